/* One value of the configuration in force. */
#ifndef ODID_SETTINGS_H
#define ODID_SETTINGS_H

#include "appliance/exits.h"
#include "appliance/places.h"

/* names: SECTION.KEY each, ended by NULL. Prints nothing when there is an unknown one. */
int settings_get(const struct places *places, char *const names[]);

/* value is cleared once it was read: it lies open in the process list. */
int settings_set(const struct places *places, const char *name, char *value);

#endif
