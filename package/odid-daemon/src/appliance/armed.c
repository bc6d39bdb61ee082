#include "appliance/armed.h"

#include <errno.h>
#include <time.h>

#include "appliance/status_fetch.h"

#define TRIES 20 /* two seconds */

bool armed_says(struct json_object *status)
{
    struct json_object *aircraft = json_object_object_get(status, "aircraft");

    return json_object_get_boolean(json_object_object_get(aircraft, "armed"));
}

enum armed armed_by(struct json_object *status, const struct kept *kept)
{
    if ((kept != NULL && kept->armed == KEPT_ARMED) || armed_says(status)) {
        return ARMED_YES;
    }
    if (kept == NULL || status == NULL) {
        return ARMED_UNKNOWN;
    }
    return kept->armed == KEPT_UNSAID ? ARMED_UNSAID
           : kept_is_silent(kept)     ? ARMED_SILENT
                                      : ARMED_NO;
}

/* It may be about to start again. NULL: it doesn't answer. */
static struct json_object *await_status(const char *run_dir)
{
    const struct timespec pause = {.tv_nsec = 100000000};
    struct json_object *status;
    int error = 0;

    for (int tries = 0; tries < TRIES; tries++) {
        status = status_fetch(run_dir, &error);
        if (status != NULL || (error != ENOENT && error != ECONNREFUSED)) {
            return status;
        }
        nanosleep(&pause, NULL);
    }
    return NULL;
}

enum armed armed_look(const char *run_dir, struct kept *kept)
{
    struct json_object *status;
    enum armed armed;

    if (kept_read(run_dir, kept) == 0 && kept->armed == KEPT_ARMED) {
        return ARMED_YES;
    }
    status = await_status(run_dir);
    if (status == NULL) {
        return ARMED_UNKNOWN;
    }
    /* Read again: a daemon that starts late may have something else to say. */
    armed = armed_by(status, kept_read(run_dir, kept) == 0 ? kept : NULL);
    json_object_put(status);
    return armed;
}

const char *armed_not_disarmed(const struct places *places)
{
    static const char *const sentences[] = {
        [ARMED_UNKNOWN] =
            "Whether the aircraft is armed isn't known, for the daemon doesn't answer",
        [ARMED_YES] = "The aircraft is armed",
        [ARMED_UNSAID] =
            "Whether the aircraft is armed isn't known, for no HEARTBEAT comes that says it",
        [ARMED_SILENT] = NULL,
        [ARMED_NO] = NULL};
    struct kept kept;

    return sentences[armed_look(places->run_dir, &kept)];
}
