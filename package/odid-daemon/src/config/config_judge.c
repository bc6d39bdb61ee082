/* The configuration as a whole: what fits its rules key by key and still can't be meant. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/earth.h"
#include "config/config_keys.h"

#define ID_NONE 0
#define ID_SERIAL 1
#define ID_REGISTRATION 2
#define ID_UTM 3
#define LOCATION_FIXED 2
#define CATEGORY_OPEN 1
#define CATEGORY_CERTIFIED 3
#define CLASS_C5 6
/* The kernel gives ports from here on to whoever asks for any; overlay/etc/init.d/S01mounts. */
#define ANYBODYS_PORTS 32768U

static void judge_basic_id(const struct config *config, unsigned index,
                           struct config_source *source)
{
    const struct config_basic_id *id = &config->basic_id[index];
    const char *section = index == 0 ? "basic_id" : "basic_id_2";
    char problem[IDENTIFIER_PROBLEM_SIZE];

    if (id->uas_id[0] == '\0') {
        return;
    }
    if (id->id_type == ID_NONE) {
        config_say(source, CONFIG_WARNING,
                   "[%s] id_type = none: receivers can't tell what kind of identifier \"%s\" is",
                   section, id->uas_id);
    } else if (id->id_type == ID_SERIAL && !identifiers_check_serial(id->uas_id, problem)) {
        config_say(source, CONFIG_WARNING,
                   "[%s] uas_id = \"%s\" is no valid serial number (CTA-2063-A): %s; it is "
                   "broadcast all the same",
                   section, id->uas_id, problem);
    } else if (id->id_type == ID_REGISTRATION && identifiers_check_serial(id->uas_id, problem)) {
        config_say(
            source, CONFIG_WARNING,
            "[%s] id_type = %s, and uas_id = \"%s\" has the form of a serial number: if it is "
            "one, set id_type = serial",
            section, config_code_name(config_id_types, id->id_type), id->uas_id);
    } else if (id->id_type >= ID_UTM) {
        config_say(source, CONFIG_WARNING,
                   "[%s] id_type = %s: \"%s\" is sent as text, not as the binary identifier that "
                   "receivers expect",
                   section, config_code_name(config_id_types, id->id_type), id->uas_id);
    }
}

static void judge_basic_ids(const struct config *config, struct config_source *source)
{
    const struct config_basic_id *first = &config->basic_id[0], *second = &config->basic_id[1];
    bool have_first = first->uas_id[0] != '\0', have_second = second->uas_id[0] != '\0';

    judge_basic_id(config, 0, source);
    judge_basic_id(config, 1, source);
    if (!have_first && !have_second) {
        config_say(
            source, CONFIG_WARNING,
            "[basic_id] uas_id is not set: the aircraft has no identity unless the autopilot "
            "sends one");
    } else if ((!have_first || first->id_type != ID_SERIAL) &&
               (!have_second || second->id_type != ID_SERIAL)) {
        config_say(source, CONFIG_WARNING,
                   "no uas_id has id_type = serial: EU rules ask for the aircraft's serial number");
    }
    if (have_first && have_second && first->id_type == second->id_type) {
        config_say(source, CONFIG_WARNING,
                   "[basic_id_2] id_type is the same as in [basic_id]: receivers keep one "
                   "identifier of a kind");
    }
}

static void judge_operator(const struct config *config, struct config_source *source)
{
    char public_part[IDENTIFIER_MAX + 1], problem[IDENTIFIER_PROBLEM_SIZE];

    if (config->operator_id[0] == '\0') {
        config_say(source, CONFIG_WARNING,
                   "[operator] operator_id is not set: no operator number is broadcast unless the "
                   "autopilot sends one");
    } else if (identifiers_check_operator(config->operator_id, public_part, problem) ==
               OPERATOR_NUMBER_INVALID) {
        config_say(source, CONFIG_WARNING,
                   "[operator] operator_id = \"%s\" is no EU operator number: %s; it is broadcast "
                   "all the same",
                   config->operator_id, problem);
    } else if (!identifiers_known_country(config->operator_id)) {
        config_say(
            source, CONFIG_WARNING,
            "[operator] operator_id = \"%s\": %.3s is no country that registers operators by "
            "EU rules. Expected SWE for Sweden, NOR for Norway, ...; it is broadcast all the "
            "same",
            config->operator_id, config->operator_id);
    }
}

static void judge_system(const struct config *config, struct config_source *source)
{
    if (config->operator_location_type == LOCATION_FIXED && isnan(config->operator_latitude_deg)) {
        config_say(
            source, CONFIG_WARNING,
            "[system] operator_location_type = fixed needs operator_latitude and "
            "operator_longitude; the ground station's place or the take-off point is sent, and "
            "until one is known none");
    }
    if (earth_is_near_zero(config->operator_latitude_deg, config->operator_longitude_deg)) {
        config_say(source, CONFIG_WARNING,
                   "[system] operator_latitude, operator_longitude: nobody stands at 0, 0, which "
                   "means unknown on the air");
    }
    if (config->classification_type == 0 && (config->category != 0 || config->class_eu != 0)) {
        config_say(
            source, CONFIG_WARNING,
            "[system] category and class mean nothing with classification_type = undeclared");
    }
    if (config->category == CATEGORY_OPEN && config->class_eu >= CLASS_C5) {
        config_say(source, CONFIG_WARNING,
                   "[system] class %s belongs to category specific, not open",
                   config_class_name(config->class_eu));
    }
    if (config->classification_type != 0 && config->class_eu != 0 &&
        (config->category == 0 || config->category == CATEGORY_CERTIFIED)) {
        config_say(source, CONFIG_WARNING,
                   "[system] class %s means nothing with category = %s: classes are of the "
                   "categories open and specific",
                   config_class_name(config->class_eu), config_category_name(config->category));
    }
    if (config->description[0] != '\0' && config->description_type == 1) {
        config_say(source, CONFIG_WARNING,
                   "[self_id] description_type = emergency: every receiver shows an emergency from "
                   "power-on");
    }
}

/* Never quoted. */
static void judge_password(const struct config *config, struct config_source *source)
{
    size_t length = strlen(config->maintenance_password);

    if (length > 0 && length < CONFIG_PASSWORD_ADVISED) {
        config_say(source, CONFIG_WARNING,
                   "[maintenance] password has %zu characters: whoever records one log-in can "
                   "guess it at leisure. Expected %d or more, by chance; it is taken all the same",
                   length, CONFIG_PASSWORD_ADVISED);
    }
}

/* "h4:/dev/ttyX@baud" uses a serial port that the autopilot can't be on as well. */
static bool uses_device(const char *adapter, const char *device)
{
    size_t length = strlen(device);

    return strncmp(adapter, "h4:", 3) == 0 && strncmp(adapter + 3, device, length) == 0 &&
           (adapter[3 + length] == '\0' || adapter[3 + length] == '@');
}

static void judge_ways(const struct config *config, struct config_source *source)
{
    bool bluetooth = config->bt4_enabled || config->bt5_enabled;

    if (!bluetooth && !config->wifi_beacon_enabled) {
        config_say(source, CONFIG_WARNING,
                   "Bluetooth and Wi-Fi are both switched off: nothing is broadcast");
    } else if (!config->bt5_enabled && !config->wifi_beacon_enabled) {
        config_say(source, CONFIG_WARNING,
                   "only Bluetooth 4 is switched on: EU rules ask for Wi-Fi or Bluetooth 5 long "
                   "range besides");
    }
    if (config->source == MAVLINK_SOURCE_SERIAL && bluetooth &&
        (uses_device(config->bt_adapter, config->device) ||
         uses_device(config->bt5_adapter, config->device))) {
        config_say(source, CONFIG_WARNING, "[mavlink] device and a Bluetooth adapter are both %s",
                   config->device);
    }
    if (config->source == MAVLINK_SOURCE_UDP && strncmp(config->udp_address, "127.", 4) != 0) {
        config_say(source, CONFIG_NOTE,
                   "[mavlink] udp_address = %s: whoever reaches it by network can feed positions",
                   config->udp_address);
    }
    if (config->source == MAVLINK_SOURCE_UDP && config->udp_port >= ANYBODYS_PORTS) {
        config_say(source, CONFIG_WARNING,
                   "[mavlink] udp_port = %u: any program can take it when odid-daemon hasn't got "
                   "it. Expected 1-%u, which the appliance keeps for itself; it is taken all the "
                   "same",
                   config->udp_port, ANYBODYS_PORTS - 1);
    }
}

static void judge_bench(const struct config *config, struct config_source *source)
{
    if (isnan(config->bench_latitude_deg)) {
        return;
    }
    config_say(
        source, CONFIG_WARNING,
        "[bench] a test position is on: an invented place is broadcast whenever the autopilot "
        "gives none; never fly with it");
    if (config->bench_latitude_deg == 0 && config->bench_longitude_deg == 0) {
        config_say(source, CONFIG_WARNING,
                   "[bench] latitude, longitude: 0, 0 means unknown on the air");
    }
}

/* The number in "uart3", or in "/dev/ttyAMA3"; -1: there is none. */
static int uart_number(const char *name, const char *prefix)
{
    size_t length = strlen(prefix);

    return strncmp(name, prefix, length) == 0 && name[length] >= '0' && name[length] <= '9' &&
                   name[length + 1] == '\0'
               ? name[length] - '0'
               : -1;
}

/* Of a port on the pin header: uart1 is /dev/ttyS1, uart2 /dev/ttyAMA2 and so on; -1: it is none.
 */
static int header_uart(const char *device)
{
    int number = uart_number(device, "/dev/ttyAMA");

    return number >= 2 ? number : strcmp(device, "/dev/ttyS1") == 0 ? 1 : -1;
}

static void judge_appliance(const struct config *config, struct config_source *source)
{
    const char *console = config_code_name(config_consoles, config->board_console);
    const char *device = config->autopilot_device;
    int uart = uart_number(console, "uart");
    char name[16];

    if ((config->bt4_enabled || config->bt5_enabled) &&
        (uses_device(config->bt_adapter, device) || uses_device(config->bt5_adapter, device))) {
        config_say(source, CONFIG_WARNING, "[autopilot] device and a Bluetooth adapter are both %s",
                   device);
    }
    if (uart >= 0 && uart == header_uart(device)) {
        config_say(source, CONFIG_WARNING,
                   "[board] console = %s is the autopilot's port, [autopilot] device = %s: no "
                   "telemetry comes through",
                   console, device);
    }
    if (strcmp(console, "usb") == 0 &&
        strcmp(config_code_name(config_usb_roles, config->board_usb), "gadget") != 0) {
        config_say(source, CONFIG_WARNING, "[board] console = usb needs usb = gadget");
    }
    snprintf(name, sizeof(name), "uart%d", header_uart(device));
    if (header_uart(device) >= 0 && strstr(config->board_uarts, name) == NULL) {
        config_say(source, CONFIG_WARNING,
                   "[autopilot] device = %s is a port that is off: [board] uarts doesn't name %s",
                   device, name);
    }
}

unsigned config_judge(const struct config *config, config_report_fn *report, void *context)
{
    struct config_source source = {.name = "", .report = report, .context = context};

    judge_basic_ids(config, &source);
    judge_operator(config, &source);
    judge_system(config, &source);
    judge_ways(config, &source);
    judge_password(config, &source);
    judge_bench(config, &source);
    judge_appliance(config, &source);
    return source.warnings;
}
