/* odid-update as a whole, between two of its steps: the real program; its places in a folder of
 * their own; U-Boot's variables, slots, SWUpdate, the daemon and init as models. (The booted
 * appliance has the real ones: tests/update.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <json-c/json_object.h>
#include <json-c/json_tokener.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "own_folder.h"

#define ROOT "." /* update_places.h */

int odid_update_main(int argc, char *argv[]);
static int model_kill(pid_t process, int signal);
static int model_syncfs(int fd);

#define kill model_kill
#define status_fetch model_fetch
#define update_gate_serve model_gate_serve
#define update_gate_ask model_gate_ask
#define syncfs model_syncfs
#define update_write_result model_write_result
#define update_write_record model_write_record
#define main odid_update_main
#include "update/service_kept.c"
#include "update/service_resume.c"
#include "update/service_trial.c"

#include "update/odid_update_main.c"
#include "update/update_hawkbit.c"
#undef main
#undef kill
#undef syncfs
#undef update_write_result
#undef update_write_record

int update_write_result(const char *data, const struct update_result *result, time_t time);
int update_write_record(const char *data, const struct update_record *record);

/* ---- the models ---- */

static struct {
    struct update_variables variables;
    bool writable, spoilt; /* the other slot */
    bool full;             /* /data, but for what the record takes */
    bool no_record;        /* nor is there room for that */
    bool armed, arms_while_flushing;
    bool silent;              /* the daemon never answered since power-on */
    bool switched_off;        /* the autopilot, disarmed */
    bool died;                /* the daemon, after it had said so */
    const char *bt5;          /* its state; Bluetooth 4 is on the air */
    const char *wifi;         /* likewise; NULL: absent */
    bool lost;                /* both copies of U-Boot's environment are */
    char report;              /* to hawkBit's server */
    bool unattended;          /* nobody asked for what SWUpdate installs */
    unsigned restarts, ended; /* init was told to restart; SWUpdate was ended */
} board;

static int model_kill(pid_t process, int signal)
{
    assert_int_equal(process, 1);
    assert_int_equal(signal, SIGTERM);
    board.restarts++;
    return 0;
}

static int model_syncfs(int fd)
{
    assert_true(fd >= 0);
    board.armed = board.armed || board.arms_while_flushing;
    return 0;
}

bool update_environment_find(const char *link, const char *found, const char *config, char *problem,
                             size_t size)
{
    (void)link, (void)found, (void)config, (void)problem, (void)size;
    return true;
}

int update_variables_read(const char *config, const char *defaults, char running,
                          struct update_variables *variables, bool *repaired)
{
    (void)config, (void)defaults;
    if (board.lost) { /* the built-in ones */
        board.variables = (struct update_variables){.slot = running};
    }
    *variables = board.variables;
    *repaired = board.lost;
    return 0;
}

int update_variables_write(const char *config, const struct update_variables *variables,
                           enum update_report report)
{
    (void)config;
    board.report = report == UPDATE_REPORT_AS_IT_IS ? board.report : (char)report;
    board.variables = *variables;
    return 0;
}

int model_write_result(const char *data, const struct update_result *result, time_t time)
{
    return board.full && access(DATA "/" UPDATE_RECORD_FILE, F_OK) == 0
               ? -ENOSPC
               : update_write_result(data, result, time);
}

int model_write_record(const char *data, const struct update_record *record)
{
    return board.no_record ? -ENOSPC : update_write_record(data, record);
}

bool update_slot_protect(char slot, bool protect)
{
    (void)slot;
    board.writable = !protect;
    return true;
}

bool update_slot_is_writable(char slot)
{
    (void)slot;
    return board.writable;
}

void update_slot_spoil(char slot)
{
    (void)slot;
    board.spoilt = true;
}

void update_installer_watch(const struct update_installer_calls *calls, bool first)
{
    (void)calls, (void)first;
}

bool update_installer_is_unattended(int64_t now)
{
    (void)now;
    return board.unattended;
}

int update_installer_end(const char *pid_file)
{
    (void)pid_file;
    board.ended++;
    return 0;
}

void update_installer_explain(const char *complaint, const char *hardware, char *out, size_t size)
{
    (void)hardware;
    snprintf(out, size, "%s", complaint);
}

int model_gate_serve(const char *directory, const struct update_gate_calls *calls)
{
    (void)directory, (void)calls;
    return 0;
}

int model_gate_ask(const char *directory, const char *question, char answer[UPDATE_SENTENCE_SIZE])
{
    (void)directory, (void)question, (void)answer;
    return -1;
}

void update_question_answer(const struct update_question *question,
                            char answer[UPDATE_SENTENCE_SIZE])
{
    board.variables.unverified = board.no_record ? question->other : '\0';
    board.writable = true;
    answer[0] = '\0'; /* nothing speaks against it */
}

struct json_object *model_fetch(const char *run_dir, int *error)
{
    char text[512];

    (void)run_dir, (void)error;
    if (board.silent || board.died) {
        return NULL;
    }
    snprintf(text, sizeof(text),
             "{\"aircraft\":{\"armed\":%s},\"uptime_s\":100,\"channels\":{"
             "\"bt4\":{\"state\":\"on air\",\"confirmed_s\":0.1,\"required\":true},"
             "\"bt5\":{\"state\":\"%s\",\"confirmed_s\":0.1,\"required\":true},"
             "\"wifi\":{\"state\":\"%s\",\"confirmed_s\":0.1,\"required\":false}}}",
             board.armed ? "true" : "false", board.bt5, board.wifi == NULL ? "absent" : board.wifi);
    return json_tokener_parse(text);
}

int kept_read(const char *directory, struct kept *kept)
{
    (void)directory;
    memset(kept, 0, sizeof(*kept));
    kept->armed = board.armed ? KEPT_ARMED : board.switched_off ? KEPT_SILENT : KEPT_DISARMED;
    return board.silent ? -ENOENT : 0;
}

/* ---- how it begins ---- */

static int64_t now_us;
static char answer[UPDATE_SENTENCE_SIZE];

static void put(const char *path, const char *text)
{
    assert_int_equal(whole_file_replace(path, text, strlen(text), 0644), 0);
}

/* A process of it: the first one since power-on, or one that runsv started again. */
static void begin(bool first)
{
    memset(&self, 0, sizeof(self));
    assert_true(start_service(first, now_us));
    update_hawkbit_begin(nothing_goes_on, end_installer, now_us);
}

static void pass(unsigned seconds)
{
    for (; seconds > 0; seconds--) {
        on_tick(NULL, now_us += SECOND_US);
    }
}

static void slot_a_runs_1_0_0(void)
{
    board.variables = (struct update_variables){.slot = 'a'};
    put(STATE "/slot", "a\n");
    put(VERSION_FILE, "1.0.0\n");
    begin(true);
}

/* A bundle of 1.1.0 is given, passes the gate, and is written. */
static void given(enum update_source source, bool unattended)
{
    put(DESCRIPTION, "version = \"1.1.0\";\nhardware-compatibility: [ \"odid-cm4\" ];\n"
                     "slot-octets = \"9\";\n");
    on_begins(now_us);
    on_source(source);
    board.unattended = unattended;
    judge_offer(answer);
    assert_string_equal(answer, "");
    assert_string_equal(self.update.version, "1.1.0"); /* the one that was signed */
    on_progress(50, now_us);
    assert_int_equal(self.update.state, UPDATE_INSTALLING);
}

static void written_from(enum update_source source)
{
    given(source, false);
}

static void written(void)
{
    written_from(UPDATE_SOURCE_OTHER);
}

static void mark(void)
{
    board.variables.slot = 'a';
    board.variables.trial = 'b';
    board.variables.trial_failed = '\0';
    board.variables.upgrade_available = true;
}

/* All that was on the air in slot a is, at first. */
static void slot_b_is_on_trial_from(enum update_source source)
{
    board.bt5 = "on air";
    slot_a_runs_1_0_0();
    written_from(source);
    mark();
    on_ends("", now_us);
    put(STATE "/slot", "b\n");
    put(VERSION_FILE, "1.1.0\n");
    begin(true);
}

static void slot_b_is_on_trial(void)
{
    slot_b_is_on_trial_from(UPDATE_SOURCE_OTHER);
}

static void it_is_kept(bool kept)
{
    pass(70);
    assert_int_equal(board.variables.trial_failed, kept ? '\0' : 'b');
    assert_int_equal(board.variables.slot, kept ? 'b' : 'a');
}

static int setup(void **state)
{
    (void)state;
    memset(&board, 0, sizeof(board));
    board.bt5 = "absent";
    now_us = 100 * SECOND_US;
    assert_int_equal(system("rm -rf data run && mkdir -p data/odid data/ssh etc/odid run/faults "
                            "run/odid-appliance run/swupdate"),
                     0);
    return 0;
}

static int in_a_folder(void **state)
{
    (void)state;
    return enter_own_folder() < 0 || loop_init() < 0 ? -1 : 0;
}

/* ---- tests ---- */

/* U-Boot starts slot a by its built-in variables. */
static void slot_a_starts_without_the_environment(const char *version)
{
    put(STATE "/slot", "a\n");
    put(VERSION_FILE, version);
    board.lost = true;
    begin(true);
    board.lost = false;
}

/* For slot a, while slot b runs 1.0.0. */
static void an_update_was_begun(void)
{
    board.bt5 = "on air";
    board.variables = (struct update_variables){.slot = 'b'};
    put(STATE "/slot", "b\n");
    put(VERSION_FILE, "1.0.0\n");
    begin(true);
    written();
}

/* Slot b's 1.1.0 was kept, and U-Boot's built-in variables have slot a: an older version ran, and
 * nobody said so. */
static void that_the_environment_was_lost_is_told(void **state)
{
    char said[300] = "";

    (void)state;
    slot_b_is_on_trial();
    it_is_kept(true);
    slot_a_starts_without_the_environment("1.0.0\n");
    begin(false);
    pass(5);
    whole_file_line(FAULTS "/environment-lost", said, sizeof(said));
    assert_non_null(strstr(said, "Version 1.0.0 runs: if another one was installed last"));
    assert_int_equal(board.variables.slot, 'a');
}

/* It isn't in slot a for long, where U-Boot's built-in variables start it again. */
static void a_version_that_failed_is_given_up_again(void **state)
{
    (void)state;
    board.bt5 = "on air";
    put(DATA "/" UPDATE_BACK_FILE, "1.1.0\n");
    put(STATE "/slot", "a\n");
    put(VERSION_FILE, "1.1.0\n");
    board.lost = true;
    begin(true);
    pass(70);
    assert_int_equal(board.variables.slot, 'b');
    assert_true(board.restarts > 0);
}

/* A version that was in slot a for its trial was kept untried. */
static void one_on_trial_whose_mark_was_lost_is_tried(void **state)
{
    (void)state;
    for (unsigned good = 0; good < 2; good++) {
        setup(NULL);
        an_update_was_begun();
        board.bt5 = good ? "on air" : "hangs";
        slot_a_starts_without_the_environment("1.1.0\n");
        assert_int_equal(self.update.state, UPDATE_TRIAL);
        assert_int_equal(board.variables.trial, 'a'); /* also for a start that comes meanwhile */
        pass(200);
        assert_int_equal(board.variables.slot, good ? 'a' : 'b');
        assert_int_equal(board.variables.trial_failed, good ? '\0' : 'a');
    }
}

/* What power broke off before the first octet was written: there is still what was in that slot. */
static void what_was_never_written_is_not_tried(void **state)
{
    (void)state;
    an_update_was_begun();
    slot_a_starts_without_the_environment("0.9.0\n");
    assert_int_equal(self.update.state, UPDATE_IDLE);
    assert_int_equal(board.variables.trial, '\0');
}

static void what_is_written_is_started_when_disarmed(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    written();
    mark();
    on_ends("", now_us);
    board.armed = true;
    pass(60);
    assert_int_equal(board.restarts, 0);
    board.armed = false;
    pass(10);
    assert_true(board.restarts > 0);
}

/* Whose update it is also an odid-update knows that was started again; and where nobody could write
 * it down, it is as if nobody were there. */
static void nobody_restarts_an_aircraft_that_fell_silent(bool unattended, bool recorded, bool again)
{
    slot_a_runs_1_0_0();
    board.no_record = !recorded;
    given(UPDATE_SOURCE_OTHER, unattended);
    mark();
    on_ends("", now_us);
    board.switched_off = true;
    if (again) {
        begin(false);
    }
    pass(60);
    assert_int_equal(board.restarts > 0, !unattended && (recorded || !again));
    board.switched_off = false;
    pass(10);
    assert_true(board.restarts > 0);
}

static void a_stick_s_update_is_not_started_on_an_old_disarmed(void **state)
{
    for (unsigned which = 0; which < 8; which++) {
        setup(state);
        nobody_restarts_an_aircraft_that_fell_silent((which & 1) != 0, (which & 2) != 0,
                                                     (which & 4) != 0);
    }
}

/* Else its server begins again at once; and not before it has been told. */
static void after_one_that_broke_off_hawkbit_is_left_alone(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    written_from(UPDATE_SOURCE_SERVER);
    on_ends("", now_us); /* nobody asks a server */
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1);
    put(HAWKBIT, "-u https://updates.example.org\n");
    for (int64_t minutes = 10; minutes <= 320; minutes *= 2) {
        int64_t pause_us = (minutes < 160 ? minutes : 160) * 60 * SECOND_US;

        assert_true(hawkbit.pause_us == pause_us);
        written_from(UPDATE_SOURCE_SERVER);
        on_ends("", now_us);
        assert_int_equal(access(HAWKBIT_PAUSE, F_OK), 0);
        assert_true(hawkbit.pause.deadline_us == now_us + pause_us);
        assert_true(update_hawkbit_reports(now_us));
        assert_false(update_hawkbit_reports(now_us + REPORT_US));
        end_pause(NULL, now_us += pause_us);
        assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1);
        hawkbit.reporting_until_us = 0; /* the gate goes by the real clock */
    }
    written_from(UPDATE_SOURCE_SERVER);
    mark();
    on_ends("", now_us);
    assert_true(hawkbit.pause_us == PAUSE_US);
}

/* As one that passes the gate isn't: what isn't even a bundle. */
static void came_to_nothing(enum update_source source)
{
    on_begins(now_us);
    on_source(source);
    on_ends("Image invalid", now_us += SECOND_US);
}

/* Garbage, again and again: it was being checked without end, and nobody else's came in. */
static void a_server_that_offers_garbage_is_left_alone(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    put(HAWKBIT, "-u https://updates.example.org\n");
    for (unsigned i = 0; i < 5; i++) { /* a technician's */
        came_to_nothing(UPDATE_SOURCE_OTHER);
    }
    came_to_nothing(UPDATE_SOURCE_SERVER);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1); /* once may be */
    came_to_nothing(UPDATE_SOURCE_SERVER);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), 0);
    assert_true(update_hawkbit_reports(now_us));
    assert_true(hawkbit.pause_us == 2 * PAUSE_US);
    came_to_nothing(UPDATE_SOURCE_SERVER); /* of the same visit */
    assert_true(hawkbit.pause_us == 2 * PAUSE_US);
}

static void swupdate_ends(bool installing)
{
    if (installing) {
        on_ends("SWUpdate ended", now_us);
    }
    on_lost(installing, now_us);
}

/* A process of it that came while SWUpdate writes didn't hold what it wrote: the aircraft might be
 * armed, and was, and what got on was ended as if it stood still. */
static void what_is_being_written_is_taken_up_by_the_next_process(void **state)
{
    (void)state;
    board.bt5 = "on air";
    slot_a_runs_1_0_0();
    written();
    begin(false);
    on_begins(now_us); /* as it is told again */
    on_source(UPDATE_SOURCE_OTHER);
    for (int percent = 51; percent < 100; percent++) {
        on_progress(percent, now_us);
        pass(1);
        assert_int_equal(access(UPDATING, F_OK), 0);
        assert_int_equal(board.ended, 0);
    }
    assert_string_equal(self.update.version, "1.1.0");
    board.armed = true;
    pass(2);
    assert_true(board.ended > 0);
}

/* Anybody can, every 20 s: it was "checking" for ever. */
static void one_that_is_begun_again_and_again_is_ended(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    on_begins(now_us);
    pass(20);
    on_begins(now_us);
    pass(9);
    assert_int_equal(board.ended, 0);
    pass(2);
    assert_true(board.ended > 0);
    on_begins(now_us); /* that it is called off stays said */
    assert_non_null(self.update.stopped);
    swupdate_ends(true);
    assert_int_equal(self.update.state, UPDATE_IDLE);
}

/* Its stick stands still: nobody was told that it keeps the others out, nor could call it off. */
static void one_that_began_in_a_trial_is_watched_when_that_is_over(void **state)
{
    for (unsigned called_off = 0; called_off < 2; called_off++) {
        setup(state);
        slot_b_is_on_trial();
        on_begins(now_us);
        on_source(UPDATE_SOURCE_OTHER);
        pass(21);
        assert_int_equal(board.variables.slot, 'b');
        assert_int_equal(self.update.state, UPDATE_CHECKING);
        put(HAWKBIT, "-u https://updates.example.org\n");
        if (called_off) {
            call_off(answer);
            assert_string_equal(answer, "");
        } else {
            pass(31);
        }
        assert_true(board.ended > 0);
        assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1); /* it is no server's still */
        swupdate_ends(true);
        pass(60);
        assert_int_equal(self.update.state, UPDATE_IDLE); /* nothing is beside anything now */
    }
}

/* Who gave it was told that SWUpdate ended. */
static void a_server_is_told_of_its_update_when_no_other_one_comes_in(void **state)
{
    for (unsigned given_meanwhile = 0; given_meanwhile < 2; given_meanwhile++) {
        setup(state);
        slot_b_is_on_trial_from(UPDATE_SOURCE_SERVER);
        put(HAWKBIT, "-u https://updates.example.org\n");
        begin(true);
        if (given_meanwhile) {
            on_begins(now_us);
            on_source(UPDATE_SOURCE_OTHER);
        }
        pass(25);
        assert_int_equal(board.variables.slot, 'b');
        assert_int_equal(board.report, UPDATE_REPORT_GOOD);
        assert_int_equal(board.ended, !given_meanwhile);
        if (given_meanwhile) {
            assert_int_equal(self.update.state, UPDATE_CHECKING);
            on_ends("HASH mismatch", now_us);
        }
        pass(5);
        assert_int_equal(board.ended, 1);
        assert_int_equal(board.report, UPDATE_REPORT_GOOD);
    }
}

/* Before the trial is over. */
static void one_that_was_refused_in_a_trial_is_over(void **state)
{
    (void)state;
    slot_b_is_on_trial();
    on_begins(now_us);
    on_ends("refused", now_us);
    it_is_kept(true);
    assert_int_equal(board.ended, 0);
    assert_int_equal(self.update.state, UPDATE_IDLE);
}

static void one_that_comes_after_a_pretended_one_is_installed(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    for (unsigned ended = 0; ended < 2; ended++) {
        on_begins(now_us);
        on_source(UPDATE_SOURCE_UNKNOWN);
        pass(20);
        if (ended) {
            pass(20);
            swupdate_ends(true);
        }
        written_from(UPDATE_SOURCE_SERVER);
        assert_true(self.record.from_server);
        mark();
        on_ends("", now_us);
        assert_int_equal(self.update.state, UPDATE_WAITING);
        setup(state);
        slot_a_runs_1_0_0();
    }
}

static void one_that_is_called_off_before_the_gate_is_not_begun_again(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    put(HAWKBIT, "-u https://updates.example.org\n");
    on_begins(now_us);
    on_source(UPDATE_SOURCE_SERVER);
    call_off(answer);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), 0);
}

/* Slow, called off or broken off: no server has to do with it. */
static void for_a_technician_s_file_no_server_is_left_alone(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    put(HAWKBIT, "-u https://updates.example.org\n");
    on_begins(now_us);
    on_source(UPDATE_SOURCE_OTHER);
    pass(40);
    assert_true(self.update.slow);
    on_ends("SWUpdate ended", now_us);
    written();
    call_off(answer);
    on_ends("SWUpdate ended", now_us);
    written();
    on_ends("HASH mismatch", now_us);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1);
}

/* hawkBit is left alone, and who looks for the reason is told. */
static void it_is_said_that_swupdate_ended(const char *how)
{
    char said[300];

    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), 0);
    whole_file_line(FAULTS "/hawkbit-server", said, sizeof(said));
    assert_non_null(strstr(said, how));
    assert_non_null(strstr(said, "https://updates.example.org"));
    assert_non_null(strstr(said, "for 10 minutes"));
}

static void slot_a_runs_1_0_0_and_asks_a_server(void)
{
    put(CONFIGURATION, "[update]\nhawkbit_url = https://updates.example.org\n");
    put(HAWKBIT, "-u https://updates.example.org\n");
    slot_a_runs_1_0_0();
}

/* Its client aborts over it, at each start; and so no bundle came in. */
static void a_server_that_ends_swupdate_is_left_alone(void **state)
{
    (void)state;
    slot_a_runs_1_0_0(); /* nobody asks a server */
    for (unsigned i = 0; i < 5; i++) {
        now_us += SECOND_US;
        swupdate_ends(false);
    }
    slot_a_runs_1_0_0_and_asks_a_server();
    for (unsigned i = 0; i < 5; i++) {
        now_us += LOST_QUIET_US;
        swupdate_ends(false);
    }
    now_us += 31 * SECOND_US;
    swupdate_ends(false);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1);
    now_us += LOST_QUIET_US - SECOND_US;
    swupdate_ends(false);
    it_is_said_that_swupdate_ended("three times");
    swupdate_ends(false); /* without it that has another reason */
    assert_true(hawkbit.pause_us == 2 * PAUSE_US);
    end_pause(NULL, now_us += PAUSE_US);
    assert_int_equal(access(FAULTS "/hawkbit-server", F_OK), -1);
}

/* Every half minute, and a bundle takes longer. */
static void a_server_that_breaks_off_another_s_update_is_left_alone(void **state)
{
    (void)state;
    slot_a_runs_1_0_0_and_asks_a_server();
    written();
    swupdate_ends(true);
    it_is_said_that_swupdate_ended("in the middle of another's update");
}

/* Another file says how its server is asked. */
static void settings_of_its_server_s_count_when_no_update_is_going_on(void **state)
{
    (void)state;
    slot_a_runs_1_0_0_and_asks_a_server();
    pass(5);
    assert_int_equal(board.ended, 0);
    update_hawkbit_pause(now_us); /* the old one's: the new one is asked at once */
    written();
    assert_int_equal(rename(HAWKBIT, "old"), 0); /* another file has another number */
    put(HAWKBIT, "-u https://elsewhere.example.org\n");
    pass(5);
    assert_int_equal(board.ended, 0);
    on_ends("HASH mismatch", now_us);
    pass(1);
    assert_int_equal(board.ended, 1);
    swupdate_ends(false);
    pass(5);
    assert_int_equal(board.ended, 1);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1);
    assert_true(hawkbit.pause_us == PAUSE_US && hawkbit.lost == 0);
}

/* By us. */
static void an_end_of_swupdate_that_somebody_meant_says_nothing_of_its_server(void **state)
{
    (void)state;
    slot_a_runs_1_0_0_and_asks_a_server();
    for (unsigned i = 0; i < 5; i++) {
        end_installer();
        swupdate_ends(false);
    }
    written();
    call_off(answer);
    swupdate_ends(true);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), -1);
    written();
    swupdate_ends(true);
    assert_int_equal(access(HAWKBIT_PAUSE, F_OK), 0);
}

/* The new version stops it, and nobody has asked for that. */
static void a_channel_that_ends_with_the_new_version_ends_its_trial(void **state)
{
    (void)state;
    put(CONFIGURATION, "");
    slot_b_is_on_trial();
    board.bt5 = "disabled";
    pass(70);
    assert_int_equal(board.variables.trial_failed, 'b');
    assert_int_equal(board.variables.slot, 'a');
}

/* Somebody has saved that setting: in the trial, or between the writing and the restart. */
static void a_channel_that_is_switched_off_is_not_asked_for(void **state)
{
    for (unsigned restarted = 0; restarted < 2; restarted++) {
        setup(state);
        put(CONFIGURATION, "");
        slot_b_is_on_trial();
        if (!restarted) {
            pass(5);
        }
        put(CONFIGURATION, "[broadcast]\nbt5_enabled = false\n");
        if (restarted) {
            begin(true);
        }
        board.bt5 = "disabled";
        pass(70);
        assert_int_equal(board.variables.trial_failed, '\0');
        assert_int_equal(board.variables.slot, 'b');
    }
}

static void a_service_runs(const char *name, const char *pid)
{
    char path[64];

    snprintf(path, sizeof(path), "mkdir -p " SERVICES "/%s/supervise", name);
    assert_int_equal(system(path), 0);
    snprintf(path, sizeof(path), SERVICES "/%s/supervise/pid", name);
    put(path, pid);
}

/* On trial, and hostapd and dropbear ran before. */
static void slot_b_is_on_trial_with_services(void)
{
    a_service_runs("hostapd", "120\n");
    a_service_runs("odid-beacons", "125\n");
    a_service_runs("dropbear", "130\n");
    put(CONFIGURATION, "");
    put(SSH_KEYS, "ssh-ed25519 AAAA\n");
    board.wifi = "on air";
    slot_b_is_on_trial();
}

/* Between the writing and the restart, or in the trial. */
static void wifi_is_switched_off_and_its_services_are_not_asked_for(void **state)
{
    for (unsigned restarted = 0; restarted < 2; restarted++) {
        setup(state);
        slot_b_is_on_trial_with_services();
        if (!restarted) {
            pass(5);
        }
        put(CONFIGURATION, "[broadcast]\nwifi_beacon_enabled = false\n");
        if (restarted) {
            begin(true);
        }
        board.wifi = "disabled";
        a_service_runs("hostapd", "");
        a_service_runs("odid-beacons", "");
        it_is_kept(true);
    }
    setup(state); /* what nobody has switched off is */
    slot_b_is_on_trial_with_services();
    a_service_runs("hostapd", "");
    it_is_kept(false);
}

/* Then dropbear waits for one. */
static void the_keys_are_taken_away_and_ssh_is_not_asked_for(void **state)
{
    setup(state);
    slot_b_is_on_trial_with_services();
    assert_int_equal(unlink(SSH_KEYS), 0);
    a_service_runs("dropbear", "");
    it_is_kept(true);

    setup(state);
    slot_b_is_on_trial_with_services();
    put(SSH_KEYS, "");
    a_service_runs("dropbear", "");
    it_is_kept(true);

    setup(state);
    slot_b_is_on_trial_with_services();
    a_service_runs("dropbear", "");
    it_is_kept(false);
}

/* Which transmits all the same, by other rules than before or without its patch. */
static void one_whose_radio_lacks_something_is_rolled_back(void **state)
{
    (void)state;
    slot_b_is_on_trial();
    put(FAULTS "/country", "The radio rules in force are those of \"00\".\n");
    it_is_kept(false);
    assert_string_equal(self.reason,
                        "Not so before the update: The radio rules in force are those of \"00\".");
}

static void one_whose_radio_lacked_it_before_is_kept(void **state)
{
    (void)state;
    put(FAULTS "/country", "The radio rules in force are those of \"00\".\n");
    slot_b_is_on_trial();
    it_is_kept(true);
}

/* Its stick would offer it again at every start, as newer than what runs. */
static void what_is_not_the_version_that_was_offered_is_rolled_back(void **state)
{
    char back[32];

    (void)state;
    slot_b_is_on_trial();
    put(VERSION_FILE, "0.9.0\n");
    begin(true);
    pass(70);
    assert_int_equal(board.variables.trial_failed, 'b');
    assert_string_equal(self.reason,
                        "It calls itself version 0.9.0: the bundle has to be built again.");
    whole_file_line(DATA "/" UPDATE_BACK_FILE, back, sizeof(back));
    assert_string_equal(back, "1.1.0"); /* for the stick */
}

/* The fault that says it ends with the restart. */
static void a_rolled_back_one_is_remembered_where_data_is_full(void **state)
{
    char back[32];

    (void)state;
    slot_b_is_on_trial();
    board.bt5 = "absent";
    board.full = true;
    pass(70);
    assert_int_equal(board.variables.trial_failed, 'b');
    whole_file_line(DATA "/" UPDATE_BACK_FILE, back, sizeof(back));
    assert_string_equal(back, "1.1.0");
    assert_int_equal(access(DATA "/" UPDATE_RESULT_FILE, F_OK), 0);
}

/* Whose update it wasn't, that server closed the one that was waiting there. */
static void a_server_is_told_of_its_own_updates_only(void **state)
{
    for (unsigned source = UPDATE_SOURCE_UNKNOWN; source <= UPDATE_SOURCE_OTHER; source++) {
        bool told = source == UPDATE_SOURCE_SERVER;

        setup(state);
        slot_b_is_on_trial_from(source);
        pass(30);
        assert_int_equal(board.report, told ? UPDATE_REPORT_GOOD : UPDATE_REPORT_NOTHING);

        setup(state);
        slot_b_is_on_trial_from(source);
        board.bt5 = "absent";
        pass(70);
        assert_int_equal(board.report, told ? UPDATE_REPORT_FAILED : UPDATE_REPORT_NOTHING);
        put(STATE "/slot", "a\n"); /* and the board has started the one before */
        put(VERSION_FILE, "1.0.0\n");
        begin(true);
        assert_int_equal(board.report, told ? UPDATE_REPORT_FAILED : UPDATE_REPORT_NOTHING);

        setup(state); /* U-Boot has given it up */
        slot_b_is_on_trial_from(source);
        board.variables = (struct update_variables){.slot = 'a', .trial_failed = 'b'};
        put(STATE "/slot", "a\n");
        put(VERSION_FILE, "1.0.0\n");
        begin(true);
        assert_int_equal(board.report, told ? UPDATE_REPORT_FAILED : UPDATE_REPORT_NOTHING);
    }
}

/* A failed trial, armed before the restart; odid-update ends, and is started again. */
static void a_failed_trial_stays_failed_over_its_own_restart(void **state)
{
    (void)state;
    slot_b_is_on_trial();
    board.bt5 = "absent";
    for (unsigned i = 0; i < 62; i++) {
        pass(1);
        board.armed = i >= 59;
    }
    assert_int_equal(board.variables.slot, 'a');
    assert_int_equal(board.variables.trial_failed, 'b');
    begin(false);
    assert_int_equal(self.update.state, UPDATE_WAITING);
    assert_int_equal(access(UPDATING, F_OK), 0); /* do not arm */
    assert_int_equal(board.variables.slot, 'a');
    assert_int_equal(board.variables.trial_failed, 'b');
    pass(10);
    assert_int_equal(board.restarts, 0);
    board.armed = false;
    pass(60);
    assert_true(board.restarts > 0);
    assert_int_equal(board.variables.slot, 'a');
    assert_false(board.spoilt);
}

/* Its reason is kept, and power fails before U-Boot's variables are written. */
static void power_fails_in_a_roll_back(void)
{
    board.silent = true;
    pass(70);
    assert_true(board.restarts > 0);
    mark();
    board.report = '1'; /* as SWUpdate left it */
    board.restarts = 0;
    begin(true);
}

/* Whether the daemon answers or not: it may be what failed. */
static void a_roll_back_goes_on_after_a_power_cut(void **state)
{
    for (unsigned source = UPDATE_SOURCE_SERVER; source <= UPDATE_SOURCE_OTHER; source++) {
        setup(state);
        slot_b_is_on_trial_from(source);
        power_fails_in_a_roll_back();
        assert_int_equal(board.variables.slot, 'a');
        assert_int_equal(board.variables.trial_failed, 'b');
        assert_int_equal(board.report, source == UPDATE_SOURCE_SERVER ? UPDATE_REPORT_FAILED
                                                                      : UPDATE_REPORT_NOTHING);
        pass(60);
        assert_true(board.restarts > 0);
    }
}

/* Whether it is still disarmed nobody can say: it is given up, and started no more; but the board
 * isn't restarted for it. */
static void a_version_whose_daemon_dies_is_given_up_for_the_next_start(void **state)
{
    (void)state;
    slot_b_is_on_trial();
    pass(1);
    board.died = true;
    pass(120);
    assert_int_equal(board.variables.slot, 'a');
    assert_int_equal(board.variables.trial_failed, 'b');
    assert_int_equal(board.restarts, 0);
    begin(false);
    pass(60);
    assert_int_equal(board.restarts, 0);
    board.died = false;
    pass(10);
    assert_true(board.restarts > 0);
}

/* Without a record it passed for one whose roll-back a power cut had broken off. */
static void one_that_was_rolled_back_has_its_trial_when_it_is_given_again(void **state)
{
    for (unsigned recorded = 0; recorded < 2; recorded++) {
        setup(state);
        put(DATA "/" UPDATE_BACK_FILE, "1.1.0\n");
        board.no_record = !recorded;
        slot_b_is_on_trial();
        it_is_kept(true);
    }
    setup(state); /* another version's */
    put(DATA "/" UPDATE_BACK_FILE, "1.0.9\n");
    board.no_record = true;
    slot_b_is_on_trial();
    assert_int_equal(access(DATA "/" UPDATE_BACK_FILE, F_OK), 0);
}

/* In its last second, and SWUpdate marks the slot before it is ended. */
static void what_was_called_off_is_not_started(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    written();
    call_off(answer);
    assert_string_equal(answer, "");
    assert_int_equal(board.ended, 1); /* at once */
    mark();
    on_ends("SWUpdate ended", now_us);
    assert_int_equal(board.variables.slot, 'a');
    assert_false(board.variables.upgrade_available);
    assert_true(board.spoilt);
    pass(60);
    assert_int_equal(board.restarts, 0);
    assert_int_equal(self.update.state, UPDATE_IDLE);
}

/* Where /data kept no record, what nobody had verified could be started for good. */
static void what_power_broke_off_is_taken_away(void **state)
{
    for (unsigned recorded = 0; recorded < 2; recorded++) {
        setup(state);
        slot_a_runs_1_0_0();
        board.no_record = !recorded;
        written();
        begin(false); /* SWUpdate writes on */
        assert_false(board.spoilt);
        assert_int_equal(board.variables.unverified, recorded ? '\0' : 'b');
        begin(true);
        assert_true(board.spoilt);
        assert_false(board.writable);
        assert_int_equal(board.variables.unverified, '\0');
        assert_int_equal(board.variables.slot, 'a');
        board.spoilt = false;
        begin(true);
        assert_false(board.spoilt);
    }
}

static void what_was_written_to_its_end_is_not_taken_away(void **state)
{
    (void)state;
    board.bt5 = "on air";
    slot_a_runs_1_0_0();
    board.no_record = true;
    written();
    mark(); /* and power fails, before SWUpdate has said so */
    begin(true);
    assert_int_equal(self.update.state, UPDATE_WAITING);
    put(STATE "/slot", "b\n");
    put(VERSION_FILE, "1.1.0\n");
    begin(true);
    it_is_kept(true);
    assert_int_equal(board.variables.unverified, '\0');
    board.variables.unverified = 'b'; /* a version without that mark has left it */
    put(STATE "/slot", "a\n");
    begin(true); /* the committed one was restarted three times */
    assert_false(board.spoilt);
    assert_int_equal(board.variables.slot, 'b');
    assert_int_equal(board.variables.unverified, '\0');
}

/* Power failed between the commit and the record, and the committed one was restarted three times:
 * its head was overwritten. */
static void a_committed_slot_whose_record_stayed_is_not_taken_away(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    written();
    mark();
    board.variables = (struct update_variables){.slot = 'b'};
    begin(true);
    assert_false(board.spoilt);
    assert_int_equal(board.variables.slot, 'b');
}

/* /data had turned read-only before the record of the update to b could go. */
static void a_record_stayed_and_slot_a_runs_1_2_0(void)
{
    slot_b_is_on_trial();
    put(STATE "/slot", "a\n");
    put(VERSION_FILE, "1.2.0\n");
}

/* Each later one was rolled back: "It calls itself version 1.2.0". */
static void a_record_that_stayed_says_nothing_of_a_later_trial(void **state)
{
    (void)state;
    a_record_stayed_and_slot_a_runs_1_2_0();
    board.variables =
        (struct update_variables){.slot = 'b', .trial = 'a', .upgrade_available = true};
    begin(true);
    pass(70);
    assert_int_equal(board.variables.trial_failed, '\0');
    assert_int_equal(board.variables.slot, 'a');
}

/* Nor where it went to the same slot: no record of the later one could be kept. */
static void nor_does_one_of_the_same_slot(void **state)
{
    (void)state;
    slot_b_is_on_trial();
    put(VERSION_FILE, "1.3.0\n");
    board.variables = (struct update_variables){
        .slot = 'a', .trial = 'b', .upgrade_available = true, .unverified = 'b'};
    begin(true);
    it_is_kept(true);
}

/* The slot to fall back to was overwritten. */
static void a_record_that_stayed_takes_no_other_slot_away(void **state)
{
    (void)state;
    a_record_stayed_and_slot_a_runs_1_2_0();
    board.variables = (struct update_variables){.slot = 'a'};
    begin(true);
    assert_false(board.spoilt);
}

static void the_disk_is_late(void)
{
    assert_int_equal(rename("data", "disk"), 0);
    assert_int_equal(system("mkdir -p data/odid"), 0);
    put(IN_MEMORY, "");
}

static void the_disk_comes(void)
{
    assert_int_equal(system("rm -r data " IN_MEMORY " && mv disk data"), 0);
}

/* A worn disk answered late: nobody knew what was kept had taken the place of, and its server
 * wasn't told. What was set there may not be in force yet: it isn't missed. */
static void a_trial_takes_the_record_that_comes_late(void **state)
{
    (void)state;
    board.wifi = "on air";
    slot_b_is_on_trial_from(UPDATE_SOURCE_SERVER);
    the_disk_is_late();
    board.wifi = NULL;
    begin(true);
    pass(10);
    assert_int_equal(self.update.state, UPDATE_TRIAL);
    the_disk_comes();
    it_is_kept(true);
    assert_string_equal(self.record.from, "1.0.0");
    assert_int_equal(board.report, UPDATE_REPORT_GOOD);
}

/* It was kept meanwhile: the record that comes then tries it no more. */
static void nor_is_one_that_was_kept_tried_again(void **state)
{
    (void)state;
    slot_b_is_on_trial();
    the_disk_is_late();
    begin(true);
    it_is_kept(true);
    the_disk_comes();
    pass(10);
    assert_int_equal(self.update.state, UPDATE_IDLE);
    assert_int_equal(board.variables.slot, 'b');
}

static void what_was_called_off_before_the_gate_is_not_written(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    on_begins(now_us);
    call_off(answer);
    assert_string_equal(answer, "");
    judge_offer(answer);
    assert_non_null(strstr(answer, "called off"));
    assert_false(board.writable);
}

static void who_arms_while_it_flushes_is_not_restarted(void **state)
{
    (void)state;
    slot_a_runs_1_0_0();
    written();
    mark();
    on_ends("", now_us);
    put(MAINTENANCE, "");
    board.arms_while_flushing = true;
    pass(30);
    assert_true(board.armed);
    assert_int_equal(board.restarts, 0);
    assert_int_equal(access(MAINTENANCE_AGAIN, F_OK), -1); /* nor is anything kept for it */
    board.armed = board.arms_while_flushing = false;
    pass(30);
    assert_true(board.restarts > 0);
    assert_int_equal(access(MAINTENANCE_AGAIN, F_OK), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(that_the_environment_was_lost_is_told, setup),
        cmocka_unit_test_setup(a_version_that_failed_is_given_up_again, setup),
        cmocka_unit_test(one_on_trial_whose_mark_was_lost_is_tried),
        cmocka_unit_test_setup(what_was_never_written_is_not_tried, setup),
        cmocka_unit_test_setup(what_is_written_is_started_when_disarmed, setup),
        cmocka_unit_test_setup(a_stick_s_update_is_not_started_on_an_old_disarmed, setup),
        cmocka_unit_test_setup(after_one_that_broke_off_hawkbit_is_left_alone, setup),
        cmocka_unit_test_setup(a_server_that_offers_garbage_is_left_alone, setup),
        cmocka_unit_test_setup(one_that_is_begun_again_and_again_is_ended, setup),
        cmocka_unit_test_setup(what_is_being_written_is_taken_up_by_the_next_process, setup),
        cmocka_unit_test_setup(one_that_began_in_a_trial_is_watched_when_that_is_over, setup),
        cmocka_unit_test_setup(a_server_is_told_of_its_update_when_no_other_one_comes_in, setup),
        cmocka_unit_test_setup(one_that_was_refused_in_a_trial_is_over, setup),
        cmocka_unit_test_setup(one_that_comes_after_a_pretended_one_is_installed, setup),
        cmocka_unit_test_setup(one_that_is_called_off_before_the_gate_is_not_begun_again, setup),
        cmocka_unit_test_setup(for_a_technician_s_file_no_server_is_left_alone, setup),
        cmocka_unit_test_setup(a_server_that_ends_swupdate_is_left_alone, setup),
        cmocka_unit_test_setup(a_server_that_breaks_off_another_s_update_is_left_alone, setup),
        cmocka_unit_test_setup(settings_of_its_server_s_count_when_no_update_is_going_on, setup),
        cmocka_unit_test_setup(an_end_of_swupdate_that_somebody_meant_says_nothing_of_its_server,
                               setup),
        cmocka_unit_test_setup(a_channel_that_ends_with_the_new_version_ends_its_trial, setup),
        cmocka_unit_test_setup(a_channel_that_is_switched_off_is_not_asked_for, setup),
        cmocka_unit_test_setup(wifi_is_switched_off_and_its_services_are_not_asked_for, setup),
        cmocka_unit_test_setup(the_keys_are_taken_away_and_ssh_is_not_asked_for, setup),
        cmocka_unit_test_setup(one_whose_radio_lacks_something_is_rolled_back, setup),
        cmocka_unit_test_setup(one_whose_radio_lacked_it_before_is_kept, setup),
        cmocka_unit_test_setup(what_is_not_the_version_that_was_offered_is_rolled_back, setup),
        cmocka_unit_test_setup(a_rolled_back_one_is_remembered_where_data_is_full, setup),
        cmocka_unit_test_setup(a_server_is_told_of_its_own_updates_only, setup),
        cmocka_unit_test_setup(a_failed_trial_stays_failed_over_its_own_restart, setup),
        cmocka_unit_test_setup(a_roll_back_goes_on_after_a_power_cut, setup),
        cmocka_unit_test_setup(a_version_whose_daemon_dies_is_given_up_for_the_next_start, setup),
        cmocka_unit_test_setup(one_that_was_rolled_back_has_its_trial_when_it_is_given_again,
                               setup),
        cmocka_unit_test_setup(what_was_called_off_is_not_started, setup),
        cmocka_unit_test_setup(what_power_broke_off_is_taken_away, setup),
        cmocka_unit_test_setup(a_committed_slot_whose_record_stayed_is_not_taken_away, setup),
        cmocka_unit_test_setup(a_record_that_stayed_says_nothing_of_a_later_trial, setup),
        cmocka_unit_test_setup(nor_does_one_of_the_same_slot, setup),
        cmocka_unit_test_setup(a_record_that_stayed_takes_no_other_slot_away, setup),
        cmocka_unit_test_setup(a_trial_takes_the_record_that_comes_late, setup),
        cmocka_unit_test_setup(nor_is_one_that_was_kept_tried_again, setup),
        cmocka_unit_test_setup(what_was_written_to_its_end_is_not_taken_away, setup),
        cmocka_unit_test_setup(what_was_called_off_before_the_gate_is_not_written, setup),
        cmocka_unit_test_setup(who_arms_while_it_flushes_is_not_restarted, setup),
    };

    return cmocka_run_group_tests_name("odid-update", tests, in_a_folder, leave_own_folder);
}
