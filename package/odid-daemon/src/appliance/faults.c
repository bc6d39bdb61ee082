/* What is wrong with the appliance: a file for each, with one sentence
 * (overlay/lib/odid/functions). */
#include "appliance/faults.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "appliance/places.h"
#include "base/log.h"
#include "base/utf8.h"
#include "base/whole_file.h"

#define SENTENCE_MAX 1024

static int is_fault(const struct dirent *entry)
{
    return entry->d_name[0] != '.'; /* those are being written */
}

/* The first line, fit to be shown. Empty: it is over meanwhile. */
static void read_sentence(const char *directory, const char *name, char out[SENTENCE_MAX])
{
    char path[PLACES_PATH_SIZE];
    size_t length;
    char *text;

    out[0] = '\0';
    snprintf(path, sizeof(path), "%s/%.200s", directory, name);
    text = whole_file_read_itself(path, SENTENCE_MAX, &length);
    if (text != NULL) {
        text[strcspn(text, "\r\n")] = '\0';
        utf8_clean(out, SENTENCE_MAX, text[0] == '\0' ? "(no more is known)" : text);
        free(text);
    } else if (errno != ENOENT) {
        snprintf(out, SENTENCE_MAX, "what is wrong can't be read: %s", strerror(errno));
    }
}

struct json_object *faults_list(const char *directory)
{
    struct json_object *faults = json_object_new_array();
    struct dirent **entries = NULL;
    int count = scandir(directory, &entries, is_fault, alphasort);

    for (int i = 0; i < count; i++) {
        char sentence[SENTENCE_MAX], name[SENTENCE_MAX];

        read_sentence(directory, entries[i]->d_name, sentence);
        utf8_clean(name, sizeof(name), entries[i]->d_name);
        if (sentence[0] != '\0') {
            struct json_object *fault = json_object_new_object();

            json_object_object_add(fault, "name", json_object_new_string(name));
            json_object_object_add(fault, "sentence", json_object_new_string(sentence));
            json_object_array_add(faults, fault);
        }
        free(entries[i]);
    }
    free(entries);
    return faults;
}

void faults_set(const char *directory, const char *name, const char *sentence)
{
    char path[PLACES_PATH_SIZE], line[SENTENCE_MAX];
    int result = 0;

    snprintf(path, sizeof(path), "%s/%s", directory, name);
    if (sentence == NULL) {
        result = unlink(path) < 0 ? -errno : 0;
    } else if (access(directory, F_OK) == 0) { /* else this is no appliance */
        snprintf(line, sizeof(line), "%s\n", sentence);
        result = whole_file_replace(path, line, strlen(line), 0644);
    }
    if (result < 0 && result != -ENOENT && result != -ENOTDIR) {
        log_error("%s: %s", path, strerror(-result));
    }
}
