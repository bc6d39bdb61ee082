/* Two sources that speak as one autopilot: whose word counts, and that it is told. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "telemetry_recorder.h"

#define LATITUDE_E7 577089000
#define LONGITUDE_E7 119746000
#define BOOT_MS 60000
#define UNIX_US UINT64_C(1790000000000000)
#define FAR_E7 90000 /* a kilometre north */

static int64_t start_us;
static uint8_t sequence;

/* As at the first position. */
static uint32_t boot_ms(void)
{
    return (uint32_t)(BOOT_MS + (now_us - start_us) / 1000);
}

static int setup(void **state)
{
    (void)state;
    begin_with_vehicle();
    start_us = now_us;
    return 0;
}

/* The real ones have numbers of their own: the library counts for all that this process sends. */
static struct frame numbered(struct frame frame, uint8_t number)
{
    mavlink_message_t message;
    mavlink_status_t status;

    for (size_t i = 0; i < frame.length; i++) {
        mavlink_parse_char(MAVLINK_COMM_1, frame.bytes[i], &message, &status);
    }
    frame.bytes[4] = number;
    {
        uint16_t crc = crc_calculate(frame.bytes + 1, (uint16_t)(frame.length - 3));

        crc_accumulate(mavlink_get_msg_entry(message.msgid)->crc_extra, &crc);
        frame.bytes[frame.length - 2] = (uint8_t)crc;
        frame.bytes[frame.length - 1] = (uint8_t)(crc >> 8);
    }
    return frame;
}

static struct frame position(uint32_t at_ms, int32_t latitude_e7)
{
    const mavlink_global_position_int_t content = {
        .time_boot_ms = at_ms, .lat = latitude_e7, .lon = LONGITUDE_E7, .alt = 120500, .vx = 1500};

    return frame_global_position_int(VEHICLE, AUTOPILOT, &content);
}

static struct frame utc(uint64_t unix_us, uint32_t at_ms)
{
    const mavlink_system_time_t content = {.time_unix_usec = unix_us, .time_boot_ms = at_ms};

    return frame_system_time(VEHICLE, AUTOPILOT, &content);
}

static struct frame native(double timestamp_s, int32_t latitude_e7)
{
    const mavlink_open_drone_id_location_t content = {.latitude = latitude_e7,
                                                      .longitude = LONGITUDE_E7,
                                                      .altitude_barometric = -1000,
                                                      .altitude_geodetic = 100,
                                                      .height = 10,
                                                      .timestamp = (float)timestamp_s,
                                                      .status = 2};

    return frame_open_drone_id_location(VEHICLE, AUTOPILOT, &content);
}

/* Flies north at 15 m/s, a position every 200 ms. Returns how many of them were taken. */
static unsigned fly(unsigned positions)
{
    unsigned taken = 0;

    for (unsigned i = 0; i < positions; i++) {
        int32_t north_e7 = (int32_t)((now_us - start_us) / 1000 * 15 * 90 / 1000);

        taken += feed(numbered(position(boot_ms(), LATITUDE_E7 + north_e7), sequence++));
        now_us += 200000;
    }
    return taken;
}

static double latest_latitude(void)
{
    for (unsigned i = update_count; i > 0; i--) {
        if (updates[i - 1].kind == TELEMETRY_GLOBAL_POSITION) {
            return updates[i - 1].global_position.latitude_deg;
        }
    }
    return NAN;
}

/* Between two real positions, one of somebody else's. */
static void attack(uint32_t at_ms, int32_t latitude_e7)
{
    now_us -= 100000;
    assert_int_equal(feed(numbered(position(at_ms, latitude_e7), sequence)), 0);
    now_us += 100000;
}

static void an_undisturbed_flight_is_no_contradiction(void **state)
{
    (void)state;
    assert_int_equal(fly(3000), 3000);
    assert_false(telemetry_contradicted(telemetry, now_us));
    assert_int_equal(telemetry_counters(telemetry)->not_believed, 0);
}

/* Two a second, each a kilometre off and stamped 900 ms ahead. */
static void positions_from_the_future_do_not_replace_the_real_ones(void **state)
{
    (void)state;
    fly(20);
    for (unsigned i = 0; i < 20; i++) {
        attack(boot_ms() + 900, LATITUDE_E7 + FAR_E7);
        assert_int_equal(fly(2), 2);
        assert_true(latest_latitude() < 57.7189);
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
    assert_int_equal(telemetry_counters(telemetry)->not_believed, 20);
}

static void neither_do_those_with_the_right_time(void **state)
{
    (void)state;
    fly(20);
    for (unsigned i = 0; i < 20; i++) {
        attack(boot_ms() - 90, LATITUDE_E7 + FAR_E7);
        assert_int_equal(fly(2), 2);
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
}

static void neither_do_many_of_them(void **state)
{
    (void)state;
    fly(20);
    for (unsigned i = 0; i < 100; i++) {
        for (unsigned j = 0; j < 10; j++) {
            attack(boot_ms() + 100 * j, LATITUDE_E7 + FAR_E7);
        }
        assert_int_equal(fly(1), 1);
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
}

static void neither_do_native_ones(void **state)
{
    (void)state;
    fly(20);
    for (unsigned i = 0; i < 20; i++) {
        assert_int_equal(feed(native(100 + i * 0.4, LATITUDE_E7 + FAR_E7)), 0);
        assert_int_equal(fly(2), 2);
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
}

/* A word for "no fix" opened the door to any place, and to any UTC. */
static void what_is_believed_stands_whatever_is_said_of_fixes(void **state)
{
    const mavlink_gps_raw_int_t lost = {.fix_type = 0};

    (void)state;
    fly(10);
    feed(numbered(utc(UNIX_US, boot_ms()), sequence++));
    feed(numbered(frame_gps_raw_int(VEHICLE, AUTOPILOT, &lost), sequence));
    assert_int_equal(feed(numbered(position(boot_ms() + 1, LATITUDE_E7 + FAR_E7), sequence)), 0);
    assert_int_equal(feed(numbered(position(boot_ms() + 2, 5000), sequence)), 0);
    assert_int_equal(feed(numbered(utc(UNIX_US + UINT64_C(3600000000), boot_ms()), sequence)), 0);
    assert_int_equal(fly(1), 1);
}

static struct frame gps(uint8_t fix_type, double separation_m)
{
    const mavlink_gps_raw_int_t content = {.fix_type = fix_type,
                                           .alt = 100000,
                                           .alt_ellipsoid = 100000 + (int32_t)(separation_m * 1e3)};

    return frame_gps_raw_int(VEHICLE, AUTOPILOT, &content);
}

/* The position went off the air with each of them. */
static void no_fix_counts_when_nobody_says_otherwise(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 20; i++) {
        assert_int_equal(feed(gps(3, 36)), 1);
        for (unsigned j = 1; j < 10; j++) {
            now_us += SECOND / 10;
            if (feed(gps(1, 36)) != 0) {
                assert_in_range(i, 0, 6); /* it isn't known yet that there are two */
            }
        }
        now_us += SECOND / 10;
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
    now_us += 2 * SECOND;
    assert_int_equal(feed(gps(1, 36)), 1);
    assert_int_equal(feed(gps(3, 36)), 1); /* found again */
}

static void a_fix_that_is_lost_counts_at_once(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++) {
        feed(gps(3, 36));
        now_us += SECOND;
    }
    for (unsigned i = 0; i < 10; i++) {
        assert_int_equal(feed(gps(1, 36)), 1);
        now_us += SECOND;
    }
    assert_int_equal(feed(gps(3, 36)), 1);
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* The autopilot tells of no receiver. After that one word nothing was believed to be its place, nor
 * its time, and so anybody's was. */
static void no_fix_once_is_no_open_door(void **state)
{
    (void)state;
    assert_int_equal(feed(gps(1, 36)), 1);
    now_us += 2 * SECOND;
    for (unsigned i = 0; i < 60; i++) {
        assert_int_equal(feed(native(100 + i, LATITUDE_E7)), 1);
        assert_int_equal(feed(utc(UNIX_US + i * SECOND, boot_ms())), 1);
        now_us += SECOND;
    }
    assert_int_equal(feed(native(159.5, LATITUDE_E7 + 1000 * FAR_E7)), 0);
    assert_int_equal(feed(utc(UNIX_US + 365 * 86400 * SECOND, boot_ms())), 0);
}

/* Now it has a fix, and now it hasn't: that is one receiver. */
static void a_receiver_at_the_edge_of_a_fix_does_not_contradict_itself(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 100; i++) {
        feed(gps(i % 2 ? 3 : 0, 36));
        now_us += SECOND / 5;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* A geodetic altitude is made with it. */
static void the_geoid_makes_no_steps(void **state)
{
    (void)state;
    assert_int_equal(feed(gps(0, -17)), 1); /* that says nothing of it */
    for (unsigned i = 0; i < 20; i++) {
        assert_int_equal(feed(gps(3, 36 + 0.05 * i)), 1);
        assert_true(fabs(latest()->gps_raw.separation_m - (36 + 0.05 * i)) < 1e-6);
        assert_int_equal(feed(gps(3, 90)), 1); /* a fix is a fix */
        assert_true(isnan(latest()->gps_raw.separation_m));
        now_us += SECOND;
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
}

/* Each of them would be flown in the time that delays leave open. */
static void a_thousand_steps_in_one_instant_are_one(void **state)
{
    unsigned taken = 0;

    (void)state;
    fly(10);
    for (int32_t step = 1; step <= 1000; step++) {
        int32_t north_e7 = (int32_t)((now_us - start_us) / 1000 * 15 * 90 / 1000) + step * 6000;

        taken += feed(
            numbered(position(boot_ms() + (uint32_t)step / 10, LATITUDE_E7 + north_e7), sequence));
    }
    assert_int_equal(taken, 1);
}

static void the_fault_ends_with_the_attack(void **state)
{
    (void)state;
    positions_from_the_future_do_not_replace_the_real_ones(state);
    fly(305);
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* An autopilot's restart, a position that an estimator corrected: one change, no contradiction. */
static void a_source_that_changes_is_believed_after_a_second(void **state)
{
    (void)state;
    fly(20);
    for (unsigned i = 0; i < 10; i++) {
        unsigned expected = i >= 4;

        assert_int_equal(feed(position(1000 + 200 * i, LATITUDE_E7)), expected);
        now_us += 200000;
    }
    for (unsigned i = 10; i < 20; i++) {
        unsigned expected = i >= 14;

        assert_int_equal(feed(position(1000 + 200 * i, LATITUDE_E7 + FAR_E7)), expected);
        now_us += 200000;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
}

static void after_a_silence_whoever_speaks_is_believed(void **state)
{
    (void)state;
    fly(20);
    now_us += 5 * SECOND;
    assert_int_equal(feed(position(500, LATITUDE_E7 + FAR_E7)), 1);
}

/* A degree away in 5 s: one such position may be a fault of the estimator's. */
static void a_jump_that_no_aircraft_flies_has_to_be_confirmed(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++) {
        fly(90);
        now_us += 5 * SECOND;
        assert_int_equal(feed(position(boot_ms(), LATITUDE_E7 + 10000000)), 0);
        now_us += 200000;
    }
    assert_int_equal(fly(60), 60);
    assert_false(telemetry_contradicted(telemetry, now_us));
    now_us += 5 * SECOND;
    assert_int_equal(feed(position(boot_ms(), LATITUDE_E7 + 10000000)), 0);
    now_us += 200000;
    assert_int_equal(feed(position(boot_ms(), LATITUDE_E7 + 10000050)), 1);
}

static void what_was_held_up_on_the_way_counts(void **state)
{
    (void)state;
    fly(20);
    now_us += 3 * SECOND; /* and now all of them at once */
    for (unsigned i = 0; i < 15; i++) {
        assert_int_equal(feed(position(boot_ms() - 3000 + 200 * i, LATITUDE_E7 + 9000)), 1);
    }
    assert_int_equal(fly(20), 20);
    assert_false(telemetry_contradicted(telemetry, now_us));
}

static void utc_is_the_believed_sources(void **state)
{
    uint64_t offset_us = UNIX_US - BOOT_MS * UINT64_C(1000);

    (void)state;
    for (unsigned i = 0; i < 20; i++) {
        assert_int_equal(feed(utc(offset_us + boot_ms() * UINT64_C(1000), boot_ms())), 1);
        fly(2);
        for (unsigned j = 0; j < 4; j++) { /* an hour off; with another clock's time */
            assert_int_equal(feed(utc(UNIX_US + UINT64_C(3600000000), boot_ms())), 0);
        }
        if (i >= 6) {
            assert_int_equal(feed(utc(UNIX_US, boot_ms() + 900)), 0);
        }
        fly(3);
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
    assert_int_equal(feed(utc(0, boot_ms())), 1); /* no GNSS time: that isn't another's */
}

/* What has no time and no place shows by its numbers. */
static void frames_numbered_by_two_are_a_contradiction(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 300; i++) { /* some are lost on the way */
        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)(i + i / 7)));
        now_us += SECOND / 10;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
    for (unsigned i = 0; i < 5; i++) {
        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)(342 + i)));
        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)(20 + i)));
        now_us += SECOND;
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
}

/* Where the line is quiet for 110 ms, he takes the last number again, the next one, or any. */
static void no_number_is_left_to_forge_with(void **state)
{
    static const uint8_t ahead[] = {0, 1, 2, 9, 100, 128, 200, 255};

    for (size_t i = 0; i < sizeof(ahead); i++) {
        setup(state);
        for (unsigned j = 0; j < 200; j++) { /* bursts of four, five times a second */
            feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)j));
            if (j % 4 == 3) {
                now_us += 110000;
                if (j > 100 && j % 16 == 3) {
                    feed(numbered(heartbeat_with_mode(VEHICLE, 1), (uint8_t)(j + ahead[i])));
                }
                now_us += 90000;
            }
        }
        assert_true(telemetry_contradicted(telemetry, now_us));
    }
}

/* Twenty frames a second, and eight hundred that go to the ground station only. */
static void a_log_that_is_downloaded_is_none(void **state)
{
    uint8_t number = 0;

    (void)state;
    for (unsigned i = 0; i < 200; i++) {
        feed(numbered(autopilot_heartbeat(VEHICLE), number++));
        now_us += SECOND / 20;
    }
    for (unsigned i = 0; i < 6000; i++) {
        feed(numbered(autopilot_heartbeat(VEHICLE), number));
        number = (uint8_t)(number + (i % 4 == 3 ? 150 + i * 7 % 20 : 1));
        now_us += i % 4 == 3 ? 195000 : 1500;
        assert_false(telemetry_contradicted(telemetry, now_us));
    }
}

/* It begins all at once, with 800 a second beside the 50 that come here. */
static void a_download_that_begins_is_none(void **state)
{
    uint8_t number = 0;

    (void)state;
    for (unsigned i = 0; i < 3000; i++) {
        feed(numbered(autopilot_heartbeat(VEHICLE), number));
        number = (uint8_t)(number + (i < 500 ? 1 : 13 + i * 7 % 8));
        now_us += SECOND / 50;
        assert_false(telemetry_contradicted(telemetry, now_us));
    }
}

/* Now and then two neighbours change places on the way. */
static void frames_that_come_in_another_order_are_none(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 3000; i++) {
        bool swapped = i % 40 >= 38; /* 38 and 39, 78 and 79, ... */

        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)(swapped ? i ^ 1U : i)));
        now_us += SECOND / 50;
        assert_false(telemetry_contradicted(telemetry, now_us));
    }
}

/* Learnt while the line was full; later nothing is held up for so long. */
static void a_line_that_was_full_is_not_held_against_it(void **state)
{
    int64_t late_us = 0, sent_us = now_us;

    (void)state;
    for (unsigned i = 0; i < 600; i++) {
        int64_t least_us = late_us - 199000; /* nothing overtakes */

        late_us = i < 15 ? 500000 : i * 7919 % 500 * INT64_C(1000);
        late_us = late_us > least_us ? late_us : least_us;
        now_us = sent_us;
        {
            struct frame frame = numbered(position(boot_ms(), LATITUDE_E7), sequence++);

            now_us = sent_us + late_us;
            assert_int_equal(feed(frame), 1);
        }
        sent_us += 200000;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* A log that is downloaded: most frames go to the ground station only. */
static void frames_that_went_elsewhere_are_none(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 100; i++) {
        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)(200 * i)));
        now_us += SECOND / 5;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* Each of an autopilot's ports numbers for itself. */
static void one_autopilot_by_two_links_is_no_contradiction(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 100; i++) {
        feed_to(0, numbered(autopilot_heartbeat(VEHICLE), (uint8_t)i));
        feed_to(1, numbered(autopilot_heartbeat(VEHICLE), (uint8_t)(i + 180)));
        now_us += SECOND / 20;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* As PX4 says before it has a fix: its clock began in 1970. */
static void an_unset_utc_is_nobody_s(void **state)
{
    (void)state;
    feed(utc(boot_ms() * UINT64_C(1000), boot_ms()));
    fly(2);
    assert_int_equal(feed(utc(UNIX_US, boot_ms())), 1);
}

static void the_same_frame_twice_is_none(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 100; i++) {
        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)i));
        feed(numbered(autopilot_heartbeat(VEHICLE), (uint8_t)i));
        now_us += SECOND / 10;
    }
    assert_false(telemetry_contradicted(telemetry, now_us));
}

/* The same number, and a checksum made to be the same, too. */
static void another_frame_with_its_checksum_is_one(void **state)
{
    (void)state;
    for (unsigned i = 0; i < 10; i++) {
        struct frame real = numbered(autopilot_heartbeat(VEHICLE), (uint8_t)i), forged = real;

        /* Of the heartbeat's custom_mode 3 octets are free: two of them make up for the third. */
        for (uint32_t tried = 1; tried < 1U << 24; tried++) {
            forged.bytes[10] = (uint8_t)tried;
            forged.bytes[11] = (uint8_t)(tried >> 8);
            forged.bytes[12] = (uint8_t)(tried >> 16);
            if (memcmp(numbered(forged, (uint8_t)i).bytes, forged.bytes, forged.length) == 0) {
                break;
            }
        }
        assert_memory_not_equal(real.bytes, forged.bytes, real.length);
        feed(real);
        feed(forged);
        now_us += SECOND / 10;
    }
    assert_true(telemetry_contradicted(telemetry, now_us));
}

static void operator_data_come_from_the_ground_all_the_same(void **state)
{
    const mavlink_open_drone_id_operator_id_t content = {.operator_id = "FIN87astrdge12k8"};

    (void)state;
    positions_from_the_future_do_not_replace_the_real_ones(state);
    assert_int_equal(feed(frame_open_drone_id_operator_id(GROUND_STATION, 190, &content)), 1);
}

#define TEST(name) cmocka_unit_test_setup(name, setup)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(an_undisturbed_flight_is_no_contradiction),
        TEST(positions_from_the_future_do_not_replace_the_real_ones),
        TEST(neither_do_those_with_the_right_time),
        TEST(neither_do_many_of_them),
        TEST(neither_do_native_ones),
        TEST(what_is_believed_stands_whatever_is_said_of_fixes),
        TEST(no_fix_counts_when_nobody_says_otherwise),
        TEST(a_fix_that_is_lost_counts_at_once),
        TEST(no_fix_once_is_no_open_door),
        TEST(a_receiver_at_the_edge_of_a_fix_does_not_contradict_itself),
        TEST(the_geoid_makes_no_steps),
        TEST(a_thousand_steps_in_one_instant_are_one),
        TEST(the_fault_ends_with_the_attack),
        TEST(a_source_that_changes_is_believed_after_a_second),
        TEST(after_a_silence_whoever_speaks_is_believed),
        TEST(a_jump_that_no_aircraft_flies_has_to_be_confirmed),
        TEST(what_was_held_up_on_the_way_counts),
        TEST(utc_is_the_believed_sources),
        TEST(frames_numbered_by_two_are_a_contradiction),
        TEST(no_number_is_left_to_forge_with),
        TEST(a_log_that_is_downloaded_is_none),
        TEST(a_download_that_begins_is_none),
        TEST(frames_that_come_in_another_order_are_none),
        TEST(a_line_that_was_full_is_not_held_against_it),
        TEST(frames_that_went_elsewhere_are_none),
        TEST(one_autopilot_by_two_links_is_no_contradiction),
        TEST(an_unset_utc_is_nobody_s),
        TEST(the_same_frame_twice_is_none),
        TEST(another_frame_with_its_checksum_is_one),
        TEST(operator_data_come_from_the_ground_all_the_same),
    };

    return cmocka_run_group_tests_name("belief", tests, NULL, NULL);
}
