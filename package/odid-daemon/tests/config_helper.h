/* What the configuration's tests share: parsing, and the sentences that came, one a line. */
#ifndef ODID_CONFIG_HELPER_H
#define ODID_CONFIG_HELPER_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "config/config_keys.h"

#define COUNT(array) (sizeof(array) / sizeof((array)[0]))

struct config_reports {
    unsigned count, errors, warnings, notes;
    size_t filled;
    char text[16384];
};

static inline void config_reports_take(void *context, enum config_severity severity,
                                       const char *sentence)
{
    static const char *const names[] = {
        [CONFIG_ERROR] = "error", [CONFIG_WARNING] = "warning", [CONFIG_NOTE] = "note"};
    struct config_reports *reports = context;

    reports->count++;
    reports->errors += severity == CONFIG_ERROR;
    reports->warnings += severity == CONFIG_WARNING;
    reports->notes += severity == CONFIG_NOTE;
    if (reports->filled < sizeof(reports->text)) {
        reports->filled += (size_t)snprintf(reports->text + reports->filled,
                                            sizeof(reports->text) - reports->filled, "%s: %s\n",
                                            names[severity], sentence);
    }
}

static struct config config;
static struct config_reports reports;

static inline unsigned parse_bytes(const char *text, size_t length)
{
    unsigned errors;

    memset(&reports, 0, sizeof(reports));
    config_defaults(&config);
    errors = config_parse(&config, "odid.conf", text, length, config_reports_take, &reports);
    if (reports.count <= CONFIG_SENTENCES_MAX) { /* the others are counted, not told */
        assert_int_equal(errors, reports.errors);
    }
    return errors;
}

static inline unsigned parse(const char *text)
{
    return parse_bytes(text, strlen(text));
}

/* Parses, and compares every sentence that came. */
static inline void expect(const char *text, const char *sentences)
{
    parse(text);
    assert_string_equal(reports.text, sentences);
}

static inline void expect_defaults(void)
{
    struct config defaults;

    config_defaults(&defaults);
    assert_memory_equal(&config, &defaults, sizeof(config));
}

/* ---- files ---- */

static char directory[] = "/tmp/odid-config-XXXXXX";

static inline void write_file(const char *name, const char *text, size_t length)
{
    char path[64];
    int fd;

    snprintf(path, sizeof(path), "%s/%s", directory, name);
    fd = open(path, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_true(fd >= 0);
    assert_int_equal(write(fd, text, length), length);
    close(fd);
}

static inline unsigned read_file(const char *name)
{
    char path[64];
    unsigned errors;

    snprintf(path, sizeof(path), "%s/%s", directory, name);
    memset(&reports, 0, sizeof(reports));
    config_defaults(&config);
    errors = config_read_file(&config, path, config_reports_take, &reports);
    assert_int_equal(errors, reports.errors);
    return errors;
}

static inline int make_directory(void **state)
{
    (void)state;
    return mkdtemp(directory) == NULL ? -1 : 0;
}

static inline int remove_directory(void **state)
{
    char path[64];

    (void)state;
    snprintf(path, sizeof(path), "%s/odid.conf", directory);
    unlink(path);
    return rmdir(directory);
}

#endif
