"""The live table, as a phone app shows it: one row per aircraft and channel."""

from __future__ import annotations

import time

from . import messages as m
from .receptions import Reception

HEADER = ("channel", "address", "ID", "type", "status", "latitude", "longitude", "height", "speed", "course",
          "climb", "operator", "operator at", "age", "heard", "Loc/s")
_RATE_WINDOW_S = 5.0


class Row:
    """What is known of one transmitter on one channel."""

    def __init__(self) -> None:
        self.newest: dict[str, m.Message] = {}
        self.heard = 0
        self.last_mono = 0.0
        self.locations: list[float] = []

    def take(self, reception: Reception) -> None:
        self.heard += 1
        self.last_mono = reception.mono
        if reception.payload is None or len(reception.payload) < 3:
            return
        try:
            found = m.decode_body(reception.payload[2:])
        except m.MessageError:
            return  # the report says so; the table shows what could be read
        for message in found:
            self.newest[message.type_name] = message
            if message.type_name == "location":
                self.locations.append(reception.mono)


def _show(value, pattern: str) -> str:
    return "-" if value is None else pattern.format(value)


class Table:
    def __init__(self) -> None:
        self.rows: dict[tuple[str, str], Row] = {}
        self._taken = 0

    def update(self, receptions: list[Reception]) -> None:
        """Takes what was added to the list since the last call."""
        for reception in receptions[self._taken:]:
            if not reception.damaged:
                self.rows.setdefault((reception.channel, reception.address), Row()).take(reception)
        self._taken = len(receptions)

    def lines(self, now_mono: float) -> list[str]:
        cells = [HEADER] + [self._cells(key, row, now_mono) for key, row in sorted(self.rows.items())]
        widths = [max(len(line[column]) for line in cells) for column in range(len(HEADER))]
        lines = ["  ".join(text.ljust(width) for text, width in zip(line, widths)).rstrip() for line in cells]
        return lines if self.rows else lines + ["(nothing heard yet)"]

    def _cells(self, key: tuple[str, str], row: Row, now_mono: float) -> tuple[str, ...]:
        basic, place = row.newest.get("basic_id"), row.newest.get("location")
        operator, system = row.newest.get("operator_id"), row.newest.get("system")
        row.locations = [mono for mono in row.locations if now_mono - mono <= _RATE_WINDOW_S]
        position = ("-",) * 7
        if place is not None:
            status = m.STATUS_NAMES[place.status] if place.status < len(m.STATUS_NAMES) else str(place.status)
            position = (status, _show(place.latitude_deg, "{:.6f}"), _show(place.longitude_deg, "{:.6f}"),
                        _show(place.height_m, "{:.1f} m"), _show(place.speed_m_s, "{:.1f} m/s"),
                        _show(place.direction_deg, "{:.0f}°"), _show(place.vertical_speed_m_s, "{:+.1f}"))
        at = "-"
        if system is not None and system.operator_latitude_deg is not None:
            at = f"{system.operator_latitude_deg:.5f},{system.operator_longitude_deg:.5f}"
        return (*key, basic.text if basic else "-", m.UA_TYPES[basic.ua_type] if basic else "-", *position,
                operator.text if operator else "-", at, f"{now_mono - row.last_mono:.1f} s", str(row.heard),
                f"{len(row.locations) / _RATE_WINDOW_S:.1f}")


class Screen:
    """Draws the table: in place once a second on a terminal, else a block every 5 s."""

    def __init__(self, stream) -> None:
        self.stream = stream
        self.interactive = stream.isatty()
        self.table = Table()
        self._drawn = 0
        self._due = 0.0

    def draw(self, receptions: list[Reception], now_mono: float, left_s: float | None) -> None:
        if now_mono < self._due:
            return
        self._due = now_mono + (1.0 if self.interactive else 5.0)
        self.table.update(receptions)
        lines = [time.strftime("%H:%M:%S") + ("" if left_s is None else f"   {max(0, left_s):.0f} s left")]
        lines += self.table.lines(now_mono)
        if self.interactive:
            up = f"\x1b[{self._drawn}A" if self._drawn else ""
            self.stream.write(up + "".join(f"\x1b[2K{line}\n" for line in lines))
            self._drawn = len(lines)
        else:
            self.stream.write("\n".join(lines) + "\n\n")
        self.stream.flush()
