/* For how long something counts that was said of the aircraft. */
#ifndef ODID_AIRCRAFT_FRESH_H
#define ODID_AIRCRAFT_FRESH_H

#include <stdbool.h>
#include <stdint.h>

/* A source that was silent for this long gives way to the next better one. */
#define AIRCRAFT_FRESH_US 3000000

/* Is an instant, INT64_MIN for never, less than AIRCRAFT_FRESH_US ago? */
static inline bool aircraft_fresh(int64_t since_us, int64_t now_us)
{
    return since_us != INT64_MIN && now_us - since_us < AIRCRAFT_FRESH_US;
}

#endif
