#include "radio/hci_kernel.h"

#include <errno.h>
#include <linux/filter.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bluetooth/bluetooth.h>
#include <bluetooth/hci.h>
#include <bluetooth/hci_lib.h>

/* Linux's Bluetooth management protocol, doc/mgmt-api.txt in BlueZ: what we use of it. */
#define MGMT_SET_POWERED 0x0005
#define MGMT_COMMAND_STATUS 0x0002
#define MGMT_INVALID_INDEX 0x11
#define MGMT_RFKILLED 0x12
#define MGMT_PERMISSION_DENIED 0x14

#define LE_SET_TERMINATED 0x12 /* Bluetooth Core Vol 4 Part E 7.7.65.18 */

static unsigned get16(const uint8_t *bytes)
{
    return bytes[0] | (unsigned)bytes[1] << 8;
}

static int bound_socket(int dev_id, unsigned short channel)
{
    struct sockaddr_hci address = {
        .hci_family = AF_BLUETOOTH, .hci_dev = (unsigned short)dev_id, .hci_channel = channel};
    int fd = socket(AF_BLUETOOTH, SOCK_RAW | SOCK_NONBLOCK | SOCK_CLOEXEC, BTPROTO_HCI);
    int error;

    if (fd < 0) {
        return -errno;
    }
    if (bind(fd, (struct sockaddr *)&address, sizeof(address)) < 0) {
        error = errno;
        close(fd);
        return -error;
    }
    return fd;
}

/* What a reply says about our request, at its status byte; -EAGAIN: nothing bad. */
static int refusal(const uint8_t *reply, size_t length)
{
    if (length < 9 || get16(reply) != MGMT_COMMAND_STATUS || get16(reply + 6) != MGMT_SET_POWERED) {
        return -EAGAIN;
    }
    switch (reply[8]) {
    case MGMT_INVALID_INDEX:
        return -EINPROGRESS; /* it is there: its driver is at it, or has failed */
    case MGMT_RFKILLED:
        return -ERFKILL;
    case MGMT_PERMISSION_DENIED:
        return -EPERM;
    default:
        return -EAGAIN; /* busy, most likely with just that */
    }
}

/*
 * HCIDEVUP sets the controller up inside the call: a second for firmware, ten
 * (HCI_INIT_TIMEOUT) for a dead chip, and the other radios would stand still
 * with it; HCIDEVDOWN waits likewise. The management interface only queues that
 * work; what it refuses, it says at once, and what comes of it is seen at the
 * next try. It is busy as long as the last one isn't done. Its price: the
 * kernel ends a power-up with advertising commands of its own, which count as
 * foreign ones if we were faster.
 */
static int set_powered(int dev_id, bool on)
{
    const uint8_t request[] = {
        MGMT_SET_POWERED, 0, (uint8_t)dev_id, (uint8_t)(dev_id >> 8), 1, 0, on};
    uint8_t reply[64];
    int fd = bound_socket(HCI_DEV_NONE, HCI_CHANNEL_CONTROL);
    int result = -EAGAIN;
    ssize_t length;

    if (fd < 0) {
        return fd;
    }
    if (write(fd, request, sizeof(request)) < 0) {
        result = -errno;
    }
    while (result == -EAGAIN && (length = read(fd, reply, sizeof(reply))) > 0) {
        result = refusal(reply, (size_t)length);
    }
    close(fd);
    return result;
}

/* LE meta events say when a set has ended (subevent 0x12), and whatever somebody who scans hears:
 * that may be a thousand a second. Of a kernel that takes no filter for it none is asked for. */
static bool filter_meta(int fd)
{
    static struct sock_filter words[] = {
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 1), /* behind the packet's type: the event */
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, EVT_LE_META_EVENT, 0, 2),
        BPF_STMT(BPF_LD | BPF_B | BPF_ABS, 3), /* behind its length: the subevent */
        BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, LE_SET_TERMINATED, 0, 1),
        BPF_STMT(BPF_RET | BPF_K, UINT32_MAX),
        BPF_STMT(BPF_RET | BPF_K, 0),
    };
    const struct sock_fprog program = {.len = sizeof(words) / sizeof(words[0]), .filter = words};

    return setsockopt(fd, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof(program)) == 0;
}

static int set_filter(int fd)
{
    struct hci_filter filter;

    hci_filter_clear(&filter);
    hci_filter_set_ptype(HCI_EVENT_PKT, &filter);
    hci_filter_set_event(EVT_CMD_COMPLETE, &filter);
    hci_filter_set_event(EVT_CMD_STATUS, &filter);
    hci_filter_set_event(EVT_HARDWARE_ERROR, &filter);
    if (filter_meta(fd)) {
        hci_filter_set_event(EVT_LE_META_EVENT, &filter);
    }
    return setsockopt(fd, SOL_HCI, HCI_FILTER, &filter, sizeof(filter)) < 0 ? -errno : 0;
}

int hci_kernel_open(int dev_id, bool *down_first)
{
    struct hci_dev_info info = {.dev_id = (uint16_t)dev_id};
    int fd = bound_socket(dev_id, HCI_CHANNEL_RAW);
    int result = 0;

    if (fd < 0) {
        return fd;
    }
    if (ioctl(fd, HCIGETDEVINFO, &info) < 0) {
        result = -errno;
    } else if (!hci_test_bit(HCI_UP, &info.flags)) {
        *down_first = false;
        result = set_powered(dev_id, true);
    } else if (*down_first) {
        result = set_powered(dev_id, false);
    } else {
        result = set_filter(fd);
    }
    if (result < 0) {
        close(fd);
        return result;
    }
    return fd;
}
