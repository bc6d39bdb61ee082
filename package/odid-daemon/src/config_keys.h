/*
 * The keys of the configuration and how each value is checked: the inside of
 * config, shared by its file reader, its environment reader and its judge.
 */
#ifndef ODID_CONFIG_KEYS_H
#define ODID_CONFIG_KEYS_H

#include "config.h"

/* Sentences about one source at most; a file of noise would give thousands. */
#define CONFIG_SENTENCES_MAX 50

/* One source of settings, and where the sentences about it go. */
struct config_source {
    const char *name; /* "odid.conf", "environment"; empty: sentences stand for themselves */
    unsigned line;    /* 0: about the whole */
    config_report_fn *report;
    void *context;
    unsigned errors, warnings, said;
};

/* Reports "<name> line <line>: <message>", valid UTF-8 and cut to CONFIG_PROBLEM_SIZE. */
void config_say(struct config_source *source, enum config_severity severity, const char *format,
                ...) __attribute__((format(printf, 3, 4)));

/* ---- names of on-air codes ---- */

struct config_code {
    const char *name; /* the first one of a code is the one shown, the others are taken too */
    int code;
};

/* Tables end with a NULL name. */
extern const struct config_code config_id_types[], config_ua_types[], config_description_types[],
    config_operator_location_types[], config_classification_types[], config_categories[],
    config_classes[], config_sources[], config_operator_id_types[];

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
    size_t offset; /* in struct config */
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
    config_rule_interface, config_rule_adapter, config_rule_second_adapter, config_rule_user;

/* true/false/yes/no/on/off/1/0; false when it is none of these. */
bool config_boolean(const char *text, bool *value);

#endif
