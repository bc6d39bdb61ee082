/* Which system is the vehicle, where another one than the expected one flies: the board was moved,
 * or a system id changed. What a stream does with it is in test_telemetry.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "daemon/vehicle.h"

#define SECOND INT64_C(1000000)
#define OLD 9      /* of the last power-on */
#define OURS 1     /* the one that flies */
#define STRANGER 2 /* is heard by the autopilot's radio */

static struct vehicle vehicle;
static int64_t now_us;

static void power_on(void)
{
    now_us = 10 * SECOND;
    vehicle_init(&vehicle);
    vehicle_expect(&vehicle, OLD, false, now_us);
}

static void one_frame(uint8_t system, bool armed)
{
    vehicle_heartbeat(&vehicle, system, armed, now_us);
}

/* Each second a HEARTBEAT and more. */
static void speaks_for(uint8_t system, bool armed, unsigned seconds)
{
    for (; seconds > 0; seconds--, now_us += SECOND) {
        one_frame(system, armed);
        vehicle_speaks(&vehicle, system, now_us);
    }
}

static void ours_flies(void)
{
    speaks_for(OURS, false, 20);
    speaks_for(OURS, true, 600);
    assert_int_equal(vehicle.system, OURS);
}

static int five_minutes_on_the_ground(void **state)
{
    (void)state;
    power_on();
    now_us += SECOND;
    speaks_for(OURS, false, 300);
    assert_int_equal(vehicle.system, OURS);
    return 0;
}

/* It took the place of ours for good, on the ground and in the air, and "armed" with it. */
static void one_frame_of_the_old_id_takes_no_flight(void **state)
{
    (void)state;
    one_frame(OLD, true);
    ours_flies();
    one_frame(OLD, true);
    assert_int_equal(vehicle.system, OURS);
}

/* Ours wasn't the one that was there first: that was still the old one, which was never heard. */
static void a_stranger_while_it_restarts_takes_no_flight(void **state)
{
    (void)state;
    for (unsigned second = 0; second < 15; second++) {
        one_frame(STRANGER, false);
        if (second >= 12) {
            speaks_for(OURS, false, 1);
        } else {
            now_us += SECOND;
        }
    }
    one_frame(STRANGER, true); /* it takes off, and is gone */
    ours_flies();
}

/* Right before it arms, and again and again in the air: it was seen disarmed before the first one.
 */
static void nor_do_more_of_them_in_the_air(void **state)
{
    (void)state;
    one_frame(OLD, true);
    now_us += SECOND;
    for (unsigned i = 0; i < 150; i++) {
        speaks_for(OURS, true, 4);
        one_frame(OLD, i % 2 == 0);
        assert_true(i < 2 || vehicle.system == OURS);
    }
}

/* Its take-off point went with that, for the flight. */
static void a_stranger_after_our_restart_is_not_the_expected_one(void **state)
{
    (void)state;
    vehicle_init(&vehicle);
    vehicle_expect(&vehicle, OLD, true, now_us);
    one_frame(OLD, true);
    now_us += 1600000;
    one_frame(STRANGER, false);
    assert_int_equal(vehicle.system, OLD);
}

/* The old one itself has time until another one takes off. */
static void the_expected_one_may_come_late(void **state)
{
    (void)state;
    one_frame(OLD, false);
    assert_int_equal(vehicle.system, OLD);
    speaks_for(OLD, false, 10);
    one_frame(OURS, false);
    assert_int_equal(vehicle.system, OLD);
}

/* The id was changed five minutes ago, and ours is silent for 5 s. */
static void nor_does_one_of_the_id_that_it_had_before(void **state)
{
    (void)state;
    power_on();
    speaks_for(OLD, false, 60);
    speaks_for(OURS, false, 300);
    now_us += 4 * SECOND;
    one_frame(OLD, true);
    now_us += SECOND;
    ours_flies();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_frame_of_the_old_id_takes_no_flight, five_minutes_on_the_ground),
        cmocka_unit_test_setup(a_stranger_while_it_restarts_takes_no_flight,
                               five_minutes_on_the_ground),
        cmocka_unit_test_setup(nor_do_more_of_them_in_the_air, five_minutes_on_the_ground),
        cmocka_unit_test(a_stranger_after_our_restart_is_not_the_expected_one),
        cmocka_unit_test_setup(the_expected_one_may_come_late, five_minutes_on_the_ground),
        cmocka_unit_test(nor_does_one_of_the_id_that_it_had_before),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
