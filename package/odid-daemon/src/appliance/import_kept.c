#include "appliance/import_kept.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "appliance/places.h"
#include "base/fingerprint.h"
#include "base/whole_file.h"
#include "config/config_keys.h"

#define BESIDE_SIZE (PLACES_PATH_SIZE + 16)
#define FINGERPRINT_SIZE 16 /* hexadecimal digits */
#define LINE_SIZE (FINGERPRINT_SIZE + 2)
#define FILE_MAX 65536 /* as for whoever reads it */

static void fingerprint_line(const char *text, size_t length, char line[LINE_SIZE])
{
    snprintf(line, LINE_SIZE, "%016" PRIx64 "\n",
             fingerprint(FINGERPRINT_OF_NOTHING, text, length));
}

/* Nothing gets there but a text: without NUL, as power cuts leave it, and 0xFF, as which erased
 * flash is read. least: an empty one, too. */
static bool is_sound(const char *path, size_t least)
{
    size_t length = 0;
    char *text = whole_file_read(path, FILE_MAX, &length);
    bool sound =
        text != NULL && length >= least &&
        (length == 0 || (config_not_ini(text, length) == NULL &&
                         memchr(text, '\0', length) == NULL && memchr(text, 0xFF, length) == NULL));

    free(text);
    return sound;
}

bool import_sound(const char *path)
{
    return is_sound(path, 1);
}

static bool is_fingerprint_line(const char *line)
{
    return strspn(line, "0123456789abcdef") == FINGERPRINT_SIZE &&
           strcmp(line + FINGERPRINT_SIZE, "\n") == 0;
}

/* What a sound disk never has: neither of the two is written in part, or is there alone
 * (import_keep; S30data, of what the image brings). */
enum import_before import_look(const char *path, const char *text, size_t length)
{
    char beside[BESIDE_SIZE], now[LINE_SIZE];
    bool sound = is_sound(path, length > 0 ? 1 : 0);
    enum import_before found = IMPORT_NEW;
    size_t before_length;
    char *before;

    snprintf(beside, sizeof(beside), "%s.imported", path);
    fingerprint_line(text, length, now);
    before = whole_file_read(beside, 64, &before_length);
    if (before == NULL) {
        found = errno == ENOENT && access(path, F_OK) < 0 ? IMPORT_NEW : IMPORT_LOST;
    } else if (!is_fingerprint_line(before)) {
        found = IMPORT_LOST;
    } else if (strcmp(before, now) == 0) {
        found = sound ? IMPORT_KEPT : IMPORT_LOST;
    }
    free(before);
    return found;
}

/* The fingerprint last: without it the same is imported once more, which is harmless. */
int import_keep(const char *path, const char *text, size_t length, mode_t mode)
{
    char beside[BESIDE_SIZE], line[LINE_SIZE];
    int result = whole_file_replace(path, text, length, mode);

    if (result == 0) {
        snprintf(beside, sizeof(beside), "%s.imported", path);
        fingerprint_line(text, length, line);
        result = whole_file_replace(beside, line, strlen(line), 0644);
    }
    return result;
}
