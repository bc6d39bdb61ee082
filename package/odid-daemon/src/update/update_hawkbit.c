#include "update/update_hawkbit.h"

#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/faults.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/whole_file.h"
#include "config/config.h"
#include "update/update_places.h"

#define SECOND_US 1000000
#define PAUSE_US INT64_C(600000000)
#define PAUSE_MAX_US (16 * PAUSE_US)
#define REPORT_US 15000000
#define FAILED_MAX 1 /* in a row: that may be */
#define LOST_MAX 3   /* without LOST_QUIET_US between them: that mustn't */
#define LOST_QUIET_US INT64_C(600000000)
#define SERVER_FAULT "hawkbit-server"

static struct {
    bool (*is_idle)(void);
    void (*restart)(void);
    struct loop_timer pause, report;
    int64_t pause_us; /* how long the next one is */
    int64_t reporting_until_us;
    unsigned failed;  /* in a row */
    unsigned lost;    /* how often SWUpdate was */
    int64_t lost_us;  /* the last time */
    ino_t configured; /* the file that says how it is asked; 0: not known */
} hawkbit;

static bool is_paused(void)
{
    return access(HAWKBIT_PAUSE, F_OK) == 0;
}

static void end_report(void *context, int64_t now_us)
{
    (void)context;
    (void)now_us;
    if (is_paused()) {
        hawkbit.restart(); /* without it */
    }
}

static void end_pause(void *context, int64_t now_us)
{
    (void)context;
    if (!hawkbit.is_idle()) { /* somebody else's update: SWUpdate is busy */
        loop_arm(&hawkbit.pause, now_us + SECOND_US);
        return;
    }
    faults_set(FAULTS, SERVER_FAULT, NULL);
    if (unlink(HAWKBIT_PAUSE) == 0) {
        hawkbit.restart();
    }
}

static ino_t configuration_file(void)
{
    struct stat file;

    return stat(HAWKBIT, &file) < 0 ? 0 : file.st_ino;
}

/* Of what its server has done. */
static void know_nothing(void)
{
    hawkbit.reporting_until_us = 0;
    hawkbit.pause_us = PAUSE_US;
    hawkbit.failed = hawkbit.lost = 0;
}

void update_hawkbit_begin(bool (*is_idle)(void), void (*restart)(void), int64_t now_us)
{
    hawkbit.is_idle = is_idle;
    hawkbit.restart = restart;
    know_nothing();
    hawkbit.configured = configuration_file();
    loop_timer_init(&hawkbit.pause, end_pause, NULL);
    loop_timer_init(&hawkbit.report, end_report, NULL);
    if (is_paused()) {
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

/* What is refused while its server is being told is no other one. */
void update_hawkbit_failed(int64_t now_us)
{
    if (!update_hawkbit_reports(now_us) && ++hawkbit.failed > FAILED_MAX) {
        update_hawkbit_report_and_pause(now_us);
    }
}

/* SWUpdate ended; how: in which way that mustn't be. */
static void leave_alone(const char *how, int64_t now_us)
{
    char sentence[CONFIG_PATH_SIZE + 160];
    struct config config;

    config_defaults(&config);
    config_read_file(&config, CONFIGURATION, config_ignore_sentence, NULL);
    snprintf(sentence, sizeof(sentence),
             "SWUpdate ended %s over what the hawkBit server %s answers: it isn't asked for %d "
             "minutes.",
             how, config.hawkbit_url, (int)(hawkbit.pause_us / (60 * SECOND_US)));
    faults_set(FAULTS, SERVER_FAULT, sentence);
    hawkbit.lost = 0;
    update_hawkbit_pause(now_us); /* it is about to start */
}

/* What the one before has done says nothing of another server. */
static void begin_anew(void)
{
    unlink(HAWKBIT_PAUSE);
    faults_set(FAULTS, SERVER_FAULT, NULL);
    know_nothing();
}

void update_hawkbit_follow_configuration(void)
{
    ino_t before = hawkbit.configured;

    hawkbit.configured = configuration_file();
    if (before != 0 && before != hawkbit.configured) {
        begin_anew();
        hawkbit.restart();
    }
}

void update_hawkbit_lost(bool broke_off, int64_t now_us)
{
    if (!update_hawkbit_is_asked() || is_paused()) {
        return;
    }
    hawkbit.lost = now_us - hawkbit.lost_us < LOST_QUIET_US ? hawkbit.lost + 1 : 1;
    hawkbit.lost_us = now_us;
    if (broke_off) {
        leave_alone("in the middle of another's update, it seems,", now_us);
    } else if (hawkbit.lost == LOST_MAX) {
        leave_alone("three times", now_us);
    }
}

void update_hawkbit_came_through(void)
{
    hawkbit.failed = 0;
    hawkbit.pause_us = PAUSE_US;
}
