/* A flight record's text -> what it says; also of one that a power cut left unfinished. Pure. */
#ifndef ODID_RECORDER_READ_H
#define ODID_RECORDER_READ_H

#include <json-c/json_object.h>

#include "flights/record.h"

struct recorder_flight {
    char boot[RECORDER_NAME_SIZE * 2], version[RECORDER_NAME_SIZE], image[RECORDER_NAME_SIZE * 2];
    bool started;            /* the first line is there */
    bool ended;              /* by the last line: in order */
    bool torn;               /* the last line isn't whole */
    unsigned bad;            /* lines that can't be understood, the torn one not among them */
    unsigned dropped;        /* events that the record's bound cost */
    int64_t start_us;        /* when the recorder began; power-on is 0 */
    int64_t last_us;         /* the last instant that is spoken of */
    int64_t clock_offset_us; /* UTC minus the record's time, as it was said first; 0: never known */
    int64_t clock_last_us;   /* the same, as it was said last */
    int64_t clock_jump_us;   /* the longest way, in either direction, from one to the next */
    struct recorder_totals totals;
    int64_t open_gap_us[CHANNELS]; /* unfinished ones, not in totals */
    unsigned faults;               /* of these the end isn't said */
    struct recorder_fault fault[RECORDER_FAULTS];
};

/* Each line in its order, parsed. */
typedef void recorder_event_fn(void *context, int64_t at_us, const char *event,
                               struct json_object *line);

/* each may be NULL. */
void recorder_read(struct recorder_flight *flight, const char *text, size_t length,
                   recorder_event_fn *each, void *context);

#endif
