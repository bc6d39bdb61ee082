/* When the aircraft counts as armed, whoever says otherwise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

static bool says(bool armed)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    update.heartbeat.base_mode = armed ? MAV_MODE_FLAG_SAFETY_ARMED : 0;
    give(&update);
    look();
    return condition.armed;
}

static void landed_state(uint8_t state)
{
    struct telemetry_update update = update_of(TELEMETRY_LANDED_STATE);

    update.landed_state = state;
    give(&update);
}

/* A second passes; the simulated autopilot itself says nothing. */
static void pass(double seconds)
{
    now_us += (int64_t)(seconds * 1e6);
}

static int setup(void **state)
{
    (void)state;
    begin();
    return 0;
}

static void it_begins_at_once_and_ends_after_3_s(void **state)
{
    (void)state;
    assert_false(says(false));
    pass(1);
    assert_true(says(true));
    for (unsigned i = 0; i < 3; i++) {
        pass(1);
        assert_true(says(false));
    }
    pass(1);
    assert_false(says(false));
}

/* Disarmed HEARTBEATs among the real ones. */
static void it_does_not_end_by_contradicted_words(void **state)
{
    (void)state;
    says(true);
    for (unsigned i = 0; i < 600; i++) {
        pass(0.1);
        assert_true(says(i % 10 == 0));
    }
}

static void it_does_not_end_while_two_sources_speak(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    says(true);
    update.heartbeat.doubtful = true;
    for (unsigned i = 0; i < 60; i++) {
        pass(1);
        give(&update);
        look();
        assert_true(condition.armed);
    }
}

static void it_does_not_end_in_the_air(void **state)
{
    (void)state;
    says(true);
    for (unsigned i = 0; i < 60;
         i++) { /* also when somebody says besides that it is on the ground */
        pass(1);
        landed_state(MAV_LANDED_STATE_IN_AIR);
        landed_state(MAV_LANDED_STATE_ON_GROUND);
        assert_true(says(false));
    }
    for (unsigned i = 0; i < 7; i++) {
        pass(1);
        landed_state(MAV_LANDED_STATE_ON_GROUND);
        says(false);
    }
    assert_false(condition.armed);
}

static void it_does_not_end_in_motion(void **state)
{
    (void)state;
    sim.armed = true;
    sim.north_mps = 15;
    fly(5);
    sim.armed = false;
    fly(60);
    assert_true(condition.armed);
    sim.north_mps = 0;
    fly(8);
    assert_false(condition.armed);
}

static void it_ends_on_a_ship_that_moves(void **state)
{
    (void)state;
    sim.armed = true;
    sim.north_mps = 15;
    fly(5);
    sim.armed = false;
    for (unsigned i = 0; i < 5; i++) {
        landed_state(MAV_LANDED_STATE_ON_GROUND);
        fly(1);
    }
    assert_false(condition.armed);
}

static void silence_does_not_end_it(void **state)
{
    (void)state;
    says(true);
    pass(3600);
    look();
    assert_true(condition.armed);
    assert_true(says(false)); /* one word after an hour is one word */
    pass(3600);
    assert_true(says(false));
}

static void a_restart_of_ours_does_not_end_it(void **state)
{
    (void)state;
    aircraft_restore_armed(aircraft, true);
    look();
    assert_true(condition.armed);
    assert_true(says(false));
    for (unsigned i = 0; i < 4; i++) {
        pass(1);
        says(false);
    }
    assert_false(condition.armed);
}

/* In flight a false word would have put the take-off point where the aircraft is. */
static void the_takeoff_point_stays(void **state)
{
    double latitude_deg;

    (void)state;
    fly(5);
    arm(true);
    fly(5);
    assert_true(condition.takeoff_known);
    latitude_deg = aircraft_takeoff(aircraft)->latitude_deg;
    sim.latitude_deg += 0.01;
    fly(2);
    assert_true(says(false));
    assert_true(says(true));
    fly(2);
    assert_near(aircraft_takeoff(aircraft)->latitude_deg, latitude_deg);
}

#define TEST(name) cmocka_unit_test_setup(name, setup)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(it_begins_at_once_and_ends_after_3_s),
        TEST(it_does_not_end_by_contradicted_words),
        TEST(it_does_not_end_while_two_sources_speak),
        TEST(it_does_not_end_in_the_air),
        TEST(it_does_not_end_in_motion),
        TEST(it_ends_on_a_ship_that_moves),
        TEST(silence_does_not_end_it),
        TEST(a_restart_of_ours_does_not_end_it),
        TEST(the_takeoff_point_stays),
    };

    return cmocka_run_group_tests_name("arming", tests, NULL, NULL);
}
