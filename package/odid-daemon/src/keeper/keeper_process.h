/*
 * The daemon as odid-keeper's child: started with the write end of a pipe of
 * its own, whose number is in ODID_ALIVE_FD, and with the UDP socket of the
 * autopilot's datagrams (link_socket.h), where there is one; and ended by the
 * kernel when the keeper is. Nothing else of the keeper's is left open in it.
 */
#ifndef ODID_KEEPER_PROCESS_H
#define ODID_KEEPER_PROCESS_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/types.h>

#include "base/loop.h"

/* A byte came; also called for several at once. */
typedef void keeper_process_alive_fn(void *context, int64_t now_us);

struct keeper_process {
    pid_t pid;               /* 0: none runs */
    struct loop_watch watch; /* the pipe's read end */
    keeper_process_alive_fn *on_alive;
    void *context;
};

void keeper_process_init(struct keeper_process *process, keeper_process_alive_fn *on_alive,
                         void *context);

/*
 * Starts command, with -seccomp-log as its first argument when log_mode.
 * link_socket: -1 for none. What keeps it from being executed is logged by the child, which then
 * exits with 127. Returns 0, or -errno.
 */
int keeper_process_start(struct keeper_process *process, char *const command[], bool log_mode,
                         int link_socket);

/* Tells at once what lies in the pipe: before its silence is judged. */
void keeper_process_drain(struct keeper_process *process, int64_t now_us);

void keeper_process_signal(const struct keeper_process *process, int signal);

/* Has it ended? Then signal is what ended it, or 0, and code its exit code. */
bool keeper_process_ended(struct keeper_process *process, int *signal, int *code);

#endif
