"""Power is cut at random instants of a configuration write: the appliance boots, broadcasts, and has the
old configuration or the new one, whole. And what only some cut out of hundreds does, done by hand."""

import random
import re
import struct
import time

import pytest

from . import disk
from .machine import configuration

SELF_ID = 3                 # message type
SUPERBLOCK = 1024, 1024     # ext4's first one: where on the volume, octets
WRITE_S = 0.25  # longer than it takes from the command to its rename being on the disk


def description(number):
    return f"Write number {number}"


def in_force(machine):
    return machine.must("odidctl get self_id.description").strip()


@pytest.mark.parametrize("cuts", [20, pytest.param(300, marks=pytest.mark.long)])
def test_power_cuts(make_machine, cuts):
    chance = random.Random(1)
    machine = make_machine("power-cut", config={"odid.conf": configuration(self_id={"description": description(0)})})
    machine.power_on()
    machine.wait_on_air()
    now, seen = description(0), {"old": 0, "new": 0}
    for number in range(1, cuts + 1):
        wanted = description(number)
        machine.shell.send(f"odidctl set self_id.description '{wanted}'")
        time.sleep(chance.uniform(0, WRITE_S))
        machine.cut_power()
        machine.power_on()
        machine.wait_on_air()
        found = in_force(machine)
        assert found in (now, wanted), f"cut {number}: {found!r}"
        assert machine.must("odidctl get basic_id.uas_id").strip() == "SSRS5GBG01", f"cut {number}"
        assert machine.run("ls /run/faults | grep -v -e autopilot -e watchdog").output == "", f"cut {number}"
        seen["old" if found == now else "new"] += 1
        now = found
    print(f"{cuts} cuts: {seen}")
    assert len([count for count in seen.values() if count]) == 2, "all cuts fell on the same side of the write"


def test_half_a_superblock(make_machine):
    """A cut while ext4 wrote its superblock; the setting is in force from the first broadcast on."""
    machine = make_machine("superblock", config={"odid.conf": configuration(self_id={"description": description(0)})})
    machine.power_on()
    machine.wait_on_air()
    machine.must(f"odidctl set self_id.description '{description(1)}'")
    machine.cut_power()
    at, size = SUPERBLOCK
    machine.disk.fill(disk.DATA, 0xA5, at + size // 2, size // 2)
    machine.power_on()
    machine.wait_on_air()
    heard = [one.data for one in machine.air.receptions("bt4", machine.powered_mono)]
    assert {data[4:27].rstrip(b"\0").decode() for data in heard if data[2] >> 4 == SELF_ID} == {description(1)}
    assert machine.run("ls /run/faults | grep -v -e autopilot -e watchdog").output == ""
    assert "ext4 rw" in machine.must("grep ' /data ' /proc/mounts")


def test_config_in_disorder(make_machine):
    """A cut while the password was written to CONFIG: a file whose clusters are free. The volume stays writable."""
    machine = make_machine("disorder")
    torn = ".maintenance-password.txt.new"
    machine.disk.put_config({torn: "A password that never was."})
    volume = machine.folder / "config"
    machine.disk.read(disk.CONFIG, volume)
    cluster = int(re.search(r"<(\d+)>", disk.call("mshowfat", "-i", volume, f"::{torn}"))[1])
    with open(volume, "r+b") as file:
        reserved, tables, table = struct.unpack("<14xHB5xH", file.read(24))
        for number in range(tables):
            file.seek((reserved + number * table) * disk.SECTOR + 2 * cluster)
            file.write(bytes(2))
    machine.disk.write(disk.CONFIG, volume)
    machine.power_on()
    machine.wait_on_air()
    assert "config" not in machine.must("ls /run/faults")
    machine.cut_power()
    assert b"assword" in machine.disk.read_config("maintenance-password.txt")
