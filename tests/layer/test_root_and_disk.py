"""What Buildroot calls: the root completed, the disk made."""

import json
import os
import re
import shutil

import pytest

from .shared import COMMON, EPOCH, OVERLAY, TOP, call, must, needs, read


def bare_target(folder):
    """A root as Buildroot hands it to post-build.sh."""
    shutil.copytree(OVERLAY, folder, symlinks=True)
    (folder / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\nwww-data:x:33:33::/var/www:/bin/false\n")
    (folder / "etc/shadow").write_text("root:*:::::::\nwww-data:*:::::::\n")
    (folder / "etc/init.d/S50theirs").write_text("#!/bin/sh\n")
    return folder


def firmware(target, board):
    listing = TOP / f"board/{board}/firmware-files"
    names = [line for line in listing.read_text().splitlines() if line and not line.startswith("#")]
    for name in [*names, "brcm/other.bin"]:
        (target / "lib/firmware" / name).parent.mkdir(parents=True, exist_ok=True)
        (target / "lib/firmware" / name).write_text(name)
    return names


def post_build(target, board, images):
    images.mkdir(exist_ok=True)
    trusted = images.parent / "trusted.pem"
    trusted.write_text("a certificate\n")
    return call(COMMON / "post-build.sh", target, board, BINARIES_DIR=str(images), SOURCE_DATE_EPOCH=EPOCH,
                ODID_BUILD_TIME="1795000000", ODID_TRUSTED=str(trusted))


@needs("mkimage")
def test_the_root_is_completed(tmp_path):
    target, images = bare_target(tmp_path / "target"), tmp_path / "images"
    names = firmware(target, "cm4")
    (images).mkdir()
    (images / "odid-cm4.dtb").write_text("tree")
    for _ in range(2):          # Buildroot calls it again on the same root
        result = post_build(target, "cm4", images)
        assert result.returncode == 0, result.stderr
        (target / "etc/odid-release").write_text(read("overlay/etc/odid-release"))
    result = post_build(target, "cm4", images)
    release = (target / "etc/odid-release").read_text()
    assert "BOARD=cm4" in release and "BUILD_TIME=1795000000" in release and "@" not in release
    assert f"VERSION={(target / 'etc/odid/version').read_text().strip()}\n" in release
    assert (target / "etc/swupdate/trusted.pem").read_text() == "a certificate\n"
    assert (target / "etc/u-boot-initial-env").read_text() == read("board/cm4/u-boot.env")
    assert sorted(path.name for path in (target / "etc/init.d").iterdir()) == sorted(
        path.name for path in (OVERLAY / "etc/init.d").iterdir())
    assert (target / "etc/passwd").read_text().split(":")[0] == "root" and "www-data" not in (
        target / "etc/shadow").read_text()
    assert (target / "boot/board.dtb").read_text() == "tree"
    assert b"fdtcontroladdr" in (target / "boot/board.scr").read_bytes()
    found = {str(path.relative_to(target / "lib/firmware")) for path in (target / "lib/firmware").rglob("*")
             if path.is_file()}
    assert found == set(names)


@needs("mkimage")
def test_firmware_that_no_package_brought_is_an_error(tmp_path):
    target = bare_target(tmp_path / "target")
    names = firmware(target, "cm4")
    (target / "lib/firmware" / names[-1]).unlink()
    result = post_build(target, "cm4", tmp_path / "images")
    assert result.returncode == 1 and names[-1] in result.stderr


def test_a_service_of_another_layer_is_supervised(tmp_path):
    target = bare_target(tmp_path / "target")
    run = target / "etc/sv/camera/run"
    run.parent.mkdir()
    run.write_text("#!/bin/sh\n")
    result = post_build(target, "qemu", tmp_path / "images")
    assert result.returncode == 1 and "/etc/sv/camera/run" in result.stderr, "it can't be run"
    run.chmod(0o755)
    for _ in range(2):
        assert post_build(target, "qemu", tmp_path / "images").returncode == 0
    lines = (target / "etc/inittab").read_text().splitlines()
    assert lines.count("::respawn:/usr/bin/runsv /run/service/camera") == 1
    assert sum(line.endswith(" /run/service/odid-daemon") for line in lines) == 1
    assert os.readlink(run.parent / "finish") == "/lib/odid/finish"


DISK_TOOLS = ("genimage", "mkimage", "mkenvimage", "mke2fs", "mkfs.fat", "mcopy", "mdir", "mksquashfs", "sfdisk", "xxd")


def make_disk(folder, board):
    """images/disk.img of a slot that holds one file."""
    images = folder / "images"
    (images / "rpi-firmware").mkdir(parents=True)
    (folder / "root").mkdir()
    (folder / "root/file").write_text("content")
    must("mksquashfs", folder / "root", images / "rootfs.squashfs", "-quiet", "-no-progress", "-all-time", "0",
         "-mkfs-time", "0", "-all-root")
    for name in ("rpi-firmware/start4.elf", "rpi-firmware/fixup4.dat", "odid-cm4.dtb", "u-boot.bin"):
        (images / name).write_text(name)
    must(COMMON / "post-image.sh", images, board, BUILD_DIR=str(folder), SOURCE_DATE_EPOCH=EPOCH,
         PATH=os.environ["PATH"] + ":/usr/sbin:/sbin")
    return images / "disk.img"


@needs(*DISK_TOOLS)
@pytest.mark.parametrize("board, on_boot", [
    ("qemu", {"boot.scr"}),
    ("cm4", {"boot.scr", "config.txt", "start4.elf", "fixup4.dat", "odid-cm4.dtb", "u-boot.bin"}),
])
def test_the_disk(tmp_path, board, on_boot):
    disk = make_disk(tmp_path / "one", board)
    table = json.loads(must("sfdisk", "--json", disk, PATH=os.environ["PATH"] + ":/usr/sbin:/sbin"))["partitiontable"]
    assert (table["label"], table["id"]) == ("dos", "0x0d1d2024")
    places = {int(entry["node"].removeprefix(str(disk))): entry for entry in table["partitions"]}
    assert sorted(places) == [1, 2, 3, 5, 6, 7, 8]
    assert places[1]["bootable"] and places[1]["type"] == "c", "the boot ROM wants FAT first"
    assert all(entry["start"] % 2048 == 0 for entry in places.values())

    def files(number):
        volume = f"{disk}@@{places[number]['start'] * 512}"
        return set(must("mdir", "-b", "-i", volume, "::").replace("::/", "").split())
    assert files(1) == on_boot
    assert files(2) == {"odid.conf.example"}
    assert files(5) == {"uboot.env", "uboot-redund.env"}

    def octets(number, length=None):
        with open(disk, "rb") as file:
            file.seek(places[number]["start"] * 512)
            return file.read(length or places[number]["size"] * 512)
    volume, copy = octets(5), (tmp_path / "one/disk-inputs/uboot.env").read_bytes()
    copies = [match.start() for match in re.finditer(re.escape(copy), volume)]
    assert len(copies) == 2 and not any(at % 4096 for at in copies), "writing one touches no sector of the other"
    assert octets(6, 4) == b"hsqs" and octets(6) == octets(7)
    assert octets(8, 1082)[1080:] == b"\x53\xef", "ext4"

    again = make_disk(tmp_path / "two-in-a-longer-path", board)
    assert disk.read_bytes() == again.read_bytes(), "the same inputs, the same bytes"


@needs(*DISK_TOOLS)
def test_a_boot_file_that_is_missing_is_an_error(tmp_path):
    images = tmp_path / "images"
    images.mkdir()
    must("mksquashfs", TOP / "configs", images / "rootfs.squashfs", "-quiet", "-no-progress")
    result = call(COMMON / "post-image.sh", images, "cm4", BUILD_DIR=str(tmp_path), SOURCE_DATE_EPOCH=EPOCH,
                  PATH=os.environ["PATH"] + ":/usr/sbin:/sbin")
    assert result.returncode == 1 and "start4.elf" in result.stderr
