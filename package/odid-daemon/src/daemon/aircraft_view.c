/* What to broadcast of what aircraft.c gathered: the choice between sources; Location is
 * aircraft_location.c's. */
#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "daemon/aircraft_state.h"

/* Of two identities that are no serial number one may be the other's correction: then it isn't said
 * any more. */
#define CORRECTED_US 30000000

/* ---- identity: what is configured speaks, native fills what isn't ---- */

/* said: CONFIG_UA_TYPE_AUTO where nobody has. */
static uint8_t ua_type(const struct aircraft *aircraft, int said)
{
    if (said != CONFIG_UA_TYPE_AUTO) {
        return (uint8_t)said;
    }
    if (aircraft->type_known) {
        return (uint8_t)aircraft_ua_type(aircraft->mav_type);
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

bool aircraft_id_is_corrected(const struct aircraft_native_id *id, int64_t at_us)
{
    return id->id_type != ODID_IDTYPE_SERIAL_NUMBER && at_us - id->said_us >= CORRECTED_US;
}

/* By the one beside it. */
static bool is_corrected(const struct aircraft *aircraft, unsigned which)
{
    const struct aircraft_native_id *other = &aircraft->native_basic_id[1 - which];

    return other->id_type != ODID_IDTYPE_NONE && other->id_type != ODID_IDTYPE_SERIAL_NUMBER &&
           aircraft_id_is_corrected(&aircraft->native_basic_id[which], other->said_us);
}

/* Where it is configured who this is, no native one stands beside it: ArduPilot passes on as its
 * own what anybody on the ground has said. */
static void view_basic_ids(const struct aircraft *aircraft, struct aircraft_view *view)
{
    struct aircraft_basic_id *out;

    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        const struct config_basic_id *configured = &aircraft->config->basic_id[i];

        if (configured->uas_id[0] != '\0') {
            out = &view->basic_id[view->basic_ids++];
            out->id_type = configured->id_type;
            out->ua_type = ua_type(aircraft, configured->ua_type);
            out->source = SOURCE_CONFIGURATION;
            memcpy(out->uas_id, configured->uas_id, strlen(configured->uas_id));
        }
    }
    if (aircraft->config->basic_id[0].uas_id[0] != '\0') {
        return;
    }
    for (unsigned i = 0; i < 2 && view->basic_ids < 2; i++) {
        const struct aircraft_native_id *native = &aircraft->native_basic_id[i];

        if (native->id_type != ODID_IDTYPE_NONE && !has_id_type(view, native->id_type) &&
            !is_corrected(aircraft, i)) {
            out = &view->basic_id[view->basic_ids++];
            out->id_type = native->id_type;
            out->ua_type =
                ua_type(aircraft, native->ua_type == ODID_UATYPE_NONE ? CONFIG_UA_TYPE_AUTO
                                                                      : native->ua_type);
            out->source = SOURCE_NATIVE;
            memcpy(out->uas_id, native->uas_id, sizeof(out->uas_id));
        }
    }
}

/* What is configured speaks, but of an emergency, which only the moment knows. */
static void view_description(const struct aircraft *aircraft, int64_t now_us,
                             struct aircraft_view *view)
{
    const struct aircraft_description *said = aircraft_description_said(aircraft, now_us);
    const struct config *config = aircraft->config;
    bool own = config->description[0] != '\0' && aircraft_emergency_said(aircraft, now_us) == NULL;

    if (own) {
        memcpy(view->description, config->description, sizeof(view->description));
        view->description_type = config->description_type;
        view->description_source = SOURCE_CONFIGURATION;
    } else if (said != NULL) {
        memcpy(view->description, said->text, sizeof(view->description));
        view->description_type = said->type;
        view->description_source = SOURCE_NATIVE;
        view->description_spare = said == &aircraft->description[AIRCRAFT_SPEAKER_GROUND] &&
                                  said->type != ODID_DESC_TYPE_EMERGENCY &&
                                  !aircraft->auth_by_another;
    }
    view->self_id_set = view->description[0] != '\0';
}

static void view_operator_id(const struct aircraft *aircraft, struct aircraft_view *view)
{
    const struct aircraft_operator_number *said = aircraft_operator_said(aircraft);
    const struct config *config = aircraft->config;
    bool own = config->operator_id[0] != '\0';

    memcpy(view->operator_id, own ? config->operator_id : said->number, sizeof(view->operator_id));
    view->operator_id_type = own ? config->operator_id_type : said->type;
}

static void view_authentication(const struct aircraft *aircraft, int64_t now_us,
                                struct aircraft_view *view)
{
    unsigned pages = aircraft->auth[0].last_page + 1U;
    uint32_t all = (1U << pages) - 1;

    if (aircraft->auth_said_us == INT64_MIN ||
        now_us - aircraft->auth_said_us >= TELEMETRY_AUTHENTICATION_KEPT_US) {
        return;
    }
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
    const struct aircraft_native_system *native = aircraft_system_said(aircraft, now_us);
    const struct config *config = aircraft->config;

    /* Never a ground station's clock. */
    out->timestamp_2019_s = utc_2019_s(aircraft, now_us);
    out->operator_location_type = config->operator_location_type;
    out->operator_latitude_deg = out->operator_longitude_deg = NAN;
    out->operator_altitude_m = NAN;
    if (aircraft_operator_told(aircraft, now_us) &&
        !aircraft_takeoff_contradicts(aircraft, native)) {
        out->operator_source = SOURCE_NATIVE;
        out->operator_location_type = native->operator_location_type;
        out->operator_latitude_deg = native->latitude_deg;
        out->operator_longitude_deg = native->longitude_deg;
        out->operator_altitude_m = native->altitude_m;
    } else if (aircraft->takeoff.known) {
        out->operator_source = SOURCE_TELEMETRY;
        out->operator_location_type = ODID_OPERATOR_LOCATION_TYPE_TAKEOFF;
        out->operator_latitude_deg = aircraft->takeoff.latitude_deg;
        out->operator_longitude_deg = aircraft->takeoff.longitude_deg;
        out->operator_altitude_m = aircraft->takeoff.altitude_geodetic_m;
        if (isnan(out->operator_altitude_m)) { /* home, or the separation came later */
            out->operator_altitude_m =
                aircraft->takeoff.altitude_msl_m + aircraft_separation_m(aircraft, now_us);
        }
    } else if (!isnan(config->operator_latitude_deg)) {
        out->operator_source = SOURCE_CONFIGURATION;
        out->operator_location_type = ODID_OPERATOR_LOCATION_TYPE_FIXED;
        out->operator_latitude_deg = config->operator_latitude_deg;
        out->operator_longitude_deg = config->operator_longitude_deg;
        out->operator_altitude_m = config->operator_altitude_m;
    }
}

static bool is_upside_down(const struct aircraft_native_system *system)
{
    return system->known && system->area_ceiling_m < system->area_floor_m;
}

static void view_system(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_system *out)
{
    const struct aircraft_native_system *native = aircraft_system_said(aircraft, now_us);
    const struct config *config = aircraft->config;
    bool own = config->classification_set || !native->known;
    bool heights = native->known && !is_upside_down(native);

    view_operator(aircraft, now_us, out);
    out->classification_type = own ? config->classification_type : native->classification_type;
    out->category_eu = own ? config->category : native->category_eu;
    out->class_eu = own ? config->class_eu : native->class_eu;
    out->area_count = native->known && native->area_count > 0 ? native->area_count : 1;
    out->area_radius_m = native->known ? native->area_radius_m : 0;
    out->area_ceiling_m = heights ? native->area_ceiling_m : NAN;
    out->area_floor_m = heights ? native->area_floor_m : NAN;
}

void aircraft_view(const struct aircraft *aircraft, int64_t now_us, struct aircraft_view *view)
{
    memset(view, 0, sizeof(*view));
    view_basic_ids(aircraft, view);
    aircraft_view_location(aircraft, now_us, &view->location);
    view_authentication(aircraft, now_us, view);
    view_description(aircraft, now_us, view);
    view_operator_id(aircraft, view);
    view_system(aircraft, now_us, &view->system);
}

/* ---- condition ---- */

static bool is_configured(const struct aircraft *aircraft, const struct aircraft_native_id *native)
{
    for (unsigned i = 0; i < CONFIG_BASIC_IDS; i++) {
        const struct config_basic_id *own = &aircraft->config->basic_id[i];

        if (own->id_type == native->id_type && strcmp(own->uas_id, native->uas_id) == 0) {
            return true;
        }
    }
    return false;
}

/* One came that isn't broadcast, nor is what is configured. */
static bool basic_id_conflict(const struct aircraft *aircraft)
{
    const struct config_basic_id *own = aircraft->config->basic_id;

    for (unsigned i = 0; i < 2; i++) {
        const struct aircraft_native_id *native = &aircraft->native_basic_id[i];
        bool left_out = own[0].uas_id[0] != '\0' ||
                        (own[1].uas_id[0] != '\0' && own[1].id_type == native->id_type);

        if (native->id_type != ODID_IDTYPE_NONE && left_out && !is_configured(aircraft, native)) {
            return true;
        }
    }
    return false;
}

static bool texts_differ(const char *a, const char *b)
{
    return a[0] != '\0' && b[0] != '\0' && strcmp(a, b) != 0;
}

static bool operator_ids_differ(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_operator_number *vehicle =
        &aircraft->operator_number[AIRCRAFT_SPEAKER_VEHICLE];
    const struct aircraft_operator_number *ground =
        &aircraft->operator_number[AIRCRAFT_SPEAKER_GROUND];

    return aircraft_still_said(vehicle->said_us, now_us) &&
           aircraft_still_said(ground->said_us, now_us) &&
           texts_differ(vehicle->number, ground->number);
}

/* An emergency is said as such. */
static bool descriptions_differ(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_description *vehicle = &aircraft->description[AIRCRAFT_SPEAKER_VEHICLE];
    const struct aircraft_description *ground = &aircraft->description[AIRCRAFT_SPEAKER_GROUND];

    return vehicle->type != ODID_DESC_TYPE_EMERGENCY && ground->type != ODID_DESC_TYPE_EMERGENCY &&
           aircraft_still_said(vehicle->said_us, now_us) &&
           aircraft_still_said(ground->said_us, now_us) &&
           texts_differ(vehicle->text, ground->text);
}

/* Of an emergency nothing is configured. */
static bool description_conflict(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_description *said = aircraft_description_said(aircraft, now_us);

    return said != NULL && said->type != ODID_DESC_TYPE_EMERGENCY &&
           aircraft_still_said(said->said_us, now_us) &&
           texts_differ(aircraft->config->description, said->text);
}

/* Who leaves a field undeclared claims nothing. */
static bool classification_conflict(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_native_system *said = aircraft_system_said(aircraft, now_us);
    const struct config *own = aircraft->config;

    return own->classification_set && said->known &&
           said->classification_type == ODID_CLASSIFICATION_TYPE_EU &&
           ((said->category_eu != ODID_CATEGORY_EU_UNDECLARED &&
             said->category_eu != own->category) ||
            (said->class_eu != ODID_CLASS_EU_UNDECLARED && said->class_eu != own->class_eu));
}

void aircraft_condition(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_condition *condition)
{
    const struct aircraft_operator_number *said = aircraft_operator_said(aircraft);
    const struct aircraft_fix *fix = aircraft_best_fix(aircraft, now_us);
    const struct config *config = aircraft->config;

    memset(condition, 0, sizeof(*condition));
    condition->armed = aircraft->armed;
    condition->flies_unheard = aircraft->flies_unheard;
    condition->heartbeat_fresh = aircraft_fresh(aircraft->heartbeat_us, now_us);
    condition->emergency = aircraft_is_emergency(aircraft, now_us);
    condition->emergency_declared = aircraft_emergency_said(aircraft, now_us) != NULL;
    condition->time_known = aircraft->clock.utc_known;
    condition->unix_us =
        condition->time_known ? autopilot_clock_unix_us(&aircraft->clock, now_us) : 0;
    condition->takeoff_known = aircraft->takeoff.known;
    condition->takeoff_is_home = aircraft->takeoff_is_home;
    condition->takeoff_is_late = aircraft->takeoff_is_late;
    condition->mav_type = aircraft->mav_type;
    condition->said_mav_type = aircraft->said_mav_type;
    condition->autopilot = aircraft->autopilot;
    condition->autopilot_restarts = aircraft->clock.restarts;
    condition->position_rate_hz = aircraft_rate_hz(
        fix == &aircraft->native ? &aircraft->native_rate : &aircraft->telemetry_rate, now_us);
    condition->speed_wrong = fix != NULL && (fix->rest.wrong || fix->level.wrong);
    condition->vertical_inverted = aircraft->vertical.inverted;
    condition->crashed = aircraft->crash_counts;
    condition->fix_known = aircraft_fix_known(aircraft, now_us);
    condition->apart = aircraft_is_apart(&aircraft->telemetry, now_us) ||
                       aircraft_is_apart(&aircraft->native, now_us);
    condition->receivers_differ = aircraft_receivers_differ(aircraft, now_us);
    condition->altitude_apart = aircraft_altitude_is_apart(&aircraft->telemetry, now_us) ||
                                aircraft_altitude_is_apart(&aircraft->native, now_us);
    condition->altitudes_differ = aircraft_altitudes_differ(aircraft, now_us);
    condition->landed_state_wrong = aircraft->landed_wrong;
    condition->simulated = aircraft->simulated;
    condition->operator_ahead_s = aircraft_operator_told(aircraft, now_us)
                                      ? aircraft_system_said(aircraft, now_us)->ahead_s
                                      : 0;
    condition->operators_differ = aircraft_operators_differ(aircraft, now_us);
    condition->area_upside_down = is_upside_down(aircraft_system_said(aircraft, now_us));
    condition->basic_ids_differ = aircraft_two_differ(aircraft, GROUND_BASIC_ID, now_us);
    condition->basic_id_conflict = basic_id_conflict(aircraft);
    condition->operator_id_conflict = config->operator_id[0] != '\0' && said->number[0] != '\0' &&
                                      strcmp(config->operator_id, said->number) != 0;
    condition->description_conflict = description_conflict(aircraft, now_us);
    condition->classification_conflict = classification_conflict(aircraft, now_us);
    condition->operator_ids_differ = config->operator_id[0] == '\0' &&
                                     (operator_ids_differ(aircraft, now_us) ||
                                      aircraft_two_differ(aircraft, GROUND_OPERATOR_ID, now_us));
    condition->descriptions_differ =
        (config->description[0] == '\0' && descriptions_differ(aircraft, now_us)) ||
        aircraft_two_differ(aircraft, GROUND_SELF_ID, now_us);
}
