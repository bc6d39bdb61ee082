/*
 * odid-confine: starts a program that makes no sockets but UNIX's, IP's and netlink's. The kernel
 * lets anybody open a raw socket of a Bluetooth controller, and have commands stand in the queue
 * before the daemon's: without one on the air, who did it for a second would have silenced it.
 *
 * With -u the program is one that needs the network's rights, and no others of root's: as that
 * user it keeps CAP_NET_ADMIN and CAP_NET_RAW. What it could do with these by a socket of any kind
 * is more than a radio's program needs: it makes UNIX's, datagrams, packet sockets, and netlink's
 * of two protocols. With -r it keeps CAP_NET_ADMIN, and asks the kernel's radios: UNIX's sockets,
 * and netlink's generic one. Neither starts another process, and so leaves none behind.
 */
#include <cap-ng.h>
#include <errno.h>
#include <linux/if_packet.h>
#include <linux/netlink.h>
#include <pwd.h>
#include <seccomp.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/socket_families.h"

#define NOT_STARTED 127 /* as a shell says it */

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

static const int families[] = {AF_UNIX, AF_INET, AF_INET6, AF_NETLINK};
static const int families_of_network[] = {AF_UNIX, AF_INET, AF_NETLINK, AF_PACKET};
static const int families_of_radio[] = {AF_UNIX, AF_NETLINK};

/* What the kernel looks at of a number. */
static const uint64_t number = UINT32_MAX;

static const unsigned rights[] = {CAP_NET_ADMIN, CAP_NET_RAW};

/* How many of these it keeps. */
enum kind { KIND_NONE, KIND_RADIO, KIND_NETWORK };

/* ---- the filter ---- */

/* With CAP_NET_ADMIN the others would be ways to the firewall's rules, and to mdev: whatever it is
 * told of as a new device, root does. */
static int refuse_netlink(scmp_filter_ctx filter, uint32_t refuse, enum kind kind)
{
    int result = 0;

    for (scmp_datum_t protocol = 0; result == 0 && protocol < MAX_LINKS; protocol++) {
        if (protocol != NETLINK_GENERIC && (protocol != NETLINK_ROUTE || kind != KIND_NETWORK)) {
            result = seccomp_rule_add(filter, refuse, SCMP_SYS(socket), 2,
                                      SCMP_A0(SCMP_CMP_EQ, AF_NETLINK),
                                      SCMP_A2(SCMP_CMP_MASKED_EQ, number, protocol));
        }
    }
    return result;
}

static int refuse_sockets(scmp_filter_ctx filter, uint32_t refuse, enum kind kind)
{
    int result;

    switch (kind) {
    case KIND_RADIO:
        result =
            socket_families_refuse(filter, refuse, families_of_radio, COUNT(families_of_radio));
        break;
    case KIND_NETWORK:
        result =
            socket_families_refuse(filter, refuse, families_of_network, COUNT(families_of_network));
        break;
    default:
        return socket_families_refuse(filter, refuse, families, COUNT(families));
    }
    if (result == 0) {
        result = socket_families_datagrams_only(filter, refuse);
    }
    return result < 0 ? result : refuse_netlink(filter, refuse, kind);
}

/* Pages that the kernel counts as nobody's: a group's limit of memory doesn't see them. */
static int refuse_memory_of_nobody(scmp_filter_ctx filter, uint32_t refuse)
{
    static const scmp_datum_t options[][2] = {
        {SOL_PACKET, PACKET_RX_RING},
        {SOL_PACKET, PACKET_TX_RING},
        {SOL_SOCKET, SO_RCVBUFFORCE},
        {SOL_SOCKET, SO_SNDBUFFORCE},
    };
    int result = 0;

    for (size_t i = 0; result == 0 && i < COUNT(options); i++) {
        result = seccomp_rule_add(filter, refuse, SCMP_SYS(setsockopt), 2,
                                  SCMP_A1(SCMP_CMP_MASKED_EQ, number, options[i][0]),
                                  SCMP_A2(SCMP_CMP_MASKED_EQ, number, options[i][1]));
    }
    return result;
}

/* The kernel hands an ioctl that a socket's family doesn't know to all interfaces: one of UNIX's
 * could switch lo off. What asks the radios needs a number for a name. */
static int refuse_ioctl_but_index(scmp_filter_ctx filter, uint32_t refuse)
{
    return seccomp_rule_add(filter, refuse, SCMP_SYS(ioctl), 1, SCMP_A1(SCMP_CMP_NE, SIOCGIFINDEX));
}

/* With an error: a library that only tries goes on without. What makes sockets by another way isn't
 * to be had either. */
static int add_refusals(scmp_filter_ctx filter, enum kind kind)
{
    const uint32_t refuse = SCMP_ACT_ERRNO(EPERM);
    int result = seccomp_rule_add(filter, refuse, SCMP_SYS(io_uring_setup), 0);

    if (result == 0 && kind == KIND_RADIO) {
        result = refuse_ioctl_but_index(filter, refuse);
    } else if (result ==
               0) { /* by a line discipline a pseudo-terminal becomes a Bluetooth controller */
        result = seccomp_rule_add(filter, refuse, SCMP_SYS(ioctl), 1,
                                  SCMP_A1(SCMP_CMP_MASKED_EQ, number, TIOCSETD));
    }
    if (result == 0 && kind != KIND_NONE) {
        result = refuse_memory_of_nobody(filter, refuse);
    }
    return result < 0 ? result : refuse_sockets(filter, refuse, kind);
}

/* Sets no_new_privs as well. */
static int enter_filter(enum kind kind)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    int result;

    if (filter == NULL) {
        return -ENOMEM;
    }
    result = add_refusals(filter, kind);
    if (result == 0) {
        result = seccomp_load(filter);
    }
    seccomp_release(filter);
    return result;
}

/* ---- the user ---- */

/* Its rights outlive the change of user, and by the ambient set the start of the program; the
 * bounding set is emptied. */
static int become(const char *user, enum kind kind)
{
    const struct rlimit itself = {.rlim_cur = 1, .rlim_max = 1};
    const size_t kept = kind;
    const struct passwd *entry = getpwnam(user);

    if (entry == NULL) {
        return -ENOENT;
    }
    capng_clear(CAPNG_SELECT_ALL);
    for (size_t i = 0; i < kept; i++) {
        if (capng_update(CAPNG_ADD, CAPNG_EFFECTIVE | CAPNG_PERMITTED | CAPNG_INHERITABLE,
                         rights[i]) < 0) {
            return -EPERM;
        }
    }
    if (capng_change_id((int)entry->pw_uid, (int)entry->pw_gid,
                        CAPNG_INIT_SUPP_GRP | CAPNG_CLEAR_BOUNDING | CAPNG_CLEAR_AMBIENT) < 0) {
        return -EPERM;
    }
    for (size_t i = 0; i < kept; i++) {
        if (prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, rights[i], 0, 0) < 0) {
            return -errno;
        }
    }
    return setrlimit(RLIMIT_NPROC, &itself) < 0 ? -errno : 0;
}

static int confine(const char *user, enum kind kind)
{
    int result = user == NULL ? 0 : become(user, kind);

    return result < 0 ? result : enter_filter(kind);
}

static enum kind kind_of(const char *option)
{
    return strcmp(option, "-u") == 0   ? KIND_NETWORK
           : strcmp(option, "-r") == 0 ? KIND_RADIO
                                       : KIND_NONE;
}

int main(int argc, char **argv)
{
    enum kind kind = argc > 2 ? kind_of(argv[1]) : KIND_NONE;
    const char *user = kind == KIND_NONE ? NULL : argv[2];
    char **program = argv + (user == NULL ? 1 : 3);
    int result;

    if (argc < 2 || program[0] == NULL || program[0][0] == '-') {
        fprintf(stderr, "usage: odid-confine [-u user | -r user] program [argument ...]\n");
        return 2;
    }
    result = confine(user, kind);
    if (result == -ENOENT) {
        fprintf(stderr, "odid-confine: %s isn't started: there is no user \"%s\"\n", program[0],
                user);
        return NOT_STARTED;
    }
    if (result < 0) {
        fprintf(stderr, "odid-confine: %s isn't started, for it can't be confined: %s\n",
                program[0], strerror(-result));
        return NOT_STARTED;
    }
    execvp(program[0], program);
    fprintf(stderr, "odid-confine: %s: %s\n", program[0], strerror(errno));
    return NOT_STARTED;
}
