#include "rfkill.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/rfkill.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "log.h"
#include "loop.h"

#define DEVICES_MAX 16
#define OPEN_AGAIN_US 5000000
/* A soft block that is set again and again is undone this often at most. */
#define UNBLOCK_EVERY_US 250000

struct device {
    bool used;
    uint8_t type; /* RFKILL_TYPE_... */
    bool soft, hard, told;
    int64_t unblocked_us;
};

static struct {
    struct loop_watch watch;
    struct loop_timer timer;
    struct device devices[DEVICES_MAX];
} self = {.watch.fd = -1};

static const char *type_name(uint8_t type)
{
    return type == RFKILL_TYPE_WLAN ? "Wi-Fi" : "Bluetooth";
}

static bool is_ours(const struct device *device)
{
    return device->used &&
           (device->type == RFKILL_TYPE_WLAN || device->type == RFKILL_TYPE_BLUETOOTH);
}

static void unblock(uint32_t index, int64_t now_us)
{
    struct device *device = &self.devices[index];
    struct rfkill_event event = {
        .idx = index, .type = device->type, .op = RFKILL_OP_CHANGE, .soft = 0};

    if (now_us - device->unblocked_us < UNBLOCK_EVERY_US) {
        loop_arm(&self.timer, device->unblocked_us + UNBLOCK_EVERY_US);
        return;
    }
    device->unblocked_us = now_us;
    if (write(self.watch.fd, &event, sizeof(event)) < 0) {
        log_warning("rfkill: can't unblock %s: %s", type_name(device->type), strerror(errno));
    }
}

static void tell(struct device *device)
{
    if ((device->soft || device->hard) && !device->told) {
        log_warning("rfkill: %s is blocked%s", type_name(device->type),
                    device->hard ? " by a switch" : "");
    } else if (!device->soft && !device->hard && device->told) {
        log_info("rfkill: %s is unblocked", type_name(device->type));
    }
    device->told = device->soft || device->hard;
}

static void take_event(const struct rfkill_event *event, int64_t now_us)
{
    struct device *device;

    if (event->idx >= DEVICES_MAX) {
        return;
    }
    device = &self.devices[event->idx];
    if (event->op == RFKILL_OP_DEL) {
        memset(device, 0, sizeof(*device));
        return;
    }
    if (event->op == RFKILL_OP_ADD) {
        memset(device, 0, sizeof(*device));
        device->unblocked_us = INT64_MIN / 2;
    }
    device->used = true;
    device->type = event->type;
    device->soft = event->soft != 0;
    device->hard = event->hard != 0;
    if (is_ours(device)) {
        tell(device);
        if (device->soft) {
            unblock(event->idx, now_us);
        }
    }
}

static void on_readable(void *context, uint32_t events, int64_t now_us)
{
    struct rfkill_event event;
    ssize_t length;

    (void)context;
    (void)events;
    /* Newer kernels have longer events; what is read is cut to what we know. */
    while ((length = read(self.watch.fd, &event, sizeof(event))) >= (ssize_t)RFKILL_EVENT_SIZE_V1) {
        take_event(&event, now_us);
    }
    if (length == 0 || (length < 0 && errno != EAGAIN && errno != EINTR)) {
        int fd = self.watch.fd;

        loop_unwatch(&self.watch);
        close(fd);
        loop_arm(&self.timer, now_us + OPEN_AGAIN_US);
    }
}

static void open_device(int64_t now_us)
{
    int fd = open("/dev/rfkill", O_RDWR | O_NONBLOCK | O_CLOEXEC);

    if (fd < 0 || loop_watch(&self.watch, fd, EPOLLIN, on_readable, NULL) < 0) {
        if (fd >= 0) {
            close(fd);
        }
        loop_arm(&self.timer, now_us + OPEN_AGAIN_US);
    }
}

static void on_timer(void *context, int64_t now_us)
{
    (void)context;
    if (self.watch.fd < 0) {
        open_device(now_us);
        return;
    }
    for (uint32_t i = 0; i < DEVICES_MAX; i++) {
        if (is_ours(&self.devices[i]) && self.devices[i].soft) {
            unblock(i, now_us);
        }
    }
}

void rfkill_start(int64_t now_us)
{
    loop_timer_init(&self.timer, on_timer, NULL);
    open_device(now_us);
}

bool rfkill_blocked(enum rfkill_radio radio, bool *hard)
{
    uint8_t type = radio == RFKILL_WLAN ? RFKILL_TYPE_WLAN : RFKILL_TYPE_BLUETOOTH;
    bool blocked = false;

    *hard = false;
    for (unsigned i = 0; i < DEVICES_MAX; i++) {
        const struct device *device = &self.devices[i];

        if (device->used && device->type == type && (device->soft || device->hard)) {
            blocked = true;
            *hard = *hard || device->hard;
        }
    }
    return blocked;
}
