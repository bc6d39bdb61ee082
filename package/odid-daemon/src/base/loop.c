#include "base/loop.h"

#include <errno.h>
#include <signal.h>
#include <stddef.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define EVENTS_MAX 16
#define PAUSE_US 5000

static struct {
    int epoll, timer;
    struct loop_timer *timers;            /* every one that was ever initialised; few */
    int64_t armed_us;                     /* what the timerfd is set to */
    int64_t round_us;                     /* deadlines up to here fire in this round */
    struct epoll_event ready[EVENTS_MAX]; /* this round's events, until they are handed out */
    int ready_count;
    bool stopped;
} self = {.epoll = -1, .timer = -1};

int64_t loop_now_us(void)
{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

int loop_init(void)
{
    struct epoll_event event = {.events = EPOLLIN};

    self.epoll = epoll_create1(EPOLL_CLOEXEC);
    if (self.epoll < 0) {
        return -errno;
    }
    self.timer = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    if (self.timer < 0 || epoll_ctl(self.epoll, EPOLL_CTL_ADD, self.timer, &event) < 0) {
        return -errno;
    }
    self.armed_us = LOOP_NEVER;
    return 0;
}

int loop_watch(struct loop_watch *watch, int fd, uint32_t events, loop_watch_fn *call,
               void *context)
{
    struct epoll_event event = {.events = events, .data.ptr = watch};

    watch->fd = fd;
    watch->call = call;
    watch->context = context;
    if (epoll_ctl(self.epoll, EPOLL_CTL_ADD, fd, &event) < 0) {
        watch->fd = -1;
        return -errno;
    }
    return 0;
}

int loop_watch_events(struct loop_watch *watch, uint32_t events)
{
    struct epoll_event event = {.events = events, .data.ptr = watch};

    return epoll_ctl(self.epoll, EPOLL_CTL_MOD, watch->fd, &event) < 0 ? -errno : 0;
}

void loop_unwatch(struct loop_watch *watch)
{
    if (watch->fd < 0) {
        return;
    }
    epoll_ctl(self.epoll, EPOLL_CTL_DEL, watch->fd, NULL);
    watch->fd = -1;
    /* What is still to be told about the old descriptor must not reach the next one. */
    for (int i = 0; i < self.ready_count; i++) {
        if (self.ready[i].data.ptr == watch) {
            self.ready[i].data.ptr = NULL;
        }
    }
}

int loop_watch_signals(struct loop_watch *watch, int another, loop_watch_fn *call, void *context)
{
    sigset_t set;
    int fd;

    sigemptyset(&set);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGHUP); /* the terminal was closed */
    sigaddset(&set, SIGQUIT);
    if (another != 0) {
        sigaddset(&set, another);
    }
    if (sigprocmask(SIG_BLOCK, &set, NULL) < 0) {
        return -errno;
    }
    signal(SIGPIPE, SIG_IGN);
    fd = signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
    return fd < 0 ? -errno : loop_watch(watch, fd, EPOLLIN, call, context);
}

void loop_timer_init(struct loop_timer *timer, loop_timer_fn *call, void *context)
{
    struct loop_timer *known = self.timers;

    while (known != NULL && known != timer) {
        known = known->next;
    }
    timer->deadline_us = LOOP_NEVER;
    timer->call = call;
    timer->context = context;
    if (known == NULL) {
        timer->next = self.timers;
        self.timers = timer;
    }
}

void loop_arm(struct loop_timer *timer, int64_t deadline_us)
{
    /* One that is always late gets its turn once a round, and the descriptors theirs. */
    timer->deadline_us = deadline_us > self.round_us ? deadline_us : self.round_us + 1;
}

static void after_pause(void *context, int64_t now_us)
{
    struct loop_watch *watch = context;

    (void)now_us;
    if (watch->fd >= 0) {
        loop_watch_events(watch, EPOLLIN);
    }
}

void loop_pause_init(struct loop_pause *pause, struct loop_watch *watch)
{
    pause->watch = watch;
    loop_timer_init(&pause->timer, after_pause, watch);
}

/* From now on, however long the work before it has taken. */
void loop_pause_reading(struct loop_pause *pause)
{
    loop_watch_events(pause->watch, 0);
    loop_arm(&pause->timer, loop_now_us() + PAUSE_US);
}

static struct loop_timer *earliest(void)
{
    struct loop_timer *first = NULL;

    for (struct loop_timer *timer = self.timers; timer != NULL; timer = timer->next) {
        if (timer->deadline_us != LOOP_NEVER &&
            (first == NULL || timer->deadline_us < first->deadline_us)) {
            first = timer;
        }
    }
    return first;
}

static void set_timerfd(void)
{
    const struct loop_timer *first = earliest();
    int64_t deadline_us = first == NULL ? LOOP_NEVER : first->deadline_us;
    struct itimerspec when = {0};

    if (deadline_us == self.armed_us) {
        return;
    }
    self.armed_us = deadline_us;
    if (first != NULL) {
        if (deadline_us < 1) {
            deadline_us = 1; /* zero would disarm it */
        }
        when.it_value.tv_sec = deadline_us / 1000000;
        when.it_value.tv_nsec = deadline_us % 1000000 * 1000;
    }
    timerfd_settime(self.timer, TFD_TIMER_ABSTIME, &when, NULL);
}

static void run_timers(void)
{
    struct loop_timer *due = earliest();

    self.round_us = loop_now_us();
    while (due != NULL && due->deadline_us <= self.round_us && !self.stopped) {
        due->deadline_us = LOOP_NEVER;
        due->call(due->context, loop_now_us());
        due = earliest();
    }
}

static void hand_out(void)
{
    for (int i = 0; i < self.ready_count && !self.stopped; i++) {
        struct loop_watch *watch = self.ready[i].data.ptr;

        if (watch != NULL) { /* else the timer's, or unwatched by an earlier call */
            watch->call(watch->context, self.ready[i].events, loop_now_us());
        }
    }
    self.ready_count = 0;
}

int loop_run(void)
{
    uint64_t expirations;
    int count;

    self.stopped = false;
    while (!self.stopped) {
        set_timerfd();
        count = epoll_wait(self.epoll, self.ready, EVENTS_MAX, -1);
        if (count < 0 && errno != EINTR) {
            return -errno;
        }
        if (read(self.timer, &expirations, sizeof(expirations)) > 0) {
            self.armed_us = LOOP_NEVER;
        }
        self.ready_count = count > 0 ? count : 0;
        /* After a late wake-up there is both: what has come goes into what is due, and an answer
         * ends its own deadline. Each descriptor's call reads a bounded share. */
        hand_out();
        run_timers();
    }
    return 0;
}

void loop_stop(void)
{
    self.stopped = true;
}
