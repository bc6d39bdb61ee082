/* odid-update: what the boot loader and an earlier process left behind, at its start. */
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "base/whole_file.h"
#include "update/service.h"
#include "update/update_places.h"
#include "update/update_slot.h"

/* The word that starts with prefix, on the kernel's command line; its rest. */
static void kernel_word(const char *prefix, char *out, size_t size)
{
    char line[2048], *rest = line, *word;

    out[0] = '\0';
    whole_file_line("/proc/cmdline", line, sizeof(line));
    while ((word = strsep(&rest, " ")) != NULL) {
        if (strncmp(word, prefix, strlen(prefix)) == 0) {
            snprintf(out, size, "%s", word + strlen(prefix));
        }
    }
}

static bool is_trial(const struct update_variables *variables, char slot)
{
    return variables->upgrade_available && variables->trial == slot;
}

bool service_is_marked(const struct service *self)
{
    struct update_variables variables;
    bool damaged;

    return update_variables_read(ENVIRONMENT_CONFIG, NULL, self->running, &variables, &damaged) ==
               0 &&
           is_trial(&variables, self->other);
}

void service_protect_other(const struct service *self, bool written)
{
    if ((written || update_slot_is_writable(self->other)) && !service_is_marked(self) &&
        update_slot_protect(self->other, false)) {
        update_slot_spoil(self->other);
    }
    update_slot_protect(self->other, true);
}

/* U-Boot was to start the new slot, and didn't. */
static void explain_fallback(struct service *self, const char *fallback)
{
    char why[128];

    update_explain_fallback(self->variables.trial_failed == '\0' ? ""
                                                                 : self->variables.trial_reason,
                            fallback, why, sizeof(why));
    service_keep(self, UPDATE_BACK, self->record.to, "Version %s was rolled back: %s.",
                 self->record.to[0] == '\0' ? "(not known)" : self->record.to, why);
}

/* No trial, no restarts, nothing unverified: the slot that U-Boot has for the committed one stays
 * that. */
static void settle(const struct service *self, enum update_report report)
{
    struct update_variables settled = {.slot = self->variables.slot};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &settled, report);

    service_complain("U-Boot's variables can't be settled", result);
}

/* Power may have failed between the reason and U-Boot's variables. */
static bool was_given_up(const struct service *self)
{
    char version[UPDATE_VERSION_SIZE];

    whole_file_line(DATA "/" UPDATE_BACK_FILE, version, sizeof(version));
    return strcmp(version, self->version) == 0;
}

/* Nothing of it was marked to be started. Where the other slot is the committed one, it isn't meant
 * any more. */
static bool was_broken_off(const struct service *self, bool recorded)
{
    return self->variables.slot == self->running &&
           (recorded || self->variables.unverified == self->other);
}

/* Only a record of what U-Boot's variables tell of: into the version that runs, or out of it. One
 * of an earlier update is there still where /data took nothing any more when it was to go. */
static bool read_record(struct service *self)
{
    bool into = is_trial(&self->variables, self->running);

    if (update_read_record(DATA, &self->record) < 0) {
        return false;
    }
    /* Unverified is what no record could be kept of. */
    if (into
            ? self->record.slot == self->running && self->variables.unverified != self->running
            : self->record.slot == self->running || strcmp(self->record.from, self->version) == 0) {
        return true;
    }
    log_warning("the record of an update to slot %c, version %s, is an earlier one's: left alone",
                self->record.slot, self->record.to);
    self->record = (struct update_record){.slot = '\0'};
    return false;
}

static bool take_record(struct service *self)
{
    bool recorded = read_record(self);

    self->record.unattended = self->record.unattended || !recorded; /* for all that is known */
    return recorded;
}

static void give_up_again(struct service *self, int64_t now_us)
{
    snprintf(self->reason, sizeof(self->reason), "It failed its trial.");
    update_version(&self->update, self->version);
    service_give_up(self, now_us);
}

/* By the record of what worked before. */
static void begin_trial(struct service *self, bool recorded, int64_t now_us)
{
    self->expectation.channels = self->record.channels;
    self->expectation.radio_faults = recorded ? self->record.radio_faults : ~0U;
    self->expectation.wanted = self->record.services;
    snprintf(self->configuration, sizeof(self->configuration), "%s", self->record.configuration);
    update_try(&self->update, self->version, now_us);
    if (!recorded && was_given_up(self)) {
        self->record.from_server = update_result_is_server_s(DATA);
        give_up_again(self, now_us);
    }
}

/* U-Boot starts slot a without its environment, and no more knows that it is on trial. */
static void mark_again(struct service *self)
{
    struct update_variables marked = {
        .slot = self->other, .trial = self->running, .upgrade_available = true};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &marked, UPDATE_REPORT_AS_IT_IS);

    service_complain("the slot can't be marked to be on trial", result);
    if (result == 0) {
        self->variables = marked;
    }
}

/* What worked before isn't asked for any more: what was set on the disk may not be in force. */
void service_take_late_record(struct service *self)
{
    if (self->update.state == UPDATE_TRIAL && self->data_late && !update_data_is_late(IN_MEMORY)) {
        self->data_late = false;
        take_record(self);
        self->record.channels_known = false;
    }
}

void service_resume(struct service *self, bool first, int64_t now_us)
{
    const struct update_variables *variables = &self->variables;
    bool late = update_data_is_late(IN_MEMORY), recorded = take_record(self);
    char fallback[128] = "";

    if (first) {
        kernel_word("odid.fallback=", fallback, sizeof(fallback));
    }
    if (self->lost && recorded && self->record.slot == self->running &&
        strcmp(self->record.to, self->version) == 0) {
        mark_again(self);
    }
    if (is_trial(variables, self->running)) {
        self->data_late = late && !recorded;
        begin_trial(self, recorded, now_us);
    } else if (is_trial(variables, self->other) && fallback[0] == '\0') {
        update_version(&self->update, self->record.to); /* installed, not restarted yet */
        update_installed(&self->update, now_us);
    } else if (!first && variables->trial_failed == self->running) {
        /* Its trial failed in this boot, and the restart waits for the aircraft to be disarmed. */
        snprintf(self->reason, sizeof(self->reason), "It failed its trial.");
        update_version(&self->update, self->version);
        update_rolled_back(&self->update, now_us);
    } else if (variables->upgrade_available || variables->trial_failed != '\0') {
        if (recorded) {
            explain_fallback(self, fallback);
        }
        /* Without a record it was rolled back by us, and what its server is told stands there. */
        settle(self,
               recorded ? service_report(self, UPDATE_REPORT_FAILED) : UPDATE_REPORT_AS_IT_IS);
    } else if (self->lost && was_given_up(self)) {
        give_up_again(self, now_us); /* U-Boot starts slot a then, whatever is in it */
    } else {
        if (recorded && self->record.slot == self->running) {
            service_keep(self, UPDATE_INSTALLED, self->version, "Version %s is installed.",
                         self->version);
        } else if (first && was_broken_off(self, recorded)) {
            service_protect_other(self, true);
            if (recorded) { /* else it may have ended long ago, and its result stands there */
                service_keep(
                    self, UPDATE_REFUSED, self->record.to,
                    "The update was broken off, by power or a restart; nothing has changed.");
            }
        }
        if (variables->restarts != 0 || (first && variables->unverified != '\0')) {
            settle(self, UPDATE_REPORT_AS_IT_IS); /* we came up */
        }
    }
}
