/*
 * <run_dir>/counters: the message counters, so that after a restart none goes
 * backward, nor stands still over new content.
 */
#ifndef ODID_KEPT_COUNTERS_H
#define ODID_KEPT_COUNTERS_H

#include "daemon/messages.h"

#define KEPT_COUNTERS_FILE "counters"

/* All counters there are. */
struct kept_counters {
    struct messages_counters legacy;
    struct messages_counter extended, beacon;
};

/*
 * Reads them, and opens their file to be written to; what is missing or makes
 * no sense begins at 0. Returns a descriptor, or -errno: then nothing is kept.
 */
int kept_counters_open(const char *run_dir, struct kept_counters *counters);

/* As they are now. Once a slot: not atomic for who reads at that moment, but the daemon that does
 * comes after this one. Returns 0, or -errno. */
int kept_counters_write(int fd, const struct kept_counters *counters);

#endif
