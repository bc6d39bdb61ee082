#include "odidctl/import_volume.h"

#include <dirent.h>
#include <errno.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "odidctl/odidctl_report.h"

/* The exact name wins over one in other letters, where a file system has both. */
static void note_name(char out[IMPORT_NAME_SIZE], const char *name, const char *exact)
{
    if (out[0] == '\0' || strcmp(name, exact) == 0) {
        snprintf(out, IMPORT_NAME_SIZE, "%s", name);
    }
}

static bool is_similar(const char *name)
{
    size_t length = strlen(name);

    return name[0] != '.' && strcasestr(name, "odid") != NULL &&
           strcasecmp(name, ODIDCTL_REPORT_NAME) != 0 &&
           (length < 8 || strcasecmp(name + length - 8, ".example") != 0);
}

static void note_entry(struct import_volume *volume, const char *name)
{
    const struct {
        const char *name;
        char *out;
    } wanted[] = {
        {"odid.conf", volume->conf},       {"odid.conf.txt", volume->conf_txt},
        {"authorized_keys", volume->keys}, {"authorized_keys.txt", volume->keys_txt},
        {"._odid.conf", volume->apple},    {"._odid.conf.txt", volume->apple},
    };

    if (strcasecmp(name, "odid.conf.cut-short") == 0) {
        note_name(volume->cut, name, name);
    } else if (strcasecmp(name, "odid.conf.txt.cut-short") == 0) {
        note_name(volume->cut_txt, name, name);
    }
    for (size_t i = 0; i < sizeof(wanted) / sizeof(wanted[0]); i++) {
        if (strcasecmp(name, wanted[i].name) == 0) {
            note_name(wanted[i].out, name, wanted[i].name);
            return;
        }
    }
    if (is_similar(name)) {
        note_name(volume->similar, name, name);
    }
}

int import_volume_look(const char *directory, struct import_volume *volume)
{
    DIR *folder = opendir(directory);
    const struct dirent *entry;
    int result;

    if (folder == NULL) {
        return -errno;
    }
    errno = 0;
    while ((entry = readdir(folder)) != NULL) {
        note_entry(volume, entry->d_name);
        errno = 0;
    }
    result = -errno;
    closedir(folder);
    return result;
}
