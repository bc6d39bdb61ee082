#include "update/update_files.h"

#include <errno.h>
#include <json-c/json_tokener.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "base/utf8.h"
#include "base/whole_file.h"

#define PATH_SIZE 300
#define RECORD_MAX 8192

bool update_data_is_late(const char *mark)
{
    struct stat memory;

    return stat(mark, &memory) == 0 && memory.st_size == 0;
}

static void add_field(struct json_object *object, const char *name, struct json_object *value)
{
    json_object_object_add(object, name, value);
}

/* Versions and sentences may quote a bundle. null when there is none. */
static struct json_object *text(const char *value)
{
    char clean[UPDATE_SENTENCE_SIZE];

    utf8_clean(clean, sizeof(clean), value);
    return clean[0] == '\0' ? NULL : json_object_new_string(clean);
}

static struct json_object *number(int value)
{
    return value < 0 ? NULL : json_object_new_int(value);
}

/* Puts the object back. */
static int replace_json(const char *directory, const char *name, struct json_object *object)
{
    char path[PATH_SIZE], line[RECORD_MAX];
    int length;

    snprintf(path, sizeof(path), "%s/%s", directory, name);
    length = snprintf(line, sizeof(line), "%s\n", json_object_to_json_string(object));
    json_object_put(object);
    return length < (int)sizeof(line) ? whole_file_replace(path, line, (size_t)length, 0644)
                                      : -EMSGSIZE;
}

int update_write_state(const char *directory, const struct update *update)
{
    struct json_object *object = json_object_new_object();

    add_field(object, "state", text(update_state_name(update->state)));
    add_field(object, "percent", number(update->percent));
    add_field(object, "seconds_left", number(update->seconds_left));
    add_field(object, "sentence", text(update->sentence));
    return replace_json(directory, UPDATE_STATE_FILE, object);
}

static int remove_durably(const char *data, const char *name)
{
    char path[PATH_SIZE];

    snprintf(path, sizeof(path), "%s/%s", data, name);
    return whole_file_remove(path);
}

static int remember_failed(const char *data, const struct update_result *result)
{
    char path[PATH_SIZE], line[UPDATE_VERSION_SIZE + 1];

    snprintf(path, sizeof(path), "%s/%s", data, UPDATE_BACK_FILE);
    if (result->outcome == UPDATE_BACK && result->to[0] != '\0') {
        snprintf(line, sizeof(line), "%s\n", result->to);
        return whole_file_replace(path, line, strlen(line), 0644);
    }
    return result->outcome != UPDATE_INSTALLED || unlink(path) == 0 || errno == ENOENT ? 0 : -errno;
}

static const char *const outcomes[] = {
    [UPDATE_INSTALLED] = "installed", [UPDATE_REFUSED] = "refused", [UPDATE_BACK] = "rolled-back"};

int update_write_result(const char *data, const struct update_result *result, time_t time)
{
    struct json_object *object = json_object_new_object();
    int remembered = remember_failed(data, result), written;
    char when[32] = "";
    struct tm utc;

    if (time != 0 && gmtime_r(&time, &utc) != NULL) {
        strftime(when, sizeof(when), "%Y-%m-%dT%H:%M:%SZ", &utc);
    }
    add_field(object, "time", text(when));
    add_field(object, "from", text(result->from));
    add_field(object, "to", text(result->to));
    add_field(object, "outcome", text(outcomes[result->outcome]));
    add_field(object, "sentence", text(result->sentence));
    add_field(object, "from_server", json_object_new_boolean(result->from_server));
    written = replace_json(data, UPDATE_RESULT_FILE, object);
    return written < 0 ? written : remembered;
}

int update_forget_back(const char *data, const char *version)
{
    char path[PATH_SIZE], back[UPDATE_VERSION_SIZE];

    snprintf(path, sizeof(path), "%s/%s", data, UPDATE_BACK_FILE);
    whole_file_line(path, back, sizeof(back));
    return strcmp(back, version) == 0 ? remove_durably(data, UPDATE_BACK_FILE) : 0;
}

bool update_result_is_server_s(const char *data)
{
    char path[PATH_SIZE], *content;
    struct json_object *object;
    const char *outcome;
    size_t length;
    bool is;

    snprintf(path, sizeof(path), "%s/%s", data, UPDATE_RESULT_FILE);
    content = whole_file_read(path, RECORD_MAX, &length);
    object = content == NULL ? NULL : json_tokener_parse(content);
    outcome = json_object_get_string(json_object_object_get(object, "outcome"));
    is = outcome != NULL && strcmp(outcome, outcomes[UPDATE_BACK]) == 0 &&
         json_object_get_boolean(json_object_object_get(object, "from_server"));
    json_object_put(object);
    free(content);
    return is;
}

/* ---- record ---- */

int update_write_record(const char *data, const struct update_record *record)
{
    struct json_object *object = json_object_new_object(), *services = json_object_new_array();
    char slot[2] = {record->slot, '\0'};

    add_field(object, "slot", text(slot));
    add_field(object, "from", text(record->from));
    add_field(object, "to", text(record->to));
    add_field(object, "from_server", json_object_new_boolean(record->from_server));
    add_field(object, "unattended", json_object_new_boolean(record->unattended));
    add_field(object, "channels", number(record->channels_known ? (int)record->channels : -1));
    add_field(object, "radio_faults", json_object_new_int64(record->radio_faults));
    for (unsigned i = 0; i < record->services.count; i++) {
        if (record->services.service[i].pid != 0) {
            json_object_array_add(services, text(record->services.service[i].name));
        }
    }
    add_field(object, "services", services);
    add_field(object, "configuration", text(record->configuration));
    return replace_json(data, UPDATE_RECORD_FILE, object);
}

static void take_text(struct json_object *object, const char *name, char *out, size_t size)
{
    const char *value = json_object_get_string(json_object_object_get(object, name));

    snprintf(out, size, "%s", value == NULL ? "" : value);
}

static void take_services(struct json_object *array, struct update_services *services)
{
    size_t count =
        json_object_is_type(array, json_type_array) ? json_object_array_length(array) : 0;

    for (size_t i = 0; i < count && services->count < UPDATE_SERVICES_MAX; i++) {
        const char *name = json_object_get_string(json_object_array_get_idx(array, i));

        if (name != NULL) {
            struct update_service *service = &services->service[services->count++];

            snprintf(service->name, sizeof(service->name), "%s", name);
            service->pid = -1; /* ran */
        }
    }
}

int update_read_record(const char *data, struct update_record *record)
{
    char path[PATH_SIZE], slot[2], *content;
    struct json_object *object, *channels, *from_server, *radio_faults;
    size_t length;

    memset(record, 0, sizeof(*record));
    snprintf(path, sizeof(path), "%s/%s", data, UPDATE_RECORD_FILE);
    content = whole_file_read(path, RECORD_MAX, &length);
    if (content == NULL) {
        return -errno;
    }
    object = json_tokener_parse(content);
    free(content);
    take_text(object, "slot", slot, sizeof(slot));
    if (slot[0] != 'a' && slot[0] != 'b') {
        json_object_put(object);
        return -EBADMSG;
    }
    record->slot = slot[0];
    take_text(object, "from", record->from, sizeof(record->from));
    take_text(object, "to", record->to, sizeof(record->to));
    /* A version before this one didn't say whose it was. */
    from_server = json_object_object_get(object, "from_server");
    record->from_server = from_server == NULL || json_object_get_boolean(from_server);
    record->unattended = json_object_get_boolean(json_object_object_get(object, "unattended"));
    channels = json_object_object_get(object, "channels");
    record->channels_known = channels != NULL;
    record->channels = (unsigned)json_object_get_int(channels);
    /* A version before this one didn't say: none is new then. */
    radio_faults = json_object_object_get(object, "radio_faults");
    record->radio_faults =
        radio_faults == NULL ? ~0U : (unsigned)json_object_get_int64(radio_faults);
    take_services(json_object_object_get(object, "services"), &record->services);
    take_text(object, "configuration", record->configuration, sizeof(record->configuration));
    json_object_put(object);
    return 0;
}

int update_remove_record(const char *data)
{
    return remove_durably(data, UPDATE_RECORD_FILE);
}
