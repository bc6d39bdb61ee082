/* The records' files: numbers, bounds, and a directory that fails in every way. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/mount.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "flights/recorder_store.h"
#include "own_mounts.h"
#include "recorder_bench.h"

static char parent[64], directory[96];
static struct recorder_store store;
static int64_t now_us;

static int set_up(void **state)
{
    (void)state;
    snprintf(parent, sizeof(parent), "/tmp/odid-recorder-XXXXXX");
    if (mkdtemp(parent) == NULL) {
        return -1;
    }
    snprintf(directory, sizeof(directory), "%s/flights", parent);
    now_us = 0;
    assert_false(recorder_store_open(&store, directory, BOOT));
    return 0;
}

static int tear_down(void **state)
{
    char command[128];

    (void)state;
    snprintf(command, sizeof(command), "rm -rf %s", parent);
    return system(command);
}

static void add(const char *line)
{
    recorder_text_add(&store.text, line);
}

static void add_start(void)
{
    add("{\"t\":1.00,\"event\":\"start\",\"boot\":\"" BOOT "\"}");
}

static int save(void)
{
    now_us += RECORDER_WRITE_EVERY_US;
    assert_true(recorder_store_due(&store, now_us));
    return recorder_store_write(&store, now_us);
}

static void path_of(char path[160], unsigned number)
{
    snprintf(path, 160, "%s/%05u.jsonl", directory, number);
}

/* A record of another power-on. */
static void make_file(unsigned number, const char *content)
{
    char path[160];
    FILE *file;

    path_of(path, number);
    file = fopen(path, "w");
    assert_non_null(file);
    fputs(content, file);
    assert_int_equal(fclose(file), 0);
}

static bool exists(unsigned number)
{
    char path[160];

    path_of(path, number);
    return access(path, F_OK) == 0;
}

static void expect_file(unsigned number)
{
    static char bytes[RECORDER_TEXT_MAX + 1];
    ssize_t length = recorder_store_read(directory, number, bytes, sizeof(bytes));

    assert_int_equal(length, store.text.length);
    assert_memory_equal(bytes, store.text.bytes, store.text.length);
}

/* ---- numbers ---- */

static void names(void **state)
{
    (void)state;
    assert_int_equal(recorder_store_number("00001.jsonl"), 1);
    assert_int_equal(recorder_store_number("123456.jsonl"), 123456);
    assert_int_equal(recorder_store_number("00000.jsonl"), 0);
    assert_int_equal(recorder_store_number("1.jsonl"), 0);
    assert_int_equal(recorder_store_number("00001.jsonl.tmp"), 0);
    assert_int_equal(recorder_store_number("00001"), 0);
    assert_int_equal(recorder_store_number("-0001.jsonl"), 0);
    assert_int_equal(recorder_store_number("1234567890.jsonl"), 0);
    assert_int_equal(recorder_store_number(".new"), 0);
}

static void the_first_record_makes_the_directory(void **state)
{
    (void)state;
    add_start();
    assert_true(recorder_store_due(&store, -1000)); /* at once */
    assert_int_equal(save(), 0);
    assert_false(recorder_store_due(&store, now_us + RECORDER_WRITE_EVERY_US - 1));
    assert_true(recorder_store_due(&store, now_us + RECORDER_WRITE_EVERY_US));
    expect_file(1);
    add("{\"t\":2.00,\"event\":\"armed\"}");
    assert_int_equal(save(), 0);
    expect_file(1);
    assert_false(exists(2));
}

static void a_power_on_has_the_next_number(void **state)
{
    (void)state;
    assert_int_equal(mkdir(directory, 0755), 0);
    make_file(7, "{\"t\":1.00,\"event\":\"start\",\"boot\":\"another\"}\n");
    make_file(41, "{\"t\":1.00,\"event\":\"start\",\"boot\":\"a third\"}\n");
    assert_false(recorder_store_open(&store, directory, BOOT));
    add_start();
    assert_int_equal(save(), 0);
    expect_file(42);
}

static void a_restart_goes_on_in_the_same_file(void **state)
{
    static struct recorder_text before;

    (void)state;
    add_start();
    assert_int_equal(save(), 0);
    before = store.text;
    assert_true(recorder_store_open(&store, directory, BOOT));
    assert_int_equal(store.text.length, before.length);
    add("{\"t\":5.00,\"event\":\"recorder_restarted\"}");
    assert_int_equal(save(), 0);
    assert_int_equal(store.number, 1);
    expect_file(1);
    /* without a boot id nobody knows */
    assert_false(recorder_store_open(&store, directory, ""));
}

static void a_torn_line_is_cut_off(void **state)
{
    (void)state;
    assert_int_equal(mkdir(directory, 0755), 0);
    make_file(3, "{\"t\":1.00,\"event\":\"start\",\"boot\":\"" BOOT "\"}\n{\"t\":2.00,\"ev");
    assert_true(recorder_store_open(&store, directory, BOOT));
    add("{\"t\":3.00,\"event\":\"armed\"}");
    assert_int_equal(save(), 0);
    expect_file(3);
    assert_null(memmem(store.text.bytes, store.text.length, "2.00", 4));
}

static void two_hundred_files(void **state)
{
    (void)state;
    assert_int_equal(mkdir(directory, 0755), 0);
    for (unsigned i = 1; i <= 205; i++) {
        make_file(i + 99990, "{\"t\":1.00,\"event\":\"start\"}\n");
    }
    make_file(5, "{\"t\":1.00,\"event\":\"start\"}\n");
    add_start();
    assert_int_equal(save(), 0);
    assert_int_equal(store.number, 100196);
    assert_false(exists(5));
    assert_false(exists(99996));
    assert_false(exists(99990 + 6));
    assert_true(exists(99990 + 7));
    assert_true(exists(100195));
    expect_file(100196);
}

/* ---- a directory that fails ---- */

/* In the way is a file: nothing can be made there. */
static void a_directory_that_comes_later(void **state)
{
    FILE *file = fopen(directory, "w");

    (void)state;
    assert_non_null(file);
    fclose(file);
    add_start();
    assert_int_equal(save(), -ENOTDIR);
    add("{\"t\":2.00,\"event\":\"armed\"}");
    assert_int_equal(save(), -ENOTDIR);
    assert_int_equal(store.error, ENOTDIR);
    assert_int_equal(unlink(directory), 0);
    assert_int_equal(save(), 0);
    assert_int_equal(store.error, 0);
    expect_file(1);
}

/* /data was broken, and another file system is mounted there: the whole record goes to it. */
static void another_disk_in_its_place(void **state)
{
    char aside[160];

    (void)state;
    add_start();
    assert_int_equal(save(), 0);
    snprintf(aside, sizeof(aside), "%s-aside", directory);
    assert_int_equal(rename(directory, aside), 0);
    assert_int_equal(mkdir(directory, 0755), 0);
    make_file(1, "{\"t\":1.00,\"event\":\"start\",\"boot\":\"another\"}\n");
    make_file(9, "{\"t\":1.00,\"event\":\"start\",\"boot\":\"a third\"}\n");
    add("{\"t\":2.00,\"event\":\"armed\"}");
    assert_int_equal(save(), 0);
    assert_int_equal(store.number, 10);
    expect_file(10);
}

static void a_file_that_somebody_removed(void **state)
{
    char path[160];

    (void)state;
    add_start();
    assert_int_equal(save(), 0);
    path_of(path, 1);
    assert_int_equal(unlink(path), 0);
    add("{\"t\":2.00,\"event\":\"armed\"}");
    assert_int_equal(save(), 0);
    expect_file(store.number);
}

/* A limit stands for a disk that is full in the middle of a line. */
static void a_write_that_fails_halfway(void **state)
{
    struct rlimit before, limit;
    char path[160];
    struct stat is;

    (void)state;
    signal(SIGXFSZ, SIG_IGN);
    add_start();
    assert_int_equal(save(), 0);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    limit = before;
    limit.rlim_cur = store.text.length + 10;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &limit), 0);
    add("{\"t\":2.00,\"event\":\"armed\"}");
    assert_int_equal(save(), -EFBIG);
    path_of(path, 1);
    assert_int_equal(stat(path, &is), 0);
    assert_int_equal(is.st_size, store.text.stored + 10); /* torn */
    add("{\"t\":3.00,\"event\":\"disarmed\"}");
    assert_int_equal(save(), -EFBIG);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(save(), 0);
    expect_file(1);
}

/* Our own mounts. Returns false, and says why, where that isn't allowed. */
static bool mount_parent(void)
{
    if (!own_mounts() || !mount_small_disk(parent, "256k")) {
        print_message("no mounts of our own here: %s\n", strerror(errno));
        return false;
    }
    return true;
}

static void a_full_disk(void **state)
{
    char path[160], filler[160];
    unsigned lines = 0;

    (void)state;
    if (!mount_parent()) {
        skip();
    }
    add_start();
    assert_int_equal(save(), 0);
    snprintf(filler, sizeof(filler), "%s/filler", parent);
    fill_to_the_last_byte(filler);
    while (store.error == 0) { /* what is left of the file's last page */
        add("{\"t\":2.00,\"event\":\"fault\",\"what\":\"position\",\"text\":\"there is none\"}");
        lines++;
        save();
        assert_true(lines < 1000);
    }
    assert_int_equal(store.error, ENOSPC);
    for (int i = 0; i < 2000; i++) { /* hours of it: memory is bounded, too */
        add("{\"t\":2.00,\"event\":\"fault\",\"what\":\"position\",\"text\":\"there is none\"}");
        assert_int_equal(save(), -ENOSPC);
    }
    snprintf(path, sizeof(path), "%s/.new", directory);
    assert_int_equal(access(path, F_OK), -1); /* nothing is left of the tries */
    assert_int_equal(unlink(filler), 0);
    assert_int_equal(save(), 0);
    expect_file(1);
    assert_true(store.text.dropped > 0);
    assert_int_equal(umount(parent), 0);
}

static void a_disk_that_becomes_read_only(void **state)
{
    (void)state;
    if (!mount_parent()) {
        skip();
    }
    add_start();
    assert_int_equal(save(), 0);
    assert_int_equal(mount("none", parent, NULL, MS_REMOUNT | MS_RDONLY, NULL), 0);
    add("{\"t\":2.00,\"event\":\"armed\"}");
    assert_int_equal(save(), -EROFS);
    assert_int_equal(mount("none", parent, NULL, MS_REMOUNT, NULL), 0);
    assert_int_equal(save(), 0);
    expect_file(1);
    assert_int_equal(umount(parent), 0);
}

/* A file never gets longer than the bound, however long it goes on. */
static void files_are_bounded(void **state)
{
    char path[160];
    struct stat is;

    (void)state;
    add_start();
    for (int i = 0; i < 3000; i++) {
        add("{\"t\":2.00,\"event\":\"fault\",\"what\":\"position\",\"text\":\"there is none\"}");
        if (i % 50 == 0) {
            assert_int_equal(save(), 0);
            path_of(path, 1);
            assert_int_equal(stat(path, &is), 0);
            assert_in_range(is.st_size, 1, RECORDER_TEXT_MAX);
        }
    }
    assert_int_equal(save(), 0);
    expect_file(1);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names),
        TEST(the_first_record_makes_the_directory),
        TEST(a_power_on_has_the_next_number),
        TEST(a_restart_goes_on_in_the_same_file),
        TEST(a_torn_line_is_cut_off),
        TEST(two_hundred_files),
        TEST(a_directory_that_comes_later),
        TEST(another_disk_in_its_place),
        TEST(a_file_that_somebody_removed),
        TEST(a_write_that_fails_halfway),
        TEST(a_full_disk),
        TEST(a_disk_that_becomes_read_only),
        TEST(files_are_bounded),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
