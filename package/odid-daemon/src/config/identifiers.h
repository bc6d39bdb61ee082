/*
 * Formats of the identifiers that Remote ID broadcasts.
 *
 * Pure: no I/O, no clock, no allocation. A wrong identifier is reported and
 * still broadcast (silence in the air is worse); these functions only judge.
 */
#ifndef ODID_IDENTIFIERS_H
#define ODID_IDENTIFIERS_H

#include <stdbool.h>
#include <stddef.h>

/* Longest identifier on the air, ASTM F3411 Basic ID and Operator ID, bytes. */
#define IDENTIFIER_MAX 20
/* Longest explanation written by the checks, with its terminator, bytes. */
#define IDENTIFIER_PROBLEM_SIZE 96

/*
 * Aircraft serial number, ANSI/CTA-2063-A: 4-character manufacturer code, one
 * length code (1-9, A-F), then exactly that many characters; digits and
 * capital letters without O and I throughout.
 *
 * Returns true when valid. Otherwise problem says in plain words which
 * character or length is wrong and what was expected.
 */
bool identifiers_check_serial(const char *serial, char problem[IDENTIFIER_PROBLEM_SIZE]);

/* What could be said about an EU operator registration number. */
enum operator_number_verdict {
    OPERATOR_NUMBER_VALID,      /* check character matches the secret part given with it */
    OPERATOR_NUMBER_UNVERIFIED, /* structure right; without the secret part no more can be said */
    OPERATOR_NUMBER_INVALID,    /* problem says why */
};

/*
 * EU operator registration number: 3-letter country code, 12 characters, 1
 * check character, optionally "-" and 3 secret characters. The check character
 * is Luhn mod 36 over the 12 characters followed by the 3 secret ones (EASA;
 * published example FIN87astrdge12k8-xyz).
 *
 * given: as the operator wrote it, with or without the secret part.
 * public_part: receives what may be stored, logged and broadcast: the first 16
 * characters when they look like a number, whatever follows them; else
 * everything before the first "-", cut to IDENTIFIER_MAX characters. The
 * secret part is never copied anywhere, and problem never quotes it.
 */
enum operator_number_verdict identifiers_check_operator(const char *given,
                                                        char public_part[IDENTIFIER_MAX + 1],
                                                        char problem[IDENTIFIER_PROBLEM_SIZE]);

/*
 * Does it begin with a country that registers operators by the EU's rules: its members, and
 * Iceland, Liechtenstein, Norway and Switzerland (ISO 3166-1, three letters)?
 */
bool identifiers_known_country(const char *operator_id);

/*
 * Removes, in place, the secret part of every operator number that stands
 * somewhere in a text where it doesn't belong. Returns true when there was one.
 */
bool identifiers_remove_secrets(char *text);

#endif
