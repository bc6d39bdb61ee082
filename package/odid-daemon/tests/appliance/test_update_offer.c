/* Which bundles are taken, from whom. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

#include "appliance/update_offer.h"

static struct update_offer offer;
static char why[UPDATE_SENTENCE_SIZE];

static int begin(void **state)
{
    (void)state;
    offer = (struct update_offer){
        .versions = {.offered = "1.10.0", .running = "1.9.0", .rolled_back = ""},
        .needed_octets = 10,
        .slot_octets = 10,
        .armed = ARMED_NO,
        .keeps_records = true,
        .remembers = true};
    why[0] = '\0';
    return 0;
}

static void assert_refused(const char *part)
{
    assert_false(update_offer_judge(&offer, why, sizeof(why)));
    if (strstr(why, part) == NULL) {
        fail_msg("\"%s\" isn't in: %s", part, why);
    }
}

static void assert_taken(void)
{
    if (!update_offer_judge(&offer, why, sizeof(why))) {
        fail_msg("%s", why);
    }
}

static void a_person_may_install_what_they_want(void **state)
{
    (void)state;
    assert_taken();
    offer.versions.offered = "1.9.0";
    assert_taken();
    offer.versions.offered = "1.2.0";
    assert_taken();
    offer.versions.rolled_back = "1.2.0";
    assert_taken();
    offer.versions.prevent_downgrade = true;
    assert_refused("1.2.0 is older than 1.9.0, which is running, and [update] prevent_downgrade");
    offer.versions.offered = "1.9.0";
    assert_taken();
}

static void nobody_knows_what_a_damaged_configuration_said(void **state)
{
    (void)state;
    offer.versions.unreadable = true;
    assert_taken();
    offer.versions.offered = "1.2.0";
    assert_refused("1.2.0 is older than 1.9.0, which is running, and the configuration can't be");
}

/* A stick that was forgotten brings nothing back, whatever its bundle is called. */
static void what_nobody_asked_for_is_newer_and_did_not_fail(void **state)
{
    (void)state;
    offer.versions.unattended = true;
    assert_taken();
    offer.versions.offered = "1.9.0";
    assert_refused("is running already");
    offer.versions.offered = "1.8.9";
    assert_refused("1.8.9 is older than 1.9.0");
    offer.versions.offered = offer.versions.rolled_back = "1.11.0";
    assert_refused("was rolled back before");
    offer.versions.offered = "1.11.1";
    assert_taken();
    offer.remembers = false;
    assert_refused("/data");
}

/* Its server wasn't told what came of it, and offered it again: installed without end. */
static void a_server_s_is_taken_only_where_its_outcome_can_be_kept(void **state)
{
    (void)state;
    offer.versions.from_server = true;
    assert_taken();
    offer.remembers = false;
    assert_refused("/data");
    offer.versions.from_server = false;
    assert_taken();
}

/* Its trial has no record then, and what was rolled back is given up without one. */
static void one_that_was_rolled_back_is_tried_again_where_data_can_be_written(void **state)
{
    (void)state;
    offer.versions.rolled_back = offer.versions.offered;
    assert_taken();
    offer.remembers = false; /* a disk that was mended: by now it takes a record */
    assert_taken();
    offer.keeps_records = false;
    assert_refused("/data");
    offer.versions.rolled_back = "1.8.0";
    assert_taken();
}

static void only_a_daemon_that_answers_says_disarmed(void **state)
{
    (void)state;
    offer.armed = ARMED_YES;
    assert_refused("is armed");
    offer.armed = ARMED_UNKNOWN;
    assert_refused("isn't known");
    offer.armed = ARMED_UNSAID;
    assert_refused("no HEARTBEAT");
}

/* It may have fallen silent on the ground, and fly. */
static void nothing_begins_by_itself_after_the_autopilot_fell_silent(void **state)
{
    (void)state;
    offer.armed = ARMED_SILENT;
    assert_taken();
    offer.versions.unattended = true;
    assert_refused("silent");
    offer.versions.unattended = false;
    offer.versions.from_server = true;
    assert_refused("silent");
}

/* A parameter had made it silent before, over a power-off, and in the air a server's update began.
 */
static void nor_while_one_is_silent_that_was_there_at_an_earlier_power_on(void **state)
{
    struct json_object *status = json_object_new_object();
    const struct kept awaited = {.armed = KEPT_AWAITED}, never = {.armed = KEPT_UNHEARD};

    (void)state;
    offer.versions.from_server = true;
    offer.armed = armed_by(status, &never);
    assert_taken();
    offer.armed = armed_by(status, &awaited);
    assert_refused("is silent");
    offer.versions.from_server = false;
    assert_taken();
    json_object_put(status);
}

static void one_update_at_a_time(void **state)
{
    (void)state;
    offer.undecided = true;
    assert_refused("Another update");
    offer.undecided = false;
    offer.given_up = true;
    assert_refused("failed its trial");
}

static void it_has_to_fit(void **state)
{
    (void)state;
    offer.needed_octets = 11;
    assert_refused("11 octets, and the slot has 10");
    offer.needed_octets = UINT64_MAX;
    assert_refused("octets");
    offer.slot_octets = 0;
    assert_refused("size of the slot");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_person_may_install_what_they_want, begin),
        cmocka_unit_test_setup(nobody_knows_what_a_damaged_configuration_said, begin),
        cmocka_unit_test_setup(what_nobody_asked_for_is_newer_and_did_not_fail, begin),
        cmocka_unit_test_setup(a_server_s_is_taken_only_where_its_outcome_can_be_kept, begin),
        cmocka_unit_test_setup(one_that_was_rolled_back_is_tried_again_where_data_can_be_written,
                               begin),
        cmocka_unit_test_setup(only_a_daemon_that_answers_says_disarmed, begin),
        cmocka_unit_test_setup(nothing_begins_by_itself_after_the_autopilot_fell_silent, begin),
        cmocka_unit_test_setup(nor_while_one_is_silent_that_was_there_at_an_earlier_power_on,
                               begin),
        cmocka_unit_test_setup(one_update_at_a_time, begin),
        cmocka_unit_test_setup(it_has_to_fit, begin),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
