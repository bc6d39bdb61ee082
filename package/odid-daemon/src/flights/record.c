#include "flights/record.h"

const char *recorder_kind_name(enum recorder_fault_kind kind)
{
    switch (kind) {
    case RECORDER_DAEMON:
        return "daemon";
    case RECORDER_LINK:
        return "link";
    case RECORDER_POSITION:
        return "position";
    case RECORDER_IDENTITY:
        return "identity";
    case RECORDER_SOURCES:
        return "sources";
    case RECORDER_EMERGENCY:
        return "emergency";
    case RECORDER_FAILURE:
        return "failure";
    case RECORDER_SIMULATED:
        return "simulated";
    case RECORDER_UNDERVOLTAGE:
        return "undervoltage";
    case RECORDER_THROTTLED:
        return "throttled";
    default:
        return channel_name((enum channel)(kind - RECORDER_CHANNEL));
    }
}
