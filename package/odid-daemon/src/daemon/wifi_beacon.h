/*
 * The pack in hostapd's beacons: SET vendor_elements, then UPDATE_BEACON (both
 * are needed), each reply checked. Notices a hostapd that is gone, hangs or
 * has its interface disabled, and resumes by itself. Where the chip refuses an
 * element, a shorter one goes out instead of none (beacon_room). Where hostapd
 * says OK and no beacon goes out (radio/beacon_evidence), it is off the air, is
 * given the element anew, switched off and on, and then left to its driver.
 */
#ifndef ODID_WIFI_BEACON_H
#define ODID_WIFI_BEACON_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"
#include "radio/radio.h"

/* Starts the state machine, which keeps radio's state current. config must outlive it. */
void wifi_beacon_start(const struct config *config, struct radio *radio, int64_t now_us);

/* The vendor element to be in every beacon from now on; the newest one wins. */
void wifi_beacon_set(const uint8_t *element, size_t length, int64_t now_us);

/* How many messages an element may have that the chip is known to take, or hasn't refused:
 * 1..MESSAGES_PACK_MAX. */
unsigned wifi_beacon_most(void);

/* Whether what was set last still waits for hostapd: what is set now takes its place, and it was
 * never in a beacon. */
bool wifi_beacon_waits(void);

/* Takes the element out of the beacons, as far as hostapd listens: for the orderly end. A beacon
 * would go on telling where the aircraft was. */
void wifi_beacon_stop(void);

#endif
