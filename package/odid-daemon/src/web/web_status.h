/* What the page shows, as one JSON object: docs/page.md lists its fields. */
#ifndef ODID_WEB_STATUS_H
#define ODID_WEB_STATUS_H

#include <json-c/json_object.h>

#include "appliance/places.h"

/* Where else than in odidctl's places something is told; other ones are for tests. */
struct web_sources {
    const char *version; /* the image's version, one line: /etc/odid/version */
    const char *flights; /* the flight records: /data/odid/flights */
};

/*
 * The daemon's status, the appliance's faults, version and slot, the update's
 * state and the last one's result. What can't be read is null. Never NULL but
 * without memory; the caller puts it back.
 */
struct json_object *web_status(const struct places *places, const struct web_sources *sources);

/* As "odidctl flights --json" lists them. Allocated; NULL when they can't be read. */
char *web_flights(const struct web_sources *sources, size_t *length);

/* A sentence about the update that is under way, when that keeps another one out; else "". */
void web_update_obstacle(const struct places *places, char *sentence, size_t size);

#endif
