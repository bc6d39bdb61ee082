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

enum import_before {
    IMPORT_NEW,  /* another text, or nothing, was put there */
    IMPORT_KEPT, /* just this one was, and something sound is there still */
    IMPORT_LOST, /* of what was put there, or set there since, a damaged disk has left nothing */
};

/* What was there before this text is put there. */
enum import_before import_look(const char *path, const char *text, size_t length);

/* Puts it there. Returns 0, or -errno. */
int import_keep(const char *path, const char *text, size_t length, mode_t mode);

#endif
