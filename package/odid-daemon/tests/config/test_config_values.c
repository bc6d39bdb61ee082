/* Values out of range, and identities that are taken all the same. */
#include "config_helper.h"

/* ---- values out of range ---- */

static void wrong_values(void **state)
{
    static const struct {
        const char *section, *line, *sentence; /* after "odid.conf line 2: [section] " */
    } cases[] = {
        {"basic_id", "id_type = 5",
         "id_type = \"5\": expected serial, registration, utm, session, none or 0-4; using "
         "serial"},
        {"basic_id", "ua_type = 16",
         "ua_type = \"16\": expected auto, a name such as aeroplane or multirotor, or 0-15; using "
         "auto"},
        {"basic_id", "ua_type = -1",
         "ua_type = \"-1\": expected auto, a name such as aeroplane or multirotor, or 0-15; using "
         "auto"},
        {"operator", "operator_id_type = 1",
         "operator_id_type = \"1\": expected operator_id or 0; using operator_id"},
        {"self_id", "description_type = 3",
         "description_type = \"3\": expected text, emergency, extended_status or 0-2; using text"},
        {"system", "operator_location_type = 3",
         "operator_location_type = \"3\": expected takeoff, live_gnss, fixed or 0-2; using "
         "takeoff"},
        {"system", "classification_type = 2",
         "classification_type = \"2\": expected undeclared, eu or 0-1; using eu"},
        {"system", "category = specifik",
         "category = \"specifik\": expected undeclared, open, specific, certified or 0-3; using "
         "undeclared"},
        {"system", "category = 4",
         "category = \"4\": expected undeclared, open, specific, certified or 0-3; using "
         "undeclared"},
        {"system", "category =",
         "category = \"\": expected undeclared, open, specific, certified or 0-3; using "
         "undeclared"},
        {"system", "class = C7",
         "class = \"C7\": expected undeclared, C0 to C6 or 0-7; using undeclared"},
        {"system", "class = 8",
         "class = \"8\": expected undeclared, C0 to C6 or 0-7; using undeclared"},
        {"system", "operator_altitude = -1000",
         "operator_altitude = \"-1000\": expected metres from -999 to 31767; using none"},
        {"system", "operator_latitude = 90.1",
         "operator_latitude = \"90.1\": expected degrees from -90 to 90; using none"},
        {"system", "operator_longitude = -180.001",
         "operator_longitude = \"-180.001\": expected degrees from -180 to 180; using none"},
        {"bench", "latitude = 57,7089",
         "latitude = \"57,7089\": write 57.7089, with a point; using none"},
        {"bench", "longitude = -11,9746",
         "longitude = \"-11,9746\": write -11.9746, with a point; using none"},
        {"bench", "latitude = 57,70,89",
         "latitude = \"57,70,89\": expected degrees from -90 to 90; using none"},
        {"bench", "latitude = 57.7089 N",
         "latitude = \"57.7089 N\": expected degrees from -90 to 90; using none"},
        {"bench", "latitude = nan",
         "latitude = \"nan\": expected degrees from -90 to 90; using none"},
        {"bench", "latitude = inf",
         "latitude = \"inf\": expected degrees from -90 to 90; using none"},
        {"bench", "latitude = 0x10",
         "latitude = \"0x10\": expected degrees from -90 to 90; using none"},
        {"bench", "latitude = 1e400",
         "latitude = \"1e400\": expected degrees from -90 to 90; using none"},
        {"bench",
         "latitude = 57\xC2\xB0"
         "42'",
         "latitude = \"57\xC2\xB0"
         "42'\": expected degrees from -90 to 90; using none"},
        {"mavlink", "source = usb", "source = \"usb\": expected serial or udp; using serial"},
        {"mavlink", "source = 1", "source = \"1\": expected serial or udp; using serial"},
        {"mavlink", "device = ttyACM0",
         "device = \"ttyACM0\": expected a path such as /dev/ttyACM0, at most 107 bytes; using "
         "/dev/ttyACM0"},
        {"mavlink", "baud = 921601",
         "baud = \"921601\": expected a speed that Linux knows, such as 57600, 115200 or 921600; "
         "using 921600"},
        {"mavlink", "udp_port = 0", "udp_port = \"0\": expected 1-65535; using 14550"},
        {"mavlink", "udp_port = 65536", "udp_port = \"65536\": expected 1-65535; using 14550"},
        {"mavlink", "udp_port = 14550 ", NULL},
        {"mavlink", "udp_address = localhost",
         "udp_address = \"localhost\": expected an IPv4 address such as 127.0.0.1; using "
         "127.0.0.1"},
        {"mavlink", "udp_address = 127.0.0.256",
         "udp_address = \"127.0.0.256\": expected an IPv4 address such as 127.0.0.1; using "
         "127.0.0.1"},
        {"mavlink", "request_rate = maybe",
         "request_rate = \"maybe\": expected true or false; using true"},
        {"broadcast", "bt4_enabled = 2", "bt4_enabled = \"2\": expected true or false; using true"},
        {"broadcast", "wifi_iface = wlan0/1",
         "wifi_iface = \"wlan0/1\": expected an interface such as wlan0, at most 15 bytes; using "
         "wlan0"},
        {"broadcast", "wifi_iface = interface1234567",
         "wifi_iface = \"interface1234567\": expected an interface such as wlan0, at most 15 "
         "bytes; using wlan0"},
        {"broadcast", "wifi_iface = interface123456", NULL},
        {"broadcast", "wifi_iface = wlan0|",
         "wifi_iface = \"wlan0|\": expected an interface such as wlan0, at most 15 bytes; using "
         "wlan0"},
        {"broadcast", "wifi_iface = a\",\"lo",
         "wifi_iface = \"a\",\"lo\": expected an interface such as wlan0, at most 15 bytes; using "
         "wlan0"},
        {"broadcast", "wifi_iface = -a",
         "wifi_iface = \"-a\": expected an interface such as wlan0, at most 15 bytes; using wlan0"},
        {"broadcast", "wifi_iface = wl-x.0_1", NULL},
        {"broadcast", "wifi_iface = lo",
         "wifi_iface = \"lo\": expected an interface such as wlan0, at most 15 bytes; using wlan0"},
        {"broadcast", "hostapd_dir = run/hostapd",
         "hostapd_dir = \"run/hostapd\": expected an absolute path, at most 80 bytes; using "
         "/run/hostapd"},
        {"broadcast", "bt_adapter = bluetooth",
         "bt_adapter = \"bluetooth\": expected hciN such as hci0, or h4:/dev/ttyX[@baud]; using "
         "hci0"},
        {"broadcast", "bt_adapter =",
         "bt_adapter = \"\": expected hciN such as hci0, or h4:/dev/ttyX[@baud]; using hci0"},
        {"broadcast", "bt5_adapter =", NULL},
        {"broadcast", "bt5_adapter = 1",
         "bt5_adapter = \"1\": expected hciN such as hci1, h4:/dev/ttyX[@baud] or \"\"; using "
         "none"},
        {"daemon", "user = Root",
         "user = \"Root\": expected a user name such as odid, at most 31 bytes; using odid"},
        {"daemon", "run_dir = /",
         "run_dir = \"/\": expected an absolute path, at most 80 bytes; "
         "using /run/odid"},
    };
    char text[160], sentence[CONFIG_PROBLEM_SIZE + 32];

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        snprintf(text, sizeof(text), "[%s]\n%s\n", cases[i].section, cases[i].line);
        snprintf(sentence, sizeof(sentence), "error: odid.conf line 2: [%s] %s\n", cases[i].section,
                 cases[i].sentence == NULL ? "" : cases[i].sentence);
        expect(text, cases[i].sentence == NULL ? "" : sentence);
        if (cases[i].sentence != NULL) {
            expect_defaults();
        }
    }
}

static void boundaries_of_places(void **state)
{
    (void)state;
    expect("[bench]\nlatitude = 90\nlongitude = 180\n", "");
    expect("[bench]\nlatitude = -90.0\nlongitude = -1.8e2\n", "");
    assert_true(config.bench_longitude_deg == -180);
    expect("[system]\noperator_altitude = -999\n", "");
    expect("[system]\noperator_altitude = 31767\n", "");
    expect("[system]\noperator_altitude = 31767.1\n",
           "error: odid.conf line 2: [system] operator_altitude = \"31767.1\": expected metres "
           "from -999 to 31767; using none\n");
    expect("[bench]\nlatitude = 1\nlongitude = 2\nlatitude =\nlongitude = \"\"\n",
           "note: odid.conf line 4: [bench] latitude is set again (before in line 2); this one "
           "counts\n"
           "note: odid.conf line 5: [bench] longitude is set again (before in line 3); this one "
           "counts\n");
    expect_defaults();
    expect("[bench]\nlatitude = 57.7\n",
           "error: odid.conf: [bench] latitude and longitude: one is set without the other; using "
           "none\n");
    expect_defaults();
    expect("[system]\noperator_longitude = 11.9\n",
           "error: odid.conf: [system] operator_latitude and operator_longitude: one is set "
           "without the other; using none\n");
    expect_defaults();
}

/* A wrong value doesn't undo the good one before it. */
static void a_bad_repetition_leaves_the_good_value(void **state)
{
    (void)state;
    expect("[mavlink]\nudp_port = 14551\nudp_port = x\n",
           "note: odid.conf line 3: [mavlink] udp_port is set again (before in line 2); this one "
           "counts\n"
           "error: odid.conf line 3: [mavlink] udp_port = \"x\": expected 1-65535; using 14551\n");
    assert_int_equal(config.udp_port, 14551);
}

/* ---- identities: taken even when wrong ---- */

static void identifiers_are_cut(void **state)
{
    (void)state;
    expect("[basic_id]\nuas_id = 12345678901234567890\n", "");
    assert_string_equal(config.basic_id[0].uas_id, "12345678901234567890");
    expect("[basic_id]\nuas_id = 123456789012345678901\n",
           "error: odid.conf line 2: [basic_id] uas_id is 21 bytes long, 20 fit on the air; cut to "
           "\"12345678901234567890\"\n");
    assert_string_equal(config.basic_id[0].uas_id, "12345678901234567890");
    expect("[basic_id]\nuas_id = SSRS5G\xC3\x85G01\n",
           "error: odid.conf line 2: [basic_id] uas_id: expected only ASCII letters and digits; "
           "sent as \"SSRS5G??G01\"\n");
    assert_string_equal(config.basic_id[0].uas_id, "SSRS5G??G01");
    expect("[basic_id]\nuas_id = A\nuas_id = \"\"\n",
           "note: odid.conf line 3: [basic_id] uas_id is set again (before in line 2); this one "
           "counts\n");
    assert_string_equal(config.basic_id[0].uas_id, "");
    expect("[operator]\noperator_id = SWE 3jxza7qbzvu5d 1234567\n",
           "error: odid.conf line 2: [operator] operator_id is too long: cut to \"SWE "
           "3jxza7qbzvu5d 12\"\n");
}

static void descriptions_are_cut_between_characters(void **state)
{
    (void)state;
    expect("[self_id]\ndescription = Sea rescue surveillance\n", ""); /* 23 */
    expect("[self_id]\ndescription = Sea rescue surveillance!\n",
           "error: odid.conf line 2: [self_id] description is 24 characters long, 23 fit; cut to "
           "\"Sea rescue surveillance\"\n");
    /* 23 bytes, 20 characters */
    expect("[self_id]\ndescription = r\xC3\xA4"
           "ddning \xC3\xA5 sj\xC3\xB6n, hej\n",
           "warning: odid.conf line 2: [self_id] description = \"r\xC3\xA4"
           "ddning \xC3\xA5 "
           "sj\xC3\xB6n, hej\": only ASCII is sure to be shown right by every receiver\n");
    /* 24 bytes, the last character would be cut in half */
    expect("[self_id]\ndescription = Sjoraddning i Goteborg\xC3\xA5\n",
           "error: odid.conf line 2: [self_id] description is 24 bytes (23 characters; "
           "\xC3\xA5, \xC3\xA4, \xC3\xB6 are 2 bytes each), 23 bytes fit; cut to \"Sjoraddning i "
           "Goteborg\"\n");
    assert_string_equal(config.description, "Sjoraddning i Goteborg");
    expect("[self_id]\ndescription = Sj\xF6r\xE4"
           "ddning\n",
           "error: odid.conf line 2: [self_id] description holds 2 bytes that are no UTF-8 (a "
           "file saved as \"ANSI\"?); sent as \"Sj?r?ddning\"\n");
    assert_string_equal(config.description, "Sj?r?ddning");
    expect("[self_id]\ndescription = \"\"\n", "");
    assert_string_equal(config.description, "");
}

static void operator_numbers(void **state)
{
    (void)state;
    expect("[operator]\noperator_id = FIN87astrdge12k8-xyz\n",
           "note: odid.conf line 2: [operator] operator_id: check character right; the secret part "
           "is not kept\n");
    assert_string_equal(config.operator_id, "FIN87astrdge12k8");
    expect("[operator]\noperator_id = FIN87astrdge12k9-xyz\n",
           "warning: odid.conf line 2: [operator] operator_id = \"FIN87astrdge12k9\": check "
           "character \"9\" does not fit the others: one of them is mistyped; broadcast all the "
           "same\n");
    assert_string_equal(config.operator_id, "FIN87astrdge12k9");
    expect("[operator]\noperator_id = FIN87astrdge12k8xyz\n",
           "warning: odid.conf line 2: [operator] operator_id = \"FIN87astrdge12k8\": after 16 "
           "characters only \"-\" and 3 secret characters may follow; broadcast all the same\n");
    assert_string_equal(config.operator_id, "FIN87astrdge12k8");
    expect("[operator]\noperator_id = FIN87ASTRDGE12K8-xyz\n", ""); /* the judge says it */
    assert_string_equal(config.operator_id, "FIN87ASTRDGE12K8");
    expect("[operator]\noperator_id = \"\"\n", "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(wrong_values),
        cmocka_unit_test(boundaries_of_places),
        cmocka_unit_test(a_bad_repetition_leaves_the_good_value),
        cmocka_unit_test(identifiers_are_cut),
        cmocka_unit_test(descriptions_are_cut_between_characters),
        cmocka_unit_test(operator_numbers),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
