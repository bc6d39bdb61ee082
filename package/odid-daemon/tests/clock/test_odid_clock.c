/* When odid-clock saves the time: its main program, with clocks, a status and a wait that are
 * played. (The program as it is: test_clock_set_program.c.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <signal.h>
#include <sys/types.h>
#include <time.h>

static int model_gettime(clockid_t which, struct timespec *now);
static int model_settime(clockid_t which, const struct timespec *now);
static int model_wait(const sigset_t *set, siginfo_t *info, const struct timespec *pause);
int clock_main(int argc, char *argv[]);

#define clock_gettime model_gettime
#define clock_settime model_settime
#define status_ask model_ask
#define sigtimedwait model_wait
#define clock_file_save model_save
#define clock_file_read model_read
#define main clock_main
#include "clock/odid_clock_main.c"
#undef main

#define NOW INT64_C(1800000000) /* s; the clock at the start */
#define YEAR (INT64_C(366) * 86400)

/* ---- the models ---- */

/* What the autopilot says from a second on, from the start; 0: nothing more. */
static const struct said {
    int64_t from_s, is_ahead_s;
} * said;

static int64_t passed_s, clock_s, end_s, saved_s[8];
static int64_t file_is_ahead_s; /* what is saved already; 0: nothing */
static unsigned saves;

static int model_gettime(clockid_t which, struct timespec *now)
{
    *now = (struct timespec){.tv_sec = which == CLOCK_REALTIME ? clock_s : passed_s};
    return 0;
}

static int model_settime(clockid_t which, const struct timespec *now)
{
    (void)which;
    clock_s = now->tv_sec;
    return 0;
}

ssize_t model_ask(const char *directory, int patience_ms, char answer[STATUS_ANSWER_MAX])
{
    const struct said *now = NULL;
    char utc[32];
    time_t told;
    struct tm parts;

    (void)directory, (void)patience_ms;
    for (const struct said *next = said; next->from_s <= passed_s && next->from_s >= 0; next++) {
        now = next;
    }
    if (now == NULL) {
        return -ENOENT;
    }
    told = NOW + passed_s + now->is_ahead_s;
    strftime(utc, sizeof(utc), "%Y-%m-%dT%H:%M:%SZ", gmtime_r(&told, &parts));
    return snprintf(answer, STATUS_ANSWER_MAX, "{\"time\": {\"known\": true, \"utc\": \"%s\"}}",
                    utc);
}

static int model_wait(const sigset_t *set, siginfo_t *info, const struct timespec *pause)
{
    (void)set, (void)info;
    passed_s += pause->tv_sec;
    clock_s += pause->tv_sec;
    return passed_s >= end_s ? SIGTERM : -1;
}

int model_save(const char *path, int64_t now_us)
{
    (void)path;
    assert_true(saves < sizeof(saved_s) / sizeof(saved_s[0]));
    saved_s[saves++] = now_us / SECOND_US - NOW - passed_s;
    return 0;
}

int model_read(const char *path, int64_t *saved_us)
{
    (void)path;
    *saved_us = (NOW + passed_s + file_is_ahead_s) * SECOND_US;
    return file_is_ahead_s == 0 ? -ENOENT : 0;
}

/* ---- tests ---- */

/* The times that were saved, as they differ from the clock at the start. */
#define EXPECT_SAVED(...)                                                                          \
    do {                                                                                           \
        static const int64_t expected[] = {__VA_ARGS__};                                           \
                                                                                                   \
        assert_int_equal(saves, sizeof(expected) / sizeof(expected[0]));                           \
        for (unsigned i = 0; i < saves; i++) {                                                     \
            assert_in_range(saved_s[i] - expected[i] + 1, 0, 2);                                   \
        }                                                                                          \
    } while (0)

/* Up to the second of its end. said: its last one from -1 on. */
static void serve_until(int64_t second, const struct said *autopilot)
{
    self.was_set = false;
    self.save_us = 0;
    self.build_us = (NOW - 3 * YEAR) * SECOND_US;
    said = autopilot;
    passed_s = 0;
    clock_s = NOW;
    end_s = second;
    saves = 0;
    assert_int_equal(follow_autopilot(), EXIT_SUCCESS);
}

static void without_an_autopilot_it_is_saved_every_ten_minutes_and_at_the_end(void **state)
{
    (void)state;
    serve_until(1300, (const struct said[]){{-1, 0}});
    EXPECT_SAVED(0, 0, 0);
}

/* As at every start of a board that was switched off for weeks: it may be on for a few minutes
 * only. */
static void a_time_that_lies_some_months_ahead_is_saved_at_once(void **state)
{
    (void)state;
    serve_until(100, (const struct said[]){{3, YEAR / 3}, {-1, 0}});
    EXPECT_SAVED(YEAR / 3, YEAR / 3);
}

/* Every later start began in the year that somebody had forged. */
static void a_time_that_lies_far_ahead_is_saved_once_it_has_stood(void **state)
{
    (void)state;
    serve_until(500, (const struct said[]){{3, YEAR}, {-1, 0}});
    assert_int_equal(saves, 0);
    serve_until(650, (const struct said[]){{3, YEAR}, {-1, 0}});
    EXPECT_SAVED(YEAR, YEAR);
    serve_until(900, (const struct said[]){{3, YEAR}, {500, 0}, {-1, 0}});
    EXPECT_SAVED(0, 0);
    /* Nor by a step back from it. */
    serve_until(500, (const struct said[]){{3, YEAR}, {300, YEAR - 5}, {-1, 0}});
    assert_int_equal(saves, 0);
}

/* Each step was of some months, and saved at once: forty years in a quarter of an hour. */
static void nor_is_one_that_is_reached_by_many_steps(void **state)
{
    (void)state;
    serve_until(100, (const struct said[]){{3, YEAR / 3},
                                           {20, YEAR * 2 / 3},
                                           {40, YEAR},
                                           {60, YEAR * 4 / 3},
                                           {80, YEAR * 5 / 3},
                                           {-1, 0}});
    EXPECT_SAVED(YEAR / 3);
}

/* /data was late, and it began with the build's time: no server's certificate was valid yet. */
static void a_later_one_that_was_saved_before_counts_until_somebody_tells_the_time(void **state)
{
    (void)state;
    file_is_ahead_s = YEAR;
    serve_until(5, (const struct said[]){{-1, 0}});
    assert_true(clock_s >= NOW + YEAR);
    serve_until(650, (const struct said[]){{-1, 0}});
    EXPECT_SAVED(YEAR, YEAR);
    serve_until(650, (const struct said[]){{3, 5}, {-1, 0}});
    EXPECT_SAVED(5, 5, 5);
    file_is_ahead_s = 0;
}

static void a_time_that_lies_behind_puts_right_what_was_saved_at_once(void **state)
{
    (void)state;
    serve_until(100, (const struct said[]){{3, -YEAR}, {-1, 0}});
    EXPECT_SAVED(-YEAR, -YEAR);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_an_autopilot_it_is_saved_every_ten_minutes_and_at_the_end),
        cmocka_unit_test(a_time_that_lies_some_months_ahead_is_saved_at_once),
        cmocka_unit_test(a_time_that_lies_far_ahead_is_saved_once_it_has_stood),
        cmocka_unit_test(nor_is_one_that_is_reached_by_many_steps),
        cmocka_unit_test(a_later_one_that_was_saved_before_counts_until_somebody_tells_the_time),
        cmocka_unit_test(a_time_that_lies_behind_puts_right_what_was_saved_at_once),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
