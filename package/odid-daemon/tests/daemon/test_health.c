/* What is wrong, in which order, and what is told. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <common/mavlink.h>

#include <stdio.h>

#include "health_fixture.h"

static struct health health;

static void judge(void)
{
    bool warnings = false;

    health_judge(&health, &fixture.input, NOW);
    assert_true(health.count <= HEALTH_MAX);
    for (unsigned i = 0; i < health.count; i++) {
        const struct health_problem *problem = &health.problem[i];

        assert_in_range(strlen(problem->reason), 1, 49);
        assert_in_range(strlen(problem->advice), 10, 118); /* 119 would mean: perhaps cut */
        warnings = warnings || problem->severity == HEALTH_WARNING;
        assert_int_equal(problem->severity, warnings ? HEALTH_WARNING : HEALTH_FAULT);
    }
}

static int reset(void **state)
{
    (void)state;
    fixture_reset();
    return 0;
}

/* Exactly this one thing is wrong. */
static void expect_one(enum health_severity severity, const char *reason)
{
    judge();
    assert_int_equal(health.count, 1);
    assert_string_equal(health.problem[0].reason, reason);
    assert_int_equal(health.problem[0].severity, severity);
    assert_string_equal(health_reason(&health), severity == HEALTH_FAULT ? reason : "");
}

static bool has(const char *reason)
{
    for (unsigned i = 0; i < health.count; i++) {
        if (strcmp(health.problem[i].reason, reason) == 0) {
            return true;
        }
    }
    return false;
}

static void nothing_is_wrong(void **state)
{
    (void)state;
    judge();
    assert_int_equal(health.count, 0);
    assert_true(health.on_air);
    assert_string_equal(health_reason(&health), "");
}

/* ---- identity ---- */

static void no_basic_id(void **state)
{
    (void)state;
    fixture.view.basic_ids = 0;
    expect_one(HEALTH_FAULT, "missing basic_id message"); /* QGroundControl compares it */
    assert_true(health.on_air);
}

static void no_operator_id(void **state)
{
    (void)state;
    fixture.view.operator_id[0] = '\0';
    expect_one(HEALTH_FAULT, "missing operator_id message");
}

static void wrong_serial(void **state)
{
    (void)state;
    strcpy(fixture.view.basic_id[0].uas_id, "SSRSGBG0010123456789"); /* 20: the reason is full */
    expect_one(HEALTH_FAULT, "Basic ID is no valid serial: SSRSGBG0010123456789");
    strcpy(fixture.view.basic_id[0].uas_id, "PX4\x01\xFF"
                                            "board");
    fixture.view.basic_id[0].source = SOURCE_NATIVE;
    expect_one(HEALTH_FAULT, "Basic ID is no valid serial: PX4??board");
    assert_non_null(strstr(health.problem[0].advice, "autopilot"));
}

static void second_identifier(void **state)
{
    (void)state;
    fixture.view.basic_ids = 2;
    fixture.view.basic_id[1].id_type = 2; /* a registration has no format that is checked */
    strcpy(fixture.view.basic_id[1].uas_id, "SE-ABC");
    judge();
    assert_int_equal(health.count, 0);
    fixture.view.basic_id[0].id_type = 3;
    expect_one(HEALTH_WARNING, "no serial number among the Basic IDs");
}

static void wrong_operator_number(void **state)
{
    (void)state;
    strcpy(fixture.view.operator_id, "SWE3JXZA7QBZVU5D");
    expect_one(HEALTH_FAULT, "Operator ID is no EU number: SWE3JXZA7QBZVU5D");
    fixture.view.operator_id_type = 201; /* private use: not ours to check */
    judge();
    assert_int_equal(health.count, 0);
}

static void conflicts(void **state)
{
    (void)state;
    fixture.condition.basic_id_conflict = 1;
    expect_one(HEALTH_WARNING, "autopilot sends another Basic ID");
    fixture.condition.basic_id_conflict = 0;
    fixture.condition.operator_id_conflict = 1;
    expect_one(HEALTH_WARNING, "autopilot sends another operator ID");
}

static void types_that_are_not_alike(void **state)
{
    static const struct {
        uint8_t said, mav_type;
        bool conflict;
    } cases[] = {
        {1, MAV_TYPE_FIXED_WING, false},     {1, MAV_TYPE_QUADROTOR, true},
        {2, MAV_TYPE_QUADROTOR, false},      {2, MAV_TYPE_FIXED_WING, true},
        {4, MAV_TYPE_FIXED_WING, false}, /* a quadplane */
        {1, MAV_TYPE_VTOL_TILTROTOR, false}, {0, MAV_TYPE_QUADROTOR, false},
        {15, MAV_TYPE_QUADROTOR, false},     {1, MAV_TYPE_GENERIC, false},
    };

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        fixture.view.basic_id[0].ua_type = cases[i].said;
        fixture.condition.said_mav_type = cases[i].mav_type;
        if (cases[i].conflict) {
            expect_one(HEALTH_WARNING, "HEARTBEAT has another UA type");
        } else {
            judge();
            assert_int_equal(health.count, 0);
        }
    }
    fixture.view.basic_ids = 2;
    fixture.view.basic_id[1].id_type = 2;
    strcpy(fixture.view.basic_id[1].uas_id, "SSRS5GBG01");
    expect_one(HEALTH_WARNING, "serial number of another type");
}

static void what_is_not_believed(void **state)
{
    (void)state;
    fixture.condition.altitudes_differ = true;
    expect_one(HEALTH_WARNING, "native altitude not believed");
    fixture.condition.altitudes_differ = false;
    fixture.condition.landed_state_wrong = true;
    expect_one(HEALTH_WARNING, "landed state not believed");
}

/* ---- autopilot ---- */

static void link_states(void **state)
{
    (void)state;
    fixture.link.state = LINK_ABSENT;
    fixture.condition.heartbeat_fresh = false;
    expect_one(HEALTH_FAULT, "no link to the autopilot"); /* the cause, not what follows from it */
    assert_string_equal(health.problem[0].advice,
                        "Plug in the autopilot's USB cable, or set [mavlink] device.");
    fixture.link.state = LINK_SILENT;
    expect_one(HEALTH_FAULT, "autopilot is silent");
    assert_non_null(strstr(health.problem[0].advice, "baud"));
    fixture.config.source = MAVLINK_SOURCE_UDP;
    expect_one(HEALTH_FAULT, "autopilot is silent");
    assert_non_null(strstr(health.problem[0].advice, "mavlink-router"));
    fixture.link.state = LINK_ABSENT;
    judge();
    assert_non_null(strstr(health.problem[0].advice, "udp_port"));
    fixture.link.state = LINK_ALIVE;
    expect_one(HEALTH_FAULT, "no heartbeat from autopilot");
    assert_non_null(strstr(health.problem[0].advice, "Its other messages come"));
    fixture.input.speaks = false;
    expect_one(HEALTH_FAULT, "no heartbeat from autopilot");
    assert_non_null(strstr(health.problem[0].advice, "no autopilot (component 1) speaks"));
    fixture.input.another_id = true;
    expect_one(HEALTH_FAULT, "another system id speaks");
    assert_non_null(strstr(health.problem[0].advice, "set it back"));
    fixture.input.another_id = false;
    /* A ground station's frames come by mavlink-router: what carries them is right. */
    fixture.input.others_only = true;
    expect_one(HEALTH_FAULT, "autopilot is silent");
    assert_string_equal(health.problem[0].id, "autopilot-silent");
    assert_non_null(strstr(health.problem[0].advice, "is it powered?"));
    fixture.condition.heartbeat_fresh = true; /* its last one isn't old yet */
    judge();
    assert_int_equal(health.count, 0);
}

static void positions(void **state)
{
    (void)state;
    fixture.view.location.position_fresh = false;
    fixture.view.location.fix_us = INT64_MIN;
    fixture.view.location.status = AIRCRAFT_REMOTE_ID_FAILURE; /* ours: told by its cause */
    expect_one(HEALTH_FAULT, "no position from autopilot");
    fixture.view.location.fix_us = NOW - 12900000;
    expect_one(HEALTH_FAULT, "position stopped 12 s ago");
    fixture.condition.fix_known = false;
    expect_one(HEALTH_FAULT, "autopilot has no GNSS fix");
    fixture.view.location.position_source = SOURCE_CONFIGURATION;
    fixture.config.bench_latitude_deg = 57.5;
    expect_one(HEALTH_FAULT, "bench position configured");
}

/* It was good to arm while the autopilot had a place, and the invented one went out when that was
 * lost. */
static void a_bench_position_is_a_fault_before_it_is_on_the_air(void **state)
{
    (void)state;
    fixture.config.bench_latitude_deg = 57.5;
    expect_one(HEALTH_FAULT, "bench position configured");
}

static void fields_that_stay_unknown(void **state)
{
    (void)state;
    fixture.view.location.height_m = NAN;
    judge();
    assert_int_equal(health.count, 0); /* known from arming on */
    fixture.condition.armed = true;
    expect_one(HEALTH_WARNING, "height above take-off unknown");
    fixture.view.location.height_m = 12;
    fixture.view.location.altitude_geodetic_m = NAN;
    expect_one(HEALTH_WARNING, "altitude above the ellipsoid unknown");
    fixture.view.location.altitude_geodetic_m = 48;
    fixture.view.location.horizontal_accuracy = 0;
    expect_one(HEALTH_WARNING, "accuracy of position unknown");
    /* Lost a moment ago: that is told when the position goes. */
    fixture.condition.fix_known = false;
    judge();
    assert_int_equal(health.count, 0);
    fixture.condition.fix_known = true;
    fixture.view.location.horizontal_accuracy = 10;
    fixture.condition.takeoff_is_late = true;
    expect_one(HEALTH_WARNING, "take-off point is the first fix after arming");
}

static void an_operator_altitude_that_stays_unknown(void **state)
{
    static const struct {
        enum source source;
        const char *advice;
    } rows[] = {
        {SOURCE_CONFIGURATION, "set [system] operator_altitude"},
        {SOURCE_NATIVE, "let the ground station send its altitude"},
        {SOURCE_TELEMETRY, "arm with a fix, and with MAVLink 2"},
    };

    (void)state;
    fixture.condition.armed = true;
    fixture.view.system.operator_altitude_m = NAN;
    for (size_t i = 0; i < sizeof(rows) / sizeof(rows[0]); i++) {
        fixture.view.system.operator_source = rows[i].source;
        expect_one(HEALTH_WARNING, "operator altitude unknown");
        assert_non_null(strstr(health.problem[0].advice, rows[i].advice));
    }
    /* From where the aircraft's own comes, which is told. */
    fixture.view.location.altitude_geodetic_m = NAN;
    expect_one(HEALTH_WARNING, "altitude above the ellipsoid unknown");
    fixture.view.location.altitude_geodetic_m = 48;
    fixture.view.system.operator_source = SOURCE_NONE; /* told as a whole */
    expect_one(HEALTH_WARNING, "operator location unknown");
}

static void what_was_set_right(void **state)
{
    (void)state;
    fixture.condition.vertical_inverted = true;
    expect_one(HEALTH_WARNING, "vertical speed comes inverted: set right");
    fixture.condition.vertical_inverted = false;
    fixture.condition.operator_ahead_s = -5;
    judge();
    assert_int_equal(health.count, 0);
    fixture.condition.operator_ahead_s = 39600; /* MAVProxy's epoch */
    expect_one(HEALTH_WARNING, "ground station's clock is +39600 s off");
    fixture.condition.operator_ahead_s = -6;
    expect_one(HEALTH_WARNING, "ground station's clock is -6 s off");
}

static void autopilots_own_failure(void **state)
{
    (void)state;
    fixture.view.location.status = AIRCRAFT_REMOTE_ID_FAILURE;
    fixture.view.location.status_source = SOURCE_NATIVE;
    expect_one(HEALTH_FAULT, "autopilot: Remote ID failure");
}

static void slow_positions(void **state)
{
    (void)state;
    fixture.condition.position_rate_hz = 0.4;
    expect_one(HEALTH_WARNING, "positions come only every 2.5 s");
    fixture.condition.position_rate_hz = NAN; /* not known yet */
    judge();
    assert_int_equal(health.count, 0);
    fixture.condition.position_rate_hz = 0; /* that they stopped is told otherwise */
    judge();
    assert_int_equal(health.count, 0);
}

static void operator_location(void **state)
{
    (void)state;
    fixture.view.system.operator_source = SOURCE_NONE;
    judge();
    assert_int_equal(health.count, 0); /* the take-off point is known only from arming on */
    fixture.condition.armed = true;
    expect_one(HEALTH_WARNING, "operator location unknown");
    fixture.view.system.operator_source = SOURCE_TELEMETRY;
    fixture.condition.takeoff_is_home = true;
    expect_one(HEALTH_WARNING, "take-off point unknown: home stands in");
}

static void time_unknown(void **state)
{
    (void)state;
    fixture.condition.time_known = false;
    expect_one(HEALTH_WARNING, "time unknown: time stamps say so");
}

/* ---- channels ---- */

static void a_channel_that_answers_and_stands_still(void **state)
{
    (void)state;
    fixture.radios[CHANNEL_BT5].state = RADIO_ON_AIR; /* so that the EU rule is met */
    fixture.radios[CHANNEL_WIFI].confirmed_us = NOW - RADIO_STALE_US - 1;
    expect_one(HEALTH_FAULT, "Wi-Fi beacon stands still");
    assert_false(health.on_air);
}

static void each_state_of_a_channel(void **state)
{
    static const struct {
        enum radio_state state;
        const char *reason;
    } cases[] = {
        {RADIO_ABSENT, "Wi-Fi beacon off: absent"}, {RADIO_BLOCKED, "Wi-Fi beacon off: blocked"},
        {RADIO_DOWN, "Wi-Fi beacon off: down"},     {RADIO_STARTING, "Wi-Fi beacon off: starting"},
        {RADIO_LOST, "Wi-Fi beacon off: lost"},
    };

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        fixture.radios[CHANNEL_BT5].state = RADIO_ON_AIR; /* so that the EU rule is met */
        fixture.radios[CHANNEL_WIFI].state = cases[i].state;
        expect_one(HEALTH_FAULT, cases[i].reason);
        assert_false(health.on_air);
    }
}

static void what_is_required(void **state)
{
    (void)state;
    assert_true(health_required(&fixture.input, CHANNEL_BT4));
    assert_false(health_required(&fixture.input, CHANNEL_BT5)); /* unsupported */
    fixture.radios[CHANNEL_BT5].state = RADIO_ABSENT;
    assert_true(health_required(&fixture.input, CHANNEL_BT5));
    fixture.config.bt5_enabled = false;
    assert_false(health_required(&fixture.input, CHANNEL_BT5));
    fixture.config.bt4_enabled = false;
    fixture.radios[CHANNEL_BT4].state = RADIO_DISABLED;
    judge();
    assert_true(health.on_air); /* Wi-Fi alone: all that was asked for */
    assert_int_equal(health.count, 0);
    fixture.config.wifi_beacon_enabled = false;
    fixture.radios[CHANNEL_WIFI].state = RADIO_DISABLED;
    expect_one(HEALTH_FAULT, "no channel is switched on");
    assert_false(health.on_air);
}

static void bluetooth_4_alone(void **state)
{
    (void)state;
    fixture.config.wifi_beacon_enabled = false;
    fixture.radios[CHANNEL_WIFI].state = RADIO_DISABLED;
    expect_one(HEALTH_FAULT, "EU: Bluetooth 4 is not enough");
    assert_true(health.on_air);
    fixture.radios[CHANNEL_BT5].state = RADIO_ON_AIR;
    judge();
    assert_int_equal(health.count, 0);
}

static void nothing_on_the_air(void **state)
{
    (void)state;
    fixture.radios[CHANNEL_BT4].state = RADIO_BLOCKED;
    fixture.radios[CHANNEL_WIFI].state = RADIO_LOST;
    judge();
    assert_int_equal(health.count, 3);
    assert_string_equal(health_reason(&health), "no channel is on the air");
    assert_string_equal(health.problem[1].reason, "Bluetooth 4 off: blocked");
    assert_string_equal(health.problem[2].reason, "Wi-Fi beacon off: lost");
    assert_non_null(strstr(health.problem[1].advice, "rfkill unblock bluetooth"));
    assert_false(health.on_air);
}

/* ---- the daemon ---- */

static void about_the_daemon(void **state)
{
    (void)state;
    fixture.input.config_errors = 1;
    expect_one(HEALTH_WARNING, "configuration: 1 value not usable");
    fixture.input.config_errors = 3;
    expect_one(HEALTH_WARNING, "configuration: 3 values not usable");
    fixture.input.config_errors = 0;
    fixture.input.filter_logging = true;
    expect_one(HEALTH_WARNING, "system-call filter only logs");
    fixture.input.filter_logging = false;
    fixture.input.filter = false;
    expect_one(HEALTH_WARNING, "no system-call filter");
    fixture.input.filter = true;
    fixture.input.realtime = false;
    expect_one(HEALTH_WARNING, "no real-time priority");
}

static void two_sources_keep_from_arming(void **state)
{
    (void)state;
    fixture.input.contradicted = true;
    expect_one(HEALTH_FAULT, "two speak as the autopilot");
}

/* What a sender says twice, and not alike; what is invented; and what only the moment knows. */
static void each_contradiction_is_told_alone(void **state)
{
    struct aircraft_condition *condition = &fixture.condition;
    const struct {
        bool *field;
        enum health_severity severity;
        const char *reason;
    } told[] = {
        {&condition->simulated, HEALTH_FAULT, "simulated flight (HIL mode)"},
        {&condition->emergency_declared, HEALTH_WARNING, "an emergency is declared"},
        {&condition->operators_differ, HEALTH_WARNING, "two tell the operator's place"},
        {&condition->operator_ids_differ, HEALTH_WARNING, "two tell the operator ID"},
        {&condition->area_upside_down, HEALTH_WARNING, "area: ceiling under floor"},
        {&condition->descriptions_differ, HEALTH_WARNING, "two tell the description"},
        {&condition->basic_ids_differ, HEALTH_WARNING, "two tell the Basic ID"},
        {&condition->description_conflict, HEALTH_WARNING, "another description is sent"},
        {&condition->classification_conflict, HEALTH_WARNING, "another EU class is sent"},
        {&condition->speed_wrong, HEALTH_WARNING, "speed 0 not believed: it moves"},
        {&condition->receivers_differ, HEALTH_WARNING, "two GNSS receivers in two places"},
        {&condition->altitude_apart, HEALTH_WARNING, "altitude differs from GNSS"},
        {&condition->altitudes_differ, HEALTH_WARNING, "native altitude not believed"},
        {&condition->landed_state_wrong, HEALTH_WARNING, "landed state not believed"},
        {&condition->vertical_inverted, HEALTH_WARNING, "vertical speed comes inverted: set right"},
    };

    (void)state;
    for (unsigned i = 0; i < sizeof(told) / sizeof(told[0]); i++) {
        *told[i].field = true;
        expect_one(told[i].severity, told[i].reason);
        *told[i].field = false;
    }
    condition->altitude_apart = condition->armed = true; /* and nothing else is said of the two */
    fixture.view.location.altitude_geodetic_m = fixture.view.location.height_m = NAN;
    expect_one(HEALTH_WARNING, "altitude differs from GNSS");
    condition->altitude_apart = condition->armed = false;
    condition->apart = true;
    fixture.view.location.position_fresh = false;
    expect_one(HEALTH_FAULT, "position differs from GNSS");
}

static void an_update_keeps_from_arming(void **state)
{
    (void)state;
    fixture.input.updating = true;
    expect_one(HEALTH_FAULT, "update in progress");
    assert_true(health.on_air);
    assert_string_equal(health_reason(&health), "update in progress");
    fixture.view.operator_id[0] = '\0';
    judge();
    assert_string_equal(health_reason(&health), "update in progress");
}

/* Everything at once: silence first, then who, then where; warnings at the end. */
static void the_order(void **state)
{
    (void)state;
    fixture.view = (struct aircraft_view){.location.fix_us = INT64_MIN};
    fixture.condition = (struct aircraft_condition){
        .armed = true, .basic_id_conflict = 1, .operator_id_conflict = 1};
    fixture.link.state = LINK_ABSENT;
    fixture.input.config_errors = 1;
    fixture.input.filter_logging = true;
    fixture.input.realtime = false;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        fixture.radios[channel].state = RADIO_ABSENT;
    }
    judge();
    assert_string_equal(health.problem[0].reason, "no channel is on the air");
    assert_string_equal(health.problem[1].reason, "missing basic_id message");
    assert_string_equal(health.problem[2].reason, "missing operator_id message");
    assert_string_equal(health.problem[3].reason, "no link to the autopilot");
    assert_string_equal(health.problem[4].reason, "no position from autopilot");
    assert_string_equal(health.problem[5].reason, "Bluetooth 4 off: absent");
    assert_true(has("operator location unknown"));
    assert_true(has("no real-time priority"));
    assert_true(health.count < HEALTH_MAX);
}

/* "PreArm: OpenDroneID: " takes 21 of the 50 characters that ArduPilot's STATUSTEXT has: what is
 * behind the rest, the pilot doesn't see. */
static void a_pilot_can_read_each_of_them(void **state)
{
    (void)state;
    fixture.view = (struct aircraft_view){.location.fix_us = INT64_MIN};
    fixture.condition = (struct aircraft_condition){.heartbeat_fresh = true};
    fixture.input.updating = fixture.input.contradicted = true;
    fixture.condition.simulated = true;
    for (unsigned round = 0; round < 6; round++) {
        fixture.link.state = round == 0 ? LINK_ABSENT : round == 4 ? LINK_SILENT : LINK_ALIVE;
        fixture.condition.apart = round == 5;
        fixture.condition.heartbeat_fresh = round != 1;
        fixture.condition.fix_known = round == 2;
        fixture.radios[CHANNEL_BT4].state = round == 3 ? RADIO_ON_AIR : RADIO_STARTING;
        fixture.radios[CHANNEL_WIFI].state = RADIO_STARTING;
        judge();
        for (unsigned i = 0; i < health.count && health.problem[i].severity == HEALTH_FAULT; i++) {
            assert_in_range(strlen(health.problem[i].reason), 1, 29);
        }
    }
}

/* The autopilot's own frames are among what the kernel had no room for. */
static void a_flood_keeps_from_arming_while_it_lasts(void **state)
{
    (void)state;
    fixture.link.overrun_us = NOW - 2900000;
    expect_one(HEALTH_WARNING, "autopilot's link is flooded");
    fixture.input.contradicted = true; /* nobody hides a fault behind that */
    judge();
    assert_string_equal(health_reason(&health), "two speak as the autopilot");
    fixture.input.contradicted = false;
    fixture.link.overrun_us = NOW - 3000000;
    judge();
    assert_int_equal(health.count, 0);
}

static void what_the_autopilot_does_not_hear_is_told(void **state)
{
    (void)state;
    fixture.input.unheard = true;
    expect_one(HEALTH_WARNING, "autopilot hears nothing of us");
    assert_non_null(strstr(health.problem[0].advice, "other wire"));
    fixture.input.signs = true;
    expect_one(HEALTH_WARNING, "autopilot hears nothing of us");
    assert_non_null(strstr(health.problem[0].advice, "signing off"));
    fixture.input.speaks = false; /* it is asked all the same, and can't answer */
    judge();
    assert_int_equal(health.count, 0);
}

/* It was on the air, and its controller says now that it can't. */
static void a_channel_that_was_on_the_air_is_missed_whatever_its_state_is_called(void **state)
{
    (void)state;
    fixture.radios[CHANNEL_BT5].state = RADIO_UNSUPPORTED;
    judge();
    assert_int_equal(health.count, 0);
    fixture.radios[CHANNEL_BT5].was_on_air = true;
    expect_one(HEALTH_FAULT, "Bluetooth 5 off: unsupported");
}

/* One message more, if only the ground station's description, and Wi-Fi had no signature. */
static void what_has_no_room_in_any_pack_is_said(void **state)
{
    (void)state;
    fixture.view.auth_pages = 4; /* nine messages */
    judge();
    assert_int_equal(health.count, 0);
    fixture.view.auth_pages = 5;
    expect_one(HEALTH_WARNING, "packs lack Authentication");
    assert_string_equal(health.problem[0].id, "pack-full");
    fixture.view.description_spare = true;
    expect_one(HEALTH_WARNING, "packs lack Self-ID");
    fixture.view.auth_pages = 6;
    expect_one(HEALTH_WARNING, "packs lack Authentication");
    fixture.config.wifi_beacon_enabled = false;
    radio_init(&fixture.radios[CHANNEL_WIFI], RADIO_DISABLED, NOW);
    judge();
    for (unsigned i = 0; i < health.count; i++) {
        assert_string_not_equal(health.problem[i].id, "pack-full"); /* there are no packs */
    }
}

/* The pack had become smaller, and nobody was told what isn't in it. */
static void what_has_no_room_in_a_small_pack_is_said(void **state)
{
    (void)state;
    fixture.input.extended_room = MESSAGES_EXTENDED_EMPTY + 3 * MESSAGE_SIZE;
    judge();
    assert_int_equal(health.count, 0); /* Bluetooth 5 isn't on the air */
    fixture.radios[CHANNEL_BT5].state = RADIO_ON_AIR;
    expect_one(HEALTH_WARNING, "Bluetooth 5 lacks System, Self-ID");
    fixture.input.extended_room = MESSAGES_EXTENDED_EMPTY + MESSAGE_SIZE;
    judge();
    assert_string_equal(health.problem[0].reason,
                        "Bluetooth 5 lacks a Basic ID, Operator ID, System");
    fixture.input.extended_room = MESSAGES_EXTENDED_EMPTY + 5 * MESSAGE_SIZE;
    judge();
    assert_int_equal(health.count, 0);
}

static void what_a_beacon_has_no_room_for_is_said(void **state)
{
    (void)state;
    fixture.input.beacon_most = 4;
    expect_one(HEALTH_WARNING, "Wi-Fi lacks Self-ID");
    fixture.input.beacon_most = 1;
    expect_one(HEALTH_WARNING, "Wi-Fi: one message at a time");
    fixture.radios[CHANNEL_WIFI].state = RADIO_LOST;
    judge();
    for (unsigned i = 0; i < health.count; i++) {
        assert_string_not_equal(health.problem[i].id, "beacon-single");
    }
}

#define TEST(name) cmocka_unit_test_setup(name, reset)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(nothing_is_wrong),
        TEST(no_basic_id),
        TEST(no_operator_id),
        TEST(wrong_serial),
        TEST(second_identifier),
        TEST(wrong_operator_number),
        TEST(conflicts),
        TEST(types_that_are_not_alike),
        TEST(what_is_not_believed),
        TEST(link_states),
        TEST(positions),
        TEST(a_bench_position_is_a_fault_before_it_is_on_the_air),
        TEST(fields_that_stay_unknown),
        TEST(an_operator_altitude_that_stays_unknown),
        TEST(what_was_set_right),
        TEST(autopilots_own_failure),
        TEST(slow_positions),
        TEST(operator_location),
        TEST(time_unknown),
        TEST(a_channel_that_answers_and_stands_still),
        TEST(each_state_of_a_channel),
        TEST(what_is_required),
        TEST(bluetooth_4_alone),
        TEST(nothing_on_the_air),
        TEST(about_the_daemon),
        TEST(the_order),
        TEST(a_pilot_can_read_each_of_them),
        TEST(each_contradiction_is_told_alone),
        TEST(an_update_keeps_from_arming),
        TEST(two_sources_keep_from_arming),
        TEST(a_flood_keeps_from_arming_while_it_lasts),
        TEST(what_the_autopilot_does_not_hear_is_told),
        TEST(what_has_no_room_in_any_pack_is_said),
        TEST(what_has_no_room_in_a_small_pack_is_said),
        TEST(what_a_beacon_has_no_room_for_is_said),
        TEST(a_channel_that_was_on_the_air_is_missed_whatever_its_state_is_called),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
