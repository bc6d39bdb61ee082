#include "appliance/update_bundle.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define NAMES_MAX 1000
#define BUNDLES_MAX 16
#define DESCRIPTION_NAME "sw-description"
/* cpio, "newc": a magic number and 13 fields of 8 hexadecimal digits; name and contents padded. */
#define HEADER_SIZE 110
#define FIELD_SIZE 8
#define FIELD_FILE_SIZE 6
#define FIELD_NAME_SIZE 11
#define PADDING 4

int update_version_compare(const char *left, const char *right)
{
    return strverscmp(left, right);
}

/* ---- description ---- */

struct text {
    const char *at, *end;
};

static void skip_blanks(struct text *line)
{
    while (line->at < line->end && (*line->at == ' ' || *line->at == '\t')) {
        line->at++;
    }
}

static bool take(struct text *line, const char *word)
{
    size_t length = strlen(word);

    skip_blanks(line);
    if ((size_t)(line->end - line->at) < length || memcmp(line->at, word, length) != 0) {
        return false;
    }
    line->at += length;
    return true;
}

static bool is_plain(char octet)
{
    return (octet >= '0' && octet <= '9') || (octet >= 'A' && octet <= 'Z') ||
           (octet >= 'a' && octet <= 'z') || (octet != '\0' && strchr(".+~_-", octet) != NULL);
}

/* A value in quotation marks, of plain characters. */
static bool take_value(struct text *line, char *out, size_t size)
{
    size_t length = 0;

    if (!take(line, "\"")) {
        return false;
    }
    while (line->at < line->end && is_plain(*line->at) && length + 1 < size) {
        out[length++] = *line->at++;
    }
    out[length] = '\0';
    return length > 0 && take(line, "\"");
}

static bool is_at_end(struct text *line)
{
    skip_blanks(line);
    return line->at == line->end;
}

struct wanted {
    const char *key, *before, *after; /* key before "value" after */
    char *out;
    size_t size;
    unsigned found;
};

/* Returns false for a line that begins with the key and isn't as it has to be. */
static bool take_line(struct text line, struct wanted *wanted)
{
    if (!take(&line, wanted->key)) {
        return true;
    }
    wanted->found++;
    return take(&line, wanted->before) && take_value(&line, wanted->out, wanted->size) &&
           take(&line, wanted->after) && is_at_end(&line) && wanted->found == 1;
}

static bool read_octets(const char *text, uint64_t *octets)
{
    char *end;

    errno = 0;
    *octets = strtoull(text, &end, 10);
    return text[0] >= '0' && text[0] <= '9' && *end == '\0' && errno == 0;
}

int update_bundle_parse(const char *text, size_t length, struct update_bundle *bundle)
{
    char octets[24];
    struct wanted wanted[] = {
        {"version", "=", ";", bundle->version, sizeof(bundle->version), 0},
        {"hardware-compatibility", ": [", "];", bundle->hardware, sizeof(bundle->hardware), 0},
        {"slot-octets", "=", ";", octets, sizeof(octets), 0},
    };
    const unsigned count = sizeof(wanted) / sizeof(wanted[0]);
    const char *end = text + length;

    memset(bundle, 0, sizeof(*bundle));
    while (text < end) {
        const char *line_end = memchr(text, '\n', (size_t)(end - text));
        struct text line = {text, line_end == NULL ? end : line_end};

        for (unsigned i = 0; i < count; i++) {
            if (!take_line(line, &wanted[i])) {
                return -EBADMSG;
            }
        }
        text = line.end + 1;
    }
    for (unsigned i = 0; i < count; i++) {
        if (wanted[i].found != 1) {
            return -EBADMSG;
        }
    }
    return read_octets(octets, &bundle->slot_octets) ? 0 : -EBADMSG;
}

/* ---- files ---- */

/* Reads size octets. Returns 0, -EBADMSG when there are less, or another -errno. */
static int read_all(int fd, char *out, size_t size)
{
    while (size > 0) {
        ssize_t got = read(fd, out, size);

        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            return got < 0 ? -errno : -EBADMSG;
        }
        out += got;
        size -= (size_t)got;
    }
    return 0;
}

int update_bundle_read_description(const char *path, struct update_bundle *bundle)
{
    char text[UPDATE_DESCRIPTION_MAX];
    int fd = open(path, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC), result;
    struct stat file;

    if (fd < 0) {
        return -errno;
    }
    if (fstat(fd, &file) < 0) {
        result = -errno;
    } else if (!S_ISREG(file.st_mode) || file.st_size > (off_t)sizeof(text)) {
        result = -EBADMSG;
    } else {
        result = read_all(fd, text, (size_t)file.st_size);
    }
    close(fd);
    return result < 0 ? result : update_bundle_parse(text, (size_t)file.st_size, bundle);
}

/* Returns the field's value, or -1. */
static int64_t field(const char *header, unsigned number)
{
    char digits[FIELD_SIZE + 1] = "";

    memcpy(digits, header + 6 + number * FIELD_SIZE, FIELD_SIZE);
    return strspn(digits, "0123456789abcdefABCDEF") == FIELD_SIZE ? strtoll(digits, NULL, 16) : -1;
}

int update_bundle_read(int fd, struct update_bundle *bundle)
{
    char header[HEADER_SIZE], name[sizeof(DESCRIPTION_NAME)], text[UPDATE_DESCRIPTION_MAX];
    char padding[PADDING];
    const size_t padded = (HEADER_SIZE + sizeof(name)) % PADDING;
    int64_t size;
    int result = read_all(fd, header, sizeof(header));

    if (result < 0) {
        return result;
    }
    size = field(header, FIELD_FILE_SIZE);
    /* The name's size is exact: behind its NUL there is no room for anything. */
    if ((memcmp(header, "070701", 6) != 0 && memcmp(header, "070702", 6) != 0) ||
        field(header, FIELD_NAME_SIZE) != sizeof(name) || size < 0 ||
        size > (int64_t)sizeof(text)) {
        return -EBADMSG;
    }
    result = read_all(fd, name, sizeof(name));
    if (result == 0 && padded > 0) {
        result = read_all(fd, padding, PADDING - padded);
    }
    if (result == 0) {
        result = read_all(fd, text, (size_t)size);
    }
    if (result < 0) {
        return result;
    }
    return memcmp(name, DESCRIPTION_NAME, sizeof(name)) == 0
               ? update_bundle_parse(text, (size_t)size, bundle)
               : -EBADMSG;
}

/* ---- folder ---- */

static bool is_bundle_name(const char *name)
{
    const char *end = strrchr(name, '.');

    return end != NULL && strcmp(end, ".swu") == 0;
}

/* 0 or -errno, as of a bundle. Neither a link nor a pipe that would never answer. */
static int read_named(int folder, const char *name, struct update_bundle *bundle)
{
    int fd = openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC), result;
    struct stat file;

    if (fd < 0) {
        return -errno;
    }
    result =
        fstat(fd, &file) == 0 && S_ISREG(file.st_mode) ? update_bundle_read(fd, bundle) : -EBADMSG;
    close(fd);
    return result;
}

int update_bundle_newest(const char *folder, const char *hardware, char name[NAME_MAX + 1],
                         struct update_bundle *bundle)
{
    DIR *directory = opendir(folder);
    struct update_bundle one;
    unsigned bundles = 0;
    int result = -ENOENT;

    if (directory == NULL) {
        return -errno;
    }
    for (unsigned names = 0; names < NAMES_MAX && bundles < BUNDLES_MAX; names++) {
        struct dirent *entry = readdir(directory);

        if (entry == NULL) {
            break;
        }
        if (!is_bundle_name(entry->d_name)) {
            continue;
        }
        bundles++;
        if (read_named(dirfd(directory), entry->d_name, &one) == 0 &&
            strcmp(one.hardware, hardware) == 0 &&
            (result < 0 || update_version_compare(one.version, bundle->version) > 0)) {
            *bundle = one;
            snprintf(name, NAME_MAX + 1, "%s", entry->d_name);
            result = 0;
        }
    }
    closedir(directory);
    return result;
}
