/* What can't be measured and somebody has to say: a description, an operator's place, who he is.
 * The aircraft's autopilot says it, or a ground station, or both; each of them can take back its
 * own. */
#include <common/mavlink.h>
#include <math.h>
#include <opendroneid.h>
#include <string.h>

#include "base/earth.h"
#include "config/identifiers.h"
#include "daemon/aircraft_state.h"

/* An operator stands on Earth. */
#define OPERATOR_MIN_M -500.0
#define OPERATOR_MAX_M 9000.0
/* A station that declares it says so each second. */
#define EMERGENCY_REPEATED_US 3000000
/* Two that take turns have changed what is said so often, each time within 10 s. */
#define TURNS 3
/* Two places that are nearer than this are one, that moves. */
#define SAME_PLACE_M 100.0

static enum aircraft_speaker speaker_of(const struct telemetry_update *update)
{
    return update->by_another ? AIRCRAFT_SPEAKER_GROUND : AIRCRAFT_SPEAKER_VEHICLE;
}

void aircraft_forget_speaker(struct aircraft *aircraft, enum aircraft_speaker speaker)
{
    memset(&aircraft->description[speaker], 0, sizeof(aircraft->description[speaker]));
    memset(&aircraft->operator_number[speaker], 0, sizeof(aircraft->operator_number[speaker]));
    memset(&aircraft->system[speaker], 0, sizeof(aircraft->system[speaker]));
    aircraft->description[speaker].said_us = INT64_MIN;
    aircraft->emergency[speaker].said_us = INT64_MIN;
    aircraft->operator_number[speaker].said_us = INT64_MIN;
    aircraft->system[speaker].said_us = INT64_MIN;
    for (enum aircraft_ground i = 0; i < AIRCRAFT_GROUNDS; i++) {
        aircraft->ground[i].changed_us[speaker] = INT64_MIN;
    }
    /* Until a SYSTEM says otherwise: who sends updates has an operator who moves. */
    aircraft->system[speaker].operator_location_type = MAV_ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS;
    if (speaker == AIRCRAFT_SPEAKER_GROUND) {
        for (enum aircraft_ground i = 0; i < AIRCRAFT_GROUNDS; i++) {
            aircraft->ground[i].said_us = INT64_MIN;
            aircraft->ground[i].differ_us = INT64_MIN;
        }
    }
}

bool aircraft_still_said(int64_t said_us, int64_t now_us)
{
    return said_us != INT64_MIN && now_us - said_us < AIRCRAFT_SPEAKER_KEPT_US;
}

bool aircraft_is_heard(struct aircraft *aircraft, enum aircraft_ground what,
                       const struct telemetry_update *update, bool urgent, int64_t now_us)
{
    struct aircraft_ground_speaker *ground = &aircraft->ground[what];

    if (!update->by_another) {
        return true;
    }
    if (ground->speaker != update->speaker && !urgent &&
        aircraft_still_said(ground->said_us, now_us)) {
        return false;
    }
    ground->speaker = update->speaker;
    ground->said_us = now_us;
    return true;
}

void aircraft_watch_turns(struct aircraft *aircraft, enum aircraft_ground what,
                          const struct telemetry_update *update, bool changed, int64_t now_us)
{
    struct aircraft_ground_speaker *ground = &aircraft->ground[what];
    enum aircraft_speaker speaker = speaker_of(update);

    if (!changed) {
        return;
    }
    if (!aircraft_still_said(ground->changed_us[speaker], now_us)) {
        ground->changes[speaker] = 0;
    }
    ground->changed_us[speaker] = now_us;
    if (++ground->changes[speaker] >= TURNS) {
        ground->differ_us = now_us;
    }
}

bool aircraft_two_differ(const struct aircraft *aircraft, enum aircraft_ground what, int64_t now_us)
{
    return aircraft_still_said(aircraft->ground[what].differ_us, now_us);
}

static void take_text(char *to, const char *from, size_t size)
{
    memcpy(to, from, size);
    identifiers_remove_secrets(to); /* some ground stations send the operator's whole entry */
}

/* ---- description ---- */

static bool declares(const struct aircraft_description *description)
{
    return description->type == ODID_DESC_TYPE_EMERGENCY && description->text[0] != '\0';
}

/* Another word of the same number ends it when it isn't repeated any more: two may speak by one. */
static bool emergency_stands(const struct aircraft *aircraft, enum aircraft_speaker speaker,
                             int64_t now_us)
{
    int64_t said_us = aircraft->emergency[speaker].said_us;

    return aircraft_still_said(said_us, now_us) &&
           (declares(&aircraft->description[speaker]) || now_us - said_us < EMERGENCY_REPEATED_US);
}

void aircraft_take_self_id(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us)
{
    enum aircraft_speaker speaker = speaker_of(update);
    struct aircraft_description *last = &aircraft->description[speaker];
    struct aircraft_description word = {.said_us = now_us, .type = update->self_id.type};
    bool urgent;

    take_text(word.text, update->self_id.text, sizeof(word.text));
    /* But not over one that stands: whoever did it would take it back for the one who declared. */
    urgent = declares(&word) && !emergency_stands(aircraft, speaker, now_us);
    if (!aircraft_is_heard(aircraft, GROUND_SELF_ID, update, urgent, now_us)) {
        return;
    }
    aircraft_watch_turns(aircraft, GROUND_SELF_ID, update,
                         last->said_us != INT64_MIN &&
                             (last->type != word.type || strcmp(last->text, word.text) != 0),
                         now_us);
    *last = word;
    if (declares(&word)) {
        aircraft->emergency[speaker] = word;
    }
}

const struct aircraft_description *aircraft_emergency_said(const struct aircraft *aircraft,
                                                           int64_t now_us)
{
    for (enum aircraft_speaker i = 0; i < AIRCRAFT_SPEAKERS; i++) {
        if (emergency_stands(aircraft, i, now_us)) {
            return &aircraft->emergency[i];
        }
    }
    return NULL;
}

const struct aircraft_description *aircraft_description_said(const struct aircraft *aircraft,
                                                             int64_t now_us)
{
    const struct aircraft_description *emergency = aircraft_emergency_said(aircraft, now_us);

    if (emergency != NULL) {
        return emergency;
    }
    for (enum aircraft_speaker i = 0; i < AIRCRAFT_SPEAKERS; i++) {
        const struct aircraft_description *description = &aircraft->description[i];

        if (description->text[0] != '\0' && description->type != ODID_DESC_TYPE_EMERGENCY) {
            return description;
        }
    }
    return NULL;
}

/* ---- operator's number ---- */

void aircraft_take_operator_id(struct aircraft *aircraft, const struct telemetry_update *update,
                               int64_t now_us)
{
    struct aircraft_operator_number *number = &aircraft->operator_number[speaker_of(update)];
    char said[sizeof(number->number)];

    if (!aircraft_is_heard(aircraft, GROUND_OPERATOR_ID, update, false, now_us)) {
        return;
    }
    take_text(said, update->operator_id.operator_id, sizeof(said));
    aircraft_watch_turns(aircraft, GROUND_OPERATOR_ID, update,
                         number->said_us != INT64_MIN && strcmp(number->number, said) != 0, now_us);
    number->said_us = now_us;
    number->type = update->operator_id.type;
    memcpy(number->number, said, sizeof(said));
}

const struct aircraft_operator_number *aircraft_operator_said(const struct aircraft *aircraft)
{
    const struct aircraft_operator_number *own =
        &aircraft->operator_number[AIRCRAFT_SPEAKER_VEHICLE];

    return own->number[0] != '\0' ? own : &aircraft->operator_number[AIRCRAFT_SPEAKER_GROUND];
}

/* ---- System ---- */

static bool place_said(const struct aircraft_native_system *system, int64_t now_us)
{
    return !isnan(system->latitude_deg) && aircraft_still_said(system->said_us, now_us);
}

static bool is_live(const struct aircraft_native_system *system)
{
    return system->operator_location_type == MAV_ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS;
}

/* A live place before another one; of equals the one that spoke first, until it is silent. */
static enum aircraft_speaker heard_speaker(const struct aircraft *aircraft, int64_t now_us)
{
    enum aircraft_speaker current = aircraft->system_speaker;
    enum aircraft_speaker other =
        current == AIRCRAFT_SPEAKER_VEHICLE ? AIRCRAFT_SPEAKER_GROUND : AIRCRAFT_SPEAKER_VEHICLE;
    const struct aircraft_native_system *is = &aircraft->system[current];
    const struct aircraft_native_system *may = &aircraft->system[other];

    if (!place_said(may, now_us)) {
        return is->known || !may->known ? current : other;
    }
    return !place_said(is, now_us) || (is_live(may) && !is_live(is)) ? other : current;
}

const struct aircraft_native_system *aircraft_system_said(const struct aircraft *aircraft,
                                                          int64_t now_us)
{
    return &aircraft->system[heard_speaker(aircraft, now_us)];
}

bool aircraft_operator_told(const struct aircraft *aircraft, int64_t now_us)
{
    return place_said(aircraft_system_said(aircraft, now_us), now_us);
}

static bool is_elsewhere(const struct aircraft_native_system *system, double latitude_deg,
                         double longitude_deg)
{
    return earth_distance_m(system->latitude_deg, system->longitude_deg, latitude_deg,
                            longitude_deg) > SAME_PLACE_M;
}

bool aircraft_takeoff_contradicts(const struct aircraft *aircraft,
                                  const struct aircraft_native_system *system)
{
    return system->operator_location_type == MAV_ODID_OPERATOR_LOCATION_TYPE_TAKEOFF &&
           aircraft->takeoff.known && !aircraft->takeoff_is_home &&
           is_elsewhere(system, aircraft->takeoff.latitude_deg, aircraft->takeoff.longitude_deg);
}

bool aircraft_operators_differ(const struct aircraft *aircraft, int64_t now_us)
{
    const struct aircraft_native_system *a = &aircraft->system[AIRCRAFT_SPEAKER_VEHICLE];
    const struct aircraft_native_system *b = &aircraft->system[AIRCRAFT_SPEAKER_GROUND];

    return (place_said(a, now_us) && place_said(b, now_us) &&
            is_elsewhere(a, b->latitude_deg, b->longitude_deg)) ||
           (aircraft_operator_told(aircraft, now_us) &&
            aircraft_takeoff_contradicts(aircraft, aircraft_system_said(aircraft, now_us))) ||
           aircraft_two_differ(aircraft, GROUND_SYSTEM, now_us);
}

static void take_static_fields(struct aircraft_native_system *system,
                               const struct telemetry_update *update)
{
    system->known = true;
    if (update->system.operator_location_type <= MAV_ODID_OPERATOR_LOCATION_TYPE_FIXED) {
        system->operator_location_type = update->system.operator_location_type;
    }
    system->classification_type = update->system.classification_type;
    system->category_eu = update->system.category_eu;
    system->class_eu = update->system.class_eu;
    system->area_count = update->system.area_count;
    system->area_radius_m = update->system.area_radius_m;
    system->area_ceiling_m = update->system.area_ceiling_m;
    system->area_floor_m = update->system.area_floor_m;
}

void aircraft_take_system(struct aircraft *aircraft, const struct telemetry_update *update,
                          int64_t now_us)
{
    struct aircraft_native_system *system = &aircraft->system[speaker_of(update)];
    bool undated = update->system.timestamp_2019_s == 0; /* then that it came has to do */
    bool known = !isnan(update->system.operator_latitude_deg) &&
                 !earth_is_near_zero(update->system.operator_latitude_deg,
                                     update->system.operator_longitude_deg);
    bool moved = system->said_us == INT64_MIN || undated ||
                 update->system.timestamp_2019_s != system->timestamp_2019_s ||
                 (known && (update->system.operator_latitude_deg != system->latitude_deg ||
                            update->system.operator_longitude_deg != system->longitude_deg));

    /* One without a place, as many stations send it each second, is in nobody's way, whoever's it
     * is: two may speak by one number. */
    if (!known && place_said(system, now_us)) {
        return;
    }
    if (!aircraft_is_heard(aircraft, GROUND_SYSTEM, update, known && !place_said(system, now_us),
                           now_us)) {
        if (known && is_elsewhere(system, update->system.operator_latitude_deg,
                                  update->system.operator_longitude_deg)) {
            aircraft->ground[GROUND_SYSTEM].differ_us = now_us;
        }
        return;
    }
    aircraft_watch_turns(aircraft, GROUND_SYSTEM, update,
                         known && place_said(system, now_us) &&
                             is_elsewhere(system, update->system.operator_latitude_deg,
                                          update->system.operator_longitude_deg),
                         now_us);
    if (update->kind == TELEMETRY_SYSTEM) {
        take_static_fields(system, update);
    }
    system->latitude_deg = update->system.operator_latitude_deg;
    system->longitude_deg = update->system.operator_longitude_deg;
    system->altitude_m = update->system.operator_altitude_m >= OPERATOR_MIN_M &&
                                 update->system.operator_altitude_m <= OPERATOR_MAX_M
                             ? update->system.operator_altitude_m
                             : NAN;
    system->timestamp_2019_s = update->system.timestamp_2019_s;
    if (earth_is_near_zero(system->latitude_deg, system->longitude_deg)) {
        system->latitude_deg = system->longitude_deg = NAN; /* a field that nobody filled */
    }
    system->ahead_s = undated || !aircraft->clock.utc_known
                          ? 0
                          : (int64_t)system->timestamp_2019_s + UNIX_2019_S -
                                autopilot_clock_unix_us(&aircraft->clock, now_us) / 1000000;
    if (moved) {
        system->said_us = now_us;
    }
    aircraft->system_speaker = heard_speaker(aircraft, now_us);
}
