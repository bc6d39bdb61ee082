/* Privilege: read from /proc as the kernel sees it, and tried. Needs root. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <cap-ng.h>
#include <errno.h>
#include <fcntl.h>
#include <linux/capability.h>
#include <netinet/in.h>
#include <poll.h>
#include <pwd.h>
#include <seccomp.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "appliance/kept.h"
#include "base/sandbox.h"

#define USER "nobody"

/* Not _exit, and not marked as never returning: either makes the sanitizer ask the kernel for more
 * than the filter allows. */
static void leave(int code)
{
    syscall(SYS_exit_group, code);
}

static void need_root(void)
{
    if (geteuid() != 0) {
        print_message("skipped: needs root to change the user\n");
        skip();
    }
}

/* Runs what in a child; returns its wait status. */
static int in_child(void (*what)(void))
{
    int status;
    pid_t child = fork();

    assert_true(child >= 0);
    if (child == 0) {
        what();
        leave(0);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    return status;
}

static struct {
    void (*what)(void);
    bool log_only;
} sandbox;

static void enter_and_do_it(void)
{
    if (sandbox_enter(USER, sandbox.log_only) < 0) {
        leave(99);
    }
    sandbox.what();
}

/* The same in a sandboxed child. */
static int sandboxed(void (*what)(void), bool log_only)
{
    sandbox.what = what;
    sandbox.log_only = log_only;
    return in_child(enter_and_do_it);
}

static void assert_killed_by_filter(int status)
{
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), SIGSYS);
}

static void assert_ended_well(int status)
{
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

static void make_a_directory(void)
{
    syscall(SYS_mkdirat, -100, "/tmp/odid-forbidden", 0700);
}

static void run_a_program(void)
{
    execl("/bin/true", "true", (char *)NULL);
}

static void trace_a_process(void)
{
    syscall(SYS_ptrace, 0, 0, 0, 0);
}

/* Its parent is what its keeper is: on a computer of one's own, of the same user. */
static void signal_its_parent(void)
{
    syscall(SYS_tgkill, getppid(), getppid(), 0);
}

static void have_its_parent_signalled(void)
{
    fcntl(STDIN_FILENO, F_SETOWN, getppid());
}

static void have_its_parent_signalled_by_another_call(void)
{
    int parent = getppid();

    ioctl(STDIN_FILENO, FIOSETOWN, &parent);
}

static void map_executable_memory(void)
{
    syscall(SYS_mmap, NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
}

static void open_a_packet_socket(void)
{
    syscall(SYS_socket, AF_PACKET, SOCK_RAW, 0);
}

/* It gets a copy of all that comes to any port here. */
static void open_a_raw_internet_socket(void)
{
    syscall(SYS_socket, AF_INET, SOCK_RAW | SOCK_CLOEXEC, IPPROTO_TCP);
}

static void open_a_stream(void)
{
    syscall(SYS_socket, AF_INET, SOCK_STREAM, 0);
}

static char folder[] = "/tmp/odid-sandbox-XXXXXX";

/* Each step that fails leaves with its line; one that is forbidden ends with SIGSYS. */
#define MUST(condition)                                                                            \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            leave(__LINE__ & 0x7F ? __LINE__ & 0x7F : 1);                                          \
        }                                                                                          \
    } while (0)

/* hostapd_control's socket and status': bound, connected, listening, accepted, removed. */
static void talk_over_sockets(void)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    int server = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
    int client = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0), accepted;
    char text[4];

    snprintf(address.sun_path, sizeof(address.sun_path), "%s/socket", folder);
    MUST(bind(server, (struct sockaddr *)&address, sizeof(address)) == 0);
    MUST(chmod(address.sun_path, 0660) == 0);
    MUST(listen(server, 1) == 0);
    MUST(connect(client, (struct sockaddr *)&address, sizeof(address)) == 0);
    accepted = accept4(server, NULL, NULL, SOCK_CLOEXEC | SOCK_NONBLOCK);
    MUST(accepted >= 0);
    MUST(send(client, "abc", 4, MSG_NOSIGNAL) == 4);
    MUST(recv(accepted, text, sizeof(text), 0) == 4);
    MUST(close(accepted) == 0 && close(client) == 0 && close(server) == 0);
    MUST(unlink(address.sun_path) == 0);
}

/* A serial port that comes back: opened, set, flushed. */
static void open_a_terminal(void)
{
    struct termios settings;
    int master = open("/dev/ptmx", O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK), unsent;

    MUST(master >= 0);
    MUST(tcgetattr(master, &settings) == 0);
    cfmakeraw(&settings);
    MUST(tcsetattr(master, TCSANOW, &settings) == 0);
    MUST(tcflush(master, TCIOFLUSH) == 0);
    MUST(ioctl(master, TIOCOUTQ, &unsent) == 0);
    MUST(close(master) == 0);
}

/* (What it does with memory, tests/daemon shows: here the sanitizer's allocator stands in.) */
static void do_what_the_daemon_does(void)
{
    struct kept kept = {.vehicle = 1};
    struct timespec now;
    struct tm parts;
    sigset_t none;

    talk_over_sockets();
    open_a_terminal();
    MUST(kept_write(folder, &kept) == 0);
    kept_read(folder, &kept);
    MUST(kept.vehicle == 1);
    MUST(clock_gettime(CLOCK_MONOTONIC, &now) == 0);
    MUST(gmtime_r(&now.tv_sec, &parts) != NULL);
    MUST(poll(NULL, 0, 1) == 0);
    sigemptyset(&none);
    MUST(sigprocmask(SIG_BLOCK, &none, NULL) == 0);
    MUST(open("/no/such/file", O_RDONLY | O_CLOEXEC) < 0);
}

/* What abort() does first (which the sanitizer intercepts): not mistaken for a forbidden call. */
static void give_up(void)
{
    raise(SIGABRT);
}

static void a_forbidden_system_call_ends_the_process(void **state)
{
    (void)state;
    need_root();
    assert_killed_by_filter(sandboxed(make_a_directory, false));
    assert_killed_by_filter(sandboxed(run_a_program, false));
    assert_killed_by_filter(sandboxed(trace_a_process, false));
    assert_killed_by_filter(sandboxed(signal_its_parent, false));
    assert_killed_by_filter(sandboxed(have_its_parent_signalled, false));
    assert_killed_by_filter(sandboxed(have_its_parent_signalled_by_another_call, false));
}

static void executable_memory_and_foreign_sockets_end_it_too(void **state)
{
    (void)state;
    need_root();
    assert_killed_by_filter(sandboxed(map_executable_memory, false));
    assert_killed_by_filter(sandboxed(open_a_packet_socket, false));
    assert_killed_by_filter(sandboxed(open_a_raw_internet_socket, false));
    assert_killed_by_filter(sandboxed(open_a_stream, false));
}

static void what_the_daemon_does_is_allowed(void **state)
{
    char path[sizeof(folder) + 8];
    int status;

    (void)state;
    need_root();
    assert_non_null(mkdtemp(folder));
    assert_int_equal(chmod(folder, 0777), 0);
    assert_ended_well(sandboxed(do_what_the_daemon_does, false));
    snprintf(path, sizeof(path), "%s/kept", folder);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(rmdir(folder), 0); /* nothing else was left in it */
    status = sandboxed(give_up, false);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), SIGABRT);
}

static void in_log_mode_nothing_ends(void **state)
{
    (void)state;
    need_root();
    assert_ended_well(sandboxed(trace_a_process, true));
}

/* ---- log mode, which whoever took the daemon over can bring about ---- */

#define HELD 55

static bool refused(long result)
{
    return result == -1 && errno == EPERM;
}

/* With arguments that a process without the filter would get far with. */
static void break_out(void)
{
    char *const words[] = {(char *)"true", NULL};
    int fd = syscall(SYS_memfd_create, "x", 0);
    char parameters[120] = {0};

    MUST(refused(syscall(SYS_execve, "/bin/true", words, NULL)));
    MUST(refused(syscall(SYS_execveat, AT_FDCWD, "/bin/true", words, NULL, 0)));
    MUST(refused(syscall(SYS_clone, SIGCHLD, 0, 0, 0, 0)));
    MUST(refused(syscall(SYS_ptrace, 0, 0, 0, 0)));
    MUST(refused(syscall(SYS_tgkill, getppid(), getppid(), 0)));
    MUST(refused(syscall(SYS_tgkill, 1L << 32 | getppid(), getppid(), 0)));
    MUST(refused(syscall(SYS_tkill, getppid(), 0)));
    MUST(refused(syscall(SYS_pidfd_send_signal, fd, 0, NULL, 0)));
    MUST(refused(syscall(SYS_fcntl, fd, F_SETOWN, getppid())));
    MUST(refused(syscall(SYS_fcntl, fd, 1L << 32 | F_SETSIG, SIGKILL)));
    MUST(refused(syscall(SYS_ioctl, fd, SIOCSPGRP, parameters)));
    MUST(refused(syscall(SYS_process_vm_readv, getppid(), NULL, 0, NULL, 0, 0)));
    MUST(refused(syscall(SYS_mount, "none", "/mnt", "tmpfs", 0, NULL)));
    MUST(refused(syscall(SYS_umount2, "/nowhere", 0)));
    MUST(refused(syscall(SYS_unshare, 0)));
    MUST(refused(syscall(SYS_chroot, "/")));
    MUST(refused(syscall(SYS_finit_module, fd, "", 0)));
    MUST(refused(syscall(SYS_bpf, 0, NULL, 0)));
    MUST(refused(syscall(SYS_kexec_load, 0, 0, NULL, 0)));
    MUST(refused(syscall(SYS_setuid, getuid())));
    MUST(refused(syscall(SYS_setgroups, 0, NULL)));
    MUST(refused(syscall(SYS_io_uring_setup, 1, parameters)));
    MUST(refused(syscall(SYS_symlinkat, "/etc/passwd", AT_FDCWD, "/tmp/odid-forbidden")));
    MUST(refused(
        syscall(SYS_mmap, NULL, 4096, PROT_READ | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0)));
    MUST(refused(syscall(SYS_socket, AF_PACKET, SOCK_RAW, 0)));
    MUST(refused(syscall(SYS_socket, AF_NETLINK, SOCK_RAW, 0)));
    MUST(refused(syscall(SYS_socket, 1000, SOCK_RAW, 0)));
    MUST(refused(syscall(SYS_socket, AF_INET, SOCK_RAW, IPPROTO_TCP)));
    MUST(refused(syscall(SYS_socket, AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)));
    MUST(syscall(SYS_socket, AF_INET, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0) >= 0);
    leave(HELD);
}

static void in_log_mode_nobody_breaks_out(void **state)
{
    int status;

    (void)state;
    need_root();
    status = sandboxed(break_out, true);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), HELD);
}

/* What nobody thought of is only logged, and what is needed goes on. */
static void in_log_mode_the_daemon_works(void **state)
{
    char path[sizeof(folder) + 8];

    (void)state;
    need_root();
    strcpy(folder + strlen(folder) - 6, "XXXXXX");
    assert_non_null(mkdtemp(folder));
    assert_int_equal(chmod(folder, 0777), 0);
    assert_ended_well(sandboxed(do_what_the_daemon_does, true));
    assert_ended_well(sandboxed(make_a_directory, true));
    rmdir("/tmp/odid-forbidden");
    snprintf(path, sizeof(path), "%s/kept", folder);
    assert_int_equal(unlink(path), 0);
    assert_int_equal(rmdir(folder), 0);
}

/* The value of a line of /proc/<pid>/status, "" when it has none. */
static void status_line(pid_t pid, const char *name, char value[64])
{
    char path[32], line[256];
    FILE *file;

    snprintf(path, sizeof(path), "/proc/%d/status", (int)pid);
    file = fopen(path, "r");
    assert_non_null(file);
    value[0] = '\0';
    while (fgets(line, sizeof(line), file) != NULL) {
        size_t length = strlen(name);

        if (strncmp(line, name, length) == 0 && line[length] == ':') {
            sscanf(line + length + 1, " %63[^\t\n]", value);
        }
    }
    fclose(file);
}

static void assert_line(pid_t pid, const char *name, const char *expected)
{
    char value[64];

    status_line(pid, name, value);
    assert_string_equal(value, expected);
}

static void proc_shows_user_capabilities_no_new_privs_and_filter(void **state)
{
    char uid[16], capabilities[32], byte;
    int ready[2], finish[2];
    pid_t child;

    (void)state;
    need_root();
    assert_int_equal(pipe(ready), 0);
    assert_int_equal(pipe(finish), 0);
    child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        close(finish[1]);
        if (sandbox_enter(USER, false) == 0 && write(ready[1], "r", 1) == 1 &&
            read(finish[0], &byte, 1) == 0) {
            leave(0);
        }
        leave(1);
    }
    close(ready[1]);
    assert_int_equal(read(ready[0], &byte, 1), 1);
    snprintf(uid, sizeof(uid), "%u", getpwnam(USER)->pw_uid);
    snprintf(capabilities, sizeof(capabilities), "%016llx",
             1ULL << CAP_NET_ADMIN | 1ULL << CAP_NET_RAW);
    assert_line(child, "Uid", uid);
    assert_line(child, "CapEff", capabilities);
    assert_line(child, "CapPrm", capabilities);
    assert_line(child, "CapInh", "0000000000000000");
    assert_line(child, "CapBnd", "0000000000000000");
    assert_line(child, "CapAmb", "0000000000000000");
    assert_line(child, "NoNewPrivs", "1");
    assert_line(child, "Seccomp", "2");
    close(finish[1]);
    waitpid(child, NULL, 0);
}

/* As a service manager starts who has User= and AmbientCapabilities=. */
static void be_started_as_user(uint64_t rights)
{
    const struct passwd *entry = getpwnam(USER);

    capng_clear(CAPNG_SELECT_ALL);
    for (unsigned right = 0; right <= CAP_LAST_CAP; right++) {
        if (rights & 1ULL << right) {
            capng_update(CAPNG_ADD, CAPNG_EFFECTIVE | CAPNG_PERMITTED | CAPNG_INHERITABLE, right);
        }
    }
    MUST(capng_change_id((int)entry->pw_uid, (int)entry->pw_gid, CAPNG_DROP_SUPP_GRP) == 0);
    for (unsigned right = 0; right <= CAP_LAST_CAP; right++) {
        if (rights & 1ULL << right) {
            MUST(prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, right, 0, 0) == 0);
        }
    }
}

static pid_t started_as_user(uint64_t rights, int *finish)
{
    int ready[2], ends[2];
    char byte;
    pid_t child;

    assert_int_equal(pipe(ready), 0);
    assert_int_equal(pipe(ends), 0);
    child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        close(ends[1]);
        be_started_as_user(rights);
        MUST(sandbox_enter(USER, false) == 0);
        MUST(write(ready[1], "r", 1) == 1);
        MUST(read(ends[0], &byte, 1) == 0);
        leave(0);
    }
    close(ready[1]);
    close(ends[0]);
    assert_int_equal(read(ready[0], &byte, 1), 1);
    close(ready[0]);
    *finish = ends[1];
    return child;
}

static void who_is_that_user_already_keeps_of_the_two_rights_those_that_it_has(void **state)
{
    const uint64_t raw = 1ULL << CAP_NET_RAW, both = raw | 1ULL << CAP_NET_ADMIN;
    const uint64_t given[] = {raw, both, both | 1ULL << CAP_SYS_TIME};
    const uint64_t kept[] = {raw, both, both};
    char capabilities[20], path[32];
    struct stat file;
    int status;

    (void)state;
    need_root();
    for (int i = 0; i < 3; i++) {
        int finish;
        pid_t child = started_as_user(given[i], &finish);

        snprintf(capabilities, sizeof(capabilities), "%016llx", (unsigned long long)kept[i]);
        assert_line(child, "CapEff", capabilities);
        assert_line(child, "CapPrm", capabilities);
        assert_line(child, "CapAmb", "0000000000000000");
        assert_line(child, "NoNewPrivs", "1");
        assert_line(child, "Seccomp", "2");
        snprintf(path, sizeof(path), "/proc/%d/mem", (int)child);
        assert_int_equal(stat(path, &file), 0);
        assert_int_equal(file.st_uid, 0); /* not that user's to look into */
        close(finish);
        assert_int_equal(waitpid(child, &status, 0), child);
        assert_ended_well(status);
    }
}

static void is_nobody(void)
{
    MUST(geteuid() == getpwnam("nobody")->pw_uid);
}

static void enter_as_a_user_that_there_is_not(void)
{
    MUST(sandbox_enter("no-such-user-here", true) == 0);
    is_nobody();
}

static void enter_as_root_without_being_it(void)
{
    be_started_as_user(1ULL << CAP_NET_RAW);
    MUST(sandbox_enter("root", true) == 0);
    is_nobody();
}

/* By a service manager's filter, or a kernel without. */
static void enter_where_no_filter_is_to_be_had(void)
{
    scmp_filter_ctx filter = seccomp_init(SCMP_ACT_ALLOW);

    MUST(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(seccomp), 0) == 0);
    MUST(seccomp_rule_add(filter, SCMP_ACT_ERRNO(EPERM), SCMP_SYS(prctl), 1,
                          SCMP_A0(SCMP_CMP_EQ, PR_SET_SECCOMP)) == 0);
    MUST(seccomp_load(filter) == 0);
    MUST(sandbox_enter(USER, false) == SANDBOX_NO_FILTER);
    make_a_directory();
}

/* No value of the key `user` keeps it silent. */
static void a_user_that_there_is_not_is_replaced(void **state)
{
    (void)state;
    need_root();
    assert_ended_well(in_child(enter_as_a_user_that_there_is_not));
}

static void who_is_not_root_stays_who_it_is(void **state)
{
    (void)state;
    need_root();
    assert_ended_well(in_child(enter_as_root_without_being_it));
}

static void without_a_filter_it_goes_on(void **state)
{
    int status;

    (void)state;
    need_root();
    status = in_child(enter_where_no_filter_is_to_be_had);
    rmdir("/tmp/odid-forbidden");
    assert_ended_well(status);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_forbidden_system_call_ends_the_process),
        cmocka_unit_test(executable_memory_and_foreign_sockets_end_it_too),
        cmocka_unit_test(what_the_daemon_does_is_allowed),
        cmocka_unit_test(in_log_mode_nothing_ends),
        cmocka_unit_test(in_log_mode_nobody_breaks_out),
        cmocka_unit_test(in_log_mode_the_daemon_works),
        cmocka_unit_test(proc_shows_user_capabilities_no_new_privs_and_filter),
        cmocka_unit_test(who_is_that_user_already_keeps_of_the_two_rights_those_that_it_has),
        cmocka_unit_test(a_user_that_there_is_not_is_replaced),
        cmocka_unit_test(who_is_not_root_stays_who_it_is),
        cmocka_unit_test(without_a_filter_it_goes_on),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
