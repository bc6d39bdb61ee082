/* Which beacons are Remote ID's: what another radio hears is whoever's. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "beacons/beacon_listener.h"

#define MESSAGE 25
#define PACK (2 + 8 + MESSAGE) /* an element with a pack of one message */

static const uint8_t name[] = {0, 4, 'o', 'd', 'i', 'd'};
static const uint8_t head[] = {221, 8 + MESSAGE, 0xFA, 0x0B, 0xBC, 0x0D, 7, 0xF2, MESSAGE, 1};

/* Also an octet too much of it would be read: the sanitizer says so. */
static bool heard(const uint8_t *elements, size_t length)
{
    uint8_t *exact = malloc(length > 0 ? length : 1);
    bool is_remote_id;

    memcpy(exact, elements, length);
    is_remote_id = beacon_listener_is_remote_id(exact, length);
    free(exact);
    return is_remote_id;
}

static void a_pack_is_found_among_others(void **state)
{
    uint8_t beacon[sizeof(name) + PACK] = {0};

    (void)state;
    memcpy(beacon, name, sizeof(name));
    memcpy(beacon + sizeof(name), head, sizeof(head));
    assert_true(heard(beacon, sizeof(beacon)));
    assert_true(heard(beacon + sizeof(name), PACK));
    assert_false(heard(beacon, sizeof(name)));
}

static void an_element_that_is_cut_short_is_none(void **state)
{
    uint8_t element[PACK] = {0};

    (void)state;
    memcpy(element, head, sizeof(head));
    for (size_t length = 0; length < PACK; length++) {
        assert_false(heard(element, length));
    }
}

static void another_maker_s_element_is_none(void **state)
{
    /* its kind, no room for a message, maker, type, no pack, other messages; the counter is free */
    static const struct {
        size_t at;
        uint8_t octet;
        bool is_remote_id;
    } changes[] = {{0, 220, false},  {1, 7 + MESSAGE, false}, {2, 0xFB, false}, {4, 0xBD, false},
                   {5, 0x0E, false}, {6, 255, true},          {7, 0x02, false}, {8, 24, false}};

    (void)state;
    for (size_t i = 0; i < sizeof(changes) / sizeof(changes[0]); i++) {
        uint8_t element[PACK] = {0};

        memcpy(element, head, sizeof(head));
        element[changes[i].at] = changes[i].octet;
        assert_int_equal(heard(element, sizeof(element)), changes[i].is_remote_id);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pack_is_found_among_others),
        cmocka_unit_test(an_element_that_is_cut_short_is_none),
        cmocka_unit_test(another_maker_s_element_is_none),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
