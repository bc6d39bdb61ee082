/* Whose OPEN_DRONE_ID messages count, and what the static ones and the pack hold. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "telemetry_recorder.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))
#define assert_near(a, b) assert_true(fabs((a) - (b)) < 1e-6)

static int setup(void **state)
{
    (void)state;
    begin_with_vehicle();
    return 0;
}

/* ---- one frame of each kind, with a target and id_or_mac ---- */

enum kind { BASIC_ID, LOCATION, AUTHENTICATION, SELF_ID, SYSTEM, UPDATE, OPERATOR_ID, PACK, KINDS };

static uint8_t id_or_mac_byte; /* 0: the messages are about the sender's own aircraft */

#define FILLED(kind_name, ...)                                                                     \
    do {                                                                                           \
        mavlink_open_drone_id_##kind_name##_t content = {                                          \
            .target_system = to_system, .target_component = to_component, __VA_ARGS__};            \
        content.id_or_mac[19] = id_or_mac_byte;                                                    \
        return frame_open_drone_id_##kind_name(system, component, &content);                       \
    } while (0)

static struct frame native(enum kind kind, uint8_t system, uint8_t component, uint8_t to_system,
                           uint8_t to_component)
{
    switch (kind) {
    case BASIC_ID:
        FILLED(basic_id, .id_type = 1, .ua_type = 2, .uas_id = "SSRS5GBG01");
    case LOCATION:
        FILLED(location, .status = 2, .latitude = 577089000);
    case AUTHENTICATION:
        FILLED(authentication, .authentication_type = 1, .length = 17, .timestamp = 5);
    case SELF_ID:
        FILLED(self_id, .description = "Sea rescue");
    case SYSTEM:
        FILLED(system, .operator_latitude = 577089000, .timestamp = 5);
    case OPERATOR_ID:
        FILLED(operator_id, .operator_id = "SWE3jxza7qbzvu5d");
    case PACK:
        FILLED(message_pack, .single_message_size = 25, .msg_pack_size = 1,
               .messages = {0x52, 0, 'S', 'W', 'E'});
    case UPDATE:
    default: {
        const mavlink_open_drone_id_system_update_t content = {.target_system = to_system,
                                                               .target_component = to_component,
                                                               .operator_latitude = 577089000,
                                                               .timestamp = 5};

        return frame_open_drone_id_system_update(system, component, &content);
    }
    }
}

static bool accepted(struct frame frame)
{
    uint64_t other = telemetry_counters(telemetry)->other_system;
    bool taken = feed(frame) > 0;

    assert_int_equal(telemetry_counters(telemetry)->other_system, other + (taken ? 0 : 1));
    return taken;
}

/* ---- targets ---- */

static void targets_from_the_autopilot(void **state)
{
    static const uint8_t systems[] = {0, VEHICLE, OTHER_VEHICLE, GROUND_STATION};

    (void)state;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        for (size_t i = 0; i < COUNT(systems); i++) {
            bool expected = systems[i] == 0 || systems[i] == VEHICLE;

            for (unsigned component = 0; component < 256; component++) {
                assert_int_equal(
                    accepted(native(kind, VEHICLE, AUTOPILOT, systems[i], (uint8_t)component)),
                    expected);
            }
        }
    }
}

/* ArduPilot passes on what its radio hears, but for what has its own ids: an aircraft was dragged
 * away by LOCATIONs of component 191. */
static void targets_from_another_component_of_the_vehicle(void **state)
{
    (void)state;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        bool autopilots = kind == LOCATION || kind == PACK || kind == BASIC_ID;

        for (unsigned component = 0; component < 256; component++) {
            bool ours = component == 0 || component == TELEMETRY_COMPONENT_ODID;

            assert_int_equal(accepted(native(kind, VEHICLE, 191, 0, (uint8_t)component)),
                             !autopilots);
            assert_int_equal(accepted(native(kind, VEHICLE, 191, VEHICLE, (uint8_t)component)),
                             ours && !autopilots);
            assert_false(accepted(native(kind, VEHICLE, 191, OTHER_VEHICLE, (uint8_t)component)));
        }
    }
}

/* Where the aircraft is only the aircraft knows: no LOCATION, no pack. */
static void targets_from_a_ground_station(void **state)
{
    (void)state;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        bool position = kind == LOCATION || kind == PACK;

        for (unsigned component = 0; component < 256; component++) {
            bool ours =
                component == 0 || component == AUTOPILOT || component == TELEMETRY_COMPONENT_ODID;

            assert_int_equal(accepted(native(kind, GROUND_STATION, 190, 0, (uint8_t)component)),
                             !position);
            assert_int_equal(
                accepted(native(kind, GROUND_STATION, 190, VEHICLE, (uint8_t)component)),
                ours && !position);
            assert_false(
                accepted(native(kind, GROUND_STATION, 190, OTHER_VEHICLE, (uint8_t)component)));
        }
    }
}

static void a_ground_station_gives_no_identity_to_an_aircraft_that_has_one(void **state)
{
    (void)state;
    assert_true(accepted(native(BASIC_ID, GROUND_STATION, 190, 0, 0)));
    assert_true(accepted(native(BASIC_ID, VEHICLE, AUTOPILOT, 0, 0)));
    assert_false(accepted(native(BASIC_ID, GROUND_STATION, 190, 0, 0)));
    assert_true(accepted(native(SYSTEM, GROUND_STATION, 190, 0, 0)));
    telemetry_restarted(telemetry); /* what it had said is gone with that */
    assert_true(accepted(native(BASIC_ID, GROUND_STATION, 190, 0, 0)));
}

/* ArduPilot says an empty one when nobody has filled it. */
static void an_empty_identity_is_none(void **state)
{
    const mavlink_open_drone_id_basic_id_t empty = {.id_type = 1};

    (void)state;
    assert_int_equal(feed(frame_open_drone_id_basic_id(VEHICLE, AUTOPILOT, &empty)), 0);
    assert_true(accepted(native(BASIC_ID, GROUND_STATION, 190, 0, 0)));
}

/* One page of its own took the vehicle's Authentication off the air. */
static void a_ground_station_proves_nothing_for_a_vehicle_that_does(void **state)
{
    (void)state;
    assert_true(accepted(native(AUTHENTICATION, GROUND_STATION, 190, 0, 0)));
    assert_true(accepted(native(AUTHENTICATION, VEHICLE, AUTOPILOT, 0, 0)));
    now_us += 29 * SECOND;
    assert_false(accepted(native(AUTHENTICATION, GROUND_STATION, 190, 0, 0)));
    now_us +=
        SECOND; /* one page in the vehicle's name kept the ground station's out for the flight */
    assert_true(accepted(native(AUTHENTICATION, GROUND_STATION, 190, 0, 0)));
}

/* What an autopilot's radio hears has often the vehicle's system id, and another component. */
static void another_component_is_not_the_autopilots_word(void **state)
{
    (void)state;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        if (kind != BASIC_ID && kind != LOCATION && kind != PACK) {
            assert_true(accepted(native(kind, VEHICLE, 25, 0, 0)));
            assert_true(latest()->by_another);
        }
    }
    assert_true(accepted(native(AUTHENTICATION, VEHICLE, AUTOPILOT, 0, 0)));
    assert_false(latest()->by_another);
    assert_false(accepted(native(AUTHENTICATION, VEHICLE, 25, 0, 0)));
}

static void other_systems_are_ignored(void **state)
{
    (void)state;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        assert_false(accepted(native(kind, OTHER_VEHICLE, AUTOPILOT, 0, 0)));
        assert_false(accepted(native(kind, OTHER_VEHICLE, AUTOPILOT, VEHICLE, 1)));
        assert_false(accepted(native(kind, 0, AUTOPILOT, 0, 0)));
    }
}

static void a_ground_station_is_one_by_its_heartbeat(void **state)
{
    (void)state;
    for (unsigned system = 1; system < 255; system++) {
        if (system != VEHICLE) {
            assert_false(accepted(native(SELF_ID, (uint8_t)system, 190, 0, 0)));
            feed(ground_station_heartbeat((uint8_t)system));
            assert_true(accepted(native(SELF_ID, (uint8_t)system, 190, 0, 0)));
        }
    }
}

static void nothing_counts_before_a_vehicle_is_known(void **state)
{
    (void)state;
    begin();
    feed(ground_station_heartbeat(GROUND_STATION));
    for (enum kind kind = 0; kind < KINDS; kind++) {
        assert_false(accepted(native(kind, VEHICLE, AUTOPILOT, 0, 0)));
        assert_false(accepted(native(kind, GROUND_STATION, 190, 0, 0)));
        assert_false(accepted(native(kind, 0, AUTOPILOT, 0, 0)));
    }
}

static void another_transmitters_messages_are_ignored(void **state)
{
    uint64_t before = telemetry_counters(telemetry)->other_transmitter;
    unsigned ignored = 0;

    (void)state;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        for (uint8_t component = 236; component <= 238; component++) {
            assert_int_equal(feed(native(kind, VEHICLE, component, 0, 0)), 0);
            assert_int_equal(telemetry_counters(telemetry)->other_transmitter, before + ++ignored);
        }
    }
    assert_true(accepted(native(SELF_ID, VEHICLE, 235, 0, 0)));
    assert_true(accepted(native(SELF_ID, VEHICLE, 239, 0, 0)));
}

static void messages_about_another_aircraft_are_ignored(void **state)
{
    unsigned ignored = 0;

    (void)state;
    id_or_mac_byte = 1;
    for (enum kind kind = 0; kind < KINDS; kind++) {
        if (kind != UPDATE) { /* has no id_or_mac */
            assert_int_equal(feed(native(kind, VEHICLE, AUTOPILOT, 0, 0)), 0);
            assert_int_equal(telemetry_counters(telemetry)->other_aircraft, ++ignored);
        }
    }
    id_or_mac_byte = 0;
}

/* ---- static messages ---- */

static void texts_come_at_full_length(void **state)
{
    mavlink_open_drone_id_basic_id_t id = {.id_type = 1, .ua_type = 15};
    mavlink_open_drone_id_self_id_t self = {.description_type = 2};
    mavlink_open_drone_id_operator_id_t operator_id = {.operator_id_type = 200};

    (void)state;
    memcpy(id.uas_id, "ABCDFGHJKLMNPQRSTUVW", 20);
    memcpy(self.description, "Sea rescue surveillance", 23);
    memcpy(operator_id.operator_id, "01234567890123456789", 20);
    feed(frame_open_drone_id_basic_id(VEHICLE, AUTOPILOT, &id));
    assert_int_equal(latest()->kind, TELEMETRY_BASIC_ID);
    assert_int_equal(latest()->basic_id.id_type, 1);
    assert_int_equal(latest()->basic_id.ua_type, 15);
    assert_string_equal(latest()->basic_id.uas_id, "ABCDFGHJKLMNPQRSTUVW");
    feed(frame_open_drone_id_self_id(VEHICLE, AUTOPILOT, &self));
    assert_int_equal(latest()->kind, TELEMETRY_SELF_ID);
    assert_int_equal(latest()->self_id.type, 2);
    assert_string_equal(latest()->self_id.text, "Sea rescue surveillance");
    feed(frame_open_drone_id_operator_id(VEHICLE, AUTOPILOT, &operator_id));
    assert_int_equal(latest()->kind, TELEMETRY_OPERATOR_ID);
    assert_int_equal(latest()->operator_id.type, 200);
    assert_string_equal(latest()->operator_id.operator_id, "01234567890123456789");
}

/* A UUID or a session id is binary: any byte of it may be 0. */
static void a_binary_id_keeps_its_zeros(void **state)
{
    mavlink_open_drone_id_basic_id_t id = {.id_type = 3};

    (void)state;
    memcpy(id.uas_id, "\0\1\0\2\0\0\0\3\0\0\0\0\0\0\0\4", 16);
    assert_int_equal(feed(frame_open_drone_id_basic_id(VEHICLE, AUTOPILOT, &id)), 1);
    assert_memory_equal(latest()->basic_id.uas_id, id.uas_id, 20);
}

/* The stack below the readers holds something else each time: padding proves nothing. */
static void __attribute__((noinline)) dirty_the_stack(uint8_t with)
{
    volatile uint8_t dirt[4096];

    for (size_t i = 0; i < sizeof(dirt); i++) {
        dirt[i] = with;
    }
}

static void empty_messages_are_absent(void **state)
{
    const mavlink_open_drone_id_basic_id_t no_id = {.target_system = VEHICLE, .ua_type = 2};
    const mavlink_open_drone_id_basic_id_t untyped = {.uas_id = "SSRS5GBG01"};
    const mavlink_open_drone_id_basic_id_t nameless = {.id_type = 1};
    const mavlink_open_drone_id_operator_id_t no_operator = {.target_system = VEHICLE};
    const mavlink_open_drone_id_system_t no_system = {.target_system = VEHICLE,
                                                      .target_component = 1};
    const mavlink_open_drone_id_system_update_t no_update = {.target_system = VEHICLE};
    const mavlink_open_drone_id_authentication_t no_page = {.target_system = VEHICLE};

    (void)state;
    for (unsigned dirt = 0; dirt < 256; dirt += 85) {
        dirty_the_stack((uint8_t)dirt);
        assert_int_equal(feed(frame_open_drone_id_basic_id(VEHICLE, AUTOPILOT, &no_id)), 0);
        assert_int_equal(feed(frame_open_drone_id_basic_id(VEHICLE, AUTOPILOT, &untyped)), 0);
        assert_int_equal(feed(frame_open_drone_id_basic_id(VEHICLE, AUTOPILOT, &nameless)), 0);
        assert_int_equal(feed(frame_open_drone_id_operator_id(VEHICLE, AUTOPILOT, &no_operator)),
                         0);
        dirty_the_stack((uint8_t)dirt);
        assert_int_equal(feed(frame_open_drone_id_system(VEHICLE, AUTOPILOT, &no_system)), 0);
        dirty_the_stack((uint8_t)dirt);
        assert_int_equal(feed(frame_open_drone_id_system_update(VEHICLE, AUTOPILOT, &no_update)),
                         0);
        assert_int_equal(feed(frame_open_drone_id_authentication(VEHICLE, AUTOPILOT, &no_page)), 0);
    }
}

/* By it a ground station takes back what it said before. */
static void an_empty_description_is_one(void **state)
{
    const mavlink_open_drone_id_self_id_t no_text = {.description_type = 1};

    (void)state;
    assert_int_equal(feed(frame_open_drone_id_self_id(VEHICLE, AUTOPILOT, &no_text)), 1);
    assert_int_equal(updates[update_count - 1].kind, TELEMETRY_SELF_ID);
    assert_string_equal(updates[update_count - 1].self_id.text, "");
}

static void a_system_message_is_read(void **state)
{
    mavlink_open_drone_id_system_t in = {.operator_latitude = -337089000,
                                         .operator_longitude = 1519746000,
                                         .area_ceiling = 120.5F,
                                         .area_floor = -999.5F,
                                         .operator_altitude_geo = 48.5F,
                                         .timestamp = 243699123,
                                         .area_count = 65535,
                                         .area_radius = 2550,
                                         .operator_location_type = 1,
                                         .classification_type = 1,
                                         .category_eu = 2,
                                         .class_eu = 5};

    (void)state;
    feed(frame_open_drone_id_system(VEHICLE, AUTOPILOT, &in));
    assert_int_equal(latest()->kind, TELEMETRY_SYSTEM);
    assert_near(latest()->system.operator_latitude_deg, -33.7089);
    assert_near(latest()->system.operator_longitude_deg, 151.9746);
    assert_near(latest()->system.operator_altitude_m, 48.5);
    assert_near(latest()->system.area_ceiling_m, 120.5);
    assert_near(latest()->system.area_floor_m, -999.5);
    assert_int_equal(latest()->system.timestamp_2019_s, 243699123); /* no float on the way */
    assert_int_equal(latest()->system.area_count, 65535);
    assert_int_equal(latest()->system.area_radius_m, 2550);
    assert_int_equal(latest()->system.operator_location_type, 1);
    assert_int_equal(latest()->system.classification_type, 1);
    assert_int_equal(latest()->system.category_eu, 2);
    assert_int_equal(latest()->system.class_eu, 5);
    in.operator_latitude = in.operator_longitude = 0;
    in.area_ceiling = in.area_floor = in.operator_altitude_geo = -1000;
    feed(frame_open_drone_id_system(VEHICLE, AUTOPILOT, &in));
    assert_true(isnan(latest()->system.operator_latitude_deg));
    assert_true(isnan(latest()->system.operator_longitude_deg));
    assert_true(isnan(latest()->system.operator_altitude_m));
    assert_true(isnan(latest()->system.area_ceiling_m));
    assert_true(isnan(latest()->system.area_floor_m));
    in.area_ceiling = 3e38F; /* more than any field can say */
    in.area_floor = INFINITY;
    feed(frame_open_drone_id_system(VEHICLE, AUTOPILOT, &in));
    assert_true(isnan(latest()->system.area_ceiling_m));
    assert_true(isnan(latest()->system.area_floor_m));
}

static void a_system_update_is_read(void **state)
{
    const mavlink_open_drone_id_system_update_t in = {.operator_latitude = 577089000,
                                                      .operator_longitude = 119746000,
                                                      .operator_altitude_geo = NAN,
                                                      .timestamp = 243699123};

    (void)state;
    feed(frame_open_drone_id_system_update(VEHICLE, AUTOPILOT, &in));
    assert_int_equal(latest()->kind, TELEMETRY_SYSTEM_UPDATE);
    assert_near(latest()->system.operator_latitude_deg, 57.7089);
    assert_near(latest()->system.operator_longitude_deg, 11.9746);
    assert_true(isnan(latest()->system.operator_altitude_m));
    assert_int_equal(latest()->system.timestamp_2019_s, 243699123);
}

static void authentication_pages_are_read_and_impossible_ones_not(void **state)
{
    mavlink_open_drone_id_authentication_t in = {.authentication_type = 2,
                                                 .data_page = 15,
                                                 .last_page_index = 15,
                                                 .length = 255,
                                                 .timestamp = 7};

    (void)state;
    memset(in.authentication_data, 0xA5, sizeof(in.authentication_data));
    assert_int_equal(feed(frame_open_drone_id_authentication(VEHICLE, AUTOPILOT, &in)), 1);
    assert_int_equal(latest()->kind, TELEMETRY_AUTHENTICATION);
    assert_int_equal(latest()->authentication.type, 2);
    assert_int_equal(latest()->authentication.page, 15);
    assert_int_equal(latest()->authentication.last_page, 15);
    assert_int_equal(latest()->authentication.length, 255);
    assert_int_equal(latest()->authentication.timestamp_2019_s, 7);
    assert_memory_equal(latest()->authentication.data, in.authentication_data, 23);
    in.data_page = 16;
    assert_int_equal(feed(frame_open_drone_id_authentication(VEHICLE, AUTOPILOT, &in)), 0);
    in.data_page = 0;
    in.last_page_index = 16;
    assert_int_equal(feed(frame_open_drone_id_authentication(VEHICLE, AUTOPILOT, &in)), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(targets_from_the_autopilot, setup),
        cmocka_unit_test_setup(targets_from_another_component_of_the_vehicle, setup),
        cmocka_unit_test_setup(targets_from_a_ground_station, setup),
        cmocka_unit_test_setup(a_ground_station_gives_no_identity_to_an_aircraft_that_has_one,
                               setup),
        cmocka_unit_test_setup(other_systems_are_ignored, setup),
        cmocka_unit_test_setup(a_ground_station_is_one_by_its_heartbeat, setup),
        cmocka_unit_test_setup(nothing_counts_before_a_vehicle_is_known, setup),
        cmocka_unit_test_setup(another_transmitters_messages_are_ignored, setup),
        cmocka_unit_test_setup(messages_about_another_aircraft_are_ignored, setup),
        cmocka_unit_test_setup(texts_come_at_full_length, setup),
        cmocka_unit_test_setup(a_binary_id_keeps_its_zeros, setup),
        cmocka_unit_test_setup(empty_messages_are_absent, setup),
        cmocka_unit_test_setup(an_empty_identity_is_none, setup),
        cmocka_unit_test_setup(another_component_is_not_the_autopilots_word, setup),
        cmocka_unit_test_setup(a_ground_station_proves_nothing_for_a_vehicle_that_does, setup),
        cmocka_unit_test_setup(an_empty_description_is_one, setup),
        cmocka_unit_test_setup(a_system_message_is_read, setup),
        cmocka_unit_test_setup(a_system_update_is_read, setup),
        cmocka_unit_test_setup(authentication_pages_are_read_and_impossible_ones_not, setup),
    };

    return cmocka_run_group_tests_name("telemetry, native messages", tests, NULL, NULL);
}
