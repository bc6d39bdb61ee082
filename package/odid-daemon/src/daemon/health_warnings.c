#include "daemon/health_warnings.h"

#include <math.h>
#include <opendroneid.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "config/identifiers.h"
#include "daemon/health_note.h"
#include "daemon/messages.h"

/* Positions may be a second old when they are sent (2nd); ArduPilot's native ones come every
 * 1.00 to 1.12 s. */
#define POSITION_RATE_MIN_HZ 0.85
/* System's time goes by whole seconds, and is on its way for a while. */
#define OPERATOR_CLOCK_S 5

/* The take-off point's comes from where the aircraft's own does, and is told with it. */
static void judge_operator_altitude(struct health *health, const struct health_input *input)
{
    const struct aircraft_system *system = &input->view->system;
    const char *advice;

    if (!input->condition->armed || !isnan(system->operator_altitude_m)) {
        return;
    }
    switch (system->operator_source) {
    case SOURCE_CONFIGURATION:
        advice = "Only US rules ask for it: set [system] operator_altitude.";
        break;
    case SOURCE_NATIVE:
        advice = "Only US rules ask for it: let the ground station send its altitude.";
        break;
    case SOURCE_TELEMETRY:
        if (isnan(input->view->location.altitude_geodetic_m)) {
            return;
        }
        advice = "Only US rules ask for it: arm with a fix, and with MAVLink 2 on this port.";
        break;
    default:
        return;
    }
    WARNING("operator-altitude-unknown", advice, "operator altitude unknown");
}

/* EU rules ask for the height, US and Japanese ones for the geodetic altitude, US ones for the
 * operator's altitude and for accuracies. */
static void judge_altitudes(struct health *health, const struct health_input *input)
{
    const struct aircraft_location *location = &input->view->location;

    if (!location->position_fresh) {
        return;
    }
    if (!input->condition->altitude_apart) { /* else why they are unknown is said */
        if (input->condition->armed && isnan(location->height_m)) {
            WARNING("height-unknown",
                    "Arm with a GNSS fix, or let the autopilot send HOME_POSITION on this port "
                    "(docs/autopilots.md).",
                    "height above take-off unknown");
        }
        if (isnan(location->altitude_geodetic_m) && !input->condition->altitudes_differ) {
            WARNING("altitude-unknown",
                    "GPS_RAW_INT doesn't say it: set this port to MAVLink 2 (docs/autopilots.md).",
                    "altitude above the ellipsoid unknown");
        }
    }
    /* While the fix is lost, what is known of it is gone before the position is. */
    if (location->horizontal_accuracy == 0 && input->condition->fix_known) {
        WARNING("accuracy-unknown",
                "GPS_RAW_INT doesn't say it: set this port to MAVLink 2, or use a receiver that "
                "knows it (docs/autopilots.md).",
                "accuracy of position unknown");
    }
    judge_operator_altitude(health, input);
}

/* What a smaller pack lacks, the worst first: what is behind the room for it isn't seen. */
static void name_left_out(const struct aircraft_view *view, unsigned most, char names[64])
{
    static const struct {
        enum message_type type;
        const char *name;
    } order[] = {{MESSAGE_BASIC_ID, "a Basic ID"},
                 {MESSAGE_OPERATOR_ID, "Operator ID"},
                 {MESSAGE_SYSTEM, "System"},
                 {MESSAGE_SELF_ID, "Self-ID"},
                 {MESSAGE_AUTHENTICATION, "Authentication"}};

    names[0] = '\0';
    for (size_t i = 0; i < sizeof(order) / sizeof(order[0]); i++) {
        size_t length = strlen(names);

        if (messages_left_out(view, most, order[i].type)) {
            snprintf(names + length, 64 - length, "%s%s", length > 0 ? ", " : "", order[i].name);
        }
    }
}

static void judge_packs(struct health *health, const struct health_input *input, int64_t now_us)
{
    char names[64];

    name_left_out(input->view, MESSAGES_EXTENDED_MOST(input->extended_room), names);
    if (health_on_air(input, CHANNEL_BT5, now_us) && names[0] != '\0') {
        WARNING("pack-too-small",
                "Its controller has no room for them: use another one ([broadcast] bt5_adapter). "
                "The other channels say them.",
                "Bluetooth 5 lacks %s", names);
    }
    name_left_out(input->view, input->beacon_most, names);
    if (!health_on_air(input, CHANNEL_WIFI, now_us) || names[0] == '\0') {
        return;
    }
    if (input->beacon_most == 1) {
        WARNING("beacon-single",
                "Its chip refused packs: each message is in every few beacons. Bluetooth says all.",
                "Wi-Fi: one message at a time");
    } else {
        WARNING(
            "beacon-too-small",
            "Its chip refused more: say less, or set another adapter as [broadcast] wifi_iface.",
            "Wi-Fi lacks %s", names);
    }
}

/* What no pack has: its nine messages are few where Authentication is among them. */
static void judge_whole_pack(struct health *health, const struct health_input *input,
                             int64_t now_us)
{
    bool signature = messages_exceed_pack(input->view, MESSAGE_AUTHENTICATION);

    if (!health_on_air(input, CHANNEL_WIFI, now_us) && !health_on_air(input, CHANNEL_BT5, now_us)) {
        return;
    }
    if (signature || messages_exceed_pack(input->view, MESSAGE_SELF_ID)) {
        WARNING("pack-full",
                "Nine messages fit, and only Bluetooth 4 says more: leave out a second Basic ID, "
                "the Self-ID or pages.",
                "packs lack %s", signature ? "Authentication" : "Self-ID");
    }
}

static void judge_data(struct health *health, const struct health_input *input)
{
    const struct aircraft_condition *condition = input->condition;

    if (!condition->time_known) {
        WARNING("time-unknown",
                "It comes from the autopilot once it has a GNSS fix (MAVLink SYSTEM_TIME).",
                "time unknown: time stamps say so");
    }
    if (condition->position_rate_hz < POSITION_RATE_MIN_HZ && condition->position_rate_hz > 0) {
        WARNING(
            "positions-slow",
            "Let the autopilot send GLOBAL_POSITION_INT at 4 Hz on this port (its stream rate).",
            "positions come only every %.1f s", 1 / condition->position_rate_hz);
    }
    if (condition->armed && input->view->system.operator_source == SOURCE_NONE) {
        WARNING("operator-location-unknown",
                "Arm with a GNSS fix, connect a ground station with a position, or set [system] "
                "operator_latitude.",
                "operator location unknown");
    }
    if (condition->armed && condition->takeoff_is_home) {
        WARNING("takeoff-is-home",
                "Armed without a fix, or before Remote ID started: the next arming with a fix "
                "counts.",
                "take-off point unknown: home stands in");
    }
    if (condition->armed && condition->takeoff_is_late) {
        WARNING("takeoff-is-late", "Armed without a fix: arm with one.",
                "take-off point is the first fix after arming");
    }
    judge_altitudes(health, input);
    if (input->unheard && input->speaks) {
        WARNING("autopilot-hears-nothing",
                input->signs
                    ? "It signs its frames, and takes no others: switch MAVLink signing off "
                      "on this port, or ARM_STATUS reaches nobody."
                    : "Nothing of ours is answered: look at the cable's other wire, and "
                      "for signing. ARM_STATUS reaches nobody.",
                "autopilot hears nothing of us");
    }
    if (condition->vertical_inverted) {
        WARNING("vertical-speed-inverted",
                "ArduPilot before September 2018 sends it so: update its firmware.",
                "vertical speed comes inverted: set right");
    }
    if (llabs(condition->operator_ahead_s) > OPERATOR_CLOCK_S) {
        WARNING("operator-clock-off",
                "The autopilot's time is broadcast. Set the ground station's clock.",
                "ground station's clock is %+lld s off", (long long)condition->operator_ahead_s);
    }
}

static void judge_conflicts(struct health *health, const struct aircraft_condition *condition)
{
    if (condition->emergency_declared) {
        WARNING(
            "emergency-declared",
            "A ground station, or the autopilot for it, says so by SELF_ID: it goes out as it is "
            "said.",
            "an emergency is declared");
    }
    if (condition->operators_differ) {
        WARNING("operators-differ",
                "A live place goes before home, else who spoke first, else each in turn. Let one "
                "of autopilot and station send SYSTEM.",
                "two tell the operator's place");
    }
    if (condition->operator_ids_differ) {
        WARNING("operator-ids-differ",
                "The autopilot's is broadcast, else each in turn. Make the ground station's the "
                "same, or set [operator] operator_id.",
                "two tell the operator ID");
    }
    if (condition->descriptions_differ) {
        WARNING("descriptions-differ",
                "The autopilot's goes out, else each in turn; an emergency stands. Let one send "
                "SELF_ID, or set [self_id] description.",
                "two tell the description");
    }
    if (condition->basic_ids_differ) {
        WARNING("basic-ids-differ",
                "Who spoke first is broadcast, else each in turn. Let one ground station send "
                "BASIC_ID, or set [basic_id] uas_id.",
                "two tell the Basic ID");
    }
    if (condition->basic_id_conflict) {
        WARNING("basic-id-conflict",
                "The configured one is broadcast. Make the ground station's the same, or leave it "
                "empty there.",
                "autopilot sends another Basic ID");
    }
    if (condition->description_conflict) {
        WARNING("description-conflict",
                "The configured one is broadcast. Let nobody else send SELF_ID, or leave [self_id] "
                "description empty.",
                "another description is sent");
    }
    if (condition->classification_conflict) {
        WARNING("classification-conflict",
                "The configured one is broadcast. Make the ground station's the same, or leave it "
                "undeclared there.",
                "another EU class is sent");
    }
    if (condition->operator_id_conflict) {
        WARNING("operator-id-conflict",
                "The configured one is broadcast. Make the ground station's the same, or leave it "
                "empty there.",
                "autopilot sends another operator ID");
    }
}

/* A quadplane of ArduPilot's is a fixed wing by its HEARTBEAT; what claims nothing contradicts
 * nothing. */
static bool types_fit(uint8_t a, int b)
{
    bool claims = a != ODID_UATYPE_NONE && a != ODID_UATYPE_OTHER && b > ODID_UATYPE_NONE &&
                  b != ODID_UATYPE_OTHER;
    bool wings = (a == ODID_UATYPE_AEROPLANE || a == ODID_UATYPE_HYBRID_LIFT) &&
                 (b == ODID_UATYPE_AEROPLANE || b == ODID_UATYPE_HYBRID_LIFT);

    return !claims || wings || a == b;
}

static void judge_types(struct health *health, const struct health_input *input)
{
    const struct aircraft_view *view = input->view;
    char problem[IDENTIFIER_PROBLEM_SIZE];
    bool fit = true;

    for (unsigned i = 0; i < view->basic_ids; i++) {
        const struct aircraft_basic_id *id = &view->basic_id[i];

        fit = fit && types_fit(id->ua_type, aircraft_ua_type(input->condition->said_mav_type));
        if (id->id_type == ODID_IDTYPE_CAA_REGISTRATION_ID &&
            identifiers_check_serial(id->uas_id, problem)) {
            WARNING("serial-of-another-type",
                    "It has a serial number's form: if it is one, set id_type = serial.",
                    "serial number of another type");
        }
    }
    if (!fit && input->condition->heartbeat_fresh) {
        WARNING("ua-type-differs",
                "The Basic ID's type of aircraft is broadcast. Compare it, and the autopilot's "
                "frame, with the aircraft.",
                "HEARTBEAT has another UA type");
    }
}

/* What is said twice, and not alike (docs/autopilots.md). */
static void judge_contradictions(struct health *health, const struct health_input *input)
{
    judge_types(health, input);
    if (input->condition->speed_wrong) {
        WARNING("speed-not-believed",
                "It says 0, and its place or altitude moves: the speed is unknown. Let the "
                "autopilot send its velocity.",
                "speed 0 not believed: it moves");
    }
    if (input->condition->area_upside_down) {
        WARNING("area-upside-down",
                "Neither is broadcast. Set the ground station's SYSTEM: area_ceiling, area_floor.",
                "area: ceiling under floor");
    }
    if (input->condition->receivers_differ) {
        WARNING("receivers-differ",
                "Both have a fix. The one that the autopilot goes by is broadcast: look at both "
                "receivers.",
                "two GNSS receivers in two places");
    }
    if (input->condition->altitude_apart) {
        WARNING("altitude-apart",
                "It stands still, or is far from the receiver's: altitude and height are unknown. "
                "Look at the barometer.",
                "altitude differs from GNSS");
    }
    if (input->condition->altitudes_differ) {
        WARNING(
            "native-altitude-not-believed",
            "The native LOCATION has another altitude than telemetry, perhaps above the sea: it "
            "isn't broadcast.",
            "native altitude not believed");
    }
    if (input->condition->landed_state_wrong) {
        WARNING("landed-state-not-believed",
                "It contradicts height and movement: armed or not counts instead. Restart the "
                "autopilot.",
                "landed state not believed");
    }
}

/* What the aircraft lacks by it is said as such; else whoever floods would decide whether it may
 * arm.
 */
static void judge_flood(struct health *health, const struct health_input *input, int64_t now_us)
{
    if (aircraft_fresh(input->link->overrun_us, now_us)) {
        WARNING("link-flooded",
                "More comes to [mavlink] udp_port than anybody needs, and some of the autopilot's "
                "is lost: find who sends it.",
                "autopilot's link is flooded");
    }
}

static void judge_daemon(struct health *health, const struct health_input *input)
{
    if (input->config_errors > 0) {
        WARNING("configuration-values", "odidctl check FILE lists them, and what is used instead.",
                "configuration: %u value%s not usable", input->config_errors,
                input->config_errors == 1 ? "" : "s");
    }
    if (!input->filter) {
        WARNING("no-filter",
                "Whoever is started in its place has more of the computer: allow it seccomp(2).",
                "no system-call filter");
    } else if (input->filter_logging) {
        WARNING("filter-logs",
                "It ended twice by a forbidden system call: send the log to whoever maintains it.",
                "system-call filter only logs");
    }
    if (!input->realtime) {
        WARNING(
            "no-realtime",
            "Start it as root; in a container allow real-time priority. Slots may be late under "
            "load.",
            "no real-time priority");
    }
}

void health_judge_warnings(struct health *health, const struct health_input *input, int64_t now_us)
{
    judge_conflicts(health, input->condition);
    judge_contradictions(health, input);
    judge_data(health, input);
    judge_packs(health, input, now_us);
    judge_whole_pack(health, input, now_us);
    judge_flood(health, input, now_us);
    judge_daemon(health, input);
}
