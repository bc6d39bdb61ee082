/* The maintenance password, and the access point's key that is made of it. */
#ifndef ODID_PASSWORD_H
#define ODID_PASSWORD_H

#include <stdbool.h>
#include <stddef.h>

/*
 * Makes the access point's key of the password and keeps it; empty: removes
 * it (the board then makes one of its own at the next import). Returns 0, -ENOSYS (see
 * maintenance_key) or another -errno.
 */
int password_keep(const char *data, const char *password);

bool password_known(const char *data);

/* Is it the password that the key was made of? 1 or 0; -ENOENT when none was ever set, -errno. */
int password_check(const char *data, const char *password);

/*
 * Overwrites a file on the volume, that holds the old text, with the one in
 * which the password's lines are blanked (config_edit_take_password); both are
 * of this length. Returns 0, or -errno.
 */
int password_blank(const char *path, const char *old, const char *blanked, size_t length);

#define PASSWORD_NAME "maintenance-password.txt"

/*
 * Makes a password where none is known, and keeps PASSWORD_NAME in the
 * directory (the volume CONFIG) right: there with the password that the board
 * made, *made set; or gone. Returns 0, or -errno: of the directory with *made
 * set, else of data.
 */
int password_show_made(const char *data, const char *directory, bool *made);

#endif
