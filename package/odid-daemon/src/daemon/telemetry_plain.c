#include "daemon/telemetry_plain.h"

#include <math.h>
#include <string.h>

/* No geoid is further from the ellipsoid. */
#define SEPARATION_MAX_M 120.0

static double degrees(int32_t deg_e7)
{
    return deg_e7 * 1e-7;
}

/* 0,0 means unknown, for both; so does what is nowhere on Earth. */
static void place_e7(int32_t latitude_e7, int32_t longitude_e7, double *latitude_deg,
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

/* The geoid is between 107 m below the ellipsoid and 86 m above it: one of the two altitudes is
 * wrong then. */
static double separation_or_nan(int32_t above_ellipsoid_mm, int32_t above_sea_mm)
{
    double separation_m = (above_ellipsoid_mm - (double)above_sea_mm) / 1000.0;

    return above_ellipsoid_mm == 0 || separation_m < -SEPARATION_MAX_M ||
                   separation_m > SEPARATION_MAX_M
               ? NAN
               : separation_m;
}

/* The two messages have these fields, under the same names. */
#define READ_RECEIVER(raw, update)                                                                 \
    do {                                                                                           \
        (update)->gps_raw.fix_type = (raw).fix_type;                                               \
        (update)->gps_raw.time_us = (raw).time_usec;                                               \
        (update)->gps_raw.altitude_msl_m = (raw).alt == 0 ? NAN : (raw).alt / 1000.0;              \
        place_e7((raw).lat, (raw).lon, &(update)->gps_raw.latitude_deg,                            \
                 &(update)->gps_raw.longitude_deg);                                                \
        (update)->gps_raw.separation_m = separation_or_nan((raw).alt_ellipsoid, (raw).alt);        \
        (update)->gps_raw.horizontal_accuracy_m = thousandths_or_nan((raw).h_acc);                 \
        (update)->gps_raw.vertical_accuracy_m = thousandths_or_nan((raw).v_acc);                   \
        (update)->gps_raw.speed_accuracy_mps = thousandths_or_nan((raw).vel_acc);                  \
    } while (0)

static void read_gps_raw(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_gps_raw_int_t raw;

    mavlink_msg_gps_raw_int_decode(message, &raw);
    READ_RECEIVER(raw, update);
}

static void read_gps2_raw(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_gps2_raw_t raw;

    mavlink_msg_gps2_raw_decode(message, &raw);
    READ_RECEIVER(raw, update);
}

static void read_global_position(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_global_position_int_t position;

    mavlink_msg_global_position_int_decode(message, &position);
    update->global_position.boot_ms = position.time_boot_ms;
    place_e7(position.lat, position.lon, &update->global_position.latitude_deg,
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
    place_e7(home.latitude, home.longitude, &update->home.latitude_deg,
             &update->home.longitude_deg);
    update->home.altitude_msl_m = home.altitude / 1000.0;
}

static void read_system_time(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_system_time_t time;

    mavlink_msg_system_time_decode(message, &time); /* MAVLink's own getter reads misaligned */
    update->system_time.unix_us = time.time_unix_usec;
    update->system_time.boot_ms = time.time_boot_ms;
}

static bool read_climb(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_vfr_hud_t hud;

    mavlink_msg_vfr_hud_decode(message, &hud);
    update->climb_mps = (double)hud.climb;
    return isfinite(hud.climb);
}

/* ArduPilot has no other word for it, in any of its vehicles. */
static bool says_crashed(const mavlink_message_t *message)
{
    static const char crash[] = "Crash";
    mavlink_statustext_t status;

    mavlink_msg_statustext_decode(message, &status);
    return status.severity == MAV_SEVERITY_EMERGENCY &&
           strncmp(status.text, crash, strlen(crash)) == 0;
}

/* Not another component's, or another system's: a ground station commands, too. MAVLink 1 doesn't
 * say whose it is, and only it: in MAVLink 2 nobody's number is somebody who has none. */
static bool read_command_ack(const mavlink_message_t *message, struct telemetry_update *update)
{
    mavlink_command_ack_t ack;

    mavlink_msg_command_ack_decode(message, &ack);
    update->command_ack.command = ack.command;
    update->command_ack.result = ack.result;
    if (message->magic == MAVLINK_STX_MAVLINK1) {
        return true;
    }
    return ack.target_component == TELEMETRY_COMPONENT_ODID && ack.target_system == message->sysid;
}

bool telemetry_plain_read(const mavlink_message_t *message, struct telemetry_update *update)
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
    case MAVLINK_MSG_ID_GPS2_RAW:
        update->kind = TELEMETRY_GPS2_RAW;
        read_gps2_raw(message, update);
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
    case MAVLINK_MSG_ID_VFR_HUD:
        update->kind = TELEMETRY_CLIMB;
        return read_climb(message, update);
    case MAVLINK_MSG_ID_STATUSTEXT:
        update->kind = TELEMETRY_CRASHED;
        return says_crashed(message);
    case MAVLINK_MSG_ID_COMMAND_ACK:
        update->kind = TELEMETRY_COMMAND_ACK;
        return read_command_ack(message, update);
    default:
        return false;
    }
}
