/*
 * The configuration: INI file, then environment, then flags, each overriding
 * the one before (docs/configuration is the man page odid.conf(5)).
 *
 * Nothing here stops the broadcast: a value that can't be used is reported
 * with file, line, what was expected and what is used instead, and its default
 * stays in force.
 */
#ifndef ODID_CONFIG_H
#define ODID_CONFIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "config/identifiers.h"

#define CONFIG_FILE "/etc/odid/odid.conf" /* of the daemon by itself, and of Debian's package */
#define CONFIG_BASIC_IDS 2
#define CONFIG_DESCRIPTION_MAX 23 /* bytes (not characters), ASTM F3411 Self ID */
#define CONFIG_PATH_SIZE 108      /* sun_path's size: the tightest of the paths */
#define CONFIG_PROBLEM_SIZE 240   /* one report sentence, with its terminator */

enum mavlink_source { MAVLINK_SOURCE_SERIAL, MAVLINK_SOURCE_UDP };

#define CONFIG_PASSWORD_MIN 8 /* WPA2 */
#define CONFIG_PASSWORD_ADVISED 12
#define CONFIG_PASSWORD_MAX 63

/* An identity as configured. An empty uas_id means "not configured". */
struct config_basic_id {
    char uas_id[IDENTIFIER_MAX + 1];
    uint8_t id_type; /* ASTM ID type, 0-4 */
    int ua_type;     /* ASTM UA type, 0-15, or CONFIG_UA_TYPE_AUTO */
};
#define CONFIG_UA_TYPE_AUTO (-1)

/* What each one is by default, stands in its row of config_keys. */
struct config {
    /* [basic_id] and [basic_id_2]: uas_id, id_type, ua_type */
    struct config_basic_id basic_id[CONFIG_BASIC_IDS];
    /* [operator]; the secret part of the number never gets here */
    char operator_id[IDENTIFIER_MAX + 1];
    uint8_t operator_id_type; /* 0, operator ID */
    /* [self_id] */
    char description[CONFIG_DESCRIPTION_MAX + 1];
    uint8_t description_type; /* 0 text, 1 emergency, 2 extended status */
    /* [system] */
    uint8_t operator_location_type; /* 0 take-off, 1 live GNSS, 2 fixed */
    double operator_latitude_deg;   /* fixed place of the operator; NAN when not configured */
    double operator_longitude_deg;
    double operator_altitude_m;  /* above the WGS-84 ellipsoid; NAN when not configured */
    bool classification_set;     /* any of the three below was configured */
    uint8_t classification_type; /* 0 undeclared, 1 European Union */
    uint8_t category;            /* on-air code: 0 undeclared, 1 open, 2 specific, 3 certified */
    uint8_t class_eu;            /* on-air code: 0 undeclared, 1 = C0 ... 7 = C6 */
    /* [mavlink] */
    enum mavlink_source source;
    char device[CONFIG_PATH_SIZE];
    unsigned baud;
    char udp_address[46]; /* numeric IPv4 address to listen on */
    uint16_t udp_port;
    bool request_rate; /* ask the autopilot for what is used of it */
    /* [broadcast] */
    bool bt4_enabled, bt5_enabled, wifi_beacon_enabled;
    char wifi_iface[16];
    char hostapd_dir[CONFIG_PATH_SIZE];
    char bt_adapter[CONFIG_PATH_SIZE];  /* hciN or h4:/dev/ttyX[@baud] */
    char bt5_adapter[CONFIG_PATH_SIZE]; /* a second one for long range; empty: the same */
    /* [bench]: a position for tests without an autopilot; NAN when off */
    double bench_latitude_deg, bench_longitude_deg;
    /* [daemon] */
    char run_dir[CONFIG_PATH_SIZE]; /* the status socket's */
    char user[32];                  /* the daemon's own user */
    /*
     * The appliance's own sections, [autopilot] to [board]: the daemon takes no
     * notice of them. Its services ask odidctl.
     */
    char autopilot_device[CONFIG_PATH_SIZE]; /* auto, usb:vvvv:pppp or a path */
    unsigned autopilot_baud;
    char ground_station[22];       /* a.b.c.d or a.b.c.d:port; empty: none */
    char ground_station_iface[16]; /* the only way there */
    char wifi_country[3];          /* two capitals */
    char wifi_listener[16];        /* another radio's interface, or empty */
    uint8_t wifi_channel;
    /* Only from the file to odidctl, which makes a key of it; whoever doesn't clears it. */
    char maintenance_password[CONFIG_PASSWORD_MAX + 1];
    bool maintenance_at_boot;
    bool update_prevent_downgrade;
    char hawkbit_url[CONFIG_PATH_SIZE];              /* http[s]://HOST[:PORT][/...]; empty: none */
    char hawkbit_tenant[48], hawkbit_id[48];         /* empty: DEFAULT; the aircraft's serial */
    uint8_t board_antenna, board_usb, board_console; /* codes of config_keys.h */
    char board_uarts[48];                            /* "uart2 uart3"; empty: none */
    /* flags only */
    bool debug;
};

enum config_severity { CONFIG_ERROR, CONFIG_WARNING, CONFIG_NOTE };

/* Receives each report sentence once, in the order of the file. */
typedef void config_report_fn(void *context, enum config_severity severity, const char *sentence);

/* Every value at its default. */
void config_defaults(struct config *config);

/*
 * Reads an INI text (already in memory; name is used in the sentences) over
 * config. Byte-order marks, CRLF and quotes are accepted; UTF-16, NUL bytes,
 * unknown sections and keys, values out of range are reported. length in bytes.
 * Returns the number of errors.
 */
unsigned config_parse(struct config *config, const char *name, const char *text, size_t length,
                      config_report_fn *report, void *context);

/* Reads a file of at most 64 KiB. An absent or unreadable one counts as one error. */
unsigned config_read_file(struct config *config, const char *path, config_report_fn *report,
                          void *context);

/* The field study's variables ODID_UAS_ID, ..., looked up through getenv_fn (getenv itself, or a
 * test's). Returns the number of errors. */
unsigned config_read_environment(struct config *config, const char *(*getenv_fn)(const char *),
                                 config_report_fn *report, void *context);

/*
 * On the appliance some places are the image's: its other services look there and nowhere else, and
 * one that finds no daemon can't say whether the aircraft is armed. What the configuration has for
 * them is put back, with a warning each. Returns the number of warnings.
 */
unsigned config_keep_appliance(struct config *config, config_report_fn *report, void *context);

/* A report function that only adds the sentence to a number: context is a uint64_t,
 * FINGERPRINT_OF_NOTHING before the first one. */
void config_add_sentence(void *context, enum config_severity severity, const char *sentence);

/* One that leaves it to others to say what is wrong. */
void config_ignore_sentence(void *context, enum config_severity severity, const char *sentence);

/*
 * What a file has for odid-daemon, as a number: another one where a value of its sections is, or
 * what there is to say of the file or of the whole; whatever else it has for the appliance's other
 * programs. said: by config_add_sentence of the sentences about the file.
 */
uint64_t config_fingerprint(const struct config *config, uint64_t said);

/*
 * Judges the whole, after all sources: identifier formats, missing identity,
 * combinations. Sentences are warnings: what is configured is broadcast.
 * Returns the number of warnings.
 */
unsigned config_judge(const struct config *config, config_report_fn *report, void *context);

/* "specific" for (category) 2, "C4" for (class) 5, ...; "reserved" outside the tables. */
const char *config_category_name(uint8_t category);
const char *config_class_name(uint8_t class_eu);

#endif
