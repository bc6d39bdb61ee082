#include "daemon/arming.h"

void arming_init(struct arming *arming, bool armed)
{
    arming->armed = armed;
    arming->disarmed_us = INT64_MIN;
    arming->said_us = INT64_MIN;
}

void arming_flies(struct arming *arming)
{
    arming->armed = true;
    arming->disarmed_us = INT64_MIN;
}

bool arming_take(struct arming *arming, bool says_armed, bool doubtful, bool flying, int64_t now_us)
{
    bool silent =
        arming->said_us == INT64_MIN || now_us - arming->said_us >= ARMING_ENDS_US; /* until now */

    arming->said_us = now_us;
    if (says_armed || doubtful || flying) {
        arming->armed = arming->armed || says_armed;
        arming->disarmed_us = INT64_MIN;
    } else if (arming->disarmed_us == INT64_MIN || silent) {
        arming->disarmed_us = now_us;
    } else if (now_us - arming->disarmed_us >= ARMING_ENDS_US) {
        arming->armed = false;
    }
    return arming->armed;
}
