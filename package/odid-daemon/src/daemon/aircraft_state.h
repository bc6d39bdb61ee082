/*
 * The inside of struct aircraft, for the files that make it up: aircraft.c takes
 * what comes (positions by aircraft_position.c, take-off and home by
 * aircraft_takeoff.c, what only people know by aircraft_operator.c), aircraft_view.c chooses from
 * it (Location by aircraft_location.c, its status by aircraft_status.c).
 */
#ifndef ODID_AIRCRAFT_STATE_H
#define ODID_AIRCRAFT_STATE_H

#include "daemon/aircraft.h"
#include "daemon/arming.h"
#include "daemon/autopilot_clock.h"
#include "daemon/vertical.h"

/* The rate of positions is the mean of about so many intervals. */
#define AIRCRAFT_RATE_POSITIONS 10
#define UNIX_2019_S INT64_C(1546300800)
/* Who tells the operator's place seldom, at 3.5 s for instance, is still who tells it; ArduPilot
 * passes each of a ground station's messages on every 5 s. */
#define AIRCRAFT_SPEAKER_KEPT_US 10000000

/* Something is where no receiver is. */
struct aircraft_apart {
    int64_t since_us; /* INT64_MIN: it isn't */
    int64_t until_us; /* when it was near again, after ... */
    int64_t for_us;   /* ... that time */
};

/* It says that it rests, and does it? */
struct aircraft_rest {
    int64_t since_us; /* it says so, or is looked at anew; INT64_MIN: it doesn't say so */
    double latitude_deg, longitude_deg, altitude_m; /* there, then */
    bool wrong;                                     /* it moves */
};

/* A position as one source gave it last. */
struct aircraft_fix {
    int64_t fix_us; /* on our clock; INT64_MIN: never */
    double latitude_deg, longitude_deg;
    double altitude_msl_m, relative_altitude_m;     /* plain telemetry only */
    double north_mps, east_mps, vertical_speed_mps; /* plain telemetry only */
    int64_t moved_us; /* when it was last elsewhere than before, which is there: */
    double moved_latitude_deg, moved_longitude_deg;
    struct aircraft_apart apart;
    int64_t climbed_us; /* the same of its altitude, ... */
    double climbed_m;
    struct aircraft_apart high;       /* ... which isn't its receiver's */
    struct aircraft_rest rest, level; /* by its speed; by its vertical speed */
};

/* Each within 3 s of the one before, and in no doubt, until there were enough. */
struct aircraft_words {
    int64_t since_us;
    bool enough;
};

/* GPS_RAW_INT's, GPS2_RAW's. */
#define AIRCRAFT_RECEIVERS 2
struct aircraft_receiver {
    int64_t said_us;                    /* INT64_MIN: never */
    uint8_t fix_type;                   /* GPS_FIX_TYPE */
    uint64_t time_us;                   /* its own, of whichever clock; 0: not known */
    double latitude_deg, longitude_deg; /* NAN unknown, likewise below */
    double separation_m;
    struct aircraft_words words;
    double horizontal_accuracy_m, vertical_accuracy_m, speed_accuracy_mps;
    int64_t near_us[2]; /* when it was where telemetry's position is, and the native one */
};

/* Ellipsoid height minus height above mean sea level. It changes by metres over tens of kilometres,
 * and holds until another one is said as often. */
struct aircraft_separation {
    double m, lasting_m; /* said last; said often enough; NAN: never */
    int64_t said_us;     /* INT64_MIN: never */
    struct aircraft_words words;
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
    int64_t since_us;                         /* it comes without a break */
    int64_t said_us;                          /* its own instant, on our clock; INT64_MIN: never */
    struct telemetry_update received;         /* its location, as it came */
    struct telemetry_update counted;          /* the one whose position is native.fix_us's */
    unsigned statuses;                        /* so many in a row have said the same status */
    int64_t emergency_since_us, emergency_us; /* emergency is said, whatever its place and time are:
                                                 without a break, and last; INT64_MIN: it isn't */
    double timestamp_s;
    bool instant_known; /* of the one that counted: its timestamp could be laid on our clock */
    double altitude_geodetic_m, altitude_barometric_m; /* corrected for the sender's habits */
};

/* Who says what can't be measured: the aircraft's own side, or a ground station. */
enum aircraft_speaker { AIRCRAFT_SPEAKER_VEHICLE, AIRCRAFT_SPEAKER_GROUND, AIRCRAFT_SPEAKERS };

/* Of several on the ground one is heard, for each of these. */
enum aircraft_ground {
    GROUND_SELF_ID,
    GROUND_OPERATOR_ID,
    GROUND_SYSTEM,
    GROUND_AUTHENTICATION,
    GROUND_BASIC_ID,
    AIRCRAFT_GROUNDS
};

struct aircraft_ground_speaker {
    uint16_t speaker; /* telemetry_update's */
    int64_t said_us;  /* INT64_MIN: never; likewise below */
    /* Two with one number, as two QGroundControls have it, take turns, or an autopilot passes on
     * what each of two says: how often it has been another word than just before, and when last. */
    unsigned changes[AIRCRAFT_SPEAKERS];
    int64_t changed_us[AIRCRAFT_SPEAKERS];
    int64_t differ_us; /* when two were seen to say two things, last */
};

struct aircraft_description {
    int64_t said_us; /* INT64_MIN: never */
    uint8_t type;
    char text[24]; /* empty: taken back, or never said */
};

struct aircraft_operator_number {
    int64_t said_us; /* INT64_MIN: never */
    uint8_t type;
    char number[21];
};

struct aircraft_native_system {
    int64_t said_us; /* when its timestamp moved last; INT64_MIN: never */
    bool known;      /* not the operator's place only */
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
    int64_t said_us;
};

struct aircraft {
    const struct config *config;
    int64_t start_us;
    struct autopilot_clock clock;

    int64_t heartbeat_us; /* INT64_MIN: never; likewise below */
    uint8_t said_mav_type, autopilot, system_status, said_status;
    bool simulated;      /* it says that it flies in a simulation */
    int64_t kind_us;     /* when that type, autopilot and that was said last */
    uint8_t mav_type;    /* what it is: that type, but what a HEARTBEAT says in flight */
    bool type_known;     /* it was said at all, ... */
    bool type_on_ground; /* ... and on the ground */
    bool doubtful;       /* two sources speak as the autopilot */
    int64_t doubtful_us; /* since when */
    struct arming arming;
    bool armed;            /* its outcome */
    bool flies_unheard;    /* armed by what it does: no HEARTBEAT said so */
    int64_t unheard_us;    /* since when it flies without one; INT64_MIN: it doesn't */
    bool says_disarmed;    /* its last word, from one source; of two that speak for 3 s nobody says
                              armed */
    int64_t said_armed_us; /* the last such word */
    int64_t only_armed_us; /* since when it says nothing else, in no doubt; INT64_MIN: it doesn't */
    int64_t armed_us, armed_ended_us;
    unsigned boot_seen; /* the autopilot's starts of which something is known */
    int64_t landed_us;
    uint8_t landed_state;
    int64_t in_air_us; /* the last landed state that said so */
    bool landed_wrong; /* what it does contradicts its landed state, which counts when it changes */
    int64_t landed_no_us; /* since when it does; INT64_MIN: it doesn't */
    int64_t lies_us;      /* since when it is disarmed, low and at rest; INT64_MIN: it isn't */
    bool crash_counts;    /* it was disarmed then, in no doubt */
    int64_t crashed_us;   /* when the autopilot said so; forgotten when it is armed again */

    bool takeoff_pending; /* armed, and may still become known */
    bool takeoff_is_home, takeoff_is_late;
    struct kept_takeoff takeoff, kept_takeoff, home;

    struct aircraft_waiting waiting_position, waiting_time;
    struct aircraft_fix telemetry;
    struct aircraft_rate telemetry_rate;
    struct vertical vertical;
    bool altitudes_differ, heights_differ; /* the native ones from telemetry's */
    int64_t position_boot_us;              /* its own timestamp, not wrapped, ... */
    unsigned position_boot;                /* ... since which start of the autopilot */
    struct aircraft_receiver receiver[AIRCRAFT_RECEIVERS];
    struct aircraft_apart receivers; /* of each other */
    int64_t no_fix_us; /* since when they say that there is none; INT64_MIN: they don't */
    struct aircraft_separation separation;
    double native_separation_m; /* by the native altitude, beside telemetry's above the sea */

    struct aircraft_fix native;
    struct aircraft_rate native_rate;
    bool native_keeps_up; /* is as new as telemetry's */
    int64_t native_behind_us;
    int64_t native_rated_us; /* its position had a time and an accuracy: it has a fix */
    struct aircraft_native_location native_location;
    int64_t telemetry_since_us;    /* plain telemetry's positions come without a break */
    struct aircraft_location last; /* said when no fix counts; fix_us INT64_MIN: nothing */
    unsigned leap_seen;
    double leap_ahead_s, leap_s;

    struct aircraft_native_id native_basic_id[2]; /* a serial number, or another type; another */
    bool basic_id_by_another[2];                  /* not the vehicle's own word */
    struct aircraft_auth_page auth[TELEMETRY_AUTH_PAGES];
    uint32_t auth_received; /* bit per page */
    int64_t auth_said_us;   /* the last page */
    bool auth_by_another;
    struct aircraft_description description[AIRCRAFT_SPEAKERS]; /* the last word of each, ... */
    struct aircraft_description emergency[AIRCRAFT_SPEAKERS];   /* ... that declares one */
    struct aircraft_operator_number operator_number[AIRCRAFT_SPEAKERS];
    struct aircraft_native_system system[AIRCRAFT_SPEAKERS];
    enum aircraft_speaker system_speaker; /* whose counts */
    struct aircraft_ground_speaker ground[AIRCRAFT_GROUNDS];
};

/* ---- aircraft_position.c ---- */

/* Came a native LOCATION within AIRCRAFT_FRESH_US? */
bool aircraft_native_fresh(const struct aircraft *aircraft, int64_t now_us);

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
bool aircraft_waits(const struct aircraft_waiting *waiting, int64_t now_us);

/* Is it known, and not for more than 3 s, that the autopilot has a GNSS fix? */
bool aircraft_fix_known(const struct aircraft *aircraft, int64_t now_us);

/* The position that counts of the source that speaks; NULL when none counts. */
const struct aircraft_fix *aircraft_best_fix(const struct aircraft *aircraft, int64_t now_us);

/* Is it fresh, and not where its receiver isn't? */
bool aircraft_fix_counts(const struct aircraft_fix *fix, int64_t now_us);

/* Altitude above the WGS-84 ellipsoid of a fix of ours; NAN when unknown. */
double aircraft_geodetic_m(const struct aircraft *aircraft, const struct aircraft_fix *fix,
                           int64_t now_us);

/* Positions a second: NAN before there were two, 0 when none came for 3 s. */
double aircraft_rate_hz(const struct aircraft_rate *rate, int64_t now_us);

/* ---- aircraft_view.c ---- */

/* Another one stands instead of it: it is no serial number, and wasn't said for 30 s at that
 * instant. */
bool aircraft_id_is_corrected(const struct aircraft_native_id *id, int64_t at_us);

/* ---- aircraft_receivers.c ---- */

void aircraft_take_gps_raw(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us);
void aircraft_forget_receivers(struct aircraft *aircraft);
/* NAN: unknown. */
double aircraft_separation_m(const struct aircraft *aircraft, int64_t now_us);

/* The one that has a fix, and that the position comes from; of two that are as good the first one.
 * NULL: none has. */
const struct aircraft_receiver *aircraft_receiver(const struct aircraft *aircraft, int64_t now_us);
/* Do both have a fix, and not in the same place, for long? */
bool aircraft_receivers_differ(const struct aircraft *aircraft, int64_t now_us);
/* Does any of them say anything, if only that it has none? */
bool aircraft_receivers_heard(const struct aircraft *aircraft, int64_t now_us);
/* Was one of them there, since the autopilot's start, and says nothing for 3 s now? A few words may
 * be anybody's, or an answer to somebody. */
bool aircraft_receiver_fell_silent(const struct aircraft *aircraft, int64_t now_us);
/* A receiver flies on, and this position, while it is fresh, has stayed somewhere else for 12 s;
 * for 3 s where it stands still. */
bool aircraft_is_apart(const struct aircraft_fix *fix, int64_t now_us);
/* The same of its altitude. */
bool aircraft_altitude_is_apart(const struct aircraft_fix *fix, int64_t now_us);

/* ---- aircraft_takeoff.c ---- */

/* HEARTBEATs begin to say armed; arming_seen: and said disarmed until now. */
void aircraft_begin_flight(struct aircraft *aircraft, bool arming_seen, int64_t now_us);

/* While it is pending where it takes off: what came may tell. on_ground: aircraft_is_on_ground. */
void aircraft_look_for_takeoff(struct aircraft *aircraft, bool on_ground, int64_t now_us);

void aircraft_take_home(struct aircraft *aircraft, const struct telemetry_update *update);

/* Plain telemetry's, above the take-off point; NAN when that isn't known. */
double aircraft_height_m(const struct aircraft *aircraft);
/* The same by the native altitude: not as its message says, which may be above a home that is moved
 * in flight. */
double aircraft_native_height_m(const struct aircraft *aircraft);

/* ---- aircraft_operator.c ---- */

void aircraft_take_self_id(struct aircraft *aircraft, const struct telemetry_update *update,
                           int64_t now_us);
void aircraft_take_operator_id(struct aircraft *aircraft, const struct telemetry_update *update,
                               int64_t now_us);
void aircraft_take_system(struct aircraft *aircraft, const struct telemetry_update *update,
                          int64_t now_us);
/* Nothing of what it said counts any more. */
void aircraft_forget_speaker(struct aircraft *aircraft, enum aircraft_speaker speaker);

/* Within the last 10 s? INT64_MIN: never. */
bool aircraft_still_said(int64_t said_us, int64_t now_us);

/* Of several on the ground the one that spoke first, until it is silent: they would take turns, the
 * last word about an emergency would be anybody's, and pages of two would be no signature. But what
 * is urgent is heard. */
bool aircraft_is_heard(struct aircraft *aircraft, enum aircraft_ground what,
                       const struct telemetry_update *update, bool urgent, int64_t now_us);

/* Of what was heard: changed: it is another thing than the same speaker said before. */
void aircraft_watch_turns(struct aircraft *aircraft, enum aircraft_ground what,
                          const struct telemetry_update *update, bool changed, int64_t now_us);

/* Two say two things of it. */
bool aircraft_two_differ(const struct aircraft *aircraft, enum aircraft_ground what,
                         int64_t now_us);

/* Somebody declares an emergency now: until it takes that back, or is silent for 10 s. NULL:
 * nobody. */
const struct aircraft_description *aircraft_emergency_said(const struct aircraft *aircraft,
                                                           int64_t now_us);
/* An emergency first; NULL: nobody has said anything. */
const struct aircraft_description *aircraft_description_said(const struct aircraft *aircraft,
                                                             int64_t now_us);
/* number empty: nobody has said it. */
const struct aircraft_operator_number *aircraft_operator_said(const struct aircraft *aircraft);
/* Of the one that counts. */
const struct aircraft_native_system *aircraft_system_said(const struct aircraft *aircraft,
                                                          int64_t now_us);
/* Does it say an operator's place? */
bool aircraft_operator_told(const struct aircraft *aircraft, int64_t now_us);
/* It says "take-off", and not where this flight took off: a home that was moved. */
bool aircraft_takeoff_contradicts(const struct aircraft *aircraft,
                                  const struct aircraft_native_system *system);
/* Do two say one, and not the same? */
bool aircraft_operators_differ(const struct aircraft *aircraft, int64_t now_us);

/* ---- aircraft_status.c ---- */

/* Only what is known: a landed state, else how it moves, and how high. */
bool aircraft_is_flying(const struct aircraft *aircraft, int64_t now_us);
/* Its landed state says so, and nothing else that it does contradicts that. */
bool aircraft_is_on_ground(const struct aircraft *aircraft, int64_t now_us);
bool aircraft_is_emergency(const struct aircraft *aircraft, int64_t now_us);

/* With each HEARTBEAT: does what the aircraft does contradict what is said of it? */
void aircraft_watch_landed_state(struct aircraft *aircraft, int64_t now_us);

/* After position_source and position_fresh. */
void aircraft_view_status(const struct aircraft *aircraft, int64_t now_us,
                          struct aircraft_location *out);

/* ---- aircraft_location.c ---- */

/* After each position that counts. What was found while both were there stands: the one that isn't
 * believed doesn't count either once the other one is gone. But a native height without telemetry
 * is held against its own message's altitude. */
void aircraft_compare_altitudes(struct aircraft *aircraft, int64_t now_us);

/* Is the native altitude another one than telemetry's? Then it doesn't count. */
bool aircraft_altitudes_differ(const struct aircraft *aircraft, int64_t now_us);

/* With whatever came. When no fix counts any more, the place of the last one that did is said, or
 * of a newer one that came late and that no receiver contradicts. */
void aircraft_keep_location(struct aircraft *aircraft, int64_t now_us);

/* The Location to broadcast now. */
void aircraft_view_location(const struct aircraft *aircraft, int64_t now_us,
                            struct aircraft_location *out);

#endif
