"""The slot: the root's files put together, the initial file system, the squashfs of both."""

import os
import re
import shutil
import tomllib
from pathlib import Path

from models.bluetooth_chip import patch_file

from .ours import CROSS
from .steps import BuildError, call, files_of, step

CONTENTS = Path("tests/bench/image/contents.toml")
GUEST = Path("tests/bench/guest")
PATCH = Path("tests/models/bluetooth_chip.py")     # a patch file that the model of the chip takes
OVERLAY = Path("overlay")
USERS = Path("board/common/users.txt")
ENVIRONMENT_DEFAULTS = Path("board/qemu/u-boot.env")
KEYS = Path(os.environ.get("KEYS") or "build/keys")
SEAL = Path("board/common/seal-slot.sh")
FOLDERS = ("boot", "data", "dev", "proc", "root", "run", "sys", "tmp", "var")
LIBRARY_FOLDERS = ("usr/lib/aarch64-linux-gnu", "usr/lib")
# Squashfs's own time; nothing in the appliance reads a file's time out of the root.
EPOCH = "0"
ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "SOURCE_DATE_EPOCH"}


def contents():
    return tomllib.loads(CONTENTS.read_text(encoding="utf-8"))


def put(source, target):
    """Copies a file, link or folder; modes are 755 or 644, whatever the umask here."""
    if source.is_dir() and not source.is_symlink():
        for path in sorted(source.rglob("*")):
            if path.is_symlink() or path.is_file():
                put(path, target / path.relative_to(source))
            else:
                (target / path.relative_to(source)).mkdir(parents=True, exist_ok=True)
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    target.unlink(missing_ok=True)              # not through a BusyBox link that is there
    if source.is_symlink():
        target.symlink_to(source.readlink())
    else:
        shutil.copyfile(source, target)
        target.chmod(0o755 if source.stat().st_mode & 0o100 else 0o644)


def write(target, text, mode=0o644):
    target.parent.mkdir(parents=True, exist_ok=True)
    target.unlink(missing_ok=True)
    target.write_text(text, encoding="utf-8")
    target.chmod(mode)


def needed(programs):
    """{program: [libraries it names]}; files that aren't programs are left out."""
    programs = [path for path in programs if not path.is_symlink()
                and path.open("rb").read(4) == b"\x7fELF"]
    listing = call(f"{CROSS}readelf", "-dW", *programs)
    parts = [listing] if len(programs) == 1 else re.split(r"^File: .*$", listing, flags=re.M)[1:]
    return {program: re.findall(r"\(NEEDED\).*\[(.+)\]", part)
            for program, part in zip(programs, parts, strict=True)}


def put_libraries(root, sysroot, programs):
    """Puts the libraries that programs need, and those that these need, into /lib."""
    put_library(root, sysroot, "ld-linux-aarch64.so.1", "every program")
    while programs:
        added = []
        for program, libraries in needed(programs).items():
            added += [put_library(root, sysroot, name, program.relative_to(root))
                      for name in libraries if not (root / "lib" / name).exists()]
        programs = added


def put_library(root, sysroot, name, why):
    for folder in LIBRARY_FOLDERS:
        source = sysroot / folder / name
        if source.exists() and name.startswith("libicudata."):
            return without_contents(source.resolve(), root / "lib" / name)
        if source.exists():
            put(source.resolve(), root / "lib" / name)
            return root / "lib" / name
    raise BuildError(f"{name}, needed by {why}, is in none of the packages of {CONTENTS}")


def without_contents(source, target):
    """ICU's tables, 30 MB for XML in other encodings: libarchive's, for archives of Apple's. Their symbol stays."""
    (name,) = re.findall(r"\bicudt\d+_dat$", call(f"{CROSS}nm", "-D", "--defined-only", source), re.M)
    program = target.with_suffix(".c")
    write(program, f"const double {name}[2];\n")
    call(f"{CROSS}gcc", "-shared", "-fPIC", "-nostdlib", "-Wl,--build-id=none", f"-Wl,-soname,{target.name}",
         "-o", target, program)
    program.unlink()
    return target


def put_busybox(root, busybox):
    put(busybox / "busybox", root / "bin/busybox")
    for line in (busybox / "busybox.links").read_text(encoding="utf-8").split():
        link = root / line.lstrip("/")
        if link.name not in ("busybox", "linuxrc"):
            link.parent.mkdir(parents=True, exist_ok=True)
            link.symlink_to("/bin/busybox")


def put_modules(root, kernel, names):
    """Puts kernel modules and those they need, and their indexes."""
    (release,) = (kernel.absolute() / "lib/modules").iterdir()
    target = root / "lib/modules" / release.name
    for name in names:
        listing = call("modprobe", "-C", "/dev/null", "-d", kernel, "-S", release.name,
                       "--show-depends", name)
        for path in re.findall(r"^insmod (\S+)", listing, re.M):
            put(Path(path), target / Path(path).relative_to(release))
    for index in ("modules.order", "modules.builtin", "modules.builtin.modinfo"):
        put(release / index, target / index)
    call("depmod", "-b", root, release.name)
    for index in target.glob("modules.*"):
        if index.name not in ("modules.dep", "modules.alias", "modules.symbols",
                              "modules.builtin", "modules.softdep"):
            index.unlink()              # kmod's; BusyBox reads the others


def users():
    """passwd, group and shadow: root and nobody, and those of the users' table."""
    groups = {"root": 0, "tty": 5, "disk": 6, "dialout": 20, "nogroup": 65534}
    members = {}
    passwd = ["root:x:0:0:root:/root:/bin/sh", "nobody:x:65534:65534:nobody:/:/bin/false"]
    shadow = ["root:*:::::::", "nobody:*:::::::"]
    next_group = 100
    for number, line in enumerate(USERS.read_text(encoding="utf-8").splitlines(), 1):
        words = line.split(maxsplit=8)
        if not words or line.startswith("#"):
            continue
        if len(words) < 9:
            raise BuildError(f"{USERS}: line {number}: expected nine columns: {line}")
        name, uid, group, gid, password, home, shell, others = words[:8]
        groups[group] = int(gid)
        home, shell = "/" if home == "-" else home, "/bin/false" if shell == "-" else shell
        passwd.append(f"{name}:x:{uid}:{gid}:{words[8]}:{home}:{shell}")
        shadow.append(f"{name}:{password}:::::::")
        for other in others.split(",") if others != "-" else []:
            members.setdefault(other, []).append(name)
            if other not in groups:
                groups[other] = next_group
                next_group += 1
    group = [f"{name}:x:{gid}:{','.join(members.get(name, []))}"
             for name, gid in sorted(groups.items(), key=lambda item: item[1])]
    return {"passwd": passwd, "group": group, "shadow": shadow}


@step
def root(out, kernel, initrd, sysroot, busybox, daemon, guest_programs, release):
    """Root put together."""
    wanted = contents()
    for folder in FOLDERS:
        (out / folder).mkdir()
    put_busybox(out, busybox)
    for name in wanted["files"]:
        if not (sysroot / name).exists():
            raise BuildError(f"{name} is in none of the packages of {CONTENTS}")
        put(sysroot / name, out / name)
    for name in ("regulatory.db", "regulatory.db.p7s"):
        put(sysroot / f"usr/lib/firmware/{name}-debian", out / "lib/firmware" / name)
    patch = out / "lib/firmware/brcm/BCM4345C0.hcd"
    patch.parent.mkdir(parents=True)
    patch.write_bytes(patch_file())
    put(daemon / "usr", out / "usr")
    put(OVERLAY, out)
    put(GUEST / "root", out)
    put(guest_programs / "relay", out / "usr/bin/mavlink-routerd")
    for name in ("hci-attach", "other-host"):
        put(guest_programs / name, out / "usr/sbin" / name)
    for name, lines in users().items():
        write(out / "etc" / name, "\n".join(lines) + "\n", 0o600 if name == "shadow" else 0o644)
    write(out / "etc/odid-release", release)
    write(out / "etc/odid/version", re.search(r"^VERSION=(.*)$", release, re.M)[1] + "\n")
    put(KEYS / "trusted.pem", out / "etc/swupdate/trusted.pem")
    put(ENVIRONMENT_DEFAULTS, out / "etc/u-boot-initial-env")
    put_libraries(out, sysroot, [path for path in files_of(out) if path.is_file()])
    put_modules(out, kernel, wanted["modules"]["root"])
    (image,) = (kernel / "boot").glob("vmlinuz-*")
    put(image, out / "boot/Image")
    put(initrd / "initrd", out / "boot/initrd")


@step
def initrd(out, kernel, sysroot, busybox):
    """Initial file system put together."""
    tree = out / "tree"
    for folder in ("dev", "proc", "sys", "newroot"):
        (tree / folder).mkdir(parents=True)
    put_busybox(tree, busybox)
    put(GUEST / "init", tree / "init")
    put_libraries(tree, sysroot, [tree / "bin/busybox"])
    put_modules(tree, kernel, contents()["modules"]["initrd"])
    (out / "initrd").write_bytes(cpio(tree))
    shutil.rmtree(tree)


@step
def board_tree(out, kernel):
    """The Compute Module's device tree, as this kernel has it."""
    (tree,) = (kernel / "usr/lib").glob("linux-image-*/broadcom/bcm2711-rpi-cm4-io.dtb")
    shutil.copyfile(tree, out / "cm4.dtb")


def cpio(tree):
    """The folder as the kernel's initramfs format ("newc"), owned by root, times 0."""
    archive = bytearray()

    def add(name, mode, data=b"", device=(0, 0)):
        fields = (0, mode, 0, 0, 1, 0, len(data), 0, 0, *device, len(name) + 1, 0)
        archive.extend(b"070701" + b"".join(b"%08X" % field for field in fields))
        archive.extend(name.encode() + b"\0")
        archive.extend(b"\0" * (-len(archive) % 4))
        archive.extend(data)
        archive.extend(b"\0" * (-len(archive) % 4))

    for path in sorted(tree.rglob("*")):
        name = str(path.relative_to(tree))
        if path.is_symlink():
            add(name, 0o120777, str(path.readlink()).encode())
        elif path.is_dir():
            add(name, 0o040755)
        else:
            add(name, 0o100000 | (path.stat().st_mode & 0o777), path.read_bytes())
    # /init's output goes to the console from its first line on.
    add("dev/console", 0o020600, device=(5, 1))
    add("TRAILER!!!", 0)
    return bytes(archive)


@step
def slot(out, root):
    """Slot made."""
    # U-Boot's zstd takes 3 s of each start for Debian's kernel on an emulated processor.
    call("mksquashfs", root, out / "slot.img", "-comp", "zstd", "-Xcompression-level", "9",
         "-action", "uncompressed@name(Image)", "-b", "64K", "-all-root", "-no-xattrs", "-no-exports", "-all-time", EPOCH,
         "-mkfs-time", EPOCH, "-noappend", "-no-progress", "-quiet", env=ENVIRONMENT)
    call(SEAL, out / "slot.img")
