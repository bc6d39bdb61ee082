/*
 * The daemon's state as one JSON object, to whoever of its group (and root)
 * connects to <run_dir>/status.sock: written at once, then closed. odidctl
 * reads it.
 *
 * A flood of questions costs the broadcast nothing that could be heard: an
 * answer is made four times a second at most, so it is up to 250 ms old, and 64
 * questions are taken a second; who comes beyond that waits.
 */
#ifndef ODID_STATUS_H
#define ODID_STATUS_H

#include <stdint.h>

#include "daemon/asking.h"
#include "daemon/health.h"
#include "daemon/telemetry.h"

/* How late the slots' deadlines were met, in microseconds. */
struct status_lateness {
    uint64_t slots, skipped;
    uint32_t histogram[64]; /* of 50 us each; the last one: 3.15 ms and more */
    int64_t max_us;
};
void status_lateness_add(struct status_lateness *lateness, int64_t late_us, unsigned skipped);
int64_t status_lateness_p99_us(const struct status_lateness *lateness);

/* Gathers everything, when an answer is made. */
struct status_snapshot {
    struct health_input input;
    struct health health;
    const struct telemetry_counters *counters;
    const struct asking *asking;
    const struct status_lateness *lateness;
    int64_t start_us;
    uint8_t vehicle;
    uint64_t config_file; /* config_fingerprint of the configuration file */
    unsigned config_reports;
    const char (*config_report)[CONFIG_PROBLEM_SIZE]; /* the first sentences */
};
typedef void status_gather_fn(void *context, struct status_snapshot *snapshot, int64_t now_us);

/* Returns 0, or -errno with a log line: then it is tried again each second. run_dir stays. */
int status_start(const char *run_dir, status_gather_fn *gather, void *context);

#endif
