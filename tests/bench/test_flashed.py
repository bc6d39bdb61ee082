"""The image that is flashed, on the Compute Module's board in emulation: what test_faults.py does to the appliance in QEMU's machine
"virt", done to that image, kernel and drivers. How long something takes is judged there. What its chips do: test_cm4.py.

make system IMAGE=build/image/cm4/images/disk.img
"""

import time

import parts
import pytest

from . import faults, flights, runs
from .cm4 import FLASHED, Cm4
from .conftest import started

pytestmark = pytest.mark.skipif(not FLASHED, reason="of the image that is flashed: make system IMAGE=build/image/cm4/images/disk.img")

LEGACY_DISABLE = "0a200100"  # LE Set Advertising Enable: off
FLIGHT_S = 7200  # longer than all of it
# Those that need what that machine has: a clock, radios that are made and taken away, a second adapter, extended advertising, a shell
# before the network is there, little memory.
OF_VIRT = ("wifi_radio", "bluetooth_controller", "autopilot_wrong_port", "foreign_command", "boot_1970", "boot_2038", "blocked_at_boot",
           "load")


def possible(listed):
    return [one for one in listed if one.name not in OF_VIRT]


@pytest.fixture
def switched_off(cm4_possible, request):
    one = Cm4(parts.ROOT / f"build/system/flashed-{request.node.callspec.id}")
    yield one
    one.close()


@pytest.mark.parametrize("fault", possible(faults.BOOTS), ids=lambda fault: fault.name)
def test_a_power_on_under_a_fault(switched_off, fault):
    fault.prepare(switched_off)
    switched_off.power_on(**fault.power)
    fault.early(switched_off)
    switched_off.play(flights.generate(switched_off.folder / "flight.tlog", 600))
    if fault.later:
        switched_off.player.order("pause")
        switched_off.wait_on_air()
        fault.later(switched_off)
    switched_off.wait_on_air(position=True)
    switched_off.wait_all_five()


@pytest.fixture(scope="module")
def flying(cm4_possible):
    machine = started("flashed", kind=Cm4)
    try:
        machine.flight, machine.flight_mono = flights.generate(machine.folder / "flight.tlog", FLIGHT_S), time.monotonic()
        machine.play(machine.flight)
        machine.wait_on_air(position=True)
        machine.put(faults.TOOL, runs.tool())
        yield machine
    finally:
        machine.close()


@pytest.mark.parametrize("fault", possible(faults.IN_FLIGHT), ids=lambda fault: fault.name)
def test_a_fault_in_flight(flying, fault):
    injected = fault.inject(flying)
    fault.undo(flying)
    assert not injected.problems
    flying.wait_on_air(position=True)
    flying.wait_all_five()


def test_a_second_bluetooth_user_turns_advertising_off(flying):
    repairs = flying.status()["channels"]["bt4"]["repairs"]
    flying.must(f"{faults.TOOL} hci 0 {LEGACY_DISABLE}")
    flying.wait_for("the repair", lambda: (status := flying.status()) and status["channels"]["bt4"]["repairs"] > repairs)
    flying.wait_all_five(["bt4"])
