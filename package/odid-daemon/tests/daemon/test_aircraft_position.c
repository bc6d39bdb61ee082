/* Position, motion and status: which source speaks, how fresh it is, what it means. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

/* ---- freshness and priority ---- */

static void nothing_is_known_at_first(void **state)
{
    (void)state;
    look();
    assert_unknown(view.location.latitude_deg);
    assert_unknown(view.location.longitude_deg);
    assert_unknown(view.location.altitude_barometric_m);
    assert_unknown(view.location.altitude_geodetic_m);
    assert_unknown(view.location.height_m);
    assert_unknown(view.location.direction_deg);
    assert_unknown(view.location.speed_mps);
    assert_unknown(view.location.vertical_speed_mps);
    assert_unknown(view.location.timestamp_s);
    assert_unknown(view.system.operator_latitude_deg);
    assert_unknown(view.system.operator_longitude_deg);
    assert_unknown(view.system.operator_altitude_m);
    assert_int_equal(view.system.timestamp_2019_s, 0);
    assert_int_equal(view.location.horizontal_accuracy, 0);
    assert_int_equal(view.location.status, AIRCRAFT_UNDECLARED);
    assert_true(view.location.fix_us == INT64_MIN);
    assert_int_equal(view.basic_ids, 0);
    assert_int_equal(view.auth_pages, 0);
    assert_false(view.self_id_set);
    assert_string_equal(view.operator_id, "");
    assert_int_equal(view.location.position_source, SOURCE_NONE);
}

static void telemetry_alone_gives_a_position(void **state)
{
    (void)state;
    fly(2);
    assert_int_equal(view.location.position_source, SOURCE_TELEMETRY);
    assert_int_equal(view.location.motion_source, SOURCE_TELEMETRY);
    assert_true(view.location.position_fresh);
    assert_near(view.location.latitude_deg, 57.7089);
    assert_near(view.location.longitude_deg, 11.9746);
    assert_unknown(view.location.altitude_barometric_m); /* no pressure altitude in it */
    assert_true(view.location.fix_us == now_us);
}

static void a_position_is_fresh_for_less_than_3_s(void **state)
{
    (void)state;
    fly(2);
    silence_us(2999 * MS);
    assert_true(view.location.position_fresh);
    assert_int_equal(view.location.motion_source, SOURCE_TELEMETRY);
    silence_us(1 * MS);
    assert_false(view.location.position_fresh);
    assert_int_equal(view.location.motion_source, SOURCE_NONE);
}

static void a_position_that_stopped_keeps_its_own_timestamp(void **state)
{
    int64_t last_us;
    double timestamp_s;

    (void)state;
    sim.north_mps = 20;
    fly(5);
    last_us = now_us;
    timestamp_s = view.location.timestamp_s;
    assert_about(timestamp_s, true_hour_s(last_us), 0.01);
    sim.position = false;
    fly(2.9);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    assert_near(view.location.speed_mps, 20);
    fly(0.1);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_near(view.location.latitude_deg, 57.7089);
    assert_about(view.location.timestamp_s, timestamp_s, 0.01);
    assert_unknown(view.location.speed_mps);
    assert_unknown(view.location.direction_deg);
    assert_unknown(view.location.vertical_speed_mps);
    assert_int_equal(view.location.speed_accuracy, 0);
    assert_int_equal(view.location.horizontal_accuracy, 0); /* the receiver's is of now */
    assert_int_equal(view.location.vertical_accuracy, 0);
    fly(600);
    assert_near(view.location.latitude_deg, 57.7089);
    assert_about(view.location.timestamp_s, timestamp_s, 0.1);
    assert_true(view.location.fix_us == last_us);
}

/* Its timestamp says when within the hour: nothing would tell it from a fresh one. */
static void a_native_place_of_before_has_no_accuracy_of_now(void **state)
{
    (void)state;
    sim.position = false;
    sim.native = true;
    fly(5);
    assert_int_not_equal(view.location.horizontal_accuracy, 0);
    sim.native = false;
    fly(3.2);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_near(view.location.latitude_deg, 58.7089);
    assert_int_equal(view.location.horizontal_accuracy, 0);
    assert_int_equal(view.location.vertical_accuracy, 0);
}

static void a_position_of_an_hour_ago_is_not_said_any_more(void **state)
{
    (void)state;
    fly(5);
    sim.position = false;
    fly(3580);
    assert_near(view.location.latitude_deg, 57.7089);
    fly(30);
    assert_unknown(view.location.latitude_deg);
    assert_unknown(view.location.timestamp_s);
}

static void packets_with_a_frozen_timestamp_are_not_fresh(void **state)
{
    int64_t frozen_us;

    (void)state;
    fly(5);
    frozen_us = now_us;
    sim.position = false;
    for (unsigned i = 0; i < 30; i++) {
        fly(0.2);
        sim.latitude_deg += 0.001; /* even if the values move */
        position_of(frozen_us);
    }
    look();
    assert_false(view.location.position_fresh);
    assert_near(view.location.latitude_deg, 57.7089);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    sim.position = true;
    fly(0.2);
    assert_true(view.location.position_fresh);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

static void a_timestamp_that_never_moves_gives_one_position(void **state)
{
    (void)state;
    sim.position = false;
    sim.time = false;
    for (unsigned i = 0; i < 50; i++) {
        fly(0.2);
        position_of(sim.boot_at_us); /* time_boot_ms 0 */
    }
    look();
    assert_false(view.location.position_fresh);
}

static void a_native_position_that_keeps_up_wins_and_again_10_s_after_its_return(void **state)
{
    (void)state;
    sim.native = true;
    fly(5);
    assert_true(from_native());
    assert_int_equal(view.location.position_source, SOURCE_NATIVE);
    assert_int_equal(view.location.motion_source, SOURCE_NATIVE);
    assert_int_equal(view.location.status_source, SOURCE_NATIVE);
    sim.native = sim.position = false;
    fly(2.8);
    silence_us(199 * MS);
    assert_true(from_native());
    silence_us(1 * MS);
    assert_false(view.location.position_fresh);
    sim.position = true;
    fly(0.2);
    assert_true(from_telemetry());
    assert_int_equal(view.location.position_source, SOURCE_TELEMETRY);
    assert_int_equal(view.location.motion_source, SOURCE_TELEMETRY);
    assert_int_equal(view.location.status_source, SOURCE_TELEMETRY);
    sim.native = true;
    fly(9.8);
    assert_true(from_telemetry());
    fly(0.4);
    assert_true(from_native());
}

/* It is the newest when it comes, and whether the next one is on time isn't known. */
static void the_first_native_position_does_not_speak_beside_telemetry(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = native_of(now_us);
    give(&update);
    fly(0.2);
    assert_true(from_telemetry());
    assert_true(now_us - view.location.fix_us <= 200 * MS);
    fly(0.2);
    update = native_of(now_us);
    give(&update);
    look();
    assert_true(from_native());
}

/* One that is lost must not age what is sent. */
static void a_native_position_that_stops_gives_way_to_a_newer_one(void **state)
{
    (void)state;
    sim.native = true;
    fly(5);
    sim.native = false;
    fly(0.6);
    assert_true(from_native());
    fly(0.2);
    assert_true(from_telemetry());
    assert_int_equal(view.location.motion_source, SOURCE_TELEMETRY);
    assert_true(now_us - view.location.fix_us <= 200 * MS);
}

/* A field, not a message, is what is known or not. */
static void telemetry_fills_what_a_native_location_leaves_unknown(void **state)
{
    struct telemetry_update update;

    (void)state;
    sim.north_mps = 10;
    sim.up_mps = 1.5;
    sim.relative_m = 44;
    sim.native = true;
    fly(5);
    sim.native = false;
    fly(0.2);
    update = native_of(now_us);
    update.location.height_m = update.location.altitude_geodetic_m = NAN;
    update.location.direction_deg = update.location.vertical_speed_mps = NAN;
    update.location.horizontal_accuracy = update.location.speed_accuracy = 0;
    give(&update);
    look();
    assert_true(from_native());
    assert_near(view.location.height_m, 44);
    assert_near(view.location.altitude_geodetic_m, sim.altitude_m + sim.separation_m);
    assert_near(view.location.altitude_barometric_m, 111);
    assert_near(view.location.direction_deg, 0);
    assert_near(view.location.speed_mps, 7);
    assert_near(view.location.vertical_speed_mps, 1.5);
    assert_int_equal(view.location.horizontal_accuracy, 11);
    assert_int_equal(view.location.vertical_accuracy, 6);
    assert_int_equal(view.location.speed_accuracy, 3);
}

static void when_both_stopped_the_newer_position_is_kept(void **state)
{
    (void)state;
    sim.native = true;
    fly(5);
    sim.native = false;
    fly(1);
    sim.position = false;
    fly(10);
    assert_true(from_telemetry());
    sim.native = true;
    fly(1);
    sim.native = false;
    fly(10);
    assert_true(from_native());
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_unknown(view.location.speed_mps);
}

static void messages_out_of_order_do_not_move_it_back(void **state)
{
    (void)state;
    fly(5);
    now_us += 100 * MS;
    sim.latitude_deg += 0.5;
    position();
    sim.latitude_deg -= 0.5;
    position_of(now_us - 150 * MS);
    sim.latitude_deg += 0.5;
    look();
    assert_true(from_telemetry());
    assert_true(view.location.fix_us == now_us);
}

static void the_bench_position_speaks_only_when_nothing_else_does(void **state)
{
    (void)state;
    config.bench_latitude_deg = 57.5;
    config.bench_longitude_deg = 11.5;
    look();
    assert_near(view.location.latitude_deg, 57.5);
    assert_int_equal(view.location.position_source, SOURCE_CONFIGURATION);
    assert_unknown(view.location.timestamp_s);
    assert_int_not_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    fly(5);
    assert_true(from_telemetry());
    assert_int_equal(view.location.position_source, SOURCE_TELEMETRY);
}

/* It took the lost place's place, and status 4 with it. */
static void a_bench_position_is_not_where_an_aircraft_was_lost(void **state)
{
    (void)state;
    config.bench_latitude_deg = 57.5;
    config.bench_longitude_deg = 11.5;
    fly(5);
    sim.fix_type = 1;
    gps();
    fly(4);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_int_not_equal(view.location.position_source, SOURCE_CONFIGURATION);
}

/* ---- what makes no position ---- */

static void a_position_without_a_fix_is_none(void **state)
{
    (void)state;
    for (uint8_t fix_type = 0; fix_type <= 8; fix_type++) {
        begin();
        sim.fix_type = fix_type;
        gps();
        fly(2);
        assert_int_equal(view.location.position_fresh, fix_type >= 2);
        assert_int_equal(isnan(view.location.latitude_deg), fix_type < 2);
    }
}

static void a_position_that_loses_its_fix_goes_stale(void **state)
{
    (void)state;
    fly(5);
    sim.fix_type = 1;
    gps();
    fly(2.8);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    fly(0.2);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

/* A stream of GPS_RAW_INT that is switched off: it is asked for (asking.h). */
static void without_word_of_a_fix_there_is_no_position(void **state)
{
    (void)state;
    sim.gps = false;
    fly(20);
    assert_unknown(view.location.latitude_deg);
    sim.gps = true;
    fly(1);
    assert_true(from_telemetry());
}

static void a_position_of_0_0_is_none(void **state)
{
    (void)state;
    fly(5);
    sim.latitude_deg = sim.longitude_deg = NAN; /* as telemetry says it */
    fly(3);
    assert_near(view.location.latitude_deg, 57.7089);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

static void a_native_location_without_position_leaves_it_to_telemetry(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 5; i++) {
        struct telemetry_update update = native_of(now_us);

        update.location.latitude_deg = update.location.longitude_deg = NAN;
        give(&update);
        fly(0.2);
    }
    assert_true(from_telemetry());
    assert_int_equal(view.location.motion_source, SOURCE_TELEMETRY);
}

/* A GPS that comes back after 25 days: boot milliseconds, seen as signed, would have gone back. */
static void a_position_returns_after_any_time_without(void **state)
{
    static const int64_t days[] = {1, 20, 24, 25, 30, 40, 49, 50, 60, 75};

    (void)state;
    for (size_t i = 0; i < sizeof(days) / sizeof(days[0]); i++) {
        int64_t end;

        begin();
        fly(5);
        for (end = now_us + days[i] * 86400 * SECOND; now_us < end; now_us += 600 * SECOND) {
            heartbeat();
            gps();
            system_time();
        }
        fly(1);
        assert_true(view.location.position_fresh);
        assert_true(view.location.fix_us == now_us);
    }
}

/* ---- motion ---- */

static void course_and_speed_come_from_the_velocity(void **state)
{
    static const struct {
        double north, east, course, speed;
    } cases[] = {
        {10, 0, 0, 10},     {0, 10, 90, 10},       {-10, 0, 180, 10},         {0, -10, 270, 10},
        {3, 4, 53.1301, 5}, {-3, -4, 233.1301, 5}, {5, -0.0001, 359.9989, 5}, {0.3, 0, 0, 0.3}};

    (void)state;
    gps();
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        sim.north_mps = cases[i].north;
        sim.east_mps = cases[i].east;
        fly(0.2);
        assert_about(view.location.speed_mps, cases[i].speed, 1e-4);
        assert_about(view.location.direction_deg, cases[i].course, 1e-3);
        assert_true(view.location.direction_deg >= 0 && view.location.direction_deg < 360);
    }
}

static void the_course_is_unknown_below_0_3_m_per_s(void **state)
{
    (void)state;
    gps();
    sim.north_mps = 0.29;
    fly(0.2);
    assert_unknown(view.location.direction_deg);
    assert_near(view.location.speed_mps, 0.29);
    sim.north_mps = 0;
    fly(0.2);
    assert_unknown(view.location.direction_deg);
    assert_near(view.location.speed_mps, 0);
}

static void climbing_is_positive(void **state)
{
    (void)state;
    gps();
    sim.up_mps = 2.5;
    fly(0.2);
    assert_near(view.location.vertical_speed_mps, 2.5);
    sim.up_mps = -1.5;
    fly(0.2);
    assert_near(view.location.vertical_speed_mps, -1.5);
}

/* ---- geodetic altitude and accuracies ---- */

static void the_geodetic_altitude_is_above_the_ellipsoid(void **state)
{
    (void)state;
    fly(2);
    assert_near(view.location.altitude_geodetic_m, 84 + 36.4);
}

static void without_a_separation_the_geodetic_altitude_is_unknown(void **state)
{
    (void)state;
    sim.gps = false;
    fly(2);
    assert_unknown(view.location.altitude_geodetic_m);
    sim.gps = true;
    sim.separation_m = NAN;
    fly(2);
    assert_unknown(view.location.altitude_geodetic_m);
    sim.separation_m = 36.4;
    sim.fix_type = 2; /* a 2D fix has no altitude worth the name */
    fly(2);
    assert_unknown(view.location.altitude_geodetic_m);
    sim.fix_type = 3;
    fly(12);
    assert_near(view.location.altitude_geodetic_m, 84 + 36.4);
    sim.gps = false; /* the geoid stays where it is */
    fly(20);
    assert_near(view.location.altitude_geodetic_m, 84 + 36.4);
}

/* It went with a place that was a second newer, and not with the height beside it. */
static void a_native_altitude_s_separation_serves_where_no_receiver_says_one(void **state)
{
    (void)state;
    sim.gps = false;
    sim.up_mps = 5;
    for (unsigned i = 0; i < 50; i++) {
        if (i % 5 == 2) {
            struct telemetry_update once_a_second = native_of(now_us);

            once_a_second.location.altitude_geodetic_m = (float)(sim.altitude_m + 36.4);
            give(&once_a_second);
        }
        sim.altitude_m += 1;
        fly(0.2);
        if (i > 10) {
            assert_true(from_telemetry());
            assert_true(fabs(view.location.altitude_geodetic_m - (sim.altitude_m + 36.4)) < 0.1);
        }
    }
}

/* Somebody else's, where the receiver knows none: a false altitude was broadcast until power-off,
 * and a native one that was right was not. */
static void a_separation_that_was_said_once_does_not_stay(void **state)
{
    (void)state;
    sim.native = true;
    sim.separation_m = NAN;
    fly(5);
    assert_near(view.location.altitude_geodetic_m, 125);
    sim.separation_m = 110;
    gps();
    sim.separation_m = NAN;
    fly(1);
    assert_true(condition.altitudes_differ);
    fly(3);
    assert_false(condition.altitudes_differ);
    assert_near(view.location.altitude_geodetic_m, 125);
    sim.native = false;
    fly(4);
    assert_unknown(view.location.altitude_geodetic_m);
}

/* A second receiver knew it for a while, and is gone: one word was the ellipsoid for the flight. */
static void a_separation_that_lasts_gives_way_to_no_single_word(void **state)
{
    struct telemetry_update second = update_of(TELEMETRY_GPS2_RAW);

    (void)state;
    sim.separation_m = NAN;
    second.gps_raw.fix_type = GPS_FIX_TYPE_3D_FIX;
    second.gps_raw.latitude_deg = sim.latitude_deg;
    second.gps_raw.longitude_deg = sim.longitude_deg;
    second.gps_raw.altitude_msl_m = sim.altitude_m;
    second.gps_raw.horizontal_accuracy_m = second.gps_raw.vertical_accuracy_m = 2;
    second.gps_raw.separation_m = 36.4;
    for (unsigned i = 0; i < 15; i++) {
        give(&second);
        fly(1);
    }
    fly(20);
    second.gps_raw.separation_m = -80;
    give(&second);
    for (unsigned i = 0; i < 60; i++) {
        fly(1);
        assert_near(view.location.altitude_geodetic_m, sim.altitude_m + 36.4);
    }
}

static void accuracies_follow_the_tables_of_the_standard(void **state)
{
    static const struct {
        double horizontal, vertical, speed;
        uint8_t h, v, s;
    } cases[] = {{0.9, 0.9, 0.29, 12, 6, 4}, {2.9, 2.9, 0.9, 11, 5, 3}, {9.9, 9.9, 2.9, 10, 4, 2},
                 {29, 24, 9.9, 9, 3, 1},     {92, 44, 11, 8, 2, 0},     {185, 149, 50, 7, 1, 0},
                 {19000, 151, 50, 0, 0, 0},  {NAN, NAN, NAN, 0, 0, 0}};

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        sim.horizontal_m = cases[i].horizontal;
        sim.vertical_m = cases[i].vertical;
        sim.speed_mps = cases[i].speed;
        fly(1);
        assert_int_equal(view.location.horizontal_accuracy, cases[i].h);
        assert_int_equal(view.location.vertical_accuracy, cases[i].v);
        assert_int_equal(view.location.speed_accuracy, cases[i].s);
    }
}

static void accuracies_that_stopped_are_unknown(void **state)
{
    (void)state;
    fly(2);
    assert_int_not_equal(view.location.horizontal_accuracy, 0);
    sim.gps = false;
    fly(3);
    assert_int_equal(view.location.horizontal_accuracy, 0);
    assert_int_equal(view.location.vertical_accuracy, 0);
    assert_int_equal(view.location.speed_accuracy, 0);
}

static void the_rate_of_positions_is_measured(void **state)
{
    (void)state;
    fly(1);
    assert_unknown(condition.position_rate_hz);
    fly(2);
    assert_about(condition.position_rate_hz, 5, 0.01);
    sim.position = false;
    for (unsigned i = 0; i < 30; i++) { /* native ones, once in 1.1 s */
        struct telemetry_update update;

        fly(1.1);
        update = native_of(now_us);
        give(&update);
        look();
    }
    assert_about(condition.position_rate_hz, 1 / 1.1, 0.01);
    fly(60);
    assert_near(condition.position_rate_hz, 0);
}

/* An estimator that sends no velocity: 20 m/s over ground went out as 0, 5 m/s up as level. */
static void a_speed_of_0_of_what_moves_is_unknown(void **state)
{
    (void)state;
    arm(true);
    for (unsigned i = 0; i < 60; i++) {
        sim.latitude_deg += 4.0 / 111320;
        sim.altitude_m += 1;
        fly(0.2);
        assert_true(i < 12 || isnan(view.location.speed_mps));
        assert_true(i < 25 || isnan(view.location.vertical_speed_mps));
    }
    assert_true(condition.speed_wrong);
    sim.north_mps = 20;
    sim.up_mps = 5;
    fly(1);
    assert_near(view.location.speed_mps, 20);
    assert_near(view.location.vertical_speed_mps, 5);
    assert_false(condition.speed_wrong);
    sim.north_mps = sim.up_mps = 0; /* it hovers, and what is said of its place trembles */
    for (unsigned i = 0; i < 120; i++) {
        sim.latitude_deg += (i % 2 ? 5.0 : -5.0) / 111320;
        fly(1);
        assert_near(view.location.speed_mps, 0);
        assert_near(view.location.vertical_speed_mps, 0);
    }
    assert_false(condition.speed_wrong);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(nothing_is_known_at_first, begin_setup),
        cmocka_unit_test_setup(telemetry_alone_gives_a_position, begin_setup),
        cmocka_unit_test_setup(a_position_is_fresh_for_less_than_3_s, begin_setup),
        cmocka_unit_test_setup(a_position_that_stopped_keeps_its_own_timestamp, begin_setup),
        cmocka_unit_test_setup(a_native_place_of_before_has_no_accuracy_of_now, begin_setup),
        cmocka_unit_test_setup(a_position_of_an_hour_ago_is_not_said_any_more, begin_setup),
        cmocka_unit_test_setup(packets_with_a_frozen_timestamp_are_not_fresh, begin_setup),
        cmocka_unit_test_setup(a_timestamp_that_never_moves_gives_one_position, begin_setup),
        cmocka_unit_test_setup(a_native_position_that_keeps_up_wins_and_again_10_s_after_its_return,
                               begin_setup),
        cmocka_unit_test_setup(the_first_native_position_does_not_speak_beside_telemetry,
                               begin_setup),
        cmocka_unit_test_setup(a_native_position_that_stops_gives_way_to_a_newer_one, begin_setup),
        cmocka_unit_test_setup(telemetry_fills_what_a_native_location_leaves_unknown, begin_setup),
        cmocka_unit_test_setup(when_both_stopped_the_newer_position_is_kept, begin_setup),
        cmocka_unit_test_setup(messages_out_of_order_do_not_move_it_back, begin_setup),
        cmocka_unit_test_setup(the_bench_position_speaks_only_when_nothing_else_does, begin_setup),
        cmocka_unit_test_setup(a_bench_position_is_not_where_an_aircraft_was_lost, begin_setup),
        cmocka_unit_test_setup(a_position_without_a_fix_is_none, begin_setup),
        cmocka_unit_test_setup(a_position_that_loses_its_fix_goes_stale, begin_setup),
        cmocka_unit_test_setup(without_word_of_a_fix_there_is_no_position, begin_setup),
        cmocka_unit_test_setup(a_position_of_0_0_is_none, begin_setup),
        cmocka_unit_test_setup(a_native_location_without_position_leaves_it_to_telemetry,
                               begin_setup),
        cmocka_unit_test_setup(a_position_returns_after_any_time_without, begin_setup),
        cmocka_unit_test_setup(course_and_speed_come_from_the_velocity, begin_setup),
        cmocka_unit_test_setup(the_course_is_unknown_below_0_3_m_per_s, begin_setup),
        cmocka_unit_test_setup(climbing_is_positive, begin_setup),
        cmocka_unit_test_setup(the_geodetic_altitude_is_above_the_ellipsoid, begin_setup),
        cmocka_unit_test_setup(without_a_separation_the_geodetic_altitude_is_unknown, begin_setup),
        cmocka_unit_test_setup(a_separation_that_was_said_once_does_not_stay, begin_setup),
        cmocka_unit_test_setup(a_separation_that_lasts_gives_way_to_no_single_word, begin_setup),
        cmocka_unit_test_setup(a_native_altitude_s_separation_serves_where_no_receiver_says_one,
                               begin_setup),
        cmocka_unit_test_setup(accuracies_follow_the_tables_of_the_standard, begin_setup),
        cmocka_unit_test_setup(accuracies_that_stopped_are_unknown, begin_setup),
        cmocka_unit_test_setup(the_rate_of_positions_is_measured, begin_setup),
        cmocka_unit_test_setup(a_speed_of_0_of_what_moves_is_unknown, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, position and motion", tests, NULL, NULL);
}
