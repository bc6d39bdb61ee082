/* Controllers that hang, and that are reset without a word: what is tried, and in which order. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "bluetooth_bench.h"

#include "radio/hci_kernel.h"

/* A MODEL of the kernel's interface hci0, over the fake controller. */
static struct {
    bool is_there, is_set_up, is_up, comes_up;
    bool heals; /* the controller, by being put down */
    unsigned downs, ups;
} kernel;

int hci_kernel_open(int dev_id, bool *down_first)
{
    assert_int_equal(dev_id, 0);
    if (!kernel.is_there) {
        return -ENODEV;
    }
    if (!kernel.is_set_up) {
        return -EINPROGRESS;
    }
    if (!kernel.is_up) {
        *down_first = false;
        kernel.ups++;
        kernel.is_up = kernel.comes_up;
        return -EAGAIN;
    }
    if (*down_first) {
        kernel.downs++;
        kernel.is_up = false;
        fake.mute = fake.mute && !kernel.heals;
        return -EAGAIN;
    }
    return fake_open(&fake);
}

static void start_behind_the_kernel(uint64_t features)
{
    memset(&kernel, 0, sizeof(kernel));
    kernel.is_there = kernel.is_set_up = kernel.is_up = kernel.comes_up = true;
    start(features);
    snprintf(config.bt_adapter, sizeof(config.bt_adapter), "hci0");
}

static void go_on_air(uint64_t features)
{
    start_behind_the_kernel(features);
    begin();
    set_legacy(1);
    set_extended(1);
    assert_true(loop_until(features & FAKE_CODED ? both_on_air : legacy_on_air, 1000));
}

/* As slots do. */
static void give_payloads_for(int64_t ms)
{
    static uint8_t counter;

    for (int64_t end_us = loop_now_us() + ms * 1000; loop_now_us() < end_us;) {
        set_legacy(++counter);
        run_ms(125);
    }
}

static bool bt4_is_lost(void)
{
    return bt4.state == RADIO_LOST;
}

static bool bt4_is_stuck(void)
{
    return radio_stuck(&bt4, loop_now_us());
}

static bool is_put_down(void)
{
    return kernel.downs > 0;
}

static void who_hangs_until_it_is_reset_is_reset(void **state)
{
    unsigned n;

    (void)state;
    go_on_air(0);
    n = fake.count;
    assert_int_equal(count_since(0, 0x0C03), 0); /* the kernel does that when it brings it up */
    fake.until_reset = true;
    set_legacy(2);
    assert_true(loop_until(bt4_is_lost, 1500));
    assert_non_null(strstr(bt4.detail, "doesn't answer; it is reset"));
    assert_true(loop_until(legacy_on_air, 500));
    assert_int_equal(count_since(n, 0x0C03), 1);
    assert_int_equal(kernel.downs, 0);
}

static void who_hangs_on_is_put_down_and_up(void **state)
{
    int64_t reset_us;

    (void)state;
    go_on_air(0);
    fake.mute = kernel.heals = true;
    set_legacy(2);
    assert_true(loop_until(bt4_is_lost, 1500));
    reset_us = loop_now_us();
    assert_true(loop_until(is_put_down, 5000));
    assert_true(in_time(loop_now_us() - reset_us, 2500000, 5000000));
    assert_non_null(strstr(bt4.detail, "it was reset, and is put down and up"));
    assert_true(loop_until(legacy_on_air, 2000));
    assert_int_equal(kernel.downs, 1);
    assert_int_equal(kernel.ups, 1);
    assert_false(bt4_is_stuck());
}

/* Whether its interface comes up again or not. */
static void who_nothing_brings_back_is_given_up(void **state)
{
    for (int comes_up = 0; comes_up < 2; comes_up++) {
        int64_t down_us;

        go_on_air(CAPABLE);
        fake.mute = true;
        kernel.comes_up = comes_up;
        set_legacy(2);
        assert_true(loop_until(is_put_down, 6000));
        down_us = loop_now_us();
        assert_false(bt4_is_stuck());
        assert_true(loop_until(bt4_is_stuck, 5000));
        assert_true(in_time(loop_now_us() - down_us, 2500000, 5000000));
        assert_true(radio_stuck(&bt5, loop_now_us()));
        run_ms(1500);
        assert_non_null(strstr(bt4.detail, "its driver is to be bound anew"));
        assert_int_equal(kernel.downs, 1);

        kernel.is_there = kernel.is_up = false; /* as whoever does that */
        fake_hang_up(&fake);
        run_ms(1500);
        assert_int_equal(bt4.state, RADIO_ABSENT);
        assert_true(bt4_is_stuck()); /* until it is on the air */
        kernel.is_there = kernel.comes_up = true;
        fake.mute = false;
        assert_true(loop_until(both_on_air, 2500));
        assert_false(bt4_is_stuck());
        assert_true(bt4.given_up); /* it may hang again at once */
        give_payloads_for(11000);
        assert_false(bt4.given_up); /* standing still for a moment isn't that */
        end(state);
    }
    start(CAPABLE); /* for the teardown */
}

static void who_doesn_t_come_up_is_given_up(void **state)
{
    (void)state;
    start_behind_the_kernel(0);
    kernel.is_up = kernel.comes_up = false;
    begin();
    run_ms(11000);
    assert_int_equal(bt4.state, RADIO_DOWN);
    assert_false(bt4_is_stuck());
    assert_true(loop_until(bt4_is_stuck, 2000));
    kernel.comes_up = true;
    set_legacy(1);
    assert_true(loop_until(legacy_on_air, 1000));
}

static void a_driver_has_the_time_for_its_patch_file(void **state)
{
    (void)state;
    start_behind_the_kernel(0);
    kernel.is_set_up = false;
    begin();
    run_ms(29000);
    assert_int_equal(bt4.state, RADIO_ABSENT);
    assert_non_null(strstr(bt4.detail, "its driver hasn't set it up"));
    assert_false(bt4_is_stuck());
    assert_true(loop_until(bt4_is_stuck, 3000));
}

/* What is away is nobody's to bring back by that. */
static void who_is_not_there_is_not_given_up(void **state)
{
    (void)state;
    start_behind_the_kernel(0);
    kernel.is_there = false;
    begin();
    run_ms(60000);
    assert_int_equal(bt4.state, RADIO_ABSENT);
    assert_false(bt4_is_stuck());
}

static void who_hangs_again_soon_is_given_the_next_remedy(void **state)
{
    (void)state;
    go_on_air(0);
    for (int i = 0; i < 2; i++) {
        fake.until_reset = true;
        give_payloads_for(5000);
        assert_true(legacy_on_air());
    }
    assert_int_equal(kernel.downs, 1);
    give_payloads_for(15000); /* well for long: from the start */
    fake.until_reset = true;
    give_payloads_for(5000);
    assert_true(legacy_on_air());
    assert_int_equal(kernel.downs, 1);
}

/* ---- reset without a word ---- */

static void a_reset_that_nobody_told_of_is_noticed(void **state)
{
    (void)state;
    go_on_air(0);
    give_payloads_for(3000);
    for (unsigned resets = 1; resets < 4; resets++) {
        fake_forget(&fake);
        set_legacy(2);
        assert_false(legacy_on_air()); /* it takes data, and sends nothing */
        give_payloads_for(1500);
        assert_true(legacy_on_air());
        assert_true(fake.sets[0].addressed);
        assert_int_equal(bt4.repairs, resets);
        assert_int_equal(bt4.failures, 0);
        give_payloads_for(5000);
    }
}

static void who_knows_no_mark_goes_without(void **state)
{
    unsigned n;

    (void)state;
    start_behind_the_kernel(0);
    fake.knows_length = false;
    begin();
    set_legacy(1);
    assert_true(loop_until(legacy_on_air, 1000));
    n = fake.count;
    give_payloads_for(5000);
    assert_int_equal(count_since(n, 0x2023), 0);
    assert_int_equal(bt4.failures + bt4.repairs, 0);
}

/* For a set that it has forgotten it refuses data. */
static void who_has_sets_needs_no_mark(void **state)
{
    (void)state;
    go_on_air(CAPABLE);
    give_payloads_for(5000);
    assert_int_equal(count_since(0, 0x2023) + count_since(0, 0x2024), 0);
}

static void the_mark_is_looked_for_each_second(void **state)
{
    unsigned n;

    (void)state;
    go_on_air(0);
    n = fake.count;
    give_payloads_for(20000);
    assert_in_range(count_since(n, 0x2023), 17, 20);
    assert_int_equal(bt4.repairs, 0);
    assert_int_equal(bt4.replaced, 0);
}

static void a_mark_that_another_program_wipes_is_put_back_now_and_then(void **state)
{
    static const uint8_t most[] = {0xFB, 0, 0x48, 0x08};

    (void)state;
    go_on_air(0);
    for (int i = 0; i < 200; i++) {
        fake_foreign(&fake, 0x2024, most, sizeof(most));
        give_payloads_for(100);
    }
    assert_in_range(bt4.repairs, 3, 6);
    assert_true(legacy_on_air());
}

/* Answers to another program's question, or to one of before, are none to ours. */
static void an_answer_that_was_not_asked_for_says_nothing(void **state)
{
    (void)state;
    go_on_air(0);
    memset(fake.data_length, 0, sizeof(fake.data_length));
    fake_complete(&fake, 0x2023, 0);
    run_ms(200);
    assert_int_equal(bt4.repairs, 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_teardown(name, end)
    const struct CMUnitTest tests[] = {
        TEST(who_hangs_until_it_is_reset_is_reset),
        TEST(who_hangs_on_is_put_down_and_up),
        TEST(who_nothing_brings_back_is_given_up),
        TEST(who_doesn_t_come_up_is_given_up),
        TEST(a_driver_has_the_time_for_its_patch_file),
        TEST(who_is_not_there_is_not_given_up),
        TEST(who_hangs_again_soon_is_given_the_next_remedy),
        TEST(a_reset_that_nobody_told_of_is_noticed),
        TEST(who_knows_no_mark_goes_without),
        TEST(who_has_sets_needs_no_mark),
        TEST(the_mark_is_looked_for_each_second),
        TEST(a_mark_that_another_program_wipes_is_put_back_now_and_then),
        TEST(an_answer_that_was_not_asked_for_says_nothing),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
