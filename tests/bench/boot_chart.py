"""What the boot's seconds go to: a chart of one power-on, from the kernel's log and the judge's receptions."""

import re
from collections import namedtuple

from .machine import CHANNELS

WIDTH_PER_S = 12  # characters
Row = namedtuple("Row", "name begin_s end_s")  # seconds after init; without an end: a moment

MOMENTS = (  # what the kernel's log calls it
    ("Bluetooth controller found", r"Bluetooth: HCI UART protocol H4 registered"),
    ("hostapd on the air", r"wlan0: AP-ENABLED"),
    ("autopilot's port", r"now attached to ttyUSB"),
)


def rows(machine, contents):
    """The chart's rows, in the order of their beginning; contents: what the judge heard."""
    log = [(float(at), text) for at, text in
           re.findall(r"^\[ *([\d.]+)\] (.*)$", machine.must("dmesg"), re.M)]
    started = machine.started()
    init = started - machine.mono(0.0)  # on the kernel's clock
    found = [Row("boot loader", machine.powered_mono - started, -init), Row("kernel", -init, 0.0)]
    scripts = [(at - init, text.rpartition(": ")[2]) for at, text in log if text.startswith("odid: boot: ")]
    for (begin, name), (end, _) in zip(scripts, scripts[1:]):
        found.append(Row(f"script {name}", begin, end))
    found.append(Row("services start", scripts[-1][0], None))
    for name, pattern in MOMENTS:
        found += [Row(name, at - init, None) for at, text in log if re.search(pattern, text)][:1]
    for channel in CHANNELS:
        found.append(Row(f"first message on {channel}", contents.first[channel] - started, None))
        found.append(Row(f"first position on {channel}", contents.newer[channel][0] - started, None))
    return sorted(found, key=lambda row: (row.begin_s, row.name))


def text(found):
    """The chart, for a fixed-width font."""
    first = min(row.begin_s for row in found)
    lines = [f"{'seconds after init':<28} {'from':>6} {'to':>6}"]
    for row in found:
        indent = round((row.begin_s - first) * WIDTH_PER_S)
        bar = "|" if row.end_s is None else "#" * max(1, round((row.end_s - row.begin_s) * WIDTH_PER_S))
        end = "" if row.end_s is None else f"{row.end_s:.2f}"
        lines.append(f"{row.name:<28} {row.begin_s:>6.2f} {end:>6} {' ' * indent}{bar}")
    return "\n".join(lines) + "\n"
