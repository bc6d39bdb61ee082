"""An appliance that is updated: a bench's machine, and what an update's tests ask of it."""

import contextlib
import json
import time

import parts
import patience
from bench import disk as disks
from bench.machine import Machine

from . import bundles
from .server import Server

STATE, RESULT = "/run/odid-appliance/update-state.json", "/data/odid/update.json"
START = "U-Boot 20"


wait_for = patience.wait_booted


class Appliance:
    def __init__(self, name=None, machine=None, **options):
        self.machine = machine or Machine(parts.ROOT / "build/update/runs" / name, **options)
        bundles.BUILD.mkdir(parents=True, exist_ok=True)
        self.server = Server(bundles.BUILD)

    def close(self):
        self.machine.close()
        self.server.stop()

    # --- on and off ----------------------------------------------------------

    def power_on(self, **options):
        self.machine.power_on(**options)
        self.machine.wait_on_air()

    def wait_ready(self):
        """Until it takes a bundle."""
        wait_for("SWUpdate and odid-update", lambda: self.machine.run(
            f"[ -S /run/swupdate/swupdateprog ] && [ -e {STATE} ] && usleep 1500000").code == 0)

    def starts(self):
        """How often the boot loader began since power-on."""
        return self.machine.console_text().count(START)

    def log(self):
        """Its end, without the kernel's part."""
        return self.machine.run("logread | grep -v kern | tail -n 60").output

    def wait_restart(self, before):
        """Until the boot loader has begun again and a shell answers; time.monotonic() of the former."""
        if self.machine.shell:
            self.machine.shell.close()
            self.machine.shell = None
        try:
            wait_for("a restart", lambda: self.starts() > before)
        except TimeoutError as error:
            self.machine.wait_shell()  # what comes after has a machine still
            raise TimeoutError(f"{error}; its log ends:\n{self.log()}") from None
        began = time.monotonic()
        self.machine.wait_shell()
        return began

    # --- asking --------------------------------------------------------------

    def _json(self, path):
        output = self.machine.run(f"cat {path}").output
        try:
            return json.loads(output)
        except ValueError:
            return None

    def state(self):
        return (self._json(STATE) or {}).get("state")

    def result(self):
        return self._json(RESULT)

    def wait_state(self, *states, within_s=None):
        return wait_for(f"the state {' or '.join(states)}", lambda: self.state() in states, within_s)

    def faults(self):
        """{name: text}; one may go while we look."""
        lines = self.machine.must("cd /run/faults; grep -s . * /dev/null || true").splitlines()
        return dict(line.split(":", 1) for line in lines)

    def slot(self):
        return self.machine.must("cat /run/odid-appliance/slot").strip()

    def version(self):
        return self.machine.must("cat /etc/odid/version").strip()

    def variables(self):
        return dict(line.split("=", 1) for line in self.machine.must("fw_printenv").splitlines() if "=" in line)

    def kept(self):
        """What is on /data: lines of sha256sum; without the update's own notes, and what is written at any time."""
        self.machine.wait_inside("the late host key", "[ -e /data/ssh/dropbear_ed25519_host_key ]")
        return set(self.machine.must("cd /data; find . -type f ! -name update.json ! -name trial.json ! -path './odid/flights*' "
                                     "! -path ./clock -exec sha256sum '{}' +").splitlines())

    def sectors_written(self, number=7):
        return int(self.machine.must(f"cat /sys/class/block/vda{number}/stat").split()[6])

    def protected(self, slot="b"):
        return self.machine.must(f"blockdev --getro /dev/disk/odid/slot-{slot}").strip() == "1"

    def armed(self):
        status = self.machine.status()
        return status and status["aircraft"]["armed"]

    def damage(self, partition, offset):
        """Overwrites a sector while power is off."""
        self.machine.disk.fill(partition, 0x5a, offset, disks.SECTOR)

    # --- doing ---------------------------------------------------------------

    def install(self, bundle, rate=None):
        """odidctl's exit code and output."""
        return self.machine.run(f"odidctl update {self.server.url(bundle, rate)}")

    def begin(self, bundle, rate=None):
        """The same, without waiting for its end; its output is in /tmp/install, its code in /tmp/code."""
        self.machine.must("rm -f /tmp/install /tmp/code")
        self.machine.shell.send(f"(odidctl update {self.server.url(bundle, rate)} >/tmp/install 2>&1; "
                                "echo $? >/tmp/code) &")

    def ended(self):
        """What was begun: (exit code, output)."""
        wait_for("odidctl", lambda: self.machine.run("[ -s /tmp/code ]").code == 0)
        return int(self.machine.must("cat /tmp/code")), self.machine.must("cat /tmp/install")


@contextlib.contextmanager
def readied(appliance):
    """It takes a bundle, and ends with what is done with it."""
    try:
        appliance.power_on()
        appliance.wait_ready()
        yield appliance
    finally:
        appliance.close()
