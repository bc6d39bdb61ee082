/*
 * Log lines on standard error, for the supervisor's logger: one line each,
 * "warning: ..." without a time stamp (the logger adds it). Control characters
 * in what came from outside are shown as '?'.
 */
#ifndef ODID_LOG_H
#define ODID_LOG_H

#include <stdbool.h>

void log_set_debug(bool on);
void log_error(const char *format, ...) __attribute__((format(printf, 1, 2)));
void log_warning(const char *format, ...) __attribute__((format(printf, 1, 2)));
void log_info(const char *format, ...) __attribute__((format(printf, 1, 2)));
void log_debug(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
