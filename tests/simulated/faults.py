"""What is done to a flight: whom it takes off the air, for how long, and how soon everything is there again."""

from __future__ import annotations

import math
from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass

from bench.attacker import ARMED, CRAFTED, Speaker

from . import rfkill
from .controller import DISALLOWED, SET_DATA, SET_EXTENDED_DATA

BLUETOOTH, WIFI, ALL = ("bt4", "bt5"), ("wifi",), ("bt4", "bt5", "wifi")
FOREIGN_DISABLE, FOREIGN_RESET = (0x2039, bytes(2)), (0x0C03, b"")


@dataclass(frozen=True)
class Fault:
    """limit_s: without a newer position after it is over, on a machine that isn't late."""
    name: str
    channels: tuple
    limit_s: float
    begin: Callable
    end: Callable | None = None  # None: it is over at once
    longest_s: float = math.inf  # then it is over by itself
    kept: bool = False  # needs odid-keeper and the others
    no_position: bool = False  # the daemon is there, and has none
    meanwhile_s: float = math.inf  # while it lasts: without a newer position
    begun_s: float = 0.0  # after its end, where a daemon begins meanwhile
    known_s: float = 0.0  # after its end: only then is it known
    told: bool = False  # takes nothing away, but is told to the pilot; limit_s: and no longer than that after its end

    @property
    def part(self):
        """What it is done to: of two at once each is done to another one."""
        return "programs" if self.kept else {BLUETOOTH: "chip", WIFI: "hostapd"}.get(self.channels, "autopilot")

    @property
    def restarts(self):
        """The daemon may be another one afterwards."""
        return self.kept and bool(self.channels)


class Window(namedtuple("Window", "channel begin_s back_s fault")):
    """Of a channel, in seconds of the flight: from when to when that fault took it away. None: of no channel, but it was told."""
    __slots__ = ()

    def lasts(self, since_s, until_s=None, longer_s=0.0):
        """At that instant, or in a part of that time: until everything must be there again."""
        return self.begin_s <= (since_s if until_s is None else until_s) and since_s <= self.back_s + self.fault.limit_s + longer_s


def legacy_or_not(flight):
    return FOREIGN_DISABLE if flight.controller.mode == "full" else (0x200A, bytes(1))


def slow(model, answers_us):
    """(begin, end): it takes its time for each answer."""
    return (lambda flight: setattr(getattr(flight, model), "answers_us", answers_us),
            lambda flight: setattr(getattr(flight, model), "answers_us", ANSWERS_US[model]))


def switched_off(radio):
    """(begin, end): by a switch, which no program undoes."""
    return lambda flight: flight.switches.block(radio, True), lambda flight: flight.switches.unblock(radio, True)


def refuse_data(flight):
    flight.controller.refused |= {SET_DATA: DISALLOWED, SET_EXTENDED_DATA: DISALLOWED}


def lose_gnss(message):
    """As ArduPilot says it: its native LOCATION goes on with the last accuracy, and has no time."""
    if message.get_type() in ("GPS_RAW_INT", "GPS2_RAW"):
        message.fix_type = 1
    elif message.get_type() == "OPEN_DRONE_ID_LOCATION":
        message.timestamp = 65535


def keep_saying(flight, until_us, every_us, say):
    if flight.world.now_us < until_us:
        say()
        flight.world.after(every_us, keep_saying, flight, until_us, every_us, say)


def for_5_s(every_us, say):
    """say(flight), again and again."""
    return lambda flight: keep_saying(flight, flight.world.now_us + 5_000_000, every_us, lambda: say(flight))


def as_autopilot(system_id):
    """It says that it is armed, and where nobody flies."""
    speaker = Speaker(system_id, 1)

    def say(flight):
        flight.autopilot.device.send(speaker.heartbeat(ARMED))
        flight.autopilot.device.send(speaker.position(flight.autopilot.boot_ms() + 200))
    return say


def say_crafted(flight):
    flight.autopilot.device.send(7 * CRAFTED)


def hang(flight):
    flight.world.called("odid-daemon").hangs = True


def go_on(flight):
    daemon = flight.world.called("odid-daemon")  # perhaps another one by now
    if daemon.hangs:
        flight.world.go_on(daemon)


def set_clock(flight):
    flight.world.realtime_us += flight.world.chance.choice((-1, 1)) * flight.world.chance.randint(2, 10**8) * 1_000_000


ANSWERS_US = {"controller": (1_000, 8_000), "hostapd": (2_000, 8_000)}
FAULTS = (
    Fault("foreign_disable", BLUETOOTH, 0.45, lambda flight: flight.controller.command(*legacy_or_not(flight))),
    Fault("foreign_reset", BLUETOOTH, 0.5, lambda flight: flight.controller.command(*FOREIGN_RESET)),
    Fault("controller_unplugged", BLUETOOTH, 1.5, lambda flight: flight.unplug_controller(),
          lambda flight: flight.plug_in_controller()),
    # Its driver may just be bound anew when it is over.
    Fault("controller_hangs", BLUETOOTH, 3.5, lambda flight: setattr(flight.controller, "hangs", True),
          lambda flight: setattr(flight.controller, "hangs", False)),
    Fault("controller_hangs_until_reset", BLUETOOTH, 2.5, lambda flight: flight.controller.hang_until("reset")),
    Fault("controller_hangs_until_bound_anew", BLUETOOTH, 6.0, lambda flight: flight.controller.hang_until("power")),
    Fault("controller_resets_silently", BLUETOOTH, 1.6, lambda flight: flight.controller.reset()),
    Fault("controller_loses_an_event", BLUETOOTH, 2.5, lambda flight: setattr(flight.controller, "lost_events", 1)),
    Fault("controller_refuses_data", BLUETOOTH, 0.9, refuse_data),
    Fault("controller_slow", BLUETOOTH, 0.9, *slow("controller", (20_000, 120_000)), meanwhile_s=2.0),
    Fault("bluetooth_soft_blocked", BLUETOOTH, 1.5, lambda flight: flight.switches.block(rfkill.BLUETOOTH)),
    Fault("bluetooth_switched_off", BLUETOOTH, 1.5, *switched_off(rfkill.BLUETOOTH)),
    Fault("wifi_soft_blocked", WIFI, 1.5, lambda flight: flight.switches.block(rfkill.WIFI)),
    Fault("wifi_switched_off", WIFI, 1.5, *switched_off(rfkill.WIFI)),
    Fault("hostapd_slow", WIFI, 0.9, *slow("hostapd", (100_000, 400_000)), meanwhile_s=2.0),
    Fault("hostapd_killed", WIFI, 1.5, lambda flight: flight.hostapd.kill(), lambda flight: flight.hostapd.start()),
    Fault("hostapd_mute", WIFI, 2.5, lambda flight: flight.hostapd.order("mute"),
          lambda flight: flight.hostapd.order("unmute")),
    Fault("hostapd_disabled", WIFI, 1.5, lambda flight: flight.hostapd.order("disabled"),
          lambda flight: flight.hostapd.order("enabled")),
    Fault("hostapd_refuses", WIFI, 1.5, lambda flight: flight.hostapd.order("fail", "2")),
    # It may just be switched off and on when it is over.
    Fault("wifi_chip_silent", WIFI, 2.5, lambda flight: flight.hostapd.order("silence"),
          lambda flight: flight.hostapd.order("speak"), known_s=1.0),
    Fault("hostapd_forgets", WIFI, 0.45, lambda flight: flight.hostapd.order("forget")),
    Fault("autopilot_unplugged", ALL, 2.1, lambda flight: flight.autopilot.device.unplug(),
          lambda flight: flight.autopilot.device.plug_in(), no_position=True),
    Fault("autopilot_silent", ALL, 1.2, lambda flight: setattr(flight.autopilot, "silent", True),
          lambda flight: setattr(flight.autopilot, "silent", False), no_position=True),
    Fault("autopilot_restarts", ALL, 2.1, lambda flight: setattr(flight.autopilot, "silent", True),
          lambda flight: flight.autopilot.start_again(), no_position=True),
    # A daemon takes no place before 1.5 s have passed since it was told that there is no fix.
    Fault("gnss_lost", ALL, 1.2, lambda flight: setattr(flight.autopilot, "rewrite", lose_gnss),
          lambda flight: setattr(flight.autopilot, "rewrite", None), no_position=True, begun_s=1.95),
    Fault("another_vehicle", (), 0.0, for_5_s(100_000, as_autopilot(7))),
    Fault("forged_autopilot", (), 67.0, for_5_s(100_000, as_autopilot(1)), told=True),
    Fault("crafted_frames", (), 0.0, for_5_s(20_000, say_crafted)),
    Fault("daemon_killed", ALL, 0.9, lambda flight: flight.world.kill(flight.world.called("odid-daemon")), kept=True),
    Fault("daemon_hangs", ALL, 0.9, hang, go_on, longest_s=3.0, kept=True),
    Fault("keeper_killed", ALL, 1.9, lambda flight: flight.kill_service("odid-keeper"), kept=True),
    Fault("recorder_killed", (), 0.0, lambda flight: flight.kill_service("odid-recorder"), kept=True),
    Fault("clock_set", (), 0.0, set_clock, kept=True),
)
BY_NAME = {fault.name: fault for fault in FAULTS}
