/*
 * The keys of the configuration and how each value is checked: the inside of
 * config, shared by its file reader, its environment reader and its judge.
 */
#ifndef ODID_CONFIG_KEYS_H
#define ODID_CONFIG_KEYS_H

#include "config/config.h"

/* Sentences about one source at most; a file of noise would give thousands. */
#define CONFIG_SENTENCES_MAX 50

struct config_key;

/*
 * Told where things stand: of each key that is known, with its value as it was
 * written; and with key NULL of each section, value being its name ("?" for an
 * unknown one). line counts from 1. A value may hold a secret: it is cleared
 * after the call.
 */
typedef void config_place_fn(void *context, const struct config_key *key, const char *value,
                             unsigned line);

/* One source of settings, and where the sentences about it go. */
struct config_source {
    const char *name; /* "odid.conf", "environment"; empty: sentences stand for themselves */
    unsigned line;    /* 0: about the whole */
    config_report_fn *report;
    config_place_fn *place; /* NULL: nobody asks */
    void *context;
    unsigned errors, warnings, said;
};

/* Reports "<name> line <line>: <message>", valid UTF-8 and cut to CONFIG_PROBLEM_SIZE. */
void config_say(struct config_source *source, enum config_severity severity, const char *format,
                ...) __attribute__((format(printf, 3, 4)));

/* config_parse that also tells the places of what it reads. */
unsigned config_parse_places(struct config *config, const char *name, const char *text,
                             size_t length, config_report_fn *report, config_place_fn *place,
                             void *context);

/* Why a text is no INI file at all ("is empty", "is UTF-16 text; ..."); NULL when it may be one. */
const char *config_not_ini(const char *text, size_t length);

/* ---- names of on-air codes ---- */

struct config_code {
    const char *name; /* the first one of a code is the one shown, the others are taken too */
    int code;
};

/* Tables end with a NULL name. */
extern const struct config_code config_id_types[], config_ua_types[], config_description_types[],
    config_operator_location_types[], config_classification_types[], config_categories[],
    config_classes[], config_sources[], config_operator_id_types[], config_antennas[],
    config_usb_roles[], config_consoles[];

/* The name of a code; "reserved" when the table has none. */
const char *config_code_name(const struct config_code *table, int code);

/* ---- values ---- */

/* A value as it was written, on its way into the configuration. */
struct config_value {
    struct config_source *source;
    const char *label; /* "[system] category", "ODID_UDP_PORT" */
    const char *text;
    char hint[64]; /* replaces "expected ..." in the sentence; empty: that one */
};

struct config_rule; /* how one kind of value is checked */

struct config_key {
    const char *section, *name;
    const char *by_default; /* as one would write it; "": nothing is set */
    size_t offset;          /* in struct config */
    const struct config_rule *rule;
};

/* The table, ended by a NULL section. */
#define CONFIG_KEYS_MAX 64
extern const struct config_key config_keys[];

/* Section and key compare without regard to case. NULL: no such key. */
const struct config_key *config_key_find(const char *section, const char *name);

/* The section's name as the table has it; NULL: no such section. */
const char *config_section_known(const char *name);

/* The key of that section (section NULL: the section) that was probably meant; NULL: none is near.
 */
const char *config_name_nearest(const char *name, const char *section);

/* Puts a value into the configuration, or says why not and what is used instead. */
void config_key_take(const struct config_key *key, struct config *config,
                     struct config_value *value);

/* A secret's value is never shown, quoted or kept. */
bool config_key_is_secret(const struct config_key *key);

/* What is in force, as one would write it; "" for what is not set, and for a secret. */
void config_key_show(const struct config_key *key, const struct config *config, char *out,
                     size_t size);

/* ---- rules (config_rules.c) ---- */

struct config_rule {
    /* Returns false when the value is of no use: the caller says so. */
    bool (*take)(const struct config_rule *rule, void *field, struct config_value *value);
    /* What is in force, as one would write it. */
    void (*show)(const struct config_rule *rule, const void *field, char *out, size_t size);
    const char *expected;
    const struct config_code *codes;
    bool wide;        /* the code's field is an int, else a uint8_t */
    double low, high; /* of numbers */
    size_t size;      /* of texts, terminator included */
    bool (*valid)(const char *text);
};

extern const struct config_rule config_rule_id, config_rule_operator, config_rule_description,
    config_rule_id_type, config_rule_ua_type, config_rule_operator_id_type,
    config_rule_description_type, config_rule_operator_location, config_rule_classification,
    config_rule_category, config_rule_class, config_rule_source, config_rule_boolean,
    config_rule_latitude, config_rule_longitude, config_rule_altitude, config_rule_baud,
    config_rule_port, config_rule_address, config_rule_device, config_rule_directory,
    config_rule_interface, config_rule_listener, config_rule_adapter, config_rule_second_adapter,
    config_rule_user;

/* The appliance's (config_appliance.c) */
extern const struct config_rule config_rule_autopilot, config_rule_ground_station,
    config_rule_country, config_rule_channel, config_rule_password, config_rule_yes_no,
    config_rule_url, config_rule_hawkbit_name, config_rule_antenna, config_rule_usb,
    config_rule_console, config_rule_uarts;

/* What several rules are made of. text_take wants size and valid, code_take codes and high. */
bool config_text_take(const struct config_rule *rule, void *field, struct config_value *value);
void config_text_show(const struct config_rule *rule, const void *field, char *out, size_t size);
bool config_code_take(const struct config_rule *rule, void *field, struct config_value *value);
void config_number_show(const struct config_rule *rule, const void *field, char *out, size_t size);
void config_code_show(const struct config_rule *rule, const void *field, char *out, size_t size);

/* Digits only, up to high: no sign, no blanks, no other base. */
bool config_whole_number(const char *text, unsigned long high, unsigned long *number);

/* true/false/yes/no/on/off/1/0; false when it is none of these. */
bool config_boolean(const char *text, bool *value);

#endif
