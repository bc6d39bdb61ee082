/* OPEN_DRONE_ID_MESSAGE_PACK: the messages as they go on the air, within MAVLink. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <opendroneid.h>

#include "telemetry_recorder.h"

static mavlink_open_drone_id_message_pack_t pack;

static int setup(void **state)
{
    (void)state;
    begin_with_vehicle();
    memset(&pack, 0, sizeof(pack));
    pack.single_message_size = ODID_MESSAGE_SIZE;
    return 0;
}

/* Room for one more message in the pack. */
static void *next(void)
{
    return pack.messages + ODID_MESSAGE_SIZE * pack.msg_pack_size++;
}

static unsigned feed_pack(void)
{
    update_count = 0;
    return feed(frame_open_drone_id_message_pack(VEHICLE, AUTOPILOT, &pack));
}

static void add_basic_id(ODID_idtype_t type, const char *id)
{
    ODID_BasicID_data data = {.IDType = type, .UAType = ODID_UATYPE_AEROPLANE};

    memcpy(data.UASID, id, strlen(id));
    encodeBasicIDMessage(next(), &data);
}

static void add_location(float direction, float speed, float altitude, float timestamp)
{
    ODID_Location_data data = {.Status = ODID_STATUS_AIRBORNE,
                               .Direction = direction,
                               .SpeedHorizontal = speed,
                               .SpeedVertical = altitude == INV_ALT ? INV_SPEED_V : -3.5F,
                               .Latitude = 57.7089,
                               .Longitude = 11.9746,
                               .AltitudeBaro = altitude,
                               .AltitudeGeo = altitude,
                               .Height = altitude,
                               .HeightType = ODID_HEIGHT_REF_OVER_GROUND,
                               .HorizAccuracy = ODID_HOR_ACC_3_METER,
                               .VertAccuracy = ODID_VER_ACC_10_METER,
                               .BaroAccuracy = ODID_VER_ACC_25_METER,
                               .SpeedAccuracy = ODID_SPEED_ACC_1_METERS_PER_SECOND,
                               .TSAccuracy = ODID_TIME_ACC_0_2_SECOND,
                               .TimeStamp = timestamp};

    assert_int_equal(encodeLocationMessage(next(), &data), ODID_SUCCESS);
}

static void every_message_of_a_pack_is_delivered(void **state)
{
    ODID_Auth_data auth = {
        .AuthType = ODID_AUTH_UAS_ID_SIGNATURE, .LastPageIndex = 1, .Length = 40};
    ODID_SelfID_data self = {.DescType = ODID_DESC_TYPE_TEXT, .Desc = "Sea rescue surveillance"};
    ODID_System_data system = {.OperatorLocationType = ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS,
                               .ClassificationType = ODID_CLASSIFICATION_TYPE_EU,
                               .OperatorLatitude = -33.5,
                               .OperatorLongitude = 151.25,
                               .AreaCount = 2,
                               .AreaRadius = 250,
                               .AreaCeiling = 120,
                               .AreaFloor = INV_ALT,
                               .CategoryEU = ODID_CATEGORY_EU_SPECIFIC,
                               .ClassEU = ODID_CLASS_EU_CLASS_4,
                               .OperatorAltitudeGeo = 48.5F,
                               .Timestamp = 243699123};
    ODID_OperatorID_data operator_id = {.OperatorId = "SWE3jxza7qbzvu5d"};
    uint8_t page_1[ODID_AUTH_PAGE_NONZERO_DATA_SIZE];

    (void)state;
    memset(auth.AuthData, 0x11, ODID_AUTH_PAGE_ZERO_DATA_SIZE);
    memset(page_1, 0x22, sizeof(page_1));
    add_basic_id(ODID_IDTYPE_SERIAL_NUMBER, "SSRS5GBG01");
    add_basic_id(ODID_IDTYPE_CAA_REGISTRATION_ID, "SE-123");
    add_location(270, 12.5F, 100.5F, 1234.5F);
    assert_int_equal(encodeAuthMessage(next(), &auth), ODID_SUCCESS);
    auth.DataPage = 1;
    memcpy(auth.AuthData, page_1, sizeof(page_1));
    assert_int_equal(encodeAuthMessage(next(), &auth), ODID_SUCCESS);
    assert_int_equal(encodeSelfIDMessage(next(), &self), ODID_SUCCESS);
    assert_int_equal(encodeSystemMessage(next(), &system), ODID_SUCCESS);
    assert_int_equal(encodeOperatorIDMessage(next(), &operator_id), ODID_SUCCESS);

    assert_int_equal(feed_pack(), 8);
    assert_int_equal(updates[0].kind, TELEMETRY_BASIC_ID);
    assert_int_equal(updates[0].basic_id.id_type, 1);
    assert_int_equal(updates[0].basic_id.ua_type, 1);
    assert_string_equal(updates[0].basic_id.uas_id, "SSRS5GBG01");
    assert_int_equal(updates[1].basic_id.id_type, 2);
    assert_string_equal(updates[1].basic_id.uas_id, "SE-123");
    assert_int_equal(updates[2].kind, TELEMETRY_LOCATION);
    assert_int_equal(updates[2].location.status, 2);
    assert_int_equal(updates[2].location.height_reference, 1);
    assert_true(updates[2].location.direction_deg == 270);
    assert_true(updates[2].location.speed_mps == 12.5);
    assert_true(updates[2].location.vertical_speed_mps == -3.5);
    assert_true(fabs(updates[2].location.latitude_deg - 57.7089) < 1e-7);
    assert_true(fabs(updates[2].location.longitude_deg - 11.9746) < 1e-7);
    assert_true(updates[2].location.altitude_barometric_m == 100.5);
    assert_true(updates[2].location.altitude_geodetic_m == 100.5);
    assert_true(updates[2].location.height_m == 100.5);
    assert_true(updates[2].location.timestamp_s == 1234.5);
    assert_int_equal(updates[2].location.horizontal_accuracy, ODID_HOR_ACC_3_METER);
    assert_int_equal(updates[2].location.vertical_accuracy, ODID_VER_ACC_10_METER);
    assert_int_equal(updates[2].location.barometer_accuracy, ODID_VER_ACC_25_METER);
    assert_int_equal(updates[2].location.speed_accuracy, ODID_SPEED_ACC_1_METERS_PER_SECOND);
    assert_int_equal(updates[2].location.timestamp_accuracy, ODID_TIME_ACC_0_2_SECOND);
    assert_int_equal(updates[3].kind, TELEMETRY_AUTHENTICATION);
    assert_int_equal(updates[3].authentication.type, 1);
    assert_int_equal(updates[3].authentication.last_page, 1);
    assert_int_equal(updates[3].authentication.length, 40);
    assert_int_equal(updates[3].authentication.data[16], 0x11);
    assert_int_equal(updates[3].authentication.data[17], 0);
    assert_int_equal(updates[4].authentication.page, 1);
    assert_memory_equal(updates[4].authentication.data, page_1, sizeof(page_1));
    assert_int_equal(updates[5].kind, TELEMETRY_SELF_ID);
    assert_string_equal(updates[5].self_id.text, "Sea rescue surveillance");
    assert_int_equal(updates[6].kind, TELEMETRY_SYSTEM);
    assert_int_equal(updates[6].system.operator_location_type, 1);
    assert_true(updates[6].system.operator_latitude_deg == -33.5);
    assert_true(updates[6].system.operator_longitude_deg == 151.25);
    assert_true(updates[6].system.operator_altitude_m == 48.5);
    assert_int_equal(updates[6].system.area_count, 2);
    assert_int_equal(updates[6].system.area_radius_m, 250);
    assert_true(updates[6].system.area_ceiling_m == 120);
    assert_true(isnan(updates[6].system.area_floor_m));
    assert_int_equal(updates[6].system.category_eu, 2);
    assert_int_equal(updates[6].system.class_eu, 5);
    assert_int_equal(updates[6].system.timestamp_2019_s, 243699123);
    assert_int_equal(updates[7].kind, TELEMETRY_OPERATOR_ID);
    assert_string_equal(updates[7].operator_id.operator_id, "SWE3jxza7qbzvu5d");
}

static void unknown_fields_of_a_pack_are_unknown(void **state)
{
    (void)state;
    add_location(INV_DIR, INV_SPEED_H, INV_ALT, INV_TIMESTAMP);
    assert_int_equal(feed_pack(), 1);
    assert_true(isnan(updates[0].location.direction_deg));
    assert_true(isnan(updates[0].location.speed_mps));
    assert_true(isnan(updates[0].location.vertical_speed_mps));
    assert_true(isnan(updates[0].location.altitude_barometric_m));
    assert_true(isnan(updates[0].location.altitude_geodetic_m));
    assert_true(isnan(updates[0].location.height_m));
    assert_true(isnan(updates[0].location.timestamp_s));
}

static void a_pack_of_the_wrong_shape_is_refused_whole(void **state)
{
    (void)state;
    add_basic_id(ODID_IDTYPE_SERIAL_NUMBER, "SSRS5GBG01");
    add_location(270, 12.5F, 100.5F, 1234.5F);
    assert_int_equal(feed_pack(), 2);
    pack.single_message_size = 24;
    assert_int_equal(feed_pack(), 0);
    pack.single_message_size = 26;
    assert_int_equal(feed_pack(), 0);
    pack.single_message_size = 25;
    pack.msg_pack_size = 0;
    assert_int_equal(feed_pack(), 0);
    for (unsigned count = 10; count < 256; count++) {
        pack.msg_pack_size = (uint8_t)count;
        assert_int_equal(feed_pack(), 0);
    }
}

static void a_pack_with_two_locations_or_a_pack_inside_is_refused(void **state)
{
    (void)state;
    add_location(270, 12.5F, 100.5F, 1234.5F);
    add_location(90, 12.5F, 100.5F, 1234.5F);
    assert_int_equal(feed_pack(), 0);
    pack.messages[25] = 0xF2;
    assert_int_equal(feed_pack(), 0);
    pack.messages[25] = 0x62;
    assert_int_equal(feed_pack(), 0);
}

static void empty_messages_of_a_pack_are_absent(void **state)
{
    (void)state;
    for (uint8_t type = 0; type <= 5; type++) {
        if (type != ODID_MESSAGETYPE_LOCATION && type != ODID_MESSAGETYPE_AUTH &&
            type != ODID_MESSAGETYPE_SELF_ID) { /* an empty one takes back what was said */
            ((uint8_t *)next())[0] = (uint8_t)(type << 4 | ODID_PROTOCOL_VERSION);
        }
    }
    assert_int_equal(feed_pack(), 0);
    assert_int_equal(telemetry_counters(telemetry)->other_system, 0);
}

static void a_binary_id_of_a_pack_keeps_its_zeros(void **state)
{
    ODID_BasicID_data data = {.IDType = ODID_IDTYPE_UTM_ASSIGNED_UUID};

    (void)state;
    memcpy(data.UASID, "\0\1\0\2\0\0\0\3\0\0\0\0\0\0\0\4", 16);
    encodeBasicIDMessage(next(), &data);
    assert_int_equal(feed_pack(), 1);
    assert_memory_equal(updates[0].basic_id.uas_id, data.UASID, 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(every_message_of_a_pack_is_delivered, setup),
        cmocka_unit_test_setup(unknown_fields_of_a_pack_are_unknown, setup),
        cmocka_unit_test_setup(a_pack_of_the_wrong_shape_is_refused_whole, setup),
        cmocka_unit_test_setup(a_pack_with_two_locations_or_a_pack_inside_is_refused, setup),
        cmocka_unit_test_setup(empty_messages_of_a_pack_are_absent, setup),
        cmocka_unit_test_setup(a_binary_id_of_a_pack_keeps_its_zeros, setup),
    };

    return cmocka_run_group_tests_name("telemetry, message pack", tests, NULL, NULL);
}
