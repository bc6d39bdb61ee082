/*
 * The course of an update, from the first octet of a bundle to the slot that is
 * kept or given up.
 *
 * Pure: is told what SWUpdate does, how the board is, and the time
 * (CLOCK_MONOTONIC); says what is to be done. The rules are DESIGN.md's,
 * section 4; docs/updates.md tells them to people.
 */
#ifndef ODID_UPDATE_H
#define ODID_UPDATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "appliance/update_names.h"

struct kept;

/* All is well for so long: the slot on trial is kept. */
#define UPDATE_WELL_US 20000000
/* The trial lasts no longer than this; time while armed doesn't count. */
#define UPDATE_TRIAL_US 60000000
/* Whoever sends a bundle must get on: by a percent in this time, and to the end in this. */
#define UPDATE_STANDSTILL_US 30000000
#define UPDATE_WRITING_US 600000000
/* Disarmed for so long before the board is restarted. */
#define UPDATE_REBOOT_US 5000000

enum update_state {
    UPDATE_IDLE,
    UPDATE_CHECKING,   /* a bundle is coming in: signature, hardware, the gate */
    UPDATE_INSTALLING, /* its slot is written */
    UPDATE_WAITING,    /* for the restart: into the new slot, or back into the old one */
    UPDATE_TRIAL,      /* the running slot is on trial */
};

/* "idle", "checking", "installing", "waiting-for-reboot", "trial" */
const char *update_state_name(enum update_state state);

/* What is to be done; of several things the next call says the next one. */
enum update_wish {
    UPDATE_NOTHING,
    UPDATE_STOP,      /* u->stopped says why: end the installer; until it has ended */
    UPDATE_COMMIT,    /* keep the slot: update_committed, when that is done */
    UPDATE_ROLL_BACK, /* give it up, u->sentence says why: update_rolled_back, when that is done */
    UPDATE_REBOOT,
};

/* How the board is. */
struct update_board {
    bool armed; /* or its autopilot was lost while it was armed */
    bool well;  /* all that worked in the old slot works: only for a trial */
    char complaint[UPDATE_SENTENCE_SIZE]; /* unless well */
};

struct update {
    enum update_state state;
    int percent, seconds_left;            /* -1: not known */
    char version[UPDATE_VERSION_SIZE];    /* the bundle's; empty: not known yet */
    char sentence[UPDATE_SENTENCE_SIZE];  /* what is going on, for people */
    int64_t since_us;                     /* the state's beginning */
    int64_t writing_us;                   /* when the first percent was written */
    int64_t moved_us;                     /* when it got on for the last time */
    int64_t ticked_us;                    /* the last tick */
    int64_t well_us, tried_us;            /* how long all is well; how long the trial has lasted */
    char complaint[UPDATE_SENTENCE_SIZE]; /* why it wasn't well, when it wasn't for the last time */
    int64_t disarmed_us;                  /* how long it was disarmed, while waiting */
    bool called_off;                      /* by somebody who was told that nothing changes */
    const char *stopped; /* why the installer was told to end, a sentence; NULL: it wasn't */
    bool slow;           /* it was because nothing moved */
};

void update_init(struct update *update, int64_t now_us);

/*
 * Does the aircraft count as armed? kept: what the daemon keeps (kept.h), NULL when it hasn't run
 * since power-on; answered: it does now; unattended: a server's or a stick's update; given_up: its
 * trial has failed. Who never answers is never disarmed, and the board isn't restarted on an old
 * word, nor while the vehicle speaks and doesn't say it; unattended, nor while it is silent, if
 * there ever was one. But a trial is judged without a word, for its daemon may be what fails; and
 * given up, it is restarted where no vehicle was heard since power-on.
 */
bool update_armed(const struct update *update, const struct kept *kept, bool answered,
                  bool unattended, bool given_up);

/* ---- what SWUpdate does ---- */

void update_begins(struct update *update, int64_t now_us);
void update_version(struct update *update, const char *version);
void update_progress(struct update *update, int percent, int64_t now_us);
/* Somebody called it off; false: there is nothing that could still be. */
bool update_cancel(struct update *update);

/* It is written and marked: the next start is a trial. */
void update_installed(struct update *update, int64_t now_us);

/* It ended without that. Nothing but the slot that isn't running was touched. */
void update_ended(struct update *update, int64_t now_us);

/* ---- trial ---- */

void update_try(struct update *update, const char *version, int64_t now_us);
void update_committed(struct update *update, int64_t now_us);
void update_rolled_back(struct update *update, int64_t now_us);

/*
 * Why U-Boot gave a slot up, for people; to follow a colon. reason: its variable
 * trial_reason; fallback: its word on the kernel's command line. Either may be empty.
 */
void update_explain_fallback(const char *reason, const char *fallback, char *out, size_t size);

/* Once a second, and whenever something happened. */
enum update_wish update_tick(struct update *update, const struct update_board *board,
                             int64_t now_us);

#endif
