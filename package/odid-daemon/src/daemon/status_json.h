/* A snapshot -> JSON: the inside of status. The field names are documented in odidctl(1). */
#ifndef ODID_STATUS_JSON_H
#define ODID_STATUS_JSON_H

#include <json-c/json_object.h>

#include "daemon/status.h"

/* The caller puts the object back (json_object_put). NULL when memory is short. */
struct json_object *status_json(const struct status_snapshot *snapshot, int64_t now_us);

#endif
