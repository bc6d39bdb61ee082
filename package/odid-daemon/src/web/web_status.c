#include "web/web_status.h"

#include <errno.h>
#include <json-c/json_tokener.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "appliance/armed.h"
#include "appliance/faults.h"
#include "appliance/status_fetch.h"
#include "appliance/update_names.h"
#include "base/utf8.h"
#include "base/whole_file.h"
#include "flights/flights_show.h"

#define FILE_MAX 16384
#define LINE_SIZE 128

static void add(struct json_object *parent, const char *name, struct json_object *value)
{
    json_object_object_add(parent, name, value);
}

/* The first line of a small file; null when there is none. */
static struct json_object *line_of(const char *path)
{
    struct json_object *line = NULL;
    char clean[LINE_SIZE], *text;
    size_t length;

    text = whole_file_read(path, FILE_MAX, &length);
    if (text != NULL) {
        text[strcspn(text, "\r\n")] = '\0';
        utf8_clean(clean, sizeof(clean), text);
        line = clean[0] == '\0' ? NULL : json_object_new_string(clean);
        free(text);
    }
    return line;
}

/* A small file that holds one JSON object; null when it doesn't. */
static struct json_object *object_of(const char *directory, const char *name)
{
    char path[PLACES_PATH_SIZE], *text;
    struct json_object *object = NULL;
    size_t length;

    snprintf(path, sizeof(path), "%s/%s", directory, name);
    text = whole_file_read(path, FILE_MAX, &length);
    if (text != NULL) {
        object = json_tokener_parse(text);
        free(text);
    }
    if (!json_object_is_type(object, json_type_object)) {
        json_object_put(object);
        object = NULL;
    }
    return object;
}

/*
 * The last result, and a mark that changes with each: two updates may be
 * refused for the same reason, at a time that nobody knows.
 */
static void add_last_update(struct json_object *root, const struct places *places)
{
    struct json_object *result = object_of(places->data, UPDATE_RESULT_FILE);
    char path[PLACES_PATH_SIZE], mark[64];
    struct stat file;

    snprintf(path, sizeof(path), "%s/" UPDATE_RESULT_FILE, places->data);
    add(root, "last_update", result);
    if (result == NULL || stat(path, &file) < 0) {
        add(root, "last_update_mark", NULL);
        return;
    }
    snprintf(mark, sizeof(mark), "%llu-%lld.%09ld", (unsigned long long)file.st_ino,
             (long long)file.st_mtim.tv_sec, file.st_mtim.tv_nsec);
    add(root, "last_update_mark", json_object_new_string(mark));
}

/* Why the daemon gave no status. */
static const char *silence(int error)
{
    switch (error) {
    case ENOENT:
    case ECONNREFUSED:
        return "not running";
    case EAGAIN:
        return "does not answer";
    default:
        return "can't be asked";
    }
}

struct json_object *web_status(const struct places *places)
{
    struct json_object *root = json_object_new_object(), *daemon;
    char path[PLACES_PATH_SIZE];
    int error = 0;

    if (root == NULL) {
        return NULL;
    }
    daemon = status_fetch(places->run_dir, &error);
    add(root, "daemon", daemon);
    add(root, "daemon_silence", daemon == NULL ? json_object_new_string(silence(error)) : NULL);
    add(root, "faults", faults_list(places->faults));
    add(root, "version", line_of(places->version));
    snprintf(path, sizeof(path), "%s/slot", places->state);
    add(root, "slot", line_of(path));
    add(root, "update", object_of(places->state, UPDATE_STATE_FILE));
    add_last_update(root, places);
    return root;
}

char *web_flights(const struct places *places, size_t *length)
{
    char boot[64], *text = NULL;
    FILE *out = open_memstream(&text, length);
    int result;

    if (out == NULL) {
        return NULL;
    }
    whole_file_line(places->boot_id, boot, sizeof(boot));
    result = flights_show(out, places->flights, NULL, boot, true);
    if (fclose(out) != 0 || (result != 0 && *length == 0)) {
        free(text);
        return NULL;
    }
    return text;
}

void web_update_obstacle(const struct places *places, char *sentence, size_t size)
{
    struct json_object *update = object_of(places->state, UPDATE_STATE_FILE);
    const char *state = json_object_get_string(json_object_object_get(update, "state"));
    const char *told = json_object_get_string(json_object_object_get(update, "sentence"));
    const char *why = armed_not_disarmed(places);

    sentence[0] = '\0';
    if (why != NULL) {
        snprintf(sentence, size, "%s: no update until it is disarmed.", why);
    } else if (state != NULL && strcmp(state, "idle") != 0) {
        utf8_clean(sentence, size,
                   told != NULL && told[0] != '\0' ? told : "Another update is under way.");
    }
    json_object_put(update);
}
