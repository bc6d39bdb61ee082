#include "radio/rfkill.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/rfkill.h>
#include <string.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "base/log.h"
#include "base/loop.h"

#define DEVICES_MAX 16
#define OPEN_AGAIN_US 5000000
/* A soft block that is set again and again is undone this often at most. */
#define UNBLOCK_EVERY_US 250000

/* One radio's switch. The kernel never uses an index again: a dongle has a new one each time. */
struct device {
    bool used;
    uint32_t index;
    uint8_t type; /* RFKILL_TYPE_... */
    bool soft, hard, told, failed;
    int64_t unblocked_us;
};

static struct {
    struct loop_watch watch;
    struct loop_timer timer;
    const char *path;
    struct device devices[DEVICES_MAX];
} self = {.watch.fd = -1};

static const char *type_name(uint8_t type)
{
    return type == RFKILL_TYPE_WLAN ? "Wi-Fi" : "Bluetooth";
}

static void unblock(struct device *device, int64_t now_us)
{
    const struct rfkill_event event = {
        .idx = device->index, .type = device->type, .op = RFKILL_OP_CHANGE, .soft = 0};
    bool failed;

    device->unblocked_us = now_us;
    failed = write(self.watch.fd, &event, sizeof(event)) < 0;
    if (failed && !device->failed) {
        log_warning("rfkill: can't unblock %s: %s; trying on", type_name(device->type),
                    strerror(errno));
    }
    device->failed = failed;
}

/* Until it is seen to be off: a driver may refuse, and the kernel then says nothing. */
static void unblock_what_is_due(int64_t now_us)
{
    int64_t next_us = LOOP_NEVER;

    for (unsigned i = 0; i < DEVICES_MAX; i++) {
        struct device *device = &self.devices[i];

        if (!device->used || !device->soft) {
            continue;
        }
        if (now_us - device->unblocked_us >= UNBLOCK_EVERY_US) {
            unblock(device, now_us);
        }
        if (device->unblocked_us + UNBLOCK_EVERY_US < next_us) {
            next_us = device->unblocked_us + UNBLOCK_EVERY_US;
        }
    }
    loop_arm(&self.timer, next_us);
}

static void log_whether_blocked(struct device *device)
{
    if ((device->soft || device->hard) && !device->told) {
        log_warning("rfkill: %s is blocked%s", type_name(device->type),
                    device->hard ? " by a switch" : "");
    } else if (!device->soft && !device->hard && device->told) {
        log_info("rfkill: %s is unblocked", type_name(device->type));
    }
    device->told = device->soft || device->hard;
}

/* The device with this index, or a free place for it; NULL when there is none. */
static struct device *find_device(uint32_t index)
{
    struct device *place = NULL;

    for (unsigned i = 0; i < DEVICES_MAX; i++) {
        struct device *device = &self.devices[i];

        if (device->used && device->index == index) {
            return device;
        }
        if (!device->used && place == NULL) {
            place = device;
        }
    }
    return place;
}

static void take_event(const struct rfkill_event *event, int64_t now_us)
{
    struct device *device = find_device(event->idx);

    if (device == NULL ||
        (event->type != RFKILL_TYPE_WLAN && event->type != RFKILL_TYPE_BLUETOOTH)) {
        return;
    }
    if (event->op == RFKILL_OP_DEL) {
        device->used = false;
        return;
    }
    if (!device->used) {
        *device = (struct device){
            .used = true, .index = event->idx, .unblocked_us = now_us - UNBLOCK_EVERY_US};
    }
    device->type = event->type;
    device->soft = event->soft != 0;
    device->hard = event->hard != 0;
    log_whether_blocked(device);
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
    if (length >= 0 || (errno != EAGAIN && errno != EINTR)) { /* the end, or no rfkill events */
        int fd = self.watch.fd;

        loop_unwatch(&self.watch);
        close(fd);
        memset(self.devices, 0, sizeof(self.devices)); /* told anew after opening */
        loop_arm(&self.timer, now_us + OPEN_AGAIN_US);
        return;
    }
    unblock_what_is_due(now_us);
}

static void open_device(int64_t now_us)
{
    int fd = open(self.path, O_RDWR | O_NONBLOCK | O_CLOEXEC);

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
    unblock_what_is_due(now_us);
}

void rfkill_start_at(const char *path, int64_t now_us)
{
    self.path = path;
    loop_timer_init(&self.timer, on_timer, NULL);
    open_device(now_us);
}

void rfkill_start(int64_t now_us)
{
    rfkill_start_at("/dev/rfkill", now_us);
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
