/* The GNSS receivers behind the autopilot's estimator: who has a fix, and is the position where
 * that receiver is? */
#include <common/mavlink.h>
#include <math.h>

#include "aircraft_state.h"
#include "earth.h"

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

enum { TELEMETRY, NATIVE };

void aircraft_forget_receivers(struct aircraft *aircraft)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        aircraft->receiver[i].said_us = INT64_MIN;
        aircraft->receiver[i].near_us[TELEMETRY] = aircraft->receiver[i].near_us[NATIVE] =
            INT64_MIN;
    }
    aircraft->no_fix_us = INT64_MIN;
    aircraft->telemetry.apart_us = aircraft->native.apart_us = INT64_MIN;
}

const struct aircraft_receiver *aircraft_receiver(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_receiver *best = NULL;

    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        const struct aircraft_receiver *receiver = &aircraft->receiver[i];

        /* Two dimensions are less than three; what is more than three makes no difference here. */
        if (aircraft_fresh(receiver->said_us, now_us) &&
            receiver->fix_type >= GPS_FIX_TYPE_2D_FIX &&
            (best == NULL ||
             (best->fix_type == GPS_FIX_TYPE_2D_FIX && receiver->fix_type > GPS_FIX_TYPE_2D_FIX))) {
            best = receiver;
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

static bool another_is_near(const struct aircraft *aircraft, unsigned which, int64_t now_us)
{
    for (unsigned i = 0; i < AIRCRAFT_RECEIVERS; i++) {
        if (aircraft_fresh(aircraft->receiver[i].near_us[which], now_us)) {
            return true;
        }
    }
    return false;
}

static void compare(struct aircraft *aircraft, struct aircraft_receiver *receiver, unsigned which,
                    double speed_mps, int64_t now_us)
{
    struct aircraft_fix *fix = which == NATIVE ? &aircraft->native : &aircraft->telemetry;
    double accuracy_m = isnan(receiver->horizontal_accuracy_m) ? ACCURACY_UNKNOWN_M
                                                               : receiver->horizontal_accuracy_m;
    double limit_m;

    if (!aircraft_fresh(fix->fix_us, now_us) || isnan(receiver->latitude_deg)) {
        return;
    }
    limit_m = APART_M + 2 * accuracy_m +
              speed_mps * (DELAY_S + fabs((double)(now_us - fix->fix_us)) * 1e-6);
    if (earth_distance_m(receiver->latitude_deg, receiver->longitude_deg, fix->latitude_deg,
                         fix->longitude_deg) <= limit_m) {
        receiver->near_us[which] = now_us;
        fix->apart_us = INT64_MIN;
        return;
    }
    receiver->near_us[which] = INT64_MIN;
    if (!another_is_near(aircraft, which, now_us) && fix->apart_us == INT64_MIN) {
        fix->apart_us = now_us;
    }
}

bool aircraft_is_apart(const struct aircraft *aircraft, const struct aircraft_fix *fix,
                       int64_t now_us)
{
    int64_t limit_us = now_us - fix->moved_us > STILL_US ? STILL_APART_US : APART_US;

    return fix->apart_us != INT64_MIN && now_us - fix->apart_us >= limit_us &&
           aircraft_receiver(aircraft, now_us) != NULL;
}

void aircraft_take_gps_raw(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us)
{
    struct aircraft_receiver *receiver =
        &aircraft->receiver[update->kind == TELEMETRY_GPS2_RAW ? 1 : 0];
    double native_mps = aircraft->native_location.received.location.speed_mps;

    receiver->said_us = now_us;
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
    if (receiver->fix_type < GPS_FIX_TYPE_3D_FIX) {
        return;
    }
    /* The geoid changes by metres over tens of kilometres: the last one holds. */
    if (aircraft_receiver(aircraft, now_us) == receiver && !isnan(update->gps_raw.separation_m)) {
        aircraft->separation_m = update->gps_raw.separation_m;
    }
    compare(aircraft, receiver, TELEMETRY,
            hypot(aircraft->telemetry.north_mps, aircraft->telemetry.east_mps), now_us);
    compare(aircraft, receiver, NATIVE, isnan(native_mps) ? 0 : native_mps, now_us);
}
