/* Is the aircraft armed? By what the daemon says and what it keeps. */
#ifndef ODID_ARMED_H
#define ODID_ARMED_H

#include <json-c/json_object.h>
#include <stdbool.h>

#include "appliance/kept.h"
#include "appliance/places.h"

enum armed {
    ARMED_UNKNOWN, /* the daemon doesn't answer */
    ARMED_YES,
    ARMED_UNSAID, /* the vehicle speaks, and doesn't say it */
    ARMED_SILENT, /* disarmed when it fell silent, or silent since power-on where there was one
                     before: for whoever is there, the same as no */
    ARMED_NO,
};

/* What the daemon itself says in that; NULL says nothing. */
bool armed_says(struct json_object *status);

/* By the daemon's status, NULL: it doesn't answer; and by what it keeps, NULL: nothing. */
enum armed armed_by(struct json_object *status, const struct kept *kept);

/*
 * NULL when the aircraft is disarmed; else why that can't be said, for people: to
 * begin a sentence. By what the daemon keeps (kept.h): one that was lost after
 * arming is armed, one never heard since power-on isn't, nor one that was lost
 * disarmed. A daemon that gives no answer for two seconds never says disarmed.
 */
const char *armed_not_disarmed(const struct places *places);

/* The same, with what it keeps: all zeros where nothing is. */
enum armed armed_look(const char *run_dir, struct kept *kept);

#endif
