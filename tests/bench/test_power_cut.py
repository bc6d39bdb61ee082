"""Power is cut at random instants of a configuration write: the appliance boots, broadcasts, and has the
old configuration or the new one, whole."""

import os
import random
import time

from .machine import configuration

CUTS = 300 if os.environ.get("TEST_LONG") else 20
WRITE_S = 0.25  # longer than it takes from the command to its rename being on the disk


def description(number):
    return f"Write number {number}"


def in_force(machine):
    return machine.must("odidctl get self_id.description").strip()


def test_power_cuts(make_machine):
    chance = random.Random(1)
    machine = make_machine("power-cut", config={"odid.conf": configuration(self_id={"description": description(0)})})
    machine.power_on()
    machine.wait_on_air()
    now, seen = description(0), {"old": 0, "new": 0}
    for number in range(1, CUTS + 1):
        wanted = description(number)
        machine.shell.send(f"odidctl set self_id.description '{wanted}'")
        time.sleep(chance.uniform(0, WRITE_S))
        machine.cut_power()
        machine.power_on()
        machine.wait_on_air(timeout_s=60)
        found = in_force(machine)
        assert found in (now, wanted), f"cut {number}: {found!r}"
        assert machine.must("odidctl get basic_id.uas_id").strip() == "SSRS5GBG01", f"cut {number}"
        assert machine.run("ls /run/faults | grep -v -e autopilot -e watchdog").output == "", f"cut {number}"
        seen["old" if found == now else "new"] += 1
        now = found
    print(f"{CUTS} cuts: {seen}")
    assert len([count for count in seen.values() if count]) == 2, "all cuts fell on the same side of the write"
