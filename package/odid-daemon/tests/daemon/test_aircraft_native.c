/* Native LOCATION and SYSTEM messages, and the habits of those who send them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

/* ---- LOCATION ---- */

static void every_native_field_is_taken_as_it_is(void **state)
{
    (void)state;
    sim.autopilot = MAV_AUTOPILOT_GENERIC;
    sim.native = true;
    fly(5);
    assert_near(view.location.latitude_deg, 58.7089);
    assert_near(view.location.longitude_deg, 11.9746);
    assert_near(view.location.direction_deg, 123);
    assert_near(view.location.speed_mps, 7);
    assert_near(view.location.vertical_speed_mps, -2);
    assert_near(view.location.altitude_barometric_m, 111);
    assert_near(view.location.altitude_geodetic_m, 125);
    assert_near(view.location.height_m, 3);
    assert_int_equal(view.location.horizontal_accuracy, 12);
    assert_int_equal(view.location.vertical_accuracy, 6);
    assert_int_equal(view.location.barometer_accuracy, 5);
    assert_int_equal(view.location.speed_accuracy, 4);
    assert_int_equal(view.location.timestamp_accuracy, 3);
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.01);
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
}

/* After a restart of the autopilot its altitude and its height were unknown for a moment. */
static void a_native_fix_confirms_the_position_of_the_same_burst(void **state)
{
    struct telemetry_update update;

    (void)state;
    begin();
    position();
    look();
    assert_false(view.location.position_fresh);
    update = native_of(now_us);
    update.location.height_m = NAN;
    give(&update);
    look();
    assert_near(view.location.height_m, sim.relative_m);
}

/* Somebody's, a kilometre away, or as much above it: it stood until the aircraft moved, and was
 * neither armed nor on the air with a place, or with an altitude. */
static void one_word_of_a_receiver_contradicts_nobody_that_stands_still(void **state)
{
    struct telemetry_update word = update_of(TELEMETRY_GPS_RAW), said = native_of(now_us);

    (void)state;
    sim.position = sim.gps = false;
    word.gps_raw.fix_type = GPS_FIX_TYPE_3D_FIX;
    word.gps_raw.horizontal_accuracy_m = word.gps_raw.vertical_accuracy_m = 1;
    word.gps_raw.separation_m = 0;
    for (unsigned i = 0; i < 120; i++) {
        said = native_of(now_us);
        give(&said);
        if (i % 60 == 10) {
            word.gps_raw.latitude_deg = said.location.latitude_deg + (i == 10 ? 0.01 : 0);
            word.gps_raw.longitude_deg = said.location.longitude_deg;
            word.gps_raw.altitude_msl_m = said.location.altitude_geodetic_m + (i == 10 ? 0 : 1000);
            give(&word);
        }
        fly(1);
        assert_true(view.location.position_fresh);
        assert_near(view.location.altitude_geodetic_m, said.location.altitude_geodetic_m);
        assert_false(condition.apart || condition.altitude_apart);
    }
}

static void a_frozen_native_timestamp_is_not_fresh(void **state)
{
    int64_t frozen_us;

    (void)state;
    sim.native = true;
    sim.position = false;
    fly(5);
    sim.native = false;
    frozen_us = now_us;
    for (unsigned i = 0; i < 15; i++) {
        struct telemetry_update update = native_of(frozen_us);

        update.location.latitude_deg += 0.001 * i;
        now_us += 200 * MS;
        give(&update);
        if (now_us % SECOND == 0) {
            heartbeat();
        }
    }
    look();
    assert_false(view.location.position_fresh);
    assert_true(from_native()); /* the newest that is known, as old as it says */
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(frozen_us)) < 0.02);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

static void without_a_timestamp_any_change_is_fresh(void **state)
{
    struct telemetry_update update;

    (void)state;
    sim.position = false;
    fly(5);
    update = native_of(now_us);
    update.location.timestamp_s = NAN;
    give(&update);
    look();
    assert_true(view.location.position_fresh);
    assert_unknown(view.location.timestamp_s);
    assert_int_equal(view.location.timestamp_accuracy, 0);
    for (unsigned i = 0; i < 16; i++) {
        fly(0.2);
        give(&update);
    }
    look();
    assert_false(view.location.position_fresh);
    update.location.latitude_deg += 1e-7;
    give(&update);
    look();
    assert_true(view.location.position_fresh);
}

static void native_messages_out_of_order_do_not_move_it_back(void **state)
{
    struct telemetry_update late;

    (void)state;
    sim.native = true;
    fly(5);
    late = native_of(now_us - 400 * MS);
    late.location.latitude_deg = 10;
    give(&late);
    look();
    assert_true(from_native());
}

static void a_native_clock_that_was_set_back_is_followed(void **state)
{
    (void)state;
    sim.native = true;
    fly(5);
    sim.native_ahead_s = -60; /* a minute old, it says */
    fly(1);
    assert_true(from_telemetry());
    sim.native_ahead_s = 0;
    fly(11); /* it has to keep up for a while before it speaks again */
    assert_true(from_native());
}

static void a_native_fix_over_the_full_hour_is_fresh(void **state)
{
    (void)state;
    sim.utc_us = UTC - UTC % (3600 * SECOND) + 3600 * SECOND - 1010 * SECOND; /* hour at 1010 s */
    sim.native = true;
    fly(5);
    for (unsigned i = 0; i < 50; i++) {
        fly(0.2);
        assert_true(from_native());
        assert_true(view.location.position_fresh);
        assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.02);
    }
}

/* ---- ArduPilot: GPS time without the leap seconds ---- */

static void leap_seconds_are_corrected_once_seen_three_times(void **state)
{
    (void)state;
    for (double leap = 17; leap <= 19; leap++) {
        for (int64_t late_us = 0; late_us <= 500 * MS; late_us += 100 * MS) {
            begin();
            sim.native_ahead_s = leap;
            sim.position = false;
            fly(3);
            for (unsigned i = 0; i < 20; i++) {
                struct telemetry_update update;

                fly(1);
                update = native_of(now_us - late_us);
                give(&update);
                look();
                assert_true(from_native());
                if (i < 2) {
                    assert_unknown(view.location.timestamp_s);
                    assert_int_equal(view.location.timestamp_accuracy, 0);
                } else {
                    assert_true(hour_apart_s(view.location.timestamp_s,
                                             true_hour_s(now_us - late_us)) < 0.1);
                    assert_int_equal(view.location.timestamp_accuracy, 3);
                }
            }
        }
    }
}

/* All that was known of UTC had come late: the lead seemed larger than it is, for a moment. */
static void leap_seconds_that_were_measured_wrong_are_set_right(void **state)
{
    struct telemetry_update time = update_of(TELEMETRY_SYSTEM_TIME);

    (void)state;
    sim.native = true;
    sim.native_ahead_s = 18;
    sim.time = sim.position = false;
    time.system_time.unix_us = (uint64_t)(sim.utc_us + now_us);
    time.system_time.boot_ms = boot_ms(now_us);
    now_us += 400 * MS;
    give(&time);
    fly(2);
    sim.time = true;
    fly(5);
    for (unsigned i = 0; i < 50; i++) {
        fly(0.2);
        assert_true(from_native());
        assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    }
}

static void corrected_timestamps_hold_over_the_full_hour(void **state)
{
    (void)state;
    sim.utc_us = UTC - UTC % (3600 * SECOND) + 3600 * SECOND - 1040 * SECOND; /* hour at 1040 s */
    sim.native = true;
    sim.native_ahead_s = 18;
    fly(5);
    for (unsigned i = 0; i < 300; i++) {
        fly(0.2);
        assert_true(from_native());
        assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    }
}

/* Neither read as fresh nor taken for another habit of the sender. */
static void a_late_message_does_not_undo_the_leap_seconds(void **state)
{
    (void)state;
    for (int64_t late_s = 1; late_s <= 10; late_s++) {
        struct telemetry_update late, receiver = update_of(TELEMETRY_GPS_RAW);

        begin();
        sim.native = true;
        sim.native_ahead_s = 18;
        sim.position = false;
        fly(5);
        sim.native = false;
        now_us += 10 * SECOND;
        late = native_of(now_us - late_s * SECOND);
        receiver.gps_raw.fix_type = GPS_FIX_TYPE_3D_FIX;
        receiver.gps_raw.latitude_deg = receiver.gps_raw.longitude_deg = NAN;
        give(&receiver);
        give(&late);
        look();
        assert_int_equal(view.location.position_fresh, late_s < 3);
        assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us - late_s * SECOND)) <
                    0.1);
        sim.native = true;
        fly(0.2);
        assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
    }
}

static void a_sender_that_learns_the_leap_seconds_is_believed(void **state)
{
    (void)state;
    sim.native = true;
    sim.native_ahead_s = 18;
    fly(5);
    sim.native_ahead_s = 0;
    fly(1);
    assert_true(from_native());
    assert_true(view.location.position_fresh);
    assert_true(hour_apart_s(view.location.timestamp_s, true_hour_s(now_us)) < 0.1);
}

static void another_lead_is_no_leap_second_but_unknown(void **state)
{
    static const double ahead[] = {1.5, 5, 15, 20, 37, 600, 1700};

    (void)state;
    for (size_t i = 0; i < sizeof(ahead) / sizeof(ahead[0]); i++) {
        begin();
        sim.native = true;
        sim.native_ahead_s = ahead[i];
        fly(10);
        assert_true(from_native());
        assert_unknown(view.location.timestamp_s);
    }
}

static void without_utc_a_native_timestamp_is_not_trusted(void **state)
{
    (void)state;
    sim.native = true;
    sim.time = false;
    fly(5);
    assert_true(from_native());
    assert_true(view.location.position_fresh);
    assert_unknown(view.location.timestamp_s);
}

/* ---- PX4 ---- */

static void px4s_geodetic_altitude_is_above_mean_sea_level(void **state)
{
    (void)state;
    sim.autopilot = MAV_AUTOPILOT_PX4;
    sim.native = true;
    sim.altitude_m = 130; /* five metres apart: each can be told */
    fly(5);
    assert_near(view.location.altitude_geodetic_m, 125 + 36.4);
    begin();
    sim.autopilot = MAV_AUTOPILOT_PX4;
    sim.native = true;
    sim.gps = false;
    fly(5);
    assert_unknown(view.location.altitude_geodetic_m);
}

/* Whatever the habits of an autopilot of that name were: its GNSS receiver says which one it is. */
static void a_native_altitude_that_contradicts_telemetry_is_not_broadcast(void **state)
{
    static const struct {
        uint8_t autopilot;
        double native_m;
        bool differs;
    } cases[] = {
        {MAV_AUTOPILOT_ARDUPILOTMEGA, 84, true}, /* above the sea */
        {MAV_AUTOPILOT_ARDUPILOTMEGA, 84 - 36.4, true},
        {MAV_AUTOPILOT_ARDUPILOTMEGA, 84 + 36.4, false},
        {MAV_AUTOPILOT_PX4, 84 + 36.4, true}, /* a newer one, that has it right */
        {MAV_AUTOPILOT_PX4, 84, false},
    };

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        begin();
        sim.autopilot = cases[i].autopilot;
        for (unsigned j = 0; j < 25; j++) {
            struct telemetry_update update = native_of(now_us);

            update.location.altitude_geodetic_m = cases[i].native_m;
            give(&update);
            fly(0.2);
        }
        assert_true(from_native());
        assert_about(view.location.altitude_geodetic_m, 84 + 36.4, 1e-6);
        assert_int_equal(condition.altitudes_differ, cases[i].differs);
    }
}

/* Where both fell silent, the one that wasn't believed was, for the moment by which it was newer.
 */
static void nor_is_it_once_telemetry_is_gone(void **state)
{
    (void)state;
    sim.autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA;
    for (unsigned i = 0; i < 50; i++) {
        struct telemetry_update update = native_of(now_us);

        sim.position = i < 25;
        update.location.altitude_geodetic_m = 84;
        give(&update);
        fly(0.2);
    }
    assert_true(from_native());
    assert_true(condition.altitudes_differ && isnan(view.location.altitude_geodetic_m));
}

/* Nor while telemetry stops for a moment in a dive, as over the autopilot's restart: it has climbed
 * down to where the other one is said to be. */
static void nor_is_it_where_a_dive_hides_it(void **state)
{
    (void)state;
    sim.autopilot = MAV_AUTOPILOT_PX4;
    sim.altitude_m = 900;
    sim.up_mps = -20;
    for (unsigned i = 0; i < 60; i++) {
        sim.position = i < 51;
        if (i % 5 == 0) {
            struct telemetry_update update = native_of(now_us);

            update.location.altitude_geodetic_m = sim.altitude_m + 36.4; /* one that has it right */
            give(&update);
        }
        sim.altitude_m -= 4;
        fly(0.2);
        assert_true(i < 10 || condition.altitudes_differ);
    }
}

/* Native once a second, in a dive: what lies between the two instants is no contradiction. */
static void in_a_dive_two_altitudes_may_differ(void **state)
{
    (void)state;
    sim.altitude_m = 900;
    sim.up_mps = -20;
    for (unsigned i = 0; i < 150; i++) {
        if (i % 5 == 0) {
            struct telemetry_update update = native_of(now_us);

            update.location.altitude_geodetic_m = sim.altitude_m + 36.4;
            give(&update);
        }
        sim.altitude_m -= 4;
        fly(0.2);
        assert_false(condition.altitudes_differ);
    }
}

static void a_pressure_altitude_that_no_weather_gives_is_unknown(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = native_of(now_us);
    update.location.altitude_barometric_m = 1200; /* 950 hPa at sea level, and less than that */
    give(&update);
    look();
    assert_near(view.location.altitude_barometric_m, 1200);
    now_us += 200 * MS;
    update = native_of(now_us);
    update.location.altitude_barometric_m = 2000;
    give(&update);
    look();
    assert_unknown(view.location.altitude_barometric_m);
    assert_int_equal(view.location.barometer_accuracy, 0);
}

static void px4s_barometric_altitude_of_0_is_unknown(void **state)
{
    struct telemetry_update update;

    (void)state;
    for (unsigned px4 = 0; px4 < 2; px4++) {
        begin();
        sim.autopilot = px4 ? MAV_AUTOPILOT_PX4 : MAV_AUTOPILOT_ARDUPILOTMEGA;
        fly(5);
        update = native_of(now_us);
        update.location.altitude_barometric_m = 0;
        give(&update);
        look();
        assert_int_equal(isnan(view.location.altitude_barometric_m), px4);
        now_us += 200 * MS;
        native();
        look();
        assert_near(view.location.altitude_barometric_m, 111);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(every_native_field_is_taken_as_it_is, begin_setup),
        cmocka_unit_test_setup(a_native_fix_confirms_the_position_of_the_same_burst, begin_setup),
        cmocka_unit_test_setup(one_word_of_a_receiver_contradicts_nobody_that_stands_still,
                               begin_setup),
        cmocka_unit_test_setup(a_frozen_native_timestamp_is_not_fresh, begin_setup),
        cmocka_unit_test_setup(without_a_timestamp_any_change_is_fresh, begin_setup),
        cmocka_unit_test_setup(native_messages_out_of_order_do_not_move_it_back, begin_setup),
        cmocka_unit_test_setup(a_native_clock_that_was_set_back_is_followed, begin_setup),
        cmocka_unit_test_setup(a_native_fix_over_the_full_hour_is_fresh, begin_setup),
        cmocka_unit_test_setup(leap_seconds_are_corrected_once_seen_three_times, begin_setup),
        cmocka_unit_test_setup(leap_seconds_that_were_measured_wrong_are_set_right, begin_setup),
        cmocka_unit_test_setup(corrected_timestamps_hold_over_the_full_hour, begin_setup),
        cmocka_unit_test_setup(a_late_message_does_not_undo_the_leap_seconds, begin_setup),
        cmocka_unit_test_setup(a_sender_that_learns_the_leap_seconds_is_believed, begin_setup),
        cmocka_unit_test_setup(another_lead_is_no_leap_second_but_unknown, begin_setup),
        cmocka_unit_test_setup(without_utc_a_native_timestamp_is_not_trusted, begin_setup),
        cmocka_unit_test_setup(px4s_geodetic_altitude_is_above_mean_sea_level, begin_setup),
        cmocka_unit_test_setup(a_native_altitude_that_contradicts_telemetry_is_not_broadcast,
                               begin_setup),
        cmocka_unit_test_setup(nor_is_it_once_telemetry_is_gone, begin_setup),
        cmocka_unit_test_setup(nor_is_it_where_a_dive_hides_it, begin_setup),
        cmocka_unit_test_setup(in_a_dive_two_altitudes_may_differ, begin_setup),
        cmocka_unit_test_setup(a_pressure_altitude_that_no_weather_gives_is_unknown, begin_setup),
        cmocka_unit_test_setup(px4s_barometric_altitude_of_0_is_unknown, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, native location", tests, NULL, NULL);
}
