/*
 * MAVLink frames -> typed updates in physical units.
 *
 * Pure: bytes and time come in as arguments. Knows which frames concern this
 * aircraft (MAVLink Open Drone ID service guide, and what QGroundControl,
 * ArduPilot and PX4 really send); everything else is counted and ignored.
 */
#ifndef ODID_TELEMETRY_H
#define ODID_TELEMETRY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "mavlink/framing.h"

/* Our component id as a Remote ID transmitter; 237 and 238 are for further ones. */
#define TELEMETRY_COMPONENT_ODID 236
/* Byte streams parsed side by side: the serial port, or as many UDP senders. */
#define TELEMETRY_STREAMS 8
#define TELEMETRY_AUTH_PAGES 16
#define TELEMETRY_AUTH_PAGE_SIZE 23

enum telemetry_kind {
    TELEMETRY_HEARTBEAT,
    TELEMETRY_SYSTEM_TIME,
    TELEMETRY_GPS_RAW,
    TELEMETRY_GPS2_RAW, /* a second receiver's gps_raw */
    TELEMETRY_GLOBAL_POSITION,
    TELEMETRY_HOME,
    TELEMETRY_LANDED_STATE,
    TELEMETRY_CLIMB,
    TELEMETRY_CRASHED,
    TELEMETRY_COMMAND_ACK,
    TELEMETRY_BASIC_ID,
    TELEMETRY_LOCATION,
    TELEMETRY_AUTHENTICATION,
    TELEMETRY_SELF_ID,
    TELEMETRY_SYSTEM,
    TELEMETRY_SYSTEM_UPDATE,
    TELEMETRY_OPERATOR_ID,
};

/* Sixteen pages of Authentication, one a second, come again within this time. */
#define TELEMETRY_AUTHENTICATION_KEPT_US 30000000

/* Angles in degrees, lengths in metres, speeds in m/s, up positive; NAN = unknown. */
struct telemetry_update {
    enum telemetry_kind kind;
    bool by_another;  /* a native message: not its autopilot's own word */
    uint16_t speaker; /* whose a native message is: system id * 256 + component id */
    union {
        struct {
            uint8_t mav_type, autopilot, base_mode, system_status; /* MAVLink enumerations */
            bool doubtful;    /* two sources speak as the autopilot */
            bool new_vehicle; /* another system id than before: forget the old aircraft */
        } heartbeat;
        struct {
            uint64_t unix_us;
            uint32_t boot_ms;
        } system_time;
        struct {
            uint8_t fix_type;                   /* GPS_FIX_TYPE */
            uint64_t time_us;                   /* the fix's, of whichever clock; 0: not known */
            double latitude_deg, longitude_deg; /* the receiver's own; NAN when it has none */
            double altitude_msl_m;              /* likewise */
            double separation_m; /* ellipsoid height minus height above mean sea level */
            double horizontal_accuracy_m, vertical_accuracy_m, speed_accuracy_mps;
        } gps_raw;
        struct {
            uint32_t boot_ms;
            double latitude_deg, longitude_deg; /* NAN when the message says 0,0 */
            double altitude_msl_m, relative_altitude_m;
            double north_mps, east_mps, up_mps;
        } global_position;
        struct {
            double latitude_deg, longitude_deg, altitude_msl_m;
        } home;
        uint8_t landed_state; /* MAV_LANDED_STATE */
        double climb_mps;     /* VFR_HUD's: from the barometer, up positive in every version */
        struct {              /* the autopilot's answer to a command of ours */
            uint16_t command; /* MAV_CMD */
            uint8_t result;   /* MAV_RESULT */
        } command_ack;
        struct {
            uint8_t id_type, ua_type; /* ASTM numbers */
            char uas_id[21];          /* types 3 and 4 are binary: 20 bytes, zeros among them */
        } basic_id;
        struct {
            uint8_t status, height_reference;
            double direction_deg, speed_mps, vertical_speed_mps;
            double latitude_deg, longitude_deg;
            double altitude_barometric_m, altitude_geodetic_m, height_m;
            uint8_t horizontal_accuracy, vertical_accuracy, barometer_accuracy; /* ASTM codes */
            uint8_t speed_accuracy, timestamp_accuracy;
            double timestamp_s; /* since the full UTC hour; NAN when unknown */
        } location;
        struct {
            uint8_t type, page, last_page, length;
            uint32_t timestamp_2019_s;
            uint8_t data[TELEMETRY_AUTH_PAGE_SIZE]; /* 17 bytes on page 0 */
        } authentication;
        struct {
            uint8_t type;
            char text[24];
        } self_id;
        struct { /* SYSTEM and SYSTEM_UPDATE; the latter leaves the first line and area alone */
            uint8_t operator_location_type, classification_type, category_eu, class_eu;
            double operator_latitude_deg, operator_longitude_deg, operator_altitude_m;
            uint16_t area_count, area_radius_m;
            double area_ceiling_m, area_floor_m;
            uint32_t timestamp_2019_s; /* seconds since 2019-01-01 UTC, 0 = unknown */
        } system;
        struct {
            uint8_t type;
            char operator_id[21];
        } operator_id;
    };
};

struct telemetry_counters {
    uint64_t frames; /* understood and used */
    struct framing_counters framing;
    uint64_t other_transmitter; /* from components 236-238 */
    uint64_t other_aircraft;    /* id_or_mac set: somebody heard it */
    uint64_t other_system;      /* neither our vehicle nor addressed to us */
    uint64_t not_needed;        /* valid, and of no use here */
    uint64_t not_believed;      /* as the vehicle's, and contradicting it (belief.h) */
};

typedef void telemetry_fn(void *context, const struct telemetry_update *update, int64_t now_us);

struct telemetry; /* about 6 KiB, one per process */

/* Never fails: the storage is static inside (one instance a process), freshly zeroed. */
struct telemetry *telemetry_init(telemetry_fn *deliver, void *context);

/*
 * Feeds bytes as they came from one stream (0..TELEMETRY_STREAMS-1), in any
 * portions (framing_stream). Calls deliver for each update, in order.
 */
void telemetry_receive(struct telemetry *telemetry, unsigned stream, const uint8_t *bytes,
                       size_t length, int64_t now_us);

/* The same for one datagram of whole frames (framing_datagram). */
void telemetry_receive_datagram(struct telemetry *telemetry, unsigned stream, const uint8_t *bytes,
                                size_t length, int64_t now_us);

/* The autopilot has started again: it hasn't said yet who it is, and a ground station may. */
void telemetry_restarted(struct telemetry *telemetry);

/* Before a restart of ours, or at the power-on before, the vehicle was this one (0: unknown), and
 * armed or not: its telemetry counts from now on, before its HEARTBEAT, and it may return at any
 * time: whoever is heard first after power-on is not the vehicle by that. */
void telemetry_expect(struct telemetry *telemetry, uint8_t vehicle, bool armed, int64_t now_us);

/* Forgets a half-received frame: the stream's device or sender is another one now. */
void telemetry_reset_stream(struct telemetry *telemetry, unsigned stream);

/*
 * The vehicle is the first system whose autopilot (component 1) sent a
 * HEARTBEAT. Another one takes its place only when both say that they are
 * disarmed, after 10 s of silence, and that of an expected one after 3 s; it is
 * no ground station's. The first (or expected) one has it back with its next
 * HEARTBEAT.
 * Returns its system id, 0 while none is known.
 */
uint8_t telemetry_vehicle(const struct telemetry *telemetry);
/* Is it there to stay, and no stray voice that said a HEARTBEAT or two? */
bool telemetry_vehicle_settled(const struct telemetry *telemetry);
/* Has anything come of it within 3 s, if only something that nobody needs; under another id, too?
 */
bool telemetry_vehicle_speaks(const struct telemetry *telemetry, int64_t now_us);
/* It doesn't, and an autopilot of another id does: its own one may have been changed. */
bool telemetry_another_id_speaks(const struct telemetry *telemetry, int64_t now_us);
/* Whole frames come, within 3 s, and none of any autopilot's: of a ground station, of a camera. */
bool telemetry_only_others_speak(const struct telemetry *telemetry, int64_t now_us);
/* Does any autopilot speak, within 3 s, whatever its number? */
bool telemetry_autopilot_speaks(const struct telemetry *telemetry, int64_t now_us);
/* For 3 s one has spoken on without a HEARTBEAT that counts, or from its first word on without any:
 * the vehicle may have another number by now. Not one that was switched off, whose last HEARTBEAT
 * came before its last word. */
bool telemetry_heartbeat_missing(const struct telemetry *telemetry, int64_t now_us);
/* Was its autopilot's last frame signed (MAVLink 2)? */
bool telemetry_vehicle_signs(const struct telemetry *telemetry);
/* The stream on which the vehicle was heard last; -1 while none is known. */
int telemetry_vehicle_stream(const struct telemetry *telemetry);
/* When the vehicle's last HEARTBEAT came, INT64_MIN before the first. */
int64_t telemetry_heartbeat_us(const struct telemetry *telemetry);

/* Do two sources speak as the vehicle's autopilot, and contradict each other (belief.h)? */
bool telemetry_contradicted(const struct telemetry *telemetry, int64_t now_us);

const struct telemetry_counters *telemetry_counters(const struct telemetry *telemetry);

#endif
