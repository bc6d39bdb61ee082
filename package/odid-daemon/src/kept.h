/*
 * What a restarted daemon must still know. In <run_dir>/kept: the vehicle, so
 * that its positions count before its next HEARTBEAT, up to a second later;
 * and in flight the frozen take-off point. In <run_dir>/counters: the message
 * counters, so that none goes backward, nor stands still over new content.
 * run_dir is a tmpfs: gone with the power.
 */
#ifndef ODID_KEPT_H
#define ODID_KEPT_H

#include <stdint.h>

#include "aircraft.h"
#include "messages.h"

struct kept {
    uint8_t vehicle;                 /* MAVLink system id, 1..255; 0: none was known */
    struct aircraft_takeoff takeoff; /* known = false: on the ground, or it wasn't known */
};

/* Reads it; what is missing or makes no sense is unknown. */
void kept_read(const char *run_dir, struct kept *kept);

/* Replaces it atomically. Returns 0, or -errno. */
int kept_write(const char *run_dir, const struct kept *kept);

/* All counters there are. */
struct kept_counters {
    struct messages_counters legacy;
    struct messages_counter extended, beacon;
};

/*
 * Reads them, and opens their file to be written to; what is missing or makes
 * no sense begins at 0. Returns a descriptor, or -errno: then nothing is kept.
 */
int kept_counters_open(const char *run_dir, struct kept_counters *counters);

/* As they are now. Once a slot: not atomic for who reads at that moment, but the daemon that does
 * comes after this one. Returns 0, or -errno. */
int kept_counters_write(int fd, const struct kept_counters *counters);

#endif
