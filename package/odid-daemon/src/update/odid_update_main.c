/*
 * odid-update: looks after updates. SWUpdate installs; this says whether it
 * may, watches it, keeps what is known about the update, stops it when the
 * aircraft is armed or nothing moves, judges the new slot on trial, and
 * restarts the board when that may be. "odid-update gate" is SWUpdate's question.
 */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "appliance/appliance_marks.h"
#include "appliance/armed.h"
#include "appliance/faults.h"
#include "appliance/kept.h"
#include "appliance/status_fetch.h"
#include "appliance/update_bundle.h"
#include "appliance/update_gate.h"
#include "appliance/update_places.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/whole_file.h"
#include "update/update.h"
#include "update/update_environment.h"
#include "update/update_files.h"
#include "update/update_hawkbit.h"
#include "update/update_installer.h"
#include "update/update_judge.h"
#include "update/update_question.h"
#include "update/update_slot.h"

#define SECOND_US 1000000

static struct {
    struct update update;
    struct update_record record;
    struct update_expectation expectation;
    struct update_variables variables;
    /* In a trial: the one in force, when it was looked at last, or before the restart. */
    char configuration[UPDATE_IDENTITY_SIZE];
    bool configured_anew; /* it has changed since */
    char running, other;  /* slots */
    char version[UPDATE_VERSION_SIZE];
    bool time_known;
    bool beside;     /* a bundle came while another update isn't decided: the gate refuses it */
    bool stopping;   /* it was told to end */
    bool ended;      /* SWUpdate was, by us */
    bool passed;     /* the gate said yes to what is being installed */
    bool unattended; /* and nobody asked for that */
    enum update_source source;          /* of that */
    char refused[UPDATE_SENTENCE_SIZE]; /* why the gate refused this bundle, or "" */
    char reason[UPDATE_SENTENCE_SIZE];  /* why it was rolled back, until the restart; or "" */
    bool overwritten; /* a bundle was refused since, and that is the last result */
    struct loop_timer tick;
    struct loop_watch signals;
} self;

/* ---- small things ---- */

static void complain(const char *what, int result)
{
    if (result < 0) {
        log_error("%s: %s", what, strerror(-result));
    }
}

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

/* ---- what is shown and kept ---- */

/* Before the gate nothing keeps the aircraft on the ground: SWUpdate's word that something begins
 * can be anybody's on this board (its notifier's socket has no mode). */
static void show(void)
{
    bool checking = self.update.state == UPDATE_CHECKING && !self.passed;

    complain("the update's state can't be shown", update_write_state(STATE, &self.update));
    if (self.update.state == UPDATE_IDLE || checking) {
        unlink(APPLIANCE_UPDATING);
    } else {
        int fd = open(APPLIANCE_UPDATING, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);

        if (fd >= 0) {
            close(fd);
        }
    }
}

/* Where /data is full there is room once the record is gone, which isn't needed any more then. */
static void write_result(const struct update_result *result, bool decided)
{
    time_t known = self.time_known ? time(NULL) : 0;
    int written = update_write_result(DATA, result, known);

    if (decided) {
        complain("the trial's record can't be removed", update_remove_record(DATA));
        written = written < 0 ? update_write_result(DATA, result, known) : written;
    }
    complain("the update's result can't be kept", written);
}

static void keep_result(enum update_outcome outcome, const char *to, const char *format,
                        va_list arguments)
{
    struct update_result result = {.outcome = outcome};
    bool recorded = outcome != UPDATE_REFUSED && self.record.from[0] != '\0';
    bool decided = outcome != UPDATE_REFUSED || !self.beside;

    result.from_server = recorded && self.record.from_server;
    snprintf(result.from, sizeof(result.from), "%s", recorded ? self.record.from : self.version);
    snprintf(result.to, sizeof(result.to), "%s", to);
    vsnprintf(result.sentence, sizeof(result.sentence), format, arguments);
    log_info("update: %s", result.sentence);
    write_result(&result, decided);
    if (decided) {
        faults_set(FAULTS, "update", outcome == UPDATE_BACK ? result.sentence : NULL);
    }
}

static void keep(enum update_outcome outcome, const char *to, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Also of a bundle beside an update that isn't decided: of that one everything stays known. */
static void keep(enum update_outcome outcome, const char *to, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    keep_result(outcome, to, format, arguments);
    va_end(arguments);
}

/* ---- how the board is ---- */

static struct json_object *ask(struct update_board *board)
{
    int error = 0;
    struct json_object *status = status_fetch(RUN_DIR, &error);
    struct json_object *known =
        json_object_object_get(json_object_object_get(status, "time"), "known");
    struct kept kept;
    bool ran = kept_read(RUN_DIR, &kept) == 0;
    bool unattended = self.record.from_server || self.record.unattended;

    memset(board, 0, sizeof(*board));
    self.time_known = self.time_known || json_object_get_boolean(known);
    board->armed =
        armed_says(status) || update_armed(&self.update, ran ? &kept : NULL, status != NULL,
                                           unattended, self.reason[0] != '\0');
    return status;
}

static bool write_record(void)
{
    int result = update_write_record(DATA, &self.record);

    complain("what worked before the update can't be kept", result);
    return result == 0;
}

/* Adds the channels on the air to the record; false: it has them already. */
static bool take_channels(struct json_object *status)
{
    unsigned channels = self.record.channels | update_channels_on_air(status);

    if (status == NULL || (self.record.channels_known && channels == self.record.channels)) {
        return false;
    }
    self.record.channels_known = true;
    self.record.channels = channels;
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
static bool configuration_changed(void)
{
    char before[UPDATE_IDENTITY_SIZE];

    snprintf(before, sizeof(before), "%s", self.configuration);
    identify_configuration(self.configuration);
    return before[0] != '\0' && self.configuration[0] != '\0' &&
           strcmp(before, self.configuration) != 0;
}

/* What the bundle called it; where that isn't known, what it calls itself. */
static const char *offered_version(void)
{
    return self.record.to[0] != '\0' ? self.record.to : self.version;
}

/* A stick whose bundle is newer than what is in it would be installed at every start. */
static void compare_versions(struct update_board *board)
{
    if (strcmp(offered_version(), self.version) != 0) {
        board->well = false;
        snprintf(board->complaint, sizeof(board->complaint),
                 "It calls itself version %s: the bundle has to be built again.", self.version);
    }
}

/* Of what worked before. In a trial settings may be saved, and keys taken away. */
static void ask_no_more_for_what_was_switched_off(struct json_object *status)
{
    struct stat keys;

    if (self.configured_anew) {
        unsigned disabled = update_channels_disabled(status);

        self.expectation.channels &= ~disabled;
        if ((disabled & 1U << CHANNEL_WIFI) != 0) {
            update_services_forget(&self.expectation.wanted, "hostapd");
        }
    }
    if (stat(SSH_KEYS, &keys) < 0 || keys.st_size == 0) {
        update_services_forget(&self.expectation.wanted, "dropbear");
    }
}

static void look(struct update_board *board, int64_t now_us)
{
    struct json_object *status = ask(board);

    if (self.update.state == UPDATE_TRIAL) {
        struct update_services services;

        update_services_read(&services, SERVICES);
        if (!self.record.channels_known) {
            self.expectation.channels = update_channels_required(status);
        }
        if (configuration_changed()) {
            self.configured_anew = true;
            update_try(&self.update, self.version, now_us);
        }
        ask_no_more_for_what_was_switched_off(status);
        update_judge(&self.expectation, status, &services, board);
        compare_versions(board);
    } else if (self.update.state == UPDATE_INSTALLING && take_channels(status)) {
        write_record(); /* a channel that wasn't up yet when the install began */
    }
    json_object_put(status);
}

/* ---- what is done ---- */

static void end_installer(void)
{
    int result = update_installer_end(INSTALLER);

    complain("SWUpdate can't be ended", result);
    self.ended = self.ended || result == 0;
}

/* A server whose update this wasn't would close the one that waits there. */
static enum update_report report(enum update_report what)
{
    return self.record.from_server ? what : UPDATE_REPORT_NOTHING;
}

static void commit(int64_t now_us)
{
    struct update_variables variables = {.slot = self.running};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &variables, report(UPDATE_REPORT_GOOD));

    if (result < 0) { /* tried again in a second */
        complain("the slot can't be committed", result);
        return;
    }
    self.variables = variables;
    keep(UPDATE_INSTALLED, self.version, "Version %s is installed.", self.version);
    update_committed(&self.update, now_us);
    if (update_hawkbit_is_asked()) { /* its client reports when it starts */
        end_installer();
    }
}

static void keep_reason(void)
{
    keep(UPDATE_BACK, offered_version(), "Version %s was rolled back: %s", offered_version(),
         self.reason);
    self.overwritten = false;
}

static void give_up(int64_t now_us)
{
    struct update_variables variables = {.slot = self.other, .trial_failed = self.running};
    int result =
        update_variables_write(ENVIRONMENT_CONFIG, &variables, report(UPDATE_REPORT_FAILED));

    if (result < 0) {
        complain("the slot can't be given up", result);
        return;
    }
    self.variables = variables;
    update_rolled_back(&self.update, now_us);
}

static void roll_back(int64_t now_us)
{
    snprintf(self.reason, sizeof(self.reason), "%s", self.update.sentence);
    if (strcmp(offered_version(), self.version) != 0) {
        give_up(now_us); /* first: was_given_up knows it by its own name only */
    }
    keep_reason(); /* before that: power may fail now (was_given_up) */
    give_up(now_us);
}

static void restart_board(void)
{
    struct update_board board;

    if (self.overwritten) {
        keep_reason();
    }
    if (access(MAINTENANCE, F_OK) == 0) {
        complain("maintenance can't be kept over the restart",
                 whole_file_replace(MAINTENANCE_AGAIN, "", 0, 0644));
    }
    sync(); /* which takes its time: nobody may have armed meanwhile */
    json_object_put(ask(&board));
    if (board.armed) {
        unlink(MAINTENANCE_AGAIN); /* else it would open at some later power-on */
        log_info("update: the aircraft is armed: the restart waits");
        return;
    }
    log_info("update: the board restarts");
    kill(1, SIGTERM); /* init's order to restart */
}

/* A technician's isn't, and no server is left alone for it. */
static bool may_be_its_server_s(void)
{
    return self.source != UPDATE_SOURCE_OTHER;
}

static void act(int64_t now_us)
{
    struct update_board board;
    enum update_state before = self.update.state;

    look(&board, now_us);
    switch (update_tick(&self.update, &board, now_us)) {
    case UPDATE_STOP:
        /* Also when it was called off: its server, which doesn't know, would begin again. */
        if (!self.stopping && may_be_its_server_s() &&
            (self.update.slow || self.update.called_off)) {
            update_hawkbit_pause(now_us);
        }
        self.stopping = true; /* it may take its time */
        end_installer();
        break;
    case UPDATE_COMMIT:
        commit(now_us);
        break;
    case UPDATE_ROLL_BACK:
        roll_back(now_us);
        break;
    case UPDATE_REBOOT:
        restart_board();
        break;
    default:
        break;
    }
    if (self.update.state != before) {
        show();
    }
}

static void on_tick(void *context, int64_t now_us)
{
    (void)context;
    if (self.update.state != UPDATE_IDLE) {
        act(now_us);
    }
    loop_arm(&self.tick, now_us + SECOND_US);
}

/* ---- what SWUpdate does ---- */

static bool undecided(void)
{
    return self.update.state == UPDATE_WAITING || self.update.state == UPDATE_TRIAL;
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
        update_begins(&self.update, now_us);
        show();
    }
}

static void on_source(enum update_source source)
{
    self.source = source;
}

/* Is it beside another update still? When that was decided meanwhile, it is the one that counts. */
static bool is_beside(int64_t now_us)
{
    if (self.beside && !undecided()) {
        on_begins(now_us);
    }
    return self.beside;
}

/* The gate is passed, and nothing is written yet that counts. */
static void begin_record(void)
{
    struct update_board board;
    struct json_object *status = ask(&board);

    memset(&self.record, 0, sizeof(self.record));
    self.record.slot = self.other;
    self.record.from_server = self.source == UPDATE_SOURCE_SERVER;
    self.record.unattended = self.unattended;
    snprintf(self.record.from, sizeof(self.record.from), "%s", self.version);
    snprintf(self.record.to, sizeof(self.record.to), "%s", self.update.version);
    take_channels(status);
    identify_configuration(self.record.configuration);
    update_services_read(&self.record.services, SERVICES);
    json_object_put(status);
    if (!write_record()) {
        /* Without a record its trial would pass for one that was given up (was_given_up). */
        complain("that its version was rolled back before can't be forgotten",
                 update_forget_back(DATA, self.record.to));
    }
}

static void on_progress(int percent, int64_t now_us)
{
    if (is_beside(now_us) || !self.passed) {
        return;
    }
    if (self.update.state == UPDATE_CHECKING) {
        begin_record();
    }
    if (self.update.state != UPDATE_INSTALLING || percent != self.update.percent) {
        update_progress(&self.update, percent, now_us);
        show();
    }
}

static void refuse(const char *why, const char *to)
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
    keep(UPDATE_REFUSED, to, "The update was refused: %s", sentence);
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

    complain("the slot's mark can't be withdrawn",
             update_variables_write(ENVIRONMENT_CONFIG, &committed, UPDATE_REPORT_NOTHING));
}

/* SWUpdate marks the slot before it says so, and may fail or be ended between, or say that all went
 * well after a mere trial run: the mark counts, as it does for U-Boot. */
static void on_ends(const char *why, int64_t now_us)
{
    bool passed = self.passed, broke_off = passed && self.update.stopped == NULL;

    self.passed = self.stopping = false;
    if (is_beside(now_us)) {
        refuse(why, "");
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
        refuse(why[0] != '\0' ? why : "all went well, but nothing is marked to be started.",
               self.update.version);
        update_ended(&self.update, now_us);
    }
    show();
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

static void judge_offer(bool unattended, char answer[UPDATE_SENTENCE_SIZE])
{
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
        show();
    }
}

static void cancel(char answer[UPDATE_SENTENCE_SIZE])
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
    keep(UPDATE_BACK, self.record.to, "Version %s was rolled back: %s.",
         self.record.to[0] == '\0' ? "(not known)" : self.record.to, why);
}

/* No trial, no restarts: the slot that U-Boot has for the committed one stays that. */
static void settle(enum update_report report)
{
    struct update_variables settled = {.slot = self.variables.slot};
    int result = update_variables_write(ENVIRONMENT_CONFIG, &settled, report);

    complain("U-Boot's variables can't be settled", result);
}

/* Power may have failed between the reason and U-Boot's variables. */
static bool was_given_up(void)
{
    char version[UPDATE_VERSION_SIZE];

    whole_file_line(DATA "/" UPDATE_BACK_FILE, version, sizeof(version));
    return strcmp(version, self.version) == 0;
}

/* What the boot loader and an earlier process left behind. first: since power-on; later the
 * kernel's command line is an old story, and an install may be going on. */
static void resume(bool first, int64_t now_us)
{
    const struct update_variables *variables = &self.variables;
    bool recorded = update_read_record(DATA, &self.record) == 0;
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
            give_up(now_us);
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
        settle(recorded ? report(UPDATE_REPORT_FAILED) : UPDATE_REPORT_AS_IT_IS);
    } else {
        if (recorded && self.record.slot == self.running) {
            keep(UPDATE_INSTALLED, self.version, "Version %s is installed.", self.version);
        } else if (recorded && first) {
            protect_other(true);
            keep(UPDATE_REFUSED, self.record.to,
                 "The update was broken off, by power or a restart; nothing has changed.");
        }
        if (variables->restarts != 0) {
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

static bool start(bool first, int64_t now_us)
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
    show();
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

static int serve(void)
{
    static const struct update_installer_calls calls = {.begins = on_begins,
                                                        .source = on_source,
                                                        .progress = on_progress,
                                                        .ends = on_ends,
                                                        .lost = on_lost};
    static const struct update_gate_calls gate = {
        .known = is_known, .judge = judge_offer, .cancel = cancel};
    bool first = access(STATE "/" UPDATE_STATE_FILE, F_OK) < 0; /* since power-on */
    int result = loop_init();

    setenv("TMPDIR", "/run/swupdate", 0); /* where libswupdate looks for SWUpdate */
    if (result == 0) {
        result = loop_watch_signals(&self.signals, 0, on_signal, NULL);
    }
    if (result < 0) {
        log_error("can't begin: %s", strerror(-result));
        return EXIT_FAILURE;
    }
    if (!start(first, loop_now_us())) {
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
    return serve();
}
