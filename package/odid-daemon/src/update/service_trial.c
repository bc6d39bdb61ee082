/* odid-update: how the board is, what worked before the update, and how its trial ends. */
#include <errno.h>
#include <fcntl.h>
#include <json-c/json_object.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "appliance/faults.h"
#include "appliance/kept.h"
#include "appliance/status_fetch.h"
#include "base/log.h"
#include "base/whole_file.h"
#include "update/service.h"
#include "update/update_hawkbit.h"
#include "update/update_places.h"

/* ---- how the board is, and was ---- */

static struct json_object *ask_daemon(struct service *self, struct update_board *board)
{
    int error = 0;
    struct json_object *status = status_fetch(RUN_DIR, &error);
    struct json_object *known =
        json_object_object_get(json_object_object_get(status, "time"), "known");
    struct kept kept;
    bool ran = kept_read(RUN_DIR, &kept) == 0;
    bool unattended = self->record.from_server || self->record.unattended;

    memset(board, 0, sizeof(*board));
    self->time_known = self->time_known || json_object_get_boolean(known);
    board->armed =
        armed_says(status) || update_armed(&self->update, ran ? &kept : NULL, status != NULL,
                                           unattended, self->reason[0] != '\0');
    return status;
}

static bool write_record(struct service *self)
{
    int result = update_write_record(DATA, &self->record);

    service_complain("what worked before the update can't be kept", result);
    return result == 0;
}

/* Adds the channels on the air to the record; false: it has them already. */
static bool take_channels(struct service *self, struct json_object *status)
{
    unsigned channels = self->record.channels | update_channels_on_air(status);

    if (status == NULL || (self->record.channels_known && channels == self->record.channels)) {
        return false;
    }
    self->record.channels_known = true;
    self->record.channels = channels;
    return true;
}

/* Of the one in force: another one whenever it is saved. Empty: not known. */
static void identify_configuration(char identity[UPDATE_IDENTITY_SIZE])
{
    struct stat file;

    identity[0] = '\0';
    if (stat(CONFIGURATION, &file) == 0) {
        snprintf(identity, UPDATE_IDENTITY_SIZE, "%ju %jd.%09ld", (uintmax_t)file.st_ino,
                 (intmax_t)file.st_mtim.tv_sec, file.st_mtim.tv_nsec);
    }
}

/* Whoever saves settings restarts what they concern: that says nothing against the new version. */
static bool configuration_changed(struct service *self)
{
    char before[UPDATE_IDENTITY_SIZE];

    snprintf(before, sizeof(before), "%s", self->configuration);
    identify_configuration(self->configuration);
    return before[0] != '\0' && self->configuration[0] != '\0' &&
           strcmp(before, self->configuration) != 0;
}

/* What the bundle called it; where that isn't known, what it calls itself. */
static const char *offered_version(const struct service *self)
{
    return self->record.to[0] != '\0' ? self->record.to : self->version;
}

/* A stick whose bundle is newer than what is in it would be installed at every start. */
static void compare_versions(const struct service *self, struct update_board *board)
{
    if (strcmp(offered_version(self), self->version) != 0) {
        board->well = false;
        snprintf(board->complaint, sizeof(board->complaint),
                 "It calls itself version %s: the bundle has to be built again.", self->version);
    }
}

/* Of what worked before. In a trial settings may be saved, and keys taken away. */
static void ask_no_more_for_what_was_switched_off(struct service *self, struct json_object *status)
{
    struct stat keys;

    if (self->configured_anew) {
        unsigned disabled = update_channels_disabled(status);

        self->expectation.channels &= ~disabled;
        if ((disabled & 1U << CHANNEL_WIFI) != 0) {
            update_services_forget(&self->expectation.wanted, "hostapd");
        }
    }
    if (stat(SSH_KEYS, &keys) < 0 || keys.st_size == 0) {
        update_services_forget(&self->expectation.wanted, "dropbear");
    }
}

void service_look(struct service *self, struct update_board *board, int64_t now_us)
{
    struct json_object *status = ask_daemon(self, board);

    if (self->update.state == UPDATE_TRIAL) {
        struct json_object *faults = faults_list(FAULTS);
        struct update_services services;

        update_services_read(&services, SERVICES);
        if (!self->record.channels_known) {
            self->expectation.channels = update_channels_required(status);
        }
        if (configuration_changed(self)) {
            self->configured_anew = true;
            update_try(&self->update, self->version, now_us);
        }
        ask_no_more_for_what_was_switched_off(self, status);
        update_judge(&self->expectation, status, faults, &services, board);
        json_object_put(faults);
        compare_versions(self, board);
    } else if (self->update.state == UPDATE_INSTALLING && take_channels(self, status)) {
        write_record(self); /* a channel that wasn't up yet when the install began */
    }
    json_object_put(status);
}

/* The gate is passed, and nothing is written yet that counts. */
void service_begin_record(struct service *self)
{
    struct update_board board;
    struct json_object *status = ask_daemon(self, &board), *faults = faults_list(FAULTS);

    memset(&self->record, 0, sizeof(self->record));
    self->record.slot = self->other;
    self->record.from_server = self->source == UPDATE_SOURCE_SERVER;
    self->record.unattended = self->unattended;
    snprintf(self->record.from, sizeof(self->record.from), "%s", self->version);
    snprintf(self->record.to, sizeof(self->record.to), "%s", self->update.version);
    take_channels(self, status);
    identify_configuration(self->record.configuration);
    update_services_read(&self->record.services, SERVICES);
    self->record.radio_faults = update_radio_faults(faults);
    json_object_put(faults);
    json_object_put(status);
    if (!write_record(self)) {
        /* Without a record its trial would pass for one that was given up (was_given_up). */
        service_complain("that its version was rolled back before can't be forgotten",
                         update_forget_back(DATA, self->record.to));
    }
}

/* ---- what is done ---- */

void service_end_installer(struct service *self)
{
    int result = update_installer_end(INSTALLER);

    service_complain("SWUpdate can't be ended", result);
    self->ended = self->ended || result == 0;
}

/* A server whose update this wasn't would close the one that waits there. */
enum update_report service_report(const struct service *self, enum update_report what)
{
    return self->record.from_server ? what : UPDATE_REPORT_NOTHING;
}

void service_commit(struct service *self, int64_t now_us)
{
    struct update_variables variables = {.slot = self->running};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &variables,
                                        service_report(self, UPDATE_REPORT_GOOD));

    if (result < 0) { /* tried again in a second */
        service_complain("the slot can't be committed", result);
        return;
    }
    self->variables = variables;
    service_keep(self, UPDATE_INSTALLED, self->version, "Version %s is installed.", self->version);
    update_committed(&self->update, now_us);
    self->report_due = update_hawkbit_is_asked();
}

static void keep_reason(struct service *self)
{
    service_keep(self, UPDATE_BACK, offered_version(self), "Version %s was rolled back: %s",
                 offered_version(self), self->reason);
    self->overwritten = false;
}

void service_give_up(struct service *self, int64_t now_us)
{
    struct update_variables variables = {.slot = self->other, .trial_failed = self->running};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &variables,
                                        service_report(self, UPDATE_REPORT_FAILED));

    if (result < 0) {
        service_complain("the slot can't be given up", result);
        return;
    }
    self->variables = variables;
    update_rolled_back(&self->update, now_us);
}

void service_roll_back(struct service *self, int64_t now_us)
{
    snprintf(self->reason, sizeof(self->reason), "%s", self->update.sentence);
    if (strcmp(offered_version(self), self->version) != 0) {
        service_give_up(self, now_us); /* first: was_given_up knows it by its own name only */
    }
    keep_reason(self); /* before that: power may fail now (was_given_up) */
    service_give_up(self, now_us);
}

/* sync() would wait as well for whatever somebody is mounting, a broken stick for instance. What
 * was written of the slot and of U-Boot's variables is on the disk. */
static void flush_data(void)
{
    int fd = open(DATA, O_RDONLY | O_DIRECTORY | O_CLOEXEC);

    service_complain("/data can't be flushed", fd < 0 || syncfs(fd) < 0 ? -errno : 0);
    if (fd >= 0) {
        close(fd);
    }
}

void service_restart_board(struct service *self)
{
    struct update_board board;

    if (self->overwritten) {
        keep_reason(self);
    }
    if (access(MAINTENANCE, F_OK) == 0) {
        service_complain("maintenance can't be kept over the restart",
                         whole_file_replace(MAINTENANCE_AGAIN, "", 0, 0644));
    }
    flush_data(); /* which takes its time: nobody may have armed meanwhile */
    json_object_put(ask_daemon(self, &board));
    if (board.armed) {
        /* Else it would open at some later power-on. */
        service_complain("maintenance's mark can't be removed",
                         whole_file_remove(MAINTENANCE_AGAIN));
        log_info("update: the aircraft is armed: the restart waits");
        return;
    }
    log_info("update: the board restarts");
    kill(1, SIGTERM); /* init's order to restart */
}
