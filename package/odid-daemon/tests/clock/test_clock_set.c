/* Whether the clock is set, and to what. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "clock/clock_file.h"
#include "clock/clock_set.h"

#define S INT64_C(1000000)
/* 2026-11-21 10:00:00 UTC */
#define NOON (INT64_C(1795255200) * S)

static int64_t of_status(const char *status)
{
    return clock_of_status_us(status, strlen(status));
}

static void the_build_time_is_found_in_its_file(void **state)
{
    (void)state;
    assert_int_equal(clock_build_us("NAME=\"Remote ID\"\nVERSION=0.1\nBUILD_TIME=1795255200\n"
                                    "BOARD=qemu\n"),
                     NOON);
    assert_int_equal(clock_build_us("BUILD_TIME=1795255200"), NOON);
}

static void a_build_time_that_makes_no_sense_is_unknown(void **state)
{
    static const char *const wrong[] = {
        "",
        "NAME=x\n",
        "BUILD_TIME=\n",
        "BUILD_TIME=@BUILD_TIME@\n",
        "BUILD_TIME=2026-11-21\n",
        "BUILD_TIME=0\n",
        "BUILD_TIME=-1795255200\n",
        "BUILD_TIME=9999999999999999999999\n",
        "BUILD_TIME=1795255200000\n",
        "BUILD_TIME=1795255200 s\n",
        "XBUILD_TIME=1795255200\n",
    };

    (void)state;
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        assert_int_equal(clock_build_us(wrong[i]), CLOCK_UNKNOWN);
    }
}

static void it_starts_at_the_later_time(void **state)
{
    (void)state;
    assert_int_equal(clock_at_boot_us(NOON, NOON + S), NOON + S);
    assert_int_equal(clock_at_boot_us(NOON, NOON - S), NOON);
    assert_int_equal(clock_at_boot_us(NOON, CLOCK_UNKNOWN), NOON);
    assert_int_equal(clock_at_boot_us(CLOCK_UNKNOWN, NOON), NOON);
    assert_int_equal(clock_at_boot_us(CLOCK_UNKNOWN, CLOCK_UNKNOWN), CLOCK_UNKNOWN);
}

static void the_status_tells_the_middle_of_its_second(void **state)
{
    (void)state;
    assert_int_equal(of_status("{\"time\": {\"known\": true, \"utc\": \"2026-11-21T10:00:00Z\"}}"),
                     NOON + S / 2);
}

static void a_status_without_a_time_tells_none(void **state)
{
    static const char *const wrong[] = {
        "",
        "{",
        "[]",
        "7",
        "{}",
        "{\"time\": null}",
        "{\"time\": 7}",
        "{\"time\": {}}",
        "{\"time\": {\"known\": false, \"utc\": null}}",
        "{\"time\": {\"known\": false, \"utc\": \"2026-11-21T10:00:00Z\"}}",
        "{\"time\": {\"known\": true, \"utc\": null}}",
        "{\"time\": {\"known\": true, \"utc\": 1795255200}}",
        "{\"time\": {\"known\": true, \"utc\": \"\"}}",
        "{\"time\": {\"known\": true, \"utc\": \"2026-11-21T10:00:00\"}}",
        "{\"time\": {\"known\": true, \"utc\": \"2026-11-21T10:00:00Zx\"}}",
        "{\"time\": {\"known\": true, \"utc\": \"1970-01-01T00:00:00Z\"}}",
        "{\"time\": {\"known\": true, \"utc\": \"9999-01-01T00:00:00Z\"}}",
        "{\"time\": {\"known\": true, \"utc\": \"2026-11-21T10:00:00Z\"}", /* cut short */
    };

    (void)state;
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        assert_int_equal(of_status(wrong[i]), CLOCK_UNKNOWN);
    }
}

static void a_second_is_tolerated(void **state)
{
    (void)state;
    assert_false(clock_is_off(NOON, NOON, CLOCK_UNKNOWN));
    assert_false(clock_is_off(NOON - S, NOON, CLOCK_UNKNOWN));
    assert_false(clock_is_off(NOON + S, NOON, CLOCK_UNKNOWN));
    assert_true(clock_is_off(NOON - S - 1, NOON, CLOCK_UNKNOWN));
    assert_true(clock_is_off(NOON + S + 1, NOON, CLOCK_UNKNOWN));
    assert_true(clock_is_off(0, NOON, CLOCK_UNKNOWN));              /* 1970 */
    assert_true(clock_is_off(INT64_C(2147483648) * S, NOON, NOON)); /* 2038 */
}

static void a_time_before_the_build_or_none_sets_nothing(void **state)
{
    (void)state;
    assert_false(clock_is_off(0, NOON - 1, NOON));
    assert_true(clock_is_off(0, NOON, NOON));
    assert_false(clock_is_off(0, CLOCK_UNKNOWN, NOON));
    assert_false(clock_is_off(0, CLOCK_UNKNOWN, CLOCK_UNKNOWN));
}

/* Set by what the status tells, it isn't set again by the next one: nothing swings. */
static void once_set_it_stays(void **state)
{
    (void)state;
    for (int64_t phase_us = 0; phase_us < S; phase_us += S / 100) {
        int64_t told_us = NOON + S / 2; /* what is told of any instant of this second */
        int64_t error_us = told_us - (NOON + phase_us);

        for (int64_t later_us = 0; later_us < 3 * S; later_us += S / 50) {
            int64_t true_us = NOON + phase_us + later_us;

            assert_false(clock_is_off(true_us + error_us, true_us / S * S + S / 2, CLOCK_UNKNOWN));
        }
    }
}

static void what_was_saved_is_read(void **state)
{
    char path[] = "/tmp/odid-clock-XXXXXX";
    int64_t saved_us;

    (void)state;
    close(mkstemp(path));
    unlink(path);
    assert_int_equal(clock_file_read(path, &saved_us), -2 /* ENOENT */);
    assert_int_equal(saved_us, CLOCK_UNKNOWN);
    assert_int_equal(clock_file_save(path, NOON + 7), 0);
    assert_int_equal(clock_file_read(path, &saved_us), 0);
    assert_int_equal(saved_us, NOON + 7);
    assert_int_equal(clock_file_save(path, NOON - 7), 0); /* also back: it was wrong before */
    assert_int_equal(clock_file_read(path, &saved_us), 0);
    assert_int_equal(saved_us, NOON - 7);
    unlink(path);
    /* A damaged disk's: each power-on began in that year. */
    assert_int_equal(clock_file_save(path, INT64_C(10413792000) * 1000000), 0);
    assert_int_equal(clock_file_read(path, &saved_us), -34 /* ERANGE */);
    assert_true(saved_us == CLOCK_UNKNOWN);
    assert_int_equal(clock_file_save("/nonexistent/clock", NOON), -2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_build_time_is_found_in_its_file),
        cmocka_unit_test(a_build_time_that_makes_no_sense_is_unknown),
        cmocka_unit_test(it_starts_at_the_later_time),
        cmocka_unit_test(the_status_tells_the_middle_of_its_second),
        cmocka_unit_test(a_status_without_a_time_tells_none),
        cmocka_unit_test(a_second_is_tolerated),
        cmocka_unit_test(a_time_before_the_build_or_none_sets_nothing),
        cmocka_unit_test(once_set_it_stays),
        cmocka_unit_test(what_was_saved_is_read),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
