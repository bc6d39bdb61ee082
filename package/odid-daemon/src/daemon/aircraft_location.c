/* The Location to broadcast: position, motion and status, each from the source that knows best. */
#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "daemon/aircraft_state.h"

/* Below this speed the course over ground is noise. */
#define COURSE_MIN_MPS 0.3
/* The native altitudes are those of telemetry, but for the weather between two instants and in the
 * pressure: what differs by more is above something else. */
#define ALTITUDES_DIFFER_M 15.0
#define CLIMBS_MPS 5.0
#define PRESSURE_DIFFERS_M 1500.0
/* Beside a place that is so much newer an altitude is another place's. */
#define ALTITUDE_LATE_US 500000
/* A Location timestamp says when within the hour: an older position can't be dated any more. */
#define POSITION_KEPT_US INT64_C(3590000000)

/* ---- position ---- */

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

/* It may have climbed as much between the two: after the autopilot's restart its first LOCATION
 * comes a second behind the last position. */
static double climbed_m(const struct aircraft *aircraft)
{
    const struct aircraft_fix *native = &aircraft->native, *telemetry = &aircraft->telemetry;
    double apart_s = fabs((double)(telemetry->fix_us - native->fix_us)) * 1e-6;

    return (CLIMBS_MPS + fabs(telemetry->vertical_speed_mps)) * apart_s;
}

/* Is what the native LOCATION has another one? It is as before (differed) where one of them isn't
 * known, or it may have climbed as much between the two. */
static bool native_differs(double native_m, double other_m, double climbed, bool differed)
{
    double difference_m = fabs(native_m - other_m);

    return difference_m > ALTITUDES_DIFFER_M + climbed ||
           (differed && !(difference_m + climbed <= ALTITUDES_DIFFER_M));
}

/* Above the take-off point, by the native altitude; NAN: one of the two isn't known. */
static double believed_native_height_m(const struct aircraft *aircraft, int64_t now_us)
{
    bool believed =
        !aircraft->altitudes_differ && !aircraft_altitude_is_apart(&aircraft->native, now_us);

    return believed ? aircraft_native_height_m(aircraft) : NAN;
}

void aircraft_compare_altitudes(struct aircraft *aircraft, int64_t now_us)
{
    double native_height_m = aircraft->native_location.counted.location.height_m;

    if (!aircraft_fresh(aircraft->native.fix_us, now_us)) {
        return;
    }
    if (!aircraft_fresh(aircraft->telemetry.fix_us, now_us)) {
        aircraft->heights_differ =
            native_differs(native_height_m, believed_native_height_m(aircraft, now_us), 0,
                           aircraft->heights_differ);
        return;
    }
    aircraft->altitudes_differ = native_differs(
        aircraft_geodetic_m(aircraft, &aircraft->native, now_us),
        aircraft_geodetic_m(aircraft, &aircraft->telemetry, now_us), climbed_m(aircraft),
        aircraft->altitudes_differ && !isnan(aircraft_separation_m(aircraft, now_us)));
    aircraft->heights_differ = native_differs(native_height_m, aircraft_height_m(aircraft),
                                              climbed_m(aircraft), aircraft->heights_differ);
}

bool aircraft_altitudes_differ(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft->altitudes_differ && aircraft_fresh(aircraft->native.fix_us, now_us);
}

static bool native_height_counts(const struct aircraft *aircraft)
{
    return aircraft->native_location.counted.location.height_reference ==
               MAV_ODID_HEIGHT_REF_OVER_GROUND ||
           !aircraft->heights_differ;
}

/*
 * Each field comes from the source whose position it is, and from the other one
 * where that doesn't know it.
 */
static void fill_from_telemetry(const struct aircraft *aircraft, int64_t now_us,
                                struct aircraft_location *out)
{
    const struct aircraft_receiver *receiver = aircraft_receiver(aircraft, now_us);
    bool altitude_counts = !aircraft_altitude_is_apart(&aircraft->telemetry, now_us) &&
                           out->fix_us - aircraft->telemetry.fix_us <= ALTITUDE_LATE_US;

    if (isnan(out->altitude_geodetic_m) && altitude_counts) {
        out->altitude_geodetic_m = aircraft_geodetic_m(aircraft, &aircraft->telemetry, now_us);
    }
    if (isnan(out->height_m) && altitude_counts) {
        out->height_m = aircraft_height_m(aircraft);
        out->height_above_ground = false;
    }
    /* Accuracies go with the fix: a filter that coasts has others. */
    if (receiver == NULL) {
        return;
    }
    if (out->horizontal_accuracy == 0) {
        out->horizontal_accuracy = accuracy_code(receiver->horizontal_accuracy_m, horizontal_code);
    }
    if (out->vertical_accuracy == 0) {
        out->vertical_accuracy = accuracy_code(receiver->vertical_accuracy_m, vertical_code);
    }
}

static void fill_from_native(const struct aircraft *aircraft, int64_t now_us,
                             struct aircraft_location *out)
{
    const struct aircraft_native_location *native = &aircraft->native_location;
    bool apart = aircraft_altitude_is_apart(&aircraft->native, now_us);

    out->altitude_barometric_m = native->altitude_barometric_m; /* telemetry has none */
    out->barometer_accuracy = native->counted.location.barometer_accuracy;
    if (isnan(out->altitude_geodetic_m) && !apart && !aircraft->altitudes_differ) {
        out->altitude_geodetic_m = native->altitude_geodetic_m;
    }
    if (isnan(out->height_m) && native_height_counts(aircraft)) {
        out->height_m = native->counted.location.height_m;
        out->height_above_ground =
            native->counted.location.height_reference == MAV_ODID_HEIGHT_REF_OVER_GROUND;
    }
    if (!aircraft_fix_known(aircraft, now_us)) {
        return;
    }
    if (out->horizontal_accuracy == 0) {
        out->horizontal_accuracy = native->counted.location.horizontal_accuracy;
    }
    if (out->vertical_accuracy == 0) {
        out->vertical_accuracy = native->counted.location.vertical_accuracy;
    }
}

static void view_telemetry_position(const struct aircraft *aircraft, int64_t now_us,
                                    struct aircraft_location *out)
{
    out->position_source = SOURCE_TELEMETRY;
    out->timestamp_s = hour_seconds_at(aircraft, aircraft->telemetry.fix_us);
    fill_from_telemetry(aircraft, now_us, out);
    if (aircraft_fix_counts(&aircraft->native, now_us)) {
        fill_from_native(aircraft, now_us, out);
    }
}

static void view_native_position(const struct aircraft *aircraft, int64_t now_us,
                                 struct aircraft_location *out)
{
    const struct aircraft_native_location *native = &aircraft->native_location;

    out->position_source = SOURCE_NATIVE;
    if (native->instant_known) {
        out->timestamp_s = hour_seconds_at(aircraft, aircraft->native.fix_us);
        out->timestamp_accuracy = native->counted.location.timestamp_accuracy;
    }
    fill_from_native(aircraft, now_us, out);
    if (aircraft_fix_counts(&aircraft->telemetry, now_us)) {
        fill_from_telemetry(aircraft, now_us, out);
    }
    if (isnan(out->height_m)) {
        out->height_m = believed_native_height_m(aircraft, now_us);
    }
}

static void view_fix(const struct aircraft *aircraft, const struct aircraft_fix *fix,
                     int64_t now_us, struct aircraft_location *out)
{
    out->position_fresh = true;
    out->fix_us = fix->fix_us;
    out->latitude_deg = fix->latitude_deg;
    out->longitude_deg = fix->longitude_deg;
    if (fix == &aircraft->native) {
        view_native_position(aircraft, now_us, out);
    } else {
        view_telemetry_position(aircraft, now_us, out);
    }
    if (fabs(out->altitude_barometric_m - out->altitude_geodetic_m) > PRESSURE_DIFFERS_M) {
        out->altitude_barometric_m = NAN; /* no weather does that */
        out->barometer_accuracy = 0;
    }
}

static void know_nothing(struct aircraft_location *out)
{
    memset(out, 0, sizeof(*out));
    out->fix_us = INT64_MIN;
    out->latitude_deg = out->longitude_deg = NAN;
    out->altitude_barometric_m = out->altitude_geodetic_m = out->height_m = NAN;
    out->direction_deg = out->speed_mps = out->vertical_speed_mps = NAN;
    out->timestamp_s = NAN;
}

/* One that came too late to count. */
static bool is_newer(const struct aircraft *aircraft, const struct aircraft_fix *fix)
{
    return fix->fix_us > aircraft->last.fix_us && fix->apart.since_us == INT64_MIN;
}

void aircraft_keep_location(struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_fix *fix = aircraft_best_fix(aircraft, now_us);

    if (fix == NULL && is_newer(aircraft, &aircraft->native)) {
        fix = &aircraft->native;
    } else if (fix == NULL && is_newer(aircraft, &aircraft->telemetry)) {
        fix = &aircraft->telemetry;
    }
    if (fix == NULL) {
        return;
    }
    know_nothing(&aircraft->last);
    view_fix(aircraft, fix, now_us, &aircraft->last);
    aircraft->last.position_fresh = false;
    aircraft->last.horizontal_accuracy = aircraft->last.vertical_accuracy = 0;
}

/* On a bench nothing is armed, nor has an autopilot had a place: in flight a lost one stays lost.
 */
static bool bench_counts(const struct aircraft *aircraft)
{
    return !isnan(aircraft->config->bench_latitude_deg) && !aircraft->armed &&
           aircraft->last.fix_us == INT64_MIN;
}

static void view_position(const struct aircraft *aircraft, int64_t now_us,
                          struct aircraft_location *out)
{
    const struct aircraft_fix *fix = aircraft_best_fix(aircraft, now_us);

    if (fix != NULL) {
        view_fix(aircraft, fix, now_us, out);
    } else if (bench_counts(aircraft)) {
        out->position_source = SOURCE_CONFIGURATION;
        out->latitude_deg = aircraft->config->bench_latitude_deg;
        out->longitude_deg = aircraft->config->bench_longitude_deg;
    } else if (aircraft->last.fix_us != INT64_MIN &&
               now_us - aircraft->last.fix_us <= POSITION_KEPT_US) {
        *out = aircraft->last;
    }
}

/* ---- motion: of the source whose position it is ---- */

static bool native_motion_known(const struct aircraft *aircraft)
{
    const struct telemetry_update *native = &aircraft->native_location.counted;

    return !isnan(native->location.direction_deg) || !isnan(native->location.speed_mps) ||
           !isnan(native->location.vertical_speed_mps);
}

static void fill_motion_from_telemetry(const struct aircraft *aircraft, int64_t now_us,
                                       struct aircraft_location *out)
{
    const struct aircraft_receiver *receiver = aircraft_receiver(aircraft, now_us);
    const struct aircraft_fix *fix = &aircraft->telemetry;
    double speed_mps = hypot(fix->north_mps, fix->east_mps);

    if (isnan(out->speed_mps) && !fix->rest.wrong) {
        out->speed_mps = speed_mps;
    }
    if (isnan(out->vertical_speed_mps) && !fix->level.wrong) {
        out->vertical_speed_mps = fix->vertical_speed_mps;
    }
    if (isnan(out->direction_deg) && speed_mps >= COURSE_MIN_MPS) {
        out->direction_deg = fmod(atan2(fix->east_mps, fix->north_mps) * 180 / M_PI + 360, 360);
    }
    if (out->speed_accuracy == 0 && receiver != NULL) {
        out->speed_accuracy = accuracy_code(receiver->speed_accuracy_mps, speed_code);
    }
}

static void fill_motion_from_native(const struct aircraft *aircraft, struct aircraft_location *out)
{
    const struct telemetry_update *native = &aircraft->native_location.counted;

    out->speed_mps = aircraft->native.rest.wrong ? NAN : native->location.speed_mps;
    out->vertical_speed_mps =
        aircraft->native.level.wrong ? NAN : native->location.vertical_speed_mps;
    /* A course without a speed says nothing. */
    out->direction_deg =
        native->location.speed_mps < COURSE_MIN_MPS ? NAN : native->location.direction_deg;
    out->speed_accuracy = native->location.speed_accuracy;
}

static void view_motion(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_location *out)
{
    bool telemetry = aircraft_fix_counts(&aircraft->telemetry, now_us);
    bool native = aircraft_fix_counts(&aircraft->native, now_us) && native_motion_known(aircraft) &&
                  (!telemetry || out->position_source == SOURCE_NATIVE);

    if (native) {
        out->motion_source = SOURCE_NATIVE;
        fill_motion_from_native(aircraft, out);
    } else if (telemetry) {
        out->motion_source = SOURCE_TELEMETRY;
    }
    if (telemetry) {
        fill_motion_from_telemetry(aircraft, now_us, out);
    }
}

void aircraft_view_location(const struct aircraft *aircraft, int64_t now_us,
                            struct aircraft_location *out)
{
    know_nothing(out);
    view_position(aircraft, now_us, out);
    view_motion(aircraft, now_us, out);
    aircraft_view_status(aircraft, now_us, out);
}
