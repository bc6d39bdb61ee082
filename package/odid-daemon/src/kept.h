/*
 * What a restarted daemon must still know, in <run_dir>/kept: the vehicle, so
 * that its positions count before its next HEARTBEAT, up to a second later;
 * and in flight the frozen take-off point. run_dir is a tmpfs: gone with the
 * power.
 */
#ifndef ODID_KEPT_H
#define ODID_KEPT_H

#include <stdint.h>

#include "aircraft.h"

struct kept {
    uint8_t vehicle;                 /* MAVLink system id, 1..255; 0: none was known */
    struct aircraft_takeoff takeoff; /* known = false: on the ground, or it wasn't known */
};

/* Reads it; what is missing or makes no sense is unknown. */
void kept_read(const char *run_dir, struct kept *kept);

/* Replaces it atomically. Returns 0, or -errno. */
int kept_write(const char *run_dir, const struct kept *kept);

#endif
