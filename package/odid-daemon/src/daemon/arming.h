/*
 * Armed or not: what opens settings and updates when it ends, and must not end
 * by somebody's word in the middle of a flight.
 *
 * Pure. Begins with the first HEARTBEAT that says so. Ends when every one of the
 * last 3 s said disarmed, no other source spoke as the autopilot, and nothing
 * that is known shows it flying.
 */
#ifndef ODID_ARMING_H
#define ODID_ARMING_H

#include <stdbool.h>
#include <stdint.h>

/* For so long disarmed is said without contradiction. */
#define ARMING_ENDS_US 3000000

struct arming {
    bool armed;
    int64_t disarmed_us; /* since when nothing else was said; INT64_MIN: armed was said last */
    int64_t said_us;     /* the last word */
};

/* armed: as it was before a restart of ours. */
void arming_init(struct arming *arming, bool armed);

/*
 * Takes one HEARTBEAT's word. doubtful: two sources contradict each other; flying:
 * landed state or movement say so. Returns whether it is armed.
 */
bool arming_take(struct arming *arming, bool says_armed, bool doubtful, bool flying,
                 int64_t now_us);

/* No HEARTBEAT comes, and it flies: armed, whatever was said last. */
void arming_flies(struct arming *arming);

#endif
