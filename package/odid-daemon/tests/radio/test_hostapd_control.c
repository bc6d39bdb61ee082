/* Requests and replies over a real datagram socket. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "simulated_time.h"

#include "fake_hostapd.h"
#include "loop_until.h"
#include "radio/hostapd_control.h"

static struct fake_hostapd fake;
static struct hostapd_control control = {.watch.fd = -1};
static char reply[128];
static unsigned replies, lost;
static int error;

static void on_reply(void *context, const char *text, int64_t now_us)
{
    (void)context;
    (void)now_us;
    replies++;
    snprintf(reply, sizeof(reply), "%s", text);
}

static void on_lost(void *context, int why, int64_t now_us)
{
    (void)context;
    (void)now_us;
    assert_int_equal(control.watch.fd, -1);
    lost++;
    error = why;
}

static int open_control(void)
{
    return hostapd_control_open(&control, fake.directory, "wlan0", fake.directory);
}

static int set_up(void **state)
{
    (void)state;
    replies = lost = 0;
    fake_hostapd_start(&fake);
    hostapd_control_init(&control, on_reply, on_lost, NULL);
    assert_int_equal(open_control(), 0);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    hostapd_control_close(&control);
    return fake_hostapd_end(&fake) ? 0 : -1;
}

static bool it_replied(void)
{
    return replies > 0;
}

static bool it_was_lost(void)
{
    return lost > 0;
}

static void a_request_has_its_reply(void **state)
{
    (void)state;
    assert_int_equal(hostapd_control_request(&control, "UPDATE_BEACON", loop_now_us()), 0);
    assert_true(loop_until(it_replied, 500));
    assert_string_equal(reply, "OK"); /* the newline is gone */
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    run_ms(10);
    assert_string_equal(reply, "state=ENABLED\nphy=phy0\nfreq=2437");
}

static void one_request_at_a_time(void **state)
{
    (void)state;
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), -EBUSY);
    run_ms(10);
    assert_int_equal(replies, 1);
    assert_int_equal(fake.requests, 1);
}

static void events_are_no_replies(void **state)
{
    (void)state;
    fake.talks = true;
    assert_int_equal(hostapd_control_request(&control, "UPDATE_BEACON", loop_now_us()), 0);
    assert_true(loop_until(it_replied, 500));
    run_ms(5);
    assert_string_equal(reply, "OK");
    assert_int_equal(replies, 1);
}

static void a_hostapd_that_hangs_is_lost_after_a_second(void **state)
{
    int64_t start_us = loop_now_us();

    (void)state;
    fake.hangs = true;
    assert_int_equal(hostapd_control_request(&control, "STATUS", start_us), 0);
    assert_true(loop_until(it_was_lost, 1500));
    assert_int_equal(error, -ETIMEDOUT);
    assert_true(in_time(loop_now_us() - start_us, 990000, 1200000));
}

/* With one name for all sockets the first reply is taken for the second request's. */
static void a_late_reply_is_not_taken_for_the_next_one(void **state)
{
    (void)state;
    fake.hangs = true;
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    assert_true(loop_until(it_was_lost, 1500));
    assert_int_equal(open_control(), 0);
    assert_int_equal(hostapd_control_request(&control, "UPDATE_BEACON", loop_now_us()), 0);
    fake_reply(&fake, "state=ENABLED\n"); /* to the socket that asked then */
    fake.hangs = false;
    assert_true(loop_until(it_replied, 500));
    assert_string_equal(reply, "OK");
}

static void a_hostapd_that_is_gone_is_noticed_by_the_next_request(void **state)
{
    (void)state;
    fake_hostapd_die(&fake);
    assert_true(hostapd_control_request(&control, "STATUS", loop_now_us()) < 0);
    assert_int_equal(open_control(), -ENOENT);
    fake_hostapd_run(&fake);
    assert_int_equal(open_control(), 0);
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    assert_true(loop_until(it_replied, 500));
}

static void what_a_killed_daemon_left_behind_is_in_nobodys_way(void **state)
{
    char path[64];

    (void)state;
    hostapd_control_close(&control);
    for (int i = 0; i < 16; i++) {
        snprintf(path, sizeof(path), "%s/hostapd-%d", fake.directory, i);
        close(open(path, O_CREAT | O_WRONLY, 0600));
    }
    for (int i = 0; i < 16; i++) {
        assert_int_equal(open_control(), 0);
    }
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    assert_true(loop_until(it_replied, 500));
}

static void paths_that_are_too_long_are_refused(void **state)
{
    char directory[200];

    (void)state;
    memset(directory, 'x', sizeof(directory));
    directory[sizeof(directory) - 1] = '\0';
    assert_int_equal(hostapd_control_open(&control, directory, "wlan0", fake.directory),
                     -ENAMETOOLONG);
    assert_int_equal(hostapd_control_open(&control, fake.directory, "wlan0", directory),
                     -ENAMETOOLONG);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_request_has_its_reply),
        TEST(one_request_at_a_time),
        TEST(events_are_no_replies),
        TEST(a_hostapd_that_hangs_is_lost_after_a_second),
        TEST(a_late_reply_is_not_taken_for_the_next_one),
        TEST(a_hostapd_that_is_gone_is_noticed_by_the_next_request),
        TEST(what_a_killed_daemon_left_behind_is_in_nobodys_way),
        TEST(paths_that_are_too_long_are_refused),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
