#include "autopilot_clock.h"

#include <stdlib.h>

/* Two crystals differ by less than 1 in this many: what the kept offset may lag when the
 * autopilot's is the slower. */
#define DRIFT_ONE_IN 5000
#define RESTART_MS 1000
#define STEP_US 1000000
#define BELIEVED 3 /* times in a row */
#define YEAR_2010_US INT64_C(1262304000000000)
#define YEAR_2100_US INT64_C(4102444800000000)

void autopilot_clock_new_boot(struct autopilot_clock *clock)
{
    if (clock->boot_known && clock->utc_known) {
        clock->utc_offset_us -= clock->offset_us; /* now UTC minus our clock */
    }
    clock->boot_known = false;
    clock->backward_seen = 0;
    clock->step_seen = 0;
}

static void start(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us)
{
    clock->boot_known = true;
    clock->last_boot_ms = boot_ms;
    clock->last_boot_us = (int64_t)boot_ms * 1000;
    clock->offset_us = now_us - clock->last_boot_us;
    clock->offset_at_us = now_us;
    if (clock->utc_known) {
        clock->utc_offset_us += clock->offset_us;
    }
}

/* Boot time without its wrap; the newest one is remembered. */
static int64_t unwrap(struct autopilot_clock *clock, uint32_t boot_ms)
{
    int32_t delta_ms = (int32_t)(boot_ms - clock->last_boot_ms);
    int64_t boot_us = clock->last_boot_us + (int64_t)delta_ms * 1000;

    if (delta_ms > 0) {
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
    int64_t unheard_us = now_us - clock->offset_at_us;
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

int64_t autopilot_clock_boot(struct autopilot_clock *clock, uint32_t boot_ms, int64_t now_us,
                             bool *restarted)
{
    int64_t boot_us, drift_us;

    *restarted = clock->boot_known && has_restarted(clock, boot_ms, now_us);
    if (*restarted) {
        clock->restarts++;
        autopilot_clock_new_boot(clock);
    }
    if (!clock->boot_known) {
        start(clock, boot_ms, now_us);
    }
    boot_us = unwrap(clock, boot_ms);

    /* Messages come late, never early: the smallest offset is the truest, but
     * for the crystals' drift since it was measured. */
    drift_us = (now_us - clock->offset_at_us) / DRIFT_ONE_IN;
    clock->offset_us += drift_us;
    clock->offset_at_us += drift_us * DRIFT_ONE_IN; /* the rest counts the next time */
    if (now_us - boot_us < clock->offset_us) {
        clock->offset_us = now_us - boot_us;
    }
    return boot_us + clock->offset_us;
}

void autopilot_clock_utc(struct autopilot_clock *clock, uint64_t unix_us, uint32_t boot_ms,
                         int64_t now_us)
{
    bool restarted;
    int64_t boot_us, offset_us;

    boot_us = autopilot_clock_boot(clock, boot_ms, now_us, &restarted) - clock->offset_us;
    if (unix_us < YEAR_2010_US || unix_us > YEAR_2100_US) {
        return;
    }
    offset_us = (int64_t)unix_us - boot_us;
    if (!clock->utc_known || llabs(offset_us - clock->utc_offset_us) <= STEP_US) {
        clock->utc_known = true;
        clock->utc_offset_us = offset_us;
        clock->step_seen = 0;
        return;
    }
    if (clock->step_seen == 0 || llabs(offset_us - clock->step_us) > STEP_US) {
        clock->step_seen = 0;
    }
    clock->step_us = offset_us;
    if (++clock->step_seen >= BELIEVED) {
        clock->utc_offset_us = offset_us;
        clock->step_seen = 0;
    }
}

int64_t autopilot_clock_unix_us(const struct autopilot_clock *clock, int64_t at_us)
{
    return clock->boot_known ? at_us - clock->offset_us + clock->utc_offset_us
                             : at_us + clock->utc_offset_us;
}
