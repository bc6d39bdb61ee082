"""Somebody speaks as the autopilot, on its own side, while it flies: attacks that worked, each with its limits. Whoever forges
counts his own frames, or waits until the line is quiet and takes a number that fits."""

from itertools import pairwise

import pytest
from judge.messages import System
from models.flight import BOOTED_MS, START_UNIX_S, write_flight
from models.tlog import Decoder
from pymavlink.dialects.v20 import common

from .autopilot import decoded
from .autopilots import knows_no_ellipsoid, says_native_messages_alone
from .flight import Flight
from .world import START_US

AT_S, KNOWN_S, END_S = 30.0, 38.0, 60.0  # it begins; by then it is known that there are two
GAP_S = 0.6
QUIET_S = 0.11
METRES_E7 = 1 / 0.0111320
SEPARATION_MM = 36_000  # of ellipsoid and geoid, in the flight that is played
AWAY_E7 = 100_000_000  # 10 degrees north and east


class Forger:
    """Knows all that the real one says, and its clock."""

    def __init__(self, flight, quiet):
        self.flight, self.quiet = flight, quiet
        self.heard, self._last, self._heard_us, self._own = {}, 0, 0, 0
        self._line = flight.autopilot.device.send
        self._link = common.MAVLink(None, srcSystem=1, srcComponent=1)
        flight.autopilot.device.send = self._listen

    def _listen(self, frame):
        for message in Decoder().messages(frame):
            self._last, self._heard_us = message.get_seq(), self.flight.world.now_us
            self.heard[message.get_type()] = message
        return self._line(frame)

    def boot_ms(self):
        return self.flight.autopilot.boot_ms()

    def unix_us(self):
        return START_UNIX_S * 1_000_000 + (self.boot_ms() - BOOTED_MS) * 1000

    def say(self, message):
        if self.quiet and self.flight.world.now_us - self._heard_us < QUIET_S * 1e6:
            return
        self._link.seq = self._last if self.quiet else self._own
        self._own = (self._own + 1) % 256
        self._line(message.pack(self._link))

    def keep_saying(self, every_s, make, from_s=AT_S):
        """make(number): the message, or some of them."""
        for number in range(round((END_S - from_s) / every_s)):
            self.flight.at(from_s + number * every_s, self._say_all, make, number)

    def _say_all(self, make, number):
        made = make(number)
        for message in made if isinstance(made, tuple) else (made,):
            self.say(message)


def position(boot_ms, lat, lon, alt=120_000):
    return common.MAVLink_global_position_int_message(boot_ms, lat, lon, alt, 0, 0, 0, 0, 0)


def a_clock_that_walks_ahead(forger):
    forger.keep_saying(0.04, lambda number: common.MAVLink_system_time_message(
        0, forger.boot_ms() + min(250 * number, 3000)))


def positions_without_a_place(forger):
    forger.keep_saying(0.2, lambda _: position(forger.boot_ms() + 250, 0, 0))


def a_utc_that_walks_away(forger):
    forger.keep_saying(0.04, lambda number: common.MAVLink_system_time_message(
        forger.unix_us() + min(900_000 * number, 600_000_000), forger.boot_ms()))


def a_geoid_that_rises(forger):
    def one(number):
        real = forger.heard["GPS_RAW_INT"]
        return common.MAVLink_gps_raw_int_message(
            real.time_usec, 3, real.lat, real.lon, real.alt, 80, 120, 0, 0, 14,
            real.alt + SEPARATION_MM + min(4900 * number, 400_000), 900, 1500, 200)
    forger.keep_saying(0.04, one)


def an_altitude(forger):
    def one(_):
        real = forger.heard["GLOBAL_POSITION_INT"]
        return position(forger.boot_ms(), real.lat, real.lon, real.alt + 3_000_000)
    forger.keep_saying(0.2, one)


def a_status(forger, status, every_s):
    forger.keep_saying(every_s, lambda number: common.MAVLink_open_drone_id_location_message(
        0, 0, bytes(20), status, 100 * number % 36000, 25500, 6300, 0, 0, -1000, -1000, 0, -1000, 0, 0, 0, 0, 65535, 0))


def an_emergency_now_and_then(forger):
    a_status(forger, 3, 3.4)


def a_failure_all_the_time(forger):
    a_status(forger, 4, 0.25)


def an_altitude_within_what_sources_differ(forger):
    def one(_):
        real = forger.heard["GLOBAL_POSITION_INT"]
        return position(forger.boot_ms() + 550, real.lat, real.lon, real.alt + 140_000)
    forger.keep_saying(0.2, one)


def native_ones_beside_it(forger):
    def one(_):
        real = forger.heard["GLOBAL_POSITION_INT"]
        return common.MAVLink_open_drone_id_location_message(
            0, 0, bytes(20), 3, 9000, 2000, 0, real.lat, real.lon, -1000, real.alt / 1000 + 140, 0, 5, 10, 4, 4, 3,
            forger.unix_us() / 1e6 % 3600, 3)
    forger.keep_saying(0.25, one)


def a_utc_before_remote_id(forger):
    forger.keep_saying(0.3, lambda _: common.MAVLink_system_time_message(1_430_000_000_000_000 + 1_200_000_000, forger.boot_ms()))


def a_restart(forger):
    """Each a little earlier than the one before."""
    forger.keep_saying(0.25, lambda _: tuple(
        common.MAVLink_system_time_message(0, forger.boot_ms() - back) for back in (999, 1998, 1997, 1996)))


FORGERIES = (a_clock_that_walks_ahead, positions_without_a_place, a_utc_that_walks_away, a_geoid_that_rises, an_altitude,
             an_emergency_now_and_then, a_failure_all_the_time, an_altitude_within_what_sources_differ,
             native_ones_beside_it, a_utc_before_remote_id, a_restart)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("forged") / "flight.tlog"
    write_flight(path, END_S + 10)
    return path


@pytest.fixture
def fly(tmp_path):
    def fly(log, quiet, forge):
        flight = Flight(tmp_path / "flight", log)
        try:
            forge(Forger(flight, quiet))
            flight.fly(END_S)
            return flight, flight.judged().tracks
        finally:
            flight.end()
    return fly


def flight_s(heard):
    return heard.reception.mono - START_US / 1e6


def real_ones(flight, at_s):
    """Where the autopilot said that it is, in the second and a half before."""
    near = [decoded(frame.octets) for frame in flight.autopilot.frames if at_s - 1.5 <= frame.at_s <= at_s]
    return [message for message in near if message.get_type() == "GLOBAL_POSITION_INT"]


def is_right(flight, at_s, message):
    """Place, altitude and time, or the time of a System."""
    if isinstance(message, System):
        return not message.unix_s or abs(message.unix_s - START_UNIX_S - at_s) < 2
    real = real_ones(flight, at_s)
    return (abs(message.timestamp_s - START_UNIX_S % 3600 - at_s) < 2
            and any(abs(message.latitude_deg * 1e7 - one.lat) < 30 * METRES_E7 for one in real)
            and any(abs(message.geodetic_altitude_m - (one.alt + SEPARATION_MM) / 1000) < 20 for one in real))


@pytest.mark.parametrize("quiet", [False, True], ids=["own_numbers", "fitting_numbers"])
@pytest.mark.parametrize("forge", FORGERIES)
def test_who_was_there_first_stays_on_the_air(fly, log, forge, quiet):
    """Right and as often as ever; and it is told that two speak. Of what is said before that is known, a second at most is
    late, and no place or time is false."""
    flight, tracks = fly(log, quiet, forge)
    for track in tracks:
        new = [flight_s(heard) for heard, _ in track.newer_locations() if flight_s(heard) >= AT_S]
        gaps = [after - before for before, after in pairwise([*new, END_S])]
        assert max(gaps) <= GAP_S, track.channel
        for name in ("location", "system"):
            for heard, message in track.of_type(name):
                assert flight_s(heard) < AT_S or is_right(flight, flight_s(heard), message), (track.channel, message)
        late = [location.status for heard, location in track.of_type("location") if flight_s(heard) > KNOWN_S]
        assert set(late) == {2}, track.channel
    if forge is not an_emergency_now_and_then:
        told = [one for one in flight.autopilot.said if one.mono - START_US / 1e6 > KNOWN_S]
        assert told and {one.reason for one in told} == {"two speak as the autopilot"}


def without_a_fix_at_first(craft, message):
    if craft.time_s < 45:
        if message.get_type() in ("GLOBAL_POSITION_INT", "GPS_RAW_INT"):
            message.lat = message.lon = 0
        if message.get_type() == "GPS_RAW_INT":
            message.fix_type = 1
        if message.get_type() == "SYSTEM_TIME":
            message.time_unix_usec = 0
    return [message]


@pytest.mark.parametrize("quiet", [False, True], ids=["own_numbers", "fitting_numbers"])
def test_nobody_else_says_where_it_is_while_it_has_no_fix(fly, tmp_path, quiet):
    """Whoever had a place first was believed from then on, against the real one that had none yet. Which of two places is
    the real one nobody knows, so there is none, and it is told why."""
    def forge(forger):
        forger.keep_saying(0.2, lambda _: (
            common.MAVLink_gps_raw_int_message(0, 3, AWAY_E7, AWAY_E7, 90_000, 80, 120, 0, 0, 14, 126_000, 900, 1500, 200),
            position(forger.boot_ms(), AWAY_E7, AWAY_E7)), from_s=6)
    write_flight(tmp_path / "flight.tlog", END_S + 10, changed=without_a_fix_at_first)
    flight, tracks = fly(tmp_path / "flight.tlog", quiet, forge)
    for track in tracks:
        assert all(location.latitude_deg is None for _, location in track.of_type("location")), track.channel
    assert flight.autopilot.said[-1].reason == "two speak as the autopilot"


@pytest.mark.parametrize("quiet", [False, True], ids=["own_numbers", "fitting_numbers"])
def test_a_receiver_that_speaks_once_takes_no_position_away(fly, tmp_path, quiet):
    """It had none that falls silent then, and was nowhere until power-off."""
    def forge(forger):
        forger.flight.at(AT_S, lambda: forger.say(common.MAVLink_gps2_raw_message(0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)))
    write_flight(tmp_path / "flight.tlog", END_S + 10, native_hz=1, changed=says_native_messages_alone)
    for track in fly(tmp_path / "flight.tlog", quiet, forge)[1]:
        late = {location.status for heard, location in track.of_type("location") if flight_s(heard) > KNOWN_S}
        assert late == {2}, track.channel


@pytest.mark.parametrize("quiet", [False, True], ids=["own_numbers", "fitting_numbers"])
@pytest.mark.parametrize("second", [False, True], ids=["GPS_RAW_INT", "GPS2_RAW"])
@pytest.mark.parametrize("native_hz", [0, 1])
def test_a_geoid_that_is_said_once_does_not_stay(fly, tmp_path, native_hz, second, quiet):
    """Where the receiver says none, the altitude was false until power-off, and all was well."""
    def one(forger):
        real = forger.heard["GLOBAL_POSITION_INT"]
        raised = real.alt + SEPARATION_MM + 80_000
        forger.say(common.MAVLink_gps2_raw_message(0, 3, real.lat, real.lon, real.alt, 80, 120, 0, 0, 11, 0, 0, 0, raised, 1200, 2000, 300)
                   if second else
                   common.MAVLink_gps_raw_int_message(0, 3, real.lat, real.lon, real.alt, 80, 120, 0, 0, 11, raised, 1200, 2000, 300))
    write_flight(tmp_path / "flight.tlog", END_S + 10, native_hz=native_hz, changed=knows_no_ellipsoid)
    flight, tracks = fly(tmp_path / "flight.tlog", quiet, lambda forger: forger.flight.at(AT_S, one, forger))
    for track in tracks:
        late = [(flight_s(heard), location.geodetic_altitude_m) for heard, location in track.of_type("location")
                if flight_s(heard) > KNOWN_S]
        for at_s, altitude_m in late:
            assert altitude_m is None if not native_hz else any(
                abs(altitude_m - (one.alt + SEPARATION_MM) / 1000) < 20 for one in real_ones(flight, at_s)), (track.channel, at_s)
