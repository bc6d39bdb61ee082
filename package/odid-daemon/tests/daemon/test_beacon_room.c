/* How many messages are given to a chip that refuses some. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "daemon/beacon_room.h"
#include "daemon/messages.h"

static struct beacon_room room;
static int64_t now_us;

static int set_up(void **state)
{
    (void)state;
    now_us = 1000000000;
    beacon_room_forget(&room);
    return 0;
}

static void refuse_twice(unsigned given)
{
    for (unsigned i = 0; i < 2; i++) {
        beacon_room_refused(&room, given, now_us);
        now_us += 125000;
    }
}

/* A ground station's signature makes it nine: Self-ID went with it. */
static void what_fitted_before_is_what_is_given(void **state)
{
    (void)state;
    beacon_room_taken(&room, 6, now_us);
    refuse_twice(9);
    assert_int_equal(room.most, 6);
    now_us += 10000000;
    beacon_room_taken(&room, 6, now_us);
    assert_int_equal(room.most, MESSAGES_PACK_MAX);
    assert_true(beacon_room_is_trial(&room, 9));
    beacon_room_refused(&room, 9, now_us);
    assert_int_equal(room.most, 6);
}

/* It was another firmware then. */
static void what_fitted_and_is_refused_now_fitted_no_more(void **state)
{
    (void)state;
    beacon_room_taken(&room, 6, now_us);
    refuse_twice(6);
    assert_int_equal(room.most, 4);
    refuse_twice(4);
    assert_int_equal(room.most, 1);
}

/* With three there were no System. */
static void three_that_fitted_are_no_measure(void **state)
{
    (void)state;
    beacon_room_taken(&room, 3, now_us);
    refuse_twice(9);
    assert_int_equal(room.most, 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(what_fitted_before_is_what_is_given, set_up),
        cmocka_unit_test_setup(what_fitted_and_is_refused_now_fitted_no_more, set_up),
        cmocka_unit_test_setup(three_that_fitted_are_no_measure, set_up),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
