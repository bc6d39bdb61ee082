#include <common/mavlink.h>

#include "daemon/aircraft.h"

/* ASTM F3411 UA types that a MAV_TYPE can mean. */
enum ua_type {
    UA_COMPONENT = -1, /* no vehicle */
    UA_AEROPLANE = 1,
    UA_HELICOPTER_OR_MULTIROTOR = 2,
    UA_GYROPLANE = 3,
    UA_HYBRID_LIFT = 4,
    UA_ORNITHOPTER = 5,
    UA_KITE = 7,
    UA_FREE_BALLOON = 8,
    UA_AIRSHIP = 10,
    UA_PARACHUTE = 11,
    UA_ROCKET = 12,
    UA_GROUND_OBSTACLE = 14,
    UA_OTHER = 15,
};

int aircraft_ua_type(uint8_t mav_type)
{
    switch (mav_type) {
    case MAV_TYPE_FIXED_WING:
        return UA_AEROPLANE;
    case MAV_TYPE_QUADROTOR:
    case MAV_TYPE_COAXIAL:
    case MAV_TYPE_HELICOPTER:
    case MAV_TYPE_HEXAROTOR:
    case MAV_TYPE_OCTOROTOR:
    case MAV_TYPE_TRICOPTER:
    case MAV_TYPE_DODECAROTOR:
    case MAV_TYPE_DECAROTOR:
    case MAV_TYPE_GENERIC_MULTIROTOR:
        return UA_HELICOPTER_OR_MULTIROTOR;
    case MAV_TYPE_VTOL_GYRODYNE:
        return UA_GYROPLANE;
    /* VTOL: by number, because MAVLink renamed five of the seven in 2024. */
    case 19:
    case 20:
    case 21:
    case 22:
    case 23:
    case 24:
    case 25:
        return UA_HYBRID_LIFT;
    case MAV_TYPE_FLAPPING_WING:
        return UA_ORNITHOPTER;
    case MAV_TYPE_KITE:
        return UA_KITE;
    case MAV_TYPE_FREE_BALLOON:
        return UA_FREE_BALLOON;
    case MAV_TYPE_AIRSHIP:
        return UA_AIRSHIP;
    case MAV_TYPE_PARAFOIL:
        return UA_PARACHUTE;
    case MAV_TYPE_ROCKET:
        return UA_ROCKET;
    case MAV_TYPE_GROUND_ROVER:
        return UA_GROUND_OBSTACLE;
    case MAV_TYPE_ANTENNA_TRACKER:
    case MAV_TYPE_GCS:
    case MAV_TYPE_ONBOARD_CONTROLLER:
    case MAV_TYPE_GIMBAL:
    case MAV_TYPE_ADSB:
    case MAV_TYPE_CAMERA:
    case MAV_TYPE_CHARGING_STATION:
    case MAV_TYPE_FLARM:
    case MAV_TYPE_SERVO:
    case MAV_TYPE_ODID:
    case MAV_TYPE_BATTERY:
    case MAV_TYPE_PARACHUTE:
    case MAV_TYPE_LOG:
    case MAV_TYPE_OSD:
    case MAV_TYPE_IMU:
    case MAV_TYPE_GPS:
    case MAV_TYPE_WINCH:
    case MAV_TYPE_ILLUMINATOR:
    case MAV_TYPE_GRIPPER:
    case 49: /* also a component in newer definitions than the headers may have */
        return UA_COMPONENT;
    default:
        return UA_OTHER; /* 0 generic, boats, submarines, ..., and what is yet to come */
    }
}
