/*
 * Octets -> MAVLink frames, at a cost that the sender doesn't choose.
 *
 * Pure. MAVLink 1 and 2, signed or not (no key is known: a signature says
 * nothing here). Only a frame of a known message with a right checksum and no
 * incompatibility flags but "signed" is delivered. What lies within another
 * frame is that frame's content, also when we can't read it: never delivered.
 *
 * Each octet is looked at three times at most on average, whatever comes
 * (FRAMING_LOOKS_MAX); once in ordinary traffic.
 */
#ifndef ODID_FRAMING_H
#define ODID_FRAMING_H

#include <common/mavlink.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FRAMING_LOOKS_MAX 3
/* The longest frame, and the octet behind it, twice: room to go on without moving at each frame. */
#define FRAMING_HELD (2 * (MAVLINK_MAX_PACKET_LEN + 1))

struct framing_counters {
    uint64_t octets;     /* that came */
    uint64_t looks;      /* at octets; a checksum over one counts as another look */
    uint64_t bad_crc;    /* frames of known messages that were damaged on the way */
    uint64_t unknown_id; /* frames of messages that are not in our definitions */
    uint64_t refused;    /* what is no frame, or none that may be read: unknown flags, cut short,
                            not looked at because too much of it came */
};

typedef void framing_fn(void *context, const mavlink_message_t *message);

/* A byte stream's state. All zeros: nothing has come. */
struct framing {
    uint8_t held[FRAMING_HELD];
    size_t from, to;
    bool failed;    /* the frame at `from` can't be read; what to do about it isn't decided */
    unsigned spent; /* on checksums beyond what the octets that came pay for */
};

/*
 * A serial link: frames come in any portions, with anything between them.
 * Where a frame can't be read and another one begins right behind its end, it
 * is passed over whole; else its start byte was none, and what follows that is
 * tried, as far as the octets that came pay for it.
 */
void framing_stream(struct framing *framing, struct framing_counters *counters,
                    const uint8_t *octets, size_t length, framing_fn *deliver, void *context);

/*
 * A datagram: whole frames, one behind the other, and nothing else (as
 * mavlink-router and all known senders do it). From the first that isn't one, or
 * is damaged, all the rest is refused. A frame of an unknown message is passed
 * over by its length.
 */
void framing_datagram(struct framing_counters *counters, const uint8_t *octets, size_t length,
                      framing_fn *deliver, void *context);

#endif
