/* The appliance's own sections: known to the parser, checked, and no concern of the daemon. */
#include "config_helper.h"

static void defaults_of_the_appliance(void **state)
{
    (void)state;
    config_defaults(&config);
    assert_string_equal(config.autopilot_device, "auto");
    assert_int_equal(config.autopilot_baud, 921600);
    assert_string_equal(config.ground_station, "");
    assert_string_equal(config.ground_station_iface, "eth0");
    assert_string_equal(config.wifi_country, "SE");
    assert_int_equal(config.wifi_channel, 6);
    assert_string_equal(config.maintenance_password, "");
    assert_false(config.maintenance_at_boot);
    assert_false(config.update_prevent_downgrade);
    assert_string_equal(config.board_uarts, "");
}

/* What is written, and what is in force then, as odidctl get shows it. */
static void right_values(void **state)
{
    static const struct {
        const char *section, *key, *written, *shown;
    } cases[] = {
        {"autopilot", "device", "AUTO", "auto"},
        {"autopilot", "device", "/dev/ttyAMA3", "/dev/ttyAMA3"},
        {"autopilot", "device", "/dev/serial/by-id/usb-ArduPilot_Pixhawk_3E0038-if00",
         "/dev/serial/by-id/usb-ArduPilot_Pixhawk_3E0038-if00"},
        {"autopilot", "device", "usb:1209:574A", "usb:1209:574a"},
        {"autopilot", "baud", "57600", "57600"},
        {"ground_station", "address", "192.168.1.20", "192.168.1.20"},
        {"ground_station", "address", "192.168.1.20:14551", "192.168.1.20:14551"},
        {"ground_station", "address", "223.255.255.254:65535", "223.255.255.254:65535"},
        {"ground_station", "address", "\"\"", ""},
        {"ground_station", "interface", "wwan0", "wwan0"},
        {"wifi", "country", "no", "NO"},
        {"wifi", "country", "ad", "AD"},
        {"wifi", "country", "ZW", "ZW"},
        {"wifi", "channel", "1", "1"},
        {"wifi", "channel", "11", "11"},
        {"maintenance", "at_boot", "yes", "yes"},
        {"maintenance", "at_boot", "true", "yes"},
        {"maintenance", "at_boot", "off", "no"},
        {"maintenance", "password", "12345678", ""},
        {"maintenance", "password", "\"correct horse battery; staple\"", ""},
        {"maintenance", "password", "", ""},
        {"update", "prevent_downgrade", "yes", "yes"},
        {"update", "hawkbit_url", "https://updates.example.org:8443/hawkbit",
         "https://updates.example.org:8443/hawkbit"},
        {"update", "hawkbit_url", "http://[fd00::1]", "http://[fd00::1]"},
        {"update", "hawkbit_url", "\"\"", ""},
        {"update", "hawkbit_tenant", "DEFAULT", "DEFAULT"},
        {"update", "hawkbit_id", "rescue-1.SE_2", "rescue-1.SE_2"},
        {"board", "antenna", "External", "external"},
        {"board", "usb", "gadget", "gadget"},
        {"board", "console", "usb", "usb"},
        {"board", "console", "uart5", "uart5"},
        {"board", "uarts", "UART5,uart3 uart3", "uart3 uart5"},
        {"board", "uarts", "uart1 uart2 uart3 uart4 uart5", "uart1 uart2 uart3 uart4 uart5"},
        {"board", "uarts", "\"\"", ""},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        char text[200], shown[200];

        snprintf(text, sizeof(text), "[%s]\n%s = %s\n", cases[i].section, cases[i].key,
                 cases[i].written);
        expect(text, "");
        config_key_show(config_key_find(cases[i].section, cases[i].key), &config, shown,
                        sizeof(shown));
        assert_string_equal(shown, cases[i].shown);
    }
}

static void wrong_values(void **state)
{
    static const struct {
        const char *section, *key, *written, *expected;
    } cases[] = {
        {"autopilot", "device", "ttyACM0",
         "auto, a serial port such as /dev/serial/by-id/NAME or /dev/ttyACM0, or usb:VVVV:PPPP; "
         "using auto"},
        {"autopilot", "device", "/etc/passwd", NULL},
        {"autopilot", "device", "/dev/", NULL},
        {"autopilot", "device", "/dev/null", NULL}, /* its group and mode would be changed */
        {"autopilot", "device", "/dev/mmcblk0", NULL},
        {"autopilot", "device", "/dev/tty", NULL},
        {"autopilot", "device", "/dev/tty1", NULL},
        {"autopilot", "device", "/dev/ttyACM", NULL},
        {"autopilot", "device", "/dev/ttyACM0/../null", NULL},
        {"autopilot", "device", "/dev/serial/../null", NULL},
        {"autopilot", "device", "/dev/../etc/passwd", NULL},
        {"autopilot", "device", "/dev/tty ACM0", NULL},
        {"autopilot", "device", "/dev/x|e reboot", NULL},
        {"autopilot", "device", "/dev/$(reboot)", NULL},
        {"autopilot", "device", "/dev/a&b", NULL},
        {"autopilot", "device", "usb:1209", NULL},
        {"autopilot", "device", "usb:1209:57401", NULL},
        {"autopilot", "device", "usb:12g9:5740", NULL},
        {"autopilot", "device", "\"\"", NULL},
        {"autopilot", "baud", "123", NULL},
        {"ground_station", "address", "laptop.local",
         "an IPv4 address such as 192.168.1.20 or 192.168.1.20:14550, or \"\"; using none"},
        {"ground_station", "address", "0.0.0.0", NULL},
        {"ground_station", "address", "127.0.0.1:14560", NULL}, /* nothing of the board's own */
        {"ground_station", "address", "224.0.0.1", NULL},
        {"ground_station", "address", "255.255.255.255", NULL},
        {"ground_station", "address", "192.168.1.300", NULL},
        {"ground_station", "address", "192.168.1.20:0", NULL},
        {"ground_station", "address", "192.168.1.20:08080", NULL},
        {"ground_station", "address", "192.168.1.20:65536", NULL},
        {"ground_station", "address", "192.168.1.20:", NULL},
        {"ground_station", "address", "192.168.1.20:14550:1", NULL},
        {"ground_station", "address", ":14550", NULL},
        {"ground_station", "address", "192.168.111.1111:14550", NULL},
        {"wifi", "country", "Sweden",
         "the two letters of a country, such as SE or GB (not EU); using SE"},
        {"wifi", "country", "UK", NULL}, /* no beacon for seconds at each start */
        {"wifi", "country", "EU", NULL},
        {"wifi", "country", "ZZ", NULL},
        {"wifi", "country", "D ", NULL},
        {"wifi", "country", "S1", NULL},
        {"wifi", "country", "00", NULL},
        {"wifi", "country", "Å", NULL},
        {"wifi", "channel", "0", "1-11; using 6"},
        {"wifi", "channel", "12", NULL},
        {"wifi", "channel", "-1", NULL},
        {"wifi", "channel", "36", NULL},
        {"wifi", "channel", "6.5", NULL},
        {"maintenance", "at_boot", "sometimes", "yes or no; using no"},
        {"update", "hawkbit_url", "updates.example.org",
         "an address such as https://updates.example.org:8443, or \"\"; using none"},
        {"update", "hawkbit_url", "https://a\\\"b", NULL},
        {"update", "hawkbit_url", "http:///x", NULL},
        {"update", "hawkbit_id", "rescue 1",
         "letters, digits, full stops, hyphens and underscores, at most 47; using none"},
        {"board", "antenna", "big", "internal or external; using internal"},
        {"board", "antenna", "1", NULL},
        {"board", "usb", "otg", "host or gadget; using host"},
        {"board", "console", "uart6", "off, usb or uart1 to uart5; using off"},
        {"board", "console", "on", NULL},
        {"board", "uarts", "uart6",
         "a list of uart1 to uart5, such as uart3 uart5, or \"\"; using none"},
        {"board", "uarts", "uart0", NULL}, /* the Bluetooth chip's */
        {"board", "uarts", "uart33", NULL},
        {"board", "uarts", "uart3;rm", NULL}, /* a comment: right */
        {"board", "uarts", "uart3/uart5", NULL},
        {"board", "uarts", "3 5", NULL},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        char text[200], sentence[400];
        struct config defaults;

        snprintf(text, sizeof(text), "[%s]\n%s = %s\n", cases[i].section, cases[i].key,
                 cases[i].written);
        parse(text);
        if (strchr(cases[i].written, ';') != NULL) {
            assert_int_equal(reports.errors, 0);
            continue;
        }
        assert_int_equal(reports.errors, 1);
        config_defaults(&defaults);
        assert_memory_equal(&config, &defaults, sizeof(config));
        if (cases[i].expected != NULL) {
            snprintf(sentence, sizeof(sentence),
                     "error: odid.conf line 2: [%s] %s = \"%s\": expected %s\n", cases[i].section,
                     cases[i].key, cases[i].written, cases[i].expected);
            assert_string_equal(reports.text, sentence);
        }
    }
}

/* Too short, too long, no ASCII: said, and not quoted. */
static void wrong_passwords(void **state)
{
    static const char *const passwords[] = {
        "hunter2", "hunter2hunter2hunter2hunter2hunter2hunter2hunter2hunter2hunter2hunter2",
        "hunter2h\xC3\xA4st", "hunter2\thunter2"};

    (void)state;
    for (size_t i = 0; i < COUNT(passwords); i++) {
        char text[200];

        snprintf(text, sizeof(text), "[maintenance]\npassword = %s\n", passwords[i]);
        expect(text, "error: odid.conf line 2: [maintenance] password: expected 8-63 ASCII "
                     "characters; not used\n");
        assert_string_equal(config.maintenance_password, "");
    }
    expect("[wifi]\npassword = hunter2hunter2\n",
           "error: odid.conf line 2: password belongs in [maintenance]; ignored here\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defaults_of_the_appliance),
        cmocka_unit_test(right_values),
        cmocka_unit_test(wrong_values),
        cmocka_unit_test(wrong_passwords),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
