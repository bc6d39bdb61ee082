/* The UDP socket that the keeper hands down: whose port it is between two daemons. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/inherited.h"
#include "daemon/link.h"
#include "loop_until.h"
#include "mavlink/link_socket.h"

static struct config config;
static char got[64];

static void on_bytes(void *context, unsigned stream, const uint8_t *bytes, size_t length,
                     int64_t now_us)
{
    (void)context;
    (void)stream;
    (void)now_us;
    strncat(got, (const char *)bytes, length);
}

static void on_reset(void *context, unsigned stream)
{
    (void)context;
    (void)stream;
}

/* On a port that nobody has: the kernel names it. */
static int open_somewhere(void)
{
    struct sockaddr_in address;
    socklen_t size = sizeof(address);
    int fd;

    config_defaults(&config);
    config.source = MAVLINK_SOURCE_UDP;
    config.udp_port = 0;
    fd = link_socket_open(&config);
    assert_true(fd >= 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&address, &size), 0);
    config.udp_port = ntohs(address.sin_port);
    return fd;
}

static int sender(void)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(config.udp_port)};
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);

    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(connect(fd, (struct sockaddr *)&to, sizeof(to)), 0);
    return fd;
}

static void what_is_another_one_does_not_fit(void **state)
{
    int right = open_somewhere(), stream = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    int local = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0), file = open("/dev/null", O_RDWR);

    (void)state;
    assert_true(link_socket_fits(right, &config));
    config.udp_port++;
    assert_false(link_socket_fits(right, &config));
    config.udp_port--;
    strcpy(config.udp_address, "127.0.0.2");
    assert_false(link_socket_fits(right, &config));
    assert_false(link_socket_fits(stream, &config));
    assert_false(link_socket_fits(local, &config));
    assert_false(link_socket_fits(file, &config));
    assert_false(link_socket_fits(-1, &config));
    strcpy(config.udp_address, "nowhere");
    assert_false(link_socket_fits(right, &config));
    assert_int_equal(link_socket_open(&config), -EADDRNOTAVAIL);
    close(right);
    close(stream);
    close(local);
    close(file);
}

/* What came while no daemon ran would be believed as if it were said now, and what the kernel had
 * no room for then isn't the daemon's. */
static void a_socket_that_was_handed_down_begins_with_what_comes_now(void **state)
{
    int fd = open_somewhere(), from = sender();

    (void)state;
    for (int i = 0; i < 5000; i++) {
        assert_int_equal(send(from, "old", 3, 0), 3);
    }
    assert_int_equal(inherited_give(LINK_SOCKET_VARIABLE, fd), 0);
    link_start(&config, on_bytes, on_reset, NULL, loop_now_us());
    assert_null(getenv(LINK_SOCKET_VARIABLE));
    assert_int_equal(fcntl(fd, F_GETFD) & FD_CLOEXEC, FD_CLOEXEC);
    assert_int_equal(link_status()->state, LINK_SILENT);
    assert_int_equal(send(from, "new", 3, 0), 3);
    for (int looks = 0; got[0] == '\0' && looks < PATIENCE_MS; looks++) {
        run_ms(1);
    }
    assert_string_equal(got, "new");
    assert_int_equal(link_status()->state, LINK_ALIVE);
    assert_int_equal(link_status()->overrun, 0);
    assert_int_equal(link_socket_open(&config), -EADDRINUSE);
    close(from);
}

static int start_loop(void **state)
{
    (void)state;
    return loop_init();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_another_one_does_not_fit),
        cmocka_unit_test(a_socket_that_was_handed_down_begins_with_what_comes_now),
    };

    return cmocka_run_group_tests_name("link_socket", tests, start_loop, NULL);
}
