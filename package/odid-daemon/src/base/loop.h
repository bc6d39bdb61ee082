/*
 * The event loop: descriptors by epoll, deadlines by one timerfd on absolute
 * CLOCK_MONOTONIC. The only place that reads the clock; everyone else is given
 * the time. One thread, no allocation.
 */
#ifndef ODID_LOOP_H
#define ODID_LOOP_H

#include <stdbool.h>
#include <stdint.h>

#define LOOP_NEVER INT64_MAX

typedef void loop_watch_fn(void *context, uint32_t events, int64_t now_us);
typedef void loop_timer_fn(void *context, int64_t now_us);

/* A descriptor being watched. Lives in its owner; stop before closing fd. */
struct loop_watch {
    int fd; /* -1: not watched */
    loop_watch_fn *call;
    void *context;
};

/* A deadline. Lives in its owner. */
struct loop_timer {
    int64_t deadline_us; /* LOOP_NEVER: not armed */
    loop_timer_fn *call;
    void *context;
    struct loop_timer *next; /* loop.c's own */
};

/* Returns 0, or -errno. */
int loop_init(void);

/* events: EPOLLIN, EPOLLOUT, ... Errors and hang-ups are always told. Returns 0, or -errno. */
int loop_watch(struct loop_watch *watch, int fd, uint32_t events, loop_watch_fn *call,
               void *context);
int loop_watch_events(struct loop_watch *watch, uint32_t events);
void loop_unwatch(struct loop_watch *watch);

/*
 * Watches the signals that ask a process to end (TERM, INT, HUP, QUIT) and
 * `another` (0: none), all blocked from here on; the call reads watch->fd,
 * signalfd(2). SIGPIPE is ignored: a logger that ended must not end us, too.
 * Returns 0, or -errno.
 */
int loop_watch_signals(struct loop_watch *watch, int another, loop_watch_fn *call, void *context);

/* Once per timer, before it is armed. */
void loop_timer_init(struct loop_timer *timer, loop_timer_fn *call, void *context);
/* (Re-)arms; a deadline that has passed fires after the calls of this round, or in the next one.
 * The timer is disarmed before its call. */
void loop_arm(struct loop_timer *timer, int64_t deadline_us);

/*
 * Who talks without end isn't listened to for 5 ms each time: a loop that never
 * sleeps would be ended by the kernel (RLIMIT_RTTIME). Errors and hang-ups are
 * told meanwhile. Only of what is watched for EPOLLIN. Lives in its owner.
 */
struct loop_pause {
    struct loop_timer timer;
    struct loop_watch *watch;
};

/* Before the first one; may be called again where the descriptor is watched anew. */
void loop_pause_init(struct loop_pause *pause, struct loop_watch *watch);
void loop_pause_reading(struct loop_pause *pause);

/* Runs until loop_stop. Returns 0, or -errno when the kernel's part failed. */
int loop_run(void);
void loop_stop(void);

/* CLOCK_MONOTONIC, for start-up code outside of calls. */
int64_t loop_now_us(void);

#endif
