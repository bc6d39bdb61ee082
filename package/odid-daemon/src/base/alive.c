#include "base/alive.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/inherited.h"
#include "base/log.h"
#include "base/loop.h"

#define EVERY_US 1000000

static struct {
    int fd; /* -1: no keeper */
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

void alive_open(void)
{
    int fd = inherited_take(ALIVE_VARIABLE);
    int result = fd < 0 ? fd : take_pipe(fd);

    self.fd = result < 0 ? -1 : fd;
    if (result < 0 && result != -ENOENT) {
        log_warning("%s names no pipe to write to (%s): the keeper hears nothing, and will start "
                    "the daemon again",
                    ALIVE_VARIABLE, strerror(-result));
    }
}

static void on_sign_due(void *context, int64_t now_us)
{
    (void)context;
    /* A full pipe: a keeper that stopped, and has enough to read when it goes on. */
    if (write(self.fd, "a", 1) < 0 && errno != EAGAIN) {
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
