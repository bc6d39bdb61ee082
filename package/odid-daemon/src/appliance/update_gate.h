/*
 * The service update's socket: one word each, and the answer is one sentence.
 *
 *   gate    SWUpdate asks (swupdate.cfg) whether what it checks may be written.
 *           Answered when it is known; empty: yes
 *   cancel  calls off what is being installed. Empty: so it is
 *
 * Root's only: socket and folder say so.
 */
#ifndef ODID_UPDATE_GATE_H
#define ODID_UPDATE_GATE_H

#include <stdbool.h>

#include "appliance/update_names.h"

#define UPDATE_GATE_SOCKET "update.sock" /* in /run/odid-appliance */

struct update_gate_calls {
    /* Is it known that SWUpdate checks a bundle? Its word may be on its way. */
    bool (*known)(void);
    void (*judge)(char answer[UPDATE_SENTENCE_SIZE]);
    void (*cancel)(char answer[UPDATE_SENTENCE_SIZE]);
};

/* Within loop.h's loop. Returns 0, or -errno. */
int update_gate_serve(const char *directory, const struct update_gate_calls *calls);

/* ---- the other end ---- */

/* Returns a connection to whom the word was said, or -errno when there is nobody. */
int update_gate_say(const char *directory, const char *word);

/* Says it and waits for the answer. Returns 0, or -errno when there was none. */
int update_gate_ask(const char *directory, const char *word, char answer[UPDATE_SENTENCE_SIZE]);

#endif
