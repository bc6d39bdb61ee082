/* Formats of serial numbers and operator numbers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "config/identifiers.h"

static void valid_serials(void **state)
{
    static const char *const serials[] = {"SSRS5GBG01", "ABCD1Z", "0000A0123456789",
                                          "SSRSFABCDEFGHJKLMNPQ", "ZZZZ9123456789"};
    char problem[IDENTIFIER_PROBLEM_SIZE];

    (void)state;
    for (size_t i = 0; i < sizeof(serials) / sizeof(serials[0]); i++) {
        assert_true(identifiers_check_serial(serials[i], problem));
        assert_string_equal(problem, "");
    }
}

/* Each length code with one character too few, the right number, and one too many. */
static void length_codes(void **state)
{
    static const char codes[] = "123456789ABCDEF";
    char serial[32], problem[IDENTIFIER_PROBLEM_SIZE];

    (void)state;
    for (size_t i = 0; codes[i] != '\0'; i++) {
        for (size_t length = i; length <= i + 2; length++) {
            snprintf(serial, sizeof(serial), "ABCD%c%.*s", codes[i], (int)length,
                     "0123456789ABCDEFGH");
            assert_int_equal(identifiers_check_serial(serial, problem), length == i + 1);
        }
    }
}

/* Every byte at every place. */
static void serial_alphabet(void **state)
{
    static const char good[] = "0123456789ABCDEFGHJKLMNPQRSTUVWXYZ";
    char problem[IDENTIFIER_PROBLEM_SIZE];

    (void)state;
    for (size_t place = 0; place < 10; place++) {
        for (int byte = 1; byte < 256; byte++) {
            char serial[] = "SSRS5GBG01";
            bool expected = strchr(good, byte) != NULL;

            serial[place] = (char)byte;
            if (place == 4) {
                expected = byte == '5'; /* the only one that announces what follows */
            }
            assert_int_equal(identifiers_check_serial(serial, problem), expected);
        }
    }
}

static void invalid_serials(void **state)
{
    static const struct {
        const char *serial, *problem;
    } cases[] = {
        {"SSRSGBG001", "character 5 is \"G\": expected a length code, 1-9 or A-F"},
        {"DIY19eosdrone8", "character 2 is \"I\": expected 0-9 or A-Z without O and I"},
        {"", "0 characters are too few: expected 6 to 20"},
        {"SSRS", "4 characters are too few: expected 6 to 20"},
        {"SSRS5", "5 characters are too few: expected 6 to 20"},
        {"SSRS5GBG0", "length code \"5\" announces 5 characters, 4 follow"},
        {"SSRS5GBG012", "length code \"5\" announces 5 characters, 6 follow"},
        {"SSRS0", "character 5 is \"0\": expected a length code, 1-9 or A-F"},
        {"SSOS5GBG01", "character 3 is \"O\": expected 0-9 or A-Z without O and I"},
        {"SSRS5GB 01", "character 8 is \" \": expected 0-9 or A-Z without O and I"},
        {"SSRS5GB\xC3\x85", "character 8 is 0xC3: expected 0-9 or A-Z without O and I"},
        {"SS\nS", "character 3 is 0x0A: expected 0-9 or A-Z without O and I"},
    };
    char problem[IDENTIFIER_PROBLEM_SIZE];

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        assert_false(identifiers_check_serial(cases[i].serial, problem));
        assert_string_equal(problem, cases[i].problem);
    }
}

/* The first one is the published example; the others were computed by a separate program. */
static const char *const operators[] = {
    "FIN87astrdge12k8-xyz", "SWEgmx1tf3a7nufc-oy6", "NORf0dqhboa48s85-800",
    "DEUddaaikcydbco4-j1n", "FRAqa9g4lj0l4jmd-juk", "ESTbuub3g1mp1zq6-no0",
};

#define OPERATORS (sizeof(operators) / sizeof(operators[0]))

static void valid_operators(void **state)
{
    char public_part[IDENTIFIER_MAX + 1], again[IDENTIFIER_MAX + 1];
    char problem[IDENTIFIER_PROBLEM_SIZE];

    (void)state;
    for (size_t i = 0; i < OPERATORS; i++) {
        assert_int_equal(identifiers_check_operator(operators[i], public_part, problem),
                         OPERATOR_NUMBER_VALID);
        assert_int_equal(strlen(public_part), 16);
        assert_memory_equal(public_part, operators[i], 16);
        assert_string_equal(problem, "");
        assert_int_equal(identifiers_check_operator(public_part, again, problem),
                         OPERATOR_NUMBER_UNVERIFIED);
        assert_string_equal(again, public_part);
    }
}

/* Luhn mod 36 notices every single wrong character, the secret ones included. */
static void every_single_error_is_noticed(void **state)
{
    static const char alphabet[] = "0123456789abcdefghijklmnopqrstuvwxyz";
    char public_part[IDENTIFIER_MAX + 1], problem[IDENTIFIER_PROBLEM_SIZE], wrong[32];

    (void)state;
    for (size_t i = 0; i < OPERATORS; i++) {
        for (size_t place = 3; place < 20; place++) {
            for (size_t c = 0; alphabet[c] != '\0'; c++) {
                snprintf(wrong, sizeof(wrong), "%s", operators[i]);
                if (place == 16 || wrong[place] == alphabet[c]) {
                    continue;
                }
                wrong[place] = alphabet[c];
                assert_int_equal(identifiers_check_operator(wrong, public_part, problem),
                                 OPERATOR_NUMBER_INVALID);
                assert_non_null(strstr(problem, "does not fit"));
            }
        }
    }
}

static void invalid_operators(void **state)
{
    static const char glued[] = "after 16 characters only \"-\" and 3 secret characters may follow";
    static const struct {
        const char *given, *public_part, *problem;
    } cases[] = {
        {"", "", "0 characters instead of 16 (country code, 12, check character)"},
        {"SWE", "SWE", "3 characters instead of 16 (country code, 12, check character)"},
        {"SWE3jxza7qbzvu5", "SWE3jxza7qbzvu5",
         "15 characters instead of 16 (country code, 12, check character)"},
        {"SWE3jxza7qbzvu5-xyz", "SWE3jxza7qbzvu5",
         "15 characters instead of 16 (country code, 12, check character)"},
        {"SWE3jxza7qbz  -xyz", "SWE3jxza7qbz",
         "12 characters instead of 16 (country code, 12, check character)"},
        {"SwE3jxza7qbzvu5d", "SwE3jxza7qbzvu5d",
         "character 2 is \"w\": expected a capital letter of the country code"},
        {"S1E3jxza7qbzvu5d", "S1E3jxza7qbzvu5d",
         "character 2 is \"1\": expected a capital letter of the country code"},
        {"SWE3JXZA7QBZVU5D", "SWE3JXZA7QBZVU5D",
         "character 5 is \"J\": expected a digit or a small letter"},
        {"SWE3jxza7 bzvu5d", "SWE3jxza7 bzvu5d",
         "character 10 is \" \": expected a digit or a small letter"},
        {"FIN87astrdge12k8-", "FIN87astrdge12k8", "0 secret characters after \"-\" instead of 3"},
        {"FIN87astrdge12k8-xy", "FIN87astrdge12k8", "2 secret characters after \"-\" instead of 3"},
        {"FIN87astrdge12k8-xyzz", "FIN87astrdge12k8",
         "4 secret characters after \"-\" instead of 3"},
        {"FIN87astrdge12k8-xYz", "FIN87astrdge12k8",
         "secret character 2 is neither a digit nor a small letter"},
        {"FIN87astrdge12k8-xzy", "FIN87astrdge12k8",
         "check character \"8\" does not fit the others: one of them is mistyped"},
        {"FIN87astrdge12k8xyz", "FIN87astrdge12k8", glued},
        {"FIN87astrdge12k8 xyz", "FIN87astrdge12k8", glued},
        {"FIN87astrdge12k8 - xyz", "FIN87astrdge12k8", glued},
        {"FIN87astrdge12k8\xE2\x80\x93xyz", "FIN87astrdge12k8", glued}, /* an en dash */
        {"FIN87astrdge12\xE2\x80\x93xyz", "FIN87astrdge12",
         "14 characters instead of 16 (country code, 12, check character)"},
        {"GBR-OP-7JW2ZR7G3DVW", "GBR",
         "3 characters instead of 16 (country code, 12, check character)"},
        {"SWE 3jxza7qbzvu5d 1234567", "SWE 3jxza7qbzvu5d 12",
         "character 4 is \" \": expected a digit or a small letter"},
    };
    char public_part[IDENTIFIER_MAX + 1], problem[IDENTIFIER_PROBLEM_SIZE];

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        assert_int_equal(identifiers_check_operator(cases[i].given, public_part, problem),
                         OPERATOR_NUMBER_INVALID);
        assert_string_equal(public_part, cases[i].public_part);
        assert_string_equal(problem, cases[i].problem);
    }
}

static void secrets_in_other_texts(void **state)
{
    static const struct {
        const char *text, *left;
    } cases[] = {
        {"SWE3jxza7qbzvu5d-xyz", "SWE3jxza7qbzvu5d"},
        {"uas_id=SWE3jxza7qbzvu5d-xyz ; both FIN87astrdge12k8-abc",
         "uas_id=SWE3jxza7qbzvu5d ; both FIN87astrdge12k8"},
        {"swe3JXZA7qbzvu5d\xE2\x80\x93xyz!", "swe3JXZA7qbzvu5d!"},
        {"SWE3jxza7qbzvu5d--xyz-abc/", "SWE3jxza7qbzvu5d/"},
        {"SWEabcdefghijklm-xyz", "SWEabcdefghijklm"}, /* no digit, but the proper form */
        {"SWE3jxza7qbzvu5d xyz", "SWE3jxza7qbzvu5d"},
        {"SWE3jxza7qbzvu5d_xyz", "SWE3jxza7qbzvu5d"},
        {"SWE3jxza7qbzvu5dxyz", "SWE3jxza7qbzvu5d"},
        {"Op SWE3jxza7qbzvu5d -xyz", "Op SWE3jxza7qbzvu5d"},
        {"SWE3jxza7qbzvu5d-- xyz, abc", "SWE3jxza7qbzvu5d, abc"},
        {"SWE3jxza7qbzvu5d - on patrol", NULL},
        {"SWE3jxza7qbzvu5d on patrol", NULL},
        {"SWE1E12345678901234", NULL},  /* a serial number of 19 characters */
        {"internationalist-xyz", NULL}, /* an ordinary word of 16 letters */
        {"SWE3jxza7qbzvu5d", NULL},
        {"SWE3jxza7qbzvu5-xyz", NULL},
        {"", NULL},
    };
    char text[80];

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        snprintf(text, sizeof(text), "%s", cases[i].text);
        assert_int_equal(identifiers_remove_secrets(text), cases[i].left != NULL);
        assert_string_equal(text, cases[i].left != NULL ? cases[i].left : cases[i].text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(valid_serials),     cmocka_unit_test(length_codes),
        cmocka_unit_test(serial_alphabet),   cmocka_unit_test(invalid_serials),
        cmocka_unit_test(valid_operators),   cmocka_unit_test(every_single_error_is_noticed),
        cmocka_unit_test(invalid_operators), cmocka_unit_test(secrets_in_other_texts),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
