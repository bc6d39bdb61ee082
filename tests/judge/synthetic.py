"""A transmitter made of numbers, for the tests of the judge: a flight, an encoder
of its own, an air without radios.  `Faults` holds what it can get wrong.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass
from typing import Callable

from .carriers import Advertisement, Beacon
from .receptions import Run, from_advertisement, from_beacon

START_TIME = 1700000000.0  # the listener's wall clock
START_MONO = 5000.0
FLIGHT_UNIX_S = 1685613594.0  # the autopilot's UTC: another day, six seconds before a full hour
BOOT_AHEAD_S = 608.0
FIX_PERIOD_S = 0.2
UNDULATION_M = 36.0
TAKE_OFF_ALTITUDE_M = 40.0
ADDRESS = "C2:00:11:22:33:44"
BSSID = "02:00:00:00:06:00"
CYCLE = ("location", "basic_id", "location", "system", "location", "operator_id", "location", "self_id")
PACK_ORDER = ("basic_id", "location", "self_id", "system", "operator_id")


# --- encoder ---------------------------------------------------------------

def text(value: str, octets: int) -> bytes:
    return value.encode("ascii").ljust(octets, b"\0")


def altitude(metres: float | None) -> int:
    return 0 if metres is None else round((metres + 1000) * 2)


def basic_id(identifier: str = "SSRS5GBG01", id_type: int = 1, ua_type: int = 1, version: int = 2) -> bytes:
    return bytes((version, id_type << 4 | ua_type)) + text(identifier, 20) + bytes(3)


def location(latitude_e7: int, longitude_e7: int, *, status: int = 2, direction_deg: float | None = None,
             speed_m_s: float | None = None, vertical_m_s: float | None = None, geodetic_m: float | None = None,
             pressure_m: float | None = None, height_m: float | None = None, hour_s: float | None = None,
             version: int = 2) -> bytes:
    flags, direction = status << 4, 361 if direction_deg is None else round(direction_deg) % 360
    if direction >= 180:
        flags, direction = flags | 2, direction - 180
    if speed_m_s is None:
        flags, speed = flags | 1, 255
    elif speed_m_s <= 63.75:
        speed = round(speed_m_s * 4)
    else:
        flags, speed = flags | 1, min(254, round((speed_m_s - 63.75) / 0.75))
    vertical = 126 if vertical_m_s is None else round(max(-62, min(62, vertical_m_s)) * 2)
    tenths = 0xFFFF if hour_s is None else int(hour_s * 10)
    return struct.pack("<BBBBbiiHHHBBHBB", 0x10 | version, flags, direction, speed, vertical, latitude_e7,
                       longitude_e7, altitude(pressure_m), altitude(geodetic_m), altitude(height_m), 0, 0, tenths, 0, 0)


def self_id(description: str = "Sea rescue surveillance") -> bytes:
    return bytes((0x32, 0)) + text(description, 23)


def system(unix_s: int, latitude_e7: int = 577089000, longitude_e7: int = 119746000) -> bytes:
    return struct.pack("<BBiiHBHHBHIB", 0x42, 0x04, latitude_e7, longitude_e7, 1, 0, 0, 0, 0x25, altitude(50.0),
                       int(unix_s) - 1546300800, 0)


def operator_id(number: str = "SWE3jxza7qbzvu5d") -> bytes:
    return bytes((0x52, 0)) + text(number, 20) + bytes(3)


def pack(messages: list[bytes]) -> bytes:
    return bytes((0xF2, 25, len(messages))) + b"".join(messages)


def service_data(counter: int, body: bytes) -> bytes:
    return bytes((len(body) + 5, 0x16, 0xFA, 0xFF, 0x0D, counter)) + body


def vendor_element(counter: int, body: bytes) -> bytes:
    return bytes((0xDD, len(body) + 5, 0xFA, 0x0B, 0xBC, 0x0D, counter)) + body


# --- flight ----------------------------------------------------------------

def fix_at(number: int) -> dict:
    """The number-th position: 15 m/s, mostly eastward in a slow curve, climbing and sinking."""
    def where(t):
        east = 15 * t
        return 60 * math.sin(t / 12), east, TAKE_OFF_ALTITUDE_M + 20 + 15 * math.sin(t / 6)

    t = number * FIX_PERIOD_S
    (north, east, up), (north_1, east_1, up_1), (north_2, east_2, up_2) = where(t), where(t - 0.05), where(t + 0.05)
    return {"type": "GLOBAL_POSITION_INT", "time_boot_ms": round((BOOT_AHEAD_S + t) * 1000),
            "lat": 577000000 + round(north / 0.0111319), "lon": 119000000 + round(east / 0.0111319 / math.cos(1.00705)),
            "alt": round(up * 1000), "relative_alt": round((up - TAKE_OFF_ALTITUDE_M) * 1000),
            "vx": round((north_2 - north_1) * 1000), "vy": round((east_2 - east_1) * 1000),
            "vz": -round((up_2 - up_1) * 1000), "hdg": 65535}


def native_at(number: int) -> dict:
    fix = fix_at(number)
    return {"latitude": fix["lat"], "longitude": fix["lon"], "height": fix["alt"] / 1000 - TAKE_OFF_ALTITUDE_M,
            "altitude_geodetic": fix["alt"] / 1000 + UNDULATION_M, "speed_vertical": -fix["vz"], "direction": 36100,
            "speed_horizontal": round(math.hypot(fix["vx"], fix["vy"])), "horizontal_accuracy": 11,
            "timestamp": (FLIGHT_UNIX_S + fix["time_boot_ms"] / 1000 - BOOT_AHEAD_S) % 3600}


def encode_fix(fix: dict, **changes) -> bytes:
    speed = math.hypot(fix["vx"], fix["vy"]) / 100
    values = {"direction_deg": math.degrees(math.atan2(fix["vy"], fix["vx"])) % 360, "speed_m_s": speed,
              "vertical_m_s": -fix["vz"] / 100, "geodetic_m": fix["alt"] / 1000 + UNDULATION_M,
              "height_m": fix["alt"] / 1000 - TAKE_OFF_ALTITUDE_M,
              "hour_s": (FLIGHT_UNIX_S + fix["time_boot_ms"] / 1000 - BOOT_AHEAD_S) % 3600}
    return location(changes.pop("lat", fix["lat"]), changes.pop("lon", fix["lon"]), **{**values, **changes})


def played_log(seconds: float, gap: tuple[float, float] | None = None, no_fix_from: float = math.inf,
               native_s: float | None = None, second: bool = False, hangs_from: float = math.inf) -> list[dict]:
    """What the flight player would have written: positions at 5 Hz, a take-off before them.
    native_s: at which interval the same positions also come as native messages. second: another receiver, that has a fix.
    hangs_from: the first one goes on with the time of that fix."""
    def row(t, name, **fields):
        return {"time": START_TIME + t, "mono": START_MONO + t, "type": name, **fields}

    def unix_us(t):
        return round((FLIGHT_UNIX_S + t) * 1e6)

    zero = {**fix_at(0), "alt": round(TAKE_OFF_ALTITUDE_M * 1000), "relative_alt": 0,
            "time_boot_ms": round((BOOT_AHEAD_S - 2) * 1000)}
    rows = [row(-3.0, "SYSTEM_TIME", time_unix_usec=unix_us(-3), time_boot_ms=round((BOOT_AHEAD_S - 3) * 1000)),
            row(-2.2, "HEARTBEAT", autopilot=3, base_mode=81, system_status=3),
            row(-2.0, **{"name": "GLOBAL_POSITION_INT"}, **{k: v for k, v in zero.items() if k != "type"}),
            row(-1.5, "HEARTBEAT", autopilot=3, base_mode=81 | 128, system_status=4)]
    ellipsoid_mm = round(40000 + UNDULATION_M * 1000)
    for t in range(-6, math.ceil(seconds) + 1):
        rows.append(row(t, "GPS_RAW_INT", fix_type=3 if t < no_fix_from else 1, time_usec=unix_us(min(t, hangs_from)), alt=40000,
                        alt_ellipsoid=ellipsoid_mm))
        if second:
            rows.append(row(t, "GPS2_RAW", fix_type=3, time_usec=unix_us(t), alt=40000, alt_ellipsoid=ellipsoid_mm))
    for number in range(round(seconds / FIX_PERIOD_S) + 1):
        t = number * FIX_PERIOD_S
        if number % 5 == 0:
            rows.append(row(t, "HEARTBEAT", autopilot=3, base_mode=81 | 128, system_status=4))
        if not (gap and gap[0] < t < gap[1]):
            fix = fix_at(number)
            rows.append(row(t, fix.pop("type"), **fix))
    if native_s is not None:
        rows += [row(t, "OPEN_DRONE_ID_LOCATION", **native_at(round(t / FIX_PERIOD_S)))
                 for t in (n * native_s for n in range(int(seconds / native_s)))]
    return sorted(rows, key=lambda one: one["mono"])


# --- transmitter -----------------------------------------------------------

@dataclass
class Faults:
    """Hooks; each gets what would be right and returns what is sent instead."""
    location: Callable[[dict, float], bytes] | None = None  # fix, seconds -> message
    system: Callable[[float], bytes] | None = None  # seconds -> message
    advertising: Callable[[bytes, float], bytes] | None = None  # legacy advertising data
    pack: Callable[[list[bytes]], bytes] | None = None  # messages in order -> body
    extended: Callable[[bytes], bytes] | None = None  # extended advertising data
    address: Callable[[float], str] | None = None
    counter: Callable[[str, int], int] | None = None  # message, right value -> value
    schedule: Callable[[float], list[tuple[float, str]]] | None = None
    silent_after_s: float | None = None
    fix_number: Callable[[float], int] | None = None  # which fix a slot uses


def slots(seconds: float) -> list[tuple[float, str]]:
    return [(n * 0.125, CYCLE[n % 8]) for n in range(int(seconds / 0.125))]


def two_deadlines(seconds: float) -> list[tuple[float, str]]:
    """The field study's: Location every 1.0 s, another every 0.75 s; at a collision,
    every 3 s, the second payload overwrites the first at once."""
    others = [(0.75 * n, CYCLE[1 + 2 * (n % 4)]) for n in range(int(seconds / 0.75))]
    return sorted([(1.0 * n, "location") for n in range(int(seconds))] + others,
                  key=lambda item: (item[0], item[1] != "location"))


class Transmitter:
    def __init__(self, faults: Faults):
        self.faults = faults
        self.counters: dict[str, int] = {}
        self.contents: dict[str, bytes] = {}

    def message(self, name: str, t: float) -> bytes:
        choose = self.faults.fix_number or (lambda now: int((now - 0.01) / FIX_PERIOD_S))
        if name == "location":
            fix = fix_at(max(0, choose(t)))
            return self.faults.location(fix, t) if self.faults.location else encode_fix(fix)
        if name == "system":
            return self.faults.system(t) if self.faults.system else system(FLIGHT_UNIX_S + t)
        return {"basic_id": basic_id, "operator_id": operator_id, "self_id": self_id}[name]()

    def counter(self, key: str, body: bytes) -> int:
        if self.contents.get(key) != body:
            self.counters[key] = (self.counters.get(key, 249) + 1) % 256  # wraps early
            self.contents[key] = body
        value = self.counters[key]
        return self.faults.counter(key, value) if self.faults.counter else value

    def legacy(self, name: str, t: float) -> bytes:
        message = self.message(name, t)
        data = service_data(self.counter(name, message), message)
        return self.faults.advertising(data, t) if self.faults.advertising else data

    def pack_body(self, t: float) -> bytes:
        messages = [self.message(name, t) for name in PACK_ORDER]
        return self.faults.pack(messages) if self.faults.pack else pack(messages)


def transmit(seconds: float = 12.0, faults: Faults | None = None, channels=("bt4", "bt5", "wifi"),
             interval_s: float = 0.02) -> tuple[Run, list[dict]]:
    """What a receiver hears in so many seconds, and what was set on the controller."""
    faults = faults or Faults()
    run, set_log = Run(sources=["synthetic"]), []
    until = seconds if faults.silent_after_s is None else faults.silent_after_s

    def address(t):
        return faults.address(t) if faults.address else ADDRESS

    def add(t, reception):
        run.receptions.append(reception)

    if "bt4" in channels:
        sender, plan, current, number = Transmitter(faults), (faults.schedule or slots)(seconds), None, 0
        for event in range(int(until / interval_s)):
            t = event * interval_s + 0.004 + 0.003 * ((event * 7) % 5) / 5
            while number < len(plan) and plan[number][0] <= t:
                current = sender.legacy(plan[number][1], plan[number][0])
                set_log.append({"mono": START_MONO + plan[number][0], "opcode": 0x2008, "data": current.hex(),
                                "channel": "bt4"})
                number += 1
            add(t, from_advertisement(START_TIME + t, START_MONO + t, Advertisement(
                False, address(t), "random", "ADV_NONCONN_IND", "1M/-", -50, current), keep=True))
    for channel in ("bt5", "wifi"):
        if channel not in channels:
            continue
        sender = Transmitter(faults)
        for event in range(int(until / 0.1)):
            t = event * 0.1 + 0.01
            body = sender.pack_body(t - t % 0.25)
            counter = sender.counter("pack", body)
            if channel == "bt5":
                data = service_data(counter, body)
                data = faults.extended(data) if faults.extended else data
                add(t, from_advertisement(START_TIME + t, START_MONO + t, Advertisement(
                    True, address(t), "random", "extended nonconnectable", "Coded/Coded", -60, data), keep=True))
            else:
                add(t, from_beacon(START_TIME + t, START_MONO + t, Beacon(
                    BSSID, bytes((0, 4)) + b"odid" + vendor_element(counter, body), 6, -40), keep=True))
    run.receptions.sort(key=lambda reception: reception.mono)
    run.start_mono, run.end_mono = START_MONO, START_MONO + seconds
    return run, set_log
