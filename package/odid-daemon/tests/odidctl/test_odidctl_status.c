/* odidctl status: the appliance's faults beside what the daemon says. */
#include <json-c/json_tokener.h>

#include "odidctl_bench.h"

#define ON_AIR "{\"on_air\": true, \"version\": \"1\"}"
#define NOT_ON_AIR "{\"on_air\": false, \"version\": \"1\"}"

static void faults_in_the_table(void **state)
{
    pid_t daemon = answer_with(ON_AIR);

    (void)state;
    assert_int_equal(CALL("status"), 0);
    assert_null(strstr(said, "The appliance"));
    put("run/faults/wireless", "There is no Wi-Fi interface.\n");
    put("run/faults/data", "/data is full.");
    put("run/faults/empty", "");
    put("run/faults/.hidden", "half written\n");
    assert_int_equal(CALL("status"), 0); /* they don't say what is on the air */
    assert_non_null(strstr(said, "The appliance\n"
                                 "  data             /data is full.\n"
                                 "  empty            (no more is known)\n"
                                 "  wireless         There is no Wi-Fi interface.\n"));
    assert_null(strstr(said, "half written"));
    shell("rm -r run/faults");
    assert_int_equal(CALL("status"), 0);
    end(daemon);
    daemon = answer_with(NOT_ON_AIR);
    assert_int_equal(CALL("status"), 1);
    end(daemon);
}

/* A terminal obeys what begins with an escape. */
static void no_word_to_the_terminal(void **state)
{
    pid_t daemon =
        answer_with("{\"on_air\": true, \"version\": \"1\\u001b[2J\", \"faults\": [\"\\u001b]0;x"
                    "\\u0007\"], \"identity\": {\"uas_id\": \"A\\u009b2J\\u001bc\"}}");

    (void)state;
    assert_int_equal(CALL("status"), 0);
    assert_non_null(strstr(said, "1?[2J"));
    assert_null(strchr(said, '\033'));
    assert_null(strstr(said, "\xC2\x9B"));
    end(daemon);
}

static void faults_in_json(void **state)
{
    pid_t daemon = answer_with(ON_AIR);
    struct json_object *status, *faults, *fault;

    (void)state;
    put("run/faults/data", "/data \"is\" full\x01\xFF.\nmore\n");
    assert_int_equal(CALL("status", "--json"), 0);
    status = json_tokener_parse(said);
    faults = json_object_object_get(status, "appliance_faults");
    assert_int_equal(json_object_array_length(faults), 1);
    fault = json_object_array_get_idx(faults, 0);
    assert_string_equal(json_object_get_string(json_object_object_get(fault, "name")), "data");
    assert_string_equal(json_object_get_string(json_object_object_get(fault, "sentence")),
                        "/data \"is\" full??.");
    json_object_put(status);
    unlink("run/faults/data");
    assert_int_equal(CALL("--json", "status"), 0);
    status = json_tokener_parse(said);
    assert_int_equal(json_object_array_length(json_object_object_get(status, "appliance_faults")),
                     0);
    json_object_put(status);
    end(daemon);
}

static void updates(void **state)
{
    pid_t daemon = answer_with(ON_AIR);
    struct json_object *status;

    (void)state;
    assert_int_equal(CALL("status"), 0);
    assert_null(strstr(said, "Updates"));
    put("run/odid-appliance/update-state.json",
        "{\"state\": \"trial\", \"sentence\": \"Version 2 is on trial.\"}");
    assert_int_equal(CALL("status"), 0);
    assert_non_null(strstr(said, "Updates\n"
                                 "  Now              Version 2 is on trial.\n"
                                 "  The last one     none yet\n"));
    put("data/odid/update.json",
        "{\"outcome\": \"refused\", \"sentence\": \"The update was refused: why.\"}");
    assert_int_equal(CALL("status"), 0);
    assert_non_null(strstr(said, "  The last one     The update was refused: why.\n"));
    assert_int_equal(CALL("status", "--json"), 0);
    status = json_tokener_parse(said);
    assert_string_equal(json_object_get_string(json_object_object_get(
                            json_object_object_get(status, "last_update"), "outcome")),
                        "refused");
    json_object_put(status);
    assert_int_equal(CALL("update"), 0);
    assert_string_equal(said, "Version 2 is on trial.\n"
                              "The last one: The update was refused: why.\n");
    shell("rm run/odid-appliance/update-state.json data/odid/update.json");
    assert_int_equal(CALL("update"), 3);
    end(daemon);
}

/* In each case in which it isn't known to be disarmed. */
static void armed_is_what_the_daemon_keeps(void **state)
{
    pid_t daemon = answer_with("{\"on_air\": true}");

    (void)state;
    assert_int_equal(CALL("armed"), 0);
    assert_string_equal(said, "unknown never 0 unheard\n");
    keep_armed("yes");
    assert_int_equal(CALL("armed"), 0);
    assert_string_equal(said, "armed once 7 said\n");
    keep_armed("unheard");
    assert_int_equal(CALL("armed"), 1);
    assert_string_equal(said, "disarmed never 7 unheard\n");
    keep_armed("no");
    assert_int_equal(CALL("armed"), 1);
    assert_string_equal(said, "disarmed never 7 said\n");
    keep_armed("silent"); /* switched off, on the ground */
    assert_int_equal(CALL("armed"), 1);
    assert_string_equal(said, "disarmed never 7 silent\n");
    keep_armed("awaited");
    assert_int_equal(CALL("armed"), 1);
    assert_string_equal(said, "disarmed never 7 awaited\n");
    keep_armed("unsaid");
    assert_int_equal(CALL("armed"), 0);
    assert_string_equal(said, "unknown never 7 unsaid\n");
    put("run/odid/kept", "nonsense");
    assert_int_equal(CALL("armed"), 0);
    shell("rm run/odid/kept; ln -s ../../kept run/odid/kept; echo armed no >kept");
    assert_int_equal(CALL("armed"), 0);
    shell("rm run/odid/kept; mkfifo run/odid/kept");
    assert_int_equal(CALL("armed"), 0);
    shell("rm run/odid/kept");
    keep_armed("no");
    end(daemon);
    assert_int_equal(CALL("armed"), 0);
    assert_string_equal(said, "unknown never 7 said\n");
}

/* A file that it couldn't replace, or make. */
static void what_it_says_itself_counts_beside_an_old_no(void **state)
{
    pid_t daemon = answer_with("{\"on_air\": true, \"aircraft\": {\"armed\": true}}");

    (void)state;
    keep_armed("no");
    assert_int_equal(CALL("armed"), 0);
    assert_string_equal(said, "armed never 7 said\n");
    shell("rm run/odid/kept");
    assert_int_equal(CALL("armed"), 0);
    assert_string_equal(said, "armed never 0 unheard\n");
    keep_armed("no");
    end(daemon);
}

static void factory_reset(void **state)
{
    pid_t daemon = answer_with("{\"on_air\": true}");

    (void)state;
    keep_armed("yes");
    assert_int_equal(CALL("factory-reset"), 1);
    expect_none("data/odid/factory-reset");
    keep_armed("unheard");
    assert_int_equal(CALL("factory-reset"), 4); /* this is no appliance: nothing is restarted */
    assert_non_null(got("data/odid/factory-reset"));
    shell("rm data/odid/factory-reset && touch run/odid-appliance/data-in-memory");
    assert_int_equal(CALL("factory-reset"), 1); /* it would be gone with the power */
    expect_none("data/odid/factory-reset");
    shell("rm -r data run/odid-appliance/data-in-memory");
    assert_int_equal(CALL("factory-reset"), 1);
    assert_non_null(strstr(said, "nothing has changed"));
    end(daemon);
}

/* On a slow disk the mark takes seconds, and the board restarted in the air. */
static void armed_meanwhile_nothing_is_reset(void **state)
{
    pid_t daemon = answer_with_then("{\"on_air\": true}", "{\"aircraft\": {\"armed\": true}}");

    (void)state;
    keep_armed("no");
    shell("mkdir -p data/odid");
    assert_int_equal(CALL("factory-reset"), 1);
    assert_non_null(strstr(said, "The aircraft is armed: no factory reset; nothing has"));
    expect_none("data/odid/factory-reset");
    end(daemon);
}

/* Then they matter most. */
static void faults_without_a_daemon(void **state)
{
    (void)state;
    put("run/faults/data", "/data is full.\n");
    assert_int_equal(CALL("status"), 3);
    assert_non_null(strstr(said, "the daemon is not running"));
    assert_non_null(strstr(said, "/data is full."));
}

/* With another [daemon] run_dir; the rest is where it always is. */
static void a_daemon_elsewhere(void **state)
{
    (void)state;
    put("run/faults/data", "/data is full.\n");
    assert_int_equal(CALL("-run-dir", "elsewhere", "status"), 3);
    assert_non_null(strstr(said, "(elsewhere/status.sock: "));
    assert_non_null(strstr(said, "/data is full."));
}

static void nonsense_for_an_answer(void **state)
{
    pid_t daemon = answer_with("[1, 2");

    (void)state;
    assert_int_equal(CALL("status"), 3);
    assert_non_null(strstr(said, "can't be understood"));
    end(daemon);
}

static void wrong_command_lines(void **state)
{
    (void)state;
    assert_int_equal(CALL("status", "now"), 2);
    assert_int_equal(CALL("stat"), 2);
    assert_int_equal(CALL("-wrong", "status"), 2);
    assert_int_equal(CALL("check"), 2);
    assert_int_equal(CALL("import"), 2);
    assert_int_equal(CALL("flights", "1", "2"), 2);
    assert_int_equal(CALL("a", "b", "c", "d", "e", "f"), 2);
    assert_int_equal(CALL("--help"), 0);
    assert_int_equal(CALL("status", "--version"), 0);
}

static void check_knows_the_appliance(void **state)
{
    (void)state;
    put("odid.conf", "[basic_id]\nuas_id = SSRS5GBG01\n[operator]\noperator_id = "
                     "SWE3jxza7qbzvu5d\n[wifi]\nchannel = 6\n[maintenance]\npassword = "
                     "hunter2hunter2\n");
    assert_int_equal(CALL("check", "odid.conf"), 0);
    assert_string_equal(said, "odid.conf: nothing is wrong\n");
    put("odid.conf", "[wifi]\nchannel = 36\n");
    assert_int_equal(CALL("check", "odid.conf"), 1);
    assert_non_null(strstr(said, "odid.conf line 2: [wifi] channel = \"36\": expected "));
}

#define CHANNEL(state, stuck, since)                                                               \
    "{\"state\": \"" state "\", \"stuck\": " stuck ", \"since_s\": " since "}"

static void expect_radios(const char *bt4, const char *bt5, const char *wifi, const char *expected)
{
    char status[512];
    pid_t daemon;

    snprintf(status, sizeof(status), "{\"channels\": {\"bt4\": %s, \"bt5\": %s, \"wifi\": %s}}",
             bt4, bt5, wifi);
    daemon = answer_with(status);
    assert_int_equal(CALL("radios"), 0);
    assert_string_equal(said, expected);
    end(daemon);
}

/* By the names that the configuration has, whatever the daemon says. */
static void radios_for_scripts(void **state)
{
    static const char on[] = CHANNEL("on air", "false", "61.9");
    static const char stuck[] = CHANNEL("lost", "true", "3.00");
    static const char off[] = CHANNEL("starting", "false", "700");
    static const char disabled[] = CHANNEL("disabled", "false", "700");

    (void)state;
    expect_radios(on, off, stuck, "hci0 on-air 61\nwlan0 stuck 0\n");
    expect_radios(on, stuck, off, "hci0 on-air 61\nwlan0 off 0\n"); /* it has both */
    expect_radios(stuck, off, on, "hci0 stuck 0\nwlan0 on-air 61\n");
    expect_radios(disabled, off, disabled, "hci0 off 0\n");
    put("data/odid/odid.conf", "[broadcast]\nbt5_adapter = hci1\nwifi_iface = wlan1\n");
    expect_radios(on, stuck, off, "hci0 on-air 61\nhci1 stuck 0\nwlan1 off 0\n");
    expect_radios("7", "null", "{\"state\": 7, \"stuck\": \"no\", \"since_s\": []}",
                  "hci0 off 0\nhci1 off 0\nwlan1 off 0\n");
    expect_radios(CHANNEL("on air", "true", "1e300"), CHANNEL("on air", "true", "-7"), on,
                  "hci0 on-air 1000000000\nhci1 on-air 0\nwlan1 on-air 61\n");
    assert_int_equal(CALL("radios"), 3);
    assert_string_equal(said, "");
}

#define TEST(function) cmocka_unit_test_setup(function, bench_clear)

int main(void)
{
    const struct CMUnitTest tests[] = {
        TEST(faults_in_the_table),
        TEST(no_word_to_the_terminal),
        TEST(faults_in_json),
        TEST(updates),
        TEST(armed_is_what_the_daemon_keeps),
        TEST(what_it_says_itself_counts_beside_an_old_no),
        TEST(radios_for_scripts),
        TEST(factory_reset),
        TEST(armed_meanwhile_nothing_is_reset),
        TEST(faults_without_a_daemon),
        TEST(a_daemon_elsewhere),
        TEST(nonsense_for_an_answer),
        TEST(wrong_command_lines),
        TEST(check_knows_the_appliance),
    };

    return cmocka_run_group_tests(tests, bench_make, bench_remove);
}
