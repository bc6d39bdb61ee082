/* What the page shows, as one JSON object: docs/page.md lists its fields. */
#ifndef ODID_WEB_STATUS_H
#define ODID_WEB_STATUS_H

#include <json-c/json_object.h>

#include "appliance/places.h"

/*
 * The daemon's status, the appliance's faults, version and slot, the update's
 * state and the last one's result. What can't be read is null. Never NULL but
 * without memory; the caller puts it back.
 */
struct json_object *web_status(const struct places *places);

/* As "odidctl flights --json" lists them. Allocated; NULL when they can't be read. */
char *web_flights(const struct places *places, size_t *length);

/* A sentence about the update that is under way, when that keeps another one out; else "". */
void web_update_obstacle(const struct places *places, char *sentence, size_t size);

#endif
