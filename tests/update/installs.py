"""Is a bundle installed?"""

import time

import patience

from .appliance import wait_for

INSTALL_S = 60


def installed(appliance, bundle):
    """Gives it the bundle, and waits until its slot was started; when that was."""
    before, began = appliance.starts(), time.monotonic()
    got = appliance.install(bundle)
    took = time.monotonic() - began
    assert got.code == 0, got.output
    patience.promise("the install", took, INSTALL_S)
    print(f"install_s {took:.1f}")
    if appliance.machine.shell:
        appliance.machine.shell.close()
        appliance.machine.shell = None
    wait_for("the restart", lambda: appliance.starts() > before)
    return time.monotonic()


def accepted(appliance, bundle):
    """Is it installed? The restart for it is prevented, and afterwards all is as before."""
    machine = appliance.machine
    appliance.begin(bundle)
    try:
        appliance.begin(bundle)
        try:
            wait_for("the mark in U-Boot's variables",
                           lambda: appliance.variables().get("trial") == "b")
            return True
        except TimeoutError:
            return False
    finally:
        machine.must("sv down update")      # it would restart the board five seconds after the mark
        appliance.ended()
        machine.must("fw_setenv upgrade_available 0; fw_setenv trial; blockdev --setro /dev/disk/odid/slot-b; "
                     "rm -f /data/odid/trial.json; sv up update; sleep 1")
        appliance.wait_ready()
