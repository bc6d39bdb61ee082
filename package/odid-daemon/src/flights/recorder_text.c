#include "flights/recorder_text.h"

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

/* Shortened to this, so that it isn't soon too long again. */
#define SHORT_MAX (RECORDER_TEXT_MAX / 2)
#define DROPPED_SIZE 192

enum kind {
    KIND_EVENT,
    KIND_KEPT,    /* of which there are few */
    KIND_TOTALS,  /* the next one says it again */
    KIND_CLOCK,   /* the first one dates the record, the next one says what the last one did */
    KIND_DROPPED, /* what we said about dropped lines */
};

static size_t line_length(const struct recorder_text *text, size_t at)
{
    const char *end = memchr(text->bytes + at, '\n', text->length - at);

    return end == NULL ? text->length - at : (size_t)(end - (text->bytes + at)) + 1;
}

static enum kind kind_of(const struct recorder_text *text, size_t at)
{
    static const struct {
        const char *event;
        enum kind kind;
    } events[] = {{"start", KIND_KEPT},
                  {"first_broadcast", KIND_KEPT},
                  {"totals", KIND_TOTALS},
                  {"clock", KIND_CLOCK},
                  {"dropped", KIND_DROPPED}};
    static const char key[] = "\"event\":\"";
    size_t length = line_length(text, at), rest;
    const char *line = text->bytes + at;
    const char *name = memmem(line, length, key, strlen(key));

    if (name == NULL) {
        return KIND_EVENT;
    }
    name += strlen(key);
    rest = length - (size_t)(name - line);
    for (size_t i = 0; i < sizeof(events) / sizeof(events[0]); i++) {
        size_t size = strlen(events[i].event);

        if (rest > size && memcmp(name, events[i].event, size) == 0 && name[size] == '"') {
            return events[i].kind;
        }
    }
    return KIND_EVENT;
}

/* Where the last line of that kind begins, or the first one; SIZE_MAX when there is none. */
static size_t find(const struct recorder_text *text, enum kind kind, bool last)
{
    size_t found = SIZE_MAX;

    for (size_t at = 0; at < text->length && (last || found == SIZE_MAX);
         at += line_length(text, at)) {
        if (kind_of(text, at) == kind) {
            found = at;
        }
    }
    return found;
}

/* Where the lines are that speak for all of their kind. */
struct speaking {
    size_t totals, first_clock, last_clock;
};

static bool stays(const struct recorder_text *text, const struct speaking *speaking, size_t at)
{
    enum kind kind = kind_of(text, at);

    return kind == KIND_EVENT || kind == KIND_KEPT || at == speaking->totals ||
           at == speaking->first_clock || at == speaking->last_clock;
}

/* Leaves out what later lines say again; if that isn't enough, the oldest events. */
static void shorten(struct recorder_text *text)
{
    const struct speaking speaking = {
        .totals = find(text, KIND_TOTALS, true),
        .first_clock = find(text, KIND_CLOCK, false),
        .last_clock = find(text, KIND_CLOCK, true),
    };
    size_t filled = 0, length, excess, kept = 0;

    for (size_t at = 0; at < text->length; at += line_length(text, at)) {
        kept += stays(text, &speaking, at) ? line_length(text, at) : 0;
    }
    excess = kept + DROPPED_SIZE > SHORT_MAX ? kept + DROPPED_SIZE - SHORT_MAX : 0;
    for (size_t at = 0; at < text->length; at += length) {
        length = line_length(text, at);
        if (excess > 0 && kind_of(text, at) == KIND_EVENT) {
            excess -= length < excess ? length : excess;
            text->dropped++;
        } else if (stays(text, &speaking, at)) {
            memmove(text->bytes + filled, text->bytes + at, length);
            filled += length;
        }
    }
    text->length = filled;
}

/* Behind the first line: who reads on knows that something is missing. */
static void say_dropped(struct recorder_text *text)
{
    char line[DROPPED_SIZE];
    size_t length, first;

    if (text->dropped == 0 || text->length == 0) {
        return;
    }
    length = (size_t)snprintf(line, sizeof(line),
                              "{\"event\":\"dropped\",\"lines\":%u,\"text\":\"the oldest events "
                              "were dropped, the record is bounded; totals count them\"}\n",
                              text->dropped);
    first = line_length(text, 0);
    memmove(text->bytes + first + length, text->bytes + first, text->length - first);
    memcpy(text->bytes + first, line, length);
    text->length += length;
}

/* Where the last line begins. */
static size_t last_line(const struct recorder_text *text)
{
    const char *end = text->length < 2 ? NULL : memrchr(text->bytes, '\n', text->length - 1);

    return end == NULL ? 0 : (size_t)(end - text->bytes) + 1;
}

void recorder_text_add(struct recorder_text *text, const char *line)
{
    size_t length = strlen(line), last = last_line(text);

    if (length + 1 > SHORT_MAX / 4) {
        return; /* no line of ours is so long */
    }
    /* Totals that weren't even written are replaced by newer ones. */
    if (strstr(line, "\"event\":\"totals\"") != NULL && last >= text->stored &&
        last < text->length && kind_of(text, last) == KIND_TOTALS) {
        text->length = last;
    }
    if (text->length + length + 1 > RECORDER_TEXT_MAX) {
        shorten(text);
        if (text->length > SHORT_MAX) {
            text->length = 0; /* such lines aren't ours */
        }
        say_dropped(text);
        text->changed = true;
        text->stored = 0;
    }
    memcpy(text->bytes + text->length, line, length);
    text->bytes[text->length + length] = '\n';
    text->length += length + 1;
}

void recorder_text_load(struct recorder_text *text, const char *bytes, size_t length)
{
    const char *last;
    size_t at;

    memset(text, 0, sizeof(*text));
    if (length > RECORDER_TEXT_MAX) {
        length = RECORDER_TEXT_MAX;
        text->changed = true;
    }
    last = memrchr(bytes, '\n', length);
    text->length = last == NULL ? 0 : (size_t)(last - bytes) + 1;
    text->changed = text->changed || text->length != length;
    text->stored = text->changed ? 0 : text->length;
    memcpy(text->bytes, bytes, text->length);
    at = find(text, KIND_DROPPED, true);
    if (at != SIZE_MAX) {
        char line[DROPPED_SIZE];

        snprintf(line, sizeof(line), "%.*s", (int)line_length(text, at), text->bytes + at);
        sscanf(line, "{\"event\":\"dropped\",\"lines\":%9u", &text->dropped);
    }
}
