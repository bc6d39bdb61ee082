/* The take-off point: where it was armed, or what stands in for that; and home. */
#include <math.h>
#include <string.h>

#include "base/earth.h"
#include "daemon/aircraft_state.h"

/* The first fix within this time after arming is the place, on the ground or not. */
#define TAKEOFF_WAIT_US AIRCRAFT_FRESH_US

static void freeze(struct aircraft *aircraft, const struct aircraft_fix *fix, int64_t now_us)
{
    aircraft->takeoff.known = true;
    aircraft->takeoff.latitude_deg = fix->latitude_deg;
    aircraft->takeoff.longitude_deg = fix->longitude_deg;
    aircraft->takeoff.altitude_geodetic_m = aircraft_geodetic_m(aircraft, fix, now_us);
    /* Not in a native message; plain telemetry's serves when that goes stale in flight. */
    aircraft->takeoff.altitude_msl_m = aircraft_fresh(aircraft->telemetry.fix_us, now_us)
                                           ? aircraft->telemetry.altitude_msl_m
                                           : NAN;
    aircraft->takeoff_pending = false;
}

/* The first home since arming: it can be moved in flight, and after landing it follows the
 * aircraft. */
static void let_home_stand_in(struct aircraft *aircraft)
{
    if (!aircraft->armed || aircraft->takeoff.known || !aircraft->home.known) {
        return;
    }
    aircraft->takeoff = aircraft->home;
    aircraft->takeoff_is_home = true;
}

void aircraft_look_for_takeoff(struct aircraft *aircraft, bool on_ground, int64_t now_us)
{
    const struct aircraft_fix *fix = aircraft_best_fix(aircraft, now_us);
    bool soon = now_us - aircraft->armed_us < TAKEOFF_WAIT_US;

    if (!soon && !on_ground) {
        aircraft->takeoff_pending = false;
        let_home_stand_in(aircraft);
    } else if (fix != NULL) {
        freeze(aircraft, fix, now_us);
        aircraft->takeoff_is_late = !soon;
    }
}

void aircraft_begin_flight(struct aircraft *aircraft, bool arming_seen, int64_t now_us)
{
    memset(&aircraft->takeoff, 0, sizeof(aircraft->takeoff));
    aircraft->home.known = false;
    aircraft->takeoff_is_home = aircraft->takeoff_is_late = false;
    aircraft->takeoff_pending = arming_seen;
    aircraft->armed_us = now_us;
}

void aircraft_take_home(struct aircraft *aircraft, const struct telemetry_update *update)
{
    if (!aircraft->armed || aircraft->home.known || isnan(update->home.latitude_deg) ||
        earth_is_near_zero(update->home.latitude_deg, update->home.longitude_deg)) {
        return;
    }
    aircraft->home = (struct kept_takeoff){
        .known = true,
        .latitude_deg = update->home.latitude_deg,
        .longitude_deg = update->home.longitude_deg,
        .altitude_msl_m = update->home.altitude_msl_m,
        .altitude_geodetic_m = NAN, /* its separation may differ: filled in the view */
    };
    if (!aircraft->takeoff_pending) {
        let_home_stand_in(aircraft);
    }
}

double aircraft_height_m(const struct aircraft *aircraft)
{
    const struct aircraft_fix *fix = &aircraft->telemetry;

    /* relative_alt is above home, which can move in flight: it counts only before arming. */
    if (aircraft->takeoff.known) {
        return fix->altitude_msl_m - aircraft->takeoff.altitude_msl_m;
    }
    return aircraft->armed ? NAN : fix->relative_altitude_m;
}

double aircraft_native_height_m(const struct aircraft *aircraft)
{
    if (!aircraft->takeoff.known) {
        return NAN;
    }
    return aircraft->native_location.altitude_geodetic_m - aircraft->takeoff.altitude_geodetic_m;
}
