#include "flights/flights_judge.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/duration.h"

/* Whole seconds, what our own clock drifts until the next line, leap seconds that come late. */
#define CLOCK_JUMP_US 10000000

/* ---- what follows from a record ---- */

bool flight_required(const struct recorder_flight *record, enum channel channel)
{
    const struct recorder_channel_totals *totals = &record->totals.channels[channel];

    return record->totals.armed_us > 0 ? totals->armed_required : totals->required;
}

int64_t flight_silent_us(const struct recorder_flight *record, enum channel channel)
{
    return record->totals.channels[channel].silent_us + record->open_gap_us[channel];
}

int64_t flight_longest_us(const struct recorder_flight *record, enum channel channel)
{
    int64_t finished_us = record->totals.channels[channel].longest_us;
    int64_t open_us = record->open_gap_us[channel];

    return open_us > finished_us ? open_us : finished_us;
}

/* Of the armed time, in percent; rounded down, so that 100 means that nothing is missing. */
double flight_share(const struct recorder_flight *record, enum channel channel)
{
    int64_t armed_us = record->totals.armed_us;
    double of_all =
        armed_us <= 0 ? 0 : 1 - (double)flight_silent_us(record, channel) / (double)armed_us;

    return fmax(0, floor(of_all * 1000) / 10);
}

/* When something was on the air first; INT64_MIN: never. */
int64_t flight_first_us(const struct recorder_flight *record)
{
    int64_t first = INT64_MIN;

    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        int64_t one = record->totals.channels[channel].first_us;

        if (one != INT64_MIN && (first == INT64_MIN || one < first)) {
            first = one;
        }
    }
    return first;
}

const char *flight_ending(const struct flight *flight)
{
    return flight->record.ended ? "in order" : flight->running ? "running" : "power cut";
}

/* ---- the verdict ---- */

__attribute__((format(printf, 2, 3))) static void append(char sentence[FLIGHT_SENTENCE_SIZE],
                                                         const char *format, ...)
{
    size_t length = strlen(sentence);
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(sentence + length, FLIGHT_SENTENCE_SIZE - length, format, arguments);
    va_end(arguments);
}

static void append_channels(char sentence[FLIGHT_SENTENCE_SIZE],
                            const struct recorder_flight *record, bool without_gap)
{
    bool any = false;
    char longest[32];

    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        if (!flight_required(record, channel) ||
            (flight_silent_us(record, channel) == 0) != without_gap) {
            continue;
        }
        append(sentence, "%s%s", any ? ", " : "", channel_title(channel));
        any = true;
        if (!without_gap && flight_silent_us(record, channel) >= record->totals.armed_us) {
            append(sentence, " never");
        } else if (!without_gap) {
            duration_text(longest, sizeof(longest), duration_s(flight_longest_us(record, channel)));
            append(sentence, " %.1f %%, longest gap %s", flight_share(record, channel), longest);
        }
    }
}

/* What was sent lacked something, or wasn't to be believed, however well it was sent. */
static void append_lacks(char sentence[FLIGHT_SENTENCE_SIZE], const struct recorder_flight *record)
{
    static const struct {
        enum recorder_fault_kind kind;
        const char *words;
    } lacks[] = {{RECORDER_POSITION, "without a position"},
                 {RECORDER_IDENTITY, "without a whole identity"},
                 {RECORDER_FAILURE, "said Remote ID failure"},
                 {RECORDER_EMERGENCY, "said an emergency"},
                 {RECORDER_SIMULATED, "simulated"},
                 {RECORDER_SOURCES, "two sources spoke"}};
    char lasted[32];

    for (size_t i = 0; i < sizeof(lacks) / sizeof(lacks[0]); i++) {
        int64_t lacked_us = record->totals.fault_us[lacks[i].kind];

        if (lacked_us > 0) {
            duration_text(lasted, sizeof(lasted), duration_s(lacked_us));
            append(sentence, ", %s for %s", lacks[i].words, lasted);
        }
    }
}

/* What goes by the clock of a recorder that stood still is nobody's word. */
static void append_unwatched(char sentence[FLIGHT_SENTENCE_SIZE],
                             const struct recorder_flight *record)
{
    char lasted[32];

    if (record->totals.unwatched_us > 0) {
        duration_text(lasted, sizeof(lasted), duration_s(record->totals.unwatched_us));
        append(sentence, ", unwatched for %s", lasted);
    }
}

/* The record's date is then to be taken with care: somebody may speak as the satellites. */
static void append_clock(char sentence[FLIGHT_SENTENCE_SIZE], const struct recorder_flight *record)
{
    char way[32];

    if (record->clock_jump_us > CLOCK_JUMP_US) {
        duration_text(way, sizeof(way), duration_s(record->clock_jump_us));
        append(sentence, "; the autopilot's clock jumped by %s", way);
    }
}

/* What stood there may have been a silence. */
static void append_damage(char sentence[FLIGHT_SENTENCE_SIZE], const struct recorder_flight *record)
{
    if (record->bad > 0) {
        append(sentence, "; %u line%s of the record can't be understood", record->bad,
               record->bad == 1 ? "" : "s");
    }
}

/* Each start costs a moment of everything, which may be too short to be a gap. */
static void append_restarts(char sentence[FLIGHT_SENTENCE_SIZE],
                            const struct recorder_flight *record)
{
    unsigned restarts = record->totals.armed_restarts;

    if (restarts > 0) {
        append(sentence, ", the daemon started again %u time%s", restarts,
               restarts == 1 ? "" : "s");
    }
}

/* It may have flown then. before: what it follows. */
static void append_untold(char sentence[FLIGHT_SENTENCE_SIZE], const char *before,
                          int64_t untold_us)
{
    char lasted[32];

    duration_text(lasted, sizeof(lasted), duration_s(untold_us));
    append(sentence, "%snobody said for %s whether it was armed", before, lasted);
}

/* What was before the record, or is behind it, nobody saw: another record, or none, has it. */
static void append_bounds(char sentence[FLIGHT_SENTENCE_SIZE], const struct flight *flight)
{
    if (flight->record.totals.began == RECORDER_ARMED) {
        append(sentence, ", armed when the record began");
    }
    if (!flight->running && flight->record.totals.armed_since_us != INT64_MIN) {
        append(sentence, ", the record ends while armed");
    }
    if (flight->record.totals.armed_us > 0 && flight->record.totals.untold_later_us > 0) {
        append_untold(sentence, "; ", flight->record.totals.untold_later_us);
    }
}

static void judge_unarmed(char sentence[FLIGHT_SENTENCE_SIZE], const struct recorder_flight *record)
{
    if (record->totals.untold_us > 0) {
        append_untold(sentence, "", record->totals.untold_us);
    } else {
        append(sentence, "never armed");
    }
    append(sentence, "%s", flight_first_us(record) == INT64_MIN ? ", and never on the air" : "");
}

static void judge_flight(char sentence[FLIGHT_SENTENCE_SIZE], const struct recorder_flight *record)
{
    unsigned required = 0, whole = 0, never = 0;

    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        if (flight_required(record, channel)) {
            required++;
            whole += flight_silent_us(record, channel) == 0;
            never += flight_silent_us(record, channel) >= record->totals.armed_us;
        }
    }
    if (required == 0 || never == required) {
        append(sentence, "NOT on the air in flight");
        return;
    }
    if (whole == required) {
        append(sentence, "on the air the whole flight");
    } else if (whole > 0) {
        append(sentence, "on the air the whole flight by ");
        append_channels(sentence, record, true);
        append(sentence, "; gaps: ");
        append_channels(sentence, record, false);
    } else {
        append(sentence, "on the air WITH GAPS: ");
        append_channels(sentence, record, false);
    }
    append_lacks(sentence, record);
    append_restarts(sentence, record);
    append_unwatched(sentence, record);
}

void flight_judge(char sentence[FLIGHT_SENTENCE_SIZE], const struct flight *flight)
{
    const struct recorder_flight *record = &flight->record;

    sentence[0] = '\0';
    if (!record->started) {
        append(sentence, "the record can't be understood");
    } else if (record->totals.armed_us > 0) {
        judge_flight(sentence, record);
        append_bounds(sentence, flight);
    } else if (record->totals.armed_since_us != INT64_MIN) {
        append(sentence, "just armed");
        append_bounds(sentence, flight);
    } else {
        judge_unarmed(sentence, record);
    }
    if (record->started) {
        append_damage(sentence, record);
    }
    append_clock(sentence, record);
}
