/* Runs the daemon's event loop for as long as there is something to read. */
#ifndef ODID_FUZZ_ROUNDS_H
#define ODID_FUZZ_ROUNDS_H

#include "base/loop.h"
#include "on_air.h"

static struct loop_timer rounds_timer;
static unsigned rounds;

static void on_round(void *context, int64_t now_us)
{
    (void)context;
    (void)now_us;
    if (rounds == 0) {
        loop_stop();
    } else {
        rounds--;
        loop_arm(&rounds_timer, 0);
    }
}

/* Once, after loop_init. */
static inline void rounds_init(void)
{
    loop_timer_init(&rounds_timer, on_round, NULL);
}

/* Until everything that is there has been read. */
static inline void run(void)
{
    rounds = 2;
    loop_arm(&rounds_timer, 0);
    MUST(loop_run() == 0);
}

#endif
