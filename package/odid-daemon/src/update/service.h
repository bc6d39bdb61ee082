/*
 * The inside of odid-update: what it knows of the update that is going on, shared by its parts. The
 * course of one is update.h's; here is what is done for it.
 */
#ifndef ODID_UPDATE_SERVICE_H
#define ODID_UPDATE_SERVICE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/loop.h"
#include "update/update.h"
#include "update/update_environment.h"
#include "update/update_files.h"
#include "update/update_installer.h"
#include "update/update_judge.h"

struct service {
    struct update update;
    struct update_record record;
    struct update_expectation expectation;
    struct update_variables variables;
    /* In a trial: the one in force, when it was looked at last, or before the restart. */
    char configuration[UPDATE_IDENTITY_SIZE];
    bool configured_anew; /* it has changed since */
    bool data_late;       /* /data is in memory, and had no record of the trial */
    char running, other;  /* slots */
    char version[UPDATE_VERSION_SIZE];
    bool lost; /* U-Boot's variables were, and those that it has built in said what starts */
    bool time_known;
    bool beside;     /* a bundle came while another update isn't decided: the gate refuses it */
    bool stopping;   /* it was told to end */
    bool ended;      /* SWUpdate was, by us */
    bool report_due; /* by its hawkBit client, when it starts: it is ended once nothing goes on */
    bool passed;     /* the gate said yes to what is being installed */
    bool unattended; /* and nobody asked for that */
    enum update_source source;          /* of that */
    char refused[UPDATE_SENTENCE_SIZE]; /* why the gate refused this bundle, or "" */
    char reason[UPDATE_SENTENCE_SIZE];  /* why it was rolled back, until the restart; or "" */
    bool overwritten; /* a bundle was refused since, and that is the last result */
    struct loop_timer tick;
    struct loop_watch signals;
};

/* ---- what is shown and kept (service_kept.c) ---- */

/* result: 0, or -errno, which is said. */
void service_complain(const char *what, int result);

/* The state of the moment, to whoever looks. */
void service_show(const struct service *self);

/* An outcome, with a sentence, for good. Also of a bundle beside an update that isn't decided: of
 * that one everything stays known. */
void service_keep(struct service *self, enum update_outcome outcome, const char *to,
                  const char *format, ...) __attribute__((format(printf, 4, 5)));

/* ---- what was left behind (service_resume.c) ---- */

/* Takes up what the boot loader and an earlier process left. first: since power-on; later the
 * kernel's command line is an old story, and an install may be going on. */
void service_resume(struct service *self, bool first, int64_t now_us);

/* A worn disk answers late, and /data is in memory until then: of a trial that began without its
 * record it is known then what it took the place of, and whose it is. */
void service_take_late_record(struct service *self);

/* Whether the other slot is to be started for its trial, by U-Boot's variables as they are now. */
bool service_is_marked(const struct service *self);

/* Nothing is written to the other slot any more; written: it was, for all that is known. Unless it
 * is marked, what is in it then goes. */
void service_protect_other(const struct service *self, bool written);

/* ---- a trial, and what came before it (service_trial.c) ---- */

/* How the board is. On trial that is judged; before it, what works is noted. */
void service_look(struct service *self, struct update_board *board, int64_t now_us);

/* What works now: the gate is passed, and nothing is written yet that counts. */
void service_begin_record(struct service *self);

/* What the server whose update this is gets to hear. */
enum update_report service_report(const struct service *self, enum update_report what);

void service_end_installer(struct service *self);
void service_commit(struct service *self, int64_t now_us);
void service_roll_back(struct service *self, int64_t now_us);

/* The slot that runs is: no sentence of it, unlike service_roll_back. */
void service_give_up(struct service *self, int64_t now_us);

/* Unless it is armed: then it is to be asked again. */
void service_restart_board(struct service *self);

#endif
