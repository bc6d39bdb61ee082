/* odidctl's commands, a file each, and what they share. */
#ifndef ODID_ODIDCTL_H
#define ODID_ODIDCTL_H

#include <json-c/json_object.h>
#include <stdbool.h>
#include <stddef.h>

enum odidctl_exit {
    ODIDCTL_GOOD = 0,
    ODIDCTL_NOT_GOOD = 1,
    ODIDCTL_USAGE = 2,
    ODIDCTL_NO_ANSWER = 3,
    ODIDCTL_HALF_DONE = 4, /* it counts, but something about it could not be done; said */
};

#define ODIDCTL_PATH_SIZE 300

/* Where everything is; other places are for tests. */
struct odidctl_places {
    const char *run_dir; /* the daemon's status socket: /run/odid */
    const char *data;    /* what outlasts power-off: /data */
    const char *faults;  /* a file for each fault of the appliance: /run/faults */
    const char *state;   /* the appliance's state: /run/odid-appliance */
    const char *apply;   /* makes a changed configuration count: /lib/odid/apply-configuration */
    const char *config;  /* the configuration file; NULL: data's */
};

/* data's odid/odid.conf, or the file that was named. */
void odidctl_config_path(const struct odidctl_places *places, char path[ODIDCTL_PATH_SIZE]);

/* ---- status, watch ---- */

int odidctl_status(const struct odidctl_places *places, bool json);
int odidctl_watch(const struct odidctl_places *places);

/* The daemon's status, or NULL with *error set. The caller puts it back. */
struct json_object *odidctl_fetch(const char *run_dir, int *error);

/* What the daemon itself says in that; NULL says nothing. */
bool odidctl_says_armed(struct json_object *status);

/*
 * NULL when the aircraft is disarmed; else why that can't be said, for people: to
 * begin a sentence. By what the daemon keeps (kept.h): one that was lost after
 * arming is armed, one never heard since power-on isn't. A daemon that gives no
 * answer for two seconds never says disarmed.
 */
const char *odidctl_not_disarmed(const struct odidctl_places *places);

/* The same for scripts, in three words: "armed", "disarmed" or "unknown"; "once" or "never" armed
 * since power-on; the vehicle's MAVLink system id, 0 while there is none. */
int odidctl_tell_armed(const struct odidctl_places *places);

/* ---- faults of the appliance ---- */

/* Array of {"name", "sentence"}, by name. */
struct json_object *odidctl_faults(const char *directory);

/* Makes the fault's file, or removes it when sentence is NULL. What fails is logged. */
void odidctl_set_fault(const char *directory, const char *name, const char *sentence);

/* ---- what something has done ---- */

/* All that is wrong now: array of sentences, the appliance's faults and the daemon's. The caller
 * puts it back. */
struct json_object *odidctl_wrong(const struct odidctl_places *places);

/* What is wrong and wasn't before, once what was started again has had its time: a second if
 * nothing is, fifteen otherwise. out: a sentence, or "". */
void odidctl_wrong_since(const struct odidctl_places *places, struct json_object *before, char *out,
                         size_t size);

/* ---- get, set ---- */

/* names: SECTION.KEY each, ended by NULL. Prints nothing when there is an unknown one. */
int odidctl_get(const struct odidctl_places *places, char *const names[]);

/* value is cleared once it was read: it lies open in the process list. */
int odidctl_set(const struct odidctl_places *places, const char *name, char *value);

/* ---- maintenance ---- */

int odidctl_maintenance(const struct odidctl_places *places, const char *word);

/*
 * Makes the access point's key of the password and keeps it; empty: removes
 * it (the board then makes one of its own at the next import). Returns 0, -ENOSYS (see
 * maintenance_key) or another -errno.
 */
int odidctl_keep_password(const char *data, const char *password);

bool odidctl_password_known(const char *data);

/* Is it the password that the key was made of? 1 or 0; -ENOENT when none was ever set, -errno. */
int odidctl_check_password(const char *data, const char *password);

/*
 * Overwrites a file on the volume, that holds the old text, with the one in
 * which the password's lines are blanked (config_edit_take_password); both are
 * of this length. Returns 0, or -errno.
 */
int odidctl_blank_password(const char *path, const char *old, const char *blanked, size_t length);

#define ODIDCTL_PASSWORD_NAME "maintenance-password.txt"

/*
 * Makes a password where none is known, and keeps ODIDCTL_PASSWORD_NAME in the
 * directory (the volume CONFIG) right: there with the password that the board
 * made, *made set; or gone. Returns 0, or -errno: of the directory with *made
 * set, else of data.
 */
int odidctl_show_made_password(const char *data, const char *directory, bool *made);

/* ---- the autopilot's port ---- */

/* Prints the port on which an autopilot speaks, of those named (ended by NULL); exit 1: none does.
 * seconds: 0 listens for ever (autopilot_find.h). */
int odidctl_find_autopilot(const char *baud, const char *seconds, char *const ports[]);

/* ---- update ---- */

/* Adds "update" (how it stands) and "last_update" to the status; null where nothing is known. */
void odidctl_add_update(const struct odidctl_places *places, struct json_object *status);

/* Installs the bundle of that file or URL, or a folder's newest; "cancel" calls it off; NULL: how
 * the update stands, and the last result. */
int odidctl_update(const struct odidctl_places *places, const char *name);

/* Unless armed: leaves a mark for the boot scripts, and restarts the board. */
int odidctl_factory_reset(const struct odidctl_places *places);

/* ---- import ---- */

int odidctl_import(const struct odidctl_places *places, const char *directory);

/* Would all that is there be taken over, and is an odid.conf among it? Says so, or the first of
 * what is wrong. */
int odidctl_import_check(const char *directory);

#endif
