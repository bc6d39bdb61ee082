/* What a restarted daemon must still know. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "appliance/kept.h"
#include "daemon/kept_counters.h"
#include "own_mounts.h"

static char directory[] = "/tmp/odid-kept-XXXXXX";
static char path[64], counters_path[64];

static int make_directory(void **state)
{
    (void)state;
    if (mkdtemp(directory) == NULL) {
        return -1;
    }
    snprintf(path, sizeof(path), "%s/kept", directory);
    snprintf(counters_path, sizeof(counters_path), "%s/counters", directory);
    return 0;
}

static int remove_directory(void **state)
{
    (void)state;
    unlink(path);
    unlink(counters_path);
    return rmdir(directory);
}

static void write_text(const char *text)
{
    FILE *file = fopen(path, "w");

    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void what_was_written_is_read(void **state)
{
    const struct kept in = {.vehicle = 255,
                            .fix_known = true,
                            .vertical_inverted = true,
                            .crashed = true,
                            .on_air = {[CHANNEL_BT4] = true, [CHANNEL_WIFI] = true},
                            .told_lost = {[CHANNEL_WIFI] = true},
                            .takeoff = {.known = true,
                                        .latitude_deg = 57.7089123,
                                        .longitude_deg = -11.9746001,
                                        .altitude_msl_m = 12.5,
                                        .altitude_geodetic_m = NAN}};
    struct kept out;

    (void)state;
    assert_int_equal(kept_write(directory, &in), 0);
    kept_read(directory, &out);
    assert_int_equal(out.vehicle, 255);
    assert_true(out.fix_known && out.vertical_inverted && out.crashed);
    assert_true(out.on_air[CHANNEL_BT4] && out.on_air[CHANNEL_WIFI]);
    assert_false(out.on_air[CHANNEL_BT5]);
    assert_true(out.told_lost[CHANNEL_WIFI]);
    assert_false(out.told_lost[CHANNEL_BT4] || out.told_lost[CHANNEL_BT5]);
    assert_true(out.takeoff.known);
    assert_true(fabs(out.takeoff.latitude_deg - in.takeoff.latitude_deg) < 1e-8);
    assert_true(fabs(out.takeoff.longitude_deg - in.takeoff.longitude_deg) < 1e-8);
    assert_true(fabs(out.takeoff.altitude_msl_m - in.takeoff.altitude_msl_m) < 1e-3);
    assert_true(isnan(out.takeoff.altitude_geodetic_m));
}

/* On a file system of its own, which somebody has filled to the last byte. */
static int arm_on_a_full_disk(bool poisoned)
{
    static const struct kept grounded = {.vehicle = 7, .armed = KEPT_DISARMED};
    static const struct kept flying = {
        .vehicle = 7, .armed = KEPT_ARMED, .armed_once = true, .takeoff = {.known = true}};
    char other[64];
    struct kept out;

    if (!own_mounts() || !mount_small_disk(directory, "64k")) {
        return 77;
    }
    snprintf(other, sizeof(other), "%s/other", directory);
    if (kept_write(directory, &grounded) < 0) {
        return 1;
    }
    if (poisoned) { /* nor is the old one to be written to */
        if (unlink(path) < 0 || mkdir(path, 0700) < 0) {
            return 2;
        }
        return kept_write(directory, &flying) < 0 && kept_read(directory, &out) < 0 ? 0 : 3;
    }
    fill_to_the_last_byte(other);
    if (kept_write(directory, &flying) < 0 || kept_read(directory, &out) < 0) {
        return 4;
    }
    return out.armed == KEPT_ARMED && out.armed_once && out.takeoff.known ? 0 : 5;
}

static void in_a_child(bool poisoned)
{
    pid_t child = fork();
    int status = 0;

    if (child == 0) {
        _exit(arm_on_a_full_disk(poisoned));
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    if (WIFEXITED(status) && WEXITSTATUS(status) == 77) {
        print_message("skipped: mounting is not allowed here\n");
        skip();
    }
    assert_int_equal(status, 0);
}

static void a_full_disk_does_not_keep_an_old_no(void **state)
{
    (void)state;
    in_a_child(false);
}

static void what_cannot_be_written_is_not_there(void **state)
{
    (void)state;
    in_a_child(true);
}

/* With the longest of everything that telemetry has: the point is what comes last. */
static void the_longest_text_is_whole(void **state)
{
    const struct kept in = {.vehicle = 255,
                            .armed_once = true,
                            .fix_known = true,
                            .vertical_inverted = true,
                            .crashed = true,
                            .on_air = {true, true, true},
                            .told_lost = {true, true, true},
                            .takeoff = {.known = true,
                                        .latitude_deg = -89.999999999,
                                        .longitude_deg = -179.999999999,
                                        .altitude_msl_m = -2147483.648,
                                        .altitude_geodetic_m = -2147483.647}};
    struct kept out;

    (void)state;
    assert_int_equal(kept_write(directory, &in), 0);
    kept_read(directory, &out);
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        assert_true(out.on_air[channel] && out.told_lost[channel]);
    }
    assert_true(out.takeoff.known);
    assert_true(fabs(out.takeoff.altitude_geodetic_m - in.takeoff.altitude_geodetic_m) < 1e-4);
}

static void a_finished_flights_point_is_gone(void **state)
{
    const struct kept landed = {.vehicle = 7};
    struct kept out;

    (void)state;
    write_text("vehicle 7\ntakeoff 1 2 3 4\n");
    kept_read(directory, &out);
    assert_true(out.takeoff.known);
    assert_int_equal(kept_write(directory, &landed), 0);
    kept_read(directory, &out);
    assert_int_equal(out.vehicle, 7);
    assert_false(out.fix_known);
    assert_false(out.takeoff.known);
}

static void nonsense_is_unknown(void **state)
{
    static const char *const vehicles[] = {
        "", "7\n", "vehicle", "vehicle x\n", "vehicle 256\n", "takeoff 1 2 3 4\n", "vehicle -1\n"};
    static const char *const points[] = {"",
                                         "takeoff 57.7",
                                         "takeoff a b c d",
                                         "takeoff 91 0 0 0",
                                         "takeoff 0 181 0 0",
                                         "takeoff nan 0 0 0",
                                         "takeoff 1 1 1e300 0", /* its text had no room */
                                         "takeoff 1 1 0 -1e300",
                                         "1 2 3 4"};
    struct kept out;
    char text[80];

    (void)state;
    for (size_t i = 0; i < sizeof(vehicles) / sizeof(vehicles[0]); i++) {
        write_text(vehicles[i]);
        kept_read(directory, &out);
        assert_int_equal(out.vehicle, 0);
        assert_false(out.takeoff.known);
    }
    for (size_t i = 0; i < sizeof(points) / sizeof(points[0]); i++) {
        snprintf(text, sizeof(text), "vehicle 1\n%s\n", points[i]);
        write_text(text);
        kept_read(directory, &out);
        assert_int_equal(out.vehicle, 1);
        assert_false(out.takeoff.known);
    }
}

static void armed_is_kept(void **state)
{
    struct kept in = {.vehicle = 7, .armed_once = true}, out;

    (void)state;
    for (enum kept_armed armed = KEPT_UNHEARD; armed <= KEPT_UNSAID; armed++) {
        in.armed = armed;
        assert_int_equal(kept_write(directory, &in), 0);
        assert_int_equal(kept_read(directory, &out), 0);
        assert_int_equal(out.armed, armed);
        assert_true(out.armed_once);
    }
    /* What can't be read is no word of disarmed. */
    write_text("vehicle 7\narmed maybe\narmed-once no\n");
    assert_int_equal(kept_read(directory, &out), 0);
    assert_int_equal(out.armed, KEPT_ARMED);
    assert_false(out.armed_once);
}

/* Another version's file, with less in it and with more. */
static void what_another_version_wrote_is_read(void **state)
{
    struct kept out;

    (void)state;
    write_text("vehicle 7\narmed no\n");
    assert_int_equal(kept_read(directory, &out), 0);
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        assert_false(out.on_air[channel] || out.told_lost[channel]);
    }
    write_text("vehicle 7\non-air\nlanded maybe\non-air bt5 bt6\narmed no\n");
    assert_int_equal(kept_read(directory, &out), 0);
    assert_true(out.on_air[CHANNEL_BT5]);
    assert_false(out.on_air[CHANNEL_BT4] || out.on_air[CHANNEL_WIFI]);
    assert_int_equal(out.armed, KEPT_DISARMED);
}

static void a_directory_that_is_gone_is_an_error(void **state)
{
    const struct kept in = {.vehicle = 1};
    struct kept out;

    (void)state;
    assert_int_equal(kept_write("/nonexistent", &in), -ENOENT);
    assert_int_equal(kept_read("/nonexistent", &out), -ENOENT);
    assert_int_equal(out.vehicle, 0);
}

/* ---- counters ---- */

static const struct kept_counters some = {
    .legacy.legacy = {[MESSAGE_BASIC_ID] = {.value = 255, .used = true, .content_hash = 1},
                      [MESSAGE_OPERATOR_ID] = {.value = 7, .used = true, .content_hash = 2}},
    .extended = {.value = 128, .used = true, .content_hash = 0x12345600},
    .beacon = {.value = 3, .used = true, .content_hash = UINT32_MAX},
};

static bool same(const struct messages_counter *a, const struct messages_counter *b)
{
    return a->value == b->value && a->used == b->used && a->content_hash == b->content_hash;
}

static void assert_same(const struct kept_counters *a, const struct kept_counters *b)
{
    for (unsigned type = 0; type < MESSAGE_TYPES; type++) {
        assert_true(same(&a->legacy.legacy[type], &b->legacy.legacy[type]));
    }
    assert_true(same(&a->extended, &b->extended));
    assert_true(same(&a->beacon, &b->beacon));
}

static void counters_go_on(void **state)
{
    static const struct kept_counters none, more = {.beacon = {.value = 4, .used = true}};
    struct kept_counters out = some;
    int fd;

    (void)state;
    unlink(counters_path);
    fd = kept_counters_open(directory, &out);
    assert_true(fd >= 0);
    assert_same(&out, &none);
    assert_int_equal(kept_counters_write(fd, &more), 0);
    assert_int_equal(kept_counters_write(fd, &some), 0); /* the newest ones count */
    close(fd);
    fd = kept_counters_open(directory, &out);
    assert_true(fd >= 0);
    assert_same(&out, &some);
    close(fd);
}

/* By somebody's descriptor of that file: the next daemon waited 45 s for it. */
static void counters_that_somebody_holds_are_begun_anew(void **state)
{
    static const struct kept_counters none;
    struct kept_counters out = some;
    int fd, ready[2];
    pid_t holder;
    char octet;

    (void)state;
    fd = kept_counters_open(directory, &out);
    assert_int_equal(kept_counters_write(fd, &some), 0);
    close(fd);
    assert_int_equal(pipe(ready), 0);
    holder = fork();
    if (holder == 0) {
        prctl(PR_SET_PDEATHSIG, SIGKILL); /* also of a test that failed */
        fd = open(counters_path, O_RDONLY);
        signal(SIGIO, SIG_IGN);
        octet = fd >= 0 && fcntl(fd, F_SETLEASE, F_RDLCK) == 0 ? 'y' : 'n';
        if (write(ready[1], &octet, 1) == 1) {
            pause();
        }
        _exit(1);
    }
    assert_int_equal(read(ready[0], &octet, 1), 1);
    assert_int_equal(octet, 'y');
    alarm(30); /* it is given up after 45 s */
    fd = kept_counters_open(directory, &out);
    alarm(0);
    assert_true(fd >= 0);
    assert_same(&out, &none);
    close(fd);
    kill(holder, SIGKILL);
    waitpid(holder, NULL, 0);
    close(ready[0]);
    close(ready[1]);
}

static void counters_of_half_a_file_begin_anew(void **state)
{
    static const struct kept_counters none;
    struct kept_counters out;
    int fd = kept_counters_open(directory, &out);

    (void)state;
    assert_int_equal(kept_counters_write(fd, &some), 0);
    close(fd);
    assert_int_equal(truncate(counters_path, 47), 0);
    fd = kept_counters_open(directory, &out);
    assert_same(&out, &none);
    assert_int_equal(kept_counters_write(fd, &some), 0); /* and are kept from then on */
    close(fd);
    fd = kept_counters_open(directory, &out);
    assert_same(&out, &some);
    close(fd);
}

/* The folder is another user's, and root reads what is in it. */
static void no_name_is_followed(void **state)
{
    struct kept out = {0};
    char elsewhere[128];
    int fd;

    (void)state;
    snprintf(elsewhere, sizeof(elsewhere), "%s/elsewhere", directory);
    fd = open(elsewhere, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
    assert_true(fd >= 0 && dprintf(fd, "armed no\n") > 0);
    close(fd);
    unlink(path);
    assert_int_equal(symlink(elsewhere, path), 0);
    assert_int_equal(kept_read(directory, &out), -ELOOP);
    unlink(path);
    unlink(elsewhere);
}

static void counters_that_cannot_be_kept_begin_anew(void **state)
{
    static const struct kept_counters none;
    struct kept_counters out = some;

    (void)state;
    assert_int_equal(kept_counters_open("/nonexistent", &out), -ENOENT);
    assert_same(&out, &none);
    unlink(counters_path);
    assert_int_equal(symlink("/dev/null", counters_path), 0);
    assert_int_equal(kept_counters_open(directory, &out), -ELOOP);
    unlink(counters_path);
    assert_int_equal(kept_counters_write(-1, &some), -EBADF);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_written_is_read),
        cmocka_unit_test(the_longest_text_is_whole),
        cmocka_unit_test(a_full_disk_does_not_keep_an_old_no),
        cmocka_unit_test(what_cannot_be_written_is_not_there),
        cmocka_unit_test(a_finished_flights_point_is_gone),
        cmocka_unit_test(nonsense_is_unknown),
        cmocka_unit_test(armed_is_kept),
        cmocka_unit_test(what_another_version_wrote_is_read),
        cmocka_unit_test(no_name_is_followed),
        cmocka_unit_test(a_directory_that_is_gone_is_an_error),
        cmocka_unit_test(counters_go_on),
        cmocka_unit_test(counters_that_somebody_holds_are_begun_anew),
        cmocka_unit_test(counters_of_half_a_file_begin_anew),
        cmocka_unit_test(counters_that_cannot_be_kept_begin_anew),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
