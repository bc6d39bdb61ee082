/*
 * A simulated flight for tests of aircraft: an autopilot whose messages are
 * switched on and off, on a simulated clock.
 */
#ifndef ODID_TESTS_FLIGHT_H
#define ODID_TESTS_FLIGHT_H

#include <common/mavlink.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/aircraft.h"

#define MS INT64_C(1000)
#define SECOND INT64_C(1000000)
#define UTC INT64_C(1790000000000000) /* Unix time at our time 0: 2026-09-21 13:33:20 */

#define assert_near(a, b) assert_true(fabs((a) - (b)) < 1e-6)
#define assert_about(a, b, limit) assert_true(fabs((a) - (b)) <= (limit))
#define assert_unknown(a) assert_true(isnan(a))

static struct config config;
static struct aircraft *aircraft;
static struct aircraft_view view;
static struct aircraft_condition condition;
static int64_t now_us;

/* The simulated autopilot. */
static struct {
    int64_t boot_at_us; /* when it started, on our clock */
    double rate;        /* its crystal's */
    int64_t utc_us;     /* Unix time at our time 0 */
    bool armed, heartbeat, position, time, gps, native;
    uint8_t system_status, mav_type, autopilot, fix_type;
    double gps_latitude_deg, gps_longitude_deg; /* its receiver's own; NAN: it doesn't say */
    double latitude_deg, longitude_deg, altitude_m, relative_m, north_mps, east_mps, up_mps;
    double gps_altitude_m; /* above the sea */
    uint64_t gps_time_us;  /* 0: it says none */
    double separation_m, horizontal_m, vertical_m, speed_mps;
    double native_ahead_s; /* native timestamps minus UTC */
} sim;

static inline void defaults(struct config *of)
{
    memset(of, 0, sizeof(*of));
    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        of->basic_id[i].id_type = 1;
        of->basic_id[i].ua_type = CONFIG_UA_TYPE_AUTO;
    }
    of->classification_type = 1;
    of->operator_latitude_deg = of->operator_longitude_deg = of->operator_altitude_m = NAN;
    of->bench_latitude_deg = of->bench_longitude_deg = NAN;
}

/* A fresh daemon at 1000 s, an autopilot up for 400 s that sends everything but native messages. */
static inline void begin(void)
{
    now_us = 1000 * SECOND;
    defaults(&config);
    memset(&sim, 0, sizeof(sim));
    sim.boot_at_us = 600 * SECOND;
    sim.rate = 1;
    sim.utc_us = UTC;
    sim.heartbeat = sim.position = sim.time = sim.gps = true;
    sim.system_status = MAV_STATE_ACTIVE;
    sim.mav_type = MAV_TYPE_QUADROTOR;
    sim.autopilot = MAV_AUTOPILOT_ARDUPILOTMEGA;
    sim.fix_type = 3;
    sim.latitude_deg = 57.7089;
    sim.longitude_deg = 11.9746;
    sim.gps_latitude_deg = sim.gps_longitude_deg = sim.gps_altitude_m = NAN;
    sim.altitude_m = 84;
    sim.separation_m = 36.4;
    sim.horizontal_m = 1.2;
    sim.vertical_m = 2.5;
    sim.speed_mps = 0.5;
    aircraft = aircraft_init(&config, now_us);
    memset(&view, 0, sizeof(view));
}

static inline int begin_setup(void **state)
{
    (void)state;
    begin();
    return 0;
}

static inline struct telemetry_update update_of(enum telemetry_kind kind)
{
    struct telemetry_update update;

    memset(&update, 0, sizeof(update));
    update.kind = kind;
    return update;
}

static inline void give(const struct telemetry_update *update)
{
    aircraft_update(aircraft, update, now_us);
}

static inline uint32_t boot_ms(int64_t at_us)
{
    return (uint32_t)(uint64_t)((double)(at_us - sim.boot_at_us) * sim.rate / 1000);
}

static inline void heartbeat(void)
{
    struct telemetry_update update = update_of(TELEMETRY_HEARTBEAT);

    update.heartbeat.mav_type = sim.mav_type;
    update.heartbeat.autopilot = sim.autopilot;
    update.heartbeat.base_mode = sim.armed ? MAV_MODE_FLAG_SAFETY_ARMED | 1 : 1;
    update.heartbeat.system_status = sim.system_status;
    give(&update);
}

static inline void arm(bool armed)
{
    sim.armed = armed;
    heartbeat();
}

/* A position stamped at one instant and arriving now. */
static inline void position_of(int64_t stamped_us)
{
    struct telemetry_update update = update_of(TELEMETRY_GLOBAL_POSITION);

    update.global_position.boot_ms = boot_ms(stamped_us);
    update.global_position.latitude_deg = sim.latitude_deg;
    update.global_position.longitude_deg = sim.longitude_deg;
    update.global_position.altitude_msl_m = sim.altitude_m;
    update.global_position.relative_altitude_m = sim.relative_m;
    update.global_position.north_mps = sim.north_mps;
    update.global_position.east_mps = sim.east_mps;
    update.global_position.up_mps = sim.up_mps;
    give(&update);
}

static inline void position(void)
{
    position_of(now_us);
}

static inline void system_time(void)
{
    struct telemetry_update update = update_of(TELEMETRY_SYSTEM_TIME);

    update.system_time.unix_us = (uint64_t)(sim.utc_us + now_us);
    update.system_time.boot_ms = boot_ms(now_us);
    give(&update);
}

static inline void gps(void)
{
    struct telemetry_update update = update_of(TELEMETRY_GPS_RAW);

    update.gps_raw.fix_type = sim.fix_type;
    update.gps_raw.time_us = sim.gps_time_us;
    update.gps_raw.altitude_msl_m = sim.gps_altitude_m;
    update.gps_raw.latitude_deg = sim.gps_latitude_deg;
    update.gps_raw.longitude_deg = sim.gps_longitude_deg;
    update.gps_raw.separation_m = sim.separation_m;
    update.gps_raw.horizontal_accuracy_m = sim.horizontal_m;
    update.gps_raw.vertical_accuracy_m = sim.vertical_m;
    update.gps_raw.speed_accuracy_mps = sim.speed_mps;
    give(&update);
}

static inline void home(double latitude_deg, double altitude_m)
{
    struct telemetry_update update = update_of(TELEMETRY_HOME);

    update.home.latitude_deg = latitude_deg;
    update.home.longitude_deg = isnan(latitude_deg) ? NAN : 11.5;
    update.home.altitude_msl_m = altitude_m;
    give(&update);
}

static inline void landed(uint8_t state)
{
    struct telemetry_update update = update_of(TELEMETRY_LANDED_STATE);

    update.landed_state = state;
    give(&update);
}

static inline double hour_s(int64_t unix_us)
{
    return (double)(unix_us % (3600 * SECOND)) * 1e-6;
}

/* What UTC is within the hour at an instant of our clock, in truth. */
static inline double true_hour_s(int64_t at_us)
{
    return hour_s(sim.utc_us + at_us);
}

/* a - b on the circle of an hour. */
static inline double hour_apart_s(double a, double b)
{
    double apart = fabs(a - b);

    return apart > 1800 ? 3600 - apart : apart;
}

/* A native LOCATION stamped at an instant: 1 degree north of plain telemetry, to tell them apart.
 */
static inline struct telemetry_update native_of(int64_t stamped_us)
{
    struct telemetry_update update = update_of(TELEMETRY_LOCATION);

    update.location.status = AIRCRAFT_AIRBORNE;
    update.location.direction_deg = 123;
    update.location.speed_mps = 7;
    update.location.vertical_speed_mps = -2;
    update.location.latitude_deg = sim.latitude_deg + 1;
    update.location.longitude_deg = sim.longitude_deg;
    update.location.altitude_barometric_m = 111;
    update.location.altitude_geodetic_m = 125; /* telemetry's: 84 + 36.4 */
    update.location.height_m = 3;
    update.location.horizontal_accuracy = 12;
    update.location.vertical_accuracy = 6;
    update.location.barometer_accuracy = 5;
    update.location.speed_accuracy = 4;
    update.location.timestamp_accuracy = 3;
    update.location.timestamp_s =
        fmod(hour_s(sim.utc_us + stamped_us) + 3600 + sim.native_ahead_s, 3600);
    return update;
}

static inline void native(void)
{
    struct telemetry_update update = native_of(now_us);

    give(&update);
}

static inline void look(void)
{
    aircraft_view(aircraft, now_us, &view);
    aircraft_condition(aircraft, now_us, &condition);
}

/* Lets time pass: positions five times a second, everything else once. Then looks. */
static inline void fly(double seconds)
{
    int64_t end = now_us + (int64_t)(seconds * 1e6 + 0.5);

    while (now_us < end) {
        int64_t step = 200 * MS - now_us % (200 * MS);

        now_us = now_us + step < end ? now_us + step : end;
        if (now_us % SECOND == 0) {
            if (sim.heartbeat) {
                heartbeat();
            }
            if (sim.gps) {
                gps();
            }
            if (sim.time) {
                system_time();
            }
        }
        if (now_us % (200 * MS) == 0) {
            if (sim.position) {
                position();
            }
            if (sim.native) {
                native();
            }
        }
    }
    look();
}

/* Lets time pass without a message. */
static inline void silence_us(int64_t us)
{
    now_us += us;
    look();
}

static inline bool from_native(void)
{
    return fabs(view.location.latitude_deg - sim.latitude_deg - 1) < 1e-6;
}

static inline bool from_telemetry(void)
{
    return fabs(view.location.latitude_deg - sim.latitude_deg) < 1e-6;
}

#endif
