/*
 * The seam between a program and the simulated world: preloaded, it is its
 * clocks, its timer, its waiting, and its devices. The program is the one that
 * ships, and knows nothing of it; one that it starts gets a seam of its own.
 *
 * When nothing is ready, epoll_wait, poll and sigtimedwait don't wait. They tell
 * the world until when they would have, and go on with the time that the world
 * answers (SIM_ROOT/world, a socket; struct turn goes either way).
 *
 * A file of the machine that also lies below SIM_ROOT is that one: a boot id, a
 * device, /run. A device there is a UNIX socket that the world listens at: what
 * is written to it is there at once, which a pty's octets are not. Devices that
 * aren't there don't exist.
 *
 * What is left out beside this (README.md): the system-call filter, locked memory
 * and real-time priority.
 */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
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
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#define NEVER INT64_MAX
#define FILES_MAX 1024
#define END_OF_WORLD 99 /* exit code: the world has gone */

/* The next definition of a function behind this one: libc's. */
#define NEXT(name)                                                                                 \
    ({                                                                                             \
        static __typeof__(&name) found_##name;                                                     \
        found_##name = found_##name != NULL ? found_##name : (__typeof__(&name))next(#name);       \
        found_##name;                                                                              \
    })

enum file_kind { FILE_UNKNOWN, FILE_OF_OURS, FILE_OF_OTHERS, FILE_DEVICE };

/* What program and world tell each other. */
struct turn {
    int64_t us;          /* program: until when it would wait; world: CLOCK_MONOTONIC */
    int64_t realtime_us; /* CLOCK_REALTIME is ahead by this */
    int64_t born;        /* program: the process that it has started since, or 0 */
    int64_t touched;     /* program: another program may have something to read since */
};

static struct {
    int world;
    int timer; /* an eventfd that stands for the program's timerfd */
    const char *root;
    struct turn now;
    int64_t deadline_us; /* of the timer */
    int64_t born, touched;
    uint64_t random;
    uint8_t kind[FILES_MAX]; /* enum file_kind */
} self = {.world = -1, .timer = -1, .deadline_us = NEVER};

static void *next(const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);

    if (found == NULL) {
        _exit(END_OF_WORLD);
    }
    return found;
}

static int connect_to(const char *path, int type)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, type | SOCK_CLOEXEC, 0);

    snprintf(address.sun_path, sizeof(address.sun_path), "%s", path);
    if (NEXT(connect)(fd, (struct sockaddr *)&address, sizeof(address)) == 0) {
        return fd;
    }
    NEXT(close)(fd);
    return -1;
}

/* The program stands still until the world says what time it is. */
static void wait_for_the_world(int64_t until_us)
{
    const struct turn mine = {.us = until_us,
                              .realtime_us = self.now.realtime_us,
                              .born = self.born,
                              .touched = self.touched};

    self.born = self.touched = 0;
    if (NEXT(send)(self.world, &mine, sizeof(mine), MSG_NOSIGNAL) < 0 ||
        recv(self.world, &self.now, sizeof(self.now), 0) != sizeof(self.now)) {
        _exit(END_OF_WORLD);
    }
}

__attribute__((constructor)) static void begin(void)
{
    const char *seed;
    char path[108];

    self.root = getenv("SIM_ROOT");
    seed = getenv("SIM_SEED");
    if (self.root == NULL || seed == NULL) {
        dprintf(STDERR_FILENO, "simulated: SIM_ROOT and SIM_SEED have to be set\n");
        _exit(END_OF_WORLD);
    }
    snprintf(path, sizeof(path), "%s/world", self.root);
    self.world = connect_to(path, SOCK_SEQPACKET);
    wait_for_the_world(0);
    self.random = (uint64_t)strtoll(seed, NULL, 10) * UINT64_C(0x9E3779B97F4A7C15) + 1;
}

/* ---- time ---- */

int clock_gettime(clockid_t clock, struct timespec *time)
{
    int64_t now_us = self.now.us;

    if (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE) {
        now_us += self.now.realtime_us;
    }
    time->tv_sec = now_us / 1000000;
    time->tv_nsec = now_us % 1000000 * 1000;
    return 0;
}

int clock_settime(clockid_t clock, const struct timespec *time)
{
    if (clock != CLOCK_REALTIME) {
        errno = EINVAL;
        return -1;
    }
    self.now.realtime_us = time->tv_sec * INT64_C(1000000) + time->tv_nsec / 1000 - self.now.us;
    return 0;
}

time_t time(time_t *result)
{
    time_t now_s = (self.now.us + self.now.realtime_us) / 1000000;

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

    if (self.deadline_us <= self.now.us) {
        self.deadline_us = NEVER;
        if (NEXT(write)(self.timer, &once, sizeof(once)) < 0) {
            _exit(END_OF_WORLD);
        }
    }
}

/* ---- waiting ---- */

static int64_t until_us(int timeout_ms)
{
    return timeout_ms < 0 ? NEVER : self.now.us + timeout_ms * INT64_C(1000);
}

int epoll_wait(int epoll, struct epoll_event *events, int size, int timeout_ms)
{
    int64_t end_us = until_us(timeout_ms);
    int count;

    for (;;) {
        expire();
        count = NEXT(epoll_wait)(epoll, events, size, 0);
        if (count != 0 || end_us <= self.now.us) {
            return count;
        }
        wait_for_the_world(self.deadline_us < end_us ? self.deadline_us : end_us);
    }
}

int poll(struct pollfd *files, nfds_t count, int timeout_ms)
{
    int64_t end_us = until_us(timeout_ms);
    int ready;

    while ((ready = NEXT(poll)(files, count, 0)) == 0 && end_us > self.now.us) {
        wait_for_the_world(end_us);
    }
    return ready;
}

int sigtimedwait(const sigset_t *set, siginfo_t *info, const struct timespec *timeout)
{
    const struct timespec at_once = {0};
    int64_t end_us = self.now.us + timeout->tv_sec * INT64_C(1000000) + timeout->tv_nsec / 1000;
    int signal;

    while ((signal = NEXT(sigtimedwait)(set, info, &at_once)) < 0 && end_us > self.now.us) {
        wait_for_the_world(end_us);
    }
    return signal;
}

/* ---- other programs ---- */

pid_t fork(void)
{
    pid_t child = NEXT(fork)();

    if (child > 0) {
        self.born = child;
    }
    return child;
}

/* One that is killed has gone when this returns: who started it has been told. */
int kill(pid_t process, int signal)
{
    int result = NEXT(kill)(process, signal);
    siginfo_t info;

    self.touched = true;
    if (result == 0 && signal == SIGKILL) {
        waitid(P_PID, (id_t)process, &info, WEXITED | WNOWAIT);
    }
    return result;
}

static enum file_kind kind_of(int fd)
{
    struct stat status;

    if (fd < 0 || fd >= FILES_MAX) {
        return FILE_OF_OURS;
    }
    if (self.kind[fd] == FILE_UNKNOWN) {
        bool shared =
            fstat(fd, &status) == 0 && (S_ISFIFO(status.st_mode) || S_ISSOCK(status.st_mode));

        self.kind[fd] = shared ? FILE_OF_OTHERS : FILE_OF_OURS;
    }
    return self.kind[fd];
}

static void touch(int fd)
{
    self.touched = self.touched || kind_of(fd) == FILE_OF_OTHERS;
}

ssize_t write(int fd, const void *octets, size_t size)
{
    touch(fd);
    return NEXT(write)(fd, octets, size);
}

ssize_t send(int fd, const void *octets, size_t size, int flags)
{
    touch(fd);
    return NEXT(send)(fd, octets, size, flags);
}

ssize_t sendto(int fd, const void *octets, size_t size, int flags, const struct sockaddr *to,
               socklen_t to_size)
{
    touch(fd);
    return NEXT(sendto)(fd, octets, size, flags, to, to_size);
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
    int fd = connect_to(path, SOCK_STREAM);

    if (fd < 0 || fd >= FILES_MAX || fcntl(fd, F_SETFL, O_NONBLOCK) < 0) {
        errno = ENOENT; /* it was unplugged */
        return -1;
    }
    self.kind[fd] = FILE_DEVICE;
    return fd;
}

static bool is_of_any_machine(const char *path)
{
    static const char memory[] = "/dev/shm/"; /* where the world is */

    return strcmp(path, "/dev/null") == 0 || strcmp(path, "/dev/urandom") == 0 ||
           strncmp(path, memory, strlen(memory)) == 0;
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
    return kind_of(fd) == FILE_DEVICE;
}

int close(int fd)
{
    touch(fd);
    if (fd >= 0 && fd < FILES_MAX) {
        self.kind[fd] = FILE_UNKNOWN;
    }
    return NEXT(close)(fd);
}

/* A socket's name below the root, where its folder is there. */
static socklen_t name_in_world(const struct sockaddr_un *name, struct sockaddr_un *found)
{
    char folder[sizeof(name->sun_path)], inside[sizeof(name->sun_path)];
    const char *slash = strrchr(name->sun_path, '/');
    struct stat status;

    *found = *name;
    if (name->sun_family == AF_UNIX && slash != NULL && slash != name->sun_path) {
        snprintf(folder, sizeof(folder), "%.*s", (int)(slash - name->sun_path), name->sun_path);
        if (in_world(folder, inside, &status) &&
            strlen(inside) + strlen(slash) < sizeof(found->sun_path)) {
            strcpy(stpcpy(found->sun_path, inside), slash);
        }
    }
    return sizeof(*found);
}

int bind(int fd, const struct sockaddr *name, socklen_t size)
{
    struct sockaddr_un found;

    if (name->sa_family != AF_UNIX || size == sizeof(sa_family_t)) { /* or the kernel chooses one */
        return NEXT(bind)(fd, name, size);
    }
    size = name_in_world((const struct sockaddr_un *)(const void *)name, &found);
    return NEXT(bind)(fd, (struct sockaddr *)&found, size);
}

int connect(int fd, const struct sockaddr *name, socklen_t size)
{
    struct sockaddr_un found;

    touch(fd);
    if (name->sa_family != AF_UNIX) {
        return NEXT(connect)(fd, name, size);
    }
    size = name_in_world((const struct sockaddr_un *)(const void *)name, &found);
    return NEXT(connect)(fd, (struct sockaddr *)&found, size);
}

int unlink(const char *path)
{
    char found[sizeof(((struct sockaddr_un *)0)->sun_path)];
    struct stat status;

    return NEXT(unlink)(in_world(path, found, &status) ? found : path);
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
