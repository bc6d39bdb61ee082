#include "daemon/bluetooth.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "base/log.h"
#include "daemon/bluetooth_adapter.h"
#include "radio/rfkill.h"

static struct {
    struct bluetooth_adapter adapters[2];
    unsigned count;
    uint8_t address[6];
} self;

/* ---- what brings it back ---- */

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

/* ---- opening and closing ---- */

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

static void take_open_error(struct bluetooth_adapter *adapter, int error, int64_t now_us)
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

static void open_adapter(struct bluetooth_adapter *adapter, int64_t now_us)
{
    int result = hci_open(&adapter->hci, adapter->name, bluetooth_event, bluetooth_lost, adapter);

    if (result < 0) {
        take_open_error(adapter, result, now_us);
        return;
    }
    adapter->step = STEP_RESET;
    adapter->awaited = 0;
    adapter->coming_us = LOOP_NEVER;
    adapter->marked = false;
    adapter->repair = STEP_ON_AIR;
    adapter->enabling_again = adapter->full = false;
    adapter->maximum_data = adapter->maximum_said = MESSAGES_EXTENDED_SIZE;
    adapter->trying_from = 0;
    adapter->again_us = LOOP_NEVER;
    for (int i = 0; i < BLUETOOTH_SETS; i++) {
        const struct bluetooth_advertising *set = &adapter->sets[i];

        /* One that was lost stays that until it is on air: mute, it would go to and fro. */
        if (set->radio != NULL && set->radio->state != RADIO_LOST &&
            set->radio->state != RADIO_UNSUPPORTED) {
            radio_enter(set->radio, set->channel, RADIO_STARTING, adapter->name, now_us);
        }
    }
    bluetooth_advance(adapter, now_us);
}

static void on_adapter_timer(void *context, int64_t now_us)
{
    struct bluetooth_adapter *adapter = context;

    if (!hci_is_open(&adapter->hci)) {
        open_adapter(adapter, now_us);
    } else if (adapter->awaited != 0 || adapter->full) {
        bluetooth_lost(adapter, -ETIMEDOUT, now_us);
    } else {
        bluetooth_advance(adapter, now_us); /* with a repair that had to wait */
    }
}

/* ---- the outside ---- */

static void make_address(void)
{
    char boot_id[64] = "";
    int fd = open("/proc/sys/kernel/random/boot_id", O_RDONLY | O_CLOEXEC);
    bool known = fd >= 0 && read(fd, boot_id, sizeof(boot_id) - 1) > 0 &&
                 bluetooth_static_address(boot_id, self.address);

    if (fd >= 0) {
        close(fd);
    }
    if (!known && getrandom(self.address, sizeof(self.address), GRND_INSECURE) > 0) {
        self.address[5] |= BLUETOOTH_STATIC;
        log_warning("no boot id: the Bluetooth address will be another one after a restart");
    }
}

static void add_set(struct bluetooth_adapter *adapter, enum bluetooth_set which,
                    struct radio *radio)
{
    adapter->sets[which].radio = radio;
    adapter->sets[which].channel = which == BLUETOOTH_LEGACY ? CHANNEL_BT4 : CHANNEL_BT5;
}

static struct bluetooth_adapter *add_adapter(const char *name)
{
    struct bluetooth_adapter *adapter = &self.adapters[self.count++];

    *adapter = (struct bluetooth_adapter){
        .name = name,
        .address = self.address,
        .hci.watch.fd = -1,
        .timer = adapter->timer, /* of a start before: the loop knows it */
        .again_wait_us = BLUETOOTH_AGAIN_US,
        .mended_us = LOOP_NEVER,
        .coming_us = LOOP_NEVER,
        .repair_from_us = INT64_MIN,
        .repair_logged_us = INT64_MIN / 2,
    };
    loop_timer_init(&adapter->timer, on_adapter_timer, adapter);
    return adapter;
}

void bluetooth_start(const struct config *config, struct radio *bt4, struct radio *bt5,
                     int64_t now_us)
{
    const char *long_range = config->bt5_adapter[0] ? config->bt5_adapter : config->bt_adapter;
    struct bluetooth_adapter *adapter = NULL;

    make_address();
    radio_init(bt4, config->bt4_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    radio_init(bt5, config->bt5_enabled ? RADIO_STARTING : RADIO_DISABLED, now_us);
    if (config->bt4_enabled) {
        adapter = add_adapter(config->bt_adapter);
        add_set(adapter, BLUETOOTH_LEGACY, bt4);
    }
    if (config->bt5_enabled) {
        if (adapter == NULL || strcmp(adapter->name, long_range) != 0) {
            adapter = add_adapter(long_range);
        }
        add_set(adapter, BLUETOOTH_LONG_RANGE, bt5);
    }
    for (unsigned i = 0; i < self.count; i++) {
        open_adapter(&self.adapters[i], now_us);
    }
}

/* Whose set that is; NULL: nobody's. */
static struct bluetooth_adapter *adapter_with(enum bluetooth_set which)
{
    for (unsigned i = 0; i < self.count; i++) {
        if (self.adapters[i].sets[which].radio != NULL) {
            return &self.adapters[i];
        }
    }
    return NULL;
}

static void set_payload(enum bluetooth_set which, const uint8_t *data, size_t length,
                        int64_t now_us)
{
    struct bluetooth_adapter *adapter = adapter_with(which);
    struct bluetooth_advertising *set;

    if (adapter == NULL || length > sizeof(set->payload)) {
        return;
    }
    set = &adapter->sets[which];
    if (set->pending) {
        radio_replaced(set->radio);
    }
    memcpy(set->payload, data, length);
    set->length = length;
    set->pending = true;
    bluetooth_advance(adapter, now_us);
}

void bluetooth_set_legacy(const uint8_t data[MESSAGES_LEGACY_SIZE], int64_t now_us)
{
    set_payload(BLUETOOTH_LEGACY, data, MESSAGES_LEGACY_SIZE, now_us);
}

void bluetooth_set_extended(const uint8_t *data, size_t length, int64_t now_us)
{
    set_payload(BLUETOOTH_LONG_RANGE, data, length, now_us);
}

size_t bluetooth_extended_room(void)
{
    const struct bluetooth_adapter *adapter = adapter_with(BLUETOOTH_LONG_RANGE);

    return adapter == NULL ? MESSAGES_EXTENDED_SIZE : adapter->maximum_data;
}

bool bluetooth_waits(enum channel channel)
{
    enum bluetooth_set which = channel == CHANNEL_BT4 ? BLUETOOTH_LEGACY : BLUETOOTH_LONG_RANGE;
    const struct bluetooth_adapter *adapter = adapter_with(which);

    return adapter != NULL && adapter->sets[which].pending;
}

enum bluetooth_fit bluetooth_legacy_fit(int64_t until_us, int64_t next_us, int64_t now_us)
{
    const struct bluetooth_adapter *adapter = adapter_with(BLUETOOTH_LEGACY);
    int64_t from_us;

    if (adapter == NULL) {
        return BLUETOOTH_FITS_NOT;
    }
    from_us = bluetooth_held_until_us(adapter, BLUETOOTH_LEGACY);
    from_us = from_us > now_us ? from_us : now_us;
    if (from_us >= until_us ||
        next_us - from_us < 2 * bluetooth_hold_us(adapter, BLUETOOTH_LEGACY)) {
        return BLUETOOTH_FITS_NOT;
    }
    /* While an answer is awaited, it isn't known when the one that was given began. */
    return adapter->awaited != 0 && adapter->awaited != BLUETOOTH_READ_DATA_LENGTH
               ? BLUETOOTH_FITS_LATER
               : BLUETOOTH_FITS;
}

void bluetooth_stop(void)
{
    for (unsigned i = 0; i < self.count; i++) {
        bluetooth_silence(&self.adapters[i], loop_now_us());
        hci_finish(&self.adapters[i].hci);
        loop_arm(&self.adapters[i].timer, LOOP_NEVER);
    }
    self.count = 0;
}
