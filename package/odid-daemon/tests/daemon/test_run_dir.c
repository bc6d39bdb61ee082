/* What a daemon that was taken over has left where the next one begins. As root. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

#include "daemon/run_dir.h"

#define USER "nobody"

static char folder[] = "/tmp/test_run_dir.XXXXXX", path[64];

static int setup(void **state)
{
    (void)state;
    if (mkdtemp(folder) == NULL || chdir(folder) < 0) {
        return -1;
    }
    snprintf(path, sizeof(path), "%s/run", folder);
    run_dir_prepare(path, USER, true);
    return 0;
}

static int teardown(void **state)
{
    char command[sizeof(folder) + 16];

    (void)state;
    snprintf(command, sizeof(command), "rm -rf %s", folder);
    return chdir("/") < 0 || system(command) != 0 ? -1 : 0;
}

static void left(const char *name, size_t size)
{
    char text[8192] = "";
    int fd = open(name, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);

    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, size), (ssize_t)size);
    close(fd);
}

static void nothing_stays_but_what_is_kept(void **state)
{
    struct stat status;

    (void)state;
    if (geteuid() != 0) {
        print_message("skipped: needs root\n");
        skip();
    }
    left("run/kept", 100);
    left("run/counters", 30);
    left("run/many", 10);
    assert_int_equal(mkdir("run/status.sock", 0700), 0);
    assert_int_equal(mkfifo("run/odid-wlan0", 0600), 0);
    assert_int_equal(symlink("/etc", "run/link"), 0);
    assert_int_equal(chmod("run", 0), 0);
    run_dir_prepare(path, USER, true);
    assert_int_equal(stat("run", &status), 0);
    assert_int_equal(status.st_mode & 07777, 0755);
    assert_int_equal(status.st_uid, getpwnam(USER)->pw_uid);
    assert_int_equal(access("run/kept", F_OK), 0);
    assert_int_equal(access("run/counters", F_OK), 0);
    assert_int_equal(access("run/many", F_OK), -1);
    assert_int_equal(access("run/status.sock", F_OK), -1);
    assert_int_equal(access("run/odid-wlan0", F_OK), -1);
    assert_int_equal(lstat("run/link", &status), -1);
    assert_int_equal(access("/etc/passwd", F_OK), 0);
}

static void what_is_kept_is_a_short_file(void **state)
{
    (void)state;
    if (geteuid() != 0) {
        print_message("skipped: needs root\n");
        skip();
    }
    left("run/kept", 5000);
    unlink("run/counters");
    assert_int_equal(mkfifo("run/counters", 0600), 0);
    run_dir_prepare(path, USER, true);
    assert_int_equal(access("run/kept", F_OK), -1);
    assert_int_equal(access("run/counters", F_OK), -1);
}

/* Elsewhere run_dir is what somebody has written into the configuration: it may be anything. */
static void what_may_be_somebody_else_s_stays_as_it_is(void **state)
{
    struct stat status;

    (void)state;
    left("run/many", 10);
    assert_int_equal(chmod("run", 01777), 0);
    run_dir_prepare(path, USER, false);
    assert_int_equal(access("run/many", F_OK), 0);
    if (geteuid() == 0) {
        assert_int_equal(chown("run", 0, 0), 0);
        run_dir_prepare(path, USER, true);
        assert_int_equal(access("run/many", F_OK), 0);
    }
    assert_int_equal(stat("run", &status), 0);
    assert_int_equal(status.st_mode & 07777, 01777);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_stays_but_what_is_kept),
        cmocka_unit_test(what_is_kept_is_a_short_file),
        cmocka_unit_test(what_may_be_somebody_else_s_stays_as_it_is),
    };

    return cmocka_run_group_tests_name("run_dir", tests, setup, teardown);
}
