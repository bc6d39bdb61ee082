/* A newer position within a slot, with a controller that takes its time: on a simulated clock, with
 * radios and an aircraft of this test's own. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/loop.h"
#include "daemon/bluetooth.h"
#include "daemon/broadcast.h"
#include "daemon/messages.h"
#include "daemon/schedule.h"
#include "daemon/wifi_beacon.h"
#include "full_view.h"

#define MS INT64_C(1000)
#define START (1234 * 1000 * MS)
#define MESSAGE_AT (MESSAGES_LEGACY_SIZE - 25)

static struct {
    int64_t answer_us; /* from a payload to the controller's answer to it */
    int64_t set_us;    /* the last payload */
    int64_t fix_us;    /* of the position that is flown */
    int64_t newest_us; /* when that was first given to the controller; 0: not yet */
    int64_t hold_us;   /* so long the controller keeps each payload */
    bool waits;        /* what was set last waits for the controller still */
    unsigned asked;    /* so often whether one fits */
    uint8_t counter;   /* of the last payload */
    unsigned beacon_most;
    unsigned beacons[MESSAGE_TYPES]; /* whose first message is of this type */
    size_t beacon_size;              /* the longest */
} radio = {.beacon_most = MESSAGES_PACK_MAX};

/* ---- instead of the real ones ---- */

static struct loop_timer *timers[4];
static unsigned timer_count;

void loop_timer_init(struct loop_timer *timer, loop_timer_fn *call, void *context)
{
    *timer = (struct loop_timer){.deadline_us = LOOP_NEVER, .call = call, .context = context};
    timers[timer_count++] = timer;
}

void loop_arm(struct loop_timer *timer, int64_t deadline_us)
{
    timer->deadline_us = deadline_us;
}

void slot_lateness_add(struct slot_lateness *lateness, int64_t late_us, unsigned skipped)
{
    (void)lateness;
    assert_int_equal(late_us, 0);
    assert_int_equal(skipped, 0);
}

void aircraft_view(const struct aircraft *aircraft, int64_t now_us, struct aircraft_view *view)
{
    (void)aircraft;
    (void)now_us;
    *view = full_view();
    view->location.fix_us = radio.fix_us;
}

void bluetooth_set_legacy(const uint8_t data[MESSAGES_LEGACY_SIZE], int64_t now_us)
{
    radio.set_us = now_us;
    radio.counter = data[MESSAGE_AT - 1];
    if (data[MESSAGE_AT] >> 4 == 1 && radio.newest_us == 0) {
        radio.newest_us = now_us;
    }
}

enum bluetooth_fit bluetooth_legacy_fit(int64_t until_us, int64_t next_us, int64_t now_us)
{
    bool answered = now_us - radio.set_us >= radio.answer_us;
    int64_t from_us = answered ? radio.set_us + radio.answer_us + radio.hold_us : now_us;

    radio.asked++;
    from_us = from_us > now_us ? from_us : now_us;
    if (from_us >= until_us || next_us - from_us < 2 * radio.hold_us) {
        return BLUETOOTH_FITS_NOT;
    }
    return answered ? BLUETOOTH_FITS : BLUETOOTH_FITS_LATER;
}

void bluetooth_set_extended(const uint8_t *data, size_t length, int64_t now_us)
{
    (void)data;
    (void)length;
    (void)now_us;
}

size_t bluetooth_extended_room(void)
{
    return MESSAGES_EXTENDED_SIZE;
}

bool bluetooth_waits(enum channel channel)
{
    return channel == CHANNEL_BT4 && radio.waits;
}

void wifi_beacon_set(const uint8_t *element, size_t length, int64_t now_us)
{
    (void)now_us;
    radio.beacons[element[MESSAGES_ELEMENT_EMPTY] >> 4]++;
    radio.beacon_size = length > radio.beacon_size ? length : radio.beacon_size;
}

unsigned wifi_beacon_most(void)
{
    return radio.beacon_most;
}

bool wifi_beacon_waits(void)
{
    return false;
}

/* ---- the tests ---- */

static void run(int64_t from_us, int64_t end_us)
{
    for (int64_t now_us = from_us; now_us <= end_us; now_us += MS) {
        for (unsigned i = 0; i < timer_count; i++) {
            if (timers[i]->deadline_us <= now_us) {
                timers[i]->deadline_us = LOOP_NEVER;
                timers[i]->call(timers[i]->context, now_us);
            }
        }
    }
}

/* How long the position waits that comes 10 ms after a slot for positions has begun. */
static int64_t waited_us(int64_t answer_us, int64_t hold_us)
{
    static struct config config;
    static struct slot_lateness lateness;
    const int64_t came_us = START + 10 * MS;

    config.bt4_enabled = true;
    timer_count = 0;
    radio.answer_us = answer_us;
    radio.hold_us = hold_us;
    radio.fix_us = START - 100 * MS;
    radio.newest_us = 0;
    radio.asked = 0;
    broadcast_start(&config, NULL, &lateness, START);
    run(START, came_us);
    assert_int_equal(radio.newest_us, START);
    radio.newest_us = 0;
    radio.fix_us = came_us;
    broadcast_position(came_us);
    run(came_us, START + 400 * MS);
    assert_int_not_equal(radio.newest_us, 0);
    return radio.newest_us - came_us;
}

static void at_once_when_the_controller_answers_at_once(void **state)
{
    (void)state;
    assert_int_equal(waited_us(0, 0), 0);
}

/* The next slot for positions is two slots away: at 5 Hz another position comes before it. */
static void as_soon_as_a_slow_controller_has_answered(void **state)
{
    (void)state;
    assert_in_range(waited_us(45 * MS, 0), 35 * MS, 55 * MS);
}

static void in_the_next_slot_when_the_controller_answers_after_this_one(void **state)
{
    (void)state;
    assert_int_equal(waited_us(300 * MS, 0), 2 * SCHEDULE_SLOT_US - 10 * MS);
}

/* One that advertises every 100 ms has no room for a second one in a slot: that is asked once. */
static void what_does_not_fit_is_not_asked_for_again(void **state)
{
    (void)state;
    assert_int_equal(waited_us(0, 112 * MS), 2 * SCHEDULE_SLOT_US - 10 * MS);
    assert_int_equal(radio.asked, 1);
}

/* The one before it has to stay on the air for its time: no older position waits for that. */
static void in_place_of_the_one_that_waits(void **state)
{
    uint8_t counter;

    (void)state;
    radio.waits = true;
    assert_int_equal(waited_us(0, 112 * MS), 0);
    assert_int_equal(radio.asked, 0);
    counter = radio.counter;
    radio.fix_us += 10 * MS;
    broadcast_position(radio.fix_us);
    assert_int_equal(radio.counter, counter); /* neither was on the air */
    radio.waits = false;
}

/* What the chip takes of a pack; the smallest of all has each message in turn, whatever becomes of
 * Bluetooth's. */
static void as_much_as_the_beacon_s_chip_takes(void **state)
{
    static struct config config = {.wifi_beacon_enabled = true, .bt4_enabled = true};
    static struct slot_lateness lateness;

    (void)state;
    for (unsigned most = 5; most == 5 || most == 3 || most == 1; most -= 2) {
        memset(radio.beacons, 0, sizeof(radio.beacons));
        radio.beacon_size = 0;
        radio.beacon_most = most;
        radio.waits = true; /* the controller is away */
        timer_count = 0;
        broadcast_start(&config, NULL, &lateness, START);
        run(START, START + 2000 * MS);
        assert_int_equal(radio.beacon_size, MESSAGES_ELEMENT_EMPTY + most * MESSAGE_SIZE);
    }
    assert_in_range(radio.beacons[MESSAGE_LOCATION], 7, 9);
    assert_in_range(radio.beacons[MESSAGE_BASIC_ID], 1, 3);
    assert_in_range(radio.beacons[MESSAGE_SYSTEM], 1, 3);
    assert_in_range(radio.beacons[MESSAGE_OPERATOR_ID], 1, 3);
    assert_in_range(radio.beacons[MESSAGE_SELF_ID], 1, 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(at_once_when_the_controller_answers_at_once),
        cmocka_unit_test(as_soon_as_a_slow_controller_has_answered),
        cmocka_unit_test(in_the_next_slot_when_the_controller_answers_after_this_one),
        cmocka_unit_test(what_does_not_fit_is_not_asked_for_again),
        cmocka_unit_test(in_place_of_the_one_that_waits),
        cmocka_unit_test(as_much_as_the_beacon_s_chip_takes),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
