/*
 * What is known -> the bytes that go on the air (ASTM F3411, protocol version
 * 2, encoded by opendroneid-core-c).
 *
 * Pure. Every field is clamped, or made "unknown", by itself before encoding:
 * the encoder refuses a whole message for one bad field, and lets NaN pass.
 */
#ifndef ODID_MESSAGES_H
#define ODID_MESSAGES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "daemon/aircraft.h"

#define MESSAGE_SIZE 25
/* Bluetooth legacy advertising data: 1E 16 FA FF 0D <counter> <25 bytes>. */
#define MESSAGES_LEGACY_SIZE 31
#define MESSAGES_PACK_MAX 9
/* F2 19 <count> <messages>: the pack without application code and counter. */
#define MESSAGES_PACK_SIZE (3 + MESSAGES_PACK_MAX * MESSAGE_SIZE)
/* <length> 16 FA FF 0D <counter> <pack>: extended advertising data. */
#define MESSAGES_EXTENDED_SIZE (6 + MESSAGES_PACK_SIZE)
#define MESSAGES_EXTENDED_EMPTY (6 + 3) /* of a pack without messages */
/* So many messages have room in so much of it. */
#define MESSAGES_EXTENDED_MOST(octets)                                                             \
    ((unsigned)(((octets)-MESSAGES_EXTENDED_EMPTY) / MESSAGE_SIZE))
/* DD <length> FA 0B BC 0D <counter> <pack>: an 802.11 vendor specific element. */
#define MESSAGES_ELEMENT_SIZE (7 + MESSAGES_PACK_SIZE)
#define MESSAGES_ELEMENT_EMPTY (7 + 3) /* of a pack without messages */

/* ASTM message types. */
enum message_type {
    MESSAGE_BASIC_ID = 0,
    MESSAGE_LOCATION = 1,
    MESSAGE_AUTHENTICATION = 2,
    MESSAGE_SELF_ID = 3,
    MESSAGE_SYSTEM = 4,
    MESSAGE_OPERATOR_ID = 5,
    MESSAGE_TYPES = 6,
};

/*
 * One counter a message type for legacy advertising, and one a channel for the
 * pack; each steps when the content changes and wraps from 255 to 0. Two Basic
 * IDs share a counter; all pages of one Authentication message carry the same.
 * What was built and never went out leaves no gap in it: the next one is built
 * from a copy of the counter as it was before.
 */
struct messages_counter {
    uint8_t value;
    bool used;
    uint32_t content_hash; /* of what the value was last given for */
};

struct messages_counters {
    struct messages_counter legacy[MESSAGE_TYPES];
};

/*
 * Encodes one message of the view. index: which Basic ID (0..basic_ids-1) or
 * Authentication page. Returns false when the view has no such message;
 * Location and System always exist.
 */
bool messages_encode(const struct aircraft_view *view, enum message_type type, unsigned index,
                     uint8_t message[MESSAGE_SIZE]);

/* Is there such a message to send, and how many (Basic IDs, Authentication pages)? */
unsigned messages_available(const struct aircraft_view *view, enum message_type type);

/* Encodes and wraps one message for legacy advertising, stepping its counter when it changed. */
bool messages_legacy(struct messages_counters *counters, const struct aircraft_view *view,
                     enum message_type type, unsigned index, uint8_t data[MESSAGES_LEGACY_SIZE]);

/*
 * Encodes all messages of the view as a pack, in the order of their types, at
 * most so many (1..MESSAGES_PACK_MAX). Authentication pages are in it only when
 * all of them fit, and are the first to be left out; Location is in it always.
 * Returns the number of bytes.
 */
size_t messages_pack(const struct aircraft_view *view, unsigned most,
                     uint8_t pack[MESSAGES_PACK_SIZE]);

/* Encodes one message as a pack of its own; none of a type that the view hasn't got. */
size_t messages_pack_of(const struct aircraft_view *view, enum message_type type, unsigned index,
                        uint8_t pack[MESSAGES_PACK_SIZE]);

/* Is there less of a type in a pack of at most so many than in one of MESSAGES_PACK_MAX? */
bool messages_left_out(const struct aircraft_view *view, unsigned most, enum message_type type);

/* Has not even one of MESSAGES_PACK_MAX room for all of a type? */
bool messages_exceed_pack(const struct aircraft_view *view, enum message_type type);

/*
 * Wraps a pack for extended advertising or for a beacon. counter belongs to
 * the channel and steps when the pack changed. Each returns the number of bytes.
 */
size_t messages_extended(struct messages_counter *counter, const uint8_t *pack, size_t pack_size,
                         uint8_t data[MESSAGES_EXTENDED_SIZE]);
size_t messages_element(struct messages_counter *counter, const uint8_t *pack, size_t pack_size,
                        uint8_t element[MESSAGES_ELEMENT_SIZE]);

#endif
