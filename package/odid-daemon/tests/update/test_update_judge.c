/* What counts in a trial, and what is kept of an update. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <json-c/json_tokener.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "update/update_files.h"
#include "update/update_installer.h"
#include "update/update_judge.h"

static char folder[] = "/tmp/odid-update-XXXXXX";

static int make_folder(void **state)
{
    (void)state;
    return mkdtemp(folder) == NULL ? -1 : 0;
}

static int remove_folder(void **state)
{
    char command[64];

    (void)state;
    snprintf(command, sizeof(command), "rm -r %s", folder);
    return system(command);
}

static void write_text(const char *name, const char *text)
{
    char path[200];
    FILE *file;

    snprintf(path, sizeof(path), "%s/%s", folder, name);
    for (char *slash = strchr(path + 1, '/'); slash != NULL; slash = strchr(slash + 1, '/')) {
        *slash = '\0';
        mkdir(path, 0755);
        *slash = '/';
    }
    file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    fclose(file);
}

static void expect_text(const char *name, const char *text)
{
    char path[200], got[2048] = "";
    FILE *file;

    snprintf(path, sizeof(path), "%s/%s", folder, name);
    file = fopen(path, "r");
    assert_non_null(file);
    got[fread(got, 1, sizeof(got) - 1, file)] = '\0';
    fclose(file);
    assert_string_equal(got, text);
}

/* ---- channels ---- */

static struct json_object *status(double uptime_s, const char *bt4, double bt4_confirmed_s)
{
    char text[1024];

    snprintf(text, sizeof(text),
             "{\"uptime_s\": %.2f, \"channels\": {"
             "\"bt4\": {\"state\": \"%s\", \"required\": true, \"confirmed_s\": %.2f},"
             "\"bt5\": {\"state\": \"unsupported\", \"required\": false, \"confirmed_s\": null},"
             "\"wifi\": {\"state\": \"on air\", \"required\": true, \"confirmed_s\": 0.10}}}",
             uptime_s, bt4, bt4_confirmed_s);
    return json_tokener_parse(text);
}

#define BT4 (1U << CHANNEL_BT4)
#define WIFI (1U << CHANNEL_WIFI)

static void channels_on_the_air_by_the_radios_own_word(void **state)
{
    struct json_object *object = status(30, "on air", 0.1);

    (void)state;
    assert_int_equal(update_channels_on_air(object), BT4 | WIFI);
    assert_int_equal(update_channels_required(object), BT4 | WIFI);
    json_object_put(object);

    object = status(30, "on air", 2.5); /* nothing was confirmed for long */
    assert_int_equal(update_channels_on_air(object), WIFI);
    json_object_put(object);

    /* Whoever kept Wi-Fi's channel busy had each version rolled back. */
    object = status(30, "lost", 60);
    json_object_object_add(
        json_object_object_get(json_object_object_get(object, "channels"), "bt4"), "silent",
        json_object_new_boolean(true));
    assert_int_equal(update_channels_on_air(object), BT4 | WIFI);
    json_object_put(object);

    object = status(30, "starting", 0.1);
    assert_int_equal(update_channels_on_air(object), WIFI);
    json_object_put(object);
    assert_int_equal(update_channels_on_air(NULL), 0);
    assert_int_equal(update_channels_required(NULL), 0);
}

static struct json_object *faults; /* the appliance's */

static int no_faults(void **state)
{
    (void)state;
    json_object_put(faults);
    faults = json_object_new_array();
    return 0;
}

static void add_fault(const char *name, const char *sentence)
{
    struct json_object *fault = json_object_new_object();

    json_object_object_add(fault, "name", json_object_new_string(name));
    json_object_object_add(fault, "sentence", json_object_new_string(sentence));
    json_object_array_add(faults, fault);
}

/* Judges, and puts the status back; the complaint, "" when all is well. */
static const char *judged(struct update_expectation *expectation, struct json_object *object)
{
    static struct update_board board;
    static const struct update_services none;

    memset(&board, 0, sizeof(board));
    update_judge(expectation, object, faults, &none, &board);
    json_object_put(object);
    assert_int_equal(board.well, board.complaint[0] == '\0');
    return board.complaint;
}

static void a_channel_that_worked_before_has_to_work(void **state)
{
    struct update_expectation expectation = {.channels = BT4};

    (void)state;
    assert_string_equal(judged(&expectation, status(30, "on air", 0.1)), "");
    assert_string_equal(judged(&expectation, status(31, "absent", 30)),
                        "Bluetooth 4 isn't on the air, as it was before the update: absent.");
    expectation.channels = WIFI; /* it never worked */
    assert_string_equal(judged(&expectation, status(32, "absent", 30)), "");
}

static void what_a_radio_lacks_it_has_to_have_lacked_before(void **state)
{
    struct update_expectation expectation = {.channels = BT4};

    (void)state;
    add_fault("watchdog", "There is none.");
    assert_int_equal(update_radio_faults(faults), 0);
    assert_string_equal(judged(&expectation, status(30, "on air", 0.1)), "");
    add_fault("country", "Not those of SE.");
    expectation.radio_faults = update_radio_faults(faults);
    assert_string_equal(judged(&expectation, status(31, "on air", 0.1)), "");
    add_fault("patch-hci0", "No file.");
    assert_string_equal(judged(&expectation, status(32, "on air", 0.1)),
                        "Not so before the update: No file.");
    expectation.radio_faults = 0;
    assert_string_equal(judged(&expectation, status(33, "on air", 0.1)),
                        "Not so before the update: Not those of SE.");
    expectation.radio_faults = update_radio_faults(faults);
    assert_string_equal(judged(&expectation, status(34, "on air", 0.1)), "");
}

static void the_daemon_has_to_stay(void **state)
{
    struct update_expectation expectation = {.channels = BT4};

    (void)state;
    assert_string_equal(judged(&expectation, status(30, "on air", 0.1)), "");
    assert_string_equal(judged(&expectation, status(1, "on air", 0.1)),
                        "The Remote ID daemon keeps ending.");
    assert_string_equal(judged(&expectation, status(2, "on air", 0.1)), "");
    assert_string_equal(judged(&expectation, NULL), "The Remote ID daemon doesn't answer.");
}

/* ---- services ---- */

static void services_that_ran_have_to_run(void **state)
{
    struct update_expectation expectation = {.channels = BT4};
    struct update_services now;
    struct update_board board = {0};
    struct json_object *object = status(30, "on air", 0.1);

    (void)state;
    write_text("service/hostapd/supervise/pid", "120\n");
    write_text("service/dropbear/supervise/pid", "");
    write_text("service/mavlink-router/supervise/pid", "130\n");
    write_text("service/udhcpd/supervise/pid", "140\n");
    write_text("service/udhcpd/down", "");
    write_text("service/.hidden/supervise/pid", "150\n");
    write_text("service/udhcpc-eth1/supervise/pid", "160\n"); /* goes with its adapter */
    write_text("service/udhcpc/supervise/pid", "165\n");      /* begins anew when one goes */
    write_text("service/udhcpd-gadget0/supervise/pid", "170\n");
    {
        char path[64];

        snprintf(path, sizeof(path), "%s/service", folder);
        update_services_read(&expectation.wanted, path);
        assert_int_equal(expectation.wanted.count, 2);
        assert_string_equal(expectation.wanted.service[0].name, "dropbear");
        assert_int_equal(expectation.wanted.service[0].pid, 0);
        assert_string_equal(expectation.wanted.service[1].name, "hostapd");
        assert_int_equal(expectation.wanted.service[1].pid, 120);
    }
    now = expectation.wanted;
    update_judge(&expectation, object, faults, &now, &board);
    assert_true(board.well);
    now.service[1].pid = 0;
    update_judge(&expectation, object, faults, &now, &board);
    assert_string_equal(board.complaint,
                        "The service hostapd doesn't run, as it did before the update.");
    now.service[1].pid = 200;
    update_judge(&expectation, object, faults, &now, &board);
    assert_true(board.well);
    now.service[1].pid = 201;
    update_judge(&expectation, object, faults, &now, &board);
    assert_string_equal(board.complaint, "The service hostapd keeps ending.");
    now.service[0].pid = 300; /* one that didn't run before may */
    update_judge(&expectation, object, faults, &now, &board);
    assert_true(board.well);
    now.count = 1; /* this version has no hostapd */
    update_judge(&expectation, object, faults, &now, &board);
    assert_true(board.well);
    json_object_put(object);
}

/* ---- files ---- */

static void the_state_as_the_page_reads_it(void **state)
{
    struct update update;

    (void)state;
    update_init(&update, 0);
    assert_int_equal(update_write_state(folder, &update), 0);
    expect_text("update-state.json",
                "{ \"state\": \"idle\", \"percent\": null, \"seconds_left\": null, "
                "\"sentence\": \"No update is going on.\" }\n");
    update_begins(&update, 0);
    update_version(&update, "1.2.0");
    update_progress(&update, 0, 0);
    update_progress(&update, 50, 10000000);
    assert_int_equal(update_write_state(folder, &update), 0);
    expect_text("update-state.json",
                "{ \"state\": \"installing\", \"percent\": 50, \"seconds_left\": 10, "
                "\"sentence\": \"Version 1.2.0 is being written.\" }\n");
    assert_int_equal(update_write_state("/nonexistent", &update), -ENOENT);
}

static void a_result(void **state)
{
    struct update_result result = {.outcome = UPDATE_BACK,
                                   .from = "1.0.0",
                                   .to = "1.2.0\xff\n",
                                   .from_server = true,
                                   .sentence = "Version 1.2.0 was rolled back: \"why\"."};

    (void)state;
    write_text("odid/x", "");
    assert_int_equal(update_write_result(folder, &result, 1800000000), 0);
    expect_text("odid/update.json",
                "{ \"time\": \"2027-01-15T08:00:00Z\", \"from\": \"1.0.0\", \"to\": \"1.2.0??\", "
                "\"outcome\": \"rolled-back\", "
                "\"sentence\": \"Version 1.2.0 was rolled back: \\\"why\\\".\", "
                "\"from_server\": true }\n");
    assert_true(update_result_is_server_s(folder));
    result = (struct update_result){.outcome = UPDATE_REFUSED, .from = "1.0.0", .sentence = "No."};
    assert_int_equal(update_write_result(folder, &result, 0), 0);
    expect_text("odid/update.json", "{ \"time\": null, \"from\": \"1.0.0\", \"to\": null, "
                                    "\"outcome\": \"refused\", \"sentence\": \"No.\", "
                                    "\"from_server\": false }\n");
    assert_false(update_result_is_server_s(folder));
    assert_false(update_result_is_server_s("/nonexistent"));
}

static void what_was_rolled_back_is_remembered_until_one_is_installed(void **state)
{
    struct update_result result = {.outcome = UPDATE_BACK, .from = "1.0.0", .to = "1.2.0"};
    char path[200];

    (void)state;
    write_text("odid/x", "");
    assert_int_equal(update_write_result(folder, &result, 0), 0);
    expect_text("odid/rolled-back", "1.2.0\n");
    result = (struct update_result){.outcome = UPDATE_REFUSED, .from = "1.0.0", .to = "1.3.0"};
    assert_int_equal(update_write_result(folder, &result, 0), 0);
    expect_text("odid/rolled-back", "1.2.0\n");
    result = (struct update_result){.outcome = UPDATE_INSTALLED, .from = "1.0.0", .to = "1.4.0"};
    snprintf(path, sizeof(path), "%s/odid/rolled-back", folder);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(update_write_result(folder, &result, 0), 0);
        assert_int_equal(access(path, F_OK), -1);
    }
}

static void a_record_over_the_restart(void **state)
{
    struct update_record in = {.slot = 'b',
                               .from = "1.0.0",
                               .to = "1.2.0",
                               .from_server = true,
                               .unattended = true,
                               .channels_known = true,
                               .channels = BT4 | WIFI,
                               .radio_faults = 2},
                         out;

    (void)state;
    in.services.count = 2;
    strcpy(in.services.service[0].name, "hostapd");
    in.services.service[0].pid = 120;
    strcpy(in.services.service[1].name, "dropbear"); /* didn't run */
    write_text("odid/x", "");
    assert_int_equal(update_write_record(folder, &in), 0);
    assert_int_equal(update_read_record(folder, &out), 0);
    assert_int_equal(out.slot, 'b');
    assert_string_equal(out.from, "1.0.0");
    assert_string_equal(out.to, "1.2.0");
    assert_true(out.from_server);
    assert_true(out.unattended);
    assert_true(out.channels_known);
    assert_int_equal(out.channels, BT4 | WIFI);
    assert_int_equal(out.radio_faults, 2);
    assert_int_equal(out.services.count, 1);
    assert_string_equal(out.services.service[0].name, "hostapd");
    assert_int_not_equal(out.services.service[0].pid, 0);
    in.channels = 0; /* none was on the air; or nobody said so */
    for (int known = 0; known < 2; known++) {
        in.channels_known = known;
        assert_int_equal(update_write_record(folder, &in), 0);
        assert_int_equal(update_read_record(folder, &out), 0);
        assert_int_equal(out.channels_known, known);
        assert_int_equal(out.channels, 0);
    }
    assert_int_equal(update_remove_record(folder), 0);
    assert_int_equal(update_remove_record(folder), 0);
    assert_int_equal(update_read_record(folder, &out), -ENOENT);
    write_text("odid/trial.json", "{\"slot\": \"c\"}");
    assert_int_equal(update_read_record(folder, &out), -EBADMSG);
    write_text("odid/trial.json", "\0");
    assert_int_equal(update_read_record(folder, &out), -EBADMSG);
}

/* Whose a stick's was it didn't say, nor what a radio lacked. */
static void a_record_of_an_older_version(void **state)
{
    struct update_record out;

    (void)state;
    write_text("odid/trial.json", "{\"slot\": \"b\", \"from_server\": false}");
    assert_int_equal(update_read_record(folder, &out), 0);
    assert_false(out.from_server);
    assert_false(out.unattended);
    write_text("odid/trial.json", "{\"slot\": \"b\"}");
    assert_int_equal(update_read_record(folder, &out), 0);
    assert_true(out.from_server);
    assert_false(out.unattended);
    assert_int_equal(out.radio_faults, ~0U);
}

/* ---- complaints ---- */

static void what_swupdate_says_in_plain_words(void **state)
{
    static const struct {
        const char *complaint, *sentence;
    } cases[] = {
        {"Signature verification failed",
         "It isn't signed by a key that this aircraft trusts, or was altered."},
        {"SW not compatible with hardware", "It is for other hardware than this board, odid-cm4."},
        {"HASH mismatch : abc <--> def",
         "It is damaged: what was written isn't what its maker signed."},
        {"ERROR : Checksum WRONG ! Computed 0xfd8b, it should be 0xfd8c",
         "It is damaged: something in it was changed on its way."},
        {"ERROR : Server delivered empty 'update', skipping..",
         "It was called off at the server while it was written."},
        {"something new", "The installer says: something new"},
        {"", "The installer says: nothing"},
    };
    char sentence[UPDATE_SENTENCE_SIZE];

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        update_installer_explain(cases[i].complaint, "odid-cm4", sentence, sizeof(sentence));
        assert_string_equal(sentence, cases[i].sentence);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(channels_on_the_air_by_the_radios_own_word),
        cmocka_unit_test_setup(a_channel_that_worked_before_has_to_work, no_faults),
        cmocka_unit_test_setup(what_a_radio_lacks_it_has_to_have_lacked_before, no_faults),
        cmocka_unit_test_setup(the_daemon_has_to_stay, no_faults),
        cmocka_unit_test_setup(services_that_ran_have_to_run, no_faults),
        cmocka_unit_test(the_state_as_the_page_reads_it),
        cmocka_unit_test(a_result),
        cmocka_unit_test(what_was_rolled_back_is_remembered_until_one_is_installed),
        cmocka_unit_test(a_record_over_the_restart),
        cmocka_unit_test(a_record_of_an_older_version),
        cmocka_unit_test(what_swupdate_says_in_plain_words),
    };

    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
