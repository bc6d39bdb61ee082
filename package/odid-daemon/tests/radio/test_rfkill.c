/* Blocked radios: a socket plays /dev/rfkill, whose events are one read or write each. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <linux/rfkill.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>

#include "simulated_time.h"

#include "loop_until.h"
#include "radio/rfkill.h"

#define DEVICE "/dev/rfkill"

static bool there = true; /* is there such a device? */
static int kernel = -1;   /* its other end, where it was opened */

/* This program's own, before libc's: the daemon's end of the device. */
int open(const char *path, int flags, ...)
{
    int ends[2];

    if (strcmp(path, DEVICE) != 0) { /* the sanitizers' */
        return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0);
    }
    if (!there) {
        errno = ENOENT;
        return -1;
    }
    if ((flags & O_NONBLOCK) == 0 ||
        socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends) < 0) {
        return -1;
    }
    kernel = ends[0];
    return ends[1];
}

static void say(uint32_t index, uint8_t type, uint8_t op, uint8_t soft, uint8_t hard)
{
    struct rfkill_event event = {.idx = index, .type = type, .op = op, .soft = soft, .hard = hard};

    assert_int_equal(write(kernel, &event, sizeof(event)), sizeof(event));
}

/* How many unblocks of this index were written; anything else that is written fails. */
static unsigned unblocks(uint32_t index)
{
    struct rfkill_event event;
    unsigned count = 0;

    while (read(kernel, &event, sizeof(event)) == sizeof(event)) {
        assert_int_equal(event.op, RFKILL_OP_CHANGE);
        assert_int_equal(event.soft, 0);
        assert_int_equal(event.idx, index);
        count++;
    }
    return count;
}

static bool something_was_written(void)
{
    struct pollfd ready = {.fd = kernel, .events = POLLIN};

    return poll(&ready, 1, 0) == 1;
}

static void expect_unblock(uint32_t index)
{
    assert_true(loop_until(something_was_written, 1000));
    assert_int_equal(unblocks(index), 1);
}

static void expect_nothing_written(void)
{
    run_ms(30);
    assert_int_equal(unblocks(0), 0);
}

static bool blocked(enum rfkill_radio radio)
{
    bool hard;

    return rfkill_blocked(radio, &hard);
}

static bool wlan_is_blocked(void)
{
    return blocked(RFKILL_WLAN);
}

static bool bluetooth_is_blocked(void)
{
    return blocked(RFKILL_BLUETOOTH);
}

static bool nothing_is_blocked(void)
{
    return !blocked(RFKILL_WLAN) && !blocked(RFKILL_BLUETOOTH);
}

static void a_soft_block_is_undone_at_once(void **state)
{
    (void)state;
    say(3, RFKILL_TYPE_BLUETOOTH, RFKILL_OP_ADD, 0, 0);
    expect_nothing_written();
    say(3, RFKILL_TYPE_BLUETOOTH, RFKILL_OP_CHANGE, 1, 0);
    assert_true(loop_until(bluetooth_is_blocked, 1000));
    assert_false(blocked(RFKILL_WLAN));
    expect_unblock(3);
    say(3, RFKILL_TYPE_BLUETOOTH, RFKILL_OP_CHANGE, 0, 0);
    assert_true(loop_until(nothing_is_blocked, 1000));
    say(3, RFKILL_TYPE_BLUETOOTH, RFKILL_OP_DEL, 0, 0);
}

static void one_blocked_from_the_start_is_unblocked(void **state)
{
    (void)state;
    say(4, RFKILL_TYPE_WLAN, RFKILL_OP_ADD, 1, 0);
    expect_unblock(4);
    assert_true(blocked(RFKILL_WLAN));
    say(4, RFKILL_TYPE_WLAN, RFKILL_OP_DEL, 0, 0);
    assert_true(loop_until(nothing_is_blocked, 1000));
}

static void a_fight_is_limited_to_four_times_a_second(void **state)
{
    (void)state;
    say(5, RFKILL_TYPE_WLAN, RFKILL_OP_ADD, 0, 0);
    for (int i = 0; i < 50; i++) {
        say(5, RFKILL_TYPE_WLAN, RFKILL_OP_CHANGE, 1, 0);
        run_ms(5);
        say(5, RFKILL_TYPE_WLAN, RFKILL_OP_CHANGE, i == 49, 0);
        run_ms(5);
    }
    assert_in_range(unblocks(5), 2, 4);
    expect_unblock(5); /* the last block wasn't forgotten */
    say(5, RFKILL_TYPE_WLAN, RFKILL_OP_DEL, 0, 0);
    assert_true(loop_until(nothing_is_blocked, 1000));
}

/* A driver that refused: the kernel takes the order, and sends no event. */
static void a_block_that_stays_is_undone_again(void **state)
{
    (void)state;
    say(6, RFKILL_TYPE_WLAN, RFKILL_OP_ADD, 1, 0);
    expect_unblock(6);
    expect_unblock(6);
    expect_unblock(6);
    say(6, RFKILL_TYPE_WLAN, RFKILL_OP_CHANGE, 0, 0);
    assert_true(loop_until(nothing_is_blocked, 1000));
    run_ms(300);
    assert_int_equal(unblocks(6), 0);
    say(6, RFKILL_TYPE_WLAN, RFKILL_OP_DEL, 0, 0);
}

static void a_switch_cannot_be_undone(void **state)
{
    bool hard = false;

    (void)state;
    say(6, RFKILL_TYPE_WLAN, RFKILL_OP_ADD, 0, 1);
    assert_true(loop_until(wlan_is_blocked, 1000));
    assert_true(rfkill_blocked(RFKILL_WLAN, &hard));
    assert_true(hard);
    expect_nothing_written();
    say(6, RFKILL_TYPE_WLAN, RFKILL_OP_DEL, 0, 0);
    assert_true(loop_until(nothing_is_blocked, 1000));
}

static void radios_that_are_not_ours_are_left_alone(void **state)
{
    (void)state;
    for (uint32_t i = 100; i < 140; i++) {
        say(i, RFKILL_TYPE_WWAN, RFKILL_OP_ADD, 1, 0);
    }
    expect_nothing_written();
    assert_true(nothing_is_blocked());
}

/* The kernel counts up with each plugging in. */
static void a_dongle_may_be_plugged_in_ever_again(void **state)
{
    (void)state;
    for (uint32_t i = 10; i < 60; i++) {
        say(i, RFKILL_TYPE_BLUETOOTH, RFKILL_OP_ADD, 1, 0);
        expect_unblock(i);
        say(i, RFKILL_TYPE_BLUETOOTH, RFKILL_OP_DEL, 0, 0);
    }
    assert_true(loop_until(nothing_is_blocked, 1000));
}

static void without_the_device_nothing_is_blocked(void **state)
{
    (void)state;
    say(7, RFKILL_TYPE_WLAN, RFKILL_OP_ADD, 0, 1);
    assert_true(loop_until(wlan_is_blocked, 1000));
    there = false;
    close(kernel);
    kernel = -1;
    assert_true(loop_until(nothing_is_blocked, 1000));
}

static bool it_was_opened(void)
{
    return kernel >= 0;
}

/* A kernel module that was unloaded: what is there is told anew. */
static void a_device_that_comes_back_is_opened_again(void **state)
{
    (void)state;
    run_ms(12000);
    there = true;
    assert_true(loop_until(it_was_opened, 5000));
    say(8, RFKILL_TYPE_WLAN, RFKILL_OP_ADD, 1, 0);
    expect_unblock(8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_soft_block_is_undone_at_once),
        cmocka_unit_test(one_blocked_from_the_start_is_unblocked),
        cmocka_unit_test(a_fight_is_limited_to_four_times_a_second),
        cmocka_unit_test(a_block_that_stays_is_undone_again),
        cmocka_unit_test(a_switch_cannot_be_undone),
        cmocka_unit_test(radios_that_are_not_ours_are_left_alone),
        cmocka_unit_test(a_dongle_may_be_plugged_in_ever_again),
        cmocka_unit_test(without_the_device_nothing_is_blocked),
        cmocka_unit_test(a_device_that_comes_back_is_opened_again),
    };

    if (loop_init() < 0) {
        return 1;
    }
    rfkill_start_at(DEVICE, loop_now_us());
    return cmocka_run_group_tests(tests, NULL, NULL);
}
