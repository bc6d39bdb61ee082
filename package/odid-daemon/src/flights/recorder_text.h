/*
 * A flight record's text, within a bound. When it gets too long, lines that
 * later ones replace go first, then the oldest events; how many went is said
 * in the text itself. Pure.
 */
#ifndef ODID_RECORDER_TEXT_H
#define ODID_RECORDER_TEXT_H

#include <stdbool.h>
#include <stddef.h>

/* A record never gets longer than this. */
#define RECORDER_TEXT_MAX 65536

struct recorder_text {
    size_t length;
    size_t stored;    /* how much of it is in the file */
    bool changed;     /* that part isn't the same any more: the file has to be written anew */
    unsigned dropped; /* events that went, altogether */
    char bytes[RECORDER_TEXT_MAX];
};

/* Appends a line, given without its newline. */
void recorder_text_add(struct recorder_text *text, const char *line);

/* Takes over what a file holds; what is behind its last whole line is cut off. */
void recorder_text_load(struct recorder_text *text, const char *bytes, size_t length);

#endif
