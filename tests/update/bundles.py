"""Bundles to try: the system of the disk under test, with one thing about it changed."""

import hashlib
import os
import re
import shutil
import subprocess
from collections import namedtuple
from pathlib import Path

import parts
from bench import disk as disks
from bench.disk import call

BUILD = parts.ROOT / "build/update"
COMMON = parts.ROOT / "board/common"
KEYS = Path(os.environ.get("KEYS") or parts.ROOT / "build/keys")
NEWER, OLDER = "9.9.0", "0.0.1"


# changes: what is wrong with the new slot; says: the reason that is kept; itself: the new slot gives
# itself up, rather than the boot loader.
Failure = namedtuple("Failure", "name changes says itself", defaults=(True,))
# It stands for a missing firmware file: no Bluetooth controller comes.
NO_BLUETOOTH = Failure("no_bluetooth", {"usr/sbin/hci-attach": None}, "Bluetooth.*isn't on the air")
NO_KERNEL = Failure("no_kernel", {"boot/Image": b"no kernel"}, "slot b kernel refused", False)


def running_version():
    return (root() / "etc/odid/version").read_text(encoding="utf-8").strip()


def root():
    """The files of the disk's slot, unpacked once for each disk."""
    stamp = disks.IMAGE.stat()
    folder = BUILD / f"root-{stamp.st_size}-{int(stamp.st_mtime)}"
    if not folder.exists():
        for old in BUILD.glob("root-*"):
            shutil.rmtree(old)
        BUILD.mkdir(parents=True, exist_ok=True)
        image = disks.Disk(BUILD / "disk")
        image.read(disks.SLOT_A, BUILD / "slot")
        call("unsquashfs", "-no-progress", "-quiet", "-d", f"{folder}.part", BUILD / "slot")
        Path(f"{folder}.part").rename(folder)
    return folder


def slot(name, changes):
    """A sealed slot with {path: content} changed: bytes, or None for a file that is not there."""
    source, target = root(), BUILD / f"{name}.slot"
    fingerprint = hashlib.sha256(repr((source.name, sorted(changes.items()))).encode()).hexdigest()
    mark = BUILD / f"{name}.made-of"
    if target.exists() and mark.exists() and mark.read_text(encoding="utf-8") == fingerprint:
        return target
    tree = BUILD / f"{name}.tree"
    shutil.rmtree(tree, ignore_errors=True)
    call("cp", "-al", source, tree)
    for path, content in changes.items():
        file = tree / path
        mode = file.stat().st_mode & 0o777 if file.is_file() else 0o755
        file.unlink(missing_ok=True)        # never through the link to the original
        if content is not None:
            file.write_bytes(content)
            file.chmod(mode)
    target.unlink(missing_ok=True)
    call("mksquashfs", tree, target, "-comp", "zstd", "-Xcompression-level", "3",
         "-action", "uncompressed@name(Image)", "-b", "64K", "-all-root",
         "-no-xattrs", "-no-exports", "-noappend", "-no-progress", "-quiet")
    shutil.rmtree(tree)
    call(COMMON / "seal-slot.sh", target)
    mark.write_text(fingerprint, encoding="utf-8")
    return target


def bundle(name, version, changes=None, board=None, keys=KEYS, slot_file=None):
    """An ordinary bundle, made as a release's is. Its slot is the running system's unless changed."""
    target = BUILD / f"{name}.swu"
    source = slot_file or slot(name, {"etc/odid/version": f"{version}\n".encode()} | (changes or {}))
    call(COMMON / "make-bundle.sh", source, board or disks.board(), version, keys, target)
    return target


def other_keys():
    """Somebody else's."""
    folder = BUILD / "other-keys"
    call(COMMON / "make-keys.sh", folder)
    return folder


# --- bundles that something is wrong with ------------------------------------


def parts_of(swu):
    """The files of a bundle, in their order."""
    folder = BUILD / "parts"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with open(swu, "rb") as stream:
        call_cpio(["-i", "--quiet"], folder, stdin=stream)
    return folder


def call_cpio(words, folder, **streams):
    subprocess.run(["cpio", *words], check=True, cwd=folder, **streams)


def sha256_in(source):
    """What the description says of the slot."""
    return re.search(r'sha256 = "([0-9a-f]{64})"', description_of(source))[1]


def slot_of(source):
    return (parts_of(source) / "slot.img").read_bytes()


def put_together(folder, names, target, form="crc"):
    with open(target, "wb") as out:
        subprocess.run(["cpio", "--quiet", "-o", "-H", form], input="".join(f"{name}\n" for name in names),
                       text=True, check=True, cwd=folder, stdout=out)
    return target


def description_of(source):
    return (parts_of(source) / "sw-description").read_text(encoding="utf-8")


def signature_of(source):
    return (parts_of(source) / "sw-description.sig").read_bytes()


def described(source, name, edit, keys=KEYS):
    """The bundle with its description edited; signed again by those keys, or (None) not."""
    folder = parts_of(source)
    description = folder / "sw-description"
    text = description.read_text(encoding="utf-8")
    edited = edit(text)
    assert edited != text, "the edit did nothing"
    description.write_text(edited, encoding="utf-8")
    if keys:
        call("openssl", "cms", "-sign", "-binary", "-nosmimecap", "-outform", "DER", "-md", "sha256",
             "-signer", keys / "signing.crt", "-inkey", keys / "signing.key", "-in", description,
             "-out", folder / "sw-description.sig")
    return put_together(folder, ["sw-description", "sw-description.sig", "slot.img"], BUILD / f"{name}.swu")


def unsigned(source, name):
    return put_together(parts_of(source), ["sw-description", "slot.img"], BUILD / f"{name}.swu")


def signed_with(source, name, signature):
    folder = parts_of(source)
    (folder / "sw-description.sig").write_bytes(signature)
    return put_together(folder, ["sw-description", "sw-description.sig", "slot.img"], BUILD / f"{name}.swu")


def damaged(source, name):
    """One bit of the slot is another one; the archive's own sums are right again."""
    folder = parts_of(source)
    with open(folder / "slot.img", "r+b") as file:
        file.seek(file.seek(0, os.SEEK_END) // 2)
        octet = file.read(1)
        file.seek(-1, os.SEEK_CUR)
        file.write(bytes([octet[0] ^ 0x10]))
    return put_together(folder, ["sw-description", "sw-description.sig", "slot.img"], BUILD / f"{name}.swu")


def cut_short(source, name):
    target = BUILD / f"{name}.swu"
    with open(source, "rb") as whole, open(target, "wb") as part:
        part.write(whole.read(source.stat().st_size * 2 // 3))
    return target


def without_sums(source, name):
    """An archive that has no sums of its own."""
    return put_together(parts_of(source), ["sw-description", "sw-description.sig", "slot.img"], BUILD / f"{name}.swu",
                        form="newc")


def filled(source, part):
    """What the slot is and what follows it when zeros take the place of what is missing of it."""
    whole, slot = source.read_bytes(), slot_of(source)
    kept, end = part.stat().st_size - whole.index(slot[:4096]), whole.rindex(b"070701")
    return slot[:kept] + bytes(len(slot) - kept), bytes(end - part.stat().st_size) + whole[end:]


def noise(name):
    target = BUILD / f"{name}.swu"
    target.write_bytes(hashlib.sha256(b"noise").digest() * 40000)
    return target
