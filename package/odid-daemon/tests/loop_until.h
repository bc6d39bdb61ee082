/*
 * Runs the real event loop until something is so, or for some time.
 *
 * How long it may take is judged where the test has simulated_time.h. Of real
 * time it is a promise, judged where ODID_TIMED is set, as `make test-all` does;
 * without it there is one generous limit, that no machine reaches which is
 * merely slow.
 */
#ifndef ODID_TESTS_LOOP_UNTIL_H
#define ODID_TESTS_LOOP_UNTIL_H

#include <sched.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

#include "base/loop.h"
#include "patience.h"

#ifndef TIME_IS_SIMULATED /* simulated_time.h comes first */
#define TIME_IS_SIMULATED false
#endif

#define LOOK_EVERY_US 1000

/* A busy machine must not look like slow code. Refused (not root): the tests may wait in vain. */
__attribute__((constructor)) static void take_real_time_priority(void)
{
    struct sched_param parameters = {.sched_priority = 5};

    (void)sched_setscheduler(0, SCHED_FIFO, &parameters);
}

static struct {
    struct loop_timer timer;
    bool (*done)(void);
    bool was;
    int64_t end_us;
} until;

static void look(void *context, int64_t now_us)
{
    (void)context;
    until.was = until.done != NULL && until.done();
    if (until.was || now_us >= until.end_us) {
        loop_stop();
    } else {
        loop_arm(&until.timer, now_us + LOOK_EVERY_US);
    }
}

static inline bool time_is_judged(void)
{
    return TIME_IS_SIMULATED || getenv("ODID_TIMED") != NULL;
}

/* Whether something took as long as it has to, where that is judged. */
static inline bool in_time(int64_t took_us, int64_t least_us, int64_t most_us)
{
    return !time_is_judged() || (took_us >= least_us && took_us <= most_us);
}

/* Returns whether it became so; where time is judged, within that time. done NULL: runs for so
 * long. */
static bool loop_until(bool (*done)(void), int ms)
{
    if (done != NULL && !time_is_judged()) {
        ms = PATIENCE_MS;
    }
    loop_timer_init(&until.timer, look, NULL);
    until.done = done;
    until.end_us = loop_now_us() + ms * INT64_C(1000);
    loop_arm(&until.timer, 0);
    return loop_run() == 0 && until.was;
}

static inline void run_ms(int ms)
{
    loop_until(NULL, ms);
}

#endif
