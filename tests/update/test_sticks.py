"""Sticks made by an enemy. With the handler as it was, each of these restarted the board, or installed what
nobody had asked for."""

import re
import struct

import pytest
from bench.disk import call

from . import autopilot, bundles
from .appliance import wait_for
from .bundles import NEWER, OLDER
from .sticks import SPARE, blank, plug, pull, stick

NAMES = 65_536      # what FAT allows; the kernel looks at each when it mounts
END = 0x0FFFFFFF    # of a chain of clusters


@pytest.fixture
def plugged(grounded):
    """Plugs one in, waits for what is said of it, pulls it."""
    machine, starts = grounded.machine, grounded.starts()

    def plug_in(image, says=None, seconds=60):
        length = len(machine.console_text())
        plug(machine, image)
        if says:
            wait_for(f"the console to say {says}", lambda: re.search(says, machine.console_text()[length:]), seconds)

    yield plug_in
    pull(machine)
    assert grounded.starts() == starts and grounded.state() == "idle"
    machine.wait_on_air()


def damaged_ext4(name, file):
    """That says what the kernel has to do about damage, and has some: its folder."""
    image, folder = blank(name, [file]), bundles.BUILD / f"{name}.files"
    folder.mkdir(exist_ok=True)
    (folder / file.name).write_bytes(file.read_bytes())
    call("mke2fs", "-q", "-F", "-t", "ext4", "-e", "panic", "-d", folder, image)
    data = image.read_bytes()
    at = data.index(file.name.encode()) & ~4095
    with open(image, "r+b") as out:
        out.seek(at)
        out.write(b"\xff" * 512)
    return image


def test_a_file_system_that_says_panic(plugged):
    plugged(damaged_ext4("panic", bundles.bundle("good", NEWER)), "left alone: ext4")


def crowded(name):
    """A FAT whose folder has very many names, all of them bundles'."""
    image, folder = bundles.BUILD / f"{name}.stick", NAMES * 32
    with open(image, "wb") as out:
        out.truncate(folder + SPARE)
    call("mkfs.fat", "-F", "32", "-s", "1", image)
    with open(image, "r+b") as disk:
        boot = disk.read(512)
        (sector, reserved, tables), (size,) = struct.unpack_from("<HxHB", boot, 11), struct.unpack_from("<I", boot, 36)
        clusters = -(-folder // sector)
        # The folder's clusters, one after the other, from 2 on.
        chain = struct.pack(f"<{clusters}I", *range(3, clusters + 2), END)
        for table in range(tables):
            disk.seek((reserved + table * size) * sector + 8)
            disk.write(chain)
        disk.seek((reserved + tables * size) * sector)
        for number in range(NAMES):
            disk.write(b"%08dSWU" % number + bytes(21))
    return image


def test_a_very_full_folder(plugged, grounded):
    """750,000 in one folder exhausted it: now the handler has its own, and reads as few as it needs."""
    plugged(crowded("crowded"), "stick .*no bundle", 120)
    assert int(grounded.machine.must("cat /sys/fs/cgroup/stick/memory.max")) == 48 << 20
    assert "oom-kill" not in grounded.machine.console_text()


def behind_the_name(bundle, name):
    """The bundle, with another version behind its first file's name, where nobody reads it."""
    made, data = bundles.BUILD / f"{name}.swu", bundle.read_bytes()
    said = b'sw-description\0\n\tversion = "99.0.0";\n\thardware-compatibility: [ "odid-qemu" ];\n\0'
    head = data[:94] + b"%08X" % len(said) + data[102:110] + said
    made.write_bytes(head + bytes(-len(head) % 4) + data[(110 + 15 + 3) & ~3:])
    return made


def test_a_version_behind_the_name(plugged, grounded):
    bundle = behind_the_name(bundles.bundle("older", OLDER), "behind")
    plugged(stick("behind", bundle), "stick .*no bundle")
    assert grounded.result() is None


def test_a_folder_is_judged_by_the_gate_too(grounded):
    """By the description that was verified, whatever the stick's first look said."""
    machine = grounded.machine
    machine.must("echo 0.0.0 >/tmp/version; mount --bind /tmp/version /etc/odid/version")  # for odidctl only
    try:
        url = grounded.server.url(bundles.bundle("older", OLDER))
        # The gate comes before the slot: as much of it as fits.
        machine.must(f"mkdir -p /tmp/folder; curl -s {url} | head -c 1000000 >/tmp/folder/older.swu")
        got = machine.run("odidctl update /tmp/folder")
    finally:
        machine.must("umount /etc/odid/version; rm -r /tmp/folder")
    assert got.code == 1 and f"Version {OLDER} is older than" in got.output, got.output


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    return {armed: autopilot.generate(folder, armed) for armed in (False, True)}


def test_a_file_that_came_to_nothing_is_left_alone(ready):
    """A copy that was cut short, on a stick that was forgotten in the aircraft: the other slot was written at each
    power-on, and the aircraft kept on the ground meanwhile."""
    image = stick("cut", bundles.cut_short(bundles.bundle("good", NEWER), "cut"))
    plug(ready.machine, image)
    wait_for("the refusal", lambda: (ready.result() or {}).get("outcome") == "refused")
    ready.wait_state("idle")
    written = ready.sectors_written(7)
    pull(ready.machine)
    plug(ready.machine, image)
    wait_for("that it is left alone", lambda: "it is left alone" in ready.machine.console_text())
    assert ready.sectors_written(7) == written and ready.state() == "idle"


def test_nothing_is_read_while_armed(plugged, grounded, logs):
    machine = grounded.machine
    machine.play(logs[True])
    wait_for("armed", grounded.armed, 30)
    length = len(machine.console_text())
    plugged(stick("nothing", bundles.bundle("cm4", NEWER, board="cm4")))
    wait_for("the stick", lambda: machine.run("[ -b /dev/sda ]").code == 0)
    read = "usleep 3000000; cut -c-20 /sys/class/block/sda/stat"
    before = machine.must(read)     # the kernel looks for partitions
    assert machine.must(read) == before and "stick sda" not in machine.console_text()[length:]
    machine.play(logs[False])
    wait_for("disarmed", lambda: grounded.armed() is False, 30)
    wait_for("a look at it", lambda: "no bundle" in machine.console_text()[length:])
