"""What is done to a flight: whom it takes off the air, for how long, and how soon everything is there again."""

from collections import namedtuple
from collections.abc import Callable
from dataclasses import dataclass

BLUETOOTH, WIFI, ALL = ("bt4", "bt5"), ("wifi",), ("bt4", "bt5", "wifi")
FOREIGN_DISABLE, FOREIGN_RESET = (0x2039, bytes(2)), (0x0C03, b"")

# Of a channel, in seconds of the flight: from when to when it was taken away, and what it may cost after that.
Window = namedtuple("Window", "channel begin_s back_s limit_s")


@dataclass(frozen=True)
class Fault:
    """limit_s: without a newer position after it is over, on a machine that isn't late."""
    name: str
    channels: tuple
    limit_s: float
    begin: Callable
    end: Callable | None = None  # None: it is over at once


def legacy_or_not(flight):
    return FOREIGN_DISABLE if flight.controller.mode == "full" else (0x200A, bytes(1))


def plug_in_controller(flight):
    flight.controller.reset()
    flight.controller.device.plug_in()


FAULTS = (
    Fault("foreign_disable", BLUETOOTH, 0.45, lambda flight: flight.controller.command(*legacy_or_not(flight))),
    Fault("foreign_reset", BLUETOOTH, 0.45, lambda flight: flight.controller.command(*FOREIGN_RESET)),
    Fault("controller_unplugged", BLUETOOTH, 1.5, lambda flight: flight.controller.device.unplug(), plug_in_controller),
    Fault("controller_hangs", BLUETOOTH, 2.5, lambda flight: setattr(flight.controller, "hangs", True),
          lambda flight: setattr(flight.controller, "hangs", False)),
    Fault("hostapd_killed", WIFI, 1.5, lambda flight: flight.hostapd.kill(), lambda flight: flight.hostapd.start()),
    Fault("hostapd_mute", WIFI, 2.5, lambda flight: flight.hostapd.order("mute"),
          lambda flight: flight.hostapd.order("unmute")),
    Fault("hostapd_disabled", WIFI, 1.5, lambda flight: flight.hostapd.order("disabled"),
          lambda flight: flight.hostapd.order("enabled")),
    Fault("hostapd_forgets", WIFI, 0.45, lambda flight: flight.hostapd.order("forget")),
    Fault("autopilot_unplugged", ALL, 1.6, lambda flight: flight.autopilot.device.unplug(),
          lambda flight: flight.autopilot.device.plug_in()),
    Fault("autopilot_silent", ALL, 0.7, lambda flight: setattr(flight.autopilot, "silent", True),
          lambda flight: setattr(flight.autopilot, "silent", False)),
)
