#include "web/web_session.h"

#include <stdio.h>
#include <string.h>

bool web_sessions_try(struct web_sessions *sessions, enum web_network network, int64_t now_us,
                      unsigned *wait_s)
{
    const int64_t most_us = (WEB_TRIES - 1) * WEB_TRY_EVERY_US;
    int64_t *full_us = &sessions->full_us[network], left_us = *full_us - now_us;

    if (left_us > most_us) {
        *wait_s = (unsigned)((left_us - most_us) / 1000000) + 1;
        return false;
    }
    *full_us = (left_us > 0 ? *full_us : now_us) + WEB_TRY_EVERY_US;
    *wait_s = 0;
    return true;
}

/* In a time that doesn't tell where they differ. */
static bool same(const char a[WEB_TOKEN_SIZE], const char b[WEB_TOKEN_SIZE])
{
    unsigned char difference = 0;

    for (size_t i = 0; i < WEB_TOKEN_SIZE; i++) {
        difference |= (unsigned char)(a[i] ^ b[i]);
    }
    return difference == 0;
}

/* Index of the session, or WEB_SESSIONS_MAX. */
static size_t find_session(const struct web_sessions *sessions, const char token[WEB_TOKEN_SIZE])
{
    size_t found = WEB_SESSIONS_MAX;

    for (size_t i = 0; i < WEB_SESSIONS_MAX; i++) {
        if (sessions->one[i].token[0] != '\0' && same(sessions->one[i].token, token)) {
            found = i;
        }
    }
    return found;
}

void web_sessions_begin(struct web_sessions *sessions, enum web_network network,
                        const uint8_t random[WEB_TOKEN_BYTES], int64_t now_us,
                        char token[WEB_TOKEN_SIZE])
{
    size_t place = 0;

    for (size_t i = 0; i < WEB_SESSIONS_MAX; i++) {
        if (sessions->one[i].token[0] == '\0') {
            place = i;
            break;
        }
        if (sessions->one[i].used_us < sessions->one[place].used_us) {
            place = i;
        }
    }
    for (size_t i = 0; i < WEB_TOKEN_BYTES; i++) {
        snprintf(token + 2 * i, 3, "%02x", random[i]);
    }
    memcpy(sessions->one[place].token, token, WEB_TOKEN_SIZE);
    sessions->one[place].used_us = now_us;
    sessions->full_us[network] -= WEB_TRY_EVERY_US;
}

bool web_sessions_known(struct web_sessions *sessions, const char token[WEB_TOKEN_SIZE],
                        int64_t now_us)
{
    size_t i = find_session(sessions, token);

    if (i == WEB_SESSIONS_MAX) {
        return false;
    }
    if (now_us - sessions->one[i].used_us > WEB_SESSION_IDLE_US) {
        memset(&sessions->one[i], 0, sizeof(sessions->one[i]));
        return false;
    }
    sessions->one[i].used_us = now_us;
    return true;
}

void web_sessions_end_all(struct web_sessions *sessions)
{
    memset(sessions->one, 0, sizeof(sessions->one));
}

void web_sessions_end(struct web_sessions *sessions, const char token[WEB_TOKEN_SIZE])
{
    size_t i = find_session(sessions, token);

    if (i < WEB_SESSIONS_MAX) {
        memset(&sessions->one[i], 0, sizeof(sessions->one[i]));
    }
}
