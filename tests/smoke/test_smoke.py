"""One appliance, booted for `make test`: that its parts work together, and that it comes back from what is done to it.

Nothing here is about how long something takes, so the verdict is the same on any machine; what has a limit is measured by
tests/bench and tests/update (`make test-all`). The appliance has limits of its own, by which it restarts or gives an
update up: it has its own time for them, in which no machine is slow. One machine is shared, in the order of this file: on
the ground first, then updated, then in flight. Which part fails without what it proves: docs/faults.md.
"""

import time

import pytest
from bench import faults, flights, runs
from bench.conftest import GROUND, PASSWORD
from bench.machine import CHANNELS
from bench.page import Page, listening
from bench.technician import Technician
from update import bundles
from update.appliance import START, Appliance, wait_for
from update.bundles import NEWER, NO_BLUETOOTH

TEXT = "Smoke"
FAILING = "9.9.1"  # newer still, so that nothing but its trial speaks against it


@pytest.fixture(scope="module")
def appliance(machine_possible):
    one = Appliance("smoke", config={"odid.conf": GROUND}, own_time=True)
    try:
        one.power_on()
        yield one
    finally:
        one.close()


@pytest.fixture(scope="module")
def machine(appliance):
    return appliance.machine


def judged(machine, *arguments):
    """Every message, field, counter and address by an independent listener; not when it was heard."""
    out = machine.folder / "judge"
    judge = machine.judge(None, "--expect", ",".join(CHANNELS), "--without-time", *arguments, out=out)
    for _ in range(5):
        machine.wait_all_five()
    assert judge.stop() == 0, judge.log()
    return (out / "report.txt").read_text()


# --- on the ground -------------------------------------------------------------------


def test_it_boots_and_all_five_messages_are_heard_on_each_channel(machine):
    console = machine.console_text()
    assert START in console and "odid.slot=a" in console
    machine.wait_inside("what the programs say, in the log", "logread | grep -q 'info: odid-daemon .*, process '")
    judged(machine)
    heard = b"".join(one.data for channel in CHANNELS for one in machine.air.receptions(channel))
    assert b"SSRS5GBG01" in heard and b"SWE3jxza7qbzvu5d" in heard  # as the CONFIG volume says


def test_a_configuration_is_taken_over_and_a_wrong_one_refused(machine):
    """As at a start: the same script. On the air it is from the next start on, which an update's test has."""
    technician, good = Technician(machine), GROUND.replace("Sea rescue surveillance", TEXT)
    technician.puts({"odid.conf": good.replace("uas_id =", "uasid =")})
    assert "uasid" in technician.report() and "odid.conf" in machine.must("cat /run/faults/config")
    assert machine.must("odidctl get self_id.description").strip() == "Sea rescue surveillance"
    technician.puts({"odid.conf": good})
    assert machine.must("odidctl get self_id.description").strip() == TEXT
    assert machine.run("cat /run/faults/config").code != 0
    machine.wait_all_five()


def test_the_page_is_there_in_maintenance(machine):
    assert listening(machine) == set()
    machine.must("odidctl maintenance on")
    machine.wait_for("the page", lambda: listening(machine) == {80})
    page = Page(machine)
    assert page.ask("GET", "/")[0] == 200 and page.ask("GET", "/api/status")[0] == 401
    assert page.ask("POST", "/api/session", {"password": PASSWORD})[0] == 200
    code, status = page.ask("GET", "/api/status")
    assert code == 200 and status["daemon"]["on_air"]
    machine.must("odidctl maintenance off")
    machine.wait_for("its end", lambda: listening(machine) == set())


# --- updates -------------------------------------------------------------------------


def test_a_forged_bundle_is_refused(appliance):
    appliance.wait_ready()
    got = appliance.install(bundles.bundle("forged", NEWER, keys=bundles.other_keys()))
    assert got.code == 1 and "signed" in got.output
    assert (appliance.result()["outcome"], appliance.slot()) == ("refused", "a")


def installed(appliance, bundle):
    """Gives it the bundle; until it has restarted into it."""
    appliance.wait_ready()
    before = appliance.starts()
    got = appliance.install(bundle)
    assert got.code == 0, got.output
    appliance.wait_restart(before)
    return before + 1


def test_an_update_is_installed_tried_and_kept(appliance):
    installed(appliance, bundles.bundle("smoke", NEWER))
    assert (appliance.slot(), appliance.version()) == ("b", NEWER)
    appliance.machine.wait_on_air()
    wait_for("its end", lambda: (appliance.result() or {}).get("outcome") == "installed")
    appliance.wait_state("idle")
    variables = appliance.variables()
    assert (variables["slot"], variables["upgrade_available"]) == ("b", "0")
    since = time.monotonic()
    appliance.machine.wait_all_five()
    heard = b"".join(one.data for channel in CHANNELS for one in appliance.machine.air.receptions(channel, since))
    assert b"SSRS5GBG01" in heard and TEXT.encode() in heard  # what was configured is kept


def test_an_update_that_fails_is_given_up(appliance):
    """Its new slot has no Bluetooth, which the old one had."""
    starts = installed(appliance, bundles.bundle("smoke_fails", FAILING, NO_BLUETOOTH.changes))
    appliance.wait_restart(starts)
    appliance.machine.wait_on_air()
    wait_for("its end", lambda: (appliance.result() or {}).get("outcome") == "rolled-back")
    assert (appliance.slot(), appliance.version()) == ("b", NEWER)
    appliance.machine.wait_all_five()


# --- in flight -----------------------------------------------------------------------


@pytest.fixture(scope="module")
def flying(machine):
    """Armed, moving, everything on the air."""
    machine.play(flights.generate(machine.folder / "flight.tlog", 3600))
    machine.wait_on_air(position=True)
    machine.wait_for("arming", lambda: machine.status()["aircraft"]["armed"])
    machine.put(faults.TOOL, runs.tool())
    return machine


def test_the_page_is_gone_when_armed(machine, request):
    machine.must("odidctl maintenance on")
    machine.wait_for("the page", lambda: listening(machine) == {80})
    request.getfixturevalue("flying")
    machine.wait_for("its end", lambda: listening(machine) == set())
    assert machine.run("odidctl maintenance on").code != 0


def back(machine):
    """Everything is on the air, and newer positions are heard on each channel."""
    machine.wait_on_air(position=True)
    machine.wait_all_five()


def test_every_field_is_right_in_flight(flying):
    report = judged(flying, "--played", flying.folder / "played.jsonl")
    assert report.rstrip().endswith("PASS"), report


@pytest.mark.parametrize("program", ["odid-daemon", "hostapd"])
def test_what_is_killed_comes_back(flying, program):
    before = flying.must(f"pidof {program}")
    flying.must(f"kill -9 {before}")
    flying.wait_inside(f"another {program}", f"pidof {program} >/dev/null && [ \"$(pidof {program})\" != '{before.strip()}' ]")
    back(flying)


def test_a_foreign_disable_is_undone(flying):
    repairs = flying.status()["channels"]["bt4"]["repairs"]
    flying.must(f"{faults.TOOL} hci 0 {faults.FOREIGN_DISABLE}")
    flying.wait_for("the repair", lambda: flying.status()["channels"]["bt4"]["repairs"] > repairs)
    back(flying)


def test_the_autopilot_s_cable_is_pulled_and_back(flying):
    flying.unplug()
    flying.wait_for("the failure", lambda: flying.status()["position"]["status"] == "remote ID system failure")
    flying.wait_all_five()
    flying.plug()
    back(flying)


@pytest.mark.parametrize("radio", [faults.wifi_radio, faults.bluetooth_controller])
def test_a_radio_is_taken_away_and_back(flying, radio):
    radio(flying)
    back(flying)
