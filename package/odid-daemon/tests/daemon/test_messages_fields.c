/*
 * Every field over its range and beyond, decoded back by opendroneid-core-c:
 * no value refuses a message, none comes out as another value.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <opendroneid.h>

#include "daemon/messages.h"
#include "full_view.h"

static struct aircraft_view view;
static ODID_Location_data location;
static ODID_System_data sys;
static const double nonsense[] = {NAN, -NAN, INFINITY, -INFINITY};

static int setup(void **state)
{
    (void)state;
    view = full_view();
    return 0;
}

static void decode(void)
{
    uint8_t message[MESSAGE_SIZE];

    assert_true(messages_encode(&view, MESSAGE_LOCATION, 0, message));
    assert_int_equal(decodeLocationMessage(&location, (void *)message), ODID_SUCCESS);
    assert_true(messages_encode(&view, MESSAGE_SYSTEM, 0, message));
    assert_int_equal(decodeSystemMessage(&sys, (void *)message), ODID_SUCCESS);
}

#define assert_about(a, b, limit) assert_true(fabs((double)(a) - (double)(b)) <= (limit) + 1e-4)

/* ---- over the range ---- */

static void directions(void **state)
{
    (void)state;
    for (double degrees = 0; degrees <= 360; degrees += 0.01) {
        double apart;

        view.location.direction_deg = degrees;
        decode();
        apart = fabs((double)location.Direction - degrees);
        assert_true(apart <= 0.501 || apart >= 359.499);
        assert_true(location.Direction >= 0 && location.Direction < 360);
    }
    view.location.direction_deg = 359.6;
    decode();
    assert_true(location.Direction == 0);
    view.location.direction_deg = 179.6;
    decode();
    assert_true(location.Direction == 180);
}

static void horizontal_speeds(void **state)
{
    (void)state;
    for (double speed = 0; speed <= 254.25; speed += 0.01) {
        view.location.speed_mps = speed;
        decode();
        assert_about(location.SpeedHorizontal, speed, speed <= 63.75 ? 0.125 : 0.375);
        assert_true(location.SpeedHorizontal < 255); /* never by rounding into unknown */
    }
    for (double speed = 254.25; speed < 1000; speed += 0.3) {
        view.location.speed_mps = speed;
        decode();
        assert_true(location.SpeedHorizontal == 254.25F);
    }
    view.location.speed_mps = -0.1;
    decode();
    assert_true(location.SpeedHorizontal == 0);
}

static void vertical_speeds(void **state)
{
    (void)state;
    for (double speed = -62; speed <= 62; speed += 0.01) {
        view.location.vertical_speed_mps = speed;
        decode();
        assert_about(location.SpeedVertical, speed, 0.25);
    }
    for (double speed = 62; speed < 400; speed += 0.1) {
        view.location.vertical_speed_mps = speed;
        decode();
        assert_true(location.SpeedVertical == 62);
        view.location.vertical_speed_mps = -speed;
        decode();
        assert_true(location.SpeedVertical == -62);
    }
}

static void places(void **state)
{
    (void)state;
    for (double latitude = -90; latitude <= 90; latitude += 0.73) {
        for (double longitude = -180; longitude <= 180; longitude += 1.37) {
            view.location.latitude_deg = view.system.operator_latitude_deg = latitude;
            view.location.longitude_deg = view.system.operator_longitude_deg = longitude;
            decode();
            assert_about(location.Latitude, latitude, 1e-7);
            assert_about(location.Longitude, longitude, 1e-7);
            assert_about(sys.OperatorLatitude, latitude, 1e-7);
            assert_about(sys.OperatorLongitude, longitude, 1e-7);
        }
    }
}

/* Half a place, or one beyond the range, is no place. */
static void wrong_places_are_unknown_as_a_whole(void **state)
{
    static const double wrong[] = {NAN, INFINITY, -INFINITY, 180.0000001, -200, 1e9};

    (void)state;
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        for (unsigned latitude = 0; latitude < 2; latitude++) {
            view = full_view();
            *(latitude ? &view.location.latitude_deg : &view.location.longitude_deg) = wrong[i];
            *(latitude ? &view.system.operator_latitude_deg : &view.system.operator_longitude_deg) =
                wrong[i];
            decode();
            assert_true(location.Latitude == 0 && location.Longitude == 0);
            assert_true(sys.OperatorLatitude == 0 && sys.OperatorLongitude == 0);
        }
    }
}

static void altitudes(void **state)
{
    (void)state;
    for (double metres = -999.5; metres <= 31767; metres += 0.37) {
        view.location.altitude_barometric_m = view.location.altitude_geodetic_m = metres;
        view.location.height_m = view.system.operator_altitude_m = metres;
        view.system.area_ceiling_m = view.system.area_floor_m = metres;
        decode();
        assert_about(location.AltitudeBaro, metres, 0.252);
        assert_about(location.AltitudeGeo, metres, 0.252);
        assert_about(location.Height, metres, 0.252);
        assert_about(sys.OperatorAltitudeGeo, metres, 0.252);
        assert_about(sys.AreaCeiling, metres, 0.252);
        assert_about(sys.AreaFloor, metres, 0.252);
    }
}

/* The lowest value on the air says "unknown": what is really there is never that, and what is below
 * it nowhere. */
static void altitudes_beyond_the_range_go_to_its_ends_or_are_unknown(void **state)
{
    static const double low[] = {-999.6, -999.9, -1000};
    static const double nowhere[] = {-1000.1, -1000.5, -5000, -1e12};
    static const double high[] = {31767.5, 31768, 40000, 1e12};

    (void)state;
    for (size_t i = 0; i < sizeof(low) / sizeof(low[0]); i++) {
        view.location.altitude_geodetic_m = view.location.height_m = low[i];
        view.system.operator_altitude_m = low[i];
        decode();
        assert_true(location.AltitudeGeo == -999.5F && location.Height == -999.5F);
        assert_true(sys.OperatorAltitudeGeo == -999.5F);
    }
    for (size_t i = 0; i < sizeof(nowhere) / sizeof(nowhere[0]); i++) {
        view.location.altitude_geodetic_m = view.location.height_m = nowhere[i];
        view.system.operator_altitude_m = nowhere[i];
        decode();
        assert_true(location.AltitudeGeo == -1000.0F && location.Height == -1000.0F);
        assert_true(sys.OperatorAltitudeGeo == -1000.0F);
    }
    for (size_t i = 0; i < sizeof(high) / sizeof(high[0]); i++) {
        view.location.altitude_geodetic_m = view.location.height_m = high[i];
        view.system.operator_altitude_m = high[i];
        decode();
        assert_true(location.AltitudeGeo == 31767.5F && location.Height == 31767.5F);
        assert_true(sys.OperatorAltitudeGeo == 31767.5F);
    }
}

static void timestamps(void **state)
{
    static const double beyond[] = {-0.01, -1, 3600.01, 65535, 1e9};

    (void)state;
    for (double seconds = 0; seconds <= 3600; seconds += 0.013) {
        view.location.timestamp_s = seconds;
        decode();
        assert_about(location.TimeStamp, seconds, 0.0503);
        assert_true(location.TimeStamp <= 3600);
    }
    for (size_t i = 0; i < sizeof(beyond) / sizeof(beyond[0]); i++) {
        view.location.timestamp_s = beyond[i];
        decode();
        assert_true(location.TimeStamp == INV_TIMESTAMP);
    }
    view.location.timestamp_s = 3599.96;
    decode();
    assert_true(location.TimeStamp == 3600);
}

static void numbers_of_tables(void **state)
{
    (void)state;
    for (unsigned value = 0; value < 256; value++) {
        view.location.status = (enum aircraft_status)value;
        view.location.horizontal_accuracy = view.location.vertical_accuracy = (uint8_t)value;
        view.location.barometer_accuracy = view.location.speed_accuracy = (uint8_t)value;
        view.location.timestamp_accuracy = (uint8_t)value;
        view.system.operator_location_type = (uint8_t)value;
        view.system.category_eu = view.system.class_eu = (uint8_t)value;
        decode();
        assert_int_equal(location.Status, value <= 4 ? value : 0);
        assert_int_equal(location.HorizAccuracy, value <= 12 ? value : 0);
        assert_int_equal(location.VertAccuracy, value <= 6 ? value : 0);
        assert_int_equal(location.BaroAccuracy, value <= 6 ? value : 0);
        assert_int_equal(location.SpeedAccuracy, value <= 4 ? value : 0);
        assert_int_equal(location.TSAccuracy, value <= 15 ? value : 0);
        assert_int_equal(sys.OperatorLocationType, value <= 2 ? value : 0);
        assert_int_equal(sys.CategoryEU, value <= 3 ? value : 0);
        assert_int_equal(sys.ClassEU, value <= 7 ? value : 0);
    }
    for (unsigned value = 0; value < 256; value++) {
        view.system.classification_type = (uint8_t)value;
        view.system.category_eu = 2;
        view.system.class_eu = 5;
        decode();
        assert_int_equal(sys.ClassificationType, value == 1);
        assert_int_equal(sys.CategoryEU, value == 1 ? 2 : 0); /* the EU's tables only */
        assert_int_equal(sys.ClassEU, value == 1 ? 5 : 0);
    }
}

static void types_of_ids_and_texts(void **state)
{
    uint8_t message[MESSAGE_SIZE];

    (void)state;
    for (unsigned value = 0; value < 256; value++) {
        view.basic_id[0].id_type = view.basic_id[0].ua_type = (uint8_t)value;
        view.description_type = view.operator_id_type = (uint8_t)value;
        assert_true(messages_encode(&view, MESSAGE_BASIC_ID, 0, message));
        assert_int_equal(message[1] >> 4, value <= 4 ? value : 0);
        assert_int_equal(message[1] & 15, value <= 15 ? value : 0);
        assert_true(messages_encode(&view, MESSAGE_SELF_ID, 0, message));
        assert_int_equal(message[1], value);
        assert_true(messages_encode(&view, MESSAGE_OPERATOR_ID, 0, message));
        assert_int_equal(message[1], value);
    }
}

static void areas(void **state)
{
    (void)state;
    for (unsigned value = 0; value < 65536; value++) {
        view.system.area_count = view.system.area_radius_m = (uint16_t)value;
        decode();
        assert_int_equal(sys.AreaCount, value);
        assert_int_equal(sys.AreaRadius, value <= 2550 ? value / 10 * 10 : 2550);
    }
}

static void system_timestamps_keep_all_their_bits(void **state)
{
    (void)state;
    for (unsigned bit = 0; bit < 32; bit++) {
        view.system.timestamp_2019_s = (UINT32_C(1) << bit) + 243699123;
        decode();
        assert_true(sys.Timestamp == view.system.timestamp_2019_s);
    }
}

static void heights_say_what_they_are_above(void **state)
{
    (void)state;
    decode();
    assert_int_equal(location.HeightType, ODID_HEIGHT_REF_OVER_TAKEOFF);
    view.location.height_above_ground = true;
    decode();
    assert_int_equal(location.HeightType, ODID_HEIGHT_REF_OVER_GROUND);
}

/* ---- not a number, one field at a time ---- */

/* The field that is nonsense is unknown, and every other one is what it was. */
static void one_nonsensical_field_spoils_no_other(void **state)
{
    enum { DIRECTION, SPEED, CLIMB, BARO, GEO, HEIGHT, TIME, OPERATOR_ALT, CEILING, FLOOR, FIELDS };
    double *const fields[FIELDS] = {
        &view.location.direction_deg,       &view.location.speed_mps,
        &view.location.vertical_speed_mps,  &view.location.altitude_barometric_m,
        &view.location.altitude_geodetic_m, &view.location.height_m,
        &view.location.timestamp_s,         &view.system.operator_altitude_m,
        &view.system.area_ceiling_m,        &view.system.area_floor_m,
    };

    (void)state;
    for (unsigned field = 0; field < FIELDS; field++) {
        for (size_t i = 0; i < sizeof(nonsense) / sizeof(nonsense[0]); i++) {
            view = full_view();
            view.system.area_floor_m = 10;
            *fields[field] = nonsense[i];
            decode();
            assert_true(location.Direction == (field == DIRECTION ? 361 : 270));
            assert_true(location.SpeedHorizontal == (field == SPEED ? 255 : 20));
            assert_true(location.SpeedVertical == (field == CLIMB ? 63 : -2.5F));
            assert_true(location.AltitudeBaro == (field == BARO ? -1000 : 101.5F));
            assert_true(location.AltitudeGeo == (field == GEO ? -1000 : 120.5F));
            assert_true(location.Height == (field == HEIGHT ? -1000 : 36));
            assert_true(location.TimeStamp == (field == TIME ? 65535 : 1234.5F));
            assert_true(sys.OperatorAltitudeGeo == (field == OPERATOR_ALT ? -1000 : 48.5F));
            assert_true(sys.AreaCeiling == (field == CEILING ? -1000 : 120));
            assert_true(sys.AreaFloor == (field == FLOOR ? -1000 : 10));
            assert_about(location.Latitude, 57.7089, 1e-7);
            assert_about(sys.OperatorLatitude, -33.7089, 1e-7);
        }
    }
}

static void a_wrong_direction_is_unknown(void **state)
{
    static const double wrong[] = {-0.1, -90, 360.1, 361, 720, 1e9, -1e9};

    (void)state;
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        view.location.direction_deg = wrong[i];
        decode();
        assert_true(location.Direction == 361);
    }
}

/* A length that its pages can't hold would make the encoder refuse page 0. */
static void an_authentication_is_encoded_whatever_it_says(void **state)
{
    uint8_t message[MESSAGE_SIZE];
    ODID_Auth_data data;

    (void)state;
    for (unsigned pages = 1; pages <= TELEMETRY_AUTH_PAGES; pages++) {
        for (unsigned length = 0; length < 256; length++) {
            unsigned room = 17 + 23 * (pages - 1);

            add_authentication(&view, pages);
            view.auth[0].length = (uint8_t)length;
            view.auth[0].type = (uint8_t)length;
            for (unsigned page = 0; page < pages; page++) {
                assert_true(messages_encode(&view, MESSAGE_AUTHENTICATION, page, message));
                assert_int_equal(decodeAuthMessage(&data, (void *)message), ODID_SUCCESS);
                assert_int_equal(data.DataPage, page);
            }
            messages_encode(&view, MESSAGE_AUTHENTICATION, 0, message);
            decodeAuthMessage(&data, (void *)message);
            assert_int_equal(data.Length, length < room ? length : room);
            assert_int_equal(data.LastPageIndex, pages - 1);
            assert_true(data.Timestamp == 0x01020304);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(directions, setup),
        cmocka_unit_test_setup(horizontal_speeds, setup),
        cmocka_unit_test_setup(vertical_speeds, setup),
        cmocka_unit_test_setup(places, setup),
        cmocka_unit_test_setup(wrong_places_are_unknown_as_a_whole, setup),
        cmocka_unit_test_setup(altitudes, setup),
        cmocka_unit_test_setup(altitudes_beyond_the_range_go_to_its_ends_or_are_unknown, setup),
        cmocka_unit_test_setup(timestamps, setup),
        cmocka_unit_test_setup(numbers_of_tables, setup),
        cmocka_unit_test_setup(types_of_ids_and_texts, setup),
        cmocka_unit_test_setup(areas, setup),
        cmocka_unit_test_setup(system_timestamps_keep_all_their_bits, setup),
        cmocka_unit_test_setup(heights_say_what_they_are_above, setup),
        cmocka_unit_test_setup(one_nonsensical_field_spoils_no_other, setup),
        cmocka_unit_test_setup(a_wrong_direction_is_unknown, setup),
        cmocka_unit_test_setup(an_authentication_is_encoded_whatever_it_says, setup),
    };

    return cmocka_run_group_tests_name("message fields", tests, NULL, NULL);
}
