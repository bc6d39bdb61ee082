#include "radio/hostapd_control.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/log.h"

#define REPLY_MAX 4096
/* Datagrams read in one go: whoever talks without end must not keep the loop from its deadlines. */
#define READS_MAX 16

static void lose_hostapd(struct hostapd_control *control, int error, int64_t now_us)
{
    hostapd_control_close(control);
    control->on_lost(control->context, error, now_us);
}

static void on_timeout(void *context, int64_t now_us)
{
    lose_hostapd(context, -ETIMEDOUT, now_us);
}

void hostapd_control_init(struct hostapd_control *control, hostapd_reply_fn *on_reply,
                          hostapd_lost_fn *on_lost, void *context)
{
    control->watch.fd = -1;
    control->waiting = false;
    control->on_reply = on_reply;
    control->on_lost = on_lost;
    control->context = context;
    loop_timer_init(&control->timeout, on_timeout, control);
}

static void take_datagram(struct hostapd_control *control, char *reply, size_t length,
                          int64_t now_us)
{
    if ((length > 0 && reply[0] == '<') || !control->waiting) {
        return; /* an event, or an answer, that nobody asked for */
    }
    while (length > 0 && reply[length - 1] == '\n') {
        length--;
    }
    reply[length] = '\0';
    control->waiting = false;
    loop_arm(&control->timeout, LOOP_NEVER);
    control->on_reply(control->context, reply, now_us);
}

static void on_datagram(void *context, uint32_t events, int64_t now_us)
{
    struct hostapd_control *control = context;
    char reply[REPLY_MAX];
    ssize_t length;

    for (int reads = 0; reads < READS_MAX && control->watch.fd >= 0; reads++) {
        length = recv(control->watch.fd, reply, sizeof(reply) - 1, 0);
        if (length < 0 && errno == EAGAIN) {
            break;
        }
        if (length < 0) {
            lose_hostapd(control, -errno, now_us);
            return;
        }
        take_datagram(control, reply, (size_t)length, now_us);
    }
    if (control->watch.fd >= 0 && (events & (EPOLLHUP | EPOLLERR))) {
        lose_hostapd(control, -ECONNRESET, now_us);
    }
}

static int connect_socket(int fd, const char *hostapd_dir, const char *iface)
{
    struct sockaddr_un theirs = {.sun_family = AF_UNIX};
    const sa_family_t unnamed = AF_UNIX;
    int length = snprintf(theirs.sun_path, sizeof(theirs.sun_path), "%s/%s", hostapd_dir, iface);

    if (length < 0 || (size_t)length >= sizeof(theirs.sun_path)) {
        return -ENAMETOOLONG;
    }
    /* Connected first: from then on the kernel lets nobody else send to us. */
    if (connect(fd, (struct sockaddr *)&theirs, sizeof(theirs)) < 0 ||
        bind(fd, (const struct sockaddr *)&unnamed, sizeof(unnamed)) < 0) {
        return -errno;
    }
    return 0;
}

int hostapd_control_open(struct hostapd_control *control, const char *hostapd_dir,
                         const char *iface)
{
    int fd, result;

    hostapd_control_close(control);
    fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return -errno;
    }
    result = connect_socket(fd, hostapd_dir, iface);
    if (result == 0) {
        result = loop_watch(&control->watch, fd, EPOLLIN, on_datagram, control);
    }
    if (result < 0) {
        close(fd);
    }
    return result;
}

void hostapd_control_close(struct hostapd_control *control)
{
    int fd = control->watch.fd;

    control->waiting = false;
    loop_arm(&control->timeout, LOOP_NEVER);
    loop_unwatch(&control->watch);
    if (fd >= 0) {
        close(fd);
    }
}

int hostapd_control_request(struct hostapd_control *control, const char *request, int64_t now_us)
{
    if (control->waiting) {
        return -EBUSY;
    }
    if (send(control->watch.fd, request, strlen(request), MSG_NOSIGNAL) < 0) {
        return -errno;
    }
    control->waiting = true;
    loop_arm(&control->timeout, now_us + HOSTAPD_REPLY_US);
    return 0;
}

void hostapd_control_tell(struct hostapd_control *control, const char *request)
{
    if (control->watch.fd >= 0 &&
        send(control->watch.fd, request, strlen(request), MSG_NOSIGNAL) < 0) {
        log_warning("hostapd isn't told \"%s\": %s", request, strerror(errno));
    }
}
