/*
 * The way to the autopilot: a serial port, or UDP from whoever sends to us.
 * Bytes in, bytes out; reopens by itself.
 *
 * At most 32 reads are taken at a time, then for 5 ms none: a flood waits in
 * the kernel, which drops what is over, and never keeps the schedule waiting.
 */
#ifndef ODID_LINK_H
#define ODID_LINK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/config.h"

/* Without a byte for this long an open link counts as silent, and is reported: an autopilot says at
 * least its HEARTBEAT each second. */
#define LINK_SILENT_US 2000000

enum link_state {
    LINK_ABSENT, /* device or address not there: retried every 250 ms */
    LINK_SILENT, /* open, nothing comes */
    LINK_ALIVE,
};

struct link_status {
    enum link_state state;
    int64_t since_us;
    char name[CONFIG_PATH_SIZE + 32]; /* "/dev/ttyACM0 at 921600 baud", "UDP 127.0.0.1:14550" */
    char detail[96];                  /* why it is absent, in plain words */
    uint64_t bytes_in, bytes_out, bytes_dropped; /* dropped: not sent because the way was full */
    uint64_t overrun;                            /* UDP: datagrams that came faster than is taken */
    int64_t overrun_us;                          /* the last time; INT64_MIN: never */
    unsigned opened;                             /* times it was opened */
    unsigned senders;                            /* UDP: different senders at present */
};

/* stream: 0 for serial; for UDP the sender's slot, 0..TELEMETRY_STREAMS-1. */
typedef void link_bytes_fn(void *context, unsigned stream, const uint8_t *bytes, size_t length,
                           int64_t now_us);
/* The stream's sender or device is another one from now on. */
typedef void link_reset_fn(void *context, unsigned stream);

/* Starts; never fails: what can't be opened is retried. config must outlive the link. */
void link_start(const struct config *config, link_bytes_fn *bytes, link_reset_fn *reset,
                void *context, int64_t now_us);

/* Sends one frame towards a stream; never blocks, drops when the way is full. */
void link_send(unsigned stream, const uint8_t *frame, size_t length);

const struct link_status *link_status(void);

#endif
