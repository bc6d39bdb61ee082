/*
 * UTF-8, as far as texts that came from outside need it: shown, counted and
 * cut without breaking a character.
 *
 * Pure.
 */
#ifndef ODID_UTF8_H
#define ODID_UTF8_H

#include <stdbool.h>
#include <stddef.h>

/* Bytes (1-4) of the character that begins at text; 0 when there is none that is valid. */
size_t utf8_character(const char *text);

/* Number of characters; a byte that is no UTF-8 counts as one. */
size_t utf8_count(const char *text);

/* The longest length, at most max bytes, at which text can be cut between two characters. */
size_t utf8_cut(const char *text, size_t max);

/*
 * Copies as much of text as fits between two characters. Control characters
 * and bytes that are no UTF-8 become '?'. Returns how many did.
 */
size_t utf8_clean(char *out, size_t size, const char *text);

#endif
