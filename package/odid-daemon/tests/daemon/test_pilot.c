/* What the pilot is told, read back with MAVLink's own parser. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <common/mavlink.h>
#include <string.h>

#include "daemon/pilot.h"

#define SECOND INT64_C(1000000)
#define VEHICLE 7

static struct pilot pilot;
static struct radio radio;
static mavlink_message_t sent[8];
static unsigned sent_count;

static void take(void *context, const uint8_t *frame, size_t length)
{
    mavlink_status_t status;
    unsigned whole = 0;

    assert_ptr_equal(context, &pilot);
    for (size_t i = 0; i < length; i++) {
        whole += mavlink_parse_char(MAVLINK_COMM_1, frame[i], &sent[sent_count], &status);
    }
    assert_int_equal(whole, 1); /* one frame a call, with a right CRC */
    assert_int_equal(frame[0], MAVLINK_STX);
    assert_int_equal(sent[sent_count].sysid, VEHICLE);
    assert_int_equal(sent[sent_count].compid, 236);
    sent_count++;
}

static int setup(void **state)
{
    (void)state;
    pilot_init(&pilot, take, &pilot);
    memset(&radio, 0, sizeof(radio));
    sent_count = 0;
    return 0;
}

static void a_heartbeat_says_that_we_are_a_healthy_remote_id_transmitter(void **state)
{
    mavlink_heartbeat_t heartbeat;

    (void)state;
    pilot_tell(&pilot, VEHICLE, "", false);
    assert_int_equal(sent_count, 2);
    assert_int_equal(sent[0].msgid, MAVLINK_MSG_ID_HEARTBEAT);
    mavlink_msg_heartbeat_decode(&sent[0], &heartbeat);
    assert_int_equal(heartbeat.type, 34);
    assert_int_equal(heartbeat.autopilot, 8); /* none */
    assert_int_equal(heartbeat.base_mode, 0);
    assert_true(heartbeat.system_status == MAV_STATE_STANDBY ||
                heartbeat.system_status == MAV_STATE_ACTIVE);
    assert_int_equal(heartbeat.mavlink_version, 3);
}

/* PX4 looks at nothing else, and arms with one that is active. */
static void with_a_reason_we_are_not_ready_until_it_is_armed(void **state)
{
    mavlink_heartbeat_t heartbeat;

    (void)state;
    pilot_tell(&pilot, VEHICLE, "missing basic_id message", false);
    mavlink_msg_heartbeat_decode(&sent[0], &heartbeat);
    assert_int_equal(heartbeat.system_status, MAV_STATE_CRITICAL);
    pilot_tell(&pilot, VEHICLE, "missing basic_id message", true);
    mavlink_msg_heartbeat_decode(&sent[2], &heartbeat);
    assert_int_equal(heartbeat.system_status, MAV_STATE_ACTIVE);
}

static void no_reason_is_good_to_arm(void **state)
{
    static const char empty[50];
    mavlink_open_drone_id_arm_status_t arm;

    (void)state;
    pilot_tell(&pilot, VEHICLE, "", false);
    assert_int_equal(sent[1].msgid, 12918);
    mavlink_msg_open_drone_id_arm_status_decode(&sent[1], &arm);
    assert_int_equal(arm.status, 0);
    assert_memory_equal(arm.error, empty, 50);
}

static void a_reason_is_told_word_for_word(void **state)
{
    mavlink_open_drone_id_arm_status_t arm;

    (void)state;
    pilot_tell(&pilot, VEHICLE, "missing basic_id message", false);
    mavlink_msg_open_drone_id_arm_status_decode(&sent[1], &arm);
    assert_int_equal(arm.status, 1);
    assert_string_equal(arm.error, "missing basic_id message");
}

static void a_long_reason_is_cut_and_terminated(void **state)
{
    static const char reason[] = "0123456789012345678901234567890123456789012345678901234567890";
    mavlink_open_drone_id_arm_status_t arm;

    (void)state;
    pilot_tell(&pilot, VEHICLE, reason, false);
    mavlink_msg_open_drone_id_arm_status_decode(&sent[1], &arm);
    assert_int_equal(arm.status, 1);
    assert_memory_equal(arm.error, reason, PILOT_REASON_MAX);
    assert_int_equal(arm.error[49], 0);
}

static void frames_are_numbered(void **state)
{
    (void)state;
    pilot_tell(&pilot, VEHICLE, "", false);
    pilot_tell(&pilot, VEHICLE, "", false);
    for (unsigned i = 1; i < sent_count; i++) {
        assert_int_equal(sent[i].seq, (uint8_t)(sent[i - 1].seq + 1));
    }
}

/* ---- channels ---- */

/* The radio is in this state since an instant; told at another. Returns the texts sent. */
static unsigned channel_at(enum radio_state state, int64_t since_us, int64_t now_us)
{
    unsigned before = sent_count;

    radio.state = state;
    radio.since_us = since_us;
    radio.confirmed_us = now_us;
    pilot_channel(&pilot, VEHICLE, CHANNEL_BT4, &radio, now_us);
    return sent_count - before;
}

static mavlink_statustext_t text(void)
{
    mavlink_statustext_t status;

    assert_int_equal(sent[sent_count - 1].msgid, MAVLINK_MSG_ID_STATUSTEXT);
    mavlink_msg_statustext_decode(&sent[sent_count - 1], &status);
    return status;
}

static void a_lost_channel_is_told_and_its_return_once(void **state)
{
    mavlink_statustext_t status;

    (void)state;
    assert_int_equal(channel_at(RADIO_ON_AIR, 0, 10 * SECOND), 0);
    assert_int_equal(channel_at(RADIO_LOST, 10 * SECOND, 11 * SECOND - 1), 0);
    assert_int_equal(channel_at(RADIO_LOST, 10 * SECOND, 11 * SECOND), 1);
    status = text();
    assert_int_equal(status.severity, MAV_SEVERITY_WARNING);
    assert_non_null(memmem(status.text, sizeof(status.text), "Remote ID: ", 11));
    assert_non_null(memmem(status.text, sizeof(status.text), channel_title(CHANNEL_BT4),
                           strlen(channel_title(CHANNEL_BT4))));
    for (int64_t now = 12; now < 41; now++) {
        assert_int_equal(channel_at(RADIO_LOST, 10 * SECOND, now * SECOND), 0);
    }
    assert_int_equal(channel_at(RADIO_ON_AIR, 100 * SECOND, 100 * SECOND), 1);
    status = text();
    assert_int_equal(status.severity, MAV_SEVERITY_NOTICE);
    assert_int_equal(channel_at(RADIO_ON_AIR, 100 * SECOND, 101 * SECOND), 0);
    assert_int_equal(channel_at(RADIO_ABSENT, 102 * SECOND, 103 * SECOND), 1);
}

/* The first text may have been lost on the way. */
static void what_lasts_is_told_again_every_30_seconds(void **state)
{
    unsigned channel = 0, sources = 0;

    (void)state;
    channel_at(RADIO_ON_AIR, 0, 1 * SECOND);
    for (int64_t now = 2; now < 92; now++) {
        sent_count = 0;
        channel += channel_at(RADIO_LOST, 1 * SECOND, now * SECOND);
        pilot_sources(&pilot, VEHICLE, true, now * SECOND);
        sources += sent_count;
    }
    assert_int_equal(channel, 3);
    assert_int_equal(sources, channel + 3);
}

/* hostapd that ends again and again: each way of being off the air began anew within the second. */
static void one_that_goes_to_and_fro_is_told_like_one_that_is_gone(void **state)
{
    unsigned told = 0;

    (void)state;
    channel_at(RADIO_ON_AIR, 0, 1 * SECOND);
    for (int64_t now = 2; now < 92; now++) {
        sent_count = 0;
        told += channel_at(now % 2 == 0 ? RADIO_LOST : RADIO_ABSENT, now * SECOND - SECOND / 2,
                           now * SECOND);
    }
    assert_int_equal(told, 3);
}

static void a_repair_within_a_second_is_not_told(void **state)
{
    (void)state;
    channel_at(RADIO_ON_AIR, 0, 1 * SECOND);
    assert_int_equal(channel_at(RADIO_LOST, 2 * SECOND, 2 * SECOND + 900000), 0);
    assert_int_equal(channel_at(RADIO_ON_AIR, 3 * SECOND, 3 * SECOND), 0);
}

static void a_channel_that_never_was_on_air_is_not_lost(void **state)
{
    (void)state;
    for (enum radio_state state_now = RADIO_DISABLED; state_now <= RADIO_LOST; state_now++) {
        if (state_now != RADIO_ON_AIR) {
            assert_int_equal(channel_at(state_now, 0, 100 * SECOND), 0);
        }
    }
}

/* By the daemon before this one, in the same flight. */
static void one_that_does_not_come_back_after_a_restart_is_lost(void **state)
{
    (void)state;
    pilot_restore(&pilot, CHANNEL_BT4, true, false);
    assert_int_equal(channel_at(RADIO_STARTING, 10 * SECOND, 11 * SECOND - 1), 0);
    assert_int_equal(channel_at(RADIO_STARTING, 10 * SECOND, 11 * SECOND), 1);
    assert_int_equal(text().severity, MAV_SEVERITY_WARNING);
    assert_int_equal(channel_at(RADIO_STARTING, 10 * SECOND, 12 * SECOND), 0);
}

static void what_was_lost_before_a_restart_is_told_and_its_return_is(void **state)
{
    (void)state;
    pilot_restore(&pilot, CHANNEL_BT4, true, true);
    assert_int_equal(channel_at(RADIO_ABSENT, 10 * SECOND, 20 * SECOND), 1);
    assert_int_equal(channel_at(RADIO_ON_AIR, 21 * SECOND, 21 * SECOND), 1);
    assert_int_equal(text().severity, MAV_SEVERITY_NOTICE);
    assert_int_equal(channel_at(RADIO_LOST, 22 * SECOND, 23 * SECOND), 1);
}

static void each_channel_is_told_for_itself(void **state)
{
    (void)state;
    radio.state = RADIO_ON_AIR;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        pilot_channel(&pilot, VEHICLE, channel, &radio, 1 * SECOND);
    }
    radio.state = RADIO_BLOCKED;
    radio.since_us = 2 * SECOND;
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        mavlink_statustext_t status;

        pilot_channel(&pilot, VEHICLE, channel, &radio, 5 * SECOND);
        assert_int_equal(sent_count, channel + 1);
        status = text();
        assert_non_null(memmem(status.text, sizeof(status.text), channel_title(channel),
                               strlen(channel_title(channel))));
    }
}

static void two_sources_are_told_and_their_end_once(void **state)
{
    (void)state;
    pilot_sources(&pilot, VEHICLE, false, 1 * SECOND);
    assert_int_equal(sent_count, 0);
    for (unsigned i = 0; i < 3; i++) {
        pilot_sources(&pilot, VEHICLE, true, (2 + i) * SECOND);
    }
    assert_int_equal(sent_count, 1);
    assert_int_equal(text().severity, MAV_SEVERITY_CRITICAL);
    pilot_sources(&pilot, VEHICLE, false, 5 * SECOND);
    pilot_sources(&pilot, VEHICLE, false, 6 * SECOND);
    assert_int_equal(sent_count, 2);
    assert_int_equal(text().severity, MAV_SEVERITY_NOTICE);
}

/* ---- the request for faster positions ---- */

static void a_rate_is_asked_of_the_autopilot(void **state)
{
    mavlink_command_long_t command;

    (void)state;
    pilot_ask_rate(&pilot, VEHICLE, 12901, 250000);
    assert_int_equal(sent_count, 1);
    assert_int_equal(sent[0].msgid, MAVLINK_MSG_ID_COMMAND_LONG);
    mavlink_msg_command_long_decode(&sent[0], &command);
    assert_int_equal(command.command, 511); /* MAV_CMD_SET_MESSAGE_INTERVAL */
    assert_int_equal(command.target_system, VEHICLE);
    assert_int_equal(command.target_component, 1);
    assert_true(command.param1 == 12901);
    assert_true(command.param2 == 250000);
    assert_true(command.param3 == 0 && command.param7 == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_heartbeat_says_that_we_are_a_healthy_remote_id_transmitter, setup),
        cmocka_unit_test_setup(with_a_reason_we_are_not_ready_until_it_is_armed, setup),
        cmocka_unit_test_setup(no_reason_is_good_to_arm, setup),
        cmocka_unit_test_setup(a_reason_is_told_word_for_word, setup),
        cmocka_unit_test_setup(a_long_reason_is_cut_and_terminated, setup),
        cmocka_unit_test_setup(frames_are_numbered, setup),
        cmocka_unit_test_setup(a_lost_channel_is_told_and_its_return_once, setup),
        cmocka_unit_test_setup(what_lasts_is_told_again_every_30_seconds, setup),
        cmocka_unit_test_setup(one_that_goes_to_and_fro_is_told_like_one_that_is_gone, setup),
        cmocka_unit_test_setup(a_repair_within_a_second_is_not_told, setup),
        cmocka_unit_test_setup(a_channel_that_never_was_on_air_is_not_lost, setup),
        cmocka_unit_test_setup(one_that_does_not_come_back_after_a_restart_is_lost, setup),
        cmocka_unit_test_setup(what_was_lost_before_a_restart_is_told_and_its_return_is, setup),
        cmocka_unit_test_setup(each_channel_is_told_for_itself, setup),
        cmocka_unit_test_setup(two_sources_are_told_and_their_end_once, setup),
        cmocka_unit_test_setup(a_rate_is_asked_of_the_autopilot, setup),
    };

    return cmocka_run_group_tests_name("pilot", tests, NULL, NULL);
}
