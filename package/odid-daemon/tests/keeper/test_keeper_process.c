/*
 * The program odid-keeper, from beside this test, with this test as its
 * "daemon": what a process does to it, and it to a process. Times are a tenth
 * of the real ones where nothing else is said.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alive.h"
#include "base/sandbox.h"
#include "fake_hostapd.h"
#include "loop_until.h"
#include "mavlink/link_socket.h"

#define BEAT_US 100000
#define DAEMON_S 120

/* ---- as the daemon ---- */

/* Notes "MODE WORDS" in DIRECTORY/started, a line for each start. */
static unsigned note_start(const char *directory, const char *mode, bool log_mode)
{
    char path[64], line[64];
    int fd;
    struct stat status;

    snprintf(path, sizeof(path), "%s/started", directory);
    fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    snprintf(line, sizeof(line), "%6d %-12s%-12s\n", (int)getpid(), mode,
             log_mode ? "-seccomp-log" : "");
    if (fd < 0 || write(fd, line, strlen(line)) < 0 || fstat(fd, &status) < 0) {
        exit(98);
    }
    close(fd);
    return (unsigned)((size_t)status.st_size / strlen(line));
}

static int spoken; /* DIRECTORY/spoken: empty before its first sign of life */

static void note_spoken(void)
{
    if (write(spoken, "x", 1) != 1) {
        exit(94);
    }
}

static void beat(void)
{
    const char *number = getenv(ALIVE_VARIABLE);

    for (int i = 0; i < DAEMON_S * 1000000 / BEAT_US; i++) {
        if (number == NULL || write(atoi(number), "a", 1) != 1) {
            exit(97);
        }
        if (i == 0) {
            note_spoken();
        }
        usleep(BEAT_US);
    }
    exit(96);
}

static void on_terminate(int number)
{
    (void)number;
    _exit(0);
}

/* -config FILE DIRECTORY MODE, behind -seccomp-log where the keeper put it. */
static int be_daemon(int argc, char *argv[])
{
    bool log_mode = strcmp(argv[1], "-seccomp-log") == 0;
    const char *mode = argv[argc - 1];
    char path[64];
    unsigned started;

    if (argc != 5 + log_mode) {
        return 99;
    }
    alarm(DAEMON_S); /* none is left over, whatever happens */
    started = note_start(argv[argc - 2], mode, log_mode);
    snprintf(path, sizeof(path), "%s/spoken", argv[argc - 2]);
    spoken = open(path, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    if (strcmp(mode, "filtered") == 0 && !log_mode) {
        signal(SIGSYS, SIG_DFL); /* the sanitizer's is none of the daemon's */
        raise(SIGSYS);
    } else if (strcmp(mode, "hangs once") == 0 && started == 1) {
        pause();
    } else if (strcmp(mode, "hangs") == 0) {
        pause();
    } else if (strcmp(mode, "fails") == 0) {
        return 3;
    } else if (strcmp(mode, "speaks once") == 0) {
        return write(atoi(getenv(ALIVE_VARIABLE)), "a", 1) == 1 ? 3 : 97;
    } else if (strcmp(mode, "floods") == 0 && started == 1) {
        static char alive[65536];

        note_spoken();
        while (write(atoi(getenv(ALIVE_VARIABLE)), alive, sizeof(alive)) > 0 || errno == EAGAIN) {
        }
        pause(); /* nobody listens any more */
    } else if (strcmp(mode, "obeys") == 0) {
        signal(SIGTERM, on_terminate);
    } else if (strcmp(mode, "stubborn") == 0) {
        signal(SIGTERM, SIG_IGN);
    } else if (strcmp(mode, "sandboxed") == 0) {
        alive_open();
        if (loop_init() < 0 || sandbox_enter("nobody", false) < 0) {
            return 95;
        }
        alive_start(loop_now_us());
        run_ms(50);
        note_spoken();
        run_ms(DAEMON_S * 1000);
    }
    beat();
    return 0;
}

/* ---- the keeper around it ---- */

static char directory[32], faults[48], config[48], log_path[48];
static struct fake_hostapd hostapd;
static pid_t keeper;
static int keeper_status;

static void read_text(const char *path, char *text, size_t size)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC);
    ssize_t length = fd < 0 ? -1 : read(fd, text, size - 1);

    text[length < 0 ? 0 : length] = '\0';
    if (fd >= 0) {
        close(fd);
    }
}

static bool log_has(const char *words)
{
    static char text[65536];

    read_text(log_path, text, sizeof(text));
    return strstr(text, words) != NULL;
}

/* How often the daemon was started, and the last one's process. */
static unsigned starts(pid_t *last)
{
    char path[64], text[8192];
    unsigned count = 0;

    snprintf(path, sizeof(path), "%s/started", directory);
    read_text(path, text, sizeof(text));
    for (const char *line = text; strchr(line, '\n') != NULL; line = strchr(line, '\n') + 1) {
        count++;
        if (last != NULL) {
            *last = atoi(line);
        }
    }
    return count;
}

static void fault_text(char *text, size_t size)
{
    char path[64];

    snprintf(path, sizeof(path), "%s/odid-daemon", faults);
    read_text(path, text, size);
}

static bool fault_says(const char *words)
{
    char text[512];

    fault_text(text, sizeof(text));
    return strstr(text, words) != NULL;
}

static bool no_fault(void)
{
    char text[512];

    fault_text(text, sizeof(text));
    return text[0] == '\0';
}

static void make_files(void)
{
    int fd;

    snprintf(directory, sizeof(directory), "/tmp/odid-keeper-XXXXXX");
    assert_non_null(mkdtemp(directory));
    chmod(directory, 0755);
    snprintf(faults, sizeof(faults), "%s/faults", directory);
    snprintf(log_path, sizeof(log_path), "%s/log", directory);
    snprintf(config, sizeof(config), "%s/odid.conf", directory);
    assert_int_equal(mkdir(faults, 0755), 0);
    fd = open(config, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    assert_true(fd >= 0);
    dprintf(fd, "[broadcast]\nbt4_enabled = false\nbt5_enabled = false\nhostapd_dir = %s\n",
            hostapd.directory);
    close(fd);
}

static int set_up(void **state)
{
    (void)state;
    keeper = 0;
    if (geteuid() != 0) {
        print_message("skipped: the keeper is root's\n");
        skip();
    }
    fake_hostapd_start(&hostapd);
    make_files();
    return 0;
}

static bool keeper_ended(void)
{
    if (keeper > 0 && waitpid(keeper, &keeper_status, WNOHANG) == keeper) {
        keeper = 0;
    }
    return keeper == 0;
}

static int tear_down(void **state)
{
    static const char *const files[] = {"started", "spoken", "log", "odid.conf",
                                        "faults/odid-daemon"};
    char path[64];
    pid_t last = 0;

    (void)state;
    if (keeper > 0) {
        kill(keeper, SIGKILL);
        waitpid(keeper, NULL, 0);
        snprintf(path, sizeof(path), "%s/.odid-daemon", faults);
        unlink(path); /* we may have killed it while it wrote a fault */
    }
    /* Its daemon should have gone with it; else, it is our child now. */
    if (starts(&last) > 0 && waitpid(last, NULL, WNOHANG) == 0) {
        kill(last, SIGKILL);
    }
    while (waitpid(-1, NULL, 0) > 0) {
    }
    for (size_t i = 0; i < sizeof(files) / sizeof(files[0]); i++) {
        snprintf(path, sizeof(path), "%s/%s", directory, files[i]);
        unlink(path);
    }
    rmdir(faults); /* unless the test did */
    if (rmdir(directory) < 0) {
        print_error("the keeper left something behind in %s\n", directory);
        return -1;
    }
    return fake_hostapd_end(&hostapd) ? 0 : -1;
}

static void run_keeper(const char *mode, const char *silent_s, const char *off_air_s)
{
    char self[256] = "", own[256], beside[300];
    ssize_t length = readlink("/proc/self/exe", self, sizeof(self) - 1);
    int log;

    assert_true(length > 0);
    snprintf(own, sizeof(own), "%s", self);
    snprintf(beside, sizeof(beside), "%s/odid-keeper", dirname(own));
    keeper = fork();
    assert_true(keeper >= 0);
    if (keeper == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        log = open(log_path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
        dup2(log, STDERR_FILENO);
        close_range(STDERR_FILENO + 1, ~0U, 0); /* whatever this test was started with */
        execl(beside, "odid-keeper", "-silent-s", silent_s, "-off-air-s", off_air_s, "-faults",
              faults, "--", self, "-config", config, directory, mode, (char *)NULL);
        _exit(1);
    }
}

/* Whoever runs now has given its first sign of life, and is what it wanted to be. */
static bool has_spoken(void)
{
    char path[64], text[8];

    snprintf(path, sizeof(path), "%s/spoken", directory);
    read_text(path, text, sizeof(text));
    return text[0] != '\0';
}

static bool twice(void)
{
    return starts(NULL) >= 2;
}

/* Runs the keeper until the daemon was started and has spoken. */
static pid_t run_until_alive(const char *mode, const char *silent_s, const char *off_air_s)
{
    pid_t pid = 0;

    run_keeper(mode, silent_s, off_air_s);
    assert_true(loop_until(has_spoken, 5000));
    assert_int_equal(starts(&pid), 1);
    assert_int_equal(kill(pid, 0), 0);
    return pid;
}

static unsigned keeper_files(void)
{
    char path[64];
    unsigned count = 0;
    DIR *list;

    snprintf(path, sizeof(path), "/proc/%d/fd", (int)keeper);
    list = opendir(path);
    assert_non_null(list);
    while (readdir(list) != NULL) {
        count++;
    }
    closedir(list);
    return count;
}

static unsigned files_before;

static bool nothing_is_left_open(void)
{
    return keeper_files() == files_before;
}

/* ---- death and silence ---- */

static void a_killed_daemon_is_back_at_once(void **state)
{
    static const int signals[] = {SIGKILL, SIGSEGV};
    int64_t start_us;
    pid_t pid, next;

    (void)state;
    pid = run_until_alive("lives", "5", "30");
    files_before = keeper_files();
    for (unsigned i = 0; i < 2; i++) {
        run_ms(1100); /* not "at once" any more */
        start_us = loop_now_us();
        kill(pid, signals[i]);
        while (starts(&next) < 2 + i && loop_now_us() - start_us < PATIENCE_MS * 1000) {
            run_ms(1);
        }
        assert_true(in_time(loop_now_us() - start_us, 0, 500000));
        assert_int_not_equal(next, pid);
        pid = next;
    }
    assert_true(loop_until(no_fault, 1500));
    assert_true(log_has("was ended by signal 9"));
    assert_true(loop_until(nothing_is_left_open, 1000)); /* of the dead */
}

/* The fault itself is over as soon as the next one lives, seen by us or not. */
static bool log_tells_silence(void)
{
    return log_has("gave no sign of life for 0.5 s");
}

static void a_stopped_daemon_is_killed_and_back(void **state)
{
    int64_t start_us;
    pid_t pid = run_until_alive("lives", "0.5", "5");

    (void)state;
    start_us = loop_now_us();
    kill(pid, SIGSTOP);
    assert_true(loop_until(log_tells_silence, 3000));
    assert_true(loop_until(twice, 3000));
    assert_true(in_time(loop_now_us() - start_us, 350000, 900000));
    assert_int_equal(kill(pid, 0), -1);
    assert_true(loop_until(no_fault, 1500));
    assert_false(log_has("was ended by signal 9")); /* that was us */
}

static void one_that_never_speaks_is_killed(void **state)
{
    (void)state;
    run_keeper("hangs once", "1.5", "30");
    assert_true(loop_until(twice, 3000));
    assert_true(loop_until(no_fault, 1500));
    run_ms(800);
    assert_int_equal(starts(NULL), 2);
}

static void one_that_hangs_again_and_again_stays_a_fault(void **state)
{
    (void)state;
    run_keeper("hangs", "0.3", "5");
    assert_true(loop_until(twice, 3000));
    assert_true(fault_says("gave no sign of life for 0.3 s"));
}

static bool four_times(void)
{
    return starts(NULL) >= 4;
}

static void one_that_ends_by_itself_is_started_once_a_second(void **state)
{
    int64_t start_us = loop_now_us();

    (void)state;
    run_keeper("fails", "30", "60"); /* however long it takes to end */
    assert_true(loop_until(four_times, 3000));
    /* At once, then once a second. */
    assert_true(loop_now_us() - start_us >= 2000000);
    assert_true(fault_says("ended with exit code 3"));
}

/* It would take all of the keeper's time, which is bounded, and be left without one. */
static void one_that_says_so_without_end_is_not_listened_to(void **state)
{
    (void)state;
    run_keeper("floods", "0.5", "100");
    assert_true(loop_until(twice, 10000));
    assert_false(keeper_ended());
}

/* Its bytes wait in the pipe while the keeper doesn't run. */
static void a_late_keeper_does_not_mistake_its_own_silence(void **state)
{
    pid_t pid = run_until_alive("lives", "1.5", "15");

    (void)state;
    kill(keeper, SIGSTOP);
    run_ms(2000);
    kill(keeper, SIGCONT);
    run_ms(300);
    assert_int_equal(starts(NULL), 1);
    assert_int_equal(kill(pid, 0), 0);
}

static void two_deaths_by_the_filter_start_it_in_log_mode(void **state)
{
    char path[64], text[512];

    (void)state;
    run_keeper("filtered", "5", "30");
    while (starts(NULL) < 3 && !keeper_ended()) {
        run_ms(10);
    }
    run_ms(700);
    assert_int_equal(starts(NULL), 3);
    snprintf(path, sizeof(path), "%s/started", directory);
    read_text(path, text, sizeof(text));
    assert_non_null(strstr(text, "-seccomp-log"));
    assert_true(strstr(text, "-seccomp-log") > strrchr(text, ' ') - 40); /* the last one only */
    assert_true(log_has("two deaths by the system-call filter"));
}

/* ---- the payload ---- */

static bool element_is_gone(void)
{
    return hostapd.updates > 0 && hostapd.beacon[0] == '\0';
}

static bool fault_tells_off_air(void)
{
    return fault_says("its last payload was taken off the air: wlan0.");
}

static bool log_tells_off_air(void)
{
    return log_has("its last payload was taken off the air: wlan0.");
}

static void the_payload_of_one_that_does_not_come_back_is_taken_off(void **state)
{
    int64_t start_us;

    (void)state;
    fake_hostapd_has(&hostapd, "dd05fa0bbc0d01");
    start_us = loop_now_us();
    run_keeper("hangs", "0.4", "0.6");
    assert_true(loop_until(element_is_gone, 2000));
    assert_true(loop_now_us() - start_us >= 600000);
    assert_true(loop_until(log_tells_off_air, 1000));
    assert_true(loop_until(four_times, 3000));
    assert_int_equal(hostapd.updates, 1); /* once */
    assert_true(fault_tells_off_air());   /* whatever happened since */
}

static void the_fault_stays_until_the_daemon_is_alive(void **state)
{
    (void)state;
    run_keeper("hangs once", "0.8", "0.3");
    assert_true(loop_until(log_tells_off_air, 2000));
    assert_true(loop_until(twice, 2000));
    assert_true(loop_until(no_fault, 1500));
}

/* Its one sign of life was taken for life: the fault came and went, and the payload stayed. */
static void one_that_dies_when_it_has_spoken_once_is_silent(void **state)
{
    (void)state;
    run_keeper("speaks once", "0.5", "1.5");
    assert_true(loop_until(fault_tells_off_air, 3000));
    assert_true(loop_until(four_times, 4000));
    assert_int_equal(hostapd.updates, 1);
    assert_true(fault_tells_off_air());
    assert_false(log_has("alive again"));
}

/* In a container the folder around it is a memory file system of its own. */
static void a_list_of_faults_is_made(void **state)
{
    (void)state;
    rmdir(faults);
    run_keeper("speaks once", "0.5", "1.5");
    assert_true(loop_until(fault_tells_off_air, 3000));
}

static void without_a_list_of_faults_nothing_is_wrong(void **state)
{
    (void)state;
    rmdir(faults);
    snprintf(faults, sizeof(faults), "%s/none/faults", directory);
    run_keeper("hangs once", "0.3", "5");
    assert_true(loop_until(twice, 3000));
    run_ms(300);
    assert_false(log_has("can't write to"));
    assert_false(keeper_ended());
}

/* ---- what is passed on ---- */

static unsigned long signal_bits(const char *status, const char *name)
{
    const char *line = strstr(status, name);

    assert_non_null(line);
    return strtoul(line + strlen(name), NULL, 16);
}

static void the_daemon_has_nothing_of_the_keepers_but_its_pipe(void **state)
{
    char path[64], link[64], target[64], status[4096];
    unsigned others = 0, pipes = 0;
    struct dirent *entry;
    DIR *list;
    pid_t pid = run_until_alive("lives", "5", "30");

    (void)state;
    snprintf(path, sizeof(path), "/proc/%d/fd", (int)pid);
    list = opendir(path);
    assert_non_null(list);
    while ((entry = readdir(list)) != NULL) {
        ssize_t length;

        if (entry->d_name[0] == '.' || atoi(entry->d_name) <= STDERR_FILENO) {
            continue;
        }
        snprintf(link, sizeof(link), "/proc/%d/fd/%.16s", (int)pid, entry->d_name);
        length = readlink(link, target, sizeof(target) - 1);
        target[length < 0 ? 0 : length] = '\0';
        pipes += strncmp(target, "pipe:", 5) == 0;
        others += strncmp(target, "anon_inode:", 11) == 0 || strncmp(target, "socket:", 7) == 0;
    }
    closedir(list);
    assert_int_equal(others, 0);
    assert_int_equal(pipes, 1);
    snprintf(path, sizeof(path), "/proc/%d/status", (int)pid);
    read_text(path, status, sizeof(status));
    assert_int_equal(signal_bits(status, "SigBlk:"), 0);
    assert_int_equal(signal_bits(status, "SigIgn:") & 1UL << (SIGPIPE - 1), 0);
}

/* ---- the autopilot's port ---- */

/* Where the process's descriptor leads, by the number in its environment; empty: it has none. */
static void handed_down(pid_t pid, char *target, size_t size)
{
    char path[64], variables[8192];
    int fd;
    ssize_t length;

    snprintf(path, sizeof(path), "/proc/%d/environ", (int)pid);
    fd = open(path, O_RDONLY | O_CLOEXEC);
    length = fd < 0 ? -1 : read(fd, variables, sizeof(variables) - 1);
    close(fd);
    assert_true(length >= 0);
    variables[length] = '\0';
    target[0] = '\0';
    for (const char *at = variables; at < variables + length; at += strlen(at) + 1) {
        if (strncmp(at, LINK_SOCKET_VARIABLE "=", strlen(LINK_SOCKET_VARIABLE "=")) == 0) {
            snprintf(path, sizeof(path), "/proc/%d/fd/%.8s", (int)pid, strchr(at, '=') + 1);
            length = readlink(path, target, size - 1);
            target[length < 0 ? 0 : length] = '\0';
        }
    }
}

/* Whoever took it between two daemons silenced the second one for good; and whatever the first one
 * did to its socket isn't the second one's. */
static void the_port_stays_taken_between_two_daemons(void **state)
{
    char first[64], second[64];
    struct config udp;
    int fd;
    pid_t pid;

    (void)state;
    config_defaults(&udp);
    udp.source = MAVLINK_SOURCE_UDP;
    udp.udp_port = (uint16_t)(20000 + getpid() % 10000);
    fd = open(config, O_WRONLY | O_APPEND | O_CLOEXEC);
    dprintf(fd, "[mavlink]\nsource = udp\nudp_port = %u\n", udp.udp_port);
    close(fd);
    pid = run_until_alive("lives", "5", "30");
    handed_down(pid, first, sizeof(first));
    assert_int_equal(strncmp(first, "socket:", 7), 0);
    kill(keeper, SIGSTOP); /* it can't start the next one meanwhile */
    kill(pid, SIGKILL);
    usleep(50000);
    assert_int_equal(link_socket_open(&udp), -EADDRINUSE);
    kill(keeper, SIGCONT);
    for (int tries = 0; !twice() && tries < PATIENCE_MS; tries++) {
        usleep(1000);
    }
    assert_true(twice());
    starts(&pid);
    handed_down(pid, second, sizeof(second));
    assert_int_equal(strncmp(second, "socket:", 7), 0);
    assert_string_not_equal(first, second);
    assert_int_equal(link_socket_open(&udp), -EADDRINUSE);
}

/* ---- the end ---- */

static void told_to_end_it_ends_the_daemon_in_order(void **state)
{
    pid_t pid = run_until_alive("obeys", "5", "30");

    (void)state;
    kill(keeper, SIGTERM);
    assert_true(loop_until(keeper_ended, 400));
    assert_true(WIFEXITED(keeper_status));
    assert_int_equal(WEXITSTATUS(keeper_status), 0);
    assert_int_equal(kill(pid, 0), -1);
    assert_int_equal(starts(NULL), 1);
    assert_int_equal(hostapd.updates, 0); /* the daemon's own business */
    assert_true(no_fault());
}

static void one_that_does_not_end_is_ended_and_taken_off_the_air(void **state)
{
    pid_t pid = run_until_alive("stubborn", "0.5", "5");

    (void)state;
    kill(keeper, SIGTERM);
    assert_true(loop_until(keeper_ended, 2000));
    assert_int_equal(WEXITSTATUS(keeper_status), 0);
    assert_int_equal(kill(pid, 0), -1);
    assert_int_equal(hostapd.updates, 1);
}

static pid_t orphan;
static int orphan_status;

static bool orphan_ended(void)
{
    return waitpid(orphan, &orphan_status, WNOHANG) == orphan; /* it became ours */
}

static void no_daemon_is_left_behind(const char *mode)
{
    orphan = run_until_alive(mode, "3", "5");
    kill(keeper, SIGKILL);
    assert_true(loop_until(keeper_ended, 1000));
    assert_true(loop_until(orphan_ended, 1000));
    assert_true(WIFSIGNALED(orphan_status));
    assert_int_equal(WTERMSIG(orphan_status), SIGKILL);
}

static void a_killed_keeper_leaves_no_daemon_behind(void **state)
{
    (void)state;
    no_daemon_is_left_behind("lives");
}

/* The kernel forgets the wish when a process changes its user. */
static void nor_one_that_became_another_user(void **state)
{
    (void)state;
    no_daemon_is_left_behind("sandboxed");
}

int main(int argc, char *argv[])
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_killed_daemon_is_back_at_once),
        TEST(a_stopped_daemon_is_killed_and_back),
        TEST(one_that_never_speaks_is_killed),
        TEST(one_that_hangs_again_and_again_stays_a_fault),
        TEST(one_that_ends_by_itself_is_started_once_a_second),
        TEST(one_that_says_so_without_end_is_not_listened_to),
        TEST(a_late_keeper_does_not_mistake_its_own_silence),
        TEST(two_deaths_by_the_filter_start_it_in_log_mode),
        TEST(the_payload_of_one_that_does_not_come_back_is_taken_off),
        TEST(the_fault_stays_until_the_daemon_is_alive),
        TEST(one_that_dies_when_it_has_spoken_once_is_silent),
        TEST(a_list_of_faults_is_made),
        TEST(without_a_list_of_faults_nothing_is_wrong),
        TEST(the_daemon_has_nothing_of_the_keepers_but_its_pipe),
        TEST(the_port_stays_taken_between_two_daemons),
        TEST(told_to_end_it_ends_the_daemon_in_order),
        TEST(one_that_does_not_end_is_ended_and_taken_off_the_air),
        TEST(a_killed_keeper_leaves_no_daemon_behind),
        TEST(nor_one_that_became_another_user),
    };

    if (argc > 1) {
        return be_daemon(argc, argv);
    }
    /* Orphans become ours, whatever init does with them. */
    if (loop_init() < 0 || prctl(PR_SET_CHILD_SUBREAPER, 1) < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
