"""Whose keys sign: by make itself, as who releases calls it."""

import re

import pytest

from .shared import COMMON, TOP, call, must, needs, read


def make_here(goal, **variables):
    alone = {name: "" for name in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    return call("make", "-C", TOP, "--no-print-directory", goal, *(f"{name}={value}" for name, value in variables.items()), **alone)


def keys(folder, *certificates):
    """certificates: what images are to trust besides its own."""
    must(COMMON / "make-keys.sh", folder)
    with open(folder / "trusted.pem", "a", encoding="utf-8") as trusted:
        trusted.writelines((path / "signing.crt").read_text() for path in certificates)
    return folder


def slot_that_trusts(folder, trusted):
    version = re.search(r"^project.odid-daemon VERSION ([0-9.]+)", read("package/odid-daemon/CMakeLists.txt"), re.M)[1]
    for name, text in {"etc/odid/version": f"{version}\n", "etc/swupdate/trusted.pem": trusted.read_text()}.items():
        (folder / "root" / name).parent.mkdir(parents=True)
        (folder / "root" / name).write_text(text)
    must("mksquashfs", folder / "root", folder / "slot.img", "-quiet", "-no-progress")
    return folder / "slot.img"


@needs("mksquashfs", "unsquashfs", "openssl", "cpio", "make")
@pytest.mark.parametrize("image, signer, made", [
    ("old", "old", True), ("both", "old", True),    # a rotation's first step: signed by the old key, it brings both
    ("new", "new", True),                           # and its second
    ("old", "new", False), ("new", "old", False),   # KEYS= was forgotten, at one of the two
])
def test_no_bundle_brings_an_image_that_does_not_trust_its_key(tmp_path, image, signer, made):
    """After it the aircraft took no bundle of the fleet's any more, nor was there a way back to that key."""
    old, new = keys(tmp_path / "old"), keys(tmp_path / "new")
    keys(tmp_path / "both", old, new)
    bundle = tmp_path / "x.swu"
    result = make_here("bundle", SLOT=slot_that_trusts(tmp_path, tmp_path / image / "trusted.pem"),
                       KEYS=tmp_path / signer, BOARD="qemu", BUNDLE=bundle)
    assert (result.returncode == 0) == bundle.exists() == made, result.stderr
    assert made or f"does not trust {tmp_path / signer}/signing.crt" in result.stderr and "make image KEYS=" in result.stderr


@needs("openssl", "make")
def test_a_folder_of_keys_that_was_mistyped_gets_no_new_pair(tmp_path):
    """An image of a key that nobody keeps was the result. Who builds images has trusted.pem alone."""
    for goal in ("keys", "keys-named"):
        result = make_here(goal, KEYS=tmp_path / "none")
        assert result.returncode != 0 and f"there is no {tmp_path}/none/trusted.pem" in result.stderr
    assert not (tmp_path / "none").exists()
    keys(tmp_path / "builder")
    for name in ("signing.key", "signing.crt"):
        (tmp_path / "builder" / name).unlink()
    assert make_here("keys", KEYS=tmp_path / "builder").returncode == 0
    assert [path.name for path in (tmp_path / "builder").iterdir()] == ["trusted.pem"]
