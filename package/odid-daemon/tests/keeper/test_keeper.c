/* What the keeper decides, on a simulated clock. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <signal.h>

#include "keeper/keeper.h"

#define S INT64_C(1000000)
#define MS INT64_C(1000)
#define T0 (100 * S)

static struct keeper keeper;

static void expect(enum keeper_action action, int64_t now_us)
{
    assert_int_equal(keeper_next(&keeper, now_us), action);
}

/* Nothing is to be done until then; at that instant something is. */
static void expect_at(int64_t at_us, enum keeper_action action)
{
    assert_int_equal(keeper_due_us(&keeper), at_us);
    expect(KEEPER_NOTHING, at_us - 1);
    expect(action, at_us);
}

static int set_up(void **state)
{
    (void)state;
    keeper_init(&keeper, 3 * S, 5 * S, T0);
    expect(KEEPER_START, T0);
    expect(KEEPER_NOTHING, T0);
    return 0;
}

/* A byte a second, from one instant up to another. */
static void live(int64_t from_us, int64_t to_us)
{
    for (int64_t at_us = from_us; at_us <= to_us; at_us += S) {
        keeper_alive(&keeper, at_us);
        expect(KEEPER_NOTHING, at_us);
    }
}

static void die(int signal, int64_t now_us)
{
    keeper_died(&keeper, signal, 0, now_us);
}

/* ---- silence ---- */

static void one_that_lives_is_left_alone(void **state)
{
    (void)state;
    live(T0, T0 + 3600 * S);
}

static void one_that_is_silent_for_3_s_is_killed_and_started_again_when_it_is_gone(void **state)
{
    (void)state;
    live(T0, T0 + 10 * S);
    expect_at(T0 + 13 * S, KEEPER_KILL);
    expect(KEEPER_NOTHING, T0 + 13 * S);
    die(SIGKILL, T0 + 13 * S + 5 * MS);
    expect(KEEPER_START, T0 + 13 * S + 5 * MS);
    expect(KEEPER_NOTHING, T0 + 13 * S + 5 * MS);
}

static void one_that_never_speaks_has_3_s_from_its_own_start(void **state)
{
    (void)state;
    live(T0, T0 + 2 * S);
    die(SIGSEGV, T0 + 2900 * MS);
    expect(KEEPER_START, T0 + 2900 * MS);
    expect_at(T0 + 5900 * MS, KEEPER_KILL);
}

static void what_a_killed_one_still_says_does_not_count(void **state)
{
    (void)state;
    live(T0, T0);
    expect(KEEPER_KILL, T0 + 3 * S);
    assert_false(keeper_alive(&keeper, T0 + 3 * S + MS));
    expect_at(T0 + 5 * S, KEEPER_TAKE_OFF_AIR);
}

static void the_end_of_an_outage_is_told_once(void **state)
{
    (void)state;
    assert_false(keeper_alive(&keeper, T0));
    die(SIGKILL, T0 + 500 * MS);
    expect(KEEPER_START, T0 + 500 * MS);
    assert_false(keeper_alive(&keeper, T0 + 510 * MS)); /* it may die before it sends anything */
    assert_true(keeper_alive(&keeper, T0 + 1510 * MS));
    assert_false(keeper_alive(&keeper, T0 + 2510 * MS));
}

/* ---- starting again ---- */

static void one_that_ended_is_started_at_once_whatever_the_reason(void **state)
{
    static const int signals[] = {SIGKILL, SIGSEGV, SIGXCPU, SIGTERM, 0};
    int64_t now_us = T0;

    (void)state;
    for (size_t i = 0; i < sizeof(signals) / sizeof(signals[0]); i++) {
        live(now_us, now_us + 2 * S);
        now_us += 2 * S;
        die(signals[i], now_us);
        expect(KEEPER_START, now_us);
    }
}

static void one_that_keeps_ending_at_once_is_started_once_a_second(void **state)
{
    int64_t started_us = T0 + 10 * MS;

    (void)state;
    die(SIGSEGV, T0 + 10 * MS);
    expect(KEEPER_START, started_us); /* the first time may be an accident */
    for (int i = 0; i < 4; i++) {
        keeper_alive(&keeper, started_us + 5 * MS);
        die(SIGSEGV, started_us + 10 * MS);
        expect_at(started_us + S, KEEPER_START);
        started_us += S;
    }
    live(started_us, started_us + 2 * S);
    die(SIGSEGV, started_us + 2 * S);
    expect(KEEPER_START, started_us + 2 * S); /* and when it lived for longer, at once again */
}

static void one_that_cannot_be_started_is_tried_once_a_second(void **state)
{
    (void)state;
    keeper_died(&keeper, 0, 127, T0);
    expect(KEEPER_START, T0);
    keeper_died(&keeper, 0, 127, T0);
    expect_at(T0 + S, KEEPER_START);
}

/* ---- the system-call filter ---- */

static void two_deaths_by_the_filter_within_a_minute_put_it_into_log_mode(void **state)
{
    (void)state;
    live(T0, T0 + 5 * S);
    die(SIGSYS, T0 + 5 * S);
    assert_false(keeper.log_mode);
    expect(KEEPER_START, T0 + 5 * S);
    live(T0 + 5 * S, T0 + 65 * S);
    die(SIGSYS, T0 + 65 * S);
    assert_true(keeper.log_mode);
    expect(KEEPER_START, T0 + 65 * S);
    live(T0 + 65 * S, T0 + 600 * S);
    die(SIGSEGV, T0 + 600 * S);
    assert_true(keeper.log_mode); /* it would only happen again */
}

static void deaths_by_the_filter_far_apart_or_by_others_do_not(void **state)
{
    (void)state;
    live(T0, T0 + 5 * S);
    die(SIGSYS, T0 + 5 * S);
    expect(KEEPER_START, T0 + 5 * S);
    live(T0 + 5 * S, T0 + 6 * S);
    die(SIGSEGV, T0 + 6 * S);
    expect(KEEPER_START, T0 + 6 * S);
    live(T0 + 6 * S, T0 + 66 * S);
    die(SIGSYS, T0 + 65 * S + 1);
    assert_false(keeper.log_mode);
}

/* ---- the last payload ---- */

static void after_5_s_without_a_sign_of_life_the_payload_is_taken_off_once(void **state)
{
    (void)state;
    live(T0, T0 + 10 * S);
    expect(KEEPER_KILL, T0 + 13 * S);
    die(SIGKILL, T0 + 13 * S);
    expect(KEEPER_START, T0 + 13 * S);
    expect_at(T0 + 15 * S, KEEPER_TAKE_OFF_AIR);
    expect(KEEPER_NOTHING, T0 + 15 * S);
    keeper_is_off_air(&keeper, true, T0);
    expect_at(T0 + 16 * S, KEEPER_KILL); /* the new one is silent as well */
    die(SIGKILL, T0 + 16 * S);
    expect(KEEPER_START, T0 + 16 * S);
    expect_at(T0 + 19 * S, KEEPER_KILL);
}

static void what_is_left_of_it_is_taken_off_later(void **state)
{
    (void)state;
    live(T0, T0 + 10 * S);
    expect(KEEPER_KILL, T0 + 13 * S);
    expect_at(T0 + 15 * S, KEEPER_TAKE_OFF_AIR); /* one that the kernel doesn't end */
    keeper_is_off_air(&keeper, false, T0 + 16 * S);
    expect_at(T0 + 21 * S, KEEPER_TAKE_OFF_AIR);
    keeper_is_off_air(&keeper, true, T0 + 21 * S);
    expect(KEEPER_NOTHING, T0 + 60 * S);
}

/* It spoke for a moment, and hung as the one before it. Without a pause the keeper ended itself by
 * that. */
static void nor_is_it_tried_without_a_pause_where_the_next_one_spoke(void **state)
{
    (void)state;
    live(T0, T0 + 10 * S);
    expect(KEEPER_KILL, T0 + 13 * S);
    die(SIGKILL, T0 + 13 * S);
    expect(KEEPER_START, T0 + 13 * S);
    keeper_alive(&keeper, T0 + 13 * S + S / 2);
    expect_at(T0 + 15 * S + S / 2, KEEPER_TAKE_OFF_AIR);
    keeper_is_off_air(&keeper, false, T0 + 15 * S + S / 2);
    expect_at(T0 + 16 * S + S / 2, KEEPER_KILL);
    die(SIGKILL, T0 + 16 * S + S / 2);
    expect(KEEPER_START, T0 + 16 * S + S / 2);
    expect(KEEPER_NOTHING, T0 + 17 * S);
}

static void the_next_outage_takes_it_off_again(void **state)
{
    (void)state;
    live(T0, T0);
    expect(KEEPER_KILL, T0 + 3 * S);
    expect(KEEPER_TAKE_OFF_AIR, T0 + 5 * S);
    die(SIGKILL, T0 + 5 * S);
    expect(KEEPER_START, T0 + 5 * S);
    assert_true(keeper_alive(&keeper, T0 + 6 * S)); /* before it is off: left to the daemon */
    keeper_is_off_air(&keeper, true, T0);
    expect_at(T0 + 9 * S, KEEPER_KILL);
    expect_at(T0 + 11 * S, KEEPER_TAKE_OFF_AIR);
}

/* speaks: it gives one sign of life. When the payload is taken off; 0: it isn't. */
static int64_t off_air_of_one_that_dies_ever_again(bool speaks)
{
    int64_t now_us = T0 + 10 * S, off_us = 0;

    live(T0, now_us);
    while (off_us == 0 && now_us < T0 + 30 * S) {
        switch (keeper_next(&keeper, now_us)) {
        case KEEPER_TAKE_OFF_AIR:
            off_us = now_us;
            break;
        case KEEPER_NOTHING:
            if (keeper.state == KEEPER_RUNNING) {
                if (speaks) {
                    assert_false(keeper_alive(&keeper, now_us));
                }
                die(SIGSEGV, now_us);
            }
            now_us += MS;
            break;
        default:
            break;
        }
    }
    return off_us;
}

static void one_that_dies_ever_again_before_it_speaks_is_taken_off_too(void **state)
{
    (void)state;
    assert_int_equal(off_air_of_one_that_dies_ever_again(false), T0 + 15 * S);
}

static void one_that_dies_ever_again_when_it_has_spoken_once_is_taken_off_too(void **state)
{
    (void)state;
    assert_int_equal(off_air_of_one_that_dies_ever_again(true), T0 + 15 * S);
}

/* A keeper that was killed took its daemon along, whose payload stays. */
static void what_an_earlier_keeper_left_is_taken_off(void **state)
{
    (void)state;
    expect_at(T0 + 3 * S, KEEPER_KILL);
    expect_at(T0 + 5 * S, KEEPER_TAKE_OFF_AIR);
}

/* Killed, and stuck in the kernel: no second one beside it. */
static void one_that_does_not_die_is_waited_for(void **state)
{
    (void)state;
    live(T0, T0);
    expect(KEEPER_KILL, T0 + 3 * S);
    expect(KEEPER_TAKE_OFF_AIR, T0 + 5 * S);
    keeper_is_off_air(&keeper, true, T0);
    assert_int_equal(keeper_due_us(&keeper), INT64_MAX);
    expect(KEEPER_NOTHING, T0 + 1000 * S);
    die(SIGKILL, T0 + 1000 * S);
    expect(KEEPER_START, T0 + 1000 * S);
}

/* ---- the end ---- */

static void told_to_end_it_tells_the_daemon_and_quits_after_it(void **state)
{
    (void)state;
    live(T0, T0 + 2 * S);
    keeper_end(&keeper, T0 + 2 * S);
    expect(KEEPER_TERMINATE, T0 + 2 * S);
    expect(KEEPER_NOTHING, T0 + 2 * S);
    keeper_end(&keeper, T0 + 2 * S); /* told twice, it tells once */
    expect(KEEPER_NOTHING, T0 + 2 * S);
    die(0, T0 + 2 * S + 20 * MS);
    expect(KEEPER_QUIT, T0 + 2 * S + 20 * MS);
}

static void a_daemon_that_does_not_end_is_killed_and_its_payload_taken_off(void **state)
{
    (void)state;
    live(T0, T0 + 2 * S);
    keeper_end(&keeper, T0 + 2 * S);
    expect(KEEPER_TERMINATE, T0 + 2 * S);
    keeper_alive(&keeper, T0 + 4 * S); /* alive, but doesn't obey */
    expect_at(T0 + 5 * S, KEEPER_KILL);
    die(SIGKILL, T0 + 5 * S);
    expect(KEEPER_TAKE_OFF_AIR, T0 + 5 * S);
    expect(KEEPER_NOTHING, T0 + 5 * S);
    keeper_is_off_air(&keeper, true, T0);
    expect(KEEPER_QUIT, T0 + 5 * S);
}

static void the_end_between_death_and_restart_takes_the_payload_off(void **state)
{
    (void)state;
    live(T0, T0);
    die(SIGSEGV, T0 + 10 * MS);
    expect(KEEPER_START, T0 + 10 * MS);
    die(SIGSEGV, T0 + 20 * MS);
    expect(KEEPER_NOTHING, T0 + 20 * MS);
    keeper_end(&keeper, T0 + 30 * MS);
    expect(KEEPER_TAKE_OFF_AIR, T0 + 30 * MS);
    keeper_is_off_air(&keeper, true, T0);
    expect(KEEPER_QUIT, T0 + 30 * MS);
}

static void a_death_at_the_end_that_was_not_orderly_is_seen_to(void **state)
{
    (void)state;
    live(T0, T0);
    keeper_end(&keeper, T0 + S);
    expect(KEEPER_TERMINATE, T0 + S);
    die(SIGSEGV, T0 + S + MS);
    expect(KEEPER_TAKE_OFF_AIR, T0 + S + MS);
    keeper_is_off_air(&keeper, true, T0);
    expect(KEEPER_QUIT, T0 + S + MS);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, set_up)
    const struct CMUnitTest tests[] = {
        TEST(one_that_lives_is_left_alone),
        TEST(one_that_is_silent_for_3_s_is_killed_and_started_again_when_it_is_gone),
        TEST(one_that_never_speaks_has_3_s_from_its_own_start),
        TEST(what_a_killed_one_still_says_does_not_count),
        TEST(the_end_of_an_outage_is_told_once),
        TEST(one_that_ended_is_started_at_once_whatever_the_reason),
        TEST(one_that_keeps_ending_at_once_is_started_once_a_second),
        TEST(one_that_cannot_be_started_is_tried_once_a_second),
        TEST(two_deaths_by_the_filter_within_a_minute_put_it_into_log_mode),
        TEST(deaths_by_the_filter_far_apart_or_by_others_do_not),
        TEST(after_5_s_without_a_sign_of_life_the_payload_is_taken_off_once),
        TEST(what_is_left_of_it_is_taken_off_later),
        TEST(nor_is_it_tried_without_a_pause_where_the_next_one_spoke),
        TEST(the_next_outage_takes_it_off_again),
        TEST(one_that_dies_ever_again_before_it_speaks_is_taken_off_too),
        TEST(one_that_dies_ever_again_when_it_has_spoken_once_is_taken_off_too),
        TEST(what_an_earlier_keeper_left_is_taken_off),
        TEST(one_that_does_not_die_is_waited_for),
        TEST(told_to_end_it_tells_the_daemon_and_quits_after_it),
        TEST(a_daemon_that_does_not_end_is_killed_and_its_payload_taken_off),
        TEST(the_end_between_death_and_restart_takes_the_payload_off),
        TEST(a_death_at_the_end_that_was_not_orderly_is_seen_to),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
