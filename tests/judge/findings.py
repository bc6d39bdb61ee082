"""Collects what a run is accused of: violations, which decide the verdict, and
notes, which don't.

Some rules are about when something was heard. They say something of the transmitter
only where the machine that runs transmitter and listener had nothing else to do;
`timing=False` counts what breaks them, and leaves the verdict to all the others.
"""

from __future__ import annotations

from dataclasses import dataclass

LISTED_OF_A_KIND = 20
ABOUT_TIME = frozenset({
    "interval.reception", "interval.content", "limit", "counter.lost", "set.unheard", "location.age",
    "played.unknown", "played.stale", "played.status", "played.time_unknown"})


@dataclass(frozen=True)
class Violation:
    kind: str  # dotted, for example "counter.missing"
    time: float | None  # Unix seconds of the reception it was seen at
    mono: float | None
    channel: str | None
    what: str
    expected: str
    found: str


class Findings:
    def __init__(self, timing: bool = True, listed: float = LISTED_OF_A_KIND) -> None:
        self.timing, self.listed = timing, listed
        self.not_judged: dict[str, int] = {}
        self.violations: list[Violation] = []  # at most `listed` of each kind
        self.counts: dict[str, int] = {}
        self.notes: list[str] = []
        self._noted: set[str] = set()

    def violation(self, kind: str, at, what: str, expected, found, channel: str | None = None) -> None:
        """`at` is the Reception, a pair (time, mono), or None for the whole run."""
        if not self.timing and kind in ABOUT_TIME:
            self.not_judged[kind] = self.not_judged.get(kind, 0) + 1
            return
        time_s = mono_s = None
        if isinstance(at, tuple):
            time_s, mono_s = at
        elif at is not None:
            time_s, mono_s, channel = at.time, at.mono, channel or at.channel
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if self.counts[kind] <= self.listed:
            self.violations.append(Violation(kind, time_s, mono_s, channel, what, str(expected), str(found)))

    def note(self, text: str) -> None:
        """Said once, however often it is seen."""
        if text not in self._noted:
            self._noted.add(text)
            self.notes.append(text)

    @property
    def total(self) -> int:
        return sum(self.counts.values())
