/* odidctl flights: what the flight records say. */
#ifndef ODID_FLIGHTS_SHOW_H
#define ODID_FLIGHTS_SHOW_H

#include <stdbool.h>
#include <stdio.h>

#define FLIGHTS_DIRECTORY "/data/odid/flights"

/*
 * All records, newest first, as a table; with a number that one in detail.
 * json: for programs. boot: the kernel's boot id, to know the record that is
 * being written. Returns 0, or 1 when something can't be read (said on stderr)
 * or there is no such record.
 */
int flights_show(FILE *out, const char *directory, const char *number, const char *boot, bool json);

/* The kernel's boot id; "" when it can't be read. */
const char *flights_boot(void);

#endif
