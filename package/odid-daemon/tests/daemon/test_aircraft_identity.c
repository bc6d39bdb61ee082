/* Identity: what is configured speaks, native fills what isn't, a difference is reported. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

static void native_id_bytes(uint8_t id_type, uint8_t ua_type, const char *id, size_t length)
{
    struct telemetry_update update = update_of(TELEMETRY_BASIC_ID);

    update.basic_id.id_type = id_type;
    update.basic_id.ua_type = ua_type;
    memcpy(update.basic_id.uas_id, id, length);
    give(&update);
}

static void native_id(uint8_t id_type, uint8_t ua_type, const char *id)
{
    native_id_bytes(id_type, ua_type, id, strlen(id));
}

static void native_operator(const char *id)
{
    struct telemetry_update update = update_of(TELEMETRY_OPERATOR_ID);

    strcpy(update.operator_id.operator_id, id);
    give(&update);
}

static void operator_by_ground(const char *id)
{
    struct telemetry_update update = update_of(TELEMETRY_OPERATOR_ID);

    update.by_another = true;
    strcpy(update.operator_id.operator_id, id);
    give(&update);
}

static void description_by_ground(uint8_t type, const char *text);

static void native_description(uint8_t type, const char *text)
{
    struct telemetry_update update = update_of(TELEMETRY_SELF_ID);

    update.self_id.type = type;
    strcpy(update.self_id.text, text);
    give(&update);
}

static void configure(unsigned i, uint8_t id_type, int ua_type, const char *id)
{
    config.basic_id[i].id_type = id_type;
    config.basic_id[i].ua_type = ua_type;
    strcpy(config.basic_id[i].uas_id, id);
}

static void assert_id(unsigned i, uint8_t id_type, uint8_t ua_type, const char *id,
                      enum source source)
{
    assert_true(i < view.basic_ids);
    assert_int_equal(view.basic_id[i].id_type, id_type);
    assert_int_equal(view.basic_id[i].ua_type, ua_type);
    assert_string_equal(view.basic_id[i].uas_id, id);
    assert_int_equal(view.basic_id[i].source, source);
}

/* ---- Basic ID ---- */

static void a_configured_serial_number_wins_over_the_native_one(void **state)
{
    (void)state;
    configure(0, 1, 1, "SSRS5GBG01");
    native_id(1, 2, "1AAA3XYZ");
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_id(0, 1, 1, "SSRS5GBG01", SOURCE_CONFIGURATION);
    assert_true(condition.basic_id_conflict);
}

static void the_same_serial_number_is_no_conflict(void **state)
{
    (void)state;
    configure(0, 1, 1, "SSRS5GBG01");
    look();
    assert_false(condition.basic_id_conflict);
    native_id(1, 2, "SSRS5GBG01");
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_false(condition.basic_id_conflict);
}

static void two_native_ids_are_kept_side_by_side(void **state)
{
    (void)state;
    native_id(2, 4, "SE-123");
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_id(0, 2, 4, "SE-123", SOURCE_NATIVE);
    native_id(1, 4, "1AAA3XYZ");
    look();
    assert_int_equal(view.basic_ids, 2);
    assert_id(0, 1, 4, "1AAA3XYZ", SOURCE_NATIVE);
    assert_id(1, 2, 4, "SE-123", SOURCE_NATIVE);
    native_id(1, 4, "1AAA3ZZZ");
    look();
    assert_int_equal(view.basic_ids, 2);
    assert_id(0, 1, 4, "1AAA3ZZZ", SOURCE_NATIVE);
}

/* A registration and a session's: there is room for both, and they took turns in one place. */
static void two_that_are_no_serial_numbers_have_a_place_each(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 3; i++) {
        native_id(2, 4, "SE-123");
        native_id(4, 4, "A-SESSION");
        look();
        assert_int_equal(view.basic_ids, 2);
        assert_true(view.basic_id[0].id_type + view.basic_id[1].id_type == 6);
    }
    native_id(1, 4, "1AAA3XYZ"); /* it comes first, and one of the others stays */
    native_id(2, 4, "SE-123");
    look();
    assert_int_equal(view.basic_ids, 2);
    assert_id(0, 1, 4, "1AAA3XYZ", SOURCE_NATIVE);
    assert_id(1, 2, 4, "SE-123", SOURCE_NATIVE);
    native_id(4, 4, "A-SESSION"); /* for a third one there is none */
    look();
    assert_id(1, 2, 4, "SE-123", SOURCE_NATIVE);
}

/* Somebody has corrected the type: the old one isn't said any more. */
static void an_identity_of_a_type_that_was_corrected_is_gone(void **state)
{
    (void)state;
    native_id(2, 4, "SE-123");
    for (unsigned i = 0; i < 40; i++) {
        fly(1);
        native_id(3 + i / 20, 4, "SE-123"); /* and again */
    }
    fly(15);
    native_id(4, 4, "SE-123");
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_id(0, 4, 4, "SE-123", SOURCE_NATIVE);
}

/* Nothing is configured, and two say something else: the autopilot's goes out, and it is told. */
static void what_two_say_differently_is_told(void **state)
{
    (void)state;
    native_operator("FIN87astrdge12k8");
    native_description(0, "sea rescue");
    look();
    assert_false(condition.operator_ids_differ || condition.descriptions_differ);
    description_by_ground(0, "sea rescue");
    look();
    assert_false(condition.descriptions_differ);
    description_by_ground(0, "survey");
    operator_by_ground("SWE87astrdge12k8");
    look();
    assert_true(condition.operator_ids_differ && condition.descriptions_differ);
    assert_string_equal(view.description, "sea rescue");
    assert_string_equal(view.operator_id, "FIN87astrdge12k8");
    fly(11); /* the ground station has gone */
    native_operator("FIN87astrdge12k8");
    native_description(0, "sea rescue");
    look();
    assert_false(condition.operator_ids_differ || condition.descriptions_differ);
    description_by_ground(0, "survey");
    operator_by_ground("SWE87astrdge12k8");
    strcpy(config.operator_id, "FIN87astrdge12k8");
    strcpy(config.description, "sea rescue");
    look();
    assert_false(condition.operator_ids_differ || condition.descriptions_differ);
}

static void ground_stations_id(uint8_t id_type, const char *id)
{
    struct telemetry_update update = update_of(TELEMETRY_BASIC_ID);

    update.by_another = true;
    update.basic_id.id_type = id_type;
    memcpy(update.basic_id.uas_id, id, strlen(id));
    give(&update);
}

/* 255/190 is everybody's QGroundControl. */
static void what_two_of_one_number_say_in_turn_is_told(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++) {
        operator_by_ground(i % 2 ? "FIN87astrdge12k8" : "SWE87astrdge12k8");
        description_by_ground(0, i % 2 ? "sea rescue" : "survey");
        ground_stations_id(1, i % 2 ? "SSRS5GBG01" : "SSRS5GBG02");
        look();
        assert_int_equal(condition.operator_ids_differ, i > 2);
        assert_int_equal(condition.descriptions_differ, i > 2);
        assert_int_equal(condition.basic_ids_differ, i > 2);
        fly(1);
    }
    fly(11);
    assert_false(condition.operator_ids_differ || condition.descriptions_differ ||
                 condition.basic_ids_differ);
}

/* One of another type stood beside the right one on every channel. ArduPilot repeats it as its own.
 */
static void nobody_adds_an_id_to_a_configured_one(void **state)
{
    (void)state;
    configure(0, 1, 2, "SSRS5GBG01");
    ground_stations_id(2, "N-FALSE");
    look();
    assert_int_equal(view.basic_ids, 1);
    native_id(2, 2, "N-FALSE");
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_id(0, 1, 2, "SSRS5GBG01", SOURCE_CONFIGURATION);
    assert_true(condition.basic_id_conflict);
}

static void what_a_ground_station_said_of_it_ends_with_the_vehicles_own_word(void **state)
{
    (void)state;
    ground_stations_id(1, "SSRS5FALSE1");
    ground_stations_id(2, "N-FALSE");
    look();
    assert_int_equal(view.basic_ids, 2); /* nobody else has said who it is */
    native_id(1, 2, "SSRS5GBG01");
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_id(0, 1, 2, "SSRS5GBG01", SOURCE_NATIVE);
}

static void two_configured_ids_leave_no_room_for_a_third(void **state)
{
    (void)state;
    configure(0, 1, 1, "SSRS5GBG01");
    configure(1, 2, 1, "SE-123");
    native_id(4, 1, "session");
    look();
    assert_int_equal(view.basic_ids, 2);
    assert_id(1, 2, 1, "SE-123", SOURCE_CONFIGURATION);
}

static void the_second_place_alone_may_be_configured(void **state)
{
    (void)state;
    configure(1, 2, 1, "SE-123");
    native_id(1, 1, "1AAA3XYZ");
    look();
    assert_int_equal(view.basic_ids, 2);
    assert_id(0, 2, 1, "SE-123", SOURCE_CONFIGURATION);
    assert_id(1, 1, 1, "1AAA3XYZ", SOURCE_NATIVE);
}

static void an_id_of_20_characters_is_kept_whole(void **state)
{
    (void)state;
    native_id(1, 1, "ABCDFGHJKLMNPQRSTUVW");
    configure(1, 2, 1, "abcdfghjklmnpqrstuvw");
    look();
    assert_id(0, 2, 1, "abcdfghjklmnpqrstuvw", SOURCE_CONFIGURATION);
    assert_id(1, 1, 1, "ABCDFGHJKLMNPQRSTUVW", SOURCE_NATIVE);
}

/* A UUID may begin with a zero byte. */
static void a_binary_id_is_kept_with_its_zeros(void **state)
{
    static const char uuid[20] = {0, 1, 0, 2, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0, 4};

    (void)state;
    native_id_bytes(3, 2, uuid, sizeof(uuid));
    look();
    assert_int_equal(view.basic_ids, 1);
    assert_int_equal(view.basic_id[0].id_type, 3);
    assert_memory_equal(view.basic_id[0].uas_id, uuid, sizeof(uuid));
}

static void a_shorter_id_leaves_nothing_of_a_longer_one(void **state)
{
    static const char padded[21] = "AB";

    (void)state;
    native_id(1, 1, "ABCDFGHJKLMNPQRSTUVW");
    look();
    native_id(1, 1, "AB");
    look();
    assert_memory_equal(view.basic_id[0].uas_id, padded, sizeof(padded));
}

/* ---- UA type ---- */

static void ua_type_auto_follows_the_heartbeat(void **state)
{
    (void)state;
    configure(0, 1, CONFIG_UA_TYPE_AUTO, "SSRS5GBG01");
    look();
    assert_int_equal(view.basic_id[0].ua_type, 0);
    sim.mav_type = MAV_TYPE_HEXAROTOR;
    heartbeat();
    look();
    assert_int_equal(view.basic_id[0].ua_type, 2);
    sim.mav_type = MAV_TYPE_FIXED_WING;
    fly(4);
    assert_int_equal(view.basic_id[0].ua_type, 1);
}

/* As the autopilot, on its own side: the UA type on the air was by turns the forger's. */
static void who_forges_heartbeats_does_not_change_what_it_is(void **state)
{
    struct telemetry_update forged = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    configure(0, 1, CONFIG_UA_TYPE_AUTO, "SSRS5GBG01");
    sim.mav_type = MAV_TYPE_HEXAROTOR;
    sim.autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA;
    fly(5);
    forged.heartbeat.mav_type = MAV_TYPE_FREE_BALLOON;
    forged.heartbeat.autopilot = MAV_AUTOPILOT_PX4;
    forged.heartbeat.base_mode = MAV_MODE_FLAG_HIL_ENABLED;
    for (unsigned i = 0; i < 60; i++) {
        forged.heartbeat.doubtful = i >= 4; /* seen after some of them */
        for (unsigned in_a_row = 0; in_a_row <= i % 3; in_a_row++) {
            give(&forged);
            look();
            assert_int_equal(view.basic_id[0].ua_type, 2);
            assert_int_equal(condition.mav_type, MAV_TYPE_HEXAROTOR);
            assert_int_equal(condition.autopilot, MAV_AUTOPILOT_ARDUPILOTMEGA);
            assert_false(condition.simulated);
        }
        fly(1);
        assert_int_equal(view.basic_id[0].ua_type, 2);
    }
}

/* One parameter made a balloon of it, and nobody was told; or a tracker, which is no vehicle. */
static void what_it_is_does_not_change_in_flight(void **state)
{
    static const uint8_t types[] = {MAV_TYPE_FREE_BALLOON, MAV_TYPE_ANTENNA_TRACKER, MAV_TYPE_GCS};

    (void)state;
    configure(0, 1, CONFIG_UA_TYPE_AUTO, "SSRS5GBG01");
    sim.mav_type = MAV_TYPE_HEXAROTOR;
    fly(5);
    arm(true);
    fly(10);
    for (size_t i = 0; i < sizeof(types); i++) {
        sim.mav_type = types[i];
        fly(10);
        assert_int_equal(view.basic_id[0].ua_type, 2);
        assert_int_equal(condition.said_mav_type, types[i]);
        assert_true(condition.heartbeat_fresh);
    }
    arm(false);
    sim.mav_type = MAV_TYPE_FREE_BALLOON;
    fly(10);
    assert_int_equal(view.basic_id[0].ua_type, 8);
}

/* Of a daemon that was started in the air: as ever. */
static void a_type_that_was_said_in_flight_alone_may_be_put_right(void **state)
{
    (void)state;
    configure(0, 1, CONFIG_UA_TYPE_AUTO, "SSRS5GBG01");
    arm(true);
    sim.mav_type = MAV_TYPE_FREE_BALLOON;
    fly(5);
    assert_int_equal(view.basic_id[0].ua_type, 8);
    sim.mav_type = MAV_TYPE_HEXAROTOR;
    fly(5);
    assert_int_equal(view.basic_id[0].ua_type, 2);
}

/* "Other" went out. */
static void a_heartbeat_of_none_that_flies_leaves_the_native_type(void **state)
{
    (void)state;
    configure(0, 1, CONFIG_UA_TYPE_AUTO, "SSRS5GBG01");
    sim.mav_type = MAV_TYPE_GCS;
    fly(5);
    assert_int_equal(view.basic_id[0].ua_type, 0);
    native_id(2, 4, "SE-123");
    fly(1);
    assert_int_equal(view.basic_id[0].ua_type, 4);
}

static void ua_type_auto_takes_the_native_one_without_a_heartbeat(void **state)
{
    (void)state;
    configure(0, 1, CONFIG_UA_TYPE_AUTO, "SSRS5GBG01");
    native_id(2, 4, "SE-123");
    look();
    assert_int_equal(view.basic_id[0].ua_type, 4);
    sim.mav_type = MAV_TYPE_QUADROTOR;
    heartbeat();
    look();
    assert_int_equal(view.basic_id[0].ua_type, 2);
}

/* A BASIC_ID in which nobody filled it: the autopilot's HEARTBEAT knows. */
static void a_native_ua_type_of_none_is_the_heartbeats(void **state)
{
    (void)state;
    native_id(1, 0, "SSRS5GBG01");
    sim.mav_type = MAV_TYPE_FIXED_WING;
    heartbeat();
    look();
    assert_id(0, 1, 1, "SSRS5GBG01", SOURCE_NATIVE);
}

static void a_configured_ua_type_stays(void **state)
{
    (void)state;
    for (int type = 0; type <= 15; type++) {
        configure(0, 1, type, "SSRS5GBG01");
        native_id(1, 4, "SSRS5GBG01");
        heartbeat();
        look();
        assert_int_equal(view.basic_id[0].ua_type, type);
    }
}

/* ---- Operator ID and Self ID ---- */

/* QGroundControl's entry may hold all of it; the secret part never goes on the air. */
static void the_secret_part_of_a_native_operator_number_is_taken_off(void **state)
{
    static const char *const given[] = {"FIN87astrdge12k8-xyz", "FIN87astrdge12k8xyz",
                                        "FIN87astrdge12k8 xyz", "fin87ASTRDGE12K8-xyz"};

    (void)state;
    for (size_t i = 0; i < sizeof(given) / sizeof(given[0]); i++) {
        native_operator(given[i]);
        look();
        assert_int_equal(strlen(view.operator_id), 16);
        assert_memory_equal(view.operator_id, given[i], 16);
    }
}

/* Another authority's, of 17 to 20 characters, of which the first 16 look like an EU one. */
static void a_native_operator_number_is_not_cut_for_its_look(void **state)
{
    static const char *const given[] = {"USA12345678901234567", "FIN87ASTRDGE12K8XYZW",
                                        "JPN0123456789ABCDEF", "CHN123456789012345"};

    (void)state;
    for (size_t i = 0; i < sizeof(given) / sizeof(given[0]); i++) {
        native_operator(given[i]);
        look();
        assert_string_equal(view.operator_id, given[i]);
    }
}

static void nor_does_it_go_out_in_other_native_texts(void **state)
{
    (void)state;
    native_description(0, "FIN87astrdge12k8-xyz");
    native_id(2, 2, "FIN87astrdge12k8-xyz");
    look();
    assert_string_equal(view.description, "FIN87astrdge12k8");
    assert_string_equal(view.basic_id[0].uas_id, "FIN87astrdge12k8");
}

static void a_configured_operator_wins_and_a_difference_is_reported(void **state)
{
    (void)state;
    native_operator("FIN87astrdge12k8");
    look();
    assert_string_equal(view.operator_id, "FIN87astrdge12k8");
    assert_false(condition.operator_id_conflict);
    strcpy(config.operator_id, "SWE3jxza7qbzvu5d");
    look();
    assert_string_equal(view.operator_id, "SWE3jxza7qbzvu5d");
    assert_true(condition.operator_id_conflict);
    native_operator("SWE3jxza7qbzvu5d");
    look();
    assert_false(condition.operator_id_conflict);
}

static void description_by_ground(uint8_t type, const char *text)
{
    struct telemetry_update update = update_of(TELEMETRY_SELF_ID);

    update.by_another = true;
    update.self_id.type = type;
    strcpy(update.self_id.text, text);
    give(&update);
    look();
}

static void assert_description(const char *text, uint8_t type, enum aircraft_status status)
{
    assert_string_equal(view.description, text);
    assert_int_equal(view.description_type, type);
    assert_int_equal(view.location.status, status);
    assert_int_equal(condition.emergency_declared, status == AIRCRAFT_EMERGENCY);
}

/* What is configured knows nothing of the moment. */
static void a_declared_emergency_goes_before_what_is_configured(void **state)
{
    (void)state;
    strcpy(config.description, "Sea rescue surveillance");
    arm(true);
    fly(5);
    for (unsigned i = 0; i < 10; i++) {
        description_by_ground(1, "Engine failure");
        assert_description("Engine failure", 1, AIRCRAFT_EMERGENCY);
        fly(1);
    }
    description_by_ground(0, "");
    assert_description("Engine failure", 1, AIRCRAFT_EMERGENCY); /* another one may have said so */
    fly(2);
    assert_description("Sea rescue surveillance", 0, AIRCRAFT_AIRBORNE);
}

static void a_declared_emergency_ends_by_silence(void **state)
{
    (void)state;
    arm(true);
    fly(5);
    description_by_ground(1, "Engine failure");
    fly(9.9);
    assert_description("Engine failure", 1, AIRCRAFT_EMERGENCY);
    fly(0.2);
    assert_description("", 0, AIRCRAFT_AIRBORNE);
}

/* ArduPilot says its empty description beside the ground station's. */
static void an_empty_description_takes_back_its_senders_only(void **state)
{
    (void)state;
    arm(true);
    fly(5);
    for (unsigned i = 0; i < 5; i++) {
        description_by_ground(1, "Engine failure");
        native_description(0, "");
        fly(1);
        assert_description("Engine failure", 1, AIRCRAFT_EMERGENCY);
    }
    native_description(2, "Training");
    description_by_ground(1, "");
    fly(2);
    assert_description("Training", 2, AIRCRAFT_AIRBORNE);
    description_by_ground(0, "Survey");
    assert_description("Training", 2, AIRCRAFT_AIRBORNE);
    native_description(2, "");
    look();
    assert_description("Survey", 0, AIRCRAFT_AIRBORNE);
}

static void a_configured_description_wins_with_its_type(void **state)
{
    (void)state;
    native_description(2, "Extended");
    look();
    assert_true(view.self_id_set);
    assert_string_equal(view.description, "Extended");
    assert_int_equal(view.description_type, 2);
    strcpy(config.description, "Sea rescue surveillance");
    look();
    assert_string_equal(view.description, "Sea rescue surveillance");
    assert_int_equal(view.description_type, 0);
}

/* ---- Authentication ---- */

static unsigned page_speaker; /* 0: the vehicle; else one on the ground */

static void page(unsigned index, unsigned last, uint32_t timestamp, uint8_t fill)
{
    struct telemetry_update update = update_of(TELEMETRY_AUTHENTICATION);

    update.by_another = page_speaker != 0;
    update.speaker = (uint16_t)page_speaker;
    update.authentication.type = 1;
    update.authentication.page = (uint8_t)index;
    update.authentication.last_page = (uint8_t)(index == 0 ? last : 0);
    update.authentication.length = (uint8_t)(index == 0 ? 17 + 23 * last : 0);
    update.authentication.timestamp_2019_s = index == 0 ? timestamp : 0;
    memset(update.authentication.data, fill, index == 0 ? 17 : 23);
    give(&update);
    look();
}

static void authentication_counts_when_all_pages_have_come(void **state)
{
    (void)state;
    page(0, 2, 5, 0xA0);
    assert_int_equal(view.auth_pages, 0);
    page(2, 2, 5, 0xA2);
    assert_int_equal(view.auth_pages, 0);
    page(1, 2, 5, 0xA1);
    assert_int_equal(view.auth_pages, 3);
    for (unsigned i = 0; i < 3; i++) {
        assert_int_equal(view.auth[i].page, i);
        assert_int_equal(view.auth[i].data[16], 0xA0 + i);
    }
    assert_int_equal(view.auth[0].last_page, 2);
    assert_int_equal(view.auth[0].length, 63);
    assert_int_equal(view.auth[0].timestamp_2019_s, 5);
}

/* It is of its time: who sends it no more has taken it back. */
static void authentication_ends_by_silence(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 16; i++) {
        page(i, 15, 5, (uint8_t)i);
        fly(1);
    }
    fly(13);
    assert_int_equal(view.auth_pages, 16);
    fly(2);
    assert_int_equal(view.auth_pages, 16);
    fly(15);
    assert_int_equal(view.auth_pages, 0);
    page(3, 15, 5, 3); /* it goes on with any page of the same */
    assert_int_equal(view.auth_pages, 16);
}

static void a_ground_station_s_description_is_spare_beside_the_vehicle_s_pages(void **state)
{
    (void)state;
    page(0, 0, 5, 0xA0);
    assert_false(view.description_spare);
    description_by_ground(0, "survey");
    assert_true(view.description_spare);
    description_by_ground(1, "Engine failure");
    assert_false(view.description_spare);
    description_by_ground(0, "survey");
    native_description(0, "sea rescue");
    look();
    assert_false(view.description_spare);
}

static void it_is_not_beside_a_ground_station_s_pages(void **state)
{
    (void)state;
    page_speaker = 255 << 8 | 190;
    page(0, 0, 5, 0xA0);
    page_speaker = 0;
    description_by_ground(0, "survey");
    assert_int_equal(view.auth_pages, 1);
    assert_false(view.description_spare);
}

static void what_is_configured_is_not_spare(void **state)
{
    (void)state;
    strcpy(config.description, "Sea rescue surveillance");
    page(0, 0, 5, 0xA0);
    description_by_ground(0, "survey");
    assert_false(view.description_spare);
}

static void authentication_of_one_page_is_whole(void **state)
{
    (void)state;
    page(0, 0, 5, 0xA0);
    assert_int_equal(view.auth_pages, 1);
}

static void authentication_of_16_pages_is_whole(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 16; i++) {
        assert_int_equal(view.auth_pages, 0);
        page(i, 15, 5, (uint8_t)i);
    }
    assert_int_equal(view.auth_pages, 16);
}

static void repeated_pages_change_nothing(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 9; i++) {
        page(i % 3, 2, 5, (uint8_t)(0xA0 + i % 3));
        assert_int_equal(view.auth_pages, i >= 2 ? 3 : 0);
    }
}

static void a_new_page_0_starts_another_authentication(void **state)
{
    (void)state;
    page(0, 1, 5, 0xA0);
    page(1, 1, 5, 0xA1);
    assert_int_equal(view.auth_pages, 2);
    page(0, 1, 6, 0xA0);
    assert_int_equal(view.auth_pages, 0);
    page(1, 1, 6, 0xB1);
    assert_int_equal(view.auth_pages, 2);
    assert_int_equal(view.auth[1].data[0], 0xB1);
    page(0, 0, 6, 0xA0); /* shorter */
    assert_int_equal(view.auth_pages, 1);
}

/* The new page 0 was lost on the way: its page 1 must not stand under the old page 0. */
static void pages_of_two_authentications_never_mix(void **state)
{
    (void)state;
    page(0, 1, 5, 0xA0);
    page(1, 1, 5, 0xA1);
    page(1, 1, 6, 0xB1);
    assert_int_equal(view.auth_pages, 0);
    page(0, 1, 6, 0xB0);
    assert_int_equal(view.auth_pages, 0);
    page(1, 1, 6, 0xB1);
    assert_int_equal(view.auth_pages, 2);
    assert_int_equal(view.auth[0].data[0], 0xB0);
    assert_int_equal(view.auth[1].data[0], 0xB1);
}

/* One page a second was enough to keep another's from ever being whole, or to mix it with one's
 * own. */
static void a_second_speaker_neither_ends_nor_mixes_an_authentication(void **state)
{
    (void)state;
    page_speaker = 255;
    page(0, 1, 5, 0xA0);
    page_speaker = 254;
    page(1, 1, 5, 0xB1);
    page(0, 1, 6, 0xB0);
    assert_int_equal(view.auth_pages, 0);
    page_speaker = 255;
    page(1, 1, 5, 0xA1);
    assert_int_equal(view.auth_pages, 2);
    assert_int_equal(view.auth[1].data[0], 0xA1);
    page_speaker = 0; /* the vehicle's own comes first */
    page(0, 1, 7, 0xC0);
    page_speaker = 255;
    page(1, 1, 5, 0xA1);
    page_speaker = 0;
    page(1, 1, 7, 0xC1);
    assert_int_equal(view.auth_pages, 2);
    assert_int_equal(view.auth[1].data[0], 0xC1);
}

/* The vehicle's old signature came back with a page of somebody else's. */
static void nobody_else_goes_on_with_an_authentication(void **state)
{
    (void)state;
    page(0, 1, 5, 0xA0);
    page(1, 1, 5, 0xA1);
    assert_int_equal(view.auth_pages, 2);
    fly(60);
    page_speaker = 255;
    page(2, 2, 5, 0xB2);
    assert_int_equal(view.auth_pages, 0);
}

static void joining_in_the_middle_waits_for_page_0(void **state)
{
    (void)state;
    page(1, 2, 5, 0xA1);
    page(2, 2, 5, 0xA2);
    page(0, 2, 5, 0xA0);
    assert_int_equal(view.auth_pages, 0);
    page(1, 2, 5, 0xA1);
    page(2, 2, 5, 0xA2);
    assert_int_equal(view.auth_pages, 3);
}

static void impossible_pages_are_ignored(void **state)
{
    (void)state;
    for (unsigned last = 16; last < 256; last++) {
        page(0, last, 5, 0xA0);
        assert_int_equal(view.auth_pages, 0);
    }
    for (unsigned index = 16; index < 256; index++) {
        page(index, 0, 5, 0xA0);
        assert_int_equal(view.auth_pages, 0);
    }
}

/* They took turns on every channel, each second, and nobody was told. */
static void of_two_ground_stations_the_first_one_says_who_it_is(void **state)
{
    static const char *const ids[] = {"SSRS5GBG01", "SSRS5GBG02"};

    (void)state;
    for (unsigned i = 0; i < 40; i++) {
        struct telemetry_update update = update_of(TELEMETRY_BASIC_ID);

        update.by_another = true;
        update.speaker = (uint16_t)(1 + i % 2);
        update.basic_id.id_type = 1;
        strcpy(update.basic_id.uas_id, ids[i % 2]);
        give(&update);
        look();
        assert_int_equal(view.basic_ids, 1);
        assert_string_equal(view.basic_id[0].uas_id, ids[0]);
        assert_int_equal(condition.basic_ids_differ, i > 0);
        fly(0.5);
    }
    fly(11);
    assert_false(condition.basic_ids_differ);
}

static void what_differs_from_the_configured_description_is_told(void **state)
{
    (void)state;
    strcpy(config.description, "sea rescue");
    description_by_ground(0, "sea rescue");
    look();
    assert_false(condition.description_conflict);
    description_by_ground(2, "Lost link, returning");
    look();
    assert_true(condition.description_conflict);
    assert_string_equal(view.description, "sea rescue");
    fly(11);
    assert_false(condition.description_conflict);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_configured_serial_number_wins_over_the_native_one, begin_setup),
        cmocka_unit_test_setup(the_same_serial_number_is_no_conflict, begin_setup),
        cmocka_unit_test_setup(two_native_ids_are_kept_side_by_side, begin_setup),
        cmocka_unit_test_setup(nobody_adds_an_id_to_a_configured_one, begin_setup),
        cmocka_unit_test_setup(what_a_ground_station_said_of_it_ends_with_the_vehicles_own_word,
                               begin_setup),
        cmocka_unit_test_setup(two_configured_ids_leave_no_room_for_a_third, begin_setup),
        cmocka_unit_test_setup(the_second_place_alone_may_be_configured, begin_setup),
        cmocka_unit_test_setup(an_id_of_20_characters_is_kept_whole, begin_setup),
        cmocka_unit_test_setup(a_binary_id_is_kept_with_its_zeros, begin_setup),
        cmocka_unit_test_setup(a_shorter_id_leaves_nothing_of_a_longer_one, begin_setup),
        cmocka_unit_test_setup(ua_type_auto_follows_the_heartbeat, begin_setup),
        cmocka_unit_test_setup(who_forges_heartbeats_does_not_change_what_it_is, begin_setup),
        cmocka_unit_test_setup(what_it_is_does_not_change_in_flight, begin_setup),
        cmocka_unit_test_setup(a_type_that_was_said_in_flight_alone_may_be_put_right, begin_setup),
        cmocka_unit_test_setup(a_heartbeat_of_none_that_flies_leaves_the_native_type, begin_setup),
        cmocka_unit_test_setup(ua_type_auto_takes_the_native_one_without_a_heartbeat, begin_setup),
        cmocka_unit_test_setup(a_native_ua_type_of_none_is_the_heartbeats, begin_setup),
        cmocka_unit_test_setup(a_configured_ua_type_stays, begin_setup),
        cmocka_unit_test_setup(the_secret_part_of_a_native_operator_number_is_taken_off,
                               begin_setup),
        cmocka_unit_test_setup(a_native_operator_number_is_not_cut_for_its_look, begin_setup),
        cmocka_unit_test_setup(nor_does_it_go_out_in_other_native_texts, begin_setup),
        cmocka_unit_test_setup(a_configured_operator_wins_and_a_difference_is_reported,
                               begin_setup),
        cmocka_unit_test_setup(a_configured_description_wins_with_its_type, begin_setup),
        cmocka_unit_test_setup(a_declared_emergency_goes_before_what_is_configured, begin_setup),
        cmocka_unit_test_setup(a_declared_emergency_ends_by_silence, begin_setup),
        cmocka_unit_test_setup(an_empty_description_takes_back_its_senders_only, begin_setup),
        cmocka_unit_test_setup(authentication_counts_when_all_pages_have_come, begin_setup),
        cmocka_unit_test_setup(a_ground_station_s_description_is_spare_beside_the_vehicle_s_pages,
                               begin_setup),
        cmocka_unit_test_setup(it_is_not_beside_a_ground_station_s_pages, begin_setup),
        cmocka_unit_test_setup(what_is_configured_is_not_spare, begin_setup),
        cmocka_unit_test_setup(authentication_of_one_page_is_whole, begin_setup),
        cmocka_unit_test_setup(authentication_of_16_pages_is_whole, begin_setup),
        cmocka_unit_test_setup(repeated_pages_change_nothing, begin_setup),
        cmocka_unit_test_setup(a_new_page_0_starts_another_authentication, begin_setup),
        cmocka_unit_test_setup(pages_of_two_authentications_never_mix, begin_setup),
        cmocka_unit_test_setup(a_second_speaker_neither_ends_nor_mixes_an_authentication,
                               begin_setup),
        cmocka_unit_test_setup(nobody_else_goes_on_with_an_authentication, begin_setup),
        cmocka_unit_test_setup(joining_in_the_middle_waits_for_page_0, begin_setup),
        cmocka_unit_test_setup(impossible_pages_are_ignored, begin_setup),
        cmocka_unit_test_setup(authentication_ends_by_silence, begin_setup),
        cmocka_unit_test_setup(two_that_are_no_serial_numbers_have_a_place_each, begin_setup),
        cmocka_unit_test_setup(an_identity_of_a_type_that_was_corrected_is_gone, begin_setup),
        cmocka_unit_test_setup(what_two_say_differently_is_told, begin_setup),
        cmocka_unit_test_setup(what_two_of_one_number_say_in_turn_is_told, begin_setup),
        cmocka_unit_test_setup(what_differs_from_the_configured_description_is_told, begin_setup),
        cmocka_unit_test_setup(of_two_ground_stations_the_first_one_says_who_it_is, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, identity", tests, NULL, NULL);
}
