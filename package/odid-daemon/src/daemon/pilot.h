/*
 * What the pilot is told, over MAVLink: HEARTBEAT and ARM_STATUS once a
 * second, STATUSTEXT when a channel is lost (and again every 30 s that it
 * stays so: no text is ever confirmed) or comes back, and the request for
 * faster positions (MAVLink Open Drone ID service).
 *
 * Pure but for the send function that it is given.
 */
#ifndef ODID_PILOT_H
#define ODID_PILOT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "radio/radio.h"

/* ARM_STATUS.error without terminator. */
#define PILOT_REASON_MAX 49

typedef void pilot_send_fn(void *context, const uint8_t *frame, size_t length);

struct pilot {
    pilot_send_fn *send;
    void *context;
    bool lost[CHANNELS], seen[CHANNELS];                  /* as last told */
    int64_t off_us[CHANNELS];                             /* since when it isn't on air; 0: it is */
    int64_t lost_told_us[CHANNELS], contradicted_told_us; /* 0: isn't so */
};

void pilot_init(struct pilot *pilot, pilot_send_fn *send, void *context);

/*
 * Once a second while the vehicle's system id is known (1-255). reason: the
 * first thing that keeps the aircraft from being legal to fly, "" when none.
 */
void pilot_tell(struct pilot *pilot, uint8_t vehicle, const char *reason, bool armed);

/*
 * A channel's state, once a second; now_us is above 0: a STATUSTEXT (warning)
 * when it was on air and has been off for a second, a notice when it is back.
 */
void pilot_channel(struct pilot *pilot, uint8_t vehicle, enum channel channel,
                   const struct radio *radio, int64_t now_us);

/* Before the first one: what a daemon before this one, in the same flight, has seen and told. */
void pilot_restore(struct pilot *pilot, enum channel channel, bool seen, bool lost);

/* Do two sources speak as the autopilot? A STATUSTEXT while that lasts (critical), as of a
 * channel, and when it ends. */
void pilot_sources(struct pilot *pilot, uint8_t vehicle, bool contradicted, int64_t now_us);

/* Asks component 1 for message_id every interval_us (MAV_CMD_SET_MESSAGE_INTERVAL). */
void pilot_ask_rate(struct pilot *pilot, uint8_t vehicle, uint16_t message_id,
                    uint32_t interval_us);

#endif
