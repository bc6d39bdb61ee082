#include "daemon/autopilot_clock.h"

#include <stdlib.h>

/* The least delay of so long counts, and of the same time before. */
#define WINDOW_US 5000000
/* Two crystals differ by less than 1 in this many: by so much it may be more after a silence. */
#define DRIFT_ONE_IN 5000
#define RESTART_MS 1000
#define STEP_US 1000000
#define DELAY_MAX_US 30000000
#define BELIEVED 3 /* times in a row */
/* And for so long, between the instants at which it was said: who says the time ten times a second
 * can be wrong for one, and what was read at once after a start has no instants yet. */
#define STEP_LASTS_US 1900000
/* What was said for that long stays; of what wasn't, nobody else goes on with a stray word. */
#define UTC_STAYS_US 10000000
#define YEAR_2010_US UINT64_C(1262304000000000)
#define YEAR_2100_US UINT64_C(4102444800000000)

void autopilot_clock_new_boot(struct autopilot_clock *clock)
{
    if (clock->utc_of_this_boot) {
        clock->utc_offset_us -= clock->offset_us;
        clock->utc_of_this_boot = false;
    }
    clock->boot_known = false;
    clock->backward_seen = 0;
    clock->step_seen = 0;
}

static void start_clock(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us)
{
    clock->boot_known = true;
    clock->last_boot_ms = boot_ms;
    clock->last_boot_us = (int64_t)boot_ms * 1000;
    clock->offset_us = now_us - clock->last_boot_us;
    clock->least_us[0] = clock->least_us[1] = clock->offset_us;
    clock->window_us = clock->heard_us = now_us;
    clock->ahead_seen = 0;
}

/* Boot time without its wrap; the newest one is remembered. Only that teaches: an older one, or
 * the same one again, comes late. */
static int64_t unwrap(struct autopilot_clock *clock, uint32_t boot_ms, bool *newest)
{
    int32_t delta_ms = (int32_t)(boot_ms - clock->last_boot_ms);
    int64_t boot_us = clock->last_boot_us + (int64_t)delta_ms * 1000;

    *newest = delta_ms > 0;
    if (*newest) {
        clock->last_boot_ms = boot_ms;
        clock->last_boot_us = boot_us;
    }
    return boot_us;
}

/*
 * Boot time that went back is a restart when the autopilot can have started
 * since it was heard last, or when it stays so. A message that merely took a
 * slow way is neither. Soon after the first start, boot time can be ahead of
 * what was heard last, and yet be another one: then it seems to come late.
 */
static bool has_restarted(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us)
{
    int64_t unheard_us = now_us - clock->heard_us;
    int32_t ahead_ms = (int32_t)(boot_ms - clock->last_boot_ms);
    int64_t late_us = now_us - clock->offset_us - clock->last_boot_us - (int64_t)ahead_ms * 1000;
    bool possible = (int64_t)boot_ms * 1000 <= unheard_us + STEP_US;

    if (ahead_ms >= -RESTART_MS) {
        clock->backward_seen = 0;
        return possible && ahead_ms != 0 && late_us > STEP_US;
    }
    if (clock->backward_seen == 0 || (int32_t)(boot_ms - clock->backward_ms) > 0) {
        clock->backward_seen++; /* and it goes on: one source with a frozen clock proves nothing */
    }
    clock->backward_ms = boot_ms;
    return clock->backward_seen >= BELIEVED || possible;
}

/* Messages come late, never early: the smallest offset is the truest, and of one that was smaller
 * long ago the clocks have gone away since. */
static void learn(struct autopilot_clock *clock, int64_t offset_us, int64_t now_us)
{
    if (now_us - clock->window_us >= WINDOW_US) {
        clock->least_us[1] = clock->least_us[0] + (now_us - clock->window_us) / DRIFT_ONE_IN;
        clock->least_us[0] = offset_us;
        clock->window_us = now_us;
    } else if (offset_us < clock->least_us[0]) {
        clock->least_us[0] = offset_us;
    }
    clock->offset_us =
        clock->least_us[0] < clock->least_us[1] ? clock->least_us[0] : clock->least_us[1];
}

/* From the future? One such message is wrong; when they go on, what was known is. */
static bool is_ahead(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us)
{
    int64_t boot_us =
        clock->last_boot_us + (int64_t)(int32_t)(boot_ms - clock->last_boot_ms) * 1000;

    if (now_us - boot_us >= clock->offset_us - STEP_US) {
        clock->ahead_seen = 0;
        return false;
    }
    if (++clock->ahead_seen < BELIEVED) {
        return true;
    }
    if (now_us - boot_us < clock->offset_us - DELAY_MAX_US) {
        autopilot_clock_new_boot(clock);
        return false;
    }
    /* What was learnt last had come late, all of it. UTC that this boot said still goes with it. */
    clock->least_us[0] = clock->least_us[1] = now_us - boot_us;
    clock->window_us = now_us;
    clock->ahead_seen = 0;
    return false;
}

static void forget_stray_utc(struct autopilot_clock *clock, int64_t now_us)
{
    if (clock->utc_known && clock->utc_said_us - clock->utc_since_us < UTC_STAYS_US &&
        now_us - clock->utc_said_us >= UTC_STAYS_US) {
        clock->utc_known = clock->utc_of_this_boot = false;
    }
}

int64_t autopilot_clock_boot(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us,
                             bool *restarted)
{
    int64_t boot_us;
    bool newest;

    forget_stray_utc(clock, now_us);
    *restarted = clock->boot_known && has_restarted(clock, boot_ms, now_us);
    if (*restarted) {
        clock->restarts++;
        autopilot_clock_new_boot(clock);
    } else if (clock->boot_known && is_ahead(clock, boot_ms, now_us)) {
        clock->heard_us = now_us;
        return now_us;
    }
    if (!clock->boot_known) {
        start_clock(clock, boot_ms, now_us);
    }
    boot_us = unwrap(clock, boot_ms, &newest);
    clock->heard_us = now_us;
    if (newest) {
        learn(clock, now_us - boot_us, now_us);
    }
    return boot_us + clock->offset_us;
}

bool autopilot_clock_plausible(uint64_t unix_us)
{
    return unix_us >= YEAR_2010_US && unix_us <= YEAR_2100_US;
}

static void believe_utc(struct autopilot_clock *clock, int64_t offset_us, bool confirmed,
                        int64_t now_us)
{
    if (clock->utc_said_us - clock->utc_since_us < UTC_STAYS_US) {
        clock->utc_since_us = clock->utc_known && confirmed ? clock->utc_since_us : now_us;
        clock->utc_said_us = now_us;
    }
    clock->utc_known = clock->utc_of_this_boot = true;
    clock->utc_offset_us = offset_us;
    clock->step_seen = 0;
}

void autopilot_clock_utc(struct autopilot_clock *clock, uint64_t unix_us, uint32_t boot_ms,
                         bool fix_known, int64_t now_us)
{
    bool restarted;
    int64_t at_us, offset_us;

    at_us = autopilot_clock_boot(clock, boot_ms, now_us, &restarted);
    if (!autopilot_clock_plausible(unix_us) || clock->ahead_seen > 0) {
        return;
    }
    offset_us = (int64_t)unix_us - (at_us - clock->offset_us);
    if (!clock->utc_known
            ? fix_known
            : llabs((int64_t)unix_us - autopilot_clock_unix_us(clock, at_us)) <= STEP_US) {
        believe_utc(clock, offset_us, fix_known, now_us);
        return;
    }
    if (!fix_known) {
        return;
    }
    if (clock->step_seen == 0 || llabs(offset_us - clock->step_us) > STEP_US) {
        clock->step_seen = 0;
        clock->step_since_us = at_us;
    }
    clock->step_us = offset_us;
    if (++clock->step_seen >= BELIEVED && at_us - clock->step_since_us >= STEP_LASTS_US) {
        believe_utc(clock, offset_us, fix_known, now_us);
    }
}

int64_t autopilot_clock_unix_us(const struct autopilot_clock *clock, int64_t at_us)
{
    return clock->utc_of_this_boot ? at_us - clock->offset_us + clock->utc_offset_us
                                   : at_us + clock->utc_offset_us;
}
