/* What the recorder makes of a flight: gaps, faults, totals; by a simulated clock. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "recorder_bench.h"

#define NEAR(a, b) assert_in_range((a) - (b) + 50000, 0, 100000)

static const struct recorder_channel_totals *totals(enum channel channel)
{
    return &bench.flight.totals.channels[channel];
}

static void expect_line(const char *line)
{
    if (count_in_text(line) != 1) {
        fail_msg("not once in the record: %s\n%.*s", line, (int)bench.text.length,
                 bench.text.bytes);
    }
}

/* ---- on the air ---- */

static void a_flight_without_a_gap(void **state)
{
    (void)state;
    pass(2);
    take_off();
    pass(60);
    bench.snapshot.armed = false;
    pass(1);
    pass(20);
    recorder_end(&bench.recorder, bench.now_us);
    recorder_read(&bench.flight, bench.text.bytes, bench.text.length, NULL, NULL);
    expect_line("{\"t\":3.00,\"event\":\"start\",\"format\":1,\"boot\":\"" BOOT "\"");
    expect_line("\"image\":\"2026.1 \\\"x\\\\y\\\"\"");
    expect_line("{\"t\":5.00,\"event\":\"first_broadcast\",\"channel\":\"bt4\"}");
    expect_line("{\"t\":5.00,\"event\":\"first_broadcast\",\"channel\":\"wifi\"}");
    expect_line("{\"t\":16.00,\"event\":\"armed\"}");
    expect_line("{\"t\":77.00,\"event\":\"disarmed\",\"seconds\":61.00}");
    expect_line("{\"t\":97.00,\"event\":\"end\"}");
    assert_int_equal(count_in_text("gap\""), 0);
    assert_int_equal(count_in_text("fault\""), 0);
    assert_int_equal(bench.flight.totals.armed_us, 61 * SECOND);
    assert_int_equal(totals(CHANNEL_BT4)->silent_us, 0);
    assert_false(totals(CHANNEL_BT5)->required);
    assert_true(bench.flight.ended);
    assert_int_equal(bench.flight.bad, 0);
    assert_int_equal(bench.flight.totals.armed_since_us, INT64_MIN);
}

static void a_gap_has_its_true_length(void **state)
{
    (void)state;
    take_off();
    pass(1);
    set_sending(CHANNEL_WIFI, false);
    pass(4);
    look();
    NEAR(bench.flight.open_gap_us[CHANNEL_WIFI], 4 * SECOND + 100000);
    assert_int_equal(bench.flight.open_gap_us[CHANNEL_BT4], 0);
    bench.now_us += 300000;
    set_sending(CHANNEL_WIFI, true);
    bench.now_us -= 300000;
    pass(1);
    look();
    expect_line("\"event\":\"gap\",\"channel\":\"wifi\",\"seconds\":4.40,\"armed\":true}");
    assert_int_equal(bench.flight.open_gap_us[CHANNEL_WIFI], 0);
    assert_int_equal(totals(CHANNEL_WIFI)->gaps, 1);
    NEAR(totals(CHANNEL_WIFI)->silent_us, 4400000);
    NEAR(totals(CHANNEL_WIFI)->longest_us, 4400000);
    assert_int_equal(totals(CHANNEL_BT4)->gaps, 0);
    /* the channel's own fault goes with it */
    expect_line("\"event\":\"fault\",\"what\":\"wifi\",\"text\":\"absent (nothing there)\"}");
    expect_line("\"event\":\"fault_over\",\"what\":\"wifi\",\"seconds\":4.00}");
}

/* Its silence shows a while after it began: the record had 1.9 of 4.4 s. */
static void what_was_taken_for_sent_is_taken_back(void **state)
{
    (void)state;
    take_off();
    pass(3);
    set_sending(CHANNEL_WIFI, false);
    bench.snapshot.channels[CHANNEL_WIFI].confirmed_us -= 2500000;
    pass(2);
    look();
    NEAR(bench.flight.open_gap_us[CHANNEL_WIFI], 4600000);
    set_sending(CHANNEL_WIFI, true);
    pass(1);
    expect_line("\"event\":\"gap\",\"channel\":\"wifi\",\"seconds\":4.60,\"armed\":true}");
    NEAR(totals(CHANNEL_WIFI)->silent_us, 0); /* as it was looked at last */
    look();
    NEAR(totals(CHANNEL_WIFI)->silent_us, 4600000);
}

static void that_a_chip_counted_is_kept(void **state)
{
    (void)state;
    take_off();
    pass(1);
    look();
    assert_int_equal(totals(CHANNEL_WIFI)->known, RADIO_SET);
    bench.snapshot.channels[CHANNEL_WIFI].known = RADIO_COUNTED;
    pass(1);
    bench.snapshot.channels[CHANNEL_WIFI].known = RADIO_SET;
    pass(1);
    look();
    assert_int_equal(totals(CHANNEL_WIFI)->known, RADIO_COUNTED);
    assert_int_equal(totals(CHANNEL_BT4)->known, RADIO_SET);
}

static void of_two_gaps_the_longest_counts(void **state)
{
    (void)state;
    take_off();
    pass(1);
    for (int seconds = 5; seconds >= 3; seconds -= 2) {
        set_sending(CHANNEL_BT4, false);
        pass(seconds);
        set_sending(CHANNEL_BT4, true);
        pass(10);
    }
    look();
    assert_int_equal(totals(CHANNEL_BT4)->gaps, 2);
    NEAR(totals(CHANNEL_BT4)->longest_us, 5100000);
    NEAR(totals(CHANNEL_BT4)->silent_us, 8200000);
}

static void only_the_armed_part_of_a_gap_counts(void **state)
{
    (void)state;
    set_sending(CHANNEL_BT4, true);
    set_sending(CHANNEL_WIFI, true);
    pass(10);
    set_sending(CHANNEL_BT4, false);
    pass(5);
    bench.snapshot.armed = true;
    pass(1);
    pass(3);
    bench.snapshot.armed = false;
    pass(1);
    pass(7);
    set_sending(CHANNEL_BT4, true);
    pass(1);
    look();
    assert_int_equal(count_in_text("\"event\":\"gap\""), 1);
    NEAR(totals(CHANNEL_BT4)->silent_us, 4 * SECOND);
    assert_int_equal(totals(CHANNEL_BT4)->silent_us, bench.flight.totals.armed_us);
    /* and a gap on the ground none at all */
    set_sending(CHANNEL_WIFI, false);
    pass(5);
    set_sending(CHANNEL_WIFI, true);
    pass(2);
    look();
    assert_int_equal(totals(CHANNEL_WIFI)->silent_us, 0);
    expect_line("\"channel\":\"wifi\",\"seconds\":5.10,\"armed\":false}");
}

static void a_channel_that_never_came_is_silent_from_arming_on(void **state)
{
    (void)state;
    set_sending(CHANNEL_BT4, true);
    pass(5);
    bench.snapshot.armed = true;
    pass(1);
    pass(50);
    look();
    NEAR(bench.flight.open_gap_us[CHANNEL_WIFI], 50 * SECOND);
    assert_int_equal(totals(CHANNEL_WIFI)->first_us, INT64_MIN);
    set_sending(CHANNEL_WIFI, true);
    pass(1);
    look();
    NEAR(totals(CHANNEL_WIFI)->silent_us, 50 * SECOND);
    assert_int_equal(bench.flight.open_gap_us[CHANNEL_WIFI], 0);
}

static void switch_off(enum channel channel)
{
    bench.snapshot.channels[channel].required = false;
    bench.snapshot.channels[channel].disabled = true;
    set_sending(channel, false);
}

static void a_channel_that_is_not_required_has_no_gaps(void **state)
{
    (void)state;
    set_sending(CHANNEL_BT4, true);
    set_sending(CHANNEL_WIFI, true);
    pass(10);
    switch_off(CHANNEL_WIFI);
    pass(10);
    bench.snapshot.armed = true;
    pass(100);
    look();
    assert_int_equal(bench.flight.open_gap_us[CHANNEL_WIFI], 0);
    assert_int_equal(totals(CHANNEL_WIFI)->silent_us, 0);
    assert_false(totals(CHANNEL_WIFI)->armed_required);
    assert_int_equal(bench.flight.totals.faults, 0);
}

/* By the time that it was looked at it sent again: the record had the last 0.8 s of 2.8. */
static void what_was_taken_for_sent_between_two_looks_is_taken_back(void **state)
{
    (void)state;
    take_off();
    pass(3);
    bench.now_us += 700000;
    set_sending(CHANNEL_WIFI, true);
    bench.snapshot.channels[CHANNEL_WIFI].paused_us = bench.now_us - 2800000;
    bench.now_us -= 700000;
    pass(3);
    expect_line("\"event\":\"gap\",\"channel\":\"wifi\",\"seconds\":2.80,\"armed\":true}");
    look();
    NEAR(totals(CHANNEL_WIFI)->silent_us, 2800000);
    assert_int_equal(totals(CHANNEL_WIFI)->gaps, 1);
}

/* Nobody wanted it meanwhile. */
static void a_silence_that_was_wanted_is_not_counted_later(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.armed = false;
    switch_off(CHANNEL_WIFI);
    pass(30);
    bench.snapshot.channels[CHANNEL_WIFI].required = true;
    bench.snapshot.channels[CHANNEL_WIFI].disabled = false;
    pass(4);
    set_sending(CHANNEL_WIFI, true);
    pass(1);
    expect_line("\"event\":\"gap\",\"channel\":\"wifi\",\"seconds\":4.00,\"armed\":false}");
}

/* It went out of the verdict, with every gap that it had. */
static void a_channel_that_is_switched_off_in_flight_is_silent(void **state)
{
    (void)state;
    take_off();
    pass(10);
    set_sending(CHANNEL_WIFI, false);
    pass(1);
    switch_off(CHANNEL_WIFI);
    pass(100);
    look();
    assert_int_equal(bench.flight.totals.faults, 1);
    assert_int_equal(bench.flight.faults, 0); /* that it is silent is wanted */
    NEAR(bench.flight.open_gap_us[CHANNEL_WIFI], 101 * SECOND + 100000);
    assert_true(totals(CHANNEL_WIFI)->armed_required);
    bench.snapshot.armed = false;
    pass(20);
    look();
    NEAR(totals(CHANNEL_WIFI)->silent_us, 102 * SECOND + 100000);
    assert_int_equal(totals(CHANNEL_WIFI)->gaps, 1);
    assert_int_equal(bench.flight.open_gap_us[CHANNEL_WIFI], 0);
}

/* Each daemon asks for long range until the controller has said that it has none. */
static void what_the_hardware_never_could_is_not_missed(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.channels[CHANNEL_BT5].required = true;
    pass(2);
    bench.snapshot.channels[CHANNEL_BT5].required = false;
    pass(10);
    look();
    assert_false(totals(CHANNEL_BT5)->armed_required);
    assert_int_equal(bench.flight.open_gap_us[CHANNEL_BT5], 0);
}

/* The daemon said that its hardware can't, and its silence passed for wanted. */
static void a_channel_that_was_on_the_air_and_cannot_any_more_is_missed(void **state)
{
    (void)state;
    take_off();
    pass(1);
    bench.snapshot.channels[CHANNEL_WIFI].required = false;
    set_sending(CHANNEL_WIFI, false);
    pass(20);
    look();
    NEAR(bench.flight.open_gap_us[CHANNEL_WIFI], 20 * SECOND + 100000);
    NEAR(bench.flight.totals.fault_us[RECORDER_CHANNEL + CHANNEL_WIFI], 19 * SECOND);
    assert_true(totals(CHANNEL_WIFI)->required);
}

/* ---- the daemon ---- */

static void a_daemon_that_does_not_answer_is_a_fault(void **state)
{
    (void)state;
    take_off();
    pass(1);
    bench.snapshot.answered = false;
    snprintf(bench.snapshot.text, sizeof(bench.snapshot.text), "the daemon does not run");
    bench.sends[CHANNEL_BT4] = bench.sends[CHANNEL_WIFI] = false;
    pass(3);
    look();
    assert_int_equal(bench.flight.faults, 1);
    assert_string_equal(bench.flight.fault[0].name, "daemon");
    NEAR(bench.flight.open_gap_us[CHANNEL_BT4], 3 * SECOND + 100000);
    bench.snapshot.answered = true;
    bench.snapshot.daemon_start_us = bench.now_us;
    set_sending(CHANNEL_BT4, true);
    set_sending(CHANNEL_WIFI, true);
    pass(5);
    look();
    expect_line("\"event\":\"fault\",\"what\":\"daemon\",\"text\":\"the daemon does not run\"}");
    expect_line("\"event\":\"fault_over\",\"what\":\"daemon\",\"seconds\":3.00}");
    expect_line("\"event\":\"daemon_restarted\"}");
    assert_int_equal(bench.flight.totals.restarts, 1);
    assert_int_equal(bench.flight.faults, 0);
    NEAR(bench.flight.totals.fault_us[RECORDER_DAEMON], 3 * SECOND);
    NEAR(totals(CHANNEL_WIFI)->silent_us, 3 * SECOND + 100000);
}

/* It sent on: that it didn't answer was no gap. */
static void a_daemon_that_was_only_mute_made_no_gap(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.answered = false;
    pass(5);
    bench.snapshot.answered = true;
    pass(2);
    look();
    assert_int_equal(totals(CHANNEL_BT4)->gaps, 0);
    assert_int_equal(totals(CHANNEL_BT4)->silent_us, 0);
    assert_int_equal(bench.flight.totals.restarts, 0);
    assert_int_equal(bench.flight.totals.armed_faults, 1);
}

/* Killed and started again between two looks. */
static void a_quick_restart_is_seen(void **state)
{
    (void)state;
    take_off();
    assert_int_equal(look()->totals.armed_restarts, 0);
    pass_us(400000);
    bench.snapshot.daemon_start_us = bench.now_us;
    bench.snapshot.channels[CHANNEL_BT4].unbroken_us = bench.now_us + 300000;
    bench.snapshot.channels[CHANNEL_WIFI].unbroken_us = bench.now_us + 300000;
    pass(1);
    look();
    assert_int_equal(bench.flight.totals.restarts, 1);
    assert_int_equal(totals(CHANNEL_BT4)->gaps, 1);
    NEAR(totals(CHANNEL_BT4)->longest_us, 400000);
    assert_int_equal(bench.flight.totals.faults, 0);
}

/* A daemon just started doesn't know what the hardware is able to do. */
static void a_new_daemon_has_time_to_find_out(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.daemon_start_us = bench.now_us;
    bench.snapshot.channels[CHANNEL_BT5].required = true;
    pass(2);
    bench.snapshot.channels[CHANNEL_BT5].required = false;
    pass(10);
    look();
    assert_int_equal(bench.flight.totals.faults, 0);
    assert_int_equal(totals(CHANNEL_BT5)->gaps, 0);
}

/* Each was excused for its first seconds, and the record said nothing of the whole flight. */
static void a_daemon_that_restarts_ever_again_excuses_nothing(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.position = bench.snapshot.link = bench.snapshot.identity = false;
    set_sending(CHANNEL_WIFI, false);
    for (int i = 0; i < 10; i++) {
        bench.snapshot.daemon_start_us = bench.now_us;
        pass(4);
    }
    look();
    assert_int_equal(bench.flight.totals.armed_restarts, 10);
    for (enum recorder_fault_kind kind = RECORDER_LINK; kind <= RECORDER_IDENTITY; kind++) {
        NEAR(bench.flight.totals.fault_us[kind], 35 * SECOND);
    }
    NEAR(bench.flight.totals.fault_us[RECORDER_CHANNEL + CHANNEL_WIFI], 35 * SECOND);
    assert_int_equal(bench.flight.totals.fault_us[RECORDER_CHANNEL + CHANNEL_BT4], 0);
}

/* ---- faults ---- */

static void what_never_was_there_is_no_fault_on_the_ground(void **state)
{
    (void)state;
    bench.snapshot.link = bench.snapshot.position = bench.snapshot.armed_known = false;
    set_sending(CHANNEL_BT4, true);
    set_sending(CHANNEL_WIFI, true);
    pass(600);
    look();
    assert_int_equal(bench.flight.totals.faults, 0);
}

static void armed_without_a_position_is_one(void **state)
{
    (void)state;
    bench.snapshot.position = false;
    take_off();
    pass(8);
    bench.snapshot.position = true;
    pass(20);
    look();
    expect_line("\"what\":\"position\",\"text\":\"no position from the autopilot\"}");
    expect_line("\"what\":\"position\",\"seconds\":9.00}");
    NEAR(bench.flight.totals.fault_us[RECORDER_POSITION], 9 * SECOND);
    assert_int_equal(bench.flight.totals.armed_faults, 1);
}

static void a_link_that_was_lost_leaves_it_armed(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.link = bench.snapshot.armed_known = bench.snapshot.armed = false;
    pass(30);
    look();
    assert_int_equal(bench.flight.totals.armed_us, 30 * SECOND);
    NEAR(bench.flight.totals.fault_us[RECORDER_LINK], 29 * SECOND);
}

/* Positions went on, and the record said that nothing was heard. */
static void a_missing_heartbeat_is_not_called_silence(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.link = false;
    bench.snapshot.speaks = true;
    pass(1);
    expect_line("\"what\":\"link\",\"text\":\"no HEARTBEAT from the autopilot\"}");
    bench.snapshot.link = true;
    pass(1);
    bench.snapshot.link = bench.snapshot.speaks = false;
    pass(1);
    expect_line("\"what\":\"link\",\"text\":\"nothing is heard from the autopilot\"}");
    bench.snapshot.link = true;
    pass(1);
    bench.snapshot.link = false;
    bench.snapshot.another_id = true;
    pass(1);
    expect_line("\"what\":\"link\",\"text\":\"another system id speaks than the vehicle's\"}");
}

static void a_channel_that_never_comes_is_a_fault_after_a_while(void **state)
{
    (void)state;
    set_sending(CHANNEL_BT4, true);
    pass(29);
    look();
    assert_int_equal(bench.flight.totals.faults, 0);
    pass(2);
    look();
    assert_int_equal(bench.flight.totals.faults, 1);
    assert_int_equal(bench.flight.totals.armed_faults, 0);
    bench.snapshot.armed = true;
    pass(1);
    look();
    assert_int_equal(bench.flight.totals.armed_faults, 1);
}

static void an_emergency_and_a_simulation_are_recorded(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.emergency = true;
    pass(1);
    expect_line(
        "\"event\":\"fault\",\"what\":\"emergency\",\"text\":\"an emergency is broadcast\"}");
    bench.snapshot.emergency = false;
    bench.snapshot.simulated = true;
    pass(1);
    expect_line("\"event\":\"fault\",\"what\":\"simulated\","
                "\"text\":\"the autopilot flies in a simulation\"}");
}

static void a_failure_that_is_broadcast_is_recorded(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.failure = true;
    pass(1);
    bench.snapshot.failure = false;
    pass(1);
    look();
    expect_line("\"event\":\"fault\",\"what\":\"failure\","
                "\"text\":\"Remote ID failure is broadcast\"}");
    assert_int_equal(bench.flight.totals.fault_us[RECORDER_FAILURE], SECOND);
}

static void supply_faults(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.board.undervoltage = bench.snapshot.board.throttled = true;
    pass(3);
    bench.snapshot.board.undervoltage = bench.snapshot.board.throttled = false;
    pass(3);
    look();
    expect_line("\"event\":\"fault_over\",\"what\":\"undervoltage\",\"seconds\":3.00}");
    expect_line("\"event\":\"fault_over\",\"what\":\"throttled\",\"seconds\":3.00}");
    /* one that was over before anybody looked */
    bench.snapshot.board.was_undervoltage = true;
    pass(1);
    bench.snapshot.board.was_undervoltage = false;
    pass(1);
    look();
    expect_line("\"event\":\"fault_over\",\"what\":\"undervoltage\",\"seconds\":0.00}");
    assert_int_equal(bench.flight.totals.faults, 3);
    assert_int_equal(bench.flight.faults, 0);
}

static void set_board_fault(unsigned i, const char *name, const char *text)
{
    snprintf(bench.snapshot.board.fault[i].name, RECORDER_NAME_SIZE, "%s", name);
    snprintf(bench.snapshot.board.fault[i].text, RECORDER_TEXT_SIZE, "%s", text);
}

static void faults_of_the_appliance(void **state)
{
    (void)state;
    bench.snapshot.board.faults = 2;
    set_board_fault(0, "data", "The disk says \"no\".");
    set_board_fault(1, "wireless", "There is none.");
    take_off();
    look();
    expect_line("\"what\":\"data\",\"text\":\"The disk says \\\"no\\\".\"}");
    assert_int_equal(bench.flight.totals.faults, 2);
    assert_int_equal(bench.flight.totals.armed_faults, 2);
    bench.snapshot.board.faults = 1; /* the first is over, the second moves up */
    set_board_fault(0, "wireless", "There is none.");
    pass(1);
    look();
    expect_line("\"event\":\"fault_over\",\"what\":\"data\",\"seconds\":11.00}");
    assert_int_equal(bench.flight.faults, 1);
    assert_string_equal(bench.flight.fault[0].name, "wireless");
    /* as many as there is place for, others each second, and no place is lost */
    for (int round = 0; round < 50; round++) {
        bench.snapshot.board.faults = RECORDER_BOARD_FAULTS;
        for (unsigned i = 0; i < RECORDER_BOARD_FAULTS; i++) {
            char name[16];

            snprintf(name, sizeof(name), "f%d-%u", round, i);
            set_board_fault(i, name, "it is so");
        }
        pass(1);
    }
    look();
    assert_int_equal(bench.flight.faults, RECORDER_BOARD_FAULTS);
    assert_int_equal(bench.flight.totals.faults, 2 + 50 * RECORDER_BOARD_FAULTS);
}

/* ---- the clock ---- */

static void a_clock_that_becomes_known_in_flight(void **state)
{
    (void)state;
    take_off();
    look();
    assert_int_equal(bench.flight.clock_offset_us, 0);
    for (int i = 0; i < 30; i++) { /* in whole seconds */
        bench.snapshot.unix_us = UTC + i / 2 * 2 * SECOND;
        pass(1);
    }
    look();
    expect_line("\"event\":\"clock\",\"utc\":\"2026-01-02T03:04:05Z\"}");
    NEAR(bench.flight.clock_offset_us, UTC - 15 * SECOND);
    /* a jump is said, and not too often */
    for (int i = 0; i < 120; i++) {
        bench.snapshot.unix_us += i % 2 == 0 ? 3600 * SECOND : -3600 * SECOND;
        pass(1);
    }
    assert_in_range(count_in_text("\"event\":\"clock\""), 2, 4);
}

/* ---- looking ---- */

/* The disk held it up, or its restart: what it didn't see was counted as good. */
static void what_nobody_looked_at_is_said(void **state)
{
    (void)state;
    take_off();
    pass_us(3 * SECOND); /* an answer that was late, and a write */
    assert_int_equal(look()->totals.unwatched_us, 0);
    pass_us(8 * SECOND);
    pass(2);
    pass_us(4 * SECOND);
    bench.snapshot.armed = false;
    pass(1);
    pass_us(60 * SECOND);
    look();
    expect_line("{\"t\":17.00,\"event\":\"unwatched\",\"seconds\":8.00}");
    assert_int_equal(count_in_text("\"unwatched\""), 2);
    assert_int_equal(bench.flight.totals.unwatched_us, 12 * SECOND);
    assert_int_equal(bench.flight.totals.armed_us, 18 * SECOND);
}

/* An autopilot that isn't heard, a daemon that doesn't answer, a recorder that stands still: in
 * that time it may have flown. */
static void that_nobody_said_whether_it_was_armed_is_counted(void **state)
{
    (void)state;
    bench.snapshot.armed_known = false;
    pass(9); /* it starts */
    bench.snapshot.armed_known = true;
    pass(100);
    assert_int_equal(look()->totals.untold_us, 0);
    bench.snapshot.armed_known = false;
    pass(10);
    assert_int_equal(look()->totals.untold_us, 0);
    pass(20);
    assert_int_equal(look()->totals.untold_us, 30 * SECOND);
    bench.snapshot.answered = false;
    bench.snapshot.armed_known = true;
    pass(20);
    bench.snapshot.answered = true;
    pass(9);
    bench.snapshot.answered = false;
    pass(9);
    bench.snapshot.answered = true;
    pass(1);
    assert_int_equal(look()->totals.untold_us, 51 * SECOND);
    pass_us(12 * SECOND);
    assert_int_equal(look()->totals.untold_us, 63 * SECOND);
    bench.snapshot.armed = true;
    pass(1);
    bench.snapshot.armed_known = bench.snapshot.armed = false;
    pass(100); /* it flies on */
    bench.snapshot.armed_known = true;
    pass(9);
    assert_int_equal(look()->totals.untold_us, 63 * SECOND);
    assert_int_equal(bench.flight.totals.untold_later_us, 63 * SECOND);
    assert_int_equal(bench.flight.totals.armed_us, 101 * SECOND);
}

/* ---- going on after a restart of our own ---- */

static void go_on(void)
{
    static struct recorder_flight before;

    recorder_read(&before, bench.text.bytes, bench.text.length, NULL, NULL);
    recorder_continue(&bench.recorder, bench_line, NULL, &before.totals, before.fault,
                      before.faults, bench.now_us);
}

static void a_restart_of_ours_loses_nothing(void **state)
{
    (void)state;
    take_off();
    bench.snapshot.position = false;
    pass(5);
    recorder_say_totals(&bench.recorder);
    pass(3); /* these are lost with the process, ... */
    go_on();
    pass(4);
    look();
    assert_int_equal(bench.flight.totals.began, RECORDER_DISARMED);
    assert_int_equal(bench.flight.totals.untold_us, 0);
    assert_int_equal(bench.flight.totals.armed_us, 12 * SECOND); /* ... and counted all the same */
    assert_int_equal(bench.flight.totals.faults, 1);
    assert_int_equal(totals(CHANNEL_BT4)->gaps, 0);
    assert_int_equal(totals(CHANNEL_BT4)->first_us, 3 * SECOND);
    bench.snapshot.position = true;
    pass(1);
    look();
    expect_line("\"event\":\"fault_over\",\"what\":\"position\",\"seconds\":12.00}");
    expect_line("\"event\":\"recorder_restarted\"}");
    assert_int_equal(count_in_text("first_broadcast"), 2);
    assert_int_equal(count_in_text("\"armed\"}"), 1);
}

static void what_became_of_an_update(void **state)
{
    (void)state;
    recorder_say_update(&bench.recorder, "Version 2 was rolled back: \"why\".", bench.now_us);
    expect_line("\"event\":\"update\",\"text\":\"Version 2 was rolled back: \\\"why\\\".\"}");
}

static void nobody_looks_over_a_restart_of_ours(void **state)
{
    (void)state;
    pass(20);
    recorder_say_totals(&bench.recorder);
    bench.now_us += 30 * SECOND;
    go_on();
    pass(5);
    assert_int_equal(look()->totals.untold_us, 31 * SECOND);
}

static void a_gap_over_a_restart_of_ours_is_whole(void **state)
{
    (void)state;
    take_off();
    pass(1);
    set_sending(CHANNEL_WIFI, false);
    pass(4);
    recorder_say_totals(&bench.recorder);
    bench.now_us += 5 * SECOND; /* nobody looks */
    go_on();
    pass(1);
    look();
    NEAR(bench.flight.open_gap_us[CHANNEL_WIFI], 10 * SECOND + 100000);
    set_sending(CHANNEL_WIFI, true);
    pass(1);
    look();
    NEAR(totals(CHANNEL_WIFI)->silent_us, 10 * SECOND + 100000);
    assert_int_equal(totals(CHANNEL_WIFI)->gaps, 1);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup(name, bench_reset)
    const struct CMUnitTest tests[] = {
        TEST(a_flight_without_a_gap),
        TEST(a_gap_has_its_true_length),
        TEST(what_was_taken_for_sent_is_taken_back),
        TEST(what_was_taken_for_sent_between_two_looks_is_taken_back),
        TEST(a_silence_that_was_wanted_is_not_counted_later),
        TEST(that_a_chip_counted_is_kept),
        TEST(of_two_gaps_the_longest_counts),
        TEST(only_the_armed_part_of_a_gap_counts),
        TEST(a_channel_that_never_came_is_silent_from_arming_on),
        TEST(a_channel_that_is_not_required_has_no_gaps),
        TEST(a_channel_that_is_switched_off_in_flight_is_silent),
        TEST(what_the_hardware_never_could_is_not_missed),
        TEST(a_channel_that_was_on_the_air_and_cannot_any_more_is_missed),
        TEST(a_daemon_that_does_not_answer_is_a_fault),
        TEST(a_daemon_that_was_only_mute_made_no_gap),
        TEST(a_quick_restart_is_seen),
        TEST(a_new_daemon_has_time_to_find_out),
        TEST(a_daemon_that_restarts_ever_again_excuses_nothing),
        TEST(what_never_was_there_is_no_fault_on_the_ground),
        TEST(armed_without_a_position_is_one),
        TEST(a_link_that_was_lost_leaves_it_armed),
        TEST(a_missing_heartbeat_is_not_called_silence),
        TEST(a_channel_that_never_comes_is_a_fault_after_a_while),
        TEST(an_emergency_and_a_simulation_are_recorded),
        TEST(a_failure_that_is_broadcast_is_recorded),
        TEST(supply_faults),
        TEST(faults_of_the_appliance),
        TEST(a_clock_that_becomes_known_in_flight),
        TEST(what_nobody_looked_at_is_said),
        TEST(that_nobody_said_whether_it_was_armed_is_counted),
        TEST(a_restart_of_ours_loses_nothing),
        TEST(what_became_of_an_update),
        TEST(nobody_looks_over_a_restart_of_ours),
        TEST(a_gap_over_a_restart_of_ours_is_whole),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
