#include "telemetry.h"

#include <common/mavlink.h>
#include <math.h>
#include <string.h>

#include "aircraft.h"
#include "telemetry_odid.h"

/* A vehicle that was silent for this long may be another one: a changed SYSID, another aircraft. */
#define VEHICLE_FORGOTTEN_US 10000000
#define VEHICLE_EXPECTED_US 3000000 /* three of its HEARTBEATs */

struct stream {
    mavlink_message_t message; /* as far as parsed */
    mavlink_status_t status;
    uint8_t held[MAVLINK_MAX_PACKET_LEN + 1]; /* since the start byte that is being tried */
    size_t length, parsed;
    bool failed; /* what was parsed is no frame that can be read */
};

struct telemetry {
    telemetry_fn *deliver;
    void *context;
    struct stream streams[TELEMETRY_STREAMS];
    struct telemetry_counters counters;
    uint8_t vehicle; /* system id, 0 = none yet */
    int vehicle_stream;
    int64_t heartbeat_us;
    int64_t vehicle_until_us;         /* no other system is the vehicle until then */
    uint8_t ground_stations[256 / 8]; /* system ids that sent a ground station's HEARTBEAT */
};

struct telemetry *telemetry_init(telemetry_fn *deliver, void *context)
{
    static struct telemetry telemetry;

    memset(&telemetry, 0, sizeof(telemetry));
    telemetry.deliver = deliver;
    telemetry.context = context;
    telemetry.vehicle_stream = -1;
    telemetry.heartbeat_us = INT64_MIN;
    return &telemetry;
}

void telemetry_expect(struct telemetry *telemetry, uint8_t vehicle, int64_t now_us)
{
    telemetry->vehicle = vehicle;
    telemetry->vehicle_until_us = now_us + VEHICLE_EXPECTED_US;
}

static double degrees(int32_t deg_e7)
{
    return deg_e7 * 1e-7;
}

/* 0,0 means unknown, for both; so does what is nowhere on Earth. */
static void place(int32_t latitude_e7, int32_t longitude_e7, double *latitude_deg,
                  double *longitude_deg)
{
    bool known = (latitude_e7 != 0 || longitude_e7 != 0) && latitude_e7 >= -900000000 &&
                 latitude_e7 <= 900000000 && longitude_e7 >= -1800000000 &&
                 longitude_e7 <= 1800000000;

    *latitude_deg = known ? degrees(latitude_e7) : NAN;
    *longitude_deg = known ? degrees(longitude_e7) : NAN;
}

/* MAVLink 2 extension fields read as 0 when absent. */
static double thousandths_or_nan(uint32_t value)
{
    return value == 0 || value == UINT32_MAX ? NAN : value / 1000.0;
}

static void read_gps_raw(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_gps_raw_int_t raw;

    mavlink_msg_gps_raw_int_decode(message, &raw);
    update->gps_raw.fix_type = raw.fix_type;
    update->gps_raw.separation_m =
        raw.alt_ellipsoid == 0 ? NAN : (raw.alt_ellipsoid - (double)raw.alt) / 1000.0;
    update->gps_raw.horizontal_accuracy_m = thousandths_or_nan(raw.h_acc);
    update->gps_raw.vertical_accuracy_m = thousandths_or_nan(raw.v_acc);
    update->gps_raw.speed_accuracy_mps = thousandths_or_nan(raw.vel_acc);
}

static void read_global_position(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_global_position_int_t position;

    mavlink_msg_global_position_int_decode(message, &position);
    update->global_position.boot_ms = position.time_boot_ms;
    place(position.lat, position.lon, &update->global_position.latitude_deg,
          &update->global_position.longitude_deg);
    update->global_position.altitude_msl_m = position.alt / 1000.0;
    update->global_position.relative_altitude_m = position.relative_alt / 1000.0;
    update->global_position.north_mps = position.vx / 100.0;
    update->global_position.east_mps = position.vy / 100.0;
    update->global_position.up_mps = -position.vz / 100.0; /* MAVLink: positive down */
}

static void read_home(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_home_position_t home;

    mavlink_msg_home_position_decode(message, &home);
    place(home.latitude, home.longitude, &update->home.latitude_deg, &update->home.longitude_deg);
    update->home.altitude_msl_m = home.altitude / 1000.0;
}

static void read_system_time(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_system_time_t time;

    mavlink_msg_system_time_decode(message, &time); /* MAVLink's own getter reads misaligned */
    update->system_time.unix_us = time.time_unix_usec;
    update->system_time.boot_ms = time.time_boot_ms;
}

/* Plain telemetry, from the vehicle's autopilot only. Returns false when the id is of no use. */
static bool read_plain(const mavlink_message_t *message, struct telemetry_update *update)
{
    switch (message->msgid) {
    case MAVLINK_MSG_ID_SYSTEM_TIME:
        update->kind = TELEMETRY_SYSTEM_TIME;
        read_system_time(message, update);
        return true;
    case MAVLINK_MSG_ID_GPS_RAW_INT:
        update->kind = TELEMETRY_GPS_RAW;
        read_gps_raw(message, update);
        return true;
    case MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
        update->kind = TELEMETRY_GLOBAL_POSITION;
        read_global_position(message, update);
        return true;
    case MAVLINK_MSG_ID_HOME_POSITION:
        update->kind = TELEMETRY_HOME;
        read_home(message, update);
        return true;
    case MAVLINK_MSG_ID_EXTENDED_SYS_STATE:
        update->kind = TELEMETRY_LANDED_STATE;
        update->landed_state = mavlink_msg_extended_sys_state_get_landed_state(message);
        return true;
    default:
        return false;
    }
}

static bool is_ground_station(const struct telemetry *telemetry, uint8_t system_id)
{
    return telemetry->ground_stations[system_id / 8] >> (system_id % 8) & 1;
}

/*
 * Whose Open Drone ID messages are ours to take. The guide says target 0 or
 * our own ids; but QGroundControl addresses the autopilot, and ArduPilot
 * relays with that target unchanged.
 */
static bool odid_concerns_us(const struct telemetry *telemetry, const mavlink_message_t *message,
                             const struct telemetry_odid_address *to)
{
    bool to_vehicle = to->system == telemetry->vehicle;

    if (telemetry->vehicle == 0) {
        return false;
    }
    if (message->sysid == telemetry->vehicle) {
        if (message->compid == MAV_COMP_ID_AUTOPILOT1) {
            return to->system == 0 || to_vehicle;
        }
        return to->system == 0 ||
               (to_vehicle && (to->component == 0 || to->component == TELEMETRY_COMPONENT_ODID));
    }
    if (!is_ground_station(telemetry, message->sysid) ||
        message->msgid == MAVLINK_MSG_ID_OPEN_DRONE_ID_LOCATION ||
        message->msgid == MAVLINK_MSG_ID_OPEN_DRONE_ID_MESSAGE_PACK) {
        return false; /* where the aircraft is, only the aircraft knows */
    }
    return to->system == 0 ||
           (to_vehicle && (to->component == 0 || to->component == TELEMETRY_COMPONENT_ODID ||
                           to->component == MAV_COMP_ID_AUTOPILOT1));
}

static void take_odid(struct telemetry *telemetry, const mavlink_message_t *message, int64_t now_us)
{
    struct telemetry_odid_address to;

    telemetry_odid_address(message, &to);
    if (to.other_aircraft) {
        telemetry->counters.other_aircraft++;
    } else if (!odid_concerns_us(telemetry, message, &to)) {
        telemetry->counters.other_system++;
    } else {
        telemetry->counters.frames++;
        telemetry_odid_read(message, telemetry->deliver, telemetry->context, now_us);
    }
}

static void take_heartbeat(struct telemetry *telemetry, const mavlink_message_t *message,
                           int64_t now_us)
{
    struct telemetry_update update = {.kind = TELEMETRY_HEARTBEAT};
    mavlink_heartbeat_t heartbeat;
    bool is_autopilot;

    mavlink_msg_heartbeat_decode(message, &heartbeat);
    if (heartbeat.type == MAV_TYPE_GCS) {
        telemetry->ground_stations[message->sysid / 8] |= (uint8_t)(1 << (message->sysid % 8));
    }
    /* An antenna tracker has an autopilot, too, and is no vehicle. */
    is_autopilot = message->compid == MAV_COMP_ID_AUTOPILOT1 && message->sysid != 0 &&
                   heartbeat.autopilot != MAV_AUTOPILOT_INVALID &&
                   aircraft_ua_type(heartbeat.type) >= 0;
    if (!is_autopilot) {
        telemetry->counters.not_needed++;
        return;
    }
    if (message->sysid != telemetry->vehicle) {
        if (telemetry->vehicle != 0 && now_us < telemetry->vehicle_until_us) {
            telemetry->counters.other_system++;
            return;
        }
        update.heartbeat.new_vehicle = telemetry->vehicle != 0;
        telemetry->vehicle = message->sysid;
    }
    telemetry->heartbeat_us = now_us;
    telemetry->vehicle_until_us = now_us + VEHICLE_FORGOTTEN_US;
    telemetry->counters.frames++;
    update.heartbeat.mav_type = heartbeat.type;
    update.heartbeat.autopilot = heartbeat.autopilot;
    update.heartbeat.base_mode = heartbeat.base_mode;
    update.heartbeat.system_status = heartbeat.system_status;
    telemetry->deliver(telemetry->context, &update, now_us);
}

/* System id 0 is nobody's, and no vehicle is known as 0. */
static bool from_autopilot(const struct telemetry *telemetry, const mavlink_message_t *message)
{
    return telemetry->vehicle != 0 && message->sysid == telemetry->vehicle &&
           message->compid == MAV_COMP_ID_AUTOPILOT1;
}

static void take_frame(struct telemetry *telemetry, unsigned stream,
                       const mavlink_message_t *message, int64_t now_us)
{
    struct telemetry_update update;

    if (message->compid >= TELEMETRY_COMPONENT_ODID &&
        message->compid < TELEMETRY_COMPONENT_ODID + 3) {
        telemetry->counters.other_transmitter++;
        return;
    }
    if (message->msgid == MAVLINK_MSG_ID_HEARTBEAT) {
        take_heartbeat(telemetry, message, now_us);
    } else if (telemetry_odid_is(message->msgid)) {
        take_odid(telemetry, message, now_us);
    } else if (!read_plain(message, &update)) {
        telemetry->counters.not_needed++;
    } else if (!from_autopilot(telemetry, message)) {
        telemetry->counters.other_system++;
    } else {
        telemetry->counters.frames++;
        telemetry->deliver(telemetry->context, &update, now_us);
    }
    if (from_autopilot(telemetry, message)) {
        telemetry->vehicle_stream = (int)stream;
    }
}

/* Tries again from the held byte with this index. */
static void try_from(struct stream *stream, size_t index)
{
    stream->length -= index;
    memmove(stream->held, stream->held + index, stream->length);
    stream->parsed = 0;
    stream->failed = false;
    stream->status.parse_state = MAVLINK_PARSE_STATE_IDLE;
}

/*
 * A frame that can't be read was one, damaged or unknown, where another one
 * follows at once. Else its start byte only looked like one, in the middle of
 * something: frames may have begun since, and the parser alone would swallow
 * them, often for many frames on end.
 */
static void pass_over(struct stream *stream)
{
    uint8_t next = stream->held[stream->parsed];
    bool framed = next == MAVLINK_STX || next == MAVLINK_STX_MAVLINK1;

    try_from(stream, framed ? stream->parsed : 1);
}

/* A header that no known sender writes: found out before what follows is taken for its payload. */
static bool is_absurd(const struct stream *stream)
{
    const mavlink_msg_entry_t *entry = mavlink_get_msg_entry(stream->message.msgid);

    if (stream->message.magic == MAVLINK_STX) {
        return stream->parsed == MAVLINK_NUM_HEADER_BYTES && stream->message.msgid > UINT16_MAX;
    }
    return stream->parsed == MAVLINK_CORE_HEADER_MAVLINK1_LEN + 1 && entry != NULL &&
           stream->message.len != entry->min_msg_len; /* MAVLink 1 never cuts a payload */
}

static void parse_byte(struct telemetry *telemetry, unsigned stream, struct stream *from,
                       int64_t now_us)
{
    mavlink_message_t message;
    mavlink_status_t status;

    switch (mavlink_frame_char_buffer(&from->message, &from->status, from->held[from->parsed++],
                                      &message, &status)) {
    case MAVLINK_FRAMING_OK:
        take_frame(telemetry, stream, &message, now_us);
        try_from(from, from->parsed);
        break;
    case MAVLINK_FRAMING_BAD_CRC:
        /* The CRC covers a seed from the definitions: without one it can't be right. */
        if (mavlink_get_msg_entry(message.msgid) == NULL) {
            telemetry->counters.unknown_id++;
        } else {
            telemetry->counters.bad_crc++;
        }
        from->failed = true;
        break;
    case MAVLINK_FRAMING_BAD_SIGNATURE: /* never: no key is configured */
        from->failed = true;
        break;
    default:
        if (from->status.parse_state <= MAVLINK_PARSE_STATE_IDLE || is_absurd(from)) {
            try_from(from, 1); /* no start byte, or no header */
        }
        break;
    }
}

void telemetry_receive(struct telemetry *telemetry, unsigned stream, const uint8_t *bytes,
                       size_t length, int64_t now_us)
{
    struct stream *from = &telemetry->streams[stream % TELEMETRY_STREAMS];

    for (size_t i = 0; i < length; i++) {
        from->held[from->length++] = bytes[i];
        while (from->parsed < from->length) {
            if (from->failed) {
                pass_over(from);
            } else {
                parse_byte(telemetry, stream, from, now_us);
            }
        }
    }
}

void telemetry_reset_stream(struct telemetry *telemetry, unsigned stream)
{
    memset(&telemetry->streams[stream % TELEMETRY_STREAMS], 0, sizeof(struct stream));
    if (telemetry->vehicle_stream == (int)stream) {
        telemetry->vehicle_stream = -1;
    }
}

uint8_t telemetry_vehicle(const struct telemetry *telemetry)
{
    return telemetry->vehicle;
}

int telemetry_vehicle_stream(const struct telemetry *telemetry)
{
    return telemetry->vehicle_stream;
}

int64_t telemetry_heartbeat_us(const struct telemetry *telemetry)
{
    return telemetry->heartbeat_us;
}

const struct telemetry_counters *telemetry_counters(const struct telemetry *telemetry)
{
    return &telemetry->counters;
}
