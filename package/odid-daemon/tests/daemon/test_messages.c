/* The bytes on the air, written out from the published layout; counters and packs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <opendroneid.h>

#include "daemon/messages.h"
#include "full_view.h"

static struct aircraft_view view;
static uint8_t message[MESSAGE_SIZE];

static int setup(void **state)
{
    (void)state;
    view = full_view();
    return 0;
}

static void encode(enum message_type type, unsigned index)
{
    memset(message, 0xEE, sizeof(message));
    assert_true(messages_encode(&view, type, index, message));
}

/* ---- the five messages, byte for byte ---- */

static void basic_id_bytes(void **state)
{
    static const uint8_t expected[MESSAGE_SIZE] = {0x02, 0x11, 'S', 'S', 'R', 'S',
                                                   '5',  'G',  'B', 'G', '0', '1'};

    (void)state;
    encode(MESSAGE_BASIC_ID, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
}

static void location_bytes(void **state)
{
    static const uint8_t expected[MESSAGE_SIZE] = {
        0x12,                   /* type 1, protocol 2 */
        0x22,                   /* airborne, above take-off, west, speed in 0.25 m/s */
        0x5A,                   /* 270 - 180 degrees */
        0x50,                   /* 20 m/s */
        0xFB,                   /* -2.5 m/s */
        0xE8, 0xAD, 0x65, 0x22, /* 57.7089 */
        0xD0, 0x2D, 0x23, 0x07, /* 11.9746 */
        0x9B, 0x08,             /* (101.5 + 1000) * 2 */
        0xC1, 0x08,             /* (120.5 + 1000) * 2 */
        0x18, 0x08,             /* (36 + 1000) * 2 */
        0x5B,                   /* vertical 5, horizontal 11 */
        0x43,                   /* barometer 4, speed 3 */
        0x39, 0x30,             /* 12345 tenths of a second */
        0x02, 0x00,
    };

    (void)state;
    encode(MESSAGE_LOCATION, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
}

static void location_bytes_when_nothing_is_known(void **state)
{
    static const uint8_t expected[MESSAGE_SIZE] = {
        0x12, 0x43,                         /* remote ID system failure, west, speed in 0.75 m/s */
        0xB5,                               /* 361 - 180 */
        0xFF,                               /* 255 m/s */
        0x7E,                               /* 63 m/s */
        0,    0,    0,    0,    0, 0, 0, 0, /* 0,0 */
        0,    0,    0,    0,    0, 0,       /* -1000 m, three times */
        0,    0,    0xFF, 0xFF, 0, 0,
    };

    (void)state;
    memset(&view, 0, sizeof(view));
    view.location.status = AIRCRAFT_REMOTE_ID_FAILURE;
    view.location.latitude_deg = view.location.longitude_deg = NAN;
    view.location.altitude_barometric_m = view.location.altitude_geodetic_m = NAN;
    view.location.height_m = view.location.timestamp_s = NAN;
    view.location.direction_deg = view.location.speed_mps = NAN;
    view.location.vertical_speed_mps = NAN;
    encode(MESSAGE_LOCATION, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
}

static void authentication_bytes(void **state)
{
    uint8_t page_0[MESSAGE_SIZE] = {0x22, 0x10, 0x01, 40, 0x04, 0x03, 0x02, 0x01};
    uint8_t page_1[MESSAGE_SIZE] = {0x22, 0x11};

    (void)state;
    memset(page_0 + 8, 0xA0, 17);
    memset(page_1 + 2, 0xA1, 23);
    add_authentication(&view, 2);
    encode(MESSAGE_AUTHENTICATION, 0);
    assert_memory_equal(message, page_0, MESSAGE_SIZE);
    encode(MESSAGE_AUTHENTICATION, 1);
    assert_memory_equal(message, page_1, MESSAGE_SIZE);
}

static void self_id_bytes(void **state)
{
    uint8_t expected[MESSAGE_SIZE] = {0x32, 0x00};

    (void)state;
    memcpy(expected + 2, "Sea rescue surveillance", 23); /* full length, no terminator */
    encode(MESSAGE_SELF_ID, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
    view.description_type = 255;
    strcpy(view.description, "A");
    memset(expected + 1, 0, sizeof(expected) - 1);
    expected[1] = 255;
    expected[2] = 'A';
    encode(MESSAGE_SELF_ID, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
}

static void system_bytes(void **state)
{
    static const uint8_t expected[MESSAGE_SIZE] = {
        0x42, 0x05,             /* European Union, live GNSS */
        0x18, 0x6E, 0xE8, 0xEB, /* -33.7089 */
        0xD0, 0x7B, 0x95, 0x5A, /* 151.9746 */
        0x02, 0x00, 0x19,       /* two aircraft within 250 m */
        0xC0, 0x08,             /* (120 + 1000) * 2 */
        0x00, 0x00,             /* unknown */
        0x25,                   /* specific, C4 */
        0x31, 0x08,             /* (48.5 + 1000) * 2 */
        0xB3, 0x8D, 0x86, 0x0E, /* 243699123 s since 2019 */
        0x00,
    };

    (void)state;
    encode(MESSAGE_SYSTEM, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
}

static void operator_id_bytes(void **state)
{
    uint8_t expected[MESSAGE_SIZE] = {0x52, 0x00};

    (void)state;
    memcpy(expected + 2, "SWE3jxza7qbzvu5d", 16);
    encode(MESSAGE_OPERATOR_ID, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
    memcpy(view.operator_id, "ABCDEFGHIJKLMNOPQRST", 21); /* full length */
    memcpy(expected + 2, "ABCDEFGHIJKLMNOPQRST", 20);
    encode(MESSAGE_OPERATOR_ID, 0);
    assert_memory_equal(message, expected, MESSAGE_SIZE);
}

static void basic_id_at_full_length_and_binary(void **state)
{
    (void)state;
    memcpy(view.basic_id[0].uas_id, "ABCDFGHJKLMNPQRSTUVW", 21);
    encode(MESSAGE_BASIC_ID, 0);
    assert_memory_equal(message + 2, "ABCDFGHJKLMNPQRSTUVW\0\0\0", 23);
    view.basic_id[0].id_type = 3;
    memcpy(view.basic_id[0].uas_id, "\0\1\0\2\0\0\0\3\0\0\0\0\0\0\0\4\0\0\0\0", 20);
    encode(MESSAGE_BASIC_ID, 0);
    assert_memory_equal(message + 2, "\0\1\0\2\0\0\0\3\0\0\0\0\0\0\0\4\0\0\0\0\0\0\0", 23);
}

/* ---- which exist ---- */

static void location_and_system_always_exist_and_the_rest_when_known(void **state)
{
    (void)state;
    memset(&view, 0, sizeof(view));
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        unsigned expected = type == MESSAGE_LOCATION || type == MESSAGE_SYSTEM;

        assert_int_equal(messages_available(&view, type), expected);
        assert_int_equal(messages_encode(&view, type, 0, message), expected);
    }
    view = full_view();
    add_second_basic_id(&view);
    add_authentication(&view, 3);
    assert_int_equal(messages_available(&view, MESSAGE_BASIC_ID), 2);
    assert_int_equal(messages_available(&view, MESSAGE_AUTHENTICATION), 3);
    assert_int_equal(messages_available(&view, MESSAGE_SELF_ID), 1);
    assert_int_equal(messages_available(&view, MESSAGE_OPERATOR_ID), 1);
    assert_int_equal(messages_available(&view, MESSAGE_TYPES), 0);
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        for (unsigned index = 0; index < messages_available(&view, type); index++) {
            encode(type, index);
            assert_int_equal(message[0], type << 4 | 2);
        }
    }
    assert_false(messages_encode(&view, MESSAGE_BASIC_ID, 2, message));
    assert_false(messages_encode(&view, MESSAGE_AUTHENTICATION, 3, message));
    assert_false(messages_encode(&view, MESSAGE_TYPES, 0, message));
}

/* ---- wraps ---- */

static void a_legacy_advertisement_is_31_bytes_with_the_counter_at_octet_5(void **state)
{
    struct messages_counters counters = {0};
    uint8_t data[MESSAGES_LEGACY_SIZE];
    static const uint8_t head[] = {0x1E, 0x16, 0xFA, 0xFF, 0x0D, 0x00};

    (void)state;
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        if (messages_available(&view, type) > 0) {
            encode(type, 0);
            assert_true(messages_legacy(&counters, &view, type, 0, data));
            assert_memory_equal(data, head, sizeof(head));
            assert_memory_equal(data + 6, message, MESSAGE_SIZE);
        }
    }
    view.operator_id[0] = '\0';
    assert_false(messages_legacy(&counters, &view, MESSAGE_OPERATOR_ID, 0, data));
}

static void the_longest_wraps_fit_their_length_bytes(void **state)
{
    struct messages_counter extended = {0}, beacon = {0};
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_EXTENDED_SIZE], element[MESSAGES_ELEMENT_SIZE];
    static const uint8_t extended_head[] = {233, 0x16, 0xFA, 0xFF, 0x0D, 0x00, 0xF2, 25, 9};
    static const uint8_t element_head[] = {0xDD, 233, 0xFA, 0x0B, 0xBC, 0x0D, 0x00, 0xF2, 25, 9};
    size_t size;

    (void)state;
    add_second_basic_id(&view);
    add_authentication(&view, 3);
    size = messages_pack(&view, MESSAGES_PACK_MAX, pack);
    assert_int_equal(size, 3 + 9 * 25);
    assert_int_equal(messages_extended(&extended, pack, size, data), 234);
    assert_memory_equal(data, extended_head, sizeof(extended_head));
    assert_memory_equal(data + 6, pack, size);
    assert_int_equal(messages_element(&beacon, pack, size, element), 235);
    assert_memory_equal(element, element_head, sizeof(element_head));
    assert_memory_equal(element + 7, pack, size);
}

static void a_short_pack_has_short_wraps(void **state)
{
    struct messages_counter counter = {0};
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_ELEMENT_SIZE];
    size_t size;

    (void)state;
    memset(&view, 0, sizeof(view));
    size = messages_pack(&view, MESSAGES_PACK_MAX, pack);
    assert_int_equal(size, 3 + 2 * 25); /* Location and System */
    assert_int_equal(messages_extended(&counter, pack, size, data), 6 + size);
    assert_int_equal(data[0], 5 + size);
    assert_int_equal(messages_element(&counter, pack, size, data), 7 + size);
    assert_int_equal(data[1], 5 + size);
}

/* ---- packs ---- */

static void a_pack_is_in_the_order_of_types_and_decodes(void **state)
{
    static const uint8_t order[] = {0x02, 0x02, 0x12, 0x22, 0x22, 0x22, 0x32, 0x42, 0x52};
    uint8_t pack[MESSAGES_PACK_SIZE];
    ODID_MessagePack_encoded encoded;
    ODID_UAS_Data uas;

    (void)state;
    add_second_basic_id(&view);
    add_authentication(&view, 3);
    assert_int_equal(messages_pack(&view, MESSAGES_PACK_MAX, pack), sizeof(pack));
    assert_int_equal(pack[0], 0xF2);
    assert_int_equal(pack[1], 25);
    assert_int_equal(pack[2], 9);
    for (unsigned i = 0; i < 9; i++) {
        assert_int_equal(pack[3 + 25 * i], order[i]);
    }
    memset(&encoded, 0, sizeof(encoded));
    memcpy(&encoded, pack, sizeof(pack));
    odid_initUasData(&uas);
    assert_int_equal(decodeMessagePack(&uas, &encoded), ODID_SUCCESS);
    assert_true(uas.BasicIDValid[0] && uas.BasicIDValid[1] && uas.LocationValid &&
                uas.AuthValid[0] && uas.AuthValid[1] && uas.AuthValid[2] && uas.SelfIDValid &&
                uas.SystemValid && uas.OperatorIDValid);
    assert_string_equal(uas.BasicID[1].UASID, "SE-123");
}

static void authentication_is_left_out_of_a_pack_when_it_does_not_fit(void **state)
{
    uint8_t pack[MESSAGES_PACK_SIZE];

    (void)state;
    for (unsigned ids = 1; ids <= 2; ids++) {
        for (unsigned pages = 1; pages <= TELEMETRY_AUTH_PAGES; pages++) {
            unsigned others = 4 + ids, count;

            view = full_view();
            if (ids == 2) {
                add_second_basic_id(&view);
            }
            add_authentication(&view, pages);
            count = others + pages <= 9 ? others + pages : others;
            assert_int_equal(messages_pack(&view, MESSAGES_PACK_MAX, pack), 3 + 25 * count);
            assert_int_equal(pack[2], count);
        }
    }
}

/* Where that is enough: else it stays. */
static void a_spare_description_makes_room_for_authentication(void **state)
{
    uint8_t pack[MESSAGES_PACK_SIZE];

    (void)state;
    for (unsigned pages = 1; pages <= TELEMETRY_AUTH_PAGES; pages++) {
        view = full_view();
        view.description_spare = true;
        add_authentication(&view, pages);
        messages_pack(&view, MESSAGES_PACK_MAX, pack);
        assert_int_equal(pack[2], pages <= 4 ? 5 + pages : pages == 5 ? 9 : 5);
        assert_int_equal(messages_exceed_pack(&view, MESSAGE_SELF_ID), pages == 5);
        assert_int_equal(messages_exceed_pack(&view, MESSAGE_AUTHENTICATION), pages > 5);
    }
}

/* ---- counters ---- */

static uint8_t counter_of(struct messages_counters *counters, enum message_type type,
                          unsigned index)
{
    uint8_t data[MESSAGES_LEGACY_SIZE];

    assert_true(messages_legacy(counters, &view, type, index, data));
    return data[5];
}

static void a_counter_steps_only_when_the_content_changes_and_wraps(void **state)
{
    struct messages_counters counters = {0};

    (void)state;
    for (unsigned i = 0; i < 600; i++) {
        view.location.timestamp_s = i;
        for (unsigned repeat = 0; repeat < 3; repeat++) {
            assert_int_equal(counter_of(&counters, MESSAGE_LOCATION, 0), (uint8_t)i);
            assert_int_equal(counter_of(&counters, MESSAGE_SYSTEM, 0), 0); /* has one of its own */
            assert_int_equal(counter_of(&counters, MESSAGE_BASIC_ID, 0), 0);
        }
    }
}

static void every_single_bit_of_content_steps_the_counter(void **state)
{
    struct messages_counter counter = {0};
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_EXTENDED_SIZE];
    size_t size = messages_pack(&view, MESSAGES_PACK_MAX, pack);
    uint8_t last;

    (void)state;
    messages_extended(&counter, pack, size, data);
    last = data[5];
    for (size_t bit = 0; bit < size * 8; bit++) {
        pack[bit / 8] ^= (uint8_t)(1 << bit % 8);
        messages_extended(&counter, pack, size, data);
        assert_int_equal(data[5], (uint8_t)(last + 1));
        last = data[5];
        messages_extended(&counter, pack, size, data);
        assert_int_equal(data[5], last);
    }
}

static void two_basic_ids_share_a_counter(void **state)
{
    struct messages_counters counters = {0};

    (void)state;
    add_second_basic_id(&view);
    assert_int_equal(counter_of(&counters, MESSAGE_BASIC_ID, 0), 0);
    assert_int_equal(counter_of(&counters, MESSAGE_BASIC_ID, 1), 1);
    assert_int_equal(counter_of(&counters, MESSAGE_BASIC_ID, 0), 2);
}

static void all_pages_of_an_authentication_carry_the_same_counter(void **state)
{
    struct messages_counters counters = {0};

    (void)state;
    add_authentication(&view, 16);
    for (unsigned i = 0; i < 32; i++) {
        assert_int_equal(counter_of(&counters, MESSAGE_AUTHENTICATION, i % 16), 0);
    }
    view.auth[9].data[22] ^= 1; /* another message, whichever page is sent */
    for (unsigned i = 0; i < 16; i++) {
        assert_int_equal(counter_of(&counters, MESSAGE_AUTHENTICATION, i), 1);
    }
}

static void each_channel_counts_its_own_packs(void **state)
{
    struct messages_counter extended = {0}, beacon = {0};
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_ELEMENT_SIZE];

    (void)state;
    for (unsigned i = 0; i < 300; i++) {
        size_t size;

        view.location.timestamp_s = i;
        size = messages_pack(&view, MESSAGES_PACK_MAX, pack);
        messages_extended(&extended, pack, size, data);
        assert_int_equal(data[5], (uint8_t)i);
        if (i % 2 == 0) {
            messages_element(&beacon, pack, size, data);
            assert_int_equal(data[6], (uint8_t)(i / 2));
        }
    }
}

/* A controller's advertising data may have room for fewer messages. */
static void what_has_no_room_is_left_out_in_order(void **state)
{
    static const struct {
        unsigned most;
        uint8_t types[MESSAGES_PACK_MAX];
    } expected[] = {
        {9, {0, 0, 1, 2, 2, 2, 3, 4, 5}},
        {8, {0, 0, 1, 3, 4, 5}},
        {6, {0, 0, 1, 3, 4, 5}},
        {5, {0, 0, 1, 4, 5}},
        {4, {0, 1, 4, 5}},
        {3, {0, 1, 5}},
        {2, {0, 1}},
        {1, {1}},
    };
    uint8_t pack[MESSAGES_PACK_SIZE];

    (void)state;
    view = full_view();
    view.basic_ids = 2;
    view.basic_id[1] = view.basic_id[0];
    view.auth_pages = 3;
    for (unsigned page = 0; page < 3; page++) {
        view.auth[page] = (struct aircraft_auth_page){
            .type = 1, .page = (uint8_t)page, .last_page = 2, .length = 60};
    }
    for (size_t i = 0; i < sizeof(expected) / sizeof(expected[0]); i++) {
        size_t size = messages_pack(&view, expected[i].most, pack);

        assert_in_range(pack[2], 1, expected[i].most);
        assert_int_equal(size, 3 + 25 * pack[2]);
        for (unsigned j = 0; j < pack[2]; j++) {
            assert_int_equal(pack[3 + 25 * j] >> 4, expected[i].types[j]);
        }
        assert_true(pack[2] == 9 || expected[i].types[pack[2]] == 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_has_no_room_is_left_out_in_order),
        cmocka_unit_test_setup(basic_id_bytes, setup),
        cmocka_unit_test_setup(location_bytes, setup),
        cmocka_unit_test_setup(location_bytes_when_nothing_is_known, setup),
        cmocka_unit_test_setup(authentication_bytes, setup),
        cmocka_unit_test_setup(self_id_bytes, setup),
        cmocka_unit_test_setup(system_bytes, setup),
        cmocka_unit_test_setup(operator_id_bytes, setup),
        cmocka_unit_test_setup(basic_id_at_full_length_and_binary, setup),
        cmocka_unit_test_setup(location_and_system_always_exist_and_the_rest_when_known, setup),
        cmocka_unit_test_setup(a_legacy_advertisement_is_31_bytes_with_the_counter_at_octet_5,
                               setup),
        cmocka_unit_test_setup(the_longest_wraps_fit_their_length_bytes, setup),
        cmocka_unit_test_setup(a_short_pack_has_short_wraps, setup),
        cmocka_unit_test_setup(a_pack_is_in_the_order_of_types_and_decodes, setup),
        cmocka_unit_test_setup(authentication_is_left_out_of_a_pack_when_it_does_not_fit, setup),
        cmocka_unit_test_setup(a_spare_description_makes_room_for_authentication, setup),
        cmocka_unit_test_setup(a_counter_steps_only_when_the_content_changes_and_wraps, setup),
        cmocka_unit_test_setup(every_single_bit_of_content_steps_the_counter, setup),
        cmocka_unit_test_setup(two_basic_ids_share_a_counter, setup),
        cmocka_unit_test_setup(all_pages_of_an_authentication_carry_the_same_counter, setup),
        cmocka_unit_test_setup(each_channel_counts_its_own_packs, setup),
    };

    return cmocka_run_group_tests_name("messages", tests, NULL, NULL);
}
