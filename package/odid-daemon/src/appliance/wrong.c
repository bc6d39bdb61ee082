/* What is wrong, and what is wrong since something was done: of a setting that was saved nobody
 * says that it is in effect without having looked. */
#include "appliance/wrong.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "appliance/faults.h"
#include "appliance/places.h"
#include "appliance/status_fetch.h"
#include "base/loop.h"

/* The daemon is started again, and hears its autopilot within a second; of several ports the right
 * one is found within ten. */
#define PATIENCE_MS 15000
#define STEADY_MS 1000
#define LOOK_MS 200

static void add_sentences(struct json_object *sentences, struct json_object *found,
                          const char *field)
{
    size_t count =
        json_object_is_type(found, json_type_array) ? json_object_array_length(found) : 0;

    for (size_t i = 0; i < count; i++) {
        struct json_object *one = json_object_array_get_idx(found, i);
        const char *severity = json_object_get_string(json_object_object_get(one, "severity"));
        const char *sentence = json_object_get_string(json_object_object_get(one, field));

        if (sentence != NULL && (severity == NULL || strcmp(severity, "fault") == 0)) {
            json_object_array_add(sentences, json_object_new_string(sentence));
        }
    }
}

struct json_object *wrong_now(const struct places *places)
{
    struct json_object *sentences = json_object_new_array();
    struct json_object *faults = faults_list(places->faults), *status;
    int error;

    add_sentences(sentences, faults, "sentence");
    json_object_put(faults);
    status = status_fetch(places->run_dir, &error);
    if (status == NULL) {
        json_object_array_add(sentences, json_object_new_string("the daemon doesn't answer"));
    }
    add_sentences(sentences, json_object_object_get(status, "problems"), "reason");
    json_object_put(status);
    return sentences;
}

/* But for how long, and how often. */
static bool same(const char *a, const char *b)
{
    for (;;) {
        a += strspn(a, "0123456789.");
        b += strspn(b, "0123456789.");
        if (*a != *b || *a == '\0') {
            return *a == *b;
        }
        a++;
        b++;
    }
}

static bool has(struct json_object *sentences, const char *sentence)
{
    for (size_t i = 0; i < json_object_array_length(sentences); i++) {
        if (same(json_object_get_string(json_object_array_get_idx(sentences, i)), sentence)) {
            return true;
        }
    }
    return false;
}

/* The first one that wasn't there before, or "". */
static void find_new(struct json_object *now, struct json_object *before, char *out, size_t size)
{
    out[0] = '\0';
    for (size_t i = 0; i < json_object_array_length(now) && out[0] == '\0'; i++) {
        const char *sentence = json_object_get_string(json_object_array_get_idx(now, i));

        if (!has(before, sentence)) {
            snprintf(out, size, "%s", sentence);
        }
    }
}

void wrong_since(const struct places *places, struct json_object *before, char *out, size_t size)
{
    const struct timespec moment = {.tv_nsec = LOOK_MS * 1000000L};
    int64_t until_us = loop_now_us() + PATIENCE_MS * INT64_C(1000);

    /* A look may take seconds as well, of a daemon that hangs. */
    for (int steady_ms = 0; loop_now_us() < until_us && steady_ms < STEADY_MS;) {
        struct json_object *now;

        nanosleep(&moment, NULL);
        now = wrong_now(places);
        find_new(now, before, out, size);
        json_object_put(now);
        steady_ms = out[0] == '\0' ? steady_ms + LOOK_MS : 0;
    }
}
