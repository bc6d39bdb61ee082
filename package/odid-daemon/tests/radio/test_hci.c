/* A controller's command channel over H4, on a real pty with the real event loop. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <unistd.h>

#include "loop_until.h"
#include "pty.h"
#include "radio/hci.h"

static struct hci hci = {.watch.fd = -1};
static char path[64], adapter[80];
static int master;

static struct {
    unsigned events, lost;
    int error;
    uint8_t code, parameters[255];
    size_t length;
} got;

static void on_event(void *context, uint8_t code, const uint8_t *parameters, size_t length,
                     int64_t now_us)
{
    (void)context;
    (void)now_us;
    got.events++;
    got.code = code;
    got.length = length;
    memcpy(got.parameters, parameters, length);
}

static void on_lost(void *context, int error, int64_t now_us)
{
    (void)now_us;
    assert_false(hci_is_open(context));
    got.lost++;
    got.error = error;
}

static int set_up(void **state)
{
    (void)state;
    memset(&got, 0, sizeof(got));
    pty_make_path(path, "bt");
    snprintf(adapter, sizeof(adapter), "h4:%s", path);
    master = pty_open(path);
    assert_true(master >= 0);
    assert_int_equal(hci_open(&hci, adapter, on_event, on_lost, &hci), 0);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    hci_close(&hci);
    close(master);
    pty_remove_path(path);
    return 0;
}

static void say(const char *bytes, size_t length)
{
    assert_int_equal(write(master, bytes, length), length);
}

static bool an_event_came(void)
{
    return got.events > 0;
}

static bool two_events_came(void)
{
    return got.events >= 2;
}

static bool it_was_lost(void)
{
    return got.lost > 0;
}

static void names_are_told_apart(void **state)
{
    static const char *const good[] = {"hci0", "hci15", "h4:/dev/ttyUSB0", "h4:/dev/ttyS1@921600",
                                       "h4:/dev/pts/3@115200"};
    static const char *const bad[] = {
        "",
        "hci",
        "hci-1",
        "hci0x",
        "hci0 ",
        "hci 0",
        "hci00",
        "ttyUSB0",
        "/dev/ttyS0",
        "h4:",
        "h4:ttyS0",
        "h4:/dev/ttyS0@",
        "h4:/d@x",
        "h4:/d@1200x",
        "h4:/d@-1200",
        "h4:/d@115201",
        "h4:/d@99999999999999999999",
        "h5:/dev/x",
        "HCI0",
        "h4:/d@ 115200",
    };
    char long_name[200] = "h4:/dev/";

    (void)state;
    for (size_t i = 0; i < sizeof(good) / sizeof(good[0]); i++) {
        assert_true(hci_name_valid(good[i]));
    }
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        assert_false(hci_name_valid(bad[i]));
    }
    memset(long_name + strlen(long_name), 'x', 150);
    assert_false(hci_name_valid(long_name));
}

static void a_device_that_cannot_be_opened_says_why(void **state)
{
    struct hci other = {.watch.fd = -1};

    (void)state;
    assert_int_equal(hci_open(&other, "h4:/tmp/odid-no-such", on_event, on_lost, &other), -ENOENT);
    assert_int_equal(hci_open(&other, "h4:/dev/null", on_event, on_lost, &other), -ENOTTY);
    assert_int_equal(hci_open(&other, "h6:/dev/null", on_event, on_lost, &other), -EINVAL);
    assert_true(hci_open(&other, "hci250", on_event, on_lost, &other) < 0);
    assert_false(hci_is_open(&other));
}

static void a_command_is_written_as_one_packet(void **state)
{
    static const uint8_t parameters[] = {0xAA, 0xBB, 0xCC};
    static const uint8_t expected[] = {0x01, 0x06, 0x20, 3, 0xAA, 0xBB, 0xCC, 0x01, 0x03, 0x0C, 0};
    uint8_t bytes[sizeof(expected)];

    (void)state;
    assert_int_equal(hci_command(&hci, 0x2006, parameters, sizeof(parameters)), 0);
    assert_int_equal(hci_command(&hci, 0x0C03, NULL, 0), 0);
    assert_int_equal(pty_read(master, bytes, sizeof(bytes)), sizeof(expected));
    assert_memory_equal(bytes, expected, sizeof(expected));
    assert_int_equal(read(master, bytes, 1), -1); /* nothing else */
}

static void an_event_is_put_together_from_single_bytes(void **state)
{
    static const char event[] = "\x04\x0E\x04\x01\x03\x0C\x00";

    (void)state;
    for (size_t i = 0; i < sizeof(event) - 1; i++) {
        assert_int_equal(got.events, 0);
        say(event + i, 1);
        run_ms(2);
    }
    assert_true(loop_until(an_event_came, 500));
    assert_int_equal(got.code, 0x0E);
    assert_int_equal(got.length, 4);
    assert_memory_equal(got.parameters, "\x01\x03\x0C\x00", 4);
}

static void every_byte_value_passes_unchanged(void **state)
{
    char event[3 + 255] = {0x04, 0x3E, (char)255};

    (void)state;
    for (int i = 0; i < 255; i++) {
        event[3 + i] = (char)(i + 1); /* XON, XOFF, ^C, newline among them */
    }
    say(event, sizeof(event));
    assert_true(loop_until(an_event_came, 500));
    assert_int_equal(got.length, 255);
    assert_memory_equal(got.parameters, event + 3, 255);
}

static void packets_that_are_no_events_are_skipped(void **state)
{
    static const char bytes[] = "\x02\x01\x20\x05\x00\x04\x0E\x04\x01\x03" /* ACL, looks like one */
                                "\x03\x01\x00\x02\x04\x0E"                 /* SCO */
                                "\x05\x01\x00\x03\x00\x04\x0E\x04"         /* ISO */
                                "\x02\x01\x20\x00\x00"                     /* an empty ACL */
                                "\x04\x10\x01\x42"                         /* Hardware Error */
                                "\x04\x3E\x00";                            /* without parameters */

    (void)state;
    say(bytes, sizeof(bytes) - 1);
    assert_true(loop_until(two_events_came, 500));
    run_ms(5);
    assert_int_equal(got.events, 2);
    assert_int_equal(got.code, 0x3E);
    assert_int_equal(got.length, 0);
    assert_int_equal(got.lost, 0);
}

static void a_stream_out_of_step_is_lost(void **state)
{
    (void)state;
    say("\x04\x10\x01\x42\x77\x04\x10\x01\x42", 9);
    assert_true(loop_until(it_was_lost, 500));
    run_ms(5);
    assert_int_equal(got.error, -EPROTO);
    assert_int_equal(got.lost, 1);
    assert_int_equal(got.events, 1); /* what came before it counts */
}

static void an_unplugged_device_is_lost_at_once(void **state)
{
    (void)state;
    close(master);
    master = dup(0);
    assert_true(loop_until(it_was_lost, 100));
    assert_int_equal(got.lost, 1);
    assert_true(got.error < 0);
}

static bool half_has_come(void)
{
    return hci.filled == 5;
}

static void half_a_packet_is_forgotten_when_it_is_opened_again(void **state)
{
    (void)state;
    say("\x04\x0E\x20\x01\x02", 5);
    assert_true(loop_until(half_has_come, 500));
    hci_close(&hci);
    assert_int_equal(hci_open(&hci, adapter, on_event, on_lost, &hci), 0);
    say("\x04\x10\x01\x42", 4);
    assert_true(loop_until(an_event_came, 500));
    assert_int_equal(got.code, 0x10);
}

static bool all_came(void)
{
    return got.events >= 100;
}

/* The loop never slept, and the kernel ended the daemon after half a second of it, Wi-Fi with it.
 */
static void who_talks_without_end_is_not_listened_to_without_end(void **state)
{
    static const uint8_t event[] = {0x04, 0x10, 0x01, 0x42};
    loop_watch_fn *on_readable = hci.watch.call;
    int ends[2];

    (void)state;
    hci_close(&hci);
    assert_int_equal(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_NONBLOCK, 0, ends), 0);
    hci.h4 = false;
    assert_int_equal(loop_watch(&hci.watch, ends[0], EPOLLIN, on_readable, &hci), 0);
    for (unsigned i = 0; i < 100; i++) {
        assert_int_equal(write(ends[1], event, sizeof(event)), sizeof(event));
    }
    assert_true(loop_until(an_event_came, 500));
    assert_int_equal(got.events, 32);
    run_ms(1);
    assert_int_equal(got.events, 32);
    assert_true(loop_until(all_came, 500));
    close(ends[1]);
    assert_true(loop_until(it_was_lost, 500));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_told_apart),
        cmocka_unit_test(a_device_that_cannot_be_opened_says_why),
        TEST(a_command_is_written_as_one_packet),
        TEST(an_event_is_put_together_from_single_bytes),
        TEST(every_byte_value_passes_unchanged),
        TEST(packets_that_are_no_events_are_skipped),
        TEST(a_stream_out_of_step_is_lost),
        TEST(an_unplugged_device_is_lost_at_once),
        TEST(who_talks_without_end_is_not_listened_to_without_end),
        TEST(half_a_packet_is_forgotten_when_it_is_opened_again),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
