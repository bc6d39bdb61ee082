#include "flights/recorder_read.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/utf8.h"
#include "flights/recorder_json.h"

static void copy(char *out, size_t size, const char *text)
{
    utf8_clean(out, size, text);
}

/* ---- totals ---- */

static enum recorder_began take_began(struct json_object *line)
{
    if (!json_object_is_type(recorder_json_find(line, "began_armed"), json_type_boolean)) {
        return RECORDER_UNTOLD; /* also one of an earlier version */
    }
    return recorder_json_true(line, "began_armed") ? RECORDER_ARMED : RECORDER_DISARMED;
}

#define TAKE_TIME(name, field) totals->field = recorder_json_us(line, name, 0);
#define TAKE_COUNT(name, field) totals->field = recorder_json_count(line, name);

static void take_totals(struct recorder_flight *flight, struct json_object *line, int64_t at_us)
{
    struct recorder_totals *totals = &flight->totals;
    struct json_object *spent = recorder_json_find(line, "armed_fault_s");

    totals->at_us = at_us;
    totals->armed_since_us = recorder_json_us(line, "armed_since", INT64_MIN);
    totals->began = take_began(line);
    RECORDER_SUMS(TAKE_TIME, TAKE_COUNT)
    for (enum recorder_fault_kind kind = 0; kind < RECORDER_KINDS; kind++) {
        totals->fault_us[kind] = recorder_json_us(spent, recorder_kind_name(kind), 0);
    }
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        struct recorder_channel_totals *one = &totals->channels[channel];
        struct json_object *object =
            recorder_json_find(recorder_json_find(line, "channels"), channel_name(channel));

        one->required = recorder_json_true(object, "required");
        one->armed_required = recorder_json_find(object, "armed_required") == NULL
                                  ? one->required /* of an earlier version */
                                  : recorder_json_true(object, "armed_required");
        one->known = recorder_json_known(object);
        one->first_us = recorder_json_us(object, "first", INT64_MIN);
        one->heard_us = recorder_json_us(object, "heard", INT64_MIN);
        one->silent_us = recorder_json_us(object, "silent_s", 0);
        one->longest_us = recorder_json_us(object, "longest_gap_s", 0);
        one->gaps = recorder_json_count(object, "gaps");
        flight->open_gap_us[channel] = recorder_json_us(object, "open_gap_s", 0);
    }
}

/* ---- what came behind the last totals: a power cut may have cost the next ones ---- */

static void pass_armed(struct recorder_totals *totals, int64_t at_us)
{
    int64_t from_us =
        totals->armed_since_us > totals->at_us ? totals->armed_since_us : totals->at_us;

    if (totals->armed_since_us != INT64_MIN && at_us > from_us) {
        totals->armed_us += at_us - from_us;
    }
    totals->at_us = at_us > totals->at_us ? at_us : totals->at_us;
}

static void take_armed(struct recorder_totals *totals, bool armed, int64_t at_us)
{
    pass_armed(totals, at_us);
    totals->armed_since_us = armed ? at_us : INT64_MIN;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        totals->channels[channel].armed_required |= armed && totals->channels[channel].required;
    }
}

/* ---- faults that are there still ---- */

static struct recorder_fault *find_fault(struct recorder_flight *flight, const char *name)
{
    for (unsigned i = 0; i < flight->faults; i++) {
        if (strcmp(flight->fault[i].name, name) == 0) {
            return &flight->fault[i];
        }
    }
    return NULL;
}

static void take_fault(struct recorder_flight *flight, struct json_object *line, int64_t at_us)
{
    char name[RECORDER_NAME_SIZE];
    struct recorder_fault *fault;

    copy(name, sizeof(name), recorder_json_text(line, "what", ""));
    if (name[0] == '\0' || find_fault(flight, name) != NULL || flight->faults == RECORDER_FAULTS) {
        return;
    }
    fault = &flight->fault[flight->faults++];
    memset(fault, 0, sizeof(*fault));
    memcpy(fault->name, name, sizeof(name));
    fault->there = true;
    fault->since_us = at_us;
}

static void take_fault_over(struct recorder_flight *flight, struct json_object *line)
{
    char name[RECORDER_NAME_SIZE];
    struct recorder_fault *fault;

    copy(name, sizeof(name), recorder_json_text(line, "what", ""));
    fault = find_fault(flight, name);
    if (fault != NULL) {
        *fault = flight->fault[--flight->faults];
    }
}

/* ---- the clock ---- */

/* The first one dates the record: nobody redates from afar, in the air, where the flight began. It
 * had a fix as well as any later one (autopilot_clock.h). */
static void take_clock(struct recorder_flight *flight, int64_t utc_us, int64_t at_us)
{
    int64_t offset_us = utc_us - at_us, way_us = llabs(offset_us - flight->clock_last_us);

    if (utc_us == 0) {
        return;
    }
    if (flight->clock_offset_us == 0) {
        flight->clock_offset_us = offset_us;
    } else if (way_us > flight->clock_jump_us) {
        flight->clock_jump_us = way_us;
    }
    flight->clock_last_us = offset_us;
}

/* ---- lines ---- */

static void take_event(struct recorder_flight *flight, const char *event, struct json_object *line,
                       int64_t at_us)
{
    flight->ended = false;
    if (strcmp(event, "start") == 0) {
        flight->started = true;
        flight->start_us = at_us;
        copy(flight->boot, sizeof(flight->boot), recorder_json_text(line, "boot", ""));
        copy(flight->version, sizeof(flight->version), recorder_json_text(line, "version", ""));
        copy(flight->image, sizeof(flight->image), recorder_json_text(line, "image", ""));
    } else if (strcmp(event, "totals") == 0) {
        take_totals(flight, line, at_us);
    } else if (strcmp(event, "clock") == 0) {
        take_clock(flight, recorder_json_utc_us(line, "utc"), at_us);
    } else if (strcmp(event, "armed") == 0 || strcmp(event, "disarmed") == 0) {
        take_armed(&flight->totals, strcmp(event, "armed") == 0, at_us);
    } else if (strcmp(event, "fault") == 0) {
        take_fault(flight, line, at_us);
    } else if (strcmp(event, "fault_over") == 0) {
        take_fault_over(flight, line);
    } else if (strcmp(event, "dropped") == 0) {
        flight->dropped = recorder_json_count(line, "lines");
    } else if (strcmp(event, "end") == 0) {
        flight->ended = true;
    }
}

static void take_line(struct recorder_flight *flight, const char *text, size_t length,
                      recorder_event_fn *each, void *context)
{
    struct json_object *line = recorder_json_parse(text, length);
    const char *event = recorder_json_text(line, "event", NULL);
    int64_t at_us = recorder_json_us(line, "t", INT64_MIN);

    if (event == NULL) {
        flight->bad++;
        flight->ended = false;
    } else {
        take_event(flight, event, line, at_us == INT64_MIN ? 0 : at_us);
        flight->last_us = at_us > flight->last_us ? at_us : flight->last_us;
        if (each != NULL) {
            each(context, at_us == INT64_MIN ? 0 : at_us, event, line);
        }
    }
    json_object_put(line);
}

void recorder_read(struct recorder_flight *flight, const char *text, size_t length,
                   recorder_event_fn *each, void *context)
{
    const char *end = text + length, *next;

    memset(flight, 0, sizeof(*flight));
    flight->totals.armed_since_us = INT64_MIN;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        flight->totals.channels[channel].first_us = INT64_MIN;
        flight->totals.channels[channel].heard_us = INT64_MIN;
    }
    for (; text < end; text = next + 1) {
        next = memchr(text, '\n', (size_t)(end - text));
        if (next == NULL) {
            flight->torn = true;
            flight->ended = false;
            break;
        }
        take_line(flight, text, (size_t)(next - text), each, context);
    }
    pass_armed(&flight->totals, flight->last_us);
}
