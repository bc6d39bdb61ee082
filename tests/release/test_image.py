"""What a built release image holds, and what it doesn't."""

import json
import os
import re
import stat
import subprocess
from collections import defaultdict

import pytest

from .conftest import TOP, call
from .figures import figures

MB = 1_000_000
ROOT_MAX, SLOT_MAX, BUNDLE_MAX = 10 * MB, 16 * MB, 16 * MB
# Nobody needs what isn't here; a new line needs a reason.
SET_USER_ID: set[str] = set()
ELSEWHERE = {
    "compilers": r"/(gcc|cc|g\+\+|c\+\+|clang|ld|as|make|gdb)$|/lib/gcc/",
    "interpreters": r"/(python\d?|perl|lua|tclsh|ruby|php)[\d.]*$",
    "package managers": r"/(opkg|dpkg|apt|rpm|apk)$",
    "other inits and desktops": r"/(systemd|dbus-daemon|bluetoothd|NetworkManager|wpa_supplicant)$",
    "headers and manuals": r"\.(h|a|la|pc)$|/share/(man|doc|info|locale)/|/include/",
    "histories": r"/\.(ash|bash)_history$|/\.viminfo$",
    "the bench": r"hci-attach|S05bench|/tcpdump$|hwsim",
}


def test_sizes(image, tmp_path):
    """Root without kernel, device tree and modules; and the whole slot."""
    call("mksquashfs", image.root, tmp_path / "root", "-comp", "zstd", "-Xcompression-level", "22", "-b", "64K", "-no-xattrs",
         "-quiet", "-no-progress", "-wildcards", "-e", "boot/*", "lib/modules/*", "lib/firmware/*")
    root, slot = (tmp_path / "root").stat().st_size, (image.images / "slot.img").stat().st_size
    unpacked = sum(path.stat().st_size for path in image.files())
    figures(image.board, root_octets=root, slot_octets=slot, unpacked_octets=unpacked,
            kernel_octets=(image.root / "boot/Image").stat().st_size,
            release_octets=sum(path.stat().st_size for path in (image.out / "release").glob("*.img.xz")))
    assert root <= ROOT_MAX and slot <= SLOT_MAX


def test_its_bundle(image, tmp_path):
    """What an update brings over the air: the slot, its description and signature."""
    call(TOP / "board/common/make-keys.sh", tmp_path / "keys")
    call(TOP / "board/common/make-bundle.sh", image.images / "slot.img", image.board, "1.0.0", tmp_path / "keys", tmp_path / "bundle.swu")
    octets = (tmp_path / "bundle.swu").stat().st_size
    figures(image.board, bundle_octets=octets)
    assert (image.images / "slot.img").stat().st_size < octets <= BUNDLE_MAX


@pytest.mark.parametrize("what", ELSEWHERE)
def test_what_an_aircraft_has_no_use_for(image, what):
    found = [image.name(path) for path in sorted(image.root.rglob("*")) if re.search(ELSEWHERE[what], image.name(path))]
    if image.board == "qemu":           # its kernel has the emulated radios
        found = [name for name in found if not name.startswith("/lib/modules/")]
    assert not found


def test_owners_and_modes(image):
    set_id, open_to_all, strange = set(), set(), set()
    users = {int(line.split(":")[2]) for line in (image.root / "etc/passwd").read_text().splitlines()}
    for path in [image.root, *image.root.rglob("*")]:
        entry = path.lstat()
        if entry.st_mode & (stat.S_ISUID | stat.S_ISGID):
            set_id.add(image.name(path))
        if not stat.S_ISLNK(entry.st_mode) and entry.st_mode & stat.S_IWOTH and not entry.st_mode & stat.S_ISVTX:
            if not stat.S_ISCHR(entry.st_mode):
                open_to_all.add(image.name(path))
        if entry.st_uid not in users:
            strange.add(image.name(path))
        assert "security.capability" not in os.listxattr(path, follow_symlinks=False), path
    assert set_id == SET_USER_ID and not open_to_all and not strange


def test_nobody_has_a_password(image):
    for line in (image.root / "etc/shadow").read_text().splitlines():
        name, password = line.split(":")[:2]
        assert re.match(r"[*!]", password), f"{name} has a password, or none is asked for"
    assert (image.root / "etc/shadow").stat().st_mode & 0o077 == 0
    names = [line.split(":")[0] for line in (image.root / "etc/passwd").read_text().splitlines()]
    wanted = [line.split()[0] for line in (TOP / "board/common/users.txt").read_text().splitlines()
              if line and not line.startswith("#")]
    assert sorted(names) == sorted(["root", "nobody", *wanted])


def test_overlay_is_there_as_it_is(image):
    for path in sorted((TOP / "overlay").rglob("*")):
        there = image.root / path.relative_to(TOP / "overlay")
        if path.is_symlink():
            assert os.readlink(there) == os.readlink(path)
        elif path.is_file() and path.name not in ("odid-release", "inittab"):
            assert there.read_bytes() == path.read_bytes(), path
            assert there.stat().st_mode & 0o111 == path.stat().st_mode & 0o111, path
    assert sorted(path.name for path in (image.root / "etc/init.d").iterdir()) == sorted(
        path.name for path in (TOP / "overlay/etc/init.d").iterdir())


# The C library's own parts, for programs of other layers, too; some are loaded by name.
C_LIBRARY = {f"lib{name}" for name in ("anl.so.1", "dl.so.2", "gcc_s.so.1", "nsl.so.1", "nss_dns.so.2", "nss_files.so.2",
                                       "pthread.so.0", "resolv.so.2", "rt.so.1", "util.so.1")}


def test_every_library_that_is_needed_is_there_and_no_other(image):
    needed, has = defaultdict(list), {path.name for path in image.root.rglob("*.so*")}
    libraries = {}
    for path in image.files():
        with path.open("rb") as file:
            if file.read(4) != b"\x7fELF" or path.suffix == ".ko":
                continue
        text = call("readelf", "-dW", path)
        for name in re.findall(r"\(NEEDED\).*\[(.+)\]", text):
            needed[name].append(image.name(path))
        for name in re.findall(r"\(SONAME\).*\[(.+)\]", text):
            libraries[name] = image.name(path)
    assert {name: programs for name, programs in needed.items() if name not in has} == {}
    assert {name: path for name, path in libraries.items() if name not in needed and name not in C_LIBRARY} == {}


def test_programs_are_hardened(image):
    """Position independent, read-only relocations, a stack that isn't executed."""
    lost = defaultdict(list)
    for path in image.files():
        with path.open("rb") as file:
            if file.read(4) != b"\x7fELF" or path.suffix == ".ko" or not path.stat().st_mode & 0o111:
                continue
        text = call("readelf", "-hldW", path)
        if not re.search(r"Type: +DYN", text) and path.name != "busybox":
            lost["fixed address"].append(image.name(path))
        if "GNU_RELRO" not in text and path.name != "busybox":
            lost["relocations can be written"].append(image.name(path))
        if re.search(r"GNU_STACK .* RWE", text):
            lost["stack is executed"].append(image.name(path))
        if re.search(r"\((RPATH|RUNPATH)\)", text):  # an empty one is what is left of the build folder: its length
            lost["has a search path"].append(image.name(path))
    assert lost == {}


def test_drivers_are_there(image):
    """Built in or as modules."""
    (folder,) = (image.root / "lib/modules").iterdir()
    known = {re.sub("-", "_", path.name.partition(".ko")[0]) for path in folder.rglob("*.ko*")}
    known |= {re.sub("-", "_", line.rpartition("/")[2].removesuffix(".ko").strip())
              for line in (folder / "modules.builtin").read_text().splitlines()}
    wanted = {"ftdi_sio", "cdc_acm", "cp210x", "ch341", "pl2303", "usb_storage", "sd_mod", "ext4", "vfat", "exfat", "squashfs",
              "hci_uart", "bluetooth", "nf_tables", "nf_conntrack", "cdc_ether", "cdc_ncm", "cdc_mbim", "qmi_wwan", "rndis_host",
              "r8152", "ax88179_178a", "smsc95xx"}
    if image.board == "cm4":
        wanted |= {"brcmfmac", "btbcm", "btusb", "dwc2", "libcomposite", "usb_f_ncm", "usb_f_acm", "xhci_pci", "genet",
                   "bcm2835_wdt", "raspberrypi_hwmon", "sdhci_iproc", "pcie_brcmstb"}
    assert not wanted - known


def test_nothing_tells_where_it_was_built(image):
    folders = {str(image.out), str(TOP), str(image.out / "host")}
    found = [image.name(path) for path in image.files()
             if any(folder.encode() in path.read_bytes() for folder in folders)]
    assert not found


def test_the_release_is_complete(image):
    release = image.out / "release"
    if not release.exists():
        pytest.skip("not packed: make image")
    call("sh", "-c", f"cd '{release}' && sha256sum --quiet -c SHA256SUMS")
    bill = json.loads(next(release.glob("*.sbom.json")).read_text())
    names = {component["name"] for component in bill["components"]}
    assert {"linux", "busybox", "odid-daemon", "hostapd-odid", "mavlink-router", "swupdate"} <= names
    without = [component["name"] for component in bill["components"]
               if not component.get("licenses") and not component["name"].startswith(("host-", "skeleton", "toolchain"))]
    assert set(without) <= {"initscripts", "ifupdown-scripts"}, "parts whose licence isn't said"
    assert len(list((release / "licences").iterdir())) > 20


# --- the Compute Module ----------------------------------------------------------------


@pytest.fixture(name="cm4")
def compute_module(image):
    if image.board != "cm4":
        pytest.skip("of the Compute Module only")
    return image


def module(image, name):
    (found,) = image.root.glob(f"lib/modules/*/kernel/**/{name}.ko*")
    return found.read_bytes()


# The chips that Compute Modules 4 have, by the names that brcmfmac and btbcm know them by.
CHIPS = {"brcmfmac43455-sdio": "BCM4345C0", "brcmfmac43456-sdio": "BCM4345C5"}


def test_radio_firmware_has_the_names_that_drivers_ask_for(cm4):
    folder, wanted = cm4.root / "lib/firmware", {"regulatory.db", "regulatory.db.p7s"}
    assert all(name.encode() in module(cm4, "cfg80211") for name in wanted)
    assert b"brcm/%s" in module(cm4, "btbcm")
    for wifi, bluetooth in CHIPS.items():
        assert f"brcm/{wifi}".encode() in module(cm4, "brcmfmac") and bluetooth.encode() in module(cm4, "btbcm")
        wanted |= {f"brcm/{bluetooth}.hcd", *(f"brcm/{wifi}.{kind}" for kind in ("bin", "clm_blob", "txt"))}
    assert {name for name in wanted if not (folder / name).stat().st_size} == set()
    listed = (TOP / "board/cm4/firmware-files").read_text()
    assert {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()} == {
        line for line in listed.splitlines() if line and not line.startswith("#")}


def test_the_board_script_s_paths_are_in_the_device_tree(cm4):
    tree = cm4.root / "boot/board.dtb"
    paths = set(re.findall(r"/(?:soc|scb)/[\w@/,-]+", (TOP / "board/cm4/board.cmd").read_text()))
    assert len(paths) >= 12
    for path in paths:
        assert subprocess.run(["fdtget", "-p", tree, path], capture_output=True, check=False).returncode == 0, path
    for alias, path in {"mmc0": "/emmc2bus/mmc@7e340000", "serial3": "/soc/serial@7e201600",
                        "ethernet0": "/scb/ethernet@7d580000", "bluetooth": "/soc/serial@7e201000/bluetooth"}.items():
        assert call("fdtget", tree, "/aliases", alias).strip() == path
    assert "stdout-path" not in call("fdtget", "-p", tree, "/chosen")


# Devices of the tree that no driver of ours is meant for: the board's and the processors' own names, graphics, a
# second timer, profiling, the IO board's clock and its bus.
WITHOUT_A_DRIVER = {
    "/", "/cpus/cpu@0", "/cpus/cpu@1", "/cpus/cpu@2", "/cpus/cpu@3", "/pmu", "/soc/timer@7e003000",
    "/soc/txp@7e004000", "/soc/hvs@7e400000", "/soc/pixelvalve@7e206000", "/soc/pixelvalve@7e207000",
    "/soc/pixelvalve@7e20a000", "/soc/pixelvalve@7e216000", "/soc/mailbox@7e00b840", "/scb/gpu@7ec00000",
    "/i2c-mux0", "/i2c-mux0/i2c@1/rtc@51"}


def switched_on(tree):
    """Path and "compatible" of every device in the tree that isn't switched off."""
    path, found, off = [], {}, set()
    for line in call("dtc", "-q", "-I", "dtb", "-O", "dts", tree).splitlines():
        line = line.strip()
        if line.endswith("{"):
            path.append(line[:-1].strip().strip("/"))
        elif line == "};":
            path.pop()
        elif line.startswith("compatible = "):
            found["/".join(path) or "/"] = [name for text in re.findall('"(.*?)"', line) for name in text.split("\\0")]
        elif line == 'status = "disabled";':
            off.add("/".join(path))
    return {path: names for path, names in found.items() if path not in off}


def test_every_device_that_is_on_has_a_driver(cm4):
    """A clock that is missing leaves the board without its card and its UARTs, and nobody there to say so."""
    drivers = (cm4.root / "boot/Image").read_bytes() + b"".join(
        path.read_bytes() for path in cm4.root.glob("lib/modules/**/*.ko"))
    devices = switched_on(cm4.root / "boot/board.dtb")
    assert len(devices) > 50
    lost = {path for path, names in devices.items() if not any(name.encode() + b"\0" in drivers for name in names)}
    assert lost <= WITHOUT_A_DRIVER, lost - WITHOUT_A_DRIVER
    assert WITHOUT_A_DRIVER <= devices.keys()


def test_boot_volume_and_slot_have_the_same_device_tree(cm4):
    assert (cm4.images / "odid-cm4.dtb").read_bytes() == (cm4.root / "boot/board.dtb").read_bytes()
