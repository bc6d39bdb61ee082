/* The environment that the program was started with keeps no secret once it was read. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "daemon/options.h"

/* The program started anew, with this environment, does that and tells by its exit code. */
static int started_with(char *const environment[])
{
    char *const arguments[] = {"test_options", "started", NULL};
    pid_t child = fork();
    int status;

    assert_true(child >= 0);
    if (child == 0) {
        execve("/proc/self/exe", arguments, environment);
        _exit(99);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    return WEXITSTATUS(status);
}

static bool open_to_all(const char *what)
{
    static char environment[65536];
    int fd = open("/proc/self/environ", O_RDONLY | O_CLOEXEC);
    ssize_t length = fd < 0 ? -1 : read(fd, environment, sizeof(environment));

    close(fd);
    return length < 0 || memmem(environment, (size_t)length, what, strlen(what)) != NULL;
}

static int look_inside(void)
{
    char *const arguments[] = {"odid-daemon", "-config", "/dev/null", NULL};
    static struct options options;

    if (!open_to_all("k8-x")) {
        return 10; /* this test couldn't find what it looks for */
    }
    if (!options_read(&options, 3, arguments)) {
        return 11;
    }
    if (strcmp(options.config.operator_id, "FIN87astrdge12k8") != 0) {
        return 12;
    }
    if (open_to_all("k8-x") || open_to_all("-xyz") || open_to_all("xyz")) {
        return 13;
    }
    return open_to_all("OTHER=1") ? 0 : 14;
}

static void no_secret_in_the_environment(void **state)
{
    char *const once[] = {"OTHER=1", "ODID_OPERATOR_ID=FIN87astrdge12k8-xyz", NULL};
    char *const twice[] = {"ODID_OPERATOR_ID=FIN87astrdge12k8-xyz", "OTHER=1",
                           "ODID_OPERATOR_ID=FIN87astrdge12k8-xyz", NULL};
    char *const elsewhere[] = {"ODID_SELF_ID=FIN87astrdge12k8-xyz", "OTHER=1",
                               "ODID_OPERATOR_ID=FIN87astrdge12k8-xyz", NULL};

    (void)state;
    assert_int_equal(started_with(once), 0);
    assert_int_equal(started_with(twice), 0);
    assert_int_equal(started_with(elsewhere), 0);
}

/* The appliance's password is odidctl's concern: the daemon keeps none. */
static void write_configuration(char path[], const char *text)
{
    int fd = mkstemp(path);

    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    optind = 1;
}

static void no_password_is_kept(void **state)
{
    static struct options options;
    char path[] = "/tmp/odid-options-XXXXXX";
    static const char text[] = "[maintenance]\npassword = hunter2hunter2\nat_boot = yes\n";
    char *arguments[] = {"odid-daemon", "-config", path, NULL};

    (void)state;
    write_configuration(path, text);
    assert_true(options_read(&options, 3, arguments));
    assert_int_equal(options.errors, 0);
    assert_true(options.config.maintenance_at_boot);
    for (size_t i = 0; i < sizeof(options.config.maintenance_password); i++) {
        assert_int_equal(options.config.maintenance_password[i], 0);
    }
    assert_null(memmem(&options, sizeof(options), "hunter2", 7));
    unlink(path);
}

/* Where the daemon was configured elsewhere nobody found it: no status, and so not armed. */
static void the_appliances_places_are_the_images(void **state)
{
    static struct options options;
    char path[] = "/tmp/odid-options-XXXXXX";
    static const char text[] = "[daemon]\nrun_dir = /tmp/elsewhere\nuser = nobody\n"
                               "[mavlink]\nudp_address = 0.0.0.0\nudp_port = 14560\n"
                               "[broadcast]\nhostapd_dir = /tmp/hostapd\n";
    char *arguments[] = {"odid-daemon", "-appliance", "-config", path, NULL};

    (void)state;
    write_configuration(path, text);
    assert_true(options_read(&options, 4, arguments));
    assert_string_equal(options.config.run_dir, "/run/odid");
    assert_string_equal(options.config.user, "odid");
    assert_string_equal(options.config.udp_address, "127.0.0.1");
    assert_string_equal(options.config.hostapd_dir, "/run/hostapd");
    assert_int_equal(options.config.udp_port, 14560);
    assert_int_equal(options.errors, 0);
    assert_non_null(strstr(options.report[0], "run_dir = /tmp/elsewhere is not for the appliance"));

    arguments[1] = "-debug"; /* any other computer: as it is configured */
    optind = 1;
    assert_true(options_read(&options, 4, arguments));
    assert_string_equal(options.config.run_dir, "/tmp/elsewhere");
    unlink(path);
}

static bool is_reported(const struct options *options, const char *what)
{
    for (unsigned i = 0; i < options->reports; i++) {
        if (strstr(options->report[i], what) != NULL) {
            return true;
        }
    }
    return false;
}

/* One that nobody can be is no reason to be silent: it is as if there were none. */
static void a_vehicle_that_cannot_be_is_none(void **state)
{
    static const char *const wrong[] = {"0", "256", "300", "4294967297", "", "1x", "-1"};
    static const char not_used[] = "expected 1-255; not used";
    static struct options options;
    char *arguments[] = {"odid-daemon", "-config", "/dev/null", "-expect-vehicle", "255", NULL};

    (void)state;
    optind = 1;
    assert_true(options_read(&options, 5, arguments));
    assert_int_equal(options.expected_vehicle, 255);
    assert_false(is_reported(&options, not_used));
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        arguments[4] = (char *)(uintptr_t)wrong[i];
        optind = 1;
        assert_true(options_read(&options, 5, arguments));
        assert_int_equal(options.expected_vehicle, 0);
        assert_true(is_reported(&options, not_used));
    }
}

int main(int argc, char *argv[])
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_secret_in_the_environment),
        cmocka_unit_test(no_password_is_kept),
        cmocka_unit_test(the_appliances_places_are_the_images),
        cmocka_unit_test(a_vehicle_that_cannot_be_is_none),
    };

    (void)argv;
    if (argc > 1) {
        return look_inside();
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
