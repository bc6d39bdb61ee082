/*
 * Who may have a connection to the page, and for how long. A connection that
 * has shown no session is a stranger's: it has ten seconds for each request,
 * from its first octet to the last one of the answer, and there are only so
 * many; one more takes the place of the oldest. So slow connections, however
 * many, keep nobody out: who logs in needs a place for a moment only, and who
 * has logged in keeps it.
 *
 * fd: the connection's own, its name here; it is only ever shut down.
 */
#ifndef ODID_WEB_PLACES_H
#define ODID_WEB_PLACES_H

#include <stdbool.h>
#include <stdint.h>

#define WEB_STRANGERS_MAX 20
#define WEB_STRANGER_US INT64_C(10000000)
/* All connections there can be: more are for the server to refuse. */
#define WEB_PLACES_MAX 48

void web_places_come(int fd, int64_t now_us);

/* Whether its request was a session's. */
void web_places_know(int fd, bool known);

/* A request is answered: the next one has its own time. */
void web_places_answered(int fd, int64_t now_us);

void web_places_go(int fd);

/* Ends those whose time is over. Returns when the next one's is, or INT64_MAX. */
int64_t web_places_expire(int64_t now_us);

#endif
