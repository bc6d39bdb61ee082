#include "hci_kernel.h"

#include <errno.h>
#include <stdint.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <bluetooth/bluetooth.h>
#include <bluetooth/hci.h>
#include <bluetooth/hci_lib.h>

/* Linux's Bluetooth management protocol, doc/mgmt-api.txt in BlueZ: header and what we use. */
#define MGMT_SET_POWERED 0x0005
#define MGMT_COMMAND_STATUS 0x0002
#define MGMT_INVALID_INDEX 0x11
#define MGMT_RFKILLED 0x12

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

/*
 * HCIDEVUP would wait in the kernel for as long as the controller takes, ten
 * seconds for a dead one, and the other radios with it. The management
 * interface only queues the work; what it refuses, it says at once.
 */
static int power_up(int dev_id)
{
    const uint8_t request[] = {
        MGMT_SET_POWERED, 0, (uint8_t)dev_id, (uint8_t)(dev_id >> 8), 1, 0, 1};
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
        if (length >= 9 && reply[0] == MGMT_COMMAND_STATUS && reply[6] == MGMT_SET_POWERED) {
            result = reply[8] == MGMT_RFKILLED        ? -ERFKILL
                     : reply[8] == MGMT_INVALID_INDEX ? -ENODEV
                                                      : -EAGAIN;
            break;
        }
    }
    close(fd);
    return result;
}

static int set_filter(int fd)
{
    struct hci_filter filter;

    hci_filter_clear(&filter);
    hci_filter_set_ptype(HCI_EVENT_PKT, &filter);
    hci_filter_set_event(EVT_CMD_COMPLETE, &filter);
    hci_filter_set_event(EVT_CMD_STATUS, &filter);
    hci_filter_set_event(EVT_HARDWARE_ERROR, &filter);
    return setsockopt(fd, SOL_HCI, HCI_FILTER, &filter, sizeof(filter)) < 0 ? -errno : 0;
}

int hci_kernel_open(int dev_id)
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
        result = power_up(dev_id);
    } else {
        result = set_filter(fd);
    }
    if (result < 0) {
        close(fd);
        return result;
    }
    return fd;
}
