/* odidctl flights: the table, one record in detail, the JSON. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <json-c/json_tokener.h>
#include <stdlib.h>
#include <unistd.h>

#include "flights/flights_show.h"
#include "flights/recorder_json.h"
#include "recorder_bench.h"

static char directory[64], text[65536];

static int set_up(void **state)
{
    snprintf(directory, sizeof(directory), "/tmp/odid-flights-XXXXXX");
    return mkdtemp(directory) == NULL ? -1 : bench_reset(state);
}

static int tear_down(void **state)
{
    char command[128];

    (void)state;
    snprintf(command, sizeof(command), "rm -rf %s", directory);
    return system(command);
}

/* The bench's record as a file, short of its last bytes. */
static void put_record(unsigned number, size_t missing)
{
    char path[128];
    FILE *file;

    snprintf(path, sizeof(path), "%s/%05u.jsonl", directory, number);
    file = fopen(path, "w");
    assert_non_null(file);
    assert_int_equal(fwrite(bench.text.bytes, 1, bench.text.length - missing, file),
                     bench.text.length - missing);
    assert_int_equal(fclose(file), 0);
}

static int show(const char *number, const char *boot, bool json)
{
    FILE *out = fmemopen(text, sizeof(text), "w");
    int result;

    assert_non_null(out);
    result = flights_show(out, directory, number, boot, json);
    assert_int_equal(fclose(out), 0);
    assert_null(strstr(text, "nan"));
    assert_null(strstr(text, "-9223372"));
    return result;
}

static void expect(const char *words)
{
    if (strstr(text, words) == NULL) {
        fail_msg("not there: %s\n%s", words, text);
    }
}

static void land(void)
{
    bench.snapshot.armed = false;
    pass(1);
}

static void end(void)
{
    recorder_end(&bench.recorder, bench.now_us);
}

/* ---- the table ---- */

static void a_good_flight(void **state)
{
    (void)state;
    pass(3);
    take_off();
    bench.snapshot.unix_us = UTC;
    pass(1500);
    land();
    end();
    put_record(12, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("12     2026-01-02 03:03  25 min   25 min   6.0 s   100 %           -"
           "               100 %           0\n");
    expect("       on the air the whole flight; ended in order\n");
}

static void take_off_at_once(void)
{
    set_sending(CHANNEL_BT4, true);
    set_sending(CHANNEL_WIFI, true);
    bench.snapshot.armed = true;
    pass(1);
}

static void newest_first_and_every_ending(void **state)
{
    (void)state;
    take_off();
    pass(60);
    recorder_say_totals(&bench.recorder);
    bench.text.stored = bench.text.length;
    put_record(1, 0); /* cut between two lines */
    pass(10);
    recorder_say_totals(&bench.recorder);
    put_record(2, 3); /* within one */
    end();
    put_record(103, 0);
    assert_int_equal(show(NULL, BOOT, false), 0);
    assert_true(strstr(text, "\n103 ") < strstr(text, "\n2 "));
    assert_true(strstr(text, "\n2 ") < strstr(text, "\n1 "));
    expect("clock unknown");
    expect("on the air the whole flight; it is being recorded");
    expect("on the air the whole flight, the record ends while armed; ended in order");
    assert_int_equal(show(NULL, "another power-on", false), 0);
    expect("on the air the whole flight, the record ends while armed; power cut");
    assert_null(strstr(text, "being recorded"));
    /* the torn totals are those of ten seconds before */
    assert_int_equal(show("2", "", false), 0);
    expect("power cut (the last line is torn, and left out)");
    expect("armed 60 s");
}

/* A board that restarts in the air: two records, and each was of a whole flight. */
static void a_flight_that_is_in_two_records(void **state)
{
    (void)state;
    take_off();
    pass(60);
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    bench_reset(NULL);
    bench.snapshot.armed_known = false;
    pass(1);
    bench.snapshot.armed_known = true;
    take_off_at_once();
    pass(60);
    recorder_say_totals(&bench.recorder);
    put_record(2, 0);
    land();
    pass(5);
    bench.snapshot.armed = true; /* its next flight changes nothing */
    pass(5);
    land();
    recorder_say_totals(&bench.recorder);
    put_record(3, 0);
    assert_int_equal(show(NULL, BOOT, false), 0);
    expect("on the air the whole flight, armed when the record began; it is being recorded\n");
    assert_int_equal(show("1", "", false), 0);
    expect("1: on the air the whole flight, the record ends while armed\n");
    assert_int_equal(show("2", "", false), 0);
    expect("2: on the air the whole flight, armed when the record began, the record ends while "
           "armed\n");
    assert_int_equal(show("3", "", false), 0);
    expect("3: on the air the whole flight, armed when the record began\n");
}

/* It passed for one that was never armed. */
static void a_power_cut_at_arming(void **state)
{
    (void)state;
    take_off();
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("       just armed, the record ends while armed; power cut\n");
    assert_int_equal(show(NULL, BOOT, false), 0);
    expect("       just armed; it is being recorded\n");
}

static void a_flight_with_gaps_on_one_channel(void **state)
{
    (void)state;
    take_off();
    pass(100);
    set_sending(CHANNEL_WIFI, false);
    pass(4);
    set_sending(CHANNEL_WIFI, true);
    pass(96);
    end();
    put_record(1, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("on the air the whole flight by Bluetooth 4; gaps: Wi-Fi beacon 97.9 %, longest gap "
           "4.1 s, the record ends while armed; ended in order\n");
    expect(" 100 % ");
    expect(" 97.9 % 4.1 s ");
    assert_int_equal(show("1", "", false), 0);
    expect("Wi-Fi beacon had a gap of 4.1 s\n");
    expect("1 gap, the longest 4.1 s\n");
    assert_true(strstr(text, "had a gap") < strstr(text, "FAULT wifi")); /* it began before */
    expect("FAULT wifi: absent (nothing there)");
}

static void a_tiny_gap_is_not_rounded_away(void **state)
{
    (void)state;
    take_off();
    pass(50000);
    set_sending(CHANNEL_WIFI, false);
    pass(2);
    set_sending(CHANNEL_WIFI, true);
    pass(2);
    end();
    put_record(1, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect(" 99.9 % 2.1 s ");
}

static void a_flight_with_gaps_everywhere(void **state)
{
    (void)state;
    take_off();
    pass(10);
    bench.snapshot.position = false;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        set_sending(channel, false);
        pass(20);
        set_sending(channel, channel != CHANNEL_BT5);
        pass(10);
    }
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("on the air WITH GAPS: Bluetooth 4 79.8 %, longest gap 20 s, Wi-Fi beacon 79.8 %, "
           "longest gap 20 s, without a position for 89 s, the record ends while armed; power cut");
}

static void switch_off(enum channel channel)
{
    bench.snapshot.channels[channel].required = false;
    bench.snapshot.channels[channel].disabled = true;
    set_sending(channel, false);
    pass(10);
}

/* Its gaps went out of the verdict; without any channel a good flight wasn't on the air. */
static void what_is_switched_off_after_landing_changes_no_flight(void **state)
{
    (void)state;
    take_off();
    pass(100);
    set_sending(CHANNEL_WIFI, false);
    pass(4);
    set_sending(CHANNEL_WIFI, true);
    pass(96);
    land();
    switch_off(CHANNEL_WIFI);
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    switch_off(CHANNEL_BT4);
    end();
    put_record(2, 0);
    for (int number = 1; number <= 2; number++) {
        assert_int_equal(show(number == 1 ? "1" : "2", "", false), 0);
        expect("on the air the whole flight by Bluetooth 4; gaps: Wi-Fi beacon 97.9 %, longest gap "
               "4.1 s\n");
        expect("97.9 % of the armed time, 1 gap, the longest 4.1 s\n");
        expect("Bluetooth 5  not required\n");
    }
    assert_int_equal(show(NULL, "", false), 0);
    expect(" 97.9 % 4.1 s ");
    assert_int_equal(show("2", "", true), 0);
    expect("\"armed_longest_gap_s\": 4.10");
}

/* What an earlier version wrote knows only of now. */
static void a_record_of_an_earlier_version(void **state)
{
    static const char *const lines[] = {
        "{\"t\":3.00,\"event\":\"start\",\"boot\":\"b\"}",
        "{\"t\":99.00,\"event\":\"totals\",\"armed_since\":null,\"armed_s\":50.00,\"channels\":{"
        "\"bt4\":{\"required\":true,\"first\":3.00,\"heard\":99.00},"
        "\"wifi\":{\"required\":false,\"first\":3.00,\"heard\":99.00}}}",
    };

    (void)state;
    bench.text.length = 0;
    recorder_text_add(&bench.text, lines[0]);
    recorder_text_add(&bench.text, lines[1]);
    put_record(1, 0);
    assert_int_equal(show("1", "", false), 0);
    expect("Flight record 1: on the air the whole flight\n");
    expect("Wi-Fi beacon not required\n");
    recorder_text_add(&bench.text, "{\"t\":100.00,\"event\":\"totals\",\"armed_s\":0.00}");
    put_record(1, 0);
    assert_int_equal(show("1", "", false), 0);
    expect("Flight record 1: never armed, and never on the air\n");
}

static void a_flight_that_nobody_could_hear(void **state)
{
    (void)state;
    bench.snapshot.armed = true;
    pass(1);
    pass(100);
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("NOT on the air in flight, armed when the record began, the record ends while armed; "
           "power cut");
    expect("never");
    set_sending(CHANNEL_BT4, true);
    pass(100);
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("on the air WITH GAPS: Bluetooth 4 50.0 %, longest gap 100 s, Wi-Fi beacon never");
}

static void on_the_ground(void **state)
{
    (void)state;
    pass(100);
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    set_sending(CHANNEL_BT4, true);
    pass(1);
    recorder_say_totals(&bench.recorder);
    put_record(2, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect("never armed; power cut");
    expect("never armed, and never on the air; power cut");
}

/* Its autopilot was never heard, or not any more when it took off. */
static void it_may_have_flown_when_nobody_said_that_it_did_not(void **state)
{
    (void)state;
    bench.snapshot.armed_known = false;
    pass(100);
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    set_sending(CHANNEL_BT4, true);
    bench.snapshot.armed_known = true;
    pass(5);
    bench.snapshot.armed_known = false;
    pass(200);
    recorder_say_totals(&bench.recorder);
    put_record(2, 0);
    assert_int_equal(show(NULL, "", false), 0);
    expect(" nobody said for 100 s whether it was armed, and never on the air; power cut");
    expect(" nobody said for 5 min whether it was armed; power cut");
    assert_int_equal(show("2", "", false), 0);
    expect("Flight record 2: nobody said for 5 min whether it was armed\n");
    expect("Lasted       5 min, whether armed was not said for 5 min\n");
    assert_int_equal(show("2", "", true), 0);
    expect("\"untold_s\": 301.00,");
    expect("\"verdict\": \"nobody said for 5 min whether it was armed\"");
    bench.snapshot.armed_known = bench.snapshot.armed = true;
    pass(5);
    recorder_say_totals(&bench.recorder);
    put_record(3, 0);
    assert_int_equal(show("3", "", false), 0);
    expect("; nobody said for 3 min whether it was armed");
}

/* ---- one in detail ---- */

static void end_and_show(void)
{
    end();
    put_record(7, 0);
    assert_int_equal(show("7", "", false), 0);
}

static void one_in_detail(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.unix_us = UTC;
    bench.snapshot.channels[CHANNEL_WIFI].known = RADIO_COUNTED;
    pass(5);
    bench.snapshot.position = false;
    pass(10);
    bench.snapshot.position = true;
    bench.snapshot.daemon_start_us = bench.now_us;
    pass(1);
    land();
    end_and_show();
    expect("Flight record 7: on the air the whole flight, without a position for 10 s, the daemon "
           "started again 1 time\n");
    expect("Power-on     2026-01-02T03:03:50Z, recorded from 3.0 s after it\n");
    expect("End          in order\n");
    expect("odid-daemon " ODID_VERSION ", image 2026.1 \"x\\y\"\n");
    expect("Bluetooth 4  first on the air after 3.0 s; armed, without a gap\n");
    expect("Bluetooth 5  not required\n");
    expect("Wi-Fi beacon first on the air after 3.0 s; armed, without a gap; at times told by "
           "its chip's own count\n");
    expect("Faults       1, 1 of them while armed\n");
    expect("Daemon       started again 1 time\n");
    expect("    3.0 s  Bluetooth 4 is on the air for the first time\n");
    expect("   14.0 s  armed\n");
    expect("   15.0 s  the autopilot says that it is 2026-01-02T03:04:05Z\n");
    expect("   20.0 s  FAULT position: no position from the autopilot\n");
    assert_true(strstr(text, "daemon was started") < strstr(text, "over: position"));
    expect("   30.0 s  over: position, after 10 s\n");
    expect("   29.0 s  odid-daemon was started again\n");
    expect("   31.0 s  disarmed, after 17 s\n");
    assert_int_equal(show("00007", "", false), 0);
}

static void what_nobody_looked_at_is_in_the_verdict(void **state)
{
    (void)state;
    take_off();
    pass_us(7 * SECOND);
    end_and_show();
    expect(
        "Flight record 7: on the air the whole flight, unwatched for 7.0 s, the record ends while "
        "armed\n");
    expect("   14.0 s  nobody looked for 7.0 s\n");
}

/* A silence may stand in a line that was damaged: "on the air the whole flight", and no more. */
static void that_a_record_is_damaged_is_in_the_verdict(void **state)
{
    char *line;

    (void)state;
    take_off();
    pass(30);
    end();
    line = strchr(bench.text.bytes, '\n');
    assert_non_null(line);
    line[1] = 'x';
    put_record(7, 0);
    assert_int_equal(show("7", "", false), 0);
    expect("on the air the whole flight");
    expect("; 1 line of the record can't be understood\n");
}

/* A flight of a simulator, or of somebody else's word, passed for one that was proven. */
static void what_was_sent_of_a_simulation_is_in_the_verdict(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.simulated = true;
    pass(30);
    bench.snapshot.two_sources = true;
    pass(10);
    bench.snapshot.simulated = bench.snapshot.two_sources = false;
    land();
    bench.snapshot.two_sources = true; /* on the ground it is nobody's flight */
    pass(10);
    end_and_show();
    expect(
        "Flight record 7: on the air the whole flight, simulated for 40 s, two sources spoke for "
        "10 s\n");
}

/* One who speaks as the satellites, near the end, redated the whole power-on. */
static void a_clock_that_jumps_redates_nothing_and_is_in_the_verdict(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.unix_us = UTC;
    pass(100);
    bench.snapshot.unix_us += 3 * SECOND; /* leap seconds, drift */
    pass(100);
    end_and_show();
    expect("Flight record 7: on the air the whole flight, the record ends while armed\n");
    bench.snapshot.unix_us -= 5 * 86400 * SECOND;
    pass(100);
    end_and_show();
    expect("2026-01-02T03:03:5");
    expect("Flight record 7: on the air the whole flight, the record ends while armed; the "
           "autopilot's clock jumped by 5 days\n");
}

/* Every receiver showed a failure, and then an emergency, of a flight that passed for a good one.
 */
static void what_every_receiver_was_told_is_in_the_verdict(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.failure = true;
    pass(12);
    bench.snapshot.failure = false;
    bench.snapshot.emergency = true;
    pass(20);
    bench.snapshot.emergency = false;
    land();
    end_and_show();
    expect("Flight record 7: on the air the whole flight, said Remote ID failure for 12 s, said an "
           "emergency for 20 s\n");
}

/* Whoever has taken the recorder over writes on no technician's terminal. */
static void a_record_moves_no_cursor(void **state)
{
    const char *line = "{\"t\":15,\"event\":\"fault\",\"what\":\"x\\u001b[2J\","
                       "\"text\":\"\\u001b[1;1Hall is well\\n      16.0 s  disarmed\"}\n";
    char path[128];
    FILE *file;

    (void)state;
    take_off();
    put_record(7, 0);
    snprintf(path, sizeof(path), "%s/00007.jsonl", directory);
    file = fopen(path, "a");
    assert_non_null(file);
    assert_true(fputs(line, file) >= 0);
    assert_int_equal(fclose(file), 0);
    assert_int_equal(show("7", "", false), 0);
    expect("   15.0 s  FAULT x?[2J: ?[1;1Hall is well?      16.0 s  disarmed\n");
    assert_null(strchr(text, '\033'));
}

static void months_in_detail(void **state)
{
    (void)state;
    take_off();
    for (int i = 0; i < 3000; i++) {
        bench.snapshot.link = i % 2 == 0;
        pass(1);
    }
    recorder_say_totals(&bench.recorder);
    put_record(1, 0);
    assert_int_equal(show("1", "", false), 0);
    expect(" older events were dropped here: a record has a bound\n");
    expect("Faults       1500, 1500 of them while armed\n");
}

/* ---- JSON ---- */

static struct json_object *parse(void)
{
    struct json_object *value = json_tokener_parse(text);

    assert_non_null(value);
    return value;
}

static void as_json(void **state)
{
    struct json_object *array, *flight;

    (void)state;
    assert_int_equal(show(NULL, "", true), 0);
    array = parse();
    assert_int_equal(json_object_array_length(array), 0);
    json_object_put(array);
    take_off();
    bench.snapshot.unix_us = UTC;
    pass(100);
    set_sending(CHANNEL_WIFI, false);
    pass(4);
    recorder_say_totals(&bench.recorder);
    put_record(3, 0);
    assert_int_equal(show(NULL, "", true), 0);
    array = parse();
    flight = json_object_array_get_idx(array, 0);
    assert_int_equal(recorder_json_count(flight, "number"), 3);
    assert_string_equal(recorder_json_text(flight, "start_utc", ""), "2026-01-02T03:03:50Z");
    assert_string_equal(recorder_json_text(flight, "ended", ""), "power cut");
    assert_int_equal(recorder_json_us(flight, "duration_s", 0), 118 * SECOND);
    assert_int_equal(recorder_json_us(flight, "armed_s", 0), 104 * SECOND);
    assert_int_equal(recorder_json_us(flight, "first_broadcast_s", 0), 3 * SECOND);
    assert_int_equal(recorder_json_us(flight, "channels.wifi.armed_on_air_s", 0), 99900000);
    assert_int_equal(recorder_json_us(flight, "channels.wifi.armed_longest_gap_s", 0), 4100000);
    assert_int_equal(recorder_json_count(flight, "channels.wifi.armed_gaps"), 1);
    assert_int_equal(recorder_json_us(flight, "channels.bt4.armed_on_air_s", 0), 104 * SECOND);
    assert_null(recorder_json_find(flight, "channels.bt5.armed_on_air_s"));
    assert_int_equal(recorder_json_count(flight, "armed_faults"), 1);
    assert_null(recorder_json_find(flight, "events"));
    json_object_put(array);
    assert_int_equal(show("3", "", true), 0);
    flight = parse();
    assert_int_equal(json_object_array_length(recorder_json_find(flight, "events")), 6);
    json_object_put(flight);
}

/* ---- what can't be shown ---- */

static void what_is_not_there(void **state)
{
    char path[128];
    FILE *file;

    (void)state;
    assert_int_equal(show(NULL, "", false), 0);
    expect("No flight is recorded yet in /tmp/odid-flights-");
    assert_int_equal(show("5", "", false), 1);
    assert_int_equal(show("-1", "", false), 1);
    assert_int_equal(show("1x", "", false), 1);
    assert_int_equal(show("", "", false), 1);
    assert_int_equal(flights_show(stdout, "/nonexistent/flights", NULL, "", false), 1);
    /* an empty file, as a power cut may leave it, and one of somebody else */
    put_record(1, bench.text.length);
    snprintf(path, sizeof(path), "%s/00002.jsonl", directory);
    file = fopen(path, "w");
    assert_non_null(file);
    fputs("hello\n", file);
    fclose(file);
    assert_int_equal(show(NULL, "", false), 0);
    expect("the record can't be understood; power cut");
    assert_int_equal(show("2", "", false), 0);
    expect("1 line can't be understood, and is left out\n");
    assert_int_equal(show("1", "", true), 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(a_good_flight),
        TEST(newest_first_and_every_ending),
        TEST(a_flight_that_is_in_two_records),
        TEST(a_power_cut_at_arming),
        TEST(a_flight_with_gaps_on_one_channel),
        TEST(a_tiny_gap_is_not_rounded_away),
        TEST(a_flight_with_gaps_everywhere),
        TEST(what_is_switched_off_after_landing_changes_no_flight),
        TEST(a_record_of_an_earlier_version),
        TEST(a_flight_that_nobody_could_hear),
        TEST(on_the_ground),
        TEST(it_may_have_flown_when_nobody_said_that_it_did_not),
        TEST(one_in_detail),
        TEST(what_nobody_looked_at_is_in_the_verdict),
        TEST(that_a_record_is_damaged_is_in_the_verdict),
        TEST(what_was_sent_of_a_simulation_is_in_the_verdict),
        TEST(a_clock_that_jumps_redates_nothing_and_is_in_the_verdict),
        TEST(what_every_receiver_was_told_is_in_the_verdict),
        TEST(a_record_moves_no_cursor),
        TEST(months_in_detail),
        TEST(as_json),
        TEST(what_is_not_there),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
