/* Bluetooth adapters against a model of a controller: the set-up and the data path. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "bluetooth_bench.h"

static struct fake_controller second;

/* The kernel's boot id, read as text and turned around: not by the code under test. */
static void expect_own_address(const uint8_t address[6])
{
    char boot_id[64], text[18];
    FILE *file = fopen("/proc/sys/kernel/random/boot_id", "r");

    assert_non_null(file);
    assert_non_null(fgets(boot_id, sizeof(boot_id), file));
    fclose(file);
    for (int i = 0; i < 5; i++) {
        snprintf(text, sizeof(text), "%02x", address[4 - i]);
        assert_memory_equal(text, boot_id + 26 + 2 * i, 2);
    }
    assert_int_equal(address[5] & 0xC0, 0xC0); /* static */
    snprintf(text, sizeof(text), "%02x", address[5]);
    assert_int_equal(text[1], boot_id[25]);
}

static void a_capable_controller_carries_both_as_two_sets(void **state)
{
    const uint8_t *legacy = fake.sets[0].parameters, *long_range = fake.sets[1].parameters;

    (void)state;
    start_on_air(CAPABLE);
    assert_int_equal(legacy[1] | legacy[2] << 8, 0x0010); /* legacy PDU, ADV_NONCONN_IND */
    assert_int_equal(legacy[3] | legacy[4] << 8, 0x0020);
    assert_int_equal(legacy[20], 1); /* LE 1M */
    assert_int_equal(long_range[1] | long_range[2] << 8, 0);
    assert_int_equal(long_range[3] | long_range[4] << 8, 0x0140);
    assert_int_equal(long_range[20], 3); /* primary Coded, ... */
    assert_int_equal(long_range[22], 3); /* ... secondary as well, ... */
    assert_int_equal(long_range[25], 4); /* ... both with S=8 */
    assert_int_equal(long_range[26], 4);
    assert_memory_equal(fake.sets[0].address, fake.sets[1].address, 6);
    expect_own_address(fake.sets[0].address);
    assert_int_equal(fake.sets[0].length, 31);
    assert_memory_equal(fake.sets[0].data, "\x1E\x16\xFA\xFF\x0D\x01", 6);
    assert_int_equal(fake.sets[1].length, sizeof(pack));
    assert_memory_equal(fake.sets[1].data, pack, sizeof(pack));
    assert_non_null(strstr(bt4.detail, "every 20 ms"));
    assert_non_null(strstr(bt5.detail, "Coded PHY S=8 requested"));
}

static void give_extended(size_t octets)
{
    pack[0] = (uint8_t)(octets - 1);
    bluetooth_set_extended(pack, octets, loop_now_us());
}

/* Such chips exist: long range was given up for good, and nobody was told. */
static void a_controller_with_less_room_is_given_a_smaller_pack(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.maximum_data = 191;
    fake.takes = 191;
    begin();
    set_legacy(1);
    set_extended(1); /* made before that was known */
    run_ms(100);
    assert_int_equal(bluetooth_extended_room(), 191);
    assert_int_equal(count_since(0, 0x2037), 1); /* the legacy one's */
    give_extended(9 + 7 * 25);
    assert_true(loop_until(both_on_air, 1000));
    assert_int_equal(fake.sets[1].length, 9 + 7 * 25);
    assert_non_null(strstr(bt5.detail, "191 octets at most"));
    assert_int_equal(bt5.failures, 0);
}

/* It knows no such command, or says more than it takes. */
static void a_controller_that_refuses_a_pack_is_given_a_smaller_one(void **state)
{
    (void)state;
    for (uint16_t said = 0; said <= 0x0672; said += 0x0672) {
        start(CAPABLE);
        fake.maximum_data = said;
        fake.takes = 191;
        begin();
        set_legacy(1);
        for (size_t room = 0; room != bluetooth_extended_room();) {
            room = bluetooth_extended_room();
            give_extended(9 + (room - 9) / 25 * 25);
            run_ms(300);
        }
        assert_int_equal(fake.sets[1].length, 9 + 7 * 25);
        assert_true(both_on_air());
        assert_int_equal(bt5.state, RADIO_ON_AIR);
        if (said == 0) {
            end(state);
        }
    }
}

static uint8_t enable_is_refused_over_191_octets(uint16_t opcode, const uint8_t *p)
{
    return opcode == 0x2039 && p[0] == 1 && p[1] == 2 && fake.sets[1].length > 191 ? 0x45 : 0;
}

/* Long range was given up then: it was the command that switches it on, not its data's. */
static void a_pack_that_is_refused_when_it_is_switched_on_is_made_smaller(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.quirk = enable_is_refused_over_191_octets;
    begin();
    for (unsigned i = 0; i < 8; i++) {
        set_legacy(1);
        give_extended(9 + (bluetooth_extended_room() - 9) / 25 * 25);
        run_ms(250);
    }
    assert_true(both_on_air());
    assert_int_equal(fake.sets[1].length, 9 + 7 * 25);
    assert_int_equal(bt5.state, RADIO_ON_AIR);
    fake.quirk = NULL;
}

static bool all_is_set(void)
{
    return both_on_air() && fake.sets[1].length == 9 + 9 * 25;
}

static void give_payloads_for(int64_t ms)
{
    for (int64_t end_us = loop_now_us() + ms * 1000; loop_now_us() < end_us;) {
        set_legacy(1);
        give_extended(9 + (bluetooth_extended_room() - 9) / 25 * 25);
        run_ms(250);
    }
}

/* What had taken its memory may be gone; what it has it sends meanwhile, and the legacy set isn't
 * touched. */
static void a_larger_pack_is_tried_again(void **state)
{
    unsigned n;

    (void)state;
    start(CAPABLE);
    fake.takes = 191;
    begin();
    give_payloads_for(3000);
    assert_true(both_on_air());
    assert_int_equal(fake.sets[1].length, 9 + 7 * 25);
    n = fake.count;
    give_payloads_for(10000); /* in vain */
    assert_true(both_on_air());
    assert_int_equal(fake.sets[1].length, 9 + 7 * 25);
    assert_non_null(strstr(bt5.detail, "184 octets at most"));
    fake.takes = 251;
    give_payloads_for(21000);
    assert_true(all_is_set());
    assert_null(strstr(bt5.detail, "octets at most"));
    assert_int_equal(count_since(n, 0x2039), 0);
    assert_int_equal(bt5.failures, 0);
    assert_int_equal(bt5.starts, 1);
}

/* One of before Bluetooth 5 is only believed: what it has refused it would refuse again. */
static void an_interval_that_was_refused_is_tried_again(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.interval_min = 0xA0;
    begin();
    give_payloads_for(3000);
    assert_int_equal(fake.sets[0].parameters[3], 0xA0);
    fake.interval_min = 0x20;
    give_payloads_for(11000);
    assert_int_equal(fake.sets[0].parameters[3], 0x20);
    assert_non_null(strstr(bt4.detail, "every 20 ms"));
    assert_true(both_on_air());
}

static uint8_t coding_is_refused(uint16_t opcode, const uint8_t *p)
{
    (void)p;
    return opcode == 0x207F ? 0x12 : 0;
}

static void a_coding_that_was_refused_is_tried_again(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.quirk = coding_is_refused;
    begin();
    give_payloads_for(12000);
    assert_null(strstr(bt5.detail, "S=8"));
    fake.quirk = NULL;
    give_payloads_for(21000);
    assert_non_null(strstr(bt5.detail, "S=8"));
    assert_true(both_on_air());
}

/* It answered while its firmware was half there. That there is none is asked for without a pause of
 * the legacy set. */
static void features_that_were_missing_are_asked_for_again(void **state)
{
    static const uint64_t before[] = {0, FAKE_EXTENDED};

    for (size_t i = 0; i < sizeof(before) / sizeof(before[0]); i++) {
        unsigned n;

        start_on_air(before[i]);
        assert_int_equal(bt5.state, RADIO_UNSUPPORTED);
        n = fake.count;
        give_payloads_for(11000);
        assert_int_equal(count_since(n, 0x2003), 1);
        assert_int_equal(count_since(n, 0x2039) + count_since(n, 0x200A), 0);
        fake.features = CAPABLE;
        give_payloads_for(21000);
        assert_true(all_is_set());
        if (i == 0) {
            end(state);
        }
    }
}

/* There is nothing else that it could do. */
static void long_range_alone_is_asked_for_again(void **state)
{
    (void)state;
    start(FAKE_EXTENDED);
    config.bt4_enabled = false;
    begin();
    give_payloads_for(3000);
    assert_int_equal(bt5.state, RADIO_UNSUPPORTED);
    fake.features = CAPABLE;
    give_payloads_for(9000);
    assert_int_equal(bt5.state, RADIO_ON_AIR);
    assert_true(fake.sets[1].enabled);
}

static void a_capable_controller_never_gets_a_legacy_command(void **state)
{
    (void)state;
    start_on_air(CAPABLE);
    for (uint16_t opcode = 0x2005; opcode <= 0x200A; opcode++) {
        assert_int_equal(count_since(0, opcode), 0);
    }
    for (unsigned i = 0; i < fake.count; i++) {
        assert_int_equal(fake.commands[i].status, 0); /* not one was tried in vain */
    }
}

static void without_coding_selection_the_first_version_is_used(void **state)
{
    (void)state;
    start_on_air(FAKE_EXTENDED | FAKE_CODED);
    assert_int_equal(count_since(0, 0x207F), 0);
    assert_null(strstr(bt5.detail, "S=8"));
}

static void a_controller_that_only_claims_coding_selection_still_transmits(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.quirk = coding_is_refused;
    begin();
    set_legacy(1);
    set_extended(1);
    assert_true(loop_until(both_on_air, 500));
    assert_null(strstr(bt5.detail, "S=8"));
}

static void a_legacy_controller_never_gets_an_extended_command(void **state)
{
    (void)state;
    start_on_air(0);
    for (uint16_t opcode = 0x2035; opcode <= 0x207F; opcode++) {
        assert_int_equal(count_since(0, opcode), 0);
    }
    assert_int_equal(fake.sets[0].parameters[0], 0x20);
    assert_int_equal(fake.sets[0].parameters[4], 0x03); /* ADV_NONCONN_IND */
    assert_int_equal(fake.sets[0].parameters[5], 1);    /* random address */
    expect_own_address(fake.sets[0].address);
    assert_int_equal(bt5.state, RADIO_UNSUPPORTED);
}

static void a_controller_of_before_bluetooth_5_gets_100_ms(void **state)
{
    (void)state;
    start(0);
    fake.interval_min = 0xA0;
    begin();
    set_legacy(1);
    assert_true(loop_until(legacy_on_air, 500));
    assert_int_equal(fake.sets[0].parameters[0], 0xA0);
    assert_int_equal(fake.sets[0].parameters[2], 0xA0);
    assert_non_null(strstr(bt4.detail, "every 100 ms"));
    assert_int_equal(bt4.failures, 0);
}

static void extended_advertising_without_coded_phy_carries_legacy_only(void **state)
{
    (void)state;
    start_on_air(FAKE_EXTENDED);
    assert_int_equal(bt5.state, RADIO_UNSUPPORTED);
    assert_int_equal(fake.sets[0].parameters[1], 0x10);
    assert_false(fake.sets[1].known);
}

/* A full controller refuses the second set: long range must not take legacy with it. */
static void a_controller_with_one_set_carries_legacy(void **state)
{
    (void)state;
    start(CAPABLE);
    fake.sets_max = 1;
    begin();
    set_legacy(1);
    set_extended(1);
    assert_true(loop_until(legacy_on_air, 500));
    assert_int_equal(bt5.state, RADIO_UNSUPPORTED);
    assert_non_null(strstr(bt5.detail, "0x07"));
}

static void nothing_is_advertised_before_there_is_a_payload(void **state)
{
    (void)state;
    start(CAPABLE);
    begin();
    run_ms(100);
    assert_int_equal(bt4.state, RADIO_STARTING);
    assert_int_equal(bt5.state, RADIO_STARTING);
    assert_int_equal(count_since(0, 0x2039), 1); /* off */
    set_legacy(7);
    run_ms(20);
    assert_false(fake.sets[0].enabled);
    set_extended(7);
    assert_true(loop_until(both_on_air, 500));
    assert_int_equal(fake.sets[0].data[5], 7);
    assert_int_equal(bt4.starts, 1);
}

static void one_alone_can_be_switched_on(void **state)
{
    (void)state;
    start(CAPABLE);
    config.bt4_enabled = false;
    begin();
    set_legacy(1);
    set_extended(1);
    run_ms(50);
    assert_int_equal(bt4.state, RADIO_DISABLED);
    assert_int_equal(bt5.state, RADIO_ON_AIR);
    assert_false(fake.sets[0].known);
    assert_true(fake.sets[1].enabled);
}

static void a_payload_is_taken_when_the_controller_says_so(void **state)
{
    uint64_t before;

    (void)state;
    start_on_air(CAPABLE);
    run_ms(40); /* the first payload has been sent */
    before = bt4.payloads;
    fake.holds = true;
    set_legacy(2);
    run_ms(20);
    assert_int_equal(bt4.payloads, before);
    fake_release(&fake);
    run_ms(50);
    assert_int_equal(bt4.payloads, before + 1);
    assert_true(in_time(loop_now_us() - bt4.accepted_us, 0, 100000));
}

/* One is with the controller, one waits: what is made then takes the place of that one. */
static void what_never_reaches_the_controller_is_counted(void **state)
{
    uint64_t before;

    (void)state;
    start_on_air(CAPABLE);
    run_ms(40);
    before = bt4.replaced;
    fake.holds = true;
    set_legacy(2);
    run_ms(5);
    set_legacy(3);
    assert_int_equal(bt4.replaced, before);
    set_legacy(4);
    assert_int_equal(bt4.replaced, before + 1);
    fake_release(&fake);
    run_ms(50);
    assert_int_equal(bt4.replaced, before + 1);
}

/* What is replaced within an interval and its random 10 ms may never be on the air. */
static void a_payload_stays_until_it_must_have_been_sent(void **state)
{
    int64_t accepted_us;

    (void)state;
    start(0);
    fake.interval_min = 0xA0;
    begin();
    set_legacy(1);
    assert_true(loop_until(legacy_on_air, 500));
    accepted_us = bt4.accepted_us;
    run_ms(60); /* the controller was late: half of the slot is over */
    set_legacy(2);
    run_ms(40);
    assert_int_equal(fake.sets[0].data[5], 1);
    run_ms(30);
    assert_int_equal(fake.sets[0].data[5], 2);
    assert_true(bt4.accepted_us - accepted_us >= 110000);
}

/* While the controller is slow: the newest wins, and legacy goes first. */
static void what_was_overtaken_is_not_sent(void **state)
{
    unsigned n;

    (void)state;
    start_on_air(CAPABLE);
    run_ms(220); /* the first payloads have been sent */
    fake.holds = true;
    n = fake.count;
    set_extended(10);
    run_ms(50);
    set_extended(11);
    set_legacy(20);
    set_legacy(21);
    set_extended(12);
    run_ms(50);
    assert_int_equal(fake.count, n + 1); /* one command at a time */
    assert_true(bluetooth_waits(CHANNEL_BT4) && bluetooth_waits(CHANNEL_BT5));
    for (int i = 0; i < 3; i++) {
        fake_release(&fake);
        run_ms(i == 1 ? 220 : 50); /* what is set stays for as long as it takes to be sent */
    }
    assert_int_equal(fake.count, n + 3);
    assert_false(bluetooth_waits(CHANNEL_BT4) || bluetooth_waits(CHANNEL_BT5));
    assert_int_equal(fake.commands[n].parameters[4 + 5], 10);
    assert_int_equal(fake.commands[n + 1].parameters[0], 0); /* the legacy set */
    assert_int_equal(fake.commands[n + 1].parameters[4 + 5], 21);
    assert_int_equal(fake.commands[n + 2].parameters[0], 1);
    assert_int_equal(fake.commands[n + 2].parameters[4 + 5], 12);
}

static bool third_is_set(void)
{
    return fake.sets[0].data[5] == 3;
}

static void a_controller_without_room_is_waited_for(void **state)
{
    const uint8_t room[] = {0x04, 0x0E, 3, 1, 0, 0};
    unsigned n;

    (void)state;
    start_on_air(CAPABLE);
    n = fake.count;
    fake.no_room = true;
    set_legacy(2);
    run_ms(60); /* longer than a payload has to stay */
    set_legacy(3);
    run_ms(60);
    assert_int_equal(fake.count, n + 1);
    fake.no_room = false;
    fake_send(&fake, room, sizeof(room));
    assert_true(loop_until(third_is_set, 1000));
    assert_int_equal(bt4.failures, 0);
}

static bool both_are_on_air(void)
{
    return legacy_on_air() && bt5.state == RADIO_ON_AIR && second.sets[1].enabled;
}

static void long_range_may_have_an_adapter_of_its_own(void **state)
{
    (void)state;
    start(0);
    fake_start(&second, CAPABLE);
    snprintf(config.bt5_adapter, sizeof(config.bt5_adapter), "%s", second.adapter);
    begin();
    set_legacy(1);
    set_extended(1);
    assert_true(loop_until(both_are_on_air, 1000));
    assert_false(second.sets[0].known);
    assert_memory_equal(fake.sets[0].address, second.sets[1].address, 6);
    bluetooth_stop();
    run_ms(2);
    fake_end(&second);
}

static bool is_silent(void)
{
    return !fake.sets[0].enabled && !fake.sets[1].enabled;
}

static void the_end_is_silent(void **state)
{
    (void)state;
    start_on_air(CAPABLE);
    bluetooth_stop();
    assert_true(loop_until(is_silent, 1000));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_teardown(name, end)
    const struct CMUnitTest tests[] = {
        TEST(a_capable_controller_carries_both_as_two_sets),
        TEST(a_capable_controller_never_gets_a_legacy_command),
        TEST(a_controller_with_less_room_is_given_a_smaller_pack),
        TEST(a_controller_that_refuses_a_pack_is_given_a_smaller_one),
        TEST(a_pack_that_is_refused_when_it_is_switched_on_is_made_smaller),
        TEST(a_larger_pack_is_tried_again),
        TEST(an_interval_that_was_refused_is_tried_again),
        TEST(a_coding_that_was_refused_is_tried_again),
        TEST(features_that_were_missing_are_asked_for_again),
        TEST(long_range_alone_is_asked_for_again),
        TEST(without_coding_selection_the_first_version_is_used),
        TEST(a_controller_that_only_claims_coding_selection_still_transmits),
        TEST(a_legacy_controller_never_gets_an_extended_command),
        TEST(a_controller_of_before_bluetooth_5_gets_100_ms),
        TEST(extended_advertising_without_coded_phy_carries_legacy_only),
        TEST(a_controller_with_one_set_carries_legacy),
        TEST(nothing_is_advertised_before_there_is_a_payload),
        TEST(one_alone_can_be_switched_on),
        TEST(a_payload_is_taken_when_the_controller_says_so),
        TEST(what_never_reaches_the_controller_is_counted),
        TEST(a_payload_stays_until_it_must_have_been_sent),
        TEST(what_was_overtaken_is_not_sent),
        TEST(a_controller_without_room_is_waited_for),
        TEST(long_range_may_have_an_adapter_of_its_own),
        TEST(the_end_is_silent),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
