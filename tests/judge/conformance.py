"""The judge: applies every rule to a run, and makes its figures and its verdict."""

from __future__ import annotations

import statistics
from dataclasses import dataclass, field

from .counters import check_counters
from .findings import LISTED_OF_A_KIND, Findings
from .flight_log import FlightLog
from .intervals import (Interval, all_within_s, limit_s, percentile, status_failure_excuse,
                        track_intervals)
from .messages import TYPE_NAMES
from .plausibility import check_plausibility
from .played import Comparison, compare, log_excuse
from .ranges import check_ranges
from .receptions import CHANNELS, Run
from .set_log import SetPayload, check_set_log
from .structure import check_structure
from .tracks import Heard, Track

ALL_FIVE = ("basic_id", "location", "system", "operator_id", "self_id")


@dataclass
class Options:
    expect_channels: tuple[str, ...] = ()
    expect_messages: tuple[str, ...] = ALL_FIVE
    limits: dict[str, float] = field(default_factory=dict)
    addresses: frozenset[str] = frozenset()
    any_version: bool = False
    timing: bool = True  # False: what depends on when something was heard isn't judged (findings.py)
    lossy: bool = False  # receptions are dropped on purpose: intervals and losses aren't the transmitter's
    lost_margin: int = 0
    warmup_s: float = 0.0
    seed: int = 1
    listed: float = LISTED_OF_A_KIND  # violations of each kind


@dataclass
class Judgement:
    findings: Findings
    figures: dict
    tracks: list[Track]
    intervals: list[Interval]

    @property
    def verdict(self) -> str:
        return "FAIL" if self.findings.total else "PASS"


def judge(run: Run, options: Options, log: FlightLog | None = None,
          set_log: dict[str, list[SetPayload]] | None = None) -> Judgement:
    findings, figures = Findings(options.timing, options.listed), {}
    tracks = _listen(run, findings, options.any_version)
    _check_presence(run, tracks, options, findings)
    _check_addresses(run, options, findings)
    lost: dict[str, int] = {}
    for track in tracks:
        judge_lost = track.channel == "bt4" and not options.lossy
        lost[track.channel] = lost.get(track.channel, 0) + check_counters(
            track, findings, judge_lost, options.lost_margin)
        check_plausibility(track, findings, has_log=log is not None)
    figures.update({f"{channel}_lost_payloads": count for channel, count in lost.items()})
    excuse = status_failure_excuse
    if log is not None:
        comparison = compare(tracks, log, findings)
        excuse = log_excuse(log, comparison)
        if log.vertical_inverted:
            findings.note("the autopilot sends its vertical speed upside down: compared the right way up")
        figures.update(_age_figures(comparison))
    intervals = []
    for track in tracks:
        if track.heard:
            intervals += track_intervals(track, run.end_mono, options.warmup_s, excuse)
    if not options.lossy:
        _judge_intervals(intervals, findings)
        _judge_first_heard(tracks, options, findings)
    figures.update(_interval_figures(tracks, intervals))
    figures.update(_all_within_figures(tracks, options))
    if set_log is not None:
        figures.update(check_set_log(set_log, run, findings, judge=not options.lossy))
    _judge_limits(figures, options.limits, findings)
    return Judgement(findings, figures, tracks, intervals)


def _listen(run: Run, findings: Findings, any_version: bool) -> list[Track]:
    """Sorts valid receptions into tracks; structure and ranges are checked on the way."""
    tracks: dict[tuple[str, str], Track] = {}
    # A payload, and a message in it, is checked once, not at each repetition; again if there was something to say.
    ranged: set[bytes] = set()
    sound: dict[tuple, Heard] = {}
    for reception in run.receptions:
        if reception.damaged:
            continue
        track = tracks.setdefault((reception.channel, reception.address),
                                  Track(reception.channel, reception.address))
        shape = (reception.channel, reception.address, reception.payload, len(reception.raw), reception.phy,
                 reception.event_type, reception.wifi_channel, reception.problem)
        if known := sound.get(shape):
            heard = known._replace(reception=reception)
        else:
            before = findings.total, len(findings.notes)
            heard = check_structure(reception, findings, any_version)
            if heard is None:
                continue
            if (findings.total, len(findings.notes)) == before:
                sound[shape] = heard
        track.add(heard)
        for message in heard.messages:
            if message.raw not in ranged:
                ranged.add(message.raw)
                check_ranges(reception, message, findings)
    return [tracks[key] for key in sorted(tracks, key=lambda key: (CHANNELS.index(key[0]), key[1]))]


def _check_presence(run: Run, tracks: list[Track], options: Options, findings: Findings) -> None:
    damaged = sum(reception.damaged for reception in run.receptions)
    if damaged:
        findings.note(f"{damaged} of {len(run.receptions)} packets have a wrong CRC: recorded, not judged")
    if not any(track.heard for track in tracks):
        findings.violation("nothing", None, "nothing was heard that a Remote ID receiver could read",
                           "at least one message", f"{len(run.receptions)} receptions, none of them readable")
    for channel in options.expect_channels:
        if not any(track.channel == channel and track.heard for track in tracks):
            findings.violation("expected.channel", None, f"{channel}: expected, and nothing readable was heard on it",
                               "receptions", "none", channel)
    for channel in CHANNELS:
        types = {name for track in tracks if track.channel == channel for name in TYPE_NAMES.values()
                 if track.of_type(name)}
        for name in options.expect_messages if types else ():
            if name not in types:
                findings.violation("expected.message", None, f"{name}: expected, never heard", "receptions", "none",
                                   channel)


def _check_addresses(run: Run, options: Options, findings: Findings) -> None:
    """One address from power-on to power-off, the same for both kinds of Bluetooth;
    public, or random static (two top bits 11), never a private one."""
    seen: dict[tuple[str, str], str] = {}
    first: dict[str, str] = {}
    for reception in run.receptions:
        if reception.damaged or (reception.channel, reception.address) in seen:
            continue
        seen[reception.channel, reception.address] = reception.address
        before = first.setdefault(reception.channel, reception.address)
        if before != reception.address and reception.address not in options.addresses:
            findings.violation("address.changed", reception, "another address on this channel: a receiver lists "
                               "another aircraft (use --address when it is one)", before, reception.address)
        if reception.address_type == "random" and int(reception.address[:2], 16) >> 6 != 3:
            findings.violation("address.private", reception, "a random address that is not static",
                               "two top bits 11", reception.address)
    if "bt4" in first and "bt5" in first and first["bt4"] != first["bt5"]:
        findings.violation("address.differs", None, "Bluetooth 4 and 5 have different addresses: a phone lists two "
                           "aircraft", first["bt4"], first["bt5"], "bt5")


def _judge_intervals(intervals: list[Interval], findings: Findings) -> None:
    excused: dict[tuple[str, str], list[float]] = {}
    for interval in intervals:
        limit = limit_s(interval.message, interval.kind)
        if limit is None or interval.seconds <= limit:
            continue
        if interval.excused:
            excused.setdefault((interval.channel, interval.excused), []).append(interval.seconds)
            continue
        if interval.kind == "content":
            what = "location: no newer content" if interval.ended else \
                "location: no newer content until the end of the run (frozen payload or stale position)"
        else:
            what = f"{interval.message}: not heard" + ("" if interval.ended else " any more until the end of the run")
        findings.violation(f"interval.{interval.kind}", interval.start, what, f"within {limit:g} s",
                           f"{interval.seconds:.3f} s", interval.channel)
    for (channel, excuse), seconds in excused.items():
        findings.note(f"{channel}: {len(seconds)} times no newer Location for more than 1 s, the longest "
                      f"{max(seconds):.2f} s; excused: {excuse}")


def _judge_first_heard(tracks: list[Track], options: Options, findings: Findings) -> None:
    for track in tracks:
        if not track.heard:
            continue
        start = track.heard[0].reception.mono + options.warmup_s
        for name in options.expect_messages:
            first = next((heard.reception for heard, _ in track.of_type(name)), None)
            limit = limit_s(name)
            if first is not None and limit is not None and first.mono - start > limit:
                findings.violation("interval.reception", first, f"{name}: first heard late", f"within {limit:g} s",
                                   f"{first.mono - start:.3f} s")


def _interval_figures(tracks: list[Track], intervals: list[Interval]) -> dict:
    figures: dict = {}
    sorted_out: dict[tuple[str, str, str], list[float]] = {}
    for interval in intervals:
        sorted_out.setdefault((interval.channel, interval.message, interval.kind), []).append(interval.seconds)
    for channel in CHANNELS:
        for name in TYPE_NAMES.values():
            count = sum(len(track.of_type(name)) for track in tracks if track.channel == channel)
            if count:
                figures[f"{channel}_{name}_reception_count"] = count
            for kind in ("reception", "content"):
                seconds = sorted_out.get((channel, name, kind))
                if not seconds:
                    continue
                prefix = f"{channel}_{name}_{kind}"
                figures[f"{prefix}_mean_s"] = round(statistics.fmean(seconds), 4)
                figures[f"{prefix}_p50_s"] = round(percentile(seconds, 0.5), 4)
                figures[f"{prefix}_p99_s"] = round(percentile(seconds, 0.99), 4)
                figures[f"{prefix}_max_s"] = round(max(seconds), 4)
    return figures


def _all_within_figures(tracks: list[Track], options: Options) -> dict:
    figures = {}
    for channel in CHANNELS:
        waits = all_within_s([track for track in tracks if track.channel == channel],
                             list(options.expect_messages), options.seed)
        if waits:
            figures[f"{channel}_all_five_within_p99_s"] = round(percentile(waits, 0.99), 4)
    return figures


def _age_figures(comparison: Comparison) -> dict:
    if not comparison.ages_s:
        return {}
    ages_s = [age_s for ages_s in comparison.ages_s.values() for age_s in ages_s]
    return {"position_age_p50_s": round(percentile(ages_s, 0.5), 4),
            "position_age_p99_s": round(percentile(ages_s, 0.99), 4),
            "position_age_max_s": round(max(ages_s), 4),
            **{f"{channel}_position_age_p99_s": round(percentile(of_channel, 0.99), 4)
               for channel, of_channel in sorted(comparison.ages_s.items())},
            "position_age_beyond_interval_p99_s": round(percentile(comparison.lateness_s, 0.99), 4)}


def _judge_limits(figures: dict, limits: dict[str, float], findings: Findings) -> None:
    for name, limit in limits.items():
        if name not in figures:
            findings.violation("limit.missing", None, f"{name}: no such figure from this run", f"at most {limit:g}",
                               "missing")
        elif figures[name] > limit:
            findings.violation("limit", None, name, f"at most {limit:g}", f"{figures[name]:g}")


def tightest_limit_s(limits: dict[str, float], channel: str, message: str, kind: str) -> float | None:
    """The smallest --limit for one kind of interval (for the plot)."""
    prefix = f"{channel}_{message}_{kind}_"
    given = [value for name, value in limits.items() if name.startswith(prefix) and name.endswith("_s")]
    return min(given) if given else None



