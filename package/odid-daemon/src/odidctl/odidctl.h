/* odidctl's commands, a file each, and what they share. */
#ifndef ODID_ODIDCTL_H
#define ODID_ODIDCTL_H

#include <json-c/json_object.h>
#include <stdbool.h>

#include "appliance/exits.h"
#include "appliance/places.h"

/* ---- status, watch ---- */

int odidctl_status(const struct places *places, bool json);
int odidctl_watch(const struct places *places);

/* Who else on this computer disturbs Remote ID (doctor.h). */
int odidctl_doctor(const struct places *places);

/* The same as status for scripts, in three words: "armed", "disarmed" or "unknown"; "once" or
 * "never" armed since power-on; the vehicle's MAVLink system id, 0 while there is none. */
int odidctl_tell_armed(const struct places *places);

/* For scripts: a line for each radio's interface that is configured, its name; "on-air", "stuck" or
 * "off"; and for how many seconds it has been on the air. Prints nothing where nobody answers. */
int odidctl_radios(const struct places *places);

/* ---- maintenance ---- */

int odidctl_maintenance(const struct places *places, const char *word);

/* ---- the autopilot's port ---- */

/* Prints the port on which an autopilot speaks, of those named (ended by NULL); exit 1: none does.
 * seconds: 0 listens for ever (autopilot_find.h). */
int odidctl_find_autopilot(const char *baud, const char *seconds, char *const ports[]);

/* ---- update ---- */

/* Adds "update" (how it stands) and "last_update" to the status; null where nothing is known. */
void odidctl_add_update(const struct places *places, struct json_object *status);

/* Installs the bundle of that file or URL, or a folder's newest; "cancel" calls it off; NULL: how
 * the update stands, and the last result. */
int odidctl_update(const struct places *places, const char *name);

/* Unless armed: leaves a mark for the boot scripts, and restarts the board. */
int odidctl_factory_reset(const struct places *places);

/* ---- import ---- */

int odidctl_import(const struct places *places, const char *directory);

/* Would all that is there be taken over, and is an odid.conf among it? Says so, or the first of
 * what is wrong. */
int odidctl_import_check(const char *directory);

#endif
