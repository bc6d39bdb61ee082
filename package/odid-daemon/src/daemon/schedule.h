/*
 * Which message goes out next on Bluetooth legacy advertising, until when.
 *
 * Pure. A cycle of eight slots of 125 ms on an absolute grid:
 *
 *   Location, Basic ID, Location, System, Location, Operator ID, Location, Self ID
 *
 * So Location is renewed every quarter second and every other message every
 * second, and losing any single packet breaks no rate. A payload stays set
 * longer than the advertising interval + 10 ms, or it may never be sent. A
 * message that does not exist gives its slot to Location. Two Basic IDs take
 * turns in their slot; Authentication pages take turns with Self ID.
 *
 * The grid says when, the slots that were served say what: a slot that passed
 * unused takes no message with it, so none waits for more than eight slots that
 * were served, however late the machine is.
 */
#ifndef ODID_SCHEDULE_H
#define ODID_SCHEDULE_H

#include <stdint.h>

#include "daemon/messages.h"

#define SCHEDULE_SLOT_US 125000
#define SCHEDULE_SLOTS 8

struct schedule {
    int64_t origin_us; /* start of slot 0 */
    int64_t slot;      /* number of the next slot since origin */
    int64_t served;    /* how many were: the place in the cycle */
};

struct schedule_entry {
    enum message_type type;
    unsigned index;   /* which Basic ID or Authentication page */
    int64_t until_us; /* when the next slot starts: the deadline to come back at */
    int64_t late_us;  /* since the slot was due, skipped ones included */
    unsigned skipped; /* whole slots that passed unused: never made up for by a burst */
};

/* The first slot starts at now. */
void schedule_start(struct schedule *schedule, int64_t now_us);

/* When the next slot is due. */
int64_t schedule_deadline(const struct schedule *schedule);

/*
 * Takes the slot that is due. available[type]: how many messages of that type
 * exist (messages_available); the index is 0 for single ones.
 */
struct schedule_entry schedule_next(struct schedule *schedule, int64_t now_us,
                                    const unsigned available[MESSAGE_TYPES]);

/* The last slot's message never went out: the next slot is for the same one. */
void schedule_withdraw(struct schedule *schedule);

#endif
