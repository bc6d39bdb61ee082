/*
 * How many messages go into one vendor element: all that there are, until the chip refuses that.
 * What it refused for once is given whole again, then as far as it fitted before, then without
 * Self-ID and Authentication, then one by one: with three each time a message that is needed would
 * be left out for good. From time to time all is tried again.
 */
#ifndef ODID_BEACON_ROOM_H
#define ODID_BEACON_ROOM_H

#include <stdbool.h>
#include <stdint.h>

struct beacon_room {
    unsigned most;     /* messages in an element: 1..MESSAGES_PACK_MAX */
    unsigned fitted;   /* so many were taken once, at most */
    unsigned taken;    /* so many were taken, and more is being tried; 0: no trial */
    unsigned refusals; /* running */
    int64_t again_us, again_wait_us;
};

/* Of another chip, or another driver of it, nothing is known. */
void beacon_room_forget(struct beacon_room *room);

/* Whether an element with so many messages is a trial: refused, it costs what was taken before no
 * time. */
bool beacon_room_is_trial(const struct beacon_room *room, unsigned given);

void beacon_room_taken(struct beacon_room *room, unsigned given, int64_t now_us);
/* Returns whether there is anything else to be given: as much once more, or less. */
bool beacon_room_refused(struct beacon_room *room, unsigned given, int64_t now_us);

#endif
