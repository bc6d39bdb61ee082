#include "daemon/health.h"

#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "config/identifiers.h"
#include "daemon/health_note.h"
#include "daemon/health_warnings.h"

#define OPERATOR_ID_EU 0

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
            health->on_air = health->on_air && health_on_air(input, channel, now_us);
        }
        any_on_air = any_on_air || health_on_air(input, channel, now_us);
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
    if (health_on_air(input, CHANNEL_BT4, now_us) && !health_on_air(input, CHANNEL_BT5, now_us) &&
        !health_on_air(input, CHANNEL_WIFI, now_us)) {
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
    } else if (!input->condition->heartbeat_fresh && input->another_id) {
        FAULT("autopilot-other-id",
              "Its system id was changed, or it isn't ours. In the air only the one of before "
              "counts: set it back.",
              "another system id speaks");
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
    health_judge_warnings(health, input, now_us);
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
