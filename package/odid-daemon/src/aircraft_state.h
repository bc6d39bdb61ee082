/*
 * What aircraft.c gathers and aircraft_view.c chooses from: the inside of
 * struct aircraft, for these two only.
 */
#ifndef ODID_AIRCRAFT_STATE_H
#define ODID_AIRCRAFT_STATE_H

#include "aircraft.h"
#include "autopilot_clock.h"

/* The rate of positions is measured over windows of this length. */
#define AIRCRAFT_RATE_WINDOW_US 5000000

/* A position as one source gave it last. */
struct aircraft_fix {
    int64_t fix_us; /* on our clock; INT64_MIN: never */
    double latitude_deg, longitude_deg;
    double altitude_msl_m, relative_altitude_m;     /* plain telemetry only */
    double north_mps, east_mps, vertical_speed_mps; /* plain telemetry only */
};

struct aircraft_native_location {
    struct telemetry_update received; /* its location, as it came */
    double timestamp_s;
    bool instant_known; /* the timestamp could be laid on our clock */
    double altitude_geodetic_m, altitude_barometric_m; /* corrected for the sender's habits */
};

struct aircraft_native_system {
    bool known;
    uint8_t operator_location_type, classification_type, category_eu, class_eu;
    double latitude_deg, longitude_deg, altitude_m;
    uint16_t area_count, area_radius_m;
    double area_ceiling_m, area_floor_m;
    uint32_t timestamp_2019_s;
};

struct aircraft_native_id {
    uint8_t id_type, ua_type; /* id_type 0: never came */
    char uas_id[21];
};

struct aircraft {
    const struct config *config;
    int64_t start_us;
    struct autopilot_clock clock;

    int64_t heartbeat_us; /* INT64_MIN: never; likewise below */
    uint8_t mav_type, autopilot, system_status;
    bool armed;
    bool arming_unseen; /* before our time, or while nothing was heard */
    int64_t armed_us;
    int64_t landed_us;
    uint8_t landed_state;

    bool takeoff_pending, takeoff_is_home;
    struct aircraft_takeoff takeoff, kept_takeoff;

    struct aircraft_fix telemetry;
    int64_t position_boot_us; /* its own timestamp, not wrapped, ... */
    unsigned position_boot;   /* ... since which start of the autopilot */
    int64_t gps_us;
    uint8_t gps_fix_type;
    double separation_m; /* ellipsoid height minus height above mean sea level; NAN unknown */
    double horizontal_accuracy_m, vertical_accuracy_m, speed_accuracy_mps;

    struct aircraft_fix native;
    struct aircraft_native_location native_location;
    unsigned leap_seen;
    double leap_ahead_s, leap_s;

    struct aircraft_native_id native_basic_id[2]; /* a serial number; another type */
    struct aircraft_auth_page auth[TELEMETRY_AUTH_PAGES];
    uint32_t auth_received; /* bit per page */
    uint8_t native_description_type;
    char native_description[24];
    struct aircraft_native_system native_system;
    int64_t operator_us; /* when its timestamp moved last */
    uint8_t native_operator_id_type;
    char native_operator_id[21];

    int64_t rate_from_us;
    unsigned rate_count;
    bool rate_count_native, rate_native;
    double rate_hz;
};

/* Is an instant, INT64_MIN for never, less than AIRCRAFT_FRESH_US ago? */
bool aircraft_fresh(int64_t since_us, int64_t now_us);

/* The fresh position of the best source that has one; NULL when none is fresh. */
const struct aircraft_fix *aircraft_best_fix(const struct aircraft *aircraft, int64_t now_us);

/* The Location to broadcast now. */
void aircraft_view_location(const struct aircraft *aircraft, int64_t now_us,
                            struct aircraft_location *out);

/* Altitude above the WGS-84 ellipsoid of a fix of ours; NAN when unknown. */
double aircraft_geodetic_m(const struct aircraft *aircraft, const struct aircraft_fix *fix);

#endif
