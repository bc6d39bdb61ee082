"""Writes a generated flight as a .tlog: what an autopilot would have sent, with known truth.

A fixed-wing stands disarmed, arms, takes off and flies circles while it climbs and
descends steeply.  Its position is the integral of its velocity, it never stands still once
it rolls, and the same arguments give the same octets.  A .tlog is an 8-octet big-endian
stamp in microseconds of Unix time before each MAVLink frame.
"""

import argparse
import math
import random
import struct
import sys
from pathlib import Path

from pymavlink.dialects.v20 import common

START_UNIX_S = 1772359200  # 2026-03-01 10:00:00 UTC
BOOTED_MS = 60_000  # the autopilot is up for this long when the log begins
LATITUDE_DEG, LONGITUDE_DEG = 57.7, 11.9
GROUND_MSL_M = 35.0
UNDULATION_M = 36.0  # the ellipsoid is this much below mean sea level here
METRES_PER_DEGREE = 111_319.49

ARM_S = 3.0
ROLL_S = 4.0  # starts to move
ACCELERATION_M_S2 = 5.0
CRUISE_M_S = 22.0
LIFT_OFF_S = 8.0
FIRST_CLIMB_S, FIRST_CLIMB_M_S = 6.0, 15.0
STEEPEST_M_S = 28.0
CIRCLE_RADIUS_M = 150.0
CRAB_DEG = 5.0  # the nose points away from the course: wind
STEP_S = 0.01

ON_GROUND, IN_AIR, TAKING_OFF = 1, 2, 3  # MAV_LANDED_STATE
SERIAL = b"SSRS5GBG01"
OPERATOR = b"SWE3jxza7qbzvu5d"


class FixedWing:
    """The aircraft: a velocity for every time, integrated to a position."""

    def __init__(self, seed, fix_until_s=math.inf):
        chance = random.Random(seed)
        self.course_start_rad = chance.uniform(0, 2 * math.pi)
        self.turn_rad_s = CRUISE_M_S / CIRCLE_RADIUS_M * chance.choice((-1, 1))
        self.climb_period_s = chance.uniform(18, 24)
        self.fix_until_s = fix_until_s
        self.time_s = 0.0
        self.north_m = self.east_m = self.up_m = 0.0

    def course_rad(self, time_s):
        return self.course_start_rad + self.turn_rad_s * max(0.0, time_s - LIFT_OFF_S)

    def velocity_m_s(self, time_s):
        """North, east, up."""
        if time_s <= ROLL_S:
            return 0.0, 0.0, 0.0
        speed = min(CRUISE_M_S, ACCELERATION_M_S2 * (time_s - ROLL_S))
        course = self.course_rad(time_s)
        return speed * math.cos(course), speed * math.sin(course), self._climb_m_s(time_s - LIFT_OFF_S)

    def _climb_m_s(self, airborne_s):
        if airborne_s <= 0:
            return 0.0
        if airborne_s < FIRST_CLIMB_S:
            return FIRST_CLIMB_M_S * math.sin(math.pi * airborne_s / FIRST_CLIMB_S)
        return STEEPEST_M_S * math.sin(2 * math.pi * (airborne_s - FIRST_CLIMB_S) / self.climb_period_s)

    def advance(self, time_s):
        """Integrates up to a time, by the midpoint rule in steps of at most STEP_S."""
        span_s = time_s - self.time_s
        steps = math.ceil(span_s / STEP_S - 1e-9)
        for step in range(steps):
            north, east, up = self.velocity_m_s(self.time_s + (step + 0.5) * span_s / steps)
            self.north_m += north * span_s / steps
            self.east_m += east * span_s / steps
            self.up_m += up * span_s / steps
        self.time_s = time_s

    @property
    def armed(self):
        return self.time_s >= ARM_S

    @property
    def landed_state(self):
        if self.up_m < 0.5:
            return ON_GROUND
        return TAKING_OFF if self.time_s < LIFT_OFF_S + FIRST_CLIMB_S else IN_AIR

    @property
    def latitude_e7(self):
        return round((LATITUDE_DEG + self.north_m / METRES_PER_DEGREE) * 1e7)

    @property
    def longitude_e7(self):
        scale = METRES_PER_DEGREE * math.cos(math.radians(LATITUDE_DEG))
        return round((LONGITUDE_DEG + self.east_m / scale) * 1e7)

    @property
    def course_cdeg(self):
        return round(math.degrees(self.course_rad(self.time_s)) * 100) % 36000

    @property
    def speed_cm_s(self):
        north, east, _ = self.velocity_m_s(self.time_s)
        return round(math.hypot(north, east) * 100)

    @property
    def boot_ms(self):
        return BOOTED_MS + round(self.time_s * 1000)

    @property
    def unix_us(self):
        return START_UNIX_S * 1_000_000 + round(self.time_s * 1e6)


def _system_time(link, craft):
    # from boot_ms, so that Unix time minus boot time is the same in each
    return [link.system_time_encode((START_UNIX_S * 1000 + craft.boot_ms - BOOTED_MS) * 1000, craft.boot_ms)]


def _heartbeat(link, craft):
    base_mode = 0x51 | (0x80 if craft.armed else 0)  # custom mode, stabilised, manual input; armed
    return [link.heartbeat_encode(1, 3, base_mode, 10, 4 if craft.armed else 3)]


def _extended_state(link, craft):
    return [link.extended_sys_state_encode(0, craft.landed_state)]


def _home(link, craft):
    return [link.home_position_encode(
        round(LATITUDE_DEG * 1e7), round(LONGITUDE_DEG * 1e7), round(GROUND_MSL_M * 1000),
        0, 0, 0, [1, 0, 0, 0], 0, 0, 0, craft.unix_us)]


def _gps(link, craft):
    alt_mm = round((GROUND_MSL_M + craft.up_m) * 1000)
    course_cdeg = craft.course_cdeg if craft.speed_cm_s else 65535
    return [link.gps_raw_int_encode(
        craft.unix_us, 3 if craft.time_s < craft.fix_until_s else 1, craft.latitude_e7, craft.longitude_e7, alt_mm,
        80, 120, craft.speed_cm_s, course_cdeg, 14, alt_mm + round(UNDULATION_M * 1000), 900, 1500, 200)]


def _position(link, craft):
    north, east, up = craft.velocity_m_s(craft.time_s)
    return [link.global_position_int_encode(
        craft.boot_ms, craft.latitude_e7, craft.longitude_e7, round((GROUND_MSL_M + craft.up_m) * 1000),
        round(craft.up_m * 1000), round(north * 100), round(east * 100), round(-up * 100),
        (craft.course_cdeg + round(CRAB_DEG * 100)) % 36000)]


def _native(link, craft):
    """What an autopilot with Open Drone ID says by itself."""
    nobody, altitude_m = [0] * 20, GROUND_MSL_M + UNDULATION_M + craft.up_m
    _, _, up = craft.velocity_m_s(craft.time_s)
    return [
        link.open_drone_id_basic_id_encode(0, 0, nobody, 1, 1, list(SERIAL.ljust(20, b"\0"))),
        link.open_drone_id_location_encode(
            0, 0, nobody, 1 if craft.landed_state == ON_GROUND else 2,
            craft.course_cdeg if craft.speed_cm_s else 36100, craft.speed_cm_s, round(up * 100),
            craft.latitude_e7, craft.longitude_e7, altitude_m, altitude_m, 0, craft.up_m,
            12, 5, 4, 4, craft.unix_us / 1e6 % 3600, 1),
        link.open_drone_id_system_encode(
            0, 0, nobody, 0, 1, round(LATITUDE_DEG * 1e7), round(LONGITUDE_DEG * 1e7), 1, 0, -1000, -1000,
            1, 3, GROUND_MSL_M + UNDULATION_M, craft.unix_us // 1_000_000 - 1546300800),
        link.open_drone_id_operator_id_encode(0, 0, nobody, 0, OPERATOR.ljust(20, b"\0")),
    ]


def write_flight(path, seconds, rate_hz=5, seed=1, native_hz=0, fix_until_s=math.inf, changed=None):
    """Writes the flight's first seconds, GLOBAL_POSITION_INT at rate_hz. Returns how many frames.

    From fix_until_s on there is no GNSS fix, and the estimator goes on. changed(craft, message) gives the
    messages that are sent instead of one; those with ground_station are sent by that, from one with system_id on that is the
    autopilot's number.
    """
    if not seconds > 0 or not rate_hz > 0:
        raise ValueError(f"seconds and rate_hz must be above 0, not {seconds} and {rate_hz}")
    streams = [(1, _heartbeat), (1, _system_time), (2, _gps), (rate_hz, _position),
               (1, _extended_state), (0.2, _home)]
    if native_hz:
        streams.append((native_hz, _native))
    due = sorted((count / hz, order, build) for order, (hz, build) in enumerate(streams)
                 for count in range(math.ceil(seconds * hz)))
    link, craft, frames = common.MAVLink(None, srcSystem=1, srcComponent=1), FixedWing(seed, fix_until_s), 0
    ground = common.MAVLink(None, srcSystem=255, srcComponent=190)
    with open(path, "wb") as log:
        for time_s, _, build in due:
            craft.advance(time_s)
            built = build(link, craft)
            for message in built if changed is None else [other for one in built for other in changed(craft, one)]:
                sender = ground if hasattr(message, "ground_station") else link
                link.srcSystem = getattr(message, "system_id", link.srcSystem)
                log.write(struct.pack(">Q", craft.unix_us) + message.pack(sender))
                sender.seq = (sender.seq + 1) % 256
                frames += 1
    return frames


def main():
    parser = argparse.ArgumentParser(prog="flight.py", description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT")
    parser.add_argument("--seconds", type=float, default=150)
    parser.add_argument("--rate", type=float, default=5, metavar="HZ", help="of GLOBAL_POSITION_INT")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--native", action="store_true", help="OPEN_DRONE_ID_* messages too")
    arguments = parser.parse_args()
    try:
        frames = write_flight(arguments.out, arguments.seconds, arguments.rate, arguments.seed, int(arguments.native))
    except (OSError, ValueError) as error:
        parser.error(str(error))
    print(f"{arguments.out}: {frames} frames, {arguments.seconds:g} s")


if __name__ == "__main__":
    sys.exit(main())
