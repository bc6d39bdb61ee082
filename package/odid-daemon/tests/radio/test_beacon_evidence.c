/* What tells that beacons go out, or don't: a count that moves, and an interface that is up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/whole_file.h"
#include "own_folder.h"
#include "radio/beacon_evidence.h"

#define SECOND_US 1000000

#define COUNT "odid" BEACON_COUNT_FILE
#define STATE "net/wlan0/operstate"

static struct beacon_evidence evidence;
static int64_t now_us;

static int set_up(void **state)
{
    (void)state;
    beacon_evidence_init(&evidence, "odid", "net", "wlan0");
    now_us = 1000 * (int64_t)SECOND_US;
    return mkdir("odid-beacons", 0755) < 0 || mkdir("net", 0755) < 0 || mkdir("net/wlan0", 0755) < 0
               ? -1
               : 0;
}

static int tear_down(void **state)
{
    (void)state;
    return system("rm -r odid-beacons net");
}

static void write_line(const char *path, const char *line)
{
    assert_int_equal(whole_file_replace(path, line, strlen(line), 0644), 0);
}

static void report(const char *count)
{
    char line[64];

    snprintf(line, sizeof(line), "%" PRId64 " %s - seen\n", now_us / 1000, count);
    write_line(COUNT, line);
}

static void report_heard(const char *heard)
{
    char line[64];

    snprintf(line, sizeof(line), "%" PRId64 " - %s -\n", now_us / 1000, heard);
    write_line(COUNT, line);
}

static enum beacon_verdict look_later(int64_t later_us)
{
    now_us += later_us;
    return beacon_evidence_look(&evidence, 0, now_us);
}

static enum beacon_verdict count(uint32_t number)
{
    char text[16];

    now_us += SECOND_US / 2;
    snprintf(text, sizeof(text), "%" PRIu32, number);
    report(text);
    return look_later(0);
}

static void nothing_is_no_evidence(void **state)
{
    (void)state;
    for (int i = 0; i < 10; i++) {
        assert_int_equal(look_later(SECOND_US), BEACONS_UNKNOWN);
    }
}

static void a_count_that_moves(void **state)
{
    (void)state;
    assert_int_equal(count(7), BEACONS_UNKNOWN);
    for (uint32_t i = 0; i < 10; i++) {
        assert_int_equal(count(12 + 5 * i), BEACONS_SENT);
    }
    assert_int_equal(count(0), BEACONS_SENT); /* it begins anew, as its firmware does */
}

static void a_count_that_stands(void **state)
{
    (void)state;
    count(7);
    assert_int_equal(count(12), BEACONS_SENT);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(count(12), BEACONS_SENT);
    }
    assert_int_equal(count(12), BEACONS_NOT_SENT);
    assert_int_equal(count(17), BEACONS_SENT);
}

static void none_are_expected_of_what_has_just_been_switched_on(void **state)
{
    (void)state;
    count(7);
    count(12);
    for (int i = 0; i < 3; i++) {
        count(12);
    }
    now_us += SECOND_US / 2;
    report("12");
    assert_int_equal(beacon_evidence_look(&evidence, now_us - SECOND_US, now_us), BEACONS_UNKNOWN);
}

/* Of something else, or of nothing. */
static void a_count_that_was_seen_to_be_none_of_beacons_is_no_evidence(void **state)
{
    (void)state;
    for (int i = 0; i < 20; i++) {
        char line[64];

        now_us += SECOND_US / 2;
        snprintf(line, sizeof(line), "%" PRId64 " %d - -\n", now_us / 1000, i < 10 ? i : 10);
        write_line(COUNT, line);
        assert_int_equal(look_later(0), BEACONS_UNKNOWN);
    }
}

/* A question that failed: for a while nobody said how many. Silence was made of that, and the
 * element taken out. */
static void what_is_told_again_is_no_silence(void **state)
{
    (void)state;
    count(7);
    assert_int_equal(count(12), BEACONS_SENT);
    for (int i = 0; i < 10; i++) {
        now_us += SECOND_US / 2;
        report("-");
        look_later(0);
    }
    assert_int_equal(count(60), BEACONS_UNKNOWN);
    assert_int_equal(count(65), BEACONS_SENT);
}

/* Nor is it silence: what others send may keep ours from the air. */
static void a_few_of_them_are_no_evidence_of_all(void **state)
{
    (void)state;
    count(7);
    for (uint32_t i = 1; i < 10; i++) {
        assert_int_equal(count(7 + i), BEACONS_UNKNOWN);
    }
    assert_int_equal(count(20), BEACONS_SENT);
}

static void what_another_radio_hears(void **state)
{
    (void)state;
    report_heard("-");
    assert_int_equal(look_later(0), BEACONS_UNKNOWN);
    assert_false(beacon_evidence_heard(&evidence, now_us));
    now_us += SECOND_US;
    report_heard("1000500");
    look_later(0);
    assert_true(beacon_evidence_heard(&evidence, now_us));
    now_us += SECOND_US;
    report_heard("-"); /* for now */
    look_later(0);
    assert_true(beacon_evidence_heard(&evidence, now_us));
    look_later(8500000);
    assert_true(beacon_evidence_heard(&evidence, now_us));
    look_later(1);
    assert_false(beacon_evidence_heard(&evidence, now_us));
}

static void nothing_was_heard_in_the_future(void **state)
{
    static const char *const words[] = {"1000001", "9999999999999999999", "x", "-1"};

    (void)state;
    for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
        report_heard(words[i]);
        look_later(0);
        assert_false(beacon_evidence_heard(&evidence, now_us));
        now_us += 20 * (int64_t)SECOND_US;
    }
}

static void an_old_report_is_no_evidence(void **state)
{
    (void)state;
    count(7);
    count(12);
    assert_int_equal(look_later(SECOND_US), BEACONS_SENT);
    for (int i = 0; i < 10; i++) {
        assert_int_equal(look_later(SECOND_US), BEACONS_UNKNOWN);
    }
}

static void nonsense_is_no_evidence(void **state)
{
    static const char *const lines[] = {
        "",
        "\n",
        "-",
        "9",
        "9999999999999 5 - seen\n",
        "999999999 5 - seen\n",
        "1000700 x - seen\n",
        "x 5 - seen\n",
        "1000800 5 -\n",
    };

    (void)state;
    count(7);
    assert_int_equal(count(12), BEACONS_SENT);
    now_us += 3 * (int64_t)SECOND_US;
    for (size_t i = 0; i < sizeof(lines) / sizeof(lines[0]); i++) {
        write_line(COUNT, lines[i]);
        assert_int_equal(look_later(0), BEACONS_UNKNOWN);
    }
    report("-"); /* nobody says how many by now */
    assert_int_equal(look_later(0), BEACONS_UNKNOWN);
}

/* Who writes the count isn't believed to write a file only. */
static void what_is_no_file_holds_nobody_up(void **state)
{
    (void)state;
    assert_int_equal(mkfifo(COUNT, 0644), 0);
    alarm(5);
    assert_int_equal(look_later(0), BEACONS_UNKNOWN);
    unlink(COUNT);
    assert_int_equal(symlink("/dev/zero", COUNT), 0);
    assert_int_equal(look_later(0), BEACONS_UNKNOWN);
    alarm(0);
}

static void an_interface_that_goes_down(void **state)
{
    (void)state;
    write_line(STATE, "down\n");
    assert_int_equal(look_later(5 * SECOND_US),
                     BEACONS_UNKNOWN); /* it never was up: no radio's, maybe */
    write_line(STATE, "up\n");
    assert_int_equal(look_later(SECOND_US), BEACONS_UNKNOWN);
    write_line(STATE, "down\n");
    assert_int_equal(look_later(SECOND_US), BEACONS_UNKNOWN);
    assert_int_equal(look_later(SECOND_US), BEACONS_NO_CARRIER);
    write_line(STATE, "up\n");
    assert_int_equal(look_later(0), BEACONS_UNKNOWN);
    unlink(STATE);
    assert_int_equal(look_later(2 * SECOND_US), BEACONS_NO_CARRIER);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(nothing_is_no_evidence),
        TEST(a_count_that_moves),
        TEST(a_count_that_stands),
        TEST(none_are_expected_of_what_has_just_been_switched_on),
        TEST(a_count_that_was_seen_to_be_none_of_beacons_is_no_evidence),
        TEST(what_is_told_again_is_no_silence),
        TEST(a_few_of_them_are_no_evidence_of_all),
        TEST(what_another_radio_hears),
        TEST(nothing_was_heard_in_the_future),
        TEST(an_old_report_is_no_evidence),
        TEST(nonsense_is_no_evidence),
        TEST(what_is_no_file_holds_nobody_up),
        TEST(an_interface_that_goes_down),
    };

    if (enter_own_folder() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, leave_own_folder);
}
