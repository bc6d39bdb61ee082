/*
 * Is all well that worked in the old slot? For an update's trial: the channels
 * by the daemon's status, what a radio lacks by the appliance's faults, and the
 * services by their supervisors. Position,
 * autopilot and identity don't count: hangars have none of them.
 */
#ifndef ODID_UPDATE_JUDGE_H
#define ODID_UPDATE_JUDGE_H

#include <json-c/json_object.h>

#include "radio/radio.h"
#include "update/update.h"

#define UPDATE_SERVICES_MAX 32
#define UPDATE_NAME_SIZE 32

/* ---- channels ---- */

/* Bits, 1 << channel: the channels that transmit by the daemon's status; NULL: none. */
unsigned update_channels_on_air(struct json_object *status);

/* Those that the configuration has switched off. */
unsigned update_channels_disabled(struct json_object *status);

/* Those that ought to, when nobody knows what worked before. */
unsigned update_channels_required(struct json_object *status);

/* ---- services ---- */

struct update_service {
    char name[UPDATE_NAME_SIZE];
    int pid; /* 0: doesn't run */
};

struct update_services {
    unsigned count;
    struct update_service service[UPDATE_SERVICES_MAX];
};

/*
 * Reads who runs in directory (/run/service), without those that come and go by
 * themselves: with the autopilot, with a network adapter, or with maintenance.
 */
void update_services_read(struct update_services *services, const char *directory);

/* From now on name isn't one that ran. */
void update_services_forget(struct update_services *services, const char *name);

/* ---- what a radio lacks ---- */

/*
 * Bits, of the appliance's faults (faults_list) those that say what a radio that transmits lacks:
 * the country's rules, its patch. Nobody who speaks to a radio brings them about.
 */
unsigned update_radio_faults(struct json_object *faults);

/* ---- all of it ---- */

/*
 * Sets well and complaint. wanted: channels, and services by name, of which a version that hasn't
 * got one isn't asked for it; before: who ran when this was called last, is brought up to date. A
 * service or a daemon that was started again since then is not well.
 */
struct update_expectation {
    unsigned channels;
    unsigned radio_faults; /* that there were before */
    struct update_services wanted, before;
    double uptime_s; /* the daemon's, when it was looked at last */
};

void update_judge(struct update_expectation *expectation, struct json_object *status,
                  struct json_object *faults, const struct update_services *now,
                  struct update_board *board);

#endif
