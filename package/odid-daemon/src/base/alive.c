#include "base/alive.h"

#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/inherited.h"
#include "base/log.h"
#include "base/loop.h"

#define EVERY_US 1000000

static struct {
    int fd;        /* -1: nobody hears it */
    bool manager;  /* it is a service manager that does */
    bool is_ready; /* and knows that we began */
    struct loop_timer timer;
    int64_t due_us;
} self = {.fd = -1};

/* Only a pipe that may be written to: a wrong number must not put bytes into anything else. */
static int take_pipe(int fd)
{
    struct stat status;
    int flags = fcntl(fd, F_GETFL);

    if (flags < 0 || fstat(fd, &status) < 0) {
        return -errno;
    }
    if (!S_ISFIFO(status.st_mode) || (flags & O_ACCMODE) == O_RDONLY) {
        return -ENOTSUP;
    }
    return fcntl(fd, F_SETFL, flags | O_NONBLOCK) < 0 ? -errno : 0;
}

/* name: a path, or behind "@" one that isn't in the file system. */
static int connect_manager(const char *name)
{
    struct sockaddr_un theirs = {.sun_family = AF_UNIX};
    size_t length = strlen(name);
    int fd;

    if ((name[0] != '/' && name[0] != '@') || length >= sizeof(theirs.sun_path)) {
        return -EINVAL;
    }
    memcpy(theirs.sun_path, name, length);
    if (name[0] == '@') {
        theirs.sun_path[0] = '\0';
    }
    fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&theirs,
                           (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length)) < 0) {
        int error = errno;

        close(fd);
        return -error;
    }
    return fd < 0 ? -errno : fd;
}

static void open_manager(void)
{
    const char *name = getenv(ALIVE_NOTIFY_VARIABLE);

    self.manager = name != NULL;
    self.is_ready = false;
    if (name == NULL) {
        return;
    }
    self.fd = connect_manager(name);
    if (self.fd < 0) {
        log_warning("%s is \"%s\", and no service manager's socket (%s): it will start us again",
                    ALIVE_NOTIFY_VARIABLE, name, strerror(-self.fd));
        self.fd = -1;
    }
    unsetenv(ALIVE_NOTIFY_VARIABLE);
}

void alive_open(void)
{
    int fd = inherited_take(ALIVE_VARIABLE);
    int result = fd < 0 ? fd : take_pipe(fd);

    self.fd = result < 0 ? -1 : fd;
    self.manager = false;
    if (result == -ENOENT) {
        open_manager();
    } else if (result < 0) {
        log_warning("%s names no pipe to write to (%s): the keeper hears nothing, and will start "
                    "the daemon again",
                    ALIVE_VARIABLE, strerror(-result));
    }
}

static void tell_manager(void)
{
    const char *what = self.is_ready ? "WATCHDOG=1" : "READY=1\nWATCHDOG=1";

    self.is_ready = send(self.fd, what, strlen(what), MSG_NOSIGNAL) >= 0 || self.is_ready;
}

static void on_sign_due(void *context, int64_t now_us)
{
    (void)context;
    if (self.manager) {
        tell_manager();
    } else if (write(self.fd, "a", 1) < 0 && errno != EAGAIN) {
        /* A full pipe is a keeper's that stopped, and has enough to read when it goes on. */
        log_error("the keeper is gone (%s): ending, for the next one starts another daemon",
                  strerror(errno));
        close(self.fd);
        self.fd = -1;
        loop_stop();
        return;
    }
    self.due_us += EVERY_US;
    if (self.due_us <= now_us) {
        self.due_us = now_us + EVERY_US;
    }
    loop_arm(&self.timer, self.due_us);
}

void alive_start(int64_t now_us)
{
    if (self.fd < 0) {
        return;
    }
    self.due_us = now_us;
    loop_timer_init(&self.timer, on_sign_due, NULL);
    loop_arm(&self.timer, now_us);
}
