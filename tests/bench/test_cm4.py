"""The Compute Module's board in emulation (cm4.py): both radio chips behind the drivers that fly, an independent listener,
and what has to come back by itself. Nothing here is about how long something takes.

One machine is shared, in the order of this file."""

import time

import parts
import pytest

from . import flights
from .cm4 import Cm4

COUNTED_TIMES = 5  # so often everything has to be heard before the judge is asked


@pytest.fixture(scope="module")
def machine(cm4_possible):
    one = Cm4(parts.ROOT / "build/system/cm4")
    try:
        one.power_on()
        one.wait_on_air()
        yield one
    finally:
        one.close()


@pytest.fixture(scope="module")
def flying(machine):
    machine.play(flights.generate(machine.folder / "flight.tlog", 3600))
    machine.wait_on_air(position=True)
    return machine


def channel(machine, name):
    status = machine.status()
    return status and status["channels"][name]


def wait_state(machine, name, *states):
    return machine.wait_for(f"{name} {' or '.join(states)}", lambda: (channel(machine, name) or {}).get("state") in states)


def wait_counted(machine, counter, before):
    """What is over within a second is seen in no state."""
    return machine.wait_for(f"one more of bt4's {counter}", lambda: (channel(machine, "bt4") or before)[counter] > before[counter])


def test_both_chips_are_driven_as_on_the_board(machine):
    log = machine.must("dmesg")
    assert "BCM4345C0 'brcm/BCM4345C0.hcd' Patch" in log and "BCM4345C0 (003.001.025) build 0281" in log
    assert "hci_uart_bcm serial0-0" in log
    assert "brcmfmac: brcmf_c_preinit_dcmds: Firmware: BCM4345/6" in log
    assert machine.must("cat /proc/device-tree/model").startswith("Raspberry Pi Compute Module 4")
    assert channel(machine, "bt5")["state"] == "unsupported"


def test_all_five_messages_are_heard_of_both(machine):
    machine.wait_all_five()
    for name in machine.channels:
        receptions = machine.air.receptions(name)
        assert b"SSRS5GBG01" in b"".join(one.data for one in receptions)
        assert len({one.address for one in receptions}) == 1


def test_the_technician_s_board_test(machine):
    """Without supply and heat, for this machine has no thermometer; and without the drivers: where brcmfmac is taken from the chip's
    USB stand-in QEMU itself ends (usb_packet_setup's assertion)."""
    machine.must("(printf '5\\n5\\n-45\\n-50\\nn\\n' | odidctl board-test 1 2 3; echo ended $?) >/run/board-test.said 2>&1 &")
    machine.wait_for("the end of odidctl board-test", lambda: "ended" in machine.run("cat /run/board-test.said").output)
    said = machine.must("cat /run/board-test.said")
    assert "The report: board-test.txt, on the volume CONFIG." in said and "ended 0" in said, said
    report = machine.must("mount -t vfat -o ro /dev/disk/odid/config /run/config && cat /run/config/board-test.txt; umount /run/config")
    assert "3 passed, 0 failed, 0 not seen." in report and "Compute Module 4" in report, report
    machine.wait_on_air()


def test_a_flight_is_heard_as_it_was_flown(flying):
    out = flying.folder / "judge"
    judge = flying.judge(None, "--expect", ",".join(flying.channels), "--without-time",
                         "--played", flying.folder / "played.jsonl", out=out)
    for _ in range(COUNTED_TIMES):
        flying.wait_all_five()
    assert judge.stop() == 0, (out / "report.txt").read_text()


def test_the_autopilot_s_cable_is_pulled_and_comes_back(flying):
    flying.unplug()
    flying.wait_for("the position's end", lambda: not (flying.status() or {"position": {"fresh": True}})["position"]["fresh"])
    flying.wait_all_five()
    flying.plug()
    flying.wait_on_air(position=True)


def test_a_bluetooth_chip_that_answers_nothing_for_a_while(flying):
    flying.front.order("mute")
    wait_state(flying, "bt4", "lost")
    flying.wait_all_five(["wifi"])
    flying.front.order("unmute")
    flying.wait_on_air()
    flying.wait_all_five()


def test_a_bluetooth_chip_that_hangs_until_it_is_reset(flying):
    before = channel(flying, "bt4")
    flying.front.order("hang")
    wait_counted(flying, "failures", before)
    flying.wait_on_air()
    flying.wait_all_five()


def test_a_bluetooth_chip_that_resets_itself(flying):
    """It answers and takes data as before, says nothing of it, and sends nothing."""
    before = channel(flying, "bt4")
    flying.front.order("reset")
    wait_counted(flying, "repairs", before)
    flying.wait_all_five(["bt4"])
    assert channel(flying, "bt4")["state"] == "on air"


def fault(machine, name):
    return machine.run(f"cat /run/faults/{name}").output


def test_a_bluetooth_chip_that_only_its_driver_brings_back(flying):
    patched = flying.must("dmesg").count("BCM4345C0 'brcm/BCM4345C0.hcd' Patch")
    flying.front.order("mute")
    flying.wait_for("its driver bound anew", lambda: "its driver is bound anew" in fault(flying, "radio-hci0"))
    assert "its driver is to be bound anew" in channel(flying, "bt4")["detail"]
    flying.front.order("unmute")
    flying.wait_on_air()
    flying.wait_all_five()
    assert flying.must("dmesg").count("BCM4345C0 'brcm/BCM4345C0.hcd' Patch") > patched
    flying.wait_for("the fault's end", lambda: "No such file" in fault(flying, "radio-hci0"))


def test_the_chip_s_own_count_confirms_the_beacons(flying):
    flying.wait_for("the count", lambda: (channel(flying, "wifi") or {}).get("known") == "confirmed")
    assert "the chip counts them" in channel(flying, "wifi")["detail"]


def test_an_element_that_the_chip_refuses_once_leaves_none_of_before_beside_it(flying):
    failures = channel(flying, "wifi")["failures"]
    assert flying.wifi.order("refuse vndr_ie -30") == "done"
    flying.wait_for("the refusal", lambda: (channel(flying, "wifi") or {"failures": 0})["failures"] > failures)
    flying.wait_on_air()
    since = time.monotonic()
    flying.wait_all_five()
    times = [one.mono for one in flying.air.receptions("wifi", since)]
    assert len(times) == len(set(times)), "two elements in a beacon"


def test_a_chip_that_says_ok_and_sends_no_beacon(flying):
    assert flying.wifi.order("silence") == "done"
    flying.wait_for("that it is off the air", lambda: (wifi := channel(flying, "wifi")) and wifi["state"] == "lost"
                    and "the chip sends no beacon" in wifi["detail"])
    assert flying.wifi.order("speak") == "done"
    flying.wait_on_air()
    flying.wait_all_five()


def test_a_wi_fi_firmware_that_crashes(flying):
    began = flying.must("dmesg").count("BCM43455 (model)")
    assert flying.wifi.order("crash 2") == "done"
    wait_state(flying, "wifi", "lost", "absent", "down")
    since = time.monotonic()
    flying.wait_on_air()
    flying.wait_all_five()
    assert flying.air.receptions("wifi", since)
    assert flying.must("dmesg").count("BCM43455 (model)") > began, "it was off the bus"


def test_a_wi_fi_chip_that_only_its_driver_brings_back(flying):
    began = flying.must("dmesg").count("preinit_dcmds: Firmware")
    assert flying.wifi.order("hang") == "done"
    wait_state(flying, "wifi", "lost", "down", "absent")
    flying.wait_on_air()
    flying.wait_all_five()
    assert "radio-wlan0: The radio wlan0 doesn't come back by itself: its driver is bound anew" in flying.must("logread; dmesg")
    assert flying.must("dmesg").count("preinit_dcmds: Firmware") > began, "it began anew"
