/* Reading JSON that somebody else wrote: what is missing, or of another type, is unknown. */
#ifndef ODID_RECORDER_JSON_H
#define ODID_RECORDER_JSON_H

#include <json-c/json_object.h>
#include <stdbool.h>
#include <stdint.h>

#include "radio/radio.h"

/* A field by its path, "position.fresh"; NULL when it is null or missing. */
struct json_object *recorder_json_find(struct json_object *object, const char *path);

const char *recorder_json_text(struct json_object *object, const char *path, const char *otherwise);

bool recorder_json_true(struct json_object *object, const char *path);

/* A channel's "known". */
enum radio_known recorder_json_known(struct json_object *channel);

/* A count, 0 when unknown. */
unsigned recorder_json_count(struct json_object *object, const char *path);

/* Seconds, as microseconds; otherwise when unknown or out of any use. */
int64_t recorder_json_us(struct json_object *object, const char *path, int64_t otherwise);

/* "2026-01-02T03:04:05Z" -> microseconds since 1970; 0 when it is none. */
int64_t recorder_json_utc_us(struct json_object *object, const char *path);

/* Parses one object out of length bytes; NULL when there is none. The caller puts it back. */
struct json_object *recorder_json_parse(const char *text, size_t length);

#endif
