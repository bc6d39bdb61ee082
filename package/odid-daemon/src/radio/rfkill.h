/*
 * /dev/rfkill: notices a blocked radio and unblocks a soft block.
 */
#ifndef ODID_RFKILL_H
#define ODID_RFKILL_H

#include <stdbool.h>
#include <stdint.h>

enum rfkill_radio { RFKILL_WLAN, RFKILL_BLUETOOTH };

/* Opens and watches; without the device nothing is ever blocked. Retried by itself. */
void rfkill_start(int64_t now_us);
/* The same on another device: for tests. */
void rfkill_start_at(const char *path, int64_t now_us);

/* Is any radio of this kind blocked, and by a switch that we can't undo (hard)? */
bool rfkill_blocked(enum rfkill_radio radio, bool *hard);

#endif
