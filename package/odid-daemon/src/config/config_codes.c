/* Names of the codes that go on the air (opendroneid-core-c's opendroneid.h). */
#include "config/config_keys.h"

const struct config_code config_id_types[] = {
    {"none", 0}, {"serial", 1},  {"registration", 2}, {"utm", 3},
    {"uuid", 3}, {"session", 4}, {NULL, 0},
};

const struct config_code config_ua_types[] = {
    {"auto", CONFIG_UA_TYPE_AUTO},
    {"none", 0},
    {"aeroplane", 1},
    {"airplane", 1},
    {"helicopter_or_multirotor", 2},
    {"multirotor", 2},
    {"helicopter", 2},
    {"gyroplane", 3},
    {"hybrid_lift", 4},
    {"ornithopter", 5},
    {"glider", 6},
    {"kite", 7},
    {"free_balloon", 8},
    {"captive_balloon", 9},
    {"airship", 10},
    {"parachute", 11},
    {"rocket", 12},
    {"tethered", 13},
    {"ground_obstacle", 14},
    {"other", 15},
    {NULL, 0},
};

const struct config_code config_description_types[] = {
    {"text", 0}, {"emergency", 1}, {"extended_status", 2}, {NULL, 0}};

const struct config_code config_operator_location_types[] = {
    {"takeoff", 0}, {"take_off", 0}, {"live_gnss", 1}, {"dynamic", 1}, {"fixed", 2}, {NULL, 0}};

const struct config_code config_classification_types[] = {{"undeclared", 0}, {"eu", 1}, {NULL, 0}};

const struct config_code config_categories[] = {
    {"undeclared", 0}, {"open", 1}, {"specific", 2}, {"certified", 3}, {NULL, 0}};

const struct config_code config_classes[] = {{"undeclared", 0}, {"C0", 1}, {"C1", 2},
                                             {"C2", 3},         {"C3", 4}, {"C4", 5},
                                             {"C5", 6},         {"C6", 7}, {NULL, 0}};

const struct config_code config_operator_id_types[] = {{"operator_id", 0}, {NULL, 0}};

/* Not on the air: which way leads to the autopilot. */
const struct config_code config_sources[] = {
    {"serial", MAVLINK_SOURCE_SERIAL}, {"udp", MAVLINK_SOURCE_UDP}, {NULL, 0}};

/* The appliance's board; its boot script knows these words. */
const struct config_code config_antennas[] = {{"internal", 0}, {"external", 1}, {NULL, 0}};

const struct config_code config_usb_roles[] = {{"host", 0}, {"gadget", 1}, {NULL, 0}};

/* uart0 is the Bluetooth chip's. */
const struct config_code config_consoles[] = {{"off", 0},   {"usb", 1},   {"uart1", 2},
                                              {"uart2", 3}, {"uart3", 4}, {"uart4", 5},
                                              {"uart5", 6}, {NULL, 0}};

const char *config_code_name(const struct config_code *table, int code)
{
    for (; table->name != NULL; table++) {
        if (table->code == code) {
            return table->name;
        }
    }
    return "reserved";
}

const char *config_category_name(uint8_t category)
{
    return config_code_name(config_categories, category);
}

const char *config_class_name(uint8_t class_eu)
{
    return config_code_name(config_classes, class_eu);
}
