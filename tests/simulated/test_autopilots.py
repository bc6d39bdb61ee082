"""What real autopilots and ground stations were seen to do, as heard on the air: each case a short flight that does
the same."""

from collections import namedtuple

import pytest
from judge.messages import Location, SelfId, System
from models.flight import START_UNIX_S, write_flight
from pymavlink.dialects.v20 import common

from .autopilots import climbs_downward, kind, operator_from_a_ground_station, second_receiver
from .flight import Flight
from .world import START_US

FLIGHT_S = 24
UNKNOWN, GROUND, AIRBORNE, EMERGENCY, FAILURE = range(5)  # Location.Status
TAKEOFF, LIVE = 0, 1  # System's operator location type
DISARMED = 0x51
LATE_S = 0.3  # the slots, and the advertising interval

Case = namedtuple("Case", "changed holds")
Heard = namedtuple("Heard", "flight_s message")


def of(heard, wanted, from_s=0.0, to_s=FLIGHT_S):
    found = [one for one in heard if isinstance(one.message, wanted) and from_s <= one.flight_s < to_s]
    assert found, f"no {wanted.__name__} was heard from {from_s} to {to_s} s"
    return found


def places(heard, from_s=0.0, to_s=FLIGHT_S):
    return [one.message for one in of(heard, Location, from_s, to_s)]


def is_home(location):
    return location.latitude_deg is not None and abs(location.latitude_deg - 57.7) < 0.1


# --- positions --------------------------------------------------------------


def restarts(craft, message):
    """An ArduPlane starts again in flight: for some seconds its estimator is at 1e-7, 0, and there is no GPS_RAW_INT."""
    if craft.time_s < 10:
        return [message]
    if hasattr(message, "time_boot_ms"):
        message.time_boot_ms = round((craft.time_s - 10) * 1000)
    if craft.time_s < 16:
        if kind(message) == "GPS_RAW_INT":
            return []
        if kind(message) == "GLOBAL_POSITION_INT":
            message.lat, message.lon = 1, 0
        elif kind(message) == "SYSTEM_TIME":
            message.time_unix_usec = 0
    return [message]


def is_never_near_zero(heard):
    assert all(one.latitude_deg is None or is_home(one) for one in places(heard))
    assert all(is_home(one) for one in places(heard, 19))


def has_no_gnss(craft, message):
    """A PX4 or an ArduPlane without a receiver: a place near 0, 0, and the year 2042."""
    if kind(message) in ("GPS_RAW_INT", "HOME_POSITION"):
        return []
    if kind(message) == "GLOBAL_POSITION_INT":
        message.lat, message.lon = 1000, 3000
    elif kind(message) == "SYSTEM_TIME":
        message.time_unix_usec = 2_289_600_000_000_000
    return [message]


def says_neither_place_nor_time(heard):
    for one in places(heard):
        assert one.latitude_deg is None and one.timestamp_s is None
    assert all(one.message.unix_s is None for one in of(heard, System))
    assert places(heard)[-1].status == FAILURE


def loses_its_fix_without_saying_so(craft, message):
    """GPS_RAW_INT isn't in the streams any more; the estimator coasts."""
    return [] if kind(message) == "GPS_RAW_INT" and craft.time_s >= 10 else [message]


def fails_within_seconds(heard):
    """3 s for the fix, 3 s for the position."""
    assert all(one.status == AIRBORNE for one in places(heard, 10, 12))
    assert all(one.status == FAILURE for one in places(heard, 10 + 3 + 3 + 2 * LATE_S))


def is_stamped_a_minute_ahead_once(craft, message):
    if kind(message) == "GLOBAL_POSITION_INT" and 12 <= craft.time_s < 12.15:
        message.time_boot_ms += 60_000
    return [message]


def is_never_of_the_future(heard):
    for one in of(heard, Location, 5):
        if one.message.timestamp_s is None:
            assert 12 <= one.flight_s < 16     # at most until it is confirmed
        else:
            assert -4 < one.message.timestamp_s - START_UNIX_S % 3600 - one.flight_s < LATE_S


def has_one_of_two_receivers_dead(craft, message):
    """GPS_RAW_INT is always the first one's."""
    if kind(message) != "GPS_RAW_INT" or craft.time_s < 10:
        return [message]
    second = second_receiver(message)
    message.fix_type = 1
    return [message, second]


def has_a_receiver_that_hangs():
    """Its driver goes on with the last fix, and the time of that; the estimator coasts."""
    last = {}

    def changed(craft, message):
        if kind(message) == "GPS_RAW_INT":
            if craft.time_s < 10:
                last.update(time_usec=message.time_usec, lat=message.lat, lon=message.lon, alt=message.alt)
            for name, value in last.items():
                setattr(message, name, value)
        return [message]
    return changed


def stands_still_under_a_receiver_that_flies():
    """An estimator that has stopped, under time stamps that move on."""
    place = []

    def changed(craft, message):
        if kind(message) == "GLOBAL_POSITION_INT" and craft.time_s >= 8:
            place[:] = place or [message.lat, message.lon]
            message.lat, message.lon = place
            message.vx = message.vy = 0
        return [message]
    return changed


def is_said_to_have_failed(heard):
    assert all(one.status == FAILURE for one in places(heard, 16))


def climbs_beside_its_altitude():
    """The estimator's altitude has stopped; the receiver's says 15 m/s."""
    altitude = []

    def changed(craft, message):
        if craft.time_s >= 6 and kind(message) == "GLOBAL_POSITION_INT":
            altitude[:] = altitude or [message.alt, message.relative_alt]
            message.alt, message.relative_alt = altitude
        elif craft.time_s >= 6 and kind(message) == "GPS_RAW_INT":
            message.alt += round((craft.time_s - 6) * 15_000)
            message.alt_ellipsoid += round((craft.time_s - 6) * 15_000)
        return [message]
    return changed


def has_a_place_and_no_altitude(heard):
    assert all(one.geodetic_altitude_m is not None for one in places(heard, 7, 10))
    for one in places(heard, 18):
        assert is_home(one) and one.status == AIRBORNE
        assert one.geodetic_altitude_m is None and one.height_m is None


# --- status -----------------------------------------------------------------


def is_disarmed_in_the_air(craft, message):
    """A copter under its parachute: disarmed, and "on ground" by its landed state, as ArduCopter says then."""
    if craft.time_s < 14:
        return [message]
    if kind(message) == "HEARTBEAT":
        message.base_mode = DISARMED
    elif kind(message) == "EXTENDED_SYS_STATE":
        message.landed_state = 1
    elif kind(message) == "GLOBAL_POSITION_INT":
        sunk_mm = round((craft.time_s - 14) * 4000)
        message.relative_alt = 86_000 - sunk_mm
        message.alt = 35_000 + message.relative_alt
        message.vx, message.vy, message.vz = 0, 0, 400
    return [message]


def is_in_distress(heard):
    assert all(one.status == EMERGENCY for one in places(heard, 17))


def is_in_a_failsafe(craft, message):
    if kind(message) == "HEARTBEAT" and craft.time_s >= 10:
        message.system_status = common.MAV_STATE_CRITICAL
    return [message]


def is_airborne(heard):
    assert all(one.status == AIRBORNE for one in places(heard, 10))


# --- clocks and directions --------------------------------------------------


def has_a_slow_clock(craft, message):
    """For ten seconds the autopilot's clock runs at half its speed: five seconds, as after 25 s a fifth too slow."""
    if hasattr(message, "time_boot_ms"):
        message.time_boot_ms -= round(min(craft.time_s, 10) * 500)
    return [message]


def is_right_again_in_ten_seconds(heard):
    for one in of(heard, Location, 20):
        assert one.message.status == AIRBORNE
        assert abs(one.message.timestamp_s - START_UNIX_S % 3600 - one.flight_s) < 0.5 + LATE_S


def climbs_upward_on_the_air(heard):
    """By the altitudes that are heard beside it."""
    known, pairs = [one for one in of(heard, Location, 15)], 0
    for before, now in zip(known, known[4:]):
        rose_m_s = (now.message.geodetic_altitude_m - before.message.geodetic_altitude_m) / (now.flight_s - before.flight_s)
        if min(abs(rose_m_s), abs(before.message.vertical_speed_m_s), abs(now.message.vertical_speed_m_s)) > 8:
            assert (rose_m_s > 0) == (now.message.vertical_speed_m_s > 0)
            pairs += 1
    assert pairs > 5


# --- take-off and operator --------------------------------------------------


def is_given_another_id(craft, message):
    """SYSID_THISMAV, in a file or by its own radio: ArduPilot takes it at once. And its own again."""
    message.system_id = 7 if 10 <= craft.time_s < 20 else 1
    return [message]


def is_missed_until_it_has_its_own(heard):
    assert all(one.status == FAILURE for one in places(heard, 10 + 3 + LATE_S, 20))
    assert all(one.status == AIRBORNE for one in places(heard, 20 + 1 + LATE_S))


def arms_before_its_fix(craft, message):
    if kind(message) == "HOME_POSITION":
        return []
    if kind(message) == "GPS_RAW_INT" and craft.time_s < 6:
        message.fix_type = 1
    return [message]


def has_height_and_operator(heard):
    assert all(one.height_m is not None for one in places(heard, 10))
    assert all(one.message.operator_latitude_deg is not None for one in of(heard, System, 10))


def is_live_and_on_time(heard):
    for one in of(heard, System, 6):
        assert one.message.operator_location_type == LIVE
        assert abs(one.message.operator_latitude_deg - 57.8) < 1e-3
        assert abs(one.message.unix_s - START_UNIX_S - one.flight_s) < 3


def declares_an_emergency(craft, message):
    """By a ground station, each second, and takes it back as QGroundControl does."""
    if kind(message) != "HEARTBEAT" or craft.time_s < 10:
        return [message]
    here = common.MAVLink_heartbeat_message(
        common.MAV_TYPE_GCS, common.MAV_AUTOPILOT_INVALID, 0, 0, common.MAV_STATE_ACTIVE, 3)
    text = common.MAVLink_open_drone_id_self_id_message(
        1, 0, [0] * 20, *((1, b"engine failure") if craft.time_s < 16 else (0, b"")))
    here.ground_station = text.ground_station = True
    return [message, here, text]


def is_an_emergency_for_so_long(heard):
    assert all(one.status != EMERGENCY for one in places(heard, 0, 10))
    assert all(one.status == EMERGENCY for one in places(heard, 11.1 + LATE_S, 16))
    assert all(one.message.text == "engine failure" for one in of(heard, SelfId, 14, 16))
    assert all(one.status == AIRBORNE for one in places(heard, 16 + 3.1 + LATE_S))
    assert all(one.message.text != "engine failure" for one in of(heard, SelfId, 20))


CASES = {
    "restarts": Case(restarts, is_never_near_zero),
    "no GNSS": Case(has_no_gnss, says_neither_place_nor_time),
    "fix lost": Case(loses_its_fix_without_saying_so, fails_within_seconds),
    "stamped ahead": Case(is_stamped_a_minute_ahead_once, is_never_of_the_future),
    "has one of two receivers dead": Case(has_one_of_two_receivers_dead, is_airborne),
    "has a receiver that hangs": Case(has_a_receiver_that_hangs(), fails_within_seconds),
    "stands still under its receiver": Case(stands_still_under_a_receiver_that_flies(), is_said_to_have_failed),
    "climbs beside its altitude": Case(climbs_beside_its_altitude(), has_a_place_and_no_altitude),
    "declares an emergency": Case(declares_an_emergency, is_an_emergency_for_so_long),
    "parachute": Case(is_disarmed_in_the_air, is_in_distress),
    "failsafe": Case(is_in_a_failsafe, is_airborne),
    "slow clock": Case(has_a_slow_clock, is_right_again_in_ten_seconds),
    "climbs downward": Case(climbs_downward, climbs_upward_on_the_air),
    "is given another id": Case(is_given_another_id, is_missed_until_it_has_its_own),
    "arms before its fix": Case(arms_before_its_fix, has_height_and_operator),
    "operator every second": Case(operator_from_a_ground_station(1), is_live_and_on_time),
    "operator every 4 s": Case(operator_from_a_ground_station(4), is_live_and_on_time),
}


@pytest.mark.parametrize("name", CASES)
def test_what_is_said_of_one_that(name, tmp_path):
    write_flight(tmp_path / "flight.tlog", FLIGHT_S + 1, changed=CASES[name].changed)
    flight = Flight(tmp_path / "flight", tmp_path / "flight.tlog", mode="bcm43455")
    try:
        flight.fly(FLIGHT_S)
        track = next(one for one in flight.judged().tracks if one.channel == "bt4")
        heard = [Heard(one.reception.mono - START_US / 1e6, message) for one in track.heard for message in one.messages]
    finally:
        flight.end()
    CASES[name].holds(heard)
