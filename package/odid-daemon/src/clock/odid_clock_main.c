/*
 * odid-clock: gives a board without a clock battery its time, at boot and from
 * the autopilot. A program of its own, for the daemon has no right to.
 */
#include <cap-ng.h>
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include "appliance/places.h"
#include "appliance/status_ask.h"
#include "base/log.h"
#include "clock/clock_file.h"
#include "clock/clock_set.h"

#define SECOND_US 1000000
/* The daemon is asked every second until it tells a time, then every ten. */
#define ASK_AGAIN_S 1
#define LOOK_AGAIN_S 10
#define PATIENCE_MS 3000
#define SAVE_EVERY_US (INT64_C(600) * SECOND_US)
/* A board that was switched off for so long is no matter of doubt. */
#define FAR_US (INT64_C(180) * 86400 * SECOND_US)

static struct {
    struct places places;
    bool boot, dry_run;
    int64_t build_us;
    int64_t save_us;               /* CLOCK_MONOTONIC: when the time is to be saved next */
    bool was_set;                  /* to the autopilot's time */
    int64_t known_us, known_at_us; /* the time at the start, or that has stood since; when */
    /* said already, and not to be said again as long as it is so */
    int save_error;
    bool implausible;
} self = {.build_us = CLOCK_UNKNOWN};

static int64_t time_us(clockid_t which)
{
    struct timespec now;

    clock_gettime(which, &now);
    return (int64_t)now.tv_sec * SECOND_US + now.tv_nsec / 1000;
}

static const char *utc_text(int64_t unix_us)
{
    static char text[2][32]; /* two in one sentence */
    static unsigned which;
    time_t seconds = (time_t)(unix_us / SECOND_US);
    struct tm utc;

    which = !which;
    if (gmtime_r(&seconds, &utc) == NULL ||
        strftime(text[which], sizeof(text[which]), "%Y-%m-%d %H:%M:%S UTC", &utc) == 0) {
        return "?";
    }
    return text[which];
}

/* Returns 0, or -errno with a log line. */
static int set_clock(int64_t unix_us, const char *why)
{
    const struct timespec now = {.tv_sec = unix_us / SECOND_US,
                                 .tv_nsec = unix_us % SECOND_US * 1000};
    int error;

    if (!self.dry_run && clock_settime(CLOCK_REALTIME, &now) < 0) {
        error = errno;
        log_error("can't set the clock to %s: %s", utc_text(unix_us), strerror(error));
        return -error;
    }
    log_info("the clock %s set to %s, %s", self.dry_run ? "would be" : "is", utc_text(unix_us),
             why);
    return 0;
}

static int64_t read_build_us(void)
{
    char text[4096] = "";
    int fd = open(self.places.release, O_RDONLY | O_CLOEXEC);
    ssize_t length = fd < 0 ? -1 : read(fd, text, sizeof(text) - 1);
    int64_t build_us;

    if (length < 0) {
        log_warning("%s: %s: the time of the build is unknown", self.places.release,
                    strerror(errno));
    }
    if (fd >= 0) {
        close(fd);
    }
    if (length < 0) {
        return CLOCK_UNKNOWN;
    }
    build_us = clock_build_us(text);
    if (build_us == CLOCK_UNKNOWN) {
        log_warning("%s: no line BUILD_TIME= with the seconds since 1970 of a time between 2010 "
                    "and 2100: the time of the build is unknown",
                    self.places.release);
    }
    return build_us;
}

/* ---- at boot ---- */

static int set_at_boot(void)
{
    int64_t saved_us, start_us;
    int result = clock_file_read(self.places.clock, &saved_us);

    if (result < 0 && result != -ENOENT) {
        log_warning("%s: %s: the last saved time is unknown", self.places.clock, strerror(-result));
    }
    start_us = clock_at_boot_us(self.build_us, saved_us);
    if (start_us == CLOCK_UNKNOWN) {
        log_error("neither the time of the build nor a saved time is known: the clock stays at %s",
                  utc_text(time_us(CLOCK_REALTIME)));
        return EXIT_FAILURE;
    }
    return set_clock(start_us, start_us == saved_us ? "the last saved time" : "the build's time") <
                   0
               ? EXIT_FAILURE
               : EXIT_SUCCESS;
}

/* ---- as a service ---- */

static void note_known(void)
{
    self.known_us = time_us(CLOCK_REALTIME);
    self.known_at_us = time_us(CLOCK_MONOTONIC);
}

/* Before anybody has told the time the later one counts: /data may have come after the start. */
static void catch_up(void)
{
    int64_t saved_us;

    if (!self.was_set && !self.dry_run && clock_file_read(self.places.clock, &saved_us) == 0 &&
        saved_us > time_us(CLOCK_REALTIME) &&
        set_clock(saved_us, "the last saved time, which came late") == 0) {
        note_known();
    }
}

static void save(void)
{
    int result;

    catch_up();
    result = self.dry_run ? 0 : clock_file_save(self.places.clock, time_us(CLOCK_REALTIME));
    if (result < 0 && result != self.save_error) {
        log_warning("can't save the time to %s: %s", self.places.clock, strerror(-result));
    }
    self.save_error = result;
    self.save_us = time_us(CLOCK_MONOTONIC) + SAVE_EVERY_US;
}

/*
 * Every later start begins with what is saved. A time that lies far ahead may be forged, or of a
 * receiver that counts its weeks wrongly: it has to have stood for ten minutes. Far from what has
 * stood, not from the clock: who forges it comes in many steps. One that lies behind puts right
 * what was saved, at once.
 */
static bool lies_far_ahead(int64_t unix_us)
{
    return unix_us - self.known_us - (time_us(CLOCK_MONOTONIC) - self.known_at_us) > FAR_US;
}

static void set_to_autopilots(int64_t autopilot_us)
{
    if (set_clock(autopilot_us, "the autopilot's time") < 0) {
        return;
    }
    self.was_set = true;
    if (lies_far_ahead(autopilot_us)) {
        self.save_us = time_us(CLOCK_MONOTONIC) + SAVE_EVERY_US;
    } else {
        save();
    }
}

/* An autopilot's time from before the build is wrong, whatever its receiver made of it. */
static void judge_plausibility(int64_t autopilot_us)
{
    bool implausible = self.build_us != CLOCK_UNKNOWN && autopilot_us < self.build_us;

    if (implausible && !self.implausible) {
        log_warning("the autopilot's time %s is before this system was built (%s): not used",
                    utc_text(autopilot_us), utc_text(self.build_us));
    }
    self.implausible = implausible;
}

/* Returns whether the autopilot's time is known. */
static bool look_at_autopilot(void)
{
    static char answer[STATUS_ANSWER_MAX];
    ssize_t length = status_ask(self.places.run_dir, PATIENCE_MS, answer);
    int64_t autopilot_us;

    if (length < 0) {
        return false; /* no daemon: its keeper's and odidctl's business to say so */
    }
    autopilot_us = clock_of_status_us(answer, (size_t)length);
    if (autopilot_us == CLOCK_UNKNOWN) {
        return false;
    }
    judge_plausibility(autopilot_us);
    if (clock_is_off(time_us(CLOCK_REALTIME), autopilot_us, self.build_us)) {
        set_to_autopilots(autopilot_us);
    }
    return true;
}

static int follow_autopilot(void)
{
    struct timespec pause = {.tv_sec = ASK_AGAIN_S};
    sigset_t set;
    int number;

    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    if (sigprocmask(SIG_BLOCK, &set, NULL) < 0) {
        log_error("can't wait for signals: %s", strerror(errno));
        return EXIT_FAILURE;
    }
    signal(SIGPIPE, SIG_IGN); /* of the log */
    self.save_us = time_us(CLOCK_MONOTONIC) + SAVE_EVERY_US;
    note_known();
    do {
        catch_up();
        pause.tv_sec = look_at_autopilot() ? LOOK_AGAIN_S : ASK_AGAIN_S;
        if (time_us(CLOCK_MONOTONIC) >= self.save_us) { /* since then it was not set */
            save();
            note_known();
        }
        number = sigtimedwait(&set, NULL, &pause);
    } while (number < 0);
    if (!lies_far_ahead(time_us(CLOCK_REALTIME))) {
        save();
    }
    log_info("ending on signal %d", number);
    return EXIT_SUCCESS;
}

/* ---- start ---- */

/* Root's files and the clock are all that we need. */
static bool give_rights_away(void)
{
    capng_clear(CAPNG_SELECT_BOTH);
    if (capng_update(CAPNG_ADD, CAPNG_EFFECTIVE | CAPNG_PERMITTED, CAP_SYS_TIME) < 0 ||
        capng_apply(CAPNG_SELECT_BOTH) < 0 || prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) < 0) {
        log_error("can't keep CAP_SYS_TIME only; odid-clock has to be started as root");
        return false;
    }
    return true;
}

int main(int argc, char *argv[])
{
    enum { FLAG_BOOT = 1, FLAG_ROOT, FLAG_DRY_RUN, FLAG_VERSION };
    static const struct option flags[] = {
        {"boot", no_argument, NULL, FLAG_BOOT},
        {"root", required_argument, NULL, FLAG_ROOT},
        {"dry-run", no_argument, NULL, FLAG_DRY_RUN},
        {"version", no_argument, NULL, FLAG_VERSION},
        {NULL, 0, NULL, 0},
    };
    const char *root = "";
    int flag;

    while ((flag = getopt_long_only(argc, argv, "", flags, NULL)) != -1) {
        switch (flag) {
        case FLAG_BOOT:
            self.boot = true;
            break;
        case FLAG_ROOT:
            root = optarg;
            break;
        case FLAG_DRY_RUN:
            self.dry_run = true;
            break;
        case FLAG_VERSION:
            puts("odid-clock " ODID_VERSION);
            return EXIT_SUCCESS;
        default:
            return 2; /* getopt said what is wrong */
        }
    }
    if (optind < argc) {
        fprintf(stderr, "odid-clock: \"%s\" is no option; see odid-clock(8)\n", argv[optind]);
        return 2;
    }
    if (!self.dry_run && !give_rights_away()) {
        return EXIT_FAILURE;
    }
    places_under(&self.places, root);
    self.build_us = read_build_us();
    return self.boot ? set_at_boot() : follow_autopilot();
}
