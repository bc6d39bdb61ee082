"""Does what an aircraft says fit together?  Needs no log of what was played.

Position against speed, track against course, altitude against vertical speed,
timestamps against each other.  One odd sample proves nothing (GNSS wanders), so
the comparisons over time need a share of all samples to disagree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from .findings import Findings
from .messages import STATUS_SYSTEM_FAILURE, Location
from .tracks import Heard, Track, hour_difference_s, went_backward

EARTH_RADIUS_M = 6371000.0
JUMP_ALLOWED_M = 30.0  # beyond twice the distance that the speed explains
FROZEN_SPEED_M_S = 3.0
FROZEN_S = 1.0
WINDOW_S = 2.0
MIN_WINDOW_DISTANCE_M = 6.0
MIN_WINDOW_CLIMB_M = 2.0
DISAGREEING_SHARE = 0.2
MIN_DISAGREEING = 5
AGE_LIMIT_S = 1.0  # (2nd) data at most 1 s old when sent
SYSTEM_HEARD_BEFORE_S = 1.5
SYSTEM_FROZEN_S = 6.0  # System comes every 3 s at least
NOWHERE_M = 1000.0  # from 0,0: an estimator without a fix, or a field that was never filled
FLOAT_STEP_S = 16  # a System timestamp that passed through a 32-bit float


def check_plausibility(track: Track, findings: Findings, has_log: bool) -> None:
    """`has_log`: ages and order are compared with what was played, not here."""
    newer = track.newer_locations()
    _check_places(track, findings)
    _check_altitude(track, findings)
    _check_jumps(newer, findings)
    _check_frozen_position(newer, findings)
    _check_motion(newer, findings)
    _check_system_time(track, findings)
    if not has_log:
        _check_timestamp_order(track, findings)
        _check_age_against_system(track, findings)


def offset_m(start: Location, end: Location) -> tuple[float, float]:
    """North and east from one position to another, over short distances."""
    north = math.radians(end.latitude_deg - start.latitude_deg) * EARTH_RADIUS_M
    east_deg = (end.longitude_deg - start.longitude_deg + 180.0) % 360.0 - 180.0
    return north, math.radians(east_deg) * EARTH_RADIUS_M * math.cos(math.radians(start.latitude_deg))


def _check_places(track: Track, findings: Findings) -> None:
    """0,0 is "unknown"; what is near it is wrong, and not said to be."""
    for name, whose, latitude, longitude in (
            ("location", "the aircraft", "latitude_deg", "longitude_deg"),
            ("system", "the operator", "operator_latitude_deg", "operator_longitude_deg")):
        last_raw = None
        for heard, message in track.of_type(name):
            place = (getattr(message, latitude), getattr(message, longitude))
            if message.raw != last_raw and None not in place and math.radians(math.hypot(*place)) * EARTH_RADIUS_M < NOWHERE_M:
                findings.violation(f"{name}.nowhere", heard.reception, f"{whose} is less than 1 km from 0,0",
                                   "a place, or unknown", f"{place[0]:.7f}, {place[1]:.7f}")
            last_raw = message.raw


def _check_altitude(track: Track, findings: Findings) -> None:
    locations = [location for _, location in track.of_type("location") if location.latitude_deg is not None]
    if locations and all(location.geodetic_altitude_m is None for location in locations):
        findings.note("the geodetic altitude is unknown in every Location: some regions require it")


def _elapsed_s(before: tuple[Heard, Location], now: tuple[Heard, Location]) -> float:
    """By the fixes' own time where both have one, else by the time of reception."""
    if before[1].timestamp_s is not None and now[1].timestamp_s is not None:
        return hour_difference_s(now[1].timestamp_s, before[1].timestamp_s)
    return now[0].reception.mono - before[0].reception.mono


def _check_jumps(newer, findings: Findings) -> None:
    for before, now in zip(newer, newer[1:]):
        if before[1].latitude_deg is None or now[1].latitude_deg is None:
            continue
        distance_m = math.hypot(*offset_m(before[1], now[1]))
        speeds = [s for s in (before[1].speed_m_s, now[1].speed_m_s) if s is not None]
        fastest_m_s = max(speeds) if len(speeds) == 2 else 255.0
        allowed_m = JUMP_ALLOWED_M + 2 * fastest_m_s * (_elapsed_s(before, now) + 0.2)
        if distance_m > allowed_m:
            findings.violation("plausibility.jump", now[0].reception, "the position jumps",
                               f"at most {allowed_m:.0f} m at {fastest_m_s:g} m/s", f"{distance_m:.0f} m")


def _check_frozen_position(newer, findings: Findings) -> None:
    """The timestamp moves on, the aircraft says that it moves, its position doesn't."""
    since = None
    for before, now in zip(newer, newer[1:]):
        same = (before[1].latitude_deg is not None and now[1].status != STATUS_SYSTEM_FAILURE
                and (before[1].latitude_deg, before[1].longitude_deg) == (now[1].latitude_deg, now[1].longitude_deg)
                and min(before[1].speed_m_s or 0, now[1].speed_m_s or 0) > FROZEN_SPEED_M_S)
        if not same:
            since = None
            continue
        since = since or before
        if now[1].timestamp_s is not None and _elapsed_s(since, now) > FROZEN_S:
            findings.violation("plausibility.frozen", now[0].reception,
                               "the timestamp moves and the position doesn't", "a position that moves",
                               f"the same for {_elapsed_s(since, now):.1f} s at {now[1].speed_m_s:g} m/s")


@dataclass
class _Comparison:
    """Samples of one comparison, and the first that disagrees."""
    samples: int = 0
    disagreeing: int = 0
    example: tuple | None = None

    def add(self, agrees: bool, reception, expected: str, found: str) -> None:
        self.samples += 1
        if not agrees:
            self.disagreeing += 1
            self.example = self.example or (reception, expected, found)

    def report(self, findings: Findings, kind: str, what: str) -> None:
        if self.disagreeing >= MIN_DISAGREEING and self.disagreeing > DISAGREEING_SHARE * self.samples:
            reception, expected, found = self.example
            findings.violation(kind, reception, f"{what} in {self.disagreeing} of {self.samples} comparisons, first",
                               expected, found)


def _check_motion(newer, findings: Findings) -> None:
    """Over windows of 2 s and more: displacement against the integral of speed and course,
    climb against the integral of the vertical speed."""
    course, speed, climb, height = _Comparison(), _Comparison(), _Comparison(), _Comparison()
    said, end = _Said(newer), 0
    for start in range(len(newer) - 1):
        end = max(end, start + 1)
        while end < len(newer) - 1 and _elapsed_s(newer[start], newer[end]) < WINDOW_S:
            end += 1
        if WINDOW_S <= _elapsed_s(newer[start], newer[end]) < 2 * WINDOW_S:
            _compare_course(newer, start, end, said, course, speed)
            _compare_climb(newer, start, end, said, climb)
            _compare_height(newer, start, end, height)
    course.report(findings, "plausibility.course", "track over ground and direction disagree")
    speed.report(findings, "plausibility.speed", "distance flown and speed disagree")
    climb.report(findings, "plausibility.climb", "altitude trend and vertical speed have opposite signs")
    height.report(findings, "plausibility.height", "the height above take-off doesn't go with the altitude")


class _Said:
    """What speed, direction and vertical speed say was flown from the first Location to each one (the trapezoidal rule),
    and how many Locations before it don't say it, or not where they are: two of these give any window."""

    def __init__(self, newer):
        self.north_m, self.east_m, self.up_m = [0.0], [0.0], [0.0]
        self.no_motion, self.no_climb, self.no_geodetic, self.no_height = [0], [0], [0], [0]
        before = None
        for heard_and_location in newer:
            location = heard_and_location[1]
            self._count(location)
            if before is not None:
                self._step(before[1], location, _elapsed_s(before, heard_and_location))
            before = heard_and_location

    def _count(self, location: Location) -> None:
        for counts, unknown in (
                (self.no_motion, None in (location.latitude_deg, location.speed_m_s, location.direction_deg)),
                (self.no_climb, location.vertical_speed_m_s is None),
                (self.no_geodetic, location.geodetic_altitude_m is None),
                (self.no_height, location.height_m is None)):
            counts.append(counts[-1] + unknown)

    def _step(self, before: Location, now: Location, elapsed_s: float) -> None:
        north = east = 0.0
        for location in (before, now):
            if location.speed_m_s is not None and location.direction_deg is not None:
                direction = math.radians(location.direction_deg)
                north += location.speed_m_s * math.cos(direction) * elapsed_s / 2
                east += location.speed_m_s * math.sin(direction) * elapsed_s / 2
        climbs = before.vertical_speed_m_s, now.vertical_speed_m_s
        up = sum(climbs) / 2 * elapsed_s if None not in climbs else 0.0
        self.north_m.append(self.north_m[-1] + north)
        self.east_m.append(self.east_m[-1] + east)
        self.up_m.append(self.up_m[-1] + up)


def _all_known(unknown: list[int], start: int, end: int) -> bool:
    return unknown[end + 1] == unknown[start]


def _compare_course(newer, start: int, end: int, all_said: _Said, course: _Comparison, speed: _Comparison) -> None:
    if not _all_known(all_said.no_motion, start, end):
        return
    north_m = all_said.north_m[end] - all_said.north_m[start]
    east_m = all_said.east_m[end] - all_said.east_m[start]
    flown_north_m, flown_east_m = offset_m(newer[start][1], newer[end][1])
    said_m, flown_m = math.hypot(north_m, east_m), math.hypot(flown_north_m, flown_east_m)
    if max(said_m, flown_m) < MIN_WINDOW_DISTANCE_M:
        return
    reception = newer[end][0].reception
    speed.add(0.5 * said_m - 3 <= flown_m <= 2 * said_m + 3, reception, f"about {said_m:.0f} m by speed",
              f"{flown_m:.0f} m by position")
    if min(said_m, flown_m) >= MIN_WINDOW_DISTANCE_M:
        said, flown = math.atan2(east_m, north_m), math.atan2(flown_east_m, flown_north_m)
        course.add(math.cos(said - flown) > 0.5, reception, f"{math.degrees(flown) % 360:.0f} deg by position",
                   f"{math.degrees(said) % 360:.0f} deg by direction")


def _compare_climb(newer, start: int, end: int, all_said: _Said, climb: _Comparison) -> None:
    if not _all_known(all_said.no_climb, start, end):
        return
    first, last = newer[start][1], newer[end][1]
    if _all_known(all_said.no_geodetic, start, end):
        climbed_m = last.geodetic_altitude_m - first.geodetic_altitude_m
    elif _all_known(all_said.no_height, start, end):
        climbed_m = last.height_m - first.height_m
    else:
        return
    said_m = all_said.up_m[end] - all_said.up_m[start]
    if min(abs(said_m), abs(climbed_m)) >= MIN_WINDOW_CLIMB_M:
        climb.add(said_m * climbed_m > 0, newer[end][0].reception, f"{climbed_m:+.1f} m by altitude",
                  f"{said_m:+.1f} m by vertical speed")


def _compare_height(newer, start: int, end: int, height: _Comparison) -> None:
    """A take-off point stands still: its height goes up and down with the altitude."""
    first, last = newer[start][1], newer[end][1]
    if first.height_above_ground or last.height_above_ground or None in (
            first.height_m, last.height_m, first.geodetic_altitude_m, last.geodetic_altitude_m):
        return
    climbed_m, said_m = last.geodetic_altitude_m - first.geodetic_altitude_m, last.height_m - first.height_m
    if abs(climbed_m) >= MIN_WINDOW_CLIMB_M:
        height.add(abs(said_m - climbed_m) <= max(1.5, 0.5 * abs(climbed_m)), newer[end][0].reception,
                   f"{climbed_m:+.1f} m by altitude", f"{said_m:+.1f} m by height")


def _check_timestamp_order(track: Track, findings: Findings) -> None:
    newest, last_raw = None, None
    for heard, location in track.of_type("location"):
        if newest is not None and location.raw != last_raw and went_backward(newest, location):
            findings.violation("location.backward", heard.reception, "the Location timestamp goes backward",
                               f"{newest.timestamp_s} s or later", f"{location.timestamp_s} s")
        else:
            newest = location
        last_raw = location.raw


def _check_system_time(track: Track, findings: Findings) -> None:
    stamps: list[tuple[Heard, int]] = []
    for heard, system in track.of_type("system"):
        if system.unix_s is not None and (not stamps or system.unix_s != stamps[-1][1]):
            if stamps and system.unix_s < stamps[-1][1]:
                findings.violation("system.backward", heard.reception, "the System timestamp goes backward",
                                   f"{stamps[-1][1]} s or later", f"{system.unix_s} s")
            stamps.append((heard, system.unix_s))
    systems = list(track.of_type("system"))
    if len(stamps) == 1 and systems[-1][0].reception.mono - stamps[0][0].reception.mono > SYSTEM_FROZEN_S:
        findings.violation("system.frozen", systems[-1][0].reception, "the System timestamp stands still",
                           "the time now, or 0 for unknown", stamps[0][1])
    if len(stamps) >= 3 and all((unix_s - 1546300800) % FLOAT_STEP_S == 0 for _, unix_s in stamps):
        findings.violation("system.float", stamps[-1][0].reception, "the System timestamp moves in steps of 16 s "
                           "(it passed through a 32-bit float)", "steps of 1 s", stamps[-1][1])


def _check_age_against_system(track: Track, findings: Findings) -> None:
    """The transmitter's own clock: System says what time it is, Location how old its position is."""
    system_heard, system_s, last_raw = None, None, None
    for heard in track.heard:
        for message in heard.messages:
            if message.type_name == "system" and message.unix_s is not None:
                system_heard, system_s = heard.reception.mono, message.unix_s
        for message in heard.messages:
            if message.type_name != "location" or message.timestamp_s is None or message.raw == last_raw:
                continue
            last_raw = message.raw
            if system_s is None or heard.reception.mono - system_heard > SYSTEM_HEARD_BEFORE_S:
                continue
            age_s = hour_difference_s(system_s % 3600, message.timestamp_s)
            if age_s > AGE_LIMIT_S and message.status != STATUS_SYSTEM_FAILURE:
                findings.violation("location.age", heard.reception,
                                   "the position is older than the System message before it says the time is",
                                   f"at most {AGE_LIMIT_S:g} s", f"{age_s:.1f} s")
