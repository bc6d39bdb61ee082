/* odidctl flights: what the flight records say. */
#ifndef ODID_FLIGHTS_SHOW_H
#define ODID_FLIGHTS_SHOW_H

#include <stdbool.h>
#include <stdio.h>

/*
 * All records, newest first, as a table; with a number that one in detail.
 * json: for programs. boot: the kernel's boot id, to know the record that is
 * being written. Returns 0, or 1 when something can't be read (said on stderr)
 * or there is no such record.
 */
int flights_show(FILE *out, const char *directory, const char *number, const char *boot, bool json);

#endif
