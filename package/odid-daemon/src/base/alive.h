/*
 * The daemon's heartbeat to its keeper: one byte a second into the pipe that
 * ODID_ALIVE_FD names, out of the same loop that serves the radios. Without
 * that variable there is no keeper, and nothing to do.
 */
#ifndef ODID_ALIVE_H
#define ODID_ALIVE_H

#include <stdint.h>

#define ALIVE_VARIABLE "ODID_ALIVE_FD"

/*
 * Takes the pipe over: non-blocking, closed on exec, and gone from the
 * environment. Before privileges are dropped. What is no pipe is reported and
 * left alone.
 */
void alive_open(void);

/*
 * The first byte goes out in the loop's first round, the others every second.
 * A keeper that is gone ends the loop: the next one starts a daemon of its own.
 */
void alive_start(int64_t now_us);

#endif
