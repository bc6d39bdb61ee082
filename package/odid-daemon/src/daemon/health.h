/*
 * What is wrong, and what to do about it: one list for status, ARM_STATUS and
 * the technician's table. Pure.
 */
#ifndef ODID_HEALTH_H
#define ODID_HEALTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"
#include "daemon/aircraft.h"
#include "daemon/link.h"
#include "radio/radio.h"

#define HEALTH_MAX 32

enum health_severity {
    HEALTH_FAULT,   /* not legal to fly: told by ARM_STATUS */
    HEALTH_WARNING, /* worth mending */
};

struct health_problem {
    const char *id; /* for programs: it stays when the sentence changes */
    enum health_severity severity;
    char reason[50];  /* for ARM_STATUS.error: at most 49 characters */
    char advice[120]; /* what to do, for a technician */
};

struct health {
    unsigned count; /* problems, the faults first, in order of importance */
    struct health_problem problem[HEALTH_MAX];
    bool on_air; /* everything that is required is on the air */
};

/* All that the verdict is made from, as it stands now. */
struct health_input {
    const struct config *config;
    const struct aircraft_view *view;
    const struct aircraft_condition *condition;
    const struct link_status *link;
    const struct radio *radios; /* [CHANNELS] */
    size_t extended_room;       /* octets that Bluetooth 5's controller takes */
    unsigned beacon_most;       /* messages that Wi-Fi's chip takes in a beacon */
    unsigned config_errors;     /* values that could not be used */
    bool filter;                /* the system-call filter was to be had */
    bool filter_logging;        /* and only logs */
    bool realtime;              /* real-time priority was granted */
    bool speaks;                /* anything came of the autopilot, a moment ago */
    bool another_id;            /* nothing did, and something of an autopilot of another id */
    bool others_only;           /* frames come, a moment ago, and none of any autopilot's */
    bool contradicted;          /* two sources speak as the autopilot */
    bool unheard;               /* the autopilot doesn't answer */
    bool signs;                 /* and signs its frames */
    bool updating;              /* the appliance's software is being replaced, or on trial */
};

void health_judge(struct health *health, const struct health_input *input, int64_t now_us);

/* Must this channel be on the air? It is switched on, and the hardware can. */
bool health_required(const struct health_input *input, enum channel channel);

/* The first fault's reason; "" when the aircraft is good to go. */
const char *health_reason(const struct health *health);

#endif
