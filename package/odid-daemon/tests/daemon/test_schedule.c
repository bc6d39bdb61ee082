/* Which message goes out when, on time, late, and after a standstill. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "daemon/schedule.h"

#define SECOND INT64_C(1000000)
#define MS INT64_C(1000)
#define START (1234 * SECOND + 567)

static struct schedule schedule;
static unsigned available[MESSAGE_TYPES];

static int setup(void **state)
{
    (void)state;
    for (unsigned type = 0; type < MESSAGE_TYPES; type++) {
        available[type] = type == MESSAGE_AUTHENTICATION ? 0 : 1;
    }
    schedule_start(&schedule, START);
    return 0;
}

/* The next slot, on time. */
static struct schedule_entry next(void)
{
    return schedule_next(&schedule, schedule_deadline(&schedule), available);
}

static void assert_cycle(const enum message_type expected[SCHEDULE_SLOTS])
{
    for (unsigned i = 0; i < SCHEDULE_SLOTS; i++) {
        struct schedule_entry entry = next();

        assert_int_equal(entry.type, expected[i]);
        assert_int_equal(entry.index, 0);
        assert_true(entry.late_us == 0);
        assert_int_equal(entry.skipped, 0);
    }
}

static void a_cycle_has_eight_slots_of_125_ms(void **state)
{
    static const enum message_type cycle[] = {
        MESSAGE_LOCATION, MESSAGE_BASIC_ID,    MESSAGE_LOCATION, MESSAGE_SYSTEM,
        MESSAGE_LOCATION, MESSAGE_OPERATOR_ID, MESSAGE_LOCATION, MESSAGE_SELF_ID};

    (void)state;
    assert_true(schedule_deadline(&schedule) == START);
    for (unsigned n = 0; n < 100; n++) {
        assert_cycle(cycle);
        assert_true(schedule_deadline(&schedule) == START + (n + 1) * SECOND);
    }
}

static void an_absent_message_gives_its_slot_to_location(void **state)
{
    static const enum message_type slots[] = {MESSAGE_BASIC_ID, MESSAGE_SYSTEM, MESSAGE_OPERATOR_ID,
                                              MESSAGE_SELF_ID};

    (void)state;
    for (unsigned absent = 0; absent < 16; absent++) {
        enum message_type cycle[SCHEDULE_SLOTS];

        setup(NULL);
        for (unsigned i = 0; i < 4; i++) {
            available[slots[i]] = absent >> i & 1 ? 0 : 1;
            cycle[2 * i] = MESSAGE_LOCATION;
            cycle[2 * i + 1] = absent >> i & 1 ? MESSAGE_LOCATION : slots[i];
        }
        assert_cycle(cycle);
    }
}

static void two_basic_ids_take_turns_in_their_slot(void **state)
{
    (void)state;
    available[MESSAGE_BASIC_ID] = 2;
    for (unsigned cycle = 0; cycle < 10; cycle++) {
        for (unsigned i = 0; i < SCHEDULE_SLOTS; i++) {
            struct schedule_entry entry = next();

            assert_int_equal(entry.index, i == 1 ? cycle % 2 : 0);
            assert_true(i != 1 || entry.type == MESSAGE_BASIC_ID);
        }
    }
}

static void authentication_pages_take_turns_with_self_id(void **state)
{
    unsigned expected_page = 0;

    (void)state;
    available[MESSAGE_AUTHENTICATION] = 3;
    for (unsigned cycle = 0; cycle < 24; cycle++) {
        struct schedule_entry entry;

        for (unsigned i = 0; i < 7; i++) {
            entry = next();
            assert_int_not_equal(entry.type, MESSAGE_AUTHENTICATION);
        }
        entry = next();
        if (cycle % 2 == 0) {
            assert_int_equal(entry.type, MESSAGE_SELF_ID);
            assert_int_equal(entry.index, 0);
        } else {
            assert_int_equal(entry.type, MESSAGE_AUTHENTICATION);
            assert_int_equal(entry.index, expected_page++ % 3);
        }
    }
}

static void authentication_has_the_slot_alone_without_a_self_id(void **state)
{
    (void)state;
    available[MESSAGE_AUTHENTICATION] = 16;
    available[MESSAGE_SELF_ID] = 0;
    for (unsigned cycle = 0; cycle < 40; cycle++) {
        struct schedule_entry entry;

        for (unsigned i = 0; i < 8; i++) {
            entry = next();
        }
        assert_int_equal(entry.type, MESSAGE_AUTHENTICATION);
        assert_int_equal(entry.index, cycle % 16);
    }
}

/* What is available may change from slot to slot: an index never exceeds it. */
static void an_index_is_always_of_a_message_that_exists(void **state)
{
    unsigned seed = 1;

    (void)state;
    for (unsigned i = 0; i < 100000; i++) {
        struct schedule_entry entry;

        seed = seed * 1103515245U + 12345U;
        available[MESSAGE_BASIC_ID] = (seed >> 16) % 3;
        available[MESSAGE_AUTHENTICATION] = (seed >> 18) % 17;
        available[MESSAGE_SELF_ID] = (seed >> 23) % 2;
        available[MESSAGE_OPERATOR_ID] = (seed >> 24) % 2;
        entry = next();
        assert_true(entry.index < available[entry.type]);
    }
}

/* ---- late ---- */

static void a_late_slot_ends_on_the_grid(void **state)
{
    (void)state;
    for (int64_t late = 0; late < SCHEDULE_SLOT_US; late += 1234) {
        struct schedule_entry entry;

        setup(NULL);
        entry = schedule_next(&schedule, START + late, available);
        assert_int_equal(entry.type, MESSAGE_LOCATION);
        assert_true(entry.until_us == START + SCHEDULE_SLOT_US);
        assert_true(entry.late_us == late);
        assert_int_equal(entry.skipped, 0);
        entry = next();
        assert_int_equal(entry.type, MESSAGE_BASIC_ID);
        assert_true(entry.until_us == START + 2 * SCHEDULE_SLOT_US);
    }
}

static void whole_slots_that_passed_are_skipped_and_never_made_up_for(void **state)
{
    (void)state;
    for (unsigned skipped = 1; skipped < 100; skipped++) {
        int64_t now = START + skipped * SCHEDULE_SLOT_US + 3 * MS;
        struct schedule_entry entry;

        setup(NULL);
        entry = schedule_next(&schedule, now, available);
        assert_int_equal(entry.skipped, skipped);
        assert_int_equal(entry.type, MESSAGE_LOCATION); /* its turn still */
        assert_true(entry.late_us == skipped * SCHEDULE_SLOT_US + 3 * MS);
        assert_true(entry.until_us == START + (skipped + 1) * SCHEDULE_SLOT_US);
        assert_true(entry.until_us > now);
    }
}

static void a_standstill_of_days_is_followed_by_one_slot(void **state)
{
    struct schedule_entry entry;
    int64_t now = START + 40 * 86400 * SECOND + 77;

    (void)state;
    entry = schedule_next(&schedule, now, available);
    assert_true(entry.until_us > now && entry.until_us <= now + SCHEDULE_SLOT_US);
    assert_true(schedule_deadline(&schedule) == entry.until_us);
}

/* Whatever pattern: of each message the limits hold (3 s; Location 1 s), as long as every second
 * slot is served. */
static void half_of_all_slots_lost_breaks_no_limit(void **state)
{
    unsigned seed = 7;

    (void)state;
    for (unsigned run = 0; run < 200; run++) {
        int64_t heard_us[MESSAGE_TYPES] = {0};

        setup(NULL);
        for (unsigned served = 0; served < 1000; served++) {
            unsigned lost = run == 0 ? 1 : (seed = seed * 1103515245U + 12345U) >> 16 & 1;
            int64_t now_us = schedule_deadline(&schedule) + lost * SCHEDULE_SLOT_US;
            struct schedule_entry entry = schedule_next(&schedule, now_us, available);
            int64_t limit_us = entry.type == MESSAGE_LOCATION ? SECOND : 3 * SECOND;

            assert_true(served < 8 || now_us - heard_us[entry.type] < limit_us);
            heard_us[entry.type] = now_us;
        }
    }
}

static void what_is_withdrawn_has_its_turn_again(void **state)
{
    static const enum message_type cycle[] = {
        MESSAGE_LOCATION, MESSAGE_BASIC_ID,    MESSAGE_LOCATION, MESSAGE_SYSTEM,
        MESSAGE_LOCATION, MESSAGE_OPERATOR_ID, MESSAGE_LOCATION, MESSAGE_SELF_ID};

    (void)state;
    schedule_withdraw(&schedule); /* nothing was given yet */
    for (unsigned i = 0; i < 4 * SCHEDULE_SLOTS; i++) {
        assert_int_equal(next().type, cycle[i % SCHEDULE_SLOTS]);
        for (unsigned again = 0; again < i % 3; again++) {
            schedule_withdraw(&schedule);
            assert_int_equal(next().type, cycle[i % SCHEDULE_SLOTS]);
        }
    }
}

/* As the loop does it: wakes at or after the deadline, for an hour. */
static void an_hour_with_lateness_up_to_40_ms_misses_no_rate(void **state)
{
    int64_t heard_us[MESSAGE_TYPES], longest_us[MESSAGE_TYPES] = {0}, until_us = START;
    unsigned seed = 42, bursts = 0;

    (void)state;
    for (unsigned type = 0; type < MESSAGE_TYPES; type++) {
        heard_us[type] = START;
    }
    while (until_us < START + 3600 * SECOND) {
        struct schedule_entry entry;
        int64_t now_us;

        seed = seed * 1103515245U + 12345U;
        now_us = until_us + (seed >> 16) % 40001;
        entry = schedule_next(&schedule, now_us, available);
        assert_int_equal(entry.skipped, 0);
        bursts += entry.until_us - now_us < SCHEDULE_SLOT_US - 40 * MS;
        if (now_us - heard_us[entry.type] > longest_us[entry.type]) {
            longest_us[entry.type] = now_us - heard_us[entry.type];
        }
        heard_us[entry.type] = now_us;
        until_us = entry.until_us;
    }
    assert_int_equal(bursts, 0);
    assert_true(longest_us[MESSAGE_LOCATION] <= SECOND / 4 + 40 * MS);
    assert_true(longest_us[MESSAGE_BASIC_ID] <= SECOND + 40 * MS);
    assert_true(longest_us[MESSAGE_SYSTEM] <= SECOND + 40 * MS);
    assert_true(longest_us[MESSAGE_OPERATOR_ID] <= SECOND + 40 * MS);
    assert_true(longest_us[MESSAGE_SELF_ID] <= SECOND + 40 * MS);
}

static void on_time_every_payload_stays_for_its_whole_slot(void **state)
{
    unsigned count[MESSAGE_TYPES] = {0};

    (void)state;
    for (int64_t slot = 0; slot < 3600 * 8; slot++) {
        int64_t now_us = schedule_deadline(&schedule);
        struct schedule_entry entry = schedule_next(&schedule, now_us, available);

        assert_true(entry.until_us - now_us == SCHEDULE_SLOT_US);
        assert_true(entry.until_us - now_us >= 110 * MS); /* interval and random delay */
        assert_true(entry.until_us == START + (slot + 1) * SCHEDULE_SLOT_US); /* no drift */
        count[entry.type]++;
    }
    assert_int_equal(count[MESSAGE_LOCATION], 4 * 3600);
    assert_int_equal(count[MESSAGE_BASIC_ID], 3600);
    assert_int_equal(count[MESSAGE_SYSTEM], 3600);
    assert_int_equal(count[MESSAGE_OPERATOR_ID], 3600);
    assert_int_equal(count[MESSAGE_SELF_ID], 3600);
}

/* A timer that fires a little early must not use up a slot of its own. */
static void coming_early_shifts_nothing(void **state)
{
    struct schedule_entry entry = schedule_next(&schedule, START - 300, available);

    (void)state;
    assert_int_equal(entry.type, MESSAGE_LOCATION);
    assert_true(entry.late_us == 0);
    assert_int_equal(entry.skipped, 0);
    assert_true(entry.until_us == START + SCHEDULE_SLOT_US);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_cycle_has_eight_slots_of_125_ms, setup),
        cmocka_unit_test_setup(an_absent_message_gives_its_slot_to_location, setup),
        cmocka_unit_test_setup(two_basic_ids_take_turns_in_their_slot, setup),
        cmocka_unit_test_setup(authentication_pages_take_turns_with_self_id, setup),
        cmocka_unit_test_setup(authentication_has_the_slot_alone_without_a_self_id, setup),
        cmocka_unit_test_setup(an_index_is_always_of_a_message_that_exists, setup),
        cmocka_unit_test_setup(a_late_slot_ends_on_the_grid, setup),
        cmocka_unit_test_setup(whole_slots_that_passed_are_skipped_and_never_made_up_for, setup),
        cmocka_unit_test_setup(a_standstill_of_days_is_followed_by_one_slot, setup),
        cmocka_unit_test_setup(half_of_all_slots_lost_breaks_no_limit, setup),
        cmocka_unit_test_setup(what_is_withdrawn_has_its_turn_again, setup),
        cmocka_unit_test_setup(an_hour_with_lateness_up_to_40_ms_misses_no_rate, setup),
        cmocka_unit_test_setup(on_time_every_payload_stays_for_its_whole_slot, setup),
        cmocka_unit_test_setup(coming_early_shifts_nothing, setup),
    };

    return cmocka_run_group_tests_name("schedule", tests, NULL, NULL);
}
