#include "daemon/broadcast.h"

#include <stdbool.h>
#include <string.h>

#include "base/log.h"
#include "base/loop.h"
#include "daemon/bluetooth.h"
#include "daemon/kept_counters.h"
#include "daemon/messages.h"
#include "daemon/schedule.h"
#include "daemon/wifi_beacon.h"

/* A beacon goes out every 102.4 ms: what is set faster is never sent. */
#define BEACON_US 100000
/* Right after a slot's beginning the controller's answer is awaited, and then that to long range's
 * payload: so often is asked whether they have come. */
#define RETRY_US 15000
/* Long range advertises every 200 ms: a pack stays set for longer than that. Two slots, less what
 * one of them may be late. */
#define EXTENDED_US (2 * SCHEDULE_SLOT_US - 25000)

static struct {
    const struct config *config;
    const struct aircraft *aircraft;
    struct slot_lateness *lateness;
    struct schedule schedule, singles; /* singles: where a beacon has room for one message */
    struct loop_timer slot, retry;
    struct kept_counters counters, before; /* before: the last payload was built */
    int counters_fd;                       /* < 0: they aren't kept */
    bool location;                         /* is what this slot is for */
    bool single;                           /* is what the beacon was given */
    bool renewed;                          /* within this slot, by a newer position */
    int64_t until_us;                      /* the next slot */
    int64_t legacy_fix_us, beacon_fix_us;  /* of the positions that were given last */
    int64_t beacon_us, extended_us;
} self;

static void keep_counters(void)
{
    int result = self.counters_fd < 0 ? 0 : kept_counters_write(self.counters_fd, &self.counters);

    if (result < 0) {
        log_warning("can't keep the message counters over a restart: %s", strerror(-result));
        self.counters_fd = -1; /* said once: it is no reason to stop */
    }
}

static void set_legacy(const struct aircraft_view *view, enum message_type type, unsigned index,
                       int64_t now_us)
{
    uint8_t data[MESSAGES_LEGACY_SIZE];

    self.before.legacy = self.counters.legacy;
    if (self.config->bt4_enabled &&
        messages_legacy(&self.counters.legacy, view, type, index, data)) {
        bluetooth_set_legacy(data, now_us);
    }
}

/* The fullest pack that the controller takes. */
static void set_extended(const struct aircraft_view *view, int64_t now_us)
{
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_EXTENDED_SIZE];
    size_t room = bluetooth_extended_room(), pack_size, size;

    if (!self.config->bt5_enabled) {
        return;
    }
    if (bluetooth_waits(CHANNEL_BT5)) {
        self.counters.extended = self.before.extended;
    }
    pack_size = messages_pack(view, MESSAGES_EXTENDED_MOST(room), pack);
    self.extended_us = now_us;
    self.before.extended = self.counters.extended;
    size = messages_extended(&self.counters.extended, pack, pack_size, data);
    bluetooth_set_extended(data, size, now_us);
}

static void find_available(const struct aircraft_view *view, unsigned available[MESSAGE_TYPES])
{
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        available[type] = messages_available(view, type);
    }
}

/* The fullest that the chip takes. One that takes single messages only has turns of its own: they
 * wait for no Bluetooth controller. */
static size_t beacon_pack(const struct aircraft_view *view, int64_t now_us,
                          uint8_t pack[MESSAGES_PACK_SIZE])
{
    unsigned most = wifi_beacon_most(), available[MESSAGE_TYPES];
    struct schedule_entry entry;

    if (most > 1) {
        return messages_pack(view, most, pack);
    }
    find_available(view, available);
    entry = schedule_next(&self.singles, now_us, available);
    return messages_pack_of(view, entry.type, entry.index, pack);
}

static void set_beacon(const struct aircraft_view *view, int64_t now_us)
{
    uint8_t pack[MESSAGES_PACK_SIZE], data[MESSAGES_ELEMENT_SIZE];
    size_t pack_size, size;

    if (!self.config->wifi_beacon_enabled) {
        return;
    }
    if (wifi_beacon_waits()) {
        self.counters.beacon = self.before.beacon;
        if (self.single) {
            schedule_withdraw(&self.singles);
        }
    }
    self.single = wifi_beacon_most() == 1;
    pack_size = beacon_pack(view, now_us, pack);
    self.beacon_fix_us = view->location.fix_us;
    self.beacon_us = now_us;
    self.before.beacon = self.counters.beacon;
    size = messages_element(&self.counters.beacon, pack, pack_size, data);
    wifi_beacon_set(data, size, now_us);
}

/* What waits was not on the air: its counter doesn't step for it. */
static void step_back_legacy(void)
{
    self.counters.legacy = self.before.legacy;
}

/* What waits for a controller that is late, or came late to it, has its turn again. A position that
 * came within its slot had its turn. */
static void take_back_what_waits(void)
{
    if (bluetooth_waits(CHANNEL_BT4)) {
        step_back_legacy();
        if (!self.renewed) {
            schedule_withdraw(&self.schedule);
        }
    }
}

static void on_slot(void *context, int64_t now_us)
{
    struct aircraft_view view;
    struct schedule_entry entry;
    unsigned available[MESSAGE_TYPES];

    (void)context;
    aircraft_view(self.aircraft, now_us, &view);
    find_available(&view, available);
    take_back_what_waits();
    entry = schedule_next(&self.schedule, now_us, available);
    slot_lateness_add(self.lateness, entry.late_us, entry.skipped);
    self.location = entry.type == MESSAGE_LOCATION;
    self.renewed = false;
    self.until_us = entry.until_us;
    if (self.location) {
        self.legacy_fix_us = view.location.fix_us;
    }
    set_legacy(&view, entry.type, entry.index, now_us);
    if (now_us - self.beacon_us >= BEACON_US) {
        set_beacon(&view, now_us);
    }
    if (now_us - self.extended_us >= EXTENDED_US) {
        set_extended(&view, now_us);
    }
    keep_counters();
    loop_arm(&self.slot, entry.until_us);
}

/* Where each message has its turn, a position doesn't take another one's. */
static void renew_beacon(const struct aircraft_view *view, int64_t now_us)
{
    if (wifi_beacon_most() > 1 && now_us - self.beacon_us >= BEACON_US &&
        view->location.fix_us > self.beacon_fix_us) {
        set_beacon(view, now_us);
        keep_counters();
    }
}

static void set_newer(const struct aircraft_view *view, int64_t now_us)
{
    self.legacy_fix_us = view->location.fix_us;
    set_legacy(view, MESSAGE_LOCATION, 0, now_us);
    keep_counters();
}

/* In a slot for positions: in place of the one that waits for the controller, or where there is
 * room for one more. */
static void renew_legacy(const struct aircraft_view *view, int64_t now_us)
{
    if (!self.location || view->location.fix_us <= self.legacy_fix_us) {
        return;
    }
    if (bluetooth_waits(CHANNEL_BT4)) {
        step_back_legacy();
        set_newer(view, now_us);
        return;
    }
    switch (bluetooth_legacy_fit(self.until_us, self.until_us + SCHEDULE_SLOT_US, now_us)) {
    case BLUETOOTH_FITS:
        self.renewed = true;
        set_newer(view, now_us);
        break;
    case BLUETOOTH_FITS_LATER:
        if (now_us + RETRY_US < self.until_us) {
            loop_arm(&self.retry, now_us + RETRY_US);
        }
        break;
    case BLUETOOTH_FITS_NOT:
        break;
    }
}

static void renew(int64_t now_us)
{
    struct aircraft_view view;

    aircraft_view(self.aircraft, now_us, &view);
    renew_beacon(&view, now_us);
    renew_legacy(&view, now_us);
}

static void on_retry(void *context, int64_t now_us)
{
    (void)context;
    renew(now_us);
}

void broadcast_position(int64_t now_us)
{
    if (self.location || now_us - self.beacon_us >= BEACON_US) {
        renew(now_us);
    }
}

void broadcast_start(const struct config *config, const struct aircraft *aircraft,
                     struct slot_lateness *lateness, int64_t now_us)
{
    self.config = config;
    self.aircraft = aircraft;
    self.lateness = lateness;
    self.legacy_fix_us = self.beacon_fix_us = INT64_MIN;
    self.beacon_us = now_us - BEACON_US;
    self.extended_us = now_us - EXTENDED_US;
    self.counters_fd = kept_counters_open(config->run_dir, &self.counters);
    if (self.counters_fd < 0) {
        log_warning("can't keep the message counters over a restart: %s/counters: %s",
                    config->run_dir, strerror(-self.counters_fd));
    }
    loop_timer_init(&self.slot, on_slot, NULL);
    loop_timer_init(&self.retry, on_retry, NULL);
    schedule_start(&self.schedule, now_us);
    schedule_start(&self.singles, now_us);
    loop_arm(&self.slot, now_us);
}
