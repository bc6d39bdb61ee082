#include "daemon/bluetooth.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/random.h>
#include <unistd.h>

#include "base/log.h"
#include "daemon/bluetooth_adapter.h"

static struct {
    struct bluetooth_adapter adapters[2];
    unsigned count;
    uint8_t address[6];
} self;

/* ---- opening ---- */

static void open_adapter(struct bluetooth_adapter *adapter, int64_t now_us)
{
    int result = hci_open(&adapter->hci, adapter->name, bluetooth_event, bluetooth_lost, adapter);

    if (result < 0) {
        bluetooth_not_opened(adapter, result, now_us);
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
        .hci.pause = adapter->hci.pause, /* of a start before: the loop knows it, ... */
        .timer = adapter->timer,         /* ... and this one */
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
