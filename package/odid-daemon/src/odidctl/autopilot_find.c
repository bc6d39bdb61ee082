#include "odidctl/autopilot_find.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdint.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/loop.h"
#include "base/serial.h"
#include "mavlink/framing.h"

#define SECOND_US INT64_C(1000000)
/* A HEARTBEAT comes once a second. */
#define PREFERRED_US (SECOND_US + SECOND_US / 5)
#define PIECE 1024
/* Noise at full speed is no reason to take a processor. */
#define PAUSE_US 5000
/* So often, each so long, the ports' processes are waited for. */
#define END_LOOKS 40
#define END_PAUSE_US 5000

/* ---- one port, in a process of its own: the kernel may have it wait for its device ---- */

/* Written when it changes; less than a pipe tears apart. */
struct news {
    uint8_t port;
    bool speaks;
};

struct port {
    struct framing framing;
    struct framing_counters counters;
    bool speaks;
};

static void on_frame(void *context, const mavlink_message_t *message)
{
    struct port *port = context;

    port->speaks = port->speaks || message->compid == MAV_COMP_ID_AUTOPILOT1;
}

static void say_heartbeat(int fd)
{
    uint8_t octets[MAVLINK_MAX_PACKET_LEN];
    mavlink_message_t message;
    uint16_t length;

    mavlink_msg_heartbeat_pack(1, MAV_COMP_ID_ODID_TXRX_1, &message, MAV_TYPE_ODID,
                               MAV_AUTOPILOT_INVALID, 0, 0, MAV_STATE_ACTIVE);
    length = mavlink_msg_to_send_buffer(octets, &message);
    if (write(fd, octets, length) < 0) {
        return; /* one that takes nothing hears nothing */
    }
}

/* Returns false when it was unplugged. */
static bool hear(struct port *port, int fd)
{
    uint8_t octets[PIECE];
    ssize_t got = read(fd, octets, sizeof(octets));

    if (got > 0) {
        framing_stream(&port->framing, &port->counters, octets, (size_t)got, on_frame, port);
    }
    return got > 0 || (got < 0 && (errno == EAGAIN || errno == EINTR));
}

/* Until it is unplugged, or nobody wants news any more. */
static void listen_on(int fd, unsigned number, int teller)
{
    static struct port port;
    struct news news = {.port = (uint8_t)number, .speaks = false};
    struct pollfd polled[] = {{.fd = fd, .events = POLLIN}, {.fd = teller, .events = 0}};
    int64_t said_us = loop_now_us() - SECOND_US;
    bool plugged = true;

    while (plugged && polled[1].revents == 0) {
        if (loop_now_us() - said_us >= SECOND_US) {
            say_heartbeat(fd);
            said_us = loop_now_us();
        }
        if (poll(polled, 2, 100) <= 0) {
            continue;
        }
        plugged = polled[0].revents == 0 || hear(&port, fd);
        if ((plugged && port.speaks) != news.speaks) {
            news.speaks = !news.speaks;
            plugged = write(teller, &news, sizeof(news)) == sizeof(news) && plugged;
        }
        usleep(PAUSE_US);
    }
}

static _Noreturn void be_port(const char *path, unsigned baud, unsigned number, int teller)
{
    int fd;

    signal(SIGPIPE, SIG_IGN);
    fd = serial_open(path, baud, false);
    if (fd >= 0) {
        listen_on(fd, number, teller);
        serial_close(fd);
    }
    _exit(0);
}

/* ---- all of them ---- */

static struct {
    bool speaks[AUTOPILOT_PORTS_MAX];
    unsigned count;
} self;

/* The first that speaks; -1: none does. */
static int first_speaking(void)
{
    for (unsigned i = 0; i < self.count; i++) {
        if (self.speaks[i]) {
            return (int)i;
        }
    }
    return -1;
}

static int listen_for(unsigned seconds, int told, int asker)
{
    struct pollfd polled[] = {{.fd = told, .events = POLLIN}, {.fd = asker, .events = 0}};
    int64_t begun_us = loop_now_us();
    struct news news;

    while (seconds == 0 || loop_now_us() - begun_us < seconds * SECOND_US) {
        int first = first_speaking();

        if (first == 0 || (first > 0 && loop_now_us() - begun_us >= PREFERRED_US)) {
            return first;
        }
        if (poll(polled, 2, 100) <= 0) {
            continue;
        }
        if ((polled[1].revents & POLLERR) != 0) {
            return -EPIPE;
        }
        if (polled[0].revents != 0) {
            if (read(told, &news, sizeof(news)) != sizeof(news)) {
                return -ENODEV; /* no port is left */
            }
            self.speaks[news.port] = news.speaks;
        }
    }
    return -ENODEV;
}

/* Who ends by himself throws away what his device hasn't taken: else closing waits 30 s for that.
 * One whose device doesn't answer isn't waited for. */
static void await_ends(void)
{
    for (int i = 0; i < END_LOOKS && waitpid(-1, NULL, WNOHANG) >= 0; i++) {
        usleep(END_PAUSE_US);
    }
}

int autopilot_find(char *const ports[], unsigned count, unsigned baud, unsigned seconds, int asker)
{
    int ends[2], found;

    if (pipe2(ends, O_CLOEXEC) < 0) {
        return -errno;
    }
    self.count = count < AUTOPILOT_PORTS_MAX ? count : AUTOPILOT_PORTS_MAX;
    for (unsigned i = 0; i < self.count; i++) {
        self.speaks[i] = false;
        if (fork() == 0) {
            close(ends[0]);
            close(asker); /* what it reads is over with our answer */
            be_port(ports[i], baud, i, ends[1]);
        }
    }
    close(ends[1]);
    found = listen_for(seconds, ends[0], asker);
    close(ends[0]); /* which ends them */
    await_ends();
    return found;
}
