/*
 * The frozen take-off point in <run_dir>/takeoff, so that a daemon restarted
 * in flight still knows it. run_dir is a tmpfs: gone with the power.
 */
#ifndef ODID_TAKEOFF_FILE_H
#define ODID_TAKEOFF_FILE_H

#include "aircraft.h"

/* Reads it; known = false when there is none or it makes no sense. */
void takeoff_file_read(const char *run_dir, struct aircraft_takeoff *takeoff);

/* Replaces it atomically, or removes it when the point isn't known. Returns 0, or -errno. */
int takeoff_file_write(const char *run_dir, const struct aircraft_takeoff *takeoff);

#endif
