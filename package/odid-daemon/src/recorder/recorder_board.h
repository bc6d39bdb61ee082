/* What the board says: the appliance's faults, under-voltage and throttling. */
#ifndef ODID_RECORDER_BOARD_H
#define ODID_RECORDER_BOARD_H

#include "appliance/places.h"
#include "recorder/recorder.h"

struct recorder_board_reader {
    const struct places *places;
    unsigned past_flags; /* the firmware's "has been", as read last */
};

/*
 * What the board hasn't (no such sensor, no such directory) is no fault. Where there are more
 * faults than have a place, those that the recorder knows keep theirs until they are over; then by
 * name.
 */
void recorder_board_read(struct recorder_board_reader *reader, const struct recorder *recorder,
                         struct recorder_board *board);

#endif
