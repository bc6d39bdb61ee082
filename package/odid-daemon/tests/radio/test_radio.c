/* What a channel tells about itself, and the retry it lives by. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "radio/radio.h"

static void the_time_of_a_state_is_that_of_its_beginning(void **state)
{
    struct radio radio;

    (void)state;
    radio_init(&radio, RADIO_STARTING, 5);
    assert_int_equal(radio.since_us, 5);
    assert_int_equal(radio.accepted_us, INT64_MIN);
    radio_enter(&radio, CHANNEL_BT4, RADIO_ON_AIR, "every 20 ms", 10);
    radio_enter(&radio, CHANNEL_BT4, RADIO_ON_AIR, "every 100 ms", 20);
    assert_int_equal(radio.since_us, 10);
    assert_int_equal(radio.starts, 1);
    assert_true(radio.was_on_air);
    assert_string_equal(radio.detail, "every 100 ms");
    radio_enter(&radio, CHANNEL_BT4, RADIO_LOST, NULL, 30);
    assert_string_equal(radio.detail, "every 100 ms");
    radio_enter(&radio, CHANNEL_BT4, RADIO_ON_AIR, NULL, 40);
    assert_int_equal(radio.starts, 2);
    assert_false(radio_accepted(&radio, CHANNEL_BT4, 50));
    radio_confirmed(&radio, 50);
    assert_int_equal(radio.accepted_us, 50);
    assert_int_equal(radio.payloads, 1);
}

static void a_pause_ends_what_was_unbroken(void **state)
{
    struct radio radio;

    (void)state;
    radio_init(&radio, RADIO_STARTING, 5);
    assert_int_equal(radio.confirmed_us, INT64_MIN);
    assert_int_equal(radio.unbroken_us, INT64_MIN);
    radio_accepted(&radio, CHANNEL_BT4, 50);
    radio_confirmed(&radio, 50);
    assert_int_equal(radio.unbroken_us, 50);
    radio_confirmed(&radio, 50 + RADIO_PAUSE_US);
    assert_int_equal(radio.unbroken_us, 50);
    assert_int_equal(radio.confirmed_us, 50 + RADIO_PAUSE_US);
    assert_int_equal(radio.accepted_us, 50);
    radio_accepted(&radio, CHANNEL_BT4, 51 + 2 * RADIO_PAUSE_US);
    radio_confirmed(&radio, 51 + 2 * RADIO_PAUSE_US);
    assert_int_equal(radio.unbroken_us, 51 + 2 * RADIO_PAUSE_US);
    assert_int_equal(radio.paused_us, 50 + RADIO_PAUSE_US);
}

static void what_was_denied_is_not_confirmed(void **state)
{
    struct radio radio;

    (void)state;
    radio_init(&radio, RADIO_STARTING, 5);
    radio_denied(&radio, 50);
    assert_int_equal(radio.confirmed_us, INT64_MIN);
    radio_confirmed(&radio, 100);
    radio_confirmed(&radio, 200);
    radio_denied(&radio, 250);
    assert_int_equal(radio.confirmed_us, 200);
    radio_denied(&radio, 150);
    assert_int_equal(radio.confirmed_us, 150);
    radio_denied(&radio, 50); /* the gap before has ended all the same */
    assert_int_equal(radio.confirmed_us, 100);
    assert_int_equal(radio.unbroken_us, 100);
}

static void who_was_on_the_air_and_stays_away_is_stuck(void **state)
{
    static const enum radio_state away[] = {RADIO_ABSENT, RADIO_DOWN, RADIO_LOST};
    static const enum radio_state told[] = {RADIO_DISABLED, RADIO_UNSUPPORTED, RADIO_BLOCKED,
                                            RADIO_STARTING};
    int64_t late_us = 100 + RADIO_STUCK_US;
    struct radio radio;

    (void)state;
    radio_init(&radio, RADIO_STARTING, 5);
    radio_enter(&radio, CHANNEL_WIFI, RADIO_LOST, "never was there", 10);
    assert_false(radio_stuck(&radio, late_us));
    radio.given_up = true;
    assert_true(radio_stuck(&radio, 20));
    radio.given_up = false;
    radio_enter(&radio, CHANNEL_WIFI, RADIO_ON_AIR, NULL, 50);
    radio_confirmed(&radio, 100);
    for (int i = 0; i < 3; i++) { /* to and fro, for less time each */
        radio_enter(&radio, CHANNEL_WIFI, away[i], NULL, 200 + i);
        assert_false(radio_stuck(&radio, late_us));
        assert_true(radio_stuck(&radio, late_us + 1));
    }
    radio.given_up = true;
    for (int i = 0; i < 4; i++) {
        radio_enter(&radio, CHANNEL_WIFI, told[i], NULL, 300 + i);
        assert_false(radio_stuck(&radio, 2 * late_us));
    }
    radio_enter(&radio, CHANNEL_WIFI, RADIO_ON_AIR, NULL, 2 * late_us);
    assert_false(radio_stuck(&radio, 2 * late_us));
    assert_true(radio_stuck(&radio, 3 * late_us)); /* it answers, and nothing goes out */
}

/* Of a daemon before this one: this one's time counts. */
static void who_was_on_the_air_before_has_its_time(void **state)
{
    struct radio radio;

    (void)state;
    radio_init(&radio, RADIO_ABSENT, 5);
    radio.was_on_air = true;
    assert_false(radio_stuck(&radio, 5 + RADIO_STUCK_US));
    assert_true(radio_stuck(&radio, 6 + RADIO_STUCK_US));
}

static void a_long_detail_is_cut(void **state)
{
    struct radio radio;
    char text[300];

    (void)state;
    memset(text, 'x', sizeof(text));
    text[sizeof(text) - 1] = '\0';
    radio_init(&radio, RADIO_STARTING, 0);
    radio_enter(&radio, CHANNEL_WIFI, RADIO_LOST, text, 1);
    assert_int_equal(strlen(radio.detail), RADIO_DETAIL_SIZE - 1);
}

static void retries_become_rarer_up_to_once_a_second(void **state)
{
    struct retry retry = {0};

    (void)state;
    assert_int_equal(retry_next(&retry, 7), 250007);
    assert_int_equal(retry_next(&retry, 0), 500000);
    for (int i = 0; i < 100; i++) {
        assert_int_equal(retry_next(&retry, 0), 1000000);
    }
    retry_reset(&retry);
    assert_int_equal(retry_next(&retry, 0), 250000);
}

static void everything_has_a_name(void **state)
{
    (void)state;
    for (enum radio_state radio = RADIO_DISABLED; radio <= RADIO_LOST; radio++) {
        assert_non_null(radio_state_name(radio));
    }
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        assert_non_null(channel_name(channel));
        assert_non_null(channel_title(channel));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_time_of_a_state_is_that_of_its_beginning),
        cmocka_unit_test(a_pause_ends_what_was_unbroken),
        cmocka_unit_test(what_was_denied_is_not_confirmed),
        cmocka_unit_test(who_was_on_the_air_and_stays_away_is_stuck),
        cmocka_unit_test(who_was_on_the_air_before_has_its_time),
        cmocka_unit_test(a_long_detail_is_cut),
        cmocka_unit_test(retries_become_rarer_up_to_once_a_second),
        cmocka_unit_test(everything_has_a_name),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
