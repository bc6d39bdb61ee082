#include "clock/clock_set.h"

#include <errno.h>
#include <json-c/json_object.h>
#include <json-c/json_tokener.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#define SECOND_US 1000000
#define OFF_US SECOND_US
/* As autopilot_clock. */
#define PLAUSIBLE_MIN_S INT64_C(1262304000)
#define PLAUSIBLE_MAX_S INT64_C(4102444800)

bool clock_is_plausible(int64_t unix_us)
{
    return unix_us >= PLAUSIBLE_MIN_S * SECOND_US && unix_us <= PLAUSIBLE_MAX_S * SECOND_US;
}

int64_t clock_build_us(const char *release)
{
    static const char key[] = "BUILD_TIME=";
    const char *line = release;
    long long value;
    char *end;

    while (strncmp(line, key, strlen(key)) != 0) {
        line = strchr(line, '\n');
        if (line == NULL) {
            return CLOCK_UNKNOWN;
        }
        line++;
    }
    line += strlen(key);
    value = strtoll(line, &end, 10);
    if (end == line || (*end != '\n' && *end != '\0') || value < PLAUSIBLE_MIN_S ||
        value > PLAUSIBLE_MAX_S) {
        return CLOCK_UNKNOWN;
    }
    return value * SECOND_US;
}

int64_t clock_at_boot_us(int64_t build_us, int64_t saved_us)
{
    return saved_us > build_us ? saved_us : build_us;
}

static int64_t parse_utc(const char *text)
{
    struct tm utc = {0};
    const char *end = strptime(text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    time_t seconds;

    if (end == NULL || *end != '\0') {
        return CLOCK_UNKNOWN;
    }
    seconds = timegm(&utc);
    if (seconds < PLAUSIBLE_MIN_S || seconds > PLAUSIBLE_MAX_S) {
        return CLOCK_UNKNOWN;
    }
    return (int64_t)seconds * SECOND_US + SECOND_US / 2;
}

static int64_t of_object(struct json_object *status)
{
    struct json_object *group, *known, *utc;

    if (!json_object_object_get_ex(status, "time", &group) ||
        !json_object_object_get_ex(group, "known", &known) ||
        !json_object_object_get_ex(group, "utc", &utc) || !json_object_get_boolean(known) ||
        !json_object_is_type(utc, json_type_string)) {
        return CLOCK_UNKNOWN;
    }
    return parse_utc(json_object_get_string(utc));
}

int64_t clock_of_status_us(const char *status, size_t length)
{
    struct json_tokener *tokener = json_tokener_new();
    struct json_object *object;
    int64_t result = CLOCK_UNKNOWN;

    if (tokener == NULL) {
        return CLOCK_UNKNOWN;
    }
    object = json_tokener_parse_ex(tokener, status, (int)length);
    if (json_object_is_type(object, json_type_object)) {
        result = of_object(object);
    }
    json_object_put(object);
    json_tokener_free(tokener);
    return result;
}

bool clock_is_off(int64_t system_us, int64_t autopilot_us, int64_t build_us)
{
    if (autopilot_us == CLOCK_UNKNOWN || (build_us != CLOCK_UNKNOWN && autopilot_us < build_us)) {
        return false;
    }
    return llabs((long long)(system_us - autopilot_us)) > OFF_US;
}
