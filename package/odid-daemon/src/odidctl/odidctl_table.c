#include "odidctl/odidctl_table.h"
#include "appliance/places.h"
#include "base/duration.h"

#include <math.h>
#include <string.h>

#define UNKNOWN "unknown"
#define LABEL "%-16s "

/* ---- reading the JSON ---- */

/* A field by its path, "position.latitude_deg"; NULL when it is null or missing. */
static struct json_object *find(struct json_object *object, const char *path)
{
    char name[48];
    const char *dot;

    while (object != NULL && path != NULL) {
        dot = strchr(path, '.');
        snprintf(name, sizeof(name), "%.*s", dot == NULL ? (int)strlen(path) : (int)(dot - path),
                 path);
        if (!json_object_is_type(object, json_type_object)) {
            return NULL;
        }
        object = json_object_object_get(object, name);
        path = dot == NULL ? NULL : dot + 1;
    }
    return object;
}

static const char *text_or(struct json_object *object, const char *path, const char *otherwise)
{
    struct json_object *field = find(object, path);

    return json_object_is_type(field, json_type_string) ? json_object_get_string(field) : otherwise;
}

static double number(struct json_object *object, const char *path)
{
    struct json_object *field = find(object, path);
    bool numeric =
        json_object_is_type(field, json_type_double) || json_object_is_type(field, json_type_int);

    return numeric ? json_object_get_double(field) : NAN;
}

static bool is_true(struct json_object *object, const char *path)
{
    return json_object_get_boolean(find(object, path));
}

static size_t elements(struct json_object *array)
{
    return json_object_is_type(array, json_type_array) ? json_object_array_length(array) : 0;
}

/* ---- writing ---- */

static const char *paint(bool colour, const char *code)
{
    return colour ? code : "";
}

#define RED "\033[1;31m"
#define YELLOW "\033[1;33m"
#define GREEN "\033[1;32m"
#define BOLD "\033[1m"
#define PLAIN "\033[0m"

/* " 12.0 m", or "unknown" */
static void print_number(FILE *out, double value, int digits, const char *unit)
{
    if (isnan(value)) {
        fputs(UNKNOWN, out);
    } else {
        fprintf(out, "%.*f%s", digits, value, unit);
    }
}

static void print_place(FILE *out, struct json_object *place)
{
    double latitude_deg = number(place, "latitude_deg"),
           longitude_deg = number(place, "longitude_deg");

    if (isnan(latitude_deg) || isnan(longitude_deg)) {
        fputs(UNKNOWN, out);
    } else {
        fprintf(out, "%.6f, %.6f", latitude_deg, longitude_deg);
    }
}

/* ---- the parts of the table ---- */

static const char *const channels[] = {"channels.bt4", "channels.bt5", "channels.wifi"};
#define CHANNEL_COUNT (sizeof(channels) / sizeof(channels[0]))

static bool any_on_air(struct json_object *status)
{
    for (size_t i = 0; i < CHANNEL_COUNT; i++) {
        if (strcmp(text_or(find(status, channels[i]), "state", ""), "on air") == 0) {
            return true;
        }
    }
    return false;
}

static void print_verdict(FILE *out, struct json_object *status, bool colour)
{
    const char *reason = text_or(status, "reason", NULL);
    bool on_air = is_true(status, "on_air");
    char uptime[32];

    duration_text(uptime, sizeof(uptime), number(status, "uptime_s"));
    fprintf(out, "%sREMOTE ID IS %s%s   (odid-daemon %s, running for %s)\n",
            paint(colour, on_air ? GREEN : RED),
            on_air               ? "ON THE AIR"
            : any_on_air(status) ? "ONLY PARTLY ON THE AIR"
                                 : "NOT ON THE AIR",
            paint(colour, PLAIN), text_or(status, "version", UNKNOWN), uptime);
    if (reason == NULL) {
        fprintf(out, "%sNothing stands against flying.%s\n", paint(colour, GREEN),
                paint(colour, PLAIN));
    } else {
        fprintf(out, "%sDo not fly: %s%s\n", paint(colour, RED), reason, paint(colour, PLAIN));
    }
}

static const char *state_colour(struct json_object *channel)
{
    if (strcmp(text_or(channel, "state", ""), "on air") == 0) {
        return GREEN;
    }
    return is_true(channel, "required") ? RED : "";
}

static void print_channel(FILE *out, struct json_object *channel, bool colour)
{
    const char *detail = text_or(channel, "detail", NULL);
    char since[32], sent[32];
    double repairs = number(channel, "repairs"), replaced = number(channel, "replaced");

    duration_text(since, sizeof(since), number(channel, "since_s"));
    duration_text(sent, sizeof(sent), number(channel, "last_accepted_s"));
    fprintf(out, "  " LABEL "%s%-12s%s for %s", text_or(channel, "title", UNKNOWN),
            paint(colour, state_colour(channel)), text_or(channel, "state", UNKNOWN),
            paint(colour, PLAIN), since);
    if (!isnan(number(channel, "last_accepted_s"))) {
        fprintf(out, ", last sent %s ago", sent);
    }
    if (repairs > 0) {
        fprintf(out, ", repaired %.0f times", repairs);
    }
    if (replaced > 0) {
        fprintf(out, ", %.0f never taken", replaced);
    }
    fprintf(out, "%s\n", is_true(channel, "required") ? "" : " (not required)");
    if (detail != NULL) {
        fprintf(out, "  " LABEL "%s\n", "", detail);
    }
}

static void print_channels(FILE *out, struct json_object *status, bool colour)
{
    fprintf(out, "\n%sChannels%s\n", paint(colour, BOLD), paint(colour, PLAIN));
    for (size_t i = 0; i < CHANNEL_COUNT; i++) {
        print_channel(out, find(status, channels[i]), colour);
    }
}

static void print_refused(FILE *out, struct json_object *refused)
{
    size_t count = elements(refused);

    if (count == 0) {
        return;
    }
    fprintf(out, "  " LABEL "to send", "Refuses");
    for (size_t i = 0; i < count; i++) {
        fprintf(out, " %d", json_object_get_int(json_object_array_get_idx(refused, i)));
    }
    fprintf(out, " (numbers of MAVLink messages)\n");
}

static void print_autopilot(FILE *out, struct json_object *status, bool colour)
{
    struct json_object *link = find(status, "link"), *armed = find(status, "aircraft.armed");
    const char *detail = text_or(link, "detail", NULL);
    char since[32];

    duration_text(since, sizeof(since), number(link, "since_s"));
    fprintf(out, "\n%sAutopilot%s\n", paint(colour, BOLD), paint(colour, PLAIN));
    fprintf(out, "  " LABEL "%s: %s for %s\n", "Link", text_or(link, "name", UNKNOWN),
            text_or(link, "state", UNKNOWN), since);
    if (detail != NULL) {
        fprintf(out, "  " LABEL "%s\n", "", detail);
    }
    fprintf(out, "  " LABEL "", "Vehicle");
    print_number(out, number(status, "vehicle"), 0, "");
    fprintf(out, ", %s\n",
            armed == NULL                    ? "armed or not: unknown"
            : json_object_get_boolean(armed) ? "armed"
                                             : "disarmed");
    fprintf(out, "  " LABEL "%.0f understood, %.0f damaged, %.0f of no concern\n", "Messages",
            fmax(number(status, "mavlink.frames"), 0), fmax(number(status, "mavlink.bad_crc"), 0),
            fmax(number(status, "mavlink.other_transmitter"), 0) +
                fmax(number(status, "mavlink.other_aircraft"), 0) +
                fmax(number(status, "mavlink.other_system"), 0));
    print_refused(out, find(status, "aircraft.refused_messages"));
    fprintf(out, "  " LABEL "%s\n", "Time (UTC)", text_or(status, "time.utc", UNKNOWN));
}

static void print_location(FILE *out, struct json_object *status, bool colour)
{
    struct json_object *position = find(status, "position"), *pilot = find(status, "operator");
    char age[32];

    duration_text(age, sizeof(age), number(position, "age_s"));
    fprintf(out, "\n%sWhere%s\n  " LABEL "", paint(colour, BOLD), paint(colour, PLAIN), "Aircraft");
    print_place(out, position);
    if (find(position, "source") != NULL) {
        fprintf(out, " (%s, %s old)", text_or(position, "source", UNKNOWN), age);
    }
    fprintf(out, "\n  " LABEL "", "Height");
    print_number(out, number(position, "height_m"), 1, " m");
    fprintf(out, " above %s; above the WGS-84 ellipsoid ",
            text_or(position, "height_above", "take-off"));
    print_number(out, number(position, "altitude_geodetic_m"), 1, " m");
    fprintf(out, "\n  " LABEL "", "Motion");
    print_number(out, number(position, "speed_mps"), 1, " m/s");
    fprintf(out, ", course ");
    print_number(out, number(position, "direction_deg"), 0, " degrees");
    fprintf(out, ", climbing ");
    print_number(out, number(position, "vertical_speed_mps"), 1, " m/s");
    fprintf(out, "\n  " LABEL "%s\n", "Status sent", text_or(position, "status", UNKNOWN));
    fprintf(out, "  " LABEL "", "Operator");
    print_place(out, pilot);
    if (find(pilot, "source") != NULL) {
        fprintf(out, " (%s, from %s)", text_or(pilot, "location_type", UNKNOWN),
                text_or(pilot, "source", UNKNOWN));
    }
    fputc('\n', out);
}

static void print_identity(FILE *out, struct json_object *status, bool colour)
{
    struct json_object *identity = find(status, "identity"), *ids = find(identity, "basic_ids");

    fprintf(out, "\n%sIdentity%s\n", paint(colour, BOLD), paint(colour, PLAIN));
    if (elements(ids) == 0) {
        fprintf(out, "  " LABEL "%s\n", "Basic ID", UNKNOWN);
    }
    for (size_t i = 0; i < elements(ids); i++) {
        struct json_object *id = json_object_array_get_idx(ids, i);

        fprintf(out, "  " LABEL "%s (%s, %s, from %s): %s\n", "Basic ID",
                text_or(id, "uas_id", UNKNOWN), text_or(id, "id_type", UNKNOWN),
                text_or(id, "ua_type", UNKNOWN), text_or(id, "source", UNKNOWN),
                text_or(id, "validity", UNKNOWN));
    }
    fprintf(out, "  " LABEL "%s", "Operator",
            text_or(identity, "operator_id.operator_id", UNKNOWN));
    if (find(identity, "operator_id.source") != NULL) {
        fprintf(out, " (from %s): %s", text_or(identity, "operator_id.source", UNKNOWN),
                text_or(identity, "operator_id.validity", UNKNOWN));
    }
    fprintf(out, "\n  " LABEL "%s\n", "Description",
            text_or(identity, "self_id.description", "none"));
    fprintf(out, "  " LABEL "%s: category %s, class %s\n", "Classification",
            text_or(identity, "classification.type", UNKNOWN),
            text_or(identity, "classification.category", UNKNOWN),
            text_or(identity, "classification.class", UNKNOWN));
}

static void print_problems(FILE *out, struct json_object *status, bool colour)
{
    struct json_object *problems = find(status, "problems");
    struct json_object *sentences = find(status, "configuration.sentences");

    fprintf(out, "\n%sWhat is wrong, and what to do%s\n", paint(colour, BOLD),
            paint(colour, PLAIN));
    if (elements(problems) == 0) {
        fprintf(out, "  nothing\n");
    }
    for (size_t i = 0; i < elements(problems); i++) {
        struct json_object *problem = json_object_array_get_idx(problems, i);
        bool fault = strcmp(text_or(problem, "severity", ""), "fault") == 0;

        fprintf(out, "  %s%-8s%s %s\n           %s\n", paint(colour, fault ? RED : YELLOW),
                fault ? "FAULT" : "warning", paint(colour, PLAIN),
                text_or(problem, "reason", UNKNOWN), text_or(problem, "advice", UNKNOWN));
    }
    if (elements(sentences) > 0) {
        fprintf(out, "\n%sConfiguration%s\n", paint(colour, BOLD), paint(colour, PLAIN));
    }
    for (size_t i = 0; i < elements(sentences); i++) {
        struct json_object *sentence = json_object_array_get_idx(sentences, i);

        if (json_object_is_type(sentence, json_type_string)) {
            fprintf(out, "  %s\n", json_object_get_string(sentence));
        }
    }
}

void odidctl_table_faults(FILE *out, struct json_object *faults, bool colour)
{
    if (elements(faults) > 0) {
        fprintf(out, "\n%s%s%s\n", paint(colour, BOLD),
                PLACES_COMPANION ? "The keeper" : "The appliance", paint(colour, PLAIN));
    }
    for (size_t i = 0; i < elements(faults); i++) {
        struct json_object *fault = json_object_array_get_idx(faults, i);

        fprintf(out, "  %s" LABEL "%s%s\n", paint(colour, YELLOW), text_or(fault, "name", UNKNOWN),
                paint(colour, PLAIN), text_or(fault, "sentence", UNKNOWN));
    }
}

/* Only where something looks after updates. */
static void print_update(FILE *out, struct json_object *status, bool colour)
{
    if (find(status, "update") == NULL && find(status, "last_update") == NULL) {
        return;
    }
    fprintf(out, "\n%sUpdates%s\n", paint(colour, BOLD), paint(colour, PLAIN));
    fprintf(out, "  " LABEL "%s\n", "Now", text_or(status, "update.sentence", UNKNOWN));
    fprintf(out, "  " LABEL "%s\n", "The last one",
            text_or(status, "last_update.sentence", "none yet"));
}

void odidctl_table(FILE *out, struct json_object *status, bool colour)
{
    print_verdict(out, status, colour);
    print_channels(out, status, colour);
    print_autopilot(out, status, colour);
    print_location(out, status, colour);
    print_identity(out, status, colour);
    print_problems(out, status, colour);
    odidctl_table_faults(out, find(status, "appliance_faults"), colour);
    print_update(out, status, colour);
}
