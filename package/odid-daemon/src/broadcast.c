#include "broadcast.h"

#include <string.h>

#include "bluetooth.h"
#include "kept.h"
#include "log.h"
#include "loop.h"
#include "messages.h"
#include "schedule.h"
#include "wifi_beacon.h"

/* Long range advertises every 200 ms: a pack stays set for longer than that. Two slots, less what
 * one of them may be late. */
#define EXTENDED_US (2 * SCHEDULE_SLOT_US - 25000)

static struct {
    const struct config *config;
    const struct aircraft *aircraft;
    struct status_lateness *lateness;
    struct schedule schedule;
    struct loop_timer slot;
    struct kept_counters counters, before; /* before: the last payload was built */
    int counters_fd;                       /* < 0: they aren't kept */
    int64_t extended_us;                   /* when long range was given a pack */
} self;

static void set_legacy(const struct aircraft_view *view, enum message_type type, unsigned index,
                       int64_t now_us)
{
    uint8_t data[MESSAGES_LEGACY_SIZE];

    self.before.legacy = self.counters.legacy;
    if (messages_legacy(&self.counters.legacy, view, type, index, data)) {
        bluetooth_set_legacy(data, now_us);
    }
}

static void set_extended(const uint8_t *pack, size_t pack_size, int64_t now_us)
{
    uint8_t data[MESSAGES_EXTENDED_SIZE];

    if (bluetooth_waits(CHANNEL_BT5)) {
        self.counters.extended = self.before.extended;
    }
    self.before.extended = self.counters.extended;
    self.extended_us = now_us;
    bluetooth_set_extended(data, messages_extended(&self.counters.extended, pack, pack_size, data),
                           now_us);
}

static void set_beacon(const uint8_t *pack, size_t pack_size, int64_t now_us)
{
    uint8_t data[MESSAGES_ELEMENT_SIZE];

    if (wifi_beacon_waits()) {
        self.counters.beacon = self.before.beacon;
    }
    self.before.beacon = self.counters.beacon;
    wifi_beacon_set(data, messages_element(&self.counters.beacon, pack, pack_size, data), now_us);
}

/* What waits for a controller that is late, or came late to it, was not on the air: its message has
 * its turn again, and its counter doesn't step for it. */
static void take_back_what_waits(void)
{
    if (bluetooth_waits(CHANNEL_BT4)) {
        schedule_withdraw(&self.schedule);
        self.counters.legacy = self.before.legacy;
    }
}

static void keep_counters(void)
{
    int result = self.counters_fd < 0 ? 0 : kept_counters_write(self.counters_fd, &self.counters);

    if (result < 0) {
        log_warning("can't keep the message counters over a restart: %s", strerror(-result));
        self.counters_fd = -1; /* said once: it is no reason to stop */
    }
}

static void on_slot(void *context, int64_t now_us)
{
    struct aircraft_view view;
    struct schedule_entry entry;
    unsigned available[MESSAGE_TYPES];
    uint8_t pack[MESSAGES_PACK_SIZE];
    size_t pack_size;

    (void)context;
    take_back_what_waits();
    aircraft_view(self.aircraft, now_us, &view);
    for (enum message_type type = 0; type < MESSAGE_TYPES; type++) {
        available[type] = messages_available(&view, type);
    }
    entry = schedule_next(&self.schedule, now_us, available);
    status_lateness_add(self.lateness, entry.late_us, entry.skipped);
    pack_size = messages_pack(&view, pack);
    if (self.config->bt4_enabled) {
        set_legacy(&view, entry.type, entry.index, now_us);
    }
    if (self.config->wifi_beacon_enabled) {
        set_beacon(pack, pack_size, now_us);
    }
    if (self.config->bt5_enabled && now_us - self.extended_us >= EXTENDED_US) {
        set_extended(pack, pack_size, now_us);
    }
    keep_counters();
    loop_arm(&self.slot, entry.until_us);
}

void broadcast_start(const struct config *config, const struct aircraft *aircraft,
                     struct status_lateness *lateness, int64_t now_us)
{
    self.config = config;
    self.aircraft = aircraft;
    self.lateness = lateness;
    self.extended_us = now_us - EXTENDED_US;
    self.counters_fd = kept_counters_open(config->run_dir, &self.counters);
    if (self.counters_fd < 0) {
        log_warning("can't keep the message counters over a restart: %s/counters: %s",
                    config->run_dir, strerror(-self.counters_fd));
    }
    loop_timer_init(&self.slot, on_slot, NULL);
    schedule_start(&self.schedule, now_us);
    loop_arm(&self.slot, now_us);
}
