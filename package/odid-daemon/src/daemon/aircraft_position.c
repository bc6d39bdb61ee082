/* Positions as they come, and which source's speaks: plain telemetry's or the native LOCATION's. */
#include <common/mavlink.h>
#include <math.h>
#include <string.h>

#include "base/earth.h"
#include "daemon/aircraft_state.h"

/* A native timestamp that is earlier by less was overtaken on the way; by more, the clock was set.
 */
#define OVERTAKEN_S 3.0
/* GPS time is ahead of UTC by the leap seconds: 18 s since 2017; one more or less may come. */
#define LEAP_MIN_S 16.0
#define LEAP_MAX_S 19.5
#define LEAP_SEEN 3
/* A lead that was measured too large, by our clock, is forgotten at this pace a message. */
#define LEAP_FORGET_S 0.02
/* A timestamp that is UTC lies between these from now: it comes late, and clocks differ. */
#define UTC_MIN_S -3.0
#define UTC_MAX_S 1.0

/* So far a native LOCATION may lie behind telemetry and pass for as new: between the two figures it
 * stays as it was judged before ... */
#define AS_NEW_US 400000
#define BEHIND_US 600000
/* ... and after it was behind once, only after so long. */
#define BEHIND_KEPT_US 10000000
/* Telemetry that lies behind the native LOCATION by more was lost on the way. */
#define LOST_US 1000000

/* What stands still may do so but for its last digits. */
#define STILL_M 2.0
#define STILL_HIGH_M 0.2

/* Who says a speed of less, and was so far away within so long, doesn't know how fast it is: an
 * estimator that sends no velocity says 0. */
#define RESTS_MPS 0.3
#define RESTS_VERTICAL_MPS 0.1
#define MOVED_M 30.0
#define ROSE_M 20.0
#define REST_LOOK_US 10000000

/* Messages come in bursts, GPS_RAW_INT anywhere among them: it confirms what came so shortly
 * before. */
#define CONFIRMED_WITHIN_US 1000000
/* Two positions that are so near in time are of one place, but for what it climbs meanwhile. */
#define BESIDE_S 0.5

bool aircraft_waits(const struct aircraft_waiting *waiting, int64_t now_us)
{
    return waiting->came_us != INT64_MIN && now_us - waiting->came_us < CONFIRMED_WITHIN_US;
}

bool aircraft_native_fresh(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft_fresh(aircraft->native_location.said_us, now_us);
}

/* ---- is there a fix? ---- */

/*
 * One of its receivers says so, or the autopilot dates and rates its native
 * position: since the receivers that are heard say that there is none, if they
 * do, for it may have another one. An estimator gives a position without any of
 * these. But a receiver that was heard and fell silent has been switched off in
 * the streams: the native position is the estimator's own, and would be held
 * against nothing any more.
 */
bool aircraft_fix_known(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft_receiver(aircraft, now_us) != NULL ||
           (aircraft_fresh(aircraft->native_rated_us, now_us) &&
            aircraft->native_rated_us > aircraft->no_fix_us &&
            !aircraft_receiver_fell_silent(aircraft, now_us));
}

/* At 0,0 the receiver itself has to be there. */
static bool counts(const struct aircraft *aircraft, double latitude_deg, double longitude_deg,
                   int64_t now_us)
{
    const struct aircraft_receiver *receiver = aircraft_receiver(aircraft, now_us);

    if (isnan(latitude_deg) || !aircraft_fix_known(aircraft, now_us)) {
        return false;
    }
    return !earth_is_near_zero(latitude_deg, longitude_deg) ||
           (receiver != NULL &&
            earth_is_near_zero(receiver->latitude_deg, receiver->longitude_deg));
}

/* ---- which one speaks ---- */

/*
 * The newest fix: but two that come at their own pace would take turns, and
 * with them every field that only one of them knows. So the native LOCATION
 * speaks as long as it keeps up with telemetry: which one alone doesn't show, for
 * it was the newest when it came.
 */
static void compare(struct aircraft *aircraft, int64_t now_us)
{
    int64_t behind_us;

    if (aircraft->native.fix_us == INT64_MIN || aircraft->telemetry.fix_us == INT64_MIN) {
        return;
    }
    behind_us = aircraft->telemetry.fix_us - aircraft->native.fix_us;
    if (behind_us > (aircraft->native_keeps_up ? BEHIND_US : AS_NEW_US)) {
        aircraft->native_behind_us = now_us;
    }
    aircraft->native_keeps_up = aircraft->native_rate.counted > 0 &&
                                (aircraft->native_behind_us == INT64_MIN ||
                                 now_us - aircraft->native_behind_us >= BEHIND_KEPT_US);
}

/* A native one that comes in mid-flight takes nothing at once from telemetry that was there; nor
 * later, when it came with somebody else who speaks as the autopilot. */
static bool native_was_there(const struct aircraft *aircraft, int64_t now_us)
{
    int64_t since_us = aircraft->native_location.since_us;
    int64_t until_us = aircraft->doubtful ? aircraft->doubtful_us : now_us;

    return since_us - aircraft->telemetry_since_us < BEHIND_KEPT_US ||
           until_us - since_us >= BEHIND_KEPT_US;
}

bool aircraft_fix_counts(const struct aircraft_fix *fix, int64_t now_us)
{
    return aircraft_fresh(fix->fix_us, now_us) && !aircraft_is_apart(fix, now_us);
}

const struct aircraft_fix *aircraft_best_fix(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_fix *native = &aircraft->native, *telemetry = &aircraft->telemetry;
    bool native_counts = aircraft_fix_counts(native, now_us);

    if (!aircraft_fix_counts(telemetry, now_us)) {
        return native_counts ? native : NULL;
    }
    return native_counts && native_was_there(aircraft, now_us) &&
                   (aircraft->native_keeps_up || native->fix_us - telemetry->fix_us > LOST_US)
               ? native
               : telemetry;
}

double aircraft_geodetic_m(const struct aircraft *aircraft, const struct aircraft_fix *fix,
                           int64_t now_us)
{
    double separation_m = aircraft_separation_m(aircraft, now_us);

    if (fix == &aircraft->native) {
        return aircraft->native_location.altitude_geodetic_m;
    }
    if (isnan(separation_m) && aircraft_fresh(aircraft->native.fix_us, now_us)) {
        separation_m = aircraft->native_separation_m;
    }
    return fix->altitude_msl_m + separation_m;
}

/* ---- how often ---- */

double aircraft_rate_hz(const struct aircraft_rate *rate, int64_t now_us)
{
    if (rate->counted == 0) {
        return NAN;
    }
    return aircraft_fresh(rate->last_us, now_us) ? 1e6 / (double)rate->interval_us : 0;
}

/* The mean interval of the last few: the first ones weigh alike. An interruption is none. */
static void count_position(struct aircraft_rate *rate, int64_t now_us)
{
    if (!aircraft_fresh(rate->last_us, now_us)) {
        rate->counted = 0;
        rate->interval_us = 0;
    } else if (now_us > rate->last_us) {
        rate->counted += rate->counted < AIRCRAFT_RATE_POSITIONS ? 1 : 0;
        rate->interval_us += (now_us - rate->last_us - rate->interval_us) / rate->counted;
    }
    rate->last_us = now_us;
}

static void move_to(const struct aircraft *aircraft, struct aircraft_fix *fix, double latitude_deg,
                    double longitude_deg, int64_t now_us)
{
    if (earth_distance_m(fix->moved_latitude_deg, fix->moved_longitude_deg, latitude_deg,
                         longitude_deg) > STILL_M) {
        fix->moved_us = now_us;
        fix->moved_latitude_deg = latitude_deg;
        fix->moved_longitude_deg = longitude_deg;
        if (aircraft_receiver(aircraft, now_us) == NULL) {
            fix->apart.since_us = fix->high.since_us =
                INT64_MIN; /* no receiver contradicts this one */
        }
    }
    fix->latitude_deg = latitude_deg;
    fix->longitude_deg = longitude_deg;
}

static void climb_to(struct aircraft_fix *fix, double altitude_m, int64_t now_us)
{
    if (!(fabs(altitude_m - fix->climbed_m) <= STILL_HIGH_M)) {
        fix->climbed_us = now_us;
        fix->climbed_m = altitude_m;
    }
}

/* Returns whether it is to be looked from where it is now. */
static bool watch(struct aircraft_rest *rest, bool says_so, double moved_m, double limit_m,
                  int64_t now_us)
{
    if (!says_so) {
        rest->since_us = INT64_MIN;
        rest->wrong = false;
        return false;
    }
    if (rest->since_us != INT64_MIN && moved_m > limit_m) {
        rest->wrong = true;
    } else if (rest->since_us != INT64_MIN && now_us - rest->since_us < REST_LOOK_US) {
        return false;
    } else {
        rest->wrong = false;
    }
    rest->since_us = now_us;
    return true;
}

static void watch_rest(struct aircraft_fix *fix, double speed_mps, double vertical_mps,
                       double altitude_m, int64_t now_us)
{
    double moved_m = earth_distance_m(fix->rest.latitude_deg, fix->rest.longitude_deg,
                                      fix->latitude_deg, fix->longitude_deg);

    if (watch(&fix->rest, speed_mps < RESTS_MPS, moved_m, MOVED_M, now_us)) {
        fix->rest.latitude_deg = fix->latitude_deg;
        fix->rest.longitude_deg = fix->longitude_deg;
    }
    if (watch(&fix->level, fabs(vertical_mps) < RESTS_VERTICAL_MPS,
              fabs(altitude_m - fix->level.altitude_m), ROSE_M, now_us)) {
        fix->level.altitude_m = altitude_m;
    }
}

/* ---- plain telemetry ---- */

void aircraft_keep_waiting(const struct aircraft *aircraft, struct aircraft_waiting *waiting,
                           int64_t now_us)
{
    if (aircraft_receivers_heard(aircraft, now_us)) { /* it was said that there is none */
        waiting->came_us = INT64_MIN;
    }
}

bool aircraft_confirm_position(struct aircraft *aircraft, int64_t now_us)
{
    struct aircraft_waiting *waiting = &aircraft->waiting_position;
    const struct telemetry_update *update = &waiting->update;
    struct aircraft_fix *fix = &aircraft->telemetry;

    if (!aircraft_waits(waiting, now_us) ||
        !counts(aircraft, update->global_position.latitude_deg,
                update->global_position.longitude_deg, now_us)) {
        return false;
    }
    waiting->came_us = INT64_MIN;
    if (!aircraft_fresh(fix->fix_us, now_us)) {
        aircraft->telemetry_since_us = now_us;
    }
    fix->fix_us = waiting->stamped_us;
    move_to(aircraft, fix, update->global_position.latitude_deg,
            update->global_position.longitude_deg, now_us);
    climb_to(fix, update->global_position.altitude_msl_m, now_us);
    fix->altitude_msl_m = update->global_position.altitude_msl_m;
    fix->relative_altitude_m = update->global_position.relative_altitude_m;
    fix->north_mps = update->global_position.north_mps;
    fix->east_mps = update->global_position.east_mps;
    fix->vertical_speed_mps =
        vertical_upright_mps(&aircraft->vertical, update->global_position.up_mps);
    watch_rest(fix, hypot(fix->north_mps, fix->east_mps), fix->vertical_speed_mps,
               fix->altitude_msl_m, now_us);
    count_position(&aircraft->telemetry_rate, now_us);
    compare(aircraft, now_us);
    return true;
}

bool aircraft_take_global_position(struct aircraft *aircraft, const struct telemetry_update *update,
                                   int64_t stamped_us, int64_t now_us)
{
    /* Nor does one from the future. */
    int64_t boot_us = (stamped_us < now_us ? stamped_us : now_us) - aircraft->clock.offset_us;
    bool moved = aircraft->position_boot_us == INT64_MIN ||
                 aircraft->position_boot != aircraft->clock.restarts ||
                 boot_us > aircraft->position_boot_us;

    /* One that says no place says nothing of when the next one is due. */
    if (!moved || isnan(update->global_position.latitude_deg)) {
        return false;
    }
    aircraft->position_boot = aircraft->clock.restarts;
    aircraft->position_boot_us = boot_us;
    vertical_position(&aircraft->vertical, boot_us, update->global_position.altitude_msl_m,
                      update->global_position.up_mps);
    aircraft->waiting_position = (struct aircraft_waiting){*update, stamped_us, now_us};
    if (!aircraft_confirm_position(aircraft, now_us)) {
        aircraft_keep_waiting(aircraft, &aircraft->waiting_position, now_us);
        return false;
    }
    return true;
}

/* ---- native LOCATION ---- */

/* a - b on the circle of an hour: -1800 to 1800 s. */
static double hour_difference_s(double a, double b)
{
    double difference = fmod(a - b + 5400, 3600) - 1800;

    return difference < -1800 ? difference + 3600 : difference;
}

static double hour_seconds(int64_t unix_us)
{
    return (double)(unix_us % INT64_C(3600000000)) * 1e-6;
}

/*
 * The native timestamp's instant on our clock; NAN-safe. ArduPilot stamps with
 * GPS time without the leap seconds: a constant 17-19 s ahead of SYSTEM_TIME
 * is corrected once it was seen three times, and unknown until then.
 * Returns false when the timestamp says nothing.
 */
static bool native_instant(struct aircraft *aircraft, double timestamp_s, int64_t now_us,
                           int64_t *instant_us)
{
    double ahead_s;

    if (isnan(timestamp_s) || !aircraft->clock.utc_known) {
        return false;
    }
    ahead_s = hour_difference_s(timestamp_s,
                                hour_seconds(autopilot_clock_unix_us(&aircraft->clock, now_us)));
    if (ahead_s > LEAP_MIN_S && ahead_s < LEAP_MAX_S) {
        /* Messages come late: the largest lead is the truest. */
        aircraft->leap_ahead_s = fmax(aircraft->leap_ahead_s - LEAP_FORGET_S, ahead_s);
        if (++aircraft->leap_seen >= LEAP_SEEN) {
            aircraft->leap_s = ceil(aircraft->leap_ahead_s - 0.1);
        }
    } else if (ahead_s > UTC_MIN_S && ahead_s <= UTC_MAX_S) {
        aircraft->leap_seen = 0;
        aircraft->leap_ahead_s = 0;
        aircraft->leap_s = 0;
    }
    ahead_s -= aircraft->leap_s; /* a message that comes very late has its sender's habit, too */
    if (ahead_s > UTC_MAX_S) {
        return false; /* from the future: not UTC */
    }
    *instant_us = now_us + (int64_t)(fmin(ahead_s, 0) * 1e6);
    return true;
}

/* Did the source's own timestamp move on, or, where it has none, anything else? */
static bool native_moved(const struct aircraft *aircraft, const struct telemetry_update *update)
{
    const struct aircraft_native_location *last = &aircraft->native_location;

    if (last->said_us == INT64_MIN) {
        return true;
    }
    if (!isnan(update->location.timestamp_s) && !isnan(last->timestamp_s)) {
        double ahead_s = hour_difference_s(update->location.timestamp_s, last->timestamp_s);

        return ahead_s > 1e-3 || ahead_s < -OVERTAKEN_S;
    }
    if (!isnan(update->location.timestamp_s) || !isnan(last->timestamp_s)) {
        return true;
    }
    return memcmp(&update->location, &last->received.location, sizeof(update->location)) != 0;
}

static void correct_px4(struct aircraft *aircraft, struct aircraft_native_location *native,
                        int64_t now_us)
{
    if (aircraft->autopilot != MAV_AUTOPILOT_PX4) {
        return;
    }
    /* PX4's geodetic altitude is above mean sea level, its barometric one 0 when unknown. */
    native->altitude_geodetic_m += aircraft_separation_m(aircraft, now_us);
    if (fabs(native->altitude_barometric_m) < 1e-6) {
        native->altitude_barometric_m = NAN;
    }
}

/* Where no receiver says it: the native altitude itself would be a second behind telemetry's place.
 */
static void learn_separation(struct aircraft *aircraft)
{
    const struct aircraft_fix *telemetry = &aircraft->telemetry;
    double since_s;

    if (telemetry->fix_us == INT64_MIN) {
        return;
    }
    since_s = (double)(aircraft->native.fix_us - telemetry->fix_us) * 1e-6;
    if (fabs(since_s) < BESIDE_S) {
        aircraft->native_separation_m =
            aircraft->native_location.altitude_geodetic_m -
            (telemetry->altitude_msl_m + telemetry->vertical_speed_mps * since_s);
    }
}

/* Of one that has lost its time, or lies there and says the same again and again, it counts, too.
 */
static void take_emergency(struct aircraft_native_location *native, uint8_t status, int64_t now_us)
{
    if (status != AIRCRAFT_EMERGENCY) {
        native->emergency_us = INT64_MIN;
        return;
    }
    if (!aircraft_fresh(native->emergency_us, now_us)) {
        native->emergency_since_us = now_us;
    }
    native->emergency_us = now_us;
}

bool aircraft_take_location(struct aircraft *aircraft, const struct telemetry_update *update,
                            int64_t now_us)
{
    struct aircraft_native_location *native = &aircraft->native_location;
    int64_t instant_us = now_us;
    bool instant_known;

    take_emergency(native, update->location.status, now_us);
    if (!native_moved(aircraft, update)) {
        return false;
    }
    if (!aircraft_native_fresh(aircraft, now_us)) {
        native->since_us = now_us;
    }
    native->statuses = aircraft_native_fresh(aircraft, now_us) &&
                               update->location.status == native->received.location.status
                           ? native->statuses + 1
                           : 1;
    instant_known = native_instant(aircraft, update->location.timestamp_s, now_us, &instant_us);
    native->said_us = instant_us;
    native->received = *update;
    native->timestamp_s = update->location.timestamp_s;
    /* Without a fix ArduPilot goes on with the last accuracy, and has no time for it. */
    if (!isnan(native->timestamp_s) && update->location.horizontal_accuracy != 0) {
        aircraft->native_rated_us = now_us;
    }
    if (!counts(aircraft, update->location.latitude_deg, update->location.longitude_deg, now_us)) {
        return false;
    }
    climb_to(&aircraft->native, update->location.altitude_geodetic_m, now_us);
    native->counted = *update;
    native->instant_known = instant_known;
    native->altitude_geodetic_m = update->location.altitude_geodetic_m;
    native->altitude_barometric_m = update->location.altitude_barometric_m;
    correct_px4(aircraft, native, now_us);
    aircraft->native.fix_us = instant_us;
    learn_separation(aircraft);
    move_to(aircraft, &aircraft->native, update->location.latitude_deg,
            update->location.longitude_deg, now_us);
    aircraft->native.altitude_msl_m = NAN;
    watch_rest(&aircraft->native, update->location.speed_mps, update->location.vertical_speed_mps,
               native->altitude_geodetic_m, now_us);
    count_position(&aircraft->native_rate, now_us);
    compare(aircraft, now_us);
    return true;
}
