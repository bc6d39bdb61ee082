"""How often things were heard: two kinds of interval, kept apart.

*Reception interval*: between receptions of any valid message of a type,
repetitions included.  *Content interval*: between receptions of a newer content.
A radio goes on repeating a dead program's last payload, so only the content
interval shows a fault.  What hasn't ended when the run ends counts as well.

Limits: Location at least once a second, its data at most 1 s old (2nd); Basic
ID, System, Operator ID and Self ID every 3 s (2nd).
"""

from __future__ import annotations

import bisect
import math
import random
import statistics
from dataclasses import dataclass, replace

from .messages import STATUS_SYSTEM_FAILURE, TYPE_NAMES
from .receptions import Reception
from .tracks import Track

LOCATION_LIMIT_S = 1.0
OTHER_LIMIT_S = 3.0
STATUS_FAILURE_DUE_S = 3.5  # 3 s without a new position, and half a second of tolerance
RANDOM_STARTS = 2000


@dataclass(slots=True)
class Interval:
    channel: str
    message: str
    kind: str  # reception or content
    start: Reception
    seconds: float
    ended: bool  # False: the run ended first
    excused: str | None = None

    @property
    def end_mono(self) -> float:
        return self.start.mono + self.seconds


def limit_s(message: str, kind: str = "reception") -> float | None:
    if message == "location":
        return LOCATION_LIMIT_S
    return OTHER_LIMIT_S if kind == "reception" and message != "authentication" else None


def percentile(values: list[float], share: float) -> float:
    """Nearest rank: the smallest value that at least `share` of all don't exceed."""
    ordered = sorted(values)
    return ordered[max(0, math.ceil(share * len(ordered)) - 1)]


def _between(channel: str, message: str, kind: str, receptions: list[Reception], end_mono: float,
             warmup_until: float) -> list[Interval]:
    found = [Interval(channel, message, kind, before, after.mono - before.mono, True)
             for before, after in zip(receptions, receptions[1:]) if before.mono >= warmup_until]
    if receptions:
        last = Interval(channel, message, kind, receptions[-1], max(0.0, end_mono - receptions[-1].mono), False)
        # A short rest of the run is no interval; one above the mean already is.
        if last.seconds > statistics.fmean(i.seconds for i in found) if found else last.seconds > 0:
            found.append(last)
    return found


def track_intervals(track: Track, end_mono: float, warmup_s: float, excuse) -> list[Interval]:
    """All intervals of a track.  `excuse(track, interval) -> str | None` says why
    a content interval isn't the transmitter's fault."""
    warmup_until = track.heard[0].reception.mono + warmup_s if track.heard else 0.0
    found: list[Interval] = []
    for name in TYPE_NAMES.values():
        receptions = [heard.reception for heard, _ in track.of_type(name)]
        found += _between(track.channel, name, "reception", receptions, end_mono, warmup_until)
    newer = [heard.reception for heard, _ in track.newer_locations()]
    for interval in _between(track.channel, "location", "content", newer, end_mono, warmup_until):
        if interval.seconds > LOCATION_LIMIT_S:
            interval = replace(interval, excused=excuse(track, interval))
        found.append(interval)
    found += _between(track.channel, "system", "content", _changes(track, "system"), end_mono, warmup_until)
    return found


def _changes(track: Track, name: str) -> list[Reception]:
    receptions, last = [], None
    for heard, message in track.of_type(name):
        if message.raw != last:
            receptions.append(heard.reception)
        last = message.raw
    return receptions


def status_failure_excuse(track: Track, interval: Interval) -> str | None:
    """The transmitter itself says so: Location's status is "remote ID system
    failure" from 3 s (and a tolerance) into the gap until its end."""
    inside = [(heard.reception.mono - interval.start.mono, location.status)
              for heard, location in track.of_type("location")
              if interval.start.mono < heard.reception.mono < interval.end_mono]
    if interval.seconds <= STATUS_FAILURE_DUE_S:
        return "status 4" if inside and inside[-1][1] == STATUS_SYSTEM_FAILURE else None
    late = [status for into_s, status in inside if into_s > STATUS_FAILURE_DUE_S]
    return "status 4" if late and all(status == STATUS_SYSTEM_FAILURE for status in late) else None


def all_within_s(tracks: list[Track], expected: list[str], seed: int) -> list[float] | None:
    """From random instants on, how long until every expected message was heard;
    None when one never was."""
    times = [sorted(heard.reception.mono for track in tracks for heard, _ in track.of_type(name))
             for name in expected]
    if not times or not all(times):
        return None
    first, last = min(t[0] for t in times), min(t[-1] for t in times)
    source = random.Random(seed)
    starts = [source.uniform(first, last) for _ in range(RANDOM_STARTS)]
    return [max(t[bisect.bisect_left(t, start)] for t in times) - start for start in starts]
