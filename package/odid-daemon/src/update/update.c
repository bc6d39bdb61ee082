#include "update/update.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "appliance/kept.h"

/* A board that stood still was not well meanwhile. */
#define PASSED_MAX_US 2000000

const char *update_state_name(enum update_state state)
{
    static const char *const names[] = {[UPDATE_IDLE] = "idle",
                                        [UPDATE_CHECKING] = "checking",
                                        [UPDATE_INSTALLING] = "installing",
                                        [UPDATE_WAITING] = "waiting-for-reboot",
                                        [UPDATE_TRIAL] = "trial"};

    return names[state];
}

static void enter(struct update *update, enum update_state state, int64_t now_us,
                  const char *format, ...) __attribute__((format(printf, 4, 5)));

static void enter(struct update *update, enum update_state state, int64_t now_us,
                  const char *format, ...)
{
    va_list arguments;

    update->state = state;
    update->since_us = now_us;
    update->ticked_us = now_us;
    update->percent = -1;
    update->seconds_left = -1;
    update->stopped = NULL;
    update->called_off = false;
    update->slow = false;
    update->moved_us = now_us;
    va_start(arguments, format);
    vsnprintf(update->sentence, sizeof(update->sentence), format, arguments);
    va_end(arguments);
}

static void idle(struct update *update, int64_t now_us)
{
    update->version[0] = '\0';
    enter(update, UPDATE_IDLE, now_us, "No update is going on.");
}

void update_init(struct update *update, int64_t now_us)
{
    memset(update, 0, sizeof(*update));
    idle(update, now_us);
}

/* For the restart. */
static bool may_fly(const struct kept *kept, bool answered, bool unattended)
{
    return !answered || kept->armed == KEPT_UNSAID || (kept_is_silent(kept) && unattended);
}

bool update_armed(const struct update *update, const struct kept *kept, bool answered,
                  bool unattended, bool given_up)
{
    if (kept != NULL && kept->armed == KEPT_ARMED) {
        return true;
    }
    if (update->state == UPDATE_TRIAL || (given_up && (kept == NULL || kept_is_unheard(kept)))) {
        return false;
    }
    return kept == NULL || (update->state == UPDATE_WAITING && may_fly(kept, answered, unattended));
}

/* ---- install ---- */

void update_begins(struct update *update, int64_t now_us)
{
    update->version[0] = '\0';
    enter(update, UPDATE_CHECKING, now_us, "A bundle is being checked.");
}

void update_version(struct update *update, const char *version)
{
    snprintf(update->version, sizeof(update->version), "%s", version);
}

void update_progress(struct update *update, int percent, int64_t now_us)
{
    int64_t passed_us;

    if (update->state != UPDATE_INSTALLING) {
        enter(update, UPDATE_INSTALLING, now_us, "Version %s is being written.", update->version);
        update->writing_us = now_us;
    }
    if (percent < update->percent) {
        return; /* SWUpdate begins again at 0 with U-Boot's variables */
    }
    if (percent > update->percent) {
        update->moved_us = now_us;
    }
    update->percent = percent;
    passed_us = now_us - update->writing_us;
    if (percent > 0 && passed_us >= 1000000) {
        update->seconds_left = (int)(passed_us * (100 - percent) / percent / 1000000);
    }
}

static void stop(struct update *update, const char *why)
{
    if (update->stopped == NULL) {
        update->stopped = why;
    }
}

bool update_cancel(struct update *update)
{
    if (update->state != UPDATE_CHECKING && update->state != UPDATE_INSTALLING) {
        return false;
    }
    update->called_off = true;
    stop(update, "It was called off; nothing has changed.");
    return true;
}

/* An update that never ends would keep the aircraft on the ground. */
static void stop_a_slow_one(struct update *update, int64_t now_us)
{
    const char *before = update->stopped;

    if (now_us - update->moved_us >= UPDATE_STANDSTILL_US) {
        stop(update, "Nothing more of it came for 30 s; nothing has changed.");
    } else if (update->state == UPDATE_INSTALLING &&
               now_us - update->writing_us >= UPDATE_WRITING_US) {
        stop(update, "It wasn't here within 10 minutes; nothing has changed.");
    }
    update->slow = update->slow || update->stopped != before;
}

void update_installed(struct update *update, int64_t now_us)
{
    update->disarmed_us = 0;
    enter(update, UPDATE_WAITING, now_us,
          "Version %s is written, and starts for its trial as soon as the aircraft is disarmed.",
          update->version);
}

void update_ended(struct update *update, int64_t now_us)
{
    idle(update, now_us);
}

/* ---- trial ---- */

void update_try(struct update *update, const char *version, int64_t now_us)
{
    update_version(update, version);
    update->well_us = 0;
    update->tried_us = 0;
    enter(update, UPDATE_TRIAL, now_us, "Version %s is on trial.", version);
}

void update_committed(struct update *update, int64_t now_us)
{
    idle(update, now_us);
}

void update_rolled_back(struct update *update, int64_t now_us)
{
    update->disarmed_us = 0;
    enter(update, UPDATE_WAITING, now_us,
          "Version %s failed its trial; the version before it starts as soon as the aircraft is "
          "disarmed.",
          update->version);
}

void update_explain_fallback(const char *reason, const char *fallback, char *out, size_t size)
{
    if (strcmp(reason, "three-restarts") == 0) {
        snprintf(out, size, "it didn't come up in three starts");
    } else if (strcmp(reason, "too-many-starts") == 0) {
        snprintf(out, size, "it was started 20 times and never kept");
    } else {
        snprintf(out, size, "%s", fallback[0] == '\0' ? "it was given up" : fallback);
        for (char *at = strchr(out, '-'); at != NULL && fallback[0] != '\0'; at = strchr(at, '-')) {
            *at = ' ';
        }
    }
}

static enum update_wish judge_trial(struct update *update, const struct update_board *board,
                                    int64_t passed_us)
{
    if (board->armed) {
        return UPDATE_NOTHING; /* its time stands still */
    }
    update->tried_us += passed_us;
    update->well_us = board->well ? update->well_us + passed_us : 0;
    if (!board->well) {
        snprintf(update->complaint, sizeof(update->complaint), "%s", board->complaint);
    }
    if (update->well_us >= UPDATE_WELL_US) {
        return UPDATE_COMMIT;
    }
    if (update->tried_us >= UPDATE_TRIAL_US) {
        snprintf(update->sentence, sizeof(update->sentence), "%s", update->complaint);
        return UPDATE_ROLL_BACK;
    }
    return UPDATE_NOTHING;
}

static enum update_wish wait(struct update *update, const struct update_board *board,
                             int64_t passed_us)
{
    update->disarmed_us = board->armed ? 0 : update->disarmed_us + passed_us;
    return update->disarmed_us >= UPDATE_REBOOT_US ? UPDATE_REBOOT : UPDATE_NOTHING;
}

enum update_wish update_tick(struct update *update, const struct update_board *board,
                             int64_t now_us)
{
    int64_t passed_us = now_us - update->ticked_us;

    update->ticked_us = now_us;
    if (passed_us > PASSED_MAX_US) {
        passed_us = PASSED_MAX_US;
    }
    switch (update->state) {
    case UPDATE_INSTALLING:
        if (board->armed) {
            stop(update, "The aircraft was armed while it was written; install it again when "
                         "disarmed.");
        }
        /* fallthrough */
    case UPDATE_CHECKING:
        stop_a_slow_one(update, now_us);
        return update->stopped != NULL ? UPDATE_STOP : UPDATE_NOTHING;
    case UPDATE_WAITING:
        return wait(update, board, passed_us);
    case UPDATE_TRIAL:
        return judge_trial(update, board, passed_us);
    default:
        return UPDATE_NOTHING;
    }
}
