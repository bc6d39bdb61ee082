/* What the board says: the appliance's faults, under-voltage and throttling. */
#ifndef ODID_RECORDER_BOARD_H
#define ODID_RECORDER_BOARD_H

#include "recorder/recorder.h"

#define RECORDER_FAULTS_DIRECTORY "/run/faults"

struct recorder_board_reader {
    const char *root;    /* "" on the appliance; tests have theirs */
    unsigned past_flags; /* the firmware's "has been", as read last */
};

/* What the board hasn't (no such sensor, no such directory) is no fault. */
void recorder_board_read(struct recorder_board_reader *reader, struct recorder_board *board);

#endif
