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

/* An id may be changed again before the one before it is forgotten. */
#define KIN_MAX 4

struct kin {
    struct {
        uint8_t system;
        unsigned same_clock; /* so often; 0: there is none */
        int64_t begun_us, heard_us;
    } of[KIN_MAX];
};

/* What a frame says of its sender's clock. */
enum kin_clock { KIN_CLOCK_UNTOLD, KIN_CLOCK_ANOTHER, KIN_CLOCK_LATE, KIN_CLOCK_SAME };

/* A frame of that system's autopilot. Is it kin for sure, by two words of its clock? */
bool kin_hear(struct kin *kin, uint8_t system, enum kin_clock clock, int64_t now_us);

/* Is it kin by one word, and nobody else has been since it began? One whose id is changed again and
 * again has one at a time; of two that speak beside each other neither is known to be the vehicle.
 */
bool kin_is_only(const struct kin *kin, uint8_t system, int64_t now_us);

/* Does any speak? */
bool kin_speaks(const struct kin *kin, int64_t now_us);

#endif
