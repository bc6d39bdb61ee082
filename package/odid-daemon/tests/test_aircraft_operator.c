/* The System message: where the operator is, classification, area. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "flight.h"

#define LIVE MAV_ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS

static uint32_t seconds_2019(void)
{
    return (uint32_t)((sim.utc_us + now_us) / SECOND - INT64_C(1546300800));
}

static struct telemetry_update system_message(enum telemetry_kind kind)
{
    struct telemetry_update update = update_of(kind);

    update.system.operator_location_type = LIVE;
    update.system.classification_type = 1;
    update.system.category_eu = 1;
    update.system.class_eu = 3;
    update.system.operator_latitude_deg = 50;
    update.system.operator_longitude_deg = 10;
    update.system.operator_altitude_m = 70;
    update.system.area_count = 3;
    update.system.area_radius_m = 200;
    update.system.area_ceiling_m = 120;
    update.system.area_floor_m = 10;
    update.system.timestamp_2019_s = seconds_2019();
    if (kind == TELEMETRY_SYSTEM_UPDATE) {
        update.system.operator_location_type = 0;
        update.system.classification_type = 0;
        update.system.category_eu = update.system.class_eu = 0;
        update.system.area_count = update.system.area_radius_m = 0;
        update.system.operator_latitude_deg = 51;
    }
    return update;
}

static void send_system(enum telemetry_kind kind)
{
    struct telemetry_update update = system_message(kind);

    give(&update);
    look();
}

static bool operator_is(double latitude_deg)
{
    return fabs(view.system.operator_latitude_deg - latitude_deg) < 1e-9;
}

static void a_native_operator_location_wins_while_fresh(void **state)
{
    (void)state;
    config.operator_latitude_deg = 40;
    config.operator_longitude_deg = 9;
    config.operator_altitude_m = 30;
    config.operator_location_type = 2;
    fly(5);
    assert_true(operator_is(40));
    assert_int_equal(view.system.operator_source, SOURCE_CONFIGURATION);
    assert_int_equal(view.system.operator_location_type, 2);
    assert_near(view.system.operator_altitude_m, 30);
    arm(true);
    look();
    assert_true(operator_is(57.7089));
    assert_int_equal(view.system.operator_location_type, 0);
    send_system(TELEMETRY_SYSTEM);
    assert_true(operator_is(50));
    assert_near(view.system.operator_longitude_deg, 10);
    assert_near(view.system.operator_altitude_m, 70);
    assert_int_equal(view.system.operator_source, SOURCE_NATIVE);
    assert_int_equal(view.system.operator_location_type, LIVE);
    fly(2.8);
    silence_us(199 * MS);
    assert_true(operator_is(50));
    silence_us(1 * MS);
    assert_true(operator_is(57.7089)); /* the take-off point again */
    assert_int_equal(view.system.operator_location_type, 0);
    send_system(TELEMETRY_SYSTEM);
    assert_true(operator_is(50));
}

static void an_update_moves_the_operator_and_nothing_else(void **state)
{
    (void)state;
    fly(5);
    send_system(TELEMETRY_SYSTEM);
    for (unsigned i = 0; i < 10; i++) {
        fly(1);
        send_system(TELEMETRY_SYSTEM_UPDATE);
        assert_true(operator_is(51));
        assert_int_equal(view.system.operator_location_type, LIVE);
        assert_int_equal(view.system.category_eu, 1);
        assert_int_equal(view.system.class_eu, 3);
        assert_int_equal(view.system.area_count, 3);
        assert_int_equal(view.system.area_radius_m, 200);
        assert_near(view.system.area_ceiling_m, 120);
        assert_near(view.system.area_floor_m, 10);
        assert_int_equal(view.system.timestamp_2019_s, seconds_2019());
    }
}

/* mavlink-router may hide the addressed SYSTEM from us, and not the update. */
static void an_update_alone_is_a_moving_operator(void **state)
{
    (void)state;
    fly(5);
    send_system(TELEMETRY_SYSTEM_UPDATE);
    assert_true(operator_is(51));
    assert_int_equal(view.system.operator_location_type, LIVE);
    assert_int_equal(view.system.operator_source, SOURCE_NATIVE);
    assert_int_equal(view.system.category_eu, config.category);
    assert_int_equal(view.system.area_count, 1);
    assert_unknown(view.system.operator_altitude_m); /* metres or ArduPilot's centimetres? */
}

static void an_operator_message_with_a_frozen_timestamp_goes_stale(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    for (unsigned i = 0; i < 3; i++) {
        give(&update);
        look();
        assert_true(operator_is(50));
        fly(1);
    }
    give(&update);
    look();
    assert_unknown(view.system.operator_latitude_deg);
}

/* 0 stands for an unknown time: then that it comes again counts. */
static void an_operator_message_without_a_timestamp_counts_while_it_comes(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    update.system.timestamp_2019_s = 0;
    for (unsigned i = 0; i < 6; i++) {
        give(&update);
        look();
        assert_true(operator_is(50));
        fly(1);
    }
    fly(3);
    assert_unknown(view.system.operator_latitude_deg);
}

/* ArduPilot without a ground station: operator 0,0. Unknown, not a place. */
static void an_unknown_native_operator_is_no_place(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    update.system.operator_latitude_deg = update.system.operator_longitude_deg = NAN;
    give(&update);
    look();
    assert_unknown(view.system.operator_latitude_deg);
    assert_unknown(view.system.operator_longitude_deg);
    assert_unknown(view.system.operator_altitude_m);
    arm(true);
    look();
    assert_true(operator_is(57.7089));
}

static void an_unknown_operator_is_never_a_made_up_default(void **state)
{
    (void)state;
    fly(60);
    assert_unknown(view.system.operator_latitude_deg);
    assert_unknown(view.system.operator_longitude_deg);
    assert_unknown(view.system.operator_altitude_m);
    assert_int_equal(view.system.operator_source, SOURCE_NONE);
}

/* Centimetres in a metre field: the field is dropped, not the message. */
static void ardupilots_substituted_operator_altitude_is_dropped(void **state)
{
    (void)state;
    for (unsigned px4 = 0; px4 < 2; px4++) {
        for (uint8_t type = 0; type <= 2; type++) {
            struct telemetry_update update;

            begin();
            sim.autopilot = px4 ? MAV_AUTOPILOT_PX4 : MAV_AUTOPILOT_ARDUPILOTMEGA;
            fly(5);
            update = system_message(TELEMETRY_SYSTEM);
            update.system.operator_location_type = type;
            give(&update);
            look();
            assert_true(operator_is(50));
            assert_int_equal(isnan(view.system.operator_altitude_m), !px4 && type == 0);
            fly(1);
            send_system(TELEMETRY_SYSTEM_UPDATE);
            assert_true(operator_is(51));
            assert_int_equal(isnan(view.system.operator_altitude_m), !px4 && type == 0);
        }
    }
}

static void the_system_timestamp_is_that_of_the_operators_place(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    assert_int_equal(view.system.timestamp_2019_s, seconds_2019());
    update = system_message(TELEMETRY_SYSTEM);
    update.system.timestamp_2019_s = 12345;
    give(&update);
    look();
    assert_int_equal(view.system.timestamp_2019_s, 12345);
    fly(3);
    assert_int_equal(view.system.timestamp_2019_s, seconds_2019());
}

/* ---- classification and area ---- */

static void a_configured_classification_wins(void **state)
{
    (void)state;
    config.classification_set = true;
    config.classification_type = 1;
    config.category = 2;
    config.class_eu = 5;
    fly(5);
    send_system(TELEMETRY_SYSTEM);
    assert_int_equal(view.system.classification_type, 1);
    assert_int_equal(view.system.category_eu, 2);
    assert_int_equal(view.system.class_eu, 5);
}

static void a_native_classification_fills_what_is_not_configured(void **state)
{
    (void)state;
    fly(5);
    assert_int_equal(view.system.classification_type, 1);
    assert_int_equal(view.system.category_eu, 0);
    assert_int_equal(view.system.class_eu, 0);
    send_system(TELEMETRY_SYSTEM);
    assert_int_equal(view.system.category_eu, 1);
    assert_int_equal(view.system.class_eu, 3);
    fly(60); /* identity doesn't go stale */
    assert_int_equal(view.system.category_eu, 1);
}

static void one_aircraft_and_no_area_is_the_default(void **state)
{
    (void)state;
    fly(5);
    assert_int_equal(view.system.area_count, 1);
    assert_int_equal(view.system.area_radius_m, 0);
    assert_unknown(view.system.area_ceiling_m);
    assert_unknown(view.system.area_floor_m);
}

static void a_native_area_count_of_0_is_one_aircraft(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    update.system.area_count = 0;
    give(&update);
    look();
    assert_int_equal(view.system.area_count, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_native_operator_location_wins_while_fresh, begin_setup),
        cmocka_unit_test_setup(an_update_moves_the_operator_and_nothing_else, begin_setup),
        cmocka_unit_test_setup(an_update_alone_is_a_moving_operator, begin_setup),
        cmocka_unit_test_setup(an_operator_message_with_a_frozen_timestamp_goes_stale, begin_setup),
        cmocka_unit_test_setup(an_operator_message_without_a_timestamp_counts_while_it_comes,
                               begin_setup),
        cmocka_unit_test_setup(an_unknown_native_operator_is_no_place, begin_setup),
        cmocka_unit_test_setup(an_unknown_operator_is_never_a_made_up_default, begin_setup),
        cmocka_unit_test_setup(ardupilots_substituted_operator_altitude_is_dropped, begin_setup),
        cmocka_unit_test_setup(the_system_timestamp_is_that_of_the_operators_place, begin_setup),
        cmocka_unit_test_setup(a_configured_classification_wins, begin_setup),
        cmocka_unit_test_setup(a_native_classification_fills_what_is_not_configured, begin_setup),
        cmocka_unit_test_setup(one_aircraft_and_no_area_is_the_default, begin_setup),
        cmocka_unit_test_setup(a_native_area_count_of_0_is_one_aircraft, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, System", tests, NULL, NULL);
}
