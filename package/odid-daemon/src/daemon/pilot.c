#include "daemon/pilot.h"

#include <common/mavlink.h>
#include <stdio.h>
#include <string.h>

#include "daemon/telemetry.h"

/* A repair takes less: only what lasts is told. */
#define TOLD_AFTER_US 1000000
/* A text is one datagram through a radio that loses some: what lasts is said again. */
#define TOLD_AGAIN_US 30000000

void pilot_init(struct pilot *pilot, pilot_send_fn *send, void *context)
{
    memset(pilot, 0, sizeof(*pilot));
    pilot->send = send;
    pilot->context = context;
}

static void send(struct pilot *pilot, const mavlink_message_t *message)
{
    uint8_t frame[MAVLINK_MAX_PACKET_LEN];

    pilot->send(pilot->context, frame, mavlink_msg_to_send_buffer(frame, message));
}

/* PX4 reads no ARM_STATUS: it counts STANDBY and ACTIVE as healthy, and arms only then
 * (COM_ARM_ODID). Once it is armed that has nothing to decide any more. */
static uint8_t system_status(const char *reason, bool armed)
{
    return reason[0] == '\0' || armed ? MAV_STATE_ACTIVE : MAV_STATE_CRITICAL;
}

static void send_heartbeat(struct pilot *pilot, uint8_t vehicle, uint8_t status)
{
    mavlink_message_t message;
    mavlink_heartbeat_t heartbeat = {
        .type = MAV_TYPE_ODID,
        .autopilot = MAV_AUTOPILOT_INVALID,
        .system_status = status,
        .mavlink_version = 3,
    };

    mavlink_msg_heartbeat_encode(vehicle, TELEMETRY_COMPONENT_ODID, &message, &heartbeat);
    send(pilot, &message);
}

static void send_arm_status(struct pilot *pilot, uint8_t vehicle, const char *reason)
{
    mavlink_message_t message;
    mavlink_open_drone_id_arm_status_t status = {
        .status = reason[0] == '\0' ? MAV_ODID_ARM_STATUS_GOOD_TO_ARM
                                    : MAV_ODID_ARM_STATUS_PRE_ARM_FAIL_GENERIC,
    };

    memcpy(status.error, reason, strnlen(reason, PILOT_REASON_MAX));
    mavlink_msg_open_drone_id_arm_status_encode(vehicle, TELEMETRY_COMPONENT_ODID, &message,
                                                &status);
    send(pilot, &message);
}

void pilot_tell(struct pilot *pilot, uint8_t vehicle, const char *reason, bool armed)
{
    send_heartbeat(pilot, vehicle, system_status(reason, armed));
    send_arm_status(pilot, vehicle, reason);
}

static void send_text(struct pilot *pilot, uint8_t vehicle, uint8_t severity, const char *text)
{
    mavlink_message_t message;
    mavlink_statustext_t status = {.severity = severity};

    memcpy(status.text, text, strnlen(text, sizeof(status.text)));
    mavlink_msg_statustext_encode(vehicle, TELEMETRY_COMPONENT_ODID, &message, &status);
    send(pilot, &message);
}

/* Is it time to say what lasts? last_us: when it was said last, 0 before the first time. */
static bool is_to_be_told(int64_t *last_us, int64_t now_us)
{
    if (*last_us != 0 && now_us - *last_us < TOLD_AGAIN_US) {
        return false;
    }
    *last_us = now_us;
    return true;
}

void pilot_channel(struct pilot *pilot, uint8_t vehicle, enum channel channel,
                   const struct radio *radio, int64_t now_us)
{
    enum radio_state state = radio_seen(radio, now_us);
    bool on_air = state == RADIO_ON_AIR;
    char text[80];

    /* In whichever way it is off the air: one that goes to and fro between two isn't on it. */
    if (on_air) {
        pilot->off_us[channel] = 0;
    } else if (pilot->off_us[channel] == 0) {
        pilot->off_us[channel] = radio_seen_since_us(radio, now_us);
    }
    if (!on_air && pilot->seen[channel] && now_us - pilot->off_us[channel] >= TOLD_AFTER_US &&
        is_to_be_told(&pilot->lost_told_us[channel], now_us)) {
        pilot->lost[channel] = true;
        snprintf(text, sizeof(text), "Remote ID: %s off air (%s)", channel_title(channel),
                 radio_state_name(state));
        send_text(pilot, vehicle, MAV_SEVERITY_WARNING, text);
    } else if (on_air && pilot->lost[channel]) {
        pilot->lost[channel] = false;
        pilot->lost_told_us[channel] = 0;
        snprintf(text, sizeof(text), "Remote ID: %s on air again", channel_title(channel));
        send_text(pilot, vehicle, MAV_SEVERITY_NOTICE, text);
    }
    pilot->seen[channel] = pilot->seen[channel] || on_air;
}

void pilot_restore(struct pilot *pilot, enum channel channel, bool seen, bool lost)
{
    pilot->seen[channel] = seen;
    pilot->lost[channel] = lost;
}

void pilot_sources(struct pilot *pilot, uint8_t vehicle, bool contradicted, int64_t now_us)
{
    if (contradicted && is_to_be_told(&pilot->contradicted_told_us, now_us)) {
        send_text(pilot, vehicle, MAV_SEVERITY_CRITICAL,
                  "Remote ID: two sources speak as the autopilot");
    } else if (!contradicted && pilot->contradicted_told_us != 0) {
        pilot->contradicted_told_us = 0;
        send_text(pilot, vehicle, MAV_SEVERITY_NOTICE, "Remote ID: one autopilot speaks again");
    }
}

void pilot_ask_rate(struct pilot *pilot, uint8_t vehicle, uint16_t message_id, uint32_t interval_us)
{
    mavlink_message_t message;
    mavlink_command_long_t command = {
        .command = MAV_CMD_SET_MESSAGE_INTERVAL,
        .param1 = message_id,
        .param2 = (float)interval_us,
        .target_system = vehicle,
        .target_component = MAV_COMP_ID_AUTOPILOT1,
    };

    mavlink_msg_command_long_encode(vehicle, TELEMETRY_COMPONENT_ODID, &message, &command);
    send(pilot, &message);
}
