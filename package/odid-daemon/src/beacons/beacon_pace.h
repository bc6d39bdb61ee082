/*
 * Whether a number that a chip tells counts its beacons: it moves at their pace. Other firmware may
 * have another number at that place.
 */
#ifndef ODID_BEACON_PACE_H
#define ODID_BEACON_PACE_H

#include <stdbool.h>
#include <stdint.h>

/* At least BEACON_COUNTED_PER_S (radio/beacon_evidence.h): others keep some of the ten from the
 * air. */
#define BEACON_PACE_MOST_PER_S 20
/* So many reports have to be at that pace, one after the other. */
#define BEACON_PACE_TIMES 3

struct beacon_pace {
    bool began, seen; /* seen: once is for good */
    uint32_t count;
    int64_t at_ms;
    unsigned times;
};

void beacon_pace_take(struct beacon_pace *pace, uint32_t count, int64_t at_ms);

#endif
