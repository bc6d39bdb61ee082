#include "radio/radio.h"

#include <stdio.h>
#include <string.h>

#include "base/log.h"

const char *radio_state_name(enum radio_state state)
{
    static const char *const names[] = {
        [RADIO_DISABLED] = "disabled", [RADIO_UNSUPPORTED] = "unsupported",
        [RADIO_ABSENT] = "absent",     [RADIO_BLOCKED] = "blocked",
        [RADIO_DOWN] = "down",         [RADIO_STARTING] = "starting",
        [RADIO_ON_AIR] = "on air",     [RADIO_LOST] = "lost",
    };

    return names[state];
}

const char *channel_name(enum channel channel)
{
    static const char *const names[] = {
        [CHANNEL_BT4] = "bt4", [CHANNEL_BT5] = "bt5", [CHANNEL_WIFI] = "wifi"};

    return names[channel];
}

const char *channel_title(enum channel channel)
{
    static const char *const titles[] = {[CHANNEL_BT4] = "Bluetooth 4",
                                         [CHANNEL_BT5] = "Bluetooth 5",
                                         [CHANNEL_WIFI] = "Wi-Fi beacon"};

    return titles[channel];
}

void radio_init(struct radio *radio, enum radio_state state, int64_t now_us)
{
    memset(radio, 0, sizeof(*radio));
    radio->state = state;
    radio->since_us = now_us;
    radio->accepted_us = radio->confirmed_us = radio->unbroken_us = INT64_MIN;
    radio->paused_us = INT64_MIN;
}

void radio_enter(struct radio *radio, enum channel channel, enum radio_state state,
                 const char *detail, int64_t now_us)
{
    bool changed = radio->state != state;

    if (detail != NULL && strcmp(detail, radio->detail) != 0) {
        snprintf(radio->detail, sizeof(radio->detail), "%s", detail);
        /* A new reason to be where it was is news only while it is off the air. */
        changed = changed || state == RADIO_ABSENT || state == RADIO_LOST;
    }
    if (!changed) {
        return;
    }
    if (radio->state != state) {
        radio->state = state;
        radio->since_us = now_us;
        radio->starts += state == RADIO_ON_AIR;
        radio->was_on_air = radio->was_on_air || state == RADIO_ON_AIR;
    }
    if (state == RADIO_LOST || state == RADIO_BLOCKED || state == RADIO_ABSENT) {
        log_warning("%s: %s (%s)", channel_title(channel), radio_state_name(state), radio->detail);
    } else {
        log_info("%s: %s (%s)", channel_title(channel), radio_state_name(state), radio->detail);
    }
}

const char *radio_known_name(enum radio_known known)
{
    static const char *const names[] = {
        [RADIO_SET] = "set", [RADIO_COUNTED] = "confirmed", [RADIO_HEARD] = "heard"};

    return names[known];
}

void radio_replaced(struct radio *radio)
{
    radio->replaced += radio->state == RADIO_ON_AIR ? 1 : 0;
}

bool radio_accepted(struct radio *radio, enum channel channel, int64_t now_us)
{
    int64_t in_time_us = channel == CHANNEL_BT4 ? RADIO_ONE_IN_TIME_US : RADIO_PACK_IN_TIME_US;
    bool in_time = radio->accepted_us != INT64_MIN && now_us - radio->accepted_us < in_time_us;

    radio->accepted_us = now_us;
    radio->payloads++;
    return in_time;
}

enum radio_state radio_seen(const struct radio *radio, int64_t now_us)
{
    int64_t last_us = radio->confirmed_us;

    if (last_us == INT64_MIN || last_us < radio->since_us) {
        last_us = radio->since_us;
    }
    return radio->state == RADIO_ON_AIR && now_us - last_us > RADIO_STALE_US ? RADIO_LOST
                                                                             : radio->state;
}

bool radio_stuck(const struct radio *radio, int64_t now_us)
{
    enum radio_state state = radio_seen(radio, now_us);
    int64_t last_us = radio->confirmed_us == INT64_MIN ? radio->since_us : radio->confirmed_us;

    return (state == RADIO_ABSENT || state == RADIO_DOWN || state == RADIO_LOST) &&
           (radio->given_up || (radio->was_on_air && now_us - last_us > RADIO_STUCK_US));
}

int64_t radio_seen_since_us(const struct radio *radio, int64_t now_us)
{
    return radio_seen(radio, now_us) != radio->state && radio->confirmed_us > radio->since_us
               ? radio->confirmed_us
               : radio->since_us;
}

void radio_confirmed(struct radio *radio, int64_t now_us)
{
    if (radio->confirmed_us == INT64_MIN || now_us - radio->confirmed_us > RADIO_PAUSE_US) {
        radio->paused_us = radio->confirmed_us;
        radio->unbroken_us = now_us;
    }
    radio->confirmed_us = now_us;
}

void radio_denied(struct radio *radio, int64_t since_us)
{
    if (since_us < radio->unbroken_us) {
        since_us = radio->unbroken_us; /* before that it had a gap */
    }
    if (since_us < radio->confirmed_us) {
        radio->confirmed_us = since_us;
    }
}

int64_t retry_next(struct retry *retry, int64_t now_us)
{
    static const int64_t waits_us[] = {250000, 500000, 1000000};
    unsigned last = sizeof(waits_us) / sizeof(waits_us[0]) - 1;
    int64_t wait_us = waits_us[retry->attempt < last ? retry->attempt : last];

    retry->attempt += retry->attempt < last;
    return now_us + wait_us;
}

void retry_reset(struct retry *retry)
{
    retry->attempt = 0;
}
