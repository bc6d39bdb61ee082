/* MAVLink fields -> physical units, with each message's own words for "unknown". */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "telemetry_recorder.h"

#define assert_near(a, b) assert_true(fabs((a) - (b)) < 1e-6)

static int setup(void **state)
{
    (void)state;
    begin_with_vehicle();
    return 0;
}

/* ---- plain telemetry ---- */

static void a_position_comes_in_degrees_metres_and_up_positive(void **state)
{
    (void)state;
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    assert_int_equal(latest()->kind, TELEMETRY_GLOBAL_POSITION);
    assert_int_equal(latest()->global_position.boot_ms, 123456);
    assert_near(latest()->global_position.latitude_deg, 57.7089);
    assert_near(latest()->global_position.longitude_deg, -11.9746);
    assert_near(latest()->global_position.altitude_msl_m, 120.5);
    assert_near(latest()->global_position.relative_altitude_m, 100.25);
    assert_near(latest()->global_position.north_mps, 3);
    assert_near(latest()->global_position.east_mps, -4);
    assert_near(latest()->global_position.up_mps, 1.5); /* vz is positive down */
}

static void latitude_and_longitude_0_mean_unknown_only_together(void **state)
{
    mavlink_global_position_int_t position = {.time_boot_ms = 1};

    (void)state;
    feed(frame_global_position_int(VEHICLE, AUTOPILOT, &position));
    assert_true(isnan(latest()->global_position.latitude_deg));
    assert_true(isnan(latest()->global_position.longitude_deg));
    position.lat = 1;
    feed(frame_global_position_int(VEHICLE, AUTOPILOT, &position));
    assert_near(latest()->global_position.latitude_deg, 1e-7);
    assert_true(latest()->global_position.longitude_deg == 0);
    position.lat = 0;
    position.lon = -1;
    feed(frame_global_position_int(VEHICLE, AUTOPILOT, &position));
    assert_true(latest()->global_position.latitude_deg == 0);
    assert_near(latest()->global_position.longitude_deg, -1e-7);
}

static void a_place_that_is_nowhere_on_earth_is_unknown(void **state)
{
    static const struct {
        int32_t latitude, longitude;
        bool known;
    } cases[] = {
        {900000000, 1800000000, true}, {-900000000, -1800000000, true}, {900000001, 0, false},
        {-900000001, 0, false},        {0, 1800000001, false},          {0, -1800000001, false},
        {INT32_MAX, INT32_MAX, false}, {INT32_MIN, INT32_MIN, false},
    };

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        const mavlink_global_position_int_t position = {.lat = cases[i].latitude,
                                                        .lon = cases[i].longitude};
        const mavlink_open_drone_id_location_t location = {.latitude = cases[i].latitude,
                                                           .longitude = cases[i].longitude};

        feed(frame_global_position_int(VEHICLE, AUTOPILOT, &position));
        assert_int_equal(!isnan(latest()->global_position.latitude_deg), cases[i].known);
        assert_int_equal(!isnan(latest()->global_position.longitude_deg), cases[i].known);
        feed(frame_open_drone_id_location(VEHICLE, AUTOPILOT, &location));
        assert_int_equal(!isnan(latest()->location.latitude_deg), cases[i].known);
        assert_int_equal(!isnan(latest()->location.longitude_deg), cases[i].known);
    }
}

static void the_extremes_of_a_position_are_read_without_overflow(void **state)
{
    mavlink_global_position_int_t position = {.lat = INT32_MIN,
                                              .lon = INT32_MAX,
                                              .alt = INT32_MIN,
                                              .relative_alt = INT32_MAX,
                                              .vx = INT16_MIN,
                                              .vy = INT16_MAX,
                                              .vz = INT16_MIN};

    (void)state;
    feed(frame_global_position_int(VEHICLE, AUTOPILOT, &position));
    assert_near(latest()->global_position.altitude_msl_m, -2147483.648);
    assert_near(latest()->global_position.north_mps, -327.68);
    assert_near(latest()->global_position.up_mps, 327.68);
}

static void system_time_keeps_all_its_bits(void **state)
{
    const mavlink_system_time_t time = {.time_unix_usec = 1790000000123456U,
                                        .time_boot_ms = UINT32_MAX};

    (void)state;
    feed(frame_system_time(VEHICLE, AUTOPILOT, &time));
    assert_int_equal(latest()->kind, TELEMETRY_SYSTEM_TIME);
    assert_true(latest()->system_time.unix_us == 1790000000123456U);
    assert_int_equal(latest()->system_time.boot_ms, UINT32_MAX);
}

/* Any component may send one, with a clock of its own. */
static void system_time_counts_from_the_autopilot_only(void **state)
{
    const mavlink_system_time_t time = {.time_unix_usec = 1790000000123456U};

    (void)state;
    assert_int_equal(feed(frame_system_time(VEHICLE, MAV_COMP_ID_ONBOARD_COMPUTER, &time)), 0);
    assert_int_equal(feed(frame_system_time(GROUND_STATION, AUTOPILOT, &time)), 0);
    assert_int_equal(feed(frame_system_time(VEHICLE, AUTOPILOT, &time)), 1);
}

static void gps_accuracies_come_in_metres_with_0_and_absent_unknown(void **state)
{
    mavlink_gps_raw_int_t raw = {.fix_type = 3,
                                 .alt = 84000,
                                 .alt_ellipsoid = 120400,
                                 .h_acc = 1250,
                                 .v_acc = 2500,
                                 .vel_acc = 300};

    (void)state;
    feed(frame_gps_raw_int(VEHICLE, AUTOPILOT, &raw));
    assert_int_equal(latest()->kind, TELEMETRY_GPS_RAW);
    assert_int_equal(latest()->gps_raw.fix_type, 3);
    assert_near(latest()->gps_raw.separation_m, 36.4);
    assert_near(latest()->gps_raw.horizontal_accuracy_m, 1.25);
    assert_near(latest()->gps_raw.vertical_accuracy_m, 2.5);
    assert_near(latest()->gps_raw.speed_accuracy_mps, 0.3);
    raw.alt_ellipsoid = 0;
    raw.h_acc = raw.v_acc = raw.vel_acc = 0;
    feed(frame_gps_raw_int(VEHICLE, AUTOPILOT, &raw));
    assert_true(isnan(latest()->gps_raw.separation_m));
    assert_true(isnan(latest()->gps_raw.horizontal_accuracy_m));
    assert_true(isnan(latest()->gps_raw.vertical_accuracy_m));
    assert_true(isnan(latest()->gps_raw.speed_accuracy_mps));
    raw.h_acc = raw.v_acc = raw.vel_acc = UINT32_MAX;
    feed(frame_gps_raw_int(VEHICLE, AUTOPILOT, &raw));
    assert_true(isnan(latest()->gps_raw.horizontal_accuracy_m));
}

/* MAVLink 1 has no extension fields. */
static void a_mavlink_1_gps_message_has_no_accuracies(void **state)
{
    const mavlink_gps_raw_int_t raw = {.fix_type = 3, .alt_ellipsoid = 5, .h_acc = 5, .v_acc = 5};

    (void)state;
    frames_are(1, false);
    feed(frame_gps_raw_int(VEHICLE, AUTOPILOT, &raw));
    assert_int_equal(latest()->gps_raw.fix_type, 3);
    assert_true(isnan(latest()->gps_raw.separation_m));
    assert_true(isnan(latest()->gps_raw.horizontal_accuracy_m));
}

/* One of the two altitudes is above something else, or nobody filled it. */
static void a_separation_that_is_nowhere_on_earth_is_unknown(void **state)
{
    static const struct {
        int32_t sea_mm, ellipsoid_mm;
        double separation_m;
    } cases[] = {{INT32_MIN, INT32_MAX, NAN},
                 {100000, 221000, NAN},
                 {100000, -21000, NAN},
                 {100000, 185400, 85.4},
                 {100000, -6900, -106.9}};

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        const mavlink_gps_raw_int_t raw = {
            .fix_type = 3, .alt = cases[i].sea_mm, .alt_ellipsoid = cases[i].ellipsoid_mm};
        double separation_m;

        setup(state);
        feed(frame_gps_raw_int(VEHICLE, AUTOPILOT, &raw));
        separation_m = latest()->gps_raw.separation_m;
        assert_true(isnan(cases[i].separation_m)
                        ? isnan(separation_m)
                        : fabs(separation_m - cases[i].separation_m) < 1e-6);
    }
}

/* What a ground station's commands are answered isn't ours; MAVLink 1 doesn't say whose an answer
 * is. */
static void an_answer_counts_when_it_is_ours(void **state)
{
    static const struct {
        unsigned version;
        uint8_t system, component;
        bool ours;
    } cases[] = {{2, VEHICLE, 236, true}, {2, VEHICLE, 190, false}, {2, 99, 0, false},
                 {2, 0, 0, false},        {2, 99, 236, false},      {1, 0, 0, true}};

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        const mavlink_command_ack_t ack = {.command = MAV_CMD_SET_MESSAGE_INTERVAL,
                                           .result = MAV_RESULT_DENIED,
                                           .target_system = cases[i].system,
                                           .target_component = cases[i].component};

        frames_are(cases[i].version, false);
        assert_int_equal(feed(frame_command_ack(VEHICLE, AUTOPILOT, &ack)), cases[i].ours);
    }
}

static void a_crash_is_read_of_the_autopilots_text(void **state)
{
    mavlink_statustext_t text = {.severity = MAV_SEVERITY_EMERGENCY, .text = "Crash: Disarming"};

    (void)state;
    assert_int_equal(feed(frame_statustext(VEHICLE, AUTOPILOT, &text)), 1);
    assert_int_equal(latest()->kind, TELEMETRY_CRASHED);
    text.severity = MAV_SEVERITY_CRITICAL;
    assert_int_equal(feed(frame_statustext(VEHICLE, AUTOPILOT, &text)), 0);
    text.severity = MAV_SEVERITY_EMERGENCY;
    strcpy(text.text, "No crash");
    assert_int_equal(feed(frame_statustext(VEHICLE, AUTOPILOT, &text)), 0);
}

static void home_and_landed_state_are_read(void **state)
{
    const mavlink_home_position_t home = {
        .latitude = 577089000, .longitude = 119746000, .altitude = 12500};
    const mavlink_home_position_t nowhere = {.altitude = 12500};
    const mavlink_extended_sys_state_t landed = {.vtol_state = 1, .landed_state = 2};

    (void)state;
    feed(frame_home_position(VEHICLE, AUTOPILOT, &home));
    assert_int_equal(latest()->kind, TELEMETRY_HOME);
    assert_near(latest()->home.latitude_deg, 57.7089);
    assert_near(latest()->home.longitude_deg, 11.9746);
    assert_near(latest()->home.altitude_msl_m, 12.5);
    feed(frame_home_position(VEHICLE, AUTOPILOT, &nowhere));
    assert_true(isnan(latest()->home.latitude_deg));
    feed(frame_extended_sys_state(VEHICLE, AUTOPILOT, &landed));
    assert_int_equal(latest()->kind, TELEMETRY_LANDED_STATE);
    assert_int_equal(latest()->landed_state, 2);
}

/* ---- native LOCATION ---- */

static mavlink_open_drone_id_location_t full_location(void)
{
    return (mavlink_open_drone_id_location_t){.status = 2,
                                              .direction = 27050,
                                              .speed_horizontal = 1225,
                                              .speed_vertical = -250,
                                              .latitude = 577089000,
                                              .longitude = -119746000,
                                              .altitude_barometric = 101.5F,
                                              .altitude_geodetic = 156.5F,
                                              .height_reference = 1,
                                              .height = 100.5F,
                                              .horizontal_accuracy = 11,
                                              .vertical_accuracy = 5,
                                              .barometer_accuracy = 4,
                                              .speed_accuracy = 3,
                                              .timestamp = 1234.5F,
                                              .timestamp_accuracy = 2};
}

static const struct telemetry_update *feed_location(const mavlink_open_drone_id_location_t *in)
{
    assert_int_equal(feed(frame_open_drone_id_location(VEHICLE, AUTOPILOT, in)), 1);
    assert_int_equal(latest()->kind, TELEMETRY_LOCATION);
    return latest();
}

static void a_native_location_comes_in_degrees_metres_and_up_positive(void **state)
{
    const mavlink_open_drone_id_location_t in = full_location();
    const struct telemetry_update *out = feed_location(&in);

    (void)state;
    assert_int_equal(out->location.status, 2);
    assert_near(out->location.direction_deg, 270.5);
    assert_near(out->location.speed_mps, 12.25);
    assert_near(out->location.vertical_speed_mps, -2.5); /* positive up in this message */
    assert_near(out->location.latitude_deg, 57.7089);
    assert_near(out->location.longitude_deg, -11.9746);
    assert_near(out->location.altitude_barometric_m, 101.5);
    assert_near(out->location.altitude_geodetic_m, 156.5);
    assert_int_equal(out->location.height_reference, 1);
    assert_near(out->location.height_m, 100.5);
    assert_int_equal(out->location.horizontal_accuracy, 11);
    assert_int_equal(out->location.vertical_accuracy, 5);
    assert_int_equal(out->location.barometer_accuracy, 4);
    assert_int_equal(out->location.speed_accuracy, 3);
    assert_int_equal(out->location.timestamp_accuracy, 2);
    assert_near(out->location.timestamp_s, 1234.5);
}

static void each_native_unknown_is_unknown(void **state)
{
    mavlink_open_drone_id_location_t in = full_location();
    const struct telemetry_update *out;

    (void)state;
    in.direction = 36100;
    in.speed_horizontal = 25500;
    in.speed_vertical = 6300;
    in.latitude = in.longitude = 0;
    in.altitude_barometric = in.altitude_geodetic = in.height = -1000;
    in.timestamp = 0xFFFF;
    out = feed_location(&in);
    assert_true(isnan(out->location.direction_deg));
    assert_true(isnan(out->location.speed_mps));
    assert_true(isnan(out->location.vertical_speed_mps));
    assert_true(isnan(out->location.latitude_deg));
    assert_true(isnan(out->location.longitude_deg));
    assert_true(isnan(out->location.altitude_barometric_m));
    assert_true(isnan(out->location.altitude_geodetic_m));
    assert_true(isnan(out->location.height_m));
    assert_true(isnan(out->location.timestamp_s));
}

static void the_last_native_values_before_unknown_are_values(void **state)
{
    mavlink_open_drone_id_location_t in = full_location();
    const struct telemetry_update *out;

    (void)state;
    in.direction = 35999;
    in.speed_horizontal = 25425;
    in.speed_vertical = -6200;
    in.altitude_barometric = in.altitude_geodetic = in.height = -999.5F;
    in.timestamp = 3599.96F;
    out = feed_location(&in);
    assert_near(out->location.direction_deg, 359.99);
    assert_near(out->location.speed_mps, 254.25);
    assert_near(out->location.vertical_speed_mps, -62);
    assert_near(out->location.altitude_barometric_m, -999.5);
    assert_near(out->location.height_m, -999.5);
    assert_true(fabs(out->location.timestamp_s - 3599.96) < 1e-3);
    in.speed_vertical = 6200;
    in.timestamp = 0;
    out = feed_location(&in);
    assert_near(out->location.vertical_speed_mps, 62);
    assert_true(out->location.timestamp_s == 0);
    in.direction = 36000; /* some round up to it: north */
    assert_true(feed_location(&in)->location.direction_deg == 0);
}

static void native_nonsense_is_unknown(void **state)
{
    static const float nonsense[] = {NAN, INFINITY, -INFINITY, -2000};

    (void)state;
    for (size_t i = 0; i < sizeof(nonsense) / sizeof(nonsense[0]); i++) {
        mavlink_open_drone_id_location_t in = full_location();
        const struct telemetry_update *out;

        in.altitude_barometric = in.altitude_geodetic = in.height = in.timestamp = nonsense[i];
        in.direction = UINT16_MAX;
        in.speed_horizontal = UINT16_MAX;
        in.speed_vertical = INT16_MIN;
        out = feed_location(&in);
        assert_true(isnan(out->location.direction_deg));
        assert_true(isnan(out->location.speed_mps));
        assert_true(isnan(out->location.vertical_speed_mps));
        assert_true(isnan(out->location.altitude_barometric_m));
        assert_true(isnan(out->location.altitude_geodetic_m));
        assert_true(isnan(out->location.height_m));
        assert_true(isnan(out->location.timestamp_s));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_position_comes_in_degrees_metres_and_up_positive, setup),
        cmocka_unit_test_setup(latitude_and_longitude_0_mean_unknown_only_together, setup),
        cmocka_unit_test_setup(a_place_that_is_nowhere_on_earth_is_unknown, setup),
        cmocka_unit_test_setup(the_extremes_of_a_position_are_read_without_overflow, setup),
        cmocka_unit_test_setup(system_time_keeps_all_its_bits, setup),
        cmocka_unit_test_setup(system_time_counts_from_the_autopilot_only, setup),
        cmocka_unit_test_setup(gps_accuracies_come_in_metres_with_0_and_absent_unknown, setup),
        cmocka_unit_test_setup(a_mavlink_1_gps_message_has_no_accuracies, setup),
        cmocka_unit_test_setup(a_separation_that_is_nowhere_on_earth_is_unknown, setup),
        cmocka_unit_test_setup(home_and_landed_state_are_read, setup),
        cmocka_unit_test_setup(an_answer_counts_when_it_is_ours, setup),
        cmocka_unit_test_setup(a_crash_is_read_of_the_autopilots_text, setup),
        cmocka_unit_test_setup(a_native_location_comes_in_degrees_metres_and_up_positive, setup),
        cmocka_unit_test_setup(each_native_unknown_is_unknown, setup),
        cmocka_unit_test_setup(the_last_native_values_before_unknown_are_values, setup),
        cmocka_unit_test_setup(native_nonsense_is_unknown, setup),
    };

    return cmocka_run_group_tests_name("telemetry fields", tests, NULL, NULL);
}
