/* odidctl get, set and in-force: the configuration in force. */
#include "appliance/settings.h"

#include <errno.h>
#include <inttypes.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "appliance/exits.h"
#include "appliance/faults.h"
#include "appliance/password.h"
#include "appliance/places.h"
#include "appliance/status_fetch.h"
#include "appliance/wrong.h"
#include "base/fingerprint.h"
#include "base/whole_file.h"
#include "config/config_edit.h"
#include "config/config_keys.h"

#define FILE_MAX 65536
#define VALUE_SIZE 256 /* a line is no longer */

/* ---- SECTION.KEY ---- */

static void say_unknown(const char *section, const char *key)
{
    const char *known = config_section_known(section), *meant;

    if (known == NULL) {
        meant = config_name_nearest(section, NULL);
        fprintf(stderr, "odidctl: [%.40s]: unknown section", section);
    } else {
        meant = config_name_nearest(key, known);
        fprintf(stderr, "odidctl: [%s] %.40s: unknown key", known, key);
    }
    fprintf(stderr, meant == NULL ? "; odid.conf(5) lists them.\n" : "; did you mean %s?\n", meant);
}

/* NULL: there is none, which was said. */
static const struct config_key *find_key(const char *name)
{
    const char *dot = strchr(name, '.');
    const struct config_key *key;
    char section[40];

    if (dot == NULL) {
        fprintf(stderr, "odidctl: \"%.40s\" is no SECTION.KEY, such as wifi.channel\n", name);
        return NULL;
    }
    snprintf(section, sizeof(section), "%.*s", (int)(dot - name), name);
    key = config_key_find(section, dot + 1);
    if (key == NULL) {
        say_unknown(section, dot + 1);
    }
    return key;
}

/* ---- sentences ---- */

/* What a reading of the configuration says, one sentence a line. */
struct sentences {
    size_t filled;
    char text[16384];
};

static void keep_sentence(void *context, enum config_severity severity, const char *sentence)
{
    static const char *const names[] = {
        [CONFIG_ERROR] = "error", [CONFIG_WARNING] = "warning", [CONFIG_NOTE] = "note"};
    struct sentences *sentences = context;
    size_t room = sizeof(sentences->text) - sentences->filled;
    int length =
        snprintf(sentences->text + sentences->filled, room, "%s: %s\n", names[severity], sentence);

    if ((size_t)length < room) {
        sentences->filled += (size_t)length;
    } else {
        sentences->text[sentences->filled] = '\0';
    }
}

/* Those that were not there before. Line numbers may have moved: only what is behind them counts.
 */
static void print_new(FILE *out, struct sentences *now, const struct sentences *before)
{
    for (char *line = strtok(now->text, "\n"); line != NULL; line = strtok(NULL, "\n")) {
        const char *number = strstr(line, " line "), *what = line;

        if (number != NULL && strchr(number, ':') != NULL) {
            what = strchr(number, ':');
        }
        if (strstr(before->text, what) == NULL) {
            fprintf(out, "%s\n", line);
        }
    }
}

/* ---- the file ---- */

/* The text, allocated; an absent file is an empty one. NULL: it can't be read, which was said. */
static char *read_text(const char *path, size_t *length)
{
    char *text = whole_file_read(path, FILE_MAX, length);

    if (text == NULL && errno == ENOENT) {
        *length = 0;
        text = calloc(1, 1);
    }
    if (text == NULL) {
        fprintf(stderr, "odidctl: %s: %s\n", path, strerror(errno));
    }
    return text;
}

static void free_text(char *text, size_t length)
{
    if (text != NULL) {
        explicit_bzero(text, length);
        free(text);
    }
}

static void read_config(struct config *config, const char *text, size_t length,
                        struct sentences *sentences)
{
    sentences->filled = 0;
    sentences->text[0] = '\0';
    config_defaults(config);
    if (length > 0) {
        config_parse(config, "odid.conf", text, length, keep_sentence, sentences);
    }
    config_judge(config, keep_sentence, sentences);
}

/* ---- get ---- */

static void print_value(const struct config_key *key, const struct config *config, const char *data)
{
    char shown[2 * CONFIG_PATH_SIZE];

    if (!config_key_is_secret(key)) {
        config_key_show(key, config, shown, sizeof(shown));
        puts(shown);
    } else if (config->maintenance_password[0] != '\0' || password_known(data)) {
        puts("set");
    } else {
        puts("unset");
    }
}

int settings_get(const struct places *places, char *const names[])
{
    static struct sentences ignored;
    struct config config;
    char *text;
    size_t length = 0;

    for (size_t i = 0; names[i] != NULL; i++) {
        if (find_key(names[i]) == NULL) {
            return ODIDCTL_USAGE;
        }
    }
    /* Unreadable: the defaults are in force. */
    text = read_text(places_config_in_force(places), &length);
    read_config(&config, text, length, &ignored);
    free_text(text, length);
    for (size_t i = 0; names[i] != NULL; i++) {
        print_value(find_key(names[i]), &config, places->data);
    }
    explicit_bzero(config.maintenance_password, sizeof(config.maintenance_password));
    return fflush(stdout) == 0 ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}

/* ---- in force ---- */

enum in_force { NOT_SAID, IN_FORCE, NOT_IN_FORCE };

static enum in_force look_whether_in_force(const struct places *places)
{
    uint64_t said = FINGERPRINT_OF_NOTHING;
    char saved[20];
    struct json_object *status, *daemon_s;
    struct config config;
    enum in_force found = NOT_SAID;
    int error;

    config_defaults(&config);
    config_read_file(&config, places->config, config_add_sentence, &said);
    snprintf(saved, sizeof(saved), "%016" PRIx64, config_fingerprint(&config, said));
    explicit_bzero(config.maintenance_password, sizeof(config.maintenance_password));
    status = status_fetch(places->run_dir, &error);
    daemon_s =
        json_object_object_get(json_object_object_get(status, "configuration"), "fingerprint");
    if (daemon_s != NULL) {
        found = strcmp(json_object_get_string(daemon_s), saved) == 0 ? IN_FORCE : NOT_IN_FORCE;
    }
    json_object_put(status);
    return found;
}

int settings_in_force(const struct places *places)
{
    return look_whether_in_force(places) == IN_FORCE ? ODIDCTL_GOOD : ODIDCTL_NOT_GOOD;
}

/* ---- set ---- */

/* Of what is wrong since then. before is put back. */
static int say_effect(const struct places *places, struct json_object *before)
{
    char wrong[1024];

    wrong_since(places, before, wrong, sizeof(wrong));
    json_object_put(before);
    if (wrong[0] != '\0') {
        printf("Saved; but since then: %s\n", wrong);
        return ODIDCTL_HALF_DONE;
    }
    if (look_whether_in_force(places) == NOT_IN_FORCE) {
        puts("Saved; but the daemon doesn't run with it.");
        return ODIDCTL_HALF_DONE;
    }
    puts("Saved, and in effect.");
    return ODIDCTL_GOOD;
}

/* The appliance keeps what counts until then (places_config_in_force). */
static const char *when_else(void)
{
    return PLACES_COMPANION
               ? "when what it concerns is started anew, so at the next power-on or sooner"
               : "after the next power-on";
}

/* Returns whether it counts now: 0, or ODIDCTL_HALF_DONE. */
static int apply(const struct places *places)
{
    char *const arguments[] = {(char *)places->apply, NULL};
    struct json_object *before;
    const char *why;
    int error, status;
    pid_t child;

    if (access(places->apply, X_OK) < 0) {
        puts("Saved. Restart the daemon to make it count.");
        return ODIDCTL_GOOD;
    }
    why = armed_not_disarmed(places);
    if (why != NULL) {
        printf("Saved. %s: it takes effect %s.\n", why, when_else());
        return ODIDCTL_GOOD;
    }
    fflush(stdout);
    before = wrong_now(places);
    error = posix_spawn(&child, places->apply, NULL, NULL, arguments, environ);
    if (error == 0 && waitpid(child, &status, 0) < 0) {
        error = errno;
    }
    if (error != 0 || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        fprintf(stderr, "odidctl: saved, but %s failed%s%s: it takes effect %s.\n", places->apply,
                error != 0 ? ": " : "", error != 0 ? strerror(error) : "", when_else());
        json_object_put(before);
        return ODIDCTL_HALF_DONE;
    }
    return say_effect(places, before);
}

/*
 * Judges the value as a line of the file would be. Prints what is wrong with
 * it, adds that to the sentences, and returns true when it can be taken.
 * written: what is to stand in the file.
 */
static bool judge_value(const struct config_key *key, struct config *config, const char *text,
                        char written[VALUE_SIZE], struct sentences *sentences)
{
    struct config_source source = {.name = "", .report = keep_sentence, .context = sentences};
    size_t said = sentences->filled;
    char label[64];
    struct config_value value = {.source = &source, .label = label, .text = text};
    bool is_operator = key->rule == &config_rule_operator;

    snprintf(label, sizeof(label), "[%s] %s", key->section, key->name);
    config_key_take(key, config, &value);
    fputs(sentences->text + said, source.errors > 0 ? stderr : stdout);
    if (source.errors > 0) {
        return false;
    }
    snprintf(written, VALUE_SIZE, "%s", is_operator ? config->operator_id : text);
    return true;
}

/* What can't be a value of any key; NULL: nothing is. */
static const char *judge_text(const struct config_key *key, const char *text)
{
    char copy[VALUE_SIZE];
    bool secret;

    for (const char *c = text; *c != '\0'; c++) {
        if ((unsigned char)*c < ' ' || *c == 0x7F) {
            return "the value holds control characters";
        }
    }
    snprintf(copy, sizeof(copy), "%s", text);
    secret = key->rule != &config_rule_operator && identifiers_remove_secrets(copy);
    explicit_bzero(copy, sizeof(copy));
    return secret ? "the value holds the secret part of an operator number" : NULL;
}

/* Writes the text with the value. Returns 0 when done, 1 when it stood there already, or -errno. */
static int write_value(const char *path, const char *text, size_t length,
                       const struct config_key *key, const char *value,
                       const struct sentences *before)
{
    static struct sentences now;
    struct config config;
    size_t new_length;
    char *made = config_edit_set(text, length, key, value, &new_length);
    int result;

    if (made == NULL) {
        return -errno;
    }
    if (new_length > FILE_MAX) {
        result = -EFBIG;
    } else if (new_length == length && memcmp(made, text, length) == 0) {
        result = 1;
    } else {
        result = whole_file_replace(path, made, new_length, 0);
        if (result == 0) {
            read_config(&config, made, new_length, &now);
            explicit_bzero(config.maintenance_password, sizeof(config.maintenance_password));
            print_new(stdout, &now, before);
        }
    }
    free_text(made, new_length);
    return result;
}

static int say_unwritten(const char *path, int result)
{
    if (result == -EINVAL) {
        fputs("odidctl: a line of odid.conf can't hold that value; nothing was changed.\n", stderr);
    } else {
        fprintf(stderr, "odidctl: %s can't be written: %s; nothing was changed.\n", path,
                strerror(-result));
    }
    return ODIDCTL_NOT_GOOD;
}

static void lost_mark(const struct places *places, char mark[PLACES_PATH_SIZE])
{
    snprintf(mark, PLACES_PATH_SIZE, "%s/odid/settings-lost", places->data);
}

int settings_mark_lost(const struct places *places)
{
    char mark[PLACES_PATH_SIZE];

    lost_mark(places, mark);
    return access(mark, F_OK) == 0 ? 0 : whole_file_replace(mark, "", 0, 0644);
}

/* Who saves settings has seen which ones are in force: that others were lost is over (S30data). */
static void settle_lost(const struct places *places)
{
    char mark[PLACES_PATH_SIZE];

    if (!places->other_config) {
        lost_mark(places, mark);
        unlink(mark);
        faults_set(places->faults, "settings", NULL);
    }
}

static int set_in_file(const struct places *places, const struct config_key *key, const char *value)
{
    const char *path = places->config, *fault;
    static struct sentences before;
    struct config config;
    char written[VALUE_SIZE];
    size_t length;
    char *text = read_text(path, &length);
    int result;

    if (text == NULL) {
        return ODIDCTL_NOT_GOOD;
    }
    fault = length > 0 ? config_not_ini(text, length) : NULL;
    if (fault != NULL) {
        fprintf(stderr, "odidctl: %s %s; nothing was changed.\n", path, fault);
        free_text(text, length);
        return ODIDCTL_NOT_GOOD;
    }
    read_config(&config, text, length, &before);
    fault = judge_text(key, value);
    if (fault != NULL) {
        fprintf(stderr, "error: %s\n", fault);
        result = -EPERM;
    } else {
        result = judge_value(key, &config, value, written, &before) ? 0 : -EPERM;
    }
    if (result == 0) {
        result = write_value(path, text, length, key, written, &before);
    }
    explicit_bzero(&config, sizeof(config));
    free_text(text, length);
    if (result >= 0) {
        settle_lost(places);
    }
    if (result == -EPERM) {
        fputs("Nothing was changed.\n", stderr);
        return ODIDCTL_NOT_GOOD;
    }
    if (result == 1) { /* it may have been saved while armed, or in vain */
        puts("It is set to that already.");
        return access(places->apply, X_OK) < 0 ? ODIDCTL_GOOD : apply(places);
    }
    return result == 0 ? apply(places) : say_unwritten(path, result);
}

/* It never gets into the file: only the key that is made of it is kept. */
static int set_password(const struct places *places, const struct config_key *key,
                        const char *password)
{
    int result;

    if (!key->rule->valid(password)) {
        fprintf(stderr, "error: [%s] %s: expected %s\nNothing was changed.\n", key->section,
                key->name, key->rule->expected);
        return ODIDCTL_NOT_GOOD;
    }
    result = password_keep(places->data, password);
    if (result < 0) {
        fprintf(stderr, "odidctl: the password's key can't be kept: %s; nothing was changed.\n",
                strerror(-result));
        return ODIDCTL_NOT_GOOD;
    }
    return apply(places);
}

int settings_set(const struct places *places, const char *name, char *value)
{
    const struct config_key *key = find_key(name);
    char directory[PLACES_PATH_SIZE], copy[VALUE_SIZE], *slash;
    int lock, result;

    if (strlen(value) >= sizeof(copy)) {
        fputs("odidctl: the value is too long; nothing was changed.\n", stderr);
        return ODIDCTL_NOT_GOOD;
    }
    snprintf(copy, sizeof(copy), "%s", value);
    explicit_bzero(value, strlen(value));
    if (key == NULL) {
        explicit_bzero(copy, sizeof(copy));
        return ODIDCTL_USAGE;
    }
    snprintf(directory, sizeof(directory), "%s", places->config);
    slash = strrchr(directory, '/');
    if (slash == NULL) {
        snprintf(directory, sizeof(directory), ".");
    } else {
        slash[slash == directory] = '\0';
    }
    lock = whole_file_lock(directory);
    if (lock < 0) {
        fprintf(stderr, "odidctl: %s: %s; nothing was changed.\n", directory, strerror(-lock));
        result = ODIDCTL_NOT_GOOD;
    } else {
        result = config_key_is_secret(key) ? set_password(places, key, copy)
                                           : set_in_file(places, key, copy);
        close(lock);
    }
    explicit_bzero(copy, sizeof(copy));
    return result;
}
