#include "update/update_judge.h"

#include <dirent.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/whole_file.h"

/* Asked once a second, and answered four times as often. */
#define CONFIRMED_MAX_S 2.0
#define PATH_SIZE 300

/* ---- channels ---- */

static struct json_object *channel_of(struct json_object *status, enum channel channel)
{
    return json_object_object_get(json_object_object_get(status, "channels"),
                                  channel_name(channel));
}

static bool is_in_state(struct json_object *channel, enum radio_state state)
{
    const char *name = json_object_get_string(json_object_object_get(channel, "state"));

    return name != NULL && strcmp(name, radio_state_name(state)) == 0;
}

/* By Command Complete or hostapd's answer, not by what the daemon wants. A chip that has sent
 * beacons, and doesn't for the moment, is none of the version's faults: whoever keeps the channel
 * busy had each one rolled back. */
static bool on_air(struct json_object *channel)
{
    struct json_object *confirmed = json_object_object_get(channel, "confirmed_s");

    if (json_object_get_boolean(json_object_object_get(channel, "silent"))) {
        return true;
    }
    return is_in_state(channel, RADIO_ON_AIR) && confirmed != NULL &&
           json_object_get_double(confirmed) <= CONFIRMED_MAX_S;
}

static bool is_disabled(struct json_object *channel)
{
    return is_in_state(channel, RADIO_DISABLED);
}

static bool is_required(struct json_object *channel)
{
    return json_object_get_boolean(json_object_object_get(channel, "required"));
}

static unsigned channels_that(bool (*hold)(struct json_object *channel), struct json_object *status)
{
    unsigned channels = 0;

    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        channels |= hold(channel_of(status, channel)) ? 1U << channel : 0;
    }
    return channels;
}

unsigned update_channels_on_air(struct json_object *status)
{
    return channels_that(on_air, status);
}

unsigned update_channels_disabled(struct json_object *status)
{
    return channels_that(is_disabled, status);
}

unsigned update_channels_required(struct json_object *status)
{
    return channels_that(is_required, status);
}

/* ---- services ---- */

static bool begins_with(const char *name, const char *prefix)
{
    return strncmp(name, prefix, strlen(prefix)) == 0;
}

/*
 * The autopilot's; those that ask a network for an address (udhcpc, udhcpc-eth1), and begin anew
 * when another adapter comes or goes; and there is a file "down" for those that only start when
 * they are told to.
 */
static bool comes_and_goes(const char *directory, const char *name)
{
    char path[PATH_SIZE];

    snprintf(path, sizeof(path), "%s/%s/down", directory, name);
    return strcmp(name, "mavlink-router") == 0 || strcmp(name, "odid-beacons") == 0 ||
           begins_with(name, "udhcpc") || begins_with(name, "udhcpd-") || access(path, F_OK) == 0;
}

static int read_pid(const char *directory, const char *name)
{
    char path[PATH_SIZE], *text;
    size_t length;
    int pid;

    snprintf(path, sizeof(path), "%s/%s/supervise/pid", directory, name);
    text = whole_file_read(path, 32, &length);
    pid = text == NULL ? 0 : atoi(text);
    free(text);
    return pid;
}

static int is_name(const struct dirent *entry)
{
    return entry->d_name[0] != '.' && strlen(entry->d_name) < UPDATE_NAME_SIZE;
}

void update_services_read(struct update_services *services, const char *directory)
{
    struct dirent **entries = NULL;
    int count = scandir(directory, &entries, is_name, alphasort);

    memset(services, 0, sizeof(*services));
    for (int i = 0; i < count; i++) {
        const char *name = entries[i]->d_name;

        if (services->count < UPDATE_SERVICES_MAX && !comes_and_goes(directory, name)) {
            struct update_service *service = &services->service[services->count++];

            snprintf(service->name, sizeof(service->name), "%.31s", name);
            service->pid = read_pid(directory, name);
        }
        free(entries[i]);
    }
    free(entries);
}

static const struct update_service *find(const struct update_services *services, const char *name)
{
    for (unsigned i = 0; i < services->count; i++) {
        if (strcmp(services->service[i].name, name) == 0) {
            return &services->service[i];
        }
    }
    return NULL;
}

void update_services_forget(struct update_services *services, const char *name)
{
    for (unsigned i = 0; i < services->count; i++) {
        if (strcmp(services->service[i].name, name) == 0) {
            services->service[i].pid = 0;
        }
    }
}

/* ---- what a radio lacks ---- */

static unsigned radio_fault(struct json_object *fault)
{
    const char *name = json_object_get_string(json_object_object_get(fault, "name"));

    if (name == NULL) {
        return 0;
    }
    return strcmp(name, "country") == 0 ? 1U : begins_with(name, "patch-") ? 2U : 0;
}

unsigned update_radio_faults(struct json_object *faults)
{
    unsigned found = 0;

    for (size_t i = 0; i < json_object_array_length(faults); i++) {
        found |= radio_fault(json_object_array_get_idx(faults, i));
    }
    return found;
}

/* ---- all of it ---- */

static bool complain(struct update_board *board, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

static bool complain(struct update_board *board, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(board->complaint, sizeof(board->complaint), format, arguments);
    va_end(arguments);
    return false;
}

static bool judge_daemon(struct update_expectation *expectation, struct json_object *status,
                         struct update_board *board)
{
    struct json_object *uptime = json_object_object_get(status, "uptime_s");
    double before_s = expectation->uptime_s;

    expectation->uptime_s = json_object_get_double(uptime);
    if (uptime == NULL) {
        return complain(board, "The Remote ID daemon doesn't answer.");
    }
    if (expectation->uptime_s < before_s) {
        return complain(board, "The Remote ID daemon keeps ending.");
    }
    return true;
}

static bool judge_channels(const struct update_expectation *expectation, struct json_object *status,
                           struct update_board *board)
{
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        struct json_object *object = channel_of(status, channel);

        if ((expectation->channels & 1U << channel) != 0 && !on_air(object)) {
            const char *state = json_object_get_string(json_object_object_get(object, "state"));

            return complain(board, "%s isn't on the air, as it was before the update: %s.",
                            channel_title(channel), state == NULL ? "not known" : state);
        }
    }
    return true;
}

static bool judge_radios(const struct update_expectation *expectation, struct json_object *faults,
                         struct update_board *board)
{
    for (size_t i = 0; i < json_object_array_length(faults); i++) {
        struct json_object *fault = json_object_array_get_idx(faults, i);

        if ((radio_fault(fault) & ~expectation->radio_faults) != 0) {
            return complain(board, "Not so before the update: %s",
                            json_object_get_string(json_object_object_get(fault, "sentence")));
        }
    }
    return true;
}

static bool judge_services(struct update_expectation *expectation,
                           const struct update_services *now, struct update_board *board)
{
    for (unsigned i = 0; i < expectation->wanted.count; i++) {
        const char *name = expectation->wanted.service[i].name;
        const struct update_service *here = find(now, name),
                                    *before = find(&expectation->before, name);

        if (expectation->wanted.service[i].pid == 0 || here == NULL) {
            continue; /* it didn't run before, or this version has no such service */
        }
        if (here->pid == 0) {
            return complain(board, "The service %s doesn't run, as it did before the update.",
                            name);
        }
        if (before != NULL && before->pid != 0 && here->pid != before->pid) {
            return complain(board, "The service %s keeps ending.", name);
        }
    }
    return true;
}

void update_judge(struct update_expectation *expectation, struct json_object *status,
                  struct json_object *faults, const struct update_services *now,
                  struct update_board *board)
{
    bool daemon = judge_daemon(expectation, status, board);

    board->well = daemon && judge_channels(expectation, status, board) &&
                  judge_radios(expectation, faults, board) &&
                  judge_services(expectation, now, board);
    expectation->before = *now;
}
