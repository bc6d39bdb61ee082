/* Which source speaks: streams as real autopilots send them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

/* What was broadcast while a stream went on, looked at 20 times a second. */
static struct {
    unsigned flips;          /* of the source of the position */
    unsigned pressure_flips; /* pressure altitude came or went */
    unsigned stale, looks;
    int64_t age_us[20 * 400]; /* of the position, at each look */
} heard;

static int by_age(const void *a, const void *b)
{
    const int64_t *first = a, *second = b;

    return *first < *second ? -1 : *first > *second;
}

static int64_t age_us(double part)
{
    qsort(heard.age_us, heard.looks, sizeof(heard.age_us[0]), by_age);
    return heard.age_us[(unsigned)((heard.looks - 1) * part)];
}

/* native_every_us: 0 for none. Each message is on its way for 20 ms, a native one for up to 340. */
static void stream(double seconds, int64_t native_every_us, int64_t telemetry_every_us)
{
    enum source last = SOURCE_NONE;
    bool pressure = false;
    unsigned n = 0;

    memset(&heard, 0, sizeof(heard));
    for (int64_t end_us = now_us + (int64_t)(seconds * 1e6); now_us < end_us; now_us += 10 * MS) {
        if (now_us % SECOND == 0) {
            heartbeat();
            system_time();
            gps();
        }
        if (telemetry_every_us != 0 && now_us % telemetry_every_us == 0) {
            position_of(now_us - 20 * MS);
        }
        if (native_every_us != 0 && now_us % native_every_us == 10 * MS) {
            struct telemetry_update update = native_of(now_us - 20 * MS - n++ % 9 * 40 * MS);

            give(&update);
        }
        if (now_us % (50 * MS) == 0) {
            look();
            heard.flips += last != SOURCE_NONE && view.location.position_source != last;
            heard.pressure_flips +=
                heard.looks > 0 && isnan(view.location.altitude_barometric_m) == pressure;
            heard.stale += !view.location.position_fresh;
            last = view.location.position_source;
            pressure = !isnan(view.location.altitude_barometric_m);
            heard.age_us[heard.looks++] = now_us - view.location.fix_us;
        }
    }
}

static int setup(void **state)
{
    begin_setup(state);
    fly(2);
    return 0;
}

/* ArduPilot's native LOCATION comes every 1.00 to 1.12 s and can't be had faster. */
static void a_slow_native_location_does_not_age_the_position(void **state)
{
    static const int64_t every_us[] = {900 * MS, 1000 * MS, 1100 * MS, 1500 * MS};
    int64_t without_us;

    stream(300, 0, 200 * MS);
    without_us = age_us(0.99);
    for (size_t i = 0; i < sizeof(every_us) / sizeof(every_us[0]); i++) {
        setup(state);
        stream(5, every_us[i], 200 * MS);
        stream(300, every_us[i], 200 * MS);
        assert_int_equal(heard.flips, 0);
        assert_int_equal(heard.pressure_flips, 0);
        assert_int_equal(heard.stale, 0);
        assert_int_equal(age_us(0.99), without_us);
        assert_true(from_telemetry());
        assert_near(view.location.altitude_barometric_m, 111); /* only native knows it */
    }
}

static void a_native_location_that_keeps_up_speaks(void **state)
{
    (void)state;
    stream(15, 200 * MS, 200 * MS);
    stream(60, 200 * MS, 200 * MS);
    assert_int_equal(heard.flips, 0);
    assert_true(from_native());
}

/* At a pace where it is now as new, now not: it doesn't change with every message. */
static void at_the_edge_of_keeping_up_the_source_stays(void **state)
{
    for (int64_t every_us = 300 * MS; every_us <= 900 * MS; every_us += 50 * MS) {
        setup(state);
        stream(15, every_us, 200 * MS);
        stream(300, every_us, 200 * MS);
        assert_true(heard.flips <= 30);
        assert_true(age_us(0.99) <= 1000 * MS);
    }
}

static void telemetry_that_is_lost_gives_way_to_the_native_location(void **state)
{
    (void)state;
    stream(30, SECOND, 200 * MS);
    assert_true(from_telemetry());
    stream(5, SECOND, 0);
    assert_true(from_native());
    assert_int_equal(heard.stale, 0);
    assert_true(age_us(1) <= 1450 * MS);
    stream(1, SECOND, 200 * MS);
    assert_true(from_telemetry());
}

static void both_at_once_a_second_are_a_second_old_at_most(void **state)
{
    (void)state;
    stream(30, SECOND, SECOND);
    stream(60, SECOND, SECOND);
    assert_int_equal(heard.flips, 0);
    assert_true(age_us(1) <= 1400 * MS);
}

/* ---- no position without a fix ---- */

/* A real ArduPlane after its start: latitude and longitude of 1e-7 degrees. */
static void an_estimator_without_a_fix_is_nowhere(void **state)
{
    (void)state;
    sim.latitude_deg = 1e-7;
    sim.longitude_deg = 7e-7;
    sim.gps = false;
    fly(20);
    assert_unknown(view.location.latitude_deg);
    assert_false(view.location.position_fresh);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    sim.gps = true;
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    fly(20);
    assert_unknown(view.location.latitude_deg);
    /* The receiver has it first; the estimator is a second behind. */
    sim.fix_type = GPS_FIX_TYPE_3D_FIX;
    sim.gps_latitude_deg = 57.7089;
    sim.gps_longitude_deg = 11.9746;
    fly(2);
    assert_unknown(view.location.latitude_deg);
    sim.latitude_deg = 57.7089;
    sim.longitude_deg = 11.9746;
    fly(1);
    assert_near(view.location.latitude_deg, 57.7089);
}

static void at_zero_with_a_fix_it_is_there(void **state)
{
    (void)state;
    sim.latitude_deg = sim.gps_latitude_deg = 0.001;
    sim.longitude_deg = sim.gps_longitude_deg = -0.001;
    fly(2);
    assert_near(view.location.latitude_deg, 0.001);
    assert_true(view.location.position_fresh);
}

static void a_fix_that_is_lost_ends_the_position_within_3_s(void **state)
{
    (void)state;
    for (unsigned silent = 0; silent < 2; silent++) {
        begin();
        fly(5);
        assert_true(condition.fix_known);
        sim.gps = !silent;
        sim.fix_type = GPS_FIX_TYPE_NO_FIX;
        fly(7);
        assert_false(condition.fix_known);
        assert_false(view.location.position_fresh);
        assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
        assert_int_equal(view.location.horizontal_accuracy, 0);
        sim.gps = true;
        sim.fix_type = GPS_FIX_TYPE_3D_FIX;
        fly(1.2);
        assert_true(view.location.position_fresh);
    }
}

/* ArduPilot goes on: the last place, its last accuracy, a timestamp that isn't known. */
static void a_native_location_without_a_fix_is_none(void **state)
{
    (void)state;
    sim.position = sim.gps = false;
    sim.time = true;
    sim.native = true;
    gps();
    fly(5);
    assert_true(view.location.position_fresh);
    sim.native = false;
    for (unsigned i = 0; i < 20; i++) {
        struct telemetry_update update = native_of(now_us);

        update.location.timestamp_s = update.location.direction_deg = NAN;
        update.location.speed_mps = i; /* something moves */
        fly(0.5);
        give(&update);
    }
    look();
    assert_false(view.location.position_fresh);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

/* A telemetry radio that sends everything every 5 s, GPS_RAW_INT last. */
static void a_burst_counts_in_any_order(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++) {
        now_us += 5 * SECOND;
        position();
        system_time();
        heartbeat();
        look();
        assert_false(view.location.position_fresh);
        now_us += 30 * MS;
        gps();
        look();
        assert_true(view.location.position_fresh);
        assert_about((double)view.location.fix_us, (double)now_us, 31000);
        assert_true(condition.time_known);
        assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    }
    now_us += 5 * SECOND; /* but not what came long before */
    position();
    now_us += 1100 * MS;
    gps();
    look();
    assert_false(view.location.position_fresh);
}

static void one_position_from_the_future_has_no_future_timestamp(void **state)
{
    (void)state;
    fly(5);
    position_of(now_us + 60 * SECOND);
    look();
    assert_true(view.location.fix_us <= now_us);
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.5);
    fly(1);
    assert_true(view.location.position_fresh);
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    assert_int_equal(condition.autopilot_restarts, 0);
}

/* ---- after a restart ---- */

/* Of the daemon, in flight: the next GPS_RAW_INT may be a second away. */
static void a_restart_of_ours_does_not_cost_the_position(void **state)
{
    (void)state;
    aircraft_restore_fix(aircraft, true, now_us);
    sim.gps = false;
    fly(0.4);
    assert_true(view.location.position_fresh);
    assert_int_equal(view.location.horizontal_accuracy, 0);
    fly(6);
    assert_false(view.location.position_fresh);
    assert_false(condition.fix_known);
}

/* Nor does one while there is no position begin anew to wait for one. */
static void a_restart_of_ours_does_not_hide_that_there_is_no_position(void **state)
{
    (void)state;
    look();
    assert_int_equal(view.location.status, AIRCRAFT_UNDECLARED);
    aircraft_restore_fix(aircraft, false, now_us);
    look();
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    fly(1.2);
    assert_true(view.location.position_fresh);
    assert_int_not_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

static void nothing_from_before_a_restart_is_its_word_after_it(void **state)
{
    struct telemetry_update id = update_of(TELEMETRY_BASIC_ID);

    (void)state;
    id.basic_id.id_type = 1;
    strcpy(id.basic_id.uas_id, "INTCJ123-4567-890");
    fly(5);
    give(&id);
    landed(MAV_LANDED_STATE_IN_AIR);
    look();
    assert_int_equal(view.basic_ids, 1);
    silence_us(2 * SECOND);
    sim.boot_at_us = now_us - SECOND;
    sim.latitude_deg = 1e-7;
    sim.gps = false;
    system_time();
    position();
    look();
    assert_int_equal(condition.autopilot_restarts, 1);
    assert_int_equal(view.basic_ids, 0);
    assert_false(condition.fix_known);
    assert_near(view.location.latitude_deg, 57.7089); /* the last that is known, as old as it is */
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

/* ---- clocks ---- */

/* A simulator that ran 20 % slow for 25 s: status 4 stayed for hours. */
static void a_clock_that_ran_slow_is_learnt_again_within_10_s(void **state)
{
    (void)state;
    fly(20);
    for (unsigned i = 0; i < 25; i++) {
        fly(1);
        sim.boot_at_us += 200 * MS;
        sim.utc_us -= 200 * MS;
    }
    fly(10);
    assert_true(view.location.position_fresh);
    assert_true(view.location.fix_us >= now_us - 100 * MS);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

static void a_time_without_a_fix_is_none(void **state)
{
    (void)state;
    sim.utc_us = INT64_C(2290000000000000); /* a PX4 without a receiver: 2042 */
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    fly(10);
    assert_false(condition.time_known);
    sim.utc_us = UTC;
    sim.fix_type = GPS_FIX_TYPE_3D_FIX;
    fly(12);
    assert_true(condition.time_known);
    assert_about((double)condition.unix_us, (double)(UTC + now_us), 20000);
    sim.fix_type = GPS_FIX_TYPE_NO_FIX; /* it goes on; and what it says otherwise doesn't count */
    sim.utc_us = INT64_C(2290000000000000);
    fly(10);
    assert_about((double)condition.unix_us, (double)(UTC + now_us), 20000);
}

/* A PX4 that has started just now: the year comes right with the fix, not before. */
static void a_time_from_before_the_fix_is_not_confirmed_by_it(void **state)
{
    (void)state;
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    for (unsigned i = 0; i < 5; i++) {
        sim.utc_us = INT64_C(2290000000000000);
        gps();
        system_time();
        position();
        now_us += 500 * MS;
        sim.fix_type = i < 4 ? GPS_FIX_TYPE_NO_FIX : GPS_FIX_TYPE_3D_FIX;
        gps();
        look();
        assert_false(condition.time_known);
        assert_unknown(view.location.latitude_deg);
        now_us += 500 * MS;
    }
    sim.utc_us = UTC;
    fly(1.2);
    assert_about((double)condition.unix_us, (double)(UTC + now_us), 20000);
}

/* Of two receivers one is dead: GPS_RAW_INT is always the first one's. */
static void a_second_receivers_fix_is_one(void **state)
{
    struct telemetry_update second = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    fly(5);
    assert_int_equal(view.location.horizontal_accuracy, 11); /* below 3 m */
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    second.gps_raw.fix_type = GPS_FIX_TYPE_3D_FIX;
    second.gps_raw.latitude_deg = second.gps_raw.longitude_deg = NAN;
    second.gps_raw.altitude_msl_m = NAN;
    second.gps_raw.horizontal_accuracy_m = 25;
    second.gps_raw.vertical_accuracy_m = 40;
    second.gps_raw.speed_accuracy_mps = 2;
    second.gps_raw.separation_m = 40;
    for (unsigned i = 0; i < 10; i++) {
        give(&second);
        fly(1);
        assert_true(view.location.position_fresh);
        assert_int_equal(view.location.horizontal_accuracy, 9); /* below 30 m: its own */
        assert_int_equal(view.location.vertical_accuracy, 2);
        assert_int_equal(view.location.speed_accuracy, 2);
        assert_near(view.location.altitude_geodetic_m, i == 0 ? 84 + 36.4 : 84 + 40);
    }
    fly(6);
    assert_false(view.location.position_fresh);
}

/* The native position was rated a second before; now its receiver has lost the fix. */
static void a_fix_that_is_lost_is_lost_for_the_native_position_too(void **state)
{
    (void)state;
    sim.native = true;
    fly(10);
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    sim.native = false;
    fly(1.1);
    assert_false(condition.fix_known);
    sim.native = true; /* it is rated still: by a receiver that isn't heard */
    fly(2.1);
    assert_true(condition.fix_known);
}

/* As a place of before: with its own time, and nothing that is true now. */
static void assert_last(double latitude_deg, int64_t fix_us)
{
    assert_false(view.location.position_fresh);
    assert_near(view.location.latitude_deg, latitude_deg);
    assert_true(view.location.fix_us == fix_us);
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(fix_us)) < 0.1);
    assert_int_equal(view.location.horizontal_accuracy, 0);
    assert_int_equal(view.location.vertical_accuracy, 0);
    assert_int_equal(view.location.speed_accuracy, 0);
    assert_unknown(view.location.speed_mps);
    assert_unknown(view.location.direction_deg);
    assert_unknown(view.location.vertical_speed_mps);
    assert_int_equal(view.location.motion_source, SOURCE_NONE);
}

/* An estimator that stands still, with a time that moves on, and a receiver that flies. */
static int64_t hang_while_the_receiver_flies(void)
{
    int64_t counted_us = 0;

    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    sim.north_mps = 10;
    fly(10);
    for (unsigned i = 0; i < 100; i++) {
        fly(0.1);
        sim.gps_latitude_deg += 1.0 / 111320; /* 10 m/s */
        counted_us = view.location.position_fresh ? view.location.fix_us : counted_us;
        if (i < 60) {
            assert_true(view.location.position_fresh);
        } else if (i > 80) {
            assert_last(sim.latitude_deg, counted_us);
            assert_true(condition.apart);
            assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
        }
    }
    return counted_us;
}

/* A LOCATION that goes on without a fix and without a time takes none from the one that counted. */
static void a_native_place_keeps_its_time(void **state)
{
    (void)state;
    fly(2);
    sim.position = false;
    for (unsigned i = 0; i < 40; i++) {
        struct telemetry_update update = native_of(now_us);

        if (i == 20) {
            sim.fix_type = GPS_FIX_TYPE_NO_FIX;
            fly(1.2); /* that is said */
        }
        if (i >= 20) {
            update.location.timestamp_s = NAN;
        }
        give(&update);
        fly(0.2);
        assert_true(i < 16 || !isnan(view.location.timestamp_s));
    }
    assert_false(view.location.position_fresh);
}

static void a_place_where_its_receiver_is_not_does_not_count(void **state)
{
    int64_t counted_us;

    (void)state;
    counted_us = hang_while_the_receiver_flies();
    sim.system_status = MAV_STATE_EMERGENCY;
    fly(1);
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    assert_last(sim.latitude_deg, counted_us);
    sim.latitude_deg = sim.gps_latitude_deg;
    fly(1.2);
    assert_true(view.location.position_fresh);
    assert_false(condition.apart);
}

/* Where somebody steers an estimator, or says where on the aircraft its receiver is. */
static void fly_with_an_offset(double offset_m, double seconds)
{
    for (double s = 0; s < seconds; s += 0.2) {
        sim.latitude_deg += 4 / 111320.0; /* 20 m/s */
        fly(0.2);
        sim.gps_latitude_deg = sim.latitude_deg - offset_m / 111320.0;
    }
}

/* It was believed for nine seconds of ten, and nobody was told. */
static void near_for_a_moment_is_not_near(void **state)
{
    unsigned said = 0;

    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    sim.north_mps = 20;
    fly_with_an_offset(0, 12);
    for (unsigned i = 0; i < 6; i++) {
        fly_with_an_offset(150, 9);
        said += condition.apart && !view.location.position_fresh;
        assert_true(i != 0 || !condition.apart);
        fly_with_an_offset(0, 2);
        assert_true(view.location.position_fresh && !condition.apart); /* it counts at once */
    }
    assert_int_equal(said, 5);
    fly_with_an_offset(0, 60); /* and is forgotten */
    fly_with_an_offset(150, 9);
    assert_true(view.location.position_fresh && !condition.apart);
}

/* Of two dimensions, too: it has a place. */
static void a_receiver_without_height_is_compared(void **state)
{
    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg + 1;
    sim.gps_longitude_deg = sim.longitude_deg;
    fly(2);
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.fix_type = GPS_FIX_TYPE_2D_FIX;
    for (unsigned i = 0; i < 20; i++) {
        fly(1);
        assert_true(view.location.position_fresh);
    }
    sim.gps_latitude_deg += 200.0 / 111320;
    fly(10);
    assert_false(view.location.position_fresh);
    assert_true(condition.apart);
}

/* It says nothing any more, or that it has no fix: it takes nothing back. */
static void a_place_that_was_contradicted_does_not_come_back_by_silence(void **state)
{
    (void)state;
    for (unsigned round = 0; round < 3; round++) {
        int64_t counted_us;

        begin();
        counted_us = hang_while_the_receiver_flies();
        sim.gps = round == 1;
        sim.fix_type = GPS_FIX_TYPE_NO_FIX;
        for (unsigned i = 0; i < 100; i++) {
            fly(0.1);
            assert_last(sim.latitude_deg, counted_us);
            if (round == 2 && i == 0) { /* nor by the autopilot's restart */
                sim.boot_at_us = now_us;
            }
        }
    }
}

static void fly_on_rated(unsigned i)
{
    struct telemetry_update rated = native_of(now_us);

    rated.location.latitude_deg = rated.location.longitude_deg = NAN;
    give(&rated);
    sim.latitude_deg += i < 30 ? 0 : 0.00002;
    fly(0.2);
}

/* A camera goes on where a receiver was wrong, and has no fix any more; the native LOCATION says
 * that there is one. */
static void a_place_that_moves_on_without_its_receiver_counts(void **state)
{
    (void)state;
    hang_while_the_receiver_flies();
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    for (unsigned i = 0; i < 60; i++) {
        fly_on_rated(i);
        assert_int_equal(view.location.position_fresh, i >= 30);
    }
    assert_true(from_telemetry());
    assert_false(condition.apart);
}

/* GPS_RAW_INT is switched off in the streams: nothing held a false place against anything. */
static void a_receiver_that_is_silenced_is_no_fix(void **state)
{
    struct telemetry_update second = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    second.gps_raw.fix_type = GPS_FIX_TYPE_NO_FIX;
    for (unsigned i = 0; i < 60; i++) {
        fly_on_rated(60);
        assert_true(i < 5 || view.location.position_fresh);
    }
    sim.gps = false;
    for (unsigned i = 0; i < 60; i++) {
        if (i >= 20 && i % 5 == 0) { /* nor where the other one says that it has none */
            give(&second);
        }
        fly_on_rated(60);
        assert_false(i > 30 && view.location.position_fresh);
    }
    assert_false(condition.fix_known);
    sim.gps = true;
    fly(1);
    assert_true(view.location.position_fresh);
}

/* Whoever they were of: somebody's who speaks as the autopilot, or its answer to somebody who
 * asked. What was never there can't fall silent, and took the position away until power-off. */
static void a_few_words_of_a_receiver_are_none_that_falls_silent(void **state)
{
    struct telemetry_update word = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    sim.gps = false;
    for (unsigned i = 0; i < 200; i++) {
        if (i == 50 || i == 55 || i == 60 || i == 100) { /* three in a row, and another one */
            give(&word);
        }
        fly_on_rated(60);
        assert_true(i < 5 || (i >= 50 && i < 70) || (i >= 100 && i < 110) ||
                    view.location.position_fresh);
    }
}

/* One a second for a minute: for ten seconds nobody has seen yet that two speak. What they say of
 * the ellipsoid doesn't stay, either. */
static void nor_are_those_of_somebody_who_speaks_as_the_autopilot(void **state)
{
    struct telemetry_update heartbeat = update_of(TELEMETRY_HEARTBEAT);
    struct telemetry_update word = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    sim.gps = sim.heartbeat = false;
    heartbeat.heartbeat.base_mode = MAV_MODE_FLAG_SAFETY_ARMED;
    word.gps_raw.separation_m = 119;
    for (unsigned i = 0; i < 500; i++) {
        if (i % 5 == 0) {
            heartbeat.heartbeat.doubtful = i >= 90;
            give(&heartbeat);
        }
        if (i >= 50 && i < 350 && i % 5 == 0) {
            give(&word);
        }
        fly_on_rated(60);
    }
    assert_true(view.location.position_fresh);
    assert_true(isnan(view.location.altitude_geodetic_m) ||
                fabs(view.location.altitude_geodetic_m - (sim.altitude_m + 119)) > 1);
}

/* Nobody had said so but the native LOCATION. */
static void a_restart_of_ours_makes_up_no_receiver(void **state)
{
    (void)state;
    sim.gps = false;
    aircraft_restore_fix(aircraft, true, now_us);
    for (unsigned i = 0; i < 60; i++) {
        fly_on_rated(60);
        assert_true(view.location.position_fresh);
    }
}

/* The first one's place walks away; the second one and the estimator agree. */
static void a_position_is_near_where_any_receiver_is(void **state)
{
    struct telemetry_update second = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    second.gps_raw.fix_type = GPS_FIX_TYPE_RTK_FIXED;
    second.gps_raw.latitude_deg = sim.gps_latitude_deg = sim.latitude_deg;
    second.gps_raw.longitude_deg = sim.gps_longitude_deg = sim.longitude_deg;
    second.gps_raw.horizontal_accuracy_m = 25;
    second.gps_raw.separation_m = second.gps_raw.altitude_msl_m = NAN;
    for (unsigned i = 0; i < 60; i++) {
        sim.gps_latitude_deg += i < 30 ? 10.0 / 111320 : 0;
        give(&second);
        fly(1);
        assert_true(i < 1 || view.location.position_fresh);
    }
    assert_int_equal(view.location.horizontal_accuracy, 9);    /* of the one that is there */
    assert_near(view.location.altitude_geodetic_m, 84 + 36.4); /* which only the first one knows */
}

/* Its driver goes on with the last fix, and the time of that. */
static void a_receiver_that_repeats_itself_has_no_fix(void **state)
{
    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    for (unsigned i = 0; i < 20; i++) {
        sim.gps_time_us += 1000000;
        fly(1);
        assert_true(i < 1 || view.location.position_fresh);
    }
    fly(7);
    assert_false(view.location.position_fresh);
    assert_false(condition.fix_known);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    sim.gps_time_us = 1; /* it has started again */
    fly(2);
    assert_true(view.location.position_fresh);
}

/* A barometer, or the estimator's altitude, that has stopped: the receiver climbs, the place moves
 * on. */
static void an_altitude_where_its_receiver_is_not_is_unknown(void **state)
{
    (void)state;
    sim.gps_altitude_m = sim.altitude_m;
    arm(true);
    fly(5);
    for (unsigned i = 0; i < 40; i++) {
        sim.latitude_deg += 10.0 / 111320;
        sim.gps_altitude_m += 5;
        fly(1);
        if (i < 12) { /* 60 m, and what it can be wrong by */
            assert_near(view.location.altitude_geodetic_m, 84 + 36.4);
        } else if (i > 19) {
            assert_true(isnan(view.location.altitude_geodetic_m) && isnan(view.location.height_m));
            assert_true(condition.altitude_apart && view.location.position_fresh);
        }
    }
    sim.altitude_m = sim.gps_altitude_m;
    fly(1.2);
    assert_near(view.location.altitude_geodetic_m, sim.altitude_m + 36.4);
    assert_false(condition.altitude_apart);
}

/* Nor does it come back when that receiver has none any more; a second one that has none says
 * nothing. */
static void an_altitude_that_was_contradicted_does_not_come_back(void **state)
{
    struct telemetry_update second = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    second.gps_raw.fix_type = GPS_FIX_TYPE_2D_FIX;
    second.gps_raw.latitude_deg = second.gps_raw.longitude_deg = NAN;
    second.gps_raw.altitude_msl_m = second.gps_raw.separation_m = NAN;
    fly(12);
    sim.gps_altitude_m = sim.altitude_m + 200;
    for (unsigned i = 0; i < 20; i++) {
        give(&second);
        fly(1);
        assert_true(i < 6 || isnan(view.location.altitude_geodetic_m));
    }
    sim.fix_type = GPS_FIX_TYPE_NO_FIX;
    fly(20);
    assert_false(view.location.position_fresh);
    assert_near(view.location.latitude_deg, sim.latitude_deg);
    assert_unknown(view.location.altitude_geodetic_m);
}

/* A long flight in falling pressure; and a receiver that is off for ten seconds. */
static void an_altitude_may_differ_from_the_receivers(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 120; i++) {
        sim.altitude_m += 0.5;
        sim.gps_altitude_m = sim.altitude_m - 50 - (i > 50 && i < 61 ? 200 : 0);
        fly(1);
        assert_near(view.location.altitude_geodetic_m, sim.altitude_m + 36.4);
    }
}

/* Air of -10 degrees, where a barometer that believes in 25 is off by an eighth of the height. */
static void a_high_flight_in_cold_air_keeps_its_altitude(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 300; i++) {
        sim.relative_m += 5;
        sim.altitude_m += 5;
        sim.gps_altitude_m = 84 + sim.relative_m * 0.87;
        fly(1);
        assert_near(view.location.altitude_geodetic_m, sim.altitude_m + 36.4);
    }
}

/* Native alone, above the sea where it should be above the ellipsoid, or as if it were in feet. */
static void a_native_altitude_where_its_receiver_is_not_is_unknown(void **state)
{
    (void)state;
    sim.native = true;
    sim.position = false;
    sim.gps_altitude_m = 84;
    fly(20);
    assert_near(view.location.altitude_geodetic_m, 125);
    sim.gps_altitude_m = 350;
    fly(20);
    assert_true(isnan(view.location.altitude_geodetic_m) && view.location.position_fresh);
}

/* It is off for ten seconds, and the estimator rightly flies on. */
static void a_receiver_that_jumps_away_for_a_while_is_not_believed(void **state)
{
    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    fly(5);
    for (unsigned i = 0; i < 300; i++) {
        sim.latitude_deg += 1.5 / 111320;
        sim.gps_latitude_deg = sim.latitude_deg + (i > 50 && i < 150 ? 120.0 / 111320 : 0);
        sim.north_mps = 15;
        fly(0.1);
        assert_true(view.location.position_fresh);
    }
}

/* A fast aircraft, and a position a second; then a receiver that knows how bad it is. */
static void a_receiver_is_near_enough(void **state)
{
    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    for (unsigned i = 0; i < 300; i++) {
        sim.gps_latitude_deg += 6.0 / 111320; /* 60 m/s */
        sim.north_mps = 60;
        if (i % 10 == 0) {
            sim.latitude_deg = sim.gps_latitude_deg;
        }
        fly(0.1);
        assert_true(i < 20 || view.location.position_fresh);
    }
    sim.north_mps = 0;
    sim.horizontal_m = 100;
    sim.latitude_deg = sim.gps_latitude_deg + 200.0 / 111320;
    fly(10);
    assert_true(view.location.position_fresh);
}

/* Everything came 2 s late for a while: UTC stays what it was when that ends. */
static void delays_that_end_do_not_bend_utc(void **state)
{
    (void)state;
    fly(20);
    now_us += 2 * SECOND;
    for (unsigned i = 0; i < 60; i++) {
        now_us += 250 * MS;
        if (i % 4 == 0) {
            gps();
        }
        position_of(now_us - 2 * SECOND);
    }
    for (unsigned i = 0; i < 20; i++) {
        now_us += 200 * MS;
        gps();
        position();
        look();
        assert_true(i < 2 || hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    }
}

/* ---- vertical speed ---- */

static void an_inverted_vertical_speed_is_set_right_and_said(void **state)
{
    (void)state;
    fly(2);
    for (unsigned i = 0; i < 50; i++) { /* ArduCopter 3.5: it climbs, and says that it sinks */
        sim.up_mps = -3;
        fly(0.2);
        sim.altitude_m += 0.6;
    }
    assert_true(condition.vertical_inverted);
    assert_near(view.location.vertical_speed_mps, 3);
}

/* Frozen but for its last digits, it was 240 m off before that was a fault. */
static void a_place_that_only_trembles_stands_still(void **state)
{
    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    sim.altitude_m = 84;
    fly(10);
    for (unsigned i = 0; i < 100; i++) {
        sim.latitude_deg += i / 2 % 2 ? 1e-7 : -1e-7;
        sim.gps_latitude_deg += 2.0 / 111320; /* 20 m/s */
        fly(0.1);
        assert_true(i < 80 || !view.location.position_fresh);
    }
    assert_true(condition.apart);
}

/* One of them stands still, and the estimator with it: nobody knew. */
static void two_receivers_in_two_places_are_told(void **state)
{
    struct telemetry_update second = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    sim.gps_latitude_deg = sim.latitude_deg;
    sim.gps_longitude_deg = sim.longitude_deg;
    second.gps_raw.fix_type = GPS_FIX_TYPE_3D_FIX;
    second.gps_raw.latitude_deg = sim.latitude_deg;
    second.gps_raw.longitude_deg = sim.longitude_deg;
    second.gps_raw.altitude_msl_m = second.gps_raw.separation_m = NAN;
    second.gps_raw.horizontal_accuracy_m = 1.5;
    for (unsigned i = 0; i < 40; i++) {
        give(&second);
        fly(1);
        second.gps_raw.latitude_deg += i < 5 ? 0 : 20 / 111320.0;
        assert_true(i >= 18 || !condition.receivers_differ);
        assert_true(i <= 25 || condition.receivers_differ);
        assert_true(view.location.position_fresh);
    }
    fly(4); /* one of them is silent */
    assert_false(condition.receivers_differ);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_slow_native_location_does_not_age_the_position, setup),
        cmocka_unit_test_setup(a_native_location_that_keeps_up_speaks, setup),
        cmocka_unit_test_setup(at_the_edge_of_keeping_up_the_source_stays, setup),
        cmocka_unit_test_setup(telemetry_that_is_lost_gives_way_to_the_native_location, setup),
        cmocka_unit_test_setup(both_at_once_a_second_are_a_second_old_at_most, setup),
        cmocka_unit_test_setup(an_estimator_without_a_fix_is_nowhere, begin_setup),
        cmocka_unit_test_setup(at_zero_with_a_fix_it_is_there, begin_setup),
        cmocka_unit_test_setup(a_fix_that_is_lost_ends_the_position_within_3_s, begin_setup),
        cmocka_unit_test_setup(a_native_location_without_a_fix_is_none, begin_setup),
        cmocka_unit_test_setup(a_burst_counts_in_any_order, begin_setup),
        cmocka_unit_test_setup(one_position_from_the_future_has_no_future_timestamp, begin_setup),
        cmocka_unit_test_setup(a_restart_of_ours_does_not_cost_the_position, begin_setup),
        cmocka_unit_test_setup(a_restart_of_ours_does_not_hide_that_there_is_no_position,
                               begin_setup),
        cmocka_unit_test_setup(nothing_from_before_a_restart_is_its_word_after_it, begin_setup),
        cmocka_unit_test_setup(a_clock_that_ran_slow_is_learnt_again_within_10_s, begin_setup),
        cmocka_unit_test_setup(a_time_without_a_fix_is_none, begin_setup),
        cmocka_unit_test_setup(a_time_from_before_the_fix_is_not_confirmed_by_it, begin_setup),
        cmocka_unit_test_setup(a_second_receivers_fix_is_one, begin_setup),
        cmocka_unit_test_setup(a_fix_that_is_lost_is_lost_for_the_native_position_too, begin_setup),
        cmocka_unit_test_setup(a_place_where_its_receiver_is_not_does_not_count, begin_setup),
        cmocka_unit_test_setup(a_native_place_keeps_its_time, begin_setup),
        cmocka_unit_test_setup(near_for_a_moment_is_not_near, begin_setup),
        cmocka_unit_test_setup(a_receiver_without_height_is_compared, begin_setup),
        cmocka_unit_test_setup(a_place_that_was_contradicted_does_not_come_back_by_silence,
                               begin_setup),
        cmocka_unit_test_setup(a_receiver_that_is_silenced_is_no_fix, begin_setup),
        cmocka_unit_test_setup(a_few_words_of_a_receiver_are_none_that_falls_silent, begin_setup),
        cmocka_unit_test_setup(nor_are_those_of_somebody_who_speaks_as_the_autopilot, begin_setup),
        cmocka_unit_test_setup(a_restart_of_ours_makes_up_no_receiver, begin_setup),
        cmocka_unit_test_setup(a_place_that_moves_on_without_its_receiver_counts, begin_setup),
        cmocka_unit_test_setup(a_place_that_only_trembles_stands_still, begin_setup),
        cmocka_unit_test_setup(two_receivers_in_two_places_are_told, begin_setup),
        cmocka_unit_test_setup(a_position_is_near_where_any_receiver_is, begin_setup),
        cmocka_unit_test_setup(a_receiver_that_jumps_away_for_a_while_is_not_believed, begin_setup),
        cmocka_unit_test_setup(a_receiver_is_near_enough, begin_setup),
        cmocka_unit_test_setup(a_receiver_that_repeats_itself_has_no_fix, begin_setup),
        cmocka_unit_test_setup(an_altitude_where_its_receiver_is_not_is_unknown, begin_setup),
        cmocka_unit_test_setup(an_altitude_that_was_contradicted_does_not_come_back, begin_setup),
        cmocka_unit_test_setup(an_altitude_may_differ_from_the_receivers, begin_setup),
        cmocka_unit_test_setup(a_high_flight_in_cold_air_keeps_its_altitude, begin_setup),
        cmocka_unit_test_setup(a_native_altitude_where_its_receiver_is_not_is_unknown, begin_setup),
        cmocka_unit_test_setup(delays_that_end_do_not_bend_utc, begin_setup),
        cmocka_unit_test_setup(an_inverted_vertical_speed_is_set_right_and_said, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, sources", tests, NULL, NULL);
}
