#include "daemon/beacon_room.h"

#include "base/loop.h"
#include "daemon/messages.h"

/* A fuller pack than what is taken is tried again: first after this long, then half as often each
 * time. */
#define AGAIN_US 10000000
#define AGAIN_MAX_US 600000000

void beacon_room_forget(struct beacon_room *room)
{
    *room = (struct beacon_room){
        .most = MESSAGES_PACK_MAX, .again_us = LOOP_NEVER, .again_wait_us = AGAIN_US};
}

bool beacon_room_is_trial(const struct beacon_room *room, unsigned given)
{
    return room->taken != 0 && given > room->taken;
}

static void try_again_later(struct beacon_room *room, int64_t now_us)
{
    room->taken = 0;
    room->again_us = now_us + room->again_wait_us;
    room->again_wait_us *= room->again_wait_us < AGAIN_MAX_US ? 2 : 1;
}

void beacon_room_taken(struct beacon_room *room, unsigned given, int64_t now_us)
{
    room->refusals = 0;
    room->fitted = given > room->fitted ? given : room->fitted;
    if (beacon_room_is_trial(room, given)) {
        room->taken = 0;
        room->again_us = LOOP_NEVER;
        room->again_wait_us = AGAIN_US;
    } else if (now_us >= room->again_us) {
        room->again_us = LOOP_NEVER;
        room->taken = room->most;
        room->most = MESSAGES_PACK_MAX;
    }
}

bool beacon_room_refused(struct beacon_room *room, unsigned given, int64_t now_us)
{
    if (beacon_room_is_trial(room, given)) {
        room->most = room->taken;
        try_again_later(room, now_us);
        return true;
    }
    /* By a radio that was switched off a moment ago, too. */
    if (++room->refusals == 1) {
        return true;
    }
    if (given <= 1) {
        return false;
    }
    /* What fitted, unless that is over; else four: with three there were no System. */
    room->fitted = given > room->fitted ? room->fitted : 0;
    room->most = room->fitted > 4 ? room->fitted : given > 4 ? 4 : 1;
    try_again_later(room, now_us);
    return true;
}
