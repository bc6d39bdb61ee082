#include "aircraft.h"

#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "aircraft_state.h"
#include "identifiers.h"

/* A native timestamp that is earlier by less was overtaken on the way; by more, the clock was set.
 */
#define OVERTAKEN_S 3.0
/* A take-off point is frozen from the first fix within this time after the arming edge. */
#define TAKEOFF_WAIT_US AIRCRAFT_FRESH_US
/* GPS time is ahead of UTC by the leap seconds: 18 s since 2017; one more or less may come. */
#define LEAP_MIN_S 16.0
#define LEAP_MAX_S 19.5
#define LEAP_SEEN 3
/* A lead that was measured too large, by our clock, is forgotten at this pace a message. */
#define LEAP_FORGET_S 0.02
/* A timestamp that is UTC lies between these from now: it comes late, and clocks differ. */
#define UTC_MIN_S -3.0
#define UTC_MAX_S 1.0

struct aircraft *aircraft_init(const struct config *config, int64_t start_us)
{
    static struct aircraft aircraft;

    memset(&aircraft, 0, sizeof(aircraft));
    aircraft.config = config;
    aircraft.start_us = start_us;
    aircraft.heartbeat_us = INT64_MIN;
    aircraft.landed_us = INT64_MIN;
    aircraft.gps_us = INT64_MIN;
    aircraft.separation_m = NAN;
    aircraft.telemetry.fix_us = INT64_MIN;
    aircraft.native.fix_us = INT64_MIN;
    aircraft.operator_us = INT64_MIN;
    /* Until a SYSTEM says otherwise: who sends updates has an operator who moves. */
    aircraft.native_system.operator_location_type = MAV_ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS;
    aircraft.rate_hz = NAN;
    aircraft.rate_from_us = start_us;
    return &aircraft;
}

bool aircraft_fresh(int64_t since_us, int64_t now_us)
{
    return since_us != INT64_MIN && now_us - since_us < AIRCRAFT_FRESH_US;
}

/* ---- take-off ---- */

static void freeze_takeoff(struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_fix *fix = aircraft_best_fix(aircraft, now_us);

    if (!aircraft->takeoff_pending || fix == NULL) {
        return;
    }
    if (now_us - aircraft->armed_us >= TAKEOFF_WAIT_US) {
        aircraft->takeoff_pending = false;
        return;
    }
    aircraft->takeoff.known = true;
    aircraft->takeoff.latitude_deg = fix->latitude_deg;
    aircraft->takeoff.longitude_deg = fix->longitude_deg;
    aircraft->takeoff.altitude_geodetic_m = aircraft_geodetic_m(aircraft, fix);
    /* Not in a native message; plain telemetry's serves when that goes stale in flight. */
    aircraft->takeoff.altitude_msl_m = aircraft_fresh(aircraft->telemetry.fix_us, now_us)
                                           ? aircraft->telemetry.altitude_msl_m
                                           : NAN;
    aircraft->takeoff_is_home = false;
    aircraft->takeoff_pending = false;
}

/*
 * Armed before our time, or unheard, and nothing kept from then: its home,
 * which it sets at arming, stands in. (It can be moved in flight: so not when
 * we saw the arming ourselves.)
 */
static void take_home(struct aircraft *aircraft, const struct telemetry_update *update)
{
    /* The first one: later ones may have been moved, and after landing it follows the aircraft. */
    if (!aircraft->armed || !aircraft->arming_unseen || aircraft->takeoff.known ||
        isnan(update->home.latitude_deg)) {
        return;
    }
    aircraft->takeoff.known = true;
    aircraft->takeoff.latitude_deg = update->home.latitude_deg;
    aircraft->takeoff.longitude_deg = update->home.longitude_deg;
    aircraft->takeoff.altitude_msl_m = update->home.altitude_msl_m;
    aircraft->takeoff.altitude_geodetic_m = NAN; /* its separation may differ: filled in the view */
    aircraft->takeoff_is_home = true;
}

const struct aircraft_takeoff *aircraft_takeoff(const struct aircraft *aircraft)
{
    return &aircraft->takeoff;
}

void aircraft_restore_takeoff(struct aircraft *aircraft, const struct aircraft_takeoff *takeoff)
{
    aircraft->kept_takeoff = *takeoff;
}

/* ---- heartbeat ---- */

/* What another vehicle must not inherit; its UTC and our configuration stay. */
static void forget_vehicle(struct aircraft *aircraft)
{
    struct autopilot_clock clock = aircraft->clock;
    const struct config *config = aircraft->config;
    int64_t start_us = aircraft->start_us;

    autopilot_clock_new_boot(&clock);
    aircraft_init(config, start_us)->clock = clock;
}

static void take_heartbeat(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us)
{
    bool armed = update->heartbeat.base_mode & MAV_MODE_FLAG_SAFETY_ARMED;
    bool first;

    if (update->heartbeat.new_vehicle) {
        forget_vehicle(aircraft);
    }
    first = aircraft->heartbeat_us == INT64_MIN;
    if (first && armed) {
        aircraft->arming_unseen = true;
        aircraft->takeoff = aircraft->kept_takeoff;
    } else if (armed && !aircraft->armed) {
        /* After a silence it may be in the air long since: this is not where it took off. */
        aircraft->arming_unseen = !aircraft_fresh(aircraft->heartbeat_us, now_us);
        memset(&aircraft->takeoff, 0, sizeof(aircraft->takeoff));
        aircraft->takeoff_is_home = false;
        aircraft->takeoff_pending = !aircraft->arming_unseen;
        aircraft->armed_us = now_us;
    }
    aircraft->armed = armed;
    aircraft->heartbeat_us = now_us;
    aircraft->mav_type = update->heartbeat.mav_type;
    aircraft->autopilot = update->heartbeat.autopilot;
    aircraft->system_status = update->heartbeat.system_status;
    freeze_takeoff(aircraft, now_us);
}

/* ---- position from plain telemetry ---- */

static void count_position(struct aircraft *aircraft, bool native, int64_t now_us)
{
    if (now_us - aircraft->rate_from_us >= AIRCRAFT_RATE_WINDOW_US) {
        aircraft->rate_hz = aircraft->rate_count * 1e6 / (double)(now_us - aircraft->rate_from_us);
        aircraft->rate_native = aircraft->rate_count_native;
        aircraft->rate_from_us = now_us;
        aircraft->rate_count = 0;
        aircraft->rate_count_native = false;
    }
    /* The rate that matters is that of the source that speaks. */
    if (native && !aircraft->rate_count_native) {
        aircraft->rate_count = 0;
        aircraft->rate_count_native = true;
    }
    if (native == aircraft->rate_count_native) {
        aircraft->rate_count++;
    }
}

static void take_gps_raw(struct aircraft *aircraft, const struct telemetry_update *update,
                         int64_t now_us)
{
    aircraft->gps_us = now_us;
    aircraft->gps_fix_type = update->gps_raw.fix_type;
    aircraft->horizontal_accuracy_m = update->gps_raw.horizontal_accuracy_m;
    aircraft->vertical_accuracy_m = update->gps_raw.vertical_accuracy_m;
    aircraft->speed_accuracy_mps = update->gps_raw.speed_accuracy_mps;
    /* The geoid changes by metres over tens of kilometres: the last one holds. */
    if (!isnan(update->gps_raw.separation_m) && update->gps_raw.fix_type >= GPS_FIX_TYPE_3D_FIX) {
        aircraft->separation_m = update->gps_raw.separation_m;
    }
}

static void take_global_position(struct aircraft *aircraft, const struct telemetry_update *update,
                                 int64_t now_us)
{
    struct aircraft_fix *fix = &aircraft->telemetry;
    bool restarted, moved;
    /* A stream of GPS_RAW_INT that was switched off says nothing about later positions. */
    bool no_fix =
        aircraft_fresh(aircraft->gps_us, now_us) && aircraft->gps_fix_type < GPS_FIX_TYPE_2D_FIX;
    int64_t stamped_us =
        autopilot_clock_boot(&aircraft->clock, update->global_position.boot_ms, now_us, &restarted);
    int64_t boot_us = stamped_us - aircraft->clock.offset_us;

    moved = fix->fix_us == INT64_MIN || aircraft->position_boot != aircraft->clock.restarts ||
            boot_us > aircraft->position_boot_us;
    if (!moved || no_fix || isnan(update->global_position.latitude_deg)) {
        return;
    }
    aircraft->position_boot = aircraft->clock.restarts;
    aircraft->position_boot_us = boot_us;
    fix->fix_us = stamped_us;
    fix->latitude_deg = update->global_position.latitude_deg;
    fix->longitude_deg = update->global_position.longitude_deg;
    fix->altitude_msl_m = update->global_position.altitude_msl_m;
    fix->relative_altitude_m = update->global_position.relative_altitude_m;
    fix->north_mps = update->global_position.north_mps;
    fix->east_mps = update->global_position.east_mps;
    fix->vertical_speed_mps = update->global_position.up_mps;
    count_position(aircraft, false, now_us);
    freeze_takeoff(aircraft, now_us);
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

    if (aircraft->native.fix_us == INT64_MIN) {
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

static void correct_px4(struct aircraft *aircraft, struct aircraft_native_location *native)
{
    if (aircraft->autopilot != MAV_AUTOPILOT_PX4) {
        return;
    }
    /* PX4's geodetic altitude is above mean sea level, its barometric one 0 when unknown. */
    native->altitude_geodetic_m += aircraft->separation_m;
    if (fabs(native->altitude_barometric_m) < 1e-6) {
        native->altitude_barometric_m = NAN;
    }
}

static void take_location(struct aircraft *aircraft, const struct telemetry_update *update,
                          int64_t now_us)
{
    struct aircraft_native_location *native = &aircraft->native_location;
    int64_t instant_us = now_us;
    bool moved = native_moved(aircraft, update);

    if (!moved) {
        return;
    }
    native->instant_known =
        native_instant(aircraft, update->location.timestamp_s, now_us, &instant_us);
    native->received = *update;
    native->timestamp_s = update->location.timestamp_s;
    native->altitude_geodetic_m = update->location.altitude_geodetic_m;
    native->altitude_barometric_m = update->location.altitude_barometric_m;
    correct_px4(aircraft, native);
    aircraft->native.fix_us = instant_us;
    aircraft->native.latitude_deg = update->location.latitude_deg;
    aircraft->native.longitude_deg = update->location.longitude_deg;
    aircraft->native.altitude_msl_m = NAN;
    if (!isnan(update->location.latitude_deg)) {
        count_position(aircraft, true, now_us);
        freeze_takeoff(aircraft, now_us);
    }
}

/* ---- native static messages ---- */

static void take_basic_id(struct aircraft *aircraft, const struct telemetry_update *update)
{
    /* One serial number, and one of another type. */
    unsigned slot = update->basic_id.id_type == ODID_IDTYPE_SERIAL_NUMBER ? 0 : 1;
    struct aircraft_native_id *native = &aircraft->native_basic_id[slot];

    memcpy(native, &update->basic_id, sizeof(update->basic_id));
    if (native->id_type == ODID_IDTYPE_CAA_REGISTRATION_ID) {
        identifiers_remove_secrets(native->uas_id);
    }
}

static bool same_page(const struct aircraft_auth_page *a, const struct aircraft_auth_page *b)
{
    bool same = a->type == b->type && memcmp(a->data, b->data, sizeof(a->data)) == 0;

    if (a->page == 0) { /* the other fields are page 0's */
        same = same && a->last_page == b->last_page && a->length == b->length &&
               a->timestamp_2019_s == b->timestamp_2019_s;
    }
    return same;
}

/*
 * A new page 0, or another page that changed, begins another Authentication
 * message, whose pages count only when all of them have come.
 */
static void take_authentication(struct aircraft *aircraft, const struct telemetry_update *update)
{
    struct aircraft_auth_page page = {
        .type = update->authentication.type,
        .page = update->authentication.page,
        .last_page = update->authentication.last_page,
        .length = update->authentication.length,
        .timestamp_2019_s = update->authentication.timestamp_2019_s,
    };
    bool have, same;

    if (page.page >= TELEMETRY_AUTH_PAGES || page.last_page >= TELEMETRY_AUTH_PAGES) {
        return;
    }
    memcpy(page.data, update->authentication.data, sizeof(page.data));
    have = aircraft->auth_received >> page.page & 1;
    same = have && same_page(&page, &aircraft->auth[page.page]);
    if (!same && (have || page.page == 0)) {
        aircraft->auth_received = 0;
    }
    aircraft->auth[page.page] = page;
    aircraft->auth_received |= 1U << page.page;
}

static void take_system(struct aircraft *aircraft, const struct telemetry_update *update,
                        int64_t now_us)
{
    struct aircraft_native_system *native = &aircraft->native_system;
    bool whole = update->kind == TELEMETRY_SYSTEM;
    bool undated = update->system.timestamp_2019_s == 0; /* then that it came has to do */
    bool moved = aircraft->operator_us == INT64_MIN || undated ||
                 update->system.timestamp_2019_s != native->timestamp_2019_s;

    if (whole) {
        native->known = true;
        native->operator_location_type = update->system.operator_location_type;
        native->classification_type = update->system.classification_type;
        native->category_eu = update->system.category_eu;
        native->class_eu = update->system.class_eu;
        native->area_count = update->system.area_count;
        native->area_radius_m = update->system.area_radius_m;
        native->area_ceiling_m = update->system.area_ceiling_m;
        native->area_floor_m = update->system.area_floor_m;
    }
    native->latitude_deg = update->system.operator_latitude_deg;
    native->longitude_deg = update->system.operator_longitude_deg;
    native->altitude_m = update->system.operator_altitude_m;
    native->timestamp_2019_s = update->system.timestamp_2019_s;
    /* What ArduPilot substitutes is in centimetres, and only SYSTEM says whether it did. */
    if (aircraft->autopilot == MAV_AUTOPILOT_ARDUPILOTMEGA &&
        (!native->known ||
         native->operator_location_type == MAV_ODID_OPERATOR_LOCATION_TYPE_TAKEOFF)) {
        native->altitude_m = NAN;
    }
    if (moved) {
        aircraft->operator_us = now_us;
    }
}

void aircraft_update(struct aircraft *aircraft, const struct telemetry_update *update,
                     int64_t now_us)
{
    switch (update->kind) {
    case TELEMETRY_HEARTBEAT:
        take_heartbeat(aircraft, update, now_us);
        break;
    case TELEMETRY_SYSTEM_TIME:
        autopilot_clock_utc(&aircraft->clock, update->system_time.unix_us,
                            update->system_time.boot_ms, now_us);
        break;
    case TELEMETRY_GPS_RAW:
        take_gps_raw(aircraft, update, now_us);
        break;
    case TELEMETRY_GLOBAL_POSITION:
        take_global_position(aircraft, update, now_us);
        break;
    case TELEMETRY_HOME:
        take_home(aircraft, update);
        break;
    case TELEMETRY_LANDED_STATE:
        aircraft->landed_us = now_us;
        aircraft->landed_state = update->landed_state;
        break;
    case TELEMETRY_BASIC_ID:
        take_basic_id(aircraft, update);
        break;
    case TELEMETRY_LOCATION:
        take_location(aircraft, update, now_us);
        break;
    case TELEMETRY_AUTHENTICATION:
        take_authentication(aircraft, update);
        break;
    case TELEMETRY_SELF_ID:
        aircraft->native_description_type = update->self_id.type;
        memcpy(aircraft->native_description, update->self_id.text,
               sizeof(aircraft->native_description));
        identifiers_remove_secrets(aircraft->native_description);
        break;
    case TELEMETRY_SYSTEM:
    case TELEMETRY_SYSTEM_UPDATE:
        take_system(aircraft, update, now_us);
        break;
    case TELEMETRY_OPERATOR_ID:
        aircraft->native_operator_id_type = update->operator_id.type;
        memcpy(aircraft->native_operator_id, update->operator_id.operator_id,
               sizeof(aircraft->native_operator_id));
        /* Some ground stations send the operator's whole entry. */
        identifiers_cut_operator(aircraft->native_operator_id);
        break;
    }
}
