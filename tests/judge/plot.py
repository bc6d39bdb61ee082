"""One page: every interval over time, per channel, with the limits drawn."""

from __future__ import annotations

from pathlib import Path

from .conformance import Judgement, Options, tightest_limit_s
from .intervals import LOCATION_LIMIT_S, OTHER_LIMIT_S, Interval
from .messages import TYPE_NAMES
from .receptions import CHANNELS, Run

COLOURS = dict.fromkeys(TYPE_NAMES.values(), "#7f7f7f") | {
    "location": "#0b6e8f", "basic_id": "#c8553d", "system": "#6a994e", "operator_id": "#8e5ea2", "self_id": "#e0a030"}
CHANNEL_NAMES = {"bt4": "Bluetooth 4 legacy", "bt5": "Bluetooth 5 Long Range", "wifi": "Wi-Fi beacon"}


def write_plot(judgement: Judgement, run: Run, options: Options, title: str, path: Path) -> None:
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    channels = [c for c in CHANNELS if any(i.channel == c for i in judgement.intervals)] or [None]
    figure, axes = plt.subplots(len(channels), 2, figsize=(13, 1.6 + 3.1 * len(channels)), squeeze=False,
                                sharex=True, layout="constrained")
    for row, channel in zip(axes, channels):
        if channel is None:
            for axis in row:
                axis.text(0.5, 0.5, "nothing was heard", transform=axis.transAxes, ha="center")
            break
        own = [i for i in judgement.intervals if i.channel == channel]
        _draw_location(row[0], [i for i in own if i.message == "location"], run, options, channel)
        _draw_others(row[1], [i for i in own if i.message != "location" and i.kind == "reception"], run, options,
                     channel)
    for axis in axes[-1]:
        axis.set_xlabel("time since the run began (s)")
    verdict_colour = "#2e7d32" if judgement.verdict == "PASS" else "#b3261e"
    count = judgement.findings.total
    figure.suptitle(f"{title}  –  {judgement.verdict}" + (f", {count} violations" if count else ""),
                    color=verdict_colour, fontsize=14, fontweight="bold")
    figure.savefig(path, dpi=110)
    plt.close(figure)


def _points(intervals: list[Interval], run: Run) -> tuple[list[float], list[float]]:
    return [i.end_mono - run.start_mono for i in intervals], [i.seconds for i in intervals]


def _decorate(axis, title: str) -> None:
    axis.set_title(title, loc="left", fontsize=11)
    axis.set_ylabel("interval (s)")
    axis.set_ylim(bottom=0)
    axis.margins(x=0.01)
    axis.grid(alpha=0.25)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _line(axis, value: float, label: str, colour: str, style: str) -> None:
    axis.axhline(value, color=colour, linestyle=style, linewidth=1.2, label=label)


def _draw_location(axis, intervals: list[Interval], run: Run, options: Options, channel: str) -> None:
    for kind, colour, marker in (("content", "#e07a1f", "o"), ("reception", COLOURS["location"], ".")):
        chosen = [i for i in intervals if i.kind == kind]
        excused = [i for i in chosen if i.excused]
        axis.plot(*_points([i for i in chosen if not i.excused], run), marker, color=colour, markersize=3.5,
                  alpha=0.75, label=f"{kind} interval", zorder=3 if kind == "reception" else 2)
        if excused:
            axis.plot(*_points(excused, run), marker, color=colour, markersize=6, markerfacecolor="none",
                      label=f"{kind}, excused: {excused[0].excused}")
        limit = tightest_limit_s(options.limits, channel, "location", kind)
        if limit is not None:
            _line(axis, limit, f"--limit, {kind}: {limit:g} s", colour, ":")
    _line(axis, LOCATION_LIMIT_S, f"standard: {LOCATION_LIMIT_S:g} s (2nd)", "#b3261e", "--")
    _decorate(axis, f"{CHANNEL_NAMES[channel]}: Location")


def _draw_others(axis, intervals: list[Interval], run: Run, options: Options, channel: str) -> None:
    limits = []
    for name, colour in COLOURS.items():
        if name == "location":
            continue
        chosen = [i for i in intervals if i.message == name]
        if chosen:
            axis.plot(*_points(chosen, run), ".", color=colour, markersize=4, alpha=0.75, label=name.replace("_", " "))
        limit = tightest_limit_s(options.limits, channel, name, "reception")
        if limit is not None:
            limits.append(limit)
    if limits:
        _line(axis, min(limits), f"--limit: {min(limits):g} s", "#555555", ":")
    _line(axis, OTHER_LIMIT_S, f"standard: {OTHER_LIMIT_S:g} s (2nd)", "#b3261e", "--")
    _decorate(axis, f"{CHANNEL_NAMES[channel]}: other messages, reception")
