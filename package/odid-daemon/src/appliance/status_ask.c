#include "appliance/status_ask.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/loop.h"

/* In the kernel's queue, in turn: where many ask, each gets its answer. */
static int wait_at_most(int fd, int patience_ms)
{
    struct timeval patience = {.tv_sec = patience_ms / 1000,
                               .tv_usec = patience_ms % 1000 * 1000 + 1}; /* 0: for ever */

    return setsockopt(fd, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof(patience));
}

/*
 * The folder is the daemon's, and who asks may be root: a link there, made by a
 * daemon that was taken over, would lead to anybody's socket. So what is
 * connected to is what was looked at. Returns the socket's own descriptor, or
 * -errno.
 */
static int find_socket(const char *run_dir)
{
    char path[sizeof(((struct sockaddr_un *)NULL)->sun_path)];
    int length = snprintf(path, sizeof(path), "%s/%s", run_dir, STATUS_SOCKET), fd;
    struct stat file;

    if (length >= (int)sizeof(path)) {
        return -ENAMETOOLONG;
    }
    fd = open(path, O_PATH | O_NOFOLLOW | O_CLOEXEC);
    if (fd < 0) {
        return -errno;
    }
    if (fstat(fd, &file) < 0 || !S_ISSOCK(file.st_mode)) {
        close(fd);
        return -ECONNREFUSED; /* as of one that nobody listens on */
    }
    return fd;
}

/* Returns a connected socket, or -errno. A backlog that stays full is EAGAIN: the daemon hangs. */
static int connect_to(const char *run_dir, int patience_ms)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int found = find_socket(run_dir), fd, error = 0;

    if (found < 0) {
        return found;
    }
    snprintf(address.sun_path, sizeof(address.sun_path), "/proc/self/fd/%d", found);
    fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd < 0 || wait_at_most(fd, patience_ms) < 0 ||
        connect(fd, (struct sockaddr *)&address, sizeof(address)) < 0) {
        error = errno;
    }
    close(found);
    if (error != 0 && fd >= 0) {
        close(fd);
    }
    return error != 0 ? -error : fd;
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
    int fd = connect_to(run_dir, patience_ms), error = 0;
    size_t filled = 0;
    ssize_t got = 1;

    if (fd < 0) {
        return fd;
    }
    while (error == 0 && got > 0 && filled < STATUS_ANSWER_MAX) {
        error = -await(fd, end_us);
        if (error == 0) {
            got = recv(fd, answer + filled, STATUS_ANSWER_MAX - filled, MSG_DONTWAIT);
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
