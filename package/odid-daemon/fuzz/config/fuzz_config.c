/*
 * Any bytes as a configuration file, and as the environment -> values within
 * their ranges, sentences that are UTF-8, and no secret part in either.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/utf8.h"
#include "config/config.h"

#define REQUIRE(condition)                                                                         \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            abort();                                                                               \
        }                                                                                          \
    } while (0)

static void require_text(const char *text, size_t size)
{
    char copy[CONFIG_PROBLEM_SIZE];
    size_t length = strnlen(text, size);

    REQUIRE(length < size);
    memcpy(copy, text, length + 1);
    REQUIRE(!identifiers_remove_secrets(copy));
    for (const char *c = text; *c != '\0'; c += utf8_character(c)) {
        REQUIRE(utf8_character(c) > 0 && (unsigned char)*c >= ' ');
    }
}

static void on_sentence(void *context, enum config_severity severity, const char *sentence)
{
    unsigned *errors = context;

    *errors += severity == CONFIG_ERROR;
    require_text(sentence, CONFIG_PROBLEM_SIZE);
}

static void require_place(double latitude_deg, double longitude_deg)
{
    REQUIRE(isnan(latitude_deg) == isnan(longitude_deg));
    REQUIRE(isnan(latitude_deg) || (fabs(latitude_deg) <= 90 && fabs(longitude_deg) <= 180));
}

static void require_ranges(const struct config *config)
{
    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        require_text(config->basic_id[i].uas_id, sizeof(config->basic_id[i].uas_id));
        REQUIRE(config->basic_id[i].id_type <= 4);
        REQUIRE(config->basic_id[i].ua_type >= CONFIG_UA_TYPE_AUTO);
        REQUIRE(config->basic_id[i].ua_type <= 15);
    }
    require_text(config->operator_id, sizeof(config->operator_id));
    REQUIRE(strchr(config->operator_id, '-') == NULL);
    REQUIRE(config->operator_id_type == 0);
    require_text(config->description, sizeof(config->description));
    REQUIRE(config->description_type <= 2 && config->operator_location_type <= 2);
    REQUIRE(config->classification_type <= 1 && config->category <= 3 && config->class_eu <= 7);
    require_place(config->operator_latitude_deg, config->operator_longitude_deg);
    require_place(config->bench_latitude_deg, config->bench_longitude_deg);
    REQUIRE(config->source == MAVLINK_SOURCE_SERIAL || config->source == MAVLINK_SOURCE_UDP);
    REQUIRE(config->device[0] == '/' && config->hostapd_dir[0] == '/' && config->run_dir[0] == '/');
    REQUIRE(config->baud >= 1200 && config->udp_port != 0);
    require_text(config->device, sizeof(config->device));
    require_text(config->udp_address, sizeof(config->udp_address));
    require_text(config->wifi_iface, sizeof(config->wifi_iface));
    require_text(config->wifi_listener, sizeof(config->wifi_listener));
    require_text(config->hostapd_dir, sizeof(config->hostapd_dir));
    require_text(config->bt_adapter, sizeof(config->bt_adapter));
    require_text(config->bt5_adapter, sizeof(config->bt5_adapter));
    require_text(config->run_dir, sizeof(config->run_dir));
    require_text(config->user, sizeof(config->user));
}

static char *variable; /* every variable holds the same */

static const char *lookup(const char *name)
{
    (void)name;
    return variable;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct config config;
    unsigned errors = 0, told = 0;

    config_defaults(&config);
    errors = config_parse(&config, "odid.conf", (const char *)data, size, on_sentence, &told);
    REQUIRE(told <= errors); /* after the fiftieth sentence they are only counted */
    require_ranges(&config);
    config_judge(&config, on_sentence, &told);

    variable = malloc(size + 1);
    if (variable != NULL) {
        memcpy(variable, data, size);
        variable[size] = '\0';
        config_read_environment(&config, lookup, on_sentence, &told);
        require_ranges(&config);
        free(variable);
    }
    return 0;
}
