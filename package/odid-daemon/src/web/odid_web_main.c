/*
 * odid-web: the technician's page, in maintenance only. Two processes: one
 * without any right speaks HTTP, the other, root's, does the little that needs
 * a right (web_helper.h). Either ends with the other.
 */
#include <cap-ng.h>
#include <errno.h>
#include <getopt.h>
#include <netdb.h>
#include <netinet/in.h>
#include <pwd.h>
#include <seccomp.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/log.h"
#include "web/web_helper.h"
#include "web/web_server.h"

static const char usage[] =
    "odid-web serves the technician's page; see odid-web(8).\n"
    "\n"
    "  -listen ADDRESS:PORT  where; default 0.0.0.0:80\n"
    "  -user NAME            whom its serving half becomes; default odid-web; empty: nobody else\n"
    "  -root DIR             everything else below DIR instead of /; for tests\n"
    "  -help, -version\n";

#define LISTEN_BACKLOG 128 /* of connections that are about to be made */
#define DESCRIPTORS_MAX 128
/* Of each connection. The kernel's own choice is megabytes: memory, and a browser that takes a
 * bundle for sent that lies here still. */
#define RECEIVE_BUFFER 65536

static struct {
    struct places places;
    struct web_server server;
    const char *root, *listen, *user;
} self = {.root = "", .listen = "0.0.0.0:80", .user = "odid-web"};

/* ---- the socket ---- */

/* Returns the listening socket, or -1 with a log line. */
static int open_listener(void)
{
    const struct addrinfo hints = {.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV | AI_PASSIVE,
                                   .ai_socktype = SOCK_STREAM};
    const char *colon = strrchr(self.listen, ':');
    struct addrinfo *place = NULL;
    char address[64];
    int fd, on = 1, buffer = RECEIVE_BUFFER;

    if (colon != NULL) {
        snprintf(address, sizeof(address), "%.*s", (int)(colon - self.listen), self.listen);
    }
    if (colon == NULL || getaddrinfo(address, colon + 1, &hints, &place) != 0) {
        log_error("-listen %s: expected an address and a port, such as 0.0.0.0:80", self.listen);
        return -1;
    }
    fd = socket(place->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    if (fd < 0 || setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof(on)) < 0 ||
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &buffer, sizeof(buffer)) < 0 ||
        bind(fd, place->ai_addr, place->ai_addrlen) < 0 || listen(fd, LISTEN_BACKLOG) < 0) {
        log_error("can't listen on %s: %s", self.listen, strerror(errno));
        if (fd >= 0) {
            close(fd);
        }
        fd = -1;
    }
    freeaddrinfo(place);
    return fd;
}

/* ---- the half that speaks HTTP ---- */

/*
 * Whoever takes this half over by its HTTP starts no program and no process,
 * and reaches nothing over a network: neither is ever needed here.
 */
static int enter_http_filter(void)
{
    static const int forbidden[] = {
        SCMP_SYS(execve), SCMP_SYS(execveat), SCMP_SYS(fork),   SCMP_SYS(vfork), SCMP_SYS(clone),
        SCMP_SYS(clone3), SCMP_SYS(ptrace),   SCMP_SYS(listen), SCMP_SYS(bind),
    };
    const uint64_t number = UINT32_MAX; /* what the kernel looks at */
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);
    int result = filter == NULL ? -ENOMEM : 0;

    for (size_t i = 0; result == 0 && i < sizeof(forbidden) / sizeof(forbidden[0]); i++) {
        result = seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), forbidden[i], 0);
        result = result == -EDOM ? 0 : result; /* this architecture doesn't have it */
    }
    if (result == 0) {
        result = seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(socket), 1,
                                  SCMP_A0(SCMP_CMP_NE, AF_UNIX));
    }
    if (result == 0) { /* maintenance that ends ends this half, too */
        result = seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(prctl), 1,
                                  SCMP_A0(SCMP_CMP_MASKED_EQ, number, PR_SET_PDEATHSIG));
    }
    if (result == 0) {
        result = seccomp_load(filter);
    }
    seccomp_release(filter);
    return result;
}

/* Returns whether all rights are gone; if not, that was said. */
static bool give_rights_away(pid_t parent)
{
    const struct rlimit descriptors = {DESCRIPTORS_MAX, DESCRIPTORS_MAX}, none = {0, 0};
    const struct passwd *entry = self.user[0] == '\0' ? NULL : getpwnam(self.user);
    int result;

    if (setrlimit(RLIMIT_NOFILE, &descriptors) < 0 || setrlimit(RLIMIT_CORE, &none) < 0 ||
        prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) < 0) {
        log_error("can't limit what the web server may do: %s", strerror(errno));
        return false;
    }
    capng_clear(CAPNG_SELECT_BOTH);
    if (self.user[0] != '\0' &&
        (entry == NULL ||
         capng_change_id((int)entry->pw_uid, (int)entry->pw_gid,
                         CAPNG_INIT_SUPP_GRP | CAPNG_CLEAR_BOUNDING | CAPNG_CLEAR_AMBIENT) < 0)) {
        log_error("can't become user \"%s\"%s", self.user,
                  entry == NULL ? ": there is no such user" : "");
        return false;
    }
    /* After the change of user, which clears it; the filter keeps it. And the parent may be gone by
     * now. */
    if (prctl(PR_SET_PDEATHSIG, SIGKILL) < 0 || getppid() != parent) {
        return false;
    }
    result = enter_http_filter();
    if (result < 0) {
        log_error("can't enter the system-call filter: %s", strerror(-result));
        return false;
    }
    return true;
}

/* Never returns. */
static void serve_http(pid_t parent)
{
    if (!give_rights_away(parent)) {
        _exit(EXIT_FAILURE);
    }
    log_error("the web server can't go on: %s", strerror(-web_server_run(&self.server)));
    _exit(EXIT_FAILURE);
}

/* ---- start ---- */

static int run_halves(void)
{
    int ends[2], status = 0;
    pid_t parent = getpid(), child;

    self.server.places = &self.places;
    self.server.listener = open_listener();
    if (self.server.listener < 0) {
        return EXIT_FAILURE;
    }
    if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) < 0) {
        log_error("no socket between the two halves: %s", strerror(errno));
        return EXIT_FAILURE;
    }
    signal(SIGPIPE, SIG_IGN);
    child = fork();
    if (child < 0) {
        log_error("no second process: %s", strerror(errno));
        return EXIT_FAILURE;
    }
    if (child == 0) {
        close(ends[0]);
        self.server.helper = ends[1];
        serve_http(parent);
    }
    close(ends[1]);
    close(self.server.listener);
    log_info("the technician's page is served on %s", self.listen);
    web_helper_serve(ends[0], &self.places);
    kill(child, SIGKILL);
    if (waitpid(child, &status, 0) == child) {
        log_error("the web server ended (%s %d)", WIFSIGNALED(status) ? "signal" : "exit code",
                  WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
    }
    return EXIT_FAILURE;
}

int main(int argc, char *argv[])
{
    enum { LISTEN = 1, USER, ROOT, HELP, VERSION, FLAGS };
    static const struct option flags[] = {
        {"listen", required_argument, NULL, LISTEN}, {"user", required_argument, NULL, USER},
        {"root", required_argument, NULL, ROOT},     {"help", no_argument, NULL, HELP},
        {"version", no_argument, NULL, VERSION},     {NULL, 0, NULL, 0},
    };
    const char **const targets[FLAGS] = {
        [LISTEN] = &self.listen,
        [USER] = &self.user,
        [ROOT] = &self.root,
    };
    int flag;

    while ((flag = getopt_long_only(argc, argv, "", flags, NULL)) != -1) {
        if (flag == HELP || flag == VERSION) {
            fputs(flag == HELP ? usage : "odid-web " ODID_VERSION "\n", stdout);
            return EXIT_SUCCESS;
        }
        if (flag == '?') {
            return 2; /* getopt said what is wrong */
        }
        *targets[flag] = optarg;
    }
    if (optind < argc) {
        fprintf(stderr, "odid-web: \"%s\" is no option\n\n%s", argv[optind], usage);
        return 2;
    }
    places_under(&self.places, self.root);
    return run_halves();
}
