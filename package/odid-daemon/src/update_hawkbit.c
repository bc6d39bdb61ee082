#include "update_hawkbit.h"

#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "log.h"
#include "loop.h"
#include "update_places.h"
#include "whole_file.h"

#define SECOND_US 1000000
#define PAUSE_US INT64_C(600000000)
#define PAUSE_MAX_US (16 * PAUSE_US)
#define REPORT_US 15000000

static struct {
    bool (*is_idle)(void);
    void (*restart)(void);
    struct loop_timer pause, report;
    int64_t pause_us; /* how long the next one is */
    int64_t reporting_until_us;
} hawkbit;

static void end_report(void *context, int64_t now_us)
{
    (void)context;
    (void)now_us;
    hawkbit.restart(); /* without it */
}

static void end_pause(void *context, int64_t now_us)
{
    (void)context;
    if (!hawkbit.is_idle()) { /* somebody else's update: SWUpdate is busy */
        loop_arm(&hawkbit.pause, now_us + SECOND_US);
        return;
    }
    if (unlink(HAWKBIT_PAUSE) == 0) {
        hawkbit.restart();
    }
}

void update_hawkbit_begin(bool (*is_idle)(void), void (*restart)(void), int64_t now_us)
{
    hawkbit.is_idle = is_idle;
    hawkbit.restart = restart;
    hawkbit.reporting_until_us = 0;
    hawkbit.pause_us = PAUSE_US;
    loop_timer_init(&hawkbit.pause, end_pause, NULL);
    loop_timer_init(&hawkbit.report, end_report, NULL);
    if (access(HAWKBIT_PAUSE, F_OK) == 0) {
        loop_arm(&hawkbit.pause, now_us + PAUSE_US);
    }
}

bool update_hawkbit_is_asked(void)
{
    struct stat file;

    return stat(HAWKBIT, &file) == 0 && file.st_size > 0;
}

void update_hawkbit_pause(int64_t now_us)
{
    int result;

    if (!update_hawkbit_is_asked()) {
        return;
    }
    result = whole_file_replace(HAWKBIT_PAUSE, "", 0, 0644);
    if (result < 0) {
        log_error("hawkBit can't be paused: %s", strerror(-result));
    }
    log_info("update: hawkBit isn't asked for %d minutes",
             (int)(hawkbit.pause_us / (60 * SECOND_US)));
    loop_arm(&hawkbit.pause, now_us + hawkbit.pause_us);
    hawkbit.pause_us *= hawkbit.pause_us < PAUSE_MAX_US ? 2 : 1;
}

void update_hawkbit_report_and_pause(int64_t now_us)
{
    if (!update_hawkbit_is_asked()) {
        return;
    }
    update_hawkbit_pause(now_us);
    hawkbit.reporting_until_us = now_us + REPORT_US;
    loop_arm(&hawkbit.report, hawkbit.reporting_until_us);
}

bool update_hawkbit_reports(int64_t now_us)
{
    return now_us < hawkbit.reporting_until_us;
}

void update_hawkbit_came_through(void)
{
    hawkbit.pause_us = PAUSE_US;
}
