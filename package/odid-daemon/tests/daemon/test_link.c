/* The way to the autopilot, on a real pty and real UDP sockets, with the real event loop. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <arpa/inet.h>
#include <fcntl.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "daemon/link.h"
#include "daemon/telemetry.h"
#include "loop_until.h"
#include "pty.h"

static struct {
    size_t length;
    uint8_t bytes[131072];
    unsigned streams[TELEMETRY_STREAMS]; /* bytes a stream */
    unsigned resets;
} got;

static struct config config;

static void on_bytes(void *context, unsigned stream, const uint8_t *bytes, size_t length,
                     int64_t now_us)
{
    (void)context;
    (void)now_us;
    memcpy(got.bytes + got.length, bytes, length);
    got.length += length;
    got.streams[stream] += (unsigned)length;
}

static void on_reset(void *context, unsigned stream)
{
    (void)context;
    (void)stream;
    got.resets++;
}

/* Runs until it is so; a minute at most, which only a fault takes. */
#define RUN_UNTIL(so)                                                                              \
    for (int looks = 0; !(so) && looks < PATIENCE_MS; looks++) {                                   \
        run_ms(1);                                                                                 \
    }

static int open_pty(char path[64])
{
    int master = posix_openpt(O_RDWR | O_NOCTTY);

    assert_true(master >= 0);
    assert_int_equal(grantpt(master), 0);
    assert_int_equal(unlockpt(master), 0);
    snprintf(path, 64, "%s", ptsname(master));
    return master;
}

static int make_symlink(const char *target)
{
    unlink(config.device);
    return symlink(target, config.device);
}

/* One link a process: the serial one first, under all its changes of fortune. */
static void a_serial_port_is_read_lost_and_found_again(void **state)
{
    char path[64];
    uint8_t back[16];
    int master;

    (void)state;
    config_defaults(&config);
    config.source = MAVLINK_SOURCE_SERIAL;
    snprintf(config.device, sizeof(config.device), "/tmp/odid-link-%d", (int)getpid());
    unlink(config.device);
    link_start(&config, on_bytes, on_reset, NULL, loop_now_us());
    assert_int_equal(link_status()->state, LINK_ABSENT);
    assert_non_null(strstr(link_status()->detail, "No such file"));

    /* It appears: open within a retry, silent until something comes. */
    master = open_pty(path);
    assert_int_equal(make_symlink(path), 0);
    RUN_UNTIL(link_status()->state == LINK_SILENT);
    assert_int_equal(link_status()->state, LINK_SILENT);
    assert_int_equal(write(master, "\x11\x13\r\n\x00\xff", 6), 6); /* raw: nothing is translated */
    RUN_UNTIL(got.length >= 6);
    assert_int_equal(link_status()->state, LINK_ALIVE);
    assert_int_equal(got.length, 6);
    assert_memory_equal(got.bytes, "\x11\x13\r\n\x00\xff", 6);

    link_send(0, (const uint8_t *)"\n\xfd\x03", 3);
    assert_int_equal(pty_read(master, back, 3), 3);
    assert_memory_equal(back, "\n\xfd\x03", 3);

    /* The cable is pulled: noticed at once. */
    close(master);
    RUN_UNTIL(link_status()->state == LINK_ABSENT);
    assert_int_equal(link_status()->state, LINK_ABSENT);
    link_send(0, (const uint8_t *)"x", 1); /* nobody there: no harm */

    /* It is back, under the same name: bytes within a second of that. */
    master = open_pty(path);
    assert_int_equal(make_symlink(path), 0);
    got.length = 0;
    RUN_UNTIL(link_status()->opened == 2);
    assert_int_equal(write(master, "again", 5), 5);
    RUN_UNTIL(got.length >= 5);
    assert_int_equal(got.length, 5);
    assert_int_equal(link_status()->opened, 2);

    /* A port that falls silent is reported. */
    RUN_UNTIL(link_status()->state == LINK_SILENT);
    assert_int_equal(link_status()->state, LINK_SILENT);
    close(master);
    unlink(config.device);
    run_ms(30);
}

static int udp_sender(uint16_t port)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(port)};
    int fd = socket(AF_INET, SOCK_DGRAM, 0);

    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(connect(fd, (struct sockaddr *)&to, sizeof(to)), 0);
    return fd;
}

static uint16_t free_port(void)
{
    struct sockaddr_in address = {.sin_family = AF_INET};
    socklen_t size = sizeof(address);
    int fd = socket(AF_INET, SOCK_DGRAM, 0);

    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(bind(fd, (struct sockaddr *)&address, size), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&address, &size), 0);
    close(fd);
    return ntohs(address.sin_port);
}

static void udp_keeps_senders_apart_and_answers_each(void **state)
{
    uint8_t back[16];
    int first, second;
    struct pollfd waiting;

    (void)state;
    memset(&got, 0, sizeof(got));
    config.source = MAVLINK_SOURCE_UDP;
    config.udp_port = free_port();
    link_start(&config, on_bytes, on_reset, NULL, loop_now_us());
    first = udp_sender(config.udp_port);
    second = udp_sender(config.udp_port);
    assert_int_equal(send(first, "aaa", 3, 0), 3);
    RUN_UNTIL(got.length >= 3);
    assert_int_equal(send(second, "bbbbb", 5, 0), 5);
    assert_int_equal(send(first, "a", 1, 0), 1);
    RUN_UNTIL(got.length >= 9);
    assert_int_equal(got.streams[0], 4);
    assert_int_equal(got.streams[1], 5);
    assert_int_equal(link_status()->senders, 2);

    link_send(1, (const uint8_t *)"to b", 4);
    waiting = (struct pollfd){.fd = second, .events = POLLIN};
    assert_int_equal(poll(&waiting, 1, PATIENCE_MS), 1);
    assert_int_equal(recv(second, back, sizeof(back), MSG_DONTWAIT), 4);
    waiting = (struct pollfd){.fd = first, .events = POLLIN};
    assert_int_equal(poll(&waiting, 1, 20), 0);

    /* An answer to a sender that is gone comes back as an error, and costs nothing. */
    close(second);
    link_send(1, (const uint8_t *)"to b", 4);
    run_ms(20);
    assert_int_equal(send(first, "a", 1, 0), 1);
    RUN_UNTIL(got.length >= 10);
    assert_int_equal(link_status()->state, LINK_ALIVE);
    assert_int_equal(got.streams[0], 5);
    close(first);
}

static void more_senders_than_streams_take_the_longest_silent_place(void **state)
{
    int fds[TELEMETRY_STREAMS + 1];

    (void)state;
    got.resets = 0;
    for (unsigned i = 0; i < TELEMETRY_STREAMS + 1; i++) {
        fds[i] = udp_sender(config.udp_port);
        assert_int_equal(send(fds[i], "x", 1, 0), 1);
        RUN_UNTIL(got.resets > i);
    }
    assert_int_equal(link_status()->senders, TELEMETRY_STREAMS);
    assert_int_equal(got.resets, TELEMETRY_STREAMS + 1);
    for (unsigned i = 0; i < TELEMETRY_STREAMS + 1; i++) {
        close(fds[i]);
    }
}

/* A flood waits its turn, and what the kernel had no room for is counted. */
static void a_flood_is_taken_in_portions(void **state)
{
    const unsigned sent = 5000, portion = 128, portion_ms = 5;
    int fd = udp_sender(config.udp_port);
    size_t taken;

    (void)state;
    run_ms(2 * portion_ms);
    got.length = 0;
    for (unsigned i = 0; i < sent; i++) {
        assert_int_equal(send(fd, "x", 1, 0), 1);
    }
    run_ms(1);
    assert_int_equal(got.length, portion);
    run_ms(3 * portion_ms);
    assert_in_range(got.length, 2 * portion, 5 * portion);

    run_ms(1000);
    taken = got.length;
    assert_in_range(taken, portion, sent - 1);
    assert_int_equal(send(fd, "x", 1, 0), 1);
    RUN_UNTIL(got.length > taken);
    assert_int_equal(got.length, taken + 1);
    assert_int_equal(link_status()->overrun, sent - taken);
    close(fd);
}

/* A burst of what a ground station may send, in frames as small as there are. */
static void a_burst_of_small_frames_is_taken_whole(void **state)
{
    static const char frame[13];
    int fd = udp_sender(config.udp_port);
    uint64_t overrun = link_status()->overrun;

    (void)state;
    run_ms(20);
    got.length = 0;
    for (int i = 0; i < 5; i++) {
        for (int j = 0; j < 150; j++) {
            assert_int_equal(send(fd, frame, sizeof(frame), 0), sizeof(frame));
        }
        run_ms(10);
    }
    RUN_UNTIL(got.length >= 750 * sizeof(frame));
    assert_int_equal(got.length, 750 * sizeof(frame));
    assert_int_equal(link_status()->overrun, overrun);
    close(fd);
}

static void large_ones_are_fewer(void **state)
{
    static const char datagram[1400];
    int fd = udp_sender(config.udp_port);

    (void)state;
    run_ms(20);
    got.length = 0;
    for (int i = 0; i < 60; i++) {
        assert_int_equal(send(fd, datagram, sizeof(datagram), 0), sizeof(datagram));
    }
    run_ms(1);
    assert_int_equal(got.length, 12 * sizeof(datagram));
    RUN_UNTIL(got.length >= 60 * sizeof(datagram));
    assert_int_equal(got.length, 60 * sizeof(datagram));
    close(fd);
}

static int start_loop(void **state)
{
    (void)state;
    return loop_init();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_serial_port_is_read_lost_and_found_again),
        cmocka_unit_test(udp_keeps_senders_apart_and_answers_each),
        cmocka_unit_test(more_senders_than_streams_take_the_longest_silent_place),
        cmocka_unit_test(a_flood_is_taken_in_portions),
        cmocka_unit_test(a_burst_of_small_frames_is_taken_whole),
        cmocka_unit_test(large_ones_are_fewer),
    };

    return cmocka_run_group_tests(tests, start_loop, NULL);
}
