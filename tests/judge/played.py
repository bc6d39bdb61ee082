"""Compares every Location heard with the log of what was played to the transmitter."""

from __future__ import annotations

import bisect
import operator
import struct
from dataclasses import dataclass, field

from .findings import Findings
from .flight_log import COURSE_UNKNOWN_M_S, Fix, FlightLog
from .intervals import LOCATION_LIMIT_S, STATUS_FAILURE_DUE_S, Interval
from .messages import STATUS_EMERGENCY, STATUS_SYSTEM_FAILURE, Location
from .receptions import Reception
from .tracks import Track, hour_difference_s

POSITION_TOLERANCE_E7 = 2  # 2e-7 degrees
TIME_TOLERANCE_S = 0.11  # one unit of the field, however it was rounded
CLOCK_TOLERANCE_S = 0.02  # between the player's stamp and its octets on the wire
STATUS_FRESH_S = 2.5
BUILT_BEFORE_S = 0.5  # what is heard was built up to a slot and an advertising interval ago
YEAR_2019_S = 1546300800
SYSTEM_S = 4.5  # a System message is repeated for up to 3 s, its time is whole seconds
LATE_S = 1.0  # a newer position is due on the air after this
NATIVE_ALTITUDE_M = 1.5  # the field's step, and what is climbed in 0.2 s
MOTION = ("speed", "vertical_speed", "direction")
STEP_MARGIN = 1.01  # a field may be rounded or cut to its resolution


@dataclass
class Comparison:
    ages_s: dict[str, list[float]] = field(default_factory=dict)  # by channel
    lateness_s: list[float] = field(default_factory=list)  # age beyond the autopilot's own interval
    shown: dict[int, Fix | None] = field(default_factory=dict)  # by id of the Reception


class _Index:
    """Finds the fix that a Location shows."""

    def __init__(self, log: FlightLog):
        self.log = log
        self.places: dict[tuple[int, int], list[Fix]] = {}
        self.without_gnss: set[tuple[int, int]] = set()
        for fix in log.fixes:
            place = (fix.latitude_e7, fix.longitude_e7)
            if fix.has_gnss is False:
                self.without_gnss.add(place)
            else:
                self.places.setdefault(place, []).append(fix)
        self.reach = range(-POSITION_TOLERANCE_E7, POSITION_TOLERANCE_E7 + 1)
        # By what a Location says; each is said many times over. The fixes in the order in which they were played.
        self.near: dict[tuple[int, int], list[Fix]] = {}
        self.near_and_then: dict[tuple[int, int, float], list[Fix]] = {}

    def _near(self, latitude_e7: int, longitude_e7: int) -> list[Fix]:
        found = self.near.get((latitude_e7, longitude_e7))
        if found is None:
            found = [fix for north in self.reach for east in self.reach
                     for fix in self.places.get((latitude_e7 + north, longitude_e7 + east), ())]
            found.sort(key=lambda fix: fix.mono)
            self.near[latitude_e7, longitude_e7] = found
        return found

    def _near_and_then(self, latitude_e7: int, longitude_e7: int, hour_s: float) -> list[Fix]:
        found = self.near_and_then.get((latitude_e7, longitude_e7, hour_s))
        if found is None:
            found = self.near_and_then[latitude_e7, longitude_e7, hour_s] = [
                fix for fix in self._near(latitude_e7, longitude_e7)
                if fix.hour_s is not None and abs(hour_difference_s(hour_s, fix.hour_s)) <= TIME_TOLERANCE_S]
        return found

    def at_place(self, latitude_e7: int, longitude_e7: int, heard_mono: float, hour_s: float | None) -> Fix | None:
        until_mono = heard_mono + CLOCK_TOLERANCE_S
        if hour_s is not None:
            timed = [fix for fix in self._near_and_then(latitude_e7, longitude_e7, hour_s) if fix.mono <= until_mono]
            if timed:  # the same fix may have been played twice: then it was new the first time
                return min(timed, key=lambda fix: (round(abs(hour_difference_s(hour_s, fix.hour_s)), 3), fix.mono))
        near = self._near(latitude_e7, longitude_e7)
        played = bisect.bisect_right(near, until_mono, key=operator.attrgetter("mono"))
        in_order = next((fix for fix in reversed(near[:played]) if not fix.out_of_order), None)
        return in_order or (near[played - 1] if played else None)

    def at_time(self, heard_mono: float, hour_s: float | None) -> Fix | None:
        if hour_s is None:
            return None
        timed = [fix for fix in self.log.fixes
                 if fix.hour_s is not None and fix.has_gnss is not False and fix.mono <= heard_mono + CLOCK_TOLERANCE_S
                 and abs(hour_difference_s(hour_s, fix.hour_s)) <= TIME_TOLERANCE_S]
        return timed[-1] if timed else None


def _compare_system_time(track: Track, log: FlightLog, findings: Findings) -> None:
    """UTC on the air is the autopilot's, whatever a ground station says."""
    checked_raw = None
    for heard, system in track.of_type("system"):
        mono = heard.reception.mono
        if system.raw == checked_raw or log.time_known_mono is None or mono < log.time_known_mono + SYSTEM_S:
            continue
        at = bisect.bisect_right(log.utc, mono, key=operator.itemgetter(0))
        if not at:
            continue
        checked_raw = system.raw
        utc_s = log.utc[at - 1][1] + mono - log.utc[at - 1][0]
        if utc_s < YEAR_2019_S:  # a flight of before: the field can't say it
            utc_s = None
        if (system.unix_s is None) != (utc_s is None) or (utc_s is not None and abs(system.unix_s - utc_s) > SYSTEM_S):
            findings.violation("played.system_time", heard.reception, "System timestamp against the autopilot's time",
                               "unknown" if utc_s is None else f"{utc_s:.0f} s, within {SYSTEM_S:g} s", system.unix_s)


def compare(tracks: list[Track], log: FlightLog, findings: Findings) -> Comparison:
    comparison, index = Comparison(), _Index(log)
    for track in tracks:
        _compare_system_time(track, log, findings)
        checked_raw, newest = None, None
        for heard, location in track.of_type("location"):
            reception = heard.reception
            fix = _shown_fix(location, reception, index, findings if location.raw != checked_raw else None)
            comparison.shown[id(reception)] = fix
            if location.raw != checked_raw and fix is not None:
                _compare_fields(location, fix, reception, log, findings)
            if fix is not None:
                _judge_age(location, fix, reception, log, findings, comparison)
                if newest is not None and location.raw != checked_raw and _older(fix, newest):
                    findings.violation("played.order", reception, "an older position is shown after a newer one",
                                       f"the fix played {reception.mono - newest.mono:.2f} s ago, or a newer one",
                                       f"the fix played {reception.mono - fix.mono:.2f} s ago")
                else:
                    newest = fix
            checked_raw = location.raw
    return comparison


def _older(fix: Fix, newest: Fix) -> bool:
    if fix.source != newest.source:
        return False
    return fix.mono < newest.mono or (fix.out_of_order and fix is not newest)


def _shown_fix(location: Location, reception: Reception, index: _Index, findings: Findings | None) -> Fix | None:
    """The played fix that a Location shows; reports (unless `findings` is None) when there is none."""
    log = index.log
    if location.latitude_deg is None:
        due = log.newest_fix(reception.mono - LATE_S)
        if due is not None and findings is not None and due.has_gnss:
            findings.violation("played.unknown", reception, "the position is unknown although one was played "
                               f"{reception.mono - due.mono:.1f} s ago", _place(due), "unknown")
        return None
    latitude_e7, longitude_e7 = struct.unpack_from("<ii", location.raw, 5)
    fix = index.at_place(latitude_e7, longitude_e7, reception.mono, location.timestamp_s)
    if fix is None and (latitude_e7, longitude_e7) in index.without_gnss:
        if findings is not None:
            findings.violation("played.fix", reception, "a position is shown that the autopilot had without a GNSS fix",
                               "unknown, or the last one with a fix", f"{latitude_e7 / 1e7:.7f}, {longitude_e7 / 1e7:.7f}")
        return None
    if fix is None:
        same_time = index.at_time(reception.mono, location.timestamp_s)
        reference = same_time or log.newest_fix(reception.mono)
        if findings is not None:
            hint = _sign_hint(latitude_e7, longitude_e7, reference) if reference else ""
            findings.violation("played.position", reception, f"the position was never played{hint}",
                               _place(reference) if reference else "unknown: nothing was played yet",
                               f"{latitude_e7 / 1e7:.7f}, {longitude_e7 / 1e7:.7f}")
        return same_time
    return fix


def _place(fix: Fix) -> str:
    return f"{fix.latitude_e7 / 1e7:.7f}, {fix.longitude_e7 / 1e7:.7f}"


def _sign_hint(latitude_e7: int, longitude_e7: int, fix: Fix) -> str:
    def near(a: int, b: int) -> bool:
        return abs(a - b) < 20000  # some 200 m

    if near(latitude_e7, fix.latitude_e7) and near(longitude_e7, -fix.longitude_e7):
        return ": the sign of the longitude is swapped"
    if near(latitude_e7, -fix.latitude_e7) and near(longitude_e7, fix.longitude_e7):
        return ": the sign of the latitude is swapped"
    if near(latitude_e7, fix.longitude_e7) and near(longitude_e7, fix.latitude_e7):
        return ": latitude and longitude are exchanged"
    return ""


def _compare_fields(location: Location, fix: Fix, reception: Reception, log: FlightLog, findings: Findings) -> None:
    lost = location.status == STATUS_SYSTEM_FAILURE

    def bad(kind: str, what: str, expected, found) -> None:
        if lost and kind in MOTION and found in (None, "unknown"):
            return  # where it was is still worth saying; how it moves now isn't known
        findings.violation(f"played.{kind}", reception, what, expected, found)

    if not fix.vertical_unsure:
        _compare_number("vertical_speed", "vertical speed (m/s, positive up)", fix.vertical_speed_m_s,
                        location.vertical_speed_m_s, 0.5, bad)
    step_m_s = 0.25 if (location.speed_m_s or 0) <= 63.75 else 0.75
    _compare_number("speed", "horizontal speed (m/s)", fix.speed_m_s, location.speed_m_s, step_m_s, bad)
    _compare_direction(location, fix, bad)
    heights = log.heights_m(fix, reception.mono)
    if heights and not any(location.height_m is None if height is None else _close(height, location.height_m, 0.5)
                           for height in heights):
        bad("height", "height above take-off (m)",
            " or ".join("unknown" if h is None else f"{h:.2f}" for h in sorted(heights, key=str)), location.height_m)
    if fix.altitude_msl_m is not None:
        altitudes = {None if u is None else fix.altitude_msl_m + u
                     for u in log.undulations_near(fix.mono, reception.mono)}
        # What no receiver says, a native message may, to whoever knows at which instants it and telemetry came.
        native = {fix.altitude_msl_m + u for u in log.native_undulations_near(fix.mono, reception.mono) if None in altitudes}
        if not any(location.geodetic_altitude_m is None if a is None else
                   _close(a, location.geodetic_altitude_m, 0.5) for a in altitudes) and not any(
                       _close(a, location.geodetic_altitude_m, NATIVE_ALTITUDE_M) for a in native):
            hint = (": above mean sea level instead of the ellipsoid"
                    if _close(fix.altitude_msl_m, location.geodetic_altitude_m, 0.5) else "")
            bad("altitude", f"geodetic altitude (m){hint}",
                " or ".join("unknown" if a is None else f"{a:.2f}" for a in sorted(altitudes | native, key=str)),
                location.geodetic_altitude_m)
    _compare_time(location, fix, reception, log, bad)


def _close(expected: float, found: float | None, step: float) -> bool:
    return found is not None and abs(expected - found) <= step * STEP_MARGIN


def _compare_number(kind: str, what: str, expected: float | None, found: float | None, step: float, bad) -> None:
    if expected is None:
        return  # a native message without it: another source may fill the field
    if not _close(expected, found, step):
        swapped = found is not None and abs(expected) > step and _close(-expected, found, step)
        bad(kind, what + (": the sign is swapped" if swapped else ""), f"{expected:.2f}", found)


def _compare_direction(location: Location, fix: Fix, bad) -> None:
    slow = fix.speed_m_s is not None and fix.speed_m_s < COURSE_UNKNOWN_M_S + 0.1
    if location.direction_deg is None:
        if fix.direction_deg is not None and not slow:
            bad("direction", "direction (degrees)", f"{fix.direction_deg:.1f}", "unknown")
    elif fix.direction_deg is None:
        if fix.speed_m_s is not None and fix.speed_m_s < COURSE_UNKNOWN_M_S - 0.1:
            bad("direction", f"direction at {fix.speed_m_s:.2f} m/s", "unknown", location.direction_deg)
    elif abs((location.direction_deg - fix.direction_deg + 180) % 360 - 180) > 1 * STEP_MARGIN:
        bad("direction", "direction (degrees): course over ground", f"{fix.direction_deg:.1f}",
            location.direction_deg)


def _compare_time(location: Location, fix: Fix, reception: Reception, log: FlightLog, bad) -> None:
    """UTC on the air is the log's SYSTEM_TIME; until that came, time is unknown."""
    time_known_mono = log.system_times[0][0] if log.system_times else None
    if location.timestamp_s is None:
        confirmed_mono = log.time_known_mono
        if fix.hour_s is not None and confirmed_mono is not None and fix.mono > confirmed_mono + LATE_S:
            bad("time_unknown", "Location timestamp (s of the UTC hour)", f"{fix.hour_s:.1f}", "unknown")
    elif fix.source == "GLOBAL_POSITION_INT" and (
            time_known_mono is None or time_known_mono > reception.mono + CLOCK_TOLERANCE_S):
        bad("time", "Location timestamp before any SYSTEM_TIME was played", "unknown", location.timestamp_s)
    elif fix.hour_s is not None and abs(hour_difference_s(location.timestamp_s, fix.hour_s)) > TIME_TOLERANCE_S:
        bad("time", "Location timestamp (s of the UTC hour)", f"{fix.hour_s:.1f}", location.timestamp_s)


def _judge_age(location: Location, fix: Fix, reception: Reception, log: FlightLog, findings: Findings,
               comparison: Comparison) -> None:
    age_s = reception.mono - fix.mono
    late_s = max(0.0, reception.mono - fix.next_mono) if fix.next_mono is not None else 0.0
    comparison.ages_s.setdefault(reception.channel, []).append(age_s)
    comparison.lateness_s.append(late_s)
    if late_s > LATE_S:
        findings.violation("played.stale", reception, "a newer position was played long ago",
                           f"the fix played {late_s:.2f} s ago, or a newer one", f"the fix played {age_s:.2f} s ago")
    failing = location.status == STATUS_SYSTEM_FAILURE
    if age_s > STATUS_FAILURE_DUE_S and not failing and location.status != STATUS_EMERGENCY:
        findings.violation("played.status", reception, f"status while the position is {age_s:.1f} s old",
                           "4 (remote ID system failure)", location.status)
    elif (_own_age_s(fix, reception) < STATUS_FRESH_S and failing and fix.has_gnss
          and _heartbeat_fresh(log, reception.mono - BUILT_BEFORE_S)):
        findings.violation("played.status", reception, f"status while the position is {age_s:.1f} s old",
                           "any but 4 (remote ID system failure)", location.status)


def _own_age_s(fix: Fix, reception: Reception) -> float:
    """Age by the fix's own timestamp: it may have been old already when it was played."""
    if fix.boot_ms is None or fix.booted_mono is None:
        return reception.mono - fix.mono
    return reception.mono - (fix.boot_ms / 1000 + fix.booted_mono)


def _heartbeat_fresh(log: FlightLog, mono: float) -> bool:
    at = bisect.bisect_right(log.heartbeats, mono)
    return at > 0 and mono - log.heartbeats[at - 1] < STATUS_FRESH_S


def log_excuse(log: FlightLog, comparison: Comparison):
    """An excuse function for intervals.track_intervals(): the log itself had nothing newer, most of the time."""
    def excuse(track: Track, interval: Interval) -> str | None:
        shown = comparison.shown.get(id(interval.start))
        if shown is None:
            newest = log.newest_fix(interval.end_mono - LOCATION_LIMIT_S)
            return "no position played yet" if newest is None else None
        if shown.next_mono is None:
            return "gap in what was played"
        gap_s, late_s = shown.next_mono - shown.mono, interval.end_mono - shown.next_mono
        return "gap in what was played" if late_s <= LOCATION_LIMIT_S and gap_s >= interval.seconds / 2 else None
    return excuse
