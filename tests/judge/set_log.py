"""Was everything heard that was set on the controller?

The log has one JSON object per advertising data command that was given while
advertising: `mono`, `opcode`, `data` (hexadecimal), `channel`.  A payload that
is overwritten within an advertising interval never reaches the air, whatever
the host's log says.
"""

from __future__ import annotations

import bisect
from dataclasses import dataclass
from pathlib import Path

from .findings import Findings
from .receptions import InputError, Run, read_json_lines

LAST_PART_S = 0.3  # what is set this late in a run may be heard after it
EARLY_S = 0.02  # the host's stamp against the controller's action
LATE_S = 0.3  # reception of a payload that was overwritten: event in flight, scanner's delay


@dataclass
class SetPayload:
    mono: float
    data: bytes
    superseded_mono: float | None = None


def read_set_log(path: Path) -> dict[str, list[SetPayload]]:
    """By channel; consecutive identical payloads are one."""
    log: dict[str, list[SetPayload]] = {}
    for number, record in read_json_lines(path):
        if "data" not in record:
            continue
        try:
            add_payload(log, record["channel"], float(record["mono"]), bytes.fromhex(record["data"]))
        except (KeyError, ValueError, TypeError) as error:
            raise InputError(f"{path}:{number}: expected mono, channel and data in hexadecimal: {error}") from error
    return log


def add_payload(log: dict[str, list[SetPayload]], channel: str, mono: float, data: bytes) -> None:
    rows = log.setdefault(channel, [])
    if rows and rows[-1].data == data:
        return
    if rows:
        rows[-1].superseded_mono = mono
    rows.append(SetPayload(mono, data))


def check_set_log(log: dict[str, list[SetPayload]], run: Run, findings: Findings, judge: bool) -> dict[str, int]:
    """Figures `<channel>_payloads_set` and `_heard`; a missing payload is a violation if `judge`."""
    figures = {}
    for channel, rows in log.items():
        times: dict[bytes, list[float]] = {}
        for reception in run.receptions:
            if reception.channel == channel and not reception.damaged:
                bisect.insort(times.setdefault(reception.raw, []), reception.mono)
        counted = [row for row in rows if run.start_mono is not None
                   and run.start_mono <= row.mono <= run.end_mono - LAST_PART_S]
        heard = 0
        for row in counted:
            until = float("inf") if row.superseded_mono is None else row.superseded_mono + LATE_S
            heard_at = times.get(row.data, [])
            first = bisect.bisect_left(heard_at, row.mono - EARLY_S)
            if first < len(heard_at) and heard_at[first] <= until:
                heard += 1
            elif judge:
                kept = f"{until - LATE_S - row.mono:.3f} s" if row.superseded_mono else "to the end"
                findings.violation("set.unheard", (None, row.mono), f"a payload that was set was never heard "
                                   f"(set for {kept})", row.data.hex(), "not heard", channel)
        figures[f"{channel}_payloads_set"] = len(counted)
        figures[f"{channel}_payloads_heard"] = heard
    return figures
