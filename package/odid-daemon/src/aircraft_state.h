/*
 * The inside of struct aircraft, for the files that make it up: aircraft.c takes
 * what comes (positions by aircraft_position.c, take-off and home by
 * aircraft_takeoff.c), aircraft_view.c chooses from it (Location by
 * aircraft_location.c, its status by aircraft_status.c).
 */
#ifndef ODID_AIRCRAFT_STATE_H
#define ODID_AIRCRAFT_STATE_H

#include "aircraft.h"
#include "arming.h"
#include "autopilot_clock.h"
#include "vertical.h"

/* The rate of positions is the mean of about so many intervals. */
#define AIRCRAFT_RATE_POSITIONS 10
#define UNIX_2019_S INT64_C(1546300800)
/* Who tells the operator's place seldom, at 3.5 s for instance, is still who tells it. */
#define AIRCRAFT_OPERATOR_KEPT_US 10000000

/* A position as one source gave it last. */
struct aircraft_fix {
    int64_t fix_us; /* on our clock; INT64_MIN: never */
    double latitude_deg, longitude_deg;
    double altitude_msl_m, relative_altitude_m;     /* plain telemetry only */
    double north_mps, east_mps, vertical_speed_mps; /* plain telemetry only */
};

/* What counts only with a GNSS fix, and came before one was known. */
struct aircraft_waiting {
    struct telemetry_update update;
    int64_t stamped_us, came_us; /* came_us INT64_MIN: nothing waits */
};

struct aircraft_rate {
    int64_t last_us, interval_us;
    unsigned counted; /* intervals */
};

struct aircraft_native_location {
    int64_t said_us;                  /* its own instant, on our clock; INT64_MIN: never */
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
    int64_t ahead_s; /* of the autopilot's time, when it came; 0: not known */
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
    struct arming arming;
    bool armed;         /* its outcome */
    bool says_disarmed; /* its last word, from one source */
    int64_t armed_us, armed_ended_us;
    unsigned boot_seen; /* the autopilot's starts of which something is known */
    int64_t landed_us;
    uint8_t landed_state;
    int64_t in_air_us; /* the last landed state that said so */

    bool takeoff_pending; /* armed, and may still become known */
    bool takeoff_is_home, takeoff_is_late;
    struct aircraft_takeoff takeoff, kept_takeoff, home;

    struct aircraft_waiting waiting_position, waiting_time;
    struct aircraft_fix telemetry;
    struct aircraft_rate telemetry_rate;
    struct vertical vertical;
    int64_t position_boot_us; /* its own timestamp, not wrapped, ... */
    unsigned position_boot;   /* ... since which start of the autopilot */
    int64_t gps_us;
    int64_t gps2_us; /* when a second receiver said last that it has a fix */
    uint8_t gps_fix_type;
    double gps_latitude_deg, gps_longitude_deg; /* NAN unknown */
    double separation_m; /* ellipsoid height minus height above mean sea level; NAN unknown */
    double horizontal_accuracy_m, vertical_accuracy_m, speed_accuracy_mps;

    struct aircraft_fix native;
    struct aircraft_rate native_rate;
    bool native_keeps_up; /* is as new as telemetry's */
    int64_t native_behind_us;
    int64_t native_rated_us; /* its position had a time and an accuracy: it has a fix */
    struct aircraft_native_location native_location;
    unsigned leap_seen;
    double leap_ahead_s, leap_s;

    struct aircraft_native_id native_basic_id[2]; /* a serial number; another type */
    bool basic_id_by_ground_station[2];           /* not the vehicle's own word */
    struct aircraft_auth_page auth[TELEMETRY_AUTH_PAGES];
    uint32_t auth_received; /* bit per page */
    uint8_t native_description_type;
    char native_description[24];
    struct aircraft_native_system native_system;
    int64_t operator_us; /* when its timestamp moved last */
    uint8_t native_operator_id_type;
    char native_operator_id[21];
};

/* Is an instant, INT64_MIN for never, less than AIRCRAFT_FRESH_US ago? */
bool aircraft_fresh(int64_t since_us, int64_t now_us);

bool aircraft_native_fresh(const struct aircraft *aircraft, int64_t now_us);

/* ---- aircraft_position.c ---- */

/* Each of the two returns true where there is a newer position, that counts. stamped_us: on our
 * clock. */
bool aircraft_take_global_position(struct aircraft *aircraft, const struct telemetry_update *update,
                                   int64_t stamped_us, int64_t now_us);
bool aircraft_take_location(struct aircraft *aircraft, const struct telemetry_update *update,
                            int64_t now_us);
/* A fix is known: does a position that came a moment ago count now? Returns true if one did. */
bool aircraft_confirm_position(struct aircraft *aircraft, int64_t now_us);
/* Only where nothing is known of a fix does something wait for one. */
void aircraft_keep_waiting(const struct aircraft *aircraft, struct aircraft_waiting *waiting,
                           int64_t now_us);
/* Within 1 km of 0,0. */
bool aircraft_near_zero(double latitude_deg, double longitude_deg);
bool aircraft_waits(const struct aircraft_waiting *waiting, int64_t now_us);
void aircraft_take_gps_raw(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us);

/* Is it known, and not for more than 3 s, that the autopilot has a GNSS fix? */
bool aircraft_fix_known(const struct aircraft *aircraft, int64_t now_us);

/* The fresh position of the source that speaks; NULL when none is fresh. */
const struct aircraft_fix *aircraft_best_fix(const struct aircraft *aircraft, int64_t now_us);

/* The newest position that there ever was; NULL when there was none. */
const struct aircraft_fix *aircraft_last_fix(const struct aircraft *aircraft);

/* Altitude above the WGS-84 ellipsoid of a fix of ours; NAN when unknown. */
double aircraft_geodetic_m(const struct aircraft *aircraft, const struct aircraft_fix *fix);

/* Positions a second: NAN before there were two, 0 when none came for 3 s. */
double aircraft_rate_hz(const struct aircraft_rate *rate, int64_t now_us);

/* ---- aircraft_takeoff.c ---- */

/* HEARTBEATs begin to say armed; arming_seen: and said disarmed until now. */
void aircraft_begin_flight(struct aircraft *aircraft, bool arming_seen, int64_t now_us);

/* Something came that may tell where it takes off. */
void aircraft_look_for_takeoff(struct aircraft *aircraft, int64_t now_us);

void aircraft_take_home(struct aircraft *aircraft, const struct telemetry_update *update);

/* Plain telemetry's, above the take-off point; NAN when that isn't known. */
double aircraft_height_m(const struct aircraft *aircraft);

/* ---- aircraft_status.c ---- */

/* Only what is known: a landed state, else how it moves, and how high. */
bool aircraft_is_flying(const struct aircraft *aircraft, int64_t now_us);
bool aircraft_is_emergency(const struct aircraft *aircraft, int64_t now_us);

/* After position_source and position_fresh. */
void aircraft_view_status(const struct aircraft *aircraft, int64_t now_us,
                          struct aircraft_location *out);

/* ---- aircraft_location.c ---- */

/* The Location to broadcast now. */
void aircraft_view_location(const struct aircraft *aircraft, int64_t now_us,
                            struct aircraft_location *out);

#endif
