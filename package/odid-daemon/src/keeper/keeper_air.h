/*
 * Takes the last payload off the air when its daemon is gone: switches off
 * each controller's advertising, legacy or else all extended sets (Bluetooth
 * Core Vol 4 Part E 7.8.9, 7.8.56), and empties hostapd's vendor elements.
 * In the event loop: nothing waits for a radio that doesn't answer, and each
 * has a second for an answer.
 */
#ifndef ODID_KEEPER_AIR_H
#define ODID_KEEPER_AIR_H

#include <stdbool.h>
#include <stdint.h>

#include "config/config.h"

#define KEEPER_AIR_ADAPTERS 2
#define KEEPER_AIR_RESULT_SIZE 200

struct keeper_air_plan {
    char adapter[KEEPER_AIR_ADAPTERS][CONFIG_PATH_SIZE]; /* empty: none */
    bool unreachable[KEEPER_AIR_ADAPTERS];               /* a port that the daemon can't share */
    char hostapd_dir[CONFIG_PATH_SIZE], iface[16];       /* empty: no Wi-Fi */
};

/* The radios that are switched on in the configuration. */
void keeper_air_plan(struct keeper_air_plan *plan, const struct config *config);

/*
 * What became of it. off: the radios that certainly carry nothing more, as
 * "hci0, wlan0"; left: each other one with the reason, "hci1 (no answer)".
 * Either may be empty. They live until the next start.
 */
typedef void keeper_air_done_fn(void *context, const char *off, const char *left, int64_t now_us);

/* done is called once, possibly before this returns. */
void keeper_air_start(const struct keeper_air_plan *plan, keeper_air_done_fn *done, void *context,
                      int64_t now_us);

/* The daemon is back: what isn't done yet is left, and done isn't called any more. */
void keeper_air_stop(void);

#endif
