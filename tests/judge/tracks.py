"""What one transmitter said on one channel, in the order in which it was heard."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from .messages import Location, Message
from .receptions import Reception


class Heard(NamedTuple):
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
    _of_type: dict[str, list[tuple[Heard, Message]]] = field(default_factory=dict)
    _newer: list[tuple[Heard, Location]] = field(default_factory=list)

    def add(self, heard: Heard) -> None:
        self.heard.append(heard)
        for message in heard.messages:
            self._of_type.setdefault(message.type_name, []).append((heard, message))
            if isinstance(message, Location) and (not self._newer or is_newer(self._newer[-1][1], message)):
                self._newer.append((heard, message))

    def of_type(self, name: str) -> list[tuple[Heard, Message]]:
        return self._of_type.get(name, [])

    def newer_locations(self) -> list[tuple[Heard, Location]]:
        """The receptions that brought a newer Location than all before them."""
        return self._newer


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
