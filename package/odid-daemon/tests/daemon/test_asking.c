/* What the autopilot is asked for, when, and when not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <common/mavlink.h>
#include <string.h>

#include "daemon/asking.h"

#define MS INT64_C(1000)
#define SECOND INT64_C(1000000)
#define MESSAGES 7
#define ALL (MESSAGES + 1) /* but the second receiver's, which is asked for where it is needed */
#define VITAL 3            /* the first of them: without these there is no position */

static const struct {
    uint16_t id;
    enum telemetry_kind kind;
    uint32_t interval_us;
} message[MESSAGES] = {
    {0, TELEMETRY_HEARTBEAT, 1000000},       {24, TELEMETRY_GPS_RAW, 1000000},
    {33, TELEMETRY_GLOBAL_POSITION, 200000}, {2, TELEMETRY_SYSTEM_TIME, 1000000},
    {245, TELEMETRY_LANDED_STATE, 1000000},  {242, TELEMETRY_HOME, 1000000},
    {124, TELEMETRY_GPS2_RAW, 1000000},
};
enum { HEARTBEAT, GPS_RAW, POSITION, SYSTEM_TIME, LANDED_STATE, HOME, GPS2_RAW };

static struct asking asking;
static int64_t now_us;
/* The simulated autopilot: at what interval it sends each, 0: not; what it does when asked. */
static uint32_t sends_us[MESSAGES];
static enum { OBEYS, REFUSES, IGNORES } when_asked[MESSAGES];
static unsigned asked[MESSAGES];
static int64_t asked_us[MESSAGES];
static unsigned probes; /* questions for a HEARTBEAT that comes */
static uint8_t fix_type;
static bool apart;
static bool may_ask; /* [mavlink] request_rate */

static int setup(void **state)
{
    (void)state;
    now_us = 1000 * SECOND;
    memset(sends_us, 0, sizeof(sends_us));
    memset(when_asked, 0, sizeof(when_asked));
    memset(asked, 0, sizeof(asked));
    probes = 0;
    fix_type = GPS_FIX_TYPE_3D_FIX;
    apart = false;
    may_ask = true;
    asking_begin(&asking, now_us);
    return 0;
}

static bool refused(uint16_t message_id)
{
    uint16_t ids[ASKING_MESSAGES];
    unsigned count = asking_refused(&asking, now_us, ids);

    while (count > 0 && ids[count - 1] != message_id) {
        count--;
    }
    return count > 0;
}

static void answer(uint8_t result, uint16_t command)
{
    struct telemetry_update update = {.kind = TELEMETRY_COMMAND_ACK};

    update.command_ack.command = command;
    update.command_ack.result = result;
    asking_heard(&asking, &update, now_us);
}

static void take(const struct asking_request *request)
{
    for (unsigned i = 0; i < MESSAGES; i++) {
        if (message[i].id != request->message_id) {
            continue;
        }
        assert_int_equal(request->interval_us, message[i].interval_us);
        if (i == HEARTBEAT && sends_us[i] == message[i].interval_us) {
            probes++;
        } else {
            asked[i]++;
            asked_us[i] = now_us;
        }
        if (when_asked[i] == OBEYS) {
            sends_us[i] = request->interval_us;
            answer(MAV_RESULT_ACCEPTED, MAV_CMD_SET_MESSAGE_INTERVAL);
        } else if (when_asked[i] == REFUSES) {
            answer(MAV_RESULT_DENIED, MAV_CMD_SET_MESSAGE_INTERVAL);
        }
        return;
    }
    fail();
}

static void pass(double seconds)
{
    int64_t end_us = now_us + (int64_t)(seconds * 1e6);

    while (now_us < end_us) {
        struct asking_request request;

        now_us += 50 * MS;
        for (unsigned i = 0; i < MESSAGES; i++) {
            if (sends_us[i] != 0 && now_us % sends_us[i] == 0) {
                struct telemetry_update update = {.kind = message[i].kind};

                update.gps_raw.fix_type = fix_type;
                asking_heard(&asking, &update, now_us);
            }
        }
        if (now_us % (250 * MS) == 0 && (may_ask ? asking_next(&asking, apart, now_us, &request)
                                                 : asking_probe(&asking, now_us, &request))) {
            take(&request);
        }
    }
}

static void expect_asked(unsigned which, unsigned times)
{
    for (unsigned i = 0; i < MESSAGES; i++) {
        if ((which == ALL && i != GPS2_RAW) || which == i) {
            assert_int_equal(asked[i], times);
        }
    }
}

/* ArduCopter's default streams. */
static void what_does_not_come_is_asked_for_once(void **state)
{
    (void)state;
    pass(10);
    expect_asked(ALL, 1);
    pass(600);
    expect_asked(ALL, 1);
}

/* A ground station that says "not that" twice a second: the position comes again each time. */
static void what_is_switched_off_all_the_time_is_asked_for_each_time(void **state)
{
    unsigned came = 0;

    (void)state;
    pass(10);
    for (unsigned i = 0; i < 120; i++) {
        sends_us[POSITION] = 0;
        pass(0.5);
        came += sends_us[POSITION] != 0;
    }
    assert_true(came >= 40);
    assert_true(asked[POSITION] <= 130); /* and the autopilot isn't flooded by it */
}

static void what_comes_is_not_asked_for(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        sends_us[i] = message[i].interval_us;
    }
    pass(600);
    expect_asked(ALL, 0);
}

static void what_comes_too_seldom_is_asked_for(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        sends_us[i] = 2 * message[i].interval_us;
    }
    pass(10);
    expect_asked(ALL, 1);
}

/* Mission Planner's position stream has 2 Hz; with each that came the next question moved on. */
static void what_is_set_slower_is_asked_for_again(void **state)
{
    (void)state;
    pass(30);
    expect_asked(ALL, 1);
    for (unsigned round = 2; round < 10; round++) {
        sends_us[POSITION] = 500000;
        sends_us[GPS_RAW] = 2500000;
        pass(20);
        assert_int_equal(asked[POSITION], round);
        assert_int_equal(asked[GPS_RAW], round);
    }
}

/* Another station's REQUEST_DATA_STREAM. */
static void what_was_switched_off_is_asked_for_again_within_5_s(void **state)
{
    (void)state;
    pass(30);
    for (unsigned round = 2; round < 10; round++) {
        int64_t off_us = now_us;

        memset(sends_us, 0, sizeof(sends_us));
        pass(8);
        for (unsigned i = 0; i < GPS2_RAW; i++) {
            assert_int_equal(asked[i], round);
            assert_true(asked_us[i] - off_us <= 5 * SECOND);
        }
    }
}

static void a_refusal_is_remembered_until_the_autopilot_restarts(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        when_asked[i] = i == LANDED_STATE ? REFUSES : OBEYS;
    }
    pass(600);
    for (unsigned i = 0; i < GPS2_RAW; i++) {
        assert_int_equal(asked[i], i == LANDED_STATE ? 2 : 1);
    }
    assert_true(refused(245));
    assert_false(refused(24));
    asking_begin(&asking, now_us);
    assert_false(refused(245));
    pass(20);
    expect_asked(LANDED_STATE, 4);
    expect_asked(GPS_RAW, 1); /* it still comes */
}

/* An answer that was another station's, or to the question before. */
static void what_a_position_needs_is_never_given_up(void **state)
{
    (void)state;
    for (unsigned i = 0; i < VITAL; i++) {
        when_asked[i] = REFUSES;
    }
    pass(600);
    for (unsigned i = 0; i < VITAL; i++) {
        assert_true(asked[i] > 10);
        when_asked[i] = OBEYS;
    }
    assert_true(refused(24));
    pass(60);
    assert_false(refused(24));
    for (unsigned i = 0; i < VITAL; i++) {
        assert_int_equal(sends_us[i], message[i].interval_us);
    }
}

static void who_never_answers_is_asked_more_and_more_seldom(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        when_asked[i] = IGNORES;
    }
    pass(100);
    for (unsigned i = 0; i < MESSAGES; i++) {
        assert_in_range(asked[i], i < VITAL ? 15 : 4, i < VITAL ? 18 : 6);
    }
    pass(1000);
    for (unsigned i = 0; i < MESSAGES; i++) {
        assert_in_range(asked[i], i < VITAL ? 165 : 20, i < VITAL ? 185 : 28);
    }
}

/* A cable with one wire; an autopilot that takes signed frames only. */
static void an_autopilot_that_hears_nothing_is_found_out(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        when_asked[i] = IGNORES;
        sends_us[i] = i <= SYSTEM_TIME && i != POSITION ? message[i].interval_us : 0;
    }
    pass(10);
    assert_false(asking_unheard(&asking));
    pass(120);
    assert_true(asking_unheard(&asking));
    while (now_us - asked_us[POSITION] != 2 * SECOND) {
        pass(0.05);
    }
    sends_us[POSITION] = message[POSITION].interval_us; /* by itself: it has its first fix */
    pass(100);
    assert_true(asking_unheard(&asking));
    for (unsigned i = 0; i < MESSAGES; i++) {
        when_asked[i] = OBEYS;
    }
    pass(60);
    assert_false(asking_unheard(&asking));
}

/* Its streams come by themselves: nothing had to be asked for, and nobody noticed. */
static void a_way_back_that_breaks_later_is_found_out(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        sends_us[i] = message[i].interval_us;
    }
    pass(300);
    assert_in_range(probes, 12, 16);
    assert_false(asking_unheard(&asking));
    when_asked[HEARTBEAT] = IGNORES;
    pass(55);
    assert_true(asking_unheard(&asking));
    when_asked[HEARTBEAT] = REFUSES; /* which is an answer */
    pass(25);
    assert_false(asking_unheard(&asking));
}

/* request_rate = false: nobody was asked anything, and nobody noticed. Somebody else's answer in
 * MAVLink 1, which doesn't say whose, is none of ours. */
static void where_nothing_is_asked_for_a_way_back_that_breaks_is_found_out_too(void **state)
{
    (void)state;
    sends_us[HEARTBEAT] = message[HEARTBEAT].interval_us;
    may_ask = false;
    pass(300);
    assert_in_range(probes, 12, 16);
    expect_asked(POSITION, 0);
    assert_false(asking_unheard(&asking));
    when_asked[HEARTBEAT] = IGNORES;
    for (unsigned i = 0; i < 11; i++) {
        pass(5);
        answer(MAV_RESULT_ACCEPTED, MAV_CMD_COMPONENT_ARM_DISARM);
    }
    assert_true(asking_unheard(&asking));
    when_asked[HEARTBEAT] = OBEYS;
    pass(25);
    assert_false(asking_unheard(&asking));
}

static void all_come_but_a_second_receiver_s(void)
{
    for (unsigned i = 0; i < GPS2_RAW; i++) {
        sends_us[i] = message[i].interval_us;
    }
    pass(60);
    expect_asked(GPS2_RAW, 0);
}

/* Where the first receiver has a fix, and is where the position is, nobody needs the second one's.
 */
static void a_second_receiver_is_asked_for_when_the_first_has_no_fix(void **state)
{
    (void)state;
    all_come_but_a_second_receiver_s();
    fix_type = GPS_FIX_TYPE_NO_FIX;
    pass(5);
    expect_asked(GPS2_RAW, 1);
    assert_int_equal(sends_us[GPS2_RAW], message[GPS2_RAW].interval_us);
    setup(NULL);
    when_asked[GPS_RAW] = when_asked[GPS2_RAW] = REFUSES; /* nor has it one */
    pass(600);
    expect_asked(GPS2_RAW, 2);
    assert_false(refused(124));
    assert_true(refused(24));
}

static void a_second_receiver_is_asked_for_when_the_first_is_contradicted(void **state)
{
    (void)state;
    all_come_but_a_second_receiver_s();
    apart = true;
    pass(5);
    expect_asked(GPS2_RAW, 1);
    assert_int_equal(sends_us[GPS2_RAW], message[GPS2_RAW].interval_us);
    apart = false;
    pass(60);
    expect_asked(GPS2_RAW, 1);
}

static void a_refusal_is_an_answer(void **state)
{
    (void)state;
    for (unsigned i = 0; i < MESSAGES; i++) {
        when_asked[i] = REFUSES;
    }
    pass(300);
    assert_false(asking_unheard(&asking));
}

static void the_answer_to_another_command_says_nothing(void **state)
{
    struct asking_request request;

    (void)state;
    now_us += 3 * SECOND;
    for (unsigned i = 0; i < 20; i++) {
        struct telemetry_update update = {.kind = message[i % VITAL].kind};

        asking_heard(&asking, &update, now_us);
        now_us += 60 * MS;
    }
    assert_true(asking_next(&asking, apart, now_us, &request));
    assert_int_equal(request.message_id, 2);
    answer(MAV_RESULT_DENIED, MAV_CMD_SET_MESSAGE_INTERVAL);
    now_us += 4 * SECOND;
    for (request.message_id = 0; request.message_id != 2; now_us += SECOND) {
        assert_true(asking_next(&asking, apart, now_us, &request));
    }
    now_us -= SECOND;
    answer(MAV_RESULT_DENIED, MAV_CMD_COMPONENT_ARM_DISARM);
    assert_false(refused(request.message_id));
    assert_false(
        asking_next(&asking, apart, now_us, &request)); /* its answer is still waited for */
    answer(MAV_RESULT_UNSUPPORTED, MAV_CMD_SET_MESSAGE_INTERVAL);
    assert_true(refused(request.message_id));
    answer(MAV_RESULT_ACCEPTED, MAV_CMD_SET_MESSAGE_INTERVAL); /* nothing was asked */
    assert_true(refused(request.message_id));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(what_does_not_come_is_asked_for_once, setup),
        cmocka_unit_test_setup(what_is_switched_off_all_the_time_is_asked_for_each_time, setup),
        cmocka_unit_test_setup(what_comes_is_not_asked_for, setup),
        cmocka_unit_test_setup(what_comes_too_seldom_is_asked_for, setup),
        cmocka_unit_test_setup(what_is_set_slower_is_asked_for_again, setup),
        cmocka_unit_test_setup(what_was_switched_off_is_asked_for_again_within_5_s, setup),
        cmocka_unit_test_setup(a_refusal_is_remembered_until_the_autopilot_restarts, setup),
        cmocka_unit_test_setup(what_a_position_needs_is_never_given_up, setup),
        cmocka_unit_test_setup(who_never_answers_is_asked_more_and_more_seldom, setup),
        cmocka_unit_test_setup(an_autopilot_that_hears_nothing_is_found_out, setup),
        cmocka_unit_test_setup(a_way_back_that_breaks_later_is_found_out, setup),
        cmocka_unit_test_setup(where_nothing_is_asked_for_a_way_back_that_breaks_is_found_out_too,
                               setup),
        cmocka_unit_test_setup(a_second_receiver_is_asked_for_when_the_first_has_no_fix, setup),
        cmocka_unit_test_setup(a_second_receiver_is_asked_for_when_the_first_is_contradicted,
                               setup),
        cmocka_unit_test_setup(a_refusal_is_an_answer, setup),
        cmocka_unit_test_setup(the_answer_to_another_command_says_nothing, setup),
    };

    return cmocka_run_group_tests_name("asking", tests, NULL, NULL);
}
