/*
 * The flight record: what happened to the broadcast since power-on, as lines
 * that answer "was Remote ID on the air the whole flight?".
 *
 * Pure: is given the daemon's status once a second, and the time; decides
 * which lines to append. Times are CLOCK_MONOTONIC, which begins at power-on.
 * The lines' names and fields are documented in odid-recorder(8).
 */
#ifndef ODID_RECORDER_H
#define ODID_RECORDER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "flights/record.h"

/* What never was on the air or complete is a fault only after this long: it has to start first. */
#define RECORDER_STARTING_US 30000000

/* One channel, as the daemon sees it. Instants: INT64_MIN for never. */
struct recorder_channel_status {
    bool required, on_air;
    enum radio_known known;        /* by whom, of one that is on the air */
    bool disabled;                 /* by configuration */
    int64_t confirmed_us;          /* last known to transmit the newest content */
    int64_t unbroken_us;           /* since when without a pause */
    int64_t paused_us;             /* last before that pause */
    char text[RECORDER_TEXT_SIZE]; /* "absent: no control socket" */
};

/* What the board says besides. */
struct recorder_board {
    bool undervoltage, throttled;         /* now */
    bool was_undervoltage, was_throttled; /* at some time since the last look */
    unsigned faults;                      /* of the appliance, /run/faults */
    struct {
        char name[RECORDER_NAME_SIZE], text[RECORDER_TEXT_SIZE];
    } fault[RECORDER_BOARD_FAULTS];
};

/* All that is known at one instant. */
struct recorder_snapshot {
    bool answered;                 /* else only text and board are set */
    char text[RECORDER_TEXT_SIZE]; /* why it did not answer */
    int64_t daemon_start_us;
    struct recorder_channel_status channels[CHANNELS];
    bool armed_known, armed;
    bool two_sources; /* speak as the autopilot */
    bool emergency, failure, simulated;
    bool link, position, identity; /* as they should be */
    bool speaks;                   /* the autopilot does, with its HEARTBEAT or without */
    bool another_id;               /* it doesn't, and one of another system id does */
    int64_t unix_us;               /* UTC by the autopilot; 0 when unknown */
    struct recorder_board board;
};

typedef void recorder_line_fn(void *context, const char *line); /* without its newline */

struct recorder {
    recorder_line_fn *line;
    void *context;
    struct recorder_totals totals;
    int64_t settled_us[CHANNELS]; /* silence is counted up to here */
    int64_t start_us;
    int64_t told_us; /* whether it is armed was known last, or its not being known was counted */
    bool untold;     /* it isn't known for so long that it counts */
    int64_t daemon_start_us; /* INT64_MIN: not known */
    int64_t clock_offset_us,
        clock_said_us;               /* UTC minus our clock, and when it was said; 0: never */
    bool seen[RECORDER_KINDS];       /* was as it should be once, */
    int64_t good_us[RECORDER_KINDS]; /* and then last; our start, if never */
    struct recorder_fault faults[RECORDER_FAULTS];
};

/* image: the appliance's version; boot: the kernel's boot id. Both go into the first line. */
void recorder_start(struct recorder *recorder, recorder_line_fn *line, void *context,
                    const char *boot, const char *image, int64_t now_us);

/* Goes on with a record that an earlier process began: its totals, and the faults that were there.
 */
void recorder_continue(struct recorder *recorder, recorder_line_fn *line, void *context,
                       const struct recorder_totals *totals, const struct recorder_fault *faults,
                       unsigned count, int64_t now_us);

/* Takes one snapshot. */
void recorder_tick(struct recorder *recorder, const struct recorder_snapshot *snapshot,
                   int64_t now_us);

/* What became of an update of the appliance: valid UTF-8. */
void recorder_say_update(struct recorder *recorder, const char *sentence, int64_t now_us);

bool recorder_armed(const struct recorder *recorder);

/* The armed part of a gap that isn't over; 0 when there is none. */
int64_t recorder_open_gap_us(const struct recorder *recorder, enum channel channel);

/* Says how it stands, as of the last tick. */
void recorder_say_totals(struct recorder *recorder);

/* An orderly end: the totals, and the last line. */
void recorder_end(struct recorder *recorder, int64_t now_us);

#endif
