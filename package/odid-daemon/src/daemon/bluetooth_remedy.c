/* What brings an adapter back that failed, or doesn't come up. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "daemon/bluetooth_adapter.h"
#include "radio/rfkill.h"

/* ---- the remedies, one after the other ---- */

static void try_remedy(struct bluetooth_adapter *adapter, enum bluetooth_remedy remedy,
                       int64_t now_us)
{
    adapter->remedy = remedy;
    adapter->remedy_us = now_us;
    adapter->mended_us = LOOP_NEVER;
    adapter->reset_first = adapter->reset_first || remedy != REMEDY_NONE;
    adapter->hci.down_first = remedy == REMEDY_DOWN_AND_UP;
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        if (adapter->sets[i].radio != NULL) {
            adapter->sets[i].radio->given_up = remedy == REMEDY_DRIVER;
        }
    }
}

void bluetooth_settle_remedy(struct bluetooth_adapter *adapter, int64_t now_us)
{
    if (now_us >= adapter->mended_us) {
        try_remedy(adapter, REMEDY_NONE, now_us);
    }
}

/* The one after that which was tried last, and was in vain. */
static void try_next_remedy(struct bluetooth_adapter *adapter, int64_t now_us)
{
    if (adapter->remedy == REMEDY_NONE) {
        try_remedy(adapter, REMEDY_RESET, now_us);
    } else if (adapter->remedy == REMEDY_RESET && !adapter->hci.h4) {
        try_remedy(adapter, REMEDY_DOWN_AND_UP, now_us);
    } else {
        try_remedy(adapter, REMEDY_DRIVER, now_us);
    }
}

static const char *what_is_tried(const struct bluetooth_adapter *adapter)
{
    static const char *const words[] = {
        [REMEDY_NONE] = "",
        [REMEDY_RESET] = "; it is reset",
        [REMEDY_DOWN_AND_UP] = "; it was reset, and is put down and up",
        [REMEDY_DRIVER] = "; its driver is to be bound anew",
    };

    return words[adapter->remedy];
}

/* ---- closing ---- */

/* What an adapter's channels share. One that this controller can't do stays so. */
static void enter_radios(struct bluetooth_adapter *adapter, enum radio_state state,
                         const char *detail, int64_t now_us)
{
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        struct bluetooth_advertising *set = &adapter->sets[i];

        if (set->radio != NULL && set->radio->state != RADIO_UNSUPPORTED) {
            radio_enter(set->radio, set->channel, state, detail, now_us);
        }
    }
}

static void close_and_retry(struct bluetooth_adapter *adapter, enum radio_state state,
                            const char *detail, int64_t now_us)
{
    hci_close(&adapter->hci);
    adapter->awaited = 0;
    enter_radios(adapter, state, detail, now_us);
    loop_arm(&adapter->timer, retry_next(&adapter->retry, now_us));
}

void bluetooth_failed(struct bluetooth_adapter *adapter, const char *detail, int64_t now_us)
{
    bool hard;
    bool blocked = !adapter->hci.h4 && rfkill_blocked(RFKILL_BLUETOOTH, &hard);

    bluetooth_settle_remedy(adapter, now_us);
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        if (adapter->sets[i].radio != NULL) {
            adapter->sets[i].radio->failures++;
        }
    }
    close_and_retry(adapter, blocked ? RADIO_BLOCKED : RADIO_LOST, detail, now_us);
}

void bluetooth_lost(void *context, int error, int64_t now_us)
{
    struct bluetooth_adapter *adapter = context;
    char detail[RADIO_DETAIL_SIZE];

    bluetooth_settle_remedy(adapter, now_us);
    if (error == -ETIMEDOUT) {
        try_next_remedy(adapter, now_us);
    }
    snprintf(detail, sizeof(detail), "%s: %s%s", adapter->name,
             error == -ETIMEDOUT ? "the controller doesn't answer" : strerror(-error),
             what_is_tried(adapter));
    bluetooth_failed(adapter, detail, now_us);
}

/* It is there, and doesn't come up. */
static void wait_for_power(struct bluetooth_adapter *adapter, int error, int64_t now_us)
{
    int64_t since_us = adapter->coming_us, patience_us;

    if (since_us == LOOP_NEVER) {
        adapter->coming_us = since_us = now_us;
    }
    if (adapter->remedy == REMEDY_DOWN_AND_UP) {
        since_us = adapter->remedy_us;
        patience_us = BLUETOOTH_DOWN_AND_UP_US;
    } else {
        patience_us = error == -EAGAIN ? BLUETOOTH_UP_US : BLUETOOTH_DRIVER_US;
    }
    if (adapter->remedy != REMEDY_DRIVER && now_us - since_us >= patience_us) {
        try_remedy(adapter, REMEDY_DRIVER, now_us);
    }
}

void bluetooth_not_opened(struct bluetooth_adapter *adapter, int error, int64_t now_us)
{
    enum radio_state state = RADIO_ABSENT;
    char detail[RADIO_DETAIL_SIZE];
    bool hard = false;

    if (!adapter->hci.h4 && (rfkill_blocked(RFKILL_BLUETOOTH, &hard) || error == -ERFKILL)) {
        state = RADIO_BLOCKED;
        error = -ERFKILL;
    } else if (error == -EAGAIN) {
        state = RADIO_DOWN;
        retry_reset(&adapter->retry); /* it may be up any moment, and looking costs little */
    }
    if (error == -EAGAIN || error == -EINPROGRESS) {
        wait_for_power(adapter, error, now_us);
    } else {
        adapter->coming_us = LOOP_NEVER;
    }
    snprintf(detail, sizeof(detail), "%s: %s%s%s", adapter->name,
             error == -EAGAIN        ? "down, asked to power up"
             : error == -EINPROGRESS ? "its driver hasn't set it up"
                                     : strerror(-error),
             hard ? " (by a switch)" : "", what_is_tried(adapter));
    close_and_retry(adapter, state, detail, now_us);
}
