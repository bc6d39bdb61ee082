#include "flights/flights_show.h"

#include <dirent.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/duration.h"
#include "base/json_clean.h"
#include "base/utf8.h"
#include "flights/flights_judge.h"
#include "flights/recorder_json.h"
#include "flights/recorder_store.h"

#define WHEN_SIZE 32
#define CELL_SIZE 32
#define EVENT_SIZE 512

static char text[RECORDER_TEXT_MAX];

/* ---- times ---- */

/* Power-on in UTC: "2026-01-02T03:04:05Z", or to the minute; "clock unknown". */
static void format_start(char out[WHEN_SIZE], const struct recorder_flight *record, bool precise)
{
    time_t unix_s = (time_t)(record->clock_offset_us / 1000000);
    struct tm utc;

    if (record->clock_offset_us == 0 || gmtime_r(&unix_s, &utc) == NULL) {
        snprintf(out, WHEN_SIZE, "clock unknown");
    } else if (precise) {
        strftime(out, WHEN_SIZE, "%Y-%m-%dT%H:%M:%SZ", &utc);
    } else {
        strftime(out, WHEN_SIZE, "%Y-%m-%d %H:%M", &utc);
    }
}

/* "-" for what never was. */
static void format_span(char out[CELL_SIZE], int64_t us)
{
    if (us == INT64_MIN) {
        snprintf(out, CELL_SIZE, "never");
    } else if (us == 0) {
        snprintf(out, CELL_SIZE, "-");
    } else {
        duration_text(out, CELL_SIZE, duration_s(us));
    }
}

/* ---- the table ---- */

static void format_channel(char out[CELL_SIZE], const struct recorder_flight *record,
                           enum channel channel)
{
    char longest[CELL_SIZE];

    if (!flight_required(record, channel) || record->totals.armed_us <= 0) {
        snprintf(out, CELL_SIZE, "-");
    } else if (flight_silent_us(record, channel) == 0) {
        snprintf(out, CELL_SIZE, "100 %%");
    } else {
        duration_text(longest, sizeof(longest), duration_s(flight_longest_us(record, channel)));
        snprintf(out, CELL_SIZE, "%.1f %% %.14s", flight_share(record, channel), longest);
    }
}

#define ROW "%-6s %-17s %-8s %-8s %-7s %-15s %-15s %-15s %s\n"

static void print_row(FILE *out, const struct flight *flight)
{
    const struct recorder_flight *record = &flight->record;
    char number[16], when[WHEN_SIZE], lasted[CELL_SIZE], armed[CELL_SIZE], first[CELL_SIZE];
    char channels[CHANNELS][CELL_SIZE], faults[16], sentence[FLIGHT_SENTENCE_SIZE];

    snprintf(number, sizeof(number), "%u", flight->number);
    snprintf(faults, sizeof(faults), "%u", record->totals.faults);
    format_start(when, record, false);
    format_span(lasted, record->last_us);
    format_span(armed, record->totals.armed_us);
    format_span(first, flight_first_us(record));
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        format_channel(channels[channel], record, channel);
    }
    flight_judge(sentence, flight);
    fprintf(out, ROW, number, when, lasted, armed, first, channels[CHANNEL_BT4],
            channels[CHANNEL_BT5], channels[CHANNEL_WIFI], faults);
    fprintf(out, "%-6s %s; %s\n", "", sentence,
            flight->running        ? "it is being recorded"
            : flight->record.ended ? "ended in order"
                                   : "power cut");
}

static void print_head(FILE *out)
{
    fprintf(out, ROW, "Number", "Start (UTC)", "Lasted", "Armed", "On air", "Bluetooth 4",
            "Bluetooth 5", "Wi-Fi", "Faults");
    fprintf(out, ROW, "", "power-on", "", "", "after", "of armed, gap", "of armed, gap",
            "of armed, gap", "");
}

/* ---- one in detail ---- */

static void describe(char *sentence, size_t size, const char *event, struct json_object *line)
{
    static const char *const plain[][2] = {
        {"start", "the record begins"},
        {"armed", "armed"},
        {"daemon_restarted", "odid-daemon was started again"},
        {"recorder_restarted", "odid-recorder was started again"},
        {"end", "ended in order"},
    };
    const char *channel = recorder_json_text(line, "channel", "");
    char lasted[32];

    duration_text(lasted, sizeof(lasted), duration_s(recorder_json_us(line, "seconds", 0)));
    for (enum channel i = 0; i < CHANNELS; i++) {
        channel = strcmp(channel, channel_name(i)) == 0 ? channel_title(i) : channel;
    }
    if (strcmp(event, "first_broadcast") == 0) {
        snprintf(sentence, size, "%s is on the air for the first time", channel);
    } else if (strcmp(event, "gap") == 0) {
        snprintf(sentence, size, "%s had a gap of %s%s", channel, lasted,
                 recorder_json_true(line, "armed") ? "" : ", disarmed");
    } else if (strcmp(event, "unwatched") == 0) {
        snprintf(sentence, size, "nobody looked for %s", lasted);
    } else if (strcmp(event, "disarmed") == 0) {
        snprintf(sentence, size, "disarmed, after %s", lasted);
    } else if (strcmp(event, "clock") == 0) {
        snprintf(sentence, size, "the autopilot says that it is %s",
                 recorder_json_text(line, "utc", "?"));
    } else if (strcmp(event, "update") == 0) {
        snprintf(sentence, size, "update: %s", recorder_json_text(line, "text", "?"));
    } else if (strcmp(event, "fault") == 0) {
        snprintf(sentence, size, "FAULT %s: %s", recorder_json_text(line, "what", "?"),
                 recorder_json_text(line, "text", "?"));
    } else if (strcmp(event, "fault_over") == 0) {
        snprintf(sentence, size, "over: %s, after %s", recorder_json_text(line, "what", "?"),
                 lasted);
    } else {
        snprintf(sentence, size, "%s", event);
        for (size_t i = 0; i < sizeof(plain) / sizeof(plain[0]); i++) {
            if (strcmp(event, plain[i][0]) == 0) {
                snprintf(sentence, size, "%s", plain[i][1]);
            }
        }
    }
}

/* A record's texts are what the programs wrote that it speaks of: they move no terminal's cursor.
 */
static void print_event(FILE *out, int64_t at_us, struct json_object *line)
{
    const char *event = recorder_json_text(line, "event", "");
    char sentence[EVENT_SIZE], shown[EVENT_SIZE];

    if (strcmp(event, "dropped") == 0) {
        fprintf(out, "  %10s  %u older events were dropped here: a record has a bound\n", "...",
                recorder_json_count(line, "lines"));
        return;
    }
    describe(sentence, sizeof(sentence), event, line);
    utf8_clean(shown, sizeof(shown), sentence);
    fprintf(out, "  %8.1f s  %s\n", duration_s(at_us), shown);
}

/* Totals are shown above the list. */
static void collect_event(void *context, int64_t at_us, const char *event, struct json_object *line)
{
    (void)at_us;
    if (strcmp(event, "totals") != 0) {
        json_object_array_add(context, json_object_get(line));
    }
}

static struct json_object *read_events(size_t length)
{
    static struct recorder_flight again;
    struct json_object *events = json_object_new_array();

    recorder_read(&again, text, length, collect_event, events);
    return events;
}

static int64_t event_time(const void *event)
{
    return recorder_json_us(*(struct json_object *const *)event, "t", 0);
}

/* Gaps are written when they are over, and begin before what is written already. */
static int earliest_first(const void *a, const void *b)
{
    int64_t first_us = event_time(a), second_us = event_time(b);

    return first_us < second_us ? -1 : first_us > second_us;
}

static void print_events(FILE *out, size_t length)
{
    struct json_object *events = read_events(length);

    json_object_array_sort(events, earliest_first);
    for (size_t i = 0; i < json_object_array_length(events); i++) {
        struct json_object *event = json_object_array_get_idx(events, i);

        print_event(out, event_time(&event), event);
    }
    json_object_put(events);
}

static void print_detail_channel(FILE *out, const struct recorder_flight *record,
                                 enum channel channel)
{
    const struct recorder_channel_totals *totals = &record->totals.channels[channel];
    static const char *const by_whom[] = {
        [RADIO_SET] = "",
        [RADIO_COUNTED] = "; at times told by its chip's own count",
        [RADIO_HEARD] = "; at times heard by another radio",
    };
    unsigned gaps = totals->gaps + (record->open_gap_us[channel] > 0);
    char first[CELL_SIZE], longest[CELL_SIZE];

    fprintf(out, "  %-12s ", channel_title(channel));
    if (!flight_required(record, channel)) {
        fprintf(out, "not required\n");
        return;
    }
    format_span(first, totals->first_us);
    fprintf(out, "first on the air%s %s", totals->first_us == INT64_MIN ? ":" : " after", first);
    if (record->totals.armed_us > 0 && gaps == 0) {
        fprintf(out, "; armed, without a gap");
    } else if (record->totals.armed_us > 0) {
        duration_text(longest, sizeof(longest), duration_s(flight_longest_us(record, channel)));
        fprintf(out, "; %.1f %% of the armed time, %u gap%s, the longest %s%s",
                flight_share(record, channel), gaps, gaps == 1 ? "" : "s", longest,
                record->open_gap_us[channel] > 0 ? ", one unfinished" : "");
    }
    fprintf(out, "%s\n", by_whom[totals->known]);
}

/* For how long it was armed, or that it isn't known. */
static void print_armed(FILE *out, const struct recorder_totals *totals)
{
    char lasted[CELL_SIZE];

    if (totals->armed_us > 0) {
        format_span(lasted, totals->armed_us);
        fprintf(out, "armed %s\n", lasted);
    } else if (totals->untold_us > 0) {
        format_span(lasted, totals->untold_us);
        fprintf(out, "whether armed was not said for %s\n", lasted);
    } else {
        fputs("never armed\n", out);
    }
}

static void print_summary(FILE *out, const struct flight *flight)
{
    const struct recorder_flight *record = &flight->record;
    char when[WHEN_SIZE], lasted[CELL_SIZE];

    format_start(when, record, true);
    format_span(lasted, record->last_us);
    fprintf(out, "  %-12s %s, recorded from %.1f s after it\n", "Power-on", when,
            duration_s(record->start_us));
    fprintf(out, "  %-12s %s, ", "Lasted", lasted);
    print_armed(out, &record->totals);
    fprintf(out, "  %-12s odid-daemon %s, image %s\n", "Software", record->version, record->image);
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        print_detail_channel(out, record, channel);
    }
    fprintf(out, "  %-12s %u, %u of them while armed\n", "Faults", record->totals.faults,
            record->totals.armed_faults);
    fprintf(out, "  %-12s started again %u time%s\n", "Daemon", record->totals.restarts,
            record->totals.restarts == 1 ? "" : "s");
}

static void print_detail(FILE *out, const struct flight *flight, size_t length)
{
    const struct recorder_flight *record = &flight->record;
    char sentence[FLIGHT_SENTENCE_SIZE];

    flight_judge(sentence, flight);
    fprintf(out, "Flight record %u: %s\n\n", flight->number, sentence);
    if (record->started) {
        print_summary(out, flight);
    }
    fprintf(out, "  %-12s %s%s\n", "End", flight_ending(flight),
            record->torn ? " (the last line is torn, and left out)" : "");
    if (record->bad > 0) {
        fprintf(out, "  %-12s %u line%s can't be understood, and %s left out\n", "Damage",
                record->bad, record->bad == 1 ? "" : "s", record->bad == 1 ? "is" : "are");
    }
    fprintf(out, "\nEvents, by the time since power-on\n");
    print_events(out, length);
}

/* ---- JSON ---- */

static void add_seconds(struct json_object *parent, const char *name, int64_t us)
{
    struct json_object *number = NULL;

    if (us != INT64_MIN) {
        number = json_object_new_double(duration_s(us));
        json_object_set_serializer(number, json_object_double_to_json_string, "%.2f", NULL);
    }
    json_object_object_add(parent, name, number);
}

static struct json_object *channel_json(const struct recorder_flight *record, enum channel channel)
{
    const struct recorder_channel_totals *totals = &record->totals.channels[channel];
    struct json_object *object = json_object_new_object();
    bool required = flight_required(record, channel);
    bool counts = required && record->totals.armed_us > 0;

    json_object_object_add(object, "required", json_object_new_boolean(required));
    json_object_object_add(object, "known",
                           json_object_new_string(radio_known_name(totals->known)));
    add_seconds(object, "first_broadcast_s", totals->first_us);
    add_seconds(object, "armed_on_air_s",
                counts ? record->totals.armed_us - flight_silent_us(record, channel) : INT64_MIN);
    add_seconds(object, "armed_longest_gap_s",
                counts ? flight_longest_us(record, channel) : INT64_MIN);
    json_object_object_add(
        object, "armed_gaps",
        json_object_new_int64(totals->gaps + (record->open_gap_us[channel] > 0)));
    return object;
}

static struct json_object *flight_json(const struct flight *flight)
{
    const struct recorder_flight *record = &flight->record;
    struct json_object *object = json_object_new_object(), *channels = json_object_new_object();
    char when[WHEN_SIZE], sentence[FLIGHT_SENTENCE_SIZE];

    flight_judge(sentence, flight);
    format_start(when, record, true);
    json_object_object_add(object, "number", json_object_new_int64(flight->number));
    json_object_object_add(object, "start_utc",
                           record->clock_offset_us == 0 ? NULL : json_object_new_string(when));
    add_seconds(object, "duration_s", record->last_us);
    add_seconds(object, "armed_s", record->totals.armed_us);
    add_seconds(object, "unwatched_s", record->totals.unwatched_us);
    add_seconds(object, "untold_s", record->totals.untold_us);
    add_seconds(object, "first_broadcast_s", flight_first_us(record));
    json_object_object_add(object, "channels", channels);
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        json_object_object_add(channels, channel_name(channel), channel_json(record, channel));
    }
    json_object_object_add(object, "faults", json_object_new_int64(record->totals.faults));
    json_object_object_add(object, "armed_faults",
                           json_object_new_int64(record->totals.armed_faults));
    json_object_object_add(object, "daemon_restarts",
                           json_object_new_int64(record->totals.restarts));
    json_object_object_add(object, "armed_daemon_restarts",
                           json_object_new_int64(record->totals.armed_restarts));
    json_object_object_add(object, "ended", json_object_new_string(flight_ending(flight)));
    json_object_object_add(object, "torn", json_object_new_boolean(record->torn));
    json_object_object_add(object, "bad_lines", json_object_new_int64(record->bad));
    json_object_object_add(object, "dropped_events", json_object_new_int64(record->dropped));
    json_object_object_add(object, "version", json_object_new_string(record->version));
    json_object_object_add(object, "image", json_object_new_string(record->image));
    json_object_object_add(object, "verdict", json_object_new_string(sentence));
    return object;
}

static void print_json(FILE *out, struct json_object *value)
{
    json_clean(value);
    fprintf(out, "%s\n",
            json_object_to_json_string_ext(value, JSON_C_TO_STRING_PRETTY |
                                                      JSON_C_TO_STRING_SPACED |
                                                      JSON_C_TO_STRING_NOSLASHESCAPE));
}

/* ---- reading ---- */

/* Returns the text's length, or -errno, which is said. */
static ssize_t read_flight(struct flight *flight, const char *directory, unsigned number,
                           const char *boot)
{
    ssize_t length = recorder_store_read(directory, number, text, sizeof(text));

    if (length < 0) {
        fprintf(stderr, "odidctl: %s/%05u.jsonl: %s\n", directory, number, strerror((int)-length));
        return length;
    }
    flight->number = number;
    recorder_read(&flight->record, text, (size_t)length, NULL, NULL);
    flight->running = !flight->record.ended && boot[0] != '\0' && flight->record.started &&
                      strcmp(flight->record.boot, boot) == 0;
    return length;
}

static int newest_first(const void *a, const void *b)
{
    unsigned first = *(const unsigned *)a, second = *(const unsigned *)b;

    return first < second ? 1 : first > second ? -1 : 0;
}

/* Returns how many there are, or -errno. The caller frees *numbers. */
static int list(const char *directory, unsigned **numbers)
{
    DIR *listing = opendir(directory);
    const struct dirent *entry;
    int count = 0;

    *numbers = NULL;
    if (listing == NULL) {
        return -errno;
    }
    while ((entry = readdir(listing)) != NULL) {
        unsigned number = recorder_store_number(entry->d_name);
        unsigned *more =
            number == 0 ? NULL : realloc(*numbers, ((size_t)count + 1) * sizeof(**numbers));

        if (more != NULL) {
            *numbers = more;
            more[count++] = number;
        }
    }
    closedir(listing);
    if (count > 0) {
        qsort(*numbers, (size_t)count, sizeof(**numbers), newest_first);
    }
    return count;
}

static int show_all(FILE *out, const char *directory, const char *boot, bool json)
{
    static struct flight flight;
    struct json_object *array;
    unsigned *numbers;
    int count = list(directory, &numbers), failed = 0;

    if (count < 0) {
        fprintf(stderr, "odidctl: no flight records: %s: %s\n", directory, strerror(-count));
        return 1;
    }
    array = json ? json_object_new_array() : NULL;
    if (!json && count == 0) {
        fprintf(out, "No flight is recorded yet in %s.\n", directory);
    } else if (!json) {
        print_head(out);
    }
    for (int i = 0; i < count; i++) {
        if (read_flight(&flight, directory, numbers[i], boot) < 0) {
            failed = 1;
        } else if (json) {
            json_object_array_add(array, flight_json(&flight));
        } else {
            print_row(out, &flight);
        }
    }
    if (json) {
        print_json(out, array);
        json_object_put(array);
    }
    free(numbers);
    return failed;
}

static int show_one(FILE *out, const char *directory, const char *number, const char *boot,
                    bool json)
{
    static struct flight flight;
    size_t digits = strspn(number, "0123456789");
    ssize_t length;

    if (digits == 0 || digits > 9 || number[digits] != '\0') {
        fprintf(stderr, "odidctl: flights \"%s\": expected the number of a flight record\n",
                number);
        return 1;
    }
    length = read_flight(&flight, directory, (unsigned)strtoul(number, NULL, 10), boot);
    if (length < 0) {
        return 1;
    }
    if (json) {
        struct json_object *object = flight_json(&flight);

        json_object_object_add(object, "events", read_events((size_t)length));
        print_json(out, object);
        json_object_put(object);
    } else {
        print_detail(out, &flight, (size_t)length);
    }
    return 0;
}

int flights_show(FILE *out, const char *directory, const char *number, const char *boot, bool json)
{
    return number == NULL ? show_all(out, directory, boot, json)
                          : show_one(out, directory, number, boot, json);
}
