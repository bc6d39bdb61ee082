/*
 * odid-update: looks after updates. SWUpdate installs; this says whether it
 * may, watches it, keeps what is known about the update, stops it when the
 * aircraft is armed or nothing moves, judges the new slot on trial, and
 * restarts the board when that may be. "odid-update gate" is SWUpdate's question.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "appliance/faults.h"
#include "appliance/update_bundle.h"
#include "appliance/update_gate.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/whole_file.h"
#include "update/service.h"
#include "update/update_hawkbit.h"
#include "update/update_places.h"
#include "update/update_question.h"
#include "update/update_slot.h"

#define SECOND_US 1000000

static struct service self;

/* ---- small things ---- */

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

/* A technician's isn't, and no server is left alone for it. */
static bool may_be_its_server_s(void)
{
    return self.source != UPDATE_SOURCE_OTHER;
}

static void end_installer(void)
{
    service_end_installer(&self);
}

static void act(int64_t now_us)
{
    struct update_board board;
    enum update_state before = self.update.state;

    service_look(&self, &board, now_us);
    switch (update_tick(&self.update, &board, now_us)) {
    case UPDATE_STOP:
        /* Also when it was called off: its server, which doesn't know, would begin again. */
        if (!self.stopping && may_be_its_server_s() &&
            (self.update.slow || self.update.called_off)) {
            update_hawkbit_pause(now_us);
        }
        self.stopping = true; /* it may take its time */
        service_end_installer(&self);
        break;
    case UPDATE_COMMIT:
        service_commit(&self, now_us);
        break;
    case UPDATE_ROLL_BACK:
        service_roll_back(&self, now_us);
        break;
    case UPDATE_REBOOT:
        service_restart_board(&self);
        break;
    default:
        break;
    }
    if (self.update.state != before) {
        service_show(&self);
    }
}

static bool undecided(void)
{
    return self.update.state == UPDATE_WAITING || self.update.state == UPDATE_TRIAL;
}

static void begin_update(int64_t now_us)
{
    self.beside = false;
    update_begins(&self.update, now_us);
    service_show(&self);
}

static void on_tick(void *context, int64_t now_us)
{
    (void)context;
    if (self.update.state != UPDATE_IDLE) {
        act(now_us);
    } else {
        update_hawkbit_follow_configuration();
    }
    if (self.beside && !undecided()) {
        begin_update(now_us); /* the other one was decided: now this one keeps the others out */
    }
    if (self.report_due && self.update.state == UPDATE_IDLE) {
        self.report_due = false;
        service_end_installer(&self);
    }
    loop_arm(&self.tick, now_us + SECOND_US);
}

/* ---- what SWUpdate does ---- */

static void on_begins(int64_t now_us)
{
    if (self.passed || self.update.state == UPDATE_CHECKING) {
        return; /* it does one at a time: that isn't its word, or the one before wasn't */
    }
    self.beside = undecided();
    self.source = UPDATE_SOURCE_UNKNOWN;
    self.refused[0] = '\0';
    if (!self.beside) {
        begin_update(now_us);
    }
}

static void on_source(enum update_source source)
{
    self.source = source;
}

static void on_progress(int percent, int64_t now_us)
{
    if (self.beside || !self.passed) {
        return;
    }
    if (self.update.state == UPDATE_CHECKING) {
        service_begin_record(&self);
    }
    if (self.update.state != UPDATE_INSTALLING || percent != self.update.percent) {
        update_progress(&self.update, percent, now_us);
        service_show(&self);
    }
}

static void keep_refusal(const char *why, const char *to)
{
    char sentence[UPDATE_SENTENCE_SIZE], hardware[UPDATE_SENTENCE_SIZE];

    if (self.update.stopped != NULL && !self.beside) {
        snprintf(sentence, sizeof(sentence), "%s", self.update.stopped);
    } else if (self.refused[0] != '\0') {
        snprintf(sentence, sizeof(sentence), "%s", self.refused);
    } else {
        whole_file_line(STATE "/hardware", hardware, sizeof(hardware));
        update_installer_explain(why, hardware, sentence, sizeof(sentence));
    }
    self.refused[0] = '\0';
    service_keep(&self, UPDATE_REFUSED, to, "The update was refused: %s", sentence);
}

static bool is_trial(const struct update_variables *variables, char slot)
{
    return variables->upgrade_available && variables->trial == slot;
}

/* By U-Boot's variables as they are now. */
static bool is_marked(void)
{
    struct update_variables variables;
    bool damaged;

    return update_variables_read(ENVIRONMENT_CONFIG, NULL, self.running, &variables, &damaged) ==
               0 &&
           is_trial(&variables, self.other);
}

/* Nothing is written to it any more; written: it was, for all that is known. */
static void protect_other(bool written)
{
    if ((written || update_slot_is_writable(self.other)) && !is_marked() &&
        update_slot_protect(self.other, false)) {
        update_slot_spoil(self.other);
    }
    update_slot_protect(self.other, true);
}

/* Called off, and written to its end all the same: whoever called it off was told that nothing has
 * changed. */
static void withdraw(void)
{
    struct update_variables committed = {.slot = self.running};

    service_complain("the slot's mark can't be withdrawn",
                     update_variables_write(ENVIRONMENT_CONFIG, &committed, UPDATE_REPORT_NOTHING));
}

/* SWUpdate marks the slot before it says so, and may fail or be ended between, or say that all went
 * well after a mere trial run: the mark counts, as it does for U-Boot. */
static void on_ends(const char *why, int64_t now_us)
{
    bool passed = self.passed, broke_off = passed && self.update.stopped == NULL;

    self.passed = self.stopping = false;
    if (self.beside) {
        keep_refusal(why, "");
        self.beside = false;
        self.overwritten = self.reason[0] != '\0';
        return;
    }
    if (why[0] != '\0') {
        log_info("SWUpdate says: %s", why);
    }
    if (self.update.called_off && is_marked()) {
        withdraw();
    }
    protect_other(passed);
    if (is_marked()) {
        update_hawkbit_came_through();
        update_installed(&self.update, now_us);
    } else {
        if (broke_off && may_be_its_server_s()) {
            update_hawkbit_report_and_pause(now_us);
        } else if (!passed && self.update.stopped == NULL && self.source == UPDATE_SOURCE_SERVER) {
            update_hawkbit_failed(now_us);
        }
        keep_refusal(why[0] != '\0' ? why : "all went well, but nothing is marked to be started.",
                     self.update.version);
        update_ended(&self.update, now_us);
    }
    service_show(&self);
}

/* Its hawkBit client takes it along, whoever's bundle it writes. What becomes of its own server's
 * on_ends has seen to. */
static void on_lost(bool installing, int64_t now_us)
{
    bool by_us = self.ended;

    self.ended = false;
    if (!by_us) {
        update_hawkbit_lost(installing && self.source != UPDATE_SOURCE_SERVER, now_us);
    }
}

/* ---- the gate ---- */

static bool is_known(void)
{
    return self.beside || self.update.state == UPDATE_CHECKING ||
           self.update.state == UPDATE_INSTALLING;
}

/* By the description that was verified: what SWUpdate tells of an update has its server's words in
 * it. */
static void take_version(void)
{
    struct update_bundle bundle;

    if (!self.beside && update_bundle_read_description(DESCRIPTION, &bundle) == 0) {
        update_version(&self.update, bundle.version);
    }
}

static void judge_offer(char answer[UPDATE_SENTENCE_SIZE])
{
    bool unattended = update_installer_is_unattended(loop_now_us()); /* first: and from where */
    const struct update_question question = {.running = self.running,
                                             .other = self.other,
                                             .version = self.version,
                                             .beside = self.beside,
                                             .unattended = unattended,
                                             .from_server = self.source == UPDATE_SOURCE_SERVER};

    take_version();
    if (update_hawkbit_reports(loop_now_us())) {
        snprintf(answer, UPDATE_SENTENCE_SIZE,
                 "The one before it was broken off, and its server is being told. Try again in a "
                 "quarter of a minute.");
    } else if (!self.beside && self.update.stopped != NULL) {
        snprintf(answer, UPDATE_SENTENCE_SIZE, "%s", self.update.stopped);
    } else {
        update_question_answer(&question, answer);
    }
    snprintf(self.refused, sizeof(self.refused), "%s", answer);
    if (answer[0] == '\0' && !self.beside) {
        self.passed = true;
        self.unattended = unattended;
        service_show(&self);
    }
}

static void call_off(char answer[UPDATE_SENTENCE_SIZE])
{
    if (!update_cancel(&self.update)) {
        snprintf(answer, UPDATE_SENTENCE_SIZE,
                 "Nothing is being installed that could be called "
                 "off.");
        return;
    }
    act(loop_now_us()); /* at once: it may be at its last octets */
}

/* SWUpdate's question, in a process of its own. */
static int ask_gate(void)
{
    char answer[UPDATE_SENTENCE_SIZE];
    int result = -1;

    for (int i = 0; result < 0 && i < 5; i++) { /* it may be about to start */
        if (i > 0) {
            sleep(1);
        }
        result = update_gate_ask(STATE, "gate", answer);
    }
    if (result < 0) {
        snprintf(answer, sizeof(answer),
                 "Nobody would watch over it: the service update doesn't answer. Try again in a "
                 "minute.");
    }
    if (answer[0] != '\0') {
        log_info("update refused: %s", answer);
    }
    return answer[0] == '\0' ? EXIT_SUCCESS : EXIT_FAILURE;
}

/* ---- start ---- */

/* U-Boot was to start the new slot, and didn't. */
static void explain_fallback(const char *fallback)
{
    char why[128];

    update_explain_fallback(self.variables.trial_failed == '\0' ? "" : self.variables.trial_reason,
                            fallback, why, sizeof(why));
    service_keep(&self, UPDATE_BACK, self.record.to, "Version %s was rolled back: %s.",
                 self.record.to[0] == '\0' ? "(not known)" : self.record.to, why);
}

/* No trial, no restarts, nothing unverified: the slot that U-Boot has for the committed one stays
 * that. */
static void settle(enum update_report report)
{
    struct update_variables settled = {.slot = self.variables.slot};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &settled, report);

    service_complain("U-Boot's variables can't be settled", result);
}

/* Power may have failed between the reason and U-Boot's variables. */
static bool was_given_up(void)
{
    char version[UPDATE_VERSION_SIZE];

    whole_file_line(DATA "/" UPDATE_BACK_FILE, version, sizeof(version));
    return strcmp(version, self.version) == 0;
}

/* Nothing of it was marked to be started. Where the other slot is the committed one, it isn't meant
 * any more. */
static bool was_broken_off(bool recorded)
{
    return self.variables.slot == self.running &&
           (recorded || self.variables.unverified == self.other);
}

/* Only a record of what U-Boot's variables tell of: into the version that runs, or out of it. One
 * of an earlier update is there still where /data took nothing any more when it was to go. */
static bool read_record(void)
{
    bool into = is_trial(&self.variables, self.running);

    if (update_read_record(DATA, &self.record) < 0) {
        return false;
    }
    /* Unverified is what no record could be kept of. */
    if (into ? self.record.slot == self.running && self.variables.unverified != self.running
             : self.record.slot == self.running || strcmp(self.record.from, self.version) == 0) {
        return true;
    }
    log_warning("the record of an update to slot %c, version %s, is an earlier one's: left alone",
                self.record.slot, self.record.to);
    self.record = (struct update_record){.slot = '\0'};
    return false;
}

/* What the boot loader and an earlier process left behind. first: since power-on; later the
 * kernel's command line is an old story, and an install may be going on. */
static void resume(bool first, int64_t now_us)
{
    const struct update_variables *variables = &self.variables;
    bool recorded = read_record();
    char fallback[128] = "";

    self.record.unattended = self.record.unattended || !recorded; /* for all that is known */
    if (first) {
        kernel_word("odid.fallback=", fallback, sizeof(fallback));
    }
    if (is_trial(variables, self.running)) {
        self.expectation.channels = self.record.channels;
        self.expectation.wanted = self.record.services;
        snprintf(self.configuration, sizeof(self.configuration), "%s", self.record.configuration);
        update_try(&self.update, self.version, now_us);
        if (!recorded && was_given_up()) {
            self.record.from_server = update_result_is_server_s(DATA);
            snprintf(self.reason, sizeof(self.reason), "It failed its trial.");
            service_give_up(&self, now_us);
        }
    } else if (is_trial(variables, self.other) && fallback[0] == '\0') {
        update_version(&self.update, self.record.to); /* installed, not restarted yet */
        update_installed(&self.update, now_us);
    } else if (!first && variables->trial_failed == self.running) {
        /* Its trial failed in this boot, and the restart waits for the aircraft to be disarmed. */
        snprintf(self.reason, sizeof(self.reason), "It failed its trial.");
        update_version(&self.update, self.version);
        update_rolled_back(&self.update, now_us);
    } else if (variables->upgrade_available || variables->trial_failed != '\0') {
        if (recorded) {
            explain_fallback(fallback);
        }
        /* Without a record it was rolled back by us, and what its server is told stands there. */
        settle(recorded ? service_report(&self, UPDATE_REPORT_FAILED) : UPDATE_REPORT_AS_IT_IS);
    } else {
        if (recorded && self.record.slot == self.running) {
            service_keep(&self, UPDATE_INSTALLED, self.version, "Version %s is installed.",
                         self.version);
        } else if (first && was_broken_off(recorded)) {
            protect_other(true);
            if (recorded) { /* else it may have ended long ago, and its result stands there */
                service_keep(
                    &self, UPDATE_REFUSED, self.record.to,
                    "The update was broken off, by power or a restart; nothing has changed.");
            }
        }
        if (variables->restarts != 0 || (first && variables->unverified != '\0')) {
            settle(UPDATE_REPORT_AS_IT_IS); /* we came up */
        }
    }
}

static bool find_environment(void)
{
    char problem[160] = "", sentence[240];
    bool repaired = false;
    int result;

    if (!update_environment_find("/dev/disk/odid/env", "/run/environment", ENVIRONMENT_CONFIG,
                                 problem, sizeof(problem))) {
        result = -EIO;
    } else {
        result = update_variables_read(ENVIRONMENT_CONFIG, ENVIRONMENT_DEFAULTS, self.running,
                                       &self.variables, &repaired);
        snprintf(problem, sizeof(problem), "U-Boot's environment can't be %s",
                 repaired ? "repaired" : "read");
    }
    snprintf(sentence, sizeof(sentence),
             "Updates are not possible: %s. Write the image to the disk again.", problem);
    faults_set(FAULTS, "environment", result < 0 ? sentence : NULL);
    if (repaired) {
        log_warning("U-Boot's environment was damaged, and is made anew");
    }
    return result == 0;
}

static bool start_service(bool first, int64_t now_us)
{
    char line[16];

    update_init(&self.update, now_us);
    whole_file_line(STATE "/slot", line, sizeof(line));
    if (line[0] != 'a' && line[0] != 'b') {
        log_error("it isn't known which slot is running");
        return false;
    }
    self.running = line[0];
    self.other = line[0] == 'a' ? 'b' : 'a';
    whole_file_line(VERSION_FILE, self.version, sizeof(self.version));
    if (!find_environment()) {
        return false;
    }
    resume(first, now_us);
    service_show(&self);
    return true;
}

static bool nothing_goes_on(void)
{
    return self.update.state == UPDATE_IDLE;
}

static void on_signal(void *context, uint32_t events, int64_t now_us)
{
    (void)context;
    (void)events;
    (void)now_us;
    loop_stop();
}

static int look_after_updates(void)
{
    static const struct update_installer_calls calls = {.begins = on_begins,
                                                        .source = on_source,
                                                        .progress = on_progress,
                                                        .ends = on_ends,
                                                        .lost = on_lost};
    static const struct update_gate_calls gate = {
        .known = is_known, .judge = judge_offer, .cancel = call_off};
    bool first = access(STATE "/" UPDATE_STATE_FILE, F_OK) < 0; /* since power-on */
    int result = loop_init();

    setenv("TMPDIR", SWUPDATE, 0); /* where libswupdate looks for SWUpdate */
    if (result == 0) {
        result = loop_watch_signals(&self.signals, 0, on_signal, NULL);
    }
    if (result < 0) {
        log_error("can't begin: %s", strerror(-result));
        return EXIT_FAILURE;
    }
    if (!start_service(first, loop_now_us())) {
        return EXIT_FAILURE;
    }
    loop_timer_init(&self.tick, on_tick, NULL);
    loop_arm(&self.tick, loop_now_us());
    update_hawkbit_begin(nothing_goes_on, end_installer, loop_now_us());
    update_installer_watch(&calls, first);
    result = update_gate_serve(STATE, &gate);
    if (result < 0) {
        log_error("nobody can ask: %s", strerror(-result));
        return EXIT_FAILURE;
    }
    return loop_run() < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

int main(int argc, char *argv[])
{
    if (argc == 2 && strcmp(argv[1], "gate") == 0) {
        return ask_gate();
    }
    if (argc != 1) {
        fputs("odid-update looks after updates; \"odid-update gate\" asks it. See "
              "odid-update(8).\n",
              stderr);
        return 2;
    }
    return look_after_updates();
}
