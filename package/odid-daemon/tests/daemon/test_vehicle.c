/* Which system is the vehicle, where another one than the expected one flies: the board was moved,
 * or a system id changed. What a stream does with it is in test_telemetry.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "daemon/vehicle.h"

#define SECOND INT64_C(1000000)
#define OLD 9      /* of the last power-on */
#define OURS 1     /* the one that flies */
#define STRANGER 2 /* is heard by the autopilot's radio */

static struct vehicle vehicle;
static int64_t now_us;

static void power_on(uint8_t expected)
{
    now_us = 10 * SECOND;
    vehicle_init(&vehicle);
    vehicle_expect(&vehicle, expected, false, now_us);
}

static void one_frame(uint8_t system, bool armed)
{
    vehicle_heartbeat(&vehicle, system, armed, now_us);
}

/* Each second a HEARTBEAT and more. */
static void speaks_for(uint8_t system, bool armed, unsigned seconds)
{
    for (; seconds > 0; seconds--, now_us += SECOND) {
        one_frame(system, armed);
        vehicle_speaks(&vehicle, system, now_us);
    }
}

static void ours_flies(void)
{
    speaks_for(OURS, false, 20);
    speaks_for(OURS, true, 600);
    assert_int_equal(vehicle.system, OURS);
}

static int five_minutes_on_the_ground(void **state)
{
    (void)state;
    power_on(OLD);
    now_us += SECOND;
    speaks_for(OURS, false, 300);
    assert_int_equal(vehicle.system, OURS);
    return 0;
}

/* It took the place of ours for good, on the ground and in the air, and "armed" with it. */
static void one_frame_of_the_old_id_takes_no_flight(void **state)
{
    (void)state;
    one_frame(OLD, true);
    ours_flies();
    one_frame(OLD, true);
    assert_int_equal(vehicle.system, OURS);
}

/* Ours wasn't the one that was there first: that was still the old one, which was never heard. */
static void a_stranger_while_it_restarts_takes_no_flight(void **state)
{
    (void)state;
    for (unsigned second = 0; second < 15; second++) {
        one_frame(STRANGER, false);
        if (second >= 12) {
            speaks_for(OURS, false, 1);
        } else {
            now_us += SECOND;
        }
    }
    one_frame(STRANGER, true); /* it takes off, and is gone */
    ours_flies();
}

/* Right before it arms, and again and again in the air: it was seen disarmed before the first one.
 */
static void nor_do_more_of_them_in_the_air(void **state)
{
    (void)state;
    one_frame(OLD, true);
    now_us += SECOND;
    for (unsigned i = 0; i < 150; i++) {
        speaks_for(OURS, true, 4);
        one_frame(OLD, i % 2 == 0);
        assert_true(i < 2 || vehicle.system == OURS);
    }
}

/* Its take-off point went with that, for the flight. */
static void a_stranger_after_our_restart_is_not_the_expected_one(void **state)
{
    (void)state;
    vehicle_init(&vehicle);
    vehicle_expect(&vehicle, OLD, true, now_us);
    one_frame(OLD, true);
    now_us += 1600000;
    one_frame(STRANGER, false);
    assert_int_equal(vehicle.system, OLD);
}

/* The old one itself has time until another one takes off. */
static void the_expected_one_may_come_late(void **state)
{
    (void)state;
    one_frame(OLD, false);
    assert_int_equal(vehicle.system, OURS);
    speaks_for(OLD, false, 5);
    assert_int_equal(vehicle.system, OLD);
    one_frame(OURS, false);
    assert_int_equal(vehicle.system, OLD);
}

/* The id was changed five minutes ago, and ours is silent for 5 s. */
static void nor_does_one_of_the_id_that_it_had_before(void **state)
{
    (void)state;
    power_on(OLD);
    speaks_for(OLD, false, 60);
    speaks_for(OURS, false, 300);
    now_us += 4 * SECOND;
    one_frame(OLD, true);
    now_us += SECOND;
    ours_flies();
}

/* Each of these kept ours from being the vehicle until power-off: "settled" counted from the
 * power-on, and two frames with nothing between them as a voice. */
static void strays_before_it_is_settled_take_no_flight(void **state)
{
    static const struct {
        const char *name;
        uint8_t expected;
        unsigned ours_s; /* it speaks for so long before the first one */
        struct {
            unsigned after_s;
            uint8_t system;
            bool armed;
        } stray[2];
        unsigned then_s;
    } cases[] = {
        {"the old id, before ours is heard", OLD, 0, {{14, OLD, true}}, 3},
        {"right after power-on", OLD, 0, {{2, OLD, true}}, 5},
        {"disarmed, two seconds after ours was heard first", OLD, 2, {{0, OLD, false}}, 0},
        {"a stranger's two, before the expected one",
         OURS,
         0,
         {{5, STRANGER, false}, {9, STRANGER, true}},
         2},
        {"where nobody is expected", 0, 0, {{5, STRANGER, true}, {9, STRANGER, true}}, 2},
        {"while it is off for a minute",
         OURS,
         300,
         {{62, STRANGER, false}, {10, STRANGER, true}},
         3},
    };

    (void)state;
    for (unsigned i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        print_message("%s\n", cases[i].name);
        power_on(cases[i].expected);
        speaks_for(OURS, false, cases[i].ours_s);
        for (unsigned k = 0; k < 2 && cases[i].stray[k].system != 0; k++) {
            now_us += cases[i].stray[k].after_s * SECOND;
            one_frame(cases[i].stray[k].system, cases[i].stray[k].armed);
        }
        now_us += cases[i].then_s * SECOND;
        speaks_for(OURS, false, 7);
        speaks_for(OURS, true, 600);
        assert_int_equal(vehicle.system, OURS);
    }
}

static unsigned below(unsigned limit)
{
    return (unsigned)random() % limit;
}

/* Up to three frames at any instants, of the old id and of strangers; ours is there from some
 * instant on, may restart before it arms, and be unheard in the air for some seconds. */
static void no_three_frames_hold_it_off(void **state)
{
    (void)state;
    srandom(1);
    for (unsigned flight = 0; flight < 5000; flight++) {
        unsigned start = below(60), arms = start + 5 + below(120), end = arms + 200, away = 0;
        unsigned off = start + below(arms - start), off_for = below(2) * below(16);
        unsigned unheard = arms + 5 + below(100), unheard_for = below(2) * below(6);
        unsigned stray_at[3] = {below(end), below(end), below(end)}, strays = 1 + below(3);

        power_on((uint8_t[]){0, OURS, OLD}[below(3)]);
        for (unsigned second = 0; second < end; second++, now_us += SECOND) {
            bool speaks = second >= start && !(second >= off && second < off + off_for) &&
                          !(second >= unheard && second < unheard + unheard_for);

            for (unsigned i = 0; i < strays; i++) {
                if (stray_at[i] == second) {
                    one_frame((uint8_t[]){OLD, STRANGER, STRANGER + 1}[below(3)], below(2) == 0);
                }
            }
            if (speaks) {
                one_frame(OURS, second >= arms);
                vehicle_speaks(&vehicle, OURS, now_us);
            }
            away = speaks && vehicle.system != OURS ? away + 1 : 0;
            if (away >= 5 + (second < arms ? 10 : 0)) {
                fail_msg("flight %u: at %u s it isn't the vehicle for %u s", flight, second, away);
            }
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(one_frame_of_the_old_id_takes_no_flight, five_minutes_on_the_ground),
        cmocka_unit_test_setup(a_stranger_while_it_restarts_takes_no_flight,
                               five_minutes_on_the_ground),
        cmocka_unit_test_setup(nor_do_more_of_them_in_the_air, five_minutes_on_the_ground),
        cmocka_unit_test(a_stranger_after_our_restart_is_not_the_expected_one),
        cmocka_unit_test_setup(the_expected_one_may_come_late, five_minutes_on_the_ground),
        cmocka_unit_test(nor_does_one_of_the_id_that_it_had_before),
        cmocka_unit_test(strays_before_it_is_settled_take_no_flight),
        cmocka_unit_test(no_three_frames_hold_it_off),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
