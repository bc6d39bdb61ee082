/* The take-off point: frozen at arming, and the height above it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

static void before_arming_the_height_is_the_autopilots(void **state)
{
    (void)state;
    sim.relative_m = 12.5;
    fly(5);
    assert_near(view.location.height_m, 12.5);
    assert_false(view.location.height_above_ground);
    assert_false(condition.takeoff_known);
    assert_unknown(view.system.operator_latitude_deg);
}

static void the_height_is_above_the_point_of_arming(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    sim.altitude_m = 184;
    sim.relative_m = 555; /* no longer asked */
    fly(1);
    assert_near(view.location.height_m, 100);
    assert_true(condition.takeoff_known);
    sim.altitude_m = 64;
    fly(1);
    assert_near(view.location.height_m, -20);
}

static void home_moved_in_flight_changes_nothing(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    fly(1);
    sim.altitude_m = 184;
    home(40, 150);
    sim.relative_m = 34;
    fly(1);
    assert_near(view.location.height_m, 100);
    assert_near(view.system.operator_latitude_deg, 57.7089);
    assert_false(condition.takeoff_is_home);
}

static void the_takeoff_point_stays_while_the_aircraft_moves_on(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    sim.latitude_deg += 0.1;
    sim.longitude_deg -= 0.1;
    sim.altitude_m += 100;
    fly(10);
    assert_near(view.system.operator_latitude_deg, 57.7089);
    assert_near(view.system.operator_longitude_deg, 11.9746);
    assert_near(view.system.operator_altitude_m, 84 + 36.4);
    assert_int_equal(view.system.operator_location_type, 0);
    assert_int_equal(view.system.operator_source, SOURCE_TELEMETRY);
}

static void the_takeoff_point_outlives_landing_and_is_released_at_the_next_arming(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    fly(60);
    arm(false);
    sim.latitude_deg += 0.1;
    sim.altitude_m = 94;
    fly(60);
    assert_near(view.system.operator_latitude_deg, 57.7089);
    assert_near(view.location.height_m, 10);
    arm(true);
    fly(1);
    assert_near(view.system.operator_latitude_deg, 57.8089);
    assert_near(view.location.height_m, 0);
}

static void only_the_edge_of_arming_freezes(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    for (unsigned i = 0; i < 10; i++) {
        sim.altitude_m += 10;
        fly(1); /* armed heartbeats go on */
    }
    assert_near(view.location.height_m, 100);
}

/* A fix that comes soon after the edge is still the place; a later one isn't. */
static void a_fix_within_3_s_after_arming_serves(void **state)
{
    (void)state;
    sim.position = false;
    fly(5);
    arm(true);
    fly(2.8);
    sim.position = true;
    fly(0.2);
    assert_false(condition.takeoff_known); /* 3.000 s */

    begin();
    sim.position = false;
    fly(5);
    arm(true);
    fly(2.6);
    sim.position = true;
    fly(0.2);
    assert_true(condition.takeoff_known);
    assert_near(view.location.height_m, 0);
}

static void armed_without_a_position_neither_height_nor_operator_is_invented(void **state)
{
    (void)state;
    sim.position = false;
    fly(5);
    arm(true);
    fly(5);
    sim.position = true;
    sim.relative_m = 50;
    fly(5);
    assert_false(condition.takeoff_known);
    assert_unknown(view.location.height_m);
    assert_unknown(view.system.operator_latitude_deg);
}

static void a_stale_position_at_arming_is_no_takeoff_point(void **state)
{
    (void)state;
    fly(5);
    sim.position = false;
    fly(3);
    arm(true);
    fly(10);
    assert_false(condition.takeoff_known);
}

/* And it stands there for a minute, by its landed state. */
static void arm_without_a_fix(void)
{
    sim.fix_type = 1;
    fly(5);
    arm(true);
    for (unsigned i = 0; i < 60; i++) {
        landed(MAV_LANDED_STATE_ON_GROUND);
        fly(1);
    }
}

/* Its landed state says that it hasn't left: then where it is, is where it takes off. */
static void the_first_fix_on_the_ground_stands_in_and_is_said_to(void **state)
{
    (void)state;
    arm_without_a_fix();
    assert_false(condition.takeoff_known);
    assert_false(condition.fix_known);
    sim.fix_type = 3;
    landed(MAV_LANDED_STATE_ON_GROUND);
    fly(1.2);
    assert_true(condition.takeoff_known);
    assert_true(condition.takeoff_is_late);
    assert_false(condition.takeoff_is_home);
    sim.altitude_m += 20;
    landed(MAV_LANDED_STATE_IN_AIR);
    fly(1);
    assert_near(view.location.height_m, 20);
    assert_near(view.system.operator_latitude_deg, 57.7089);
    arm(false);
    fly(10);
    sim.altitude_m -= 20;
    arm(true);
    fly(1);
    assert_false(condition.takeoff_is_late);
}

static void once_it_has_left_the_ground_home_stands_in(void **state)
{
    (void)state;
    sim.fix_type = 1;
    fly(5);
    arm(true);
    for (unsigned i = 0; i < 4; i++) {
        landed(MAV_LANDED_STATE_ON_GROUND);
        fly(1);
    }
    home(57.6, 70);
    fly(1);
    assert_false(condition.takeoff_known);
    landed(MAV_LANDED_STATE_IN_AIR);
    sim.fix_type = 3;
    sim.altitude_m = 90;
    fly(2);
    assert_true(condition.takeoff_is_home);
    assert_near(view.location.height_m, 20);
    assert_near(view.system.operator_latitude_deg, 57.6);
}

static void armed_again_in_the_air_the_takeoff_point_stays(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    sim.altitude_m += 50;
    sim.latitude_deg += 0.01;
    sim.north_mps = 15;
    fly(5);
    arm(false);
    fly(10);
    arm(true);
    fly(1);
    assert_near(view.location.height_m, 50);
    assert_near(view.system.operator_latitude_deg, 57.7089);
}

/* Minutes after landing, aboard a boat that goes faster than some aircraft. */
static void another_flight_from_something_fast_has_its_own_point(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    fly(30);
    arm(false);
    fly(120);
    sim.latitude_deg += 0.01;
    sim.altitude_m = 64;
    sim.north_mps = 12;
    fly(5);
    arm(true);
    fly(1);
    assert_near(view.system.operator_latitude_deg, 57.7189);
    assert_near(view.location.height_m, 0);
}

/* ---- armed before our time ---- */

static void armed_before_start_the_kept_point_serves(void **state)
{
    const struct kept_takeoff kept = {.known = true,
                                      .latitude_deg = 57.1,
                                      .longitude_deg = 11.1,
                                      .altitude_msl_m = 34,
                                      .altitude_geodetic_m = 70.4};

    (void)state;
    aircraft_restore_takeoff(aircraft, &kept);
    sim.armed = true;
    fly(5);
    home(40, 10);
    fly(1);
    assert_near(view.location.height_m, 50);
    assert_near(view.system.operator_latitude_deg, 57.1);
    assert_near(view.system.operator_altitude_m, 70.4);
    assert_memory_equal(aircraft_takeoff(aircraft), &kept, sizeof(kept));
}

static void the_kept_point_is_not_used_when_arming_is_seen(void **state)
{
    const struct kept_takeoff kept = {.known = true, .latitude_deg = 57.1};

    (void)state;
    aircraft_restore_takeoff(aircraft, &kept);
    fly(5);
    assert_false(condition.takeoff_known);
    arm(true);
    fly(1);
    assert_near(view.system.operator_latitude_deg, 57.7089);
}

static void armed_before_start_the_first_home_stands_in(void **state)
{
    (void)state;
    sim.armed = true;
    fly(5);
    assert_unknown(view.location.height_m);
    assert_unknown(view.system.operator_latitude_deg);
    home(NAN, 10);
    fly(1);
    assert_false(condition.takeoff_known);
    home(57.2, 24);
    fly(1);
    assert_true(condition.takeoff_known);
    assert_true(condition.takeoff_is_home);
    assert_near(view.location.height_m, 60);
    assert_near(view.system.operator_latitude_deg, 57.2);
    assert_near(view.system.operator_altitude_m, 24 + 36.4);
    home(57.3, 25); /* moved in flight */
    fly(1);
    assert_near(view.system.operator_latitude_deg, 57.2);
    assert_near(view.location.height_m, 60);
}

/* Disarmed, the autopilot's home follows the aircraft: it is no take-off point any more. */
static void home_after_landing_does_not_stand_in(void **state)
{
    (void)state;
    sim.armed = true;
    fly(5);
    arm(false);
    fly(4);
    home(57.2, 24);
    fly(1);
    assert_false(condition.takeoff_known);
}

static void home_before_arming_is_no_takeoff_point(void **state)
{
    (void)state;
    fly(5);
    home(57.2, 24);
    fly(1);
    assert_false(condition.takeoff_known);
    assert_unknown(view.system.operator_latitude_deg);
}

/* The link was lost on the ground and is back in the air: not here did it take off. */
static void arming_that_nobody_heard_freezes_nothing(void **state)
{
    (void)state;
    fly(5);
    silence_us(60 * SECOND);
    sim.armed = true;
    sim.altitude_m = 184;
    sim.relative_m = 100;
    fly(5);
    assert_false(condition.takeoff_known);
    assert_unknown(view.location.height_m);
    assert_unknown(view.system.operator_latitude_deg);
    home(57.2, 84);
    fly(1);
    assert_near(view.location.height_m, 100);
    assert_true(condition.takeoff_is_home);
    arm(false);
    fly(5);
    arm(true);
    fly(1);
    assert_false(condition.takeoff_is_home);
    assert_near(view.location.height_m, 0);
}

static void a_lost_link_in_flight_keeps_the_takeoff_point(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    fly(5);
    silence_us(60 * SECOND);
    sim.altitude_m = 184;
    fly(5);
    assert_near(view.location.height_m, 100);
}

static void an_autopilot_restarted_in_flight_keeps_it_until_it_arms_again(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    fly(5);
    sim.boot_at_us = now_us;
    sim.armed = false;
    sim.altitude_m = 184;
    fly(2);
    assert_int_equal(condition.autopilot_restarts, 1);
    assert_near(view.location.height_m, 100);
}

/* ---- with native messages ---- */

static void a_native_height_wins_and_telemetry_knows_its_own_afterwards(void **state)
{
    (void)state;
    sim.native = true;
    fly(5);
    arm(true);
    fly(5);
    assert_near(view.location.height_m, 3);
    sim.native = false;
    sim.altitude_m = 184;
    fly(5);
    assert_near(view.location.height_m, 100);
}

/* Above a home that was moved, above the sea, in feet: not above where it took off. */
static void a_native_height_that_contradicts_the_altitudes_is_not_broadcast(void **state)
{
    (void)state;
    sim.native = true;
    fly(5);
    arm(true);
    fly(5);
    assert_near(view.location.height_m, 3);
    sim.altitude_m = 184; /* and the native one stays 3 */
    fly(15);
    assert_near(view.location.height_m, 100);
}

/* Native messages alone: the height in them is above a home that the autopilot moves in flight. */
static void give_native(double altitude_geodetic_m, double height_m, uint8_t reference)
{
    struct telemetry_update update = native_of(now_us);

    update.location.altitude_geodetic_m = altitude_geodetic_m;
    update.location.height_m = height_m;
    update.location.height_reference = reference;
    give(&update);
    fly(1);
}

static void take_off_with_native_alone(void)
{
    sim.position = false;
    give_native(125, 0, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    arm(true);
    give_native(125, 0, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
}

static void with_native_alone_no_height_is_above_a_home_that_was_moved(void **state)
{
    (void)state;
    take_off_with_native_alone();
    give_native(205, 79, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF); /* as it is said, while it is right */
    assert_near(view.location.height_m, 79);
    give_native(205, 4, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    assert_near(view.location.height_m, 80);
    assert_false(view.location.height_above_ground);
    give_native(205, 66, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    assert_near(view.location.height_m, 66);
    give_native(205, NAN, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    assert_near(view.location.height_m, 80);
}

static void what_is_above_the_ground_is_held_against_no_take_off(void **state)
{
    (void)state;
    take_off_with_native_alone();
    give_native(205, 4, MAV_ODID_HEIGHT_REF_OVER_GROUND);
    assert_near(view.location.height_m, 4);
    assert_true(view.location.height_above_ground);
}

/* Telemetry has shown that the native altitude is wrong: it proves nothing of the height, then. */
static void nor_is_a_height_against_an_altitude_that_is_not_believed(void **state)
{
    (void)state;
    give_native(80, 0, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    arm(true);
    fly(1);
    give_native(80, 0, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    assert_true(condition.altitudes_differ);
    sim.position = false;
    for (unsigned i = 0; i < 5; i++) {
        give_native(80, 3 + i, MAV_ODID_HEIGHT_REF_OVER_TAKEOFF);
    }
    assert_true(from_native());
    assert_near(view.location.height_m, 7);
}

static void a_native_position_alone_freezes_a_takeoff_point(void **state)
{
    (void)state;
    sim.position = false;
    sim.native = true;
    fly(5);
    arm(true);
    fly(5);
    assert_near(view.system.operator_latitude_deg, 58.7089);
    assert_near(view.system.operator_altitude_m, 125);
}

static void the_height_above_ground_is_said_to_be(void **state)
{
    struct telemetry_update update;

    (void)state;
    sim.native = true;
    fly(5);
    sim.native = false;
    fly(0.2);
    update = native_of(now_us);
    update.location.height_reference = MAV_ODID_HEIGHT_REF_OVER_GROUND;
    give(&update);
    look();
    assert_true(view.location.height_above_ground);
    fly(3);
    assert_false(view.location.height_above_ground);
}

static void another_vehicle_inherits_no_takeoff_point(void **state)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    (void)state;
    fly(5);
    arm(true);
    fly(5);
    update.heartbeat.new_vehicle = true;
    update.heartbeat.mav_type = MAV_TYPE_FIXED_WING;
    give(&update);
    look();
    assert_false(condition.takeoff_known);
    assert_unknown(view.location.latitude_deg);
    sim.armed = false;
    fly(4);
    assert_false(condition.armed);
}

/* "On ground" by a landed state that is stuck: the first fix came in the air, and was the take-off
 * point. */
static void the_first_fix_in_the_air_is_no_take_off(void **state)
{
    (void)state;
    for (unsigned level = 0; level < 2; level++) {
        begin();
        arm_without_a_fix();
        sim.relative_m = 100;
        sim.north_mps = 15;
        sim.up_mps = level ? 0 : 2;
        sim.fix_type = 3;
        for (unsigned i = 0; i < 10; i++) {
            landed(MAV_LANDED_STATE_ON_GROUND);
            fly(1);
            assert_false(condition.takeoff_known);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(before_arming_the_height_is_the_autopilots, begin_setup),
        cmocka_unit_test_setup(the_height_is_above_the_point_of_arming, begin_setup),
        cmocka_unit_test_setup(home_moved_in_flight_changes_nothing, begin_setup),
        cmocka_unit_test_setup(the_takeoff_point_stays_while_the_aircraft_moves_on, begin_setup),
        cmocka_unit_test_setup(
            the_takeoff_point_outlives_landing_and_is_released_at_the_next_arming, begin_setup),
        cmocka_unit_test_setup(only_the_edge_of_arming_freezes, begin_setup),
        cmocka_unit_test_setup(a_fix_within_3_s_after_arming_serves, begin_setup),
        cmocka_unit_test_setup(armed_without_a_position_neither_height_nor_operator_is_invented,
                               begin_setup),
        cmocka_unit_test_setup(a_stale_position_at_arming_is_no_takeoff_point, begin_setup),
        cmocka_unit_test_setup(the_first_fix_on_the_ground_stands_in_and_is_said_to, begin_setup),
        cmocka_unit_test_setup(the_first_fix_in_the_air_is_no_take_off, begin_setup),
        cmocka_unit_test_setup(once_it_has_left_the_ground_home_stands_in, begin_setup),
        cmocka_unit_test_setup(armed_again_in_the_air_the_takeoff_point_stays, begin_setup),
        cmocka_unit_test_setup(another_flight_from_something_fast_has_its_own_point, begin_setup),
        cmocka_unit_test_setup(armed_before_start_the_kept_point_serves, begin_setup),
        cmocka_unit_test_setup(the_kept_point_is_not_used_when_arming_is_seen, begin_setup),
        cmocka_unit_test_setup(armed_before_start_the_first_home_stands_in, begin_setup),
        cmocka_unit_test_setup(home_after_landing_does_not_stand_in, begin_setup),
        cmocka_unit_test_setup(home_before_arming_is_no_takeoff_point, begin_setup),
        cmocka_unit_test_setup(arming_that_nobody_heard_freezes_nothing, begin_setup),
        cmocka_unit_test_setup(a_lost_link_in_flight_keeps_the_takeoff_point, begin_setup),
        cmocka_unit_test_setup(an_autopilot_restarted_in_flight_keeps_it_until_it_arms_again,
                               begin_setup),
        cmocka_unit_test_setup(a_native_height_wins_and_telemetry_knows_its_own_afterwards,
                               begin_setup),
        cmocka_unit_test_setup(a_native_height_that_contradicts_the_altitudes_is_not_broadcast,
                               begin_setup),
        cmocka_unit_test_setup(a_native_position_alone_freezes_a_takeoff_point, begin_setup),
        cmocka_unit_test_setup(with_native_alone_no_height_is_above_a_home_that_was_moved,
                               begin_setup),
        cmocka_unit_test_setup(what_is_above_the_ground_is_held_against_no_take_off, begin_setup),
        cmocka_unit_test_setup(nor_is_a_height_against_an_altitude_that_is_not_believed,
                               begin_setup),
        cmocka_unit_test_setup(the_height_above_ground_is_said_to_be, begin_setup),
        cmocka_unit_test_setup(another_vehicle_inherits_no_takeoff_point, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, take-off point and height", tests, NULL, NULL);
}
