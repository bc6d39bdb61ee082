/* What the fuzzers of MAVLink send: whole frames of the messages that the daemon reads, and of one
 * that it doesn't. */
#ifndef ODID_FUZZ_FRAMES_H
#define ODID_FUZZ_FRAMES_H

#include <common/mavlink.h>
#include <stddef.h>
#include <stdint.h>

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

/* By their place here the corpora name them (make_corpus.py). */
static const uint32_t messages[] = {
    MAVLINK_MSG_ID_HEARTBEAT,
    MAVLINK_MSG_ID_SYSTEM_TIME,
    MAVLINK_MSG_ID_GPS_RAW_INT,
    MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
    MAVLINK_MSG_ID_HOME_POSITION,
    MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_BASIC_ID,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_AUTHENTICATION,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_SELF_ID,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_OPERATOR_ID,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_SYSTEM_UPDATE,
    MAVLINK_MSG_ID_OPEN_DRONE_ID_ARM_STATUS,
    MAVLINK_MSG_ID_ATTITUDE,
};

/* Of a message whose payload is filled in; with the channel's next number. Returns its length. */
static inline size_t finish_frame(mavlink_message_t *message, uint32_t id, uint8_t system,
                                  uint8_t component, uint8_t octets[MAVLINK_MAX_PACKET_LEN])
{
    const mavlink_msg_entry_t *entry = mavlink_get_msg_entry(id);

    message->msgid = id;
    mavlink_finalize_message_chan(message, system, component, MAVLINK_COMM_0, entry->min_msg_len,
                                  entry->max_msg_len, entry->crc_extra);
    return mavlink_msg_to_send_buffer(octets, message);
}

#endif
