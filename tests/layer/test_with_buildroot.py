"""What only Buildroot itself can say.

BUILDROOT_DIR=<dir>: with a Buildroot there.
"""

import json
import os
import re
from pathlib import Path

import pytest

from .shared import BOARDS, COMMON, EPOCH, LAYER, TOP, call, must

BUILDROOT = os.environ.get("BUILDROOT_DIR")
with_buildroot = pytest.mark.skipif(not BUILDROOT, reason="no BUILDROOT_DIR=<dir> was given")


def buildroot(out, *words):
    return must("make", "-s", "--no-print-directory", "-C", Path(BUILDROOT).resolve(), f"O={out}",
                f"BR2_EXTERNAL={LAYER}", *words, MAKEFLAGS="", SOURCE_DATE_EPOCH=EPOCH)


@pytest.fixture(name="configured", scope="session", params=BOARDS)
def configured_for_a_board(request, tmp_path_factory):
    out = tmp_path_factory.mktemp(request.param)
    buildroot(out, f"odid_{request.param}_defconfig")
    return request.param, out


# Debian's own Python has Debian's packages.
SYSTEM = "/usr/bin:" + os.environ["PATH"]


@with_buildroot
@pytest.mark.skipif(call("python3", "-c", "import magic, flake8", PATH=SYSTEM).returncode != 0,
                    reason="not installed: python3-magic or python3-flake8")
def test_check_package():
    files = [path for path in LAYER.rglob("*") if path.is_file()]
    files += [path for path in (TOP / "package/odid-daemon").iterdir() if path.suffix == ".mk" or path.name == "Config.in"]
    output = must(Path(BUILDROOT) / "utils/check-package", "--br2-external", *files, PATH=SYSTEM)
    assert "0 warnings generated" in output or output.strip() == ""


@with_buildroot
def test_a_defconfig_survives(configured):
    board, out = configured
    must(COMMON / "check-config.sh", "Buildroot", out / ".config", TOP / f"configs/odid_{board}_defconfig")


@with_buildroot
def test_the_swupdate_that_is_tried_is_the_release_s():
    """What tests/setup/swupdate.sh builds for this machine."""
    tried = re.search(r"^version=(\S+)$", (TOP / "tests/setup/swupdate.sh").read_text(), re.M)[1]
    assert f"SWUPDATE_VERSION = {tried}\n" in Path(BUILDROOT, "package/swupdate/swupdate.mk").read_text()


@with_buildroot
def test_a_list_without_ours_is_an_error(configured):
    board, out = configured
    if board != "cm4":
        pytest.skip("the same for both")
    theirs = (out / ".config").read_text()
    ours = re.search(r'^BR2_ROOTFS_USERS_TABLES="(.*)"$', theirs, re.M)[1]
    for value, refused in (("/theirs/users.txt", True), (f"{ours} /theirs/users.txt", False)):
        result = call("make", "-s", "-C", Path(BUILDROOT).resolve(), f"O={out}", f"BR2_EXTERNAL={LAYER}", "-n", "skeleton",
                      f'BR2_ROOTFS_USERS_TABLES="{value}"', MAKEFLAGS="")
        assert ("BR2_ROOTFS_USERS_TABLES" in result.stderr) == refused, result.stderr[-500:]


@with_buildroot
def test_locations_hashes_and_licences_are_complete(configured):
    _, out = configured
    lost = []
    for name, package in json.loads(buildroot(out, "show-info")).items():
        if package["type"] == "rootfs" or package["virtual"] or not package.get("downloads"):
            continue
        if package["type"] == "target" and not package.get("licenses"):
            lost.append((name, "licence"))
        hashes = "".join(Path(BUILDROOT, file).read_text() for file in package.get("hashes", []))
        for download in package["downloads"]:
            if any(uri.startswith("local") for uri in download.get("uris", [])):
                continue
            if not download.get("uris"):
                lost.append((name, "location"))
            if not re.search(rf"^sha(256|512) +[0-9a-f]+ +{re.escape(download['source'])}$", hashes, re.M):
                lost.append((name, "hash"))
    assert not lost
