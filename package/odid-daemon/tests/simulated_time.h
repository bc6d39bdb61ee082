/*
 * Time of the test's own: this program's clock_gettime, timerfd_settime and
 * epoll_wait, which the linker takes before libc's. Nothing waits. When nothing
 * is ready, it is the next timer's time, at once: a second costs as much as what
 * happens in it, and no machine is late.
 *
 * For tests whose other sides live in the same loop and talk through sockets or
 * pipes, which are ready at once. A pty's octets are carried by the kernel when
 * it likes, another process' come when that runs: those keep the machine's time.
 */
#ifndef ODID_TESTS_SIMULATED_TIME_H
#define ODID_TESTS_SIMULATED_TIME_H

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/epoll.h>
#include <sys/syscall.h>
#include <sys/timerfd.h>
#include <time.h>
#include <unistd.h>

#define TIME_IS_SIMULATED true

static struct {
    int64_t now_us;
    int64_t alarm_us; /* what the loop's timer is set to; 0: to nothing */
    int timer;
} simulated = {.now_us = INT64_C(1000000000)};

int clock_gettime(clockid_t clock, struct timespec *time)
{
    if (clock != CLOCK_MONOTONIC) {
        return (int)syscall(SYS_clock_gettime, clock, time);
    }
    time->tv_sec = simulated.now_us / 1000000;
    time->tv_nsec = simulated.now_us % 1000000 * 1000;
    return 0;
}

static void set_real_timer(int timer, int64_t at_ns)
{
    const struct itimerspec when = {.it_value.tv_nsec = at_ns};

    if (syscall(SYS_timerfd_settime, timer, TFD_TIMER_ABSTIME, &when, NULL) < 0) {
        perror("simulated time: timerfd_settime");
        abort();
    }
}

int timerfd_settime(int timer, int flags, const struct itimerspec *when, struct itimerspec *before)
{
    (void)flags;
    (void)before;
    simulated.timer = timer;
    simulated.alarm_us = when->it_value.tv_sec * INT64_C(1000000) + when->it_value.tv_nsec / 1000;
    set_real_timer(timer, 0);
    return 0;
}

int epoll_wait(int epoll, struct epoll_event *events, int size, int timeout_ms)
{
    int count = (int)syscall(SYS_epoll_pwait, epoll, events, size, 0, NULL, 8);

    if (count != 0 || timeout_ms == 0) {
        return count;
    }
    if (simulated.alarm_us == 0) {
        fprintf(stderr, "simulated time: nothing is ready, and no timer will ever be\n");
        abort();
    }
    if (simulated.now_us < simulated.alarm_us) {
        simulated.now_us = simulated.alarm_us;
    }
    set_real_timer(simulated.timer, 1); /* long past: it is readable now */
    return (int)syscall(SYS_epoll_pwait, epoll, events, size, 0, NULL, 8);
}

#endif
