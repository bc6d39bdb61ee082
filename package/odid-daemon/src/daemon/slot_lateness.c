#include "daemon/slot_lateness.h"

#include <stddef.h>

#define FINE_US 50
#define FINE 64
#define COARSE_US 200
#define BUCKETS (sizeof(((struct slot_lateness *)NULL)->histogram) / sizeof(uint32_t))

static size_t bucket_of(int64_t late_us)
{
    size_t bucket;

    if (late_us < 0) {
        return 0;
    }
    bucket = late_us < FINE * FINE_US ? (size_t)(late_us / FINE_US)
                                      : FINE + (size_t)((late_us - FINE * FINE_US) / COARSE_US);
    return bucket < BUCKETS ? bucket : BUCKETS - 1;
}

static int64_t end_of_us(size_t bucket)
{
    return bucket < FINE ? (int64_t)(bucket + 1) * FINE_US
                         : FINE * FINE_US + (int64_t)(bucket + 1 - FINE) * COARSE_US;
}

void slot_lateness_add(struct slot_lateness *lateness, int64_t late_us, unsigned skipped)
{
    lateness->slots++;
    lateness->skipped += skipped;
    lateness->histogram[bucket_of(late_us)]++;
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
        int64_t end_us = end_of_us(bucket);

        seen += lateness->histogram[bucket];
        if (seen >= wanted) {
            return end_us < lateness->max_us ? end_us : lateness->max_us;
        }
    }
    return lateness->max_us;
}
