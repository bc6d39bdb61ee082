/*
 * Privilege: real-time priority while root, then the daemon's own user with
 * CAP_NET_RAW and CAP_NET_ADMIN only, no_new_privs, and a list of the system
 * calls that it needs; any other one ends the process (SIGSYS).
 */
#ifndef ODID_SANDBOX_H
#define ODID_SANDBOX_H

#include <stdbool.h>

/*
 * SCHED_FIFO (priority 20) with RLIMIT_RTTIME, and memory locked as it is
 * touched. Returns 0, or -errno when refused: said in status, never fatal.
 */
int sandbox_realtime(void);

/*
 * Becomes user (with its supplementary groups: tty, rfkill's and hostapd's),
 * and enters the filter. Who isn't root stays who it is, with what it has of the two rights; a user
 * that there is not is replaced by nobody: no setting keeps the broadcast silent. log_only:
 * forbidden calls are logged by the kernel instead of ending us; those that nothing here ever needs
 * (another program, mounts, the kernel, other users and processes) fail with EPERM. Returns 0,
 * SANDBOX_NO_FILTER where none is to be had, or -errno, with a log line that says which step
 * failed.
 */
#define SANDBOX_NO_FILTER 1
int sandbox_enter(const char *user, bool log_only);

#endif
