#include "config/identifiers.h"

#include <stdio.h>
#include <string.h>

/* CTA-2063-A: manufacturer code and length code come before the characters that are counted. */
#define SERIAL_MANUFACTURER 4
#define SERIAL_HEAD (SERIAL_MANUFACTURER + 1)

/* EU operator number. */
#define OPERATOR_COUNTRY 3
#define OPERATOR_CODE 12
#define OPERATOR_PUBLIC (OPERATOR_COUNTRY + OPERATOR_CODE + 1)
#define OPERATOR_SECRET 3

/* Not <ctype.h>: it asks the locale, and these alphabets are fixed. */
static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static bool is_capital(char c)
{
    return c >= 'A' && c <= 'Z';
}

static bool is_small(char c)
{
    return c >= 'a' && c <= 'z';
}

static bool is_serial_character(char c)
{
    return is_digit(c) || (is_capital(c) && c != 'O' && c != 'I');
}

static bool is_code_character(char c)
{
    return is_digit(c) || is_small(c);
}

/* "character 5 is "G": expected ..." ; position counts from 1. */
static bool wrong_character(char *problem, size_t position, char c, const char *expected)
{
    char shown[8];

    if (c >= ' ' && c <= '~') {
        snprintf(shown, sizeof(shown), "\"%c\"", c);
    } else {
        snprintf(shown, sizeof(shown), "0x%02X", (unsigned)(unsigned char)c);
    }
    snprintf(problem, IDENTIFIER_PROBLEM_SIZE, "character %zu is %s: expected %s", position, shown,
             expected);
    return false;
}

/* ---- aircraft serial number ---- */

/* The number that a length code stands for, 0 for none. */
static size_t length_code(char c)
{
    if (c >= '1' && c <= '9') {
        return (size_t)(c - '0');
    }
    return c >= 'A' && c <= 'F' ? (size_t)(c - 'A' + 10) : 0;
}

bool identifiers_check_serial(const char *serial, char problem[IDENTIFIER_PROBLEM_SIZE])
{
    size_t length = strlen(serial), announced;

    problem[0] = '\0';
    for (size_t i = 0; i < length; i++) {
        if (i == SERIAL_MANUFACTURER) {
            if (length_code(serial[i]) == 0) {
                return wrong_character(problem, i + 1, serial[i], "a length code, 1-9 or A-F");
            }
        } else if (!is_serial_character(serial[i])) {
            return wrong_character(problem, i + 1, serial[i], "0-9 or A-Z without O and I");
        }
    }
    if (length <= SERIAL_HEAD) {
        snprintf(problem, IDENTIFIER_PROBLEM_SIZE, "%zu characters are too few: expected 6 to 20",
                 length);
        return false;
    }
    announced = length_code(serial[SERIAL_MANUFACTURER]);
    if (length - SERIAL_HEAD != announced) {
        snprintf(problem, IDENTIFIER_PROBLEM_SIZE,
                 "length code \"%c\" announces %zu characters, %zu follow",
                 serial[SERIAL_MANUFACTURER], announced, length - SERIAL_HEAD);
        return false;
    }
    return true;
}

/* ---- EU operator number ---- */

/* A hyphen, or what a word processor makes of one (U+2010 to U+2015, U+2212). */
static bool is_dash(const char *at)
{
    return at[0] == '-' ||
           (strncmp(at, "\xE2\x80", 2) == 0 && at[2] >= '\x90' && at[2] <= '\x95') ||
           strncmp(at, "\xE2\x88\x92", 3) == 0;
}

/* Does it begin with three letters and 13 letters or digits, right or wrong in other ways? */
static bool begins_like_a_number(const char *given)
{
    for (size_t i = 0; i < OPERATOR_PUBLIC; i++) {
        bool letter = is_capital(given[i]) || is_small(given[i]);

        if (!letter && (i < OPERATOR_COUNTRY || !is_digit(given[i]))) {
            return false;
        }
    }
    return true;
}

/*
 * How many bytes may be shown. After 16 characters that look like a number
 * nothing more is public, whether a hyphen, a blank or nothing stands between.
 */
static size_t public_length(const char *given)
{
    size_t length = 0;

    if (begins_like_a_number(given)) {
        return OPERATOR_PUBLIC;
    }
    while (length < IDENTIFIER_MAX && given[length] != '\0' && !is_dash(given + length)) {
        length++;
    }
    while (length > 0 && given[length - 1] == ' ') {
        length--;
    }
    return length;
}

static bool check_public(const char *public_part, char *problem)
{
    size_t length = strlen(public_part);

    for (size_t i = 0; i < length; i++) {
        if (i < OPERATOR_COUNTRY && !is_capital(public_part[i])) {
            return wrong_character(problem, i + 1, public_part[i],
                                   "a capital letter of the country code");
        }
        if (i >= OPERATOR_COUNTRY && !is_code_character(public_part[i])) {
            return wrong_character(problem, i + 1, public_part[i], "a digit or a small letter");
        }
    }
    if (length != OPERATOR_PUBLIC) {
        snprintf(problem, IDENTIFIER_PROBLEM_SIZE,
                 "%zu characters instead of 16 (country code, 12, check character)", length);
        return false;
    }
    return true;
}

/* What follows the public part; nothing of it is quoted. */
static bool check_secret(const char *rest, char *problem)
{
    size_t length;

    if (rest[0] != '-') {
        snprintf(problem, IDENTIFIER_PROBLEM_SIZE,
                 "after 16 characters only \"-\" and 3 secret characters may follow");
        return false;
    }
    length = strlen(rest + 1);
    if (length != OPERATOR_SECRET) {
        snprintf(problem, IDENTIFIER_PROBLEM_SIZE, "%zu secret characters after \"-\" instead of 3",
                 length);
        return false;
    }
    for (size_t i = 1; i <= OPERATOR_SECRET; i++) {
        if (!is_code_character(rest[i])) {
            snprintf(problem, IDENTIFIER_PROBLEM_SIZE,
                     "secret character %zu is neither a digit nor a small letter", i);
            return false;
        }
    }
    return true;
}

/* Luhn mod 36: every second character, counted from the last, is doubled. */
static char check_character(const char *code, const char *secret)
{
    static const char alphabet[] = "0123456789abcdefghijklmnopqrstuvwxyz";
    unsigned sum = 0;

    for (size_t i = 0; i < OPERATOR_CODE + OPERATOR_SECRET; i++) {
        char c = i < OPERATOR_CODE ? code[i] : secret[i - OPERATOR_CODE];
        unsigned value = is_digit(c) ? (unsigned)(c - '0') : (unsigned)(c - 'a') + 10;

        if ((OPERATOR_CODE + OPERATOR_SECRET - i) % 2 == 1) {
            value *= 2;
        }
        sum += value / 36 + value % 36;
    }
    return alphabet[(36 - sum % 36) % 36];
}

bool identifiers_known_country(const char *operator_id)
{
    static const char countries[][OPERATOR_COUNTRY + 1] = {
        "AUT", "BEL", "BGR", "CHE", "CYP", "CZE", "DEU", "DNK", "ESP", "EST", "FIN",
        "FRA", "GRC", "HRV", "HUN", "IRL", "ISL", "ITA", "LIE", "LTU", "LUX", "LVA",
        "MLT", "NLD", "NOR", "POL", "PRT", "ROU", "SVK", "SVN", "SWE"};

    for (size_t i = 0; i < sizeof(countries) / sizeof(countries[0]); i++) {
        if (strncmp(operator_id, countries[i], OPERATOR_COUNTRY) == 0) {
            return true;
        }
    }
    return false;
}

enum operator_number_verdict identifiers_check_operator(const char *given,
                                                        char public_part[IDENTIFIER_MAX + 1],
                                                        char problem[IDENTIFIER_PROBLEM_SIZE])
{
    size_t length = public_length(given);
    const char *rest = given + length;

    problem[0] = '\0';
    memcpy(public_part, given, length);
    public_part[length] = '\0';
    if (!check_public(public_part, problem)) {
        return OPERATOR_NUMBER_INVALID;
    }
    if (rest[0] == '\0') {
        return OPERATOR_NUMBER_UNVERIFIED;
    }
    if (!check_secret(rest, problem)) {
        return OPERATOR_NUMBER_INVALID;
    }
    if (check_character(given + OPERATOR_COUNTRY, rest + 1) != given[OPERATOR_PUBLIC - 1]) {
        snprintf(problem, IDENTIFIER_PROBLEM_SIZE,
                 "check character \"%c\" does not fit the others: one of them is mistyped",
                 given[OPERATOR_PUBLIC - 1]);
        return OPERATOR_NUMBER_INVALID;
    }
    return OPERATOR_NUMBER_VALID;
}

/* ---- a number in the wrong place ---- */

static bool is_alphanumeric(char c)
{
    return is_digit(c) || is_capital(c) || is_small(c);
}

/* Words of 16 letters exist: without a digit only the proper form counts as a number. */
static bool is_number_in_text(const char *text)
{
    char public_part[OPERATOR_PUBLIC + 1], problem[IDENTIFIER_PROBLEM_SIZE];

    if (!begins_like_a_number(text)) {
        return false;
    }
    memcpy(public_part, text, OPERATOR_PUBLIC);
    public_part[OPERATOR_PUBLIC] = '\0';
    return strpbrk(public_part, "0123456789") != NULL || check_public(public_part, problem);
}

static size_t dash_length(const char *at)
{
    return !is_dash(at) ? 0 : at[0] == '-' ? 1 : 3;
}

/*
 * How many bytes behind a number, separator included, are its secret part.
 * Right behind a dash: whatever is written there. With blanks before, or
 * without a dash: three characters that end a word; without a dash only behind
 * a number in the proper form, which no aircraft's serial number has.
 */
static size_t secret_length(const char *number)
{
    char public_part[OPERATOR_PUBLIC + 1], problem[IDENTIFIER_PROBLEM_SIZE];
    const char *after = number + OPERATOR_PUBLIC;
    size_t blanks = strspn(after, " _"), dash = dash_length(after + blanks), letters = 0;

    while (is_alphanumeric(after[blanks + dash + letters])) {
        letters++;
    }
    if (dash > 0 && blanks == 0) {
        return dash + letters;
    }
    memcpy(public_part, number, OPERATOR_PUBLIC);
    public_part[OPERATOR_PUBLIC] = '\0';
    if (letters != OPERATOR_SECRET || (dash == 0 && !check_public(public_part, problem))) {
        return 0;
    }
    return blanks + dash + letters;
}

bool identifiers_remove_secrets(char *text)
{
    bool removed = false;

    for (size_t i = 0; text[i] != '\0'; i++) {
        size_t length;

        if ((i > 0 && is_alphanumeric(text[i - 1])) || !is_number_in_text(text + i)) {
            continue;
        }
        while ((length = secret_length(text + i)) > 0) {
            char *secret = text + i + OPERATOR_PUBLIC;
            size_t left = strlen(secret + length);

            memmove(secret, secret + length, left);
            explicit_bzero(secret + left, length); /* nor behind the new end */
            removed = true;
        }
    }
    return removed;
}
