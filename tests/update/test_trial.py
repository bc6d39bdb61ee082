"""A new slot on trial: kept when it does what the one before did, else given up, with the reason."""

import re
import time

import patience
import pytest
from bench import disk as disks
from bench.machine import configuration

from . import LONG, bundles, figures
from .appliance import wait_for
from .bundles import NEWER, NO_BLUETOOTH, NO_KERNEL, OLDER, Failure
from .installs import installed

pytestmark = LONG

BACK_ON_AIR_S = 90
# All that the boot loader's three starts may take, from the first one to the broadcast of the old slot; for one that
# is never judged, with its two minutes in each.
GIVEN_UP_S = {"no_kernel": 90, "kernel_panics": 90, "init_hangs": 150, "not_judged": 600}

STARTS_ON_TRIAL = 20    # bootlimit in u-boot.env: that many, and one in which it is given up

HANGS = b"#!/bin/sh\nwhile :; do sleep 1000; done\n"
CRASHES = b"#!/bin/sh\nsleep 1\nkill -SEGV $$\n"

KERNEL_PANICS = Failure("kernel_panics", {"sbin/init": None, "bin/init": None, "etc/init": None, "bin/sh": None},
                        "three starts", False)
FAILURES = (
    NO_BLUETOOTH,
    Failure("daemon_crashes", {"usr/sbin/odid-daemon": CRASHES}, "daemon"),
    Failure("radio_configuration", {"etc/hostapd/hostapd.conf.in": b"interface=@INTERFACE@\nnonsense=1\n"},
            "Wi-Fi.*isn't on the air"),
    Failure("a_service", {"usr/sbin/dropbear": None, "etc/sv/syslogd/run": b"#!/bin/sh\nexit 1\n"}, "service syslogd"),
    KERNEL_PANICS,
    Failure("init_hangs", {"sbin/init": HANGS}, "three starts", False),
    # Nobody judges the slot: it restarts after two minutes, three times.
    Failure("not_judged", {"usr/sbin/odid-update": None}, "three starts", False),
    NO_KERNEL,
)


def test_one_that_does_what_the_old_one_did_is_kept(ready):
    """In a hangar: no autopilot, no position."""
    machine = ready.machine
    machine.must("odidctl set self_id.description Kept")
    machine.wait_on_air()
    kept = ready.kept()
    began = installed(ready, bundles.bundle("good", NEWER))
    machine.wait_shell()
    machine.wait_on_air()
    figures.note(kept_restart_to_air_s=round(time.monotonic() - began, 1))
    assert ready.slot() == "b"
    assert ready.version() == NEWER
    ready.wait_state("trial")
    assert "update in progress" in machine.must("odidctl status; true")
    # Another one meanwhile is refused, and changes nothing about the trial.
    ready.wait_ready()
    got = ready.install(bundles.bundle("older", OLDER))
    assert got.code == 1, got.output
    assert "on trial" in got.output
    ready.wait_state("idle")
    figures.note(kept_restart_to_commit_s=round(time.monotonic() - began, 1))
    variables = ready.variables()
    assert variables["slot"] == "b"
    assert variables["upgrade_available"] == "0"
    assert "trial" not in variables
    result = ready.result()
    assert result["outcome"] == "installed"
    assert (result["from"], result["to"]) == (bundles.running_version(), NEWER)
    assert "update in progress" not in machine.must("odidctl status; true")
    assert machine.must("odidctl get self_id.description").strip() == "Kept"
    assert kept <= ready.kept()

    # And back to an older one, which nobody forbade; the settings stay.
    installed(ready, bundles.bundle("older", OLDER))
    machine.wait_shell()
    machine.wait_on_air()
    ready.wait_state("trial")
    ready.wait_state("idle")
    assert ready.slot() == "a"
    assert ready.variables()["slot"] == "a"
    assert ready.result()["to"] == OLDER
    assert machine.must("odidctl get self_id.description").strip() == "Kept"
    assert kept <= ready.kept()
    machine.cut_power()
    machine.power_on()
    assert ready.slot() == "a"
    assert ready.version() == OLDER


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: failure.name)
def test_one_that_fails_is_given_up_without_a_hand_on_it(ready, failure):
    machine = ready.machine
    bundle = bundles.bundle(failure.name, NEWER, failure.changes)
    before, kept = ready.starts(), ready.kept()
    began = installed(ready, bundle)
    if failure.itself:
        machine.wait_shell()
        failed = wait_for("the reason", lambda: ready.result() and time.monotonic())
        ready.wait_restart(before + 1)
    else:
        if failure.name == "not_judged":    # the autopilot is told of the trial, without odid-update
            machine.wait_shell()
            wait_for("the pilot's sentence", lambda: "update in progress" in machine.run("odidctl status").output)
            machine.shell.close()
            machine.shell = None
        within_s = GIVEN_UP_S[failure.name]
        wait_for("the old slot", lambda: re.search(r"odid\.slot=a odid\.fallback", machine.console_text()), within_s,
                 limit_s=within_s + patience.BOOTED_S)
        failed = began if failure.name == "no_kernel" else time.monotonic()
        machine.wait_shell()
    machine.wait_on_air()
    took = time.monotonic() - failed
    figures.note(**{f"{failure.name}_failed_to_air_s": round(took, 1),
                    f"{failure.name}_restart_to_air_s": round(time.monotonic() - began, 1)})
    patience.promise("back on the air", took, BACK_ON_AIR_S)
    if not failure.itself:
        patience.promise("given up", time.monotonic() - began, GIVEN_UP_S[failure.name])
    assert ready.slot() == "a"
    assert ready.version() == bundles.running_version()
    result = wait_for("the result", ready.result)
    assert result["outcome"] == "rolled-back"
    assert re.search(failure.says, result["sentence"]), result["sentence"]
    assert (result["from"], result["to"]) == (bundles.running_version(), NEWER)
    ready.wait_state("idle")
    assert result["sentence"] in machine.must("odidctl update")
    variables = ready.variables()
    assert (variables["slot"], variables["upgrade_available"]) == ("a", "0")
    assert kept <= ready.kept()
    # The next power-on doesn't try it again.
    machine.cut_power()
    machine.power_on()
    assert ready.slot() == "a"


def test_a_channel_that_never_worked_is_not_asked_for(make_appliance):
    """A board without Bluetooth takes an update as any other."""
    one = make_appliance("no-bluetooth", config={"odid.conf": configuration(
        broadcast={"bt4_enabled": "false", "bt5_enabled": "false"})})
    one.machine.power_on()
    one.machine.wait_on_air(channels=("wifi",))
    one.wait_ready()
    installed(one, bundles.bundle("no_bluetooth", NEWER, NO_BLUETOOTH.changes))
    one.machine.wait_shell()
    one.wait_state("trial")
    one.wait_state("idle")
    assert one.result()["outcome"] == "installed"


def test_switched_off_ten_times_on_trial(ready):
    """Quickly, after 1 to 10 s: it is on trial still, and is kept when it is left alone."""
    installed(ready, bundles.bundle("good", NEWER))
    machine = ready.machine
    for seconds in range(1, 11):
        machine.cut_power()
        machine.power_on(wait=False)
        time.sleep(seconds)
    machine.cut_power()
    ready.power_on()
    assert ready.slot() == "b"
    ready.wait_state("trial")
    ready.wait_state("idle")
    assert ready.result()["outcome"] == "installed"


def test_the_boot_loader_s_limit_of_starts(ready):
    """For a board that can't tell a power-on from a restart: 20 starts without a decision, whatever they were."""
    installed(ready, bundles.bundle("good", NEWER))
    machine = ready.machine
    machine.wait_console(r"odid\.slot=b.* odid\.trial")     # that start is counted
    for number in range(STARTS_ON_TRIAL):
        machine.cut_power()
        machine.power_on(wait=False)
        machine.wait_console(r"odid\.slot=(a|b)")
        taken = re.search(r"odid\.slot=(a|b)", machine.console_text())[1]
        # The first of them was the restart after the install.
        assert taken == ("b" if number < STARTS_ON_TRIAL - 1 else "a"), f"start {number + 2}"
    ready.machine.wait_shell()
    machine.wait_on_air()
    result = wait_for("the result", ready.result)
    assert result["outcome"] == "rolled-back" and "started 20 times" in result["sentence"], result
    ready.wait_state("idle")
    assert (ready.variables()["slot"], ready.variables()["upgrade_available"]) == ("a", "0")


def test_a_committed_slot_that_panics_gives_way(ready):
    """Three times before init; it is reported, and tried again at the next power-on."""
    machine = ready.machine
    machine.cut_power()
    machine.disk.write(disks.SLOT_A, bundles.slot("kernel_panics", KERNEL_PANICS.changes))
    machine.power_on(wait=False)
    wait_for("the other slot", lambda: "odid.slot=b odid.fallback=slot-a-restarted-three-times" in machine.console_text(),
             GIVEN_UP_S["kernel_panics"])
    machine.wait_shell()
    machine.wait_on_air()
    assert "slot a restarted three times" in machine.must("cat /run/faults/slot")
    assert "slot a restarted three times" in machine.must("odidctl status; true")
    ready.wait_ready()
    variables = ready.variables()
    assert (variables["slot"], variables.get("upgrade_available", "0")) == ("a", "0")


@pytest.mark.parametrize("where", ["kernel", "superblock"])
def test_a_committed_slot_that_rots_gives_way(ready, where):
    """Without a trial's counter; it is reported; and an update makes it whole again."""
    machine = ready.machine
    machine.cut_power()
    ready.damage(disks.SLOT_A, {"kernel": 4_000_256, "superblock": 0}[where])
    ready.power_on()
    assert ready.slot() == "b"
    assert re.search("slot a (damaged|unreadable)", machine.must("cat /run/faults/slot"))
    assert "damaged" in machine.must("odidctl status; true") or "unreadable" in machine.must("odidctl status; true")
    ready.wait_ready()
    assert ready.variables()["slot"] == "a"
    assert ready.variables().get("upgrade_available", "0") == "0"
    installed(ready, bundles.bundle("good", NEWER))
    machine.wait_shell()
    machine.wait_on_air()
    assert ready.slot() == "a"
    ready.wait_state("trial")
    ready.wait_state("idle")
    assert ready.result()["outcome"] == "installed"
