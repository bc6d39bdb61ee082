/* Bluetooth adapters that are interfered with, vanish, hang and come back. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "bluetooth_bench.h"

static const uint8_t off[] = {0, 0};
static uint8_t own_address[6];

static bool is_whole(void)
{
    return both_on_air() && memcmp(fake.sets[0].address, own_address, 6) == 0 &&
           memcmp(fake.sets[1].address, own_address, 6) == 0 && fake.sets[0].length == 31 &&
           fake.sets[1].length == sizeof(pack);
}

static void start_whole(void)
{
    start_on_air(CAPABLE);
    memcpy(own_address, fake.sets[0].address, 6);
    assert_true(is_whole());
}

static void a_foreign_disable_is_undone_within_a_slot(void **state)
{
    unsigned n;

    (void)state;
    start_whole();
    n = fake.count;
    fake_foreign(&fake, 0x2039, off, sizeof(off));
    assert_false(fake.sets[0].enabled);
    assert_true(loop_until(is_whole, 125));
    assert_int_equal(bt4.repairs, 1);
    assert_int_equal(bt5.repairs, 1);
    assert_int_equal(bt4.state, RADIO_ON_AIR);
    assert_int_equal(count_since(n, 0x2036) + count_since(n, 0x207F), 0); /* by one command */
}

/* By what another program, or the controller, gave it an end. */
static void a_set_that_ended_is_switched_on_again(void **state)
{
    static const uint8_t ended[] = {4, 0x3E, 6, 0x12, 0x3C, 1, 0, 0, 0};
    static const uint8_t heard[] = {4, 0x3E, 6, 0x0D, 0x3C, 1, 0, 0, 0};
    static const uint8_t others[] = {4, 0x3E, 6, 0x12, 0x3C, 5, 0, 0, 0};
    static const uint8_t torn[] = {4, 0x3E, 2, 0x12, 0x3C};
    unsigned n;

    (void)state;
    start_whole();
    n = fake.count;
    fake_send(&fake, heard, sizeof(heard));
    fake_send(&fake, others, sizeof(others));
    fake_send(&fake, torn, sizeof(torn));
    run_ms(20);
    assert_int_equal(fake.count, n);
    fake.sets[1].enabled = false;
    fake_send(&fake, ended, sizeof(ended));
    assert_true(loop_until(is_whole, 125));
    assert_int_equal(bt5.repairs, 1);
    assert_int_equal(count_since(n, 0x2036) + count_since(n, 0x207F), 0); /* by one command */
}

static bool second_is_set(void)
{
    return fake.sets[1].data[5] == 2;
}

/* What was set before the disable has been sent; the newest doesn't wait for an interval more. */
static void the_newest_goes_out_with_the_event_after_a_foreign_disable(void **state)
{
    (void)state;
    start_whole();
    run_ms(220);
    fake_foreign(&fake, 0x2039, off, sizeof(off));
    assert_true(loop_until(is_whole, 125));
    set_extended(2);
    assert_true(loop_until(second_is_set, 100));
}

static void enabling_that_is_refused_makes_a_whole_set_up(void **state)
{
    (void)state;
    start_whole();
    fake_foreign(&fake, 0x2039, off, sizeof(off));
    fake.refused = 0x2039;
    fake.refusal = 0x0C;
    assert_true(loop_until(is_whole, 125));
    assert_int_equal(bt4.starts, 1);
    assert_int_equal(bt4.failures, 0);
}

static void a_foreign_disable_of_a_legacy_controller_is_undone(void **state)
{
    (void)state;
    start_on_air(0);
    fake_foreign(&fake, 0x200A, off, 1);
    assert_false(fake.sets[0].enabled);
    assert_true(loop_until(legacy_on_air, 125));
    assert_int_equal(bt4.repairs, 1);
}

static void after_a_foreign_reset_the_address_is_set_again(void **state)
{
    (void)state;
    start_whole();
    fake_foreign(&fake, 0x0C03, NULL, 0);
    assert_false(fake.sets[0].addressed);
    assert_true(loop_until(is_whole, 125));
    assert_int_equal(bt4.repairs, 1);
    assert_int_equal(count_since(0, 0x0C03), 1); /* not reset by us once more */
}

static void after_a_foreign_reset_of_a_legacy_controller_the_address_is_set_again(void **state)
{
    (void)state;
    start_on_air(0);
    memcpy(own_address, fake.sets[0].address, 6);
    fake_foreign(&fake, 0x0C03, NULL, 0);
    assert_true(loop_until(legacy_on_air, 125));
    assert_memory_equal(fake.sets[0].address, own_address, 6);
}

static void foreign_data_is_replaced_by_the_newest(void **state)
{
    const uint8_t lie[] = {0, 3, 1, 3, 0x02, 0x01, 0x06};

    (void)state;
    start_whole();
    set_legacy(9);
    run_ms(5);
    fake_foreign(&fake, 0x2037, lie, sizeof(lie));
    assert_int_equal(fake.sets[0].length, 3);
    assert_true(loop_until(is_whole, 125));
    assert_int_equal(fake.sets[0].data[5], 9);
}

static void what_changes_nothing_is_no_interference(void **state)
{
    unsigned n;

    (void)state;
    start_whole();
    n = fake.count;
    fake_foreign(&fake, 0x2003, NULL, 0);                  /* asks */
    fake_foreign(&fake, 0x2006, pack, 15);                 /* is refused: we are extended */
    fake_complete(&fake, 0x203B, 0);                       /* asks */
    fake_send(&fake, (uint8_t[]){4, 0x0E, 3, 1, 0, 0}, 6); /* room only */
    fake_send(&fake, (uint8_t[]){4, 0x0F, 4, 0, 1, 0x39, 0x20}, 7); /* its end is to come */
    run_ms(20);
    assert_int_equal(fake.count, n);
    assert_int_equal(bt4.repairs, 0);
}

static struct loop_timer enemy_timer;
static unsigned attacks;

static void attack(void *context, int64_t now_us)
{
    (void)context;
    if (fake.sets[0].enabled) {
        attacks++;
        fake_foreign(&fake, 0x2039, off, sizeof(off));
    }
    loop_arm(&enemy_timer, now_us + 5000);
}

/* Without the limit a second holds more than a hundred set-ups. */
static void an_endless_fight_is_fought_once_a_slot(void **state)
{
    unsigned n;

    (void)state;
    start_whole();
    n = fake.count;
    attacks = 0;
    loop_timer_init(&enemy_timer, attack, NULL);
    loop_arm(&enemy_timer, 0);
    run_ms(1000);
    loop_arm(&enemy_timer, LOOP_NEVER);
    assert_in_range(attacks, 6, 10);
    assert_true(fake.count - n < 10 * 10);
    assert_true(loop_until(is_whole, 200));
}

/* As slots do. */
static void give_payloads_for(int64_t ms)
{
    static uint8_t counter;

    for (int64_t end_us = loop_now_us() + ms * 1000; loop_now_us() < end_us;) {
        set_legacy(++counter);
        set_extended(counter);
        run_ms(125);
    }
}

static bool all_are_told_that_it_is_lost(void)
{
    return radio_seen(&bt4, loop_now_us()) == RADIO_LOST &&
           radio_seen(&bt5, loop_now_us()) == RADIO_LOST;
}

static void fight(void *context, int64_t now_us)
{
    (void)context;
    if (fake.sets[0].enabled) {
        fake_foreign(&fake, 0x2039, off, sizeof(off));
    }
    loop_arm(&enemy_timer, now_us + 1000);
}

/* It answers everything, its data too, and is off nearly all the time. */
static void who_is_switched_off_each_time_is_not_on_the_air(void **state)
{
    (void)state;
    start_whole();
    loop_timer_init(&enemy_timer, fight, NULL);
    loop_arm(&enemy_timer, 0);
    give_payloads_for(4000);
    assert_true(all_are_told_that_it_is_lost());
    loop_arm(&enemy_timer, LOOP_NEVER);
    give_payloads_for(1000);
    assert_false(all_are_told_that_it_is_lost());
    assert_true(is_whole());
}

static void answer_late(void *context, int64_t now_us)
{
    (void)context;
    fake_release(&fake);
    loop_arm(&enemy_timer, now_us + 900000);
}

/* Each within its second, and a message has its turn every fourteen. */
static void who_answers_slowly_is_not_on_the_air(void **state)
{
    (void)state;
    start_whole();
    give_payloads_for(5000);
    assert_false(all_are_told_that_it_is_lost());
    fake.holds = true;
    loop_timer_init(&enemy_timer, answer_late, NULL);
    loop_arm(&enemy_timer, loop_now_us() + 900000);
    give_payloads_for(6000);
    assert_int_equal(bt4.state, RADIO_ON_AIR);
    assert_true(all_are_told_that_it_is_lost());
    fake.holds = false;
    give_payloads_for(2000);
    loop_arm(&enemy_timer, LOOP_NEVER);
    assert_false(all_are_told_that_it_is_lost());
}

static bool bt5_is_given_up(void)
{
    return bt5.state == RADIO_UNSUPPORTED;
}

static void long_range_comes_back_when_whoever_had_its_set_is_gone(void **state)
{
    (void)state;
    start_whole();
    fake.sets_max = 1;
    fake_foreign(&fake, 0x0C03, NULL, 0);
    assert_true(loop_until(bt5_is_given_up, 1000));
    give_payloads_for(12000); /* asked again, in vain */
    assert_true(bt5_is_given_up());
    fake.sets_max = 2;
    give_payloads_for(21000);
    assert_true(both_on_air());
}

/* What another program's refused command says is taken for ours. */
static void a_foreign_refusal_takes_nothing_for_good(void **state)
{
    (void)state;
    start_whole();
    fake.holds = true;
    fake_foreign(&fake, 0x0C03, NULL, 0);
    for (int i = 0; i < 40; i++) {
        uint16_t opcode = fake.commands[(fake.count - 1) % 2048].opcode;

        if (opcode == 0x207F || opcode == 0x2036) {
            fake_complete(&fake, opcode, 0x12);
        }
        fake_release(&fake);
        run_ms(5);
    }
    fake.holds = false;
    fake_release(&fake);
    give_payloads_for(12000);
    assert_true(both_on_air());
    assert_non_null(strstr(bt5.detail, "S=8"));
}

static void refused_data_makes_a_new_set_up(void **state)
{
    (void)state;
    start_whole();
    fake_forget(&fake); /* a reset that nobody told of */
    set_legacy(2);
    run_ms(2);
    assert_true(loop_until(is_whole, 125));
    assert_int_equal(fake.sets[0].data[5], 2);
    assert_int_equal(bt4.failures, 1);
}

static bool bt4_is_lost(void)
{
    return bt4.state == RADIO_LOST;
}

static void a_refused_set_up_is_tried_again_later(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.refused = 0x2035;
    fake.refusal = 0x0C;
    begin();
    set_legacy(1);
    set_extended(1);
    assert_true(loop_until(bt4_is_lost, 100));
    assert_non_null(strstr(bt4.detail, "0x2035"));
    assert_non_null(strstr(bt4.detail, "0x0c"));
    assert_true(loop_until(both_on_air, 500));
}

static uint16_t refused_command;
static uint8_t refused_with;

static uint8_t long_range_is_refused(uint16_t opcode, const uint8_t *p)
{
    bool is_its = opcode == 0x2039 ? p[1] == 2 : p[0] == 1;

    return opcode == refused_command && is_its ? refused_with : 0;
}

/* Whatever it calls that: Bluetooth 4 doesn't stay off the air for it. */
static void legacy_does_not_wait_for_a_long_range_that_is_refused_each_time(void **state)
{
    static const uint16_t commands[] = {0x207F, 0x2035, 0x2037, 0x2039};
    static const uint8_t statuses[] = {0x0C, 0x0D, 0x1F, 0x42};

    (void)state;
    for (size_t i = 0; i < 4; i++) {
        unsigned n;

        start(CAPABLE);
        fake.quirk = long_range_is_refused;
        refused_command = commands[i];
        refused_with = statuses[i];
        begin();
        set_legacy(1);
        set_extended(1);
        assert_true(loop_until(legacy_on_air, 1000));
        assert_true(bt5_is_given_up());
        assert_int_equal(bt4.failures, 1);
        n = fake.count;
        give_payloads_for(12000); /* tried again, in vain */
        assert_int_not_equal(count_since(n, 0x207F), 0);
        assert_true(legacy_on_air() && bt5_is_given_up());
        assert_int_equal(bt4.failures, 1);
        fake.quirk = NULL;
        give_payloads_for(21000);
        assert_true(both_on_air());
        end(state);
    }
    start(CAPABLE); /* for the teardown */
}

static void a_long_range_that_is_refused_once_is_not_given_up(void **state)
{
    (void)state;
    start_whole();
    for (int i = 0; i < 2; i++) { /* once each time that it was on the air */
        fake.refused = 0x207F;
        fake.refusal = 0x0C;
        fake_foreign(&fake, 0x0C03, NULL, 0);
        assert_true(loop_until(bt4_is_lost, 500));
        assert_true(loop_until(is_whole, 500));
    }
}

static void an_unplugged_controller_comes_back_by_itself(void **state)
{
    (void)state;
    start_whole();
    fake_unplug(&fake);
    assert_true(loop_until(bt4_is_lost, 100));
    run_ms(700);
    assert_int_equal(bt4.state, RADIO_ABSENT);
    set_legacy(5);
    set_extended(5);
    fake_plug_in(&fake);
    assert_true(loop_until(is_whole, 1200));
    assert_int_equal(fake.sets[0].data[5], 5); /* the newest, not what it knew before */
    assert_int_equal(bt4.starts, 2);
}

static void a_controller_that_is_late_is_waited_for(void **state)
{
    (void)state;
    start(CAPABLE);
    fake_unplug(&fake);
    begin();
    set_legacy(1);
    set_extended(1);
    assert_int_equal(bt4.state, RADIO_ABSENT);
    run_ms(400);
    fake_plug_in(&fake);
    assert_true(loop_until(both_on_air, 1200));
}

static bool bt4_came_back(void)
{
    return both_on_air() && bt4.starts == 2;
}

static void a_mute_controller_is_lost_in_a_second_and_asked_again(void **state)
{
    int64_t start_us;
    unsigned n;

    (void)state;
    start_whole();
    fake.mute = true;
    set_legacy(2);
    start_us = loop_now_us();
    assert_true(loop_until(bt4_is_lost, 1500));
    assert_true(in_time(loop_now_us() - start_us, 900000, 1200000));
    assert_non_null(strstr(bt4.detail, "doesn't answer"));
    n = fake.count;
    run_ms(600);
    assert_true(fake.count > n);             /* it is asked again, ... */
    assert_int_equal(bt4.state, RADIO_LOST); /* ... and called lost until it answers */
    fake.mute = false;
    assert_true(loop_until(bt4_came_back, 2500));
}

static void a_hardware_error_restarts_everything(void **state)
{
    (void)state;
    start_whole();
    fake_send(&fake, (uint8_t[]){0x04, 0x10, 1, 0x42}, 4);
    assert_true(loop_until(bt4_is_lost, 100));
    assert_non_null(strstr(bt4.detail, "0x42"));
    assert_true(loop_until(bt4_came_back, 700));
    assert_int_equal(count_since(0, 0x0C03), 2);
}

static void a_stream_out_of_step_is_opened_and_reset(void **state)
{
    (void)state;
    start_whole();
    fake_send(&fake, (uint8_t[]){0x99, 0x98, 0x97}, 3);
    assert_true(loop_until(bt4_is_lost, 100));
    assert_true(loop_until(bt4_came_back, 700));
    assert_int_equal(count_since(0, 0x0C03), 2);
}

static void a_controller_that_never_has_room_is_lost(void **state)
{
    (void)state;
    start_whole();
    fake.no_room = true;
    set_legacy(2);
    assert_true(loop_until(bt4_is_lost, 1500));
    fake.no_room = false;
    assert_true(loop_until(bt4_came_back, 700));
}

/* Nor is one that says so again and again. */
static void a_controller_that_keeps_saying_so_is_lost(void **state)
{
    static const uint8_t no_room[] = {4, 0x0E, 3, 0, 0, 0};

    (void)state;
    start_whole();
    for (int i = 0; i < 8 && !bt4_is_lost(); i++) {
        fake_send(&fake, no_room, sizeof(no_room));
        run_ms(500);
    }
    assert_true(bt4_is_lost());
}

/* A reset between a command of ours and its answer would be another case: the command fails. */
static void run_until_nothing_is_asked(void)
{
    unsigned before;

    do {
        before = fake.count;
        run_ms(50);
    } while (fake.count != before);
}

static void the_set_up_may_be_interfered_with(void **state)
{
    (void)state;
    start(CAPABLE);
    begin();
    set_legacy(1);
    run_until_nothing_is_asked(); /* waits for the second payload */
    fake_foreign(&fake, 0x0C03, NULL, 0);
    run_until_nothing_is_asked();
    set_extended(1);
    assert_true(loop_until(both_on_air, 500));
    assert_int_equal(bt4.failures, 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_teardown(name, end)
    const struct CMUnitTest tests[] = {
        TEST(a_foreign_disable_is_undone_within_a_slot),
        TEST(a_set_that_ended_is_switched_on_again),
        TEST(the_newest_goes_out_with_the_event_after_a_foreign_disable),
        TEST(enabling_that_is_refused_makes_a_whole_set_up),
        TEST(a_foreign_disable_of_a_legacy_controller_is_undone),
        TEST(after_a_foreign_reset_the_address_is_set_again),
        TEST(after_a_foreign_reset_of_a_legacy_controller_the_address_is_set_again),
        TEST(foreign_data_is_replaced_by_the_newest),
        TEST(what_changes_nothing_is_no_interference),
        TEST(an_endless_fight_is_fought_once_a_slot),
        TEST(who_is_switched_off_each_time_is_not_on_the_air),
        TEST(who_answers_slowly_is_not_on_the_air),
        TEST(long_range_comes_back_when_whoever_had_its_set_is_gone),
        TEST(a_foreign_refusal_takes_nothing_for_good),
        TEST(refused_data_makes_a_new_set_up),
        TEST(a_refused_set_up_is_tried_again_later),
        TEST(legacy_does_not_wait_for_a_long_range_that_is_refused_each_time),
        TEST(a_long_range_that_is_refused_once_is_not_given_up),
        TEST(an_unplugged_controller_comes_back_by_itself),
        TEST(a_controller_that_is_late_is_waited_for),
        TEST(a_mute_controller_is_lost_in_a_second_and_asked_again),
        TEST(a_hardware_error_restarts_everything),
        TEST(a_stream_out_of_step_is_opened_and_reset),
        TEST(a_controller_that_never_has_room_is_lost),
        TEST(a_controller_that_keeps_saying_so_is_lost),
        TEST(the_set_up_may_be_interfered_with),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
