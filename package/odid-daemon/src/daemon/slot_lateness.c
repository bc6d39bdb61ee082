#include "daemon/slot_lateness.h"

#include <stddef.h>

#define BUCKET_US 50
#define BUCKETS (sizeof(((struct slot_lateness *)NULL)->histogram) / sizeof(uint32_t))

void slot_lateness_add(struct slot_lateness *lateness, int64_t late_us, unsigned skipped)
{
    size_t bucket = late_us < 0 ? 0 : (size_t)(late_us / BUCKET_US);

    lateness->slots++;
    lateness->skipped += skipped;
    lateness->histogram[bucket < BUCKETS ? bucket : BUCKETS - 1]++;
    if (late_us > lateness->max_us) {
        lateness->max_us = late_us;
    }
}

int64_t slot_lateness_p99_us(const struct slot_lateness *lateness)
{
    uint64_t wanted = lateness->slots - lateness->slots / 100, seen = 0;

    if (lateness->slots == 0) {
        return -1;
    }
    for (size_t bucket = 0; bucket < BUCKETS - 1; bucket++) {
        int64_t end_us = (int64_t)(bucket + 1) * BUCKET_US;

        seen += lateness->histogram[bucket];
        if (seen >= wanted) {
            return end_us < lateness->max_us ? end_us : lateness->max_us;
        }
    }
    return lateness->max_us;
}
