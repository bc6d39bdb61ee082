/*
 * The sequence numbers of a source's MAVLink frames: whether one source uses
 * them, or two take turns.
 *
 * Frames are numbered one by one. Where two sources take turns, one goes on
 * behind its own last number after the other's came between, or uses a number
 * that was just used: so whoever forges has no number left that doesn't show.
 * Numbers come round after 256: they say so only as long as 64 can have been
 * used, 100 ms to 5 s by the pace at which they are (a log that is downloaded
 * goes to others, and takes most of them).
 *
 * Pure.
 */
#ifndef ODID_FRAME_NUMBERS_H
#define ODID_FRAME_NUMBERS_H

#include <stdbool.h>
#include <stdint.h>

struct frame_numbers {
    bool known;
    uint8_t next_to; /* the next one of the believed source follows this one ... */
    int64_t next_to_us;
    bool other;      /* ... and since then came one that doesn't, */
    bool back;       /* and one that went back */
    uint8_t skipped; /* of the last eight: bit 0 is next_to's predecessor */
    uint8_t last;    /* whoever's */
    int64_t last_us; /* when that came */
    double per_s;    /* numbers used, by the last ten seconds or so */
};

/* A frame's number: does it show that two sources take turns? again: it is the frame before, octet
 * by octet. */
bool frame_numbers_follow(struct frame_numbers *numbers, uint8_t sequence, bool again,
                          int64_t now_us);

/* After it: what the next one is measured by. paced: it tells the pace, too. */
void frame_numbers_pass(struct frame_numbers *numbers, uint8_t sequence, bool paced,
                        int64_t now_us);

#endif
