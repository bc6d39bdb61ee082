/*
 * The native OPEN_DRONE_ID_* messages of MAVLink -> typed updates. Used by
 * telemetry only, which decides whose messages count.
 */
#ifndef ODID_TELEMETRY_ODID_H
#define ODID_TELEMETRY_ODID_H

#include <common/mavlink.h>

#include "daemon/telemetry.h"

struct telemetry_odid_address {
    uint8_t system, component; /* the target, 0 = everyone */
    bool other_aircraft;       /* id_or_mac set: about an aircraft that somebody heard */
};

/* Is this one of the OPEN_DRONE_ID messages that describe an aircraft (12900-12905, 12915, 12919)?
 */
bool telemetry_odid_is(uint32_t message_id);

void telemetry_odid_address(const mavlink_message_t *message, struct telemetry_odid_address *to);

/*
 * Delivers what the message holds. An empty one counts as absent (ArduPilot
 * sends the static ones also when nobody filled them): nothing is delivered.
 */
void telemetry_odid_read(const mavlink_message_t *message, telemetry_fn *deliver, void *context,
                         int64_t now_us);

#endif
