/* Log lines, read back from the pipe that a logger would read. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/log.h"

static int end, kept_stderr;

static int set_up(void **state)
{
    int pipe_ends[2];

    (void)state;
    assert_int_equal(pipe2(pipe_ends, O_CLOEXEC), 0);
    kept_stderr = dup(STDERR_FILENO);
    dup2(pipe_ends[1], STDERR_FILENO);
    close(pipe_ends[1]);
    end = pipe_ends[0];
    fcntl(end, F_SETFL, O_NONBLOCK);
    log_set_debug(false);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    dup2(kept_stderr, STDERR_FILENO);
    close(kept_stderr);
    close(end);
    return 0;
}

static const char *logged(void)
{
    static char text[2048];
    ssize_t length = read(end, text, sizeof(text) - 1);

    text[length > 0 ? length : 0] = '\0';
    return text;
}

static void each_level_has_its_word(void **state)
{
    (void)state;
    log_error("no %s", "radio");
    log_warning("w");
    log_info("%d", 5);
    assert_string_equal(logged(), "error: no radio\nwarning: w\ninfo: 5\n");
}

static void debug_is_silent_until_asked_for(void **state)
{
    (void)state;
    log_debug("a");
    assert_string_equal(logged(), "");
    log_set_debug(true);
    log_debug("b");
    assert_string_equal(logged(), "debug: b\n");
}

static void control_characters_from_outside_are_shown_harmless(void **state)
{
    (void)state;
    log_info("%s", "a\nerror: b\x1b[2J\x7f"
                   "Göteborg");
    assert_string_equal(logged(), "info: a?error: b?[2J?Göteborg\n");
}

static void a_line_has_at_most_512_bytes(void **state)
{
    char text[1000];

    (void)state;
    memset(text, 'x', sizeof(text));
    text[sizeof(text) - 1] = '\0';
    log_info("%s", text);
    assert_int_equal(strlen(logged()), 511);
    log_info("next");
    assert_string_equal(logged(), "info: next\n");
}

/* Without the look at the pipe's room this test never ends. */
static void a_logger_that_hangs_stops_nobody(void **state)
{
    (void)state;
    for (int i = 0; i < 10000; i++) {
        log_info("line %d", i);
    }
    while (logged()[0] != '\0') {
    }
    log_info("it reads again");
    assert_string_equal(logged(), "info: it reads again\n");
}

/* As a service manager's journal that stopped: a stream socket, unread. */
static void a_socket_that_nobody_reads_stops_nobody(void **state)
{
    int ends[2];

    (void)state;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
    dup2(ends[1], STDERR_FILENO);
    for (int i = 0; i < 10000; i++) {
        log_info("line %d", i);
    }
    close(ends[0]);
    close(ends[1]);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(each_level_has_its_word),
        TEST(debug_is_silent_until_asked_for),
        TEST(control_characters_from_outside_are_shown_harmless),
        TEST(a_line_has_at_most_512_bytes),
        TEST(a_logger_that_hangs_stops_nobody),
        TEST(a_socket_that_nobody_reads_stops_nobody),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
