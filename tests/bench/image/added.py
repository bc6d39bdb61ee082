"""A release image with the bench's own additions in its slots: guest/, and in QEMU's Debian's tcpdump and
wpa_supplicant. What is tested, kernel, programs, libraries, boot loader, stays as it was built.
"""

from pathlib import Path

from bench.disk import SLOT_A, SLOT_B, board, places

from . import debian, ours, root
from .steps import BuildError, call, sha256, step

# Of the packages in contents.toml. They have libraries of their own: the image's may be built with less.
PROGRAMS = ("usr/bin/tcpdump", "usr/sbin/wpa_supplicant", "usr/sbin/wpa_cli")
OWN = Path("usr/lib/bench")
# But the C library is the image's: a newer one runs what was linked with an older one.
C_LIBRARY = {"ld-linux-aarch64.so.1", "libc.so.6", "libdl.so.2", "libm.so.6", "libpthread.so.0", "libresolv.so.2", "librt.so.1"}


def slot_of(image, out):
    """The squashfs in slot a; its own head says how long it is."""
    offset, _ = places(image)[SLOT_A]
    with open(image, "rb") as file:
        file.seek(offset)
        head = file.read(96)
        if head[:4] != b"hsqs":
            raise BuildError(f"{image}: slot a holds no squashfs")
        file.seek(offset)
        Path(out).write_bytes(file.read((int.from_bytes(head[40:48], "little") + 4095) // 4096 * 4096))


def put_program(tree, sysroot, name):
    """The program and its libraries in a folder of the bench's, and a script in its place."""
    own = tree / OWN
    program = own / Path(name).name
    root.put(sysroot / name, program)
    wanted = [program]
    while wanted:
        found = {library for libraries in root.needed(wanted).values() for library in libraries}
        wanted = [root.put_library(own, sysroot, library, name) for library in sorted(found - C_LIBRARY)
                  if not (own / "lib" / library).exists()]
    script = tree / name
    script.write_text(f'#!/bin/sh\nLD_LIBRARY_PATH=/{OWN}/lib exec /{OWN}/{program.name} "$@"\n', encoding="utf-8")
    script.chmod(0o755)


@step
def tested_root(out, image, sysroot, guest_programs, _hash):
    """Release image's root and the bench's additions put together."""
    slot_of(image, out.with_name("slot.part"))
    out.rmdir()
    call("unsquashfs", "-quiet", "-no-progress", "-dest", out, out.with_name("slot.part"))
    out.with_name("slot.part").unlink()
    root.put(root.GUEST / "root", out)
    if board(image) == "cm4":  # its radios are found as ever, and the judge hears them outside
        return
    root.put(guest_programs / "hci-attach", out / "usr/sbin/hci-attach")
    for name in PROGRAMS:
        put_program(out, sysroot, name)


@step
def tested_disk(out, image, slot, _hash):
    """Release image's disk made, with that root in both slots."""
    call("cp", "--sparse=always", image, out / "disk.img")
    data = (slot / "slot.img").read_bytes()
    with open(out / "disk.img", "r+b") as disk:
        for number in (SLOT_A, SLOT_B):
            offset, size = places(image)[number]
            if len(data) > size:
                raise BuildError(f"{image}: with the bench's additions the slot has {len(data)} octets, "
                                 f"and partition {number} has room for {size}")
            disk.seek(offset)
            disk.write(data)


def add_to(image, indexes, mavlink):
    """{product's name: path} for a release image; what else it is started with lies beside it."""
    image = Path(image).resolve()
    if not image.exists():
        raise BuildError(f"{image} is missing: make image makes it")
    beside = [image.with_name(name) for name in ("u-boot.bin", *(["odid-cm4.dtb"] if board(image) == "cm4" else []))]
    for path in beside:
        if not path.exists():
            raise BuildError(f"{path} is missing: make image BOARD={board(image)} makes it")
    sysroot = debian.sysroot(debian.packages(indexes, " ".join(root.contents()["packages"])))
    guest = ours.guest_programs(root.GUEST, mavlink, inputs=[*sorted(root.GUEST.glob("*.c")), mavlink / "common"])
    tree = tested_root(image, sysroot, guest, sha256(image), inputs=[root.GUEST / "root"])
    slot = root.slot(tree, variant="_tested", inputs=[root.SEAL])
    disk = tested_disk(image, slot, sha256(image))
    return {"disk.img": disk / "disk.img", "slot.img": slot / "slot.img"} | {path.name: path for path in beside}
