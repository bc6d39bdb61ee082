/* The daemon's heartbeat, into a real pipe. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "simulated_time.h"

#include "base/alive.h"
#include "base/sandbox.h"
#include "loop_until.h"

static int ends[2];

static void name_pipe(int fd)
{
    char number[16];

    snprintf(number, sizeof(number), "%d", fd);
    setenv(ALIVE_VARIABLE, number, 1);
}

static int set_up(void **state)
{
    (void)state;
    signal(SIGPIPE, SIG_IGN); /* as the daemon does */
    assert_int_equal(pipe(ends), 0);
    assert_int_equal(fcntl(ends[0], F_SETFL, O_NONBLOCK), 0);
    name_pipe(ends[1]);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    /* Takes the module's hands off the pipe, and ends its timer: it finds nobody there. */
    close(ends[0]);
    run_ms(1100);
    close(ends[1]);
    unsetenv(ALIVE_VARIABLE);
    alive_open();
    return 0;
}

static ssize_t heard(void)
{
    char bytes[64];
    ssize_t length = read(ends[0], bytes, sizeof(bytes));

    return length < 0 && errno == EAGAIN ? 0 : length;
}

static void start(void)
{
    alive_open();
    alive_start(loop_now_us());
}

static void the_first_byte_comes_at_once_then_one_a_second(void **state)
{
    (void)state;
    start();
    assert_int_equal(heard(), 0); /* out of the loop, not before it */
    run_ms(50);
    assert_int_equal(heard(), 1);
    run_ms(850);
    assert_int_equal(heard(), 0);
    run_ms(200);
    assert_int_equal(heard(), 1);
    run_ms(1000);
    assert_int_equal(heard(), 1);
}

static void the_pipe_is_ours_alone(void **state)
{
    (void)state;
    alive_open();
    assert_int_equal(fcntl(ends[1], F_GETFD) & FD_CLOEXEC, FD_CLOEXEC);
    assert_int_equal(fcntl(ends[1], F_GETFL) & O_NONBLOCK, O_NONBLOCK);
    assert_null(getenv(ALIVE_VARIABLE));
}

/* Written to a blocking pipe, this would never come back. */
static void a_keeper_that_stopped_stops_nobody(void **state)
{
    char page[4096] = {0};

    (void)state;
    alive_open();
    while (write(ends[1], page, sizeof(page)) > 0) {
    }
    while (write(ends[1], page, 1) > 0) {
    }
    alive_start(loop_now_us());
    assert_false(loop_until(NULL, 1100));
    while (heard() > 0) {
    }
    run_ms(1000);
    assert_int_equal(heard(), 1);
}

static void a_keeper_that_is_gone_ends_the_loop(void **state)
{
    int64_t start_us = loop_now_us();

    (void)state;
    close(ends[0]);
    start();
    run_ms(3000); /* ended long before */
    assert_true(in_time(loop_now_us() - start_us, 0, 1000000));
    ends[0] = dup(ends[1]);
}

static void without_a_keeper_there_is_nothing_to_do(void **state)
{
    (void)state;
    unsetenv(ALIVE_VARIABLE);
    start();
    run_ms(50);
    assert_int_equal(heard(), 0);
}

static void what_is_no_pipe_to_write_to_is_left_alone(void **state)
{
    static const char *const wrong[] = {"", "x", "7x", "-1", " 7", "99999999999", "9999"};
    int file = open("/dev/null", O_RDWR | O_CLOEXEC);

    (void)state;
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        setenv(ALIVE_VARIABLE, wrong[i], 1);
        start();
        assert_null(getenv(ALIVE_VARIABLE));
    }
    name_pipe(file);
    start();
    name_pipe(ends[0]); /* the wrong end */
    start();
    run_ms(50);
    assert_int_equal(fcntl(file, F_GETFL) & O_NONBLOCK, 0);
    assert_int_equal(heard(), 0);
    close(file);
}

/* ---- a service manager ---- */

/* The socket that it would have. Abstract: no file is left of it. */
static int be_manager(const char *name)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    size_t length = strlen(name);

    memcpy(address.sun_path + 1, name + 1, length - 1);
    assert_int_equal(bind(fd, (struct sockaddr *)&address,
                          (socklen_t)(offsetof(struct sockaddr_un, sun_path) + length)),
                     0);
    unsetenv(ALIVE_VARIABLE);
    setenv(ALIVE_NOTIFY_VARIABLE, name, 1);
    return fd;
}

static void expect_told(int fd, const char *what)
{
    char text[64] = "";

    assert_int_equal(recv(fd, text, sizeof(text) - 1, 0), strlen(what));
    assert_string_equal(text, what);
    assert_int_equal(recv(fd, text, sizeof(text) - 1, 0), -1);
}

static void a_manager_hears_that_we_are_ready_and_then_that_we_live(void **state)
{
    int fd = be_manager("@odid-test-alive");

    (void)state;
    start();
    assert_null(getenv(ALIVE_NOTIFY_VARIABLE)); /* not the next one's: that has a keeper */
    run_ms(50);
    expect_told(fd, "READY=1\nWATCHDOG=1");
    run_ms(1000);
    expect_told(fd, "WATCHDOG=1");
    close(fd);
    assert_false(loop_until(NULL, 1100)); /* one that is gone ends nobody */
}

static void a_keeper_goes_before_a_manager(void **state)
{
    int fd = be_manager("@odid-test-alive");
    char octet;

    (void)state;
    name_pipe(ends[1]);
    start();
    run_ms(50);
    assert_int_equal(heard(), 1);
    assert_int_equal(recv(fd, &octet, 1, 0), -1);
    close(fd);
    unsetenv(ALIVE_NOTIFY_VARIABLE);
}

static void what_is_no_manager_is_left_alone(void **state)
{
    static const char *const wrong[] = {"", "@", "relative", "/nowhere/notify",
                                        "@odid-test-nobody"};
    char long_name[200];

    (void)state;
    unsetenv(ALIVE_VARIABLE);
    memset(long_name, 'x', sizeof(long_name) - 1);
    long_name[0] = '/';
    long_name[sizeof(long_name) - 1] = '\0';
    for (size_t i = 0; i <= sizeof(wrong) / sizeof(wrong[0]); i++) {
        bool last = i == sizeof(wrong) / sizeof(wrong[0]);

        setenv(ALIVE_NOTIFY_VARIABLE, last ? long_name : wrong[i], 1);
        start();
        assert_null(getenv(ALIVE_NOTIFY_VARIABLE));
    }
}

/* Not _exit: the sanitizer's would ask for more than the filter allows. */
static void leave(int code)
{
    raise(code == 0 ? SIGKILL : SIGABRT);
}

/* User, capabilities and filter do not keep it from speaking. */
static void it_beats_under_the_filter(void **state)
{
    int status;
    pid_t child;

    (void)state;
    if (geteuid() != 0) {
        print_message("skipped: needs root to change the user\n");
        skip();
    }
    child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        alive_open();
        if (sandbox_enter("nobody", false) < 0) {
            leave(1);
        }
        alive_start(loop_now_us());
        run_ms(1200);
        leave(0);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), SIGKILL); /* by itself, and not SIGSYS */
    assert_int_equal(heard(), 2);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(the_first_byte_comes_at_once_then_one_a_second),
        TEST(the_pipe_is_ours_alone),
        TEST(a_keeper_that_stopped_stops_nobody),
        TEST(a_keeper_that_is_gone_ends_the_loop),
        TEST(without_a_keeper_there_is_nothing_to_do),
        TEST(what_is_no_pipe_to_write_to_is_left_alone),
        TEST(it_beats_under_the_filter),
        TEST(a_manager_hears_that_we_are_ready_and_then_that_we_live),
        TEST(a_keeper_goes_before_a_manager),
        TEST(what_is_no_manager_is_left_alone),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
