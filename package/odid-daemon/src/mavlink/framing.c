#include "mavlink/framing.h"

#include <stdbool.h>
#include <string.h>

#define HEADER_1 (MAVLINK_CORE_HEADER_MAVLINK1_LEN + 1)
#define HEADER_2 MAVLINK_NUM_HEADER_BYTES
/* As far as a frame's length is decided: start byte, payload's length, and MAVLink 2's flags. */
#define LENGTH_KNOWN_1 2
#define LENGTH_KNOWN_2 3
/* Checksums over octets may cost one and a half for each that comes, kept in halves, ... */
#define EARNED_HALVES 3
#define CRC_HALVES 2
/* ... and so much on credit: the noise before the first frame is worth a closer look. */
#define CREDIT_HALVES 4096

enum verdict { GOOD, BAD_CRC, UNKNOWN_ID, REFUSED };

static bool is_start(uint8_t octet)
{
    return octet == MAVLINK_STX || octet == MAVLINK_STX_MAVLINK1;
}

/* Of the frame that begins here; 0 when there is too little of it to know. */
static size_t frame_length(const uint8_t *at, size_t have)
{
    size_t around = HEADER_2 + MAVLINK_NUM_CHECKSUM_BYTES;

    if (at[0] == MAVLINK_STX_MAVLINK1) {
        return have < LENGTH_KNOWN_1 ? 0 : HEADER_1 + MAVLINK_NUM_CHECKSUM_BYTES + (size_t)at[1];
    }
    if (have < LENGTH_KNOWN_2) {
        return 0;
    }
    return around + at[1] + (at[2] & MAVLINK_IFLAG_SIGNED ? MAVLINK_SIGNATURE_BLOCK_LEN : 0);
}

static void read_header(const uint8_t *at, mavlink_message_t *message)
{
    memset(message, 0, sizeof(*message));
    message->magic = at[0];
    message->len = at[1];
    if (at[0] == MAVLINK_STX_MAVLINK1) {
        message->seq = at[2];
        message->sysid = at[3];
        message->compid = at[4];
        message->msgid = at[5];
    } else {
        message->incompat_flags = at[2];
        message->compat_flags = at[3];
        message->seq = at[4];
        message->sysid = at[5];
        message->compid = at[6];
        message->msgid = at[7] | (uint32_t)at[8] << 8 | (uint32_t)at[9] << 16;
    }
}

/* What the header alone says. entry: the message's definition, NULL when it is unknown. */
static enum verdict judge_header(const mavlink_message_t *message, const mavlink_msg_entry_t *entry)
{
    if (message->incompat_flags & ~MAVLINK_IFLAG_MASK) {
        return REFUSED;
    }
    if (entry == NULL) {
        return UNKNOWN_ID; /* the checksum covers a seed from the definition: it can't be told */
    }
    /* MAVLink 1 never cuts a payload. */
    return message->magic == MAVLINK_STX_MAVLINK1 && message->len != entry->min_msg_len ? REFUSED
                                                                                        : GOOD;
}

static enum verdict judge_content(const uint8_t *at, size_t header, uint8_t seed,
                                  mavlink_message_t *message)
{
    size_t end = header + message->len;
    uint16_t crc = crc_calculate(at + 1, (uint16_t)(end - 1));

    crc_accumulate(seed, &crc);
    if (at[end] != (crc & 0xFF) || at[end + 1] != crc >> 8) {
        return BAD_CRC;
    }
    message->checksum = crc;
    memcpy(_MAV_PAYLOAD_NON_CONST(message), at + header, message->len);
    return GOOD;
}

/* The frame's length is that of a whole one. *checked: octets under the checksum that was made. */
static enum verdict judge_frame(const uint8_t *at, mavlink_message_t *message, size_t *checked)
{
    size_t header = at[0] == MAVLINK_STX ? HEADER_2 : HEADER_1;
    const mavlink_msg_entry_t *entry;
    enum verdict verdict;

    read_header(at, message);
    entry = mavlink_get_msg_entry(message->msgid);
    verdict = judge_header(message, entry);
    *checked = 0;
    if (verdict == GOOD) {
        *checked = header + message->len;
        verdict = judge_content(at, header, entry->crc_extra, message);
    }
    return verdict;
}

static void count_verdict(struct framing_counters *counters, enum verdict verdict)
{
    counters->bad_crc += verdict == BAD_CRC;
    counters->unknown_id += verdict == UNKNOWN_ID;
    counters->refused += verdict == REFUSED;
}

void framing_datagram(struct framing_counters *counters, const uint8_t *octets, size_t length,
                      framing_fn *deliver, void *context)
{
    mavlink_message_t message;
    enum verdict verdict = GOOD;
    size_t checked;

    counters->octets += length;
    while (length > 0 && (verdict == GOOD || verdict == UNKNOWN_ID)) {
        size_t frame = is_start(octets[0]) ? frame_length(octets, length) : 0;

        counters->looks++;
        if (frame == 0 || frame > length) {
            counters->refused++;
            return;
        }
        verdict = judge_frame(octets, &message, &checked);
        counters->looks += checked;
        count_verdict(counters, verdict);
        if (verdict == GOOD) {
            deliver(context, &message);
        }
        octets += frame;
        length -= frame;
    }
}

/* ---- a stream ---- */

/* Takes as much as there is room for. Returns how much that is: never 0, a frame that fills half of
 * the room has been decided. */
static size_t hold(struct framing *framing, const uint8_t *octets, size_t length)
{
    size_t room = FRAMING_HELD - framing->to;

    if (room == 0) {
        framing->to -= framing->from;
        memmove(framing->held, framing->held + framing->from, framing->to);
        framing->from = 0;
        room = FRAMING_HELD - framing->to;
    }
    length = length < room ? length : room;
    memcpy(framing->held + framing->to, octets, length);
    framing->to += length;
    return length;
}

static void find_start(struct framing *framing, struct framing_counters *counters)
{
    while (framing->from < framing->to && !is_start(framing->held[framing->from])) {
        framing->from++;
        counters->looks++;
    }
}

/* Judges the whole frame that begins here; what can't be paid for is refused unread. */
static enum verdict judge_first(struct framing *framing, struct framing_counters *counters,
                                mavlink_message_t *message)
{
    size_t checked = 0;
    enum verdict verdict = REFUSED;

    if (framing->spent <= CREDIT_HALVES) {
        verdict = judge_frame(framing->held + framing->from, message, &checked);
    }
    counters->looks += 1 + checked;
    framing->spent += CRC_HALVES * (unsigned)checked;
    count_verdict(counters, verdict);
    return verdict;
}

/*
 * A frame that can't be read was one, damaged or not for us, where another one
 * follows at once. Else its start byte only looked like one, in the middle of
 * something: frames may have begun since.
 */
static void pass_over(struct framing *framing, size_t frame)
{
    framing->from += is_start(framing->held[framing->from + frame]) ? frame : 1;
    framing->failed = false;
}

/* The first held frame. Returns false when more has to come before it is decided. */
static bool take_first(struct framing *framing, struct framing_counters *counters,
                       framing_fn *deliver, void *context)
{
    size_t have = framing->to - framing->from;
    size_t frame = have == 0 ? 0 : frame_length(framing->held + framing->from, have);
    mavlink_message_t message;

    if (frame == 0 || frame > have) {
        return false;
    }
    if (!framing->failed && judge_first(framing, counters, &message) == GOOD) {
        framing->from += frame;
        deliver(context, &message);
        return true;
    }
    framing->failed = true;
    if (have == frame) {
        return false; /* the octet behind it decides */
    }
    pass_over(framing, frame);
    return true;
}

void framing_stream(struct framing *framing, struct framing_counters *counters,
                    const uint8_t *octets, size_t length, framing_fn *deliver, void *context)
{
    while (length > 0) {
        size_t taken = hold(framing, octets, length);
        unsigned earned = EARNED_HALVES * (unsigned)taken;

        counters->octets += taken;
        framing->spent -= framing->spent < earned ? framing->spent : earned;
        do {
            find_start(framing, counters);
        } while (take_first(framing, counters, deliver, context));
        octets += taken;
        length -= taken;
    }
}
