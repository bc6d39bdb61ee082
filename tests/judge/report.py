"""The conformance report: text, and figures.json."""

from __future__ import annotations

import json
import subprocess
import time
from pathlib import Path

from .conformance import Judgement, Options
from .findings import LISTED_OF_A_KIND, Violation
from .intervals import limit_s
from .messages import TYPE_NAMES
from .receptions import CHANNELS, Run

_COLUMNS = ("mean", "p50", "p99", "max")


def commit() -> str:
    """The commit of the tree that holds this package, or "unknown" outside of one."""
    try:
        answer = subprocess.run(["git", "-C", str(Path(__file__).parent), "rev-parse", "--short", "HEAD"],
                                capture_output=True, text=True, check=False)
    except OSError:
        return "unknown"
    return answer.stdout.strip() if answer.returncode == 0 else "unknown"


def complete_figures(judgement: Judgement) -> dict:
    return {"commit": commit(), "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
            **judgement.figures, "not_judged": sum(judgement.findings.not_judged.values()),
            "violations": judgement.findings.total, "verdict": judgement.verdict}


def write_figures(judgement: Judgement, folder: Path) -> None:
    (folder / "figures.json").write_text(json.dumps(complete_figures(judgement), indent=1) + "\n")


def report_text(judgement: Judgement, run: Run, options: Options, title: str) -> str:
    duration_s = (run.end_mono - run.start_mono) if run.start_mono is not None else 0.0
    lines = [title, "=" * len(title), ""]
    if run.receptions:
        lines.append(f"First reception {_clock(run.receptions[0].time, True)} UTC; {duration_s:.1f} s, "
                     f"{len(run.receptions)} receptions.")
    lines += [f"Source: {source}" for source in run.sources]
    lines += [""] + _interval_table(judgement) + [""] + _other_figures(judgement)
    notes = run.notes + judgement.findings.notes
    if options.lossy:
        notes = ["receptions were dropped on purpose: intervals and lost payloads are judged by --limit only"] + notes
    if notes:
        lines += ["", "Notes"] + [f"  {note}" for note in notes]
    lines += [""] + _violation_lines(judgement, run) + _not_judged_lines(judgement) + ["", judgement.verdict]
    return "\n".join(lines) + "\n"


def brief_text(judgement: Judgement, run: Run) -> str:
    """What most people want to know; the report has the rest."""
    lines = [f"{'':6}{'heard':>7}   {'a Location every':^22}   {'a newer one every':^22}   each other message",
             f"{'':16}{'mean / p99 / max, s':^22}   {'mean / p99 / max, s':^22}   every (max, s)"]
    figures = judgement.figures
    for channel in CHANNELS:
        count = max((figures.get(f"{channel}_{name}_reception_count") or 0 for name in TYPE_NAMES.values()), default=0)
        if not count:
            continue
        blocks = [" / ".join("-" if figures.get(f"{channel}_location_{kind}_{column}_s") is None
                             else f"{figures[f'{channel}_location_{kind}_{column}_s']:.2f}"
                             for column in ("mean", "p99", "max")) for kind in ("reception", "content")]
        others = [figures[name] for message in TYPE_NAMES.values() if message != "location"
                  and figures.get(name := f"{channel}_{message}_reception_max_s") is not None]
        lines.append(f"{channel:6}{figures.get(f'{channel}_location_reception_count', 0):7}   {blocks[0]:^22}   "
                     f"{blocks[1]:^22}   " + (f"{max(others):.2f}" if others else "-"))
    lines = lines if len(lines) > 2 else ["Nothing was heard."]
    return "\n".join(lines + [f"limit{'':11}{limit_s('location'):^22g}   {limit_s('location'):^22g}   "
                              f"{limit_s('basic_id'):g}", ""] + _violation_lines(judgement, run, 2)) + "\n"


def _interval_table(judgement: Judgement) -> list[str]:
    head = f"{'channel':8}{'message':16}{'heard':>7}   {'reception interval (s)':^31}   {'content interval (s)':^31}"
    sub = f"{'':8}{'':16}{'':>7}   " + "   ".join("".join(f"{c:>7}" for c in _COLUMNS) + "   " for _ in range(2))
    lines = [head, sub]
    for channel in CHANNELS:
        for name in TYPE_NAMES.values():
            count = judgement.figures.get(f"{channel}_{name}_reception_count")
            if not count:
                continue
            blocks = []
            for kind in ("reception", "content"):
                values = [judgement.figures.get(f"{channel}_{name}_{kind}_{column}_s") for column in _COLUMNS]
                blocks.append("".join(f"{'-' if v is None else f'{v:.3f}':>7}" for v in values) + "   ")
            limit = limit_s(name)
            lines.append(f"{channel:8}{name:16}{count:7}   " + "   ".join(blocks)
                         + (f"limit {limit:g} s (2nd)" if limit else ""))
    return lines if len(lines) > 2 else ["Nothing was heard."]


def _other_figures(judgement: Judgement) -> list[str]:
    shown = [(name, value) for name, value in judgement.figures.items()
             if "_reception_" not in name and "_content_" not in name]
    return [f"{name:38}{value:g}" for name, value in shown]


def _clock(unix_s: float, with_date: bool = False) -> str:
    pattern = "%Y-%m-%d %H:%M:%S" if with_date else "%H:%M:%S"
    return time.strftime(pattern, time.gmtime(unix_s)) + f"{unix_s % 1:.3f}"[1:]


def _when(violation: Violation, run: Run) -> str:
    into_s = (f" (+{violation.mono - run.start_mono:.3f} s)"
              if violation.mono is not None and run.start_mono is not None else "")
    if violation.time is not None:
        return _clock(violation.time) + into_s
    return "--:--:--.---" + into_s if into_s else "whole run"


def _not_judged_lines(judgement: Judgement) -> list[str]:
    findings = judgement.findings
    if findings.timing:
        return []
    over = ", ".join(f"[{kind}] {count}" for kind, count in sorted(findings.not_judged.items()))
    return ["", "What is about time is shown above and was not judged"
            + (f"; beyond its limits was: {over}" if over else "; nothing was beyond its limits")]


def _violation_lines(judgement: Judgement, run: Run, listed: int = LISTED_OF_A_KIND) -> list[str]:
    findings = judgement.findings
    if not findings.total:
        return ["No violation."]
    lines = [f"{findings.total} violation{'s' if findings.total > 1 else ''}"]
    for kind in sorted(findings.counts):
        count = findings.counts[kind]
        lines.append(f"  [{kind}] {count}" + (f", the first {listed}:" if count > listed else ""))
        lines += [f"    {_when(violation, run)}  {violation.channel or '-':5} {violation.what}; "
                  f"expected {violation.expected}, found {violation.found}"
                  for violation in findings.violations if violation.kind == kind][:listed]
    return lines
