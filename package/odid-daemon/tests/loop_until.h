/* Runs the real event loop until something is so, or for some time. */
#ifndef ODID_TESTS_LOOP_UNTIL_H
#define ODID_TESTS_LOOP_UNTIL_H

#include <sched.h>
#include <stdbool.h>
#include <stdint.h>

#include "loop.h"

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

/* Returns whether it became so within that time. */
static bool loop_until(bool (*done)(void), int ms)
{
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
