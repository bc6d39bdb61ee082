#include "update/update_question.h"

#include <json-c/json_object.h>
#include <stdio.h>
#include <unistd.h>

#include "appliance/armed.h"
#include "appliance/import_kept.h"
#include "appliance/kept.h"
#include "appliance/status_fetch.h"
#include "appliance/update_bundle.h"
#include "appliance/update_offer.h"
#include "base/whole_file.h"
#include "config/config.h"
#include "update/update_environment.h"
#include "update/update_files.h"
#include "update/update_places.h"
#include "update/update_slot.h"

#define TRIED DATA "/odid/.remembers"

/* As odidctl and the services read it: what is wrong in it was said elsewhere. */
static bool prevents_downgrade(void)
{
    struct config config;

    config_defaults(&config);
    config_read_file(&config, CONFIGURATION, config_ignore_sentence, NULL);
    return config.update_prevent_downgrade;
}

/* Where settings were lost, or are in memory without what the disk has, a sound stand-in is in
 * force. */
static bool is_what_was_set(void)
{
    return import_sound(CONFIGURATION) && access(FAULTS "/settings", F_OK) < 0 &&
           !update_data_is_late(IN_MEMORY);
}

/* A disk that has turned read-only may not have said so yet: it is tried. */
static bool keeps_records(void)
{
    static const char block[4096];
    bool keeps =
        access(IN_MEMORY, F_OK) < 0 && whole_file_replace(TRIED, block, sizeof(block), 0600) == 0;

    unlink(TRIED);
    return keeps;
}

static void fill_offer(struct update_offer *offer, const struct update_bundle *bundle,
                       const struct update_question *question)
{
    bool keeps = keeps_records();
    static char rolled_back[UPDATE_VERSION_SIZE];
    struct update_variables variables = {0};
    bool damaged;
    int known =
        update_variables_read(ENVIRONMENT_CONFIG, NULL, question->running, &variables, &damaged);
    int error = 0;
    struct json_object *status = status_fetch(RUN_DIR, &error);
    struct kept kept;
    bool ran = kept_read(RUN_DIR, &kept) == 0;

    whole_file_line(DATA "/" UPDATE_BACK_FILE, rolled_back, sizeof(rolled_back));
    *offer = (struct update_offer){
        .versions = {.offered = bundle->version,
                     .running = question->version,
                     .rolled_back = rolled_back,
                     .unattended = question->unattended,
                     .from_server = question->from_server,
                     .prevent_downgrade = prevents_downgrade(),
                     .unreadable = !is_what_was_set()},
        .needed_octets = bundle->slot_octets,
        .slot_octets = update_slot_octets(question->other),
        .undecided = question->beside || known < 0 || variables.upgrade_available,
        .given_up = variables.trial_failed == question->running,
        .armed = armed_by(status, ran ? &kept : NULL),
        .keeps_records = keeps,
        /* A disk that had to be mended may lose it again, and a stick would bring it each time. */
        .remembers = keeps && access(FAULTS "/data", F_OK) < 0,
    };
    json_object_put(status);
}

/* The boot loader may have taken this slot because the committed one is damaged: from now on it is
 * the one that a failed trial goes back to. And where /data keeps no record of the update, it
 * stands here that one was begun: what power breaks off is taken away at the next start. */
static int keep_this_slot(const struct update_question *question, bool recorded)
{
    char unverified = recorded ? '\0' : question->other;
    struct update_variables variables;
    bool damaged;
    int result =
        update_variables_read(ENVIRONMENT_CONFIG, NULL, question->running, &variables, &damaged);

    if (result == 0 &&
        (variables.slot != question->running || variables.unverified != unverified)) {
        enum update_report report =
            variables.slot == question->running ? UPDATE_REPORT_AS_IT_IS : UPDATE_REPORT_NOTHING;

        variables.slot = question->running;
        variables.unverified = unverified;
        result = update_variables_write(ENVIRONMENT_CONFIG, &variables, report);
    }
    return result;
}

void update_question_answer(const struct update_question *question,
                            char answer[UPDATE_SENTENCE_SIZE])
{
    struct update_bundle bundle;
    struct update_offer offer;

    if (update_bundle_read_description(DESCRIPTION, &bundle) < 0) {
        snprintf(answer, UPDATE_SENTENCE_SIZE,
                 "Its description isn't as this appliance's are, though it is signed.");
    } else {
        fill_offer(&offer, &bundle, question);
        if (update_offer_judge(&offer, answer, UPDATE_SENTENCE_SIZE)) {
            answer[0] = '\0';
            if (keep_this_slot(question, offer.keeps_records) < 0) {
                snprintf(answer, UPDATE_SENTENCE_SIZE, "U-Boot's environment can't be written.");
            } else if (!update_slot_protect(question->other, false)) {
                snprintf(answer, UPDATE_SENTENCE_SIZE, "The slot can't be made writable.");
            }
        }
    }
}
