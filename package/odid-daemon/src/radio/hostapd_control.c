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
#define READS_MAX 16 /* then it isn't listened to for a moment */
/* So long nobody who passed descriptors is spoken to, and each time twice as long. */
#define SHUN_US 60000000
#define SHUN_DOUBLED_MAX 10 /* no power-on lasts as long as that */

/* The next datagram's length, or -errno; HOSTAPD_PASSED: it is there still. */
static ssize_t receive(int fd, char *reply, size_t size)
{
    struct iovec place = {.iov_base = reply, .iov_len = size};
    struct msghdr message = {.msg_iov = &place, .msg_iovlen = 1};
    ssize_t length = recvmsg(fd, &message, MSG_PEEK);

    if (length >= 0 && (message.msg_flags & MSG_CTRUNC)) {
        return HOSTAPD_PASSED;
    }
    if (length >= 0) {
        length = recv(fd, reply, size, 0);
    }
    return length < 0 ? -errno : length;
}

/* Whether nothing is in its queue any more. */
static bool is_empty(int fd)
{
    ssize_t length = 0;
    char passed_over;

    for (int reads = 0; reads < READS_MAX && length != HOSTAPD_PASSED; reads++) {
        length = receive(fd, &passed_over, sizeof(passed_over));
        if (length == -EAGAIN) {
            return true;
        }
    }
    return false;
}

/*
 * Where descriptors came, they are left in the queue, and the socket open: whoever takes them out,
 * or closes it, closes them all, and the kernel may take 20 ms of our time for each one. As long as
 * they are there, it also lets their sender pass only so many.
 */
static void leave_open(struct hostapd_control *control)
{
    unsigned doubled = control->passed < SHUN_DOUBLED_MAX ? control->passed : SHUN_DOUBLED_MAX;

    control->passed++;
    control->shunned_us = loop_now_us() + ((int64_t)SHUN_US << doubled);
}

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
    control->passed = 0;
    control->shunned_us = INT64_MIN;
    control->on_reply = on_reply;
    control->on_lost = on_lost;
    control->context = context;
    loop_timer_init(&control->timeout, on_timeout, control);
    loop_pause_init(&control->pause, &control->watch);
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
    int reads;

    for (reads = 0; reads < READS_MAX && control->watch.fd >= 0; reads++) {
        length = receive(control->watch.fd, reply, sizeof(reply) - 1);
        if (length == -EAGAIN) {
            break;
        }
        if (length < 0) {
            lose_hostapd(control, (int)length, now_us);
            return;
        }
        take_datagram(control, reply, (size_t)length, now_us);
    }
    if (control->watch.fd >= 0 && (events & (EPOLLHUP | EPOLLERR))) {
        lose_hostapd(control, -ECONNRESET, now_us);
    } else if (control->watch.fd >= 0 && reads == READS_MAX) {
        loop_pause_reading(&control->pause);
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
    if (loop_now_us() < control->shunned_us) {
        return HOSTAPD_PASSED;
    }
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
    if (fd >= 0 && !is_empty(fd)) {
        leave_open(control);
    } else if (fd >= 0) {
        close(fd);
    }
}

/* Where the other end is gone, the kernel takes out itself, at that, what is in our queue. */
static int send_request(int fd, const char *request)
{
    if (!is_empty(fd)) {
        return HOSTAPD_PASSED;
    }
    return send(fd, request, strlen(request), MSG_NOSIGNAL) < 0 ? -errno : 0;
}

int hostapd_control_request(struct hostapd_control *control, const char *request, int64_t now_us)
{
    int result;

    if (control->waiting) {
        return -EBUSY;
    }
    result = send_request(control->watch.fd, request);
    if (result < 0) {
        return result;
    }
    control->waiting = true;
    loop_arm(&control->timeout, now_us + HOSTAPD_REPLY_US);
    return 0;
}

void hostapd_control_wait(struct hostapd_control *control, int64_t until_us)
{
    if (control->waiting) {
        loop_arm(&control->timeout, until_us);
    }
}

void hostapd_control_tell(struct hostapd_control *control, const char *request)
{
    int result = control->watch.fd < 0 ? 0 : send_request(control->watch.fd, request);

    if (result < 0) {
        log_warning("hostapd isn't told \"%s\": %s", request, strerror(-result));
    }
}
