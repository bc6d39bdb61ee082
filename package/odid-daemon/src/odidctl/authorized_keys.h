/*
 * Judges the keys with which one may log in: authorized_keys, as dropbear
 * takes it, without options.
 *
 * Pure.
 */
#ifndef ODID_AUTHORIZED_KEYS_H
#define ODID_AUTHORIZED_KEYS_H

#include <stddef.h>

/* Receives what is wrong, in plain words; no part of a line is quoted but a name. */
typedef void authorized_keys_report_fn(void *context, unsigned line, const char *sentence);

struct authorized_keys {
    unsigned keys, comments, errors;
};

/*
 * Reads a text with a NUL byte behind it, any line ends, in place: afterwards
 * each line ends with LF, *length is its new length.
 */
struct authorized_keys authorized_keys_read(char *text, size_t *length,
                                            authorized_keys_report_fn *report, void *context);

#endif
