"""Which slot U-Boot starts, and what it says about it on the kernel's command line.

Each boot goes only as far as that line. The disk is a copy that the test has damaged."""

import json
import re
import subprocess

import patience
import pytest
from bench import disk as disks
from bench.machine import Qmp

pytestmark = pytest.mark.usefixtures("emulation_possible")

ENV_SIZE = "0x4000"
COMMAND_LINE = re.compile(r"Kernel command line: (.*)")
HOPELESS = "neither slot can be started"


class Bare:
    """The disk's copy, and a machine with nothing but that disk."""

    def __init__(self, folder):
        self.disk, self.folder = folder / "disk.img", folder
        subprocess.run(["cp", "--sparse=always", disks.IMAGE, self.disk], check=True)
        table = json.loads(subprocess.run(["sfdisk", "--json", self.disk], check=True,
                                          capture_output=True).stdout)["partitiontable"]
        self.place = {int(entry["node"].removeprefix(str(self.disk))):
                      (entry["start"] * disks.SECTOR, entry["size"] * disks.SECTOR)
                      for entry in table["partitions"]}

    def read(self, partition, offset, length):
        with open(self.disk, "rb") as file:
            file.seek(self.place[partition][0] + offset)
            return file.read(length)

    def write(self, partition, offset, data):
        assert offset + len(data) <= self.place[partition][1]
        with open(self.disk, "r+b") as file:
            file.seek(self.place[partition][0] + offset)
            file.write(data)

    def slot_length(self, partition):
        """What the squashfs says of itself, padded: the seal lies behind it."""
        used = int.from_bytes(self.read(partition, 0x28, 8), "little")
        return (used + 4095) // 4096 * 4096

    def flip_bit(self, partition, offset):
        self.write(partition, offset, bytes([self.read(partition, offset, 1)[0] ^ 0x10]))

    def wipe(self, partition):
        self.write(partition, 0, bytes(self.place[partition][1]))

    def volume(self):
        return f"{self.disk}@@{self.place[disks.ENV][0]}"

    def set_variables(self, **variables):
        """Sets variables in both files of the environment."""
        text = dict(line.split("=", 1) for line in self.variables())
        text.update({name: str(value) for name, value in variables.items()})
        (self.folder / "env").write_text("".join(f"{name}={value}\n" for name, value in text.items()))
        for name in ("uboot.env", "uboot-redund.env"):
            subprocess.run(["mkenvimage", "-r", "-s", ENV_SIZE, "-o", self.folder / name,
                            self.folder / "env"], check=True)
            subprocess.run(["mcopy", "-o", "-i", self.volume(), self.folder / name, f"::{name}"],
                           check=True)

    def variables(self):
        """The newer file's lines: U-Boot counts its writes in the octet before the text."""
        files = [subprocess.run(["mtype", "-i", self.volume(), f"::{name}"], check=True,
                                capture_output=True).stdout
                 for name in ("uboot.env", "uboot-redund.env")]
        newest = max(files, key=lambda data: data[4])
        return [line.decode() for line in newest[5:].split(b"\0\0")[0].split(b"\0")]

    def boot(self, until=COMMAND_LINE, restarts=0):
        """Words of the kernel's command line, {name: value}; or the text where `until` is found.
        Power is switched on; then the machine is restarted, as by a panic, so many times."""
        console, qmp = self.folder / "console", self.folder / "qmp"
        console.unlink(missing_ok=True)
        qemu = subprocess.Popen(
            ["qemu-system-aarch64", "-M", "virt,gic-version=3", "-cpu", "cortex-a72",
             "-accel", "tcg,thread=multi", "-smp", "2", "-m", "384", "-nodefaults", "-display", "none",
             "-qmp", f"unix:{qmp},server=on,wait=off", "-bios", disks.LOADER, "-chardev", f"file,id=console,path={console}",
             "-serial", "chardev:console", "-drive", f"if=none,id=disk,format=raw,file={self.disk}",
             "-device", "virtio-blk-device,drive=disk"], stdin=subprocess.DEVNULL)
        try:
            control = Qmp(qmp)
            begin = 0
            for _ in range(restarts):
                begin += self._wait(console, begin, COMMAND_LINE).end()
                control.command("system_reset")
            match = self._wait(console, begin, until)
            control.close()
            if until is not COMMAND_LINE:
                return match.string
            return dict(word.split("=", 1) for word in match[1].split() if "=" in word)
        finally:
            qemu.kill()
            qemu.wait()

    @staticmethod
    def _wait(console, begin, pattern):
        def said():
            return console.read_text(errors="replace")[begin:] if console.exists() else ""

        def found():
            text = said()
            match = re.search(pattern, text)
            return match if match and (pattern is not COMMAND_LINE or "\n" in text[match.end():]) else None
        try:
            # About 3 s where the machine has nothing else to do.
            return patience.wait_for("the line", found, every_s=0.1, limit_s=patience.BOOTED_S)
        except TimeoutError as error:
            raise TimeoutError(f"{error}:\n{said()[-2000:]}") from None


@pytest.fixture(name="bare")
def bare_machine(tmp_path):
    one = Bare(tmp_path)
    yield one
    one.disk.unlink()           # pytest keeps folders of the last runs


def test_the_committed_slot(bare):
    words = bare.boot()
    assert words["odid.slot"] == "a"
    assert words["root"] == "PARTUUID=0d1d2024-06"
    assert "odid.fallback" not in words
    bare.set_variables(slot="b")
    words = bare.boot()
    assert words["odid.slot"] == "b"
    assert words["root"] == "PARTUUID=0d1d2024-07"
    assert "odid.fallback" not in words


@pytest.mark.parametrize("where", ["kernel", "last file", "seal", "length"])
def test_one_wrong_bit_anywhere_is_reason_enough(bare, where):
    length = bare.slot_length(disks.SLOT_A)
    bare.flip_bit(disks.SLOT_A, {"kernel": 4_000_000, "last file": length * 3 // 4, "seal": length,
                                 "length": 0x2A}[where])
    words = bare.boot()
    assert words["odid.slot"] == "b"
    assert words["root"] == "PARTUUID=0d1d2024-07"
    assert words["odid.fallback"] in ("slot-a-damaged", "slot-a-unreadable")


def test_an_empty_slot(bare):
    bare.wipe(disks.SLOT_A)
    assert bare.boot()["odid.fallback"] == "slot-a-damaged"


def test_both_slots_damaged_starts_neither(bare):
    for slot in (disks.SLOT_A, disks.SLOT_B):
        bare.flip_bit(slot, 4_000_000)
    assert "Starting kernel" not in bare.boot(until=HOPELESS)


def test_a_trial_that_is_never_confirmed_ends_after_three_restarts(bare):
    bare.set_variables(slot="a", trial="b", upgrade_available=1, bootcount=0)
    words = bare.boot(restarts=3)
    assert words["odid.slot"] == "b"
    assert "odid.fallback" not in words
    bare.set_variables(slot="a", trial="b", upgrade_available=1, bootcount=0, restarts=0)
    words = bare.boot(restarts=4)
    assert words["odid.slot"] == "a"
    assert words["odid.fallback"] == "slot-b-failed-its-trial"
    lines = bare.variables()
    assert "upgrade_available=0" in lines
    assert "trial_failed=b" in lines
    # Nothing of the boot script's own is kept.
    own = {"first", "fallback", "try", "part", "trial", "power_on"}
    assert not own & {line.split("=")[0] for line in lines}
    assert "odid.fallback" not in bare.boot()


def test_switching_power_off_never_ends_a_trial(bare):
    bare.set_variables(slot="a", trial="b", upgrade_available=1, bootcount=0)
    for _ in range(10):
        words = bare.boot()
        assert words["odid.slot"] == "b"
        assert "odid.fallback" not in words
    # A board that took every start for a power-on would stop here.
    bare.set_variables(bootcount=20)
    assert bare.boot()["odid.fallback"] == "slot-b-failed-its-trial"


def test_a_committed_slot_that_keeps_restarting_gives_way_for_once(bare):
    words = bare.boot(restarts=3)
    assert words["odid.slot"] == "a"
    assert "odid.fallback" not in words
    words = bare.boot(restarts=1)
    assert words["odid.slot"] == "b"
    assert words["odid.fallback"] == "slot-a-restarted-three-times"
    assert bare.boot()["odid.slot"] == "a"


def test_a_damaged_slot_on_trial_gives_way_at_once(bare):
    bare.set_variables(slot="a", trial="b", upgrade_available=1, bootcount=0)
    bare.flip_bit(disks.SLOT_B, 4_000_000)
    words = bare.boot()
    assert words["odid.slot"] == "a"
    assert words["odid.fallback"] == "slot-b-damaged"


def test_a_lost_environment_starts_the_first_slot(bare):
    bare.set_variables(slot="b")
    subprocess.run(["mdel", "-i", bare.volume(), "::uboot.env"], check=True)
    assert bare.boot()["odid.slot"] == "b"      # the other file has it as well
    bare.wipe(disks.ENV)
    assert bare.boot()["odid.slot"] == "a"
