/* The autopilot's boot time and UTC, laid on our clock. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "daemon/autopilot_clock.h"

#define SECOND INT64_C(1000000)
#define DAY (86400 * SECOND)
#define UTC INT64_C(1790000000000000) /* 2026-09-21 */
#define LATENCY 5000                  /* the quickest way from the autopilot to us */

static struct autopilot_clock clock;

/* An autopilot on our clock: since when it runs, how fast, and UTC at our time 0. */
static int64_t boot_at_us, utc_at_us;
static double rate;

static int setup(void **state)
{
    (void)state;
    memset(&clock, 0, sizeof(clock));
    boot_at_us = 50 * SECOND;
    utc_at_us = UTC;
    rate = 1;
    return 0;
}

/* What its milliseconds since boot were at an instant of our clock. */
static uint32_t boot_ms_at(int64_t at_us)
{
    return (uint32_t)(uint64_t)((double)(at_us - boot_at_us) * rate / 1000);
}

/* A message stamped at one instant, which came at another. Returns how wrong its instant is. */
static int64_t hear_late(int64_t stamped_us, int64_t now_us, bool *restarted)
{
    int64_t instant_us = autopilot_clock_boot(&clock, boot_ms_at(stamped_us), now_us, restarted);

    assert_true(instant_us <= now_us);
    return instant_us - stamped_us;
}

static int64_t hear(int64_t stamped_us)
{
    bool restarted;

    return hear_late(stamped_us, stamped_us + LATENCY, &restarted);
}

static void tell_utc(int64_t stamped_us)
{
    autopilot_clock_utc(&clock, (uint64_t)(utc_at_us + stamped_us), boot_ms_at(stamped_us), true,
                        stamped_us + LATENCY);
}

static int64_t utc_error(int64_t at_us)
{
    return autopilot_clock_unix_us(&clock, at_us) - (utc_at_us + at_us);
}

#define assert_within(value, limit) assert_true(llabs(value) <= (limit))

/* ---- boot time ---- */

static void a_message_on_time_is_dated_within_its_latency(void **state)
{
    (void)state;
    for (int64_t at = 100 * SECOND; at < 200 * SECOND; at += 200000) {
        assert_within(hear(at), LATENCY + 1000);
    }
    assert_int_equal(clock.restarts, 0);
}

static void a_delayed_message_keeps_the_instant_of_its_stamp(void **state)
{
    bool restarted;

    (void)state;
    for (int64_t at = 100 * SECOND; at < 110 * SECOND; at += 200000) {
        hear(at);
    }
    for (int64_t late = 0; late <= 60 * SECOND; late += SECOND / 4) {
        assert_within(hear_late(110 * SECOND, 110 * SECOND + LATENCY + late, &restarted),
                      LATENCY + 20000);
        assert_false(restarted);
    }
}

/* Stopped for a minute, then everything at once. */
static void a_burst_after_a_stop_is_dated_as_it_was_stamped(void **state)
{
    bool restarted;

    (void)state;
    boot_at_us = -600 * SECOND;
    for (int64_t at = 100 * SECOND; at < 110 * SECOND; at += 200000) {
        hear(at);
    }
    for (int64_t at = 110 * SECOND; at < 170 * SECOND; at += 200000) {
        assert_within(hear_late(at, 170 * SECOND, &restarted), 100000);
        assert_false(restarted);
    }
    assert_within(hear(170 * SECOND), LATENCY + 1000);
}

/* Even when what came first was late, what comes after it on time sets it right. */
static void a_late_first_message_is_made_up_for(void **state)
{
    bool restarted;

    (void)state;
    for (int64_t at = 100 * SECOND; at < 105 * SECOND; at += 200000) {
        hear_late(at, 105 * SECOND, &restarted);
        assert_false(restarted);
    }
    assert_within(hear(105 * SECOND), LATENCY + 1000);
}

static void messages_out_of_order_are_dated_in_their_own_order(void **state)
{
    bool restarted;

    (void)state;
    for (int64_t at = 100 * SECOND; at < 200 * SECOND; at += 400000) {
        hear(at + 200000);
        assert_within(hear_late(at, at + 200000 + LATENCY, &restarted), LATENCY + 1000);
        assert_false(restarted);
    }
    /* one that took a very slow way is no restart either */
    assert_within(hear_late(190 * SECOND, 200 * SECOND, &restarted), LATENCY + 2000);
    assert_false(restarted);
    assert_int_equal(clock.restarts, 0);
    assert_within(hear(201 * SECOND), LATENCY + 1000);
}

static void either_crystal_may_be_the_faster_for_a_day(void **state)
{
    static const double rates[] = {1 - 100e-6, 1 - 20e-6, 1 + 20e-6, 1 + 100e-6};

    (void)state;
    for (size_t i = 0; i < sizeof(rates) / sizeof(rates[0]); i++) {
        unsigned seed = 7;
        bool restarted;

        setup(NULL);
        rate = rates[i];
        for (int64_t at = 100 * SECOND; at < DAY; at += 200000) {
            seed = seed * 1103515245U + 12345U;
            assert_within(hear_late(at, at + LATENCY + (seed >> 16) % 40000, &restarted), 100000);
        }
    }
}

/* At high rates the steps between two messages are small: none may get lost in rounding. */
static void drift_is_followed_at_any_message_rate(void **state)
{
    static const int64_t steps[] = {1000, 2500, 4000, 4999, 5001, 9999, 20000};

    (void)state;
    for (size_t i = 0; i < sizeof(steps) / sizeof(steps[0]); i++) {
        setup(NULL);
        rate = 1 - 100e-6;
        for (int64_t at = 100 * SECOND; at < 2500 * SECOND; at += steps[i]) {
            assert_within(hear(at), 100000);
        }
    }
}

static void drift_is_caught_up_with_after_silence(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        setup(NULL);
        rate = 1 + sign * 100e-6;
        hear(100 * SECOND);
        for (int64_t at = 3600 * SECOND; at < 3601 * SECOND; at += 200000) {
            assert_within(hear(at), 100000);
        }
    }
}

static void boot_milliseconds_wrap_after_49_7_days(void **state)
{
    (void)state;
    boot_at_us = 100 * SECOND - INT64_C(4294960000000); /* 7 s before the wrap */
    for (int64_t at = 100 * SECOND; at < 120 * SECOND; at += 200000) {
        assert_within(hear(at), LATENCY + 1000);
    }
    assert_int_equal(clock.restarts, 0);
    assert_true(clock.last_boot_us > INT64_C(4294967296000));
}

static void two_hundred_days_pass_with_drift_and_four_wraps(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        setup(NULL);
        rate = 1 + sign * 100e-6;
        for (int64_t at = 100 * SECOND; at < 200 * DAY; at += 20 * SECOND) {
            hear(at);
            assert_within(hear(at + 200000), 100000);
            utc_at_us = UTC;
            tell_utc(at + 400000);
            assert_within(utc_error(at + SECOND), 100000);
        }
        assert_int_equal(clock.restarts, 0);
    }
}

/* ---- restarts ---- */

/* Runs until one instant, is off for a time, and starts anew; heard again after a while. */
static void restart(int64_t ran_s, int64_t off_s, int64_t unheard_s)
{
    int64_t end = boot_at_us + ran_s * SECOND;
    bool restarted;

    for (int64_t at = end - (ran_s < 10 ? ran_s : 10) * SECOND; at < end; at += 200000) {
        hear(at);
    }
    boot_at_us = end + off_s * SECOND;
    assert_within(hear_late(boot_at_us + unheard_s * SECOND,
                            boot_at_us + unheard_s * SECOND + LATENCY, &restarted),
                  LATENCY + 1000);
    assert_true(restarted);
    assert_int_equal(clock.restarts, 1);
    for (int64_t at = 200000; at < 5 * SECOND; at += 200000) {
        assert_within(hear_late(boot_at_us + unheard_s * SECOND + at,
                                boot_at_us + unheard_s * SECOND + at + LATENCY, &restarted),
                      LATENCY + 1000);
        assert_false(restarted);
    }
}

static void a_restart_is_noticed_at_its_first_message(void **state)
{
    static const int64_t unheard[] = {0, 1, 3, 10, 60};

    (void)state;
    for (size_t i = 0; i < sizeof(unheard) / sizeof(unheard[0]); i++) {
        setup(NULL);
        restart(300, 2, unheard[i]);
    }
}

/* Its boot time is then ahead of what was heard last, and yet it is another one. */
static void a_restart_soon_after_the_first_start_is_noticed(void **state)
{
    (void)state;
    for (int64_t ran = 2; ran < 20; ran++) {
        for (int64_t unheard = 0; unheard < 40; unheard += 3) {
            setup(NULL);
            restart(ran, 1, unheard);
        }
    }
}

static void a_boot_time_that_stays_back_is_a_restart_at_the_third(void **state)
{
    bool restarted;

    (void)state;
    boot_at_us = -5000 * SECOND;
    hear(100 * SECOND);
    boot_at_us += 1000 * SECOND; /* a clock that was set, not a start */
    hear_late(101 * SECOND, 101 * SECOND, &restarted);
    assert_false(restarted);
    hear_late(102 * SECOND, 102 * SECOND, &restarted);
    assert_false(restarted);
    hear_late(103 * SECOND, 103 * SECOND, &restarted);
    assert_true(restarted);
    assert_within(hear(104 * SECOND), LATENCY + 1000);
}

static void utc_goes_on_over_a_restart(void **state)
{
    (void)state;
    for (int64_t at = 100 * SECOND; at < 110 * SECOND; at += SECOND) {
        tell_utc(at);
    }
    boot_at_us = 112 * SECOND;
    hear(115 * SECOND);
    assert_int_equal(clock.restarts, 1);
    assert_true(clock.utc_known);
    assert_within(utc_error(115 * SECOND), 2 * LATENCY);
    /* the restarted autopilot has no GNSS fix yet, then it has */
    autopilot_clock_utc(&clock, 0, boot_ms_at(116 * SECOND), true, 116 * SECOND + LATENCY);
    assert_within(utc_error(116 * SECOND), 2 * LATENCY);
    tell_utc(117 * SECOND);
    assert_within(utc_error(117 * SECOND), 2 * LATENCY);
}

static void utc_may_be_what_comes_first_after_a_restart(void **state)
{
    (void)state;
    tell_utc(100 * SECOND);
    tell_utc(101 * SECOND);
    boot_at_us = 103 * SECOND;
    tell_utc(106 * SECOND);
    assert_int_equal(clock.restarts, 1);
    assert_within(utc_error(106 * SECOND), 2 * LATENCY);
    assert_within(hear(107 * SECOND), LATENCY + 1000);
    assert_int_equal(clock.restarts, 1);
}

/* Who hung while the autopilot started reads its first messages late, and all at once. */
static void utc_goes_on_over_a_restart_that_was_heard_late(void **state)
{
    (void)state;
    for (int64_t late = SECOND / 4; late < 20 * SECOND; late += SECOND / 4) {
        bool restarted;

        setup(NULL);
        for (int64_t at = 100 * SECOND; at < 112 * SECOND; at += SECOND) {
            tell_utc(at);
        }
        boot_at_us = 112 * SECOND;
        for (int64_t at = 0; at <= late; at += SECOND / 4) {
            hear_late(boot_at_us + at, boot_at_us + late, &restarted);
            assert_int_equal(restarted, at == 0);
            autopilot_clock_utc(&clock, (uint64_t)(utc_at_us + boot_at_us + at),
                                boot_ms_at(boot_at_us + at), true, boot_at_us + late);
            assert_within(utc_error(boot_at_us + late), SECOND + 2 * LATENCY);
        }
        assert_within(utc_error(boot_at_us + late), 2 * LATENCY);
    }
}

/* One message alone took a slow way, and what is on time after it seems to be ahead. */
static void utc_goes_on_over_a_restart_whose_first_message_came_late(void **state)
{
    bool restarted;

    (void)state;
    for (int64_t at = 100 * SECOND; at < 110 * SECOND; at += SECOND) {
        tell_utc(at);
    }
    boot_at_us = 112 * SECOND;
    hear_late(113 * SECOND, 117 * SECOND, &restarted);
    assert_true(restarted);
    for (int64_t at = 117 * SECOND; at < 130 * SECOND; at += SECOND) {
        tell_utc(at);
        assert_within(utc_error(at), 2 * LATENCY);
    }
    assert_int_equal(clock.restarts, 1);
}

static void another_autopilot_starts_anew_and_utc_goes_on(void **state)
{
    (void)state;
    tell_utc(100 * SECOND);
    autopilot_clock_new_boot(&clock);
    assert_within(utc_error(105 * SECOND), 2 * LATENCY);
    boot_at_us = -40 * DAY;
    hear(110 * SECOND);
    assert_int_equal(clock.restarts, 0);
    assert_within(utc_error(110 * SECOND), 2 * LATENCY);
}

/* ---- UTC ---- */

static void a_time_that_is_no_gnss_time_is_ignored(void **state)
{
    static const uint64_t wrong[] = {0,
                                     1,
                                     1000000,
                                     UINT64_C(936316800000000),  /* a GPS week rollover back */
                                     UINT64_C(1262303999999999), /* just before 2010 */
                                     UINT64_C(4102444800000001), /* after 2100 */
                                     UINT64_MAX,
                                     UINT64_C(1) << 63};

    (void)state;
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        for (unsigned n = 0; n < 10; n++) {
            int64_t at = (100 + (int64_t)(10 * i + n)) * SECOND;

            autopilot_clock_utc(&clock, wrong[i], boot_ms_at(at), true, at + LATENCY);
            assert_false(clock.utc_known);
        }
    }
    tell_utc(300 * SECOND);
    assert_true(clock.utc_known);
    for (unsigned n = 1; n < 10; n++) {
        autopilot_clock_utc(&clock, 0, boot_ms_at((300 + n) * SECOND), true, (300 + n) * SECOND);
    }
    assert_within(utc_error(310 * SECOND), 2 * LATENCY);
}

static void a_step_of_utc_is_believed_at_the_third_time_in_a_row(void **state)
{
    (void)state;
    for (int64_t at = 100 * SECOND; at < 110 * SECOND; at += SECOND) {
        tell_utc(at);
    }
    for (int64_t step = -3600; step <= 3600; step += 7200) {
        utc_at_us += step * SECOND;
        tell_utc(111 * SECOND);
        tell_utc(112 * SECOND);
        assert_within(utc_error(112 * SECOND) + step * SECOND, 2 * LATENCY);
        tell_utc(113 * SECOND);
        assert_within(utc_error(113 * SECOND), 2 * LATENCY);
    }
}

static void single_wrong_times_are_no_step(void **state)
{
    (void)state;
    tell_utc(100 * SECOND);
    for (int64_t at = 101 * SECOND; at < 200 * SECOND; at += SECOND) {
        int64_t wrong = at % (3 * SECOND) == 0 ? 0 : at * 1000; /* each another one */

        utc_at_us += wrong;
        tell_utc(at);
        utc_at_us -= wrong;
        assert_within(utc_error(at), 2 * LATENCY);
    }
}

static void a_small_step_is_followed_at_once(void **state)
{
    (void)state;
    tell_utc(100 * SECOND);
    utc_at_us -= 900000;
    tell_utc(101 * SECOND);
    assert_within(utc_error(101 * SECOND), 2 * LATENCY);
}

/* A late SYSTEM_TIME names a time that was right when it was stamped. */
static void a_late_system_time_does_not_bend_utc(void **state)
{
    (void)state;
    for (int64_t at = 100 * SECOND; at < 110 * SECOND; at += SECOND) {
        tell_utc(at);
    }
    autopilot_clock_utc(&clock, (uint64_t)(utc_at_us + 110 * SECOND), boot_ms_at(110 * SECOND),
                        true, 117 * SECOND);
    assert_within(utc_error(117 * SECOND), 2 * LATENCY);
}

static void utc_holds_over_a_silence(void **state)
{
    (void)state;
    tell_utc(100 * SECOND);
    assert_within(utc_error(100 * SECOND + DAY), 2 * LATENCY);
    assert_within(utc_error(99 * SECOND), 2 * LATENCY);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_message_on_time_is_dated_within_its_latency, setup),
        cmocka_unit_test_setup(a_delayed_message_keeps_the_instant_of_its_stamp, setup),
        cmocka_unit_test_setup(a_burst_after_a_stop_is_dated_as_it_was_stamped, setup),
        cmocka_unit_test_setup(a_late_first_message_is_made_up_for, setup),
        cmocka_unit_test_setup(messages_out_of_order_are_dated_in_their_own_order, setup),
        cmocka_unit_test_setup(either_crystal_may_be_the_faster_for_a_day, setup),
        cmocka_unit_test_setup(drift_is_followed_at_any_message_rate, setup),
        cmocka_unit_test_setup(drift_is_caught_up_with_after_silence, setup),
        cmocka_unit_test_setup(boot_milliseconds_wrap_after_49_7_days, setup),
        cmocka_unit_test_setup(two_hundred_days_pass_with_drift_and_four_wraps, setup),
        cmocka_unit_test_setup(a_restart_is_noticed_at_its_first_message, setup),
        cmocka_unit_test_setup(a_restart_soon_after_the_first_start_is_noticed, setup),
        cmocka_unit_test_setup(a_boot_time_that_stays_back_is_a_restart_at_the_third, setup),
        cmocka_unit_test_setup(utc_goes_on_over_a_restart, setup),
        cmocka_unit_test_setup(utc_goes_on_over_a_restart_that_was_heard_late, setup),
        cmocka_unit_test_setup(utc_goes_on_over_a_restart_whose_first_message_came_late, setup),
        cmocka_unit_test_setup(utc_may_be_what_comes_first_after_a_restart, setup),
        cmocka_unit_test_setup(another_autopilot_starts_anew_and_utc_goes_on, setup),
        cmocka_unit_test_setup(a_time_that_is_no_gnss_time_is_ignored, setup),
        cmocka_unit_test_setup(a_step_of_utc_is_believed_at_the_third_time_in_a_row, setup),
        cmocka_unit_test_setup(single_wrong_times_are_no_step, setup),
        cmocka_unit_test_setup(a_small_step_is_followed_at_once, setup),
        cmocka_unit_test_setup(a_late_system_time_does_not_bend_utc, setup),
        cmocka_unit_test_setup(utc_holds_over_a_silence, setup),
    };

    return cmocka_run_group_tests_name("autopilot clock", tests, NULL, NULL);
}
