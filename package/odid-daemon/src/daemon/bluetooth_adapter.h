/*
 * One Bluetooth adapter, as bluetooth's four files share it, each knowing only
 * those before it: bluetooth_remedy.c closes it and says how it may come back,
 * bluetooth_setup.c sends the commands, bluetooth_answers.c takes the
 * controller's answers, and bluetooth.c opens it. Used by these only.
 */
#ifndef ODID_BLUETOOTH_ADAPTER_H
#define ODID_BLUETOOTH_ADAPTER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/loop.h"
#include "daemon/messages.h"
#include "radio/bluetooth_commands.h"
#include "radio/hci.h"
#include "radio/radio.h"

/* A controller answers within milliseconds; one that doesn't in a second hangs. */
#define BLUETOOTH_ANSWER_US 1000000
/* The kernel keeps a reset back until it has given up the command before, after two seconds. */
#define BLUETOOTH_RESET_ANSWER_US 2500000
/* Down and up: the kernel waits two seconds for one that hangs, and a working one is up in one. */
#define BLUETOOTH_DOWN_AND_UP_US 3500000
/* Nobody has put it down, and the kernel gives the first command of its set-up ten seconds. */
#define BLUETOOTH_UP_US 12000000
/* With a patch file. */
#define BLUETOOTH_DRIVER_US 30000000
/* One that hangs again so soon after that wasn't mended by it: the next remedy is tried. */
#define BLUETOOTH_MENDED_US 10000000
/* How often a controller is asked whether it was reset; and after it was. */
#define BLUETOOTH_MARK_EVERY_US 1000000
#define BLUETOOTH_MARK_AGAIN_US 5000000
/* For so long payloads that wait go before it. */
#define BLUETOOTH_MARK_WAITS_US 250000
/* What was refused, or isn't there, is tried again after this, and after twice as long each time:
 * the legacy set may be off the air for a moment meanwhile. */
#define BLUETOOTH_AGAIN_US 10000000
#define BLUETOOTH_AGAIN_MAX_US 600000000
/* Another program's commands are undone at most once in this time: a slot. */
#define BLUETOOTH_REPAIR_EVERY_US 125000

/* The set-up, command by command; one that a controller doesn't need is passed over. */
enum bluetooth_step {
    STEP_RESET,
    STEP_FEATURES,
    STEP_MAXIMUM_DATA,
    STEP_DISABLE,
    STEP_MARK,
    STEP_CLEAR,
    STEP_LEGACY_PARAMETERS,
    STEP_LEGACY_ADDRESS,
    STEP_LEGACY_DATA,
    STEP_LONG_RANGE_PARAMETERS,
    STEP_LONG_RANGE_ADDRESS,
    STEP_LONG_RANGE_DATA,
    STEP_ENABLE,
    STEP_ON_AIR,
};

/* What was tried last on a controller that doesn't answer. */
enum bluetooth_remedy {
    REMEDY_NONE,
    REMEDY_RESET,
    REMEDY_DOWN_AND_UP, /* of the kernel's interface */
    REMEDY_DRIVER,      /* to be bound anew: which isn't ours to do */
};

/* One of the two things that an adapter can advertise. */
struct bluetooth_advertising {
    struct radio *radio; /* NULL: not this adapter's */
    enum channel channel;
    bool possible; /* wanted, and the controller can */
    bool pending;  /* a newer payload than the controller has */
    size_t length; /* of the payload; 0: none was given yet */
    uint8_t payload[MESSAGES_EXTENDED_SIZE];
};

struct bluetooth_adapter {
    const char *name;
    const uint8_t *address; /* random static, 6 bytes */
    struct hci hci;
    struct loop_timer timer; /* closed: the next try; open: the answer's time-out, or a repair */
    struct retry retry;
    enum bluetooth_step step;
    enum bluetooth_set sending; /* whose data went out last */
    uint16_t awaited;           /* opcode whose completion must come next; 0: none */
    bool full;                  /* the controller takes no command for now */
    bool extended;              /* speaks extended commands, and only those */
    bool coding_selection;      /* S=8 can be asked for */
    size_t maximum_data;        /* octets of extended advertising data that it takes, ... */
    size_t maximum_said;        /* ... and that it says it takes */
    size_t trying_from;         /* more than so many is being tried; 0: nothing is */
    bool slow;                  /* refused 20 ms */
    bool parameters_refused;    /* 20 ms or S=8, by one that should know them */
    int64_t again_us;           /* something is missing: tried again then; LOOP_NEVER: nothing is */
    int64_t again_wait_us;
    bool reset_first; /* the last set-up was refused, or not answered */
    enum bluetooth_remedy remedy;
    int64_t remedy_us;          /* when that one was begun, ... */
    int64_t mended_us;          /* ... and from when on it counts as the right one */
    int64_t coming_us;          /* since when it is there and not up; LOOP_NEVER: it isn't so */
    bool marked;                /* so that a reset shows, ... */
    int64_t mark_us;            /* ... and is looked for then */
    bool long_range_refused;    /* one was by long range's part, which wasn't on the air since */
    enum bluetooth_step repair; /* from where to set up again; STEP_ON_AIR: nothing to repair */
    bool enabling_again;        /* a repair by that single command is under way */
    int64_t repair_from_us;     /* no repair before this, ... */
    int64_t repair_logged_us;   /* ... and not told more than now and then */
    struct bluetooth_advertising sets[BLUETOOTH_SETS];
};

/* ---- bluetooth_remedy.c ---- */

/* What has worked for long isn't the one that was in vain: the next hang begins with the first. */
void bluetooth_settle_remedy(struct bluetooth_adapter *adapter, int64_t now_us);
/* Closes after a failure, says so, and opens again later. A time-out brings the next remedy. */
void bluetooth_failed(struct bluetooth_adapter *adapter, const char *detail, int64_t now_us);
/* The same with an -errno; an hci_lost_fn. */
void bluetooth_lost(void *adapter, int error, int64_t now_us);
/* It couldn't be opened, with an -errno of hci_open's. */
void bluetooth_not_opened(struct bluetooth_adapter *adapter, int error, int64_t now_us);

/* ---- bluetooth_setup.c ---- */

/* Sends what is due next, unless an answer is awaited. */
void bluetooth_advance(struct bluetooth_adapter *adapter, int64_t now_us);
/* How long a payload stays set to be sent once. */
int64_t bluetooth_hold_us(const struct bluetooth_adapter *adapter, enum bluetooth_set set);
/* Until when the payload that is set has to stay; INT64_MIN: none was ever accepted. */
int64_t bluetooth_held_until_us(const struct bluetooth_adapter *adapter, enum bluetooth_set set);
/* Switches everything off; the answer isn't waited for. */
void bluetooth_silence(struct bluetooth_adapter *adapter, int64_t now_us);

/* ---- bluetooth_answers.c ---- */

/* An hci_event_fn. */
void bluetooth_event(void *adapter, uint8_t code, const uint8_t *parameters, size_t length,
                     int64_t now_us);

#endif
