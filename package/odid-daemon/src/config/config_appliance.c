/* How the values of the appliance's own sections are checked, [autopilot] to [board]. */
#include <arpa/inet.h>
#include <ctype.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "config/config_keys.h"

/* ---- [autopilot] device ---- */

/*
 * A serial port, and no other device: its group and mode are changed. ttyACM0,
 * ttyUSB0, ttyAMA1, but not tty1, which is a console. In the links' names what
 * udev puts there, and nothing that means something to the shell or to sed.
 */
static bool is_device_path(const char *text)
{
    static const char links[] = "/dev/serial/", port[] = "/dev/tty";
    size_t length = strlen(port);

    if (strncmp(text, links, strlen(links)) == 0) {
        return text[strlen(links)] != '\0' && strstr(text, "..") == NULL &&
               text[strspn(text, "/ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"
                                 "#+.:=@_-")] == '\0';
    }
    if (strncmp(text, port, length) != 0) {
        return false;
    }
    text += length;
    length = strspn(text, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz");
    return length > 0 && isdigit((unsigned char)text[length]) &&
           text[length + strspn(text + length, "0123456789")] == '\0';
}

/* usb:VVVV:PPPP, as lsusb shows it. */
static bool is_usb_id(const char *text)
{
    static const char pattern[] = "usb:xxxx:xxxx";
    size_t i = 0;

    while (i < sizeof(pattern) &&
           (i < 4 || pattern[i] != 'x' ? tolower((unsigned char)text[i]) == pattern[i]
                                       : isxdigit((unsigned char)text[i]))) {
        i++;
    }
    return i == sizeof(pattern);
}

static bool is_autopilot(const char *text)
{
    return strcasecmp(text, "auto") == 0 || is_usb_id(text) || is_device_path(text);
}

static void make_small(char *text)
{
    for (; *text != '\0'; text++) {
        *text = (char)tolower((unsigned char)*text);
    }
}

static bool take_autopilot(const struct config_rule *rule, void *field, struct config_value *value)
{
    if (!config_text_take(rule, field, value)) {
        return false;
    }
    if (value->text[0] != '/') {
        make_small(field); /* names are the same in upper and lower case; scripts compare */
    }
    return true;
}

const struct config_rule config_rule_autopilot = {
    .take = take_autopilot,
    .show = config_text_show,
    .expected =
        "auto, a serial port such as /dev/serial/by-id/NAME or /dev/ttyACM0, or usb:VVVV:PPPP",
    .size = CONFIG_PATH_SIZE,
    .valid = is_autopilot};

/* ---- [ground_station] address ---- */

/* Not this board, not everybody: 0/8, 127/8, multicast and above. */
static bool is_another_host(uint32_t address)
{
    uint32_t network = address >> 24;

    return network != 0 && network != 127 && network < 224;
}

static bool is_ground_station(const char *text)
{
    char host[16];
    size_t length = strcspn(text, ":");
    unsigned long port;
    struct in_addr address;

    if (text[0] == '\0') {
        return true;
    }
    if (length >= sizeof(host)) {
        return false;
    }
    memcpy(host, text, length);
    host[length] = '\0';
    /* mavlink-router would take one that begins with 0 for octal. */
    if (text[length] == ':' &&
        (text[length + 1] == '0' || !config_whole_number(text + length + 1, UINT16_MAX, &port))) {
        return false;
    }
    return inet_pton(AF_INET, host, &address) == 1 && is_another_host(ntohl(address.s_addr));
}

/* Numbers only: mavlink-router, which sends there, looks up no names. */
const struct config_rule config_rule_ground_station = {
    .take = config_text_take,
    .show = config_text_show,
    .expected = "an IPv4 address such as 192.168.1.20 or 192.168.1.20:14550, or \"\"",
    .size = sizeof(((struct config *)0)->ground_station),
    .valid = is_ground_station};

/* ---- [wifi] ---- */

/* Those of which the regulatory database (wireless-regdb 2026.05.30) has rules: with another one
 * the kernel stays at "world", and hostapd waits for the country at each start. */
static const char countries[] = "AD AE AF AI AL AM AN AR AS AT AU AW AZ "
                                "BA BB BD BE BF BG BH BL BM BN BO BR BS BT BW BY BZ "
                                "CA CF CH CI CL CN CO CR CU CX CY CZ "
                                "DE DK DM DO DZ "
                                "EC EE EG ES ET "
                                "FI FM FO FR "
                                "GB GD GE GF GH GI GL GP GR GT GU GY "
                                "HK HN HR HT HU "
                                "ID IE IL IM IN IR IS IT "
                                "JM JO JP "
                                "KE KH KN KP KR KW KY KZ "
                                "LB LC LI LK LS LT LU LV "
                                "MA MC MD ME MF MH MK MN MO MP MQ MR MT MU MV MW MX MY "
                                "NA NG NI NL NO NP NZ "
                                "OM "
                                "PA PE PF PG PH PK PL PM PR PT PW PY "
                                "QA "
                                "RE RO RS RU RW "
                                "SA SE SG SI SK SM SN SR SV SX SY "
                                "TC TD TG TH TN TR TT TW TZ "
                                "UA UG US UY UZ "
                                "VA VC VE VI VN VU "
                                "WF WS "
                                "YE YT "
                                "ZA ZW";

static bool is_country(const char *text)
{
    const char *at = countries;

    if (strlen(text) != 2 || !isalpha((unsigned char)text[0]) || !isalpha((unsigned char)text[1])) {
        return false;
    }
    while (strncasecmp(at, text, 2) != 0) {
        if (strlen(at) < 4) {
            return false;
        }
        at += 3;
    }
    return true;
}

static bool take_country(const struct config_rule *rule, void *field, struct config_value *value)
{
    char *country = field;

    if (strcasecmp(value->text, "UK") == 0) {
        snprintf(value->hint, sizeof(value->hint), "did you mean GB?");
        return false;
    }
    if (!config_text_take(rule, field, value)) {
        return false;
    }
    country[0] = (char)toupper((unsigned char)country[0]);
    country[1] = (char)toupper((unsigned char)country[1]);
    return true;
}

const struct config_rule config_rule_country = {
    .take = take_country,
    .show = config_text_show,
    .expected = "the two letters of a country, such as SE or GB (not EU)",
    .size = 3,
    .valid = is_country};

#define CHANNEL_MAX 11 /* 12 and 13 are not heard everywhere */

static bool take_channel(const struct config_rule *rule, void *field, struct config_value *value)
{
    unsigned long number;

    (void)rule;
    if (!config_whole_number(value->text, CHANNEL_MAX, &number) || number == 0) {
        return false;
    }
    *(uint8_t *)field = (uint8_t)number;
    return true;
}

static void show_channel(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    (void)rule;
    snprintf(out, size, "%u", *(const uint8_t *)field);
}

const struct config_rule config_rule_channel = {
    .take = take_channel, .show = show_channel, .expected = "1-11"};

/* ---- [maintenance] ---- */

/* WPA2's passphrase: printable ASCII. Empty, as after it was taken over, is none. */
static bool is_password(const char *text)
{
    size_t length = strlen(text);

    for (size_t i = 0; i < length; i++) {
        if (text[i] < ' ' || text[i] > '~') {
            return false;
        }
    }
    return length == 0 || (length >= CONFIG_PASSWORD_MIN && length <= CONFIG_PASSWORD_MAX);
}

static void show_password(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    (void)rule;
    snprintf(out, size, "%s", *(const char *)field == '\0' ? "none" : "a password");
}

const struct config_rule config_rule_password = {
    .take = config_text_take,
    .show = show_password,
    .expected = "8-63 ASCII characters",
    .size = sizeof(((struct config *)0)->maintenance_password),
    .valid = is_password};

static bool take_yes_no(const struct config_rule *rule, void *field, struct config_value *value)
{
    (void)rule;
    return config_boolean(value->text, field);
}

static void show_yes_no(const struct config_rule *rule, const void *field, char *out, size_t size)
{
    (void)rule;
    snprintf(out, size, "%s", *(const bool *)field ? "yes" : "no");
}

const struct config_rule config_rule_yes_no = {
    .take = take_yes_no, .show = show_yes_no, .expected = "yes or no"};

/* ---- [update] ---- */

#define NAME_CHARACTERS "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789._-"

static bool is_name(const char *text)
{
    return text[strspn(text, NAME_CHARACTERS)] == '\0';
}

/* What stands in SWUpdate's configuration, between quotes: no quote, no blank, no backslash. */
static bool is_url(const char *text)
{
    size_t scheme = strncmp(text, "https://", 8) == 0  ? 8
                    : strncmp(text, "http://", 7) == 0 ? 7
                                                       : 0;

    return text[0] == '\0' || (scheme > 0 && text[scheme] != '\0' && text[scheme] != '/' &&
                               text[strspn(text, NAME_CHARACTERS ":/[]~%")] == '\0');
}

const struct config_rule config_rule_url = {
    .take = config_text_take,
    .show = config_text_show,
    .expected = "an address such as https://updates.example.org:8443, or \"\"",
    .size = sizeof(((struct config *)0)->hawkbit_url),
    .valid = is_url};

const struct config_rule config_rule_hawkbit_name = {
    .take = config_text_take,
    .show = config_text_show,
    .expected = "letters, digits, full stops, hyphens and underscores, at most 47",
    .size = sizeof(((struct config *)0)->hawkbit_id),
    .valid = is_name};

/* ---- [board] ---- */

#define NAME_RULE(table, text)                                                                     \
    {                                                                                              \
        .take = config_code_take, .show = config_code_show, .expected = text, .codes = table,      \
        .high = -1                                                                                 \
    }

const struct config_rule config_rule_antenna = NAME_RULE(config_antennas, "internal or external");
const struct config_rule config_rule_usb = NAME_RULE(config_usb_roles, "host or gadget");
const struct config_rule config_rule_console =
    NAME_RULE(config_consoles, "off, usb or uart1 to uart5");

#define UART_FIRST 1 /* 0 is the Bluetooth chip's */
#define UART_LAST 5

/* The numbers named in a list such as "uart2, uart3", a bit each; -1: something else stands there.
 */
static int uart_bits(const char *text)
{
    static const char between[] = ", \t";
    int bits = 0;

    for (text += strspn(text, between); *text != '\0'; text += strspn(text, between)) {
        if (strncasecmp(text, "uart", 4) != 0 || text[4] < '0' + UART_FIRST ||
            text[4] > '0' + UART_LAST || (text[5] != '\0' && strchr(between, text[5]) == NULL)) {
            return -1;
        }
        bits |= 1 << (text[4] - '0');
        text += 5;
    }
    return bits;
}

/* Kept in one form, in order and once each, whatever was written. */
static bool take_uarts(const struct config_rule *rule, void *field, struct config_value *value)
{
    int bits = uart_bits(value->text);
    char *out = field;
    size_t filled = 0;

    if (bits < 0) {
        return false;
    }
    memset(out, 0, rule->size);
    for (int i = UART_FIRST; i <= UART_LAST; i++) {
        if ((bits & 1 << i) != 0) {
            filled += (size_t)snprintf(out + filled, rule->size - filled, "%suart%d",
                                       filled == 0 ? "" : " ", i);
        }
    }
    return true;
}

const struct config_rule config_rule_uarts = {
    .take = take_uarts,
    .show = config_text_show,
    .expected = "a list of uart1 to uart5, such as uart3 uart5, or \"\"",
    .size = sizeof(((struct config *)0)->board_uarts)};
