/* The record's bound, and reading what a power cut left. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdlib.h>

#include "recorder_bench.h"

static void read_record(void)
{
    recorder_read(&bench.flight, bench.text.bytes, bench.text.length, NULL, NULL);
}

static void totals_that_were_not_written_are_replaced(void **state)
{
    (void)state;
    pass(1);
    recorder_say_totals(&bench.recorder);
    pass(1);
    recorder_say_totals(&bench.recorder);
    assert_int_equal(count_in_text("\"totals\""), 1);
    bench.text.stored = bench.text.length;
    pass(1);
    recorder_say_totals(&bench.recorder);
    assert_int_equal(count_in_text("\"totals\""), 2);
    assert_false(bench.text.changed);
}

/* An hour armed: totals each 10 s. The oldest of them go, and no event. */
static void a_long_flight_keeps_its_events(void **state)
{
    (void)state;
    take_off();
    for (int i = 0; i < 360 * 5; i++) {
        pass(10);
        recorder_say_totals(&bench.recorder);
        bench.text.stored = bench.text.length;
        assert_true(bench.text.length <= RECORDER_TEXT_MAX);
    }
    read_record();
    assert_int_equal(bench.flight.totals.armed_us, 18000 * SECOND);
    assert_int_equal(count_in_text("\"event\":\"armed\""), 1);
    assert_int_equal(count_in_text("\"event\":\"dropped\""), 0);
    assert_int_equal(bench.flight.dropped, 0);
}

/*
 * Three months of power, with a cable that comes loose every six minutes, and looks
 * as seldom: the record stays bounded, says what it dropped, and its totals are right.
 */
static void months_of_power(void **state)
{
    const int steps = 90 * 24 * 20; /* of 3 minutes */

    (void)state;
    take_off();
    bench.snapshot.unix_us = UTC;
    for (int i = 0; i < steps; i++) {
        bench.snapshot.link = i % 2 == 1;
        pass_us(180 * SECOND);
        recorder_say_totals(&bench.recorder);
        if (bench.text.length > RECORDER_TEXT_MAX) {
            fail_msg("step %d: %zu bytes", i, bench.text.length);
        }
        bench.text.stored = bench.text.length;
    }
    read_record();
    assert_true(bench.flight.started);
    assert_int_equal(bench.flight.bad, 0);
    assert_int_equal(bench.flight.totals.faults, steps / 2);
    assert_int_equal(bench.flight.totals.armed_us, 90 * 86400 * SECOND);
    assert_int_equal(count_in_text("\"event\":\"dropped\""), 1);
    assert_int_equal(count_in_text("\"event\":\"clock\""), 1);
    assert_int_equal(count_in_text("\"event\":\"start\""), 1);
    assert_int_equal(count_in_text("\"event\":\"first_broadcast\""), 2);
    assert_int_equal(bench.flight.totals.unwatched_us, 90 * 86400 * SECOND);
    /* every event is there, or counted as dropped: armed is the one more */
    assert_int_equal(bench.flight.dropped + count_in_text("\"event\":\"fault\"") +
                         count_in_text("\"event\":\"fault_over\"") +
                         count_in_text("\"event\":\"unwatched\"") +
                         count_in_text("\"event\":\"armed\""),
                     2 * steps + 1);
    assert_true(bench.flight.dropped > 40000);
    /* the newest are those that were kept */
    assert_non_null(memmem(bench.text.bytes + bench.text.length - 2048, 2048, "\"fault\"", 7));
}

/* The first one dates the record; that another one came is known by the last one. */
static void of_a_clock_that_jumps_the_first_and_the_last_word_are_kept(void **state)
{
    int64_t offset_us;

    (void)state;
    take_off();
    bench.snapshot.unix_us = UTC;
    pass(1);
    read_record();
    offset_us = bench.flight.clock_offset_us;
    assert_int_not_equal(offset_us, 0);
    for (int i = 0; i < 3000; i++) {
        bench.snapshot.unix_us += i % 100 == 0 ? 3600 * SECOND : 0;
        bench.snapshot.link = i % 2 == 0;
        pass(1);
        bench.text.stored = bench.text.length;
    }
    read_record();
    assert_true(bench.flight.dropped > 0);
    assert_in_range(count_in_text("\"event\":\"clock\""), 2, 29);
    assert_int_equal(bench.flight.clock_offset_us, offset_us);
    assert_int_equal(bench.flight.clock_last_us, offset_us + 30 * 3600 * SECOND);
    assert_true(bench.flight.clock_jump_us >= 3600 * SECOND);
}

/* Whoever runs on the board can pretend one each second, and a server can offer what is refused. */
static void a_thousand_updates_take_nothing_else(void **state)
{
    char sentence[160];

    (void)state;
    take_off();
    for (int i = 0; i < 1000; i++) {
        memset(sentence, i % 2 ? 'x' : '\"', sizeof(sentence) - 1);
        sentence[sizeof(sentence) - 1] = '\0';
        recorder_say_update(&bench.recorder, sentence, bench.now_us);
        pass(1);
        recorder_say_totals(&bench.recorder);
        bench.text.stored = bench.text.length;
    }
    read_record();
    assert_true(bench.flight.started);
    assert_int_equal(bench.flight.bad, 0);
    assert_int_equal(count_in_text("\"event\":\"start\""), 1);
    assert_int_equal(count_in_text("\"event\":\"first_broadcast\""), 2);
    assert_true(bench.flight.totals.armed_us >= 999 * SECOND);
    assert_true(bench.flight.dropped > 500);
}

static void what_was_dropped_is_known_after_a_restart(void **state)
{
    static struct recorder_text again;
    unsigned dropped;

    (void)state;
    take_off();
    for (int i = 0; i < 3000; i++) {
        bench.snapshot.link = i % 2 == 0;
        pass(1);
    }
    dropped = bench.text.dropped;
    assert_true(dropped > 0);
    recorder_text_load(&again, bench.text.bytes, bench.text.length);
    assert_int_equal(again.dropped, dropped);
    assert_int_equal(again.stored, again.length);
    assert_false(again.changed);
    assert_int_equal(again.length, bench.text.length);
}

/* Not ours: it must not make us write outside of the bound, nor stop us. */
static void a_file_of_something_else(void **state)
{
    static struct recorder_text text;
    static char bytes[RECORDER_TEXT_MAX + 100];
    static const char *const lines[] = {"{\"t\":1,\"event\":\"start\"}\n", "\n",
                                        "{\"event\":\"totals\n", "\"event\":\"", "\0\0\0\n"};

    (void)state;
    for (size_t i = 0; i < sizeof(lines) / sizeof(lines[0]); i++) {
        size_t size = i == 4 ? 4 : strlen(lines[i]);

        for (size_t at = 0; at < sizeof(bytes); at++) {
            bytes[at] = lines[i][at % size];
        }
        recorder_text_load(&text, bytes, sizeof(bytes));
        assert_true(text.length <= RECORDER_TEXT_MAX);
        for (int j = 0; j < 1000; j++) {
            recorder_text_add(&text, "{\"t\":1.00,\"event\":\"fault\",\"what\":\"x\"}");
            assert_true(text.length <= RECORDER_TEXT_MAX);
        }
        assert_true(text.length > 1000);
        recorder_read(&bench.flight, bytes, sizeof(bytes), NULL, NULL);
    }
    bytes[0] = 'x';
    recorder_text_load(&text, bytes, 1);
    assert_int_equal(text.length, 0);
    recorder_text_load(&text, bytes, 0);
    assert_int_equal(text.length, 0);
    assert_false(text.changed);
}

static void a_line_without_end_is_not_taken(void **state)
{
    char line[20000];
    size_t before = bench.text.length;

    (void)state;
    memset(line, 'x', sizeof(line));
    line[sizeof(line) - 1] = '\0';
    recorder_text_add(&bench.text, line);
    assert_int_equal(bench.text.length, before);
}

/* ---- power cuts ---- */

/* Cut at each byte: what is before the torn line is read, and the recorder goes on from it. */
static void a_power_cut_at_any_byte(void **state)
{
    static struct recorder_text again;
    static char exact[8192];
    size_t length;
    int64_t armed_us = 0;

    (void)state;
    take_off();
    for (int i = 0; i < 4; i++) {
        bench.snapshot.position = i % 2 == 1;
        pass(10);
        recorder_say_totals(&bench.recorder);
        bench.text.stored = bench.text.length;
    }
    recorder_end(&bench.recorder, bench.now_us);
    length = bench.text.length;
    assert_true(length < sizeof(exact));
    for (size_t cut = 0; cut <= length; cut++) {
        char *piece = malloc(cut + 1); /* of that size, so that a read beyond it is seen */

        memcpy(piece, bench.text.bytes, cut);
        recorder_read(&bench.flight, piece, cut, NULL, NULL);
        assert_int_equal(bench.flight.bad, 0);
        assert_int_equal(bench.flight.ended, cut == length);
        assert_int_equal(bench.flight.torn, cut > 0 && piece[cut - 1] != '\n');
        assert_true(bench.flight.totals.armed_us >= armed_us);
        armed_us = bench.flight.totals.armed_us;
        recorder_text_load(&again, piece, cut);
        assert_int_equal(again.changed, bench.flight.torn);
        recorder_read(&bench.flight, again.bytes, again.length, NULL, NULL);
        assert_false(bench.flight.torn);
        free(piece);
    }
    assert_int_equal(armed_us, 40 * SECOND);
}

/* The totals went, the event before them not. */
static void armed_just_before_a_power_cut(void **state)
{
    (void)state;
    pass(5);
    recorder_say_totals(&bench.recorder);
    bench.text.stored = bench.text.length;
    take_off();
    pass(7);
    bench.snapshot.armed = false;
    pass(1);
    recorder_say_totals(&bench.recorder);
    bench.text.length -= 5;
    read_record();
    assert_true(bench.flight.torn);
    assert_int_equal(bench.flight.totals.armed_us, 8 * SECOND);
    assert_int_equal(bench.flight.totals.armed_since_us, INT64_MIN);
}

/* What came instead of the last line's end: a block that was never written. */
static void a_block_of_zeros_is_left_out(void **state)
{
    (void)state;
    take_off();
    recorder_say_totals(&bench.recorder);
    memset(bench.text.bytes + bench.text.length, 0, 512);
    bench.text.bytes[bench.text.length + 511] = '\n';
    bench.text.length += 512;
    read_record();
    assert_int_equal(bench.flight.bad, 1);
    assert_true(bench.flight.started);
    assert_int_equal(bench.flight.totals.channels[CHANNEL_BT4].first_us, 3 * SECOND);
}

static void lines_of_another_version(void **state)
{
    static const char strange[] =
        "{\"t\":1.5,\"event\":\"start\",\"boot\":7}\n"
        "{\"t\":\"2\",\"event\":\"fault\"}\n"
        "{\"t\":3,\"event\":\"fault\",\"what\":\"x\"}\n{\"t\":3,\"event\":\"fault\",\"what\":\"x\"}"
        "\n"
        "{\"t\":1e300,\"event\":\"something new\"}\n"
        "{\"t\":4,\"event\":\"totals\",\"channels\":[],\"armed_s\":-1,\"faults\":-3}\n"
        "{\"t\":5,\"event\":\"clock\",\"utc\":\"yesterday\"}\n"
        "[]\n{}\nnull\n";

    (void)state;
    recorder_read(&bench.flight, strange, sizeof(strange) - 1, NULL, NULL);
    assert_true(bench.flight.started);
    assert_string_equal(bench.flight.boot, "");
    assert_int_equal(bench.flight.faults, 1);
    assert_int_equal(bench.flight.totals.faults, 0);
    assert_int_equal(bench.flight.clock_offset_us, 0);
    assert_int_equal(bench.flight.last_us, 5 * SECOND);
    assert_int_equal(bench.flight.bad, 3);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, bench_reset)
    const struct CMUnitTest tests[] = {
        TEST(totals_that_were_not_written_are_replaced),
        TEST(a_long_flight_keeps_its_events),
        TEST(months_of_power),
        TEST(of_a_clock_that_jumps_the_first_and_the_last_word_are_kept),
        TEST(a_thousand_updates_take_nothing_else),
        TEST(what_was_dropped_is_known_after_a_restart),
        TEST(a_file_of_something_else),
        TEST(a_line_without_end_is_not_taken),
        TEST(a_power_cut_at_any_byte),
        TEST(armed_just_before_a_power_cut),
        TEST(a_block_of_zeros_is_left_out),
        TEST(lines_of_another_version),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
