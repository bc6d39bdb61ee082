/* odidctl factory-reset: back to what the volume CONFIG says. */
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "base/whole_file.h"
#include "odidctl/odidctl.h"

/* In data; a boot script sees it, and does it over again when power fails meanwhile. */
#define MARK "odid/factory-reset"

/* By init's order for it; what isn't an appliance is left alone. */
static bool restart(const struct places *places)
{
    char path[PLACES_PATH_SIZE];

    snprintf(path, sizeof(path), "%s/slot", places->state);
    return access(path, F_OK) == 0 && kill(1, SIGTERM) == 0;
}

int odidctl_factory_reset(const struct places *places)
{
    static const char text[] = "asked for by odidctl\n";
    char path[PLACES_PATH_SIZE];
    const char *why;
    int result;

    why = armed_not_disarmed(places);
    if (why != NULL) {
        fprintf(stderr, "odidctl: %s: no factory reset.\n", why);
        return ODIDCTL_NOT_GOOD;
    }
    if (places_data_in_memory(places)) { /* the mark would be gone with it */
        fputs("odidctl: /data is in memory: no factory reset before it is repaired (odidctl "
              "faults).\n",
              stderr);
        return ODIDCTL_NOT_GOOD;
    }
    snprintf(path, sizeof(path), "%s/" MARK, places->data);
    result = whole_file_replace(path, text, strlen(text), 0644);
    why = armed_not_disarmed(places); /* a slow disk has taken its time */
    if (result < 0 || why != NULL) {
        int removed = whole_file_remove(path);

        if (result < 0) {
            fprintf(stderr, "odidctl: %s: %s", path, strerror(-result));
        } else {
            fprintf(stderr, "odidctl: %s: no factory reset", why);
        }
        fputs(removed == 0 ? "; nothing has changed.\n"
                           : "; but the next start may make one, for it can't be called off.\n",
              stderr);
        return ODIDCTL_NOT_GOOD;
    }
    puts("At its next start the board forgets its settings, passwords and keys, and takes over "
         "what\n"
         "the volume CONFIG has. Flight records stay.");
    fflush(stdout);
    if (!restart(places)) {
        fputs("odidctl: the board can't be restarted: switch power off and on.\n", stderr);
        return ODIDCTL_HALF_DONE;
    }
    return ODIDCTL_GOOD;
}
