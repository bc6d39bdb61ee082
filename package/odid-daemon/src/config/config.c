#include "config/config.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "config/config_ini.h"
#include "config/config_keys.h"

#define FILE_MAX 65536

void config_defaults(struct config *config)
{
    struct config_source silent = {.name = ""}; /* there is nothing to be said of a default */

    memset(config, 0, sizeof(*config));
    for (const struct config_key *key = config_keys; key->section != NULL; key++) {
        struct config_value value = {
            .source = &silent, .label = key->name, .text = key->by_default};

        key->rule->take(key->rule, (char *)config + key->offset, &value);
    }
}

/* ---- what is no INI text at all ---- */

/* What editors and systems put in a configuration file's place. */
static const struct {
    const char *begin;
    size_t length;
    const char *what;
} foreign[] = {
    {"\xFF\xFE", 2, "is UTF-16 text; save it as UTF-8 (Notepad: Encoding: UTF-8)"},
    {"\xFE\xFF", 2, "is UTF-16 text; save it as UTF-8 (Notepad: Encoding: UTF-8)"},
    {"\x00\x05\x16\x07", 4, "is a \"._\" file that macOS puts beside the real one"},
    {"{\\rtf", 5, "is a word processor's file (RTF); save it as plain text"},
    {"PK\x03\x04", 4, "is a word processor's file or an archive; save it as plain text"},
    {"<", 1, "is HTML or XML; save it as plain text"},
};

/* Without a byte-order mark: Latin letters have every second byte zero. */
static bool is_utf16(const char *text, size_t length)
{
    size_t zeros[2] = {0, 0};

    for (size_t i = 0; i < length; i++) {
        zeros[i % 2] += text[i] == '\0';
    }
    return (zeros[0] == 0 || zeros[1] == 0) && (zeros[0] + zeros[1]) * 4 > length;
}

static bool is_all_nul(const char *text, size_t length)
{
    return length > 0 && text[0] == '\0' && memcmp(text, text + 1, length - 1) == 0;
}

const char *config_not_ini(const char *text, size_t length)
{
    if (length == 0) {
        return "is empty";
    }
    for (size_t i = 0; i < sizeof(foreign) / sizeof(foreign[0]); i++) {
        if (length >= foreign[i].length && memcmp(text, foreign[i].begin, foreign[i].length) == 0) {
            return foreign[i].what;
        }
    }
    if (is_all_nul(text, length)) {
        return "holds only NUL bytes, as after a power cut";
    }
    return is_utf16(text, length) ? foreign[0].what : NULL;
}

/* ---- after a secret was read ---- */

/*
 * The buffers are cleared where they are; what is left is what the compiler
 * and the dynamic linker put on the stack of their own, in calls that have
 * returned.
 */
__attribute__((noinline)) static void clear_stack_below(void)
{
    char dead[16384];

    explicit_bzero(dead, sizeof(dead));
}

/* ---- INI text ---- */

/* A place needs both: half of one is none. */
static void check_place(struct config_source *source, const char *names, double *latitude_deg,
                        double *longitude_deg)
{
    if (isnan(*latitude_deg) != isnan(*longitude_deg)) {
        *latitude_deg = *longitude_deg = NAN;
        config_say(source, CONFIG_ERROR, "%s: one is set without the other; using none", names);
    }
}

unsigned config_parse(struct config *config, const char *name, const char *text, size_t length,
                      config_report_fn *report, void *context)
{
    return config_parse_places(config, name, text, length, report, NULL, context);
}

unsigned config_parse_places(struct config *config, const char *name, const char *text,
                             size_t length, config_report_fn *report, config_place_fn *place,
                             void *context)
{
    struct config_source source = {
        .name = name, .report = report, .place = place, .context = context};
    const char *fault = config_not_ini(text, length);

    if (fault != NULL) {
        config_say(&source, CONFIG_ERROR, "%s; nothing in it is used", fault);
        return source.errors;
    }
    if (length >= 3 && memcmp(text, "\xEF\xBB\xBF", 3) == 0) {
        text += 3;
        length -= 3;
    }
    config_ini_read(config, &source, text, length);
    clear_stack_below();
    check_place(&source, "[system] operator_latitude and operator_longitude",
                &config->operator_latitude_deg, &config->operator_longitude_deg);
    check_place(&source, "[bench] latitude and longitude", &config->bench_latitude_deg,
                &config->bench_longitude_deg);
    return source.errors;
}

/* ---- file ---- */

/* Returns the number of bytes, or -errno. */
static ssize_t read_whole(const char *path, char *text, size_t size)
{
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    size_t filled = 0;
    ssize_t result = 0;

    if (fd < 0) {
        return -errno;
    }
    while (filled < size) {
        result = read(fd, text + filled, size - filled);
        if (result <= 0) {
            break;
        }
        filled += (size_t)result;
    }
    if (result < 0) {
        result = -errno;
    }
    close(fd);
    return result < 0 ? result : (ssize_t)filled;
}

/*
 * The text is kept in pages of its own, cleared and given back: it may hold the
 * secret part of the operator number.
 */
unsigned config_read_file(struct config *config, const char *path, config_report_fn *report,
                          void *context)
{
    const char *slash = strrchr(path, '/');
    const char *name = slash == NULL ? path : slash + 1;
    struct config_source source = {.name = path, .report = report, .context = context};
    char *text =
        mmap(NULL, FILE_MAX + 1, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    ssize_t length = text == MAP_FAILED ? -errno : read_whole(path, text, FILE_MAX + 1);

    if (length < 0) {
        config_say(&source, CONFIG_ERROR, "can't be read: %s", strerror((int)-length));
    } else if (length > FILE_MAX) {
        config_say(&source, CONFIG_ERROR, "is larger than 64 KiB; nothing in it is used");
    } else {
        source.errors = config_parse(config, name, text, (size_t)length, report, context);
    }
    if (text != MAP_FAILED) {
        explicit_bzero(text, FILE_MAX + 1);
        munmap(text, FILE_MAX + 1);
    }
    return source.errors;
}

/* ---- environment ---- */

static const struct {
    const char *variable, *section, *key;
} settings[] = {
    {"ODID_UAS_ID", "basic_id", "uas_id"},      {"ODID_OPERATOR_ID", "operator", "operator_id"},
    {"ODID_SELF_ID", "self_id", "description"}, {"ODID_MAVLINK_SOURCE", "mavlink", "source"},
    {"ODID_UDP_PORT", "mavlink", "udp_port"},
};

static void take_variable(struct config *config, struct config_source *source, size_t which,
                          const char *text)
{
    char copy[256];
    struct config_value value = {.source = source, .label = settings[which].variable, .text = copy};
    const struct config_key *key = config_key_find(settings[which].section, settings[which].key);

    snprintf(copy, sizeof(copy), "%s", text);
    if (key->rule != &config_rule_operator && identifiers_remove_secrets(copy)) {
        config_say(source, CONFIG_ERROR, "%s holds an operator number; its secret part is left out",
                   value.label);
    }
    config_key_take(key, config, &value);
    explicit_bzero(copy, sizeof(copy));
}

/* A variable that is set to yes; nothing, or nonsense, is no. */
static bool is_yes(const char *(*getenv_fn)(const char *), struct config_source *source,
                   const char *variable)
{
    const char *text = getenv_fn(variable);
    bool yes = false;

    if (text != NULL && text[0] != '\0' && !config_boolean(text, &yes)) {
        config_say(source, CONFIG_ERROR, "%s = \"%.40s\": expected 1 or 0; using 0", variable,
                   text);
    }
    return yes;
}

unsigned config_read_environment(struct config *config, const char *(*getenv_fn)(const char *),
                                 config_report_fn *report, void *context)
{
    struct config_source source = {.name = "environment", .report = report, .context = context};

    for (size_t i = 0; i < sizeof(settings) / sizeof(settings[0]); i++) {
        const char *text = getenv_fn(settings[i].variable);

        if (text != NULL && text[0] != '\0') {
            take_variable(config, &source, i, text);
        }
    }
    clear_stack_below();
    if (is_yes(getenv_fn, &source, "ODID_NO_WIFI")) {
        config->wifi_beacon_enabled = false;
    }
    if (is_yes(getenv_fn, &source, "ODID_NO_BT")) {
        config->bt4_enabled = config->bt5_enabled = false;
    }
    if (is_yes(getenv_fn, &source, "ODID_DEBUG")) {
        config->debug = true;
    }
    return source.errors;
}

unsigned config_keep_appliance(struct config *config, config_report_fn *report, void *context)
{
    struct config image;
    const struct {
        const char *name;
        char *value;
        const char *right;
        size_t size;
    } kept[] = {
        {"[daemon] run_dir", config->run_dir, image.run_dir, sizeof(image.run_dir)},
        {"[daemon] user", config->user, image.user, sizeof(image.user)},
        {"[mavlink] udp_address", config->udp_address, image.udp_address,
         sizeof(image.udp_address)},
        {"[broadcast] hostapd_dir", config->hostapd_dir, image.hostapd_dir,
         sizeof(image.hostapd_dir)},
    };
    unsigned warnings = 0;

    config_defaults(&image);
    for (unsigned i = 0; i < sizeof(kept) / sizeof(kept[0]); i++) {
        char sentence[CONFIG_PROBLEM_SIZE];

        if (strcmp(kept[i].value, kept[i].right) != 0) {
            snprintf(sentence, sizeof(sentence),
                     "%s = %s is not for the appliance, whose services are at %s: that counts",
                     kept[i].name, kept[i].value, kept[i].right);
            report(context, CONFIG_WARNING, sentence);
            memcpy(kept[i].value, kept[i].right, kept[i].size);
            warnings++;
        }
    }
    return warnings;
}
