"""What an update costs the broadcast: the longest wait for a newer position, its restart aside."""

import time

import patience
import pytest
from bench.gaps import CHANNELS, Contents

from . import LONG, autopilot, bundles, figures
from .appliance import wait_for
from .bundles import NEWER

pytestmark = LONG

SETTLE_S = 3
LATER_S = 150       # where it is then: positions that were not heard yet


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """It moves, and isn't armed."""
    return autopilot.generate(tmp_path_factory.mktemp("logs"), armed=False)


def test_the_broadcast_goes_on(make_appliance, log):
    one = make_appliance("air")
    machine = one.machine
    judge = machine.judge(None)
    windows, measured = {}, {}
    try:
        one.power_on()
        machine.play(log)
        machine.wait_on_air(position=True)
        one.wait_ready()
        time.sleep(SETTLE_S)
        bundle = bundles.bundle("good", NEWER)
        before, begun = one.starts(), time.monotonic()
        got = one.install(bundle)
        assert got.code == 0, got.output
        windows["install"] = begun, time.monotonic()
        # The autopilot isn't switched off meanwhile; its cable is the machine's, and comes back with it.
        one.wait_restart(before)
        machine.play(log, start=LATER_S)
        machine.wait_on_air(position=True)
        time.sleep(SETTLE_S)
        begun = time.monotonic()
        one.wait_state("trial", "idle")
        one.wait_state("idle")
        time.sleep(SETTLE_S)
        windows["trial and commit"] = begun, time.monotonic()
    finally:
        judge.stop()
    contents = Contents(machine.folder / "judge/receptions.jsonl")
    for name, (start, end) in windows.items():
        gap_s, channel = contents.worst_gap(CHANNELS, start, end)
        print(f"{name}: longest gap {gap_s:.2f} s on {channel}")
        measured[f"{name.replace(' ', '_')}_gap_s"] = round(gap_s, 2)
    figures.note(**measured)
    assert one.result()["outcome"] == "installed"
    for name, gap_s in measured.items():
        patience.promise(name, gap_s, figures.GAP_S)
    wait_for("the end", lambda: one.state() == "idle", 5)
