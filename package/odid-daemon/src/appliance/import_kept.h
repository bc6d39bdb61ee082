/*
 * What was imported, and whether it was already: a file that hasn't changed
 * since is left alone, so that what was set in the meantime stays. PATH.imported
 * beside it says what it was made of.
 */
#ifndef ODID_IMPORT_KEPT_H
#define ODID_IMPORT_KEPT_H

#include <stdbool.h>
#include <stddef.h>
#include <sys/types.h>

/* Can the file be read, and is it a text as one that was put there? */
bool import_sound(const char *path);

/* Was just this text put there, and is something sound there still? */
bool import_kept(const char *path, const char *text, size_t length);

/* Puts it there. Returns 0, or -errno. */
int import_keep(const char *path, const char *text, size_t length, mode_t mode);

#endif
