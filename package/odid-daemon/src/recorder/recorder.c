#include "recorder/recorder.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/duration.h"

/* Ages are told in hundredths of a second. */
#define ROUNDING_US 20000
/* A daemon that started so much later is another one. */
#define RESTART_US 500000
/* A new one has to set up its channels and hear its autopilot: the gaps say what that cost. What is
 * missing for longer than that is missing, however often a new one came. */
#define DAEMON_STARTING_US 5000000
/* A look each second, and less than a second for an answer: what took longer than this nobody saw.
 */
#define UNWATCHED_US 3000000
/* An autopilot takes so long to start, or a daemon to start again. */
#define UNTOLD_US 10000000
/* The autopilot tells its time in whole seconds; a jump above this is said, once a minute at most.
 */
#define CLOCK_JUMP_US 2500000
#define CLOCK_SAY_EVERY_US 60000000

bool recorder_armed(const struct recorder *recorder)
{
    return recorder->totals.armed_since_us != INT64_MIN;
}

/* ---- lines ---- */

static void say(struct recorder *recorder, int64_t at_us, const char *event, const char *format,
                ...) __attribute__((format(printf, 4, 5)));

/* format: the further fields, each with a comma before it. */
static void say(struct recorder *recorder, int64_t at_us, const char *event, const char *format,
                ...)
{
    char line[RECORDER_LINE_SIZE];
    va_list arguments;
    size_t length = (size_t)snprintf(line, sizeof(line), "{\"t\":%.2f,\"event\":\"%s\"",
                                     duration_s(at_us), event);

    va_start(arguments, format);
    vsnprintf(line + length, sizeof(line) - length, format, arguments);
    va_end(arguments);
    length = strlen(line);
    if (length < sizeof(line) - 1) { /* they all fit: their parts are bounded */
        strcpy(line + length, "}");
        recorder->line(recorder->context, line);
    }
}

/* Text was cleaned where it came in: nothing is left to escape but these two. */
static const char *escape(const char *text, char out[2 * RECORDER_TEXT_SIZE])
{
    size_t filled = 0;

    for (; *text != '\0' && filled < 2 * RECORDER_TEXT_SIZE - 2; text++) {
        if (*text == '"' || *text == '\\') {
            out[filled++] = '\\';
        }
        out[filled++] = *text;
    }
    out[filled] = '\0';
    return out;
}

/* ---- gaps ---- */

static int64_t later(int64_t a_us, int64_t b_us)
{
    return a_us > b_us ? a_us : b_us;
}

/* The armed part of a silence that lasts up to until_us and isn't counted yet. */
static int64_t armed_silence_us(const struct recorder *recorder, enum channel channel,
                                int64_t until_us)
{
    int64_t from_us = later(recorder->totals.channels[channel].heard_us,
                            later(recorder->settled_us[channel], recorder->totals.armed_since_us));

    return recorder_armed(recorder) && until_us > from_us ? until_us - from_us : 0;
}

/* Counts it; the silence itself may go on. Returns the armed part. */
static int64_t settle(struct recorder *recorder, enum channel channel, int64_t until_us)
{
    struct recorder_channel_totals *totals = &recorder->totals.channels[channel];
    int64_t silent_us = armed_silence_us(recorder, channel, until_us);

    recorder->settled_us[channel] = until_us;
    if (silent_us > 0) {
        totals->silent_us += silent_us;
        totals->longest_us = later(totals->longest_us, silent_us);
        totals->gaps++;
    }
    return silent_us;
}

int64_t recorder_open_gap_us(const struct recorder *recorder, enum channel channel)
{
    const struct recorder_channel_totals *totals = &recorder->totals.channels[channel];
    int64_t now_us = recorder->totals.at_us;

    /* Shorter than that it may be none. */
    if (!totals->armed_required ||
        (totals->heard_us != INT64_MIN && now_us - totals->heard_us <= RADIO_PAUSE_US)) {
        return 0;
    }
    return armed_silence_us(recorder, channel, now_us);
}

/* It was taken for sending a moment before it was found silent: it had last been known to at_us.
 * What is counted already stays so. */
static void take_back(struct recorder *recorder, enum channel channel, int64_t at_us)
{
    struct recorder_channel_totals *totals = &recorder->totals.channels[channel];

    if (at_us != INT64_MIN) { /* a daemon's first */
        at_us = later(at_us, recorder->settled_us[channel]);
        totals->heard_us = at_us < totals->heard_us ? at_us : totals->heard_us;
    }
}

static void take_channel(struct recorder *recorder, enum channel channel,
                         const struct recorder_channel_status *status)
{
    struct recorder_channel_totals *totals = &recorder->totals.channels[channel];
    int64_t silent_us;

    totals->required = status->required || (totals->first_us != INT64_MIN && !status->disabled);
    totals->armed_required |= totals->required && recorder_armed(recorder);
    if (!totals->required && !status->disabled) { /* it was, until its hardware was known */
        totals->armed_required = false;
    }
    if (!totals->required && (!totals->armed_required || !recorder_armed(recorder))) {
        /* Its silence is wanted. Of a flight that had it the silence counts, whoever wants it. */
        recorder->settled_us[channel] = totals->heard_us = recorder->totals.at_us;
        return;
    }
    if (status->confirmed_us == INT64_MIN) {
        return; /* a new daemon that isn't on the air yet, or nothing ever was */
    }
    if (totals->first_us == INT64_MIN) {
        settle(recorder, channel, status->unbroken_us);
        totals->first_us = status->unbroken_us;
        say(recorder, totals->first_us, "first_broadcast", ",\"channel\":\"%s\"",
            channel_name(channel));
    } else if (status->unbroken_us > totals->heard_us + ROUNDING_US) {
        take_back(recorder, channel, status->paused_us);
        silent_us = settle(recorder, channel, status->unbroken_us);
        say(recorder, totals->heard_us, "gap", ",\"channel\":\"%s\",\"seconds\":%.2f,\"armed\":%s",
            channel_name(channel), duration_s(status->unbroken_us - totals->heard_us),
            silent_us > 0 ? "true" : "false");
    }
    if (!status->on_air) {
        take_back(recorder, channel, status->confirmed_us);
    }
    totals->heard_us = later(totals->heard_us, status->confirmed_us);
    totals->known = status->known > totals->known ? status->known : totals->known;
}

/* ---- faults ---- */

static void count_while_armed(struct recorder *recorder, struct recorder_fault *fault)
{
    if (fault->there && !fault->was_armed && recorder_armed(recorder)) {
        fault->was_armed = true;
        recorder->totals.armed_faults++;
    }
}

static void set_fault(struct recorder *recorder, struct recorder_fault *fault, bool there,
                      const char *text)
{
    char escaped[2 * RECORDER_TEXT_SIZE];
    int64_t now_us = recorder->totals.at_us;

    if (there == fault->there) {
        return;
    }
    fault->there = there;
    if (!there) {
        say(recorder, now_us, "fault_over", ",\"what\":\"%s\",\"seconds\":%.2f", fault->name,
            duration_s(now_us - fault->since_us));
        return;
    }
    fault->since_us = now_us;
    fault->was_armed = false;
    recorder->totals.faults++;
    count_while_armed(recorder, fault);
    say(recorder, now_us, "fault", ",\"what\":\"%s\",\"text\":\"%s\"", fault->name,
        escape(text, escaped));
}

/* When what a flight needs counts as missing: only if it was there before, or in any case. */
enum due { DUE_NOT_NOW, DUE_IF_SEEN, DUE };

static void need(struct recorder *recorder, enum recorder_fault_kind kind, bool good, enum due due,
                 const char *text)
{
    struct recorder_fault *fault = &recorder->faults[kind];

    if (good) {
        recorder->seen[kind] = true;
        recorder->good_us[kind] = recorder->totals.at_us;
    }
    set_fault(recorder, fault,
              !good && (fault->there || due == DUE || (due == DUE_IF_SEEN && recorder->seen[kind])),
              text);
}

/* What the daemon's kinds are needed with; one that has just been started is given time. */
static void need_of_daemon(struct recorder *recorder, enum recorder_fault_kind kind, bool good,
                           enum due due, const char *text)
{
    int64_t now_us = recorder->totals.at_us;
    bool starting = now_us - recorder->daemon_start_us < DAEMON_STARTING_US &&
                    now_us - recorder->good_us[kind] < DAEMON_STARTING_US;

    need(recorder, kind, good, starting ? DUE_NOT_NOW : due, text);
}

static void take_needs(struct recorder *recorder, const struct recorder_snapshot *snapshot)
{
    int64_t now_us = recorder->totals.at_us;
    bool armed = recorder_armed(recorder);
    enum due started =
        armed || now_us - recorder->start_us >= RECORDER_STARTING_US ? DUE : DUE_IF_SEEN;
    enum due in_flight = armed ? DUE : DUE_IF_SEEN;

    need(recorder, RECORDER_DAEMON, snapshot->answered, started, snapshot->text);
    if (!snapshot->answered) {
        return; /* nothing is known of the others */
    }
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        const struct recorder_channel_status *status = &snapshot->channels[channel];
        bool required = recorder->totals.channels[channel].required;

        need_of_daemon(recorder, RECORDER_CHANNEL + channel, !required || status->on_air, started,
                       status->text);
        /* When it is required again, it has to start first. */
        recorder->seen[RECORDER_CHANNEL + channel] &= required;
    }
    need_of_daemon(recorder, RECORDER_LINK, snapshot->link, in_flight,
                   snapshot->speaks       ? "no HEARTBEAT from the autopilot"
                   : snapshot->another_id ? "another system id speaks than the vehicle's"
                                          : "nothing is heard from the autopilot");
    need_of_daemon(recorder, RECORDER_POSITION, snapshot->position, in_flight,
                   "no position from the autopilot");
    need_of_daemon(recorder, RECORDER_IDENTITY, snapshot->identity, started,
                   "Basic ID or operator number is missing");
    need(recorder, RECORDER_SOURCES, !snapshot->two_sources, DUE,
         "two sources speak as the autopilot");
    need(recorder, RECORDER_EMERGENCY, !snapshot->emergency, DUE, "an emergency is broadcast");
    need(recorder, RECORDER_FAILURE, !snapshot->failure, DUE, "Remote ID failure is broadcast");
    need(recorder, RECORDER_SIMULATED, !snapshot->simulated, DUE,
         "the autopilot flies in a simulation");
}

/* A short one that was over before anybody looked is said all the same. */
static void take_supply(struct recorder *recorder, enum recorder_fault_kind kind, bool now,
                        bool was, const char *text)
{
    struct recorder_fault *fault = &recorder->faults[kind];

    if (was && !now && !fault->there) {
        set_fault(recorder, fault, true, text);
    }
    set_fault(recorder, fault, now, text);
}

static struct recorder_fault *board_fault(struct recorder *recorder, const char *name)
{
    struct recorder_fault *free_one = NULL;

    for (size_t i = RECORDER_KINDS; i < RECORDER_FAULTS; i++) {
        struct recorder_fault *fault = &recorder->faults[i];

        if (fault->there && strcmp(fault->name, name) == 0) {
            return fault;
        }
        if (!fault->there && free_one == NULL) {
            free_one = fault;
        }
    }
    if (free_one != NULL) {
        snprintf(free_one->name, sizeof(free_one->name), "%s", name);
    }
    return free_one;
}

static void take_board(struct recorder *recorder, const struct recorder_board *board)
{
    take_supply(recorder, RECORDER_UNDERVOLTAGE, board->undervoltage, board->was_undervoltage,
                "the board's supply voltage is too low");
    take_supply(recorder, RECORDER_THROTTLED, board->throttled, board->was_throttled,
                "the processor is slowed down by heat or low voltage");
    for (size_t i = RECORDER_KINDS; i < RECORDER_FAULTS; i++) {
        struct recorder_fault *fault = &recorder->faults[i];
        bool listed = false;

        for (unsigned j = 0; j < board->faults; j++) {
            listed = listed || strcmp(board->fault[j].name, fault->name) == 0;
        }
        if (fault->there && !listed) {
            set_fault(recorder, fault, false, "");
        }
    }
    for (unsigned j = 0; j < board->faults; j++) {
        struct recorder_fault *fault = board_fault(recorder, board->fault[j].name);

        if (fault != NULL) { /* always: there are as many places as it can list */
            set_fault(recorder, fault, true, board->fault[j].text);
        }
    }
}

/* ---- armed, clock, the daemon's restarts ---- */

static void take_armed(struct recorder *recorder, bool armed)
{
    struct recorder_totals *totals = &recorder->totals;

    if (totals->began == RECORDER_UNTOLD) {
        totals->began = armed ? RECORDER_ARMED : RECORDER_DISARMED;
    }
    if (armed == recorder_armed(recorder)) {
        return;
    }
    if (armed) {
        totals->armed_since_us = totals->at_us;
        say(recorder, totals->at_us, "armed", "%s", "");
        for (enum channel channel = 0; channel < CHANNELS; channel++) {
            totals->channels[channel].armed_required |= totals->channels[channel].required;
        }
        for (size_t i = 0; i < RECORDER_FAULTS; i++) {
            count_while_armed(recorder, &recorder->faults[i]);
        }
        return;
    }
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        if (recorder_open_gap_us(recorder, channel) > 0) {
            settle(recorder, channel, totals->at_us);
        }
    }
    say(recorder, totals->at_us, "disarmed", ",\"seconds\":%.2f",
        duration_s(totals->at_us - totals->armed_since_us));
    totals->armed_since_us = INT64_MIN;
}

/* Nobody says whether it is armed, or nobody looks. One that was lost after arming flies on. */
static void take_untold(struct recorder *recorder, bool told)
{
    struct recorder_totals *totals = &recorder->totals;
    int64_t untold_us = recorder_armed(recorder) ? 0 : totals->at_us - recorder->told_us;
    bool counts = recorder->untold || untold_us > UNTOLD_US;

    totals->untold_us += counts ? untold_us : 0;
    totals->untold_later_us += counts && totals->began != RECORDER_UNTOLD ? untold_us : 0;
    recorder->untold = counts && !told && !recorder_armed(recorder);
    if (counts || told || recorder_armed(recorder)) {
        recorder->told_us = totals->at_us;
    }
}

static void take_clock(struct recorder *recorder, int64_t unix_us)
{
    int64_t now_us = recorder->totals.at_us, offset_us = unix_us - now_us;
    time_t unix_s = (time_t)(unix_us / 1000000);
    char text[32];
    struct tm utc;

    if (unix_us == 0 ||
        (recorder->clock_said_us != 0 &&
         (llabs(offset_us - recorder->clock_offset_us) < CLOCK_JUMP_US ||
          now_us - recorder->clock_said_us < CLOCK_SAY_EVERY_US)) ||
        gmtime_r(&unix_s, &utc) == NULL) {
        return;
    }
    recorder->clock_offset_us = offset_us;
    recorder->clock_said_us = now_us;
    strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &utc);
    say(recorder, now_us, "clock", ",\"utc\":\"%s\"", text);
}

static void take_daemon_start(struct recorder *recorder, int64_t start_us)
{
    if (recorder->daemon_start_us != INT64_MIN &&
        start_us > recorder->daemon_start_us + RESTART_US) {
        recorder->totals.restarts++;
        recorder->totals.armed_restarts += recorder_armed(recorder);
        say(recorder, start_us, "daemon_restarted", "%s", "");
    }
    recorder->daemon_start_us = start_us;
}

/* ---- in and out ---- */

static void begin(struct recorder *recorder, recorder_line_fn *line, void *context, int64_t now_us)
{
    memset(recorder, 0, sizeof(*recorder));
    recorder->line = line;
    recorder->context = context;
    recorder->start_us = recorder->told_us = recorder->totals.at_us = now_us;
    recorder->daemon_start_us = recorder->totals.armed_since_us = INT64_MIN;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        recorder->settled_us[channel] = INT64_MIN;
        recorder->totals.channels[channel].first_us = INT64_MIN;
        recorder->totals.channels[channel].heard_us = INT64_MIN;
    }
    for (enum recorder_fault_kind kind = 0; kind < RECORDER_KINDS; kind++) {
        snprintf(recorder->faults[kind].name, RECORDER_NAME_SIZE, "%s", recorder_kind_name(kind));
        recorder->good_us[kind] = now_us; /* since then it is missed */
    }
}

void recorder_start(struct recorder *recorder, recorder_line_fn *line, void *context,
                    const char *boot, const char *image, int64_t now_us)
{
    char escaped[2 * RECORDER_TEXT_SIZE];

    begin(recorder, line, context, now_us);
    say(recorder, now_us, "start",
        ",\"format\":1,\"boot\":\"%s\",\"version\":\"" ODID_VERSION "\",\"image\":\"%s\"", boot,
        escape(image, escaped));
}

/* Where a fault of that name belongs. */
static struct recorder_fault *fault_place(struct recorder *recorder, const char *name)
{
    for (enum recorder_fault_kind kind = 0; kind < RECORDER_KINDS; kind++) {
        if (strcmp(recorder->faults[kind].name, name) == 0) {
            recorder->seen[kind] = true;
            return &recorder->faults[kind];
        }
    }
    return board_fault(recorder, name);
}

void recorder_continue(struct recorder *recorder, recorder_line_fn *line, void *context,
                       const struct recorder_totals *totals, const struct recorder_fault *faults,
                       unsigned count, int64_t now_us)
{
    begin(recorder, line, context, now_us);
    recorder->totals = *totals;
    recorder->told_us = totals->at_us;
    for (unsigned i = 0; i < count; i++) {
        struct recorder_fault *fault = fault_place(recorder, faults[i].name);

        if (fault != NULL) {
            *fault = faults[i];
            fault->was_armed = recorder_armed(recorder);
        }
    }
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        recorder->seen[RECORDER_CHANNEL + channel] |=
            totals->channels[channel].first_us != INT64_MIN;
    }
    say(recorder, now_us, "recorder_restarted", "%s", "");
}

void recorder_say_update(struct recorder *recorder, const char *sentence, int64_t now_us)
{
    char text[2 * RECORDER_TEXT_SIZE];

    say(recorder, now_us, "update", ",\"text\":\"%s\"", escape(sentence, text));
}

/* Time passes in the state in which it was. */
static void pass_time(struct recorder *recorder, int64_t now_us)
{
    struct recorder_totals *totals = &recorder->totals;
    int64_t from_us = totals->at_us, passed_us = now_us - from_us;

    totals->at_us = now_us;
    if (!recorder_armed(recorder)) {
        return;
    }
    if (passed_us > UNWATCHED_US) {
        totals->unwatched_us += passed_us;
        say(recorder, from_us, "unwatched", ",\"seconds\":%.2f", duration_s(passed_us));
    }
    totals->armed_us += passed_us;
    for (enum recorder_fault_kind kind = 0; kind < RECORDER_KINDS; kind++) {
        totals->fault_us[kind] += recorder->faults[kind].there ? passed_us : 0;
    }
}

void recorder_tick(struct recorder *recorder, const struct recorder_snapshot *snapshot,
                   int64_t now_us)
{
    pass_time(recorder, now_us);
    take_untold(recorder, snapshot->answered && snapshot->armed_known);
    if (snapshot->answered) {
        take_daemon_start(recorder, snapshot->daemon_start_us);
        take_clock(recorder, snapshot->unix_us);
        for (enum channel channel = 0; channel < CHANNELS; channel++) {
            take_channel(recorder, channel, &snapshot->channels[channel]);
        }
        if (snapshot->armed_known) { /* an autopilot that was lost after arming flies on */
            take_armed(recorder, snapshot->armed);
        }
    }
    take_needs(recorder, snapshot);
    take_board(recorder, &snapshot->board);
}

/* "null" for what never was */
static const char *instant(int64_t us, char out[24])
{
    if (us == INT64_MIN) {
        return "null";
    }
    snprintf(out, 24, "%.2f", duration_s(us));
    return out;
}

static const char *began(enum recorder_began began)
{
    return began == RECORDER_UNTOLD ? "null" : began == RECORDER_ARMED ? "true" : "false";
}

#define SAY(form, value)                                                                           \
    filled += (size_t)snprintf(sums + filled, sizeof(sums) - filled, form, value);
#define SAY_TIME(name, field) SAY(",\"" name "\":%.2f", duration_s(totals->field))
#define SAY_COUNT(name, field) SAY(",\"" name "\":%u", totals->field)

void recorder_say_totals(struct recorder *recorder)
{
    const struct recorder_totals *totals = &recorder->totals;
    char channels[720] = "", faults[320] = "", sums[400], first[24], heard[24];
    size_t filled = 0;

    RECORDER_SUMS(SAY_TIME, SAY_COUNT)
    filled = 0;
    for (enum recorder_fault_kind kind = 0; kind < RECORDER_KINDS; kind++) {
        if (totals->fault_us[kind] > 0) {
            filled += (size_t)snprintf(faults + filled, sizeof(faults) - filled, "%s\"%s\":%.2f",
                                       filled == 0 ? "" : ",", recorder_kind_name(kind),
                                       duration_s(totals->fault_us[kind]));
        }
    }
    filled = 0;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        const struct recorder_channel_totals *one = &totals->channels[channel];

        filled += (size_t)snprintf(
            channels + filled, sizeof(channels) - filled,
            "%s\"%s\":{\"required\":%s,\"armed_required\":%s,\"known\":\"%s\",\"first\":%s,"
            "\"heard\":%s,\"silent_s\":%.2f,\"longest_gap_s\":%.2f,\"gaps\":%u,"
            "\"open_gap_s\":%.2f}",
            channel == 0 ? "" : ",", channel_name(channel), one->required ? "true" : "false",
            one->armed_required ? "true" : "false", radio_known_name(one->known),
            instant(one->first_us, first), instant(one->heard_us, heard),
            duration_s(one->silent_us), duration_s(one->longest_us), one->gaps,
            duration_s(recorder_open_gap_us(recorder, channel)));
    }
    say(recorder, totals->at_us, "totals",
        ",\"began_armed\":%s,\"armed_since\":%s%s,\"armed_fault_s\":{%s},\"channels\":{%s}",
        began(totals->began), instant(totals->armed_since_us, first), sums, faults, channels);
}

void recorder_end(struct recorder *recorder, int64_t now_us)
{
    pass_time(recorder, now_us);
    recorder_say_totals(recorder);
    say(recorder, now_us, "end", "%s", "");
}
