/*
 * Bluetooth adapters: brought up, asked what they can do, set advertising, and
 * kept so. Legacy and long range share an adapter where it can do both (as two
 * advertising sets), or have one each.
 *
 * Capability is asked (LE Read Local Supported Features), never tried: an
 * extended command locks a capable controller's legacy ones until reset.
 * What is missing, or was refused, is asked for again, less and less often.
 * One that doesn't answer is reset, then put down and up, then given up
 * (radio_stuck): its driver is to be bound anew, which is root's to do.
 * A Command Complete for an advertising command that we did not send, or a
 * reset, is foreign, and undone at once: parameters, address, data and enable
 * are set again.
 */
#ifndef ODID_BLUETOOTH_H
#define ODID_BLUETOOTH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"
#include "daemon/messages.h"
#include "radio/radio.h"

/* Starts one or two adapters' state machines, which keep the two radios' states current. */
void bluetooth_start(const struct config *config, struct radio *bt4, struct radio *bt5,
                     int64_t now_us);

/* What to advertise from now on; the newest wins. Set even while not on air: it goes first then. */
void bluetooth_set_legacy(const uint8_t data[MESSAGES_LEGACY_SIZE], int64_t now_us);
void bluetooth_set_extended(const uint8_t *data, size_t length, int64_t now_us);

/* How many octets the controller takes for long range; never too few for a pack of one message. */
size_t bluetooth_extended_room(void);

/* Whether what was set last for CHANNEL_BT4 or CHANNEL_BT5 still waits for the controller: what is
 * set now takes its place, and it was never on the air. */
bool bluetooth_waits(enum channel channel);

enum bluetooth_fit { BLUETOOTH_FITS, BLUETOOTH_FITS_LATER, BLUETOOTH_FITS_NOT };

/* Would a legacy payload that is set now begin before until_us, after the one that is on the air
 * was sent, and leave the next one the time to be sent before next_us? Later: an answer is
 * awaited, and only then it is known. Not: nor will it before until_us. To be asked when none waits
 * (bluetooth_waits). */
enum bluetooth_fit bluetooth_legacy_fit(int64_t until_us, int64_t next_us, int64_t now_us);

/* Silence on all sets, synchronously as far as the transports take it: for the orderly end. */
void bluetooth_stop(void);

#endif
