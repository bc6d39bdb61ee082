#include "status_ask.h"

#include <errno.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "loop.h"
#include "status.h"

/* Returns a connected socket, or -errno. A full backlog is EAGAIN: the daemon hangs. */
static int connect_to(const char *run_dir)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int length =
        snprintf(address.sun_path, sizeof(address.sun_path), "%s/%s", run_dir, STATUS_SOCKET);
    int fd, error;

    if (length >= (int)sizeof(address.sun_path)) {
        return -ENAMETOOLONG;
    }
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0) {
        return -errno;
    }
    if (connect(fd, (struct sockaddr *)&address, sizeof(address)) < 0) {
        error = errno;
        close(fd);
        return -error;
    }
    return fd;
}

/* Returns 0 when there is something to read, or -errno. */
static int await(int fd, int64_t end_us)
{
    struct pollfd readable = {.fd = fd, .events = POLLIN};
    int64_t left_us = end_us - loop_now_us();
    int ready = poll(&readable, 1, left_us > 0 ? (int)(left_us / 1000) + 1 : 0);

    return ready > 0 ? 0 : ready == 0 ? -EAGAIN : -errno;
}

ssize_t status_ask(const char *run_dir, int patience_ms, char answer[STATUS_ANSWER_MAX])
{
    int64_t end_us = loop_now_us() + patience_ms * INT64_C(1000);
    int fd = connect_to(run_dir), error = 0;
    size_t filled = 0;
    ssize_t got = 1;

    if (fd < 0) {
        return fd;
    }
    while (error == 0 && got > 0 && filled < STATUS_ANSWER_MAX) {
        error = -await(fd, end_us);
        if (error == 0) {
            got = recv(fd, answer + filled, STATUS_ANSWER_MAX - filled, 0);
            error = got < 0 ? errno : 0;
        }
        if (error == EINTR) { /* the patience counts on */
            error = 0;
            got = 1;
        } else if (error == 0) {
            filled += (size_t)got;
        }
    }
    close(fd);
    return error != 0 ? -error : (ssize_t)filled;
}
