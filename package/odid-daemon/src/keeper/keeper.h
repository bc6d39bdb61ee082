/*
 * What odid-keeper decides: when the daemon is started, killed, told to end,
 * and when its last payload is taken off the air.
 *
 * Pure: no I/O and no clock. The caller tells what happened, asks keeper_next
 * until there is nothing to do, and comes back at keeper_due_us.
 *
 * A daemon that ended is started again at once; one that keeps ending within a
 * second, once a second. One that gives no sign of life for silent_us is
 * killed. Without a sign of life for off_air_us the payload that a radio goes
 * on repeating is taken off, once per outage: it would show an aircraft where
 * it no longer is. What one says in its first second is no sign of that: whoever
 * dies ever again in it sends nothing. Two deaths by the system-call filter (SIGSYS) within a
 * minute start it with the filter in log mode: silence is worse.
 */
#ifndef ODID_KEEPER_H
#define ODID_KEEPER_H

#include <stdbool.h>
#include <stdint.h>

enum keeper_action {
    KEEPER_NOTHING,
    KEEPER_START,        /* the daemon; when that fails: keeper_died */
    KEEPER_KILL,         /* it, by SIGKILL */
    KEEPER_TERMINATE,    /* it, by SIGTERM */
    KEEPER_TAKE_OFF_AIR, /* the last payload; then keeper_is_off_air */
    KEEPER_QUIT,         /* everything is done */
};

enum keeper_state { KEEPER_DOWN, KEEPER_RUNNING, KEEPER_KILLED };

struct keeper {
    int64_t silent_us, off_air_us;
    enum keeper_state state;
    int64_t started_us;  /* the last start */
    int64_t start_us;    /* down: when it is due to be started */
    int64_t alive_us;    /* the last sign of life; before the first one: since when it is awaited */
    int64_t on_air_us;   /* the last one that says that it sends; before the first one: as above */
    int64_t end_us;      /* ending: patience with the daemon until then */
    int64_t filtered_us; /* the last death by SIGSYS; INT64_MIN: none */
    unsigned quick;      /* deaths in a row within a second of the start */
    bool log_mode;       /* start it with the filter in log mode */
    bool outage;         /* it ended or was killed, and gave no sign since that it sends */
    bool ending, told_to_end;
    bool orderly; /* told to end, it did, and has switched its radios off itself */
    bool taking_off_air, off_air;
    int64_t again_us; /* when what was left is taken off */
};

void keeper_init(struct keeper *keeper, int64_t silent_us, int64_t off_air_us, int64_t now_us);

/* What happened. A byte came from the daemon. Returns whether an outage is over by that. */
bool keeper_alive(struct keeper *keeper, int64_t now_us);
/* It is gone: the signal that ended it, 0 when it exited with the code. */
void keeper_died(struct keeper *keeper, int signal, int code, int64_t now_us);
/* What can be taken off the air was. all: nothing is left of it; else it is tried again. */
void keeper_is_off_air(struct keeper *keeper, bool all, int64_t now_us);
/* We were told to end. */
void keeper_end(struct keeper *keeper, int64_t now_us);

/* What is to be done next; it counts as done. */
enum keeper_action keeper_next(struct keeper *keeper, int64_t now_us);
/* When to ask again at the latest; INT64_MAX: when something happens. */
int64_t keeper_due_us(const struct keeper *keeper);

#endif
