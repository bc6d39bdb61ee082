/*
 * A program's heartbeat to whoever keeps it, once a second, out of the same loop
 * that serves its work: the daemon's to odid-keeper, a byte into the pipe that
 * ODID_ALIVE_FD names; the keeper's to a service manager, by sd_notify(3)'s
 * datagrams (READY=1, then WATCHDOG=1) to the socket that NOTIFY_SOCKET names.
 * Without either variable there is nobody, and nothing to do.
 */
#ifndef ODID_ALIVE_H
#define ODID_ALIVE_H

#include <stdint.h>

#define ALIVE_VARIABLE "ODID_ALIVE_FD"
#define ALIVE_NOTIFY_VARIABLE "NOTIFY_SOCKET"

/*
 * Takes the pipe, or else the socket, over: non-blocking, closed on exec, and
 * gone from the environment. Before privileges are dropped. What is neither is
 * reported and left alone.
 */
void alive_open(void);

/*
 * The first sign goes out in the loop's first round, the others every second.
 * A keeper that is gone ends the loop: the next one starts a daemon of its own.
 * A service manager that is gone for a moment starts itself anew.
 */
void alive_start(int64_t now_us);

#endif
