/* Location.Status: ground, airborne, emergency, remote ID system failure. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

static void the_armed_bit_decides_without_a_landed_state(void **state)
{
    (void)state;
    fly(5);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    assert_int_equal(view.location.status_source, SOURCE_TELEMETRY);
    assert_false(condition.armed);
    arm(true);
    look();
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    assert_true(condition.armed);
}

static void a_landed_state_wins_over_the_armed_bit(void **state)
{
    static const struct {
        uint8_t landed;
        enum aircraft_status armed, disarmed;
    } cases[] = {
        {MAV_LANDED_STATE_UNDEFINED, AIRCRAFT_AIRBORNE, AIRCRAFT_GROUND},
        {MAV_LANDED_STATE_ON_GROUND, AIRCRAFT_GROUND, AIRCRAFT_GROUND},
        {MAV_LANDED_STATE_IN_AIR, AIRCRAFT_AIRBORNE, AIRCRAFT_AIRBORNE},
        {MAV_LANDED_STATE_TAKEOFF, AIRCRAFT_AIRBORNE, AIRCRAFT_AIRBORNE},
        {MAV_LANDED_STATE_LANDING, AIRCRAFT_AIRBORNE, AIRCRAFT_AIRBORNE},
        {200, AIRCRAFT_AIRBORNE, AIRCRAFT_GROUND},
    };

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        fly(5);
        arm(true);
        landed(cases[i].landed);
        look();
        assert_int_equal(view.location.status, cases[i].armed);
        arm(false);
        fly(4);
        landed(cases[i].landed);
        look();
        assert_int_equal(view.location.status, cases[i].disarmed);
    }
}

static void a_landed_state_that_stopped_gives_way_to_the_armed_bit(void **state)
{
    (void)state;
    sim.armed = true;
    fly(5);
    landed(MAV_LANDED_STATE_ON_GROUND);
    fly(2.8);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    fly(0.2);
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
}

static void an_emergency_is_said_and_over_when_it_is_over(void **state)
{
    (void)state;
    sim.armed = true;
    fly(5);
    for (uint8_t system_status = 0; system_status <= MAV_STATE_FLIGHT_TERMINATION;
         system_status++) {
        /* CRITICAL is a failsafe in which it still navigates. */
        bool emergency =
            system_status == MAV_STATE_EMERGENCY || system_status == MAV_STATE_FLIGHT_TERMINATION;

        sim.system_status = system_status;
        fly(1);
        assert_int_equal(view.location.status, emergency ? AIRCRAFT_EMERGENCY : AIRCRAFT_AIRBORNE);
        assert_int_equal(condition.emergency, emergency);
    }
}

/* An emergency that is known now is worth more than what else is missing. */
static void an_emergency_without_a_position_is_an_emergency(void **state)
{
    (void)state;
    fly(5);
    sim.system_status = MAV_STATE_EMERGENCY;
    sim.position = false;
    fly(10);
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    assert_false(view.location.position_fresh);
    sim.heartbeat = false;
    fly(3);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_false(condition.emergency);
}

static void a_lost_heartbeat_is_a_remote_id_failure_after_3_s(void **state)
{
    (void)state;
    sim.armed = true;
    fly(5);
    sim.heartbeat = false;
    fly(2.8);
    silence_us(199 * MS);
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    assert_true(condition.heartbeat_fresh);
    silence_us(1 * MS);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_false(condition.heartbeat_fresh);
    sim.heartbeat = true;
    fly(1);
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
}

static void a_lost_heartbeat_keeps_a_position_that_still_comes(void **state)
{
    (void)state;
    fly(5);
    sim.heartbeat = false;
    fly(10);
    assert_true(view.location.position_fresh);
    assert_true(view.location.fix_us == now_us);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

static void the_first_seconds_are_no_failure_yet(void **state)
{
    (void)state;
    silence_us(2999 * MS);
    assert_int_equal(view.location.status, AIRCRAFT_UNDECLARED);
    silence_us(1 * MS);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

static void a_native_status_wins_while_it_is_fresh(void **state)
{
    (void)state;
    fly(5);
    for (uint8_t status = 0; status <= 15; status++) {
        struct telemetry_update update;

        fly(0.2);
        for (unsigned times = 0; times < 2; times++) {
            fly(0.2);
            update = native_of(now_us);
            update.location.status = status;
            give(&update);
        }
        look();
        /* undeclared, or a number that isn't one: what telemetry knows */
        assert_int_equal(view.location.status,
                         status >= 1 && status <= 4 ? status : AIRCRAFT_GROUND);
        assert_int_equal(view.location.status_source,
                         status >= 1 && status <= 4 ? SOURCE_NATIVE : SOURCE_TELEMETRY);
    }
    fly(3);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

static void a_native_emergency_is_said_without_a_position(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    sim.position = false;
    fly(5);
    update = native_of(now_us);
    update.location.status = AIRCRAFT_EMERGENCY;
    update.location.latitude_deg = update.location.longitude_deg = NAN;
    give(&update);
    look();
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE); /* once is no word */
    now_us += SECOND;
    update.location.timestamp_s += 1;
    give(&update);
    look();
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    fly(3);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
}

static void an_emergency_counts_from_whichever_source(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    sim.system_status = MAV_STATE_EMERGENCY;
    fly(1.5);
    update = native_of(now_us);
    update.location.status = AIRCRAFT_AIRBORNE;
    give(&update);
    look();
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    assert_int_equal(view.location.status_source, SOURCE_TELEMETRY);
}

/* ArduPlane says "Crash detected. No action taken", and flies on. */
static void a_crash_that_is_only_said_is_none(void **state)
{
    struct telemetry_update crash = update_of(TELEMETRY_CRASHED);

    (void)state;
    arm(true);
    fly(20);
    give(&crash);
    for (unsigned i = 0; i < 30; i++) {
        fly(1);
        assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    }
    arm(false); /* landed, later */
    fly(5);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

static void hardware_in_the_loop_is_known_as_such(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    fly(5);
    assert_false(condition.simulated);
    update.heartbeat.mav_type = sim.mav_type;
    update.heartbeat.autopilot = sim.autopilot;
    update.heartbeat.base_mode = MAV_MODE_FLAG_HIL_ENABLED | MAV_MODE_FLAG_SAFETY_ARMED;
    /* As what kind it is: when the other word isn't said any more. */
    for (unsigned i = 0; i < 5; i++) {
        now_us += SECOND;
        give(&update);
        look();
        assert_int_equal(condition.simulated, i >= 2);
    }
    fly(5);
    assert_false(condition.simulated);
}

/* Falling, beside a stray voice that says anything: it was in no distress for receivers. */
static void in_doubt_it_falls_as_well(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    fly(5);
    arm(true);
    fly(5);
    sim.altitude_m += 80;
    fly(5);
    sim.heartbeat = false;
    sim.up_mps = -5;
    update.heartbeat.mav_type = sim.mav_type;
    update.heartbeat.autopilot = sim.autopilot;
    update.heartbeat.doubtful = true;
    for (unsigned i = 0; i < 9; i++) {
        give(&update);
        sim.altitude_m -= 5;
        fly(1);
        assert_int_equal(view.location.status, i >= 3 ? AIRCRAFT_EMERGENCY : AIRCRAFT_AIRBORNE);
    }
    update.heartbeat.base_mode = MAV_MODE_FLAG_SAFETY_ARMED; /* who flies says so each second */
    for (unsigned i = 0; i < 9; i++) {
        give(&update);
        update.heartbeat.base_mode ^= MAV_MODE_FLAG_SAFETY_ARMED;
        fly(1);
        assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    }
}

/* Two take turns, and one of them says emergency. */
static void in_doubt_one_word_is_no_emergency(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    arm(true);
    fly(5);
    update.heartbeat.mav_type = sim.mav_type;
    update.heartbeat.base_mode = MAV_MODE_FLAG_SAFETY_ARMED;
    update.heartbeat.doubtful = true;
    for (unsigned i = 0; i < 20; i++) {
        update.heartbeat.system_status = i % 2 ? MAV_STATE_EMERGENCY : MAV_STATE_ACTIVE;
        give(&update);
        look();
        assert_false(condition.emergency);
        now_us += SECOND / 2;
    }
    give(&update); /* the same again */
    look();
    assert_true(condition.emergency);
}

/* One text of somebody else's, and it would stand until the aircraft is armed. */
static void what_lies_there_disarmed_does_not_crash(void **state)
{
    struct telemetry_update crash = update_of(TELEMETRY_CRASHED);

    (void)state;
    fly(5);
    give(&crash);
    fly(5);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    arm(true);
    fly(5);
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
}

static void fly_and_crash(void)
{
    struct telemetry_update crash = update_of(TELEMETRY_CRASHED);

    arm(true);
    fly(20);
    give(&crash);
    arm(false);
}

/* It lies there, disarmed, and by its landed state on the ground. */
static void a_crash_is_an_emergency_until_it_is_armed_again(void **state)
{
    struct telemetry_update doubted = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    fly_and_crash();
    fly(60);
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    for (unsigned armed = 0; armed < 2; armed++) { /* our own restart, also while armed lasts */
        begin();
        aircraft_restore_armed(aircraft, armed);
        aircraft_restore_crash(aircraft, true, now_us);
        look();
        assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY); /* its autopilot may be dead */
        arm(false);
        fly(60);
        assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    }
    doubted.heartbeat.doubtful = true; /* a stray voice ended it */
    sim.heartbeat = false;
    for (unsigned i = 0; i < 20; i++) {
        give(&doubted);
        fly(1);
        assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    }
    doubted.heartbeat.base_mode = MAV_MODE_FLAG_SAFETY_ARMED; /* so did one that says armed */
    give(&doubted);
    sim.heartbeat = true;
    fly(5);
    arm(true);
    fly(0.3);
    arm(false);
    fly(20);
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    assert_true(condition.crashed);
    arm(true);
    fly(5);
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    assert_false(condition.crashed);
}

/* A real copter: disarmed at 86 m, under its parachute, "on ground" by its landed state. */
static void disarmed_high_in_the_air_it_is_in_distress(void **state)
{
    for (unsigned with = 0; with < 4; with++) {
        (void)state;
        begin();
        fly(5);
        arm(true);
        sim.up_mps = 3;
        for (unsigned i = 0; i < 30; i++) {
            sim.altitude_m += 3;
            fly(1);
        }
        assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
        sim.armed = false;
        sim.up_mps = -4;
        for (unsigned i = 0; i < 15; i++) {
            sim.altitude_m -= 4;
            if (with & 1) {
                landed(MAV_LANDED_STATE_ON_GROUND);
            }
            if (with & 2) { /* ArduPilot's native status is the armed bit */
                struct telemetry_update update = native_of(now_us);

                update.location.status = AIRCRAFT_GROUND;
                update.location.vertical_speed_mps = -4;
                give(&update);
            }
            fly(1);
            if (i > 0) {
                assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
            }
        }
        sim.up_mps = 0; /* it lies there */
        for (unsigned i = 0; i < 10; i++) {
            landed(MAV_LANDED_STATE_ON_GROUND);
            fly(1);
        }
        assert_int_equal(view.location.status, AIRCRAFT_GROUND);
        assert_false(condition.armed);
    }
}

/* The same of one that sends nothing but native messages: their status is the armed bit. */
static void fall_with_native_alone(double home_follows)
{
    double height_m = 86;

    sim.position = sim.gps = false;
    fly(2);
    arm(true);
    for (unsigned i = 0; i < 40; i++) {
        struct telemetry_update update = native_of(now_us);
        bool falls = i >= 10 && height_m > 0;

        height_m -= falls ? 4 : 0;
        sim.armed = i < 10;
        update.location.status = sim.armed ? AIRCRAFT_AIRBORNE : AIRCRAFT_GROUND;
        update.location.speed_mps = 0;
        update.location.vertical_speed_mps = falls ? -4 : 0;
        update.location.altitude_geodetic_m = 36 + (i == 0 ? 0 : height_m);
        update.location.height_m = i == 0 ? 0 : height_m * (1 - home_follows);
        give(&update);
        fly(1);
        if (i > 1 && i < 10) {
            assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
        } else if (i > 11 && height_m > 20) {
            assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
        }
    }
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    assert_false(condition.armed);
}

static void native_alone_disarmed_high_in_the_air_it_is_in_distress(void **state)
{
    (void)state;
    fall_with_native_alone(0);
}

/* A home that follows a ship, or the aircraft itself: the height above it says nothing. */
static void native_alone_the_altitude_counts_not_a_home_that_moves(void **state)
{
    (void)state;
    fall_with_native_alone(1);
}

/* Telemetry that doesn't know where it took off leaves it to the native message. */
static void a_native_height_counts_where_telemetry_knows_none(void **state)
{
    struct telemetry_update update;

    (void)state;
    sim.armed = true; /* before the daemon began: take-off and home are unknown */
    sim.native = false;
    fly(3);
    for (unsigned i = 0; i < 4; i++) {
        update = native_of(now_us);
        update.location.height_m = 86 - 4 * i;
        update.location.vertical_speed_mps = -4;
        give(&update);
        sim.armed = false;
        fly(0.5);
    }
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
}

/* A plane that landed above its take-off point, on a ship, in a car: no distress. */
static void moved_after_landing_it_is_on_the_ground(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    sim.altitude_m += 60;
    fly(10);
    sim.north_mps = sim.up_mps = 0;
    landed(MAV_LANDED_STATE_ON_GROUND);
    arm(false);
    fly(5);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
    assert_false(condition.armed);
    sim.north_mps = 25;
    sim.up_mps = 2;
    fly(10);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

/* "On ground" for ever: it climbs away, and flies level. */
static void a_landed_state_that_stays_on_the_ground_is_not_believed(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    for (unsigned i = 0; i < 60; i++) {
        landed(MAV_LANDED_STATE_ON_GROUND);
        sim.up_mps = i < 20 ? 3 : 0;
        sim.altitude_m += sim.up_mps;
        sim.north_mps = i < 40 ? 20 : 0; /* and at the end it hovers */
        fly(1);
        assert_true(i < 10 || view.location.status == AIRCRAFT_AIRBORNE);
    }
    assert_true(condition.landed_state_wrong);
    landed(MAV_LANDED_STATE_IN_AIR); /* it moves after all: believed again */
    fly(1);
    assert_false(condition.landed_state_wrong);
    landed(MAV_LANDED_STATE_ON_GROUND);
    fly(1);
    assert_int_equal(view.location.status, AIRCRAFT_GROUND);
}

/* The same of one that is slow: it would stay "ground" at 15 m and at 100 m. */
static void a_slow_aircraft_flies_too(void **state)
{
    (void)state;
    for (unsigned climbs = 0; climbs < 2; climbs++) {
        begin();
        fly(5);
        arm(true);
        sim.altitude_m += 20;
        sim.north_mps = climbs ? 0 : 5;
        sim.up_mps = climbs ? 1 : 0;
        for (unsigned i = 0; i < 10; i++) {
            landed(MAV_LANDED_STATE_ON_GROUND);
            sim.altitude_m += sim.up_mps;
            fly(1);
            assert_true(i < 6 || view.location.status == AIRCRAFT_AIRBORNE);
        }
    }
}

/* "In air" for ever, by its landed state or the native status: it lies there, disarmed. */
static void a_landed_state_that_stays_in_the_air_is_not_believed(void **state)
{
    (void)state;
    for (unsigned with = 1; with < 4; with++) {
        begin();
        fly(5);
        arm(true);
        fly(20);
        sim.armed = false;
        for (unsigned i = 0; i < 40; i++) {
            struct telemetry_update update = native_of(now_us);

            update.location.speed_mps = update.location.vertical_speed_mps = 0;
            if (with & 1) {
                landed(MAV_LANDED_STATE_IN_AIR);
            }
            if (with & 2) {
                give(&update);
            }
            fly(1);
            assert_true(i > 25 || with == 2 || condition.armed);
        }
        assert_int_equal(view.location.status, AIRCRAFT_GROUND);
        assert_false(condition.armed);
        assert_int_equal(condition.landed_state_wrong, with & 1);
    }
}

/* After half a minute on the ground it was told that its landed state is wrong. */
static void who_says_no_landed_state_says_no_wrong_one(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 40; i++) {
        landed(MAV_LANDED_STATE_UNDEFINED);
        fly(1);
        assert_false(condition.landed_state_wrong);
    }
}

/* Disarmed by somebody's word, it flies on: what moves doesn't lie there. */
static void what_moves_is_in_the_air_as_it_says(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    sim.north_mps = 15;
    sim.armed = false;
    for (unsigned i = 0; i < 60; i++) {
        landed(MAV_LANDED_STATE_IN_AIR);
        fly(1);
    }
    assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    assert_true(condition.armed);
}

static void another_vehicle_starts_from_nothing(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    sim.native = sim.armed = true;
    fly(5);
    landed(MAV_LANDED_STATE_IN_AIR);
    update.heartbeat.new_vehicle = true;
    update.heartbeat.mav_type = MAV_TYPE_FIXED_WING;
    give(&update);
    look();
    assert_unknown(view.location.latitude_deg);
    assert_unknown(view.location.speed_mps);
    assert_false(view.location.position_fresh);
    assert_int_equal(view.location.status, AIRCRAFT_REMOTE_ID_FAILURE);
    assert_int_equal(condition.mav_type, MAV_TYPE_FIXED_WING);
    assert_true(condition.time_known); /* UTC is the same for all */
    assert_about((double)condition.unix_us, (double)(sim.utc_us + now_us), 20000);
}

/* Another station keeps them from us, or the link does, from before it was armed: an old "disarmed"
 * would open settings and updates in the air. */
static void without_heartbeats_what_flies_is_armed(void **state)
{
    (void)state;
    arm(false);
    fly(5);
    sim.heartbeat = false;
    fly(10);
    assert_false(condition.armed);
    sim.north_mps = 15; /* in a car, and the cable was out for a while */
    fly(1);
    sim.heartbeat = true;
    fly(5);
    assert_false(condition.armed);
    sim.heartbeat = false;
    fly(7);
    assert_true(condition.armed && condition.flies_unheard);
    sim.north_mps = 0;
    fly(30); /* it may be hovering */
    assert_true(condition.armed);
    sim.heartbeat = true;
    fly(2);
    assert_true(condition.armed && !condition.flies_unheard);
    fly(4);
    assert_false(condition.armed);
}

/* PX4 goes on for ten seconds with its receiver's last time; what lies crashed says the same again
 * and again. */
static void a_native_emergency_counts_without_a_time_that_moves(void **state)
{
    (void)state;
    for (unsigned with_time = 0; with_time < 2; with_time++) {
        struct telemetry_update update;

        begin();
        arm(true);
        fly(5);
        update = native_of(now_us);
        update.location.status = AIRCRAFT_EMERGENCY;
        if (!with_time) {
            update.location.timestamp_s = update.location.latitude_deg =
                update.location.longitude_deg = NAN;
        }
        for (unsigned i = 0; i < 20; i++) {
            give(&update);
            give(&update); /* one message, twice */
            fly(1);
            assert_int_equal(view.location.status, i ? AIRCRAFT_EMERGENCY : AIRCRAFT_AIRBORNE);
        }
        fly(3);
        assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
    }
}

static void a_crash_stands_where_its_autopilot_dies_of_it(void **state)
{
    (void)state;
    fly_and_crash();
    silence_us(60 * SECOND);
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
}

/* From a hill, or where it took off isn't known: "on ground" by its landed state, and armed ended
 * while it fell. */
static void disarmed_high_it_is_in_distress_wherever_it_took_off(void **state)
{
    (void)state;
    for (unsigned known = 0; known < 2; known++) {
        begin();
        sim.fix_type = known ? 3 : 1;
        fly(5);
        arm(true);
        fly(5);
        sim.fix_type = 3;
        sim.relative_m = known ? -80 : 120;
        sim.altitude_m += sim.relative_m;
        sim.north_mps = 15;
        for (unsigned i = 0; i < 10; i++) {
            landed(MAV_LANDED_STATE_IN_AIR);
            fly(1);
        }
        assert_int_equal(condition.takeoff_known, known);
        for (unsigned i = 0; i < 10; i++) { /* it flies on, and is stuck */
            landed(MAV_LANDED_STATE_ON_GROUND);
            fly(1);
        }
        assert_int_equal(view.location.status, AIRCRAFT_AIRBORNE);
        sim.armed = false;
        sim.up_mps = -4;
        for (unsigned i = 0; i < 10; i++) {
            sim.altitude_m -= 4;
            sim.relative_m -= 4;
            landed(MAV_LANDED_STATE_ON_GROUND);
            fly(1);
            assert_true(i == 0 || view.location.status == AIRCRAFT_EMERGENCY);
            assert_true(condition.armed);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(the_armed_bit_decides_without_a_landed_state, begin_setup),
        cmocka_unit_test_setup(a_landed_state_wins_over_the_armed_bit, begin_setup),
        cmocka_unit_test_setup(a_landed_state_that_stopped_gives_way_to_the_armed_bit, begin_setup),
        cmocka_unit_test_setup(an_emergency_is_said_and_over_when_it_is_over, begin_setup),
        cmocka_unit_test_setup(an_emergency_without_a_position_is_an_emergency, begin_setup),
        cmocka_unit_test_setup(in_doubt_it_falls_as_well, begin_setup),
        cmocka_unit_test_setup(a_crash_that_is_only_said_is_none, begin_setup),
        cmocka_unit_test_setup(hardware_in_the_loop_is_known_as_such, begin_setup),
        cmocka_unit_test_setup(in_doubt_one_word_is_no_emergency, begin_setup),
        cmocka_unit_test_setup(what_lies_there_disarmed_does_not_crash, begin_setup),
        cmocka_unit_test_setup(a_crash_is_an_emergency_until_it_is_armed_again, begin_setup),
        cmocka_unit_test_setup(a_lost_heartbeat_is_a_remote_id_failure_after_3_s, begin_setup),
        cmocka_unit_test_setup(a_lost_heartbeat_keeps_a_position_that_still_comes, begin_setup),
        cmocka_unit_test_setup(the_first_seconds_are_no_failure_yet, begin_setup),
        cmocka_unit_test_setup(a_native_status_wins_while_it_is_fresh, begin_setup),
        cmocka_unit_test_setup(a_native_emergency_is_said_without_a_position, begin_setup),
        cmocka_unit_test_setup(an_emergency_counts_from_whichever_source, begin_setup),
        cmocka_unit_test_setup(disarmed_high_in_the_air_it_is_in_distress, begin_setup),
        cmocka_unit_test_setup(native_alone_disarmed_high_in_the_air_it_is_in_distress,
                               begin_setup),
        cmocka_unit_test_setup(native_alone_the_altitude_counts_not_a_home_that_moves, begin_setup),
        cmocka_unit_test_setup(a_native_height_counts_where_telemetry_knows_none, begin_setup),
        cmocka_unit_test_setup(moved_after_landing_it_is_on_the_ground, begin_setup),
        cmocka_unit_test_setup(a_landed_state_that_stays_on_the_ground_is_not_believed,
                               begin_setup),
        cmocka_unit_test_setup(a_slow_aircraft_flies_too, begin_setup),
        cmocka_unit_test_setup(who_says_no_landed_state_says_no_wrong_one, begin_setup),
        cmocka_unit_test_setup(a_landed_state_that_stays_in_the_air_is_not_believed, begin_setup),
        cmocka_unit_test_setup(without_heartbeats_what_flies_is_armed, begin_setup),
        cmocka_unit_test_setup(a_native_emergency_counts_without_a_time_that_moves, begin_setup),
        cmocka_unit_test_setup(a_crash_stands_where_its_autopilot_dies_of_it, begin_setup),
        cmocka_unit_test_setup(disarmed_high_it_is_in_distress_wherever_it_took_off, begin_setup),
        cmocka_unit_test_setup(what_moves_is_in_the_air_as_it_says, begin_setup),
        cmocka_unit_test_setup(another_vehicle_starts_from_nothing, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, status", tests, NULL, NULL);
}
