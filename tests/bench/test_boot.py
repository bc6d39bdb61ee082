"""What it takes to get on the air."""

import json
import time

from host import parts

from . import boot_chart, flights, gaps, limits
from .machine import CHANNELS


def test_the_boot(make_machine):
    """From init to the first valid message, of an appliance that has booted before, as each flight does."""
    machine = make_machine("boot")
    machine.power_on()
    machine.wait_on_air()
    machine.must("sync")
    machine.cut_power()
    judge = machine.judge(None)
    machine.power_on()
    machine.play(flights.generate(machine.folder / "flight.tlog", 60))
    machine.wait_on_air(position=True)
    started = machine.started()
    time.sleep(1)
    judge.stop(timeout_s=60)
    contents = gaps.Contents(machine.folder / "judge/receptions.jsonl")
    figures = {f"boot_to_{channel}_s": round(contents.first[channel] - started, 2) for channel in CHANNELS}
    path = parts.ROOT / "build/system/boot.json"
    path.write_text(json.dumps(figures, indent=1) + "\n")
    chart = boot_chart.text(boot_chart.rows(machine, contents))
    path.with_suffix(".txt").write_text(chart)
    print(chart)
    for channel, limit_s in limits.BOOT_S.items():
        assert figures[f"boot_to_{channel}_s"] <= limit_s
