/* The pack in hostapd's beacons, against a played hostapd. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "simulated_time.h"

#include <inttypes.h>
#include <sys/stat.h>

#include "base/whole_file.h"
#include "daemon/messages.h"
#include "daemon/wifi_beacon.h"
#include "fake_hostapd.h"
#include "loop_until.h"
#include "own_mounts.h"
#include "radio/beacon_evidence.h"

static struct fake_hostapd fake;
static struct config config;
static struct radio radio;
static char expected[8];

static void set(uint8_t counter)
{
    const uint8_t element[] = {0xDD, 0x01, counter};

    snprintf(expected, sizeof(expected), "dd01%02x", counter);
    wifi_beacon_set(element, sizeof(element), loop_now_us());
}

/* What it was told last is in the beacon. */
static bool it_is_in_the_beacon(void)
{
    return strcmp(fake.beacon, expected) == 0 && radio.state == RADIO_ON_AIR;
}

static void start(void)
{
    static uint8_t counter;

    memset(&config, 0, sizeof(config));
    config.wifi_beacon_enabled = true;
    snprintf(config.wifi_iface, sizeof(config.wifi_iface), "wlan0");
    snprintf(config.hostapd_dir, sizeof(config.hostapd_dir), "%s", fake.directory);
    snprintf(config.run_dir, sizeof(config.run_dir), "%s", fake.directory);
    wifi_beacon_start(&config, &radio, loop_now_us());
    set(++counter);
}

static int set_up(void **state)
{
    (void)state;
    fake_hostapd_start(&fake);
    return 0;
}

static bool it_is_absent(void)
{
    return radio.state == RADIO_ABSENT;
}

static bool it_is_lost(void)
{
    return radio.state == RADIO_LOST;
}

static bool it_is_down(void)
{
    return radio.state == RADIO_DOWN;
}

static int tear_down(void **state)
{
    (void)state;
    wifi_beacon_stop();
    return fake_hostapd_end(&fake) ? 0 : -1;
}

static bool it_is_confirmed(void)
{
    return radio.confirmed_us > radio.accepted_us;
}

static void an_unchanged_element_is_confirmed(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    assert_true(loop_until(it_is_confirmed, 1500));
    assert_int_equal(radio.payloads, 1);
    assert_true(radio.confirmed_us - radio.unbroken_us < RADIO_PAUSE_US);
}

static void an_element_gets_into_the_beacon(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    assert_int_equal(radio.payloads, 1);
    assert_int_equal(fake.statuses, 1); /* asked first */
    set(200);
    assert_true(loop_until(it_is_in_the_beacon, 500));
    assert_int_equal(radio.payloads, 2);
    assert_int_equal(radio.failures, 0);
}

static void the_same_element_is_not_sent_again(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    for (int i = 0; i < 10; i++) {
        set((uint8_t)strtoul(expected + 4, NULL, 16));
        run_ms(5);
    }
    assert_int_equal(fake.sets, 1);
}

static void of_several_elements_the_newest_is_sent(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    set(100);
    set(101);
    set(102);
    assert_true(loop_until(it_is_in_the_beacon, 500));
    assert_true(fake.sets <= 3);
}

static void hostapd_is_asked_once_a_second_by_itself(void **state)
{
    (void)state;
    start();
    run_ms(2300);
    assert_in_range(fake.statuses, 3, 4);
}

static void a_hostapd_that_restarts_has_the_element_within_a_second(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake_hostapd_die(&fake);
    assert_true(loop_until(it_is_lost, 1200)); /* at the next question, at the latest */
    assert_true(loop_until(it_is_absent, 500));
    run_ms(1500);
    fake_hostapd_run(&fake);
    assert_true(loop_until(it_is_in_the_beacon, 1100));
    assert_int_equal(radio.starts, 2);
}

static void a_hostapd_that_hangs_is_lost_and_asked_again(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake.hangs = true;
    set(50);
    assert_true(loop_until(it_is_lost, 1500));
    assert_non_null(strstr(radio.detail, "doesn't answer"));
    set(51);
    assert_true(wifi_beacon_waits());
    fake.hangs = false;
    assert_true(loop_until(it_is_in_the_beacon, 1500));
    assert_false(wifi_beacon_waits());
}

static void a_hostapd_that_passes_descriptors_is_left_alone_for_a_minute(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake.passes = true;
    assert_true(loop_until(it_is_lost, 1200));
    assert_string_equal(radio.detail, "hostapd is left alone: it passed descriptors");
    fake.passes = false;
    fake.requests = 0;
    run_ms(58000);
    assert_int_equal(radio.state, RADIO_LOST);
    assert_string_equal(radio.detail, "hostapd is left alone: it passed descriptors");
    assert_int_equal(fake.requests, 0);
    assert_true(loop_until(it_is_in_the_beacon, 4000));
}

static void a_disabled_interface_is_down_and_gets_the_element_again(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake.disabled = true;
    fake_hostapd_forget(&fake);
    assert_true(loop_until(it_is_down, 1200));
    assert_non_null(strstr(radio.detail, "DISABLED"));
    fake.sets = 0;
    set(60);
    run_ms(300);
    assert_int_equal(fake.sets, 0);
    fake.disabled = false;
    assert_true(loop_until(it_is_in_the_beacon, 1200));
}

/* It was in the beacons before: what takes its place replaces nothing. */
static void one_that_is_given_again_does_not_wait(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake.disabled = true;
    assert_true(loop_until(it_is_down, 1200));
    fake.set_reply = "FAIL\n";
    fake.disabled = false;
    assert_true(loop_until(it_is_lost, 1200));
    assert_false(wifi_beacon_waits());
    set(65);
    assert_true(wifi_beacon_waits());
    fake.set_reply = "OK\n";
    assert_true(loop_until(it_is_in_the_beacon, 1200));
    assert_false(wifi_beacon_waits());
}

static void a_refused_element_is_told_and_tried_again(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake.set_reply = "FAIL\n";
    set(70);
    run_ms(600);
    assert_int_equal(radio.state, RADIO_LOST);
    assert_non_null(strstr(radio.detail, "\"FAIL\" to SET vendor_elements"));
    assert_in_range(fake.sets, 3, 5);
    assert_true(radio.failures >= 2);
    fake.set_reply = "OK\n";
    assert_true(loop_until(it_is_in_the_beacon, 500));
}

static void a_refused_update_is_told_and_tried_again(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake.update_reply = "FAIL\n";
    set(80);
    run_ms(100);
    assert_int_equal(radio.state, RADIO_LOST);
    fake.update_reply = "OK\n";
    assert_true(loop_until(it_is_in_the_beacon, 500));
}

/* ---- a chip that refuses ---- */

#define ELEMENT(messages) (MESSAGES_ELEMENT_EMPTY + (messages)*MESSAGE_SIZE)

/* As the broadcast does each 125 ms: as many of five messages as may be, with a place of its own.
 */
static struct loop_timer slot;
static unsigned slots;
static int64_t silent_us, silence_us; /* since when nothing is in the beacon; the longest so far */

static void on_slot(void *context, int64_t now_us)
{
    unsigned messages = wifi_beacon_most() < 5 ? wifi_beacon_most() : 5;
    uint8_t element[ELEMENT(5)] = {0xDD};

    (void)context;
    element[7] = (uint8_t)++slots;
    element[8] = (uint8_t)messages;
    wifi_beacon_set(element, ELEMENT(messages), now_us);
    loop_arm(&slot, now_us + 125000);
}

static size_t in_the_beacon(void)
{
    return strlen(fake.beacon) / 2;
}

static bool all_is_heard(void)
{
    return in_the_beacon() == ELEMENT(5) && radio.state == RADIO_ON_AIR;
}

static bool four_are_heard(void)
{
    return in_the_beacon() == ELEMENT(4) && radio.state == RADIO_ON_AIR;
}

static bool one_is_heard(void)
{
    return in_the_beacon() == ELEMENT(1) && radio.state == RADIO_ON_AIR;
}

static bool it_was_refused(void)
{
    return radio.failures > 0;
}

static bool never(void)
{
    int64_t now_us = loop_now_us();

    if (in_the_beacon() > 0) {
        silent_us = now_us;
    }
    silence_us = now_us - silent_us > silence_us ? now_us - silent_us : silence_us;
    return radio.state == RADIO_LOST;
}

static void start_slots(void)
{
    start();
    loop_timer_init(&slot, on_slot, NULL);
    loop_arm(&slot, loop_now_us());
    silent_us = loop_now_us();
    silence_us = 0;
}

static void end_slots(void)
{
    loop_arm(&slot, LOOP_NEVER);
}

static void what_a_chip_refused_goes_out_shorter(void **state)
{
    (void)state;
    fake.limit = ELEMENT(4);
    start_slots();
    assert_true(loop_until(four_are_heard, 600));
    assert_int_equal(wifi_beacon_most(), 4);
    assert_non_null(strstr(radio.detail, "shortened"));
    end_slots();
}

static void one_that_takes_little_has_them_one_by_one(void **state)
{
    (void)state;
    fake.limit = ELEMENT(2);
    start_slots();
    assert_true(loop_until(one_is_heard, 2000));
    end_slots();
}

/* It was "OK" the second time, and wasn't there. */
static void what_was_refused_once_goes_out_whole_again(void **state)
{
    (void)state;
    start_slots();
    assert_true(loop_until(all_is_heard, 600));
    fake.refuses = 1;
    assert_true(loop_until(it_was_refused, 300));
    assert_true(loop_until(all_is_heard, 300));
    assert_int_equal(wifi_beacon_most(), MESSAGES_PACK_MAX);
    end_slots();
}

/* What the chip took last was forgotten with the connection: it stayed in every beacon, with an old
 * place, beside all later ones. */
static void no_element_of_before_stays_beside_the_later_ones(void **state)
{
    static const struct {
        unsigned hangs_ms;
        bool refused_then, killed;
    } cases[] = {{2500, false, false}, {1300, true, false}, {0, true, true}};

    (void)state;
    for (unsigned i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        if (i > 0) {
            tear_down(state);
            set_up(state);
        }
        start_slots();
        assert_true(loop_until(all_is_heard, 600));
        fake.hangs = cases[i].hangs_ms > 0;
        fake.refuses = !cases[i].refused_then;
        run_ms(cases[i].hangs_ms);
        fake.hangs = false;
        if (cases[i].killed) { /* the one that was told to take it out isn't */
            struct fake_hostapd before = fake;

            wifi_beacon_stop();
            run_ms(20);
            memcpy(fake.configured, before.configured, sizeof(before.configured));
            memcpy(fake.driver, before.driver, sizeof(before.driver));
            memcpy(fake.chip, before.chip, sizeof(before.chip));
            wifi_beacon_start(&config, &radio, loop_now_us());
        }
        fake.refuses = fake.refuses > 0 || cases[i].refused_then;
        run_ms(10000);
        assert_int_equal(fake.refuses, 0);
        assert_true(all_is_heard());
        assert_string_equal(fake.chip[1], "");
        end_slots();
    }
}

static void what_was_refused_twice_goes_out_whole_later(void **state)
{
    (void)state;
    start_slots();
    assert_true(loop_until(all_is_heard, 600));
    fake.refuses = 3; /* the one that is given back, too */
    assert_true(loop_until(it_was_refused, 300));
    assert_true(loop_until(four_are_heard, 600));
    assert_true(loop_until(all_is_heard, 10300));
    assert_int_equal(wifi_beacon_most(), MESSAGES_PACK_MAX);
    end_slots();
}

static void trying_more_costs_hardly_a_beacon(void **state)
{
    unsigned failures;

    (void)state;
    fake.limit = ELEMENT(4);
    start_slots();
    assert_true(loop_until(four_are_heard, 600));
    failures = radio.failures;
    fake.updates = 0;
    assert_false(loop_until(never, 60000));
    assert_int_equal(radio.failures, failures);
    assert_true(silence_us > 0 && silence_us < 300000);
    assert_int_equal(wifi_beacon_most(), 4);
    end_slots();
}

/* It says nothing about the chip. */
static void an_interface_that_is_down_is_no_refusal(void **state)
{
    (void)state;
    start_slots();
    assert_true(loop_until(all_is_heard, 600));
    fake.disabled = true;
    assert_true(loop_until(it_was_refused, 1000));
    assert_true(loop_until(it_is_down, 1000));
    assert_int_equal(wifi_beacon_most(), MESSAGES_PACK_MAX);
    end_slots();
}

#define NET "/sys/class/net"

static bool has_interface;

static void the_kernel_has_it(const char *state)
{
    assert_int_equal(whole_file_replace(NET "/wlan0/operstate", state, strlen(state), 0644), 0);
}

/* An interface of the kernel's, which the daemon has seen up. */
static void start_seen_up(void)
{
    has_interface = own_mounts() && mount_small_disk(NET, "64k");
    if (!has_interface) {
        skip();
    }
    assert_int_equal(mkdir(NET "/wlan0", 0755), 0);
    the_kernel_has_it("up\n");
    start_slots();
    assert_true(loop_until(all_is_heard, 600));
    run_ms(1000);
}

/* Also of a test that failed: the next ones have none. */
static int tear_down_interface(void **state)
{
    return has_interface && umount(NET) < 0 ? -1 : tear_down(state);
}

/* hostapd goes on saying ENABLED. It was taken for a chip that has no room, twice within ten
 * milliseconds, and a shorter pack was in the beacons for half a minute. */
static void nor_is_one_that_the_kernel_has_down(void **state)
{
    (void)state;
    start_seen_up();
    the_kernel_has_it("down\n");
    fake.update_reply = "FAIL\n";
    run_ms(1000);
    assert_int_equal(radio.state, RADIO_LOST);
    the_kernel_has_it("up\n");
    fake.update_reply = "OK\n";
    assert_true(loop_until(all_is_heard, 600));
    assert_int_equal(wifi_beacon_most(), MESSAGES_PACK_MAX);
    end_slots();
}

/* Then nothing is to be expected: its driver was to be bound anew after five seconds, while hostapd
 * was about to be back. */
static void of_a_hostapd_that_is_gone_no_beacons_are_expected(void **state)
{
    (void)state;
    start_seen_up();
    fake_hostapd_die(&fake);
    the_kernel_has_it("down\n");
    run_ms(10000);
    assert_int_equal(radio.state, RADIO_ABSENT);
    assert_false(radio.given_up);
    fake_hostapd_run(&fake);
    the_kernel_has_it("up\n");
    assert_true(loop_until(all_is_heard, 3000));
    end_slots();
}

/* Whatever is a moment ago gets a moment: both within one were no two refusals. */
static void two_refusals_in_a_row_lie_apart(void **state)
{
    (void)state;
    start_slots();
    assert_true(loop_until(all_is_heard, 600));
    fake.update_reply = "FAIL\n";
    run_ms(200);
    fake.update_reply = "OK\n";
    assert_true(loop_until(all_is_heard, 600));
    assert_int_equal(wifi_beacon_most(), MESSAGES_PACK_MAX);
    end_slots();
}

/* By another program, or by us: switching it on failed, or we ended meanwhile. */
static void one_that_was_left_off_is_switched_on(void **state)
{
    (void)state;
    fake.disabled = true;
    start_slots();
    assert_true(loop_until(all_is_heard, 2000));
    assert_int_equal(fake.switched, 1);
    fake.cannot_enable = fake.disabled = true;
    assert_false(loop_until(all_is_heard, 12000));
    assert_in_range(fake.switched, 3, 4);
    fake.cannot_enable = false;
    assert_true(loop_until(all_is_heard, 6000));
    end_slots();
}

static void another_hostapd_is_given_all(void **state)
{
    (void)state;
    fake.limit = ELEMENT(4);
    start_slots();
    assert_true(loop_until(four_are_heard, 600));
    fake_hostapd_die(&fake);
    fake.limit = 0;
    assert_true(loop_until(it_is_absent, 3000));
    fake_hostapd_run(&fake);
    assert_true(loop_until(all_is_heard, 1500));
    end_slots();
}

static void a_hostapd_that_forgot_is_told_again_after_a_while(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    fake_hostapd_forget(&fake);
    assert_true(loop_until(it_is_in_the_beacon, 5500));
}

/* ---- a chip that sends nothing ---- */

/* odid-beacons, and what the chip that it asks makes of beacons. */
static struct {
    struct loop_timer timer;
    uint32_t count;
    bool says_nothing; /* of how many there were */
    bool silent;
    bool by_clear, by_switch; /* that mends it */
} chip;

static void on_count(void *context, int64_t now_us)
{
    char path[80], line[40];

    (void)context;
    if ((chip.by_clear && fake.clears > 0) || (chip.by_switch && fake.switched == 2)) {
        chip.silent = false;
    }
    chip.count += chip.silent || fake.disabled ? 0 : 5;
    snprintf(path, sizeof(path), "%s" BEACON_COUNT_FILE, fake.directory);
    if (chip.says_nothing) {
        snprintf(line, sizeof(line), "%" PRId64 " - - -\n", now_us / 1000);
    } else {
        snprintf(line, sizeof(line), "%" PRId64 " %" PRIu32 " - %s\n", now_us / 1000, chip.count,
                 chip.count >= 15 ? BEACON_COUNT_SEEN : "-");
    }
    assert_int_equal(whole_file_replace(path, line, strlen(line), 0644), 0);
    loop_arm(&chip.timer, now_us + BEACON_COUNT_EVERY_US);
}

static bool it_is_counted(void)
{
    return radio.state == RADIO_ON_AIR && radio.known == RADIO_COUNTED;
}

static bool it_is_stuck(void)
{
    return radio_stuck(&radio, loop_now_us());
}

static bool it_is_seen_lost(void)
{
    return radio_seen(&radio, loop_now_us()) == RADIO_LOST;
}

static int set_up_count(void **state)
{
    char folder[80];

    set_up(state);
    memset(&chip, 0, sizeof(chip));
    snprintf(folder, sizeof(folder), "%s-beacons", fake.directory);
    mkdir(folder, 0755);
    loop_timer_init(&chip.timer, on_count, NULL);
    loop_arm(&chip.timer, loop_now_us());
    return 0;
}

static int tear_down_count(void **state)
{
    char path[80];

    loop_arm(&chip.timer, LOOP_NEVER);
    snprintf(path, sizeof(path), "%s" BEACON_COUNT_FILE, fake.directory);
    unlink(path);
    *strrchr(path, '/') = '\0';
    rmdir(path);
    return tear_down(state);
}

static void start_counted(void)
{
    start_slots();
    assert_true(loop_until(it_is_counted, 2500));
    assert_non_null(strstr(radio.detail, "the chip counts them"));
    assert_string_equal(radio_known_name(radio.known), "confirmed");
    chip.silent = true;
}

static void what_the_chip_counts_is_confirmed_by_it(void **state)
{
    (void)state;
    start_counted();
    chip.silent = false;
    assert_false(loop_until(never, 30000));
    assert_int_equal(fake.switched, 0);
    end_slots();
}

static void a_chip_that_sends_nothing_is_lost_whatever_hostapd_says(void **state)
{
    (void)state;
    start_counted();
    assert_true(loop_until(it_is_seen_lost, 3000));
    assert_true(loop_now_us() - radio.confirmed_us > BEACON_SILENCE_US); /* when it last was true */
    assert_non_null(strstr(radio.detail, "the chip sends no beacon"));
    assert_string_equal(radio_known_name(radio.known), "set");
    assert_false(loop_until(all_is_heard, 1000)); /* it goes on saying OK */
    chip.silent = false;
    assert_true(loop_until(it_is_counted, 1500));
    end_slots();
}

static void the_element_set_anew_may_bring_it_back(void **state)
{
    (void)state;
    start_counted();
    chip.by_clear = true;
    assert_true(loop_until(it_is_lost, 3000));
    assert_true(loop_until(it_is_counted, 1500));
    assert_int_equal(fake.switched, 0);
    end_slots();
}

static void then_the_interface_is_switched_off_and_on(void **state)
{
    (void)state;
    start_counted();
    chip.by_switch = true;
    assert_true(loop_until(it_is_lost, 3000));
    assert_true(loop_until(it_is_counted, 4500));
    assert_int_equal(fake.switched, 2);
    end_slots();
}

static void and_then_its_driver_is_to_be_bound_anew(void **state)
{
    (void)state;
    start_counted();
    assert_true(loop_until(it_is_lost, 3000));
    assert_true(loop_until(it_is_stuck, 6500));
    assert_int_equal(fake.switched, 2);
    fake_hostapd_die(&fake); /* by that */
    assert_true(loop_until(it_is_absent, 3000));
    chip.silent = false;
    fake_hostapd_run(&fake);
    assert_true(loop_until(it_is_counted, 3000));
    assert_false(radio.given_up);
    end_slots();
}

/* It was started anew, by what was saved because of the fault; who asks the chip wasn't. */
static void a_daemon_that_begins_beside_a_silent_chip_knows_it(void **state)
{
    (void)state;
    start_counted();
    wifi_beacon_stop();
    loop_arm(&slot, LOOP_NEVER);
    run_ms(3000);
    start_slots();
    assert_true(loop_until(it_is_seen_lost, 3500));
    assert_true(radio.silent);
    chip.silent = false;
    assert_true(loop_until(it_is_counted, 1500));
    assert_false(radio.silent);
    end_slots();
}

static bool it_is_more_than_silent(void)
{
    return radio.state == RADIO_LOST && !radio.silent;
}

/* For a version on trial it was as good as on the air. */
static void what_hostapd_refuses_is_no_mere_silence(void **state)
{
    (void)state;
    start_counted();
    assert_true(loop_until(it_is_seen_lost, 3000));
    assert_true(radio.silent);
    fake.set_reply = "FAIL\n";
    assert_true(loop_until(it_is_more_than_silent, 1500));
    end_slots();
}

/* Another chip's driver, or one that never counts: that is no silence. */
static void a_count_that_never_moved_says_nothing(void **state)
{
    (void)state;
    chip.silent = true;
    start_slots();
    assert_true(loop_until(all_is_heard, 600));
    assert_false(loop_until(it_is_seen_lost, 10000));
    assert_string_equal(radio_known_name(radio.known), "set");
    chip.says_nothing = true;
    assert_false(loop_until(it_is_seen_lost, 10000));
    end_slots();
}

static void without_the_count_hostapd_is_believed(void **state)
{
    (void)state;
    start_counted();
    chip.silent = false;
    loop_arm(&chip.timer, LOOP_NEVER);
    assert_false(loop_until(it_is_seen_lost, 10000));
    assert_string_equal(radio_known_name(radio.known), "set");
    loop_arm(&chip.timer, loop_now_us());
    assert_true(loop_until(it_is_counted, 1500));
    chip.silent = true;
    assert_true(loop_until(it_is_lost, 3000));
    loop_arm(&chip.timer, LOOP_NEVER); /* nobody says any more that it is silent */
    assert_true(loop_until(all_is_heard, 12000));
    end_slots();
}

static void the_end_takes_the_element_out_of_the_beacon(void **state)
{
    (void)state;
    start();
    assert_true(loop_until(it_is_in_the_beacon, 500));
    set(90); /* even while it is being told something else */
    wifi_beacon_stop();
    run_ms(50);
    assert_string_equal(fake.beacon, "");
    assert_int_equal(fake.sets, 3);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
#define IN_THE_KERNEL(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down_interface)
#define COUNTED(name) cmocka_unit_test_setup_teardown(name, set_up_count, tear_down_count)
    const struct CMUnitTest tests[] = {
        TEST(an_element_gets_into_the_beacon),
        TEST(an_unchanged_element_is_confirmed),
        TEST(the_same_element_is_not_sent_again),
        TEST(of_several_elements_the_newest_is_sent),
        TEST(hostapd_is_asked_once_a_second_by_itself),
        TEST(a_hostapd_that_restarts_has_the_element_within_a_second),
        TEST(a_hostapd_that_hangs_is_lost_and_asked_again),
        TEST(a_hostapd_that_passes_descriptors_is_left_alone_for_a_minute),
        TEST(a_disabled_interface_is_down_and_gets_the_element_again),
        TEST(one_that_is_given_again_does_not_wait),
        TEST(a_refused_element_is_told_and_tried_again),
        TEST(a_refused_update_is_told_and_tried_again),
        TEST(what_a_chip_refused_goes_out_shorter),
        TEST(one_that_takes_little_has_them_one_by_one),
        TEST(what_was_refused_once_goes_out_whole_again),
        TEST(no_element_of_before_stays_beside_the_later_ones),
        TEST(what_was_refused_twice_goes_out_whole_later),
        TEST(trying_more_costs_hardly_a_beacon),
        TEST(an_interface_that_is_down_is_no_refusal),
        IN_THE_KERNEL(nor_is_one_that_the_kernel_has_down),
        IN_THE_KERNEL(of_a_hostapd_that_is_gone_no_beacons_are_expected),
        TEST(two_refusals_in_a_row_lie_apart),
        TEST(one_that_was_left_off_is_switched_on),
        TEST(another_hostapd_is_given_all),
        TEST(a_hostapd_that_forgot_is_told_again_after_a_while),
        COUNTED(what_the_chip_counts_is_confirmed_by_it),
        COUNTED(a_chip_that_sends_nothing_is_lost_whatever_hostapd_says),
        COUNTED(the_element_set_anew_may_bring_it_back),
        COUNTED(then_the_interface_is_switched_off_and_on),
        COUNTED(and_then_its_driver_is_to_be_bound_anew),
        COUNTED(a_daemon_that_begins_beside_a_silent_chip_knows_it),
        COUNTED(what_hostapd_refuses_is_no_mere_silence),
        COUNTED(a_count_that_never_moved_says_nothing),
        COUNTED(without_the_count_hostapd_is_believed),
        TEST(the_end_takes_the_element_out_of_the_beacon),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
