#include "daemon/link.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/sock_diag.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/inherited.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/serial.h"
#include "daemon/telemetry.h"
#include "mavlink/link_socket.h"

#define RETRY_US 250000
/* Reads per wake-up: a flood must not keep the schedule waiting. Where there is more, the rest has
 * to wait: a program that never sleeps at real-time priority is ended (sandbox.h). What that costs
 * goes by the octets, and the smallest frames have twelve: 25000 a second are more than a ground
 * station's share, 3 MB ten times what a telemetry port brings. */
#define READS_MAX 32
#define DATAGRAMS_MAX 128
#define DATAGRAM_OCTETS_MAX 16384
#define WAITING_MAX 4096 /* datagrams: more than a socket's buffer holds */
/* A UDP sender that was silent for this long isn't counted any more. */
#define SENDER_PRESENT_US 10000000

struct sender {
    struct sockaddr_in address; /* sin_family 0: free */
    int64_t heard_us;
};

static struct {
    const struct config *config;
    link_bytes_fn *bytes;
    link_reset_fn *reset;
    void *context;
    struct link_status status;
    struct loop_watch watch;
    struct loop_timer retry, silence;
    struct loop_pause pause;
    int64_t heard_us; /* the last byte, or the opening */
    struct sender senders[TELEMETRY_STREAMS];
    uint32_t overrun_seen; /* as the kernel said last of this socket */
    int handed_down;       /* the keeper's UDP socket, ours too; < 0: there is none */
} self = {.watch.fd = -1, .handed_down = -1, .status.overrun_us = INT64_MIN};

static void enter_state(enum link_state state, int64_t now_us)
{
    static const char *const names[] = {
        [LINK_ABSENT] = "absent", [LINK_SILENT] = "silent", [LINK_ALIVE] = "alive"};

    if (self.status.state == state) {
        return;
    }
    self.status.state = state;
    self.status.since_us = now_us;
    if (state == LINK_ALIVE) {
        self.status.detail[0] = '\0';
        log_info("autopilot link %s: alive", self.status.name);
    } else {
        log_warning("autopilot link %s: %s (%s)", self.status.name, names[state],
                    self.status.detail);
    }
}

static void lose_link(const char *what, int error, int64_t now_us)
{
    int fd = self.watch.fd;

    loop_unwatch(&self.watch);
    if (fd >= 0) {
        serial_close(fd);
    }
    loop_arm(&self.silence, LOOP_NEVER);
    loop_arm(&self.retry, now_us + RETRY_US);
    snprintf(self.status.detail, sizeof(self.status.detail), "%s: %s", what, strerror(error));
    enter_state(LINK_ABSENT, now_us);
}

static void heard(size_t length, int64_t now_us)
{
    self.heard_us = now_us;
    self.status.bytes_in += length;
    enter_state(LINK_ALIVE, now_us);
}

static void on_silence(void *context, int64_t now_us)
{
    (void)context;
    if (now_us - self.heard_us >= LINK_SILENT_US) {
        snprintf(self.status.detail, sizeof(self.status.detail), "open, but nothing comes");
        enter_state(LINK_SILENT, now_us);
        loop_arm(&self.silence, now_us + LINK_SILENT_US);
    } else {
        loop_arm(&self.silence, self.heard_us + LINK_SILENT_US);
    }
}

/* ---- serial ---- */

static void on_serial(void *context, uint32_t events, int64_t now_us)
{
    uint8_t buffer[512];
    ssize_t length = -1;

    (void)context;
    for (int i = 0; i < READS_MAX; i++) {
        length = read(self.watch.fd, buffer, sizeof(buffer));
        if (length <= 0) {
            break;
        }
        heard((size_t)length, now_us);
        self.bytes(self.context, 0, buffer, (size_t)length, now_us);
    }
    if (length == 0) {
        lose_link("hang-up", EIO, now_us);
    } else if (length < 0 && errno != EAGAIN && errno != EINTR) {
        lose_link("read", errno, now_us);
    } else if (events & (EPOLLHUP | EPOLLERR)) {
        lose_link("hang-up", EIO, now_us);
    } else if (length > 0) {
        loop_pause_reading(&self.pause);
    }
}

/* ---- UDP ---- */

/* The sender's slot; a new one takes a free slot, or that of the longest silent. */
static unsigned sender_slot(const struct sockaddr_in *address, int64_t now_us)
{
    unsigned slot = 0;

    for (unsigned i = 0; i < TELEMETRY_STREAMS; i++) {
        const struct sockaddr_in *known = &self.senders[i].address;

        if (known->sin_family == AF_INET && known->sin_port == address->sin_port &&
            known->sin_addr.s_addr == address->sin_addr.s_addr) {
            self.senders[i].heard_us = now_us;
            return i;
        }
        if (self.senders[slot].address.sin_family != 0 &&
            (known->sin_family == 0 || self.senders[i].heard_us < self.senders[slot].heard_us)) {
            slot = i;
        }
    }
    self.senders[slot].address = *address;
    self.senders[slot].heard_us = now_us;
    self.reset(self.context, slot);
    return slot;
}

static void count_senders(int64_t now_us)
{
    self.status.senders = 0;
    for (unsigned i = 0; i < TELEMETRY_STREAMS; i++) {
        if (self.senders[i].address.sin_family != 0 &&
            now_us - self.senders[i].heard_us < SENDER_PRESENT_US) {
            self.status.senders++;
        }
    }
}

/* What the kernel had no room for since the socket was opened; it may be older than we are. */
static uint32_t dropped_by_kernel(int fd)
{
    uint32_t numbers[SK_MEMINFO_VARS] = {0};
    socklen_t size = sizeof(numbers);

    return getsockopt(fd, SOL_SOCKET, SO_MEMINFO, numbers, &size) == 0 ? numbers[SK_MEMINFO_DROPS]
                                                                       : self.overrun_seen;
}

static void note_overrun(int64_t now_us)
{
    uint32_t dropped = dropped_by_kernel(self.watch.fd);

    if (dropped != self.overrun_seen) {
        self.status.overrun += (uint32_t)(dropped - self.overrun_seen);
        self.status.overrun_us = now_us;
        self.overrun_seen = dropped;
    }
}

static void on_udp(void *context, uint32_t events, int64_t now_us)
{
    uint8_t datagram[2048];
    struct sockaddr_in from;
    int reads = 0;
    size_t octets = 0;

    (void)context;
    (void)events;
    for (; reads < DATAGRAMS_MAX && octets < DATAGRAM_OCTETS_MAX; reads++) {
        socklen_t from_size = sizeof(from);
        ssize_t length = recvfrom(self.watch.fd, datagram, sizeof(datagram), 0,
                                  (struct sockaddr *)&from, &from_size);

        if (length < 0 && errno == ECONNREFUSED) {
            continue; /* an answer of ours reached nobody; not about the socket */
        }
        if (length < 0 && (errno == EAGAIN || errno == EINTR)) {
            break;
        }
        if (length < 0) {
            lose_link("receive", errno, now_us);
            return;
        }
        octets += (size_t)length;
        heard((size_t)length, now_us);
        self.bytes(self.context, sender_slot(&from, now_us), datagram, (size_t)length, now_us);
    }
    if (reads == DATAGRAMS_MAX || octets >= DATAGRAM_OCTETS_MAX) {
        loop_pause_reading(&self.pause);
    }
    count_senders(now_us);
    note_overrun(now_us);
}

/* What came while no daemon ran is old, and says nothing of now. */
static void forget_waiting(int fd)
{
    char octet;

    for (int i = 0; i < WAITING_MAX && recv(fd, &octet, 1, 0) >= 0; i++) {
    }
}

static int open_udp(void)
{
    int fd;

    if (self.handed_down >= 0 && link_socket_fits(self.handed_down, self.config)) {
        fd = fcntl(self.handed_down, F_DUPFD_CLOEXEC, 0);
        if (fd < 0) {
            return -errno;
        }
        forget_waiting(fd);
    } else {
        fd = link_socket_open(self.config);
    }
    self.overrun_seen = fd < 0 ? 0 : dropped_by_kernel(fd);
    return fd;
}

/* ---- both ---- */

static void open_link(void *context, int64_t now_us)
{
    bool serial = self.config->source == MAVLINK_SOURCE_SERIAL;
    int fd = serial ? serial_open(self.config->device, self.config->baud, false) : open_udp();
    int result;

    (void)context;
    if (fd < 0) {
        lose_link("open", -fd, now_us);
        return;
    }
    result = loop_watch(&self.watch, fd, EPOLLIN, serial ? on_serial : on_udp, NULL);
    if (result < 0) {
        close(fd);
        lose_link("watch", -result, now_us);
        return;
    }
    for (unsigned i = 0; i < TELEMETRY_STREAMS; i++) {
        self.senders[i].address.sin_family = 0;
        self.reset(self.context, i);
    }
    self.status.opened++;
    self.heard_us = now_us;
    loop_arm(&self.silence, now_us + LINK_SILENT_US);
    snprintf(self.status.detail, sizeof(self.status.detail), "open, nothing came yet");
    log_info("autopilot link %s: open", self.status.name);
    self.status.state = LINK_SILENT;
    self.status.since_us = now_us;
}

void link_start(const struct config *config, link_bytes_fn *bytes, link_reset_fn *reset,
                void *context, int64_t now_us)
{
    self.config = config;
    self.bytes = bytes;
    self.reset = reset;
    self.context = context;
    self.status.since_us = now_us;
    self.handed_down = inherited_take(LINK_SOCKET_VARIABLE);
    if (config->source == MAVLINK_SOURCE_SERIAL) {
        snprintf(self.status.name, sizeof(self.status.name), "%s at %u baud", config->device,
                 config->baud);
    } else {
        snprintf(self.status.name, sizeof(self.status.name), "UDP %s:%u", config->udp_address,
                 config->udp_port);
    }
    loop_timer_init(&self.retry, open_link, NULL);
    loop_timer_init(&self.silence, on_silence, NULL);
    loop_pause_init(&self.pause, &self.watch);
    open_link(NULL, now_us);
    if (self.status.state == LINK_ABSENT) {
        log_warning("autopilot link %s: not there yet (%s)", self.status.name, self.status.detail);
    }
}

void link_send(unsigned stream, const uint8_t *frame, size_t length)
{
    const struct sockaddr_in *to = &self.senders[stream % TELEMETRY_STREAMS].address;
    ssize_t sent;

    if (self.watch.fd < 0) {
        return;
    }
    if (self.config->source == MAVLINK_SOURCE_SERIAL) {
        sent = write(self.watch.fd, frame, length);
    } else if (to->sin_family == AF_INET) {
        sent = sendto(self.watch.fd, frame, length, MSG_NOSIGNAL, (const struct sockaddr *)to,
                      sizeof(*to));
    } else {
        return;
    }
    /* A frame cut short costs the receiver one bad CRC; waiting would cost us the schedule. */
    if (sent == (ssize_t)length) {
        self.status.bytes_out += length;
    } else {
        self.status.bytes_dropped += length;
    }
}

const struct link_status *link_status(void)
{
    return &self.status;
}
