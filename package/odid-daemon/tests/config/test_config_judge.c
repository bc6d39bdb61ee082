/* The configuration judged as a whole, and the sample. */
#include "config_helper.h"

/* ---- the judge ---- */

#define GOOD "[basic_id]\nuas_id = SSRS5GBG01\n[operator]\noperator_id = SWE3jxza7qbzvu5d\n"

static void expect_judgement(const char *text, const char *sentences)
{
    unsigned warnings;

    parse(text);
    memset(&reports, 0, sizeof(reports));
    warnings = config_judge(&config, config_reports_take, &reports);
    assert_int_equal(warnings, reports.warnings);
    assert_string_equal(reports.text, sentences);
}

static void judgements(void **state)
{
    static const struct {
        const char *text, *sentences;
    } cases[] = {
        {GOOD, ""},
        {GOOD "[system]\ncategory = specific\nclass = C4\n", ""},
        {GOOD "[maintenance]\npassword = twelve chars\n", ""},
        {GOOD "[maintenance]\npassword = eleven cha.\n",
         "warning: [maintenance] password has 11 characters: whoever records one log-in can guess "
         "it at leisure. Expected 12 or more, by chance; it is taken all the same\n"},
        {"[basic_id]\n",
         "warning: [basic_id] uas_id is not set: the aircraft has no identity unless the autopilot "
         "sends one\n"
         "warning: [operator] operator_id is not set: no operator number is broadcast unless the "
         "autopilot sends one\n"},
        {GOOD "[basic_id]\nuas_id = SSRSGBG001\n",
         "warning: [basic_id] uas_id = \"SSRSGBG001\" is no valid serial number (CTA-2063-A): "
         "character 5 is \"G\": expected a length code, 1-9 or A-F; it is broadcast all the "
         "same\n"},
        {GOOD "[operator]\noperator_id = SWE3JXZA7qbzvu5d\n",
         "warning: [operator] operator_id = \"SWE3JXZA7qbzvu5d\" is no EU operator number: "
         "character 5 is \"J\": expected a digit or a small letter; it is broadcast all the "
         "same\n"},
        {GOOD "[basic_id]\nid_type = none\n",
         "warning: [basic_id] id_type = none: receivers can't tell what kind of identifier "
         "\"SSRS5GBG01\" is\n"
         "warning: no uas_id has id_type = serial: EU rules ask for the aircraft's serial "
         "number\n"},
        {GOOD "[basic_id]\nid_type = session\n",
         "warning: [basic_id] id_type = session: \"SSRS5GBG01\" is sent as text, not as the binary "
         "identifier that receivers expect\n"
         "warning: no uas_id has id_type = serial: EU rules ask for the aircraft's serial "
         "number\n"},
        {GOOD "[basic_id_2]\nuas_id = SSRS5GBG02\n",
         "warning: [basic_id_2] id_type is the same as in [basic_id]: receivers keep one "
         "identifier of a kind\n"},
        {GOOD "[basic_id_2]\nuas_id = SE-ABC\nid_type = registration\n", ""},
        {GOOD "[basic_id_2]\nuas_id = SSRS5GBG02\nid_type = registration\n",
         "warning: [basic_id_2] id_type = registration, and uas_id = \"SSRS5GBG02\" has the form "
         "of "
         "a serial number: if it is one, set id_type = serial\n"},
        {GOOD "[system]\noperator_location_type = fixed\n",
         "warning: [system] operator_location_type = fixed needs operator_latitude and "
         "operator_longitude; the ground station's place or the take-off point is sent, and until "
         "one is known none\n"},
        {GOOD "[system]\noperator_location_type = fixed\noperator_latitude = 0.001\n"
              "operator_longitude = -0.001\n",
         "warning: [system] operator_latitude, operator_longitude: nobody stands at 0, 0, which "
         "means unknown on the air\n"},
        {GOOD "[system]\nclassification_type = undeclared\ncategory = open\n",
         "warning: [system] category and class mean nothing with classification_type = "
         "undeclared\n"},
        {GOOD "[system]\nclassification_type = undeclared\nclass = C3\n",
         "warning: [system] category and class mean nothing with classification_type = "
         "undeclared\n"},
        {GOOD "[system]\ncategory = open\nclass = C5\n",
         "warning: [system] class C5 belongs to category specific, not open\n"},
        {GOOD "[system]\ncategory = specific\nclass = C3\n", ""},
        {GOOD "[system]\ncategory = certified\nclass = C3\n",
         "warning: [system] class C3 means nothing with category = certified: classes are of the "
         "categories open and specific\n"},
        {GOOD "[system]\nclass = C3\n",
         "warning: [system] class C3 means nothing with category = undeclared: classes are of the "
         "categories open and specific\n"},
        {GOOD "[operator]\noperator_id = ZZZ3jxza7qbzvu5d\n",
         "warning: [operator] operator_id = \"ZZZ3jxza7qbzvu5d\": ZZZ is no country that registers "
         "operators by EU rules. Expected SWE for Sweden, NOR for Norway, ...; it is broadcast all "
         "the same\n"},
        {GOOD "[operator]\noperator_id = NOR87astrdge12k8\n", ""},
        {GOOD "[self_id]\ndescription = x\ndescription_type = emergency\n",
         "warning: [self_id] description_type = emergency: every receiver shows an emergency from "
         "power-on\n"},
        {GOOD "[broadcast]\nbt4_enabled = no\nbt5_enabled = no\nwifi_beacon_enabled = no\n",
         "warning: Bluetooth and Wi-Fi are both switched off: nothing is broadcast\n"},
        {GOOD "[broadcast]\nbt5_enabled = no\nwifi_beacon_enabled = no\n",
         "warning: only Bluetooth 4 is switched on: EU rules ask for Wi-Fi or Bluetooth 5 long "
         "range besides\n"},
        {GOOD "[broadcast]\nbt_adapter = h4:/dev/ttyACM0@115200\n",
         "warning: [mavlink] device and a Bluetooth adapter are both /dev/ttyACM0\n"},
        {GOOD "[broadcast]\nbt_adapter = h4:/dev/ttyACM01\n", ""},
        {GOOD "[mavlink]\nsource = udp\nudp_address = 0.0.0.0\n",
         "note: [mavlink] udp_address = 0.0.0.0: whoever reaches it by network can feed "
         "positions\n"},
        {GOOD "[mavlink]\nsource = udp\nudp_port = 32767\n", ""},
        {GOOD "[mavlink]\nsource = udp\nudp_port = 32768\n",
         "warning: [mavlink] udp_port = 32768: any program can take it when odid-daemon hasn't "
         "got it. Expected 1-32767, which the appliance keeps for itself; it is taken all the "
         "same\n"},
        {GOOD "[mavlink]\nsource = udp\n", ""},
        {GOOD "[bench]\nlatitude = 57.7089\nlongitude = 11.9746\n",
         "warning: [bench] a test position is on: an invented place is broadcast whenever the "
         "autopilot gives none; never fly with it\n"},
        {GOOD "[bench]\nlatitude = 0\nlongitude = 0\n",
         "warning: [bench] a test position is on: an invented place is broadcast whenever the "
         "autopilot gives none; never fly with it\n"
         "warning: [bench] latitude, longitude: 0, 0 means unknown on the air\n"},
        {GOOD "[autopilot]\ndevice = /dev/ttyACM1\n[broadcast]\nbt_adapter = h4:/dev/ttyACM1\n",
         "warning: [autopilot] device and a Bluetooth adapter are both /dev/ttyACM1\n"},
        {GOOD "[autopilot]\ndevice = /dev/ttyAMA3\n[board]\nconsole = uart3\nuarts = uart3\n",
         "warning: [board] console = uart3 is the autopilot's port, [autopilot] device = "
         "/dev/ttyAMA3: no telemetry comes through\n"},
        {GOOD "[autopilot]\ndevice = /dev/ttyAMA3\n[board]\nconsole = uart2\nuarts = uart3\n", ""},
        {GOOD "[autopilot]\ndevice = /dev/ttyS1\n[board]\nconsole = uart1\nuarts = uart1\n",
         "warning: [board] console = uart1 is the autopilot's port, [autopilot] device = "
         "/dev/ttyS1: no telemetry comes through\n"},
        {GOOD "[autopilot]\ndevice = /dev/ttyAMA3\n[board]\nuarts = uart1 uart4\n",
         "warning: [autopilot] device = /dev/ttyAMA3 is a port that is off: [board] uarts doesn't "
         "name uart3\n"},
        {GOOD "[autopilot]\ndevice = /dev/ttyS1\n",
         "warning: [autopilot] device = /dev/ttyS1 is a port that is off: [board] uarts doesn't "
         "name uart1\n"},
        {GOOD "[board]\nconsole = usb\n", "warning: [board] console = usb needs usb = gadget\n"},
        {GOOD "[board]\nconsole = usb\nusb = gadget\n", ""},
    };

    (void)state;
    for (size_t i = 0; i < COUNT(cases); i++) {
        expect_judgement(cases[i].text, cases[i].sentences);
    }
}

/* ---- the sample ---- */

static char sample[32768], page[65536];

static bool read_text(const char *name, char *text, size_t size)
{
    FILE *file = fopen(name, "re");
    size_t length;

    if (file == NULL) {
        return false; /* not started in the package's folder */
    }
    length = fread(text, 1, size - 1, file);
    fclose(file);
    text[length] = '\0';
    return true;
}

static bool read_sample(void)
{
    return read_text("odid.conf.example", sample, sizeof(sample));
}

/* As it is, it sets nothing. */
static void the_sample_is_right(void **state)
{
    (void)state;
    if (!read_sample()) {
        skip();
    }
    expect(sample, "");
    expect_defaults();
    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        char line[48];

        snprintf(line, sizeof(line), "\n; %s = ", key->name);
        if (strstr(sample, line) == NULL) {
            fail_msg("[%s] %s is not in odid.conf.example", key->section, key->name);
        }
    }
}

/* But where it says that it is an example. */
static void the_sample_shows_the_defaults(void **state)
{
    const char *section = "";
    char *next;
    bool example = false;
    unsigned shown = 0;

    (void)state;
    if (!read_sample()) {
        skip();
    }
    for (char *line = sample; (next = strchr(line, '\n')) != NULL; line = next + 1) {
        static char text[2 * sizeof(sample)];

        *next = '\0';
        if (line[0] == '[') {
            section = line;
        } else if (line[0] == '#') {
            example = example || strstr(line, "Example") != NULL;
        } else if (line[0] == '\0') {
            example = false;
        } else if (!example) {
            assert_memory_equal(line, "; ", 2);
            snprintf(text, sizeof(text), "%s\n%s\n", section, line + 2);
            expect(text, "");
            config.classification_set = false; /* also by setting it to that */
            expect_defaults();
            shown++;
        }
    }
    assert_true(shown >= 20);
}

/* Under its section's name; of the second identity as of the first. */
static void the_page_of_the_manual_has_every_key(void **state)
{
    (void)state;
    if (!read_text("man/odid.conf.5", page, sizeof(page))) {
        skip();
    }
    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        char head[48], *begin, *end, *item;
        bool found = false;

        snprintf(head, sizeof(head), "\n.Ss [%s]\n", key->section);
        begin = strstr(page, head);
        assert_non_null(begin);
        end = strstr(begin + 1, "\n.Ss ");
        for (item = strstr(begin, "\n.It Cm "); item != NULL && (end == NULL || item < end);
             item = strstr(item + 1, "\n.It Cm ")) {
            size_t length = strlen(key->name);

            for (char *word = item;
                 !found && (word = strchr(word, ' ')) != NULL && word < strchr(item + 1, '\n');
                 word++) {
                found =
                    strncmp(word + 1, key->name, length) == 0 && strchr(" \n", word[1 + length]);
            }
        }
        if (!found) {
            fail_msg("[%s] %s is not in odid.conf(5)", key->section, key->name);
        }
    }
}

/* And whoever takes away every "; " gets a right one. */
static void the_sample_with_everything_set(void **state)
{
    (void)state;
    if (!read_sample()) {
        skip();
    }
    for (char *line = strstr(sample, "\n; "); line != NULL; line = strstr(line, "\n; ")) {
        memmove(line + 1, line + 3, strlen(line + 3) + 1);
    }
    expect_judgement(sample, "warning: [bench] a test position is on: an invented place is "
                             "broadcast whenever the autopilot gives none; never fly with it\n");
    assert_string_equal(config.basic_id[0].uas_id, "SSRS5GBG01");
    assert_int_equal(config.category, 2);
    assert_int_equal(config.class_eu, 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(judgements),
        cmocka_unit_test(the_sample_is_right),
        cmocka_unit_test(the_sample_shows_the_defaults),
        cmocka_unit_test(the_sample_with_everything_set),
        cmocka_unit_test(the_page_of_the_manual_has_every_key),
    };

    return cmocka_run_group_tests(tests, make_directory, remove_directory);
}
