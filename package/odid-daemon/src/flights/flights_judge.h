/* What follows from a flight record: shares, and the verdict. Pure. */
#ifndef ODID_FLIGHTS_JUDGE_H
#define ODID_FLIGHTS_JUDGE_H

#include <stdbool.h>
#include <stdint.h>

#include "flights/recorder_read.h"

#define FLIGHT_SENTENCE_SIZE 600

struct flight {
    unsigned number;
    bool running; /* it is being written */
    struct recorder_flight record;
};

/* Does its record count the channel? Of a flight: one that was required while armed, whatever was
 * switched off later; else one that is required. */
bool flight_required(const struct recorder_flight *record, enum channel channel);

/* Of the time armed: all gaps together, and the longest; an unfinished one among them. */
int64_t flight_silent_us(const struct recorder_flight *record, enum channel channel);
int64_t flight_longest_us(const struct recorder_flight *record, enum channel channel);

/* On the air, in percent of the time armed; rounded down, so that 100 means all of it. */
double flight_share(const struct recorder_flight *record, enum channel channel);

/* When the first channel was on the air first, since power-on; INT64_MIN: none ever was. */
int64_t flight_first_us(const struct recorder_flight *record);

/* "in order", "running" or "power cut" */
const char *flight_ending(const struct flight *flight);

/* Was it on the air the whole flight? */
void flight_judge(char sentence[FLIGHT_SENTENCE_SIZE], const struct flight *flight);

#endif
