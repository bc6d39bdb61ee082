"""What is handed on: the release, the bill of materials, and what it takes to make them."""

import os
import shutil

import pytest

from .shared import BOARDS, COMMON, call, must, needs


def built(out, content=b"disk"):
    """What Buildroot leaves of an image."""
    for folder in ("images", "legal-info/licenses/a"):
        (out / folder).mkdir(parents=True)
    with open(out / "images/disk.img", "wb") as disk:
        disk.write(content)
        disk.truncate(1 << 20)
    for name in ("images/u-boot.bin", "legal-info/manifest.csv", "legal-info/licenses/a/COPYING", "sbom.json"):
        (out / name).write_text(name)
    (out / "root").mkdir()
    (out / "root/file").write_bytes(content)
    return out


@needs("bmaptool", "xz")
def test_the_release(tmp_path):
    out = built(tmp_path / "out")
    must(COMMON / "pack-release.sh", "qemu", out, "odid-qemu-1.0")
    release = out / "release"
    assert sorted(str(path.relative_to(release)) for path in release.rglob("*") if path.is_file()) == [
        "SHA256SUMS", "licences/a/COPYING", "licences/manifest.csv", "odid-qemu-1.0.img.bmap",
        "odid-qemu-1.0.img.xz", "odid-qemu-1.0.sbom.json", "u-boot.bin"]
    must("sh", "-c", f"cd {release} && sha256sum --quiet -c SHA256SUMS")
    assert len((release / "SHA256SUMS").read_text().splitlines()) == 6
    # Without a bill of materials it is a release all the same, and says so.
    (out / "sbom.json").unlink()
    assert "odid-qemu-1.0.sbom.json" in must(COMMON / "pack-release.sh", "qemu", out, "odid-qemu-1.0")
    assert len((release / "SHA256SUMS").read_text().splitlines()) == 5
    # What a technician does with it: only what the map names is written.
    must("bmaptool", "-q", "copy", release / "odid-qemu-1.0.img.xz", tmp_path / "card")
    assert (tmp_path / "card").read_bytes() == (out / "images/disk.img").read_bytes()
    assert "<MappedBlocksCount> 1 " in (release / "odid-qemu-1.0.img.bmap").read_text()


@needs("bmaptool", "xz", "unsquashfs")
def test_two_builds_are_compared(tmp_path):
    outs = [built(tmp_path / "one"), built(tmp_path / "two"), built(tmp_path / "three", b"other")]
    for out in outs:
        must("mksquashfs", out / "root", out / "images/rootfs.squashfs", "-quiet", "-no-progress", "-all-time", "0")
        must(COMMON / "pack-release.sh", "cm4", out, "odid-cm4-1.0")
    compare = COMMON / "compare-images.sh"
    assert "the same" in must(compare, outs[0], outs[1])
    result = call(compare, outs[0], outs[2])
    assert result.returncode == 1
    assert "  odid-cm4-1.0.img.xz\n" in result.stdout and "Files one/file and other/file differ" in result.stdout
    assert call(compare, outs[0], tmp_path / "none").returncode != 0


def test_what_is_missing_to_make_an_image_is_said(tmp_path):
    check = COMMON / "check-host.sh"
    result = call(check, "none", tmp_path, tmp_path / "a b", PATH="/nowhere:" + os.environ["PATH"])
    assert result.returncode == 1
    assert "BOARD=none" in result.stderr and f"expected one of: {', '.join(BOARDS)}" in result.stderr
    assert "a space in its name" in result.stderr
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("sh", "dirname", "mkdir", "df", "awk", "make"):
        (tools / name).symlink_to(shutil.which(name))
    result = call(check, "cm4", tmp_path, tmp_path / "out", PATH=str(tools))
    assert result.returncode == 1 and "bmaptool is not installed" in result.stderr
    assert "make is not installed" not in result.stderr


def test_each_build_needs_its_room(tmp_path):
    """make reproducible makes two: that the second has none is said before the first begins."""
    disk = tmp_path / "df"
    disk.write_text("#!/bin/sh\nprintf 'header\\n/dev/disk 0 0 16777216 0%% /\\n'\n")  # 16 GiB
    disk.chmod(0o755)

    def complaints(*outs):
        return call(COMMON / "check-host.sh", "cm4", tmp_path, *outs, PATH=f"{tmp_path}:{os.environ['PATH']}").stderr
    one, other = tmp_path / "one", tmp_path / "other"
    assert "GiB" not in complaints(one) and "20 GiB are needed" in complaints(one, other)
    (one / "built").write_text("")
    assert "GiB" not in complaints(one, other)


def program(path, text):
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def test_the_list_of_licences_is_taken_by_its_hash(tmp_path):
    """Whatever a server says under its name: the image is made without it, and what is missing is named."""
    (tmp_path / "utils").mkdir()
    (tmp_path / "utils/generate-cyclonedx").write_text('CYCLONEDX_VERSION = "1.6"\n')
    wget = tmp_path / "wget"
    wget.write_text('#!/bin/sh\nwhile [ "$1" != -O ]; do shift; done\necho "{}" >"$2"\n')
    wget.chmod(0o755)
    result = call(COMMON / "licence-names.sh", tmp_path, tmp_path, PATH=f"{tmp_path}:{os.environ['PATH']}")
    listing = tmp_path / "cyclonedx/spdx-1.6.schema.json"
    assert result.returncode == 1 and str(listing) in result.stderr and "expected baa9d3bd" in result.stderr
    assert not list(listing.parent.iterdir())
    (tmp_path / "utils/generate-cyclonedx").write_text('CYCLONEDX_VERSION = "1.7"\n')
    assert "another version" in call(COMMON / "licence-names.sh", tmp_path, tmp_path).stderr


@pytest.mark.parametrize("generate, made", [
    ('printf %s "$(cat)" >"$6"', True),
    ('echo half >"$6"; echo Traceback >&2; exit 1', False),
], ids=["made", "fails"])
def test_an_image_is_made_without_a_bill_of_materials(tmp_path, generate, made):
    """Buildroot's program is the last step of an hour: whatever becomes of it, the image is there."""
    bill, common = tmp_path / "sbom.json", tmp_path / "common"
    program(tmp_path / "utils/generate-cyclonedx", generate)
    program(common / "licence-names.sh", "exit 0")
    shutil.copy(COMMON / "bill-of-materials.sh", common)
    bill.write_text("of another build")
    result = call("sh", "-c", f"echo info | {common}/bill-of-materials.sh {tmp_path} {tmp_path} {tmp_path} odid-cm4 1.0")
    assert result.returncode == 0 and bill.exists() == made and not list(tmp_path.glob("*.part"))
    assert made or "the image goes without one" in result.stderr
    program(common / "licence-names.sh", "exit 1")
    assert call("sh", "-c", f"{common}/bill-of-materials.sh {tmp_path} {tmp_path} {tmp_path} a 1 </dev/null").returncode == 0
    assert not bill.exists()
