"""What one transmitter said on one channel, in the order in which it was heard."""

from __future__ import annotations

from dataclasses import dataclass, field

from .messages import Location, Message
from .receptions import Reception


@dataclass(frozen=True)
class Heard:
    """A reception that holds valid messages."""
    reception: Reception
    counter: int
    body: bytes  # message or pack
    messages: tuple[Message, ...]


@dataclass
class Track:
    """Receivers key an aircraft by the transmitter's address."""
    channel: str
    address: str
    heard: list[Heard] = field(default_factory=list)

    def of_type(self, name: str):
        """(heard, message) of one message type."""
        for heard in self.heard:
            for message in heard.messages:
                if message.type_name == name:
                    yield heard, message

    def newer_locations(self) -> list[tuple[Heard, Location]]:
        """The receptions that brought a newer Location than all before them."""
        newer: list[tuple[Heard, Location]] = []
        for heard, location in self.of_type("location"):
            if not newer or is_newer(newer[-1][1], location):
                newer.append((heard, location))
        return newer


def hour_difference_s(later_s: float, earlier_s: float) -> float:
    """Difference of two Location timestamps, which start again at every full hour."""
    return (later_s - earlier_s + 1800.0) % 3600.0 - 1800.0


def is_newer(before: Location, now: Location) -> bool:
    """A newer content: something measured moved, and the timestamp not backward.
    (The status alone can change without a new position.)"""
    if now.content == before.content:
        return False
    if now.timestamp_s is None or before.timestamp_s is None:
        return True
    return hour_difference_s(now.timestamp_s, before.timestamp_s) >= 0


def went_backward(before: Location, now: Location) -> bool:
    return (now.timestamp_s is not None and before.timestamp_s is not None
            and hour_difference_s(now.timestamp_s, before.timestamp_s) < 0)
