/*
 * odid-daemon: wires the modules together. Data flows one way:
 *
 *   link -> telemetry -> aircraft -> broadcast -> radios
 *
 * and status and pilot listen to all of them.
 */
#include <errno.h>
#include <pwd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <sys/stat.h>
#include <unistd.h>

#include "aircraft.h"
#include "alive.h"
#include "bluetooth.h"
#include "broadcast.h"
#include "health.h"
#include "kept.h"
#include "link.h"
#include "log.h"
#include "loop.h"
#include "options.h"
#include "pilot.h"
#include "radio.h"
#include "rfkill.h"
#include "sandbox.h"
#include "status.h"
#include "telemetry.h"
#include "wifi_beacon.h"

/* The pilot is told once a second, and at once when good turns into bad or bad into good. */
#define TELL_US 1000000
#define LOOK_US 250000
/* Positions slower than this are asked for ... */
#define POSITION_RATE_MIN_HZ 3.8
/* ... at this interval, ... */
#define POSITION_INTERVAL_US 200000
#define SYSTEM_TIME_INTERVAL_US 1000000
/* ... again after this long, doubling each time up to the second figure. */
#define ASK_AGAIN_US 10000000
#define ASK_AGAIN_MAX_US 80000000
/* MAVLink message ids that are asked for. */
#define ID_SYSTEM_TIME 2
#define ID_GLOBAL_POSITION_INT 33
#define ID_OPEN_DRONE_ID_LOCATION 12901

static struct {
    struct options options;
    struct telemetry *telemetry;
    struct aircraft *aircraft;
    struct radio radios[CHANNELS];
    struct pilot pilot;
    struct status_lateness lateness;
    struct kept kept; /* as it is in its file */
    struct loop_timer look;
    struct loop_watch signals;
    int64_t start_us, look_us, tell_us, ask_us, ask_wait_us;
    bool told_fault;
    bool realtime;
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
    telemetry_receive(self.telemetry, stream, bytes, length, now_us);
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
    char path[CONFIG_PATH_SIZE + 16];
    struct stat file;

    snprintf(path, sizeof(path), "%s/update", config()->run_dir);
    return stat(path, &file) == 0;
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
        .config_errors = self.options.errors,
        .filter_logging = self.options.seccomp_log,
        .realtime = self.realtime,
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
    snapshot->lateness = &self.lateness;
    snapshot->start_us = self.start_us;
    snapshot->vehicle = telemetry_vehicle(self.telemetry);
    snapshot->config_reports = self.options.reports;
    snapshot->config_report = (const char(*)[CONFIG_PROBLEM_SIZE])self.options.report;
}

/* An autopilot that offers positions slower than 4 Hz, or none, is asked for more. */
static void ask_for_positions(const struct aircraft_condition *condition, uint8_t vehicle,
                              int64_t now_us)
{
    bool slow = condition->position_rate_hz < POSITION_RATE_MIN_HZ; /* not while still unknown */

    if (!config()->request_rate || !condition->heartbeat_fresh || !slow || now_us < self.ask_us) {
        return;
    }
    pilot_ask_rate(&self.pilot, vehicle, ID_GLOBAL_POSITION_INT, POSITION_INTERVAL_US);
    if (condition->position_native) {
        pilot_ask_rate(&self.pilot, vehicle, ID_OPEN_DRONE_ID_LOCATION, POSITION_INTERVAL_US);
    }
    if (!condition->time_known) {
        pilot_ask_rate(&self.pilot, vehicle, ID_SYSTEM_TIME, SYSTEM_TIME_INTERVAL_US);
    }
    self.ask_us = now_us + self.ask_wait_us;
    self.ask_wait_us *= self.ask_wait_us < ASK_AGAIN_MAX_US ? 2 : 1;
}

/* The take-off point for a restart in flight only: that of a flight that ended must not pass for
 * the next one's. */
static void keep(uint8_t vehicle, bool armed)
{
    static const struct aircraft_takeoff none;
    const struct aircraft_takeoff *takeoff = armed ? aircraft_takeoff(self.aircraft) : &none;
    int result;

    if (vehicle == self.kept.vehicle &&
        memcmp(takeoff, &self.kept.takeoff, sizeof(*takeoff)) == 0) {
        return;
    }
    self.kept.vehicle = vehicle;
    self.kept.takeoff = *takeoff;
    result = kept_write(config()->run_dir, &self.kept);
    if (result < 0) {
        log_warning("can't keep vehicle and take-off point over a restart: %s/kept: %s",
                    config()->run_dir, strerror(-result));
    }
}

static void tell(uint8_t vehicle, const char *reason, int64_t now_us)
{
    bool fault = reason[0] != '\0';

    if (now_us >= self.tell_us || fault != self.told_fault) {
        pilot_tell(&self.pilot, vehicle, reason);
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

    (void)context;
    /* Not before the first HEARTBEAT: the pilot would be told that none came, and it decides
     * whether the kept take-off point counts. */
    if (telemetry_heartbeat_us(self.telemetry) != INT64_MIN) {
        judge(&input, &health, &view, &condition, now_us);
        tell(vehicle, health_reason(&health), now_us);
        for (enum channel channel = 0; channel < CHANNELS; channel++) {
            pilot_channel(&self.pilot, vehicle, channel, &self.radios[channel], now_us);
        }
        ask_for_positions(&condition, vehicle, now_us);
        keep(vehicle, condition.armed);
    }
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

/* On the appliance a boot script makes it; elsewhere we do, while we may. */
static void make_run_dir(void)
{
    const struct passwd *user = getpwnam(config()->user);

    if (mkdir(config()->run_dir, 0755) == 0 && user != NULL &&
        chown(config()->run_dir, user->pw_uid, user->pw_gid) == 0) {
        log_info("made %s", config()->run_dir);
    }
}

static void start_modules(int64_t now_us)
{
    self.start_us = self.look_us = self.ask_us = now_us;
    self.ask_wait_us = ASK_AGAIN_US;
    self.telemetry = telemetry_init(on_update, NULL);
    self.aircraft = aircraft_init(config(), now_us);
    kept_read(config()->run_dir, &self.kept);
    telemetry_expect(self.telemetry, self.kept.vehicle, now_us);
    aircraft_restore_takeoff(self.aircraft, &self.kept.takeoff);
    pilot_init(&self.pilot, send_to_vehicle, NULL);
    status_start(config()->run_dir, gather, NULL);
    rfkill_start(now_us);
    bluetooth_start(config(), &self.radios[CHANNEL_BT4], &self.radios[CHANNEL_BT5], now_us);
    wifi_beacon_start(config(), &self.radios[CHANNEL_WIFI], now_us);
    link_start(config(), on_bytes, on_stream_reset, NULL, now_us);
    loop_timer_init(&self.look, on_look, NULL);
    broadcast_start(config(), self.aircraft, &self.lateness, now_us);
    loop_arm(&self.look, now_us);
    alive_start(now_us);
}

static int run(void)
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
    make_run_dir();
    alive_open();
    if (sandbox_enter(config()->user, self.options.seccomp_log) < 0) {
        return EXIT_FAILURE;
    }
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
    return run();
}
