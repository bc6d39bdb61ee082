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
    service_take_late_record(&self);
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

/* By the description that was verified: what SWUpdate tells of an update has its server's words in
 * it. */
static void take_version(void)
{
    struct update_bundle bundle;

    if (!self.beside && update_bundle_read_description(DESCRIPTION, &bundle) == 0) {
        update_version(&self.update, bundle.version);
    }
}

static void on_begins(int64_t now_us)
{
    if (self.passed || self.update.state == UPDATE_CHECKING) {
        return; /* it does one at a time: that isn't its word, or the one before wasn't */
    }
    self.beside = undecided();
    self.source = UPDATE_SOURCE_UNKNOWN;
    self.refused[0] = '\0';
    if (!self.beside) {
        /* Said in a process before this one: the gate alone has the slot written to. */
        self.passed = update_slot_is_writable(self.other);
        self.unattended = self.passed; /* for all that is known */
        begin_update(now_us);
    }
    if (self.passed) {
        take_version();
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
    if (self.update.called_off && service_is_marked(&self)) {
        withdraw();
    }
    service_protect_other(&self, passed);
    if (service_is_marked(&self)) {
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

static bool find_environment(void)
{
    char problem[160] = "", sentence[240];
    int result;

    if (!update_environment_find("/dev/disk/odid/env", "/run/environment", ENVIRONMENT_CONFIG,
                                 problem, sizeof(problem))) {
        result = -EIO;
    } else {
        result = update_variables_read(ENVIRONMENT_CONFIG, ENVIRONMENT_DEFAULTS, self.running,
                                       &self.variables, &self.lost);
        snprintf(problem, sizeof(problem), "U-Boot's environment can't be %s",
                 self.lost ? "repaired" : "read");
    }
    snprintf(sentence, sizeof(sentence),
             "Updates are not possible: %s. Write the image to the disk again.", problem);
    faults_set(FAULTS, "environment", result < 0 ? sentence : NULL);
    if (self.lost && result == 0) { /* until power-off: by then it is over */
        snprintf(sentence, sizeof(sentence),
                 "U-Boot's environment was damaged, and is made anew. Version %s runs: if another "
                 "one was installed last, install it again.",
                 self.version);
        log_warning("%s", sentence);
        faults_set(FAULTS, "environment-lost", sentence);
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
    service_resume(&self, first, now_us);
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
