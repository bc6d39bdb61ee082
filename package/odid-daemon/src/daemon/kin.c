#include "daemon/kin.h"

#define SURE 2           /* a clock is looked at so often ... */
#define ALIVE_US 1500000 /* ... and whose it is is forgotten after so long */

static bool is_alive(const struct kin *kin, unsigned i, int64_t now_us)
{
    return kin->of[i].same_clock > 0 && now_us - kin->of[i].heard_us < ALIVE_US;
}

/* Where that system is remembered, or can be; KIN_MAX: nowhere. */
static unsigned find(struct kin *kin, uint8_t system, int64_t now_us)
{
    unsigned place = KIN_MAX;

    for (unsigned i = 0; i < KIN_MAX; i++) {
        if (!is_alive(kin, i, now_us)) {
            place = i;
        } else if (kin->of[i].system == system) {
            return i;
        }
    }
    if (place < KIN_MAX) {
        kin->of[place].system = system;
        kin->of[place].same_clock = 0;
    }
    return place;
}

bool kin_hear(struct kin *kin, uint8_t system, enum belief_clock_is clock, int64_t now_us)
{
    unsigned i = find(kin, system, now_us);

    if (i == KIN_MAX) {
        return false;
    }
    if (clock == BELIEF_CLOCK_ANOTHER) {
        kin->of[i].same_clock = 0;
        return false;
    }
    kin->of[i].same_clock += clock == BELIEF_CLOCK_SAME;
    kin->of[i].heard_us = now_us;
    return kin->of[i].same_clock >= SURE;
}

bool kin_is_only(const struct kin *kin, uint8_t system, int64_t now_us)
{
    bool is = false;

    for (unsigned i = 0; i < KIN_MAX; i++) {
        if (is_alive(kin, i, now_us)) {
            if (kin->of[i].system != system || kin->of[i].same_clock < SURE) {
                return false;
            }
            is = true;
        }
    }
    return is;
}
