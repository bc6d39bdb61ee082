"""python3 -m bench.image: builds build/appliance/{disk.img,slot.img,u-boot.bin,manifest.json}.
python3 -m bench.image --add-to IMAGE: the same in build/appliance/tested, out of a release image.

Called from the project's top folder. Prints a line for each step that had to be done.
"""

import argparse
import fcntl
import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from . import added, debian, disk, ours, programs, root
from .steps import BUILD, CACHE, BuildError, call, say, sha256

DAEMON = Path("package/odid-daemon")
OPENDRONEID = Path(os.environ.get("OPENDRONEID_DIR") or "build/opendroneid")
MAVLINK = Path(os.environ.get("MAVLINK_DIR") or "build/mavlink")


def build_time():
    """SOURCE_DATE_EPOCH, else the time of the commit: the same sources, the same bytes."""
    if os.environ.get("SOURCE_DATE_EPOCH"):
        return int(os.environ["SOURCE_DATE_EPOCH"])
    try:
        return int(subprocess.run(["git", "log", "-1", "--format=%ct"], check=True,
                                  capture_output=True, text=True).stdout)
    except (OSError, subprocess.CalledProcessError, ValueError):
        return int((DAEMON / "CMakeLists.txt").stat().st_mtime)     # not a git checkout


def release():
    text = (DAEMON / "CMakeLists.txt").read_text(encoding="utf-8")
    version = re.search(r"project\(odid-daemon VERSION (\S+)", text).group(1)
    return f'NAME="odid"\nVERSION={version}\nBUILD_TIME={build_time()}\nBOARD=qemu\n'


def place(source, target):
    """Replaces a product by a link or a sparse copy, in one step: somebody may be booting it."""
    part = target.with_name(f"{target.name}.part")
    part.unlink(missing_ok=True)
    call("cp", "--sparse=always", source, part)
    part.rename(target)


def build():
    wanted = root.contents()
    call("board/common/make-keys.sh", root.KEYS)
    indexes = debian.indexes(debian.Apt().sources)

    def sources(name):
        archive, hash_ = wanted["sources"][name]["archive"], wanted["sources"][name]["sha256"]
        return debian.source(indexes, name, archive, hash_, variant=f"_{name}", identity=[hash_])

    common, board = Path("board/common"), Path("board/qemu")
    # Two long compilations beside the rest; each is parallel in itself as well.
    with ThreadPoolExecutor(2) as pool:
        u_boot = pool.submit(
            programs.u_boot, sources("u-boot"),
            inputs=[common / "u-boot.fragment", board / "u-boot.fragment", board / "u-boot.env"])
        busybox_source = sources("busybox")
        packages = debian.packages(indexes, " ".join(wanted["packages"]))
        busybox = pool.submit(programs.busybox, busybox_source, inputs=[
            common / "busybox.fragment", common / "busybox-config.sh"])
        sysroot = debian.sysroot(packages)
        kernel = debian.kernel(packages)
        daemon = ours.daemon(
            sysroot, OPENDRONEID, MAVLINK, inputs=[
                DAEMON / "src", DAEMON / "CMakeLists.txt", OPENDRONEID, MAVLINK / "common"])
        guest = ours.guest_programs(root.GUEST, MAVLINK, inputs=[*sorted(root.GUEST.glob("*.c")), MAVLINK / "common"])
        busybox = busybox.result()
        initrd = root.initrd(kernel, sysroot, busybox, inputs=[root.GUEST / "init", root.CONTENTS])
        slot = root.slot(root.root(
            kernel, initrd, sysroot, busybox, daemon, guest, release(),
            inputs=[root.CONTENTS, root.PATCH, root.USERS, root.KEYS / "trusted.pem", root.ENVIRONMENT_DEFAULTS,
                    root.OVERLAY, root.GUEST / "root"]),
            inputs=[root.SEAL])
        whole = disk.disk(slot, inputs=[
            common / "genimage.cfg.in", common / "boot.cmd", common / "u-boot.fragment",
            board / "u-boot.env", disk.EXAMPLE])
        return {"disk.img": whole / "disk.img", "slot.img": slot / "slot.img",
                "u-boot.bin": u_boot.result() / "u-boot.bin", "cm4.dtb": root.board_tree(kernel) / "cm4.dtb"}


def main():
    parser = argparse.ArgumentParser(prog="bench.image")
    parser.add_argument("--add-to", metavar="IMAGE")
    image = parser.parse_args().add_to
    BUILD.mkdir(parents=True, exist_ok=True)
    with open(BUILD / "lock", "w", encoding="utf-8") as alone:
        fcntl.flock(alone, fcntl.LOCK_EX)       # a second builder waits, and finds all done
        make(BUILD / "tested" if image else BUILD,
             lambda: added.add_to(image, debian.indexes(debian.Apt().sources), MAVLINK) if image else build())


def make(place_in, products_of):
    try:
        place_in.mkdir(exist_ok=True)
        products = products_of()
        listing = place_in / "manifest.json"
        manifest = json.loads(listing.read_text(encoding="utf-8")) if listing.exists() else {}
        for name, path in products.items():
            # A step's folder is named by what it was made from.
            made_from = path.parent.name if CACHE in path.parents else sha256(path)
            if manifest.get(name, {}).get("made_from") == made_from and (place_in / name).exists():
                continue
            place(path, place_in / name)
            manifest[name] = {"sha256": sha256(path), "made_from": made_from}
            listing.write_text(json.dumps(manifest, indent=1) + "\n", encoding="utf-8")
            say(f"{place_in / name}")
    except BuildError as error:
        sys.exit(f"image: {error}")


if __name__ == "__main__":
    main()
