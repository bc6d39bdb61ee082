/* A snapshot -> JSON: the inside of status. The field names are documented in odidctl(1). */
#ifndef ODID_STATUS_JSON_H
#define ODID_STATUS_JSON_H

#include <json-c/json_object.h>

#include "daemon/asking.h"
#include "daemon/health.h"
#include "daemon/slot_lateness.h"
#include "daemon/telemetry.h"

/* All that is said. */
struct status_snapshot {
    struct health_input input;
    struct health health;
    const struct telemetry_counters *counters;
    const struct asking *asking;
    const struct slot_lateness *lateness;
    int64_t start_us;
    uint8_t vehicle;
    uint64_t config_file; /* config_fingerprint of the configuration file */
    unsigned config_reports;
    const char (*config_report)[CONFIG_PROBLEM_SIZE]; /* the first sentences */
};

/* The caller puts the object back (json_object_put). NULL when memory is short. */
struct json_object *status_json(const struct status_snapshot *snapshot, int64_t now_us);

#endif
