/* The Location to broadcast: position, motion and status, each from the source that knows best. */
#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>

#include "aircraft_state.h"

/* Data are at most this old when sent, ASTM F3411: where there is a newer position, it is taken. */
#define NATIVE_PREFERRED_US 1000000
/* Below this speed the course over ground is noise. */
#define COURSE_MIN_MPS 0.3
/* A Location timestamp says when within the hour: an older position can't be dated any more. */
#define POSITION_KEPT_US INT64_C(3590000000)

/* ---- position ---- */

/*
 * Is the native LOCATION what speaks? While it is fresh; but one of over a
 * second gives way to newer telemetry: a message that was lost must not age
 * what is sent.
 */
static bool native_speaks(const struct aircraft *aircraft, int64_t now_us)
{
    int64_t native_us = aircraft->native.fix_us, telemetry_us = aircraft->telemetry.fix_us;

    return aircraft_fresh(native_us, now_us) &&
           (now_us - native_us <= NATIVE_PREFERRED_US || telemetry_us <= native_us);
}

const struct aircraft_fix *aircraft_best_fix(const struct aircraft *aircraft, int64_t now_us)
{
    if (native_speaks(aircraft, now_us) && !isnan(aircraft->native.latitude_deg)) {
        return &aircraft->native;
    }
    if (aircraft_fresh(aircraft->telemetry.fix_us, now_us)) {
        return &aircraft->telemetry;
    }
    return NULL;
}

/* The last position that is still worth saying, when no source is fresh. */
static const struct aircraft_fix *last_fix(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_fix *fix = &aircraft->telemetry;

    if (!isnan(aircraft->native.latitude_deg) && aircraft->native.fix_us > fix->fix_us) {
        fix = &aircraft->native;
    }
    if (fix->fix_us == INT64_MIN || now_us - fix->fix_us > POSITION_KEPT_US) {
        return NULL;
    }
    return fix;
}

double aircraft_geodetic_m(const struct aircraft *aircraft, const struct aircraft_fix *fix)
{
    return fix == &aircraft->native ? aircraft->native_location.altitude_geodetic_m
                                    : fix->altitude_msl_m + aircraft->separation_m;
}

/* relative_alt is above home, which can move in flight: it counts only before arming. */
static double height_m(const struct aircraft *aircraft, const struct aircraft_fix *fix)
{
    if (aircraft->takeoff.known) {
        return fix->altitude_msl_m - aircraft->takeoff.altitude_msl_m;
    }
    return aircraft->armed ? NAN : fix->relative_altitude_m;
}

static double hour_seconds_at(const struct aircraft *aircraft, int64_t at_us)
{
    if (!aircraft->clock.utc_known) {
        return NAN;
    }
    return (double)(autopilot_clock_unix_us(&aircraft->clock, at_us) % INT64_C(3600000000)) * 1e-6;
}

static uint8_t accuracy_code(double value, int (*code)(float))
{
    return isnan(value) ? 0 : (uint8_t)code((float)value);
}

static int horizontal_code(float accuracy_m)
{
    return createEnumHorizontalAccuracy(accuracy_m);
}

static int vertical_code(float accuracy_m)
{
    return createEnumVerticalAccuracy(accuracy_m);
}

static int speed_code(float accuracy_mps)
{
    return createEnumSpeedAccuracy(accuracy_mps);
}

/* Altitudes and accuracies that nothing better has said. */
static void fill_from_telemetry(const struct aircraft *aircraft, int64_t now_us,
                                struct aircraft_location *out)
{
    const struct aircraft_fix *fix = &aircraft->telemetry;

    if (isnan(out->altitude_geodetic_m)) {
        out->altitude_geodetic_m = aircraft_geodetic_m(aircraft, fix);
    }
    if (isnan(out->height_m)) {
        out->height_m = height_m(aircraft, fix);
        out->height_above_ground = false;
    }
    if (!aircraft_fresh(aircraft->gps_us, now_us)) {
        return;
    }
    if (out->horizontal_accuracy == 0) {
        out->horizontal_accuracy = accuracy_code(aircraft->horizontal_accuracy_m, horizontal_code);
    }
    if (out->vertical_accuracy == 0) {
        out->vertical_accuracy = accuracy_code(aircraft->vertical_accuracy_m, vertical_code);
    }
}

static void view_telemetry_position(const struct aircraft *aircraft, int64_t now_us,
                                    struct aircraft_location *out)
{
    out->position_source = SOURCE_TELEMETRY;
    out->timestamp_s = hour_seconds_at(aircraft, aircraft->telemetry.fix_us);
    fill_from_telemetry(aircraft, now_us, out);
}

static void view_native_position(const struct aircraft *aircraft, int64_t now_us,
                                 struct aircraft_location *out)
{
    const struct aircraft_native_location *native = &aircraft->native_location;

    out->position_source = SOURCE_NATIVE;
    out->altitude_geodetic_m = native->altitude_geodetic_m;
    out->altitude_barometric_m = native->altitude_barometric_m;
    out->height_m = native->received.location.height_m;
    out->height_above_ground =
        native->received.location.height_reference == MAV_ODID_HEIGHT_REF_OVER_GROUND;
    out->horizontal_accuracy = native->received.location.horizontal_accuracy;
    out->vertical_accuracy = native->received.location.vertical_accuracy;
    out->barometer_accuracy = native->received.location.barometer_accuracy;
    if (native->instant_known) {
        out->timestamp_s = hour_seconds_at(aircraft, aircraft->native.fix_us);
        out->timestamp_accuracy = native->received.location.timestamp_accuracy;
    }
    if (aircraft_fresh(aircraft->telemetry.fix_us, now_us)) {
        fill_from_telemetry(aircraft, now_us, out);
    }
}

static void view_position(const struct aircraft *aircraft, int64_t now_us,
                          struct aircraft_location *out)
{
    const struct aircraft_fix *fix = aircraft_best_fix(aircraft, now_us);

    out->position_fresh = fix != NULL;
    if (fix == NULL && !isnan(aircraft->config->bench_latitude_deg)) {
        out->position_source = SOURCE_CONFIGURATION;
        out->latitude_deg = aircraft->config->bench_latitude_deg;
        out->longitude_deg = aircraft->config->bench_longitude_deg;
        return;
    }
    if (fix == NULL) {
        fix = last_fix(aircraft, now_us);
    }
    if (fix == NULL) {
        return;
    }
    out->fix_us = fix->fix_us;
    out->latitude_deg = fix->latitude_deg;
    out->longitude_deg = fix->longitude_deg;
    if (fix == &aircraft->native) {
        view_native_position(aircraft, now_us, out);
    } else {
        view_telemetry_position(aircraft, now_us, out);
    }
}

/* ---- motion ---- */

static bool native_motion_known(const struct aircraft *aircraft)
{
    const struct telemetry_update *native = &aircraft->native_location.received;

    return !isnan(native->location.direction_deg) || !isnan(native->location.speed_mps) ||
           !isnan(native->location.vertical_speed_mps);
}

/* What no native message has said. */
static void fill_motion(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_location *out)
{
    const struct aircraft_fix *fix = &aircraft->telemetry;
    double speed_mps = hypot(fix->north_mps, fix->east_mps);

    if (isnan(out->speed_mps)) {
        out->speed_mps = speed_mps;
    }
    if (isnan(out->vertical_speed_mps)) {
        out->vertical_speed_mps = fix->vertical_speed_mps;
    }
    if (isnan(out->direction_deg) && speed_mps >= COURSE_MIN_MPS) {
        out->direction_deg = fmod(atan2(fix->east_mps, fix->north_mps) * 180 / M_PI + 360, 360);
    }
    if (out->speed_accuracy == 0 && aircraft_fresh(aircraft->gps_us, now_us)) {
        out->speed_accuracy = accuracy_code(aircraft->speed_accuracy_mps, speed_code);
    }
}

static void view_motion(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_location *out)
{
    bool telemetry = aircraft_fresh(aircraft->telemetry.fix_us, now_us);

    if (native_speaks(aircraft, now_us) && native_motion_known(aircraft)) {
        const struct telemetry_update *native = &aircraft->native_location.received;

        out->motion_source = SOURCE_NATIVE;
        out->direction_deg = native->location.direction_deg;
        out->speed_mps = native->location.speed_mps;
        out->vertical_speed_mps = native->location.vertical_speed_mps;
        out->speed_accuracy = native->location.speed_accuracy;
    } else if (telemetry) {
        out->motion_source = SOURCE_TELEMETRY;
    }
    if (telemetry) {
        fill_motion(aircraft, now_us, out);
    }
}

/* ---- status ---- */

static enum aircraft_status telemetry_status(const struct aircraft *aircraft, int64_t now_us)
{
    if (!aircraft_fresh(aircraft->heartbeat_us, now_us)) {
        return AIRCRAFT_UNDECLARED;
    }
    if (aircraft->system_status == MAV_STATE_EMERGENCY) {
        return AIRCRAFT_EMERGENCY;
    }
    if (aircraft_fresh(aircraft->landed_us, now_us)) {
        switch (aircraft->landed_state) {
        case MAV_LANDED_STATE_ON_GROUND:
            return AIRCRAFT_GROUND;
        case MAV_LANDED_STATE_IN_AIR:
        case MAV_LANDED_STATE_TAKEOFF:
        case MAV_LANDED_STATE_LANDING:
            return AIRCRAFT_AIRBORNE;
        default:
            break;
        }
    }
    return aircraft->armed ? AIRCRAFT_AIRBORNE : AIRCRAFT_GROUND;
}

static void view_status(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_location *out)
{
    uint8_t native = aircraft->native_location.received.location.status;
    bool starting = now_us - aircraft->start_us < AIRCRAFT_FRESH_US;
    bool bench = out->position_source == SOURCE_CONFIGURATION;

    out->status = telemetry_status(aircraft, now_us);
    out->status_source = out->status == AIRCRAFT_UNDECLARED ? SOURCE_NONE : SOURCE_TELEMETRY;
    /* An emergency counts from whichever source says so. */
    if (aircraft_fresh(aircraft->native.fix_us, now_us) && native != AIRCRAFT_UNDECLARED &&
        native <= AIRCRAFT_REMOTE_ID_FAILURE && out->status != AIRCRAFT_EMERGENCY) {
        out->status = native;
        out->status_source = SOURCE_NATIVE;
    }
    if (out->status == AIRCRAFT_EMERGENCY || starting || bench) {
        return; /* an emergency that is known now is worth more than what else is missing */
    }
    if (!out->position_fresh || !aircraft_fresh(aircraft->heartbeat_us, now_us)) {
        out->status = AIRCRAFT_REMOTE_ID_FAILURE;
    }
}

void aircraft_view_location(const struct aircraft *aircraft, int64_t now_us,
                            struct aircraft_location *out)
{
    out->fix_us = INT64_MIN;
    out->latitude_deg = out->longitude_deg = NAN;
    out->altitude_barometric_m = out->altitude_geodetic_m = out->height_m = NAN;
    out->direction_deg = out->speed_mps = out->vertical_speed_mps = NAN;
    out->timestamp_s = NAN;
    view_position(aircraft, now_us, out);
    view_motion(aircraft, now_us, out);
    view_status(aircraft, now_us, out);
}
