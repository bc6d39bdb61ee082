/* The daemon's status as a table that a technician understands. */
#ifndef ODID_ODIDCTL_TABLE_H
#define ODID_ODIDCTL_TABLE_H

#include <json-c/json_object.h>
#include <stdbool.h>
#include <stdio.h>

/* What isn't known, or isn't there, is shown as "unknown". */
void odidctl_table(FILE *out, struct json_object *status, bool colour);

/* Only "appliance_faults", odidctl's own addition to the status; nothing when there are none. */
void odidctl_table_faults(FILE *out, struct json_object *faults, bool colour);

#endif
