#include "radio/hci.h"

#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/ioctl.h>
#include <sys/uio.h>
#include <unistd.h>

#include "base/serial.h"
#include "radio/hci_kernel.h"

/* H4 packet types, Bluetooth Core Vol 4 Part A 2. */
#define H4_COMMAND 0x01
#define H4_ACL 0x02
#define H4_SCO 0x03
#define H4_EVENT 0x04
#define H4_ISO 0x05

#define H4_BAUD 115200
/* Reads in one go, then none for a moment: whoever talks without end must not keep the loop from
 * its deadlines. 6400 events a second are more than a controller has to say. */
#define READS_MAX 32
/* A command of 35 bytes takes 3 ms at 115200 baud. */
#define FINISH_MS 50

static const char h4_prefix[] = "h4:";

/* ---- names ---- */

/* Splits "h4:/dev/ttyX@baud". Without a baud rate: 115200, and no flow control. */
static bool parse_h4(const char *adapter, char path[108], unsigned *baud, bool *flow_control)
{
    const char *rest = adapter + strlen(h4_prefix);
    const char *at = strrchr(rest, '@');
    size_t length = at != NULL ? (size_t)(at - rest) : strlen(rest);
    char *end;

    *flow_control = at != NULL;
    *baud = H4_BAUD;
    if (rest[0] != '/' || length >= 108) {
        return false;
    }
    memcpy(path, rest, length);
    path[length] = '\0';
    if (at != NULL) {
        unsigned long value = strtoul(at + 1, &end, 10);

        *baud = (unsigned)value;
        return at[1] >= '0' && at[1] <= '9' && *end == '\0' && value <= 4000000 &&
               serial_baud_valid(*baud);
    }
    return true;
}

static bool parse_kernel(const char *adapter, int *dev_id)
{
    char proper[16];

    if (sscanf(adapter, "hci%3d", dev_id) != 1 || *dev_id < 0) {
        return false;
    }
    snprintf(proper, sizeof(proper), "hci%d", *dev_id);
    return strcmp(adapter, proper) == 0; /* one controller has one name */
}

bool hci_name_valid(const char *adapter)
{
    char path[108];
    unsigned baud;
    bool flow_control;
    int dev_id;

    if (strncmp(adapter, h4_prefix, strlen(h4_prefix)) == 0) {
        return parse_h4(adapter, path, &baud, &flow_control);
    }
    return parse_kernel(adapter, &dev_id);
}

/* ---- receiving ---- */

static void lose_controller(struct hci *hci, int error, int64_t now_us)
{
    hci_close(hci);
    hci->on_lost(hci->context, error, now_us);
}

/* One whole event: type, code, length, parameters. */
static void deliver(struct hci *hci, const uint8_t *packet, size_t length, int64_t now_us)
{
    if (length >= 3 && packet[0] == H4_EVENT && length >= 3U + packet[2]) {
        hci->on_event(hci->context, packet[1], packet + 3, packet[2], now_us);
    }
}

/* How many header bytes, type included, until the length is known; 0: no H4 packet. */
static size_t header_size(uint8_t type)
{
    switch (type) {
    case H4_EVENT:
        return 3;
    case H4_SCO:
        return 4;
    case H4_ACL:
    case H4_ISO:
        return 5;
    default:
        return 0;
    }
}

static size_t payload_size(const uint8_t *header)
{
    switch (header[0]) {
    case H4_EVENT:
        return header[2];
    case H4_SCO:
        return header[3];
    case H4_ISO:
        return (size_t)(header[3] | header[4] << 8) & 0x3FFF;
    default:
        return (size_t)(header[3] | header[4] << 8);
    }
}

/* Takes one byte of the stream. Returns false when it is out of step. */
static bool take_byte(struct hci *hci, uint8_t byte, int64_t now_us)
{
    size_t header;

    if (hci->skip > 0) {
        hci->skip--;
        return true;
    }
    hci->packet[hci->filled++] = byte;
    header = header_size(hci->packet[0]);
    if (header == 0) {
        return false;
    }
    if (hci->filled < header) {
        return true;
    }
    if (hci->packet[0] != H4_EVENT) {
        hci->skip = payload_size(hci->packet); /* no connection is ours */
        hci->filled = 0;
    } else if (hci->filled == header + payload_size(hci->packet)) {
        hci->filled = 0;
        deliver(hci, hci->packet, header + payload_size(hci->packet), now_us);
    }
    return true;
}

static void take(struct hci *hci, const uint8_t *bytes, size_t length, int64_t now_us)
{
    if (!hci->h4) {
        deliver(hci, bytes, length, now_us); /* the kernel gives a packet a read */
        return;
    }
    for (size_t i = 0; i < length && hci_is_open(hci); i++) {
        if (!take_byte(hci, bytes[i], now_us)) {
            lose_controller(hci, -EPROTO, now_us); /* only a reset brings it back into step */
        }
    }
}

static void on_readable(void *context, uint32_t events, int64_t now_us)
{
    struct hci *hci = context;
    uint8_t buffer[512];
    ssize_t length = 0;

    for (int reads = 0; reads < READS_MAX; reads++) {
        length = read(hci->watch.fd, buffer, sizeof(buffer));
        if (length < 0 && errno == EAGAIN) {
            break;
        }
        if (length <= 0) {
            lose_controller(hci, length == 0 ? -EIO : -errno, now_us);
            return;
        }
        take(hci, buffer, (size_t)length, now_us);
        if (!hci_is_open(hci)) {
            return; /* closed by what it was told, or out of step */
        }
    }
    if (events & (EPOLLHUP | EPOLLERR)) {
        lose_controller(hci, -EIO, now_us);
    } else if (length > 0) {
        loop_pause_reading(&hci->pause);
    }
}

/* ---- opening, sending ---- */

int hci_open(struct hci *hci, const char *adapter, hci_event_fn *on_event, hci_lost_fn *on_lost,
             void *context)
{
    char path[108];
    unsigned baud;
    bool flow_control;
    int fd, result;

    hci->on_event = on_event;
    hci->on_lost = on_lost;
    hci->context = context;
    hci->filled = hci->skip = 0;
    hci->h4 = strncmp(adapter, h4_prefix, strlen(h4_prefix)) == 0;
    if (hci->h4) {
        if (!parse_h4(adapter, path, &baud, &flow_control)) {
            return -EINVAL;
        }
        fd = serial_open(path, baud, flow_control);
    } else {
        if (!parse_kernel(adapter, &hci->dev_id)) {
            return -EINVAL;
        }
        fd = hci_kernel_open(hci->dev_id, &hci->down_first);
    }
    if (fd < 0) {
        return fd;
    }
    loop_pause_init(&hci->pause, &hci->watch);
    result = loop_watch(&hci->watch, fd, EPOLLIN, on_readable, hci);
    if (result < 0) {
        close(fd);
    }
    return result;
}

void hci_close(struct hci *hci)
{
    int fd = hci->watch.fd;

    loop_unwatch(&hci->watch);
    if (fd >= 0) {
        serial_close(fd);
    }
}

void hci_finish(struct hci *hci)
{
    int fd = hci->watch.fd, unsent = 0;

    loop_unwatch(&hci->watch);
    if (fd < 0) {
        return;
    }
    for (int i = 0; hci->h4 && i < FINISH_MS; i++) {
        if (ioctl(fd, TIOCOUTQ, &unsent) < 0 || unsent == 0) {
            break;
        }
        poll(NULL, 0, 1);
    }
    if (unsent > 0) {
        serial_close(fd);
    } else {
        close(fd); /* what was taken is on its way out */
    }
}

bool hci_is_open(const struct hci *hci)
{
    return hci->watch.fd >= 0;
}

int hci_command(struct hci *hci, uint16_t opcode, const uint8_t *parameters, uint8_t length)
{
    uint8_t packet[4 + HCI_PARAMETERS_MAX] = {H4_COMMAND, (uint8_t)opcode, (uint8_t)(opcode >> 8),
                                              length};
    ssize_t written;

    if (length > 0) {
        memcpy(packet + 4, parameters, length);
    }
    written = write(hci->watch.fd, packet, 4U + length);
    if (written < 0) {
        return -errno;
    }
    /* Half a command leaves the controller out of step: only reopening helps. */
    return written == 4 + length ? 0 : -EPROTO;
}
