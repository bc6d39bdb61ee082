"""Never a restart in the air: armed, and lost while armed, at every phase of an update."""

import re
import time

import patience
import pytest

from . import LONG, autopilot, bundles
from .appliance import wait_for
from .bundles import NEWER, NO_BLUETOOTH, OLDER
from .installs import installed

pytestmark = LONG

DESCRIPTION_RATE = 100  # octets a second: description and signature take half a minute
LONG_ENOUGH_S = 75      # longer than a trial lasts, and than the wait before a restart


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    return {armed: autopilot.generate(folder, armed) for armed in (False, True)}


@pytest.fixture
def ready(make_appliance, request, logs):
    one = make_appliance(re.sub(r"\W+", "_", request.node.name))
    one.power_on()
    one.machine.play(logs[False])
    one.wait_ready()
    wait_for("disarmed", lambda: one.armed() is False)
    return one


def arm(appliance, logs, armed=True):
    appliance.machine.play(logs[armed])
    wait_for("armed" if armed else "disarmed", lambda: appliance.armed() is armed)


def disarm_for_a_restart(appliance, logs):
    """It may restart before anybody could ask it whether it is disarmed."""
    before = appliance.starts()
    appliance.machine.play(logs[False])
    appliance.wait_restart(before)


def on_trial(appliance, bundle):
    """Its slot is started, and the daemon answers."""
    installed(appliance, bundle)
    appliance.machine.wait_shell()
    wait_for("the daemon", appliance.machine.status)


def told(appliance, reason):
    """What the autopilot hears of us: ARM_STATUS."""
    return any(reason in str(answer) for answer in appliance.machine.answers()[-12:])


def no_restart(appliance, seconds):
    before = appliance.starts()
    patience.stays("no restart", lambda: appliance.starts() == before, seconds)


def test_armed_while_it_is_checked(ready, logs):
    """The description is still coming in; then the gate refuses it."""
    bundle = bundles.bundle("good", NEWER)
    written = ready.sectors_written()
    ready.begin(bundle, rate=DESCRIPTION_RATE)
    ready.wait_state("checking", within_s=10)
    arm(ready, logs)
    assert ready.state() == "checking"
    assert ready.ended()[0] == 1
    result = ready.result()
    assert result["outcome"] == "refused"
    assert "disarm it first" in result["sentence"]
    assert ready.protected()
    assert ready.sectors_written() == written


@pytest.mark.parametrize("case", ["armed", "lost_while_armed", "supervisor_replaced"])
def test_writing_stops(ready, logs, case):
    bundle = bundles.bundle("good", NEWER)
    ready.begin(bundle, rate=bundle.stat().st_size // 40)
    ready.wait_state("installing")
    wait_for("ARM_STATUS", lambda: told(ready, "update in progress"), 10)
    variables = ready.variables()
    if case == "supervisor_replaced":       # SWUpdate goes on, an orphan that a script stands in for
        ready.machine.must("kill -9 $(pgrep -f '[r]unsv /run/service/swupdate'); sleep 3")
        assert ready.state() == "installing"
    arm(ready, logs)
    if case == "lost_while_armed":
        ready.machine.unplug()
    ready.wait_state("idle", within_s=10)
    result = ready.result()
    assert result["outcome"] == "refused"
    assert "armed" in result["sentence"]
    assert ready.protected()
    written = ready.sectors_written(7)
    time.sleep(5)
    assert ready.sectors_written(7) == written
    assert ready.variables() == variables
    assert ready.ended()[0] == 1
    if case == "armed":     # disarmed, its autopilot switched off: the next one isn't stopped by what was
        arm(ready, logs, False)
        time.sleep(3)
        ready.machine.unplug()
        wait_for("lost", lambda: ready.armed() is None)
        got = ready.install(bundle)
        assert got.code == 0, got.output


def test_marked_but_not_said(ready):
    """SWUpdate is ended between its mark in U-Boot's variables and its last word: what U-Boot will do counts."""
    bundle = bundles.bundle("good", NEWER)
    ready.begin(bundle, rate=bundle.stat().st_size // 40)
    ready.wait_state("installing")
    before = ready.starts()
    ready.machine.must("fw_setenv trial b && fw_setenv upgrade_available 1 && "
                       "read -r pid _ </run/pid/swupdate && kill -9 $pid")
    ready.wait_state("waiting-for-reboot", within_s=5)
    assert ready.result() is None
    # It was half written.
    ready.wait_restart(before)
    assert ready.slot() == "a"
    assert re.search("rolled back: slot b (damaged|unreadable)", wait_for("the result", ready.result)["sentence"])


def test_no_restart_into_the_new_slot(ready, logs):
    got = ready.install(bundles.bundle("good", NEWER))
    assert got.code == 0, got.output
    arm(ready, logs)
    assert ready.state() == "waiting-for-reboot"
    wait_for("ARM_STATUS", lambda: told(ready, "update in progress"), 10)
    got = ready.install(bundles.bundle("older", OLDER))     # another one meanwhile
    assert got.code == 1, got.output
    assert "waits for the reboot" in got.output
    no_restart(ready, 30)
    ready.machine.unplug()
    no_restart(ready, 20)
    ready.machine.plug()
    disarm_for_a_restart(ready, logs)
    assert ready.slot() == "b"


def test_the_trial_stands_still(ready, logs):
    on_trial(ready, bundles.bundle("good", NEWER))
    arm(ready, logs)
    ready.wait_state("trial")
    wait_for("ARM_STATUS", lambda: told(ready, "update in progress"), 10)
    no_restart(ready, LONG_ENOUGH_S)
    assert ready.state() == "trial"
    assert ready.variables()["upgrade_available"] == "1"
    arm(ready, logs, False)
    ready.wait_state("idle")
    assert ready.result()["outcome"] == "installed"


def test_a_failed_trial_waits_for_the_ground(ready, logs):
    on_trial(ready, bundles.bundle("no_bluetooth", NEWER, NO_BLUETOOTH.changes))
    ready.wait_state("trial")
    arm(ready, logs)
    no_restart(ready, LONG_ENOUGH_S)
    assert ready.result() is None
    arm(ready, logs, False)
    ready.wait_state("waiting-for-reboot")
    arm(ready, logs)            # again, before it restarted
    no_restart(ready, 20)
    disarm_for_a_restart(ready, logs)
    assert ready.slot() == "a"
    assert ready.result()["outcome"] == "rolled-back"


def test_after_a_watchdog_reset_armed_is_known_at_once(ready, logs):
    """In flight, on trial: the board is reset; nothing is decided, and it doesn't restart."""
    on_trial(ready, bundles.bundle("no_bluetooth", NEWER, NO_BLUETOOTH.changes))
    arm(ready, logs)
    before = ready.starts()
    ready.machine.qmp.command("system_reset")
    ready.wait_restart(before)
    wait_for("armed", ready.armed)
    ready.wait_state("trial")
    no_restart(ready, LONG_ENOUGH_S)
    assert ready.slot() == "b"
    assert ready.variables()["upgrade_available"] == "1"
