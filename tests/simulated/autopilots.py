"""Kinds of autopilots, and who speaks beside them: each does what real ones were seen to do. A kind's options are
models/flight.py's; `changed` gives the messages that are sent instead of one."""

from models.flight import START_UNIX_S, UNDULATION_M
from pymavlink.dialects.v20 import common

EPOCH_2019_S = 1546300800
# One of the ground station's own: MAVProxy counts from 1546261200.
AHEAD_S = 39600


def kind(message):
    return message.get_type()


def climbs_downward(craft, message):
    """ArduPilot before September 2018."""
    if kind(message) == "GLOBAL_POSITION_INT":
        message.vz = -message.vz
    return [message]


def is_mended_px4(craft, message):
    """Its altitudes are what they are called."""
    if kind(message) == "HEARTBEAT":
        message.autopilot = common.MAV_AUTOPILOT_PX4
    return [message]


def is_px4(craft, message):
    """Its geodetic altitude is above mean sea level, its barometric one 0."""
    if kind(message) == "OPEN_DRONE_ID_LOCATION":
        message.altitude_geodetic -= UNDULATION_M
        message.altitude_barometric = 0
    return is_mended_px4(craft, message)


def second_receiver(message):
    """What another one says beside GPS_RAW_INT, which is always the first one's."""
    return common.MAVLink_gps2_raw_message(
        message.time_usec, message.fix_type, message.lat, message.lon, message.alt, 80, 120, message.vel, message.cog, 11, 0, 0, 0,
        message.alt_ellipsoid, 1200, 2000, 300)


def knows_no_ellipsoid(craft, message):
    """As each by MAVLink 1."""
    if kind(message) == "GPS_RAW_INT":
        message.alt_ellipsoid = 0
    return [message]


def tells_of_no_receiver(craft, message):
    """That there is a fix is known by its native LOCATION alone."""
    return [] if kind(message) == "GPS_RAW_INT" else [message]


def says_native_messages_alone(craft, message):
    return [] if kind(message) == "GLOBAL_POSITION_INT" else tells_of_no_receiver(craft, message)


def has_two_receivers(craft, message):
    return [message, second_receiver(message)] if kind(message) == "GPS_RAW_INT" else [message]


def operator_from_a_ground_station(every_s):
    """Where its operator stands, and what time it believes it is."""
    def changed(craft, message):
        if kind(message) != "HEARTBEAT":
            return [message]
        here = common.MAVLink_heartbeat_message(
            common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, common.MAV_STATE_ACTIVE, 3)
        here.ground_station = True
        if craft.time_s % every_s >= 1:
            return [message, here]
        system = common.MAVLink_open_drone_id_system_message(
            1, 0, [0] * 20, common.MAV_ODID_OPERATOR_LOCATION_TYPE_LIVE_GNSS, 0, 578000000, 118000000, 1, 0, -1000, -1000, 0, 0, 20,
            START_UNIX_S + int(craft.time_s) - EPOCH_2019_S + AHEAD_S)
        system.ground_station = True
        return [message, here, system]
    return changed


WITHOUT_RECEIVER = "ArduPilot with Open Drone ID, without GPS_RAW_INT"
KINDS = {
    "ArduPilot": {},
    "ArduPilot with Open Drone ID": {"native_hz": 1 / 1.05},
    "ArduPilot with Open Drone ID, 10 Hz": {"rate_hz": 10, "native_hz": 1 / 0.9},
    "ArduPilot with Open Drone ID, late": {"native_hz": 1 / 1.5},
    "ArduPilot before September 2018": {"changed": climbs_downward},
    "ArduPilot with two receivers": {"changed": has_two_receivers},
    "ArduPilot and a ground station": {"changed": operator_from_a_ground_station(1)},
    "ArduPilot without an ellipsoid": {"changed": knows_no_ellipsoid},
    WITHOUT_RECEIVER: {"native_hz": 1 / 1.05, "changed": tells_of_no_receiver},
    "PX4": {"rate_hz": 10, "native_hz": 1, "changed": is_px4},
    "PX4, mended": {"rate_hz": 10, "native_hz": 1, "changed": is_mended_px4},
}
