/* What a flight record sums up: its faults by kind, and what each channel was missing. */
#ifndef ODID_RECORD_H
#define ODID_RECORD_H

#include <stdbool.h>
#include <stdint.h>

#include "radio/radio.h"

#define RECORDER_LINE_SIZE 1280
#define RECORDER_NAME_SIZE 32
#define RECORDER_TEXT_SIZE 160
#define RECORDER_BOARD_FAULTS 24

/* The kinds of faults; behind them a place for each of the appliance's own. */
enum recorder_fault_kind {
    RECORDER_DAEMON,  /* it doesn't answer */
    RECORDER_CHANNEL, /* and the two behind it: one a channel */
    RECORDER_LINK = RECORDER_CHANNEL + CHANNELS,
    RECORDER_POSITION,     /* none, or it stopped */
    RECORDER_IDENTITY,     /* no Basic ID, or no operator number */
    RECORDER_SOURCES,      /* two speak as the autopilot */
    RECORDER_EMERGENCY,    /* is broadcast, whoever says it */
    RECORDER_FAILURE,      /* of the Remote ID system is broadcast, though there is a position */
    RECORDER_SIMULATED,    /* the autopilot says that it flies in a simulation */
    RECORDER_UNDERVOLTAGE, /* the board's supply */
    RECORDER_THROTTLED,    /* the processor is slowed down */
    RECORDER_KINDS,        /* the kinds whose armed time is counted */
    RECORDER_FAULTS = RECORDER_KINDS + RECORDER_BOARD_FAULTS,
};

/* "daemon", "bt4", "link", ...: a fault's name in the record. */
const char *recorder_kind_name(enum recorder_fault_kind kind);

/* What is summed up; written again and again, so that a power cut loses little. */
struct recorder_channel_totals {
    bool required;          /* also one that was on the air, and isn't switched off: it is missed */
    bool armed_required;    /* was so at some time while armed; from then on a flight misses it */
    enum radio_known known; /* by whom, at best */
    int64_t first_us;       /* first on the air; INT64_MIN: never */
    int64_t heard_us;       /* last known to be on the air; INT64_MIN: never */
    int64_t silent_us;      /* gaps while armed, all together, without an unfinished one */
    int64_t longest_us;     /* the longest of them */
    unsigned gaps;          /* their number */
};

/* What the first word of this power-on was. */
enum recorder_began { RECORDER_UNTOLD, RECORDER_DISARMED, RECORDER_ARMED };

struct recorder_totals {
    int64_t at_us;
    int64_t armed_since_us;            /* INT64_MIN: not armed */
    enum recorder_began began;         /* armed: its flight began before the record */
    int64_t armed_us;                  /* the time armed, all together */
    int64_t unwatched_us;              /* of it: nobody looked, for some seconds each time */
    int64_t untold_us;                 /* not armed as far as is known, and nobody said whether */
    int64_t untold_later_us;           /* of it: behind the first word */
    unsigned faults, armed_faults;     /* all; those that were there while armed */
    unsigned restarts, armed_restarts; /* of the daemon; those while armed */
    int64_t fault_us[RECORDER_KINDS];  /* while armed */
    struct recorder_channel_totals channels[CHANNELS];
};

/* What of these is one number in the record: how it is called there, and here. */
#define RECORDER_SUMS(time, count)                                                                 \
    time("armed_s", armed_us) time("unwatched_s", unwatched_us) time("untold_s", untold_us)        \
        time("untold_later_s", untold_later_us) count("faults", faults)                            \
            count("armed_faults", armed_faults) count("restarts", restarts)                        \
                count("armed_restarts", armed_restarts)

struct recorder_fault {
    char name[RECORDER_NAME_SIZE]; /* empty: this place is free */
    bool there, was_armed;
    int64_t since_us;
};

#endif
