/*
 * MAVLink frames for tests: frame_<message>(system, component, &content) makes
 * the bytes that would come from a serial port.
 */
#ifndef ODID_TESTS_MAVLINK_FRAMES_H
#define ODID_TESTS_MAVLINK_FRAMES_H

#include <common/mavlink.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

struct frame {
    uint8_t bytes[MAVLINK_MAX_PACKET_LEN];
    size_t length;
};

#define FRAME_FUNCTION(name)                                                                       \
    static inline struct frame frame_##name(uint8_t system, uint8_t component,                     \
                                            const mavlink_##name##_t *content)                     \
    {                                                                                              \
        mavlink_message_t message;                                                                 \
        struct frame frame;                                                                        \
                                                                                                   \
        mavlink_msg_##name##_encode(system, component, &message, content);                         \
        frame.length = mavlink_msg_to_send_buffer(frame.bytes, &message);                          \
        return frame;                                                                              \
    }

FRAME_FUNCTION(heartbeat)
FRAME_FUNCTION(system_time)
FRAME_FUNCTION(gps_raw_int)
FRAME_FUNCTION(statustext)
FRAME_FUNCTION(attitude)
FRAME_FUNCTION(global_position_int)
FRAME_FUNCTION(home_position)
FRAME_FUNCTION(command_ack)
FRAME_FUNCTION(extended_sys_state)
FRAME_FUNCTION(open_drone_id_basic_id)
FRAME_FUNCTION(open_drone_id_location)
FRAME_FUNCTION(open_drone_id_authentication)
FRAME_FUNCTION(open_drone_id_self_id)
FRAME_FUNCTION(open_drone_id_system)
FRAME_FUNCTION(open_drone_id_system_update)
FRAME_FUNCTION(open_drone_id_operator_id)
FRAME_FUNCTION(open_drone_id_message_pack)
FRAME_FUNCTION(open_drone_id_arm_status)

#undef FRAME_FUNCTION

/* The following frames don't go on with the numbers of those before: another sender's. */
static inline void frames_are_another_senders(void)
{
    mavlink_get_channel_status(MAVLINK_COMM_0)->current_tx_seq += 100;
}

/* What the following frames are: MAVLink 1 or 2, signed or not. */
static inline void frames_are(unsigned version, bool is_signed)
{
    static mavlink_signing_t signing;
    mavlink_status_t *status = mavlink_get_channel_status(MAVLINK_COMM_0);

    mavlink_set_proto_version(MAVLINK_COMM_0, version);
    memset(&signing, 0, sizeof(signing));
    signing.flags = MAVLINK_SIGNING_FLAG_SIGN_OUTGOING;
    signing.timestamp = 1000;
    memset(signing.secret_key, 0x42, sizeof(signing.secret_key));
    status->signing = is_signed ? &signing : NULL;
}

#endif
