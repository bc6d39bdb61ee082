/* The daemon's status (JSON, odidctl(1)) -> what the recorder looks at. Pure. */
#ifndef ODID_RECORDER_SNAPSHOT_H
#define ODID_RECORDER_SNAPSHOT_H

#include <json-c/json_object.h>

#include "recorder/recorder.h"

/* Fills all but the board. now_us: when the answer came, on the clock of its "at_s". */
void recorder_snapshot(struct recorder_snapshot *snapshot, struct json_object *status,
                       int64_t now_us);

#endif
