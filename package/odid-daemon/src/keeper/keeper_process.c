#include "keeper/keeper_process.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alive.h"
#include "base/inherited.h"
#include "base/log.h"
#include "mavlink/link_socket.h"

#define NOT_EXECUTED 127

void keeper_process_init(struct keeper_process *process, keeper_process_alive_fn *on_alive,
                         void *context)
{
    process->pid = 0;
    process->watch.fd = -1;
    process->on_alive = on_alive;
    process->context = context;
}

static void close_pipe(struct keeper_process *process)
{
    int fd = process->watch.fd;

    loop_unwatch(&process->watch);
    if (fd >= 0) {
        close(fd);
    }
}

static void on_sign(void *context, uint32_t events, int64_t now_us)
{
    struct keeper_process *process = context;
    char bytes[256];
    ssize_t length = read(process->watch.fd, bytes, sizeof(bytes));

    (void)events;
    if (length == 0 || (length < 0 && errno != EAGAIN)) {
        close_pipe(process); /* it ended, which SIGCHLD says, or went silent */
    } else if (length == sizeof(bytes)) {
        log_error("the daemon says without end that it is alive: it isn't listened to any more");
        close_pipe(process); /* else that would take all of this program's time, which is bounded */
    } else if (length > 0) {
        process->on_alive(process->context, now_us);
    }
}

void keeper_process_drain(struct keeper_process *process, int64_t now_us)
{
    if (process->watch.fd >= 0) {
        on_sign(process, EPOLLIN, now_us);
    }
}

/* ---- in the child ---- */

static const char **with_log_mode(char *const command[])
{
    size_t count = 0;
    const char **words;

    while (command[count] != NULL) {
        count++;
    }
    words = calloc(count + 2, sizeof(*words));
    if (words != NULL) {
        words[0] = command[0];
        words[1] = "-seccomp-log";
        memcpy(words + 2, command + 1, (count - 1) * sizeof(*words));
    }
    return words;
}

/* What the keeper has set for itself and exec would pass on. */
static void forget_signals(void)
{
    sigset_t none;

    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    signal(SIGPIPE, SIG_DFL);
}

__attribute__((noreturn)) static void exec_daemon(char *const command[], bool log_mode, int alive,
                                                  int link_socket, pid_t keeper)
{
    const char **words = log_mode ? with_log_mode(command) : (const char **)command;

    if (prctl(PR_SET_PDEATHSIG, SIGKILL) < 0 || inherited_give(ALIVE_VARIABLE, alive) < 0 ||
        (link_socket >= 0 && inherited_give(LINK_SOCKET_VARIABLE, link_socket) < 0) ||
        words == NULL) {
        log_error("can't prepare the daemon's start: %s", strerror(errno));
        _exit(NOT_EXECUTED);
    }
    if (getppid() != keeper) {
        _exit(NOT_EXECUTED); /* killed in the meantime; the next one starts its own */
    }
    forget_signals();
    execvp(words[0], (char *const *)words);
    log_error("can't execute \"%s\": %s", words[0], strerror(errno));
    _exit(NOT_EXECUTED);
}

/* ---- in the keeper ---- */

int keeper_process_start(struct keeper_process *process, char *const command[], bool log_mode,
                         int link_socket)
{
    pid_t keeper = getpid();
    int ends[2], result;

    close_pipe(process);
    if (pipe2(ends, O_CLOEXEC) < 0) {
        return -errno;
    }
    /* Ours only: the daemon makes its end non-blocking itself. */
    if (fcntl(ends[0], F_SETFL, O_NONBLOCK) < 0) {
        result = -errno;
    } else {
        result = loop_watch(&process->watch, ends[0], EPOLLIN, on_sign, process);
    }
    if (result < 0) {
        close(ends[0]);
        close(ends[1]);
        return result;
    }
    process->pid = fork();
    if (process->pid == 0) {
        exec_daemon(command, log_mode, ends[1], link_socket, keeper);
    }
    result = process->pid < 0 ? -errno : 0;
    close(ends[1]);
    if (result < 0) {
        process->pid = 0;
        close_pipe(process);
    }
    return result;
}

void keeper_process_signal(const struct keeper_process *process, int signal)
{
    if (process->pid > 0 && kill(process->pid, signal) < 0) {
        log_error("can't send signal %d to the daemon (process %d): %s", signal, (int)process->pid,
                  strerror(errno));
    }
}

bool keeper_process_ended(struct keeper_process *process, int *signal, int *code)
{
    int status;

    if (process->pid == 0 || waitpid(process->pid, &status, WNOHANG) != process->pid) {
        return false;
    }
    *signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
    *code = WIFEXITED(status) ? WEXITSTATUS(status) : 0;
    process->pid = 0;
    close_pipe(process);
    return true;
}
