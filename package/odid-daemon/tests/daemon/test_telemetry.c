/* Which MAVLink frames concern this aircraft: framing, vehicle, senders, targets. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "telemetry_recorder.h"

static int setup(void **state)
{
    (void)state;
    begin_with_vehicle();
    return 0;
}

/* ---- framing ---- */

static void both_versions_of_the_protocol_are_understood(void **state)
{
    (void)state;
    for (unsigned version = 1; version <= 2; version++) {
        frames_are(version, false);
        assert_int_equal(some_position(VEHICLE, AUTOPILOT).bytes[0],
                         version == 1 ? MAVLINK_STX_MAVLINK1 : MAVLINK_STX);
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
        assert_int_equal(latest()->kind, TELEMETRY_GLOBAL_POSITION);
    }
}

static void the_two_versions_may_follow_each_other_in_one_stream(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 20; i++) {
        frames_are(1 + i % 2, false);
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    }
}

static void a_signed_frame_counts_without_a_key(void **state)
{
    (void)state;
    frames_are(2, true);
    assert_int_equal(some_position(VEHICLE, AUTOPILOT).bytes[2], MAVLINK_IFLAG_SIGNED);
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    frames_are(2, false);
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
}

/* Zeros at the end of a MAVLink 2 payload aren't sent. */
static void a_truncated_payload_reads_as_zeros(void **state)
{
    const mavlink_global_position_int_t full = {
        .lat = 577089001, .lon = 2, .alt = 3, .vx = 77, .hdg = 9};
    const mavlink_global_position_int_t position = {.time_boot_ms = 5, .lat = 577089000};
    struct frame frame = frame_global_position_int(VEHICLE, AUTOPILOT, &position);

    (void)state;
    assert_true(frame.length < 12 + MAVLINK_MSG_ID_GLOBAL_POSITION_INT_LEN);
    feed(frame_global_position_int(VEHICLE, AUTOPILOT, &full));
    now_us += 10 * SECOND;
    assert_int_equal(feed(frame), 1);
    assert_true(latest()->global_position.latitude_deg > 57.7);
    assert_true(latest()->global_position.longitude_deg == 0);
    assert_true(latest()->global_position.altitude_msl_m == 0);
    assert_true(latest()->global_position.north_mps == 0);
}

static void frames_may_come_in_any_portions(void **state)
{
    uint8_t bytes[4096];
    size_t length = 0;

    (void)state;
    for (unsigned i = 0; i < 40; i++) {
        struct frame frame;

        frames_are(1 + i % 2, false);
        frame = some_position(VEHICLE, AUTOPILOT);
        memcpy(bytes + length, frame.bytes, frame.length);
        length += frame.length;
    }
    for (size_t portion = 1; portion < length; portion += portion < 64 ? 1 : 61) {
        update_count = 0;
        for (size_t i = 0; i < length; i += portion) {
            size_t left = length - i;

            telemetry_receive(telemetry, 3, bytes + i, left < portion ? left : portion, now_us);
        }
        assert_int_equal(update_count, 40);
    }
}

static void streams_do_not_mix(void **state)
{
    struct frame frames[TELEMETRY_STREAMS];

    (void)state;
    for (unsigned i = 0; i < TELEMETRY_STREAMS; i++) {
        frames_are(1 + i % 2, i % 4 == 1);
        frames[i] = some_position(VEHICLE, AUTOPILOT);
    }
    for (size_t byte = 0; byte < MAVLINK_MAX_PACKET_LEN; byte++) {
        for (unsigned i = 0; i < TELEMETRY_STREAMS; i++) {
            if (byte < frames[i].length) {
                telemetry_receive(telemetry, i, frames[i].bytes + byte, 1, now_us);
            }
        }
    }
    assert_int_equal(update_count, TELEMETRY_STREAMS);
}

static void garbage_between_frames_is_skipped(void **state)
{
    uint8_t garbage[256];
    unsigned seed = 12345;

    (void)state;
    for (unsigned round = 0; round < 200; round++) {
        for (size_t i = 0; i < sizeof(garbage); i++) {
            seed = seed * 1103515245U + 12345U;
            garbage[i] = (uint8_t)(seed >> 16);
            if (garbage[i] == MAVLINK_STX || garbage[i] == MAVLINK_STX_MAVLINK1) {
                garbage[i] = 0;
            }
        }
        telemetry_receive(telemetry, 0, garbage, sizeof(garbage), now_us);
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    }
    assert_int_equal(telemetry_counters(telemetry)->framing.bad_crc, 0);
}

/*
 * A byte in garbage, or in a frame whose beginning was missed, that looks like
 * a start byte takes no good frame with it: what it seemed to begin is read
 * again. (Where the garbage happens to end as a frame does, it may.)
 */
static void a_false_start_costs_no_frames(void **state)
{
    unsigned seed = 99, fed = 0;
    mavlink_global_position_int_t position = {.lat = 577089000, .lon = -119746000, .vx = -400};

    (void)state;
    for (unsigned round = 0; round < 300; round++) {
        for (unsigned i = 0; i < 300; i++) {
            uint8_t byte;

            seed = seed * 1103515245U + 12345U;
            byte = (uint8_t)(seed >> 16);
            telemetry_receive(telemetry, 0, &byte, 1, now_us);
        }
        for (unsigned i = 0; i < 20; i++) {
            position.time_boot_ms += 200;
            now_us += 200000;
            feed(frame_global_position_int(VEHICLE, AUTOPILOT, &position));
            fed++;
        }
    }
    assert_in_range(update_count, fed - fed / 100, fed);
}

static void half_a_frame_at_the_beginning_costs_the_longest_frame_at_most(void **state)
{
    (void)state;
    for (size_t missed = 1; missed < some_position(VEHICLE, AUTOPILOT).length; missed++) {
        struct frame frame = some_position(VEHICLE, AUTOPILOT);
        size_t wasted = 0;

        telemetry_reset_stream(telemetry, 0);
        telemetry_receive(telemetry, 0, frame.bytes + missed, frame.length - missed, now_us);
        while (feed(frame) == 0) {
            wasted += frame.length;
        }
        assert_in_range(wasted, 0, MAVLINK_MAX_PACKET_LEN); /* what it looked like */
    }
}

static void a_damaged_frame_is_counted_and_the_next_one_read(void **state)
{
    struct frame frame = some_position(VEHICLE, AUTOPILOT);

    (void)state;
    for (size_t i = 10; i < frame.length; i++) { /* behind the header: the framing holds */
        struct frame damaged = frame;

        damaged.bytes[i] ^= 0x10;
        assert_int_equal(feed(damaged), 0);
        assert_int_equal(telemetry_counters(telemetry)->framing.bad_crc, i - 9);
        assert_int_equal(feed(frame), 1);
    }
}

/* The bytes that a shortened frame swallowed are given back. */
static void a_frame_that_lost_a_byte_does_not_take_the_next_with_it(void **state)
{
    struct frame frame;

    (void)state;
    for (unsigned version = 1; version <= 2; version++) {
        for (unsigned lost = 1; lost < 8; lost++) {
            begin_with_vehicle();
            frames_are(version, false);
            frame = some_position(VEHICLE, AUTOPILOT);
            telemetry_receive(telemetry, 0, frame.bytes, 20, now_us);
            telemetry_receive(telemetry, 0, frame.bytes + 20 + lost, frame.length - 20 - lost,
                              now_us);
            for (unsigned i = 0; i < 10; i++) {
                feed(frame);
            }
            assert_int_equal(update_count, 10);
        }
    }
}

static void a_reset_stream_forgets_its_half_frame(void **state)
{
    struct frame frame = some_position(VEHICLE, AUTOPILOT);

    (void)state;
    telemetry_receive(telemetry, 0, frame.bytes, 20, now_us);
    telemetry_reset_stream(telemetry, 0);
    assert_int_equal(feed(frame), 1);
}

static void an_unknown_id_is_counted_as_such(void **state)
{
    /* 60000 is in no definitions. */
    static const uint8_t unknown[] = {0xFD, 2, 0, 0, 0, VEHICLE, 1, 0x60, 0xEA, 0, 1, 2, 3, 4};

    (void)state;
    telemetry_receive(telemetry, 0, unknown, sizeof(unknown), now_us);
    assert_int_equal(telemetry_counters(telemetry)->framing.unknown_id, 1);
    assert_int_equal(telemetry_counters(telemetry)->framing.bad_crc, 0);
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
}

static void a_known_message_of_no_use_is_counted_as_not_needed(void **state)
{
    const mavlink_attitude_t attitude = {.yaw = 1};
    const mavlink_open_drone_id_arm_status_t arm = {.status = 1};
    uint64_t before = telemetry_counters(telemetry)->not_needed;

    (void)state;
    assert_int_equal(feed(frame_attitude(VEHICLE, AUTOPILOT, &attitude)), 0);
    assert_int_equal(feed(frame_open_drone_id_arm_status(VEHICLE, AUTOPILOT, &arm)), 0);
    assert_int_equal(telemetry_counters(telemetry)->not_needed, before + 2);
}

static void used_frames_are_counted(void **state)
{
    uint64_t before = telemetry_counters(telemetry)->frames;

    (void)state;
    feed(some_position(VEHICLE, AUTOPILOT));
    feed(autopilot_heartbeat(VEHICLE));
    feed(some_position(OTHER_VEHICLE, AUTOPILOT));
    assert_int_equal(telemetry_counters(telemetry)->frames, before + 2);
    assert_int_equal(telemetry_counters(telemetry)->other_system, 1);
}

/* ---- which vehicle ---- */

static void no_vehicle_is_known_before_a_heartbeat(void **state)
{
    (void)state;
    begin();
    assert_int_equal(telemetry_vehicle(telemetry), 0);
    assert_int_equal(telemetry_vehicle_stream(telemetry), -1);
    assert_true(telemetry_heartbeat_us(telemetry) == INT64_MIN);
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 0);
    assert_int_equal(telemetry_vehicle_stream(telemetry), -1);
}

/* System id 0 is a broadcast address, never a sender, and not "the vehicle" while none is known. */
static void a_frame_from_system_0_is_nobodys(void **state)
{
    (void)state;
    begin();
    assert_int_equal(feed(autopilot_heartbeat(0)), 0);
    assert_int_equal(feed(some_position(0, AUTOPILOT)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), 0);
    assert_int_equal(telemetry_vehicle_stream(telemetry), -1);
}

static void the_first_autopilot_is_the_vehicle(void **state)
{
    (void)state;
    begin();
    assert_int_equal(feed_to(2, autopilot_heartbeat(VEHICLE)), 1);
    assert_int_equal(latest()->kind, TELEMETRY_HEARTBEAT);
    assert_int_equal(latest()->heartbeat.mav_type, MAV_TYPE_QUADROTOR);
    assert_int_equal(latest()->heartbeat.autopilot, MAV_AUTOPILOT_ARDUPILOTMEGA);
    assert_int_equal(latest()->heartbeat.base_mode, MAV_MODE_FLAG_SAFETY_ARMED);
    assert_int_equal(latest()->heartbeat.system_status, MAV_STATE_ACTIVE);
    assert_false(latest()->heartbeat.new_vehicle);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
    assert_int_equal(telemetry_vehicle_stream(telemetry), 2);
    assert_true(telemetry_heartbeat_us(telemetry) == now_us);
}

static void every_system_id_from_1_to_255_can_be_the_vehicle(void **state)
{
    (void)state;
    for (unsigned system = 1; system <= 255; system++) {
        begin();
        assert_int_equal(feed(autopilot_heartbeat((uint8_t)system)), 1);
        assert_int_equal(telemetry_vehicle(telemetry), system);
        assert_int_equal(feed(some_position((uint8_t)system, AUTOPILOT)), 1);
    }
}

static void only_an_autopilot_makes_a_vehicle(void **state)
{
    mavlink_heartbeat_t heartbeat = {.type = MAV_TYPE_QUADROTOR, .autopilot = MAV_AUTOPILOT_PX4};

    (void)state;
    begin();
    assert_int_equal(feed(frame_heartbeat(VEHICLE, 2, &heartbeat)), 0);
    assert_int_equal(feed(frame_heartbeat(VEHICLE, 0, &heartbeat)), 0);
    heartbeat.autopilot = MAV_AUTOPILOT_INVALID;
    assert_int_equal(feed(frame_heartbeat(VEHICLE, AUTOPILOT, &heartbeat)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), 0);
}

/* An antenna tracker runs an autopilot's firmware as component 1: it is no vehicle all the same. */
static void a_component_type_makes_no_vehicle(void **state)
{
    static const uint8_t components[] = {5,  6,  18, 26, 27, 30, 31, 32, 33, 34,
                                         36, 37, 38, 39, 40, 41, 42, 44, 48, 49};

    (void)state;
    begin();
    for (size_t i = 0; i < sizeof(components); i++) {
        const mavlink_heartbeat_t heartbeat = {.type = components[i],
                                               .autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA};

        assert_int_equal(feed(frame_heartbeat(VEHICLE, AUTOPILOT, &heartbeat)), 0);
        assert_int_equal(telemetry_vehicle(telemetry), 0);
    }
}

/* By a parameter: its HEARTBEATs were gone for good. */
static void whatever_the_vehicle_calls_itself_its_heartbeat_counts(void **state)
{
    static const uint8_t types[] = {MAV_TYPE_GCS, MAV_TYPE_ANTENNA_TRACKER};

    (void)state;
    for (unsigned expected = 0; expected < 2; expected++) {
        begin();
        if (expected) {
            telemetry_expect(telemetry, VEHICLE, false, now_us);
        } else {
            assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
        }
        for (size_t i = 0; i < sizeof(types); i++) {
            const mavlink_heartbeat_t heartbeat = {.type = types[i],
                                                   .autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA};

            assert_int_equal(feed(frame_heartbeat(VEHICLE, AUTOPILOT, &heartbeat)), 1);
            assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
            assert_true(telemetry_heartbeat_us(telemetry) == now_us);
        }
    }
}

/* Another one had been heard first: it stayed the vehicle, and the vehicle a ground station. */
static void the_one_that_is_expected_returns_whatever_it_calls_itself(void **state)
{
    const mavlink_heartbeat_t heartbeat = {.type = MAV_TYPE_GCS,
                                           .autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA};

    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, false, now_us);
    now_us += 4000000;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 1);
    assert_int_equal(telemetry_vehicle(telemetry), OTHER_VEHICLE);
    assert_int_equal(feed(frame_heartbeat(VEHICLE, AUTOPILOT, &heartbeat)), 1);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

/* It counted as one that isn't there. */
static void the_vehicle_under_another_component_is_there_and_says_nothing(void **state)
{
    const mavlink_heartbeat_t heartbeat = {.type = MAV_TYPE_QUADROTOR,
                                           .autopilot = MAV_AUTOPILOT_PX4};

    (void)state;
    for (unsigned system = VEHICLE; system <= VEHICLE + 1; system++) {
        begin();
        telemetry_expect(telemetry, VEHICLE, false, now_us);
        for (unsigned second = 0; second < 5; second++) {
            assert_int_equal(feed(frame_heartbeat((uint8_t)system, 2, &heartbeat)), 0);
            now_us += 1000000;
        }
        assert_true(telemetry_heartbeat_us(telemetry) == INT64_MIN);
        assert_true(telemetry_heartbeat_missing(telemetry, now_us) == (system == VEHICLE));
    }
}

static void the_vehicles_other_components_say_nothing_of_its_state(void **state)
{
    const mavlink_heartbeat_t gimbal = {.type = MAV_TYPE_GIMBAL,
                                        .autopilot = MAV_AUTOPILOT_INVALID};

    (void)state;
    assert_int_equal(feed(frame_heartbeat(VEHICLE, MAV_COMP_ID_GIMBAL, &gimbal)), 0);
    assert_int_equal(feed(some_position(VEHICLE, MAV_COMP_ID_GIMBAL)), 0);
    assert_int_equal(feed(some_position(OTHER_VEHICLE, AUTOPILOT)), 0);
}

static void the_vehicle_of_before_a_restart_counts_before_its_heartbeat(void **state)
{
    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, false, now_us);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
    assert_true(telemetry_heartbeat_us(telemetry) == INT64_MIN);
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    frames_are_another_senders();
    assert_int_equal(feed(some_position(VEHICLE + 1, AUTOPILOT)), 0);
    now_us += 2900000;
    assert_int_equal(feed(disarmed_heartbeat(VEHICLE + 1)), 0);
    now_us += 200000; /* it is not there any more */
    assert_int_equal(feed(disarmed_heartbeat(VEHICLE + 1)), 1);
    assert_true(latest()->heartbeat.new_vehicle);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE + 1);
}

static void speaks_for(uint8_t system, bool armed, unsigned seconds)
{
    for (; seconds > 0; seconds--) {
        now_us += SECOND;
        assert_int_equal(feed(armed ? autopilot_heartbeat(system) : disarmed_heartbeat(system)), 1);
    }
}

/* Whoever was heard first after power-on, and said armed, was the vehicle until power-off. */
static void who_is_heard_first_gives_way_to_the_vehicle_of_the_last_power_on(void **state)
{
    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, false, now_us);
    assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
    now_us += 3 * SECOND;
    assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)),
                     1); /* an autopilot that was exchanged */
    speaks_for(OTHER_VEHICLE, true, 60);
    for (unsigned i = 0; i < 4; i++) { /* one voice may be a stray one */
        assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 0);
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 0);
        speaks_for(OTHER_VEHICLE, true, 1);
    }
    assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 1);
    assert_true(latest()->heartbeat.new_vehicle);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

/* A neighbour that has the system id which this aircraft had before: with its word the flying
 * aircraft was replaced, and disarmed. */
static void who_took_off_here_gives_way_to_nobody_who_was_only_expected(void **state)
{
    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, false, now_us);
    now_us += 2 * SECOND;
    speaks_for(OTHER_VEHICLE, false, 60);
    speaks_for(OTHER_VEHICLE, true, 1);
    now_us += SECOND;
    assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 0);
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), OTHER_VEHICLE);
    now_us += 60 * SECOND;
    assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 0);
}

/* One such word, before the autopilot's first one counted, took its place away until power-off. */
static void a_station_of_the_same_system_takes_no_place_away(void **state)
{
    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, false, now_us);
    feed(ground_station_heartbeat(OTHER_VEHICLE));
    now_us += 3 * SECOND;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 1);
    assert_int_equal(feed(some_position(OTHER_VEHICLE, AUTOPILOT)), 1);
}

static void another_vehicle_waits_for_10_s_of_silence(void **state)
{
    (void)state;
    feed(disarmed_heartbeat(VEHICLE));
    now_us += 10 * SECOND - 1;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
    now_us += 1;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 1);
    assert_true(latest()->heartbeat.new_vehicle);
    assert_int_equal(telemetry_vehicle(telemetry), OTHER_VEHICLE);
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 1);
    assert_false(latest()->heartbeat.new_vehicle);
}

/* Its HEARTBEATs are lost, or were switched off by somebody on the ground. */
static void nobody_takes_the_place_of_one_that_speaks(void **state)
{
    (void)state;
    feed(disarmed_heartbeat(VEHICLE));
    for (unsigned i = 0; i < 60; i++) {
        now_us += SECOND;
        assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 0);
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    }
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

/* The same of one that has started before us, and is expected. */
static void nor_of_one_that_is_expected_and_speaks(void **state)
{
    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, false, now_us);
    for (unsigned i = 0; i < 60; i++) {
        now_us += SECOND;
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
    }
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

/* Two HEARTBEATs at power-on, and then never again. */
static void a_stray_voice_holds_nobody_off(void **state)
{
    (void)state;
    begin();
    feed(autopilot_heartbeat(OTHER_VEHICLE));
    now_us += SECOND;
    feed(autopilot_heartbeat(OTHER_VEHICLE));
    now_us += SECOND;
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 0); /* it may still go on */
    assert_false(telemetry_vehicle_settled(telemetry));      /* and is kept by nobody */
    now_us += SECOND;
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
    for (unsigned i = 0; i < 3; i++) {
        assert_false(telemetry_vehicle_settled(telemetry));
        now_us += SECOND;
        assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
    }
    assert_true(telemetry_vehicle_settled(telemetry));
    /* Nor has it a right of return. */
    now_us += 20 * SECOND;
    assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
}

static void in_flight_no_other_vehicle_takes_its_place(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 3600; i++) {
        now_us += SECOND;
        assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 0);
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
        assert_int_equal(feed(some_position(OTHER_VEHICLE, AUTOPILOT)), 0);
    }
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
}

/* Whoever could give it one could give it back to himself: only the one of before counts in the
 * air, and it is said. */
static void an_autopilot_with_another_id_is_not_heard_until_it_has_its_own_again(void **state)
{
    (void)state;
    feed(disarmed_heartbeat(VEHICLE));
    now_us += SECOND;
    feed(autopilot_heartbeat(VEHICLE));
    for (unsigned i = 1; i <= 60; i++) {
        now_us += SECOND;
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
        assert_int_equal(feed(some_position(OTHER_VEHICLE, AUTOPILOT)), 0);
        assert_true(telemetry_another_id_speaks(telemetry, now_us) == (i >= 3));
    }
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
    assert_false(latest()->heartbeat.new_vehicle);
    assert_false(telemetry_another_id_speaks(telemetry, now_us));
    assert_false(telemetry_contradicted(telemetry, now_us));
}

static void one_that_flies_takes_no_place_at_all(void **state)
{
    (void)state;
    feed(disarmed_heartbeat(VEHICLE));
    now_us += 60 * SECOND;
    assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

/* The first one was silent, and another one takes its place and takes off. */
static void another_one_takes_off(void)
{
    feed(disarmed_heartbeat(VEHICLE));
    now_us += 11 * SECOND;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 1);
    speaks_for(OTHER_VEHICLE, false, 3);
    speaks_for(OTHER_VEHICLE, true, 1);
}

/* Both of them speak, for 3 s; the second one of them first. */
static void both_speak(void)
{
    for (unsigned i = 0; i < 3; i++) {
        now_us += SECOND;
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 1);
        assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 0); /* one voice may be a stray one */
        assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 0);
    }
    now_us += SECOND;
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 0);
}

/* Whatever the other one says meanwhile. */
static void the_first_vehicle_has_its_place_back_when_it_returns(void **state)
{
    (void)state;
    another_one_takes_off();
    both_speak();
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
    assert_true(latest()->heartbeat.new_vehicle);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
    assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
    assert_int_equal(feed(some_position(OTHER_VEHICLE, AUTOPILOT)), 0);
    assert_int_equal(feed(some_position(VEHICLE, AUTOPILOT)), 1);
}

static void and_at_once_when_the_other_one_is_silent(void **state)
{
    (void)state;
    another_one_takes_off();
    now_us += 3 * SECOND + 1;
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

/* A stray voice of the ground, which the vehicle took for the first one, is heard again in flight:
 * one HEARTBEAT held the vehicle off for the rest of it. */
static void one_heartbeat_takes_nothing_from_who_took_off_here(void **state)
{
    (void)state;
    another_one_takes_off();
    for (unsigned i = 0; i < 120; i++) {
        now_us += SECOND;
        assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 0);
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 1);
    }
    assert_int_equal(telemetry_vehicle(telemetry), OTHER_VEHICLE);
}

/* That one has the whole of it, and falls silent again. */
static void who_took_off_here_has_its_place_back_from_who_is_silent(void **state)
{
    (void)state;
    another_one_takes_off();
    for (unsigned i = 0; i < 3; i++) {
        both_speak();
        assert_int_equal(feed(disarmed_heartbeat(VEHICLE)), 1);
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 0);
        now_us += 3 * SECOND + 1;
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 1);
        assert_true(latest()->heartbeat.new_vehicle);
    }
}

/* Its system id was changed on the ground; 1 is what many have. */
static void in_flight_nobody_returns_whose_place_was_given_up(void **state)
{
    (void)state;
    feed(disarmed_heartbeat(VEHICLE));
    now_us += 11 * SECOND;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 1);
    for (unsigned i = 0; i < 61; i++) {
        now_us += SECOND;
        assert_int_equal(feed(autopilot_heartbeat(OTHER_VEHICLE)), 1);
    }
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), OTHER_VEHICLE);
}

static void a_ground_station_becomes_no_vehicle(void **state)
{
    (void)state;
    feed(disarmed_heartbeat(VEHICLE));
    now_us += 60 * SECOND;
    assert_int_equal(feed(disarmed_heartbeat(GROUND_STATION)), 0);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

static void after_a_restart_in_flight_no_other_vehicle_takes_its_place(void **state)
{
    (void)state;
    begin();
    telemetry_expect(telemetry, VEHICLE, true, now_us);
    now_us += 60 * SECOND;
    assert_int_equal(feed(disarmed_heartbeat(OTHER_VEHICLE)), 0);
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
}

static void the_same_vehicle_after_silence_is_no_new_one(void **state)
{
    (void)state;
    now_us += 3600 * SECOND;
    assert_int_equal(feed(autopilot_heartbeat(VEHICLE)), 1);
    assert_false(latest()->heartbeat.new_vehicle);
}

/* mavlink-router passes on what a ground station says: the autopilot can be off for all that. */
static void others_that_speak_are_told_from_an_autopilot_and_from_noise(void **state)
{
    struct frame cut = ground_station_heartbeat(GROUND_STATION);

    (void)state;
    begin();
    now_us = SECOND; /* just after power-on, nobody was heard just now */
    assert_false(telemetry_only_others_speak(telemetry, now_us));
    cut.bytes[cut.length - 1] ^= 1;
    feed(cut);
    assert_false(telemetry_only_others_speak(telemetry, now_us));
    feed(ground_station_heartbeat(GROUND_STATION));
    assert_true(telemetry_only_others_speak(telemetry, now_us));
    /* One without a HEARTBEAT is an autopilot, too, and whoever else's it is. */
    feed(frame_attitude(OTHER_VEHICLE, AUTOPILOT, &(mavlink_attitude_t){.roll = 1}));
    assert_false(telemetry_only_others_speak(telemetry, now_us));
    now_us += 3 * SECOND;
    assert_false(telemetry_only_others_speak(telemetry, now_us));
    feed(ground_station_heartbeat(GROUND_STATION));
    assert_true(telemetry_only_others_speak(telemetry, now_us));
}

static void replies_go_where_the_vehicle_was_heard_last(void **state)
{
    (void)state;
    assert_int_equal(telemetry_vehicle_stream(telemetry), 0);
    feed_to(5, some_position(VEHICLE, AUTOPILOT));
    assert_int_equal(telemetry_vehicle_stream(telemetry), 5);
    feed_to(6, ground_station_heartbeat(GROUND_STATION));
    feed_to(6, some_position(VEHICLE, MAV_COMP_ID_GIMBAL));
    feed_to(6, some_position(OTHER_VEHICLE, AUTOPILOT));
    assert_int_equal(telemetry_vehicle_stream(telemetry), 5);
    telemetry_reset_stream(telemetry, 6);
    assert_int_equal(telemetry_vehicle_stream(telemetry), 5);
    telemetry_reset_stream(telemetry, 5);
    assert_int_equal(telemetry_vehicle_stream(telemetry), -1);
    assert_int_equal(telemetry_vehicle(telemetry), VEHICLE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(both_versions_of_the_protocol_are_understood, setup),
        cmocka_unit_test_setup(the_two_versions_may_follow_each_other_in_one_stream, setup),
        cmocka_unit_test_setup(a_signed_frame_counts_without_a_key, setup),
        cmocka_unit_test_setup(a_truncated_payload_reads_as_zeros, setup),
        cmocka_unit_test_setup(frames_may_come_in_any_portions, setup),
        cmocka_unit_test_setup(streams_do_not_mix, setup),
        cmocka_unit_test_setup(garbage_between_frames_is_skipped, setup),
        cmocka_unit_test_setup(a_false_start_costs_no_frames, setup),
        cmocka_unit_test_setup(half_a_frame_at_the_beginning_costs_the_longest_frame_at_most,
                               setup),
        cmocka_unit_test_setup(a_damaged_frame_is_counted_and_the_next_one_read, setup),
        cmocka_unit_test_setup(a_frame_that_lost_a_byte_does_not_take_the_next_with_it, setup),
        cmocka_unit_test_setup(a_reset_stream_forgets_its_half_frame, setup),
        cmocka_unit_test_setup(an_unknown_id_is_counted_as_such, setup),
        cmocka_unit_test_setup(a_known_message_of_no_use_is_counted_as_not_needed, setup),
        cmocka_unit_test_setup(used_frames_are_counted, setup),
        cmocka_unit_test_setup(no_vehicle_is_known_before_a_heartbeat, setup),
        cmocka_unit_test_setup(a_frame_from_system_0_is_nobodys, setup),
        cmocka_unit_test_setup(the_first_autopilot_is_the_vehicle, setup),
        cmocka_unit_test_setup(every_system_id_from_1_to_255_can_be_the_vehicle, setup),
        cmocka_unit_test_setup(only_an_autopilot_makes_a_vehicle, setup),
        cmocka_unit_test_setup(a_component_type_makes_no_vehicle, setup),
        cmocka_unit_test_setup(whatever_the_vehicle_calls_itself_its_heartbeat_counts, setup),
        cmocka_unit_test_setup(the_one_that_is_expected_returns_whatever_it_calls_itself, setup),
        cmocka_unit_test_setup(the_vehicle_under_another_component_is_there_and_says_nothing,
                               setup),
        cmocka_unit_test_setup(the_vehicles_other_components_say_nothing_of_its_state, setup),
        cmocka_unit_test_setup(the_vehicle_of_before_a_restart_counts_before_its_heartbeat, setup),
        cmocka_unit_test_setup(who_is_heard_first_gives_way_to_the_vehicle_of_the_last_power_on,
                               setup),
        cmocka_unit_test_setup(another_vehicle_waits_for_10_s_of_silence, setup),
        cmocka_unit_test_setup(nobody_takes_the_place_of_one_that_speaks, setup),
        cmocka_unit_test_setup(nor_of_one_that_is_expected_and_speaks, setup),
        cmocka_unit_test_setup(a_stray_voice_holds_nobody_off, setup),
        cmocka_unit_test_setup(in_flight_no_other_vehicle_takes_its_place, setup),
        cmocka_unit_test_setup(an_autopilot_with_another_id_is_not_heard_until_it_has_its_own_again,
                               setup),
        cmocka_unit_test_setup(one_that_flies_takes_no_place_at_all, setup),
        cmocka_unit_test_setup(the_first_vehicle_has_its_place_back_when_it_returns, setup),
        cmocka_unit_test_setup(and_at_once_when_the_other_one_is_silent, setup),
        cmocka_unit_test_setup(one_heartbeat_takes_nothing_from_who_took_off_here, setup),
        cmocka_unit_test_setup(who_took_off_here_has_its_place_back_from_who_is_silent, setup),
        cmocka_unit_test_setup(who_took_off_here_gives_way_to_nobody_who_was_only_expected, setup),
        cmocka_unit_test_setup(a_station_of_the_same_system_takes_no_place_away, setup),
        cmocka_unit_test_setup(a_ground_station_becomes_no_vehicle, setup),
        cmocka_unit_test_setup(in_flight_nobody_returns_whose_place_was_given_up, setup),
        cmocka_unit_test_setup(after_a_restart_in_flight_no_other_vehicle_takes_its_place, setup),
        cmocka_unit_test_setup(the_same_vehicle_after_silence_is_no_new_one, setup),
        cmocka_unit_test_setup(others_that_speak_are_told_from_an_autopilot_and_from_noise, setup),
        cmocka_unit_test_setup(replies_go_where_the_vehicle_was_heard_last, setup),
    };

    return cmocka_run_group_tests_name("telemetry", tests, NULL, NULL);
}
