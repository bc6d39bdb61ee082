/*
 * Who has given the technician's password, and how often it may be tried.
 *
 * Pure: randomness and time are arguments.
 */
#ifndef ODID_WEB_SESSION_H
#define ODID_WEB_SESSION_H

#include <stdbool.h>
#include <stdint.h>

#define WEB_TOKEN_BYTES 16
#define WEB_TOKEN_SIZE (2 * WEB_TOKEN_BYTES + 1) /* as hexadecimal digits */
#define WEB_SESSIONS_MAX 4                       /* a phone and a laptop, and some forgotten ones */
#define WEB_SESSION_IDLE_US (INT64_C(30) * 60 * 1000000)

/*
 * Passwords: five tries at once, then one every ten seconds, whoever tries.
 * Addresses are free on a network, so counting by address would be no limit; but
 * who tries by cable takes no try away from who is on the access point, which
 * has asked for the same password already.
 */
#define WEB_TRIES 5
#define WEB_TRY_EVERY_US INT64_C(10000000)
enum web_network { WEB_BY_CABLE, WEB_BY_ACCESS_POINT, WEB_NETWORKS };

struct web_sessions {
    struct {
        char token[WEB_TOKEN_SIZE]; /* empty: free */
        int64_t used_us;
    } one[WEB_SESSIONS_MAX];
    int64_t full_us[WEB_NETWORKS]; /* when all tries are there again */
};

/*
 * May a password be tried now? Counts the try if so; else *wait_s says when to
 * come back. A try that was right is given back by web_sessions_begin.
 */
bool web_sessions_try(struct web_sessions *sessions, enum web_network network, int64_t now_us,
                      unsigned *wait_s);

/* A new session; when there are too many, the one that was used least recently ends. */
void web_sessions_begin(struct web_sessions *sessions, enum web_network network,
                        const uint8_t random[WEB_TOKEN_BYTES], int64_t now_us,
                        char token[WEB_TOKEN_SIZE]);

/* Is it a session? It is used now, if so. */
bool web_sessions_known(struct web_sessions *sessions, const char token[WEB_TOKEN_SIZE],
                        int64_t now_us);

/* All of them: the password is another one. */
void web_sessions_end_all(struct web_sessions *sessions);

void web_sessions_end(struct web_sessions *sessions, const char token[WEB_TOKEN_SIZE]);

#endif
