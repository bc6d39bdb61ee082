"""What it takes to get on the air."""

import json
import time

import parts
import pytest

from . import boot_chart, flights, gaps, limits
from .machine import CHANNELS

FILE = parts.ROOT / "build/system/boot.json"


def power_on_again(machine):
    """Cuts the power and switches on again, in flight. Seconds to the first message; the chart is in FILE's folder."""
    machine.must("sync")
    machine.cut_power()
    judge = machine.judge(None)
    machine.power_on()
    machine.play(flights.generate(machine.folder / "flight.tlog", 60))
    machine.wait_on_air(position=True)
    started = machine.started()
    time.sleep(1)
    judge.stop()
    contents = gaps.Contents(machine.folder / "judge/receptions.jsonl")
    chart = boot_chart.text(boot_chart.rows(machine, contents))
    FILE.with_suffix(".txt").write_text(chart)
    print(chart)
    return {channel: round(contents.first[channel] - started, 2) for channel in CHANNELS}


def test_a_bluetooth_line_whose_driver_has_stopped_is_attached_again(make_machine):
    """Which a kernel's N_HCI did at its switching off, for good (guest/hci-attach.c). Here it is the answers that stop,
    in the middle of a set-up: to who attaches it that looks the same."""
    machine = make_machine("stopped-line")
    machine.power_on()
    machine.wait_on_air()
    machine.front.order("mute")
    machine.must("rfkill block bluetooth")  # the daemon switches it on again
    machine.wait_inside("another attachment", "dmesg | grep -q 'has stopped to send: attached again'")
    machine.front.order("unmute")
    machine.wait_on_air()


def test_the_boot(make_machine):
    """From init to the first valid message, of an appliance that has booted before, as each flight does."""
    machine = make_machine("boot")
    machine.power_on()
    machine.wait_on_air()
    first_s, disturbed = power_on_again(machine), machine.boot_disturbed()
    FILE.write_text(json.dumps({f"boot_to_{channel}_s": seconds for channel, seconds in first_s.items()}, indent=1) + "\n")
    late = [f"{channel}: {first_s[channel]} s, {limit_s:g} s allowed" for channel, limit_s in limits.BOOT_S.items()
            if first_s[channel] > limit_s]
    if late and disturbed:
        pytest.skip(f"not judged: {disturbed}; {'; '.join(late)}")
    assert not late
