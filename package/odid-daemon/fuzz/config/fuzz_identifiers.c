/*
 * Any text as a serial number and as an operator number -> a verdict, an
 * explanation exactly when it is needed, and nothing of the secret part.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "config/identifiers.h"

#define REQUIRE(condition)                                                                         \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            abort();                                                                               \
        }                                                                                          \
    } while (0)

static void try_serial(const char *text)
{
    char problem[IDENTIFIER_PROBLEM_SIZE];
    bool valid;

    memset(problem, '!', sizeof(problem));
    valid = identifiers_check_serial(text, problem);
    REQUIRE(strnlen(problem, sizeof(problem)) < sizeof(problem));
    REQUIRE(valid == (problem[0] == '\0'));
    REQUIRE(!valid || (strlen(text) >= 6 && strlen(text) <= IDENTIFIER_MAX));
}

static void try_operator(const char *text)
{
    char public_part[IDENTIFIER_MAX + 1], again[IDENTIFIER_MAX + 1];
    char problem[IDENTIFIER_PROBLEM_SIZE];
    enum operator_number_verdict verdict, of_public;

    memset(public_part, '!', sizeof(public_part));
    memset(problem, '!', sizeof(problem));
    verdict = identifiers_check_operator(text, public_part, problem);
    REQUIRE(strnlen(public_part, sizeof(public_part)) < sizeof(public_part));
    REQUIRE(strnlen(problem, sizeof(problem)) < sizeof(problem));
    REQUIRE(strncmp(text, public_part, strlen(public_part)) == 0);
    REQUIRE(strchr(public_part, '-') == NULL);
    REQUIRE((verdict == OPERATOR_NUMBER_INVALID) == (problem[0] != '\0'));

    /* What is public proves nothing, and stays what it is. */
    of_public = identifiers_check_operator(public_part, again, problem);
    REQUIRE(of_public != OPERATOR_NUMBER_VALID);
    REQUIRE(verdict == OPERATOR_NUMBER_INVALID || of_public == OPERATOR_NUMBER_UNVERIFIED);
    REQUIRE(strcmp(public_part, again) == 0);
}

static void try_removal(char *text)
{
    size_t length = strlen(text);
    bool removed = identifiers_remove_secrets(text);

    REQUIRE(removed == (strlen(text) < length));
    REQUIRE(!identifiers_remove_secrets(text));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char *text = malloc(size + 1);

    if (text == NULL) {
        return 0;
    }
    memcpy(text, data, size);
    text[size] = '\0';
    try_serial(text);
    try_operator(text);
    try_removal(text);
    free(text);
    return 0;
}
