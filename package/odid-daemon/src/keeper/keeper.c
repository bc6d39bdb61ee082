#include "keeper/keeper.h"

#include <signal.h>
#include <string.h>

/* A daemon that ended earlier than this after its start "ended at once". Its first sign of life
 * comes before anything of its is on the air: one that it gives later says that something is. */
#define AT_ONCE_US 1000000
#define SPEAKS_AGAIN_US 1500000
/* hostapd, or a chip, may do later what it didn't do. */
#define AGAIN_US 5000000
/* Two deaths by the filter within this time are no accident. */
#define FILTERED_WITHIN_US 60000000

void keeper_init(struct keeper *keeper, int64_t silent_us, int64_t off_air_us, int64_t now_us)
{
    memset(keeper, 0, sizeof(*keeper));
    keeper->silent_us = silent_us;
    keeper->off_air_us = off_air_us;
    keeper->again_us = INT64_MIN;
    keeper->start_us = now_us;
    /* An earlier keeper may have been killed, and what its daemon said last is on the air. */
    keeper->alive_us = keeper->on_air_us = now_us;
    keeper->filtered_us = INT64_MIN;
}

bool keeper_alive(struct keeper *keeper, int64_t now_us)
{
    bool over = keeper->outage || keeper->off_air || keeper->taking_off_air;

    if (keeper->state != KEEPER_RUNNING) {
        return false; /* it woke up too late */
    }
    keeper->alive_us = now_us;
    if (now_us - keeper->started_us < AT_ONCE_US) {
        return false;
    }
    keeper->on_air_us = now_us;
    keeper->outage = keeper->off_air = keeper->taking_off_air = false;
    keeper->again_us = INT64_MIN;
    return over;
}

void keeper_died(struct keeper *keeper, int signal, int code, int64_t now_us)
{
    bool at_once = now_us - keeper->started_us < AT_ONCE_US;

    keeper->state = KEEPER_DOWN;
    keeper->outage = true;
    keeper->orderly = keeper->told_to_end && signal == 0 && code == 0;
    keeper->quick = at_once ? keeper->quick + 1 : 0;
    keeper->start_us = keeper->quick < 2 ? now_us : keeper->started_us + AT_ONCE_US;
    if (signal == SIGSYS) {
        keeper->log_mode = keeper->log_mode || (keeper->filtered_us != INT64_MIN &&
                                                now_us - keeper->filtered_us <= FILTERED_WITHIN_US);
        keeper->filtered_us = now_us;
    }
}

void keeper_is_off_air(struct keeper *keeper, bool all, int64_t now_us)
{
    if (!keeper->taking_off_air) { /* one spoke meanwhile */
        return;
    }
    if (all || keeper->ending) { /* nobody waits for what can't be done at once */
        keeper->off_air = true;
    } else {
        keeper->again_us = now_us + AGAIN_US;
    }
    keeper->taking_off_air = false;
}

void keeper_end(struct keeper *keeper, int64_t now_us)
{
    if (!keeper->ending) {
        keeper->ending = true;
        keeper->end_us = now_us + keeper->silent_us;
    }
}

/* When the running daemon is to be killed. */
static int64_t kill_us(const struct keeper *keeper)
{
    int64_t since_us =
        keeper->alive_us > keeper->started_us ? keeper->alive_us : keeper->started_us;

    return keeper->ending ? keeper->end_us : since_us + keeper->silent_us;
}

static int64_t off_air_us(const struct keeper *keeper)
{
    int64_t silent_us = keeper->on_air_us + keeper->off_air_us;
    int64_t spoken_us = keeper->started_us + AT_ONCE_US + SPEAKS_AGAIN_US, due_us = silent_us;

    if (keeper->off_air || keeper->taking_off_air) {
        return INT64_MAX;
    }
    if (keeper->ending && keeper->state == KEEPER_DOWN) {
        return keeper->orderly ? INT64_MAX : 0; /* nobody comes after us */
    }
    /* The one that runs has spoken, and hasn't had the time to speak again: it may be sending. */
    if (keeper->state == KEEPER_RUNNING && keeper->quick < 2 &&
        keeper->alive_us > keeper->started_us && silent_us < spoken_us) {
        due_us = spoken_us;
    }
    return due_us > keeper->again_us ? due_us : keeper->again_us;
}

static int64_t process_us(const struct keeper *keeper)
{
    switch (keeper->state) {
    case KEEPER_DOWN:
        return keeper->ending ? INT64_MAX : keeper->start_us;
    case KEEPER_RUNNING:
        return keeper->ending && !keeper->told_to_end ? 0 : kill_us(keeper);
    default:
        return INT64_MAX; /* killed: the kernel will tell when it is gone */
    }
}

enum keeper_action keeper_next(struct keeper *keeper, int64_t now_us)
{
    if (now_us >= process_us(keeper)) {
        if (keeper->state == KEEPER_DOWN) {
            keeper->state = KEEPER_RUNNING;
            keeper->started_us = now_us;
            return KEEPER_START;
        }
        if (keeper->ending && !keeper->told_to_end) {
            keeper->told_to_end = true;
            return KEEPER_TERMINATE;
        }
        keeper->state = KEEPER_KILLED;
        keeper->outage = true;
        return KEEPER_KILL;
    }
    if (now_us >= off_air_us(keeper)) {
        keeper->taking_off_air = true;
        return KEEPER_TAKE_OFF_AIR;
    }
    if (keeper->ending && keeper->state == KEEPER_DOWN && !keeper->taking_off_air) {
        return KEEPER_QUIT;
    }
    return KEEPER_NOTHING;
}

int64_t keeper_due_us(const struct keeper *keeper)
{
    int64_t process = process_us(keeper), air = off_air_us(keeper);

    return process < air ? process : air;
}
