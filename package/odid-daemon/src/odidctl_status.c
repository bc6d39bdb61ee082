/* odidctl status and watch: how the daemon and the appliance are. */
#include <errno.h>
#include <json-c/json_tokener.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "kept.h"
#include "odidctl.h"
#include "odidctl_json.h"
#include "odidctl_table.h"
#include "status.h"
#include "status_ask.h"

#define TRIES 20 /* two seconds */
#define PATIENCE_MS 3000

/* ---- asking the daemon ---- */

static int say_no_answer(const char *run_dir, int error)
{
    switch (error) {
    case ENOENT:
    case ECONNREFUSED:
        fprintf(stderr,
                "odidctl: the daemon is not running (%s/%s: %s).\n"
                "Start it, and read its log if it ends again. If it was started with another\n"
                "[daemon] run_dir, name that: odidctl -run-dir DIR ...\n",
                run_dir, STATUS_SOCKET, strerror(error));
        break;
    case EAGAIN:
        fprintf(stderr,
                "odidctl: the daemon does not answer (%s/%s).\n"
                "It hangs; its supervisor restarts it within seconds. If not, restart it.\n",
                run_dir, STATUS_SOCKET);
        break;
    case EBADMSG:
        fprintf(stderr,
                "odidctl: the daemon's answer can't be understood (%s/%s).\n"
                "Are odidctl and odid-daemon of the same version?\n",
                run_dir, STATUS_SOCKET);
        break;
    default:
        fprintf(stderr, "odidctl: can't ask the daemon (%s/%s: %s).\n", run_dir, STATUS_SOCKET,
                strerror(error));
        break;
    }
    return ODIDCTL_NO_ANSWER;
}

struct json_object *odidctl_fetch(const char *run_dir, int *error)
{
    static char answer[STATUS_ANSWER_MAX];
    ssize_t length = status_ask(run_dir, PATIENCE_MS, answer);
    struct json_tokener *tokener;
    struct json_object *status = NULL;

    if (length < 0) {
        *error = (int)-length;
        return NULL;
    }
    tokener = json_tokener_new();
    if (tokener != NULL) {
        status = json_tokener_parse_ex(tokener, answer, (int)length);
        json_tokener_free(tokener);
    }
    if (!json_object_is_type(status, json_type_object)) {
        json_object_put(status);
        *error = EBADMSG;
        return NULL;
    }
    odidctl_json_clean(status);
    return status;
}

static const char armed_text[] = "The aircraft is armed";
static const char unknown_text[] =
    "Whether the aircraft is armed isn't known, for the daemon doesn't answer";

bool odidctl_says_armed(struct json_object *status)
{
    struct json_object *aircraft = json_object_object_get(status, "aircraft");

    return json_object_get_boolean(json_object_object_get(aircraft, "armed"));
}

/* It may be about to start again. *armed: what it says itself, too. */
static bool answers(const char *run_dir, bool *armed)
{
    const struct timespec pause = {.tv_nsec = 100000000};
    struct json_object *status;
    int error = 0;

    for (int tries = 0; tries < TRIES; tries++) {
        status = odidctl_fetch(run_dir, &error);
        if (status != NULL) {
            *armed = odidctl_says_armed(status);
            json_object_put(status);
            return true;
        }
        if (error != ENOENT && error != ECONNREFUSED) {
            return false;
        }
        nanosleep(&pause, NULL);
    }
    return false;
}

/* Read again after the answer: a daemon that starts late may have something else to say. */
static const char *not_disarmed(const char *run_dir, struct kept *kept)
{
    bool armed = false;

    if (kept_read(run_dir, kept) == 0 && kept->armed == KEPT_ARMED) {
        return armed_text;
    }
    if (!answers(run_dir, &armed)) {
        return unknown_text;
    }
    if (kept_read(run_dir, kept) < 0) {
        return armed ? armed_text : unknown_text;
    }
    return armed || kept->armed == KEPT_ARMED ? armed_text : NULL;
}

const char *odidctl_not_disarmed(const struct odidctl_places *places)
{
    struct kept kept;

    return not_disarmed(places->run_dir, &kept);
}

int odidctl_tell_armed(const struct odidctl_places *places)
{
    struct kept kept;
    const char *why = not_disarmed(places->run_dir, &kept);

    printf("%s %s %u\n",
           why == NULL         ? "disarmed"
           : why == armed_text ? "armed"
                               : "unknown",
           kept.armed_once ? "once" : "never", kept.vehicle);
    return why == NULL ? ODIDCTL_NOT_GOOD : ODIDCTL_GOOD;
}

/* ---- showing ---- */

int odidctl_status(const struct odidctl_places *places, bool json)
{
    int error = 0;
    struct json_object *faults = odidctl_faults(places->faults);
    struct json_object *status = odidctl_fetch(places->run_dir, &error);
    bool on_air;

    if (status == NULL) {
        say_no_answer(places->run_dir, error);
        odidctl_table_faults(stderr, faults, isatty(STDERR_FILENO));
        json_object_put(faults);
        return ODIDCTL_NO_ANSWER;
    }
    json_object_object_add(status, "appliance_faults", faults);
    odidctl_add_update(places, status);
    if (json) {
        puts(json_object_to_json_string_ext(status,
                                            JSON_C_TO_STRING_PRETTY | JSON_C_TO_STRING_SPACED));
    } else {
        odidctl_table(stdout, status, isatty(STDOUT_FILENO));
    }
    on_air = json_object_get_boolean(json_object_object_get(status, "on_air"));
    json_object_put(status);
    return on_air ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}

/* Ends by Ctrl-C, or when nobody reads any more. */
int odidctl_watch(const struct odidctl_places *places)
{
    const struct timespec second = {.tv_sec = 1};
    bool terminal = isatty(STDOUT_FILENO);
    static char page[16384];

    setvbuf(stdout, page, _IOFBF, sizeof(page)); /* a page appears at once, without flicker */
    while (!ferror(stdout)) {
        if (terminal) {
            fputs("\033[H\033[2J", stdout);
            fflush(stdout);
        }
        odidctl_status(places, false);
        fputs(terminal ? "\nCtrl-C ends this.\n" : "\n", stdout);
        fflush(stdout);
        nanosleep(&second, NULL);
    }
    return ODIDCTL_NOT_GOOD;
}
