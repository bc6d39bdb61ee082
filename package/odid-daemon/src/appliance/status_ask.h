/* Asks the daemon for its status: the other end of status.h's socket. */
#ifndef ODID_STATUS_ASK_H
#define ODID_STATUS_ASK_H

#include <stddef.h>
#include <sys/types.h>

#define STATUS_SOCKET "status.sock" /* in run_dir */
/* An answer is never longer. */
#define STATUS_ANSWER_MAX 65536

/*
 * Reads the whole answer, for at most patience_ms altogether. Returns its
 * length, or -errno: ENOENT, ECONNREFUSED when no daemon runs, EAGAIN when it
 * doesn't answer in time.
 */
ssize_t status_ask(const char *run_dir, int patience_ms, char answer[STATUS_ANSWER_MAX]);

#endif
