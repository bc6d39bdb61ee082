/* Taking the last payload off the air: a controller and hostapd, played. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "simulated_time.h"

#include "fake_controller.h"
#include "fake_hostapd.h"
#include "keeper/keeper_air.h"
#include "keeper/keeper_config.h"
#include "loop_until.h"

static struct fake_controller controller;
static struct fake_hostapd hostapd;
static struct keeper_air_plan plan;
static char off[KEEPER_AIR_RESULT_SIZE], left[KEEPER_AIR_RESULT_SIZE];
static unsigned done;

static void on_done(void *context, const char *is_off, const char *is_left, int64_t now_us)
{
    (void)context;
    (void)now_us;
    done++;
    snprintf(off, sizeof(off), "%s", is_off);
    snprintf(left, sizeof(left), "%s", is_left);
}

static bool is_done(void)
{
    return done > 0;
}

static int set_up(void **state)
{
    (void)state;
    done = 0;
    memset(&plan, 0, sizeof(plan));
    fake_start(&controller, FAKE_EXTENDED | FAKE_CODED);
    fake_hostapd_start(&hostapd);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    keeper_air_stop();
    fake_end(&controller);
    return fake_hostapd_end(&hostapd) ? 0 : -1;
}

static void with_controller(void)
{
    snprintf(plan.adapter[0], sizeof(plan.adapter[0]), "%s", controller.adapter);
}

static void with_hostapd(void)
{
    snprintf(plan.hostapd_dir, sizeof(plan.hostapd_dir), "%s", hostapd.directory);
    snprintf(plan.iface, sizeof(plan.iface), "wlan0");
}

static void take_off(int ms)
{
    keeper_air_start(&plan, on_done, NULL, loop_now_us());
    assert_true(loop_until(is_done, ms));
    run_ms(5);
    assert_int_equal(done, 1);
}

static void expect_all_off(void)
{
    assert_false(controller.sets[0].enabled);
    assert_false(controller.sets[1].enabled);
    assert_string_equal(off, controller.adapter);
    assert_string_equal(left, "");
}

static void legacy_advertising_is_switched_off(void **state)
{
    (void)state;
    controller.legacy_used = true;
    controller.sets[0].known = controller.sets[0].enabled = true;
    with_controller();
    take_off(500);
    expect_all_off();
    assert_int_equal(controller.count, 2);
}

/* After extended commands, the legacy one is disallowed. */
static void both_advertising_sets_are_switched_off(void **state)
{
    (void)state;
    controller.extended_used = true;
    controller.sets[0].enabled = controller.sets[1].enabled = true;
    with_controller();
    take_off(500);
    expect_all_off();
}

/* It said that it was off, of the first set; the second one was on the air for ever. */
static void a_controller_that_takes_the_legacy_command_as_well_is_sent_both(void **state)
{
    (void)state;
    controller.takes_both = true;
    controller.sets[0].enabled = controller.sets[1].enabled = true;
    with_controller();
    take_off(500);
    expect_all_off();
}

static void a_controller_that_refuses_or_is_silent_is_named(void **state)
{
    char expected[128];

    (void)state;
    controller.extended_used = true;
    controller.refused = 0x2039;
    controller.refusal = 0x1F;
    with_controller();
    take_off(500);
    snprintf(expected, sizeof(expected), "%s (refused with status 0x1f)", controller.adapter);
    assert_string_equal(left, expected);
    assert_string_equal(off, "");

    done = 0;
    controller.mute = true;
    take_off(1500);
    snprintf(expected, sizeof(expected), "%s (no answer)", controller.adapter);
    assert_string_equal(left, expected);
}

static void a_controller_that_is_not_there_is_off_the_air(void **state)
{
    (void)state;
    with_controller();
    snprintf(plan.adapter[1], sizeof(plan.adapter[1]), "h4:/nonexistent/tty");
    take_off(500);
    assert_non_null(strstr(off, "h4:/nonexistent/tty"));
    assert_string_equal(left, "");
}

static void a_port_that_cannot_be_shared_is_left_alone_and_named(void **state)
{
    char expected[128];

    (void)state;
    with_controller();
    plan.unreachable[0] = true;
    take_off(100);
    run_ms(20);
    assert_int_equal(controller.count, 0);
    snprintf(expected, sizeof(expected), "%s (only the daemon can talk to it)", controller.adapter);
    assert_string_equal(left, expected);
}

static void hostapd_sends_no_element_any_more(void **state)
{
    (void)state;
    snprintf(hostapd.configured, sizeof(hostapd.configured), "dd05fa0bbc0d01");
    fake_hostapd_has(&hostapd, "dd05fa0bbc0d01");
    with_hostapd();
    take_off(500);
    assert_string_equal(hostapd.beacon, "");
    assert_int_equal(hostapd.sets, 1);
    assert_int_equal(hostapd.updates, 1);
    assert_string_equal(off, "wlan0");
    assert_string_equal(left, "");
}

static void a_hostapd_that_refuses_or_hangs_is_named(void **state)
{
    (void)state;
    with_hostapd();
    hostapd.update_reply = "FAIL\n";
    take_off(500);
    assert_string_equal(left, "wlan0 (hostapd refused with \"FAIL\")");
    assert_string_equal(off, "");

    done = 0;
    hostapd.hangs = true;
    take_off(1500);
    assert_string_equal(left, "wlan0 (hostapd gives no answer)");
}

static void without_hostapd_it_depends_on_the_interface(void **state)
{
    (void)state;
    fake_hostapd_die(&hostapd);
    with_hostapd();
    snprintf(plan.iface, sizeof(plan.iface), "nosuch0");
    take_off(100);
    assert_string_equal(off, "nosuch0");
    snprintf(plan.iface, sizeof(plan.iface), "lo"); /* is there on every machine */
    done = 0;
    take_off(100);
    assert_string_equal(left, "lo (hostapd does not run)");
}

static void all_radios_are_seen_to_whatever_one_of_them_does(void **state)
{
    char expected[128];

    (void)state;
    controller.mute = true;
    with_controller();
    with_hostapd();
    fake_hostapd_has(&hostapd, "dd05fa0bbc0d01");
    take_off(1500);
    assert_string_equal(hostapd.beacon, "");
    assert_string_equal(off, "wlan0");
    snprintf(expected, sizeof(expected), "%s (no answer)", controller.adapter);
    assert_string_equal(left, expected);
}

static void
a_hostapd_that_passes_descriptors_is_left_alone_and_bluetooth_is_switched_off(void **state)
{
    static const char left_alone[] = "wlan0 (hostapd passed descriptors, and is left alone)";

    (void)state;
    controller.legacy_used = true;
    controller.sets[0].known = controller.sets[0].enabled = true;
    with_controller();
    with_hostapd();
    hostapd.passes = true;
    take_off(500);
    assert_false(controller.sets[0].enabled);
    assert_string_equal(off, controller.adapter);
    assert_string_equal(left, left_alone);

    done = hostapd.requests = 0;
    take_off(500);
    assert_string_equal(left, left_alone);
    assert_int_equal(hostapd.requests, 0);
    run_ms(60000);
    hostapd.passes = false;
    done = 0;
    take_off(500);
    assert_string_equal(left, "");
}

static void no_radio_at_all_is_done_at_once(void **state)
{
    (void)state;
    keeper_air_start(&plan, on_done, NULL, loop_now_us());
    assert_int_equal(done, 1);
    assert_string_equal(off, "");
    assert_string_equal(left, "");
}

static void stopped_it_says_and_does_nothing_more(void **state)
{
    (void)state;
    hostapd.hangs = true;
    controller.mute = true;
    with_controller();
    with_hostapd();
    keeper_air_start(&plan, on_done, NULL, loop_now_us());
    run_ms(20);
    keeper_air_stop();
    run_ms(1200);
    assert_int_equal(done, 0);
    assert_int_equal(hostapd.updates, 0);
}

static void the_plan_follows_the_configuration(void **state)
{
    struct config config;

    (void)state;
    config_defaults(&config);
    keeper_air_plan(&plan, &config);
    assert_string_equal(plan.adapter[0], "hci0");
    assert_string_equal(plan.adapter[1], ""); /* long range is on the same one */
    assert_string_equal(plan.hostapd_dir, "/run/hostapd");
    assert_string_equal(plan.iface, "wlan0");
    assert_false(plan.unreachable[0]);

    config.wifi_beacon_enabled = false;
    strcpy(config.bt5_adapter, "h4:/dev/ttyUSB0");
    keeper_air_plan(&plan, &config);
    assert_string_equal(plan.adapter[1], "h4:/dev/ttyUSB0");
    assert_true(plan.unreachable[1]);
    assert_string_equal(plan.iface, "");

    config.bt4_enabled = false;
    config.bt5_adapter[0] = '\0';
    keeper_air_plan(&plan, &config);
    assert_string_equal(plan.adapter[0], "");
    assert_string_equal(plan.adapter[1], "hci0");
}

/* The daemon's own words decide, in whichever way they are written. */
static void the_configuration_is_the_daemons(void **state)
{
    char path[] = "/tmp/odid-keeper-XXXXXX", joined[64];
    char *const plain[] = {"odid-daemon", "-debug", "-config", path, NULL};
    char *const other[] = {"odid-daemon", joined, "--no-bt", "-no-wifi", NULL};
    char *const none[] = {"odid-daemon", "-config", NULL};
    static const char text[] = "[broadcast]\nwifi_iface = wlan7\nbt_adapter = hci3\n";
    struct config config;
    int fd = mkstemp(path);

    (void)state;
    assert_int_equal(write(fd, text, strlen(text)), (ssize_t)strlen(text));
    close(fd);
    keeper_config_read(&config, plain);
    assert_string_equal(config.wifi_iface, "wlan7");
    assert_string_equal(config.bt_adapter, "hci3");
    assert_true(config.wifi_beacon_enabled && config.bt4_enabled && config.bt5_enabled);

    snprintf(joined, sizeof(joined), "--config=%s", path);
    keeper_config_read(&config, other);
    assert_string_equal(config.wifi_iface, "wlan7");
    assert_false(config.wifi_beacon_enabled || config.bt4_enabled || config.bt5_enabled);

    setenv("ODID_NO_WIFI", "1", 1);
    keeper_config_read(&config, plain);
    assert_false(config.wifi_beacon_enabled);
    unsetenv("ODID_NO_WIFI");

    unlink(path);
    keeper_config_read(&config, plain); /* gone: the defaults, as for the daemon */
    assert_string_equal(config.wifi_iface, "wlan0");
    keeper_config_read(&config, none);
    assert_string_equal(config.wifi_iface, "wlan0");
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        TEST(legacy_advertising_is_switched_off),
        TEST(both_advertising_sets_are_switched_off),
        TEST(a_controller_that_takes_the_legacy_command_as_well_is_sent_both),
        TEST(a_controller_that_refuses_or_is_silent_is_named),
        TEST(a_controller_that_is_not_there_is_off_the_air),
        TEST(a_port_that_cannot_be_shared_is_left_alone_and_named),
        TEST(hostapd_sends_no_element_any_more),
        TEST(a_hostapd_that_refuses_or_hangs_is_named),
        TEST(without_hostapd_it_depends_on_the_interface),
        TEST(all_radios_are_seen_to_whatever_one_of_them_does),
        TEST(a_hostapd_that_passes_descriptors_is_left_alone_and_bluetooth_is_switched_off),
        TEST(no_radio_at_all_is_done_at_once),
        TEST(stopped_it_says_and_does_nothing_more),
        TEST(the_plan_follows_the_configuration),
        TEST(the_configuration_is_the_daemons),
    };

    if (loop_init() < 0) {
        return 1;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
