/* The gate's question: gathers how the board is, for update_offer.h to judge. */
#ifndef ODID_UPDATE_QUESTION_H
#define ODID_UPDATE_QUESTION_H

#include <stdbool.h>

#include "update/update.h"

struct update_question {
    char running, other; /* slots */
    const char *version; /* that is running */
    bool beside;         /* another update isn't decided */
    bool unattended;
    bool from_server; /* known to be */
};

/*
 * May the bundle whose description SWUpdate has verified be installed? answer: why not, or empty.
 * Then the other slot can be written to.
 */
void update_question_answer(const struct update_question *question,
                            char answer[UPDATE_SENTENCE_SIZE]);

#endif
