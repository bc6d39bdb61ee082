/*
 * What SWUpdate says it does: its two sockets, by libswupdate. The sockets are
 * where $TMPDIR says. One SWUpdate, one process: there is one installer.
 */
#ifndef ODID_UPDATE_INSTALLER_H
#define ODID_UPDATE_INSTALLER_H

#include <stdbool.h>
#include <stdint.h>

/* Who gave it the bundle, as far as it has said so. */
enum update_source {
    UPDATE_SOURCE_UNKNOWN,
    UPDATE_SOURCE_SERVER, /* its own hawkBit client */
    UPDATE_SOURCE_OTHER,
};

struct update_installer_calls {
    void (*begins)(int64_t now_us);
    void (*source)(enum update_source source); /* after that, and when it is another one */
    void (*progress)(int percent, int64_t now_us);
    /* why: what went wrong, a sentence; empty when it is installed. */
    void (*ends)(const char *why, int64_t now_us);
    /* SWUpdate ended; installing: in the middle of an install, of which ends was told. */
    void (*lost)(bool installing, int64_t now_us);
};

/*
 * Within loop.h's loop; connects by itself, again and again. from_the_start: nobody has watched
 * before; else what the first SWUpdate says of an install that has ended is old.
 */
void update_installer_watch(const struct update_installer_calls *calls, bool from_the_start);

/* Did nobody ask for what it installs? For the gate: what SWUpdate said before it asked is read
 * first. Who wasn't heard to begin counts as one whom nobody asked. */
bool update_installer_is_unattended(int64_t now_us);

/* Ends SWUpdate at once, whoever supervises it now. pid_file: its number and its start, as
 * take_over (overlay/lib/odid/functions) wrote them. Returns 0 or -errno; -ESRCH: it has ended. */
int update_installer_end(const char *pid_file);

/* What SWUpdate's complaints (the first one counts) mean to a technician. hardware: this board's.
 */
void update_installer_explain(const char *complaint, const char *hardware, char *out,
                              unsigned long size);

#endif
