#include "config/config_keys.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/fingerprint.h"
#include "base/utf8.h"

#define AT(field) offsetof(struct config, field)

/* A companion computer may have a hostapd of its own, which makes the usual folder its own. */
#ifdef ODID_COMPANION
#define HOSTAPD_DIR "/run/odid-hostapd/control"
#else
#define HOSTAPD_DIR "/run/hostapd"
#endif

/* What the daemon takes no notice of. */
static const char *const of_the_appliance[] = {"autopilot",   "ground_station", "wifi",
                                               "maintenance", "update",         "board"};

const struct config_key config_keys[] = {
    {"basic_id", "uas_id", "", AT(basic_id[0].uas_id), &config_rule_id},
    {"basic_id", "id_type", "serial", AT(basic_id[0].id_type), &config_rule_id_type},
    {"basic_id", "ua_type", "auto", AT(basic_id[0].ua_type), &config_rule_ua_type},
    {"basic_id_2", "uas_id", "", AT(basic_id[1].uas_id), &config_rule_id},
    {"basic_id_2", "id_type", "serial", AT(basic_id[1].id_type), &config_rule_id_type},
    {"basic_id_2", "ua_type", "auto", AT(basic_id[1].ua_type), &config_rule_ua_type},
    {"operator", "operator_id", "", AT(operator_id), &config_rule_operator},
    {"operator", "operator_id_type", "operator_id", AT(operator_id_type),
     &config_rule_operator_id_type},
    {"self_id", "description", "", AT(description), &config_rule_description},
    {"self_id", "description_type", "text", AT(description_type), &config_rule_description_type},
    {"system", "operator_location_type", "takeoff", AT(operator_location_type),
     &config_rule_operator_location},
    {"system", "operator_latitude", "", AT(operator_latitude_deg), &config_rule_latitude},
    {"system", "operator_longitude", "", AT(operator_longitude_deg), &config_rule_longitude},
    {"system", "operator_altitude", "", AT(operator_altitude_m), &config_rule_altitude},
    {"system", "classification_type", "eu", AT(classification_type), &config_rule_classification},
    {"system", "category", "undeclared", AT(category), &config_rule_category},
    {"system", "class", "undeclared", AT(class_eu), &config_rule_class},
    {"mavlink", "source", "serial", AT(source), &config_rule_source},
    {"mavlink", "device", "/dev/ttyACM0", AT(device), &config_rule_device},
    {"mavlink", "baud", "921600", AT(baud), &config_rule_baud},
    {"mavlink", "udp_address", "127.0.0.1", AT(udp_address), &config_rule_address},
    {"mavlink", "udp_port", "14550", AT(udp_port), &config_rule_port},
    {"mavlink", "request_rate", "true", AT(request_rate), &config_rule_boolean},
    {"broadcast", "bt4_enabled", "true", AT(bt4_enabled), &config_rule_boolean},
    {"broadcast", "bt5_enabled", "true", AT(bt5_enabled), &config_rule_boolean},
    {"broadcast", "wifi_beacon_enabled", "true", AT(wifi_beacon_enabled), &config_rule_boolean},
    {"broadcast", "wifi_iface", "wlan0", AT(wifi_iface), &config_rule_interface},
    {"broadcast", "hostapd_dir", HOSTAPD_DIR, AT(hostapd_dir), &config_rule_directory},
    {"broadcast", "bt_adapter", "hci0", AT(bt_adapter), &config_rule_adapter},
    {"broadcast", "bt5_adapter", "", AT(bt5_adapter), &config_rule_second_adapter},
    {"bench", "latitude", "", AT(bench_latitude_deg), &config_rule_latitude},
    {"bench", "longitude", "", AT(bench_longitude_deg), &config_rule_longitude},
    {"daemon", "run_dir", "/run/odid", AT(run_dir), &config_rule_directory},
    {"daemon", "user", "odid", AT(user), &config_rule_user},
    {"autopilot", "device", "auto", AT(autopilot_device), &config_rule_autopilot},
    {"autopilot", "baud", "921600", AT(autopilot_baud), &config_rule_baud},
    {"ground_station", "address", "", AT(ground_station), &config_rule_ground_station},
    {"ground_station", "interface", "eth0", AT(ground_station_iface), &config_rule_interface},
    {"wifi", "country", "SE", AT(wifi_country), &config_rule_country},
    {"wifi", "channel", "6", AT(wifi_channel), &config_rule_channel},
    {"wifi", "listener", "", AT(wifi_listener), &config_rule_listener},
    {"maintenance", "password", "", AT(maintenance_password), &config_rule_password},
    {"maintenance", "at_boot", "no", AT(maintenance_at_boot), &config_rule_yes_no},
    {"update", "prevent_downgrade", "no", AT(update_prevent_downgrade), &config_rule_yes_no},
    {"update", "hawkbit_url", "", AT(hawkbit_url), &config_rule_url},
    {"update", "hawkbit_tenant", "", AT(hawkbit_tenant), &config_rule_hawkbit_name},
    {"update", "hawkbit_id", "", AT(hawkbit_id), &config_rule_hawkbit_name},
    {"board", "antenna", "internal", AT(board_antenna), &config_rule_antenna},
    {"board", "usb", "host", AT(board_usb), &config_rule_usb},
    {"board", "console", "off", AT(board_console), &config_rule_console},
    {"board", "uarts", "", AT(board_uarts), &config_rule_uarts},
    {NULL, NULL, NULL, 0, NULL},
};

_Static_assert(sizeof(config_keys) / sizeof(config_keys[0]) <= CONFIG_KEYS_MAX,
               "CONFIG_KEYS_MAX is too small");

const struct config_key *config_key_find(const char *section, const char *name)
{
    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        if (strcasecmp(key->section, section) == 0 && strcasecmp(key->name, name) == 0) {
            return key;
        }
    }
    return NULL;
}

const char *config_section_known(const char *name)
{
    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        if (strcasecmp(key->section, name) == 0) {
            return key->section;
        }
    }
    return NULL;
}

/* ---- nearest known name, for what was probably meant ---- */

#define NAME_MAX_LENGTH 32

static size_t edit_distance(const char *a, const char *b)
{
    size_t row[NAME_MAX_LENGTH + 1], length_a = strlen(a), length_b = strlen(b);

    if (length_a > NAME_MAX_LENGTH || length_b > NAME_MAX_LENGTH) {
        return SIZE_MAX;
    }
    for (size_t j = 0; j <= length_b; j++) {
        row[j] = j;
    }
    for (size_t i = 1; i <= length_a; i++) {
        size_t diagonal = row[0];

        row[0] = i;
        for (size_t j = 1; j <= length_b; j++) {
            size_t replaced = diagonal + (strncasecmp(&a[i - 1], &b[j - 1], 1) != 0);
            size_t removed = (row[j] < row[j - 1] ? row[j] : row[j - 1]) + 1;

            diagonal = row[j];
            row[j] = replaced < removed ? replaced : removed;
        }
    }
    return row[length_b];
}

const char *config_name_nearest(const char *name, const char *section)
{
    const char *best = NULL;
    size_t best_distance = 3;

    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        const char *candidate = section == NULL ? key->section : key->name;
        size_t distance;

        if (section != NULL && strcasecmp(section, key->section) != 0) {
            continue;
        }
        distance = edit_distance(name, candidate);
        if (distance < best_distance && distance * 2 <= strlen(candidate)) {
            best = candidate;
            best_distance = distance;
        }
    }
    return best;
}

/* ---- sentences ---- */

/* What was written, cut to a length that leaves room for the rest of the sentence. */
static void quote(char *out, size_t size, const char *text)
{
    size_t cut = utf8_cut(text, size - 4);

    snprintf(out, size, "%.*s%s", (int)cut, text, text[cut] == '\0' ? "" : "...");
}

/* https://USER:PASSWORD@HOST, as it may be quoted. Where it is mistyped, or the password has an @
 * or a :// in it, rather too little of it. */
static void hide_credentials(char *out, size_t size, const struct config_rule *rule,
                             const char *text)
{
    const char *mark = strstr(text, "://"), *end = strrchr(text, '@');
    size_t scheme = strcspn(text, ":@");

    if (end == NULL || (mark == NULL && rule != &config_rule_url)) {
        snprintf(out, size, "%s", text);
    } else {
        snprintf(out, size, "%.*s...%s", mark == text + scheme ? (int)scheme + 3 : 0, text, end);
    }
}

static void say_refused(const struct config_rule *rule, const void *field,
                        struct config_value *value)
{
    char plain[128], written[52], used[60];

    hide_credentials(plain, sizeof(plain), rule, value->text);
    quote(written, sizeof(written), plain);
    rule->show(rule, field, used, sizeof(used));
    if (rule == &config_rule_password) {
        config_say(value->source, CONFIG_ERROR, "%s: expected %s; not used", value->label,
                   rule->expected);
        explicit_bzero(plain, sizeof(plain));
        explicit_bzero(written, sizeof(written));
    } else if (value->hint[0] != '\0') {
        config_say(value->source, CONFIG_ERROR, "%s = \"%s\": %s; using %s", value->label, written,
                   value->hint, used);
    } else {
        config_say(value->source, CONFIG_ERROR, "%s = \"%s\": expected %s; using %s", value->label,
                   written, rule->expected, used);
    }
}

/* ---- taking a value ---- */

/* What is configured of the classification wins over the autopilot's: any of the three. */
static bool is_classification(const struct config_key *key)
{
    return key->rule == &config_rule_classification || key->rule == &config_rule_category ||
           key->rule == &config_rule_class;
}

void config_key_take(const struct config_key *key, struct config *config,
                     struct config_value *value)
{
    void *field = (char *)config + key->offset;

    value->hint[0] = '\0';
    if (!key->rule->take(key->rule, field, value)) {
        say_refused(key->rule, field, value);
    } else if (is_classification(key)) {
        config->classification_set = true;
    }
}

/* ---- showing a value ---- */

bool config_key_is_secret(const struct config_key *key)
{
    return key->rule == &config_rule_password;
}

void config_key_show(const struct config_key *key, const struct config *config, char *out,
                     size_t size)
{
    const void *field = (const char *)config + key->offset;
    bool unset;

    if (key->rule->show == config_text_show) {
        unset = *(const char *)field == '\0';
    } else if (key->rule->show == config_number_show) {
        unset = isnan(*(const double *)field);
    } else {
        unset = config_key_is_secret(key);
    }
    if (unset) {
        snprintf(out, size, "%s", "");
    } else {
        key->rule->show(key->rule, field, out, size);
    }
}

/* ---- what a file has for odid-daemon ---- */

static bool is_of_the_appliance(const struct config_key *key)
{
    for (size_t i = 0; i < sizeof(of_the_appliance) / sizeof(of_the_appliance[0]); i++) {
        if (strcmp(key->section, of_the_appliance[i]) == 0) {
            return true;
        }
    }
    return false;
}

void config_add_sentence(void *context, enum config_severity severity, const char *sentence)
{
    uint64_t *found = context;

    (void)severity;
    *found = fingerprint(*found, sentence, strlen(sentence) + 1);
}

void config_ignore_sentence(void *context, enum config_severity severity, const char *sentence)
{
    (void)context;
    (void)severity;
    (void)sentence;
}

uint64_t config_fingerprint(const struct config *config, uint64_t said)
{
    uint64_t found = fingerprint(said, &config->classification_set, sizeof(bool));

    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        char shown[2 * CONFIG_PATH_SIZE];

        if (!is_of_the_appliance(key)) {
            config_key_show(key, config, shown, sizeof(shown));
            found = fingerprint(found, shown, strlen(shown) + 1);
        }
    }
    config_judge(config, config_add_sentence, &found);
    return found;
}
