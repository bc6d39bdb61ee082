/* odidctl get, set and maintenance, as they are called. */

#include "odidctl_bench.h"

#include <inttypes.h>

#include "base/fingerprint.h"
#include "config/config.h"

#define CONF "data/odid/odid.conf"
#define ANY_KEY "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff"
#define APPLY "lib/odid/apply-configuration"
#define BEGIN "; Kept.\n[wifi]\ncountry = NO ; and this\n\n[broadcast]\nbt5_enabled = off\n"
#define ANSWER "{\"on_air\": true}"

/* ---- get ---- */

static void expect_in_force(const char *name, const char *value)
{
    char line[300];

    assert_int_equal(CALL("get", name), 0);
    snprintf(line, sizeof(line), "%s\n", value);
    assert_string_equal(said, line);
}

static void values_in_force(void **state)
{
    (void)state;
    expect_in_force("wifi.country", "SE"); /* without a file */
    put(CONF, BEGIN "[autopilot]\ndevice = /dev/ttyAMA3\n[ground_station]\naddress = laptop\n");
    expect_in_force("wifi.country", "NO");
    expect_in_force("WiFi.Country", "NO");
    expect_in_force("wifi.channel", "6");
    expect_in_force("broadcast.bt5_enabled", "false");
    expect_in_force("autopilot.device", "/dev/ttyAMA3");
    expect_in_force("maintenance.at_boot", "no");
    expect_in_force("ground_station.address", ""); /* a wrong value is not in force */
    expect_in_force("basic_id.uas_id", "");
    expect_in_force("system.operator_latitude", "");
    put(CONF, "\xFF\xFE[");
    expect_in_force("wifi.country", "SE");
    put("other.conf", "[wifi]\ncountry = FI\n");
    assert_int_equal(CALL("get", "wifi.country", "-config", "other.conf"), 0);
    assert_string_equal(said, "FI\n");
}

/* It was in effect with the next service that started anew, in mid-flight. */
static void what_was_saved_in_flight_is_not_in_force(void **state)
{
    (void)state;
    put("run/odid-appliance/odid.conf", "[wifi]\ncountry = NO\n");
    put(CONF, "[wifi]\ncountry = FI\n");
    expect_in_force("wifi.country", "NO");
    put("other.conf", "[wifi]\ncountry = DE\n");
    assert_int_equal(CALL("get", "wifi.country", "-config", "other.conf"), 0);
    assert_string_equal(said, "DE\n");
}

static void several_values_in_their_order(void **state)
{
    (void)state;
    put(CONF, BEGIN);
    assert_int_equal(CALL("get", "wifi.channel", "basic_id.uas_id", "wifi.country"), 0);
    assert_string_equal(said, "6\n\nNO\n");
    assert_int_equal(CALL("get", "wifi.country", "wifi.chanel"), 2);
    assert_null(strstr(said, "NO\n"));
}

static void unknown_keys(void **state)
{
    (void)state;
    assert_int_equal(CALL("get", "wifi.chanel"), 2);
    assert_non_null(strstr(said, "did you mean channel?"));
    assert_int_equal(CALL("get", "wfi.channel"), 2);
    assert_non_null(strstr(said, "did you mean wifi?"));
    assert_int_equal(CALL("get", "channel"), 2);
    assert_int_equal(CALL("get"), 2);
    assert_int_equal(CALL("set", "wifi.chanel", "6"), 2);
    assert_int_equal(CALL("set", "wifi.channel"), 2);
    assert_int_equal(CALL("set", "wifi.channel", "1", "2"), 2);
    expect_none(CONF);
}

static void secrets_are_not_printed(void **state)
{
    (void)state;
    put(CONF, "[operator]\noperator_id = FIN87astrdge12k8-xyz\n");
    expect_in_force("operator.operator_id", "FIN87astrdge12k8");
    expect_in_force("maintenance.password", "unset");
    put(CONF, "[maintenance]\npassword = hunter2hunter2\n");
    expect_in_force("maintenance.password", "set");
    put(CONF, "");
    put("data/secrets/maintenance.psk", ANY_KEY "\n");
    expect_in_force("maintenance.password", "set");
    put("data/secrets/maintenance.psk", "\1\2 damaged, with nothing of a key\n");
    expect_in_force("maintenance.password", "unset");
}

/* ---- set ---- */

static void a_value_is_set(void **state)
{
    (void)state;
    put(CONF, BEGIN);
    assert_int_equal(chmod(CONF, 0640), 0);
    assert_int_equal(CALL("set", "wifi.country", "fi"), 0);
    assert_string_equal(said, "Saved. Restart the daemon to make it count.\n");
    expect_file(CONF,
                "; Kept.\n[wifi]\ncountry = fi ; and this\n\n[broadcast]\nbt5_enabled = off\n");
    assert_int_equal(CALL("set", "system.operator_latitude", "-12.5"), 0);
    assert_non_null(strstr(said, "one is set without the other"));
    assert_int_equal(CALL("set", "system.operator_longitude", "-0.5"), 0);
    assert_string_equal(said, "Saved. Restart the daemon to make it count.\n");
    expect_in_force("system.operator_latitude", "-12.5");
    assert_int_equal(CALL("set", "self_id.description", "a; b"), 0);
    expect_in_force("self_id.description", "a; b");
    expect_none("data/odid/.odid.conf.new");
    assert_int_equal(CALL("get", "wifi.country"), 0);
}

static void without_a_file(void **state)
{
    (void)state;
    assert_int_equal(CALL("set", "wifi.channel", "11"), 0);
    expect_file(CONF, "[wifi]\nchannel = 11\n");
    shell("rm -r data/odid");
    assert_int_equal(CALL("set", "wifi.channel", "11"), 1);
    assert_non_null(strstr(said, "nothing was changed"));
}

static void wrong_values_change_nothing(void **state)
{
    static const struct {
        const char *name, *value, *sentence;
    } cases[] = {
        {"wifi.channel", "14", "[wifi] channel = \"14\": expected "},
        {"wifi.channel", "", "[wifi] channel = \"\": expected "},
        {"wifi.country", "Norge",
         "expected the two letters of a country, such as SE or GB (not EU); using NO"},
        {"wifi.country", "uk", "did you mean GB?; using NO"},
        {"system.operator_latitude", "57,7", "write 57.7, with a point"},
        {"system.operator_latitude", "91", "degrees from -90 to 90"},
        {"self_id.description", "123456789012345678901234", "24 characters long, 23 fit"},
        {"self_id.description", "FIN87astrdge12k8-xyz", "holds the secret part"},
        {"self_id.description", "a\n[wifi]", "holds control characters"},
        {"self_id.description", "it's \"a\"", "can't hold that value"},
        {"basic_id.uas_id", "SSRS5GBG01234567890123", "20 fit on the air"},
        {"operator.operator_id", "FIN87\xC3\xA5strdge12k8", "expected only ASCII"},
        {"broadcast.bt5_enabled", "maybe", "expected true or false"},
        {"maintenance.password", "short", "expected 8-63 ASCII characters"},
        {"autopilot.device", "ttyACM0", "usb:VVVV:PPPP"},
    };

    (void)state;
    put(CONF, BEGIN);
    for (size_t i = 0; i < COUNT(cases); i++) {
        assert_int_equal(CALL("set", cases[i].name, cases[i].value), 1);
        assert_non_null(strstr(said, cases[i].sentence));
        assert_non_null(strcasestr(said, "nothing was changed"));
        expect_file(CONF, BEGIN);
    }
    put(CONF, "\xFF\xFE[\x01");
    assert_int_equal(CALL("set", "wifi.channel", "1"), 1);
    assert_non_null(strstr(said, "is UTF-16 text"));
    expect_file(CONF, "\xFF\xFE[\x01");
}

/* The guard of prevent_downgrade was gone at the next power-on, and nobody had looked. */
static void who_saves_settings_has_seen_which_were_lost(void **state)
{
    static const struct {
        const char *key, *value;
        int code;
        bool seen;
    } saved[] = {{"wifi.channel", "11", 0, true},
                 {"wifi.channel", "6", 0, true},
                 {"wifi.country", "NO", 0, true}, /* it stands there already */
                 {"wifi.channel", "99", 1, false},
                 {"maintenance.password", "long enough", 0, false}};

    (void)state;
    for (size_t i = 0; i < COUNT(saved); i++) {
        put(CONF, BEGIN);
        put("data/odid/settings-lost", "0123456789abcdef\n");
        put("run/faults/settings", "What was set is lost.\n");
        assert_int_equal(CALL("set", saved[i].key, saved[i].value), saved[i].code);
        assert_int_equal(access("data/odid/settings-lost", F_OK), saved[i].seen ? -1 : 0);
        assert_int_equal(access("run/faults/settings", F_OK), saved[i].seen ? -1 : 0);
    }
}

static void the_operator_number_without_its_secret(void **state)
{
    (void)state;
    assert_int_equal(CALL("set", "operator.operator_id", "FIN87astrdge12k8-xyz"), 0);
    assert_non_null(strstr(said, "check character right"));
    assert_null(strstr(said, "xyz"));
    expect_file(CONF, "[operator]\noperator_id = FIN87astrdge12k8\n");
}

/* 64 digits, which IEEE 802.11 annex J.4 has for this password and this name. */
static void the_password_becomes_a_key(void **state)
{
    struct stat file;

    (void)state;
    put(CONF, BEGIN);
    put("data/secrets/wifi_ssid", "IEEE\n");
    assert_int_equal(CALL("set", "maintenance.password", "password"), 0);
    assert_null(strstr(said, "password"));
    expect_file("data/secrets/maintenance.psk",
                "f42c6fc52df0ebef9ebb4b90b38a5f902e83fe1b135a70e23aed762e9710a12e\nIEEE\n");
    assert_int_equal(stat("data/secrets/maintenance.psk", &file), 0);
    assert_int_equal(file.st_mode & 0777, 0600);
    expect_file(CONF, BEGIN);
    expect_in_force("maintenance.password", "set");
    assert_int_equal(CALL("set", "maintenance.password", ""), 0);
    expect_none("data/secrets/maintenance.psk");
    /* Another name, another key. */
    put("data/secrets/wifi_ssid", "ThisIsASSID\n");
    shell("rm -r data/secrets/maintenance.psk 2>/dev/null; true");
    assert_int_equal(CALL("set", "maintenance.password", "ThisIsAPassword"), 0);
    expect_file("data/secrets/maintenance.psk",
                "0dc0d6eb90555ed6419756b9a15ec3e3209b63df707dd508d14581f8982721af\nThisIsASSID\n");
}

/* ---- the daemon ---- */

/* It has read that file. */
static pid_t daemon_with(const char *conf)
{
    uint64_t sentences = FINGERPRINT_OF_NOTHING;
    char status[100];
    struct config config;

    put("odid.conf", conf);
    config_defaults(&config);
    config_read_file(&config, "odid.conf", config_add_sentence, &sentences);
    snprintf(status, sizeof(status), "{\"configuration\": {\"fingerprint\": \"%016" PRIx64 "\"}}",
             config_fingerprint(&config, sentences));
    return answer_with(status);
}

/* ---- making it count ---- */

static void put_apply(const char *script)
{
    put(APPLY, script);
    assert_int_equal(chmod(APPLY, 0755), 0);
}

static void it_is_applied_unless_armed(void **state)
{
    pid_t daemon;

    (void)state;
    put_apply("#!/bin/sh\necho applied >>applied\n");
    unlink("applied");

    /* The daemon answers, and no autopilot was heard: disarmed. */
    keep_armed("unheard");
    daemon = daemon_with("; nothing\n");
    assert_int_equal(CALL("set", "wifi.channel", "1"), 0);
    assert_string_equal(said, "Saved, and in effect.\n");
    expect_file("applied", "applied\n");
    assert_int_equal(CALL("set", "wifi.channel", "1"), 0);
    assert_string_equal(said, "It is set to that already.\nSaved, and in effect.\n");
    expect_file("applied", "applied\napplied\n");

    keep_armed("yes");
    assert_int_equal(CALL("set", "wifi.channel", "2"), 0);
    assert_non_null(strstr(said, "after the next power-on"));
    expect_file("applied", "applied\napplied\n");
    expect_in_force("wifi.channel", "2");

    /* The same once more, on the ground. */
    keep_armed("no");
    unlink("applied");
    assert_int_equal(CALL("set", "wifi.channel", "2"), 0);
    expect_file("applied", "applied\n");
    assert_int_equal(CALL("set", "wifi.channel", "3"), 0);
    expect_file("applied", "applied\napplied\n");
    end(daemon);

    /* The daemon doesn't answer: what it said last may be old. */
    assert_int_equal(CALL("set", "wifi.channel", "4"), 0);
    assert_non_null(strstr(said, "after the next power-on"));
    unlink("run/odid/kept");
    assert_int_equal(CALL("set", "wifi.channel", "5"), 0);
    assert_non_null(strstr(said, "after the next power-on"));
    expect_file("applied", "applied\napplied\n");
    keep_armed("no");
    daemon = daemon_with("; nothing\n");

    /* It is looked whether it did any good: what was wrong before isn't its doing. */
    put("run/faults/old", "Something is wrong for 3 s.\n");
    put_apply("#!/bin/sh\necho 'Something is wrong for 9 s.' >run/faults/old\n");
    assert_int_equal(CALL("set", "wifi.channel", "7"), 0);
    assert_string_equal(said, "Saved, and in effect.\n");
    put_apply("#!/bin/sh\necho 'wlan7 is not there.' >run/faults/wifi\n");
    assert_int_equal(CALL("set", "broadcast.wifi_iface", "wlan7"), 4);
    assert_string_equal(said, "Saved; but since then: wlan7 is not there.\n");

    /* Nobody saw to it. */
    put_apply("#!/bin/sh\n");
    assert_int_equal(CALL("set", "self_id.description", "Search"), 4);
    assert_string_equal(said, "Saved; but the daemon doesn't run with it.\n");

    put_apply("#!/bin/sh\nexit 3\n");
    assert_int_equal(CALL("set", "wifi.channel", "6"), 4);
    assert_non_null(strstr(said, "saved, but ./" APPLY " failed"));
    end(daemon);
    expect_in_force("wifi.channel", "6");
    unlink(APPLY);
}

/* ---- what the daemon runs with ---- */

static void what_the_daemon_runs_with(void **state)
{
    pid_t daemon;

    (void)state;
    put(CONF, BEGIN);
    assert_int_equal(CALL("in-force"), 1); /* nobody says so */
    daemon = daemon_with(BEGIN);
    assert_int_equal(CALL("in-force"), 0);
    assert_int_equal(CALL("set", "wifi.channel", "11"), 0); /* hostapd's */
    assert_int_equal(CALL("in-force"), 0);
    assert_int_equal(CALL("set", "self_id.description", "Search"), 0);
    assert_int_equal(CALL("in-force"), 1);
    assert_int_equal(CALL("set", "self_id.description", ""), 0);
    assert_int_equal(CALL("in-force"), 0);
    put(CONF, BEGIN "[wifi]\nchanel = 11\n"); /* it has to say that */
    assert_int_equal(CALL("in-force"), 1);
    end(daemon);
    daemon = daemon_with(BEGIN "[wifi]\nchanel = 11\n");
    assert_int_equal(CALL("in-force"), 0);
    end(daemon);
    put(CONF, BEGIN);
    daemon = answer_with(ANSWER); /* an older one, which doesn't say */
    assert_int_equal(CALL("in-force"), 1);
    end(daemon);
}

/* ---- maintenance ---- */

static void maintenance_on_and_off(void **state)
{
    pid_t daemon;

    (void)state;
    assert_int_equal(CALL("maintenance"), 2);
    assert_int_equal(CALL("maintenance", "maybe"), 2);
    assert_int_equal(CALL("maintenance", "on"), 1); /* nobody says that it is disarmed */
    expect_none("run/odid-appliance/maintenance-asked");
    keep_armed("unheard");
    daemon = answer_with(ANSWER);
    assert_int_equal(CALL("maintenance", "on"), 4);
    assert_non_null(strstr(said, "nobody can join"));
    put("data/secrets/maintenance.psk", ANY_KEY "\n");
    assert_int_equal(CALL("maintenance", "on"), 0);
    expect_file("run/odid-appliance/maintenance-asked", "");
    assert_int_equal(CALL("maintenance", "off"), 0);
    expect_none("run/odid-appliance/maintenance-asked");
    assert_int_equal(CALL("maintenance", "off"), 0);
    keep_armed("yes");
    assert_int_equal(CALL("maintenance", "on"), 1);
    expect_none("run/odid-appliance/maintenance-asked");
    keep_armed("no");
    shell("rm -r run/odid-appliance");
    assert_int_equal(CALL("maintenance", "on"), 1);
    end(daemon);
}

#define TEST(function) cmocka_unit_test_setup(function, bench_clear)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(values_in_force),
        TEST(what_was_saved_in_flight_is_not_in_force),
        TEST(several_values_in_their_order),
        TEST(unknown_keys),
        TEST(secrets_are_not_printed),
        TEST(a_value_is_set),
        TEST(without_a_file),
        TEST(wrong_values_change_nothing),
        TEST(who_saves_settings_has_seen_which_were_lost),
        TEST(the_operator_number_without_its_secret),
        TEST(the_password_becomes_a_key),
        TEST(it_is_applied_unless_armed),
        TEST(what_the_daemon_runs_with),
        TEST(maintenance_on_and_off),
    };

    return cmocka_run_group_tests(tests, bench_make, bench_remove);
}
