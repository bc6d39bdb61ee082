#include "odidctl/autopilot_find.h"

#include <errno.h>
#include <poll.h>
#include <stdbool.h>
#include <stdint.h>
#include <unistd.h>

#include "base/loop.h"
#include "base/serial.h"
#include "mavlink/framing.h"

#define SECOND_US INT64_C(1000000)
/* A HEARTBEAT comes once a second. */
#define PREFERRED_US (SECOND_US + SECOND_US / 5)
#define PIECE 1024
/* Noise at full speed is no reason to take a processor. */
#define PAUSE_US 5000

struct port {
    struct framing framing;
    struct framing_counters counters;
    bool speaks;
};

static struct {
    struct port ports[AUTOPILOT_PORTS_MAX];
    /* fd -1: it couldn't be opened, or is gone. The last is whoever asked: a pipe without a reader
     * is an error there. */
    struct pollfd polled[AUTOPILOT_PORTS_MAX + 1];
    unsigned count;
} self;

static void on_frame(void *context, const mavlink_message_t *message)
{
    struct port *port = context;

    port->speaks = port->speaks || message->compid == MAV_COMP_ID_AUTOPILOT1;
}

static void say_heartbeat(void)
{
    uint8_t octets[MAVLINK_MAX_PACKET_LEN];
    mavlink_message_t message;
    uint16_t length;

    mavlink_msg_heartbeat_pack(1, MAV_COMP_ID_ODID_TXRX_1, &message, MAV_TYPE_ODID,
                               MAV_AUTOPILOT_INVALID, 0, 0, MAV_STATE_ACTIVE);
    length = mavlink_msg_to_send_buffer(octets, &message);
    for (unsigned i = 0; i < self.count; i++) {
        /* One that takes nothing hears nothing. */
        if (self.polled[i].fd >= 0 && write(self.polled[i].fd, octets, length) < 0) {
            continue;
        }
    }
}

static void let_go(unsigned number)
{
    struct pollfd *polled = &self.polled[number];

    if (polled->fd >= 0) {
        serial_close(polled->fd);
        polled->fd = -1;
    }
}

static void hear(unsigned number)
{
    struct port *port = &self.ports[number];
    struct pollfd *polled = &self.polled[number];
    uint8_t octets[PIECE];
    ssize_t got;

    if (polled->fd < 0 || polled->revents == 0) {
        return;
    }
    got = read(polled->fd, octets, sizeof(octets));
    if (got > 0) {
        framing_stream(&port->framing, &port->counters, octets, (size_t)got, on_frame, port);
    } else if (got == 0 || (errno != EAGAIN && errno != EINTR)) {
        let_go(number); /* unplugged */
        port->speaks = false;
    }
}

/* The first that speaks; -1: none does. *left: whether there is a port at all. */
static int first_speaking(bool *left)
{
    int first = -1;

    *left = false;
    for (unsigned i = 0; i < self.count; i++) {
        *left = *left || self.polled[i].fd >= 0;
        if (first < 0 && self.ports[i].speaks) {
            first = (int)i;
        }
    }
    return first;
}

static int listen_for(unsigned seconds)
{
    int64_t begun_us = loop_now_us(), said_us = begun_us - SECOND_US;
    bool left = true;

    while (left && (seconds == 0 || loop_now_us() - begun_us < seconds * SECOND_US)) {
        int first = first_speaking(&left);
        int64_t now_us = loop_now_us();

        if (first == 0 || (first > 0 && now_us - begun_us >= PREFERRED_US)) {
            return first;
        }
        if (now_us - said_us >= SECOND_US) {
            say_heartbeat();
            said_us = now_us;
        }
        if (poll(self.polled, self.count + 1, 100) > 0) {
            if ((self.polled[self.count].revents & POLLERR) != 0) {
                return -EPIPE;
            }
            for (unsigned i = 0; i < self.count; i++) {
                hear(i);
            }
            usleep(PAUSE_US);
        }
    }
    return -ENODEV;
}

int autopilot_find(char *const ports[], unsigned count, unsigned baud, unsigned seconds, int asker)
{
    int found;

    self.count = count < AUTOPILOT_PORTS_MAX ? count : AUTOPILOT_PORTS_MAX;
    for (unsigned i = 0; i < self.count; i++) {
        int fd = serial_open(ports[i], baud, false);

        self.ports[i] = (struct port){.speaks = false};
        self.polled[i] = (struct pollfd){.fd = fd < 0 ? -1 : fd, .events = POLLIN};
    }
    self.polled[self.count] = (struct pollfd){.fd = asker, .events = 0};
    found = listen_for(seconds);
    for (unsigned i = 0; i < self.count; i++) {
        let_go(i);
    }
    return found;
}
