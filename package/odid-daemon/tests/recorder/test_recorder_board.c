/* The board's sensors and faults, on a tree of files. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "own_folder.h"
#include "recorder/recorder_board.h"

static struct places places;
static struct recorder_board_reader reader;
static struct recorder recorder;
static struct recorder_board board;

static int set_up(void **state)
{
    (void)state;
    reader = (struct recorder_board_reader){.places = &places};
    memset(&recorder, 0, sizeof(recorder));
    return system("rm -rf run sys");
}

static void put(const char *path, const char *content)
{
    char whole[256];
    FILE *file;

    snprintf(whole, sizeof(whole), ".%s", path);
    for (char *slash = strchr(whole + 2, '/'); slash != NULL; slash = strchr(slash + 1, '/')) {
        *slash = '\0';
        mkdir(whole, 0755);
        *slash = '/';
    }
    file = fopen(whole, "w");
    assert_non_null(file);
    fputs(content, file);
    fclose(file);
}

static void a_board_without_any_of_it(void **state)
{
    static const struct recorder_board nothing;

    (void)state;
    recorder_board_read(&reader, &recorder, &board);
    assert_memory_equal(&board, &nothing, sizeof(board));
}

static void the_kernels_alarm(void **state)
{
    (void)state;
    put("/sys/class/hwmon/hwmon0/name", "cpu_thermal\n");
    put("/sys/class/hwmon/hwmon0/in0_lcrit_alarm", "1\n"); /* somebody else's */
    put("/sys/class/hwmon/hwmon1/name", "rpi_volt\n");
    put("/sys/class/hwmon/hwmon1/in0_lcrit_alarm", "0\n");
    recorder_board_read(&reader, &recorder, &board);
    assert_false(board.undervoltage);
    put("/sys/class/hwmon/hwmon1/in0_lcrit_alarm", "1\n");
    recorder_board_read(&reader, &recorder, &board);
    assert_true(board.undervoltage);
    assert_false(board.throttled);
}

#define FIRMWARE "/sys/devices/platform/soc/soc:firmware/get_throttled"

static void the_firmwares_flags(void **state)
{
    (void)state;
    put(FIRMWARE, "0\n");
    recorder_board_read(&reader, &recorder, &board);
    assert_false(board.undervoltage || board.throttled);
    put(FIRMWARE, "50005\n"); /* under-voltage and throttled: now, and has been */
    recorder_board_read(&reader, &recorder, &board);
    assert_true(board.undervoltage && board.throttled);
    put(FIRMWARE, "50000\n"); /* has been; that is known already */
    recorder_board_read(&reader, &recorder, &board);
    assert_false(board.undervoltage || board.throttled);
    assert_false(board.was_undervoltage || board.was_throttled);
    put(FIRMWARE, "0xd0000"); /* and the temperature's soft limit, between two looks */
    recorder_board_read(&reader, &recorder, &board);
    assert_false(board.undervoltage || board.throttled || board.was_undervoltage);
    assert_true(board.was_throttled);
    put(FIRMWARE, "nonsense");
    recorder_board_read(&reader, &recorder, &board);
    assert_false(board.undervoltage || board.throttled);
}

static void the_appliances_faults(void **state)
{
    char path[80];

    (void)state;
    put("/run/faults/data", "/data is full: \x01 delete \"something\".\nmore\n");
    put("/run/faults/.wireless", "not yet");
    recorder_board_read(&reader, &recorder, &board);
    assert_int_equal(board.faults, 1);
    assert_string_equal(board.fault[0].name, "data");
    assert_string_equal(board.fault[0].text, "/data is full: ? delete \"something\".");
    for (int i = 0; i < 40; i++) {
        snprintf(path, sizeof(path), "/run/faults/%d-is-a-name-that-is-much-longer-than-usual", i);
        put(path, "");
    }
    recorder_board_read(&reader, &recorder, &board);
    assert_int_equal(board.faults, RECORDER_BOARD_FAULTS);
}

static bool listed(const char *name)
{
    for (unsigned i = 0; i < board.faults; i++) {
        if (strcmp(board.fault[i].name, name) == 0) {
            return true;
        }
    }
    return false;
}

/* Adapters that came later pushed a fault off the list, and the record said that it was over. */
static void a_fault_is_listed_until_it_is_over(void **state)
{
    char path[64];

    (void)state;
    snprintf(recorder.faults[RECORDER_KINDS].name, RECORDER_NAME_SIZE, "wireless");
    recorder.faults[RECORDER_KINDS].there = true;
    put("/run/faults/wireless", "There is none.\n");
    for (int i = 99; i >= 10; i--) {
        snprintf(path, sizeof(path), "/run/faults/dhcp-usb%d", i);
        put(path, "It isn't used.\n");
    }
    recorder_board_read(&reader, &recorder, &board);
    assert_true(listed("wireless"));
    assert_true(listed("dhcp-usb10")); /* the others by name, whatever the directory's order */
    assert_false(listed("dhcp-usb99"));
    assert_int_equal(board.faults, RECORDER_BOARD_FAULTS);
    assert_int_equal(unlink("run/faults/wireless"), 0);
    recorder_board_read(&reader, &recorder, &board);
    assert_false(listed("wireless"));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, set_up)
    const struct CMUnitTest tests[] = {
        TEST(a_board_without_any_of_it),
        TEST(the_kernels_alarm),
        TEST(the_firmwares_flags),
        TEST(the_appliances_faults),
        TEST(a_fault_is_listed_until_it_is_over),
    };

    places_under(&places, ".");
    return enter_own_folder() < 0 || cmocka_run_group_tests(tests, NULL, leave_own_folder);
}
