/*
 * odid-daemon: wires the modules together. Data flows one way:
 *
 *   link -> telemetry -> aircraft -> broadcast -> radios
 *
 * and status and pilot listen to all of them.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include "appliance/appliance_marks.h"
#include "appliance/kept.h"
#include "appliance/places.h"
#include "base/alive.h"
#include "base/log.h"
#include "base/loop.h"
#include "base/sandbox.h"
#include "daemon/aircraft.h"
#include "daemon/asking.h"
#include "daemon/bluetooth.h"
#include "daemon/broadcast.h"
#include "daemon/health.h"
#include "daemon/link.h"
#include "daemon/options.h"
#include "daemon/pilot.h"
#include "daemon/run_dir.h"
#include "daemon/status.h"
#include "daemon/telemetry.h"
#include "daemon/wifi_beacon.h"
#include "radio/radio.h"
#include "radio/rfkill.h"

/* The pilot is told once a second, and at once when good turns into bad or bad into good. */
#define TELL_US 1000000
#define LOOK_US 250000
static struct {
    struct options options;
    struct telemetry *telemetry;
    struct aircraft *aircraft;
    struct radio radios[CHANNELS];
    struct asking asking;
    unsigned asked_boot;   /* the autopilot's starts when it was begun ... */
    uint8_t asked_vehicle; /* ... and whose */
    struct pilot pilot;
    struct slot_lateness lateness;
    struct kept kept; /* as it is in its file, ... */
    bool kept_behind; /* ... or has to be */
    struct loop_timer look;
    struct loop_watch signals;
    int64_t start_us, look_us, tell_us;
    bool told_fault;
    bool realtime, filter;
} self = {.signals.fd = -1};

static const struct config *config(void)
{
    return &self.options.config;
}

/* ---- in: link -> telemetry -> aircraft ---- */

static void on_bytes(void *context, unsigned stream, const uint8_t *bytes, size_t length,
                     int64_t now_us)
{
    (void)context;
    if (config()->source == MAVLINK_SOURCE_SERIAL) {
        telemetry_receive(self.telemetry, stream, bytes, length, now_us);
    } else {
        telemetry_receive_datagram(self.telemetry, stream, bytes, length, now_us);
    }
}

static void on_stream_reset(void *context, unsigned stream)
{
    (void)context;
    telemetry_reset_stream(self.telemetry, stream);
}

static void on_update(void *context, const struct telemetry_update *update, int64_t now_us)
{
    (void)context;
    aircraft_update(self.aircraft, update, now_us);
    asking_heard(&self.asking, update, now_us);
    if (update->kind == TELEMETRY_GLOBAL_POSITION || update->kind == TELEMETRY_LOCATION) {
        broadcast_position(now_us);
    }
}

/* ---- back: status and pilot ---- */

static void send_to_vehicle(void *context, const uint8_t *frame, size_t length)
{
    int stream = telemetry_vehicle_stream(self.telemetry);

    (void)context;
    if (stream >= 0) {
        link_send((unsigned)stream, frame, length);
    }
}

/* odid-update makes the file for as long as an update goes on. */
static bool updating(void)
{
    struct stat file;

    return stat(PLACES_STATE "/" APPLIANCE_UPDATING, &file) == 0;
}

static void judge(struct health_input *input, struct health *health, struct aircraft_view *view,
                  struct aircraft_condition *condition, int64_t now_us)
{
    aircraft_view(self.aircraft, now_us, view);
    aircraft_condition(self.aircraft, now_us, condition);
    *input = (struct health_input){
        .config = config(),
        .view = view,
        .condition = condition,
        .link = link_status(),
        .radios = self.radios,
        .extended_room = bluetooth_extended_room(),
        .beacon_most = wifi_beacon_most(),
        .config_errors = self.options.errors,
        .filter = self.filter,
        .filter_logging = self.options.seccomp_log,
        .realtime = self.realtime,
        .speaks = telemetry_vehicle_speaks(self.telemetry, now_us),
        .another_id = telemetry_another_id_speaks(self.telemetry, now_us),
        .others_only = telemetry_only_others_speak(self.telemetry, now_us),
        .contradicted = telemetry_contradicted(self.telemetry, now_us),
        .unheard = asking_unheard(&self.asking),
        .signs = telemetry_vehicle_signs(self.telemetry),
        .updating = updating(),
    };
    health_judge(health, input, now_us);
}

static void gather(void *context, struct status_snapshot *snapshot, int64_t now_us)
{
    static struct aircraft_view view;
    static struct aircraft_condition condition;

    (void)context;
    judge(&snapshot->input, &snapshot->health, &view, &condition, now_us);
    snapshot->counters = telemetry_counters(self.telemetry);
    snapshot->asking = &self.asking;
    snapshot->lateness = &self.lateness;
    snapshot->start_us = self.start_us;
    snapshot->vehicle = telemetry_vehicle(self.telemetry);
    snapshot->config_file = self.options.file;
    snapshot->config_reports = self.options.reports;
    snapshot->config_report = (const char(*)[CONFIG_PROBLEM_SIZE])self.options.report;
}

static void ask_vehicle(const struct aircraft_condition *condition, uint8_t vehicle, int64_t now_us)
{
    struct asking_request request;

    /* One that was there is asked on while it is silent: somebody may have switched off what it
     * says, and kept its answers from us. Nothing would come until power-off. */
    if (!telemetry_vehicle_speaks(self.telemetry, now_us) && !condition->armed &&
        telemetry_heartbeat_us(self.telemetry) == INT64_MIN) {
        return;
    }
    if (vehicle != self.asked_vehicle || condition->autopilot_restarts != self.asked_boot) {
        self.asked_vehicle = vehicle;
        self.asked_boot = condition->autopilot_restarts;
        telemetry_restarted(self.telemetry);
        asking_begin(&self.asking, now_us);
    }
    if (config()->request_rate
            ? asking_next(&self.asking, condition->apart || condition->altitude_apart, now_us,
                          &request)
            : asking_probe(&self.asking, now_us, &request)) {
        pilot_ask_rate(&self.pilot, vehicle, request.message_id, request.interval_us);
    }
}

static void write_kept(void)
{
    int result = kept_write(config()->run_dir, &self.kept);

    if (result < 0 && !self.kept_behind) {
        log_warning("can't keep what others and a restart need to know: %s/" KEPT_FILE ": %s",
                    config()->run_dir, strerror(-result));
    }
    self.kept_behind = result < 0; /* tried again at each look: others go by it */
}

/* Of an autopilot that was never heard since power-on. One that was there at an earlier one may
 * have been told to be silent. */
static enum kept_armed word_of_unheard(void)
{
    return self.options.expected_vehicle != 0 ? KEPT_AWAITED : KEPT_UNHEARD;
}

/* An old "disarmed", also one that a daemon before this one heard, is no word of one that speaks on
 * without it: it may fly. One that is silent may be switched off, or was never there. */
static enum kept_armed word_of(const struct aircraft_condition *condition, int64_t now_us)
{
    bool heard = telemetry_heartbeat_us(self.telemetry) != INT64_MIN;
    bool unheard = !heard && kept_is_unheard(&self.kept);
    /* One that a daemon before this one heard had its time to say a HEARTBEAT. */
    bool missing = telemetry_heartbeat_missing(self.telemetry, now_us) ||
                   (!heard && !unheard && telemetry_autopilot_speaks(self.telemetry, now_us));

    return condition->armed             ? KEPT_ARMED
           : condition->heartbeat_fresh ? KEPT_DISARMED
           : missing                    ? KEPT_UNSAID
           : unheard                    ? word_of_unheard()
                                        : KEPT_SILENT;
}

/* The take-off point for a restart in flight only: that of a flight that ended must not pass for
 * the next one's. */
static void keep(uint8_t vehicle, const struct aircraft_condition *condition, int64_t now_us)
{
    static const struct kept_takeoff none;
    bool armed = condition->armed;
    const struct kept_takeoff *takeoff = armed ? aircraft_takeoff(self.aircraft) : &none;
    enum kept_armed word = word_of(condition, now_us);

    if (!self.kept_behind && vehicle == self.kept.vehicle && word == self.kept.armed &&
        condition->fix_known == self.kept.fix_known &&
        condition->vertical_inverted == self.kept.vertical_inverted &&
        condition->crashed == self.kept.crashed &&
        memcmp(takeoff, &self.kept.takeoff, sizeof(*takeoff)) == 0) {
        return;
    }
    self.kept.vehicle = vehicle;
    self.kept.armed = word;
    self.kept.armed_once = self.kept.armed_once || armed;
    self.kept.fix_known = condition->fix_known;
    self.kept.vertical_inverted = condition->vertical_inverted;
    self.kept.crashed = condition->crashed;
    self.kept.takeoff = *takeoff;
    write_kept();
}

/* One that can't be on the air any more is missed, also by the daemon after this one, which tells
 * the pilot what this one hasn't. */
static void keep_channels(void)
{
    bool news = false;

    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        bool lost = self.pilot.lost[channel];

        news = news || (self.radios[channel].was_on_air && !self.kept.on_air[channel]) ||
               lost != self.kept.told_lost[channel];
        self.kept.on_air[channel] = self.kept.on_air[channel] || self.radios[channel].was_on_air;
        self.kept.told_lost[channel] = lost;
    }
    if (news) {
        write_kept();
    }
}

/* Not on the ground: there a channel may have been configured away. */
static void restore_channels(void)
{
    if (self.kept.armed != KEPT_ARMED) {
        memset(self.kept.on_air, 0, sizeof(self.kept.on_air));
        memset(self.kept.told_lost, 0, sizeof(self.kept.told_lost));
        return;
    }
    for (enum channel channel = 0; channel < CHANNELS; channel++) {
        self.radios[channel].was_on_air = self.kept.on_air[channel];
        pilot_restore(&self.pilot, channel, self.kept.on_air[channel],
                      self.kept.told_lost[channel]);
    }
}

/* What was known before a restart of ours counts on; at the first start others learn that nothing
 * was heard yet. */
static void restore(int64_t now_us)
{
    uint8_t vehicle;
    bool believed;

    if (kept_read(config()->run_dir, &self.kept) == -ENOENT) {
        self.kept.armed = word_of_unheard();
        write_kept();
    }
    vehicle = self.kept.vehicle != 0 ? self.kept.vehicle : self.options.expected_vehicle;
    /* What a daemon that was taken over has written there would keep the one that flies away. */
    believed = self.options.expected_vehicle == 0 || self.options.expected_vehicle == vehicle;
    telemetry_expect(self.telemetry, vehicle, believed && self.kept.armed == KEPT_ARMED, now_us);
    aircraft_restore_armed(self.aircraft, self.kept.armed == KEPT_ARMED);
    aircraft_restore_takeoff(self.aircraft, &self.kept.takeoff);
    aircraft_restore_vertical(self.aircraft, self.kept.vertical_inverted);
    aircraft_restore_crash(self.aircraft, self.kept.crashed, now_us);
    if (self.kept.vehicle != 0) {
        aircraft_restore_fix(self.aircraft, self.kept.fix_known, now_us);
    }
}

static void tell_pilot(uint8_t vehicle, const char *reason, bool armed, int64_t now_us)
{
    bool fault = reason[0] != '\0';

    if (now_us >= self.tell_us || fault != self.told_fault) {
        pilot_tell(&self.pilot, vehicle, reason, armed);
        self.told_fault = fault;
        self.tell_us = now_us + TELL_US - LOOK_US / 2; /* the look that is nearest to a second */
    }
}

static void on_look(void *context, int64_t now_us)
{
    struct health_input input;
    struct health health;
    struct aircraft_view view;
    struct aircraft_condition condition;
    uint8_t vehicle = telemetry_vehicle(self.telemetry);
    bool decided, waited, settled;

    (void)context;
    judge(&input, &health, &view, &condition, now_us);
    ask_vehicle(&condition, vehicle, now_us);
    /* The first HEARTBEAT says whether it is armed, or what it does. */
    decided = telemetry_heartbeat_us(self.telemetry) != INT64_MIN || condition.flies_unheard;
    waited = now_us - self.start_us >= AIRCRAFT_FRESH_US;
    /* Before, the pilot would be told that none came. */
    if (decided || (waited && telemetry_vehicle_speaks(self.telemetry, now_us))) {
        tell_pilot(vehicle, health_reason(&health), condition.armed, now_us);
        for (enum channel channel = 0; channel < CHANNELS; channel++) {
            pilot_channel(&self.pilot, vehicle, channel, &self.radios[channel], now_us);
        }
        pilot_sources(&self.pilot, vehicle, input.contradicted, now_us);
    }
    if (decided || waited) {
        /* Others keep it over power-offs: not whoever passed by, or was only expected. */
        settled = decided && telemetry_vehicle_settled(self.telemetry);
        keep(settled ? vehicle : self.kept.vehicle, &condition, now_us);
    }
    keep_channels();
    self.look_us += LOOK_US;
    if (self.look_us <= now_us) {
        self.look_us = now_us + LOOK_US;
    }
    loop_arm(&self.look, self.look_us);
}

/* ---- start and end ---- */

static void on_signal(void *context, uint32_t events, int64_t now_us)
{
    struct signalfd_siginfo info;

    (void)context;
    (void)events;
    (void)now_us;
    if (read(self.signals.fd, &info, sizeof(info)) == sizeof(info)) {
        log_info("ending on signal %u", info.ssi_signo);
        loop_stop();
    }
}

static void start_modules(int64_t now_us)
{
    self.start_us = self.look_us = now_us;
    asking_begin(&self.asking, now_us);
    self.telemetry = telemetry_init(on_update, NULL);
    self.aircraft = aircraft_init(config(), now_us);
    restore(now_us);
    pilot_init(&self.pilot, send_to_vehicle, NULL);
    status_start(config()->run_dir, gather, NULL);
    rfkill_start(now_us);
    bluetooth_start(config(), &self.radios[CHANNEL_BT4], &self.radios[CHANNEL_BT5], now_us);
    wifi_beacon_start(config(), &self.radios[CHANNEL_WIFI], now_us);
    restore_channels();
    link_start(config(), on_bytes, on_stream_reset, NULL, now_us);
    loop_timer_init(&self.look, on_look, NULL);
    broadcast_start(config(), self.aircraft, &self.lateness, now_us);
    loop_arm(&self.look, now_us);
    alive_start(now_us);
}

static int run_daemon(void)
{
    int result = loop_init();

    if (result == 0) {
        result = loop_watch_signals(&self.signals, 0, on_signal, NULL);
    }
    if (result < 0) {
        log_error("can't start the event loop: %s", strerror(-result));
        return EXIT_FAILURE;
    }
    result = sandbox_realtime();
    self.realtime = result == 0;
    if (result < 0) {
        log_warning("no real-time priority (%s): slots may be late under load", strerror(-result));
    }
    run_dir_prepare(config()->run_dir, config()->user, self.options.appliance);
    alive_open();
    result = sandbox_enter(config()->user, self.options.seccomp_log);
    if (result < 0) {
        return EXIT_FAILURE;
    }
    self.filter = result != SANDBOX_NO_FILTER;
    log_info("odid-daemon %s, process %d", ODID_VERSION, (int)getpid());
    start_modules(loop_now_us());
    result = loop_run();
    if (result < 0) {
        log_error("the event loop failed: %s", strerror(-result));
    }
    bluetooth_stop();
    if (config()->wifi_beacon_enabled) {
        wifi_beacon_stop();
    }
    return result < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

int main(int argc, char *argv[])
{
    if (!options_read(&self.options, argc, argv)) {
        return 2;
    }
    log_set_debug(config()->debug);
    if (self.options.version) {
        printf("odid-daemon %s\n", ODID_VERSION);
        return EXIT_SUCCESS;
    }
    if (self.options.check) {
        return self.options.errors + self.options.warnings > 0 ? EXIT_FAILURE : EXIT_SUCCESS;
    }
    return run_daemon();
}
