/*
 * The count of beacons in what a Broadcom chip's firmware answers to "counters".
 */
#ifndef ODID_BEACON_COUNTERS_H
#define ODID_BEACON_COUNTERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Longer than any that is known: 1.4 KB. */
#define BEACON_COUNTERS_MAX 2048

/*
 * Little-endian, from the chip. By the layouts in Broadcom's public drivers (wlioctl.h): of the
 * versions 10 and 11 one structure; of version 30 tagged parts, of which the radio's macro-code
 * has one. Returns whether there is one; of another version nothing is guessed.
 */
bool beacon_counters_read(const uint8_t *answer, size_t length, uint32_t *beacons);

#endif
