#include "daemon/status_json.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/utf8.h"
#include "config/config_keys.h"
#include "config/identifiers.h"

#define ID_SERIAL 1
#define OPERATOR_ID_EU 0

/* ---- fields: what isn't known is null ---- */

static void add(struct json_object *parent, const char *name, struct json_object *value)
{
    json_object_object_add_ex(parent, name, value,
                              JSON_C_OBJECT_ADD_KEY_IS_NEW | JSON_C_OBJECT_ADD_CONSTANT_KEY);
}

static struct json_object *add_object(struct json_object *parent, const char *name)
{
    struct json_object *object = json_object_new_object();

    add(parent, name, object);
    return object;
}

static void add_bool(struct json_object *parent, const char *name, bool value)
{
    add(parent, name, json_object_new_boolean(value));
}

static void add_count(struct json_object *parent, const char *name, uint64_t value)
{
    add(parent, name, json_object_new_int64((int64_t)value));
}

/* format has as many digits as mean something. */
static void add_number(struct json_object *parent, const char *name, double value,
                       const char *format)
{
    struct json_object *number = NULL;

    if (isfinite(value)) {
        number = json_object_new_double(value);
        json_object_set_serializer(number, json_object_double_to_json_string, (void *)format, NULL);
    }
    add(parent, name, number);
}

/* Text from outside may hold any byte; JSON is UTF-8. */
static void add_text(struct json_object *parent, const char *name, const char *text)
{
    char clean[CONFIG_PROBLEM_SIZE];

    utf8_clean(clean, sizeof(clean), text);
    add(parent, name, clean[0] == '\0' ? NULL : json_object_new_string(clean));
}

/* Seconds since an instant; null when there was none. */
static void add_age(struct json_object *parent, const char *name, int64_t since_us, int64_t now_us)
{
    double age_s = since_us == INT64_MIN ? NAN : (double)(now_us - since_us) * 1e-6;

    add_number(parent, name, age_s, "%.2f");
}

static const char *source_name(enum source source)
{
    static const char *const names[] = {[SOURCE_NONE] = "",
                                        [SOURCE_CONFIGURATION] = "configuration",
                                        [SOURCE_TELEMETRY] = "telemetry",
                                        [SOURCE_NATIVE] = "native"};

    return names[source];
}

/* ---- groups ---- */

static void add_channels(struct json_object *root, const struct health_input *input, int64_t now_us)
{
    struct json_object *channels = add_object(root, "channels");

    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        const struct radio *radio = &input->radios[channel];
        struct json_object *object = add_object(channels, channel_name(channel));

        add_text(object, "title", channel_title(channel));
        add_text(object, "state", radio_state_name(radio_seen(radio, now_us)));
        add_text(object, "detail", radio->detail);
        add_text(object, "known", radio_known_name(radio->known));
        add_bool(object, "required", health_required(input, channel));
        add_bool(object, "stuck", radio_stuck(radio, now_us));
        add_bool(object, "silent", radio->silent && radio_seen(radio, now_us) == RADIO_LOST);
        add_age(object, "since_s", radio_seen_since_us(radio, now_us), now_us);
        add_age(object, "last_accepted_s", radio->accepted_us, now_us);
        add_age(object, "confirmed_s", radio->confirmed_us, now_us);
        add_age(object, "unbroken_s", radio->unbroken_us, now_us);
        add_age(object, "paused_s", radio->paused_us, now_us);
        add_count(object, "payloads", radio->payloads);
        add_count(object, "replaced", radio->replaced);
        add_count(object, "starts", radio->starts);
        add_count(object, "repairs", radio->repairs);
        add_count(object, "failures", radio->failures);
    }
}

static void add_link(struct json_object *root, const struct link_status *link, int64_t now_us)
{
    static const char *const states[] = {
        [LINK_ABSENT] = "absent", [LINK_SILENT] = "silent", [LINK_ALIVE] = "alive"};
    struct json_object *object = add_object(root, "link");

    add_text(object, "name", link->name);
    add_text(object, "state", states[link->state]);
    add_text(object, "detail", link->detail);
    add_age(object, "since_s", link->since_us, now_us);
    add_count(object, "bytes_in", link->bytes_in);
    add_count(object, "bytes_out", link->bytes_out);
    add_count(object, "bytes_dropped", link->bytes_dropped);
    add_count(object, "overrun", link->overrun);
    add_count(object, "opened", link->opened);
    add_count(object, "senders", link->senders);
}

static void add_mavlink(struct json_object *root, const struct telemetry_counters *counters,
                        bool contradicted)
{
    struct json_object *object = add_object(root, "mavlink");

    add_count(object, "frames", counters->frames);
    add_count(object, "bad_crc", counters->framing.bad_crc);
    add_count(object, "unknown_id", counters->framing.unknown_id);
    add_count(object, "refused", counters->framing.refused);
    add_count(object, "other_transmitter", counters->other_transmitter);
    add_count(object, "other_aircraft", counters->other_aircraft);
    add_count(object, "other_system", counters->other_system);
    add_count(object, "not_needed", counters->not_needed);
    add_count(object, "not_believed", counters->not_believed);
    add_bool(object, "contradicted", contradicted);
}

static void add_basic_ids(struct json_object *identity, const struct aircraft_view *view)
{
    struct json_object *array = json_object_new_array_ext((int)view->basic_ids);

    add(identity, "basic_ids", array);
    for (unsigned i = 0; i < view->basic_ids; i++) {
        const struct aircraft_basic_id *id = &view->basic_id[i];
        struct json_object *object = json_object_new_object();
        char problem[IDENTIFIER_PROBLEM_SIZE];

        json_object_array_add(array, object);
        add_text(object, "uas_id", id->uas_id);
        add_text(object, "id_type", config_code_name(config_id_types, id->id_type));
        add_text(object, "ua_type", config_code_name(config_ua_types, id->ua_type));
        add_text(object, "source", source_name(id->source));
        if (id->id_type != ID_SERIAL) {
            add_text(object, "validity", "not checked");
        } else if (identifiers_check_serial(id->uas_id, problem)) {
            add_text(object, "validity", "valid");
        } else {
            add_text(object, "validity", problem);
        }
    }
}

/* A number that came natively may have its secret part with it: that is never shown. */
static void add_operator_id(struct json_object *identity, const struct health_input *input)
{
    static const char *const verdicts[] = {
        [OPERATOR_NUMBER_VALID] = "valid", [OPERATOR_NUMBER_UNVERIFIED] = "structure right"};
    const struct aircraft_view *view = input->view;
    struct json_object *object = add_object(identity, "operator_id");
    char public_part[IDENTIFIER_MAX + 1] = "", problem[IDENTIFIER_PROBLEM_SIZE];
    enum operator_number_verdict verdict;
    bool configured = input->config->operator_id[0] != '\0';

    verdict = identifiers_check_operator(view->operator_id, public_part, problem);
    add_text(object, "operator_id", public_part);
    if (view->operator_id[0] == '\0') {
        add(object, "source", NULL);
        add(object, "validity", NULL);
        return;
    }
    add_text(object, "source", source_name(configured ? SOURCE_CONFIGURATION : SOURCE_NATIVE));
    if (view->operator_id_type != OPERATOR_ID_EU) {
        add_text(object, "validity", "not checked");
    } else {
        add_text(object, "validity",
                 verdict == OPERATOR_NUMBER_INVALID ? problem : verdicts[verdict]);
    }
}

static void add_identity(struct json_object *root, const struct health_input *input)
{
    const struct aircraft_view *view = input->view;
    struct json_object *identity = add_object(root, "identity"), *object;

    add_basic_ids(identity, view);
    add_operator_id(identity, input);
    object = add_object(identity, "self_id");
    add_text(object, "description", view->self_id_set ? view->description : "");
    add_text(object, "type", config_code_name(config_description_types, view->description_type));
    add_text(object, "source",
             source_name(view->self_id_set ? view->description_source : SOURCE_NONE));
    object = add_object(identity, "classification");
    add_text(object, "type",
             config_code_name(config_classification_types, view->system.classification_type));
    add_text(object, "category", config_category_name(view->system.category_eu));
    add_text(object, "class", config_class_name(view->system.class_eu));
    add_text(object, "source",
             input->config->classification_set ? source_name(SOURCE_CONFIGURATION) : "");
}

static void add_position(struct json_object *root, const struct aircraft_location *location,
                         int64_t now_us)
{
    static const char *const states[] = {"undeclared", "ground", "airborne", "emergency",
                                         "remote ID system failure"};
    struct json_object *object = add_object(root, "position");

    add_text(object, "source", source_name(location->position_source));
    add_bool(object, "fresh", location->position_fresh);
    add_age(object, "age_s", location->fix_us, now_us);
    add_number(object, "latitude_deg", location->latitude_deg, "%.7f");
    add_number(object, "longitude_deg", location->longitude_deg, "%.7f");
    add_number(object, "altitude_geodetic_m", location->altitude_geodetic_m, "%.1f");
    add_number(object, "altitude_barometric_m", location->altitude_barometric_m, "%.1f");
    add_number(object, "height_m", location->height_m, "%.1f");
    add_text(object, "height_above", location->height_above_ground ? "ground" : "takeoff");
    add_text(object, "motion_source", source_name(location->motion_source));
    add_number(object, "direction_deg", location->direction_deg, "%.1f");
    add_number(object, "speed_mps", location->speed_mps, "%.2f");
    add_number(object, "vertical_speed_mps", location->vertical_speed_mps, "%.2f");
    add_number(object, "timestamp_s", location->timestamp_s, "%.1f");
    add_text(object, "status", states[location->status <= 4 ? location->status : 0]);
    add_text(object, "status_source", source_name(location->status_source));
}

static void add_operator(struct json_object *root, const struct aircraft_system *system)
{
    struct json_object *object = add_object(root, "operator");

    add_text(object, "source", source_name(system->operator_source));
    add_text(object, "location_type",
             config_code_name(config_operator_location_types, system->operator_location_type));
    add_number(object, "latitude_deg", system->operator_latitude_deg, "%.7f");
    add_number(object, "longitude_deg", system->operator_longitude_deg, "%.7f");
    add_number(object, "altitude_m", system->operator_altitude_m, "%.1f");
}

static void add_time(struct json_object *root, const struct aircraft_condition *condition)
{
    struct json_object *object = add_object(root, "time");
    time_t unix_s = (time_t)(condition->unix_us / 1000000);
    char text[32] = "";
    struct tm utc;

    add_bool(object, "known", condition->time_known);
    if (condition->time_known && gmtime_r(&unix_s, &utc) != NULL) {
        strftime(text, sizeof(text), "%Y-%m-%dT%H:%M:%SZ", &utc);
    }
    add_text(object, "utc", text);
}

/* Messages that the autopilot was asked for in vain, by their numbers. */
static void add_refused(struct json_object *aircraft, const struct asking *asking, int64_t now_us)
{
    struct json_object *array = json_object_new_array();
    uint16_t refused[ASKING_MESSAGES];
    unsigned count = asking_refused(asking, now_us, refused);

    add(aircraft, "refused_messages", array);
    for (unsigned i = 0; i < count; i++) {
        json_object_array_add(array, json_object_new_int(refused[i]));
    }
}

static void add_aircraft(struct json_object *root, const struct status_snapshot *snapshot,
                         int64_t now_us)
{
    const struct aircraft_condition *condition = snapshot->input.condition;
    struct json_object *object = add_object(root, "aircraft");
    bool known = condition->heartbeat_fresh;

    add_bool(object, "heartbeat", known);
    add_bool(object, "speaks", snapshot->input.speaks);
    add_bool(object, "another_id", snapshot->input.another_id);
    /* Without HEARTBEATs an old "no" is none; a "yes" may come of what it does. */
    add(object, "armed",
        known || condition->armed ? json_object_new_boolean(condition->armed) : NULL);
    add(object, "emergency",
        known || condition->emergency ? json_object_new_boolean(condition->emergency) : NULL);
    add_bool(object, "simulated", condition->simulated);
    add_count(object, "mav_type", condition->mav_type);
    add_count(object, "autopilot", condition->autopilot);
    add_count(object, "restarts", condition->autopilot_restarts);
    add_bool(object, "takeoff_known", condition->takeoff_known);
    add_bool(object, "takeoff_is_home", condition->takeoff_is_home);
    add_bool(object, "takeoff_is_late", condition->takeoff_is_late);
    add_bool(object, "fix_known", condition->fix_known);
    add_bool(object, "vertical_inverted", condition->vertical_inverted);
    add_number(object, "position_rate_hz", condition->position_rate_hz, "%.2f");
    add_refused(object, snapshot->asking, now_us);
}

static void add_problems(struct json_object *root, const struct health *health)
{
    struct json_object *array = json_object_new_array_ext((int)health->count);

    add(root, "problems", array);
    for (unsigned i = 0; i < health->count; i++) {
        const struct health_problem *problem = &health->problem[i];
        struct json_object *object = json_object_new_object();

        json_object_array_add(array, object);
        add_text(object, "id", problem->id);
        add_text(object, "severity", problem->severity == HEALTH_FAULT ? "fault" : "warning");
        add_text(object, "reason", problem->reason);
        add_text(object, "advice", problem->advice);
    }
}

static void add_daemon(struct json_object *root, const struct status_snapshot *snapshot)
{
    const struct slot_lateness *lateness = snapshot->lateness;
    struct json_object *object = add_object(root, "configuration"), *array;
    int64_t p99_us = slot_lateness_p99_us(lateness);
    char fingerprint[17];

    add_count(object, "errors", snapshot->input.config_errors);
    snprintf(fingerprint, sizeof(fingerprint), "%016" PRIx64, snapshot->config_file);
    add_text(object, "fingerprint", fingerprint);
    array = json_object_new_array_ext((int)snapshot->config_reports);
    add(object, "sentences", array);
    for (unsigned i = 0; i < snapshot->config_reports; i++) {
        json_object_array_add(array, json_object_new_string(snapshot->config_report[i]));
    }
    object = add_object(root, "schedule");
    add_count(object, "slots", lateness->slots);
    add_count(object, "skipped", lateness->skipped);
    add(object, "slot_lateness_p99_us", p99_us < 0 ? NULL : json_object_new_int64(p99_us));
    add(object, "slot_lateness_max_us",
        lateness->slots == 0 ? NULL : json_object_new_int64(lateness->max_us));
    object = add_object(root, "privilege");
    add_bool(object, "realtime", snapshot->input.realtime);
    add_bool(object, "filter", snapshot->input.filter);
    add_bool(object, "filter_logging", snapshot->input.filter_logging);
}

struct json_object *status_json(const struct status_snapshot *snapshot, int64_t now_us)
{
    const struct health_input *input = &snapshot->input;
    struct json_object *root = json_object_new_object();

    if (root == NULL) {
        return NULL;
    }
    add_text(root, "version", ODID_VERSION);
    add_number(root, "at_s", (double)now_us * 1e-6, "%.2f");
    add_age(root, "uptime_s", snapshot->start_us, now_us);
    add_bool(root, "on_air", snapshot->health.on_air);
    add_text(root, "reason", health_reason(&snapshot->health));
    add_channels(root, input, now_us);
    add_link(root, input->link, now_us);
    add_mavlink(root, snapshot->counters, input->contradicted);
    add(root, "vehicle", snapshot->vehicle == 0 ? NULL : json_object_new_int(snapshot->vehicle));
    add_identity(root, input);
    add_position(root, &input->view->location, now_us);
    add_operator(root, &input->view->system);
    add_time(root, input->condition);
    add_aircraft(root, snapshot, now_us);
    add_problems(root, &snapshot->health);
    add_daemon(root, snapshot);
    return root;
}
