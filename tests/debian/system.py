"""A companion computer in an emulated machine: Debian 12 with systemd, out of its signed packages, with the radios and the
judge of the appliance's bench (tests/bench). The package is installed by the tests.

    python3 -m debian.system        builds build/companion/system: disk.img, vmlinuz, initrd.img (minutes)
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.image.debian import KEYRING, mirrors
from bench.machine import Machine

from .package import FOLDER, TOP, call

SYSTEM = FOLDER / "system"
GUEST = Path(__file__).with_name("guest")
QEMU = "qemu-system-x86_64"
SIZE = "2G"
# What the package depends on is there already: the machine has no network.
PACKAGES = (
    "linux-image-amd64", "initramfs-tools", "systemd-sysv", "udev", "kmod", "dbus", "iproute2", "procps",
    "hostapd", "wireless-regdb", "libinih1", "libjson-c5", "libnettle8", "libseccomp2", "libcap-ng0",
    "bluez", "network-manager",     # the neighbours
    "iw", "tcpdump",                # the judge's ear
)
NOT_NEEDED = ("man", "doc", "locale")
# Its neighbours sleep until a test starts them; the judge's radios are none of the computer's.
HOOK = """
mkdir -p "$1/etc/NetworkManager/conf.d"
printf '[keyfile]\\nunmanaged-devices+=interface-name:wlan1;interface-name:wlan2\\n' >"$1/etc/NetworkManager/conf.d/bench.conf"
printf 'SUBSYSTEM=="net", KERNEL=="wlan[12]", ENV{SYSTEMD_WANTS}=""\\n' >"$1/etc/udev/rules.d/99-bench.rules"
for unit in bluetooth NetworkManager NetworkManager-wait-online wpa_supplicant hostapd; do
    chroot "$1" systemctl disable $unit.service 2>/dev/null || true
done
chroot "$1" systemctl mask NetworkManager-wait-online.service systemd-timesyncd.service apt-daily.timer apt-daily-upgrade.timer
install -m 755 "$GUEST/bench" "$1/usr/local/sbin/bench"
install -m 644 "$GUEST/bench.service" "$1/etc/systemd/system/bench.service"
install -m 755 "$ATTACH" "$1/usr/local/sbin/hci-attach"
chroot "$1" systemctl enable bench.service
echo /dev/vda / ext4 defaults 0 1 >"$1/etc/fstab"
echo companion >"$1/etc/hostname"
rm -f "$1/etc/machine-id"
touch "$1/etc/machine-id"
"""


def missing():
    """Why there is no such machine here, or None."""
    if not shutil.which(QEMU):
        return f"{QEMU} isn't installed (Debian: qemu-system-x86)"
    if not (SYSTEM / "disk.img").exists():
        return f"{SYSTEM} isn't built: make companion-system"
    return None


def build():
    if os.geteuid() != 0:
        sys.exit("companion-system: needs root")
    SYSTEM.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=SYSTEM) as work:
        root, attach = Path(work, "root"), Path(work, "hci-attach")
        call("gcc", "-O2", "-static", "-s", "-o", attach, TOP / "tests/bench/guest/hci-attach.c")
        hook = Path(work, "hook")
        hook.write_text(f"#!/bin/sh\nset -e\nGUEST='{GUEST}' ATTACH='{attach}'\n{HOOK}")
        hook.chmod(0o755)
        call("mmdebstrap", "--mode=root", "--variant=minbase", "--architectures=amd64", f"--include={','.join(PACKAGES)}",
             '--aptopt=Acquire::Languages "none"', *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in NOT_NEEDED),
             '--essential-hook=mkdir -p "$1/etc/initramfs-tools/conf.d" && echo MODULES=list >"$1/etc/initramfs-tools/conf.d/bench"'
             ' && printf "virtio_pci\\nvirtio_blk\\next4\\n" >"$1/etc/initramfs-tools/modules"',
             f"--customize-hook={hook}", "bookworm", root,
             *(f"deb [signed-by={KEYRING}] {address} {suite} main" for suite, address in mirrors().items()))
        for name, file in (("vmlinuz", "vmlinuz"), ("initrd.img", "initrd.img")):
            shutil.copyfile(root / name, SYSTEM / file)
        disk = SYSTEM / "disk.part"
        disk.unlink(missing_ok=True)
        subprocess.run(["truncate", "-s", SIZE, disk], check=True)
        call("mke2fs", "-q", "-t", "ext4", "-d", root, disk)
        disk.rename(SYSTEM / "disk.img")


class Companion(Machine):
    # To systemd's start. 6.7 s where the appliance's kernel took 2.5 s, twice as long as on a quick machine.
    most_kernel_s = 4.0

    def __init__(self, folder, image=SYSTEM / "disk.img"):
        super().__init__(folder, config={}, image=image, memory_mib=512)

    def _board(self):
        return [QEMU, "-M", "q35", "-cpu", "max", *self.timing, "-kernel", SYSTEM / "vmlinuz", "-initrd", SYSTEM / "initrd.img",
                "-append", "root=/dev/vda rw console=ttyS0 net.ifnames=0 quiet cryptomgr.notests=1 mitigations=off",
                "-device", "virtio-blk-pci,drive=disk"]

    def restart(self, **power):
        """Switched off in order, and on again."""
        self.shell.send("sync; systemctl poweroff")
        self.wait_for("the computer to switch itself off", lambda: self.qemu.process.poll() is not None)
        self.cut_power()
        self.power_on(**power)

    def _ask_kernel_s(self):
        return int(self.must("systemctl show -P UserspaceTimestampMonotonic")) / 1e6

    def systemd_started(self):
        """time.monotonic() at which systemd began."""
        return self.mono(self.kernel_s())


if __name__ == "__main__":
    build()
