#include "config/config_ini.h"

#include <ini.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/utf8.h"

/*
 * inih parses, line by line. Each line is made plain before it gets there
 * (trimmed, comment and quotes gone), because the library can neither tell the
 * line's number nor keep a ';' in quotes, takes an indented key for part of
 * the value before, and is built with different options here and there.
 */

/* Stands for ';' in a value on its way through inih, which would see a comment. */
#define HIDDEN_SEMICOLON '\x01'
#define LINE_SIZE 256
#define NAME_SIZE 40
#define UNKNOWN_SECTION "?"

struct reader {
    struct config *config;
    struct config_source *source;
    const char *next, *end; /* what has not been read yet */
    unsigned line;
    const char *section;            /* a known one, UNKNOWN_SECTION, or "" before the first */
    unsigned seen[CONFIG_KEYS_MAX]; /* in which line a key was set; 0: not yet */
};

/* A piece of the text, without terminator. */
struct span {
    const char *at;
    size_t length;
};

/* ---- spans ---- */

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\f' || c == '\v';
}

static struct span trim(struct span span)
{
    while (span.length > 0 && is_blank(span.at[0])) {
        span.at++;
        span.length--;
    }
    while (span.length > 0 && is_blank(span.at[span.length - 1])) {
        span.length--;
    }
    return span;
}

static struct span after(struct span span, size_t bytes)
{
    return trim((struct span){span.at + bytes, span.length - bytes});
}

/* Up to the first of the characters, or all of it. */
static struct span until(struct span span, const char *characters)
{
    size_t length = 0;

    while (length < span.length && strchr(characters, span.at[length]) == NULL) {
        length++;
    }
    return trim((struct span){span.at, length});
}

static bool is_comment(struct span span)
{
    return span.length == 0 || span.at[0] == ';' || span.at[0] == '#';
}

static size_t copy(char *out, size_t size, struct span span)
{
    size_t length = span.length < size ? span.length : size - 1;

    memcpy(out, span.at, length);
    out[length] = '\0';
    return length;
}

/* ---- [section] ---- */

/* Its first word: behind it may stand anything, a password among it. */
static void say_unknown_section(struct reader *reader, const char *name)
{
    const char *meant = config_name_nearest(name, NULL);
    int word = (int)strcspn(name, " \t=:");

    if (meant != NULL) {
        config_say(reader->source, CONFIG_ERROR,
                   "[%.*s]: unknown section, ignored with all its keys; did you mean [%s]?", word,
                   name, meant);
    } else {
        config_say(reader->source, CONFIG_ERROR,
                   "[%.*s]: unknown section, ignored with all its keys", word, name);
    }
}

static void plain_section(struct reader *reader, struct span line, char *out, size_t size)
{
    struct span inner = after(line, 1), name = until(inner, "];#");
    bool closed = until(inner, "]").length < inner.length;
    char text[NAME_SIZE];

    copy(text, sizeof(text), name);
    identifiers_remove_secrets(text);
    reader->section = config_section_known(text);
    if (reader->section == NULL) {
        say_unknown_section(reader, text);
        reader->section = UNKNOWN_SECTION;
    } else if (!closed) {
        config_say(reader->source, CONFIG_ERROR, "[%s: the closing ] is missing; taken as [%s]",
                   text, reader->section);
    }
    if (closed) {
        struct span closing = {memchr(inner.at, ']', inner.length), 0};

        closing.length = (size_t)(inner.at + inner.length - closing.at);
        if (!is_comment(after(closing, 1))) {
            config_say(reader->source, CONFIG_ERROR,
                       "[%s]: what follows in the same line is ignored", text);
        }
    }
    if (reader->source->place != NULL) {
        reader->source->place(reader->source->context, NULL, reader->section, reader->line);
    }
    snprintf(out, size, "[%s]\n", reader->section);
}

/* ---- key = value ---- */

/* Straight quotes, and what word processors make of them. */
static const struct quotes {
    const char *opening;
    const char *closing[3]; /* ended by NULL */
    bool plain;
} quotes[] = {
    {"\"", {"\"", NULL}, true},
    {"'", {"'", NULL}, true},
    {"\xE2\x80\x9C", {"\xE2\x80\x9D", "\xE2\x80\x9C", NULL}, false}, /* English, Swedish */
    {"\xE2\x80\x9D", {"\xE2\x80\x9D", NULL}, false},
    {"\xE2\x80\x9E", {"\xE2\x80\x9C", "\xE2\x80\x9D", NULL}, false}, /* German */
    {"\xE2\x80\x98", {"\xE2\x80\x99", NULL}, false},
    {"\xE2\x80\x99", {"\xE2\x80\x99", NULL}, false},
};

static bool begins_with(struct span span, const char *text)
{
    return span.length >= strlen(text) && memcmp(span.at, text, strlen(text)) == 0;
}

static const struct quotes *opening_quote(struct span value)
{
    for (size_t i = 0; i < sizeof(quotes) / sizeof(quotes[0]); i++) {
        if (begins_with(value, quotes[i].opening)) {
            return &quotes[i];
        }
    }
    return NULL;
}

/* What stands between the quotes; rest: what follows them. False without a closing one. */
static bool between(const struct quotes *kind, struct span value, struct span *inner,
                    struct span *rest)
{
    struct span text = after(value, strlen(kind->opening));

    for (size_t i = 0; i < text.length; i++) {
        struct span here = {text.at + i, text.length - i};

        for (size_t k = 0; kind->closing[k] != NULL; k++) {
            if (begins_with(here, kind->closing[k])) {
                *inner = trim((struct span){text.at, i});
                *rest = after(here, strlen(kind->closing[k]));
                return true;
            }
        }
    }
    *inner = until(text, ";");
    return false;
}

/* The value without quotes and comment. key: only for sentences. */
static struct span bare_value(struct reader *reader, const char *key, struct span value)
{
    const struct quotes *kind = opening_quote(value);
    struct span inner, rest = {value.at, 0};

    if (kind == NULL) {
        return until(value, ";");
    }
    if (!between(kind, value, &inner, &rest)) {
        config_say(reader->source, CONFIG_ERROR,
                   "%s: the closing quote is missing; taken up to the end of the line", key);
    } else if (!is_comment(rest)) {
        config_say(reader->source, CONFIG_ERROR, "%s: what follows the closing quote is ignored",
                   key);
    }
    if (!kind->plain) {
        config_say(reader->source, CONFIG_WARNING,
                   "%s: typographic quotes, as a word processor makes them; use \"\"", key);
    }
    return inner;
}

/* The value with its quotes, between what must stay of a line that gets another value. */
void config_ini_value(const char *text, size_t length, size_t *from, size_t *to)
{
    struct span line = {text, length}, value, inner, rest;
    const struct quotes *kind;
    size_t sign = 0;

    while (sign < length && text[sign] != '=' && text[sign] != ':') {
        sign++;
    }
    value = sign == length ? (struct span){text + length, 0} : after(line, sign + 1);
    kind = opening_quote(value);
    if (kind == NULL) {
        value = until(value, ";");
        *to = (size_t)(value.at + value.length - text);
    } else if (between(kind, value, &inner, &rest)) {
        *to = (size_t)(rest.at - text);
    } else {
        *to = (size_t)(inner.at + inner.length - text);
    }
    *from = (size_t)(value.at - text);
    while (*to > *from && is_blank(text[*to - 1])) {
        (*to)--;
    }
}

static void hide_semicolons(char *text)
{
    for (; *text != '\0'; text++) {
        if (*text == HIDDEN_SEMICOLON) {
            *text = '?'; /* a control character has no business here */
        } else if (*text == ';') {
            *text = HIDDEN_SEMICOLON;
        }
    }
}

static void plain_setting(struct reader *reader, struct span line, char *out, size_t size)
{
    struct span name = until(line, "=:;"), value;
    char key[NAME_SIZE];
    size_t sign = 0, filled;

    while (sign < line.length && strchr("=:;", line.at[sign]) == NULL) {
        sign++;
    }
    if (sign == line.length || line.at[sign] == ';' || name.length == 0) {
        config_say(reader->source, CONFIG_ERROR, "neither [section] nor key = value; ignored");
        return;
    }
    copy(key, sizeof(key), name);
    identifiers_remove_secrets(key);
    value = bare_value(reader, key, after(line, sign + 1));
    filled = strlen(key);
    if (filled + value.length + 4 > size) {
        config_say(reader->source, CONFIG_ERROR, "%s: the line is too long; ignored", key);
        return;
    }
    memcpy(out, key, filled);
    out[filled++] = '=';
    filled += copy(out + filled, size - filled, value);
    hide_semicolons(out);
    if (strcasecmp(key, "operator_id") != 0 && identifiers_remove_secrets(out)) {
        config_say(reader->source, CONFIG_ERROR,
                   "%s holds an operator number; its secret part is left out", key);
    }
    strcat(out, "\n");
}

/* ---- the two functions that inih calls ---- */

size_t config_ini_line(const char *text, size_t length, size_t *ending)
{
    size_t line = 0;

    while (line < length && text[line] != '\n' && text[line] != '\r') {
        line++;
    }
    *ending = line == length ? 0 : 1;
    if (length - line > 1 && text[line] == '\r' && text[line + 1] == '\n') {
        *ending = 2;
    }
    return line;
}

static struct span next_line(struct reader *reader)
{
    size_t ending;
    struct span line = {reader->next, 0};

    line.length = config_ini_line(reader->next, (size_t)(reader->end - reader->next), &ending);
    reader->next += line.length + ending;
    reader->source->line = ++reader->line;
    return trim(line);
}

static char *feed_inih(char *out, int size, void *stream)
{
    struct reader *reader = stream;
    size_t room = size < LINE_SIZE ? (size_t)size : LINE_SIZE;
    struct span line;

    explicit_bzero(out, (size_t)size); /* at the end too: inih's buffer keeps no secret part */
    if (reader->next == reader->end) {
        return NULL;
    }
    line = next_line(reader);
    if (memchr(line.at, '\0', line.length) != NULL) {
        config_say(reader->source, CONFIG_ERROR,
                   "holds NUL bytes, as a damaged file does; ignored");
    } else if (!is_comment(line) && line.at[0] == '[') {
        plain_section(reader, line, out, room);
    } else if (!is_comment(line)) {
        plain_setting(reader, line, out, room);
    }
    if (out[0] == '\0') {
        out[0] = '\n';
    }
    return out;
}

static void say_unknown_key(struct reader *reader, const char *name)
{
    const char *meant = config_name_nearest(name, reader->section);

    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        if (strcasecmp(key->name, name) == 0) {
            config_say(reader->source, CONFIG_ERROR, "%s belongs in [%s]; ignored here", key->name,
                       key->section);
            return;
        }
    }
    if (meant != NULL) {
        config_say(reader->source, CONFIG_ERROR, "[%s] %s: unknown key, ignored; did you mean %s?",
                   reader->section, name, meant);
    } else {
        config_say(reader->source, CONFIG_ERROR, "[%s] %s: unknown key, ignored", reader->section,
                   name);
    }
}

static void take_setting(struct reader *reader, const struct config_key *key, const char *text)
{
    char label[64];
    struct config_value value = {.source = reader->source, .label = label, .text = text};
    unsigned *seen = &reader->seen[key - config_keys];

    snprintf(label, sizeof(label), "[%s] %s", key->section, key->name);
    if (*seen != 0) {
        config_say(reader->source, CONFIG_NOTE,
                   "%s is set again (before in line %u); this one counts", label, *seen);
    }
    *seen = reader->line;
    if (reader->source->place != NULL) {
        reader->source->place(reader->source->context, key, text, reader->line);
    }
    config_key_take(key, reader->config, &value);
}

static int on_setting(void *context, const char *section, const char *name, const char *text)
{
    struct reader *reader = context;
    const struct config_key *key = config_key_find(section, name);
    char value[LINE_SIZE];

    if (strcmp(section, UNKNOWN_SECTION) == 0) {
        return 1; /* said already */
    }
    if (key == NULL) {
        say_unknown_key(reader, name);
        return 1;
    }
    snprintf(value, sizeof(value), "%s", text);
    for (char *c = value; *c != '\0'; c++) {
        if (*c == HIDDEN_SEMICOLON) {
            *c = ';';
        }
    }
    take_setting(reader, key, value);
    explicit_bzero(value, sizeof(value));
    return 1;
}

void config_ini_read(struct config *config, struct config_source *source, const char *text,
                     size_t length)
{
    struct reader reader = {
        .config = config, .source = source, .next = text, .end = text + length, .section = ""};

    ini_parse_stream(feed_inih, &reader, on_setting, &reader);
    source->line = 0;
}
