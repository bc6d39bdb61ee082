/* Timestamps: the fix's own time in UTC, through everything that happens to clocks. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

#define DAY (86400 * SECOND)

/* The Location that is shown is dated as it was in truth, within 0.1 s. */
static void assert_dated(int64_t fix_us)
{
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(fix_us)) <= 0.1);
    assert_true(view.location.timestamp_s >= 0 && view.location.timestamp_s < 3600);
}

static void assert_system_time_right(void)
{
    int64_t since_2019 = (sim.utc_us + now_us) / SECOND - INT64_C(1546300800);

    assert_in_range(view.system.timestamp_2019_s, since_2019 - 1, since_2019 + 1);
    assert_true(condition.time_known);
    assert_about((double)condition.unix_us, (double)(sim.utc_us + now_us), 100000);
}

static void timestamps_are_unknown_until_the_autopilot_knows_the_time(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_SYSTEM_TIME);

    (void)state;
    sim.time = false;
    fly(5);
    assert_true(view.location.position_fresh);
    assert_unknown(view.location.timestamp_s);
    assert_int_equal(view.system.timestamp_2019_s, 0);
    assert_false(condition.time_known);
    for (unsigned i = 0; i < 10; i++) { /* from 1970 on: it has no GNSS time either */
        fly(1);
        update.system_time.boot_ms = boot_ms(now_us);
        update.system_time.unix_us = (uint64_t)update.system_time.boot_ms * 1000;
        give(&update);
    }
    fly(1);
    assert_unknown(view.location.timestamp_s);
    assert_int_equal(view.system.timestamp_2019_s, 0);
    sim.time = true;
    fly(1);
    assert_dated(now_us);
    assert_system_time_right();
}

static void time_goes_on_without_system_time(void **state)
{
    (void)state;
    fly(12);
    sim.time = false;
    fly(3600);
    assert_dated(now_us);
    assert_system_time_right();
}

/* Somebody's who speaks as an autopilot that says no time: it stayed for the whole flight. One a
 * second for twenty seconds, of which the first are in no doubt. */
static void a_few_times_that_are_said_are_not_the_time_of_the_flight(void **state)
{
    struct telemetry_update heartbeat = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    sim.heartbeat = false;
    for (unsigned i = 0; i < 60; i++) {
        sim.time = i >= 10 && i < 30;
        heartbeat.heartbeat.doubtful = i >= 15;
        give(&heartbeat);
        fly(1);
        assert_true(i < 12 || i >= 30 || condition.time_known);
    }
    assert_false(condition.time_known);
}

static void the_hour_rolls_over(void **state)
{
    double last = -1;
    bool rolled = false;

    (void)state;
    sim.utc_us = UTC - UTC % (3600 * SECOND) + 3600 * SECOND - 1010 * SECOND; /* hour at 1010 s */
    fly(5);
    for (unsigned i = 0; i < 100; i++) {
        sim.native = i % 2 == 0;
        fly(0.2);
        assert_dated(view.location.fix_us);
        rolled = rolled || view.location.timestamp_s < last;
        last = view.location.timestamp_s;
    }
    assert_true(rolled);
    assert_about(last, 15, 0.3);
}

/* Stamped in the last hour, shown in this one. */
static void a_fix_from_before_the_full_hour_keeps_its_time(void **state)
{
    (void)state;
    sim.utc_us = UTC - UTC % (3600 * SECOND) + 3600 * SECOND - 1005 * SECOND - 40 * MS;
    fly(5);
    sim.position = false;
    fly(2);
    assert_about(view.location.timestamp_s, 3599.96, 0.005);
}

static void a_step_of_utc_is_followed_after_three_messages(void **state)
{
    (void)state;
    fly(5);
    sim.utc_us += 100 * SECOND;
    fly(2);
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) > 99);
    fly(1);
    assert_dated(now_us);
    assert_system_time_right();
}

/* Said five times a second, wrong for one: nobody hears of it. */
static void utc_that_steps_for_a_second_stays(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 20; i++) {
        sim.utc_us += i == 5 ? 3600 * SECOND : i == 10 ? -3600 * SECOND : 0;
        system_time();
        fly(0.2);
        assert_about((double)condition.unix_us,
                     (double)(sim.utc_us - (i >= 5 && i < 10 ? 3600 * SECOND : 0) + now_us), 20000);
    }
}

static void the_host_clock_is_irrelevant(void **state)
{
    (void)state;
    /* The same flight at two other readings of our clock gives the same. */
    fly(20);
    assert_dated(now_us);
    for (unsigned i = 0; i < 2; i++) {
        int64_t start = i == 0 ? 1 * SECOND : INT64_C(1) << 50;

        begin();
        now_us = start;
        sim.boot_at_us = start - 400 * SECOND;
        sim.utc_us = UTC - start;
        aircraft = aircraft_init(&config, now_us);
        fly(20);
        assert_dated(now_us);
        assert_system_time_right();
    }
}

/* ---- delays ---- */

/* The daemon stood still, and then reads everything that came in the meantime. */
static void a_burst_after_a_stop_leaves_no_wrong_time(void **state)
{
    int64_t stopped_us;

    (void)state;
    fly(20);
    stopped_us = now_us;
    now_us += 20 * SECOND;
    gps();
    for (int64_t at = stopped_us + 200 * MS; at <= now_us; at += 200 * MS) {
        int64_t age_us = now_us - at;

        position_of(at);
        look();
        assert_dated(at);
        if (llabs(age_us - AIRCRAFT_FRESH_US) > 10 * MS) {
            assert_int_equal(view.location.position_fresh, age_us < AIRCRAFT_FRESH_US);
        }
    }
    assert_true(view.location.position_fresh);
    fly(1);
    assert_dated(now_us);
    assert_int_equal(condition.autopilot_restarts, 0);
}

static void a_burst_right_at_the_start_leaves_no_wrong_time(void **state)
{
    (void)state;
    for (int64_t at = now_us - 10 * SECOND; at <= now_us; at += 200 * MS) {
        position_of(at);
    }
    fly(1);
    assert_dated(now_us);
    assert_true(view.location.fix_us == now_us);
}

/* The autopilot had hardly started when the daemon stood still for longer than it had run. */
static void a_burst_soon_after_the_autopilots_start_leaves_no_wrong_time(void **state)
{
    int64_t stopped_us;

    (void)state;
    sim.boot_at_us = now_us - 2 * SECOND;
    fly(3);
    stopped_us = now_us;
    for (int64_t at = stopped_us + 200 * MS; at <= stopped_us + 20 * SECOND; at += 200 * MS) {
        struct telemetry_update update = update_of(TELEMETRY_SYSTEM_TIME);

        now_us = stopped_us + 20 * SECOND;
        gps();
        position_of(at);
        update.system_time.unix_us = (uint64_t)(sim.utc_us + at);
        update.system_time.boot_ms = boot_ms(at);
        give(&update);
    }
    fly(1);
    assert_dated(now_us);
    assert_system_time_right();
    assert_true(view.location.fix_us == now_us);
}

static void jitter_and_disorder_leave_the_time_within_a_tenth(void **state)
{
    unsigned seed = 3;

    (void)state;
    fly(5);
    for (unsigned i = 0; i < 20000; i++) {
        int64_t late_us;

        seed = seed * 1103515245U + 12345U;
        late_us = (seed >> 16) % 300 * MS;
        now_us += 50 * MS;
        position_of(now_us - late_us);
        if (i % 20 == 0) {
            gps();
            heartbeat();
            system_time();
        }
        look();
        assert_dated(view.location.fix_us);
        assert_true(view.location.fix_us <= now_us && view.location.fix_us >= now_us - 310 * MS);
    }
    assert_int_equal(condition.autopilot_restarts, 0);
}

/* ---- drift and long times ---- */

static void drift_of_either_crystal_is_within_a_tenth_for_hours(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        begin();
        sim.rate = 1 + sign * 100e-6;
        for (unsigned i = 0; i < 360; i++) {
            fly(20);
            assert_dated(now_us);
            assert_about((double)view.location.fix_us, (double)now_us, 100000);
            assert_system_time_right();
        }
        assert_int_equal(condition.autopilot_restarts, 0);
    }
}

static void two_hundred_days_go_by(void **state)
{
    (void)state;
    for (int sign = -1; sign <= 1; sign += 2) {
        int64_t end;

        begin();
        sim.rate = 1 + sign * 100e-6;
        fly(5);
        for (end = now_us + 200 * DAY; now_us < end; now_us += 120 * SECOND) {
            fly(1);
            assert_dated(now_us);
            assert_true(view.location.position_fresh);
            assert_system_time_right();
        }
        assert_int_equal(condition.autopilot_restarts, 0);
    }
}

static void the_wrap_of_boot_milliseconds_shows_nowhere(void **state)
{
    (void)state;
    gps();
    sim.boot_at_us = now_us - INT64_C(4294967296000) + 10 * SECOND;
    for (unsigned i = 0; i < 100; i++) {
        fly(0.2);
        assert_true(view.location.position_fresh);
        assert_true(view.location.fix_us == now_us);
        assert_true(i < 5 || hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    }
    assert_int_equal(condition.autopilot_restarts, 0);
}

/* ---- restarts ---- */

static void a_restarted_autopilot_is_fresh_at_its_first_position_with_a_fix(void **state)
{
    (void)state;
    for (unsigned time_first = 0; time_first < 2; time_first++) {
        begin();
        fly(20);
        silence_us(5 * SECOND);
        sim.boot_at_us = now_us - 3 * SECOND;
        if (time_first) {
            system_time();
        }
        position(); /* the fix that was known isn't of this start */
        look();
        assert_false(view.location.position_fresh);
        gps();
        look();
        assert_int_equal(condition.autopilot_restarts, 1);
        assert_true(view.location.position_fresh);
        assert_true(view.location.fix_us == now_us);
        assert_dated(now_us);
        fly(20);
        assert_dated(now_us);
        assert_int_equal(condition.autopilot_restarts, 1);
    }
}

static void a_restart_without_gnss_time_keeps_utc(void **state)
{
    (void)state;
    fly(20);
    sim.time = false;
    silence_us(5 * SECOND);
    sim.boot_at_us = now_us - 3 * SECOND;
    for (unsigned i = 0; i < 60; i++) {
        struct telemetry_update update = update_of(TELEMETRY_SYSTEM_TIME);

        fly(1);
        update.system_time.boot_ms = boot_ms(now_us);
        give(&update);
        look();
        assert_dated(now_us);
        assert_system_time_right();
    }
}

static void restarts_soon_after_each_other_are_all_noticed(void **state)
{
    (void)state;
    for (unsigned i = 1; i <= 20; i++) {
        silence_us(4 * SECOND);
        sim.boot_at_us = now_us - 2 * SECOND - i * 100 * MS;
        fly(3);
        assert_true(view.location.position_fresh);
        assert_true(view.location.fix_us == now_us);
        assert_dated(now_us);
    }
    assert_int_equal(condition.autopilot_restarts, 19); /* the first was a start */
}

static void another_vehicle_brings_its_own_boot_time(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    fly(20);
    silence_us(11 * SECOND);
    update.heartbeat.new_vehicle = true;
    update.heartbeat.mav_type = MAV_TYPE_FIXED_WING;
    give(&update);
    sim.boot_at_us = now_us - 30 * DAY;
    sim.time = false;
    fly(5);
    assert_true(view.location.position_fresh);
    assert_true(view.location.fix_us == now_us);
    assert_dated(now_us);
    assert_int_equal(condition.autopilot_restarts, 0);
}

/* ---- System.Timestamp ---- */

static void the_system_timestamp_counts_whole_seconds_since_2019(void **state)
{
    (void)state;
    fly(1);
    for (unsigned i = 0; i < 40; i++) { /* no steps of 16 s, as through a float */
        uint32_t before = view.system.timestamp_2019_s;

        fly(1);
        assert_int_equal(view.system.timestamp_2019_s, before + 1);
    }
    assert_int_equal(view.system.timestamp_2019_s,
                     (sim.utc_us + now_us) / SECOND - INT64_C(1546300800));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(timestamps_are_unknown_until_the_autopilot_knows_the_time,
                               begin_setup),
        cmocka_unit_test_setup(time_goes_on_without_system_time, begin_setup),
        cmocka_unit_test_setup(a_few_times_that_are_said_are_not_the_time_of_the_flight,
                               begin_setup),
        cmocka_unit_test_setup(the_hour_rolls_over, begin_setup),
        cmocka_unit_test_setup(a_fix_from_before_the_full_hour_keeps_its_time, begin_setup),
        cmocka_unit_test_setup(a_step_of_utc_is_followed_after_three_messages, begin_setup),
        cmocka_unit_test_setup(utc_that_steps_for_a_second_stays, begin_setup),
        cmocka_unit_test_setup(the_host_clock_is_irrelevant, begin_setup),
        cmocka_unit_test_setup(a_burst_after_a_stop_leaves_no_wrong_time, begin_setup),
        cmocka_unit_test_setup(a_burst_right_at_the_start_leaves_no_wrong_time, begin_setup),
        cmocka_unit_test_setup(a_burst_soon_after_the_autopilots_start_leaves_no_wrong_time,
                               begin_setup),
        cmocka_unit_test_setup(jitter_and_disorder_leave_the_time_within_a_tenth, begin_setup),
        cmocka_unit_test_setup(drift_of_either_crystal_is_within_a_tenth_for_hours, begin_setup),
        cmocka_unit_test_setup(two_hundred_days_go_by, begin_setup),
        cmocka_unit_test_setup(the_wrap_of_boot_milliseconds_shows_nowhere, begin_setup),
        cmocka_unit_test_setup(a_restarted_autopilot_is_fresh_at_its_first_position_with_a_fix,
                               begin_setup),
        cmocka_unit_test_setup(a_restart_without_gnss_time_keeps_utc, begin_setup),
        cmocka_unit_test_setup(restarts_soon_after_each_other_are_all_noticed, begin_setup),
        cmocka_unit_test_setup(another_vehicle_brings_its_own_boot_time, begin_setup),
        cmocka_unit_test_setup(the_system_timestamp_counts_whole_seconds_since_2019, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, time", tests, NULL, NULL);
}
