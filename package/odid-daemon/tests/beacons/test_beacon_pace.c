/* Whether a number is that of beacons: by its pace. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "beacons/beacon_pace.h"

#define REPORTS 8

/* Half a second from one to the next. */
static bool seen_in(const uint32_t *counts)
{
    struct beacon_pace pace = {.began = false};

    for (int i = 0; i < REPORTS; i++) {
        beacon_pace_take(&pace, counts[i], 1000 + 500 * i);
    }
    return pace.seen;
}

static void beacons_are_seen(void **state)
{
    static const uint32_t counts[][REPORTS] = {
        {0, 5, 10, 15, 15, 15, 15, 15},
        {7, 7, 7, 10, 14, 18, 18, 18},    /* some are kept from the air */
        {900, 905, 0, 5, 10, 15, 15, 15}, /* its firmware begins anew */
        {3, 4, 5, 6, 11, 16, 21, 21},     /* after a while of few */
    };

    (void)state;
    for (size_t i = 0; i < sizeof(counts) / sizeof(counts[0]); i++) {
        assert_true(seen_in(counts[i]));
    }
}

static void what_moves_otherwise_is_something_else(void **state)
{
    static const uint32_t counts[][REPORTS] = {
        {9, 9, 9, 9, 9, 9, 9, 9},
        {0, 1, 2, 3, 4, 5, 6, 7},
        {0, 100, 200, 300, 400, 500, 600, 700},
        {0, 5, 10, 10, 15, 20, 20, 25},               /* never three times in a row */
        {UINT32_MAX, 4, 9, 3000000000U, 1, 6, 11, 1}, /* of no pace at all */
    };

    (void)state;
    for (size_t i = 0; i < sizeof(counts) / sizeof(counts[0]); i++) {
        assert_false(seen_in(counts[i]));
    }
}

static void at_one_instant_there_is_no_pace(void **state)
{
    struct beacon_pace pace = {.began = false};

    (void)state;
    for (uint32_t i = 0; i < 10; i++) {
        beacon_pace_take(&pace, 5 * i, 1000);
    }
    assert_false(pace.seen);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(beacons_are_seen),
        cmocka_unit_test(what_moves_otherwise_is_something_else),
        cmocka_unit_test(at_one_instant_there_is_no_pace),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
