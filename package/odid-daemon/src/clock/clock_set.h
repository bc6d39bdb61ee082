/*
 * What odid-clock decides: whether the system clock is set, and to what. A
 * board without a clock battery starts at the latest time that is known for
 * sure, and gets the autopilot's GNSS time later.
 *
 * Pure. Times are Unix microseconds.
 */
#ifndef ODID_CLOCK_SET_H
#define ODID_CLOCK_SET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CLOCK_UNKNOWN INT64_MIN

/* From 2010 to 2100: what lies outside is a damaged file's. */
bool clock_is_plausible(int64_t unix_us);

/* BUILD_TIME, in whole seconds since 1970, of /etc/odid-release's text. CLOCK_UNKNOWN: there is
 * none that makes sense. */
int64_t clock_build_us(const char *release);

/* The time to start with, of what is known; CLOCK_UNKNOWN: neither is. */
int64_t clock_at_boot_us(int64_t build_us, int64_t saved_us);

/*
 * The autopilot's time of the daemon's status, which tells whole seconds: the
 * middle of that second. CLOCK_UNKNOWN: the autopilot told none, or this is no
 * status.
 */
int64_t clock_of_status_us(const char *status, size_t length);

/*
 * Is the system clock more than a second off? build_us: an autopilot's time
 * before it is none; CLOCK_UNKNOWN: not checked.
 */
bool clock_is_off(int64_t system_us, int64_t autopilot_us, int64_t build_us);

#endif
