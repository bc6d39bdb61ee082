/*
 * Another radio that hears the first one's beacons. What it hears may be somebody else's: whoever
 * is in reach can send a beacon with our address. So it tells of beacons, and never of silence.
 */
#ifndef ODID_BEACON_LISTENER_H
#define ODID_BEACON_LISTENER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* It listens on the one channel, for a tenth of a second. */
#define BEACON_LISTEN_EVERY_MS 4000

/* Elements of a beacon (IEEE 802.11, 9.4.2), and whether one is a pack of Remote ID's messages
 * (ASTM F3411's, in ASD-STAN's element), with at least one in it. */
bool beacon_listener_is_remote_id(const uint8_t *elements, size_t length);

/* Called again and again with the same two interfaces. listener: one that is up and that nobody
 * uses, or it isn't heard. now_ms: CLOCK_MONOTONIC's. Returns when such a beacon of iface's was
 * heard last; INT64_MIN: never, as far as is known. */
int64_t beacon_listener_look(const char *iface, const char *listener, int64_t now_ms);

#endif
