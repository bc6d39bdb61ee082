/* Location.Status: on the ground, in the air, in distress; and whether it flies at all. */
#include <common/mavlink.h>
#include <math.h>

#include "daemon/aircraft_state.h"

/* What moves faster than a vehicle that rolls out, or a boat with it aboard that rolls, flies. */
#define FLYING_MPS 8.0
#define FLYING_VERTICAL_MPS 2.5
/* What climbs or sinks so high above its take-off point, or below it, flies, whatever its landed
 * state says: ArduCopter's is "on ground" as soon as it is disarmed, under a parachute, too. */
#define HIGH_M 15.0
#define HIGH_VERTICAL_MPS 1.5
/* "On ground" by its landed state it moves that high, armed; "in air" it lies there, disarmed: for
 * so long, and that landed state is stuck. */
#define MOVES_MPS 3.0
#define MOVES_VERTICAL_MPS 0.5
#define FLIES_US 3000000
#define LIES_US 30000000
#define RESTS_MPS 1.0
#define RESTS_VERTICAL_MPS 0.5
/* What comes sooner is the same message, twice. */
#define ANOTHER_WORD_US 100000

/* The greater of what the sources say that are fresh; NAN: none does. */
static double fastest(bool native_fresh, double native, bool telemetry_fresh, double telemetry)
{
    return fmax(native_fresh ? fabs(native) : NAN, telemetry_fresh ? fabs(telemetry) : NAN);
}

static double vertical_mps(const struct aircraft *aircraft, int64_t now_us)
{
    return fastest(aircraft_native_fresh(aircraft, now_us),
                   aircraft->native_location.received.location.vertical_speed_mps,
                   aircraft_fresh(aircraft->telemetry.fix_us, now_us),
                   aircraft->telemetry.vertical_speed_mps);
}

static double speed_mps(const struct aircraft *aircraft, int64_t now_us)
{
    return fastest(aircraft_native_fresh(aircraft, now_us),
                   aircraft->native_location.received.location.speed_mps,
                   aircraft_fresh(aircraft->telemetry.fix_us, now_us),
                   hypot(aircraft->telemetry.north_mps, aircraft->telemetry.east_mps));
}

/* By the altitudes; else as the message says, which may be above a home that is moved in flight. */
static double native_height_m(const struct aircraft *aircraft)
{
    double height_m = aircraft_native_height_m(aircraft);

    return isnan(height_m) ? aircraft->native_location.received.location.height_m : height_m;
}

/* Above the point of this flight's take-off, by telemetry or, where that doesn't say it, by the
 * native LOCATION; where nobody knows that point above home, which may be moved in flight, but
 * rarely to right under it. NAN: unknown. */
static double height_m(const struct aircraft *aircraft, int64_t now_us)
{
    bool telemetry = aircraft_fresh(aircraft->telemetry.fix_us, now_us) &&
                     !aircraft_altitude_is_apart(&aircraft->telemetry, now_us);
    double height_m = NAN;

    if (!aircraft->armed) {
        return NAN;
    }
    if (telemetry) {
        height_m = aircraft_height_m(aircraft);
    }
    if (isnan(height_m) && aircraft_native_fresh(aircraft, now_us)) {
        height_m = native_height_m(aircraft);
    }
    return isnan(height_m) && telemetry ? aircraft->telemetry.relative_altitude_m : height_m;
}

static bool is_high(const struct aircraft *aircraft, int64_t now_us)
{
    return fabs(height_m(aircraft, now_us)) > HIGH_M &&
           vertical_mps(aircraft, now_us) > HIGH_VERTICAL_MPS;
}

static uint8_t landed_state(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft_fresh(aircraft->landed_us, now_us) && !aircraft->landed_wrong
               ? aircraft->landed_state
               : MAV_LANDED_STATE_UNDEFINED;
}

void aircraft_watch_landed_state(struct aircraft *aircraft, int64_t now_us)
{
    double height = height_m(aircraft, now_us), vertical = vertical_mps(aircraft, now_us);
    double speed = speed_mps(aircraft, now_us);
    bool lies = aircraft->says_disarmed && !(height > HIGH_M) && speed < RESTS_MPS &&
                vertical < RESTS_VERTICAL_MPS;
    bool flies = aircraft->armed && fabs(height) > HIGH_M &&
                 (speed > MOVES_MPS || vertical > MOVES_VERTICAL_MPS);
    bool on_ground = aircraft->landed_state == MAV_LANDED_STATE_ON_GROUND;
    int64_t limit_us = on_ground ? FLIES_US : LIES_US;

    aircraft->lies_us = !lies                            ? INT64_MIN
                        : aircraft->lies_us == INT64_MIN ? now_us
                                                         : aircraft->lies_us;
    if (aircraft->doubtful || !aircraft_fresh(aircraft->landed_us, now_us) ||
        aircraft->landed_state == MAV_LANDED_STATE_UNDEFINED || !(on_ground ? flies : lies)) {
        aircraft->landed_no_us = INT64_MIN;
    } else if (aircraft->landed_no_us == INT64_MIN) {
        aircraft->landed_no_us = now_us;
    } else if (now_us - aircraft->landed_no_us >= limit_us) {
        aircraft->landed_wrong = true;
    }
}

bool aircraft_is_flying(const struct aircraft *aircraft, int64_t now_us)
{
    uint8_t state = landed_state(aircraft, now_us);

    /* Said since the last 3 s: a single "on ground" in between doesn't end it. */
    if (is_high(aircraft, now_us) ||
        (aircraft_fresh(aircraft->in_air_us, now_us) && !aircraft->landed_wrong)) {
        return true;
    }
    if (state != MAV_LANDED_STATE_UNDEFINED) {
        return false; /* on the ground, or on a ship that moves */
    }
    return speed_mps(aircraft, now_us) > FLYING_MPS ||
           vertical_mps(aircraft, now_us) > FLYING_VERTICAL_MPS;
}

/* However fast: before it lifts off it rolls. */
bool aircraft_is_on_ground(const struct aircraft *aircraft, int64_t now_us)
{
    return landed_state(aircraft, now_us) == MAV_LANDED_STATE_ON_GROUND &&
           !aircraft_is_flying(aircraft, now_us) &&
           !(fabs(aircraft->telemetry.relative_altitude_m) > HIGH_M);
}

/*
 * MAV_STATE_CRITICAL is none: ArduPilot says it for any failsafe, a radio that
 * is out of range among them, and goes on to navigate. Disarmed high above
 * the ground it falls, with a parachute or without.
 */
bool aircraft_is_emergency(const struct aircraft *aircraft, int64_t now_us)
{
    if (aircraft_emergency_said(aircraft, now_us) != NULL) {
        return true;
    }
    if (aircraft->crash_counts) {
        return true; /* also where its autopilot dies of it */
    }
    if (!aircraft_fresh(aircraft->heartbeat_us, now_us)) {
        return false;
    }
    return aircraft->system_status == MAV_STATE_EMERGENCY ||
           aircraft->system_status == MAV_STATE_FLIGHT_TERMINATION ||
           (aircraft->says_disarmed && is_high(aircraft, now_us));
}

static enum aircraft_status telemetry_status(const struct aircraft *aircraft, int64_t now_us)
{
    if (!aircraft_fresh(aircraft->heartbeat_us, now_us)) {
        return AIRCRAFT_UNDECLARED;
    }
    if (is_high(aircraft, now_us)) {
        return AIRCRAFT_AIRBORNE;
    }
    switch (landed_state(aircraft, now_us)) {
    case MAV_LANDED_STATE_ON_GROUND:
        return AIRCRAFT_GROUND;
    case MAV_LANDED_STATE_IN_AIR:
    case MAV_LANDED_STATE_TAKEOFF:
    case MAV_LANDED_STATE_LANDING:
        return AIRCRAFT_AIRBORNE;
    default:
        break;
    }
    return aircraft->armed ? AIRCRAFT_AIRBORNE : AIRCRAFT_GROUND;
}

/* ArduPilot's native status is its armed bit; what it knows of the air, its landed state says. */
static bool native_is_contradicted(const struct aircraft *aircraft, uint8_t native, int64_t now_us)
{
    bool lies = aircraft->lies_us != INT64_MIN && now_us - aircraft->lies_us >= LIES_US;

    return native == AIRCRAFT_GROUND ? aircraft->armed && aircraft_is_flying(aircraft, now_us)
                                     : native == AIRCRAFT_AIRBORNE && lies;
}

static bool native_is_doubtful(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft->doubtful && aircraft_best_fix(aircraft, now_us) != &aircraft->native;
}

/* Said again and again, as a position is: a single LOCATION beside telemetry changes nothing, and
 * while two sources speak only that of the position that counts. */
static bool native_status_counts(const struct aircraft *aircraft, int64_t now_us)
{
    return !native_is_doubtful(aircraft, now_us) && aircraft_native_fresh(aircraft, now_us) &&
           (aircraft->native_location.statuses >= 2 ||
            !aircraft_fresh(aircraft->heartbeat_us, now_us));
}

static bool native_emergency(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_native_location *native = &aircraft->native_location;

    return !native_is_doubtful(aircraft, now_us) && aircraft_fresh(native->emergency_us, now_us) &&
           (native->emergency_us - native->emergency_since_us >= ANOTHER_WORD_US ||
            !aircraft_fresh(aircraft->heartbeat_us, now_us));
}

void aircraft_view_status(const struct aircraft *aircraft, int64_t now_us,
                          struct aircraft_location *out)
{
    uint8_t native = aircraft->native_location.received.location.status;
    bool starting = now_us - aircraft->start_us < AIRCRAFT_FRESH_US;
    bool bench = out->position_source == SOURCE_CONFIGURATION;

    out->status = telemetry_status(aircraft, now_us);
    out->status_source = out->status == AIRCRAFT_UNDECLARED ? SOURCE_NONE : SOURCE_TELEMETRY;
    /* An emergency counts from whichever source says so. */
    if (aircraft_is_emergency(aircraft, now_us)) {
        out->status = AIRCRAFT_EMERGENCY;
    } else if (native_emergency(aircraft, now_us)) {
        out->status = AIRCRAFT_EMERGENCY;
        out->status_source = SOURCE_NATIVE;
    } else if (native_status_counts(aircraft, now_us) && native != AIRCRAFT_UNDECLARED &&
               native != AIRCRAFT_EMERGENCY && native <= AIRCRAFT_REMOTE_ID_FAILURE &&
               !native_is_contradicted(aircraft, native, now_us)) {
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
