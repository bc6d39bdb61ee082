#include "daemon/options.h"

#include <getopt.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/fingerprint.h"
#include "base/log.h"
#include "config/config_keys.h"

static void report(void *context, enum config_severity severity, const char *sentence)
{
    struct options *options = context;

    config_add_sentence(&options->said, severity, sentence);
    switch (severity) {
    case CONFIG_ERROR:
        options->errors++;
        log_error("%s", sentence);
        break;
    case CONFIG_WARNING:
        options->warnings++;
        log_warning("%s", sentence);
        break;
    case CONFIG_NOTE:
        log_info("%s", sentence);
        return;
    }
    if (options->reports < OPTIONS_REPORTS) {
        snprintf(options->report[options->reports++], CONFIG_PROBLEM_SIZE, "%s", sentence);
    }
}

static const char *environment(const char *name)
{
    return getenv(name);
}

/*
 * The environment that we were started with lies open in /proc/PID/environ for
 * as long as we run: what is secret in it is overwritten where it stands.
 */
static void forget_secrets(void)
{
    static const char number[] = "ODID_OPERATOR_ID=";

    for (char **entry = environ; entry != NULL && *entry != NULL; entry++) {
        if (strncmp(*entry, number, strlen(number)) == 0) {
            char *value = *entry + strlen(number);

            explicit_bzero(value, strlen(value)); /* whatever form it has */
        } else if (strncmp(*entry, "ODID_", 5) == 0) {
            identifiers_remove_secrets(*entry);
        }
    }
}

static bool read_system_id(const char *text, uint8_t *system_id)
{
    unsigned long value;

    if (!config_whole_number(text, UINT8_MAX, &value)) {
        return false;
    }
    *system_id = (uint8_t)value;
    return value >= 1;
}

/* text may be NULL. The appliance's comes from a file that may be damaged: no reason to be silent.
 */
static void expect_vehicle(struct options *options, const char *text)
{
    char sentence[CONFIG_PROBLEM_SIZE];

    if (text != NULL && !read_system_id(text, &options->expected_vehicle)) {
        options->expected_vehicle = 0;
        snprintf(sentence, sizeof(sentence), "-expect-vehicle %.32s: expected 1-255; not used",
                 text);
        report(options, CONFIG_WARNING, sentence);
    }
}

bool options_read(struct options *options, int argc, char *const argv[])
{
    enum {
        FLAG_CONFIG = 1,
        FLAG_NO_WIFI,
        FLAG_NO_BT,
        FLAG_DEBUG,
        FLAG_CHECK,
        FLAG_LOG,
        FLAG_APPLIANCE,
        FLAG_VEHICLE,
        FLAG_VERSION
    };
    static const struct option flags[] = {
        {"config", required_argument, NULL, FLAG_CONFIG},
        {"no-wifi", no_argument, NULL, FLAG_NO_WIFI},
        {"no-bt", no_argument, NULL, FLAG_NO_BT},
        {"debug", no_argument, NULL, FLAG_DEBUG},
        {"check", no_argument, NULL, FLAG_CHECK},
        {"seccomp-log", no_argument, NULL, FLAG_LOG},
        {"appliance", no_argument, NULL, FLAG_APPLIANCE},
        {"expect-vehicle", required_argument, NULL, FLAG_VEHICLE},
        {"version", no_argument, NULL, FLAG_VERSION},
        {NULL, 0, NULL, 0},
    };
    const char *file = CONFIG_FILE, *vehicle = NULL;
    bool no_wifi = false, no_bt = false, debug = false;
    int flag;

    memset(options, 0, sizeof(*options));
    while ((flag = getopt_long_only(argc, argv, "", flags, NULL)) != -1) {
        switch (flag) {
        case FLAG_CONFIG:
            file = optarg;
            break;
        case FLAG_NO_WIFI:
            no_wifi = true;
            break;
        case FLAG_NO_BT:
            no_bt = true;
            break;
        case FLAG_DEBUG:
            debug = true;
            break;
        case FLAG_CHECK:
            options->check = true;
            break;
        case FLAG_LOG:
            options->seccomp_log = true;
            break;
        case FLAG_APPLIANCE:
            options->appliance = true;
            break;
        case FLAG_VEHICLE:
            vehicle = optarg;
            break;
        case FLAG_VERSION:
            options->version = true;
            return true;
        default:
            return false; /* getopt said what is wrong */
        }
    }
    if (optind < argc) {
        fprintf(stderr, "odid-daemon: \"%s\" is no option; see odid-daemon(8)\n", argv[optind]);
        return false;
    }
    config_defaults(&options->config);
    options->said = FINGERPRINT_OF_NOTHING;
    config_read_file(&options->config, file, report, options);
    options->file = config_fingerprint(&options->config, options->said);
    config_read_environment(&options->config, environment, report, options);
    if (options->appliance) {
        config_keep_appliance(&options->config, report, options);
    }
    expect_vehicle(options, vehicle);
    forget_secrets();
    /* odidctl's concern, and not to be found here. */
    explicit_bzero(options->config.maintenance_password,
                   sizeof(options->config.maintenance_password));
    options->config.wifi_beacon_enabled = options->config.wifi_beacon_enabled && !no_wifi;
    options->config.bt4_enabled = options->config.bt4_enabled && !no_bt;
    options->config.bt5_enabled = options->config.bt5_enabled && !no_bt;
    options->config.debug = options->config.debug || debug;
    config_judge(&options->config, report, options);
    return true;
}
