/*
 * odid-confine: starts a program that makes no sockets but UNIX's, IP's and netlink's. The kernel
 * lets anybody open a raw socket of a Bluetooth controller, and have commands stand in the queue
 * before the daemon's: without one on the air, who did it for a second would have silenced it.
 */
#include <errno.h>
#include <seccomp.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "base/socket_families.h"

#define NOT_STARTED 127 /* as a shell says it */

static const int families[] = {AF_UNIX, AF_INET, AF_INET6, AF_NETLINK};

/* With an error: a library that only tries goes on without. What makes sockets by another way isn't
 * to be had either. */
static int add_refusals(scmp_filter_ctx filter)
{
    const uint32_t refuse = SCMP_ACT_ERRNO(EPERM);
    int result = seccomp_rule_add(filter, refuse, SCMP_SYS(io_uring_setup), 0);

    return result < 0 ? result
                      : socket_families_refuse(filter, refuse, families,
                                               sizeof(families) / sizeof(families[0]));
}

/* Sets no_new_privs as well. */
static int confine(void)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    int result;

    if (filter == NULL) {
        return -ENOMEM;
    }
    result = add_refusals(filter);
    if (result == 0) {
        result = seccomp_load(filter);
    }
    seccomp_release(filter);
    return result;
}

int main(int argc, char **argv)
{
    int result;

    if (argc < 2 || argv[1][0] == '-') {
        fprintf(stderr, "usage: odid-confine program [argument ...]\n");
        return 2;
    }
    result = confine();
    if (result < 0) {
        fprintf(stderr, "odid-confine: %s isn't started, for it can't be confined: %s\n", argv[1],
                strerror(-result));
        return NOT_STARTED;
    }
    execvp(argv[1], argv + 1);
    fprintf(stderr, "odid-confine: %s: %s\n", argv[1], strerror(errno));
    return NOT_STARTED;
}
