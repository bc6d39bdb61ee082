/*
 * What is known of the aircraft, as messages on the channels: at the schedule's
 * slots, and a newer position at once, where a Location is on the air, has been
 * sent, and the next slot leaves the time for its own message.
 *
 * The counters are those of what a controller took: a payload that was given
 * and never accepted, because one of the two was late, gives its number back.
 */
#ifndef ODID_BROADCAST_H
#define ODID_BROADCAST_H

#include <stdint.h>

#include "config/config.h"
#include "daemon/aircraft.h"
#include "daemon/status.h"

/* Starts the first slot. All three outlive it; lateness counts how late the slots are. */
void broadcast_start(const struct config *config, const struct aircraft *aircraft,
                     struct slot_lateness *lateness, int64_t now_us);

/* A position came, newer or not. */
void broadcast_position(int64_t now_us);

#endif
