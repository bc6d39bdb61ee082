/* The configuration in force, value by value. */
#ifndef ODID_SETTINGS_H
#define ODID_SETTINGS_H

#include "appliance/exits.h"
#include "appliance/places.h"

/* names: SECTION.KEY each, ended by NULL. Prints nothing when there is an unknown one. */
int settings_get(const struct places *places, char *const names[]);

/* value is cleared once it was read: it lies open in the process list. */
int settings_set(const struct places *places, const char *name, char *value);

/* Does odid-daemon run with what the file has for it? ODIDCTL_NOT_GOOD also where nobody can say.
 */
int settings_in_force(const struct places *places);

/* What was set is lost: a fault at each power-on (the boot script S40config) until somebody saves
 * settings. Returns 0, or -errno. */
int settings_mark_lost(const struct places *places);

#endif
