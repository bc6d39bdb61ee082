/* other-host: another host inside the bench's machine, with a network of its own.
 *
 *     other-host PORT ADDRESS:PORT COMMAND...
 *
 * Runs COMMAND in that network; interfaces come to it when they are moved there (by the id that is
 * printed). Each connection to PORT in the machine's own network goes on to ADDRESS:PORT in the new
 * one. Ends when COMMAND does, with what was moved back in its place. */

#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

static void die(const char *what)
{
    fprintf(stderr, "other-host: %s: %s\n", what, strerror(errno));
    exit(1);
}

static struct sockaddr_in address(const char *host, const char *port)
{
    struct sockaddr_in made = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(port))};

    if (inet_pton(AF_INET, host, &made.sin_addr) != 1 || made.sin_port == 0) {
        errno = EINVAL;
        die(host);
    }
    return made;
}

/* What one side sends goes to the other, until both have sent their last. */
static void carry(int one, int other)
{
    struct pollfd ends[2] = {{.fd = one, .events = POLLIN}, {.fd = other, .events = POLLIN}};
    char data[65536];

    while (ends[0].fd >= 0 || ends[1].fd >= 0) {
        if (poll(ends, 2, -1) < 0) {
            return;
        }
        for (int i = 0; i < 2; i++) {
            int to = i == 0 ? other : one;
            ssize_t got, sent = 0;

            if (ends[i].fd < 0 || ends[i].revents == 0) {
                continue;
            }
            got = read(ends[i].fd, data, sizeof(data));
            for (ssize_t n; sent < got; sent += n) {
                n = write(to, data + sent, (size_t)(got - sent));
                if (n <= 0) {
                    return;
                }
            }
            if (got <= 0) {
                shutdown(to, SHUT_WR);
                ends[i].fd = -1;
            }
        }
    }
}

static void serve(int connection, const struct sockaddr_in *to)
{
    int onward = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);

    if (onward < 0 || connect(onward, (const struct sockaddr *)to, sizeof(*to)) < 0) {
        die("connect");
    }
    carry(connection, onward);
    exit(0);
}

int main(int argc, char **argv)
{
    char *colon = argc < 4 ? NULL : strchr(argv[2], ':');
    struct sockaddr_in here, there;
    int listening, yes = 1;
    pid_t command;

    if (colon == NULL) {
        fprintf(stderr, "usage: other-host PORT ADDRESS:PORT COMMAND...\n");
        return 2;
    }
    *colon = '\0';
    here = address("0.0.0.0", argv[1]);
    there = address(argv[2], colon + 1);
    /* A socket stays in the network that it was made in. */
    listening = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (listening < 0 || setsockopt(listening, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof(yes)) < 0 ||
        bind(listening, (struct sockaddr *)&here, sizeof(here)) < 0 || listen(listening, 8) < 0) {
        die(argv[1]);
    }
    if (unshare(CLONE_NEWNET) < 0) {
        die("a network of its own");
    }
    printf("%d\n", (int)getpid());
    fflush(stdout);
    command = fork();
    if (command == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        execvp(argv[3], argv + 3);
        die(argv[3]);
    }
    for (;;) {
        struct pollfd wait = {.fd = listening, .events = POLLIN};
        int connection;
        pid_t ended;

        while ((ended = waitpid(-1, NULL, WNOHANG)) > 0) {
            if (ended == command) {
                return 0;
            }
        }
        if (poll(&wait, 1, 200) <= 0) {
            continue;
        }
        connection = accept4(listening, NULL, NULL, SOCK_CLOEXEC);
        if (connection >= 0 && fork() == 0) {
            prctl(PR_SET_PDEATHSIG, SIGKILL);
            serve(connection, &there);
        }
        close(connection);
    }
}
