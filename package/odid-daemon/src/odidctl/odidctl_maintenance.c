/* odidctl maintenance: asks for it, or ends it. */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "appliance/appliance_marks.h"
#include "appliance/armed.h"
#include "appliance/password.h"
#include "odidctl/odidctl.h"

/* The service "maintenance" looks for the file every other second. */
int odidctl_maintenance(const struct places *places, const char *word)
{
    char path[PLACES_PATH_SIZE];
    bool on = strcmp(word, "on") == 0;
    const char *why;
    int fd;

    snprintf(path, sizeof(path), "%s/" APPLIANCE_MAINTENANCE, places->state);
    if (!on) {
        if (unlink(path) < 0 && errno != ENOENT) {
            fprintf(stderr, "odidctl: maintenance can't be ended: %s: %s\n", path, strerror(errno));
            return ODIDCTL_NOT_GOOD;
        }
        puts(
            "Maintenance ends, unless [maintenance] at_boot keeps it until the aircraft is armed.");
        return ODIDCTL_GOOD;
    }
    why = armed_not_disarmed(places);
    if (why != NULL) {
        fprintf(stderr, "odidctl: %s: no maintenance.\n", why);
        return ODIDCTL_NOT_GOOD;
    }
    fd = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (fd < 0) {
        fprintf(stderr, "odidctl: can't ask for maintenance: %s: %s\n", path, strerror(errno));
        return ODIDCTL_NOT_GOOD;
    }
    close(fd);
    puts("Maintenance begins within seconds, and ends when the aircraft is armed.");
    if (!password_known(places->data)) {
        fputs(
            "odidctl: no [maintenance] password was ever set: nobody can join the access point.\n",
            stderr);
        return ODIDCTL_HALF_DONE;
    }
    return ODIDCTL_GOOD;
}
