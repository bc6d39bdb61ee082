/* The course of an update, second by second. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "appliance/kept.h"
#include "update/update.h"

#define SECOND_US INT64_C(1000000)
#define WELL_S ((int)(UPDATE_WELL_US / SECOND_US))

static const struct update_board well = {.well = true};
static const struct update_board armed = {.armed = true, .well = true};
static const struct update_board ill = {.complaint = "Bluetooth 4 isn't on the air."};

static struct update update;
static int64_t now_us;

static int begin(void **state)
{
    (void)state;
    now_us = 100 * SECOND_US;
    update_init(&update, now_us);
    return 0;
}

/* Ticks each second for at most so long; the first wish, and how long it took in *after_s. */
static enum update_wish ticks(const struct update_board *board, int seconds, int *after_s)
{
    for (int i = 1; i <= seconds; i++) {
        enum update_wish wish;

        now_us += SECOND_US;
        wish = update_tick(&update, board, now_us);
        if (wish != UPDATE_NOTHING) {
            *after_s = i;
            return wish;
        }
    }
    *after_s = seconds;
    return UPDATE_NOTHING;
}

static void written(void)
{
    update_begins(&update, now_us);
    update_version(&update, "1.2.0");
    update_progress(&update, 0, now_us);
}

/* ---- install ---- */

static void nothing_is_done_without_an_update(void **state)
{
    int after_s;

    (void)state;
    assert_string_equal(update_state_name(update.state), "idle");
    assert_int_equal(ticks(&armed, 100, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&ill, 100, &after_s), UPDATE_NOTHING);
}

static void percent_and_what_is_left(void **state)
{
    (void)state;
    update_begins(&update, now_us);
    assert_string_equal(update_state_name(update.state), "checking");
    assert_int_equal(update.percent, -1);
    update_version(&update, "1.2.0");
    update_progress(&update, 0, now_us);
    assert_string_equal(update_state_name(update.state), "installing");
    assert_string_equal(update.sentence, "Version 1.2.0 is being written.");
    assert_int_equal(update.percent, 0);
    assert_int_equal(update.seconds_left, -1);
    update_progress(&update, 25, now_us + 5 * SECOND_US);
    assert_int_equal(update.percent, 25);
    assert_int_equal(update.seconds_left, 15);
    update_progress(&update, 100, now_us + 20 * SECOND_US);
    assert_int_equal(update.seconds_left, 0);
    /* U-Boot's variables come after the slot. */
    update_progress(&update, 0, now_us + 20 * SECOND_US);
    assert_int_equal(update.percent, 100);
    assert_int_equal(update.seconds_left, 0);
}

static void arming_stops_the_installer_until_it_has_ended(void **state)
{
    int after_s;

    (void)state;
    written();
    assert_int_equal(ticks(&well, 29, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&armed, 30, &after_s), UPDATE_STOP);
    assert_int_equal(after_s, 1);
    assert_non_null(update.stopped);
    assert_int_equal(ticks(&armed, 30, &after_s), UPDATE_STOP);
    assert_int_equal(ticks(&well, 30, &after_s), UPDATE_STOP); /* disarmed again */
    update_ended(&update, now_us);
    assert_int_equal(update.state, UPDATE_IDLE);
    update_begins(&update, now_us);
    assert_null(update.stopped);
}

/* Nothing is written; the gate refuses it and says why, also to a server, which would offer it
 * again. */
static void arming_leaves_what_is_checked_to_the_gate(void **state)
{
    int after_s;

    (void)state;
    update_begins(&update, now_us);
    assert_int_equal(ticks(&armed, 29, &after_s), UPDATE_NOTHING);
    update_progress(&update, 0, now_us); /* armed right after the gate */
    assert_int_equal(ticks(&armed, 30, &after_s), UPDATE_STOP);
    assert_int_equal(after_s, 1);
}

/* Twenty octets a second kept the aircraft at "do not fly: update in progress" without end. */
static void a_slow_server_is_not_waited_for(void **state)
{
    int after_s;

    (void)state;
    update_begins(&update, now_us);
    assert_int_equal(ticks(&well, 60, &after_s), UPDATE_STOP);
    assert_int_equal(after_s, 30);
    assert_true(update.slow);
    update_ended(&update, now_us);

    written();
    for (int percent = 0; percent < 20; percent++) {
        update_progress(&update, percent, now_us);
        assert_int_equal(ticks(&well, 29, &after_s), UPDATE_NOTHING);
    }
    update_progress(&update, 19, now_us); /* the same again is nothing new */
    assert_int_equal(ticks(&well, 29, &after_s), UPDATE_STOP);
    assert_int_equal(after_s, 1);
    update_ended(&update, now_us);

    written();
    for (int percent = 1; percent <= 21;
         percent++) { /* 28 s each: 10 minutes are over in the 22nd */
        update_progress(&update, percent, now_us);
        assert_int_equal(ticks(&well, 28, &after_s), UPDATE_NOTHING);
    }
    update_progress(&update, 22, now_us);
    assert_int_equal(ticks(&well, 28, &after_s), UPDATE_STOP);
    assert_int_equal(after_s, 12);
    assert_true(update.slow);
}

static void it_can_be_called_off_until_it_is_written(void **state)
{
    int after_s;

    (void)state;
    assert_false(update_cancel(&update));
    update_begins(&update, now_us);
    assert_true(update_cancel(&update));
    assert_int_equal(ticks(&well, 5, &after_s), UPDATE_STOP);
    assert_int_equal(after_s, 1);
    assert_string_equal(update.stopped, "It was called off; nothing has changed.");
    assert_false(update.slow);
    update_ended(&update, now_us);
    written();
    assert_true(update_cancel(&update));
    update_installed(&update, now_us); /* the mark was faster */
    assert_null(update.stopped);
    assert_false(update_cancel(&update));
}

static void who_does_not_answer_is_not_disarmed(void **state)
{
    const struct kept yes = {.armed = KEPT_ARMED}, no = {.armed = KEPT_DISARMED},
                      unheard = {.armed = KEPT_UNHEARD}, silent = {.armed = KEPT_SILENT},
                      awaited = {.armed = KEPT_AWAITED}, unsaid = {.armed = KEPT_UNSAID};

    (void)state;
    written();
    assert_true(update_armed(&update, &yes, true, false, false));
    assert_true(update_armed(&update, &yes, false, false, false));
    assert_false(update_armed(&update, &no, true, false, false));
    assert_false(update_armed(&update, &unheard, true, false, false));
    assert_false(
        update_armed(&update, &no, false, false, false)); /* it starts again: settings were saved */
    assert_true(update_armed(&update, NULL, false, false, false));
    /* But for the restart somebody has to know. */
    update_installed(&update, now_us);
    assert_false(update_armed(&update, &no, true, false, false));
    assert_true(update_armed(&update, &no, false, false, false));
    assert_true(update_armed(&update, NULL, false, false, false));
    assert_true(update_armed(&update, &unsaid, true, false, false));
    assert_false(update_armed(&update, &silent, true, false, false));
    assert_true(update_armed(&update, &silent, true, true, false)); /* nobody looks at it */
    assert_false(update_armed(&update, &awaited, true, false, false));
    assert_true(update_armed(&update, &awaited, true, true, false));
}

static void a_slot_whose_daemon_never_answers_is_given_up(void **state)
{
    const struct kept yes = {.armed = KEPT_ARMED}, unheard = {.armed = KEPT_UNHEARD},
                      awaited = {.armed = KEPT_AWAITED};

    (void)state;
    for (int unattended = 0; unattended < 2; unattended++) {
        update_try(&update, "1.5.0", now_us);
        assert_false(update_armed(&update, NULL, false, unattended, false));
        assert_false(update_armed(&update, &unheard, false, unattended, false));
        assert_true(update_armed(&update, &yes, false, unattended, false));
        update_rolled_back(&update, now_us); /* waits for the restart now */
        assert_false(update_armed(&update, NULL, false, unattended, true));
        assert_false(update_armed(&update, &unheard, false, unattended, true));
        assert_false(update_armed(&update, &awaited, false, unattended, true));
        assert_true(update_armed(&update, &yes, false, unattended, true));
    }
}

/* It is judged, and given up for the next start; but not restarted on an old word. */
static void the_restart_out_of_a_failed_trial_waits_for_a_disarmed_as_well(void **state)
{
    const struct kept no = {.armed = KEPT_DISARMED}, silent = {.armed = KEPT_SILENT},
                      unsaid = {.armed = KEPT_UNSAID};

    (void)state;
    update_try(&update, "1.5.0", now_us);
    assert_false(update_armed(&update, &no, false, false, false));
    assert_false(update_armed(&update, &unsaid, true, false, false));
    assert_false(update_armed(&update, &silent, true, true, false));
    update_rolled_back(&update, now_us);
    assert_true(update_armed(&update, &no, false, false, true));
    assert_true(update_armed(&update, &unsaid, true, false, true));
    assert_true(update_armed(&update, &silent, true, true, true));
    assert_true(update_armed(&update, &silent, false, false, true));
    assert_false(update_armed(&update, &no, true, false, true));
    assert_false(update_armed(&update, &silent, true, false, true));
}

static void the_restart_waits_until_disarmed(void **state)
{
    int after_s;

    (void)state;
    written();
    update_installed(&update, now_us);
    assert_string_equal(update_state_name(update.state), "waiting-for-reboot");
    assert_int_equal(ticks(&armed, 3600, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&well, 4, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&armed, 1, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&well, 30, &after_s), UPDATE_REBOOT);
    assert_int_equal(after_s, 5);
}

/* ---- trial ---- */

static void a_slot_that_is_well_for_long_enough_is_kept(void **state)
{
    int after_s;

    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_string_equal(update_state_name(update.state), "trial");
    assert_int_equal(ticks(&well, 100, &after_s), UPDATE_COMMIT);
    assert_int_equal(after_s, WELL_S);
    update_committed(&update, now_us);
    assert_int_equal(update.state, UPDATE_IDLE);
}

static void well_in_one_piece(void **state)
{
    int after_s;

    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_int_equal(ticks(&well, WELL_S - 1, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&ill, 1, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&well, 100, &after_s), UPDATE_COMMIT);
    assert_int_equal(after_s, WELL_S);
}

static void one_that_is_not_well_is_given_up_after_a_minute(void **state)
{
    int after_s;

    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_int_equal(ticks(&ill, 100, &after_s), UPDATE_ROLL_BACK);
    assert_int_equal(after_s, 60);
    assert_string_equal(update.sentence, ill.complaint);
    update_rolled_back(&update, now_us);
    assert_int_equal(update.state, UPDATE_WAITING);
    assert_int_equal(ticks(&armed, 100, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&ill, 100, &after_s), UPDATE_REBOOT);
    assert_int_equal(after_s, 5);
}

/* A service that is started again and again is there for a moment each time. */
static void one_that_is_well_in_the_last_moment_is_given_up_with_a_reason(void **state)
{
    int after_s;

    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_int_equal(ticks(&ill, 59, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&well, 1, &after_s), UPDATE_ROLL_BACK);
    assert_string_equal(update.sentence, ill.complaint);
}

static void the_trial_stands_still_while_armed(void **state)
{
    const struct update_board armed_and_ill = {.armed = true, .complaint = "x"};
    int after_s;

    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_int_equal(ticks(&well, WELL_S - 5, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&armed, 3600, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&well, 100, &after_s), UPDATE_COMMIT);
    assert_int_equal(after_s, 5);

    update_try(&update, "1.2.0", now_us);
    assert_int_equal(ticks(&ill, 55, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&armed_and_ill, 3600, &after_s), UPDATE_NOTHING);
    assert_int_equal(ticks(&ill, 100, &after_s), UPDATE_ROLL_BACK);
    assert_int_equal(after_s, 5);
}

static void a_board_that_stood_still_was_not_well_meanwhile(void **state)
{
    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_int_equal(update_tick(&update, &well, now_us + 30 * SECOND_US), UPDATE_NOTHING);
}

static void a_failed_commit_is_tried_again(void **state)
{
    int after_s;

    (void)state;
    update_try(&update, "1.2.0", now_us);
    assert_int_equal(ticks(&well, 100, &after_s), UPDATE_COMMIT);
    assert_int_equal(ticks(&well, 100, &after_s), UPDATE_COMMIT);
    assert_int_equal(after_s, 1);
}

/* ---- what the boot loader says ---- */

static void why_the_boot_loader_gave_it_up(void **state)
{
    static const struct {
        const char *reason, *fallback, *why;
    } cases[] = {
        {"three-restarts", "slot-b-failed-its-trial", "it didn't come up in three starts"},
        /* Power was cut before it could be said. */
        {"three-restarts", "", "it didn't come up in three starts"},
        {"too-many-starts", "slot-b-failed-its-trial", "it was started 20 times and never kept"},
        {"", "slot-b-kernel-refused", "slot b kernel refused"},
        {"", "", "it was given up"},
    };
    char why[100];

    (void)state;
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        update_explain_fallback(cases[i].reason, cases[i].fallback, why, sizeof(why));
        assert_string_equal(why, cases[i].why);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(nothing_is_done_without_an_update, begin),
        cmocka_unit_test_setup(percent_and_what_is_left, begin),
        cmocka_unit_test_setup(arming_stops_the_installer_until_it_has_ended, begin),
        cmocka_unit_test_setup(arming_leaves_what_is_checked_to_the_gate, begin),
        cmocka_unit_test_setup(a_slow_server_is_not_waited_for, begin),
        cmocka_unit_test_setup(it_can_be_called_off_until_it_is_written, begin),
        cmocka_unit_test_setup(who_does_not_answer_is_not_disarmed, begin),
        cmocka_unit_test_setup(a_slot_whose_daemon_never_answers_is_given_up, begin),
        cmocka_unit_test_setup(the_restart_out_of_a_failed_trial_waits_for_a_disarmed_as_well,
                               begin),
        cmocka_unit_test_setup(the_restart_waits_until_disarmed, begin),
        cmocka_unit_test_setup(a_slot_that_is_well_for_long_enough_is_kept, begin),
        cmocka_unit_test_setup(well_in_one_piece, begin),
        cmocka_unit_test_setup(one_that_is_not_well_is_given_up_after_a_minute, begin),
        cmocka_unit_test_setup(one_that_is_well_in_the_last_moment_is_given_up_with_a_reason,
                               begin),
        cmocka_unit_test_setup(the_trial_stands_still_while_armed, begin),
        cmocka_unit_test_setup(a_board_that_stood_still_was_not_well_meanwhile, begin),
        cmocka_unit_test_setup(a_failed_commit_is_tried_again, begin),
        cmocka_unit_test_setup(why_the_boot_loader_gave_it_up, begin),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
