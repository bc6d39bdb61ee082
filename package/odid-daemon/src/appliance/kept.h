/*
 * <run_dir>/kept: what the daemon knows of vehicle and flight, for itself after
 * a restart and for everybody else. run_dir is a tmpfs: gone with the power.
 *
 *   vehicle 7                  MAVLink system id; 0 while none is known
 *   armed yes                  yes, or no: by what the autopilot says; what it
 *                              said last was no, and it is silent, or speaks on
 *                              without a HEARTBEAT (unsaid: nobody knows then);
 *                              unheard: no autopilot since power-on;
 *                              awaited: likewise, and this board has had one
 *   armed-once yes             since power-on: yes or no
 *   fix yes                    the autopilot has a GNSS fix: yes or no
 *   vertical-inverted no       it sends its vertical speed upside down: yes or no
 *   crashed no                 it said that it crashed, and wasn't armed since: yes or no
 *   on-air bt4 wifi            the channels that were on the air since power-on
 *   told-lost wifi             of these, the ones that the pilot was told are lost
 *   takeoff 57.7 11.9 12 48    in flight: the frozen point, degrees and metres
 *
 * Replaced atomically, at the daemon's first start and on change: whoever wants
 * to know waits for that (inotify). Nobody else says whether it is armed. While
 * the daemon doesn't answer (status_ask) the file may be old: then "no" isn't
 * known to be true.
 */
#ifndef ODID_KEPT_H
#define ODID_KEPT_H

#include <stdbool.h>
#include <stdint.h>

#include "radio/radio.h"

#define KEPT_FILE "kept"

/* The place where it was armed. */
struct kept_takeoff {
    bool known;
    double latitude_deg, longitude_deg;
    double altitude_msl_m, altitude_geodetic_m; /* each NAN when unknown */
};

enum kept_armed { KEPT_UNHEARD, KEPT_DISARMED, KEPT_ARMED, KEPT_SILENT, KEPT_UNSAID, KEPT_AWAITED };

struct kept {
    uint8_t vehicle; /* MAVLink system id, 1..255; 0: none was known */
    enum kept_armed armed;
    bool armed_once;
    bool fix_known;
    bool vertical_inverted;
    bool crashed;
    bool on_air[CHANNELS];       /* once, since power-on */
    bool told_lost[CHANNELS];    /* and not yet that they are back */
    struct kept_takeoff takeoff; /* known = false: on the ground, or it wasn't known */
};

/* Nobody was heard since power-on. */
static inline bool kept_is_unheard(const struct kept *kept)
{
    return kept->armed == KEPT_UNHEARD || kept->armed == KEPT_AWAITED;
}

/* Nothing is heard now: it said last that it is disarmed, or is awaited. */
static inline bool kept_is_silent(const struct kept *kept)
{
    return kept->armed == KEPT_SILENT || kept->armed == KEPT_AWAITED;
}

/*
 * Reads it; what is missing or makes no sense is unknown, and a file that says
 * nothing of armed says that it is. Follows no link. Returns 0; -ENOENT when
 * the daemon never ran since power-on; another -errno when it can't be read.
 */
int kept_read(const char *run_dir, struct kept *kept);

/* Replaces it atomically; in place, where there is no room for another one. Returns 0, or -errno:
 * then there is none. */
int kept_write(const char *run_dir, const struct kept *kept);

#endif
