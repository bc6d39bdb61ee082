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

/* It may be about to start again. *armed: what it says itself, too. */
static bool answers(const char *run_dir, bool *armed)
{
    const struct timespec pause = {.tv_nsec = 100000000};
    struct json_object *status;
    int error = 0;

    for (int tries = 0; tries < TRIES; tries++) {
        status = status_fetch(run_dir, &error);
        if (status != NULL) {
            *armed = armed_says(status);
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
enum armed armed_look(const char *run_dir, struct kept *kept)
{
    bool armed = false;

    if (kept_read(run_dir, kept) == 0 && kept->armed == KEPT_ARMED) {
        return ARMED_YES;
    }
    if (!answers(run_dir, &armed)) {
        return ARMED_UNKNOWN;
    }
    if (kept_read(run_dir, kept) < 0) {
        return armed ? ARMED_YES : ARMED_UNKNOWN;
    }
    return armed || kept->armed == KEPT_ARMED ? ARMED_YES
           : kept->armed == KEPT_UNSAID       ? ARMED_UNSAID
                                              : ARMED_NO;
}

const char *armed_not_disarmed(const struct places *places)
{
    static const char *const sentences[] = {
        [ARMED_NO] = NULL,
        [ARMED_YES] = "The aircraft is armed",
        [ARMED_UNKNOWN] =
            "Whether the aircraft is armed isn't known, for the daemon doesn't answer",
        [ARMED_UNSAID] =
            "Whether the aircraft is armed isn't known, for no HEARTBEAT comes that says it"};
    struct kept kept;

    return sentences[armed_look(places->run_dir, &kept)];
}
