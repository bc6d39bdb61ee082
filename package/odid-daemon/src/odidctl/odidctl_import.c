/*
 * odidctl import: takes over what a technician put on the volume CONFIG, from
 * any computer, and explains in odid-report.txt beside it what came of it. A
 * file that is wrong is refused as a whole: what was in force stays.
 */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/faults.h"
#include "appliance/import_kept.h"
#include "appliance/password.h"
#include "appliance/settings.h"
#include "base/log.h"
#include "base/utf8.h"
#include "base/whole_file.h"
#include "config/config_edit.h"
#include "config/config_ini.h"
#include "odidctl/authorized_keys.h"
#include "odidctl/import_volume.h"
#include "odidctl/odidctl.h"
#include "odidctl/odidctl_report.h"

#define FILE_MAX 65536

struct import {
    const struct places *places;
    const char *directory;
    struct odidctl_report *report;
    const char *name; /* of the file that is being read */
    bool refused;     /* something was not taken over */
    bool unwritten;   /* the volume did not take what was to be written to it */
    unsigned key_problems;
    char fault[512]; /* the first of what went wrong */
};

#define KEY_PROBLEMS_TOLD 20

/* ---- saying ---- */

static void remember_fault(struct import *self, const char *sentence)
{
    if (self->fault[0] == '\0') {
        size_t cut = utf8_cut(sentence, sizeof(self->fault) - 1);

        memcpy(self->fault, sentence, cut);
        self->fault[cut] = '\0';
    }
}

__attribute__((format(printf, 2, 3))) static void refuse(struct import *self, const char *format,
                                                         ...)
{
    char text[600], sentence[600];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(text, sizeof(text), format, arguments);
    va_end(arguments);
    utf8_clean(sentence, sizeof(sentence), text);
    log_error("%s", sentence);
    odidctl_report_line(self->report, "  error: %s", sentence);
    remember_fault(self, sentence);
    self->refused = true;
}

static void on_sentence(void *context, enum config_severity severity, const char *sentence)
{
    struct import *self = context;

    switch (severity) {
    case CONFIG_ERROR:
        refuse(self, "%s", sentence);
        return;
    case CONFIG_WARNING:
        log_warning("%s", sentence);
        odidctl_report_line(self->report, "  warning: %s", sentence);
        return;
    case CONFIG_NOTE:
        odidctl_report_line(self->report, "  note: %s", sentence);
        return;
    }
}

/* A file of nothing else would fill the log, and the report with it. */
static void on_key_problem(void *context, unsigned line, const char *sentence)
{
    struct import *self = context;

    if (++self->key_problems > KEY_PROBLEMS_TOLD) {
        return;
    }
    refuse(self, "%s line %u: %s", self->name, line, sentence);
}

/* The volume is the technician's: what can't be written there is no reason to refuse anything. */
static void say_unwritten(struct import *self, const char *name, int error)
{
    char sentence[400];

    snprintf(sentence, sizeof(sentence), "%.260s can't be written on the volume CONFIG: %s", name,
             strerror(error));
    log_error("%s", sentence);
    remember_fault(self, sentence);
    self->unwritten = true;
}

/* ---- reading ---- */

/* The file that is named, allocated; NULL: it can't be read, which was said. */
static char *read_named(struct import *self, size_t *length)
{
    char path[IMPORT_NAME_SIZE + PLACES_PATH_SIZE], *text;

    snprintf(path, sizeof(path), "%s/%s", self->directory, self->name);
    text = whole_file_read(path, FILE_MAX, length);
    if (text == NULL) {
        refuse(self, "%s can't be read: %s", self->name,
               errno == EFBIG ? "it is larger than 64 KiB" : strerror(errno));
    }
    return text;
}

/* Why it is no text (its name goes before it), or NULL. What is kept of one with 0xFF would be
 * taken for damaged at each power-on (import_look). */
static const char *why_no_text(const char *text, size_t length)
{
    const char *fault = config_not_ini(text, length);

    if (fault == NULL && memchr(text, 0xFF, length) != NULL) {
        fault = "holds octets 0xFF, as erased flash does; save it as plain text";
    }
    return fault;
}

/* ---- odid.conf ---- */

/* What is in force now: the defaults when there is nothing that can be read. */
static void read_in_force(const struct places *places, struct config *config)
{
    config_defaults(config);
    config_read_file(config, places->config, config_ignore_sentence, NULL);
}

/* What other computers do to a text and is no fault; said so that nobody goes looking for one. */
static void note_oddities(struct import *self, const char *text, size_t length)
{
    if (length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        odidctl_report_line(
            self->report, "  note: begins with a byte-order mark, as Windows writes it: no fault");
    }
    if (memmem(text, length, "\r\n", 2) != NULL) {
        odidctl_report_line(self->report, "  note: has the line ends of Windows: no fault");
    }
    if (text[length - 1] != '\n' && text[length - 1] != '\r') {
        odidctl_report_line(self->report, "  note: ends within its last line. If the file was cut "
                                          "short, the rest of it is missing");
    }
}

/* The key first: a password that can't be kept must stay where it is. */
static void take_password(struct import *self, const char *path, const char *old,
                          const char *blanked, size_t length, const char *password)
{
    /* Set to nothing in a later line: only the earlier one is to be blanked. */
    int result = password[0] == '\0' ? 0 : password_keep(self->places->data, password);

    if (result < 0) {
        refuse(self, "%s: [maintenance] password was not taken over: %s", self->name,
               strerror(-result));
        return;
    }
    log_info("the maintenance password was taken over");
    if (places_data_in_memory(self->places)) {
        odidctl_report_line(self->report, "  note: /data is in memory: the password stays in this "
                                          "file until it can be kept");
        return;
    }
    result = password_blank(path, old, blanked, length);
    if (result < 0) {
        say_unwritten(self, self->name, -result);
        odidctl_report_line(self->report,
                            "  warning: the password could not be blanked in this file: delete it");
    }
}

/* What was set since the last import has gone with it, and nobody would know. */
static int say_lost(struct import *self)
{
    const char sentence[] = "what was set in /data is damaged, and lost: this file counts again";

    log_error("%s: %s", self->name, sentence);
    odidctl_report_line(self->report, "  warning: %s", sentence);
    return settings_mark_lost(self->places);
}

/* blanked: a right configuration, without its password. Returns whether it is in force. */
static bool take_config(struct import *self, const char *blanked, size_t length)
{
    const char *path = self->places->config;
    size_t kept_length = 0;
    char *kept = config_edit_without_secrets(blanked, length, &kept_length);
    enum import_before before = kept == NULL ? IMPORT_KEPT : import_look(path, kept, kept_length);
    int result = kept == NULL ? -ENOMEM : 0;

    if (before == IMPORT_LOST) {
        result = say_lost(self); /* before something sound stands in for it */
    }
    if (before != IMPORT_KEPT && result == 0) {
        result = import_keep(path, kept, kept_length, 0644);
        if (result == 0) {
            log_info("%s was taken over", self->name);
        }
    }
    free(kept);
    if (result < 0) {
        refuse(self, "%s can't be kept in %s: %s", self->name, path, strerror(-result));
    }
    return result == 0;
}

/* Returns whether there is no error: behind many warnings one isn't told by itself. */
static bool parse(struct import *self, struct config *config, const char *text, size_t length)
{
    unsigned errors = config_parse(config, self->name, text, length, on_sentence, self);
    const char *fault = config_not_ini(text, length) == NULL ? why_no_text(text, length) : NULL;

    if (fault != NULL) {
        refuse(self, "%s %s", self->name, fault);
        return false;
    }
    if (errors > 0 && !self->refused) {
        refuse(self, "%s: so much is wrong that errors aren't listed here", self->name);
    }
    return errors == 0;
}

/* text is cleared by the caller. Returns whether the configuration is right and in force. */
static bool import_text(struct import *self, const char *path, char *text, size_t length)
{
    char password[CONFIG_PASSWORD_MAX + 1], *blanked;
    struct config config;
    unsigned lines;
    bool in_force = false, right, alone;

    /* It counts as it stands. Of what is refused "using ..." names what stays in force instead. */
    config_defaults(&config);
    alone = config_parse(&config, self->name, text, length, config_ignore_sentence, NULL) == 0;
    if (alone) {
        config_defaults(&config);
    } else {
        read_in_force(self->places, &config);
    }
    right = parse(self, &config, text, length);
    if (right && !alone) { /* half of a place, with the other half of the one in force */
        config_defaults(&config);
        right = parse(self, &config, text, length);
    }
    explicit_bzero(&config, sizeof(config));
    if (length > 0 && config_not_ini(text, length) == NULL) {
        note_oddities(self, text, length);
    }
    if (!right) {
        return false;
    }
    blanked = calloc(1, length + 1);
    if (blanked == NULL) {
        refuse(self, "%s: %s", self->name, strerror(ENOMEM));
        return false;
    }
    memcpy(blanked, text, length);
    lines = config_edit_take_password(blanked, length, password);
    in_force = take_config(self, blanked, length);
    if (in_force && lines > 0) {
        take_password(self, path, text, blanked, length, password);
    }
    config_defaults(&config);
    config_parse(&config, self->name, blanked, length, config_ignore_sentence, NULL);
    config_keep_appliance(&config, on_sentence, self);
    snprintf(config.maintenance_password, sizeof(config.maintenance_password), "%s", password);
    config_judge(&config, on_sentence, self);
    explicit_bzero(&config, sizeof(config));
    explicit_bzero(password, sizeof(password));
    free(blanked);
    return in_force;
}

static void import_conf(struct import *self, const char *name)
{
    char path[IMPORT_NAME_SIZE + PLACES_PATH_SIZE];
    size_t length = 0;
    char *text;
    bool in_force = false;

    self->name = name;
    snprintf(path, sizeof(path), "%s/%s", self->directory, name);
    text = read_named(self, &length);
    if (text != NULL) {
        in_force = import_text(self, path, text, length);
        explicit_bzero(text, length);
        free(text);
    }
    odidctl_report_line(self->report, "  %s",
                        in_force
                            ? "It was taken over. odidctl may have changed single values since."
                            : "NOTHING OF IT WAS TAKEN OVER, because of the errors. What was in "
                              "force before stays in force.");
}

/* Of a file that isn't taken over, and won't be: its password doesn't stay in it either. */
static void blank_unused(struct import *self, const char *name)
{
    char path[IMPORT_NAME_SIZE + PLACES_PATH_SIZE], password[CONFIG_PASSWORD_MAX + 1];
    char *text, *blanked;
    size_t length = 0;

    if (name[0] == '\0') {
        return;
    }
    snprintf(path, sizeof(path), "%s/%s", self->directory, name);
    text = whole_file_read(path, FILE_MAX, &length);
    blanked = text == NULL ? NULL : strdup(text); /* a power cut's zeros may follow */
    if (blanked != NULL && config_edit_take_password(blanked, strlen(text), password) > 0) {
        int result = password_blank(path, text, blanked, strlen(text));

        if (result < 0) {
            say_unwritten(self, name, -result);
        }
        odidctl_report_line(self->report,
                            result < 0 ? "  warning: %s has a password, which could not be blanked "
                                         "there: delete it"
                                       : "  note: %s had a password, which doesn't count: it is "
                                         "blanked there",
                            name);
        explicit_bzero(password, sizeof(password));
    }
    if (text != NULL) {
        explicit_bzero(text, length);
    }
    free(text);
    free(blanked);
}

static void import_config(struct import *self, const struct import_volume *volume)
{
    const char *name = volume->conf[0] != '\0' ? volume->conf : volume->conf_txt;

    odidctl_report_line(self->report, "odid.conf");
    if (volume->conf[0] != '\0' && volume->conf_txt[0] != '\0') {
        odidctl_report_line(self->report,
                            "  warning: there are %s and %s: the first one counts. Windows hides "
                            "the ending .txt",
                            volume->conf, volume->conf_txt);
        log_warning("there are %s and %s: the first one counts", volume->conf, volume->conf_txt);
    } else if (volume->conf[0] == '\0' && volume->conf_txt[0] != '\0') {
        odidctl_report_line(self->report,
                            "  note: its name is %s (Windows adds .txt and hides it): taken as "
                            "odid.conf",
                            volume->conf_txt);
    }
    blank_unused(self, volume->cut);
    blank_unused(self, volume->cut_txt);
    if (name[0] != '\0') {
        import_conf(self, name);
        if (name != volume->conf_txt && !self->refused) {
            blank_unused(self, volume->conf_txt);
        }
    } else if (volume->apple[0] != '\0') {
        refuse(self,
               "there is only %s, which macOS puts beside the real file: odid.conf itself is "
               "missing; what was in force before stays in force",
               volume->apple);
    } else if (volume->similar[0] != '\0') {
        refuse(self,
               "there is no odid.conf, but %s: save it as plain text with the name "
               "odid.conf; what was in force before stays in force",
               volume->similar);
    } else {
        odidctl_report_line(self->report,
                            "  There is none on this volume: what was in force before "
                            "stays in force.");
    }
}

/* ---- authorized_keys ---- */

static void keep_keys(struct import *self, const char *text, size_t length)
{
    char path[PLACES_PATH_SIZE];
    int result = 0;

    snprintf(path, sizeof(path), "%s/ssh", self->places->data);
    if (mkdir(path, 0700) < 0 && errno != EEXIST) {
        result = -errno;
    }
    snprintf(path, sizeof(path), "%s/ssh/authorized_keys", self->places->data);
    if (result == 0 && import_look(path, text, length) != IMPORT_KEPT) {
        result = import_keep(path, text, length, 0600);
        if (result == 0) {
            log_info("%s was taken over", self->name);
        }
    }
    if (result < 0) {
        refuse(self, "%s can't be kept in %s: %s", self->name, path, strerror(-result));
    }
}

/* Returns the number of keys that are right; what is wrong was said. */
static unsigned judge_keys(struct import *self, char *text, size_t *length)
{
    const char *fault = why_no_text(text, *length);
    struct authorized_keys found = {0};

    if (fault != NULL) {
        refuse(self, "%s %s", self->name, fault);
        return 0;
    }
    found = authorized_keys_read(text, length, on_key_problem, self);
    if (self->key_problems > KEY_PROBLEMS_TOLD) {
        refuse(self, "%s: and %u lines more", self->name, self->key_problems - KEY_PROBLEMS_TOLD);
    }
    if (found.keys + found.comments + found.errors == 0) {
        refuse(self, "%s holds no key; to close SSH, write a comment into it (# none)", self->name);
    } else if (found.keys == 0 && found.errors == 0) {
        *length = 0; /* then SSH doesn't even listen */
    }
    return found.keys;
}

static void import_keys(struct import *self, const struct import_volume *volume)
{
    bool refused_before = self->refused;
    size_t length = 0;
    unsigned keys;
    char *text;

    self->name = volume->keys[0] != '\0' ? volume->keys : volume->keys_txt;
    odidctl_report_line(self->report, "%s", "");
    odidctl_report_line(self->report, "authorized_keys");
    if (self->name[0] == '\0') {
        odidctl_report_line(self->report, "  There is none on this volume: keys that were taken "
                                          "over before stay in force.");
        return;
    }
    text = read_named(self, &length);
    if (text == NULL) {
        return;
    }
    self->refused = false;
    keys = judge_keys(self, text, &length);
    if (!self->refused) {
        keep_keys(self, text, length);
    }
    free(text);
    if (self->refused) {
        odidctl_report_line(self->report, "  NONE OF ITS KEYS WAS TAKEN OVER. Those of before stay "
                                          "in force.");
    } else {
        odidctl_report_line(self->report, "  It was taken over: %u key%s may log in.", keys,
                            keys == 1 ? "" : "s");
    }
    self->refused = self->refused || refused_before;
}

/* ---- all of it ---- */

/* What the report says of the password. */
static const char *look_after_password(struct import *self)
{
    bool made = false;
    int result = password_show_made(self->places->data, self->directory, &made);

    if (result < 0 && made) {
        say_unwritten(self, PASSWORD_NAME, -result);
    } else if (result < 0) {
        log_error("no maintenance password can be made and kept: %s", strerror(-result));
    }
    if (made) {
        return "made by this board, see " PASSWORD_NAME;
    }
    return password_known(self->places->data) ? "set" : "not set";
}

static void finish(struct import *self)
{
    char path[PLACES_PATH_SIZE + 20], sentence[700];
    struct config config;
    int result;

    read_in_force(self->places, &config);
    odidctl_report_in_force(self->report, &config, look_after_password(self));
    explicit_bzero(&config, sizeof(config));
    snprintf(path, sizeof(path), "%s/" ODIDCTL_REPORT_NAME, self->directory);
    result = odidctl_report_write(self->report, path, self->places->run_dir);
    if (result < 0) {
        say_unwritten(self, ODIDCTL_REPORT_NAME, -result);
    }
    if (self->refused) {
        snprintf(sentence, sizeof(sentence),
                 "The volume CONFIG was not taken over as it is, see odid-report.txt there: %s",
                 self->fault);
    } else {
        snprintf(sentence, sizeof(sentence), "%s", self->fault);
    }
    faults_set(self->places->faults, "config", self->refused || self->unwritten ? sentence : NULL);
}

int odidctl_import(const struct places *places, const char *directory)
{
    struct import self = {.places = places, .directory = directory};
    struct import_volume volume = {0};
    char path[PLACES_PATH_SIZE];
    int result = import_volume_look(directory, &volume), lock;

    if (result < 0) {
        log_error("%s can't be read: %s; what was in force before stays in force", directory,
                  strerror(-result));
        return ODIDCTL_NOT_GOOD;
    }
    self.report = odidctl_report_begin();
    if (self.report == NULL) {
        log_error("import: %s", strerror(errno));
        return ODIDCTL_NOT_GOOD;
    }
    snprintf(path, sizeof(path), "%s/odid", places->data);
    if (mkdir(path, 0755) < 0 && errno != EEXIST) {
        log_error("%s can't be made: %s", path, strerror(errno)); /* what follows says the rest */
    }
    lock = whole_file_lock(path); /* keeps "odidctl set" out */
    import_config(&self, &volume);
    import_keys(&self, &volume);
    finish(&self);
    if (lock >= 0) {
        close(lock);
    }
    odidctl_report_end(self.report);
    return self.refused ? ODIDCTL_NOT_GOOD : self.unwritten ? ODIDCTL_HALF_DONE : ODIDCTL_GOOD;
}

/* ---- what would be taken over ---- */

static void judge_conf_file(struct import *self)
{
    size_t length = 0;
    char *text = read_named(self, &length);
    struct config config;

    if (text != NULL) {
        config_defaults(&config);
        parse(self, &config, text, length);
        explicit_bzero(&config, sizeof(config));
        explicit_bzero(text, length);
        free(text);
    }
}

static void judge_keys_file(struct import *self)
{
    size_t length = 0;
    char *text = read_named(self, &length);

    if (text != NULL) {
        judge_keys(self, text, &length);
        free(text);
    }
}

static void judge_volume(struct import *self, const struct import_volume *volume)
{
    self->name = volume->conf[0] != '\0' ? volume->conf : volume->conf_txt;
    if (self->name[0] == '\0') {
        refuse(self, "there is no odid.conf");
    } else {
        judge_conf_file(self);
    }
    self->name = volume->keys[0] != '\0' ? volume->keys : volume->keys_txt;
    if (self->name[0] != '\0') {
        judge_keys_file(self);
    }
}

int odidctl_import_check(const char *directory)
{
    struct import self = {.directory = directory, .report = odidctl_report_begin()};
    struct import_volume volume = {0};
    int result = import_volume_look(directory, &volume);

    if (result < 0 || self.report == NULL) {
        printf("%s: can't be read: %s\n", directory, strerror(result < 0 ? -result : ENOMEM));
        odidctl_report_end(self.report);
        return ODIDCTL_NOT_GOOD;
    }
    judge_volume(&self, &volume);
    odidctl_report_end(self.report);
    if (self.refused) {
        printf("%s: not all of it would be taken over: %s\n", directory, self.fault);
        return ODIDCTL_NOT_GOOD;
    }
    printf("%s: would be taken over\n", directory);
    return ODIDCTL_GOOD;
}
