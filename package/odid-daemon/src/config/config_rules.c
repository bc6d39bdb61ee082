/* How each kind of value is checked; the identities are in config_identity.c. */
#include <arpa/inet.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/serial.h"
#include "config/config_keys.h"
#include "radio/hci.h"

/* hostapd's and our own socket names come after a directory in sun_path. */
#define DIRECTORY_SIZE 81

/* ---- whole numbers ---- */

bool config_whole_number(const char *text, unsigned long high, unsigned long *number)
{
    size_t length = strspn(text, "0123456789");

    if (length == 0 || length > 9 || text[length] != '\0') {
        return false;
    }
    *number = strtoul(text, NULL, 10);
    return *number <= high;
}

static bool take_baud(const struct config_rule *rule, void *field, struct config_value *value)
{
    unsigned long number;

    (void)rule;
    if (!config_whole_number(value->text, 999999999, &number) ||
        !serial_baud_valid((unsigned)number)) {
        return false;
    }
    *(unsigned *)field = (unsigned)number;
    return true;
}

static void show_baud(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    (void)rule;
    snprintf(out, size, "%u", *(const unsigned *)field);
}

static bool take_port(const struct config_rule *rule, void *field, struct config_value *value)
{
    unsigned long number;

    (void)rule;
    if (!config_whole_number(value->text, UINT16_MAX, &number) || number == 0) {
        return false;
    }
    *(uint16_t *)field = (uint16_t)number;
    return true;
}

static void show_port(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    (void)rule;
    snprintf(out, size, "%u", *(const uint16_t *)field);
}

/* ---- names and on-air codes ---- */

static int get_code(const struct config_rule *rule, const void *field)
{
    return rule->wide ? *(const int *)field : *(const uint8_t *)field;
}

static void set_code(const struct config_rule *rule, void *field, int code)
{
    if (rule->wide) {
        *(int *)field = code;
    } else {
        *(uint8_t *)field = (uint8_t)code;
    }
}

bool config_code_take(const struct config_rule *rule, void *field, struct config_value *value)
{
    unsigned long number;

    for (const struct config_code *code = rule->codes; code->name != NULL; code++) {
        if (strcasecmp(code->name, value->text) == 0) {
            set_code(rule, field, code->code);
            return true;
        }
    }
    if (rule->high < 0 || !config_whole_number(value->text, (unsigned long)rule->high, &number)) {
        return false;
    }
    set_code(rule, field, (int)number);
    config_say(value->source, CONFIG_NOTE, "%s = %lu means %s on the air", value->label, number,
               config_code_name(rule->codes, (int)number));
    return true;
}

void config_code_show(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    snprintf(out, size, "%s", config_code_name(rule->codes, get_code(rule, field)));
}

#define CODE_RULE(table, highest, is_wide, text)                                                   \
    {                                                                                              \
        .take = config_code_take, .show = config_code_show, .expected = text, .codes = table,      \
        .wide = is_wide, .high = highest                                                           \
    }

const struct config_rule config_rule_id_type =
    CODE_RULE(config_id_types, 4, false, "serial, registration, utm, session, none or 0-4");
const struct config_rule config_rule_ua_type =
    CODE_RULE(config_ua_types, 15, true, "auto, a name such as aeroplane or multirotor, or 0-15");
const struct config_rule config_rule_operator_id_type =
    CODE_RULE(config_operator_id_types, 0, false, "operator_id or 0");
const struct config_rule config_rule_description_type =
    CODE_RULE(config_description_types, 2, false, "text, emergency, extended_status or 0-2");
const struct config_rule config_rule_operator_location =
    CODE_RULE(config_operator_location_types, 2, false, "takeoff, live_gnss, fixed or 0-2");
const struct config_rule config_rule_classification =
    CODE_RULE(config_classification_types, 1, false, "undeclared, eu or 0-1");
const struct config_rule config_rule_category =
    CODE_RULE(config_categories, 3, false, "undeclared, open, specific, certified or 0-3");
const struct config_rule config_rule_class =
    CODE_RULE(config_classes, 7, false, "undeclared, C0 to C6 or 0-7");
/* Not on the air: names only. */
const struct config_rule config_rule_source = CODE_RULE(config_sources, -1, true, "serial or udp");

/* ---- yes and no ---- */

bool config_boolean(const char *text, bool *value)
{
    static const char *const words[][2] = {
        {"false", "true"}, {"no", "yes"}, {"off", "on"}, {"0", "1"}};

    for (size_t i = 0; i < sizeof(words) / sizeof(words[0]); i++) {
        for (int word = 0; word < 2; word++) {
            if (strcasecmp(text, words[i][word]) == 0) {
                *value = word == 1;
                return true;
            }
        }
    }
    return false;
}

static bool take_boolean(const struct config_rule *rule, void *field, struct config_value *value)
{
    (void)rule;
    return config_boolean(value->text, field);
}

static void show_boolean(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    (void)rule;
    snprintf(out, size, "%s", *(const bool *)field ? "true" : "false");
}

const struct config_rule config_rule_boolean = {
    .take = take_boolean, .show = show_boolean, .expected = "true or false"};

/* ---- degrees and metres ---- */

/* "57,7089" as many countries write it: says how to write it here. */
static void hint_at_comma(struct config_value *value)
{
    size_t length = strspn(value->text, "+-0123456789,");
    char point[24];

    if (value->text[length] != '\0' || strchr(value->text, ',') != strrchr(value->text, ',') ||
        length >= sizeof(point)) {
        return;
    }
    memcpy(point, value->text, length + 1);
    if (strchr(point, ',') != NULL) {
        *strchr(point, ',') = '.';
        snprintf(value->hint, sizeof(value->hint), "write %s, with a point", point);
    }
}

static bool take_number(const struct config_rule *rule, void *field, struct config_value *value)
{
    size_t length = strspn(value->text, "+-0123456789.eE"); /* no "nan", "inf", hexadecimal */
    char *end;
    double number;

    if (value->text[0] == '\0') {
        *(double *)field = NAN;
        return true;
    }
    number = strtod(value->text, &end);
    if (value->text[length] != '\0' || *end != '\0') {
        hint_at_comma(value);
        return false;
    }
    if (!(number >= rule->low && number <= rule->high)) {
        return false;
    }
    *(double *)field = number;
    return true;
}

void config_number_show(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    double number = *(const double *)field;

    (void)rule;
    if (isnan(number)) {
        snprintf(out, size, "none");
    } else {
        snprintf(out, size, "%.9g", number);
    }
}

const struct config_rule config_rule_latitude = {.take = take_number,
                                                 .show = config_number_show,
                                                 .expected = "degrees from -90 to 90",
                                                 .low = -90,
                                                 .high = 90};
const struct config_rule config_rule_longitude = {.take = take_number,
                                                  .show = config_number_show,
                                                  .expected = "degrees from -180 to 180",
                                                  .low = -180,
                                                  .high = 180};
/* -1000 m means "unknown" on the air. */
const struct config_rule config_rule_altitude = {.take = take_number,
                                                 .show = config_number_show,
                                                 .expected = "metres from -999 to 31767",
                                                 .low = -999,
                                                 .high = 31767};

/* ---- short texts ---- */

bool config_text_take(const struct config_rule *rule, void *field, struct config_value *value)
{
    size_t length = strlen(value->text);

    if (length >= rule->size || !rule->valid(value->text)) {
        return false;
    }
    memset(field, 0, rule->size);
    memcpy(field, value->text, length);
    return true;
}

void config_text_show(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    const char *text = field;

    (void)rule;
    snprintf(out, size, "%s", text[0] == '\0' ? "none" : text);
}

static bool is_graphic(const char *text)
{
    for (; *text != '\0'; text++) {
        if (*text <= ' ' || *text > '~') {
            return false;
        }
    }
    return true;
}

static bool is_path(const char *text)
{
    return text[0] == '/' && text[1] != '\0' && is_graphic(text);
}

#define LETTERS_AND_DIGITS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"

/* The kernel takes far more; but this gets into hostapd's configuration and the network filter's. A
 * hyphen stands for a slash in the names of systemd's units. */
#ifdef ODID_COMPANION
#define BETWEEN "._"
#define AN_INTERFACE "an interface such as wlan0, at most 15 bytes, without a hyphen"
#else
#define BETWEEN "._-"
#define AN_INTERFACE "an interface such as wlan0, at most 15 bytes"
#endif

static bool is_interface(const char *text)
{
    return text[0] != '\0' && strchr(LETTERS_AND_DIGITS, text[0]) != NULL &&
           text[strspn(text, LETTERS_AND_DIGITS BETWEEN)] == '\0' && strcmp(text, "lo") != 0;
}

static bool is_user(const char *text)
{
    static const char first[] = "abcdefghijklmnopqrstuvwxyz_";

    return text[0] != '\0' && strchr(first, text[0]) != NULL &&
           text[strspn(text, "abcdefghijklmnopqrstuvwxyz_0123456789-")] == '\0';
}

static bool is_address(const char *text)
{
    struct in_addr address;

    return inet_pton(AF_INET, text, &address) == 1;
}

static bool is_second_adapter(const char *text)
{
    return text[0] == '\0' || hci_name_valid(text);
}

static bool is_listener(const char *text)
{
    return text[0] == '\0' || is_interface(text);
}

#define TEXT_RULE(bytes, is_valid, text)                                                           \
    {                                                                                              \
        .take = config_text_take, .show = config_text_show, .expected = text, .size = bytes,       \
        .valid = is_valid                                                                          \
    }

const struct config_rule config_rule_device =
    TEXT_RULE(CONFIG_PATH_SIZE, is_path, "a path such as /dev/ttyACM0, at most 107 bytes");
const struct config_rule config_rule_directory =
    TEXT_RULE(DIRECTORY_SIZE, is_path, "an absolute path, at most 80 bytes");
const struct config_rule config_rule_interface = TEXT_RULE(16, is_interface, AN_INTERFACE);
const struct config_rule config_rule_listener =
    TEXT_RULE(16, is_listener, "an interface such as wlan1, at most 15 bytes, or \"\"");
const struct config_rule config_rule_user =
    TEXT_RULE(32, is_user, "a user name such as odid, at most 31 bytes");
const struct config_rule config_rule_address =
    TEXT_RULE(46, is_address, "an IPv4 address such as 127.0.0.1");
const struct config_rule config_rule_adapter =
    TEXT_RULE(CONFIG_PATH_SIZE, hci_name_valid, "hciN such as hci0, or h4:/dev/ttyX[@baud]");
const struct config_rule config_rule_second_adapter = TEXT_RULE(
    CONFIG_PATH_SIZE, is_second_adapter, "hciN such as hci1, h4:/dev/ttyX[@baud] or \"\"");

const struct config_rule config_rule_baud = {
    .take = take_baud,
    .show = show_baud,
    .expected = "a speed that Linux knows, such as 57600, 115200 or 921600"};
const struct config_rule config_rule_port = {
    .take = take_port, .show = show_port, .expected = "1-65535"};
