/*
 * A model of a Bluetooth controller on a UART: H4, the advertising commands and
 * their rules (Bluetooth Core Vol 4 Part E 7.8), and faults. Runs in the test's
 * own event loop. The UART is a pair of sockets, by this program's own open and
 * tc[gs]etattr; test_hci and test_link have a terminal's.
 */
#ifndef ODID_TESTS_FAKE_CONTROLLER_H
#define ODID_TESTS_FAKE_CONTROLLER_H

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <termios.h>
#include <unistd.h>

#include "base/loop.h"

#define FAKES_MAX 2

#define FAKE_EXTENDED (UINT64_C(1) << 12)
#define FAKE_CODED (UINT64_C(1) << 11)
#define FAKE_CODING_SELECTION (UINT64_C(1) << 40)

struct fake_set {
    bool known, addressed, enabled;
    uint8_t parameters[27], address[6], data[251];
    size_t length; /* of the data */
};

struct fake_command {
    uint16_t opcode;
    uint8_t parameters[255], length, status;
};

struct fake_controller {
    struct loop_watch watch;
    char path[32], adapter[48]; /* the device, and its name in the configuration */
    bool plugged_in;
    uint8_t packet[300];
    size_t filled;
    /* what it can do */
    uint64_t features;
    unsigned interval_min; /* 0.625 ms */
    unsigned sets_max;
    uint16_t maximum_data; /* octets of advertising data that it says it takes; 0: it doesn't know
                              the command */
    size_t takes;          /* that it does take */
    bool knows_length;     /* of data on a connection: 4.2 and later */
    /* faults */
    bool takes_both;           /* legacy commands after extended ones, and the other way round */
    bool until_reset;          /* answers nothing until it is reset */
    bool mute, holds, no_room; /* no answer; no answer yet; answers, but takes no more */
    uint16_t refused;          /* a command that is refused once, ... */
    uint8_t refusal;           /* ... with this status */
    /* what is odd about it: with which status it refuses that command; 0: it obeys */
    uint8_t (*quirk)(uint16_t opcode, const uint8_t *p);
    /* what it was made to do; legacy commands use set 0 */
    bool legacy_used, extended_used;
    struct fake_set sets[2];
    uint8_t data_length[4];
    /* what came */
    struct fake_command commands[2048];
    unsigned count, held;
};

static void fake_send(struct fake_controller *fake, const uint8_t *packet, size_t length)
{
    if (send(fake->watch.fd, packet, length, MSG_NOSIGNAL) < 0) {
        return; /* nobody is there */
    }
}

static void fake_complete(struct fake_controller *fake, uint16_t opcode, uint8_t status)
{
    uint8_t event[] = {0x04,
                       0x0E,
                       4,
                       !fake->no_room,
                       (uint8_t)opcode,
                       (uint8_t)(opcode >> 8),
                       status,
                       0,
                       0,
                       0,
                       0,
                       0,
                       0,
                       0,
                       0};
    size_t length = 7;

    if (opcode == 0x2003) {
        memcpy(event + 7, &fake->features, 8); /* little-endian, as we are */
        length = 15;
    } else if (opcode == 0x203A && status == 0) {
        memcpy(event + 7, &fake->maximum_data, 2);
        length = 9;
    } else if (opcode == 0x2023 && status == 0) {
        memcpy(event + 7, fake->data_length, 4);
        length = 11;
    } else if (opcode == 0x2036 || opcode == 0x207F) {
        length = 8;
    }
    event[2] = (uint8_t)(length - 3);
    fake_send(fake, event, length);
}

static void fake_forget(struct fake_controller *fake)
{
    static const uint8_t least[] = {0x1B, 0, 0x48, 0x01}; /* 27 octets, 328 us */

    memcpy(fake->data_length, least, sizeof(least));
    memset(fake->sets, 0, sizeof(fake->sets));
    fake->legacy_used = fake->extended_used = false;
}

static uint8_t fake_legacy(struct fake_controller *fake, uint16_t opcode, const uint8_t *p)
{
    struct fake_set *set = &fake->sets[0];

    if (fake->extended_used && !fake->takes_both) {
        return 0x0C;
    }
    fake->legacy_used = opcode != 0x2005;
    switch (opcode) {
    case 0x2005:
        memcpy(set->address, p, 6);
        set->addressed = true;
        return set->enabled ? 0x0C : 0;
    case 0x2006:
        if (set->enabled) {
            return 0x0C;
        }
        if (p[0] + 256U * p[1] < fake->interval_min) {
            return 0x12;
        }
        memcpy(set->parameters, p, 15);
        set->known = true;
        return 0;
    case 0x2008:
        set->length = p[0];
        memcpy(set->data, p + 1, 31);
        return 0;
    default:
        if (p[0] && (!set->known || (set->parameters[5] == 1 && !set->addressed))) {
            return 0x12;
        }
        set->enabled = p[0];
        return 0;
    }
}

static uint8_t fake_set_extended_parameters(struct fake_controller *fake, const uint8_t *p,
                                            size_t length)
{
    struct fake_set *set = &fake->sets[p[0]];

    if (p[0] >= fake->sets_max) {
        return 0x07;
    }
    if (set->enabled) {
        return 0x0C;
    }
    if (p[3] + 256U * p[4] < fake->interval_min) {
        return 0x12;
    }
    memcpy(set->parameters, p, length);
    set->known = true;
    return 0;
}

static uint8_t fake_extended_enable(struct fake_controller *fake, const uint8_t *p)
{
    for (unsigned i = 0; i < p[1]; i++) {
        const struct fake_set *set = &fake->sets[p[2 + 4 * i]];

        if (!set->known) {
            return 0x42;
        }
        if (p[0] && !set->addressed) {
            return 0x12;
        }
    }
    for (unsigned i = 0; i < 2; i++) {
        fake->sets[i].enabled = fake->sets[i].enabled && p[1] > 0;
    }
    for (unsigned i = 0; i < p[1]; i++) {
        fake->sets[p[2 + 4 * i]].enabled = p[0];
    }
    return 0;
}

static uint8_t fake_extended(struct fake_controller *fake, uint16_t opcode, const uint8_t *p,
                             size_t length)
{
    struct fake_set *set = &fake->sets[p[0] & 1];

    if (!(fake->features & FAKE_EXTENDED)) {
        return 0x01;
    }
    if (fake->legacy_used && !fake->takes_both) {
        return 0x0C;
    }
    fake->extended_used = true;
    switch (opcode) {
    case 0x2035:
        memcpy(set->address, p + 1, 6);
        set->addressed = true;
        return set->known ? 0 : 0x42;
    case 0x2036:
    case 0x207F:
        return fake_set_extended_parameters(fake, p, length);
    case 0x203A:
        return fake->maximum_data == 0 ? 0x01 : 0;
    case 0x2037:
        if (p[3] > fake->takes) {
            return 0x45;
        }
        set->length = p[3];
        memcpy(set->data, p + 4, p[3]);
        return set->known && p[1] == 3 ? 0 : 0x42;
    case 0x2039:
        return fake_extended_enable(fake, p);
    default: /* 0x203D: clear */
        if (fake->sets[0].enabled || fake->sets[1].enabled) {
            return 0x0C;
        }
        memset(fake->sets, 0, sizeof(fake->sets));
        return 0;
    }
}

/* Does what a command says, whoever sent it. Returns the status. */
static uint8_t fake_obey(struct fake_controller *fake, uint16_t opcode, const uint8_t *p,
                         size_t length)
{
    if (opcode == fake->refused) {
        fake->refused = 0;
        return fake->refusal;
    }
    if (fake->quirk != NULL && fake->quirk(opcode, p) != 0) {
        return fake->quirk(opcode, p);
    }
    switch (opcode) {
    case 0x0C03:
        fake_forget(fake);
        return 0;
    case 0x2003:
        return 0;
    case 0x2024:
        memcpy(fake->data_length, p, sizeof(fake->data_length));
        return fake->knows_length ? 0 : 0x01;
    case 0x2023:
        return fake->knows_length ? 0 : 0x01;
    case 0x2005:
    case 0x2006:
    case 0x2008:
    case 0x200A:
        return fake_legacy(fake, opcode, p);
    case 0x2035:
    case 0x2036:
    case 0x2037:
    case 0x2039:
    case 0x203A:
    case 0x203D:
    case 0x207F:
        return fake_extended(fake, opcode, p, length);
    default:
        return 0x01;
    }
}

/* Another program's command, through the same controller. */
static inline void fake_foreign(struct fake_controller *fake, uint16_t opcode, const uint8_t *p,
                                size_t length)
{
    fake_complete(fake, opcode, fake_obey(fake, opcode, p, length));
}

static void fake_take_command(struct fake_controller *fake)
{
    struct fake_command *command = &fake->commands[fake->count % 2048];

    command->opcode = (uint16_t)(fake->packet[1] | fake->packet[2] << 8);
    command->length = fake->packet[3];
    memcpy(command->parameters, fake->packet + 4, command->length);
    fake->count++;
    fake->until_reset = fake->until_reset && command->opcode != 0x0C03;
    if (fake->mute || fake->until_reset) {
        return;
    }
    command->status = fake_obey(fake, command->opcode, command->parameters, command->length);
    if (fake->holds) {
        fake->held++;
    } else {
        fake_complete(fake, command->opcode, command->status);
    }
}

/* Answers what was held back. */
static inline void fake_release(struct fake_controller *fake)
{
    const struct fake_command *command = &fake->commands[(fake->count - 1) % 2048];

    if (fake->held > 0) {
        fake->held = 0;
        fake_complete(fake, command->opcode, command->status);
    }
}

static void fake_hang_up(struct fake_controller *fake)
{
    int end = fake->watch.fd;

    if (end >= 0) {
        loop_unwatch(&fake->watch);
        close(end);
    }
}

static void fake_on_readable(void *context, uint32_t events, int64_t now_us)
{
    struct fake_controller *fake = context;
    uint8_t byte;

    (void)now_us;
    while (read(fake->watch.fd, &byte, 1) == 1) {
        fake->packet[fake->filled++] = byte;
        if (fake->filled >= 4 && fake->filled == 4U + fake->packet[3]) {
            fake->filled = 0;
            fake_take_command(fake);
        }
    }
    if (events & EPOLLHUP) { /* closed by the daemon, which may open it again */
        fake_hang_up(fake);
    }
}

static struct fake_controller *fakes[FAKES_MAX]; /* that were started */

static int fake_open(struct fake_controller *fake)
{
    int ends[2];

    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends) < 0) {
        return -1;
    }
    fake_hang_up(fake);
    fake->filled = 0;
    loop_watch(&fake->watch, ends[1], EPOLLIN, fake_on_readable, fake);
    return ends[0];
}

int open(const char *path, int flags, ...)
{
    va_list rest;
    mode_t mode;

    for (int i = 0; i < FAKES_MAX; i++) {
        if (fakes[i] != NULL && fakes[i]->plugged_in && strcmp(fakes[i]->path, path) == 0) {
            return fake_open(fakes[i]);
        }
    }
    va_start(rest, flags);
    mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

int tcgetattr(int fd, struct termios *termios)
{
    (void)fd;
    memset(termios, 0, sizeof(*termios));
    return 0;
}

int tcsetattr(int fd, int when, const struct termios *termios)
{
    (void)fd;
    (void)when;
    (void)termios;
    return 0;
}

static void fake_plug_in(struct fake_controller *fake)
{
    fake_forget(fake);
    fake->plugged_in = true;
}

static void fake_unplug(struct fake_controller *fake)
{
    fake->plugged_in = false;
    fake_hang_up(fake);
}

static void fake_start(struct fake_controller *fake, uint64_t features)
{
    int place = 0;

    memset(fake, 0, sizeof(*fake));
    fake->watch.fd = -1;
    fake->features = features;
    fake->maximum_data = 0x0672;
    fake->takes = 251;
    fake->interval_min = 0x20;
    fake->sets_max = 2;
    fake->knows_length = true;
    while (fakes[place] != NULL && fakes[place] != fake) {
        place++;
    }
    fakes[place] = fake;
    snprintf(fake->path, sizeof(fake->path), "/dev/fake%d", place);
    snprintf(fake->adapter, sizeof(fake->adapter), "h4:%s", fake->path);
    fake_plug_in(fake);
}

static void fake_end(struct fake_controller *fake)
{
    fake_unplug(fake);
    for (int i = 0; i < FAKES_MAX; i++) {
        if (fakes[i] == fake) {
            fakes[i] = NULL;
        }
    }
}

#endif
