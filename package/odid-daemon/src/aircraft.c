#include "aircraft.h"

#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "aircraft_state.h"
#include "identifiers.h"

#define SAME_FLIGHT_US 60000000
/* An operator stands on Earth. */
#define OPERATOR_MIN_M -500.0
#define OPERATOR_MAX_M 9000.0

/* Until a SYSTEM says otherwise: who sends updates has an operator who moves. */
static void forget_native_system(struct aircraft *aircraft)
{
    memset(&aircraft->native_system, 0, sizeof(aircraft->native_system));
    aircraft->native_system.operator_location_type = MAV_ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS;
    aircraft->operator_us = INT64_MIN;
}

struct aircraft *aircraft_init(const struct config *config, int64_t start_us)
{
    static struct aircraft aircraft;

    memset(&aircraft, 0, sizeof(aircraft));
    aircraft.config = config;
    aircraft.start_us = start_us;
    aircraft.heartbeat_us = INT64_MIN;
    arming_init(&aircraft.arming, false);
    aircraft.landed_us = aircraft.in_air_us = INT64_MIN;
    aircraft.gps_us = aircraft.gps2_us = INT64_MIN;
    aircraft.armed_ended_us = INT64_MIN;
    aircraft.separation_m = NAN;
    aircraft.telemetry.fix_us = aircraft.position_boot_us = INT64_MIN;
    aircraft.waiting_position.came_us = aircraft.waiting_time.came_us = INT64_MIN;
    aircraft.native.fix_us = INT64_MIN;
    aircraft.native_location.said_us = INT64_MIN;
    aircraft.native_rated_us = aircraft.native_behind_us = INT64_MIN;
    aircraft.telemetry_rate.last_us = aircraft.native_rate.last_us = INT64_MIN;
    forget_native_system(&aircraft);
    return &aircraft;
}

/* ---- before a restart of ours ---- */

const struct aircraft_takeoff *aircraft_takeoff(const struct aircraft *aircraft)
{
    return &aircraft->takeoff;
}

void aircraft_restore_armed(struct aircraft *aircraft, bool armed)
{
    arming_init(&aircraft->arming, armed);
    aircraft->armed = armed;
}

void aircraft_restore_fix(struct aircraft *aircraft, int64_t now_us)
{
    aircraft->gps_us = now_us;
    aircraft->gps_fix_type = GPS_FIX_TYPE_2D_FIX;
    aircraft->gps_latitude_deg = aircraft->gps_longitude_deg = NAN;
    aircraft->horizontal_accuracy_m = aircraft->vertical_accuracy_m = NAN;
    aircraft->speed_accuracy_mps = NAN;
}

void aircraft_restore_takeoff(struct aircraft *aircraft, const struct aircraft_takeoff *takeoff)
{
    aircraft->kept_takeoff = *takeoff;
    if (aircraft->armed) {
        aircraft->takeoff = *takeoff;
    }
}

/* ---- heartbeat ---- */

/* What another vehicle must not inherit; its UTC and our configuration stay, and so does armed:
 * that ends as always. */
static void forget_vehicle(struct aircraft *aircraft)
{
    struct autopilot_clock clock = aircraft->clock;
    struct arming arming = aircraft->arming;
    const struct config *config = aircraft->config;
    int64_t start_us = aircraft->start_us;

    autopilot_clock_new_boot(&clock);
    aircraft_init(config, start_us);
    aircraft->clock = clock;
    aircraft->arming = arming;
    aircraft->armed = arming.armed;
    aircraft->boot_seen = clock.restarts;
}

/* What an autopilot said before it restarted isn't its word any more. The place where the aircraft
 * took off, and that it is armed, are our own. */
static void forget_before_restart(struct aircraft *aircraft)
{
    if (aircraft->boot_seen == aircraft->clock.restarts) {
        return;
    }
    aircraft->boot_seen = aircraft->clock.restarts;
    aircraft->gps_us = aircraft->gps2_us = INT64_MIN;
    aircraft->waiting_position.came_us = aircraft->waiting_time.came_us = INT64_MIN;
    aircraft->native_rated_us = INT64_MIN;
    aircraft->native_location.said_us = INT64_MIN;
    aircraft->landed_us = aircraft->in_air_us = INT64_MIN;
    memset(aircraft->native_basic_id, 0, sizeof(aircraft->native_basic_id));
    aircraft->auth_received = 0;
    aircraft->native_description[0] = '\0';
    aircraft->native_operator_id[0] = '\0';
    forget_native_system(aircraft);
}

/* Armed again so soon, and in the air: it is the same flight. */
static bool took_off_just_before(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft->takeoff.known && aircraft->armed_ended_us != INT64_MIN &&
           now_us - aircraft->armed_ended_us < SAME_FLIGHT_US;
}

static void take_heartbeat(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us)
{
    bool says_armed = update->heartbeat.base_mode & MAV_MODE_FLAG_SAFETY_ARMED;
    bool flying, armed, first;

    if (update->heartbeat.new_vehicle) {
        forget_vehicle(aircraft);
    }
    flying = aircraft_is_flying(aircraft, now_us);
    armed = arming_take(&aircraft->arming, says_armed, update->heartbeat.doubtful, flying, now_us);
    first = aircraft->heartbeat_us == INT64_MIN;
    if (first && armed) {
        aircraft_begin_flight(aircraft, false, now_us);
        aircraft->takeoff = aircraft->kept_takeoff;
    } else if (armed && !aircraft->armed && !(flying && took_off_just_before(aircraft, now_us))) {
        /* After a silence it may be in the air long since: this is not where it took off. */
        aircraft_begin_flight(aircraft, aircraft_fresh(aircraft->heartbeat_us, now_us), now_us);
    }
    if (aircraft->armed && !armed) {
        aircraft->armed_ended_us = now_us;
    }
    aircraft->says_disarmed = !says_armed && !update->heartbeat.doubtful;
    aircraft->armed = armed;
    aircraft->heartbeat_us = now_us;
    aircraft->mav_type = update->heartbeat.mav_type;
    aircraft->autopilot = update->heartbeat.autopilot;
    aircraft->system_status = update->heartbeat.system_status;
    aircraft_look_for_takeoff(aircraft, now_us);
}

/* ---- native static messages ---- */

static void take_basic_id(struct aircraft *aircraft, const struct telemetry_update *update)
{
    /* One serial number, and one of another type. */
    unsigned slot = update->basic_id.id_type == ODID_IDTYPE_SERIAL_NUMBER ? 0 : 1;
    struct aircraft_native_id *native = &aircraft->native_basic_id[slot];

    /* Once the vehicle says who it is, nothing stands that somebody else has said of it. */
    for (unsigned i = 0; !update->by_ground_station && i < 2; i++) {
        if (aircraft->basic_id_by_ground_station[i]) {
            memset(&aircraft->native_basic_id[i], 0, sizeof(aircraft->native_basic_id[i]));
            aircraft->basic_id_by_ground_station[i] = false;
        }
    }
    aircraft->basic_id_by_ground_station[slot] = update->by_ground_station;
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
        if (update->system.operator_location_type <= MAV_ODID_OPERATOR_LOCATION_TYPE_FIXED) {
            native->operator_location_type = update->system.operator_location_type;
        }
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
    native->altitude_m = update->system.operator_altitude_m >= OPERATOR_MIN_M &&
                                 update->system.operator_altitude_m <= OPERATOR_MAX_M
                             ? update->system.operator_altitude_m
                             : NAN;
    native->timestamp_2019_s = update->system.timestamp_2019_s;
    if (aircraft_near_zero(native->latitude_deg, native->longitude_deg)) {
        native->latitude_deg = native->longitude_deg = NAN; /* a field that nobody filled */
    }
    native->ahead_s = undated || !aircraft->clock.utc_known
                          ? 0
                          : (int64_t)native->timestamp_2019_s + UNIX_2019_S -
                                autopilot_clock_unix_us(&aircraft->clock, now_us) / 1000000;
    if (moved) {
        aircraft->operator_us = now_us;
    }
}

static void take_global_position(struct aircraft *aircraft, const struct telemetry_update *update,
                                 int64_t now_us)
{
    bool restarted;
    int64_t stamped_us =
        autopilot_clock_boot(&aircraft->clock, update->global_position.boot_ms, now_us, &restarted);

    forget_before_restart(aircraft);
    if (aircraft_take_global_position(aircraft, update, stamped_us, now_us)) {
        aircraft_look_for_takeoff(aircraft, now_us);
    }
}

static void take_system_time(struct aircraft *aircraft, const struct telemetry_update *update,
                             int64_t now_us)
{
    bool fix_known = aircraft_fix_known(aircraft, now_us);

    autopilot_clock_utc(&aircraft->clock, update->system_time.unix_us, update->system_time.boot_ms,
                        fix_known, now_us);
    forget_before_restart(aircraft);
    if (!fix_known) {
        aircraft->waiting_time = (struct aircraft_waiting){*update, now_us, now_us};
        aircraft_keep_waiting(aircraft, &aircraft->waiting_time, now_us);
    }
}

/* A fix may be known now: what came a moment ago, in the same burst, counts with it. */
static void confirm(struct aircraft *aircraft, int64_t now_us)
{
    struct aircraft_waiting *time = &aircraft->waiting_time;

    if (!aircraft_fix_known(aircraft, now_us)) {
        return;
    }
    if (aircraft_waits(time, now_us)) {
        autopilot_clock_utc(&aircraft->clock, time->update.system_time.unix_us,
                            time->update.system_time.boot_ms, true, now_us);
    }
    time->came_us = INT64_MIN;
    if (aircraft_confirm_position(aircraft, now_us)) {
        aircraft_look_for_takeoff(aircraft, now_us);
    }
}

static void take_landed_state(struct aircraft *aircraft, uint8_t landed_state, int64_t now_us)
{
    aircraft->landed_us = now_us;
    aircraft->landed_state = landed_state;
    if (landed_state == MAV_LANDED_STATE_IN_AIR || landed_state == MAV_LANDED_STATE_TAKEOFF ||
        landed_state == MAV_LANDED_STATE_LANDING) {
        aircraft->in_air_us = now_us;
    }
    aircraft_look_for_takeoff(aircraft, now_us);
}

static void take_text(char *to, const char *from, size_t size)
{
    memcpy(to, from, size);
    identifiers_remove_secrets(to); /* some ground stations send the operator's whole entry */
}

void aircraft_update(struct aircraft *aircraft, const struct telemetry_update *update,
                     int64_t now_us)
{
    switch (update->kind) {
    case TELEMETRY_HEARTBEAT:
        take_heartbeat(aircraft, update, now_us);
        break;
    case TELEMETRY_SYSTEM_TIME:
        take_system_time(aircraft, update, now_us);
        break;
    case TELEMETRY_GPS_RAW:
        aircraft_take_gps_raw(aircraft, update, now_us);
        confirm(aircraft, now_us);
        break;
    case TELEMETRY_GPS2_RAW:
        if (update->gps_raw.fix_type >= GPS_FIX_TYPE_2D_FIX) {
            aircraft->gps2_us = now_us;
            confirm(aircraft, now_us);
        }
        break;
    case TELEMETRY_GLOBAL_POSITION:
        take_global_position(aircraft, update, now_us);
        break;
    case TELEMETRY_HOME:
        aircraft_take_home(aircraft, update);
        break;
    case TELEMETRY_LANDED_STATE:
        take_landed_state(aircraft, update->landed_state, now_us);
        break;
    case TELEMETRY_CLIMB:
        vertical_climb(&aircraft->vertical, update->climb_mps);
        break;
    case TELEMETRY_BASIC_ID:
        take_basic_id(aircraft, update);
        break;
    case TELEMETRY_LOCATION:
        if (aircraft_take_location(aircraft, update, now_us)) {
            aircraft_look_for_takeoff(aircraft, now_us);
        }
        break;
    case TELEMETRY_AUTHENTICATION:
        take_authentication(aircraft, update);
        break;
    case TELEMETRY_SELF_ID:
        aircraft->native_description_type = update->self_id.type;
        take_text(aircraft->native_description, update->self_id.text,
                  sizeof(aircraft->native_description));
        break;
    case TELEMETRY_SYSTEM:
    case TELEMETRY_SYSTEM_UPDATE:
        take_system(aircraft, update, now_us);
        break;
    case TELEMETRY_OPERATOR_ID:
        aircraft->native_operator_id_type = update->operator_id.type;
        take_text(aircraft->native_operator_id, update->operator_id.operator_id,
                  sizeof(aircraft->native_operator_id));
        break;
    case TELEMETRY_COMMAND_ACK: /* asking.h's */
        break;
    }
}
