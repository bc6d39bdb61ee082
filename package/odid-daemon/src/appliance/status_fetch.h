/* The daemon's status as JSON, for whoever reads it. */
#ifndef ODID_STATUS_FETCH_H
#define ODID_STATUS_FETCH_H

#include <json-c/json_object.h>

/* The daemon's status, or NULL with *error set. The caller puts it back. */
struct json_object *status_fetch(const char *run_dir, int *error);

#endif
