#include "daemon/aircraft.h"

#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "config/identifiers.h"
#include "daemon/aircraft_state.h"

#define SAME_FLIGHT_US 60000000
#define CRASH_DISARMS_US 10000000
#define ARMED_AGAIN_US 3000000

struct aircraft *aircraft_init(const struct config *config, int64_t start_us)
{
    static struct aircraft aircraft;

    memset(&aircraft, 0, sizeof(aircraft));
    aircraft.config = config;
    aircraft.start_us = start_us;
    aircraft.heartbeat_us = aircraft.kind_us = INT64_MIN;
    arming_init(&aircraft.arming, false);
    aircraft.landed_us = aircraft.in_air_us = aircraft.crashed_us = INT64_MIN;
    aircraft.said_armed_us = aircraft.only_armed_us = INT64_MIN;
    aircraft.landed_no_us = aircraft.lies_us = INT64_MIN;
    aircraft_forget_receivers(&aircraft);
    aircraft.armed_ended_us = aircraft.auth_said_us = aircraft.unheard_us = INT64_MIN;
    aircraft.separation =
        (struct aircraft_separation){.m = NAN, .lasting_m = NAN, .said_us = INT64_MIN};
    aircraft.native_separation_m = NAN;
    aircraft.telemetry.fix_us = aircraft.position_boot_us = INT64_MIN;
    aircraft.waiting_position.came_us = aircraft.waiting_time.came_us = INT64_MIN;
    aircraft.native.fix_us = aircraft.last.fix_us = INT64_MIN;
    aircraft.telemetry.rest.since_us = aircraft.telemetry.level.since_us = INT64_MIN;
    aircraft.native.rest.since_us = aircraft.native.level.since_us = INT64_MIN;
    aircraft.native_location.said_us = aircraft.native_location.emergency_us = INT64_MIN;
    aircraft.native_rated_us = aircraft.native_behind_us = INT64_MIN;
    aircraft.telemetry_rate.last_us = aircraft.native_rate.last_us = INT64_MIN;
    for (enum aircraft_speaker i = 0; i < AIRCRAFT_SPEAKERS; i++) {
        aircraft_forget_speaker(&aircraft, i);
    }
    return &aircraft;
}

/* ---- before a restart of ours ---- */

const struct kept_takeoff *aircraft_takeoff(const struct aircraft *aircraft)
{
    return &aircraft->takeoff;
}

void aircraft_restore_armed(struct aircraft *aircraft, bool armed)
{
    arming_init(&aircraft->arming, armed);
    aircraft->armed = armed;
}

void aircraft_restore_vertical(struct aircraft *aircraft, bool inverted)
{
    vertical_restore(&aircraft->vertical, inverted);
}

void aircraft_restore_crash(struct aircraft *aircraft, bool crashed, int64_t now_us)
{
    aircraft->crash_counts = crashed;
    aircraft->crashed_us = crashed ? now_us : INT64_MIN;
}

void aircraft_restore_fix(struct aircraft *aircraft, bool fix_known, int64_t now_us)
{
    if (!fix_known) {
        aircraft->start_us = now_us - AIRCRAFT_FRESH_US;
        return;
    }
    aircraft->native_rated_us = now_us; /* whoever it was: no receiver that could fall silent */
}

void aircraft_restore_takeoff(struct aircraft *aircraft, const struct kept_takeoff *takeoff)
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
    aircraft_forget_receivers(aircraft);
    aircraft->waiting_position.came_us = aircraft->waiting_time.came_us = INT64_MIN;
    aircraft->native_rated_us = INT64_MIN;
    aircraft->native_location.said_us = aircraft->native_location.emergency_us = INT64_MIN;
    aircraft->landed_us = aircraft->in_air_us = INT64_MIN; /* a crash stands */
    aircraft->landed_no_us = aircraft->lies_us = INT64_MIN;
    aircraft->landed_wrong = false;
    memset(aircraft->native_basic_id, 0, sizeof(aircraft->native_basic_id));
    aircraft->auth_received = 0;
    aircraft_forget_speaker(aircraft, AIRCRAFT_SPEAKER_VEHICLE);
}

/* Armed again so soon, and in the air: it is the same flight. */
static bool took_off_just_before(const struct aircraft *aircraft, int64_t now_us)
{
    return aircraft->takeoff.known && aircraft->armed_ended_us != INT64_MIN &&
           now_us - aircraft->armed_ended_us < SAME_FLIGHT_US;
}

/* Where two take turns, the first word stands as long as it is said. */
static void take_kind(struct aircraft *aircraft, const struct telemetry_update *update,
                      int64_t now_us)
{
    bool simulated = update->heartbeat.base_mode & MAV_MODE_FLAG_HIL_ENABLED;
    bool same = aircraft->said_mav_type == update->heartbeat.mav_type &&
                aircraft->autopilot == update->heartbeat.autopilot &&
                aircraft->simulated == simulated;

    if (same || !aircraft_fresh(aircraft->kind_us, now_us)) {
        aircraft->said_mav_type = update->heartbeat.mav_type;
        aircraft->autopilot = update->heartbeat.autopilot;
        aircraft->simulated = simulated;
        aircraft->kind_us = now_us;
    }
}

/* What it is doesn't change in flight, whatever a parameter has it say: what it said on the ground
 * stands. A type that doesn't fly is none. */
static void take_type(struct aircraft *aircraft)
{
    if (aircraft_ua_type(aircraft->said_mav_type) < 0 ||
        (aircraft->armed && aircraft->type_on_ground)) {
        return;
    }
    aircraft->mav_type = aircraft->said_mav_type;
    aircraft->type_known = true;
    aircraft->type_on_ground = !aircraft->armed;
}

/* Something came that may tell where it takes off. */
static void look_for_takeoff(struct aircraft *aircraft, int64_t now_us)
{
    if (aircraft->takeoff_pending) {
        aircraft_look_for_takeoff(aircraft, aircraft_is_on_ground(aircraft, now_us), now_us);
    }
}

/* The text counts with what a crash brings: some only say it, and fly on. Then it stands until it
 * is armed again: not by a word that somebody contradicts. */
static void take_crash(struct aircraft *aircraft, int64_t now_us)
{
    if (aircraft->crashed_us == INT64_MIN) {
        return;
    }
    aircraft->crash_counts = aircraft->crash_counts || aircraft->says_disarmed;
    if (aircraft->only_armed_us != INT64_MIN &&
        now_us - aircraft->only_armed_us >= ARMED_AGAIN_US &&
        now_us - aircraft->crashed_us > CRASH_DISARMS_US) {
        aircraft_restore_crash(aircraft, false, now_us);
    }
}

/* A flight begins, or ends, by what arming.h makes of the words. */
static void take_armed(struct aircraft *aircraft, bool says_armed, bool doubtful, int64_t now_us)
{
    bool flying = aircraft_is_flying(aircraft, now_us);
    bool armed = arming_take(&aircraft->arming, says_armed, doubtful, flying, now_us);

    if (armed && aircraft->heartbeat_us == INT64_MIN) { /* the first one */
        aircraft_begin_flight(aircraft, false, now_us);
        aircraft->takeoff = aircraft->kept_takeoff;
    } else if (armed && !aircraft->armed && !(flying && took_off_just_before(aircraft, now_us))) {
        /* After a silence it may be in the air long since: this is not where it took off. */
        aircraft_begin_flight(aircraft, aircraft_fresh(aircraft->heartbeat_us, now_us), now_us);
    }
    if (aircraft->armed && !armed) {
        aircraft->armed_ended_us = now_us;
    }
    aircraft->armed = armed;
    aircraft->flies_unheard = false;
    aircraft->heartbeat_us = now_us;
}

static void note_words(struct aircraft *aircraft, bool says_armed, bool doubtful, int64_t now_us)
{
    aircraft->said_armed_us = says_armed ? now_us : aircraft->said_armed_us;
    aircraft->says_disarmed =
        !says_armed && (!doubtful || !aircraft_fresh(aircraft->said_armed_us, now_us));
    if (!says_armed || doubtful) {
        aircraft->only_armed_us = INT64_MIN;
    } else if (aircraft->only_armed_us == INT64_MIN) {
        aircraft->only_armed_us = now_us;
    }
}

/* Where two take turns, one word alone changes nothing. */
static void take_state(struct aircraft *aircraft, uint8_t system_status, bool doubtful)
{
    if (!doubtful || aircraft->said_status == system_status) {
        aircraft->system_status = system_status;
    }
    aircraft->said_status = system_status;
}

static void take_heartbeat(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us)
{
    bool says_armed = update->heartbeat.base_mode & MAV_MODE_FLAG_SAFETY_ARMED;
    bool doubtful = update->heartbeat.doubtful;

    if (update->heartbeat.new_vehicle) {
        forget_vehicle(aircraft);
    }
    aircraft_watch_landed_state(aircraft, now_us);
    take_armed(aircraft, says_armed, doubtful, now_us);
    note_words(aircraft, says_armed, doubtful, now_us);
    take_kind(aircraft, update, now_us);
    take_type(aircraft);
    take_crash(aircraft, now_us);
    take_state(aircraft, update->heartbeat.system_status, doubtful);
    if (!aircraft->doubtful) {
        aircraft->doubtful_us = now_us;
    }
    aircraft->doubtful = doubtful;
    look_for_takeoff(aircraft, now_us);
}

/* Its HEARTBEATs may be lost, or kept from us: an old "disarmed" doesn't stand in the air. */
static void look_whether_it_flies(struct aircraft *aircraft, int64_t now_us)
{
    int64_t since_us =
        aircraft->heartbeat_us == INT64_MIN ? aircraft->start_us : aircraft->heartbeat_us;
    bool flies = !aircraft->armed && !aircraft_fresh(since_us, now_us) &&
                 aircraft_is_flying(aircraft, now_us);

    /* After a silence of everything its HEARTBEAT is the next thing that comes. */
    aircraft->unheard_us = !flies                              ? INT64_MIN
                           : aircraft->unheard_us == INT64_MIN ? now_us
                                                               : aircraft->unheard_us;
    if (!flies || aircraft_fresh(aircraft->unheard_us, now_us)) {
        return;
    }
    arming_flies(&aircraft->arming);
    aircraft->armed = aircraft->flies_unheard = true;
    if (!took_off_just_before(aircraft, now_us)) {
        aircraft_begin_flight(aircraft, false, now_us);
    }
}

/* ---- native static messages ---- */

/* One of each type: a serial number comes first, and any other type has the place that is free, or
 * of one that isn't said any more. -1: there is none, and who was there first stays. */
static int place_of_id(const struct aircraft *aircraft, uint8_t id_type, int64_t now_us)
{
    const struct aircraft_native_id *ids = aircraft->native_basic_id;

    if (id_type == ODID_IDTYPE_SERIAL_NUMBER) {
        return 0;
    }
    for (int i = 0; i < 2; i++) {
        if (ids[i].id_type == id_type) {
            return i;
        }
    }
    for (int i = 1; i >= 0; i--) {
        if (ids[i].id_type == ODID_IDTYPE_NONE) {
            return i;
        }
    }
    for (int i = 1; i >= 0; i--) {
        if (aircraft_id_is_corrected(&ids[i], now_us)) {
            return i;
        }
    }
    return -1;
}

static void take_basic_id(struct aircraft *aircraft, const struct telemetry_update *update,
                          int64_t now_us)
{
    struct aircraft_native_id *native, before;
    int slot;

    /* Once the vehicle says who it is, nothing stands that somebody else has said of it. */
    for (unsigned i = 0; !update->by_another && i < 2; i++) {
        if (aircraft->basic_id_by_another[i]) {
            memset(&aircraft->native_basic_id[i], 0, sizeof(aircraft->native_basic_id[i]));
            aircraft->basic_id_by_another[i] = false;
        }
    }
    slot = place_of_id(aircraft, update->basic_id.id_type, now_us);
    if (slot < 0) {
        return;
    }
    if (!aircraft_is_heard(aircraft, GROUND_BASIC_ID, update, false, now_us)) {
        if (strcmp(aircraft->native_basic_id[slot].uas_id, update->basic_id.uas_id) != 0) {
            aircraft->ground[GROUND_BASIC_ID].differ_us = now_us;
        }
        return;
    }
    native = &aircraft->native_basic_id[slot];
    before = *native;
    aircraft->basic_id_by_another[slot] = update->by_another;
    memcpy(native, &update->basic_id, sizeof(update->basic_id));
    native->said_us = now_us;
    if (native->id_type == ODID_IDTYPE_CAA_REGISTRATION_ID) {
        identifiers_remove_secrets(native->uas_id);
    }
    aircraft_watch_turns(
        aircraft, GROUND_BASIC_ID, update,
        before.id_type != ODID_IDTYPE_NONE && strcmp(before.uas_id, native->uas_id) != 0, now_us);
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
static void take_authentication(struct aircraft *aircraft, const struct telemetry_update *update,
                                int64_t now_us)
{
    struct aircraft_auth_page page = {
        .type = update->authentication.type,
        .page = update->authentication.page,
        .last_page = update->authentication.last_page,
        .length = update->authentication.length,
        .timestamp_2019_s = update->authentication.timestamp_2019_s,
    };
    bool have, same;

    if (page.page >= TELEMETRY_AUTH_PAGES || page.last_page >= TELEMETRY_AUTH_PAGES ||
        (update->by_another && !aircraft->auth_by_another &&
         aircraft_still_said(aircraft->auth_said_us, now_us)) ||
        !aircraft_is_heard(aircraft, GROUND_AUTHENTICATION, update, false, now_us)) {
        return;
    }
    if (aircraft->auth_by_another != update->by_another) {
        aircraft->auth_received = 0; /* from now on they are the vehicle's own, or no more */
    }
    aircraft->auth_by_another = update->by_another;
    aircraft->auth_said_us = now_us;
    memcpy(page.data, update->authentication.data, sizeof(page.data));
    have = aircraft->auth_received >> page.page & 1;
    same = have && same_page(&page, &aircraft->auth[page.page]);
    if (!same && (have || page.page == 0)) {
        aircraft->auth_received = 0;
    }
    aircraft->auth[page.page] = page;
    aircraft->auth_received |= 1U << page.page;
}

/* A newer one counts. */
static void use_position(struct aircraft *aircraft, int64_t now_us)
{
    aircraft_compare_altitudes(aircraft, now_us);
    look_for_takeoff(aircraft, now_us);
}

static void take_global_position(struct aircraft *aircraft, const struct telemetry_update *update,
                                 int64_t now_us)
{
    bool restarted;
    int64_t stamped_us =
        autopilot_clock_boot(&aircraft->clock, update->global_position.boot_ms, now_us, &restarted);

    forget_before_restart(aircraft);
    if (aircraft_take_global_position(aircraft, update, stamped_us, now_us)) {
        use_position(aircraft, now_us);
    }
}

static void take_system_time(struct aircraft *aircraft, const struct telemetry_update *update,
                             int64_t now_us)
{
    bool fix_known = aircraft_fix_known(aircraft, now_us);

    autopilot_clock_utc(&aircraft->clock, update->system_time.unix_us, update->system_time.boot_ms,
                        fix_known && !aircraft->doubtful, now_us);
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
                            time->update.system_time.boot_ms, !aircraft->doubtful, now_us);
    }
    time->came_us = INT64_MIN;
    if (aircraft_confirm_position(aircraft, now_us)) {
        use_position(aircraft, now_us);
    }
}

static void take_landed_state(struct aircraft *aircraft, uint8_t landed_state, int64_t now_us)
{
    if (landed_state != aircraft->landed_state) {
        aircraft->landed_wrong = false;
        aircraft->landed_no_us = INT64_MIN;
    }
    aircraft->landed_us = now_us;
    aircraft->landed_state = landed_state;
    if (landed_state == MAV_LANDED_STATE_IN_AIR || landed_state == MAV_LANDED_STATE_TAKEOFF ||
        landed_state == MAV_LANDED_STATE_LANDING) {
        aircraft->in_air_us = now_us;
    }
    look_for_takeoff(aircraft, now_us);
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
    case TELEMETRY_GPS2_RAW:
        aircraft_take_gps_raw(aircraft, update, now_us);
        confirm(aircraft, now_us);
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
    case TELEMETRY_CRASHED:
        /* What lies there disarmed doesn't crash: such a text is somebody else's. */
        if (aircraft->armed) {
            aircraft->crashed_us = now_us;
        }
        break;
    case TELEMETRY_BASIC_ID:
        take_basic_id(aircraft, update, now_us);
        break;
    case TELEMETRY_LOCATION:
        if (aircraft_take_location(aircraft, update, now_us)) {
            use_position(aircraft, now_us);
            confirm(aircraft, now_us);
        }
        break;
    case TELEMETRY_AUTHENTICATION:
        take_authentication(aircraft, update, now_us);
        break;
    case TELEMETRY_SELF_ID:
        aircraft_take_self_id(aircraft, update, now_us);
        break;
    case TELEMETRY_SYSTEM:
    case TELEMETRY_SYSTEM_UPDATE:
        aircraft_take_system(aircraft, update, now_us);
        break;
    case TELEMETRY_OPERATOR_ID:
        aircraft_take_operator_id(aircraft, update, now_us);
        break;
    case TELEMETRY_COMMAND_ACK: /* asking.h's */
        break;
    }
    look_whether_it_flies(aircraft, now_us);
    aircraft_keep_location(aircraft, now_us);
}
