"""The log of what was played to the transmitter: one JSON object per MAVLink message.

Units and signs as MAVLink defines them (positions in 1e-7 degrees, altitudes in
mm above mean sea level, velocities in cm/s, z downward) become what Open Drone
ID demands (metres above the ellipsoid and above take-off, positive upward, UTC).
"""

from __future__ import annotations

import bisect
import math
import operator
import statistics
from dataclasses import dataclass, field
from pathlib import Path

from .receptions import InputError, read_json_lines

ARMED = 0x80  # MAV_MODE_FLAG_SAFETY_ARMED
AUTOPILOT_INVALID = 8
AUTOPILOT_COMPONENT = 1  # MAV_COMP_ID_AUTOPILOT1
TRANSMITTER_COMPONENTS = range(236, 239)
GPS_TO_UTC_S = 18
COURSE_UNKNOWN_M_S = 0.3
REBOOT_MS = 10000  # a boot time that falls by more is a restart, by less a message out of order
EARLIEST_UNIX_S = 1.0e9  # an autopilot without GNSS time sends its time since boot
FIX_TYPE_2D = 2
GNSS_FRESH_S = 3.0  # a fix is known for so long after it was said ...
GNSS_TOLERANCE_S = 1.1  # ... by the transmitter's clock, of what was heard in between
DECIDING_SECONDS = 3  # so many tell that the vertical speed is upside down ...
DECIDING_TOLERANCE_S = 2.0  # ... to a transmitter whose seconds begin at other instants
HEARD_LATE_S = 0.2  # by so much, by a transmitter whose machine is late
BESIDE_S = 0.5  # two positions so near in time are of one place
POSITION_MESSAGES = ("GLOBAL_POSITION_INT", "OPEN_DRONE_ID_LOCATION")
_FIRST, _MONO = operator.itemgetter(0), operator.attrgetter("mono")
RECEIVER_MESSAGES = ("GPS_RAW_INT", "GPS2_RAW")  # the first one's, and a second one's


@dataclass
class Fix:
    """One position that was played, in Open Drone ID's terms; None is unknown."""
    mono: float
    source: str
    boot_ms: int | None
    latitude_e7: int
    longitude_e7: int
    altitude_msl_m: float | None
    relative_altitude_m: float | None
    height_m: float | None  # native messages only
    geodetic_altitude_m: float | None
    speed_m_s: float | None
    vertical_speed_m_s: float | None
    direction_deg: float | None
    unix_s: float | None = None
    hour_s: float | None = None  # seconds since the last full UTC hour
    rated: bool = False  # native messages only: it has a time and an accuracy
    next_mono: float | None = None  # when the next newer fix, of any source, was played
    out_of_order: bool = False
    vertical_unsure: bool = False  # upside down, and not yet to be known by its altitude
    booted_mono: float | None = None  # when its autopilot's clock was 0, by that boot's least delayed fix
    first_boot: bool = True  # of its autopilot, in this log
    has_gnss: bool | None = None  # did the autopilot have a GNSS fix? None: just then it changed


@dataclass
class FlightLog:
    fixes: list[Fix] = field(default_factory=list)
    native_undulations: list[tuple[float, float]] = field(default_factory=list)  # mono, metres
    arming_edges: list[float] = field(default_factory=list)  # mono
    armed_from_start: bool = False
    disarmed_mono: float = math.inf  # the first time
    vertical_inverted: bool = False  # the autopilot sends it upside down
    homes: list[tuple[float, float]] = field(default_factory=list)  # mono, metres above mean sea level
    heartbeats: list[float] = field(default_factory=list)  # mono
    system_times: list[tuple[float, float]] = field(default_factory=list)  # mono, Unix time of boot
    utc: list[tuple[float, float]] = field(default_factory=list)  # mono, Unix time
    undulations: list[tuple[float, float | None]] = field(default_factory=list)  # mono, metres or unknown
    fix_types: list[tuple[float, int, str]] = field(default_factory=list)  # and whose: the message's name
    fixes_said: dict[str, tuple] = field(default_factory=dict)  # each receiver's last: time, kind of fix and place
    time_known_mono: float | None = None  # the first SYSTEM_TIME that a GNSS fix confirms
    clock_offset_s: float = 0.0  # mono minus time
    gnss_found: dict[float, bool | None] = field(default_factory=dict)  # has_gnss, once the log is whole

    def newest_fix(self, mono: float, source: str | None = None) -> Fix | None:
        for at in range(bisect.bisect_right(self.fixes, mono, key=_MONO) - 1, -1, -1):
            fix = self.fixes[at]
            if not fix.out_of_order and fix.has_gnss is not False and (source is None or fix.source == source):
                return fix
        return None

    def has_gnss(self, mono: float) -> bool | None:
        """Was a GNSS fix known at an instant: by any receiver, or where none is heard by a native
        position with time and accuracy?  None: either answer is right, so shortly after a change."""
        if mono not in self.gnss_found:
            around = {self._gnss_at(mono - GNSS_TOLERANCE_S), self._gnss_at(mono), self._gnss_at(mono + GNSS_TOLERANCE_S)}
            self.gnss_found[mono] = around.pop() if len(around) == 1 else None
        return self.gnss_found[mono]

    def _gnss_at(self, mono: float) -> bool:
        newest: dict[str, int] = {}
        for at in range(bisect.bisect_right(self.fix_types, mono, key=_FIRST) - 1, -1, -1):
            said_mono, fix_type, whose = self.fix_types[at]
            if mono - said_mono >= GNSS_FRESH_S:
                break
            newest.setdefault(whose, fix_type)
        if newest:
            return max(newest.values()) >= FIX_TYPE_2D
        return any(fix.rated and 0 <= mono - fix.mono < GNSS_FRESH_S for fix in self.fixes)

    def undulations_near(self, start_mono: float, end_mono: float) -> set[float | None]:
        """Ellipsoid minus sea level that a transmitter may have used for a fix that came
        at `start_mono` and was heard at `end_mono`; None: unknown."""
        first = max(0, bisect.bisect_right(self.undulations, start_mono, key=_FIRST) - 1)
        last = bisect.bisect_right(self.undulations, end_mono, key=_FIRST)
        found = {value for _, value in self.undulations[first:last]}
        if not self.undulations or start_mono < self.undulations[0][0]:
            found.add(None)
        return found

    def native_undulations_near(self, start_mono: float, end_mono: float) -> list[float]:
        """By the geodetic altitudes of native positions, fresh at that time, beside telemetry's above the sea."""
        first = bisect.bisect_right(self.native_undulations, start_mono - GNSS_FRESH_S - HEARD_LATE_S, key=_FIRST)
        last = bisect.bisect_right(self.native_undulations, end_mono, key=_FIRST)
        return [undulation_m for _, undulation_m in self.native_undulations[first:last]]

    def heights_m(self, fix: Fix, heard_mono: float) -> set[float | None]:
        """Heights above take-off that are right for a fix.  Before the first arming
        edge relative_alt; from an edge on, the altitude at that edge is the zero.
        Around an edge both are right.  An aircraft that was armed when the log
        begins took off where nobody saw it: unknown, or above the autopilot's home;
        once it is disarmed, relative_alt as before any arming."""
        if fix.height_m is not None or fix.altitude_msl_m is None:
            return {fix.height_m} if fix.height_m is not None else set()
        if self.armed_from_start and not any(edge <= heard_mono for edge in self.arming_edges):
            grounded = {fix.relative_altitude_m} if heard_mono >= self.disarmed_mono else set()
            return {None} | grounded | {fix.altitude_msl_m - home for mono, home in self.homes if mono <= heard_mono}
        edges = [edge for edge in self.arming_edges if edge <= heard_mono]
        if edges and self.has_gnss(edges[-1]) is not True:
            # Armed without a fix: the first one on the ground, home, or nothing stands in.
            late = next((one for one in self.fixes if one.mono > edges[-1] and one.has_gnss), None)
            zeros = [home for mono, home in self.homes if edges[-1] <= mono <= heard_mono]
            zeros += [late.altitude_msl_m] if late is not None and late.altitude_msl_m is not None else []
            return {None} | {fix.altitude_msl_m - zero for zero in zeros}
        decided = [edge for edge in edges if edge <= fix.mono - 0.5]
        heights = set() if decided else {fix.relative_altitude_m}
        for edge in (decided[-1:] + [edge for edge in edges if edge > fix.mono - 0.5]):
            at = bisect.bisect_right(self.fixes, edge, key=_MONO)
            for zero in self.fixes[max(0, at - 2):at + 1]:  # the edge may overtake a position
                if zero.altitude_msl_m is not None:
                    heights.add(fix.altitude_msl_m - zero.altitude_msl_m)
        return heights


def read_flight_log(path: Path) -> FlightLog:
    log = FlightLog()
    offsets, armed = [], None
    for number, record in read_json_lines(path):
        try:
            mono, name = float(record["mono"]), record.get("mavpackettype") or record["type"]
            offsets.append(mono - float(record["time"]))
            if not isinstance(name, str):
                raise ValueError(f"the message's name is expected in mavpackettype or type, found {name!r}")
            if not _from_this_autopilot(name, record):
                continue
            if name == "HEARTBEAT" and record.get("autopilot", 0) != AUTOPILOT_INVALID:
                log.heartbeats.append(mono)
                now_armed = bool(record["base_mode"] & ARMED)
                log.armed_from_start = log.armed_from_start or (now_armed and armed is None)
                if now_armed and armed is False:
                    log.arming_edges.append(mono)
                if armed and not now_armed:
                    log.disarmed_mono = min(log.disarmed_mono, mono)
                armed = now_armed
            elif name == "SYSTEM_TIME" and record["time_unix_usec"] / 1e6 > EARLIEST_UNIX_S:
                log.system_times.append((mono, record["time_unix_usec"] / 1e6 - record["time_boot_ms"] / 1e3))
                log.utc.append((mono, record["time_unix_usec"] / 1e6))
            elif name == "HOME_POSITION":
                log.homes.append((mono, record["altitude"] / 1000))
            elif name in RECEIVER_MESSAGES:
                ellipsoid_mm = record.get("alt_ellipsoid") or None
                if name == RECEIVER_MESSAGES[0] or ellipsoid_mm is not None:
                    log.undulations.append((mono, None if ellipsoid_mm is None else
                                            (ellipsoid_mm - record["alt"]) / 1000))
                # One that repeats its last fix, with the time of that, says nothing new; without a fix it has no time to move on.
                said = record.get("time_usec"), record["fix_type"], record.get("lat"), record.get("lon")
                if record["fix_type"] < FIX_TYPE_2D or not said[0] or said != log.fixes_said.get(name):
                    log.fix_types.append((mono, record["fix_type"], name))
                log.fixes_said[name] = said
            elif name in POSITION_MESSAGES:
                fix = _telemetry_fix(mono, record) if name == POSITION_MESSAGES[0] else _native_fix(mono, record)
                if fix.latitude_e7 or fix.longitude_e7:
                    log.fixes.append(fix)
        except (KeyError, TypeError, ValueError) as error:
            what = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{path}:{number}: not a played MAVLink message: {what}") from error
    if not offsets:
        raise InputError(f"{path}: nothing was played (no line in it)")
    log.clock_offset_s = statistics.median(offsets)
    for rows in (log.fixes, log.system_times, log.utc, log.undulations, log.fix_types):
        rows.sort(key=lambda row: row.mono if isinstance(row, Fix) else row[0])
    telemetry = [fix for fix in log.fixes if fix.source == POSITION_MESSAGES[0]]
    log.native_undulations = _native_undulations([fix for fix in log.fixes if fix.source != POSITION_MESSAGES[0]], telemetry)
    _tell_boots_apart(telemetry)
    _complete(log)
    _set_upright(telemetry, log)
    return log


def _from_this_autopilot(name: str, record: dict) -> bool:
    """Telemetry counts from the autopilot's component only; native messages not from
    another transmitter (components 236 to 238), nor about another aircraft."""
    component = record.get("compid", AUTOPILOT_COMPONENT)
    if name.startswith("OPEN_DRONE_ID_"):
        return component not in TRANSMITTER_COMPONENTS and not any(record.get("id_or_mac") or ())
    return component == AUTOPILOT_COMPONENT


def _telemetry_fix(mono: float, record: dict) -> Fix:
    north, east = record["vx"] / 100, record["vy"] / 100
    speed = math.hypot(north, east)
    return Fix(mono, "GLOBAL_POSITION_INT", record["time_boot_ms"], record["lat"], record["lon"],
               record["alt"] / 1000, record["relative_alt"] / 1000, None, None, min(speed, 254.25),
               max(-62.0, min(62.0, -record["vz"] / 100)),
               math.degrees(math.atan2(east, north)) % 360 if speed >= COURSE_UNKNOWN_M_S else None)


def _native_fix(mono: float, record: dict) -> Fix:
    def known(value, unknown, scale=1.0):
        return None if value is None or value == unknown else value / scale

    timestamp_s = record.get("timestamp")
    return Fix(mono, "OPEN_DRONE_ID_LOCATION", None, record["latitude"], record["longitude"], None, None,
               known(record.get("height"), -1000), known(record.get("altitude_geodetic"), -1000),
               known(record.get("speed_horizontal"), 25500, 100), known(record.get("speed_vertical"), 6300, 100),
               known(record.get("direction"), 36100, 100),
               hour_s=timestamp_s if timestamp_s is not None and timestamp_s <= 3600 else None,
               rated=timestamp_s is not None and timestamp_s <= 3600 and bool(record.get("horizontal_accuracy")))


def _native_undulations(native: list[Fix], telemetry: list[Fix]) -> list[tuple[float, float]]:
    """Beside the telemetry positions before and after each, which climb meanwhile."""
    found = []
    for fix in native:
        at = bisect.bisect_right(telemetry, fix.mono, key=_MONO)
        for beside in telemetry[max(0, at - 1):at + 1]:
            since_s = fix.mono - beside.mono
            if fix.geodetic_altitude_m is not None and abs(since_s) < BESIDE_S:
                found.append((fix.mono, fix.geodetic_altitude_m - beside.altitude_msl_m - since_s * beside.vertical_speed_m_s))
    return found


def _tell_boots_apart(fixes: list[Fix]) -> None:
    """An autopilot that starts again begins its clock anew."""
    boots: list[list[Fix]] = [[]]
    for fix in fixes:
        if boots[-1] and fix.boot_ms < boots[-1][-1].boot_ms - REBOOT_MS:
            boots.append([])
        boots[-1].append(fix)
    for number, boot in enumerate(boots):
        booted_mono = min((fix.mono - fix.boot_ms / 1000 for fix in boot), default=None)
        for fix in boot:
            fix.booted_mono, fix.first_boot = booted_mono, number == 0


def _complete(log: FlightLog) -> None:
    """UTC of each fix, and which fix is the next newer one."""
    newest: dict[str, Fix] = {}
    for fix in log.fixes:
        at = bisect.bisect_right(log.system_times, fix.mono, key=_FIRST)
        # Of another boot it says nothing.
        first = 0 if fix.first_boot else bisect.bisect_right(log.system_times, fix.booted_mono, key=_FIRST)
        boot_unix_s = log.system_times[max(first, at - 1)][1] if first < len(log.system_times) else None
        if fix.boot_ms is not None and boot_unix_s is not None:
            fix.unix_s = boot_unix_s + fix.boot_ms / 1000
            fix.hour_s = fix.unix_s % 3600
        elif fix.hour_s is not None and log.system_times:
            _correct_leap_seconds(fix, log.system_times[max(0, at - 1)], newest)
        before = newest.get(fix.source)
        fix.out_of_order = before is not None and not _is_newer(before, fix)
        if not fix.out_of_order:
            newest[fix.source] = fix
        fix.has_gnss = log.has_gnss(fix.mono)
    next_mono = None
    for fix in reversed(log.fixes):
        if not fix.out_of_order:
            fix.next_mono = next_mono
            next_mono = fix.mono if fix.has_gnss else next_mono
    log.time_known_mono = next((mono for mono, _ in log.system_times if log.has_gnss(mono)), None)


def _set_upright(fixes: list[Fix], log: FlightLog) -> None:
    """ArduPilot before September 2018 sends the vertical speed upside down: told by the altitude, in every whole
    second in which both say that it climbs or sinks. Some more of such seconds against it than for it decide."""
    against, begin, decided_mono = 0, 0, None
    for number, fix in enumerate(fixes):
        seconds = fix.mono - fixes[begin].mono
        if seconds < 1:
            continue
        said_m_s = statistics.fmean(one.vertical_speed_m_s for one in fixes[begin + 1:number + 1])
        rose_m_s = (fix.altitude_msl_m - fixes[begin].altitude_msl_m) / seconds
        if seconds < 3 and min(abs(said_m_s), abs(rose_m_s)) > 1:
            against = max(-DECIDING_SECONDS, against + (1 if (said_m_s > 0) != (rose_m_s > 0) else -1))
        if against >= DECIDING_SECONDS:
            decided_mono = fix.mono
            break
        begin = number
    if decided_mono is not None:
        log.vertical_inverted = True
        for fix in fixes:
            fix.vertical_speed_m_s = -fix.vertical_speed_m_s
            fix.vertical_unsure = fix.mono <= decided_mono + DECIDING_TOLERANCE_S


def _correct_leap_seconds(fix: Fix, system_time: tuple[float, float], newest: dict[str, Fix]) -> None:
    """ArduPilot's native timestamp is GPS time: 18 s ahead of UTC."""
    telemetry = newest.get("GLOBAL_POSITION_INT")
    if telemetry is None or telemetry.unix_s is None:
        return
    ahead_s = (fix.hour_s - (telemetry.unix_s + fix.mono - telemetry.mono) + 1800) % 3600 - 1800
    if 17 - 0.5 <= ahead_s <= 19 + 0.5:
        fix.hour_s = (fix.hour_s - GPS_TO_UTC_S) % 3600


def _is_newer(before: Fix, now: Fix) -> bool:
    """Fresh means that the source's own time moved, not that a packet arrived."""
    if now.boot_ms is not None and before.boot_ms is not None:
        return now.boot_ms > before.boot_ms or now.boot_ms < before.boot_ms - REBOOT_MS
    if now.hour_s is not None and before.hour_s is not None:
        return 0 < (now.hour_s - before.hour_s) % 3600 < 1800
    return True
