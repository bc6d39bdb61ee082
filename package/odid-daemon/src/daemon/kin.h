/*
 * The vehicle's kin: other systems on its line whose autopilot has its clock.
 *
 * An autopilot that is given another system id in flight goes on with its
 * clock and its frames' numbers. So it is the vehicle's kin, and takes its own
 * place when the old id is silent. Until then the numbers of both are one row
 * (belief_sequence): who speaks on under the old id gives himself away by it,
 * whatever numbers he has, and an autopilot that is given its id back doesn't.
 * A neighbour that was switched on at another time has another clock.
 *
 * Pure.
 */
#ifndef ODID_KIN_H
#define ODID_KIN_H

#include <stdbool.h>
#include <stdint.h>

#include "daemon/belief.h"

/* An id may be changed again before the one before it is forgotten. */
#define KIN_MAX 4

struct kin {
    struct {
        uint8_t system;
        unsigned same_clock; /* so often in a row; 0: there is none */
        int64_t heard_us;
    } of[KIN_MAX];
};

/* A frame of that system's autopilot, and what it says of its clock. Is it kin? */
bool kin_hear(struct kin *kin, uint8_t system, enum belief_clock_is clock, int64_t now_us);

/* Is it kin, and no other one is? Of two that might be the vehicle, neither is. */
bool kin_is_only(const struct kin *kin, uint8_t system, int64_t now_us);

#endif
