/* Which way an autopilot's vertical speed points: decided by what the altitude does. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "daemon/vertical.h"

#define SECOND INT64_C(1000000)

static struct vertical vertical;
static int64_t at_us;
static double altitude_m, climb_mps;

static int setup(void **state)
{
    (void)state;
    memset(&vertical, 0, sizeof(vertical));
    at_us = 400 * SECOND;
    altitude_m = 30;
    climb_mps = 0;
    return 0;
}

/* sign: 1 as MAVLink has it, -1 upside down. */
static void move(double seconds, double up_mps, int sign, double rate_hz)
{
    for (unsigned i = 0; i < (unsigned)(seconds * rate_hz); i++) {
        at_us += (int64_t)((double)SECOND / rate_hz);
        altitude_m += up_mps / rate_hz;
        vertical_position(&vertical, at_us, altitude_m, sign * up_mps);
    }
}

static void a_flight_as_mavlink_has_it_is_left_alone(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) {
        move(10, i % 2 == 0 ? 3 : -4, 1, 5);
        assert_false(vertical.inverted);
    }
    assert_true(vertical_upright_mps(&vertical, -4) < -3.9);
}

static void an_inverted_one_is_known_after_three_seconds_of_climb(void **state)
{
    static const unsigned rates[] = {1, 2, 4, 5, 10, 50};

    for (unsigned i = 0; i < sizeof(rates) / sizeof(rates[0]); i++) {
        for (int up = -3; up <= 3; up += 6) {
            setup(state);
            move(2, up, -1, rates[i]);
            assert_false(vertical.inverted);
            move(3, up, -1, rates[i]);
            assert_true(vertical.inverted);
            assert_true(fabs(vertical_upright_mps(&vertical, -up) - up) < 1e-9);
        }
    }
}

static void level_flight_decides_nothing_and_forgets_nothing(void **state)
{
    (void)state;
    move(5, 3, -1, 5);
    assert_true(vertical.inverted);
    move(600, 0.5, -1, 5);
    move(600, -0.9, 1, 5);
    assert_true(vertical.inverted);
}

/* A firmware is updated while the aircraft stands: three votes more the other way. */
static void what_was_decided_can_be_mended(void **state)
{
    (void)state;
    move(5, 3, -1, 5);
    move(10, 3, 1, 5);
    assert_false(vertical.inverted);
}

/* An estimator that jumps by 5 m now and then, while it sinks slowly. */
static void single_steps_of_altitude_decide_nothing(void **state)
{
    (void)state;
    for (int i = 0; i < 100; i++) {
        move(20, -1.5, 1, 5);
        altitude_m += 5;
    }
    assert_false(vertical.inverted);
}

static void a_climb_rate_that_contradicts_the_altitude_silences_both(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) {
        vertical_climb(&vertical, -3);
        move(1, 3, -1, 5);
    }
    assert_false(vertical.inverted);
    vertical_climb(&vertical, 3);
    move(5, 3, -1, 5);
    assert_true(vertical.inverted);
}

/* VFR_HUD isn't in the streams any more: what it said last is no witness for ever. */
static void a_climb_rate_that_stopped_silences_nobody(void **state)
{
    (void)state;
    vertical_climb(&vertical, -3);
    move(3, 3, -1, 5);
    assert_false(vertical.inverted);
    move(5, 3, -1, 5);
    assert_true(vertical.inverted);
}

/* Positions every 2.5 s: two of them are more than three seconds. */
static void nor_does_one_between_slow_positions(void **state)
{
    (void)state;
    move(2.5, 3, -1, 0.4);
    vertical_climb(&vertical, -3);
    move(12.5, 3, -1, 0.4);
    assert_true(vertical.inverted);
}

static void gaps_and_a_restarted_clock_are_no_climb(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) {
        move(0.8, 3, 1, 5);
        at_us += 30 * SECOND;
        altitude_m -= 300;
    }
    at_us = 0;
    move(0.8, 3, 1, 5);
    assert_int_equal(vertical.votes, 0);
}

static void nothing_known_is_no_vote(void **state)
{
    (void)state;
    move(5, NAN, 1, 5);
    assert_int_equal(vertical.votes, 0);
}

/* A daemon that begins in the air had the sign wrong for seconds. */
static void what_was_decided_before_a_restart_counts(void **state)
{
    struct vertical other = {.inverted = false};

    (void)state;
    vertical_restore(&other, true);
    assert_true(vertical_upright_mps(&other, -4.0) > 0);
    vertical_restore(&other, false);
    assert_true(vertical_upright_mps(&other, -4.0) < 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_flight_as_mavlink_has_it_is_left_alone, setup),
        cmocka_unit_test_setup(an_inverted_one_is_known_after_three_seconds_of_climb, setup),
        cmocka_unit_test_setup(level_flight_decides_nothing_and_forgets_nothing, setup),
        cmocka_unit_test_setup(what_was_decided_can_be_mended, setup),
        cmocka_unit_test_setup(single_steps_of_altitude_decide_nothing, setup),
        cmocka_unit_test_setup(a_climb_rate_that_contradicts_the_altitude_silences_both, setup),
        cmocka_unit_test_setup(a_climb_rate_that_stopped_silences_nobody, setup),
        cmocka_unit_test_setup(nor_does_one_between_slow_positions, setup),
        cmocka_unit_test_setup(gaps_and_a_restarted_clock_are_no_climb, setup),
        cmocka_unit_test_setup(nothing_known_is_no_vote, setup),
        cmocka_unit_test(what_was_decided_before_a_restart_counts),
    };

    return cmocka_run_group_tests_name("vertical speed", tests, NULL, NULL);
}
