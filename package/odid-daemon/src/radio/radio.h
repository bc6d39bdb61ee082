/*
 * What every radio channel tells about itself, and the retry it lives by.
 * Implemented by bluetooth (legacy, extended) and wifi_beacon.
 */
#ifndef ODID_RADIO_H
#define ODID_RADIO_H

#include <stdbool.h>
#include <stdint.h>

enum channel { CHANNEL_BT4, CHANNEL_BT5, CHANNEL_WIFI, CHANNELS };

enum radio_state {
    RADIO_DISABLED,    /* by configuration */
    RADIO_UNSUPPORTED, /* this controller can't; said once, not a fault */
    RADIO_ABSENT,      /* no such device or service yet */
    RADIO_BLOCKED,     /* rfkill, soft or hard */
    RADIO_DOWN,        /* there, and not up */
    RADIO_STARTING,    /* being set up */
    RADIO_ON_AIR,
    RADIO_LOST, /* was on air, stopped answering */
};

#define RADIO_DETAIL_SIZE 112
/* Confirmations come every second or oftener; later than this, the content had a gap. */
#define RADIO_PAUSE_US 1500000
/* Then nothing of what is to be said goes out in time. */
#define RADIO_STALE_US 2500000
/* Within that hostapd was started again, if it hung or its interface stayed down, and was on the
 * air. */
#define RADIO_STUCK_US 15000000
/* One message each 400 ms, and the fourth has its turn within the 3 s that it may take; all of them
 * in a pack, and each has Location's second. */
#define RADIO_ONE_IN_TIME_US 400000
#define RADIO_PACK_IN_TIME_US 1000000

/* By whom it is known that it transmits: by who was told to; by the chip itself, which counts what
 * it sends; by another radio. */
enum radio_known { RADIO_SET, RADIO_COUNTED, RADIO_HEARD };

struct radio {
    enum radio_state state;
    int64_t since_us;       /* when this state began */
    int64_t accepted_us;    /* when the radio last took a payload; INT64_MIN: never */
    int64_t confirmed_us;   /* when it was last known to transmit the newest content */
    int64_t unbroken_us;    /* since when it was known without a pause; INT64_MIN: never */
    int64_t paused_us;      /* when it was last known to before that pause; INT64_MIN: never */
    uint64_t payloads;      /* taken by the radio */
    uint64_t replaced;      /* on the air, not given to it: a newer one came first */
    unsigned starts;        /* times it came on air */
    bool was_on_air;        /* once since power-on, if by a daemon before this one */
    bool given_up;          /* all was tried that a daemon can */
    enum radio_known known; /* that it transmits */
    bool silent;            /* was told to, did before, and sends nothing by its own count */
    unsigned repairs;       /* foreign commands undone */
    unsigned failures;      /* errors and time-outs */
    char detail[RADIO_DETAIL_SIZE]; /* the last error, or how it transmits; plain words */
};

const char *radio_state_name(enum radio_state state); /* "on air", "blocked", ... */
const char *radio_known_name(enum radio_known known); /* "set", "confirmed", "heard" */
const char *channel_name(enum channel channel);       /* "bt4", "bt5", "wifi": as in figures */
const char *channel_title(enum channel channel);      /* "Bluetooth 4", ... */

void radio_init(struct radio *radio, enum radio_state state, int64_t now_us);

/* Enters a state and logs the change once. detail may be NULL: keep the old one. */
void radio_enter(struct radio *radio, enum channel channel, enum radio_state state,
                 const char *detail, int64_t now_us);

/* A payload was made while an older one still waited for the radio. */
void radio_replaced(struct radio *radio);
/* A payload was taken. Returns whether that is soon enough after the one before for each message to
 * keep its time. */
bool radio_accepted(struct radio *radio, enum channel channel, int64_t now_us);
/* The radio says that it transmits what it was given last; and nothing newer waits, or it takes
 * them in time. */
void radio_confirmed(struct radio *radio, int64_t now_us);
/* Its word was wrong since then: nothing was transmitted, as other evidence shows. */
void radio_denied(struct radio *radio, int64_t since_us);
/* The state as everybody is told it: one that is on the air and wasn't confirmed for long is lost,
 * however well it answers. */
enum radio_state radio_seen(const struct radio *radio, int64_t now_us);
/* Whether only its driver bound anew may bring it back: it was given up, or was on the air since
 * power-on, and isn't for long though nothing else is known to keep it off. */
bool radio_stuck(const struct radio *radio, int64_t now_us);
/* When that one began. */
int64_t radio_seen_since_us(const struct radio *radio, int64_t now_us);

/* Capped exponential retry: 250 ms, 500 ms, then every second. */
struct retry {
    unsigned attempt;
};
int64_t retry_next(struct retry *retry, int64_t now_us);
void retry_reset(struct retry *retry);

#endif
