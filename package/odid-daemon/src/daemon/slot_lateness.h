/* How late the slots' deadlines were met. */
#ifndef ODID_SLOT_LATENESS_H
#define ODID_SLOT_LATENESS_H

#include <stdint.h>

struct slot_lateness {
    uint64_t slots, skipped;
    uint32_t histogram[128]; /* 64 of 50 us each, then of 0.2 ms; the last one: 15.8 ms and more */
    int64_t max_us;
};

/* late_us: negative counts as in time. skipped: slots that were left out before this one. */
void slot_lateness_add(struct slot_lateness *lateness, int64_t late_us, unsigned skipped);

/* The upper end of the bucket in which the 99th percentile lies; -1 when nothing was measured. */
int64_t slot_lateness_p99_us(const struct slot_lateness *lateness);

#endif
