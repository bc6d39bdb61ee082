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

bool kin_hear(struct kin *kin, uint8_t system, enum kin_clock clock, int64_t now_us)
{
    unsigned i = find(kin, system, now_us);

    if (i == KIN_MAX) {
        return false;
    }
    if (clock == KIN_CLOCK_ANOTHER) {
        kin->of[i].same_clock = 0;
        return false;
    }
    kin->of[i].begun_us = kin->of[i].same_clock == 0 ? now_us : kin->of[i].begun_us;
    kin->of[i].same_clock += clock == KIN_CLOCK_SAME;
    kin->of[i].heard_us = now_us;
    return kin->of[i].same_clock >= SURE;
}

static bool another_spoke_since(const struct kin *kin, unsigned it, int64_t now_us)
{
    for (unsigned i = 0; i < KIN_MAX; i++) {
        if (i != it && is_alive(kin, i, now_us) && kin->of[i].heard_us > kin->of[it].begun_us) {
            return true;
        }
    }
    return false;
}

bool kin_is_only(const struct kin *kin, uint8_t system, int64_t now_us)
{
    for (unsigned i = 0; i < KIN_MAX; i++) {
        if (is_alive(kin, i, now_us) && kin->of[i].system == system) {
            return !another_spoke_since(kin, i, now_us);
        }
    }
    return false;
}

bool kin_speaks(const struct kin *kin, int64_t now_us)
{
    for (unsigned i = 0; i < KIN_MAX; i++) {
        if (is_alive(kin, i, now_us)) {
            return true;
        }
    }
    return false;
}
