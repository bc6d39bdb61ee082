/*
 * What health.c, which judges what is required, and health_warnings.c share:
 * how a problem is noted.
 */
#ifndef ODID_HEALTH_NOTE_H
#define ODID_HEALTH_NOTE_H

#include "daemon/health.h"

/* Notes a problem behind those that are noted; format: its reason. */
void health_note(struct health *health, enum health_severity severity, const char *id,
                 const char *advice, const char *format, ...) __attribute__((format(printf, 5, 6)));

#define FAULT(...) health_note(health, HEALTH_FAULT, __VA_ARGS__)
#define WARNING(...) health_note(health, HEALTH_WARNING, __VA_ARGS__)

bool health_on_air(const struct health_input *input, enum channel channel, int64_t now_us);

#endif
