/* hostapd's control socket, played in the test's own event loop. */
#ifndef ODID_TESTS_FAKE_HOSTAPD_H
#define ODID_TESTS_FAKE_HOSTAPD_H

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/loop.h"

struct fake_hostapd {
    struct loop_watch watch;
    char directory[32], path[108]; /* where the control socket is */
    struct sockaddr_un client;
    socklen_t client_size;
    bool hangs, talks; /* no replies; events before each reply */
    bool passes;       /* a descriptor with each reply */
    bool disabled, cannot_enable;
    const char *set_reply, *update_reply;
    size_t limit;     /* longer elements are refused, in octets; 0: none is */
    unsigned refuses; /* so many updates */
    /* vendor elements, as hexadecimal: hostapd's, the one that its driver takes for set, and those
     * that the chip has */
    char configured[1024], driver[1024], chip[2][1024];
    char beacon[2048]; /* the chip's one after the other */
    unsigned requests, statuses, sets, clears, updates, switched;
};

static inline void fake_reply(struct fake_hostapd *fake, const char *reply)
{
    if (sendto(fake->watch.fd, reply, strlen(reply), MSG_DONTWAIT, (struct sockaddr *)&fake->client,
               fake->client_size) < 0) {
        return; /* nobody is there */
    }
}

/* With a descriptor, to whom it answered last. */
static inline bool fake_pass(struct fake_hostapd *fake, const char *reply, int fd)
{
    union {
        struct cmsghdr header;
        char bytes[CMSG_SPACE(sizeof(int))];
    } control = {.header = {.cmsg_len = CMSG_LEN(sizeof(int)),
                            .cmsg_level = SOL_SOCKET,
                            .cmsg_type = SCM_RIGHTS}};
    struct iovec place = {.iov_base = (void *)(uintptr_t)reply, .iov_len = strlen(reply)};
    struct msghdr message = {.msg_name = &fake->client,
                             .msg_namelen = fake->client_size,
                             .msg_iov = &place,
                             .msg_iovlen = 1,
                             .msg_control = &control,
                             .msg_controllen = sizeof(control)};

    memcpy(CMSG_DATA(&control.header), &fd, sizeof(fd));
    return sendmsg(fake->watch.fd, &message, MSG_DONTWAIT) >= 0;
}

static inline void fake_hostapd_forget(struct fake_hostapd *fake)
{
    memset(fake->driver, 0, sizeof(fake->driver));
    memset(fake->chip, 0, sizeof(fake->chip));
    memset(fake->beacon, 0, sizeof(fake->beacon));
}

/* The chip's: `before` is deleted, `now` added; "" is none. What it refuses it leaves as it is. */
static bool fake_chip_takes(struct fake_hostapd *fake, const char *before, const char *now)
{
    char *place;

    if (before[0] != '\0') {
        place = strcmp(fake->chip[0], before) == 0 ? fake->chip[0] : fake->chip[1];
        if (strcmp(place, before) != 0) {
            return false;
        }
        memset(place, 0, sizeof(fake->chip[0]));
    }
    if (now[0] == '\0') {
        return true;
    }
    place = fake->chip[0][0] == '\0' ? fake->chip[0] : fake->chip[1];
    if ((fake->limit > 0 && strlen(now) / 2 > fake->limit) || place[0] != '\0') {
        return false;
    }
    memcpy(place, now, strlen(now));
    return true;
}

/* brcmfmac's: it takes for set what it was told, whatever the chip says; the same one is nothing
 * new. */
static bool fake_driver_takes(struct fake_hostapd *fake)
{
    char before[sizeof(fake->driver)];
    bool taken;

    if (strcmp(fake->driver, fake->configured) == 0) {
        return true;
    }
    memcpy(before, fake->driver, sizeof(before));
    memcpy(fake->driver, fake->configured, sizeof(fake->driver));
    if (fake->refuses > 0 && fake->configured[0] != '\0') {
        fake->refuses--;
        return false;
    }
    taken = fake_chip_takes(fake, before, fake->driver);
    snprintf(fake->beacon, sizeof(fake->beacon), "%s%s", fake->chip[0], fake->chip[1]);
    return taken;
}

/* An element that somebody set before. */
static inline void fake_hostapd_has(struct fake_hostapd *fake, const char *element)
{
    snprintf(fake->configured, sizeof(fake->configured), "%s", element);
    fake_driver_takes(fake);
}

static const char *fake_obey_hostapd(struct fake_hostapd *fake, const char *request)
{
    static const char set[] = "SET vendor_elements ";

    if (strcmp(request, "STATUS") == 0) {
        fake->statuses++;
        return fake->disabled ? "state=DISABLED\nphy=phy0\n"
                              : "state=ENABLED\nphy=phy0\nfreq=2437\n";
    }
    if (strncmp(request, set, strlen(set)) == 0) {
        fake->sets++;
        fake->clears += request[strlen(set)] == '\0';
        if (strcmp(fake->set_reply, "OK\n") == 0) {
            snprintf(fake->configured, sizeof(fake->configured), "%s", request + strlen(set));
        }
        return fake->set_reply;
    }
    if (strcmp(request, "UPDATE_BEACON") == 0) {
        fake->updates++;
        return fake->disabled || strcmp(fake->update_reply, "OK\n") != 0 || !fake_driver_takes(fake)
                   ? "FAIL\n"
                   : "OK\n";
    }
    if (strcmp(request, "DISABLE") == 0 || strcmp(request, "ENABLE") == 0) {
        fake->switched++;
        fake->disabled = request[0] == 'D' || fake->cannot_enable;
        fake_hostapd_forget(fake);
        return request[0] == 'E' && fake->disabled ? "FAIL\n" : "OK\n";
    }
    return "UNKNOWN COMMAND\n";
}

static void fake_hostapd_readable(void *context, uint32_t events, int64_t now_us)
{
    struct fake_hostapd *fake = context;
    char request[1024];
    const char *reply;
    ssize_t length;

    (void)events;
    (void)now_us;
    fake->client_size = sizeof(fake->client);
    while ((length = recvfrom(fake->watch.fd, request, sizeof(request) - 1, MSG_DONTWAIT,
                              (struct sockaddr *)&fake->client, &fake->client_size)) >= 0) {
        request[length] = '\0';
        fake->requests++;
        reply = fake_obey_hostapd(fake, request);
        if (fake->hangs) {
            continue;
        }
        if (fake->talks) {
            fake_reply(fake, "<3>AP-STA-CONNECTED 02:00:00:00:00:01");
        }
        if (fake->passes) {
            fake_pass(fake, reply, STDERR_FILENO);
        } else {
            fake_reply(fake, reply);
        }
    }
}

static void fake_hostapd_run(struct fake_hostapd *fake)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    fake_hostapd_forget(fake); /* a new one has forgotten everything */
    memset(fake->configured, 0, sizeof(fake->configured));
    snprintf(address.sun_path, sizeof(address.sun_path), "%s", fake->path);
    if (bind(fd, (struct sockaddr *)&address, sizeof(address)) == 0) {
        loop_watch(&fake->watch, fd, EPOLLIN, fake_hostapd_readable, fake);
    }
}

static void fake_hostapd_die(struct fake_hostapd *fake)
{
    int fd = fake->watch.fd;

    if (fd >= 0) {
        loop_unwatch(&fake->watch);
        close(fd);
    }
    unlink(fake->path);
}

static void fake_hostapd_start(struct fake_hostapd *fake)
{
    memset(fake, 0, sizeof(*fake));
    fake->set_reply = fake->update_reply = "OK\n";
    fake->watch.fd = -1;
    snprintf(fake->directory, sizeof(fake->directory), "/tmp/odid-test-XXXXXX");
    if (mkdtemp(fake->directory) != NULL) {
        snprintf(fake->path, sizeof(fake->path), "%s/wlan0", fake->directory);
    }
    fake_hostapd_run(fake);
}

/* Fails (rmdir) when the daemon left something behind. */
static bool fake_hostapd_end(struct fake_hostapd *fake)
{
    fake_hostapd_die(fake);
    return rmdir(fake->directory) == 0;
}

#endif
