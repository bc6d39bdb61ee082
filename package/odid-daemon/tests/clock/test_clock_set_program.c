/*
 * The program odid-clock, from beside this test, against a status socket that
 * is played. This machine's clock is never changed: with -dry-run, or with a
 * status that tells the time that it is.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <libgen.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "own_folder.h"
#include "patience.h"

#define SAVED "data/clock"
#define RELEASE "etc/odid-release"
#define SOCKET "run/odid/status.sock"

static int listener;

static void write_release(const char *text)
{
    int fd = open(RELEASE, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);

    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
}

static int set_up(void **state)
{
    struct sockaddr_un address = {.sun_family = AF_UNIX, .sun_path = SOCKET};

    (void)state;
    if (system("rm -rf data etc log run && mkdir -p data etc run/odid") != 0) {
        return -1;
    }
    write_release("BUILD_TIME=1795255200\n");
    listener = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    return bind(listener, (struct sockaddr *)&address, sizeof(address)) < 0 ||
           listen(listener, 4) < 0;
}

static int tear_down(void **state)
{
    (void)state;
    return close(listener);
}

static pid_t run_clock(const char *mode)
{
    char self[256] = "", path[300];
    pid_t pid = fork();
    int log;

    assert_true(pid >= 0);
    if (pid == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        signal(SIGPIPE, SIG_DFL);
        log = open("log", O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
        dup2(log, STDERR_FILENO);
        if (readlink("/proc/self/exe", self, sizeof(self) - 1) > 0) {
            snprintf(path, sizeof(path), "%s/odid-clock", dirname(self));
            execl(path, "odid-clock", "-root", ".", mode, mode == NULL ? NULL : "-dry-run",
                  (char *)NULL);
        }
        _exit(99);
    }
    return pid;
}

static bool log_has(const char *words)
{
    char text[4096] = "";
    int fd = open("log", O_RDONLY | O_CLOEXEC);

    if (fd >= 0) {
        if (read(fd, text, sizeof(text) - 1) < 0) {
            text[0] = '\0';
        }
        close(fd);
    }
    return strstr(text, words) != NULL;
}

/* Answers whoever asks next, so many times, with that time; 0: with none. */
static void answer(unsigned times, time_t seconds)
{
    char status[128], utc[32];
    struct tm parts;
    struct pollfd asked = {.fd = listener, .events = POLLIN};

    for (unsigned i = 0; i < times; i++) {
        time_t told = seconds == -1 ? time(NULL) : seconds;
        int fd;

        assert_int_equal(poll(&asked, 1, PATIENCE_MS), 1);
        fd = accept4(listener, NULL, NULL, SOCK_CLOEXEC);
        assert_true(fd >= 0);
        strftime(utc, sizeof(utc), "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&told, &parts));
        snprintf(status, sizeof(status), "{\"time\": {\"known\": %s, \"utc\": \"%s\"}}",
                 seconds != 0 ? "true" : "false", utc);
        assert_true(send(fd, status, strlen(status), MSG_NOSIGNAL) > 0);
        close(fd);
    }
}

/*
 * Until it waits for signals: one that comes before ends it in no order. What is waited for isn't
 * seen in SigBlk; that SIGPIPE is ignored, which it does next, is seen in SigIgn.
 */
static void until_it_serves(pid_t pid)
{
    char path[64], text[4096] = "";

    snprintf(path, sizeof(path), "/proc/%d/status", (int)pid);
    for (int tries = 0; tries < PATIENCE_MS; tries++) {
        int fd = open(path, O_RDONLY | O_CLOEXEC);
        ssize_t length = fd < 0 ? -1 : read(fd, text, sizeof(text) - 1);
        const char *ignored;

        close(fd);
        assert_true(length > 0);
        text[length] = '\0';
        ignored = strstr(text, "SigIgn:");
        if (ignored != NULL &&
            strtoull(ignored + strlen("SigIgn:"), NULL, 16) & 1ULL << (SIGPIPE - 1)) {
            return;
        }
        usleep(1000);
    }
    fail_msg("it never waited for signals: %s", text);
}

static int ended(pid_t pid)
{
    int status;

    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static int end(pid_t pid)
{
    until_it_serves(pid);
    kill(pid, SIGTERM);
    return ended(pid);
}

static void save(time_t seconds)
{
    const struct timespec times[2] = {{.tv_sec = seconds}, {.tv_sec = seconds}};
    int fd = open(SAVED, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);

    assert_true(fd >= 0);
    assert_int_equal(futimens(fd, times), 0);
    close(fd);
}

static void at_boot_it_starts_with_the_later_of_build_and_saved(void **state)
{
    (void)state;
    assert_int_equal(ended(run_clock("-boot")), 0);
    assert_true(log_has("would be set to 2026-11-21 10:00:00 UTC, the build's time"));
    save(1795255200 - 3600);
    assert_int_equal(ended(run_clock("-boot")), 0);
    assert_true(log_has("would be set to 2026-11-21 10:00:00 UTC, the build's time"));
    save(1795255200 + 3600);
    assert_int_equal(ended(run_clock("-boot")), 0);
    assert_true(log_has("would be set to 2026-11-21 11:00:00 UTC, the last saved time"));
}

static void at_boot_with_nothing_known_it_says_so(void **state)
{
    (void)state;
    write_release("NAME=x\n");
    assert_int_equal(ended(run_clock("-boot")), 1);
    assert_true(log_has("no line BUILD_TIME="));
    assert_true(log_has("neither the time of the build nor a saved time is known"));
}

static void the_autopilots_time_sets_it(void **state)
{
    pid_t pid = run_clock("-dry-run");

    (void)state;
    answer(2, 0); /* it asks again when it is through with the first one */
    assert_false(log_has("the clock"));
    answer(1, 1795255200 + 86400);
    assert_int_equal(end(pid), 0);
    assert_true(log_has("the clock would be set to 2026-11-22 10:00:00 UTC, the autopilot's time"));
}

static void an_autopilots_time_before_the_build_is_told_and_not_used(void **state)
{
    pid_t pid = run_clock("-dry-run");

    (void)state;
    answer(1, 1600000000); /* 2020 */
    assert_int_equal(end(pid), 0);
    assert_true(log_has("is before this system was built"));
    assert_false(log_has("the clock would"));
}

static void without_a_daemon_it_waits(void **state)
{
    pid_t pid;

    (void)state;
    unlink(SOCKET);
    pid = run_clock("-dry-run");
    until_it_serves(pid);
    usleep(300000); /* it goes on */
    assert_int_equal(end(pid), 0);
    assert_false(log_has("error"));
}

/* For real, with nothing to set; the time is saved at the end. */
static void at_the_end_it_saves_the_time(void **state)
{
    struct stat status;
    pid_t pid;

    (void)state;
    if (geteuid() != 0) {
        print_message("skipped: needs root\n");
        skip();
    }
    write_release("BUILD_TIME=1300000000\n");
    pid = run_clock(NULL);
    answer(1, -1);
    assert_int_equal(stat(SAVED, &status), -1);
    assert_int_equal(end(pid), 0);
    assert_false(log_has("the clock"));
    assert_int_equal(stat(SAVED, &status), 0);
    assert_in_range(status.st_mtime, time(NULL) - 2, time(NULL));
    assert_int_equal(status.st_size, 0);
}

static void a_disk_that_is_gone_is_told(void **state)
{
    pid_t pid;

    (void)state;
    if (geteuid() != 0) {
        print_message("skipped: needs root\n");
        skip();
    }
    assert_int_equal(rmdir("data"), 0);
    write_release("BUILD_TIME=1300000000\n");
    pid = run_clock(NULL);
    answer(1, -1);
    assert_int_equal(end(pid), 0);
    assert_true(log_has("can't save the time to ./data/clock: No such file or directory"));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(at_boot_it_starts_with_the_later_of_build_and_saved),
        TEST(at_boot_with_nothing_known_it_says_so),
        TEST(the_autopilots_time_sets_it),
        TEST(an_autopilots_time_before_the_build_is_told_and_not_used),
        TEST(without_a_daemon_it_waits),
        TEST(at_the_end_it_saves_the_time),
        TEST(a_disk_that_is_gone_is_told),
    };

    return enter_own_folder() < 0 || cmocka_run_group_tests(tests, NULL, leave_own_folder);
}
