/*
 * Plain telemetry, as MAVLink's common.xml has it, in SI units: what each message
 * says, and nothing of whether it is believed (telemetry.h).
 */
#ifndef ODID_TELEMETRY_PLAIN_H
#define ODID_TELEMETRY_PLAIN_H

#include <common/mavlink.h>
#include <stdbool.h>

#include "daemon/telemetry.h"

/* Fills kind and that kind's fields. False: nothing is known to be read from this message. */
bool telemetry_plain_read(const mavlink_message_t *message, struct telemetry_update *update);

#endif
