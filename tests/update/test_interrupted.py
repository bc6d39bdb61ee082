"""odid-update ended, or power cut, between two of its steps; and what comes beside an update that isn't decided."""

from . import LONG, bundles
from .appliance import wait_for
from .bundles import NEWER, NO_BLUETOOTH

pytestmark = LONG

RATE_S = 15         # so long a bundle takes to come
STALE = "odid.fallback=slot-a-damaged"


def begun(ready):
    """An install in the middle, and how often the machine had started before."""
    bundle, before = bundles.bundle("good", NEWER), ready.starts()
    ready.begin(bundle, rate=bundle.stat().st_size // RATE_S)
    ready.wait_state("installing")
    return before


def kept(ready, before):
    """The restart comes, and then the trial is passed."""
    ready.wait_restart(before)
    ready.machine.wait_on_air()
    ready.wait_state("trial")
    ready.wait_state("idle")
    assert ready.result()["outcome"] == "installed" and ready.version() == NEWER


def test_odid_update_started_again_while_a_bundle_is_written(ready):
    """It finds the install going on: no result before there is one."""
    before = begun(ready)
    ready.machine.must("sv term update; sleep 2")
    assert ready.result() is None
    assert ready.ended() == (0, ready.machine.must("cat /tmp/install"))
    kept(ready, before)


def test_odid_update_started_again_before_the_restart(ready):
    """Why the boot loader took another slot long ago says nothing about this update."""
    ready.machine.must(f"sed 's/$/ {STALE}/' /proc/cmdline >/tmp/cmdline && mount --bind /tmp/cmdline /proc/cmdline")
    before = begun(ready)
    ready.wait_state("waiting-for-reboot")
    ready.machine.must("sv term update")
    kept(ready, before)


def test_power_cut_between_the_reason_and_the_boot_loader_s_variables(ready):
    """As it leaves the disk: the reason is kept, the record gone, and the slot is on trial. It would pass."""
    before = begun(ready)
    ready.wait_restart(before)
    machine = ready.machine
    ready.wait_state("trial")
    machine.must(f"sv down update; rm /data/odid/trial.json; echo {NEWER} >/data/odid/rolled-back; "
                 """echo '{ "from": "1", "to": "2", "outcome": "rolled-back", "sentence": "The reason." }' """
                 ">/data/odid/update.json; sync")
    machine.cut_power()
    machine.power_on(wait=False)    # it may restart before there is a shell
    ready.wait_restart(1)
    machine.wait_on_air()
    assert ready.slot() == "a" and ready.result()["sentence"] == "The reason."
    ready.wait_state("idle")
    assert ready.variables()["upgrade_available"] == "0"


def test_what_is_refused_before_the_restart_does_not_hide_the_reason(ready):
    before, machine = ready.starts(), ready.machine
    assert ready.install(bundles.bundle("no_bluetooth", NEWER, NO_BLUETOOTH.changes)).code == 0
    ready.wait_restart(before)
    machine.wait_inside("the trial", "[ -S /run/swupdate/sockinstctrl ] && grep -q trial /run/odid-appliance/update-state.json")
    machine.must(f"curl -sfo /tmp/noise.swu {ready.server.url(bundles.noise('noise'))}")
    machine.wait_inside("the end of the trial", "grep -q waiting /run/odid-appliance/update-state.json")
    got = machine.run("odidctl update /tmp/noise.swu")
    assert got.code == 1 and ready.result()["outcome"] == "refused"
    ready.wait_restart(before + 1)
    machine.wait_on_air()
    result = wait_for("the result", ready.result)
    assert result["outcome"] == "rolled-back" and "Bluetooth" in result["sentence"], result


def test_settings_saved_on_trial_say_nothing_against_it(ready):
    """Each restarts the daemon, and the trial begins again."""
    before = begun(ready)
    ready.wait_restart(before)
    machine = ready.machine
    ready.wait_state("trial")
    for number in range(4):
        machine.must(f"sleep 14; odidctl set self_id.description 'Number {number}'")
    ready.wait_state("idle")
    assert ready.result()["outcome"] == "installed" and ready.version() == NEWER
    assert machine.must("odidctl get self_id.description").strip() == "Number 3"
