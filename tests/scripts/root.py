"""A bare root with the overlay in it, to run its scripts in."""

import contextlib
import os
import shutil
import signal
import subprocess
from pathlib import Path

import patience

ROOT = Path(__file__).resolve().parent.parent.parent
OVERLAY = ROOT / "overlay"
BUSYBOX = shutil.which("busybox")
SETTINGS = {
    "autopilot.device": "auto", "autopilot.baud": "921600", "broadcast.wifi_iface": "wlan0", "wifi.country": "SE",
    "wifi.channel": "6", "mavlink.udp_port": "14550", "ground_station.address": "",
    "ground_station.interface": "eth0",
    "broadcast.wifi_beacon_enabled": "true", "wifi.listener": "",
}
ODIDCTL = """#!/bin/sh
case $1 in
get) shift && for name; do sed -n "s/^$name=//p" /settings; done ;;
check) cat /checked ;;
armed) cat /armed && ! grep -q ^disarmed /armed ;;
status) cat /status.json ;;
radios) cat /radios ;;
in-force) [ ! -e /changed ] ;;
esac
"""
NOTES = """#!/bin/sh
echo "${0##*/} $*" >>/calls
echo OK
"""
# Debian's BusyBox has neither; nothing runs twice here, and no power is cut.
FLOCK = FSYNC = "#!/bin/sh\n"
NETDEV = 100  # the group
NOTED = ("sv", "nft", "hostapd_cli", "ip")
# BusyBox' shell takes its own `ip` before the one that is noted: what a script does to a network, a name, a clock or a
# kernel, it does to none of this machine's.
OF_ITS_OWN = ("unshare", "--mount", "--net", "--uts", "--ipc",
              "setpriv", "--bounding-set=-sys_boot,-sys_time,-sys_module,-sys_rawio")
KEY = "7" * 64


class Appliance:
    """A bare root with the overlay, and its scripts run in it."""

    def __init__(self, root):
        self.root = root
        for folder in ("bin", "data/odid", "data/secrets", "dev", "proc", "run/faults", "run/lock", "run/odid-appliance", "run/pid",
                       "sys/class/tty", "usr/bin"):
            (root / folder).mkdir(parents=True)
        shutil.copy(BUSYBOX, root / "bin/busybox")
        shutil.copytree(OVERLAY, root, symlinks=True, dirs_exist_ok=True)
        for name, number in (("null", 3), ("zero", 5), ("urandom", 9)):
            os.mknod(root / "dev" / name, 0o20666, os.makedev(1, number))
        for name, text in {"odidctl": ODIDCTL, "flock": FLOCK, "fsync": FSYNC, **dict.fromkeys(NOTED, NOTES)}.items():
            (root / "usr/bin" / name).write_text(text)
            (root / "usr/bin" / name).chmod(0o755)
        self.settings()
        self.write("armed", "disarmed never 0 said\n")
        self.write("etc/passwd", "root:x:0:0::/:/bin/sh\nhostapd:x:994:994::/:/bin/false\nodid-beacons:x:989:989::/:/bin/false\n")
        self.write("etc/group", f"root:x:0:\nhostapd:x:994:\nodid-beacons:x:989:\nnetdev:x:{NETDEV}:hostapd\n")
        self.run("/bin/busybox --install -s /bin", shell="/bin/busybox")

    def settings(self, **changed):
        """wifi__channel="11" for wifi.channel."""
        values = SETTINGS | {name.replace("__", "."): value for name, value in changed.items()}
        self.write("settings", "".join(f"{name}={value}\n" for name, value in values.items()))

    def write(self, path, text):
        path = self.root / path
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_symlink():
            path.unlink()  # one of BusyBox', by a link that here is the machine's own
        path.write_text(text)

    def change(self, path, *replacements):
        """(old, new) in a script's text: a test needn't wait as long as the appliance does, or waits for something."""
        text = self.read(path)
        for old, new in replacements:
            assert old in text, f"{path} has no {old!r}"
            text = text.replace(old, new)
        self.write(path, text)

    def read(self, path):
        return (self.root / path).read_text()

    def exists(self, path):
        return (self.root / path).exists()

    def words(self, command, shell="/bin/sh"):
        inside = f'mount --bind /proc "$0/proc" && mount --bind -o ro /proc/sys "$0/proc/sys" && exec chroot "$0" {shell} {"sh " if "busybox" in shell else ""}-c "$1"'
        return [*OF_ITS_OWN, "sh", "-c", inside, str(self.root), f"PATH=/usr/bin:/bin; {command}"]

    def run(self, command, shell="/bin/sh"):
        return subprocess.run(self.words(command, shell), capture_output=True, text=True, timeout=patience.LIMIT_S)

    def start(self, command):
        """The same without waiting for its end. Signals get to it when it is one program, or begins with exec."""
        return subprocess.Popen(self.words(command), stdin=subprocess.DEVNULL)

    def end_all(self):
        """What scripts have left running, as some do on purpose."""
        patience.wait_for("what scripts left running to end", lambda: not [process for process in os.listdir("/proc") if self._killed(process)])

    def _killed(self, process):
        """Did it run in this root until now?"""
        with contextlib.suppress(OSError):  # it has ended
            if process.isdigit() and os.path.samefile(f"/proc/{process}/root", self.root):
                os.kill(int(process), signal.SIGKILL)
                return True
        return False

    def must(self, command):
        result = self.run(command)
        assert result.returncode == 0, result.stdout + result.stderr
        return result.stdout

    def calls(self):
        return self.read("calls").splitlines() if self.exists("calls") else []

    def fault(self, name):
        return self.read(f"run/faults/{name}") if self.exists(f"run/faults/{name}") else None

    def port(self, tty, where, interface, number=None, **device):
        """A USB serial port as sysfs shows it; device: idVendor, idProduct, manufacturer, product, serial."""
        usb = self.root / "sys/devices" / where
        inner = usb / f"{where}:1.{interface}" / (tty if number is not None else "")
        (inner / "tty" / tty).mkdir(parents=True)
        for name, value in device.items():
            (usb / name).write_text(value + "\n")
        (usb / f"{where}:1.{interface}/bInterfaceNumber").write_text(f"{interface:02}\n")
        if number is not None:
            (inner / "port_number").write_text(f"{number}\n")
        (inner / "tty" / tty / "device").symlink_to("../..")
        classes = self.root / "sys/class/tty"
        (classes / tty).symlink_to(os.path.relpath(inner / "tty" / tty, classes))
        os.mknod(self.root / "dev" / tty, 0o20660, os.makedev(1, 3))
