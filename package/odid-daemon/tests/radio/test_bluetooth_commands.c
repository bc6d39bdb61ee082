/* The advertising commands' parameters, byte by byte (Bluetooth Core Vol 4 Part E 7.8). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "radio/bluetooth_commands.h"

static uint8_t out[255];
static const uint8_t address[6] = {1, 2, 3, 4, 5, 0xC6};

static void expect(size_t length, const char *bytes, size_t expected)
{
    assert_int_equal(length, expected);
    assert_memory_equal(out, bytes, expected);
}
#define EXPECT(length, bytes) expect(length, bytes, sizeof(bytes) - 1)

static void legacy_parameters(void **state)
{
    (void)state;
    EXPECT(bluetooth_parameters(BLUETOOTH_INTERVAL_20_MS, out),
           "\x20\x00\x20\x00\x03\x01\x00\x00\x00\x00\x00\x00\x00\x07\x00");
    EXPECT(bluetooth_parameters(BLUETOOTH_INTERVAL_100_MS, out),
           "\xA0\x00\xA0\x00\x03\x01\x00\x00\x00\x00\x00\x00\x00\x07\x00");
}

static void extended_parameters(void **state)
{
    (void)state;
    EXPECT(bluetooth_extended_parameters(BLUETOOTH_LEGACY, BLUETOOTH_INTERVAL_20_MS, out),
           "\x00\x10\x00\x20\x00\x00\x20\x00\x00\x07\x01\x00\x00\x00\x00\x00\x00\x00\x00\x7F"
           "\x01\x00\x01\x00\x00");
    EXPECT(bluetooth_extended_parameters(BLUETOOTH_LONG_RANGE, BLUETOOTH_INTERVAL_200_MS, out),
           "\x01\x00\x00\x40\x01\x00\x40\x01\x00\x07\x01\x00\x00\x00\x00\x00\x00\x00\x00\x7F"
           "\x03\x00\x03\x01\x00");
}

static void extended_parameters_with_the_choice_of_the_coding(void **state)
{
    (void)state;
    EXPECT(bluetooth_extended_parameters_v2(BLUETOOTH_LONG_RANGE, BLUETOOTH_INTERVAL_200_MS, out),
           "\x01\x00\x00\x40\x01\x00\x40\x01\x00\x07\x01\x00\x00\x00\x00\x00\x00\x00\x00\x7F"
           "\x03\x00\x03\x01\x00\x04\x04");
}

static void addresses(void **state)
{
    (void)state;
    EXPECT(bluetooth_extended_address(BLUETOOTH_LONG_RANGE, address, out),
           "\x01\x01\x02\x03\x04\x05\xC6");
}

static void data(void **state)
{
    static const uint8_t payload[] = {0x02, 0x16, 0xFA};

    (void)state;
    EXPECT(bluetooth_data(payload, 3, out),
           "\x03\x02\x16\xFA\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0");
    EXPECT(bluetooth_extended_data(BLUETOOTH_LONG_RANGE, payload, 3, out),
           "\x01\x03\x01\x03\x02\x16\xFA");
}

static void the_longest_data_fit_into_a_command(void **state)
{
    uint8_t payload[251] = {0};

    (void)state;
    assert_int_equal(bluetooth_extended_data(BLUETOOTH_LEGACY, payload, sizeof(payload), out), 255);
    assert_int_equal(bluetooth_data(payload, 31, out), 32);
    assert_int_equal(out[0], 31);
}

static void enabling(void **state)
{
    const bool both[] = {true, true}, long_range[] = {false, true}, none[] = {false, false};

    (void)state;
    EXPECT(bluetooth_extended_enable(both, out), "\x01\x02\x00\x00\x00\x00\x01\x00\x00\x00");
    EXPECT(bluetooth_extended_enable(long_range, out), "\x01\x01\x01\x00\x00\x00");
    EXPECT(bluetooth_extended_enable(none, out), "\x00\x00");
}

static void commands_that_change_what_is_advertised(void **state)
{
    static const uint16_t change[] = {0x0C03, 0x2005, 0x2006, 0x2008, 0x200A, 0x2035, 0x2036,
                                      0x2037, 0x2038, 0x2039, 0x203C, 0x203D, 0x207F};
    static const uint16_t leave[] = {0x0000, 0x0C01, 0x1009, 0x2001, 0x2003, 0x2007,
                                     0x200C, 0x203A, 0x203B, 0x203E, 0x2034, 0xFC01};

    (void)state;
    for (size_t i = 0; i < sizeof(change) / sizeof(change[0]); i++) {
        assert_true(bluetooth_changes_advertising(change[i]));
    }
    for (size_t i = 0; i < sizeof(leave) / sizeof(leave[0]); i++) {
        assert_false(bluetooth_changes_advertising(leave[i]));
    }
}

/* Within what 7.8.34 allows, and neither the least, the most, nor what a host would ask for. */
static void the_mark_is_one_that_nobody_else_makes(void **state)
{
    (void)state;
    assert_int_equal(bluetooth_mark(out), BLUETOOTH_MARK_SIZE);
    assert_memory_equal(out, "\x51\x00\xd3\x05", BLUETOOTH_MARK_SIZE);
    assert_false(bluetooth_changes_advertising(BLUETOOTH_WRITE_DATA_LENGTH));
}

static void the_address_comes_from_the_boot_id(void **state)
{
    uint8_t made[6];

    (void)state;
    assert_true(bluetooth_static_address("6f1b4a2e-1234-4abc-9def-0123456789ab\n", made));
    assert_memory_equal(made, "\xab\x89\x67\x45\x23\xc1", 6);
    assert_true(bluetooth_static_address("00000000-0000-0000-0000-fedcba987654", made));
    assert_memory_equal(made, "\x54\x76\x98\xba\xdc\xfe", 6);
}

static void what_is_no_boot_id_gives_no_address(void **state)
{
    static const char *const bad[] = {"",
                                      "-",
                                      "abc",
                                      "1-2-3-4-12345678901",
                                      "a-zzzzzzzzzzzz",
                                      "0123456789ab",
                                      "1-0x1234567890",
                                      "1- 12345678901"};
    uint8_t made[6];

    (void)state;
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++) {
        assert_false(bluetooth_static_address(bad[i], made));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(legacy_parameters),
        cmocka_unit_test(extended_parameters),
        cmocka_unit_test(extended_parameters_with_the_choice_of_the_coding),
        cmocka_unit_test(addresses),
        cmocka_unit_test(data),
        cmocka_unit_test(the_longest_data_fit_into_a_command),
        cmocka_unit_test(enabling),
        cmocka_unit_test(commands_that_change_what_is_advertised),
        cmocka_unit_test(the_mark_is_one_that_nobody_else_makes),
        cmocka_unit_test(the_address_comes_from_the_boot_id),
        cmocka_unit_test(what_is_no_boot_id_gives_no_address),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
