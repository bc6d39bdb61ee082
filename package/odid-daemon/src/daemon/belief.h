/*
 * Which of two sources that speak as the same autopilot is believed: the one
 * that was there first, as long as it speaks.
 *
 * Pure. A source has a clock that goes on (its time since boot), a place that
 * it can have flown to, a UTC that goes with its clock, and numbers its frames.
 * What doesn't continue one of these is another source's word: not taken while
 * the first one goes on, and taken when that was silent for a while: three of
 * its usual intervals, 1 s at least, 5 s at most. A source that changes (an
 * autopilot's restart, a position that was corrected) is therefore believed
 * after about a second; two that take turns contradict each other. A place that
 * it can't have flown to has to be said twice, whenever it comes. While two
 * sources contradict each other a receiver's "no fix" counts only when nobody
 * says otherwise any more.
 */
#ifndef ODID_BELIEF_H
#define ODID_BELIEF_H

#include <stdbool.h>
#include <stdint.h>

#include "daemon/frame_numbers.h"
#include "daemon/telemetry.h"

/* So many contradictions within this time are a fault: no restart makes more than one. One who
 * forges seldom is seen, too. */
#define BELIEF_FAULT_COUNT 4
#define BELIEF_FAULT_US 60000000

/* One thing that is said again and again. */
struct belief_track {
    bool known;
    bool other_seen; /* since the believed source's last word */
    int64_t heard_us, interval_us;
};

struct belief_clock {
    struct belief_track track;
    uint32_t last_ms;
    int64_t last_us;   /* the same, not wrapped */
    int64_t offset_us; /* our clock minus that: the least delayed arrival tells */
    int64_t since_us;  /* believed since */
};

struct belief_place {
    double latitude_deg, longitude_deg;
    double altitude_m; /* NAN: not said; of native ones above the ellipsoid, else above the sea */
    int64_t at_us;
    bool native;
};

struct belief_altitude {
    double metres;
    int64_t at_us; /* INT64_MIN: none */
};

struct belief {
    struct belief_clock boot, native; /* time since boot; native messages': since the full hour */
    struct belief_track place, utc, fix, geoid;
    bool no_fix;                        /* the believed GPS_RAW_INT says so */
    int64_t no_fix_us;                  /* when somebody said so last; INT64_MIN: never */
    int64_t second_fix_us;              /* when another receiver had a fix; INT64_MIN: never */
    int64_t telemetry_us;               /* when its place was believed last; INT64_MIN: never */
    double separation_m;                /* of ellipsoid and geoid there */
    struct belief_place at;             /* the believed source's last */
    struct belief_altitude altitude[2]; /* the last of telemetry's, and of native ones */
    double jump_m;               /* what it may still jump: fills up as fast as an aircraft flies */
    struct belief_place another; /* the last one that it can't have flown to; at_us 0: none */
    int64_t utc_offset_us;       /* UTC minus time since boot */
    struct frame_numbers numbers;
    int64_t contradicted_us[BELIEF_FAULT_COUNT]; /* the latest ones, by turns */
    uint64_t contradictions;
};

/* Nothing is known, of a vehicle that is new. The count of contradictions goes on. */
void belief_reset(struct belief *belief);

/*
 * May this update of the vehicle's autopilot be taken? Asked for each, once, in
 * order; those that have neither time nor place may be always. One field that
 * isn't believed, of an update that is, becomes unknown.
 */
bool belief_take(struct belief *belief, struct telemetry_update *update, int64_t now_us);

/* The number of a frame of the vehicle's autopilot (frame_numbers.h).
 * again: it is the frame before, octet by octet. */
void belief_sequence(struct belief *belief, uint8_t sequence, bool again, int64_t now_us);

/* The next frame comes by another link of the autopilot's, which has numbers of its own. */
void belief_new_link(struct belief *belief);

/* Do two sources contradict each other? */
bool belief_contradicted(const struct belief *belief, int64_t now_us);

#endif
