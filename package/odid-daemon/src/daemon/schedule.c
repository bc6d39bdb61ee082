#include "daemon/schedule.h"

void schedule_start(struct schedule *schedule, int64_t now_us)
{
    schedule->origin_us = now_us;
    schedule->slot = 0;
    schedule->served = 0;
}

int64_t schedule_deadline(const struct schedule *schedule)
{
    return schedule->origin_us + schedule->slot * SCHEDULE_SLOT_US;
}

/* Self ID and Authentication pages share a slot, one of each in turn. */
static enum message_type last_slot(const unsigned available[MESSAGE_TYPES], int64_t cycle)
{
    bool page_turn = available[MESSAGE_SELF_ID] == 0 || cycle % 2 == 1;

    return available[MESSAGE_AUTHENTICATION] > 0 && page_turn ? MESSAGE_AUTHENTICATION
                                                              : MESSAGE_SELF_ID;
}

static enum message_type slot_type(int64_t served, const unsigned available[MESSAGE_TYPES])
{
    enum message_type type;

    switch (served % SCHEDULE_SLOTS) {
    case 1:
        type = MESSAGE_BASIC_ID;
        break;
    case 3:
        type = MESSAGE_SYSTEM;
        break;
    case 5:
        type = MESSAGE_OPERATOR_ID;
        break;
    case 7:
        type = last_slot(available, served / SCHEDULE_SLOTS);
        break;
    default:
        type = MESSAGE_LOCATION;
        break;
    }
    return available[type] > 0 ? type : MESSAGE_LOCATION;
}

/* Whose turn it is follows from the cycle's number alone. */
static unsigned turn(enum message_type type, int64_t cycle, const unsigned available[MESSAGE_TYPES])
{
    if (type == MESSAGE_AUTHENTICATION && available[MESSAGE_SELF_ID] > 0) {
        cycle /= 2;
    }
    return available[type] > 1 ? (unsigned)(cycle % available[type]) : 0;
}

struct schedule_entry schedule_next(struct schedule *schedule, int64_t now_us,
                                    const unsigned available[MESSAGE_TYPES])
{
    struct schedule_entry entry;
    int64_t behind_us = now_us - schedule_deadline(schedule);

    entry.skipped = behind_us > 0 ? (unsigned)(behind_us / SCHEDULE_SLOT_US) : 0;
    schedule->slot += entry.skipped;
    entry.late_us = behind_us > 0 ? behind_us : 0;
    entry.type = slot_type(schedule->served, available);
    entry.index = turn(entry.type, schedule->served / SCHEDULE_SLOTS, available);
    schedule->slot++;
    schedule->served++;
    entry.until_us = schedule_deadline(schedule);
    return entry;
}

void schedule_withdraw(struct schedule *schedule)
{
    if (schedule->served > 0) {
        schedule->served--;
    }
}
