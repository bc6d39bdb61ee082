/* Requests and replies over a real datagram socket. */
#include <fcntl.h>
#include <linux/sockios.h>
#include <poll.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/ioctl.h>
#include <sys/wait.h>

#include <cmocka.h>

#include "simulated_time.h"

#include "fake_hostapd.h"
#include "loop_until.h"
#include "radio/hostapd_control.h"

#define NOBODY 65534

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
    return hostapd_control_open(&control, fake.directory, "wlan0");
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

#define EVENTS 100

static bool it_asked(void)
{
    return fake.requests > 0;
}

/* What hostapd has said, and nobody read yet. */
static bool is_unread(void)
{
    int octets = 0;

    assert_int_equal(ioctl(fake.watch.fd, SIOCOUTQ, &octets), 0);
    return octets > 0;
}

static bool all_is_read(void)
{
    return !is_unread();
}

/* Read without a pause, they kept us from sleeping until the kernel ended us, keeper and all. */
static void who_talks_without_end_is_listened_to_in_pauses(void **state)
{
    (void)state;
    fake.hangs = true;
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    assert_true(loop_until(it_asked, 100));
    for (int i = 0; i < EVENTS; i++) {
        fake_reply(&fake, "<3>AP-STA-CONNECTED 02:00:00:00:00:01");
    }
    run_ms(EVENTS / 16 * 5 - 5);
    assert_true(is_unread());
    assert_true(loop_until(all_is_read, 10));
    fake_reply(&fake, "state=ENABLED");
    assert_true(loop_until(it_replied, 10));
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

/* Its user isn't ours; a name in a folder of ours it couldn't answer to. */
static void a_hostapd_without_our_rights_can_answer(void **state)
{
    int ended;
    pid_t answers;

    (void)state;
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    answers = fork();
    if (answers == 0) {
        char request[64];

        fake.client_size = sizeof(fake.client);
        if ((geteuid() == 0 && (setgid(NOBODY) < 0 || setuid(NOBODY) < 0)) ||
            recvfrom(fake.watch.fd, request, sizeof(request), 0, (struct sockaddr *)&fake.client,
                     &fake.client_size) < 0) {
            _exit(1);
        }
        _exit(sendto(fake.watch.fd, "OK", 2, 0, (struct sockaddr *)&fake.client,
                     fake.client_size) == 2
                  ? 0
                  : 2);
    }
    assert_int_equal(waitpid(answers, &ended, 0), answers);
    assert_int_equal(ended, 0);
    assert_true(loop_until(it_replied, 500));
}

static void nobody_else_can_answer(void **state)
{
    struct sockaddr_un ours;
    socklen_t size = sizeof(ours);
    int stranger = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    (void)state;
    assert_int_equal(getsockname(control.watch.fd, (struct sockaddr *)&ours, &size), 0);
    assert_true(size > sizeof(sa_family_t)); /* it has a name */
    assert_int_equal(sendto(stranger, "OK", 2, 0, (struct sockaddr *)&ours, size), -1);
    assert_int_equal(errno, EPERM);
    close(stranger);
}

/* ---- descriptors: to close them may take 20 ms each ---- */

/* One end of a pipe is on its way to us, and nobody else has it; returns the other end. */
static int pass_a_pipe(const char *text)
{
    int ends[2];

    assert_int_equal(pipe2(ends, O_CLOEXEC), 0);
    assert_true(fake_pass(&fake, text, ends[0]));
    close(ends[0]);
    return ends[1];
}

static bool is_closed(int other_end)
{
    struct pollfd poll_end = {.fd = other_end};
    bool closed = poll(&poll_end, 1, 0) > 0 && (poll_end.revents & POLLERR);

    close(other_end);
    return closed;
}

static void ask_and_hear(void)
{
    replies = 0;
    assert_int_equal(hostapd_control_request(&control, "STATUS", loop_now_us()), 0);
    assert_true(loop_until(it_replied, 500));
}

static void descriptors_are_not_taken_and_who_passes_them_is_left_alone(void **state)
{
    int other_end;

    (void)state;
    ask_and_hear();
    other_end = pass_a_pipe("OK\n");
    fake_reply(&fake, "OK\n");
    assert_true(loop_until(it_was_lost, 500));
    assert_int_equal(error, HOSTAPD_PASSED);
    assert_int_equal(lost, 1);
    assert_int_equal(open_control(), HOSTAPD_PASSED);
    fake_hostapd_die(&fake);
    fake_hostapd_run(&fake); /* it can make as many sockets as it likes */
    assert_int_equal(open_control(), HOSTAPD_PASSED);
    assert_false(is_closed(other_end));
}

static void it_is_left_alone_twice_as_long_each_time(void **state)
{
    (void)state;
    for (int alone_s = 60; alone_s <= 240; alone_s *= 2) {
        lost = 0;
        ask_and_hear();
        assert_false(is_closed(pass_a_pipe("OK\n")));
        assert_true(loop_until(it_was_lost, 500));
        run_ms((alone_s - 1) * 1000);
        assert_int_equal(open_control(), HOSTAPD_PASSED);
        run_ms(1000);
        assert_int_equal(open_control(), 0);
    }
}

/* What is behind an answer, which nobody has read yet when the next request fails. */
static void descriptors_that_were_not_seen_yet_are_not_closed_either(void **state)
{
    int other_end;

    (void)state;
    ask_and_hear();
    fake_reply(&fake, "<3>AP-STA-CONNECTED 02:00:00:00:00:01");
    other_end = pass_a_pipe("OK\n");
    fake_hostapd_die(&fake);
    assert_true(hostapd_control_request(&control, "STATUS", loop_now_us()) < 0);
    hostapd_control_close(&control);
    assert_false(is_closed(other_end));
    fake_hostapd_run(&fake);
    assert_int_equal(open_control(), HOSTAPD_PASSED);
}

static void paths_that_are_too_long_are_refused(void **state)
{
    char directory[200];

    (void)state;
    memset(directory, 'x', sizeof(directory));
    directory[sizeof(directory) - 1] = '\0';
    assert_int_equal(hostapd_control_open(&control, directory, "wlan0"), -ENAMETOOLONG);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_request_has_its_reply),
        TEST(one_request_at_a_time),
        TEST(events_are_no_replies),
        TEST(who_talks_without_end_is_listened_to_in_pauses),
        TEST(a_hostapd_that_hangs_is_lost_after_a_second),
        TEST(a_late_reply_is_not_taken_for_the_next_one),
        TEST(a_hostapd_that_is_gone_is_noticed_by_the_next_request),
        TEST(a_hostapd_without_our_rights_can_answer),
        TEST(nobody_else_can_answer),
        TEST(descriptors_are_not_taken_and_who_passes_them_is_left_alone),
        TEST(it_is_left_alone_twice_as_long_each_time),
        TEST(descriptors_that_were_not_seen_yet_are_not_closed_either),
        TEST(paths_that_are_too_long_are_refused),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
