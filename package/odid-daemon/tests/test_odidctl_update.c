/* Which of a stick's files is tried again: what "odidctl update DIR" remembers. (Giving one to
 * SWUpdate: tests/update.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "odidctl_update.c"
#include "own_folder.h"

static const struct odidctl_places places = {.data = "data", .state = "state"};

/* A file of that many octets is offered; written at one and the same time, or it would be another.
 */
static bool is_left_alone(unsigned octets, char identity[UPDATE_IDENTITY_SIZE])
{
    static const struct timespec written[2] = {{.tv_sec = 1}, {.tv_sec = 1}};
    static char text[32];

    assert_int_equal(whole_file_replace("stick/odid.swu", text, octets, 0644), 0);
    assert_int_equal(utimensat(AT_FDCWD, "stick/odid.swu", written, 0), 0);
    return is_tried_again(&places, "stick/odid.swu", identity);
}

static void switch_off_and_on(void)
{
    unlink("state/" UPDATE_STICK_FAILURES_FILE);
}

/* Two of them took turns: each was forgotten for the other one, at each power-on. */
static void the_last_eight_files_that_came_to_nothing_are_left_alone(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    for (unsigned octets = 1; octets <= 9; octets++) {
        assert_false(is_left_alone(octets, identity));
        remember_failure(&places, identity);
        switch_off_and_on();
    }
    for (unsigned octets = 9; octets >= 2; octets--) {
        assert_true(is_left_alone(octets, identity));
    }
    assert_false(is_left_alone(1, identity));
}

static void after_two_of_them_none_is_tried_until_power_off(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    for (unsigned octets = 11; octets <= 12; octets++) {
        assert_false(is_left_alone(octets, identity));
        remember_failure(&places, identity);
    }
    assert_true(is_left_alone(13, identity));
    switch_off_and_on();
    assert_false(is_left_alone(13, identity));
}

static int in_a_folder(void **state)
{
    (void)state;
    return enter_own_folder() < 0 || system("mkdir -p data/odid state stick") != 0 ? -1 : 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_eight_files_that_came_to_nothing_are_left_alone),
        cmocka_unit_test(after_two_of_them_none_is_tried_until_power_off),
    };

    return cmocka_run_group_tests(tests, in_a_folder, leave_own_folder);
}
