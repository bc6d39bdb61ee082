/* What octets cost, and what is a frame: also for somebody who would rather have it otherwise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <dirent.h>
#include <stdio.h>

#include "mavlink/framing.h"
#include "mavlink_frames.h"

#define CORPUS "fuzz/corpus/framing"
/* Long enough that what may be spent on credit doesn't count. */
#define MUCH (256 * 1024)

static struct framing framing;
static struct framing_counters counters;
static unsigned delivered;
static mavlink_message_t latest;

static void on_frame(void *context, const mavlink_message_t *message)
{
    (void)context;
    delivered++;
    latest = *message;
}

static int setup(void **state)
{
    (void)state;
    memset(&framing, 0, sizeof(framing));
    memset(&counters, 0, sizeof(counters));
    delivered = 0;
    frames_are(2, false);
    return 0;
}

static void as_datagram(const uint8_t *octets, size_t length)
{
    framing_datagram(&counters, octets, length, on_frame, NULL);
}

static void as_stream(const uint8_t *octets, size_t length)
{
    framing_stream(&framing, &counters, octets, length, on_frame, NULL);
}

typedef void feed_fn(const uint8_t *octets, size_t length);
static feed_fn *const feeds[] = {as_datagram, as_stream};

static struct frame position(void)
{
    const mavlink_global_position_int_t content = {
        .time_boot_ms = 123456, .lat = 577089000, .lon = 119746000, .alt = 120500, .hdg = 9000};

    return frame_global_position_int(1, 1, &content);
}

/* The frame that MAVLink 2 would be wrapped in: this header, the content as payload. */
static struct frame wrapped(uint8_t flags, uint32_t id, const struct frame *content)
{
    struct frame frame = {.bytes = {MAVLINK_STX, (uint8_t)content->length, flags, 0, 0, 1, 1,
                                    (uint8_t)id, (uint8_t)(id >> 8), (uint8_t)(id >> 16)}};

    memcpy(frame.bytes + 10, content->bytes, content->length);
    frame.length = 12 + content->length + (flags & MAVLINK_IFLAG_SIGNED ? 13 : 0);
    return frame;
}

/* ---- cost ---- */

static double looks_per_octet(feed_fn *feed, const uint8_t *octets, size_t length)
{
    memset(&counters, 0, sizeof(counters));
    memset(&framing, 0, sizeof(framing));
    while (counters.octets < MUCH) {
        feed(octets, length);
    }
    return (double)counters.looks / (double)counters.octets;
}

static double ordinary(feed_fn *feed)
{
    struct frame frame = position();

    return looks_per_octet(feed, frame.bytes, frame.length);
}

static void ordinary_traffic_is_looked_at_once(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 2; i++) {
        assert_true(ordinary(feeds[i]) <= 1.05);
        assert_true(ordinary(feeds[i]) >= 0.9);
        assert_int_equal(counters.refused + counters.bad_crc + counters.unknown_id, 0);
    }
}

static void no_input_of_the_corpus_costs_more_than_three_times_the_ordinary(void **state)
{
    DIR *folder = opendir(CORPUS);
    struct dirent *entry;
    unsigned inputs = 0;

    (void)state;
    assert_non_null(folder);
    while ((entry = readdir(folder)) != NULL) {
        char path[512];
        uint8_t octets[4096];
        size_t length;
        FILE *file;

        snprintf(path, sizeof(path), CORPUS "/%s", entry->d_name);
        if (entry->d_name[0] == '.' || (file = fopen(path, "rb")) == NULL) {
            continue;
        }
        length = fread(octets, 1, sizeof(octets), file);
        fclose(file);
        assert_true(length > 0);
        inputs++;
        for (unsigned i = 0; i < 2; i++) {
            assert_true(looks_per_octet(feeds[i], octets, length) <=
                        FRAMING_LOOKS_MAX * ordinary(feeds[i]));
        }
    }
    closedir(folder);
    assert_true(inputs >= 10);
}

/* Octets of the few values that begin frames, or make headers of them. */
static void neither_does_any_mixture_of_start_bytes(void **state)
{
    static const uint8_t values[] = {0xFD, 0xFE, 0xFF, 0, 1, 2, 9, 33, 28, 3};
    uint8_t octets[1024];
    unsigned seed = 7;

    (void)state;
    for (unsigned round = 0; round < 100; round++) {
        unsigned kinds = 2 + round % 9;

        for (size_t i = 0; i < sizeof(octets); i++) {
            seed = seed * 1103515245U + 12345U;
            octets[i] = values[(seed >> 16) % kinds];
        }
        for (unsigned i = 0; i < 2; i++) {
            assert_true(looks_per_octet(feeds[i], octets, 1 + (seed >> 8) % sizeof(octets)) <=
                        FRAMING_LOOKS_MAX * ordinary(feeds[i]));
        }
    }
}

/* ---- frames within frames ---- */

static void what_is_wrapped_in_another_frame_is_never_delivered(void **state)
{
    static const struct {
        uint8_t flags;
        uint32_t id;
    } wrappings[] = {
        {0x02, 0xFDFDFD}, /* flags that nobody knows, and no such message, ... */
        {0x02, 33},       /* ... or one that there is */
        {0x03, 33},       {0xFE, 0xFDFDFD},
        {0x80, 0},        {0x00, 60000}, /* a message that we don't know */
        {0x00, 0x20000},  {0x01, 60000},
        {0x00, 33}, /* one that we know, with a wrong checksum */
    };

    for (size_t i = 0; i < sizeof(wrappings) / sizeof(wrappings[0]); i++) {
        struct frame inner = position(),
                     outer = wrapped(wrappings[i].flags, wrappings[i].id, &inner);

        for (unsigned mode = 0; mode < 2; mode++) {
            setup(state);
            feeds[mode](outer.bytes, outer.length);
            assert_int_equal(delivered, 0);
            feeds[mode](inner.bytes, inner.length);
            assert_int_equal(delivered, 1);
            assert_int_equal(counters.refused + counters.unknown_id + counters.bad_crc, 1);
        }
    }
}

static void neither_is_what_mavlink_1_wraps(void **state)
{
    struct frame inner = position(), outer = {.bytes = {MAVLINK_STX_MAVLINK1, 0, 0, 1, 1, 33}};

    outer.bytes[1] = (uint8_t)inner.length;
    memcpy(outer.bytes + 6, inner.bytes, inner.length);
    outer.length = inner.length + 8;
    for (unsigned mode = 0; mode < 2; mode++) {
        setup(state);
        feeds[mode](outer.bytes, outer.length);
        feeds[mode](inner.bytes, inner.length);
        assert_int_equal(delivered, 1);
        assert_int_equal(counters.refused, 1);
    }
}

/* ---- datagrams ---- */

static void a_datagram_may_hold_several_frames(void **state)
{
    struct frame inner = position(), unknown = wrapped(0, 60000, &inner);
    uint8_t octets[512];
    size_t length = 0;

    (void)state;
    for (unsigned i = 0; i < 6; i++) {
        const struct frame *frame = i == 2 ? &unknown : &inner;

        memcpy(octets + length, frame->bytes, frame->length);
        length += frame->length;
    }
    as_datagram(octets, length);
    assert_int_equal(delivered, 5);
    assert_int_equal(counters.unknown_id, 1);
    assert_int_equal(counters.refused, 0);
}

/* From the first that is no whole, good frame on, nothing counts: there is no place to begin again.
 */
static void a_datagrams_rest_is_refused_with_what_is_no_frame(void **state)
{
    struct frame good = position();
    uint8_t octets[512];

    for (unsigned kind = 0; kind < 4; kind++) {
        struct frame bad = kind == 3 ? wrapped(0x40, 33, &good) : good;

        setup(state);
        if (kind == 0) {
            bad.bytes[0] = 'x';
        } else if (kind == 1) {
            bad.bytes[15] ^= 1;
        } else if (kind == 2) {
            bad.bytes[1] = 255; /* longer than what there is */
        }
        memcpy(octets, good.bytes, good.length);
        memcpy(octets + good.length, bad.bytes, bad.length);
        memcpy(octets + good.length + bad.length, good.bytes, good.length);
        as_datagram(octets, bad.length + 2 * good.length);
        assert_int_equal(delivered, 1);
        assert_int_equal(counters.refused + counters.bad_crc, 1);
    }
}

static void a_datagram_cut_anywhere_gives_no_frame(void **state)
{
    struct frame good = position();

    (void)state;
    for (size_t length = 1; length < good.length; length++) {
        as_datagram(good.bytes, length);
        as_datagram(good.bytes + length, good.length - length);
    }
    assert_int_equal(delivered, 0);
    as_datagram(good.bytes, 0);
    as_datagram(good.bytes, good.length);
    assert_int_equal(delivered, 1);
}

/* ---- streams ---- */

static void a_stream_is_read_again_after_any_flood(void **state)
{
    struct frame good = position();
    uint8_t flood[4000];

    for (unsigned value = 0; value < 256; value++) {
        setup(state);
        memset(flood, (int)value, sizeof(flood));
        as_stream(flood, sizeof(flood));
        for (unsigned i = 0; i < 12; i++) { /* the last false start may claim 280 octets */
            as_stream(good.bytes, good.length);
        }
        assert_true(delivered >= 5);
        delivered = 0;
        as_stream(good.bytes, good.length);
        assert_int_equal(delivered, 1);
    }
}

static void all_of_the_header_comes_through(void **state)
{
    struct frame good = position();

    (void)state;
    as_datagram(good.bytes, good.length);
    assert_int_equal(latest.msgid, MAVLINK_MSG_ID_GLOBAL_POSITION_INT);
    assert_int_equal(latest.sysid, 1);
    assert_int_equal(latest.compid, 1);
    assert_int_equal(latest.seq, good.bytes[4]);
    assert_int_equal(latest.len, good.length - 12);
    assert_int_equal(mavlink_msg_global_position_int_get_lat(&latest), 577089000);
}

#define TEST(name) cmocka_unit_test_setup(name, setup)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(ordinary_traffic_is_looked_at_once),
        TEST(no_input_of_the_corpus_costs_more_than_three_times_the_ordinary),
        TEST(neither_does_any_mixture_of_start_bytes),
        TEST(what_is_wrapped_in_another_frame_is_never_delivered),
        TEST(neither_is_what_mavlink_1_wraps),
        TEST(a_datagram_may_hold_several_frames),
        TEST(a_datagrams_rest_is_refused_with_what_is_no_frame),
        TEST(a_datagram_cut_anywhere_gives_no_frame),
        TEST(a_stream_is_read_again_after_any_flood),
        TEST(all_of_the_header_comes_through),
    };

    return cmocka_run_group_tests_name("framing", tests, NULL, NULL);
}
