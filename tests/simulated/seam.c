/*
 * The seam between a program and the simulated world: preloaded, it is its
 * clock, its timer, its waiting, and its devices. The program is the one that
 * ships, and knows nothing of it.
 *
 * When nothing is ready, epoll_wait doesn't wait. It tells the world how long it
 * would have (SIM_FD: 8 octets, the deadline in simulated microseconds), and
 * goes on with the time that the world answers.
 *
 * A file of the machine that also lies below SIM_ROOT is that one: a boot id, a
 * device. A device there is a UNIX socket that the world listens at: what is
 * written to it is there at once, which a pty's octets are not. Devices that
 * aren't there don't exist.
 *
 * What is left out beside this (README.md): the system-call filter, locked memory
 * and real-time priority.
 */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/timerfd.h>
#include <sys/un.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define NEVER INT64_MAX
#define FILES_MAX 1024
#define END_OF_WORLD 99 /* exit code: the world has gone */

/* The next definition of a function behind this one: libc's. */
#define NEXT(name) ((__typeof__(&name))next(#name))

static struct {
    int world; /* SIM_FD */
    int timer; /* an eventfd that stands for the program's timerfd */
    const char *root;
    int64_t now_us;      /* CLOCK_MONOTONIC */
    int64_t realtime_us; /* CLOCK_REALTIME is ahead by this */
    int64_t deadline_us;
    uint64_t random;
    bool is_device[FILES_MAX];
} self = {.world = -1, .timer = -1, .deadline_us = NEVER};

static void *next(const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);

    if (found == NULL) {
        _exit(END_OF_WORLD);
    }
    return found;
}

static int64_t number(const char *name)
{
    const char *text = getenv(name);

    if (text == NULL) {
        dprintf(STDERR_FILENO, "simulated: %s is not set\n", name);
        _exit(END_OF_WORLD);
    }
    return strtoll(text, NULL, 10);
}

__attribute__((constructor)) static void begin(void)
{
    self.world = (int)number("SIM_FD");
    self.now_us = number("SIM_NOW_US");
    self.realtime_us = number("SIM_REALTIME_US");
    self.random = (uint64_t)number("SIM_SEED") * UINT64_C(0x9E3779B97F4A7C15) + 1;
    self.root = getenv("SIM_ROOT");
}

/* ---- time ---- */

int clock_gettime(clockid_t clock, struct timespec *time)
{
    int64_t now_us = self.now_us;

    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) {
        now_us += self.realtime_us;
    }
    time->tv_sec = now_us / 1000000;
    time->tv_nsec = now_us % 1000000 * 1000;
    return 0;
}

time_t time(time_t *result)
{
    time_t now_s = (self.now_us + self.realtime_us) / 1000000;

    if (result != NULL) {
        *result = now_s;
    }
    return now_s;
}

int timerfd_create(int clock, int flags)
{
    (void)clock;
    (void)flags;
    return self.timer = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
}

int timerfd_settime(int timer, int flags, const struct itimerspec *when, struct itimerspec *before)
{
    uint64_t expirations;

    (void)flags;
    (void)before;
    if (read(timer, &expirations, sizeof(expirations)) < 0 && errno != EAGAIN) {
        return -1;
    }
    self.deadline_us = when->it_value.tv_sec * INT64_C(1000000) + when->it_value.tv_nsec / 1000;
    if (self.deadline_us == 0) {
        self.deadline_us = NEVER;
    }
    return 0;
}

static void expire(void)
{
    const uint64_t once = 1;

    if (self.deadline_us <= self.now_us) {
        self.deadline_us = NEVER;
        if (write(self.timer, &once, sizeof(once)) < 0) {
            _exit(END_OF_WORLD);
        }
    }
}

int epoll_wait(int epoll, struct epoll_event *events, int size, int timeout_ms)
{
    static __typeof__(&epoll_wait) wait;
    int count;

    if (wait == NULL) {
        wait = NEXT(epoll_wait);
    }
    for (;;) {
        expire();
        count = wait(epoll, events, size, 0);
        if (count != 0 || timeout_ms == 0) {
            return count;
        }
        if (send(self.world, &self.deadline_us, sizeof(self.deadline_us), MSG_NOSIGNAL) < 0 ||
            recv(self.world, &self.now_us, sizeof(self.now_us), 0) != sizeof(self.now_us)) {
            _exit(END_OF_WORLD);
        }
    }
}

/* ---- files and devices ---- */

/* What stands for a path below the root; false: nothing does. */
static bool in_world(const char *path,
                     char found[static sizeof(((struct sockaddr_un *)0)->sun_path)],
                     struct stat *status)
{
    size_t size = sizeof(((struct sockaddr_un *)0)->sun_path);

    return self.root != NULL && path[0] == '/' &&
           (size_t)snprintf(found, size, "%s%s", self.root, path) < size &&
           stat(found, status) == 0;
}

static int open_device(const char *path)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int types[] = {SOCK_STREAM, SOCK_SEQPACKET}, fd;

    snprintf(address.sun_path, sizeof(address.sun_path), "%s", path);
    for (size_t i = 0; i < sizeof(types) / sizeof(types[0]); i++) {
        fd = socket(AF_UNIX, types[i] | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
        if (fd >= 0 && fd < FILES_MAX &&
            connect(fd, (struct sockaddr *)&address, sizeof(address)) == 0) {
            self.is_device[fd] = true;
            return fd;
        }
        close(fd);
    }
    errno = ENOENT; /* it was unplugged */
    return -1;
}

static bool is_of_any_machine(const char *path)
{
    return strcmp(path, "/dev/null") == 0 || strcmp(path, "/dev/urandom") == 0;
}

int open(const char *path, int flags, ...)
{
    char found[sizeof(((struct sockaddr_un *)0)->sun_path)];
    struct stat status;
    va_list rest;
    mode_t mode;

    va_start(rest, flags);
    mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    if (in_world(path, found, &status)) {
        if (S_ISSOCK(status.st_mode)) {
            return open_device(found);
        }
        path = found;
    } else if (strncmp(path, "/dev/", 5) == 0 && !is_of_any_machine(path)) {
        errno = ENOENT;
        return -1;
    }
    return NEXT(open)(path, flags, mode);
}

static bool is_device(int fd)
{
    return fd >= 0 && fd < FILES_MAX && self.is_device[fd];
}

int close(int fd)
{
    if (is_device(fd)) {
        self.is_device[fd] = false;
    }
    return NEXT(close)(fd);
}

int tcgetattr(int fd, struct termios *termios)
{
    if (!is_device(fd)) {
        return NEXT(tcgetattr)(fd, termios);
    }
    memset(termios, 0, sizeof(*termios));
    return 0;
}

int tcsetattr(int fd, int when, const struct termios *termios)
{
    return is_device(fd) ? 0 : NEXT(tcsetattr)(fd, when, termios);
}

int tcflush(int fd, int queue)
{
    return is_device(fd) ? 0 : NEXT(tcflush)(fd, queue);
}

/* What was written to a device is behind it at once. */
int ioctl(int fd, unsigned long request, ...)
{
    va_list rest;
    void *argument;

    va_start(rest, request);
    argument = va_arg(rest, void *);
    va_end(rest);
    if (is_device(fd) && request == TIOCOUTQ) {
        *(int *)argument = 0;
        return 0;
    }
    return NEXT(ioctl)(fd, request, argument);
}

/* ---- chance, and what doesn't take part ---- */

ssize_t getrandom(void *octets, size_t size, unsigned flags)
{
    (void)flags;
    for (size_t i = 0; i < size; i++) { /* xorshift64 */
        self.random ^= self.random << 13;
        self.random ^= self.random >> 7;
        self.random ^= self.random << 17;
        ((uint8_t *)octets)[i] = (uint8_t)(self.random >> 32);
    }
    return (ssize_t)size;
}

int seccomp_load(void *filter)
{
    (void)filter;
    return 0;
}

int mlockall(int flags)
{
    (void)flags;
    return 0;
}

int sched_setscheduler(int process, int policy, const void *parameters)
{
    (void)process;
    (void)policy;
    (void)parameters;
    return 0;
}
