/*
 * What is kept about updates, as JSON: the state of the moment (shown by the
 * page and odidctl), the last result, and what a trial has to know of the slot
 * that it replaces. docs/updates.md has the fields.
 */
#ifndef ODID_UPDATE_FILES_H
#define ODID_UPDATE_FILES_H

#include <stdbool.h>
#include <sys/types.h>

#include "appliance/update_names.h"
#include "update/update_judge.h"

/* Is what is kept in memory, without what the disk has, which may come yet? mark: IN_MEMORY. */
bool update_data_is_late(const char *mark);

enum update_outcome { UPDATE_INSTALLED, UPDATE_REFUSED, UPDATE_BACK };

struct update_result {
    enum update_outcome outcome;
    char from[UPDATE_VERSION_SIZE], to[UPDATE_VERSION_SIZE]; /* to empty: not known */
    char sentence[UPDATE_SENTENCE_SIZE];
    bool from_server; /* as the record has it, which is gone then */
};

/* Written when an install begins, removed when its outcome is kept. */
struct update_record {
    char slot; /* 'a' or 'b': the new one */
    char from[UPDATE_VERSION_SIZE], to[UPDATE_VERSION_SIZE];
    bool from_server;                         /* hawkBit's: that one is told what becomes of it */
    bool unattended;                          /* a stick's: nobody asked for it */
    bool channels_known;                      /* the daemon said something of them */
    unsigned channels;                        /* that were on the air, 1 << channel */
    unsigned radio_faults;                    /* update_radio_faults */
    struct update_services services;          /* that ran */
    char configuration[UPDATE_IDENTITY_SIZE]; /* the one in force then; empty: not known */
};

/* Each returns 0, or -errno; what fails is for the caller to say. */
int update_write_state(const char *directory, const struct update *update);

/* time: when the clock is known to be right, or 0. Whatever comes after it, the version that was
 * rolled back is remembered until one is installed. */
int update_write_result(const char *data, const struct update_result *result, time_t time);

/* Was the last result a roll-back, of a hawkBit server's update? */
bool update_result_is_server_s(const char *data);

/* Where version is the one that was rolled back: it is to be tried again. */
int update_forget_back(const char *data, const char *version);

int update_write_record(const char *data, const struct update_record *record);

/* -ENOENT: none; -EBADMSG: it can't be understood. */
int update_read_record(const char *data, struct update_record *record);

int update_remove_record(const char *data);

#endif
