#include "beacons/beacon_pace.h"

#include "radio/beacon_evidence.h"

static bool is_theirs(const struct beacon_pace *pace, uint32_t count, int64_t at_ms)
{
    int64_t more = (int64_t)count - pace->count, passed_ms = at_ms - pace->at_ms;

    return more * 1000 >= passed_ms * BEACON_COUNTED_PER_S &&
           more * 1000 <= passed_ms * BEACON_PACE_MOST_PER_S && passed_ms > 0;
}

void beacon_pace_take(struct beacon_pace *pace, uint32_t count, int64_t at_ms)
{
    pace->times = pace->began && is_theirs(pace, count, at_ms) ? pace->times + 1 : 0;
    pace->seen = pace->seen || pace->times >= BEACON_PACE_TIMES;
    pace->began = true;
    pace->count = count;
    pace->at_ms = at_ms;
}
