/* A pty under a name of its own, which can be taken away and come back like a device. */
#ifndef ODID_TESTS_PTY_H
#define ODID_TESTS_PTY_H

#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <unistd.h>

#include "patience.h"

/* Returns the master, non-blocking. path: a name in a new directory, linked to the slave. */
static inline int pty_open(const char *path)
{
    int master = posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
    struct termios termios;

    if (master < 0 || grantpt(master) < 0 || unlockpt(master) < 0 ||
        tcgetattr(master, &termios) < 0) {
        return -1;
    }
    cfmakeraw(&termios);
    tcsetattr(master, TCSANOW, &termios);
    unlink(path);
    return symlink(ptsname(master), path) < 0 ? -1 : master;
}

/*
 * Reads so many octets, which the kernel hands over some time after they were
 * written to the other end. Returns how many came; all, but for a fault.
 */
static inline size_t pty_read(int fd, void *octets, size_t size)
{
    struct pollfd waiting = {.fd = fd, .events = POLLIN};
    size_t filled = 0;
    ssize_t length;

    while (filled < size && poll(&waiting, 1, PATIENCE_MS) == 1) {
        length = read(fd, (char *)octets + filled, size - filled);
        if (length <= 0) {
            break;
        }
        filled += (size_t)length;
    }
    return filled;
}

/* A directory of the test's own; name: in it. Removed by pty_remove_path. */
static inline void pty_make_path(char path[64], const char *name)
{
    char directory[] = "/tmp/odid-test-XXXXXX";

    snprintf(path, 64, "%s/%s", mkdtemp(directory), name);
}

static inline void pty_remove_path(const char *path)
{
    char directory[64];

    unlink(path);
    snprintf(directory, sizeof(directory), "%s", path);
    *strrchr(directory, '/') = '\0';
    rmdir(directory);
}

#endif
