/* The event loop: who is called, in which order, and who must not be. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "simulated_time.h"

#include "base/loop.h"
#include "loop_until.h"

static struct loop_timer timers[3];
static struct loop_watch watches[2];
static int pairs[3][2];
static char calls[64];

static void note(char letter)
{
    size_t length = strlen(calls);

    if (length + 1 < sizeof(calls)) {
        calls[length] = letter;
        calls[length + 1] = '\0';
    }
}

static void on_timer(void *context, int64_t now_us)
{
    (void)now_us;
    note(*(const char *)context);
}

static int set_up(void **state)
{
    (void)state;
    calls[0] = '\0';
    for (int i = 0; i < 3; i++) {
        assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, pairs[i]), 0);
    }
    watches[0].fd = watches[1].fd = -1;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        loop_unwatch(&watches[i]);
    }
    for (int i = 0; i < 3; i++) {
        loop_arm(&timers[i], LOOP_NEVER);
        close(pairs[i][0]);
        close(pairs[i][1]);
    }
    return 0;
}

static void timers_fire_in_the_order_of_their_deadlines(void **state)
{
    static char a = 'a', b = 'b', c = 'c';
    int64_t now_us = loop_now_us();

    (void)state;
    loop_timer_init(&timers[0], on_timer, &a);
    loop_timer_init(&timers[1], on_timer, &b);
    loop_timer_init(&timers[2], on_timer, &c);
    loop_arm(&timers[0], now_us + 9000);
    loop_arm(&timers[1], now_us - 1);
    loop_arm(&timers[2], now_us + 4000);
    run_ms(20);
    assert_string_equal(calls, "bca");
}

static void a_timer_armed_again_has_only_its_new_deadline(void **state)
{
    static char a = 'a';

    (void)state;
    loop_timer_init(&timers[0], on_timer, &a);
    loop_arm(&timers[0], loop_now_us() + 5000);
    loop_arm(&timers[0], loop_now_us() + 30000);
    run_ms(15);
    assert_string_equal(calls, "");
    run_ms(30);
    assert_string_equal(calls, "a");
    loop_arm(&timers[0], loop_now_us() + 5000);
    loop_arm(&timers[0], LOOP_NEVER);
    run_ms(15);
    assert_string_equal(calls, "a");
}

static void on_always_late(void *context, int64_t now_us)
{
    (void)context;
    note('t');
    if (strlen(calls) < 20) {
        loop_arm(&timers[0], now_us - 1000);
    } else {
        loop_stop();
    }
}

static void on_readable(void *context, uint32_t events, int64_t now_us)
{
    char byte;

    (void)events;
    (void)now_us;
    note(*(const char *)context);
    assert_int_equal(read(watches[0].fd, &byte, 1), 1);
}

/* With the round's end left out of loop_arm, the descriptor is never served: "tttt...". */
static void a_timer_that_is_always_late_leaves_the_descriptors_their_turn(void **state)
{
    static char d = 'd';

    (void)state;
    loop_timer_init(&timers[0], on_always_late, NULL);
    loop_arm(&timers[0], 0);
    assert_int_equal(loop_watch(&watches[0], pairs[0][0], EPOLLIN, on_readable, &d), 0);
    assert_int_equal(write(pairs[0][1], "x", 1), 1);
    assert_int_equal(loop_run(), 0);
    assert_non_null(strchr(calls, 'd'));
    assert_true(strchr(calls, 'd') < calls + 4);
}

/* After a late wake-up both are there: what is due goes out with what has come. */
static void what_has_come_is_read_before_what_is_due(void **state)
{
    static char d = 'd', t = 't';

    (void)state;
    loop_timer_init(&timers[0], on_timer, &t);
    loop_arm(&timers[0], loop_now_us() - 1);
    assert_int_equal(loop_watch(&watches[0], pairs[0][0], EPOLLIN, on_readable, &d), 0);
    assert_int_equal(write(pairs[0][1], "x", 1), 1);
    run_ms(10);
    assert_string_equal(calls, "dt");
}

static void on_first_of_two(void *context, uint32_t events, int64_t now_us)
{
    (void)context;
    (void)events;
    (void)now_us;
    note('1');
    loop_unwatch(&watches[0]);
    loop_unwatch(&watches[1]);
    loop_stop();
}

/* Both are ready in one round; the one that is called first ends the other. */
static void a_watch_that_was_ended_in_this_round_is_not_called(void **state)
{
    (void)state;
    assert_int_equal(write(pairs[0][1], "x", 1), 1);
    assert_int_equal(write(pairs[1][1], "x", 1), 1);
    loop_watch(&watches[0], pairs[0][0], EPOLLIN, on_first_of_two, NULL);
    loop_watch(&watches[1], pairs[1][0], EPOLLIN, on_first_of_two, NULL);
    assert_int_equal(loop_run(), 0);
    assert_string_equal(calls, "1");
}

static void on_new_descriptor(void *context, uint32_t events, int64_t now_us)
{
    (void)context;
    (void)events;
    (void)now_us;
    note('!');
}

static void on_first_moves_second(void *context, uint32_t events, int64_t now_us)
{
    int other = *(const int *)context;

    (void)events;
    (void)now_us;
    note('1');
    loop_unwatch(&watches[0]);
    loop_unwatch(&watches[1]);
    /* The one that wasn't called watches something else now, where nothing has happened. */
    loop_watch(&watches[other], pairs[2][0], EPOLLIN, on_new_descriptor, NULL);
}

static void what_was_ready_before_is_not_told_of_the_next_descriptor(void **state)
{
    static const int second = 1, first = 0;

    (void)state;
    assert_int_equal(write(pairs[0][1], "x", 1), 1);
    assert_int_equal(write(pairs[1][1], "x", 1), 1);
    loop_watch(&watches[0], pairs[0][0], EPOLLIN, on_first_moves_second, (void *)&second);
    loop_watch(&watches[1], pairs[1][0], EPOLLIN, on_first_moves_second, (void *)&first);
    run_ms(10);
    assert_string_equal(calls, "1");
}

static void on_hang_up(void *context, uint32_t events, int64_t now_us)
{
    (void)context;
    (void)now_us;
    assert_true(events & EPOLLHUP);
    note('h');
    loop_unwatch(&watches[0]);
}

static void a_hang_up_is_told_unasked(void **state)
{
    (void)state;
    loop_watch(&watches[0], pairs[0][0], 0, on_hang_up, NULL);
    close(pairs[0][1]);
    pairs[0][1] = dup(pairs[0][0]);
    run_ms(10);
    assert_string_equal(calls, "h");
}

static struct loop_pause flood_pause;
static int64_t flood_read_us;

static void on_flood(void *context, uint32_t events, int64_t now_us)
{
    (void)context;
    (void)events;
    assert_true(calls[0] == '\0' || now_us - flood_read_us >= 5000);
    note('f');
    simulated.now_us += 6000; /* what a portion costs on a slow processor */
    flood_read_us = loop_now_us();
    loop_pause_reading(&flood_pause);
}

/* It was counted from the portion's beginning: one that took longer left no pause at all, and
 * RLIMIT_RTTIME would have ended the daemon. */
static void who_talks_without_end_leaves_a_pause_after_each_portion(void **state)
{
    (void)state;
    assert_int_equal(write(pairs[0][1], "x", 1), 1);
    loop_pause_init(&flood_pause, &watches[0]);
    loop_watch(&watches[0], pairs[0][0], EPOLLIN, on_flood, NULL);
    run_ms(100);
    assert_true(strlen(calls) >= 8);
    loop_arm(&flood_pause.timer, LOOP_NEVER);
}

static void a_descriptor_that_cannot_be_watched_is_refused(void **state)
{
    (void)state;
    assert_int_equal(loop_watch(&watches[0], 9999, EPOLLIN, on_readable, NULL), -9 /* EBADF */);
    assert_int_equal(watches[0].fd, -1);
    loop_unwatch(&watches[0]); /* once more does no harm */
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(timers_fire_in_the_order_of_their_deadlines),
        TEST(a_timer_armed_again_has_only_its_new_deadline),
        TEST(a_timer_that_is_always_late_leaves_the_descriptors_their_turn),
        TEST(what_has_come_is_read_before_what_is_due),
        TEST(a_watch_that_was_ended_in_this_round_is_not_called),
        TEST(what_was_ready_before_is_not_told_of_the_next_descriptor),
        TEST(a_hang_up_is_told_unasked),
        TEST(who_talks_without_end_leaves_a_pause_after_each_portion),
        TEST(a_descriptor_that_cannot_be_watched_is_refused),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
