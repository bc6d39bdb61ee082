/*
 * What is known of the aircraft, from which source, since when.
 *
 * Pure: holds the rules of priority and freshness, and never reads a clock.
 * The newest position speaks, of the native Open Drone ID messages or of plain
 * telemetry, and only where a GNSS fix is known; each other field comes from
 * the same source, or from the other one where that doesn't know it. For the
 * identity what is configured speaks, native fills what isn't, and a difference
 * is reported.
 *
 * Fresh means that the source's own timestamp moved within the last 3 s, not
 * that a packet came. What isn't known is NAN here and "unknown" on the air;
 * nothing is ever invented.
 */
#ifndef ODID_AIRCRAFT_H
#define ODID_AIRCRAFT_H

#include <stdbool.h>
#include <stdint.h>

#include "appliance/kept.h"
#include "config/config.h"
#include "daemon/aircraft_fresh.h"
#include "daemon/telemetry.h"

enum source { SOURCE_NONE, SOURCE_CONFIGURATION, SOURCE_TELEMETRY, SOURCE_NATIVE };

/* ASTM F3411 operational status. */
enum aircraft_status {
    AIRCRAFT_UNDECLARED = 0,
    AIRCRAFT_GROUND = 1,
    AIRCRAFT_AIRBORNE = 2,
    AIRCRAFT_EMERGENCY = 3,
    AIRCRAFT_REMOTE_ID_FAILURE = 4,
};

struct aircraft_location {
    enum aircraft_status status;
    enum source status_source;
    enum source position_source;
    double latitude_deg, longitude_deg;
    double altitude_barometric_m; /* pressure altitude, 1013.25 hPa */
    double altitude_geodetic_m;   /* above the WGS-84 ellipsoid */
    double height_m;
    bool height_above_ground; /* else above the take-off point */
    uint8_t horizontal_accuracy, vertical_accuracy, barometer_accuracy,
        timestamp_accuracy; /* ASTM codes */
    double timestamp_s;     /* of the fix: seconds since the full UTC hour, [0, 3600) */
    int64_t fix_us;         /* of the fix on our clock; INT64_MIN when there never was one */
    bool position_fresh;
    enum source motion_source;
    double direction_deg; /* course over ground, [0, 360) */
    double speed_mps, vertical_speed_mps;
    uint8_t speed_accuracy; /* ASTM code */
};

struct aircraft_basic_id {
    uint8_t id_type, ua_type;
    char uas_id[21]; /* types 3 and 4 may hold zeros: all 20 bytes count */
    enum source source;
};

struct aircraft_system {
    uint8_t operator_location_type; /* of what is really sent: 0 take-off, 1 live GNSS, 2 fixed */
    enum source operator_source;
    double operator_latitude_deg, operator_longitude_deg, operator_altitude_m;
    uint8_t classification_type, category_eu, class_eu;
    uint16_t area_count, area_radius_m;
    double area_ceiling_m, area_floor_m;
    uint32_t timestamp_2019_s; /* seconds since 2019-01-01 UTC, 0 = unknown */
};

struct aircraft_auth_page {
    uint8_t type, page, last_page, length;
    uint32_t timestamp_2019_s;
    uint8_t data[TELEMETRY_AUTH_PAGE_SIZE];
};

/* Everything that can be broadcast, as it stands at one instant. */
struct aircraft_view {
    unsigned basic_ids; /* 0..2 */
    struct aircraft_basic_id basic_id[2];
    struct aircraft_location location;
    unsigned auth_pages; /* 0 unless every page of the message has come */
    struct aircraft_auth_page auth[TELEMETRY_AUTH_PAGES];
    bool self_id_set;
    uint8_t description_type;
    char description[24];
    enum source description_source;
    bool description_spare; /* a ground station's, and no emergency: the vehicle's own pages count
                               for more */
    struct aircraft_system system;
    char operator_id[21]; /* empty when unknown */
    uint8_t operator_id_type;
};

/* What the autopilot says besides, for status and pilot. */
struct aircraft_condition {
    bool armed;              /* arming.h */
    bool flies_unheard;      /* armed by what it does: no HEARTBEAT said so */
    bool emergency;          /* declared, or measured */
    bool emergency_declared; /* by a SELF_ID */
    bool operators_differ;   /* vehicle and ground station each tell an operator's place */
    bool heartbeat_fresh;
    bool time_known;
    int64_t unix_us; /* UTC now, when time_known */
    bool takeoff_known;
    bool takeoff_is_home;     /* armed unheard or without a fix: its home stands in */
    bool takeoff_is_late;     /* armed without a fix: the first one on the ground stands in */
    bool crashed;             /* it said so, and wasn't armed since */
    bool fix_known;           /* the autopilot's, within the last 3 s */
    bool apart;               /* its position isn't where its GNSS receiver is, and doesn't count */
    bool simulated;           /* HEARTBEAT says hardware in the loop */
    bool receivers_differ;    /* both of its receivers have a fix, in two places */
    bool altitude_apart;      /* its altitude isn't its receiver's, and doesn't count */
    bool altitudes_differ;    /* native LOCATION's isn't its receiver's: telemetry's goes out */
    bool landed_state_wrong;  /* it contradicts what the aircraft does, and doesn't count */
    bool speed_wrong;         /* it says 0, and moves: unknown */
    bool vertical_inverted;   /* it sends vertical speed upside down: set right (vertical.h) */
    int64_t operator_ahead_s; /* the ground station's clock; 0 while not known */
    uint8_t mav_type, autopilot;
    uint8_t said_mav_type; /* HEARTBEAT's; in flight mav_type stays that of before */
    unsigned autopilot_restarts;
    double position_rate_hz; /* new positions a second of the source that speaks; NAN unknown */
    uint8_t basic_id_conflict, operator_id_conflict;    /* native differs from configured: 1 */
    bool description_conflict, classification_conflict; /* likewise */
    bool area_upside_down; /* its ceiling is under its floor: both unknown */
    bool operator_ids_differ, descriptions_differ; /* vehicle's and ground station's */
    bool basic_ids_differ;                         /* two ground stations' */
};

struct aircraft; /* one per daemon */

/* config must outlive the aircraft. start_us: now. Static storage, freshly zeroed. */
struct aircraft *aircraft_init(const struct config *config, int64_t start_us);

/* Takes one update from telemetry. */
void aircraft_update(struct aircraft *aircraft, const struct telemetry_update *update,
                     int64_t now_us);

/* What to broadcast now. */
void aircraft_view(const struct aircraft *aircraft, int64_t now_us, struct aircraft_view *view);

void aircraft_condition(const struct aircraft *aircraft, int64_t now_us,
                        struct aircraft_condition *condition);

/* The frozen take-off point, to be kept over a restart. */
const struct kept_takeoff *aircraft_takeoff(const struct aircraft *aircraft);
/* As it was before a restart: it ends by the autopilot's word only (arming.h). */
void aircraft_restore_armed(struct aircraft *aircraft, bool armed);
/* The autopilot had a fix just before: positions count until GPS_RAW_INT says otherwise, or for 3
 * s. It had none, but had spoken: that is said on, and no 3 s begin in which it isn't. */
void aircraft_restore_fix(struct aircraft *aircraft, bool fix_known, int64_t now_us);
void aircraft_restore_vertical(struct aircraft *aircraft, bool inverted);
void aircraft_restore_crash(struct aircraft *aircraft, bool crashed, int64_t now_us);
/* After that. It counts at once where it was armed, and when the first HEARTBEAT says armed: then
 * the arming edge was before our time. */
void aircraft_restore_takeoff(struct aircraft *aircraft, const struct kept_takeoff *takeoff);

/*
 * ASTM UA type (0-15) of a MAV_TYPE, or -1 for a component that is no vehicle.
 * The two enumerations look alike and are not.
 */
int aircraft_ua_type(uint8_t mav_type);

#endif
