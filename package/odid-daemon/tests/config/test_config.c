/* The configuration's keys: what is written, and what it gives. */
#include "config_helper.h"

#include <math.h>

#include "base/fingerprint.h"

/* ---- good ones ---- */

static void the_defaults(void **state)
{
    (void)state;
    config_defaults(&config);
    assert_string_equal(config.basic_id[0].uas_id, "");
    assert_int_equal(config.basic_id[0].id_type, 1);
    assert_int_equal(config.basic_id[1].ua_type, CONFIG_UA_TYPE_AUTO);
    assert_int_equal(config.source, MAVLINK_SOURCE_SERIAL);
    assert_string_equal(config.device, "/dev/ttyACM0");
    assert_int_equal(config.baud, 921600);
    assert_string_equal(config.udp_address, "127.0.0.1");
    assert_int_equal(config.udp_port, 14550);
    assert_true(config.request_rate && config.bt4_enabled && config.bt5_enabled);
    assert_true(config.wifi_beacon_enabled && !config.debug && !config.classification_set);
    assert_int_equal(config.classification_type, 1);
    assert_string_equal(config.wifi_iface, "wlan0");
    assert_string_equal(config.hostapd_dir, "/run/hostapd");
    assert_string_equal(config.bt_adapter, "hci0");
    assert_string_equal(config.bt5_adapter, "");
    assert_string_equal(config.run_dir, "/run/odid");
    assert_string_equal(config.user, "odid");
    assert_true(isnan(config.bench_latitude_deg) && isnan(config.operator_longitude_deg));
    assert_true(isnan(config.operator_altitude_m));
}

static void every_key_is_taken(void **state)
{
    (void)state;
    expect("[basic_id]\nuas_id = SSRS5GBG01\nid_type = serial\nua_type = aeroplane\n"
           "[basic_id_2]\nuas_id = 'SE-ABC'\nid_type = registration\nua_type = glider\n"
           "[operator]\noperator_id = SWE3jxza7qbzvu5d\noperator_id_type = operator_id\n"
           "[self_id]\ndescription = \"Sea rescue surveillance\"\ndescription_type = text\n"
           "[system]\noperator_location_type = fixed\noperator_latitude = 57.7089\n"
           "operator_longitude = -11.9746\noperator_altitude = 40.5\nclassification_type = eu\n"
           "category = specific\nclass = C4\n"
           "[mavlink]\nsource = udp\ndevice = /dev/serial0\nbaud = 57600\n"
           "udp_address = 0.0.0.0\nudp_port = 14551\nrequest_rate = no\n"
           "[broadcast]\nbt4_enabled = off\nbt5_enabled = false\nwifi_beacon_enabled = 0\n"
           "wifi_iface = wlan1\nhostapd_dir = /var/run/hostapd\nbt_adapter = hci1\n"
           "bt5_adapter = h4:/dev/ttyUSB0@115200\n"
           "[bench]\nlatitude = -90\nlongitude = +180.0\n"
           "[daemon]\nrun_dir = /tmp/odid\nuser = nobody\n",
           "");
    assert_string_equal(config.basic_id[0].uas_id, "SSRS5GBG01");
    assert_int_equal(config.basic_id[0].ua_type, 1);
    assert_string_equal(config.basic_id[1].uas_id, "SE-ABC");
    assert_int_equal(config.basic_id[1].id_type, 2);
    assert_int_equal(config.basic_id[1].ua_type, 6);
    assert_string_equal(config.operator_id, "SWE3jxza7qbzvu5d");
    assert_string_equal(config.description, "Sea rescue surveillance");
    assert_int_equal(config.operator_location_type, 2);
    assert_true(config.operator_latitude_deg == 57.7089);
    assert_true(config.operator_longitude_deg == -11.9746);
    assert_true(config.operator_altitude_m == 40.5);
    assert_true(config.classification_set);
    assert_int_equal(config.category, 2);
    assert_int_equal(config.class_eu, 5);
    assert_int_equal(config.source, MAVLINK_SOURCE_UDP);
    assert_string_equal(config.device, "/dev/serial0");
    assert_int_equal(config.baud, 57600);
    assert_string_equal(config.udp_address, "0.0.0.0");
    assert_int_equal(config.udp_port, 14551);
    assert_false(config.request_rate || config.bt4_enabled || config.bt5_enabled);
    assert_false(config.wifi_beacon_enabled);
    assert_string_equal(config.wifi_iface, "wlan1");
    assert_string_equal(config.hostapd_dir, "/var/run/hostapd");
    assert_string_equal(config.bt_adapter, "hci1");
    assert_string_equal(config.bt5_adapter, "h4:/dev/ttyUSB0@115200");
    assert_true(config.bench_latitude_deg == -90 && config.bench_longitude_deg == 180);
    assert_string_equal(config.run_dir, "/tmp/odid");
    assert_string_equal(config.user, "nobody");
}

/* Field by field: what is written, and the byte that it gives. */
static void names_of_codes(void **state)
{
    static const struct {
        const char *line;
        size_t offset;
        int code;
    } cases[] = {
        {"[basic_id]\nid_type = none", offsetof(struct config, basic_id[0].id_type), 0},
        {"[basic_id]\nid_type = Serial", offsetof(struct config, basic_id[0].id_type), 1},
        {"[basic_id]\nid_type = utm", offsetof(struct config, basic_id[0].id_type), 3},
        {"[basic_id]\nid_type = session", offsetof(struct config, basic_id[0].id_type), 4},
        {"[self_id]\ndescription_type = emergency", offsetof(struct config, description_type), 1},
        {"[self_id]\ndescription_type = extended_status", offsetof(struct config, description_type),
         2},
        {"[system]\noperator_location_type = takeoff",
         offsetof(struct config, operator_location_type), 0},
        {"[system]\noperator_location_type = live_gnss",
         offsetof(struct config, operator_location_type), 1},
        {"[system]\noperator_location_type = dynamic",
         offsetof(struct config, operator_location_type), 1},
        {"[system]\nclassification_type = undeclared", offsetof(struct config, classification_type),
         0},
        {"[system]\ncategory = undeclared", offsetof(struct config, category), 0},
        {"[system]\ncategory = OPEN", offsetof(struct config, category), 1},
        {"[system]\ncategory = certified", offsetof(struct config, category), 3},
        {"[system]\nclass = undeclared", offsetof(struct config, class_eu), 0},
        {"[system]\nclass = C0", offsetof(struct config, class_eu), 1},
        {"[system]\nclass = c3", offsetof(struct config, class_eu), 4},
        {"[system]\nclass = C6", offsetof(struct config, class_eu), 7},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        expect(cases[i].line, "");
        assert_int_equal(*((uint8_t *)&config + cases[i].offset), cases[i].code);
    }
}

static void every_ua_type(void **state)
{
    static const char *const names[] = {"none",
                                        "aeroplane",
                                        "helicopter_or_multirotor",
                                        "gyroplane",
                                        "hybrid_lift",
                                        "ornithopter",
                                        "glider",
                                        "kite",
                                        "free_balloon",
                                        "captive_balloon",
                                        "airship",
                                        "parachute",
                                        "rocket",
                                        "tethered",
                                        "ground_obstacle",
                                        "other"};
    char text[64], note[96];

    (void)state;
    for (int code = 0; code < (int)COUNT(names); code++) {
        snprintf(text, sizeof(text), "[basic_id]\nua_type = %s\n", names[code]);
        expect(text, "");
        assert_int_equal(config.basic_id[0].ua_type, code);
        snprintf(text, sizeof(text), "[basic_id]\nua_type = %d\n", code);
        snprintf(note, sizeof(note),
                 "note: odid.conf line 2: [basic_id] ua_type = %d means %s on the air\n", code,
                 names[code]);
        expect(text, note);
        assert_int_equal(config.basic_id[0].ua_type, code);
    }
    expect("[basic_id]\nua_type = multirotor\n", "");
    assert_int_equal(config.basic_id[0].ua_type, 2);
    expect("[basic_id]\nua_type = glider\nua_type = auto\n",
           "note: odid.conf line 3: [basic_id] ua_type is set again (before in line 2); this one "
           "counts\n");
    assert_int_equal(config.basic_id[0].ua_type, CONFIG_UA_TYPE_AUTO);
}

/* The field study's example: its comments and its codes disagree. */
static void numbers_are_on_air_codes(void **state)
{
    (void)state;
    expect("[system]\ncategory = 3 ; Specific\nclass = 4 ; C4\n",
           "note: odid.conf line 2: [system] category = 3 means certified on the air\n"
           "note: odid.conf line 3: [system] class = 4 means C3 on the air\n");
    assert_int_equal(config.category, 3);
    assert_int_equal(config.class_eu, 4);
    assert_string_equal(config_category_name(2), "specific");
    assert_string_equal(config_category_name(4), "reserved");
    assert_string_equal(config_class_name(0), "undeclared");
    assert_string_equal(config_class_name(5), "C4");
    assert_string_equal(config_class_name(8), "reserved");
    expect("[basic_id]\nid_type = 4\n[self_id]\ndescription_type = 2\n[operator]\n"
           "operator_id_type = 0\n[system]\noperator_location_type = 0\nclassification_type = 1\n",
           "note: odid.conf line 2: [basic_id] id_type = 4 means session on the air\n"
           "note: odid.conf line 4: [self_id] description_type = 2 means extended_status on the "
           "air\n"
           "note: odid.conf line 6: [operator] operator_id_type = 0 means operator_id on the air\n"
           "note: odid.conf line 8: [system] operator_location_type = 0 means takeoff on the air\n"
           "note: odid.conf line 9: [system] classification_type = 1 means eu on the air\n");
}

static void booleans(void **state)
{
    static const char *const yes[] = {"true", "yes", "on", "1", "TRUE", "Yes"};
    static const char *const no[] = {"false", "no", "off", "0", "OFF", "\"no\""};
    char text[64];

    (void)state;
    for (size_t i = 0; i < COUNT(yes); i++) {
        snprintf(text, sizeof(text), "[broadcast]\nbt4_enabled = no\nbt4_enabled = %s\n", yes[i]);
        assert_int_equal(parse(text), 0);
        assert_true(config.bt4_enabled);
        snprintf(text, sizeof(text), "[broadcast]\nbt4_enabled = %s\n", no[i]);
        assert_int_equal(parse(text), 0);
        assert_false(config.bt4_enabled);
    }
}

static void every_speed(void **state)
{
    static const unsigned good[] = {1200, 9600, 57600, 115200, 460800, 921600, 1500000, 4000000};
    static const char *const bad[] = {"0",  "1",      "57601",       "115200.0",
                                      "-1", "0x1000", "999999999999"};
    char text[64];

    (void)state;
    for (size_t i = 0; i < COUNT(good); i++) {
        snprintf(text, sizeof(text), "[mavlink]\nbaud = %u\n", good[i]);
        expect(text, "");
        assert_int_equal(config.baud, good[i]);
    }
    for (size_t i = 0; i < COUNT(bad); i++) {
        snprintf(text, sizeof(text), "[mavlink]\nbaud = %s\n", bad[i]);
        assert_int_equal(parse(text), 1);
        assert_int_equal(config.baud, 921600);
    }
}

/* ---- environment ---- */

static const char *const *variables; /* name, value, ..., NULL */

static const char *lookup(const char *name)
{
    for (size_t i = 0; variables[i] != NULL; i += 2) {
        if (strcmp(variables[i], name) == 0) {
            return variables[i + 1];
        }
    }
    return NULL;
}

static void expect_environment(const char *const *set, const char *sentences)
{
    unsigned errors;

    variables = set;
    memset(&reports, 0, sizeof(reports));
    config_defaults(&config);
    errors = config_read_environment(&config, lookup, config_reports_take, &reports);
    assert_int_equal(errors, reports.errors);
    assert_string_equal(reports.text, sentences);
}

static void environment(void **state)
{
    static const char *const none[] = {NULL};
    static const char *const empty[] = {"ODID_UAS_ID", "", "ODID_UDP_PORT", "", "ODID_NO_BT", "",
                                        NULL};
    static const char *const good[] = {"ODID_UAS_ID",
                                       "SSRS5GBG01",
                                       "ODID_OPERATOR_ID",
                                       "FIN87astrdge12k8-xyz",
                                       "ODID_SELF_ID",
                                       "Sea rescue",
                                       "ODID_MAVLINK_SOURCE",
                                       "udp",
                                       "ODID_UDP_PORT",
                                       "14560",
                                       "ODID_NO_WIFI",
                                       "1",
                                       "ODID_NO_BT",
                                       "yes",
                                       "ODID_DEBUG",
                                       "true",
                                       NULL};
    static const char *const no[] = {"ODID_NO_WIFI", "0",   "ODID_NO_BT", "no",
                                     "ODID_DEBUG",   "off", NULL};
    static const char *const bad[] = {"ODID_UAS_ID",
                                      "FIN87astrdge12k8-xyz",
                                      "ODID_MAVLINK_SOURCE",
                                      "usb",
                                      "ODID_UDP_PORT",
                                      "99999",
                                      "ODID_NO_WIFI",
                                      "please",
                                      NULL};

    (void)state;
    expect_environment(none, "");
    expect_defaults();
    expect_environment(empty, "");
    expect_defaults();
    expect_environment(no, "");
    expect_defaults();
    expect_environment(good, "note: environment: ODID_OPERATOR_ID: check character right; the "
                             "secret part is not kept\n");
    assert_string_equal(config.basic_id[0].uas_id, "SSRS5GBG01");
    assert_string_equal(config.operator_id, "FIN87astrdge12k8");
    assert_string_equal(config.description, "Sea rescue");
    assert_int_equal(config.source, MAVLINK_SOURCE_UDP);
    assert_int_equal(config.udp_port, 14560);
    assert_false(config.wifi_beacon_enabled || config.bt4_enabled || config.bt5_enabled);
    assert_true(config.debug);
    expect_environment(
        bad,
        "error: environment: ODID_UAS_ID holds an operator number; its secret part is left out\n"
        "error: environment: ODID_MAVLINK_SOURCE = \"usb\": expected serial or udp; using serial\n"
        "error: environment: ODID_UDP_PORT = \"99999\": expected 1-65535; using 14550\n"
        "error: environment: ODID_NO_WIFI = \"please\": expected 1 or 0; using 0\n");
    assert_string_equal(config.basic_id[0].uas_id, "FIN87astrdge12k8");
    assert_true(config.wifi_beacon_enabled);
}

/* ---- what the file has for the daemon ---- */

static uint64_t fingerprint_of(const char *text)
{
    parse(text);
    return config_fingerprint(
        &config, fingerprint(FINGERPRINT_OF_NOTHING, reports.text, strlen(reports.text)));
}

static void the_daemon_s_values_and_no_others(void **state)
{
    static const char *const its_own[] = {
        "[basic_id]\nuas_id = SSRS5GBG01",
        "[basic_id_2]\nid_type = session",
        "[operator]\noperator_id = x",
        "[self_id]\ndescription = x",
        "[system]\noperator_altitude = 40",
        "[mavlink]\nrequest_rate = no",
        "[broadcast]\nbt_adapter = hci1",
        "[bench]\nlatitude = 1\nlongitude = 1",
        "[broadcast]\nbt5_enabled = false",
        "[daemon]\nuser = nobody",
        "[system]\noperator_latitude = 57.70890001\noperator_longitude = 1"};
    static const char *const others[] = {"[autopilot]\ndevice = /dev/ttyACM1",
                                         "[ground_station]\naddress = 10.0.0.1",
                                         "[wifi]\nchannel = 11",
                                         "[maintenance]\nat_boot = yes",
                                         "[update]\nhawkbit_id = me",
                                         "[board]\nantenna = external"};
    uint64_t found[COUNT(its_own)], none;

    (void)state;
    none = fingerprint_of("; nothing");
    for (size_t i = 0; i < COUNT(others); i++) {
        assert_int_equal(fingerprint_of(others[i]), none);
    }
    for (size_t i = 0; i < COUNT(its_own); i++) {
        found[i] = fingerprint_of(its_own[i]);
        assert_true(found[i] != none);
        for (size_t j = 0; j < i; j++) {
            assert_true(found[i] != found[j]);
        }
    }
    /* What the daemon has to say of the appliance's. */
    assert_true(fingerprint_of("[wifi]\nchanel = 11") != none);
    assert_true(fingerprint_of("[wifi]\nchannel = 14") != none);
    assert_true(fingerprint_of("[autopilot]\ndevice = /dev/ttyAMA5") !=
                none); /* a port that is off */
    /* Set to what it is by itself it counts more than the autopilot's. */
    assert_true(fingerprint_of("[system]\nclassification_type = eu") != none);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_defaults),
        cmocka_unit_test(every_key_is_taken),
        cmocka_unit_test(names_of_codes),
        cmocka_unit_test(every_ua_type),
        cmocka_unit_test(numbers_are_on_air_codes),
        cmocka_unit_test(booleans),
        cmocka_unit_test(every_speed),
        cmocka_unit_test(environment),
        cmocka_unit_test(the_daemon_s_values_and_no_others),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
