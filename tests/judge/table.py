"""The live table, as a phone app shows it: one column per aircraft and channel."""

from __future__ import annotations

import shutil
import time

from . import messages as m
from .receptions import Reception

FIELDS = ("", "address", "ID", "aircraft", "status", "latitude", "longitude", "height", "speed", "course", "climb",
          "operator", "operator at", "heard", "Locations/s", "silent for")
_RATE_WINDOW_S = 5.0
_EVERY_S = {True: 1.0, False: 15.0}  # by whether it is a terminal, where the table is drawn in place


class Column:
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
        self.columns: dict[tuple[str, str], Column] = {}
        self._taken = 0

    def update(self, receptions: list[Reception]) -> None:
        """Takes what was added to the list since the last call."""
        for reception in receptions[self._taken:]:
            if not reception.damaged:
                self.columns.setdefault((reception.channel, reception.address), Column()).take(reception)
        self._taken = len(receptions)

    def lines(self, now_mono: float, width: int) -> list[str]:
        """As many columns as fit into the width; what is cut off is counted."""
        if not self.columns:
            return ["(nothing heard yet)"]
        cells = [FIELDS] + [self._cells(key, column, now_mono) for key, column in sorted(self.columns.items())]
        widths = [max(map(len, one)) for one in cells]
        shown = 2
        while shown < len(cells) and sum(widths[:shown + 1]) + 2 * shown <= width:
            shown += 1
        lines = ["  ".join(one[row].ljust(widths[at]) for at, one in enumerate(cells[:shown])).rstrip()
                 for row in range(len(FIELDS))]
        return lines + ([f"and {len(cells) - shown} more, for which this is too narrow"] if shown < len(cells) else [])

    def _cells(self, key: tuple[str, str], column: Column, now_mono: float) -> tuple[str, ...]:
        basic, place = column.newest.get("basic_id"), column.newest.get("location")
        operator, system = column.newest.get("operator_id"), column.newest.get("system")
        column.locations = [mono for mono in column.locations if now_mono - mono <= _RATE_WINDOW_S]
        position = ("-",) * 7
        if place is not None:
            status = m.STATUS_NAMES[place.status] if place.status < len(m.STATUS_NAMES) else str(place.status)
            position = (status, _show(place.latitude_deg, "{:.6f}"), _show(place.longitude_deg, "{:.6f}"),
                        _show(place.height_m, "{:.1f} m"), _show(place.speed_m_s, "{:.1f} m/s"),
                        _show(place.direction_deg, "{:.0f}°"), _show(place.vertical_speed_m_s, "{:+.1f} m/s"))
        at = "-"
        if system is not None and system.operator_latitude_deg is not None:
            at = f"{system.operator_latitude_deg:.5f},{system.operator_longitude_deg:.5f}"
        return (*key, basic.text if basic else "-", m.UA_TYPES[basic.ua_type] if basic else "-", *position,
                operator.text if operator else "-", at, str(column.heard),
                f"{len(column.locations) / _RATE_WINDOW_S:.1f}", f"{now_mono - column.last_mono:.1f} s")


class Screen:
    """Draws the table: in place once a second on a terminal, else a block every 15 s."""

    def __init__(self, stream) -> None:
        self.stream = stream
        self.interactive = stream.isatty()
        self.table = Table()
        self._drawn = 0
        self._due = 0.0 if self.interactive else time.monotonic() + _EVERY_S[False]

    def draw(self, receptions: list[Reception], now_mono: float, left_s: float | None) -> None:
        if now_mono < self._due:
            return
        self._due = now_mono + _EVERY_S[self.interactive]
        self.table.update(receptions)
        width = shutil.get_terminal_size().columns if self.interactive else 120
        lines = [time.strftime("%H:%M:%S") + ("" if left_s is None else f"   {max(0, left_s):.0f} s left")]
        lines += self.table.lines(now_mono, width)
        if self.interactive:
            up = f"\x1b[{self._drawn}A\x1b[J" if self._drawn else ""
            self.stream.write(up + "".join(f"{line}\n" for line in lines))
            self._drawn = len(lines)
        else:
            self.stream.write("\n".join(lines) + "\n\n")
        self.stream.flush()
