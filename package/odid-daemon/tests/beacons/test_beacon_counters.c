/* What a chip's "counters" say: each layout by numbers of its own, and what isn't one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "beacons/beacon_counters.h"

static uint8_t answer[BEACON_COUNTERS_MAX];

static void put_u16(size_t at, uint16_t value)
{
    answer[at] = (uint8_t)value;
    answer[at + 1] = (uint8_t)(value >> 8);
}

static void put_u32(size_t at, uint32_t value)
{
    put_u16(at, (uint16_t)value);
    put_u16(at + 2, (uint16_t)(value >> 16));
}

static int set_up(void **state)
{
    (void)state;
    memset(answer, 0xEE, sizeof(answer));
    return 0;
}

/* In memory of that length: whoever reads on is told of by the sanitizer. */
static bool read_first(size_t length, uint32_t *beacons)
{
    uint8_t *cut = malloc(length > 0 ? length : 1);
    bool found;

    assert_non_null(cut);
    memcpy(cut, answer, length);
    found = beacon_counters_read(cut, length, beacons);
    free(cut);
    return found;
}

static void assert_whole_only(size_t whole)
{
    uint32_t beacons = 0;

    for (size_t length = 0; length < whole; length++) {
        assert_false(read_first(length, &beacons));
    }
    assert_true(read_first(whole, &beacons));
    assert_int_equal(beacons, 0x01020304);
    assert_true(read_first(sizeof(answer), &beacons)); /* as the driver hands it out */
}

static void one_structure(void **state)
{
    (void)state;
    for (uint16_t version = 10; version <= 11; version++) {
        put_u16(0, version);
        put_u16(2, 848);
        put_u32(216, 0x01020304);
        assert_whole_only(848);
    }
}

/* Those of the driver's part first, of an odd length. */
static void tagged_parts(void **state)
{
    static const uint16_t cores[] = {0x200, 0x300, 0x400};

    (void)state;
    for (size_t i = 0; i < sizeof(cores) / sizeof(cores[0]); i++) {
        put_u16(0, 30);
        put_u16(2, 4 + 732 + 4 + 256);
        put_u16(4, 0x100);
        put_u16(6, 730);
        put_u16(4 + 4 + 732, cores[i]);
        put_u16(4 + 4 + 732 + 2, 256);
        put_u32(4 + 4 + 732 + 4 + 20, 0x01020304);
        assert_whole_only(4 + 4 + 732 + 4 + 256);
    }
}

static void what_is_none(void **state)
{
    uint32_t beacons;

    (void)state;
    assert_false(read_first(sizeof(answer), &beacons)); /* of no version that is known */
    put_u16(0, 10);
    put_u16(2, 200); /* too short to have it */
    assert_false(read_first(sizeof(answer), &beacons));
    put_u16(0, 30);
    put_u16(2, 8);
    put_u16(4, 0x400);
    put_u16(6, 4); /* the part is */
    assert_false(read_first(sizeof(answer), &beacons));
    put_u16(2, 0);
    assert_false(read_first(sizeof(answer), &beacons));
    put_u16(2, 12);
    put_u16(4, 0x500);
    put_u16(6, 0xFFFF); /* one that leads out of it */
    assert_false(read_first(sizeof(answer), &beacons));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_structure, set_up),
        cmocka_unit_test_setup(tagged_parts, set_up),
        cmocka_unit_test_setup(what_is_none, set_up),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
