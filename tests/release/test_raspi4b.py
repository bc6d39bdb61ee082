"""The Compute Module's own image in QEMU's machine raspi4b: its U-Boot, environment, boot script, kernel
and device tree, root from its own partitions, as far as init, a daemon that reports its missing radios, an
update that is installed, and what becomes of its trial without radios.

Without the bench's additions and without radios; with them: tests/bench/test_flashed.py. Not covered
(docs/hardware-checklist.md): the firmware before U-Boot, whose part QEMU plays with the tree that it is given; PCIe and
Ethernet, which that machine doesn't have.
"""

import json
import os
import re
import shutil
import struct
import subprocess
import time
import zlib
from pathlib import Path

import pytest
from bench import disk, raspi4b

from .conftest import TOP, call, out_of
from .figures import figures

QEMU = TOP / "build/qemu-raspi/usr/bin/qemu-system-aarch64"
TIMEOUT_S = 200                 # its card reads 1.7 MB/s
RECORDED_S = 50                 # from the services' start: 30 s may pass before a channel counts as missing, 10 s
                                # between two writes of the flight record
TRIAL_S = 120                   # 60 s are its time


class Raspi:
    def __init__(self, out, folder):
        self.out, self.folder = out, folder
        self.card = disk.Card(folder / "card.img", out / "images/disk.img").path
        self.starts = {number: offset for number, (offset, _) in disk.places(self.card).items()}
        self.tree = raspi4b.firmware_tree(out / "images/odid-cm4.dtb", folder / "firmware.dtb")

    def set_variables(self, **variables):
        """In the board's environment, beside what this machine needs."""
        file = raspi4b.environment(self.folder / "env", **variables)
        for name in raspi4b.ENV_FILES:
            call("mcopy", "-o", "-i", f"{self.card}@@{self.starts[disk.ENV]}", file, f"::{name}")

    def variables(self):
        """What U-Boot would start with now: the newer one of its two files."""
        found = []
        for name in raspi4b.ENV_FILES:
            call("mcopy", "-o", "-i", f"{self.card}@@{self.starts[disk.ENV]}", f"::{name}", self.folder / name)
            data = (self.folder / name).read_bytes()
            crc, serial = struct.unpack("<IB", data[:5])
            assert crc == zlib.crc32(data[5:]), f"{name} is torn"
            found.append((serial, dict(line.split("=", 1) for line in data[5:].split(b"\0\0")[0].decode().split("\0"))))
        return max(found, key=lambda one: one[0])[1]

    def damage(self, partition, offset):
        with open(self.card, "r+b") as card:
            card.seek(self.starts[partition] + offset)
            octet = card.read(1)[0]
            card.seek(-1, 1)
            card.write(bytes([octet ^ 1]))

    def add(self, name, text):
        """A script to the root in slot A."""
        root, slot = self.folder / "root", self.folder / "slot"
        call("unsquashfs", "-quiet", "-no-progress", "-dest", root, self.out / "images/rootfs.squashfs")
        (root / name).write_text(text, encoding="utf-8")
        (root / name).chmod(0o755)
        call("mksquashfs", root, slot, "-comp", "zstd", "-b", "64K", "-no-xattrs", "-noappend", "-no-progress", "-quiet")
        shutil.rmtree(root)
        call(TOP / "board/common/seal-slot.sh", slot)
        self.write(disk.SLOT_A, slot.read_bytes())

    def put(self, name, file):
        """A file on /data, before it was ever mounted."""
        data = self.folder / "data"
        data.write_bytes(self.read(disk.DATA))
        call("debugfs", "-w", "-R", f"write {file} {name}", data)
        self.write(disk.DATA, data.read_bytes())

    def boot(self, until, stay_s=0):
        """The console's text up to a pattern, and how long it took; then it runs for stay_s, and its power is cut."""
        console = self.folder / "console"
        console.unlink(missing_ok=True)
        begun = time.monotonic()
        qemu = subprocess.Popen(
            [QEMU, "-M", "raspi4b", "-smp", "4", "-display", "none", "-kernel", self.out / "images/u-boot.bin",
             "-dtb", self.tree, "-drive", f"if=sd,format=raw,file={self.card}", "-serial", "null",
             "-chardev", f"file,id=console,path={console}", "-serial", "chardev:console", "-no-reboot"],
            stdin=subprocess.DEVNULL)
        try:
            text = ""
            while time.monotonic() - begun < TIMEOUT_S:
                text = console.read_text(errors="replace").replace("\r", "") if console.exists() else ""
                if all(re.search(pattern, text) for pattern in until):
                    took_s = time.monotonic() - begun
                    time.sleep(stay_s)
                    return text, took_s
                if "Kernel panic" in text or qemu.poll() is not None:
                    break
                time.sleep(0.5)
            lost = [pattern for pattern in until if not re.search(pattern, text)]
            raise AssertionError(f"not on the console: {lost}\n{text[-6000:]}")
        finally:
            qemu.kill()
            qemu.wait()

    def read(self, partition, octets=None):
        with open(self.card, "rb") as card:
            card.seek(self.starts[partition])
            return card.read(octets)

    def write(self, partition, data):
        with open(self.card, "r+b") as card:
            card.seek(self.starts[partition])
            card.write(data)

    def flight_record(self):
        """The lines that the board wrote to /data, after what a power-on does there: its journal is played."""
        data = self.folder / "data"
        data.write_bytes(self.read(disk.DATA))
        subprocess.run(["e2fsck", "-fy", "-E", "journal_only", data], capture_output=True, check=False)  # 1: it was
        names = re.findall(r"[\w-]+\.jsonl", call("debugfs", "-R", "ls -p /odid/flights", data))
        assert len(names) == 1, names
        return [json.loads(line) for line in call("debugfs", "-R", f"cat /odid/flights/{names[0]}", data).splitlines()]


@pytest.fixture(name="raspi")
def machine(tmp_path):
    out = out_of("cm4")
    if out is None or not (out / "images/disk.img").exists():
        pytest.skip("no image for cm4 is built: make image")
    if not QEMU.exists():
        pytest.skip("no QEMU with the machine raspi4b: make qemu-raspi")
    one = Raspi(out, tmp_path)
    yield one
    one.card.unlink()           # pytest keeps folders of the last runs


SERVICES = ["odid: boot: services", "odid: fault: wireless"]


def command_line(text):
    return re.search(r"Kernel command line: (.*)", text)[1]


def test_the_image_boots(raspi):
    raspi.set_variables()
    text, seconds = raspi.boot(SERVICES, RECORDED_S)
    (Path(TOP) / "build/image/raspi4b.log").write_text(text)
    figures("cm4", raspi4b_boot_s=round(seconds, 1))
    line = command_line(text)
    assert "odid.slot=a" in line and "root=PARTUUID=0d1d2024-06" in line and "console=ttynull" in line
    assert "odid.fallback" not in line
    assert "Run /sbin/init as init process" in text
    for script in ("mounts", "disk", "data", "secrets", "clock", "config", "services"):
        assert f"odid: boot: {script}" in text
    # What the daemon said of its radios is in the record of this power-on.
    faults = {one["what"]: one["text"] for one in raspi.flight_record() if one["event"] == "fault"}
    assert {"bt4", "wifi"} <= faults.keys(), faults


def test_a_damaged_slot_gives_way_to_the_other_one(raspi):
    raspi.set_variables()
    raspi.damage(disk.SLOT_A, 9_000_000)
    text, _ = raspi.boot(SERVICES)
    line = command_line(text)
    assert "odid.slot=b" in line and "root=PARTUUID=0d1d2024-07" in line
    assert "odid.fallback=slot-a-damaged" in line
    assert "odid: fault: slot: The boot loader took the other slot: slot a damaged." in text


# A technician's command; the machine has neither a network nor USB to give it by.
INSTALLS = """#!/bin/sh
(
	until [ -S /run/swupdate/swupdateprog ] && [ -e /run/odid-appliance/update-state.json ]; do sleep 1; done
	sleep 2
	odidctl update /data/test.swu
	echo "test: odidctl update ended with $?"
) </dev/null >/dev/kmsg 2>&1 &
"""


def test_an_update_is_installed(raspi):
    slot, bundle = raspi.out / "images/slot.img", raspi.folder / "test.swu"
    keys = Path(os.environ.get("KEYS") or TOP / "build/keys")
    if not (keys / "signing.key").exists():
        pytest.skip(f"the image's key to sign with isn't in {keys}")
    call(TOP / "board/common/make-bundle.sh", slot, "cm4", "9.9.9", keys, bundle)
    raspi.set_variables()
    raspi.add("etc/init.d/S99install", INSTALLS)
    raspi.put("test.swu", bundle)
    raspi.write(disk.SLOT_B, bytes(slot.stat().st_size))
    text, _ = raspi.boot(["test: odidctl update ended with"])
    assert "test: odidctl update ended with 0" in text, text[-6000:]
    variables = raspi.variables()
    assert (variables["slot"], variables["trial"], variables["upgrade_available"]) == ("a", "b", "1")
    assert raspi.read(disk.SLOT_B, slot.stat().st_size) == slot.read_bytes()
    # The machine lacks the means to restart itself.
    text, _ = raspi.boot(SERVICES)
    line = command_line(text)
    assert "odid.slot=b" in line and "odid.trial" in line and "odid.fallback" not in line


def test_a_trial_without_radios_is_given_up(raspi):
    """An installed update's first start. It ends before the restart, for which this machine lacks the means."""
    raspi.set_variables(slot="a", trial="b", upgrade_available="1")
    text, _ = raspi.boot(SERVICES, TRIAL_S)
    assert "odid.slot=b" in command_line(text)
    variables = raspi.variables()
    assert (variables["slot"], variables["upgrade_available"], variables["trial_failed"]) == ("a", "0", "b")
    said = [one["text"] for one in raspi.flight_record() if one["event"] == "update"]
    assert len(said) == 1 and "rolled back: Bluetooth 4 isn't on the air" in said[0], said
