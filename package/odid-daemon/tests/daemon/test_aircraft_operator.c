/* The System message: where the operator is, classification, area. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "flight.h"

#define PILOTS_STATION (255 << 8 | 190)
#define ANOTHER_STATION (200 << 8 | 190)
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
    fly(9.8);
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
    assert_near(view.system.operator_altitude_m, 70);
}

static void an_operator_message_with_a_frozen_timestamp_goes_stale(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    for (unsigned i = 0; i < 10; i++) {
        give(&update);
        look();
        assert_true(operator_is(50));
        fly(1);
    }
    give(&update);
    look();
    assert_unknown(view.system.operator_latitude_deg);
}

/* A station whose clock stands, and who walks: it lives. */
static void an_operator_who_moves_counts_whatever_the_timestamp(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    for (unsigned i = 0; i < 20; i++) {
        update.system.operator_latitude_deg += 0.00001;
        give(&update);
        look();
        assert_true(operator_is(update.system.operator_latitude_deg));
        fly(1);
    }
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
    fly(9);
    assert_unknown(view.system.operator_latitude_deg);
}

/* A ground station that tells it every 3.5 s: live GNSS all the time, not now and then take-off. */
static void who_tells_seldom_is_not_interrupted_by_the_takeoff_point(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    for (unsigned i = 0; i < 350; i++) {
        if (i % 35 == 0) {
            send_system(TELEMETRY_SYSTEM);
        }
        fly(0.1);
        assert_true(operator_is(50));
        assert_int_equal(view.system.operator_location_type, LIVE);
    }
}

/* ArduPilot without a ground station: operator 0,0. Unknown, not a place. */
static void an_unknown_native_operator_is_no_place(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    update.system.operator_latitude_deg = update.system.operator_longitude_deg = NAN;
    fly(10); /* a word without a place takes none back: that it isn't said any more does */
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

/* An operator stands on Earth: what is no altitude there is dropped, not the place. */
static void an_operator_altitude_has_to_be_one(void **state)
{
    static const struct {
        double altitude_m;
        bool plausible;
    } cases[] = {{-430, true},  {0, true},      {70, true},     {8848, true},
                 {-501, false}, {12300, false}, {31767, false}, {NAN, false}};

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        for (uint8_t type = 0; type <= 2; type++) {
            struct telemetry_update update = system_message(TELEMETRY_SYSTEM);

            fly(1);
            update.system.operator_location_type = type;
            update.system.operator_altitude_m = cases[i].altitude_m;
            update.system.timestamp_2019_s = seconds_2019();
            give(&update);
            look();
            assert_true(operator_is(50));
            assert_int_equal(view.system.operator_location_type, type);
            if (cases[i].plausible) {
                assert_near(view.system.operator_altitude_m, cases[i].altitude_m);
            } else {
                assert_unknown(view.system.operator_altitude_m);
            }
        }
    }
}

/* 3 is no type of the standard: what was said before stands. */
static void an_operator_location_of_no_known_type_is_not_called_takeoff(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    for (unsigned type = 3; type <= 255; type++) {
        update = system_message(TELEMETRY_SYSTEM);
        update.system.operator_location_type = (uint8_t)type;
        give(&update);
        look();
        assert_true(operator_is(50));
        assert_int_equal(view.system.operator_location_type, LIVE);
    }
}

/* 0, an hour ahead, and MAVProxy's epoch, which is 11 hours ahead. */
static void the_autopilots_time_wins_over_the_ground_stations(void **state)
{
    static const int64_t ahead_s[] = {3600, 39600, -86400, 6};
    struct telemetry_update update;

    (void)state;
    fly(5);
    assert_int_equal(view.system.timestamp_2019_s, seconds_2019());
    for (size_t i = 0; i < sizeof(ahead_s) / sizeof(ahead_s[0]); i++) {
        fly(1);
        update = system_message(TELEMETRY_SYSTEM);
        update.system.timestamp_2019_s = (uint32_t)(seconds_2019() + ahead_s[i]);
        give(&update);
        look();
        assert_true(operator_is(50));
        assert_int_equal(view.system.timestamp_2019_s, seconds_2019());
        assert_int_equal(condition.operator_ahead_s, ahead_s[i]);
    }
    update.system.timestamp_2019_s = 0;
    give(&update);
    look();
    assert_int_equal(view.system.timestamp_2019_s, seconds_2019());
    assert_int_equal(condition.operator_ahead_s, 0);

    begin(); /* nobody gives time but the aircraft */
    sim.time = false;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    give(&update);
    look();
    assert_int_equal(view.system.timestamp_2019_s, 0);
    assert_int_equal(condition.operator_ahead_s, 0);
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

static void a_ceiling_under_its_floor_is_none(void **state)
{
    struct telemetry_update update;

    (void)state;
    fly(5);
    update = system_message(TELEMETRY_SYSTEM);
    update.system.area_floor_m = 121;
    give(&update);
    look();
    assert_unknown(view.system.area_ceiling_m);
    assert_unknown(view.system.area_floor_m);
    assert_true(condition.area_upside_down);
    update.system.area_floor_m = NAN;
    give(&update);
    look();
    assert_near(view.system.area_ceiling_m, 120);
    assert_false(condition.area_upside_down);
}

/* ---- two voices ---- */

/* speaker 0: the vehicle's own. */
static void say_as(uint16_t speaker, uint8_t location_type, double latitude_deg)
{
    struct telemetry_update update = system_message(TELEMETRY_SYSTEM);

    update.by_another = speaker != 0;
    update.speaker = speaker;
    update.system.operator_location_type = location_type;
    update.system.operator_latitude_deg = latitude_deg;
    give(&update);
    look();
}

static void say(bool by_another, uint8_t location_type, double latitude_deg)
{
    say_as(by_another ? PILOTS_STATION : 0, location_type, latitude_deg);
}

/* PX4's SYSTEM says home, a ground station's where the operator stands; each once a second. */
static void a_live_operator_goes_before_home(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 20; i++) {
        say(false, 0, 50);
        assert_true(operator_is(i == 0 ? 50 : 51));
        fly(0.5);
        say(true, LIVE, 51);
        assert_true(operator_is(51));
        assert_int_equal(view.system.operator_location_type, LIVE);
        assert_true(condition.operators_differ);
        fly(0.5);
    }
    for (unsigned i = 0; i < 11; i++) { /* it falls silent */
        say(false, 0, 50);
        fly(1);
    }
    assert_true(operator_is(50));
    assert_false(condition.operators_differ);
}

static void of_equals_the_first_one_counts_until_it_is_silent(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 20; i++) {
        say(true, LIVE, 51);
        assert_true(operator_is(51));
        say(false, LIVE, 50);
        assert_true(operator_is(51));
        fly(1);
    }
    for (unsigned i = 0; i < 20; i++) {
        say(false, LIVE, 50);
        assert_true(operator_is(i < 9 ? 51 : 50));
        fly(1);
    }
    say(true, LIVE, 51);
    assert_true(operator_is(50));
}

/* The second one is whoever sends a ground station's HEARTBEAT; they took turns, and nobody was
 * told. */
static void of_two_ground_stations_the_first_one_counts_until_it_is_silent(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 20; i++) {
        say_as(PILOTS_STATION, LIVE, 51);
        assert_true(operator_is(51));
        say_as(ANOTHER_STATION, LIVE, 47);
        assert_true(operator_is(51));
        assert_true(condition.operators_differ);
        fly(1);
    }
    for (unsigned i = 0; i < 20; i++) {
        say_as(ANOTHER_STATION, LIVE, 47);
        assert_true(operator_is(i < 9 ? 51 : 47));
        fly(1);
    }
    assert_false(condition.operators_differ);
}

/* QGroundControl without a place of its own sends 0,0 each second; and 255/190 is everyone's. */
static void who_has_no_place_is_in_nobodys_way(void **state)
{
    static const uint16_t with_a_place[] = {ANOTHER_STATION, PILOTS_STATION};

    (void)state;
    for (unsigned i = 0; i < 20; i++) {
        struct telemetry_update none = system_message(TELEMETRY_SYSTEM);

        fly(i % 10 == 0 ? 11 : 1);
        none.by_another = true;
        none.speaker = PILOTS_STATION;
        none.system.operator_latitude_deg = none.system.operator_longitude_deg = 0;
        give(&none);
        look();
        assert_true(i % 10 == 0 || operator_is(51));
        say_as(with_a_place[i / 10], LIVE, 51);
        assert_true(operator_is(51));
        assert_false(condition.operators_differ);
    }
}

/* Two places by one speaker, 0: the vehicle; it is told. */
static void take_turns_as(uint16_t speaker)
{
    for (unsigned i = 0; i < 10; i++) {
        say_as(speaker, LIVE, 51);
        fly(0.5);
        say_as(speaker, LIVE, 47);
        fly(0.5);
        assert_true(i < 1 || condition.operators_differ);
    }
}

static void two_stations_of_one_number_are_told(void **state)
{
    (void)state;
    fly(5);
    take_turns_as(PILOTS_STATION);
    for (unsigned i = 0; i < 12; i++) {
        say_as(PILOTS_STATION, LIVE, 51 + i * 1e-4);
        fly(1);
    }
    assert_false(condition.operators_differ);
}

static struct telemetry_update described(uint16_t speaker, uint8_t type, const char *text)
{
    struct telemetry_update update = update_of(TELEMETRY_SELF_ID);

    update.by_another = true;
    update.speaker = speaker;
    update.self_id.type = type;
    strcpy(update.self_id.text, text);
    return update;
}

/* Who has declared it; from anybody else it is one more, and no end of it. */
static void an_emergency_is_taken_back_by_who_declared_it(void **state)
{
    struct telemetry_update declared = described(PILOTS_STATION, 1, "engine failure");
    struct telemetry_update others = described(ANOTHER_STATION, 0, "");
    struct telemetry_update theirs = described(ANOTHER_STATION, 1, "bird strike");
    struct telemetry_update ended = described(PILOTS_STATION, 0, "");

    (void)state;
    fly(5);
    give(&others);
    for (unsigned i = 0; i < 10; i++) {
        give(&declared);
        fly(0.5);
        give(&others);
        look();
        assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
        fly(0.5);
    }
    give(&theirs); /* it stays the pilot's, and so does its end */
    give(&others);
    look();
    assert_string_equal(view.description, "engine failure");
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
    for (unsigned i = 0; i < 8; i++) { /* it says so, and doesn't say the other any more */
        give(&ended);
        look();
        assert_true(i < 6 || view.location.status != AIRCRAFT_EMERGENCY);
        fly(0.5);
    }
    assert_false(condition.descriptions_differ);
    give(&theirs);
    look();
    assert_string_equal(view.description, "bird strike");
    give(&ended); /* that one is another's */
    look();
    assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
}

/* Everybody's QGroundControl is 255/190: a second one's ordinary text took it off the air. */
static void an_emergency_stands_while_another_of_its_number_says_otherwise(void **state)
{
    struct telemetry_update declared = described(PILOTS_STATION, 1, "engine failure");
    struct telemetry_update others = described(PILOTS_STATION, 0, "survey");

    (void)state;
    fly(5);
    for (unsigned i = 0; i < 30; i++) {
        give(&declared);
        for (unsigned j = 0; j < 4; j++) {
            give(&others);
            look();
            assert_string_equal(view.description, "engine failure");
            assert_int_equal(view.location.status, AIRCRAFT_EMERGENCY);
            assert_true(i < 2 || condition.descriptions_differ);
            fly(0.25);
        }
    }
    for (unsigned i = 0; i < 20; i++) {
        give(&others);
        fly(1);
    }
    assert_string_equal(view.description, "survey");
    assert_false(condition.descriptions_differ);
}

/* ArduPilot passes on what the ground station says. */
static void one_place_by_two_ways_is_no_difference(void **state)
{
    (void)state;
    fly(5);
    for (unsigned i = 0; i < 20; i++) {
        say(true, LIVE, 51 + 1e-6 * i);
        fly(0.5);
        say(false, LIVE, 51 + 1e-6 * i);
        assert_false(condition.operators_differ);
        fly(0.5);
    }
}

/* ArduPilot passes on as its own what each of two has said. */
static void two_that_the_autopilot_passes_on_are_told(void **state)
{
    (void)state;
    fly(5);
    take_turns_as(0);
}

/* A home that was moved in flight: PX4 says it so. */
static void a_take_off_elsewhere_than_it_took_off_is_not_broadcast(void **state)
{
    (void)state;
    fly(5);
    arm(true);
    fly(5);
    say(false, 0, 51);
    assert_true(operator_is(57.7089));
    assert_int_equal(view.system.operator_location_type, 0);
    assert_true(condition.operators_differ);
    for (unsigned i = 0; i < 2; i++) { /* live, and then where it was armed */
        struct telemetry_update update = system_message(TELEMETRY_SYSTEM);

        fly(1);
        update.system.operator_location_type = i == 0 ? LIVE : 0;
        update.system.operator_latitude_deg = i == 0 ? 51 : 57.7090;
        update.system.operator_longitude_deg = sim.longitude_deg;
        update.system.timestamp_2019_s += 1;
        give(&update);
        look();
        assert_true(operator_is(i == 0 ? 51 : 57.7090));
    }
}

static void what_differs_from_the_configured_classification_is_told(void **state)
{
    struct telemetry_update update = system_message(TELEMETRY_SYSTEM);

    (void)state;
    config.classification_set = true;
    config.category = update.system.category_eu;
    config.class_eu = update.system.class_eu;
    give(&update);
    look();
    assert_false(condition.classification_conflict);
    update.system.category_eu = 0; /* claims nothing */
    update.system.class_eu = 0;
    give(&update);
    look();
    assert_false(condition.classification_conflict);
    update.system.class_eu = (uint8_t)(config.class_eu + 1);
    give(&update);
    look();
    assert_true(condition.classification_conflict);
    assert_int_equal(view.system.class_eu, config.class_eu);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_native_operator_location_wins_while_fresh, begin_setup),
        cmocka_unit_test_setup(an_update_moves_the_operator_and_nothing_else, begin_setup),
        cmocka_unit_test_setup(an_update_alone_is_a_moving_operator, begin_setup),
        cmocka_unit_test_setup(an_operator_message_with_a_frozen_timestamp_goes_stale, begin_setup),
        cmocka_unit_test_setup(an_operator_who_moves_counts_whatever_the_timestamp, begin_setup),
        cmocka_unit_test_setup(an_operator_message_without_a_timestamp_counts_while_it_comes,
                               begin_setup),
        cmocka_unit_test_setup(an_unknown_native_operator_is_no_place, begin_setup),
        cmocka_unit_test_setup(an_unknown_operator_is_never_a_made_up_default, begin_setup),
        cmocka_unit_test_setup(who_tells_seldom_is_not_interrupted_by_the_takeoff_point,
                               begin_setup),
        cmocka_unit_test_setup(an_operator_altitude_has_to_be_one, begin_setup),
        cmocka_unit_test_setup(an_operator_location_of_no_known_type_is_not_called_takeoff,
                               begin_setup),
        cmocka_unit_test_setup(the_autopilots_time_wins_over_the_ground_stations, begin_setup),
        cmocka_unit_test_setup(a_configured_classification_wins, begin_setup),
        cmocka_unit_test_setup(a_native_classification_fills_what_is_not_configured, begin_setup),
        cmocka_unit_test_setup(one_aircraft_and_no_area_is_the_default, begin_setup),
        cmocka_unit_test_setup(a_native_area_count_of_0_is_one_aircraft, begin_setup),
        cmocka_unit_test_setup(a_live_operator_goes_before_home, begin_setup),
        cmocka_unit_test_setup(a_ceiling_under_its_floor_is_none, begin_setup),
        cmocka_unit_test_setup(of_equals_the_first_one_counts_until_it_is_silent, begin_setup),
        cmocka_unit_test_setup(of_two_ground_stations_the_first_one_counts_until_it_is_silent,
                               begin_setup),
        cmocka_unit_test_setup(an_emergency_is_taken_back_by_who_declared_it, begin_setup),
        cmocka_unit_test_setup(an_emergency_stands_while_another_of_its_number_says_otherwise,
                               begin_setup),
        cmocka_unit_test_setup(one_place_by_two_ways_is_no_difference, begin_setup),
        cmocka_unit_test_setup(who_has_no_place_is_in_nobodys_way, begin_setup),
        cmocka_unit_test_setup(two_stations_of_one_number_are_told, begin_setup),
        cmocka_unit_test_setup(what_differs_from_the_configured_classification_is_told,
                               begin_setup),
        cmocka_unit_test_setup(two_that_the_autopilot_passes_on_are_told, begin_setup),
        cmocka_unit_test_setup(a_take_off_elsewhere_than_it_took_off_is_not_broadcast, begin_setup),
    };

    return cmocka_run_group_tests_name("aircraft, System", tests, NULL, NULL);
}
