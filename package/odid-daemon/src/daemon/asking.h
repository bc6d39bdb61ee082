/*
 * What is used of the autopilot's messages is asked for
 * (MAV_CMD_SET_MESSAGE_INTERVAL), each one only while it doesn't come as often
 * as it is needed: ArduCopter's streams are empty at first, EXTENDED_SYS_STATE
 * is in none of ArduPilot's, and another station's REQUEST_DATA_STREAM resets
 * what was asked for.
 *
 * Pure. One message at a time, so that an answer is that one's. What was
 * refused twice isn't asked for again before the autopilot restarts; what is
 * ignored is asked for more and more seldom, down to once in 48 s, and again
 * within 5 s when it came and stops. HEARTBEAT, GPS_RAW_INT and GLOBAL_POSITION_INT,
 * without which there is no position, are asked for once in 6 s at least, whatever is answered.
 * GPS2_RAW, a second receiver's, is asked for where the first one's says that there is no fix, or
 * doesn't come, or is contradicted by the position: that may be where the second one is.
 *
 * Where nothing has to be asked for, or nothing may be, HEARTBEAT is all the same, once in 20 s: an
 * answer says that the way back works.
 */
#ifndef ODID_ASKING_H
#define ODID_ASKING_H

#include <stdbool.h>
#include <stdint.h>

#include "daemon/telemetry.h"

#define ASKING_MESSAGES 7

struct asking_message {
    int64_t heard_us, mean_us; /* the last one, INT64_MIN: none; the mean interval, 0: not known */
    int64_t from_us, wait_us;  /* not asked for before; and not again for so long */
    int64_t asked_us;          /* last, where asked_for */
    unsigned refusals;
    bool asked_for;
    bool done; /* and it began right after that */
};

struct asking {
    struct asking_message message[ASKING_MESSAGES];
    int asked; /* whose answer is waited for; -1: nobody's */
    int64_t asked_us;
    unsigned unanswered; /* questions since it answered, or did what it was asked for */
    bool fix;            /* GPS_RAW_INT says so */
};

struct asking_request {
    uint16_t message_id;
    uint32_t interval_us;
};

/* An autopilot is there, or another one, or it has restarted. */
void asking_begin(struct asking *asking, int64_t now_us);

/* Takes what came from the autopilot: the messages that are needed, and its answers. */
void asking_heard(struct asking *asking, const struct telemetry_update *update, int64_t now_us);

/* Is there something to ask for now? Called a few times a second. apart: the position, or its
 * altitude, isn't where its receiver is. */
bool asking_next(struct asking *asking, bool apart, int64_t now_us, struct asking_request *request);

/* The same where nothing is to be asked for: is there to ask whether it hears us? */
bool asking_probe(struct asking *asking, int64_t now_us, struct asking_request *request);

/* Is nothing of it answered any more, or done? Then ARM_STATUS isn't heard either. */
bool asking_unheard(const struct asking *asking);

/* Fills the MAVLink ids of the messages that were refused, and don't come as often as needed.
 * Returns how many. */
unsigned asking_refused(const struct asking *asking, int64_t now_us,
                        uint16_t message_ids[ASKING_MESSAGES]);

#endif
