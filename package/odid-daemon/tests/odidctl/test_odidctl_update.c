/* What becomes of a bundle that is handed over, and which of a stick's files is tried again: what
 * "odidctl update DIR" remembers. SWUpdate and the service update are models. (Giving one to the
 * real ones: tests/update.) */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <fcntl.h>

#define ipc_inst_start_ext model_start
#define ipc_end model_end
#define open(...) model_open(__VA_ARGS__)
#define armed_not_disarmed model_not_disarmed

int model_open(const char *name, int flags);

#include "odidctl/odidctl_update.c"
#undef open
#include "own_folder.h"

/* ---- the models ---- */

static bool armed, busy, takes, slow;
static char info[512]; /* of the request */
static unsigned started;

static void put(const char *path, const char *text)
{
    assert_int_equal(whole_file_replace(path, text, strlen(text), 0644), 0);
}

static void is_now(const char *state)
{
    char text[64];

    snprintf(text, sizeof(text), "{ \"state\": \"%s\" }\n", state);
    put("run/odid-appliance/" UPDATE_STATE_FILE, text);
}

static void end_as(const char *outcome)
{
    char text[96];

    snprintf(text, sizeof(text), "{ \"outcome\": \"%s\", \"sentence\": \"It is.\" }\n", outcome);
    put("data/" UPDATE_RESULT_FILE, text);
}

/* It refuses what it is given before it has read it, unless it takes it. */
int model_start(void *request, ssize_t size)
{
    const struct swupdate_request *given = request;

    assert_int_equal(size, sizeof(*given));
    assert_int_equal(given->len, strlen(given->info));
    strcpy(info, given->info);
    started++;
    if (busy) {
        return -1;
    }
    if (takes) {
        is_now("waiting-for-reboot");
        return open("/dev/null", O_WRONLY | O_CLOEXEC);
    }
    is_now("idle");
    end_as("refused");
    return open("/dev/null", O_WRONLY | O_CLOEXEC);
}

/* A slow stick: meanwhile somebody else's is refused. */
int model_open(const char *name, int flags)
{
    if (slow) {
        end_as("refused");
    }
    return open(name, flags);
}

void model_end(int installer)
{
    close(installer);
}

const char *model_not_disarmed(const struct places *places)
{
    (void)places;
    return armed ? "The aircraft is armed" : NULL;
}

/* ---- tests ---- */

static struct places places;

/* A file of that many octets is offered; written at one and the same time, or it would be another.
 */
static bool is_left_alone(unsigned octets, char identity[UPDATE_IDENTITY_SIZE])
{
    static const struct timespec written[2] = {{.tv_sec = 1}, {.tv_sec = 1}};
    static char text[32];

    assert_int_equal(whole_file_replace("stick/odid.swu", text, octets, 0644), 0);
    assert_int_equal(utimensat(AT_FDCWD, "stick/odid.swu", written, 0), 0);
    return is_tried_again(&places, "stick/odid.swu", identity);
}

static void switch_off_and_on(void)
{
    unlink("run/odid-appliance/" UPDATE_STICK_FAILURES_FILE);
}

/* Two of them took turns: each was forgotten for the other one, at each power-on. */
static void the_last_eight_files_that_came_to_nothing_are_left_alone(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    for (unsigned octets = 1; octets <= 9; octets++) {
        assert_false(is_left_alone(octets, identity));
        note_failure(&places, identity, &(struct attempt){.counts = true, .tried = true});
        switch_off_and_on();
    }
    for (unsigned octets = 9; octets >= 2; octets--) {
        assert_true(is_left_alone(octets, identity));
    }
    assert_false(is_left_alone(1, identity));
}

static void after_two_of_them_none_is_tried_until_power_off(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    for (unsigned octets = 11; octets <= 12; octets++) {
        assert_false(is_left_alone(octets, identity));
        note_failure(&places, identity, &(struct attempt){.counts = true, .tried = true});
    }
    assert_true(is_left_alone(13, identity));
    switch_off_and_on();
    assert_false(is_left_alone(13, identity));
}

/* Such a stick came again and again. */
static void one_that_is_refused_at_once_counts_until_power_off(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    switch_off_and_on();
    for (unsigned i = 0; i < 8; i++) { /* not what the bundle isn't to blame for */
        armed = i % 2 == 0;
        busy = !armed;
        assert_false(is_left_alone(21, identity));
        assert_int_not_equal(try_file(&places, "stick/odid.swu", "2", identity), ODIDCTL_GOOD);
    }
    armed = busy = false;
    for (unsigned i = 0; i < STICK_FAILURES_MAX; i++) {
        assert_false(is_left_alone(21, identity));
        assert_int_not_equal(try_file(&places, "stick/odid.swu", "2", identity), ODIDCTL_GOOD);
    }
    assert_true(is_left_alone(21, identity));
    assert_true(is_left_alone(22, identity));
    switch_off_and_on();
    assert_false(is_left_alone(21, identity));
}

/* Two took turns, each rolled back: of those that fail their trial only the last one is known. */
static void one_that_was_written_is_left_alone_whatever_becomes_of_it(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    takes = true;
    for (unsigned octets = 25; octets <= 26; octets++) {
        switch_off_and_on();
        is_now("idle");
        assert_false(is_left_alone(octets, identity));
        assert_int_equal(try_file(&places, "stick/odid.swu", "2", identity), ODIDCTL_GOOD);
    }
    takes = false;
    assert_true(is_left_alone(25, identity));
    assert_true(is_left_alone(26, identity));
    assert_false(is_left_alone(27, identity)); /* nor does it count as one that came to nothing */
}

static void the_request_says_that_nobody_asked_for_it(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    started = 0;
    is_left_alone(28, identity);
    try_file(&places, "stick/odid.swu", "2", identity);
    assert_string_equal(info, "unattended");
    install(&places, "stick/odid.swu", false, &(struct attempt){0}); /* a technician's */
    assert_string_equal(info, "");
    assert_int_equal(started, 2);
    try_file(&places, "stick/none.swu", "2", identity);
    assert_int_equal(started, 2);
    switch_off_and_on();
}

static void what_is_refused_while_a_stick_is_opened_is_another_s(void **state)
{
    char identity[UPDATE_IDENTITY_SIZE];

    (void)state;
    is_now("idle");
    is_left_alone(29, identity);
    takes = slow = true;
    assert_int_equal(try_file(&places, "stick/odid.swu", "2", identity), ODIDCTL_GOOD);
    takes = slow = false;
    is_now("idle");
}

/* "Version OLD is installed", it said of one that was given during OLD's trial, and that it failed;
 * or it didn't give the rest of it. */
static void what_becomes_of_a_trial_is_nothing_of_what_is_given_meanwhile(void **state)
{
    struct before before;

    (void)state;
    for (unsigned refused = 0; refused < 2; refused++) {
        is_now("trial");
        before = look_before(&places);
        end_as("installed");
        assert_int_equal(look_whether_over(&places, &before), -1);
        is_now("checking");
        assert_int_equal(look_whether_over(&places, &before), -1);
        if (refused) {
            end_as("refused");
            assert_int_equal(look_whether_over(&places, &before), -1); /* not shown yet */
            is_now("idle");
            assert_int_equal(look_whether_over(&places, &before), ODIDCTL_NOT_GOOD);
        } else {
            is_now("waiting-for-reboot");
            assert_int_equal(look_whether_over(&places, &before), ODIDCTL_GOOD);
        }
    }
}

/* The board waits for the restart into the slot before. */
static void nor_is_the_restart_that_ends_a_trial(void **state)
{
    struct before before;

    (void)state;
    is_now("trial");
    before = look_before(&places);
    end_as("rolled-back");
    is_now("waiting-for-reboot");
    assert_int_equal(look_whether_over(&places, &before), -1);
    end_as("refused");
    assert_int_equal(look_whether_over(&places, &before), ODIDCTL_NOT_GOOD);
}

static int in_a_folder(void **state)
{
    (void)state;
    places_under(&places, ".");
    return enter_own_folder() < 0 || system("mkdir -p data/odid run/odid-appliance stick") != 0 ? -1
                                                                                                : 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_request_says_that_nobody_asked_for_it),
        cmocka_unit_test(what_is_refused_while_a_stick_is_opened_is_another_s),
        cmocka_unit_test(what_becomes_of_a_trial_is_nothing_of_what_is_given_meanwhile),
        cmocka_unit_test(nor_is_the_restart_that_ends_a_trial),
        cmocka_unit_test(the_last_eight_files_that_came_to_nothing_are_left_alone),
        cmocka_unit_test(one_that_was_written_is_left_alone_whatever_becomes_of_it),
        cmocka_unit_test(one_that_is_refused_at_once_counts_until_power_off),
        cmocka_unit_test(after_two_of_them_none_is_tried_until_power_off),
    };

    return cmocka_run_group_tests(tests, in_a_folder, leave_own_folder);
}
