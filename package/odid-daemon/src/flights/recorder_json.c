#include "flights/recorder_json.h"

#include <json-c/json_tokener.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define SECONDS_MAX 1e10

struct json_object *recorder_json_find(struct json_object *object, const char *path)
{
    char name[48];
    size_t length;

    while (*path != '\0') {
        if (!json_object_is_type(object, json_type_object)) {
            return NULL;
        }
        length = strcspn(path, ".");
        snprintf(name, sizeof(name), "%.*s", (int)length, path);
        object = json_object_object_get(object, name);
        path += length + (path[length] == '.');
    }
    return object;
}

const char *recorder_json_text(struct json_object *object, const char *path, const char *otherwise)
{
    struct json_object *field = recorder_json_find(object, path);

    return json_object_is_type(field, json_type_string) ? json_object_get_string(field) : otherwise;
}

bool recorder_json_true(struct json_object *object, const char *path)
{
    struct json_object *field = recorder_json_find(object, path);

    return json_object_is_type(field, json_type_boolean) && json_object_get_boolean(field);
}

enum radio_known recorder_json_known(struct json_object *channel)
{
    const char *name = recorder_json_text(channel, "known", "");
    enum radio_known known = RADIO_HEARD;

    while (known > RADIO_SET && strcmp(name, radio_known_name(known)) != 0) {
        known--;
    }
    return known;
}

unsigned recorder_json_count(struct json_object *object, const char *path)
{
    struct json_object *field = recorder_json_find(object, path);
    int count = json_object_is_type(field, json_type_int) ? json_object_get_int(field) : 0;

    return count > 0 ? (unsigned)count : 0;
}

int64_t recorder_json_us(struct json_object *object, const char *path, int64_t otherwise)
{
    struct json_object *field = recorder_json_find(object, path);
    bool numeric =
        json_object_is_type(field, json_type_double) || json_object_is_type(field, json_type_int);
    double seconds = numeric ? json_object_get_double(field) : NAN;

    /* NAN isn't within them either */
    return fabs(seconds) < SECONDS_MAX ? (int64_t)llround(seconds * 1e6) : otherwise;
}

int64_t recorder_json_utc_us(struct json_object *object, const char *path)
{
    const char *text = recorder_json_text(object, path, "");
    struct tm utc = {0};
    const char *end = strptime(text, "%Y-%m-%dT%H:%M:%SZ", &utc);

    return end != NULL && *end == '\0' ? (int64_t)timegm(&utc) * 1000000 : 0;
}

struct json_object *recorder_json_parse(const char *text, size_t length)
{
    struct json_tokener *tokener = json_tokener_new();
    struct json_object *object = NULL;

    if (tokener != NULL) {
        object = json_tokener_parse_ex(tokener, text, (int)length);
        json_tokener_free(tokener);
    }
    if (!json_object_is_type(object, json_type_object)) {
        json_object_put(object);
        return NULL;
    }
    return object;
}
