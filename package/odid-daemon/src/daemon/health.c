#include "daemon/health.h"

#include <math.h>
#include <opendroneid.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/utf8.h"
#include "config/identifiers.h"
#include "daemon/messages.h"

#define OPERATOR_ID_EU 0
/* Positions may be a second old when they are sent (2nd); ArduPilot's native ones come every
 * 1.00 to 1.12 s. */
#define POSITION_RATE_MIN_HZ 0.85
/* System's time goes by whole seconds, and is on its way for a while. */
#define OPERATOR_CLOCK_S 5

static void note(struct health *health, enum health_severity severity, const char *id,
                 const char *advice, const char *format, ...) __attribute__((format(printf, 5, 6)));

static void note(struct health *health, enum health_severity severity, const char *id,
                 const char *advice, const char *format, ...)
{
    struct health_problem *problem = &health->problem[health->count];
    char reason[128];
    va_list arguments;

    if (health->count == HEALTH_MAX) {
        return; /* the most important ones are there */
    }
    health->count++;
    problem->id = id;
    problem->severity = severity;
    va_start(arguments, format);
    vsnprintf(reason, sizeof(reason), format, arguments);
    va_end(arguments);
    utf8_clean(problem->reason, sizeof(problem->reason),
               reason); /* a native ID may hold any byte */
    snprintf(problem->advice, sizeof(problem->advice), "%s", advice);
}

#define FAULT(...) note(health, HEALTH_FAULT, __VA_ARGS__)
#define WARNING(...) note(health, HEALTH_WARNING, __VA_ARGS__)

/* ---- channels ---- */

static bool switched_on(const struct config *config, enum channel channel)
{
    switch (channel) {
    case CHANNEL_BT4:
        return config->bt4_enabled;
    case CHANNEL_BT5:
        return config->bt5_enabled;
    default:
        return config->wifi_beacon_enabled;
    }
}

bool health_required(const struct health_input *input, enum channel channel)
{
    enum radio_state state = input->radios[channel].state;

    /* One that was on the air and isn't any more is missed, whatever its state is called. */
    return switched_on(input->config, channel) && state != RADIO_DISABLED &&
           (state != RADIO_UNSUPPORTED || input->radios[channel].was_on_air);
}

static bool on_air(const struct health_input *input, enum channel channel, int64_t now_us)
{
    return radio_seen(&input->radios[channel], now_us) == RADIO_ON_AIR;
}

static const char *channel_advice(enum channel channel, enum radio_state state)
{
    bool wifi = channel == CHANNEL_WIFI;

    switch (state) {
    case RADIO_ABSENT:
        return wifi ? "Start hostapd; check [broadcast] wifi_iface and hostapd_dir. A CM4 without "
                      "wireless has no Wi-Fi."
                    : "Check [broadcast] bt_adapter, or plug in the Bluetooth adapter. A CM4 "
                      "without wireless has none.";
    case RADIO_BLOCKED:
        return wifi ? "The radio is switched off: rfkill unblock wlan, or the switch on the device."
                    : "The radio is switched off: rfkill unblock bluetooth, or the switch on the "
                      "device.";
    case RADIO_LOST:
        return "It stopped answering and is being set up again. If this lasts two minutes, "
               "switch power off and on.";
    case RADIO_UNSUPPORTED:
        return "Its controller refuses it by now: another program may hold it. If this lasts, "
               "switch power off and on.";
    default:
        return "It is being set up. If this lasts longer than 10 s, read the log, then switch "
               "power off and on.";
    }
}

static void judge_any_channel(struct health *health, const struct health_input *input,
                              int64_t now_us)
{
    bool any_required = false, any_on_air = false;

    health->on_air = true;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        if (health_required(input, channel)) {
            any_required = true;
            health->on_air = health->on_air && on_air(input, channel, now_us);
        }
        any_on_air = any_on_air || on_air(input, channel, now_us);
    }
    health->on_air = health->on_air && any_required;
    if (!any_on_air && any_required) {
        FAULT("nobody-can-receive", "Nobody can receive this aircraft: see the channels below.",
              "no channel is on the air");
    } else if (!any_on_air) {
        FAULT("no-channel-switched-on",
              "Switch on a channel in [broadcast], or plug in an adapter that can transmit.",
              "no channel is switched on");
    }
}

/* opendroneid-core-c's table of what is mandatory: Bluetooth 4 by itself nowhere. */
static void judge_mandatory_channel(struct health *health, const struct health_input *input,
                                    int64_t now_us)
{
    if (on_air(input, CHANNEL_BT4, now_us) && !on_air(input, CHANNEL_BT5, now_us) &&
        !on_air(input, CHANNEL_WIFI, now_us)) {
        FAULT("bluetooth-4-not-enough",
              "EU rules count Wi-Fi or Bluetooth 5 long range, not Bluetooth 4: get one of them on "
              "the air.",
              "EU: Bluetooth 4 is not enough");
    }
}

static void judge_channels(struct health *health, const struct health_input *input, int64_t now_us)
{
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        const struct radio *radio = &input->radios[channel];
        enum radio_state state = radio_seen(radio, now_us);

        if (health_required(input, channel) && state != radio->state) {
            FAULT("channel-stands-still",
                  "It takes too long for each payload, or another program works against it: read "
                  "the log.",
                  "%s stands still", channel_title(channel));
        } else if (health_required(input, channel) && state != RADIO_ON_AIR) {
            FAULT("channel-off", channel_advice(channel, state), "%s off: %s",
                  channel_title(channel), radio_state_name(state));
        }
    }
}

/* ---- identity ---- */

static void judge_basic_ids(struct health *health, const struct aircraft_view *view)
{
    char problem[IDENTIFIER_PROBLEM_SIZE];

    if (view->basic_ids == 0) {
        /* QGroundControl knows this text. */
        FAULT("basic-id-missing",
              "Set [basic_id] uas_id in odid.conf to the aircraft's serial number.",
              "missing basic_id message");
    }
    for (unsigned i = 0; i < view->basic_ids; i++) {
        if (view->basic_id[i].id_type == ODID_IDTYPE_SERIAL_NUMBER &&
            !identifiers_check_serial(view->basic_id[i].uas_id, problem)) {
            FAULT("basic-id-invalid",
                  view->basic_id[i].source == SOURCE_NATIVE
                      ? "The autopilot sends it. Set [basic_id] uas_id to the number on the "
                        "aircraft's label."
                      : "Compare [basic_id] uas_id with the aircraft's label; odidctl check says "
                        "what is wrong.",
                  "Basic ID is no valid serial: %s", view->basic_id[i].uas_id);
        }
    }
}

static void judge_operator_id(struct health *health, const struct aircraft_view *view)
{
    char public_part[IDENTIFIER_MAX + 1], problem[IDENTIFIER_PROBLEM_SIZE];

    if (view->operator_id[0] == '\0') {
        FAULT("operator-id-missing",
              "Set [operator] operator_id in odid.conf to the operator's registration number.",
              "missing operator_id message");
        return;
    }
    if (view->operator_id_type == OPERATOR_ID_EU &&
        identifiers_check_operator(view->operator_id, public_part, problem) ==
            OPERATOR_NUMBER_INVALID) {
        FAULT("operator-id-invalid",
              "Compare [operator] operator_id with the registration; odidctl check says what is "
              "wrong.",
              "Operator ID is no EU number: %s", public_part);
    }
}

static void judge_serial_present(struct health *health, const struct aircraft_view *view)
{
    for (unsigned i = 0; i < view->basic_ids; i++) {
        if (view->basic_id[i].id_type == ODID_IDTYPE_SERIAL_NUMBER) {
            return;
        }
    }
    if (view->basic_ids > 0) {
        WARNING("serial-missing",
                "EU rules ask for the serial number: set [basic_id] uas_id with id_type = serial.",
                "no serial number among the Basic IDs");
    }
}

/* ---- autopilot ---- */

static const char *link_advice(const struct health_input *input)
{
    bool serial = input->config->source == MAVLINK_SOURCE_SERIAL;

    if (input->link->state == LINK_ABSENT) {
        return serial ? "Plug in the autopilot's USB cable, or set [mavlink] device."
                      : "Check [mavlink] udp_address and udp_port: another program may use them.";
    }
    return serial ? "Is the autopilot powered? Check [mavlink] baud and the port's MAVLink "
                    "protocol setting."
                  : "Start mavlink-router, and let it send to [mavlink] udp_address and udp_port.";
}

static void judge_link(struct health *health, const struct health_input *input)
{
    if (input->link->state == LINK_ABSENT) {
        FAULT("autopilot-no-link", link_advice(input), "no link to the autopilot");
    } else if (input->link->state == LINK_SILENT) {
        FAULT("autopilot-silent", link_advice(input), "autopilot is silent");
    } else if (!input->condition->heartbeat_fresh && input->others_only) {
        FAULT("autopilot-silent",
              "Others speak on its link, it doesn't: is it powered? Check cable, baud and the "
              "port's MAVLink protocol setting.",
              "autopilot is silent");
    } else if (!input->condition->heartbeat_fresh) {
        FAULT("autopilot-no-heartbeat",
              input->speaks
                  ? "Its other messages come: look for what sets its HEARTBEAT's rate, or holds it "
                    "back on the way."
                  : "Bytes come, but no autopilot (component 1) speaks: check baud, and that it is "
                    "set to MAVLink.",
              "no heartbeat from autopilot");
    }
}

static void judge_sources(struct health *health, const struct health_input *input)
{
    if (input->contradicted) {
        FAULT("two-autopilots",
              "Something else speaks with the vehicle's system id: find it, switch it off. The one "
              "that was there first counts.",
              "two speak as the autopilot");
    }
}

/* On the air or not yet: it would be there as soon as the autopilot's is late. */
static bool bench_position(const struct health_input *input)
{
    return !isnan(input->config->bench_latitude_deg);
}

static void judge_position(struct health *health, const struct health_input *input, int64_t now_us)
{
    const struct aircraft_location *location = &input->view->location;

    if (location->position_source == SOURCE_CONFIGURATION || location->position_fresh) {
        return;
    }
    if (input->condition->apart) {
        FAULT(
            "position-apart",
            "Its estimator stands still, or the receiver is wrong: restart the autopilot, look at "
            "its messages.",
            "position differs from GNSS");
    } else if (!input->condition->fix_known && input->condition->heartbeat_fresh) {
        FAULT("no-gnss-fix",
              "Wait for a GNSS fix. Where there is one: GPS_RAW_INT doesn't come, set this port's "
              "stream rates (docs/autopilots.md).",
              "autopilot has no GNSS fix");
    } else if (location->fix_us == INT64_MIN) {
        FAULT("position-missing",
              "Take the aircraft outdoors and wait for a GNSS fix; check the GNSS antenna.",
              "no position from autopilot");
    } else {
        FAULT("position-stopped",
              "The autopilot lost its GNSS fix, or its link broke: check antenna and cable.",
              "position stopped %lld s ago", (long long)((now_us - location->fix_us) / 1000000));
    }
}

static void judge_failure(struct health *health, const struct health_input *input)
{
    /* Ours come with a cause that is listed already. */
    if (input->view->location.status == AIRCRAFT_REMOTE_ID_FAILURE &&
        input->view->location.status_source == SOURCE_NATIVE) {
        FAULT("autopilot-reports-failure",
              "The autopilot reports it: look at its own messages in the ground station.",
              "autopilot: Remote ID failure");
    }
}

/* ---- worth mending ---- */

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
    if (on_air(input, CHANNEL_BT5, now_us) && names[0] != '\0') {
        WARNING("pack-too-small",
                "Its controller has no room for them: use another one ([broadcast] bt5_adapter). "
                "The other channels say them.",
                "Bluetooth 5 lacks %s", names);
    }
    name_left_out(input->view, input->beacon_most, names);
    if (!on_air(input, CHANNEL_WIFI, now_us) || names[0] == '\0') {
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

    if (!on_air(input, CHANNEL_WIFI, now_us) && !on_air(input, CHANNEL_BT5, now_us)) {
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
    if (input->unheard) {
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
                "A live place goes before home, else who spoke first. Let one of autopilot and "
                "ground station send SYSTEM.",
                "two tell the operator's place");
    }
    if (condition->operator_ids_differ) {
        WARNING(
            "operator-ids-differ",
            "The autopilot's is broadcast. Make the ground station's the same, or set [operator] "
            "operator_id.",
            "two tell the operator ID");
    }
    if (condition->descriptions_differ) {
        WARNING(
            "descriptions-differ",
            "The autopilot's is broadcast. Let one of autopilot and ground station send SELF_ID, "
            "or set [self_id] description.",
            "two tell the description");
    }
    if (condition->basic_id_conflict) {
        WARNING("basic-id-conflict",
                "The configured one is broadcast. Make the ground station's the same, or leave it "
                "empty there.",
                "autopilot sends another Basic ID");
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

/* ---- all of it ---- */

void health_judge(struct health *health, const struct health_input *input, int64_t now_us)
{
    memset(health, 0, sizeof(*health));
    judge_any_channel(health, input, now_us);
    if (input->updating) {
        FAULT("update-in-progress", "Wait until it is decided: odidctl update says how it stands.",
              "update in progress");
    }
    if (bench_position(input)) {
        FAULT("bench-position",
              "An invented place is broadcast, or would be. Remove [bench] from odid.conf.",
              "bench position configured");
    }
    if (input->condition->simulated) {
        FAULT("simulated-flight",
              "An invented flight is broadcast under the real number. Switch hardware-in-the-loop "
              "off.",
              "simulated flight (HIL mode)");
    }
    judge_sources(health, input);
    judge_basic_ids(health, input->view);
    judge_operator_id(health, input->view);
    judge_link(health, input);
    judge_position(health, input, now_us);
    judge_mandatory_channel(health, input, now_us);
    judge_channels(health, input, now_us);
    judge_failure(health, input);
    judge_serial_present(health, input->view);
    judge_conflicts(health, input->condition);
    judge_contradictions(health, input);
    judge_data(health, input);
    judge_packs(health, input, now_us);
    judge_whole_pack(health, input, now_us);
    judge_flood(health, input, now_us);
    judge_daemon(health, input);
}

const char *health_reason(const struct health *health)
{
    for (unsigned i = 0; i < health->count; i++) {
        if (health->problem[i].severity == HEALTH_FAULT) {
            return health->problem[i].reason;
        }
    }
    return "";
}
