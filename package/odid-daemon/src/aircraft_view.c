/* What to broadcast of what aircraft.c gathered: the choice between sources. */
#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "aircraft_state.h"

/* Data are at most this old when sent, ASTM F3411: where there is a newer position, it is taken. */
#define NATIVE_PREFERRED_US 1000000
/* Below this speed the course over ground is noise. */
#define COURSE_MIN_MPS 0.3
/* A Location timestamp says when within the hour: an older position can't be dated any more. */
#define POSITION_KEPT_US INT64_C(3590000000)
#define UNIX_2019_S INT64_C(1546300800)

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

static void view_location(const struct aircraft *aircraft, int64_t now_us,
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

/* ---- identity: what is configured speaks, native fills what isn't ---- */

static uint8_t configured_ua_type(const struct aircraft *aircraft, int configured)
{
    int derived;

    if (configured != CONFIG_UA_TYPE_AUTO) {
        return (uint8_t)configured;
    }
    if (aircraft->heartbeat_us != INT64_MIN) {
        derived = aircraft_ua_type(aircraft->mav_type);
        if (derived >= 0) {
            return (uint8_t)derived;
        }
    }
    for (unsigned i = 0; i < 2; i++) {
        if (aircraft->native_basic_id[i].id_type != ODID_IDTYPE_NONE) {
            return aircraft->native_basic_id[i].ua_type;
        }
    }
    return ODID_UATYPE_NONE;
}

static bool has_id_type(const struct aircraft_view *view, uint8_t id_type)
{
    for (unsigned i = 0; i < view->basic_ids; i++) {
        if (view->basic_id[i].id_type == id_type) {
            return true;
        }
    }
    return false;
}

static void view_basic_ids(const struct aircraft *aircraft, struct aircraft_view *view)
{
    struct aircraft_basic_id *out;

    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        const struct config_basic_id *configured = &aircraft->config->basic_id[i];

        if (configured->uas_id[0] != '\0') {
            out = &view->basic_id[view->basic_ids++];
            out->id_type = configured->id_type;
            out->ua_type = configured_ua_type(aircraft, configured->ua_type);
            out->source = SOURCE_CONFIGURATION;
            memcpy(out->uas_id, configured->uas_id, strlen(configured->uas_id));
        }
    }
    for (unsigned i = 0; i < 2 && view->basic_ids < 2; i++) {
        const struct aircraft_native_id *native = &aircraft->native_basic_id[i];

        if (native->id_type != ODID_IDTYPE_NONE && !has_id_type(view, native->id_type)) {
            out = &view->basic_id[view->basic_ids++];
            out->id_type = native->id_type;
            out->ua_type = native->ua_type;
            out->source = SOURCE_NATIVE;
            memcpy(out->uas_id, native->uas_id, sizeof(out->uas_id));
        }
    }
}

static void view_texts(const struct aircraft *aircraft, struct aircraft_view *view)
{
    const struct config *config = aircraft->config;
    bool own_operator = config->operator_id[0] != '\0';
    bool own_description = config->description[0] != '\0';

    memcpy(view->operator_id, own_operator ? config->operator_id : aircraft->native_operator_id,
           sizeof(view->operator_id));
    view->operator_id_type =
        own_operator ? config->operator_id_type : aircraft->native_operator_id_type;
    memcpy(view->description, own_description ? config->description : aircraft->native_description,
           sizeof(view->description));
    view->description_type =
        own_description ? config->description_type : aircraft->native_description_type;
    view->self_id_set = view->description[0] != '\0';
}

static void view_authentication(const struct aircraft *aircraft, struct aircraft_view *view)
{
    unsigned pages = aircraft->auth[0].last_page + 1U;
    uint32_t all = (1U << pages) - 1;

    if ((aircraft->auth_received & 1) && pages <= TELEMETRY_AUTH_PAGES &&
        (aircraft->auth_received & all) == all) {
        view->auth_pages = pages;
        memcpy(view->auth, aircraft->auth, pages * sizeof(view->auth[0]));
    }
}

/* ---- System ---- */

static uint32_t utc_2019_s(const struct aircraft *aircraft, int64_t now_us)
{
    int64_t since_s;

    if (!aircraft->clock.utc_known) {
        return 0;
    }
    since_s = autopilot_clock_unix_us(&aircraft->clock, now_us) / 1000000 - UNIX_2019_S;
    return since_s > 0 && since_s <= UINT32_MAX ? (uint32_t)since_s : 0;
}

static void view_operator(const struct aircraft *aircraft, int64_t now_us,
                          struct aircraft_system *out)
{
    const struct aircraft_native_system *native = &aircraft->native_system;
    const struct config *config = aircraft->config;

    out->timestamp_2019_s = utc_2019_s(aircraft, now_us);
    out->operator_location_type = config->operator_location_type;
    out->operator_latitude_deg = out->operator_longitude_deg = NAN;
    out->operator_altitude_m = NAN;
    if (aircraft_fresh(aircraft->operator_us, now_us) && !isnan(native->latitude_deg)) {
        out->operator_source = SOURCE_NATIVE;
        out->operator_location_type = native->operator_location_type;
        out->operator_latitude_deg = native->latitude_deg;
        out->operator_longitude_deg = native->longitude_deg;
        out->operator_altitude_m = native->altitude_m;
        out->timestamp_2019_s = native->timestamp_2019_s;
    } else if (aircraft->takeoff.known) {
        out->operator_source = SOURCE_TELEMETRY;
        out->operator_location_type = ODID_OPERATOR_LOCATION_TYPE_TAKEOFF;
        out->operator_latitude_deg = aircraft->takeoff.latitude_deg;
        out->operator_longitude_deg = aircraft->takeoff.longitude_deg;
        out->operator_altitude_m = aircraft->takeoff.altitude_geodetic_m;
        if (isnan(out->operator_altitude_m)) { /* home, or the separation came later */
            out->operator_altitude_m = aircraft->takeoff.altitude_msl_m + aircraft->separation_m;
        }
    } else if (!isnan(config->operator_latitude_deg)) {
        out->operator_source = SOURCE_CONFIGURATION;
        out->operator_location_type = ODID_OPERATOR_LOCATION_TYPE_FIXED;
        out->operator_latitude_deg = config->operator_latitude_deg;
        out->operator_longitude_deg = config->operator_longitude_deg;
        out->operator_altitude_m = config->operator_altitude_m;
    }
}

static void view_system(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_system *out)
{
    const struct aircraft_native_system *native = &aircraft->native_system;
    const struct config *config = aircraft->config;
    bool own = config->classification_set || !native->known;

    view_operator(aircraft, now_us, out);
    out->classification_type = own ? config->classification_type : native->classification_type;
    out->category_eu = own ? config->category : native->category_eu;
    out->class_eu = own ? config->class_eu : native->class_eu;
    out->area_count = native->known && native->area_count > 0 ? native->area_count : 1;
    out->area_radius_m = native->known ? native->area_radius_m : 0;
    out->area_ceiling_m = native->known ? native->area_ceiling_m : NAN;
    out->area_floor_m = native->known ? native->area_floor_m : NAN;
}

void aircraft_view(const struct aircraft *aircraft, int64_t now_us, struct aircraft_view *view)
{
    memset(view, 0, sizeof(*view));
    view_basic_ids(aircraft, view);
    view_location(aircraft, now_us, &view->location);
    view_authentication(aircraft, view);
    view_texts(aircraft, view);
    view_system(aircraft, now_us, &view->system);
}

/* ---- condition ---- */

static bool basic_id_conflict(const struct aircraft *aircraft)
{
    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        const struct config_basic_id *own = &aircraft->config->basic_id[i];

        for (unsigned j = 0; j < 2; j++) {
            const struct aircraft_native_id *native = &aircraft->native_basic_id[j];

            if (own->uas_id[0] != '\0' && native->id_type != ODID_IDTYPE_NONE &&
                own->id_type == native->id_type && strcmp(own->uas_id, native->uas_id) != 0) {
                return true;
            }
        }
    }
    return false;
}

/* A window that is never closed, because nothing comes, counts as it stands. */
static double position_rate_hz(const struct aircraft *aircraft, int64_t now_us)
{
    int64_t window_us = now_us - aircraft->rate_from_us;

    return window_us > 2 * AIRCRAFT_RATE_WINDOW_US ? aircraft->rate_count * 1e6 / (double)window_us
                                                   : aircraft->rate_hz;
}

void aircraft_condition(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_condition *condition)
{
    const struct config *config = aircraft->config;

    memset(condition, 0, sizeof(*condition));
    condition->armed = aircraft->armed;
    condition->heartbeat_fresh = aircraft_fresh(aircraft->heartbeat_us, now_us);
    condition->emergency =
        condition->heartbeat_fresh && aircraft->system_status == MAV_STATE_EMERGENCY;
    condition->time_known = aircraft->clock.utc_known;
    condition->unix_us =
        condition->time_known ? autopilot_clock_unix_us(&aircraft->clock, now_us) : 0;
    condition->takeoff_known = aircraft->takeoff.known;
    condition->takeoff_is_home = aircraft->takeoff_is_home;
    condition->mav_type = aircraft->mav_type;
    condition->autopilot = aircraft->autopilot;
    condition->autopilot_restarts = aircraft->clock.restarts;
    condition->position_rate_hz = position_rate_hz(aircraft, now_us);
    condition->position_native = aircraft->rate_native;
    condition->basic_id_conflict = basic_id_conflict(aircraft);
    condition->operator_id_conflict =
        config->operator_id[0] != '\0' && aircraft->native_operator_id[0] != '\0' &&
        strcmp(config->operator_id, aircraft->native_operator_id) != 0;
}
