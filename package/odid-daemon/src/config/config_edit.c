#include "config/config_edit.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "config/config_ini.h"

#define VALUE_SIZE 256 /* a line is no longer */

/* Reads a text only for its places. */
static void walk(const char *text, size_t length, config_place_fn *place, void *context)
{
    struct config ignored;

    config_defaults(&ignored);
    config_parse_places(&ignored, "", text, length, config_ignore_sentence, place, context);
    explicit_bzero(&ignored, sizeof(ignored));
}

/* Where line number begins (counted from 1), without a byte-order mark; its end in *length. */
static size_t find_line(const char *text, size_t text_length, unsigned number, size_t *length,
                        size_t *ending)
{
    size_t at = text_length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0 ? 3 : 0;

    *length = config_ini_line(text + at, text_length - at, ending);
    while (--number > 0) {
        at += *length + *ending;
        *length = config_ini_line(text + at, text_length - at, ending);
    }
    return at;
}

/* ---- set ---- */

struct search {
    const struct config_key *key;
    bool in_section;
    unsigned setting; /* the line that sets the key; 0: none does */
    unsigned section; /* the last line of its section that says something */
    char value[VALUE_SIZE];
};

static void find_key(void *context, const struct config_key *key, const char *value, unsigned line)
{
    struct search *search = context;

    if (key == NULL) {
        search->in_section = strcmp(value, search->key->section) == 0;
    }
    if (search->in_section) {
        search->section = line;
    }
    if (key == search->key) {
        search->setting = line;
        snprintf(search->value, sizeof(search->value), "%s", value);
    }
}

/* What stood in quotes stays in quotes: behind them "#" begins a comment, else it doesn't. */
static bool in_quotes(const char *line, size_t from, size_t to)
{
    return from < to && (line[from] == '"' || line[from] == '\'' || (line[from] & 0x80) != 0);
}

/* The value as it is written into the file; false when that can't be. */
static bool quoted(const char *value, bool quotes, char out[VALUE_SIZE])
{
    const char *quote = "";

    for (const char *c = value; *c != '\0'; c++) {
        if ((unsigned char)*c < ' ' || *c == 0x7F) {
            return false;
        }
    }
    if (quotes || value[0] == '\0' || strpbrk(value, " ;'\"#") != NULL || (value[0] & 0x80) != 0) {
        quote = strchr(value, '"') == NULL ? "\"" : "'";
    }
    return snprintf(out, VALUE_SIZE, "%s%s%s", quote, value, quote) < VALUE_SIZE;
}

/* text with [from, to) replaced. */
static char *splice(const char *text, size_t length, size_t from, size_t to, const char *piece,
                    size_t *new_length)
{
    size_t size = strlen(piece);
    char *made = malloc(length - (to - from) + size + 1);

    if (made == NULL) {
        errno = ENOMEM;
        return NULL;
    }
    memcpy(made, text, from);
    memcpy(made + from, piece, size);
    memcpy(made + from + size, text + to, length - to);
    *new_length = length - (to - from) + size;
    made[*new_length] = '\0';
    return made;
}

/* The line end that the file uses. */
static const char *line_end(const char *text, size_t length)
{
    size_t ending, line = config_ini_line(text, length, &ending);

    return ending == 2 ? "\r\n" : ending == 1 && text[line] == '\r' ? "\r" : "\n";
}

/* In the line that sets the key already. NULL with errno EINVAL: no line can hold the value. */
static char *change(const char *text, size_t length, const struct search *search, const char *value,
                    size_t *new_length)
{
    size_t line, ending, at = find_line(text, length, search->setting, &line, &ending), from, to;
    char written[VALUE_SIZE], piece[VALUE_SIZE + 2];

    config_ini_value(text + at, line, &from, &to);
    if (!quoted(value, in_quotes(text + at, from, to), written)) {
        errno = EINVAL;
        return NULL;
    }
    /* "key =": a blank looks better before, and one is needed before a comment. */
    snprintf(piece, sizeof(piece), "%s%s%s", from > 0 && text[at + from - 1] != ' ' ? " " : "",
             written, from == to && to < line ? " " : "");
    return splice(text, length, at + from, at + to, piece, new_length);
}

/* In a new line: after the last one of its section, or in a new section. */
static char *insert(const char *text, size_t length, const struct search *search, const char *value,
                    size_t *new_length)
{
    const char *end = line_end(text, length);
    char written[VALUE_SIZE], piece[2 * VALUE_SIZE];
    size_t at = length, line, ending = 1;
    bool open; /* the last line has no line end */

    if (!quoted(value, false, written)) {
        errno = EINVAL;
        return NULL;
    }
    if (search->section > 0) {
        at = find_line(text, length, search->section, &line, &ending);
        at += line + ending;
        open = ending == 0;
        snprintf(piece, sizeof(piece), "%s%s = %s%s", open ? end : "", search->key->name, written,
                 open ? "" : end);
    } else {
        open = length > 0 && text[length - 1] != '\n' && text[length - 1] != '\r';
        snprintf(piece, sizeof(piece), "%s%s[%s]%s%s = %s%s", open ? end : "",
                 length > 0 ? end : "", search->key->section, end, search->key->name, written, end);
    }
    return splice(text, length, at, at, piece, new_length);
}

char *config_edit_set(const char *text, size_t length, const struct config_key *key,
                      const char *value, size_t *new_length)
{
    struct search search = {.key = key}, result = {.key = key};
    char *made;

    walk(text, length, find_key, &search);
    made = search.setting > 0 ? change(text, length, &search, value, new_length)
                              : insert(text, length, &search, value, new_length);
    if (made == NULL) {
        return NULL;
    }
    /* Whatever else stands there: it counts only if it reads as it was meant. */
    walk(made, *new_length, find_key, &result);
    if (result.setting == 0 || strcmp(result.value, value) != 0) {
        free(made);
        errno = EINVAL;
        return NULL;
    }
    return made;
}

/* ---- the password ---- */

struct take {
    char *text;
    size_t length;
    char *password;
    unsigned lines;
};

static void blank_line(char *line, size_t length)
{
    static const char note[] = "; password: taken over";
    size_t indent = 0;

    while (indent < length && (line[indent] == ' ' || line[indent] == '\t')) {
        indent++;
    }
    line += indent;
    length -= indent;
    memset(line, ' ', length);
    memcpy(line, note, length < strlen(note) ? length : strlen(note));
}

static void take_over(void *context, const struct config_key *key, const char *value, unsigned line)
{
    struct take *take = context;
    size_t length, ending, at;

    if (key == NULL || !config_key_is_secret(key)) {
        return;
    }
    memset(take->password, 0, CONFIG_PASSWORD_MAX + 1);
    if (value[0] == '\0') {
        return;
    }
    if (strlen(value) <= CONFIG_PASSWORD_MAX && key->rule->valid(value)) {
        memcpy(take->password, value, strlen(value));
    }
    at = find_line(take->text, take->length, line, &length, &ending);
    blank_line(take->text + at, length);
    take->lines++;
}

static unsigned take_interrupted(char *text, size_t length)
{
    static const char begun[] = ";assword";
    unsigned lines = 0;

    for (size_t at = 0, ending, line; at < length; at += line + ending) {
        size_t indent = 0;

        line = config_ini_line(text + at, length - at, &ending);
        while (indent < line && (text[at + indent] == ' ' || text[at + indent] == '\t')) {
            indent++;
        }
        if (line - indent >= strlen(begun) &&
            strncasecmp(text + at + indent, begun, strlen(begun)) == 0) {
            blank_line(text + at, line);
            lines++;
        }
    }
    return lines;
}

unsigned config_edit_take_password(char *text, size_t length,
                                   char password[CONFIG_PASSWORD_MAX + 1])
{
    struct take take = {.text = text, .length = length, .password = password};

    memset(password, 0, CONFIG_PASSWORD_MAX + 1);
    /* A line is changed in text only after it was read. */
    walk(text, length, take_over, &take);
    return take.lines + take_interrupted(text, length);
}

/* ---- operator numbers ---- */

struct strip {
    char *text;
    size_t length;
    bool failed;
};

static void strip_line(void *context, const struct config_key *key, const char *value,
                       unsigned line)
{
    char public_part[IDENTIFIER_MAX + 1], problem[IDENTIFIER_PROBLEM_SIZE], written[VALUE_SIZE];
    struct strip *strip = context;
    size_t length, ending, at, from, to;
    char *made;

    if (key == NULL || key->rule != &config_rule_operator || strip->failed) {
        return;
    }
    identifiers_check_operator(value, public_part, problem);
    at = find_line(strip->text, strip->length, line, &length, &ending);
    config_ini_value(strip->text + at, length, &from, &to);
    if (strcmp(public_part, value) == 0) {
        return;
    }
    if (!quoted(public_part, in_quotes(strip->text + at, from, to), written)) {
        snprintf(written, sizeof(written), "\"\""); /* both kinds of quotes: no number at all */
    }
    made = splice(strip->text, strip->length, at + from, at + to, written, &strip->length);
    strip->failed = made == NULL;
    if (made != NULL) {
        explicit_bzero(strip->text, strlen(strip->text));
        free(strip->text);
        strip->text = made;
    }
}

char *config_edit_without_secrets(const char *text, size_t length, size_t *new_length)
{
    struct strip strip = {.length = length};

    strip.text = splice(text, length, length, length, "", &strip.length);
    if (strip.text == NULL) {
        return NULL;
    }
    /* A key is set in one line each, so line numbers hold while lines change. */
    walk(text, length, strip_line, &strip);
    if (strip.failed) {
        explicit_bzero(strip.text, strip.length);
        free(strip.text);
        return NULL;
    }
    identifiers_remove_secrets(strip.text);
    *new_length = strlen(strip.text);
    return strip.text;
}
