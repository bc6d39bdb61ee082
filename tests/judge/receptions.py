"""The Reception record, and receptions.jsonl: one JSON object per reception.

Whoever has the file can recompute every figure of a report.  `run.json` beside
it holds what belongs to the run and not to one reception: when it began and
ended, so that a gap at the end isn't forgotten when the file is judged again.
"""

from __future__ import annotations

import json
import statistics
from dataclasses import dataclass, field, replace
from pathlib import Path

from .carriers import (Advertisement, Beacon, Found, has_ad_structures, remote_id_in_advertising,
                       remote_id_in_elements)

CHANNELS = ("bt4", "bt5", "wifi")


class InputError(Exception):
    """A file or source can't be used; the text says which, where and why."""


@dataclass
class Reception:
    time: float  # Unix seconds
    mono: float  # CLOCK_MONOTONIC seconds; equals `time` when a file has one clock only
    channel: str
    address: str
    payload: bytes | None  # from the application code 0x0D on
    raw: bytes  # AD structures or vendor element as heard
    phy: str | None = None
    rssi: int | None = None
    address_type: str | None = None
    event_type: str | None = None
    wifi_channel: int | None = None
    problem: str | None = None  # why there is no payload, or why receivers won't find it
    damaged: bool = False  # wrong CRC: recorded, never judged, never in a figure

    def to_json(self) -> str:
        record = {"time": round(self.time, 6), "mono": round(self.mono, 6), "channel": self.channel,
                  "address": self.address, "payload": self.payload.hex() if self.payload else None,
                  "raw": self.raw.hex(), "phy": self.phy, "rssi": self.rssi}
        for name in ("address_type", "event_type", "wifi_channel", "problem"):
            if getattr(self, name) is not None:
                record[name] = getattr(self, name)
        if self.damaged:
            record["damaged"] = True
        return json.dumps(record)


@dataclass
class Run:
    """What was listened to, and for how long (on the receptions' `mono` clock)."""
    receptions: list[Reception] = field(default_factory=list)
    start_mono: float | None = None
    end_mono: float | None = None
    sources: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def from_advertisement(time_s: float, mono_s: float, heard: Advertisement, keep: bool) -> Reception | None:
    """`keep`: record it although nothing in it looks like Remote ID, because of its
    address.  Of a damaged one at least the layout has to be intact."""
    found = remote_id_in_advertising(heard.data)
    if found is None and not (keep and (not heard.damaged or has_ad_structures(heard.data))):
        return None
    if heard.damaged:
        found = Found(None, heard.data, "wrong CRC")
    return Reception(
        time_s, mono_s, "bt5" if heard.extended else "bt4", heard.address,
        found.payload if found else None, heard.data, heard.phy, heard.rssi, heard.address_type,
        heard.event_type, problem=found.problem if found else "no Remote ID element in the advertising data",
        damaged=heard.damaged)


def from_beacon(time_s: float, mono_s: float, heard: Beacon, keep: bool) -> Reception | None:
    found = remote_id_in_elements(heard.elements)
    if found is None and not keep:
        return None
    return Reception(
        time_s, mono_s, "wifi", heard.bssid, found.payload if found else None,
        found.raw if found else heard.elements, None, heard.rssi, wifi_channel=heard.channel,
        problem=found.problem if found else "no Remote ID element in the beacon")


def read_json_lines(path: Path):
    """Yields (line number, object); a line that isn't a JSON object is an error, but
    for an unfinished last one."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text at octet {error.start}") from error
    lines = text.splitlines()
    last_number = len(lines)
    for number, line in enumerate(lines, 1):
        if not line.strip():
            continue
        try:
            record = json.loads(line)
        except json.JSONDecodeError as error:
            if number == last_number and not text.endswith("\n"):
                return  # its writer is still at work on it
            raise InputError(f"{path}:{number}: not JSON: {error.msg} at column {error.colno}") from error
        if not isinstance(record, dict):
            raise InputError(f"{path}:{number}: expected a JSON object, found {type(record).__name__}")
        yield number, record


def read_receptions(path: Path) -> Run:
    """A saved receptions.jsonl; `run.json` in the same folder is used when it is there."""
    run = Run(sources=[f"receptions {path.name}"])
    for number, record in read_json_lines(path):
        try:
            if record["channel"] not in CHANNELS:
                raise ValueError(f"channel {record['channel']!r} is none of {', '.join(CHANNELS)}")
            payload = record["payload"]
            run.receptions.append(Reception(
                float(record["time"]), float(record["mono"]), record["channel"], str(record["address"]).upper(),
                bytes.fromhex(payload) if payload else None, bytes.fromhex(record.get("raw") or ""),
                record.get("phy"), record.get("rssi"), record.get("address_type"),
                record.get("event_type"), record.get("wifi_channel"), record.get("problem"),
                bool(record.get("damaged"))))
        except (KeyError, ValueError, TypeError) as error:
            what = f"{error.args[0]!r} is missing" if isinstance(error, KeyError) else str(error)
            raise InputError(f"{path}:{number}: not a reception: {what}") from error
    side = path.with_name("run.json")
    if side.exists():
        try:
            saved = json.loads(side.read_text())
            run.start_mono, run.end_mono = float(saved["start_mono"]), float(saved["end_mono"])
        except (ValueError, KeyError, TypeError) as error:
            raise InputError(f"{side}: expected an object with start_mono and end_mono: {error}") from error
    elif run.receptions:
        run.start_mono = min(r.mono for r in run.receptions)
        run.end_mono = max(r.mono for r in run.receptions)
    return run


def write_receptions(run: Run, folder: Path) -> None:
    with open(folder / "receptions.jsonl", "w", encoding="utf-8") as file:
        for reception in run.receptions:
            file.write(reception.to_json() + "\n")
    (folder / "run.json").write_text(json.dumps(
        {"start_mono": run.start_mono, "end_mono": run.end_mono, "sources": run.sources}) + "\n")


def align_clocks(run: Run, other_offset_s: float | None) -> None:
    """Puts receptions that come from a file with one clock (mono equals time) on the
    monotonic clock of the others, or, without any, of the played log.

    `other_offset_s` is that log's mono minus time, None without a log.
    """
    live = [r.mono - r.time for r in run.receptions if r.mono != r.time]
    offset_s = statistics.median(live) if live else other_offset_s
    if offset_s is None or offset_s == 0:
        return
    everything_from_files = not live
    run.receptions = [replace(r, mono=r.time + offset_s) if r.mono == r.time else r for r in run.receptions]
    if everything_from_files and run.start_mono is not None:
        run.start_mono += offset_s
        run.end_mono += offset_s
    run.receptions.sort(key=lambda r: r.mono)
