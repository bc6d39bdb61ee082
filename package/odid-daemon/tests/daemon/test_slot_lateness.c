/* How late the slots were, as a percentile. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "daemon/slot_lateness.h"

static struct slot_lateness lateness;

static void nothing_was_measured(void **state)
{
    (void)state;
    assert_int_equal(slot_lateness_p99_us(&lateness), -1);
}

static void the_percentile(void **state)
{
    (void)state;
    slot_lateness_add(&lateness, 20, 0);
    assert_int_equal(slot_lateness_p99_us(&lateness), 20); /* never more than the maximum */
    for (int i = 0; i < 98; i++) {
        slot_lateness_add(&lateness, 120, 0);
    }
    assert_int_equal(slot_lateness_p99_us(&lateness), 120);
    slot_lateness_add(&lateness, 40000, 2);
    assert_int_equal(lateness.slots, 100);
    assert_int_equal(lateness.skipped, 2);
    assert_int_equal(lateness.max_us, 40000);
    assert_int_equal(slot_lateness_p99_us(&lateness), 150); /* the bucket's end */
    /* A machine that is late by some milliseconds was said to be as late as it ever was. */
    for (int i = 0; i < 100; i++) {
        slot_lateness_add(&lateness, 3199, 0);
    }
    assert_int_equal(slot_lateness_p99_us(&lateness), 3200);
    for (int i = 0; i < 100; i++) {
        slot_lateness_add(&lateness, 3701, 0);
    }
    assert_int_equal(slot_lateness_p99_us(&lateness), 3800);
    for (int i = 0; i < 100; i++) {
        slot_lateness_add(&lateness, 15800, 0);
    }
    assert_int_equal(slot_lateness_p99_us(&lateness), 40000); /* the last bucket has no end */
    slot_lateness_add(&lateness, -5, 0);
    assert_int_equal(lateness.histogram[0], 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_was_measured),
        cmocka_unit_test(the_percentile),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
