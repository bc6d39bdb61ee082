/*
 * The texts that identify aircraft and operator. They are taken even when they
 * are wrong, as far as they can be put on the air: silence there is worse.
 */
#include <stdio.h>
#include <string.h>

#include "base/utf8.h"
#include "config/config_keys.h"

/* Bytes other than printable ASCII become '?'. Returns how many did. */
static size_t make_ascii(char *text)
{
    size_t replaced = 0;

    for (; *text != '\0'; text++) {
        if (*text < ' ' || *text > '~') {
            *text = '?';
            replaced++;
        }
    }
    return replaced;
}

/* Fills an identifier's field; says what could not be put there as it was. */
static void put_identifier(char field[IDENTIFIER_MAX + 1], const char *text,
                           struct config_value *value)
{
    size_t length = strlen(text), cut = utf8_cut(text, IDENTIFIER_MAX), replaced;

    memset(field, 0, IDENTIFIER_MAX + 1);
    memcpy(field, text, cut);
    replaced = make_ascii(field);
    identifiers_remove_secrets(field); /* what looks like one now that it was cut */
    if (replaced > 0) {
        config_say(value->source, CONFIG_ERROR,
                   "%s: expected only ASCII letters and digits; sent as \"%s\"", value->label,
                   field);
    }
    if (length > cut) {
        config_say(value->source, CONFIG_ERROR,
                   "%s is %zu bytes long, %d fit on the air; cut to \"%s\"", value->label, length,
                   IDENTIFIER_MAX, field);
    }
}

static bool take_id(const struct config_rule *rule, void *field, struct config_value *value)
{
    (void)rule;
    put_identifier(field, value->text, value);
    return true;
}

/*
 * The secret part is looked at here and nowhere else: no sentence quotes the
 * value, only what is public of it.
 */
static bool take_operator(const struct config_rule *rule, void *field, struct config_value *value)
{
    char public_part[IDENTIFIER_MAX + 1], problem[IDENTIFIER_PROBLEM_SIZE];
    char ignored[IDENTIFIER_MAX + 1], unheard[IDENTIFIER_PROBLEM_SIZE];
    enum operator_number_verdict verdict, of_public;

    (void)rule;
    verdict = identifiers_check_operator(value->text, public_part, problem);
    of_public = identifiers_check_operator(public_part, ignored, unheard);
    put_identifier(field, public_part, value);
    if (verdict == OPERATOR_NUMBER_VALID) {
        config_say(value->source, CONFIG_NOTE,
                   "%s: check character right; the secret part is not kept", value->label);
    } else if (verdict == OPERATOR_NUMBER_INVALID && of_public != OPERATOR_NUMBER_INVALID) {
        /* Later, without the secret part, nobody could tell; other faults are judged there. */
        config_say(value->source, CONFIG_WARNING, "%s = \"%s\": %s; broadcast all the same",
                   value->label, public_part, problem);
    } else if (strlen(value->text) > IDENTIFIER_MAX && strlen(public_part) == IDENTIFIER_MAX) {
        config_say(value->source, CONFIG_ERROR, "%s is too long: cut to \"%s\"", value->label,
                   (char *)field);
    }
    return true;
}

static bool take_description(const struct config_rule *rule, void *field,
                             struct config_value *value)
{
    char clean[4 * CONFIG_PROBLEM_SIZE];
    size_t replaced = utf8_clean(clean, sizeof(clean), value->text);
    size_t length = strlen(clean), cut = utf8_cut(clean, CONFIG_DESCRIPTION_MAX);
    char *out = field;

    (void)rule;
    memset(out, 0, CONFIG_DESCRIPTION_MAX + 1);
    memcpy(out, clean, cut);
    identifiers_remove_secrets(out); /* what looks like one now that it was cut */
    if (replaced > 0) {
        config_say(value->source, CONFIG_ERROR,
                   "%s holds %zu bytes that are no UTF-8 (a file saved as \"ANSI\"?); sent as "
                   "\"%s\"",
                   value->label, replaced, out);
    }
    if (length > cut && utf8_count(clean) < length) {
        config_say(value->source, CONFIG_ERROR,
                   "%s is %zu bytes (%zu characters; å, ä, ö are 2 bytes each), %d bytes fit; "
                   "cut to \"%s\"",
                   value->label, length, utf8_count(clean), CONFIG_DESCRIPTION_MAX, out);
    } else if (length > cut) {
        config_say(value->source, CONFIG_ERROR, "%s is %zu characters long, %d fit; cut to \"%s\"",
                   value->label, length, CONFIG_DESCRIPTION_MAX, out);
    }
    if (utf8_count(out) < strlen(out)) {
        config_say(value->source, CONFIG_WARNING,
                   "%s = \"%s\": only ASCII is sure to be shown right by every receiver",
                   value->label, out);
    }
    return true;
}

const struct config_rule config_rule_id = {.take = take_id, .show = config_text_show};
const struct config_rule config_rule_operator = {.take = take_operator, .show = config_text_show};
const struct config_rule config_rule_description = {.take = take_description,
                                                    .show = config_text_show};
