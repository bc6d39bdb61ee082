/* What the gate is told of the board: its places in a folder of their own; the daemon, slots and
 * U-Boot's variables as models. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <json-c/json_tokener.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "own_folder.h"

#define ROOT "." /* update_places.h */

#define status_fetch model_fetch
#define kept_read model_kept
#define update_variables_read model_variables
#define update_variables_write model_write
#define update_slot_octets model_octets
#define update_slot_protect model_protect
#include "update/update_question.c"

/* ---- the models ---- */

static bool protected;
static struct update_variables stored; /* U-Boot's */
static char report_of_it;
static int fails; /* to be stored */

struct json_object *model_fetch(const char *run_dir, int *error)
{
    (void)run_dir, (void)error;
    return json_tokener_parse("{\"aircraft\":{\"armed\":false}}");
}

int model_kept(const char *directory, struct kept *kept)
{
    (void)directory;
    memset(kept, 0, sizeof(*kept));
    kept->armed = KEPT_DISARMED;
    return 0;
}

int model_variables(const char *config, const char *defaults, char running,
                    struct update_variables *variables, bool *repaired)
{
    (void)config, (void)defaults, (void)repaired;
    (void)running;
    *variables = stored;
    return 0;
}

int model_write(const char *config, const struct update_variables *variables,
                enum update_report report)
{
    (void)config;
    assert_true(protected); /* first the mark */
    stored = *variables;
    report_of_it = (char)report;
    return fails;
}

uint64_t model_octets(char slot)
{
    (void)slot;
    return 1 << 20;
}

bool model_protect(char slot, bool protect)
{
    (void)slot;
    protected = protect;
    return true;
}

/* ---- how it begins ---- */

static void put(const char *path, const char *text, size_t length)
{
    assert_int_equal(whole_file_replace(path, text, length, 0644), 0);
}

#define PUT(path, text) put(path, text, sizeof(text) - 1)

static void expect_answer(const char *part)
{
    static const struct update_question question = {
        .running = 'a', .other = 'b', .version = "1.1.0"};
    char answer[UPDATE_SENTENCE_SIZE];

    protected = true;
    update_question_answer(&question, answer);
    if (part[0] == '\0' ? answer[0] != '\0' : strstr(answer, part) == NULL) {
        fail_msg("\"%s\" isn't in: %s", part, answer);
    }
    assert_int_equal(protected, part[0] != '\0');
    assert_int_equal(access(TRIED, F_OK), -1); /* nothing is left of the question */
}

static void offer(const char *version)
{
    char text[200];

    snprintf(text, sizeof(text),
             "version = \"%s\";\nhardware-compatibility: [ \"odid-cm4\" ];\nslot-octets = \"9\";\n",
             version);
    put(DESCRIPTION, text, strlen(text));
}

static int in_a_folder(void **state)
{
    (void)state;
    return enter_own_folder() < 0 || system("mkdir -p data/odid run/faults run/odid "
                                            "run/odid-appliance run/swupdate") != 0
               ? -1
               : 0;
}

/* ---- tests ---- */

/* An older one was taken, whatever prevent_downgrade had been. */
static void an_older_one_is_refused_where_the_configuration_is_damaged_or_lost(void **state)
{
    (void)state;
    offer("1.0.0");
    PUT(CONFIGURATION, "; nothing\n");
    expect_answer("");
    PUT(CONFIGURATION, "[update]\nprevent_downgrade = yes\n");
    expect_answer("prevent_downgrade = yes");
    PUT(CONFIGURATION, "");
    expect_answer("can't be read");
    PUT(CONFIGURATION, "[update]\nprev\0\0\0\0");
    expect_answer("can't be read");
    PUT(CONFIGURATION, "[update]\nprev\xFF\xFF\xFF\xFF");
    expect_answer("can't be read");
    unlink(CONFIGURATION);
    expect_answer("can't be read");
    PUT(CONFIGURATION, "; what the boot has put there\n");
    PUT(FAULTS "/data", "/data is full.\n");
    expect_answer("");
    PUT(IN_MEMORY, "");
    expect_answer("was lost");
    PUT(IN_MEMORY, "copied\n");
    expect_answer("");
    PUT(FAULTS "/settings", "What was set in /data is lost.\n");
    expect_answer("was lost");
    offer("1.2.0");
    expect_answer("");
}

/* What power broke off stayed, startable. */
static void where_data_keeps_no_record_the_slot_is_marked_before_it_can_be_written_to(void **state)
{
    (void)state;
    offer("1.2.0");
    PUT(CONFIGURATION, "; nothing\n");
    unlink(FAULTS "/data");
    unlink(IN_MEMORY);
    stored = (struct update_variables){.slot = 'a', .restarts = 2};
    expect_answer("");
    assert_int_equal(stored.unverified, '\0'); /* its record does */
    PUT(FAULTS "/data", "/data was damaged, and was repaired.\n");
    expect_answer("");
    assert_int_equal(stored.unverified,
                     '\0'); /* the fault stands until power-off, and it is sound */
    PUT(IN_MEMORY, "copied\n");
    expect_answer("");
    assert_int_equal(stored.slot, 'a');
    assert_int_equal(stored.unverified, 'b');
    assert_int_equal(stored.restarts, 2);
    assert_int_equal(report_of_it, UPDATE_REPORT_AS_IT_IS);
    stored = (struct update_variables){.slot = 'b'}; /* it is damaged */
    expect_answer("");
    assert_int_equal(stored.slot, 'a');
    assert_int_equal(report_of_it, UPDATE_REPORT_NOTHING);
    stored.unverified = '\0';
    unlink(IN_MEMORY);
    stored = (struct update_variables){.slot = 'b'};
    expect_answer("");
    assert_int_equal(stored.slot, 'a');
    assert_int_equal(stored.unverified,
                     '\0');  /* or its trial would take the record for an earlier one's */
    stored.unverified = 'b'; /* of one that came to nothing */
    expect_answer("");
    assert_int_equal(stored.unverified, '\0');
    PUT(IN_MEMORY, "copied\n");
    offer("1.0.0");
    PUT(CONFIGURATION, "[update]\nprevent_downgrade = yes\n");
    expect_answer("prevent_downgrade = yes");
    assert_int_equal(stored.unverified, '\0');
    offer("1.2.0");
    fails = -EIO;
    expect_answer("can't be written");
    fails = 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_older_one_is_refused_where_the_configuration_is_damaged_or_lost),
        cmocka_unit_test(where_data_keeps_no_record_the_slot_is_marked_before_it_can_be_written_to),
    };

    return cmocka_run_group_tests(tests, in_a_folder, leave_own_folder);
}
