/* The GNSS receivers behind the autopilot's estimator: who has a fix, and is the position where
 * that receiver is? */
#include <common/mavlink.h>
#include <math.h>

#include "base/earth.h"
#include "daemon/aircraft_state.h"

/* An estimator is that far from its receiver at most, beside what the accuracies say, ... */
#define APART_M 30.0
#define ACCURACY_UNKNOWN_M 10.0
/* ... what it flew since its last position, and a receiver's own delay; */
#define DELAY_S 0.5
/* or it is wrong, when it stays so for that long: an estimator refuses a receiver that jumps away
 * for some ten seconds, rightly; ... */
#define APART_US 12000000
/* ... but one that doesn't move any more while a receiver does has stopped. */
#define STILL_US 2000000
#define STILL_APART_US 3000000
/* Of altitudes: an estimator goes by its barometer, which the weather lifts by tens of metres in a
 * long flight. */
#define HIGH_APART_M 60.0
#define HIGH_ACCURACY_UNKNOWN_M 15.0
/* ... and cold or warm air by a part of the height: an altitude that moves may be off by it. */
#define HIGH_APART_OF_HEIGHT 0.15

/* Who is near for a moment was apart all the same: of that time a fifth of the time since is
 * forgotten. */
#define FORGOTTEN_PACE 5

/* Whoever forges words for so long is seen (belief). Who said fewer contradicts nobody. */
#define ENOUGH_US 10000000

enum { TELEMETRY, NATIVE };

static void is_now_apart(struct aircraft_apart *apart, int64_t now_us)
{
    int64_t kept_us = apart->for_us - (now_us - apart->until_us) / FORGOTTEN_PACE;

    if (apart->since_us == INT64_MIN) {
        apart->since_us = now_us - (kept_us > 0 ? kept_us : 0);
    }
}

static void is_now_near(struct aircraft_apart *apart, int64_t now_us)
{
    if (apart->since_us == INT64_MIN) {
        return;
    }
    apart->for_us = now_us - apart->since_us < APART_US ? now_us - apart->since_us : APART_US;
    apart->until_us = now_us;
    apart->since_us = INT64_MIN;
}

/* Nobody says any more whether it is right. */
static void forget_contradicted(struct aircraft_fix *fix)
{
    if (fix->apart.since_us != INT64_MIN) {
        fix->fix_us = INT64_MIN;
    }
    fix->apart = fix->high = (struct aircraft_apart){.since_us = INT64_MIN};
}

void aircraft_forget_receivers(struct aircraft *aircraft)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        aircraft->receiver[i].said_us = INT64_MIN;
        aircraft->receiver[i].words.enough = false;
        aircraft->receiver[i].near_us[TELEMETRY] = aircraft->receiver[i].near_us[NATIVE] =
            INT64_MIN;
    }
    aircraft->no_fix_us = INT64_MIN;
    aircraft->receivers = (struct aircraft_apart){.since_us = INT64_MIN};
    forget_contradicted(&aircraft->telemetry);
    forget_contradicted(&aircraft->native);
}

static bool is_near(const struct aircraft_receiver *receiver, int64_t now_us)
{
    return aircraft_fresh(receiver->near_us[TELEMETRY], now_us) ||
           aircraft_fresh(receiver->near_us[NATIVE], now_us);
}

/* Two dimensions are less than three; what is more than three makes no difference here. 0: no fix.
 */
static unsigned worth(const struct aircraft_receiver *receiver, int64_t now_us)
{
    if (!aircraft_fresh(receiver->said_us, now_us) || receiver->fix_type < GPS_FIX_TYPE_2D_FIX) {
        return 0;
    }
    return 1 + (receiver->fix_type > GPS_FIX_TYPE_2D_FIX ? 2 : 0) + is_near(receiver, now_us);
}

const struct aircraft_receiver *aircraft_receiver(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_receiver *best = NULL;
    unsigned most = 0;

    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        unsigned has = worth(&aircraft->receiver[i], now_us);

        if (has > most) {
            best = &aircraft->receiver[i];
            most = has;
        }
    }
    return best;
}

bool aircraft_receivers_heard(const struct aircraft *aircraft, int64_t now_us)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        if (aircraft_fresh(aircraft->receiver[i].said_us, now_us)) {
            return true;
        }
    }
    return false;
}

bool aircraft_receiver_fell_silent(const struct aircraft *aircraft, int64_t now_us)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        const struct aircraft_receiver *receiver = &aircraft->receiver[i];

        if (receiver->words.enough && !aircraft_fresh(receiver->said_us, now_us)) {
            return true;
        }
    }
    return false;
}

static bool another_is_near(const struct aircraft *aircraft, unsigned which, int64_t now_us)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        if (aircraft_fresh(aircraft->receiver[i].near_us[which], now_us)) {
            return true;
        }
    }
    return false;
}

static double accuracy_m(const struct aircraft_receiver *receiver)
{
    return isnan(receiver->horizontal_accuracy_m) ? ACCURACY_UNKNOWN_M
                                                  : receiver->horizontal_accuracy_m;
}

static void compare(struct aircraft *aircraft, struct aircraft_receiver *receiver, unsigned which,
                    double speed_mps, int64_t now_us)
{
    struct aircraft_fix *fix = which == NATIVE ? &aircraft->native : &aircraft->telemetry;
    double limit_m;

    if (!aircraft_fresh(fix->fix_us, now_us) || isnan(receiver->latitude_deg)) {
        return;
    }
    limit_m = APART_M + 2 * accuracy_m(receiver) +
              speed_mps * (DELAY_S + fabs((double)(now_us - fix->fix_us)) * 1e-6);
    if (earth_distance_m(receiver->latitude_deg, receiver->longitude_deg, fix->latitude_deg,
                         fix->longitude_deg) <= limit_m) {
        receiver->near_us[which] = now_us;
        is_now_near(&fix->apart, now_us);
        return;
    }
    receiver->near_us[which] = INT64_MIN;
    if (receiver->words.enough && !another_is_near(aircraft, which, now_us)) {
        is_now_apart(&fix->apart, now_us);
    }
}

static bool both_have_a_fix(const struct aircraft *aircraft, int64_t now_us)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        const struct aircraft_receiver *receiver = &aircraft->receiver[i];

        if (!aircraft_fresh(receiver->said_us, now_us) || isnan(receiver->latitude_deg) ||
            receiver->fix_type < GPS_FIX_TYPE_3D_FIX) {
            return false;
        }
    }
    return true;
}

/* Each says so once a second, and not at once. */
static bool are_apart(const struct aircraft_receiver *a, const struct aircraft_receiver *b,
                      double speed_mps)
{
    double limit_m = APART_M + 2 * (accuracy_m(a) + accuracy_m(b)) +
                     speed_mps * (2 * DELAY_S + fabs((double)(a->said_us - b->said_us)) * 1e-6);

    return earth_distance_m(a->latitude_deg, a->longitude_deg, b->latitude_deg, b->longitude_deg) >
           limit_m;
}

static void compare_receivers(struct aircraft *aircraft, double speed_mps, int64_t now_us)
{
    if (both_have_a_fix(aircraft, now_us) &&
        are_apart(&aircraft->receiver[0], &aircraft->receiver[1], speed_mps)) {
        is_now_apart(&aircraft->receivers, now_us);
    } else {
        is_now_near(&aircraft->receivers, now_us);
    }
}

bool aircraft_receivers_differ(const struct aircraft *aircraft, int64_t now_us)
{
    return both_have_a_fix(aircraft, now_us) && aircraft->receivers.since_us != INT64_MIN &&
           now_us - aircraft->receivers.since_us >= APART_US;
}

static double or_zero(double value)
{
    return isnan(value) ? 0 : fabs(value);
}

/* above_m: of the fix, above the receiver. climbs_mps, height_m: NAN where that isn't known. */
static void compare_altitude(const struct aircraft *aircraft,
                             const struct aircraft_receiver *receiver, struct aircraft_fix *fix,
                             double above_m, double climbs_mps, double height_m, int64_t now_us)
{
    double accuracy_m = isnan(receiver->vertical_accuracy_m) ? HIGH_ACCURACY_UNKNOWN_M
                                                             : receiver->vertical_accuracy_m;
    double limit_m = HIGH_APART_M + 3 * accuracy_m;

    if (!aircraft_fresh(fix->fix_us, now_us) || aircraft_receiver(aircraft, now_us) != receiver) {
        return;
    }
    limit_m += or_zero(climbs_mps) * (DELAY_S + fabs((double)(now_us - fix->fix_us)) * 1e-6);
    if (now_us - fix->climbed_us <= STILL_US) {
        limit_m += HIGH_APART_OF_HEIGHT * or_zero(height_m);
    }
    if (!(fabs(above_m) > limit_m)) { /* nor where one of the two isn't known */
        is_now_near(&fix->high, now_us);
    } else if (receiver->words.enough) {
        is_now_apart(&fix->high, now_us);
    }
}

/* A receiver that falls silent takes nothing back. */
static bool lasts(const struct aircraft_fix *fix, const struct aircraft_apart *apart,
                  int64_t moved_us, int64_t now_us)
{
    int64_t limit_us = now_us - moved_us > STILL_US ? STILL_APART_US : APART_US;

    return aircraft_fresh(fix->fix_us, now_us) && apart->since_us != INT64_MIN &&
           now_us - apart->since_us >= limit_us;
}

bool aircraft_is_apart(const struct aircraft_fix *fix, int64_t now_us)
{
    return lasts(fix, &fix->apart, fix->moved_us, now_us);
}

bool aircraft_altitude_is_apart(const struct aircraft_fix *fix, int64_t now_us)
{
    return lasts(fix, &fix->high, fix->climbed_us, now_us);
}

/* One that hangs, or its driver, repeats its last fix with the time that it had. */
static bool is_repeated(const struct aircraft_receiver *receiver,
                        const struct telemetry_update *update)
{
    bool moved = update->gps_raw.latitude_deg != receiver->latitude_deg ||
                 update->gps_raw.longitude_deg != receiver->longitude_deg;

    return update->gps_raw.time_us != 0 && update->gps_raw.time_us == receiver->time_us &&
           update->gps_raw.fix_type >= GPS_FIX_TYPE_2D_FIX &&
           update->gps_raw.fix_type == receiver->fix_type &&
           (!moved || isnan(update->gps_raw.latitude_deg));
}

/* Only such are left that know no height. */
static void forget_heights(struct aircraft *aircraft, const struct aircraft_receiver *receiver,
                           int64_t now_us)
{
    if (aircraft_receiver(aircraft, now_us) == receiver) {
        aircraft->telemetry.high.since_us = aircraft->native.high.since_us = INT64_MIN;
    }
}

/* Once there were enough, there were. said_us: the time before. */
static void count_word(const struct aircraft *aircraft, struct aircraft_words *words,
                       int64_t said_us, int64_t now_us)
{
    if (aircraft->doubtful || !aircraft_fresh(said_us, now_us)) {
        words->since_us = now_us;
    }
    words->enough = words->enough || now_us - words->since_us >= ENOUGH_US;
}

static void take_separation(struct aircraft *aircraft, const struct aircraft_receiver *receiver,
                            int64_t now_us)
{
    const struct aircraft_receiver *best = aircraft_receiver(aircraft, now_us);
    struct aircraft_separation *separation = &aircraft->separation;

    if (!isnan(receiver->separation_m) &&
        (best == receiver || best == NULL || isnan(best->separation_m))) {
        separation->m = receiver->separation_m;
        separation->words.enough = false;
        count_word(aircraft, &separation->words, separation->said_us, now_us);
        separation->said_us = now_us;
        if (separation->words.enough) {
            separation->lasting_m = separation->m;
        }
    }
}

double aircraft_separation_m(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_separation *separation = &aircraft->separation;

    if (!isnan(separation->lasting_m)) {
        return separation->lasting_m;
    }
    return aircraft_fresh(separation->said_us, now_us) ? separation->m : NAN;
}

void aircraft_take_gps_raw(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us)
{
    struct aircraft_receiver *receiver =
        &aircraft->receiver[update->kind == TELEMETRY_GPS2_RAW ? 1 : 0];
    double native_mps = aircraft->native_location.received.location.speed_mps;
    double speed_mps = hypot(aircraft->telemetry.north_mps, aircraft->telemetry.east_mps);

    if (is_repeated(receiver, update)) {
        return;
    }
    count_word(aircraft, &receiver->words, receiver->said_us, now_us);
    receiver->said_us = now_us;
    receiver->time_us = update->gps_raw.time_us;
    receiver->separation_m = update->gps_raw.separation_m;
    receiver->fix_type = update->gps_raw.fix_type;
    receiver->latitude_deg = update->gps_raw.latitude_deg;
    receiver->longitude_deg = update->gps_raw.longitude_deg;
    receiver->horizontal_accuracy_m = update->gps_raw.horizontal_accuracy_m;
    receiver->vertical_accuracy_m = update->gps_raw.vertical_accuracy_m;
    receiver->speed_accuracy_mps = update->gps_raw.speed_accuracy_mps;
    /* What was said without a fix isn't confirmed by one that comes later. */
    if (aircraft_receiver(aircraft, now_us) != NULL) {
        aircraft->no_fix_us = INT64_MIN;
    } else {
        aircraft->no_fix_us = aircraft->no_fix_us == INT64_MIN ? now_us : aircraft->no_fix_us;
        aircraft->waiting_position.came_us = aircraft->waiting_time.came_us = INT64_MIN;
    }
    compare_receivers(aircraft, speed_mps, now_us);
    if (receiver->fix_type < GPS_FIX_TYPE_2D_FIX) {
        return;
    }
    compare(aircraft, receiver, TELEMETRY, speed_mps, now_us);
    compare(aircraft, receiver, NATIVE, isnan(native_mps) ? 0 : native_mps, now_us);
    if (receiver->fix_type < GPS_FIX_TYPE_3D_FIX) {
        forget_heights(aircraft, receiver, now_us);
        return;
    }
    take_separation(aircraft, receiver, now_us);
    compare_altitude(aircraft, receiver, &aircraft->telemetry,
                     aircraft->telemetry.altitude_msl_m - update->gps_raw.altitude_msl_m,
                     aircraft->telemetry.vertical_speed_mps,
                     aircraft->telemetry.relative_altitude_m, now_us);
    compare_altitude(aircraft, receiver, &aircraft->native,
                     aircraft->native_location.altitude_geodetic_m -
                         aircraft_separation_m(aircraft, now_us) - update->gps_raw.altitude_msl_m,
                     aircraft->native_location.received.location.vertical_speed_mps,
                     aircraft->native_location.received.location.height_m, now_us);
}
