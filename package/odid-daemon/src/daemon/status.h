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

#include "daemon/status_json.h"

/* Gathers everything, when an answer is made. */
typedef void status_gather_fn(void *context, struct status_snapshot *snapshot, int64_t now_us);

/* Returns 0, or -errno with a log line: then it is tried again each second. run_dir stays. */
int status_start(const char *run_dir, status_gather_fn *gather, void *context);

#endif
