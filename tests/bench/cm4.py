"""The Compute Module's board: QEMU's raspi4b with the module's own device tree, its two radio chips as models behind the
drivers that fly, and the appliance's disk as its card.

  rootcanal <- bluetooth_chip.py <- uart0 -----+              +-- USB network adapter: control console: run()
  (the air)                         hci_uart   |  QEMU, arm64 |
  wifi.pcap <- wifi_chip.py <------ USB -------+  appliance   +-- USB serial port <- player.py
  the judge listens to both         brcmfmac   +--------------+   usb_serial.py: unplug(), plug()

What it is and isn't: README.md. Cm4 is the bench's appliance, or with IMAGE= the image that is flashed, each started its own
way.
"""

import re

import parts

from . import disk as disks
from . import raspi4b
from .machine import Machine, missing

HOME = parts.ROOT / "build/qemu-raspi/usr"
QEMU = HOME / "bin/qemu-system-aarch64"
FLASHED = disks.IMAGE.resolve().parent != disks.APPLIANCE
SCREENS = ("hdmi", "hvs", "pixelvalve", "vec", "txp", "dsi", "v3d", "dvp", "interrupt-controller@7ef", "clock@7ef", "i2c@7ef")
# Of the firmware's pins, by which the board switches its radios, the machine has none.
PIN = (raspi4b.BLUETOOTH, "shutdown-gpios")


def missing_for_cm4():
    """Why this machine can't be started here, or None."""
    if reason := missing("cm4" if FLASHED else "qemu"):
        return reason
    for path, how in ((QEMU, "make qemu-raspi"), (disks.IMAGE.with_name(Cm4.tree), "make appliance")):
        if not path.exists():
            return f"{path} isn't there: {how}"
    return None


class Board(Machine):
    """The same as Machine; `front` is the Bluetooth chip, `wifi` the other one, `port` the autopilot's. How it is started: below."""

    channels = ("bt4", "wifi")
    kind_of_disk = disks.Card
    most_kernel_s = float("inf")  # nobody has measured it on a quiet machine
    of_qemu = ("qmp", "control")

    def __init__(self, folder, config=None, mode="bcm43455"):
        self._mode = mode
        super().__init__(folder, config)
        self._boot_files()

    def _start_radios(self):
        self.front = self._model("bluetooth_chip", "--listen", self.front_port, "--hci-port", self.rootcanal.hci_port,
                                 "--mode", self._mode, "--set-log", self.set_log)
        self.wifi = self._model("wifi_chip", "--listen", self._sockets / "wifi", "--out", self.pcap)
        self.port = self._model("usb_serial", "--listen", self._sockets / "port", "--line", self._sockets / "fc")

    def power_on(self, rtc=None, adapter=True, radios=True, wait=True):
        if rtc or not radios:
            raise ValueError("this board has no clock, and is always with its radios")
        self.port.order("plug" if adapter else "unplug")
        super().power_on(adapter=adapter, wait=wait)

    def unplug(self):
        """The autopilot's cable is pulled."""
        if self.player:
            self.player.order("pause")
        self.port.order("unplug")

    def plug(self):
        self.port.order("plug")
        if self.player:
            self.player.order("resume")

    def _words(self, rtc, adapter, radios):
        return [
            "setpriv", "--pdeathsig", "KILL", QEMU, "-M", "raspi4b", "-smp", "4", "-display", "none",
            *self._started_by(),
            "-qmp", f"unix:{self._sockets}/qmp,server=on,wait=off",
            "-drive", f"if=sd,format={self.disk.form},cache=unsafe,file={self.disk.path}",
            "-chardev", f"socket,id=bt,host=127.0.0.1,port={self.front_port},nodelay=on", "-serial", "chardev:bt",
            "-chardev", f"file,id=console,path={self.console},append=on", "-serial", "chardev:console",
            "-chardev", f"socket,id=control,path={self._sockets}/control,server=on,wait=off",
            "-netdev", "user,id=net,guestfwd=tcp:10.0.2.100:23-chardev:control", "-device", "usb-net,netdev=net",
            "-chardev", f"socket,id=wifi,path={self._sockets}/wifi", "-device", "usb-redir,chardev=wifi",
            "-chardev", f"socket,id=port,path={self._sockets}/port", "-device", "usb-redir,chardev=port",
        ]

    @staticmethod
    def _environment():
        """With the modules of that very QEMU: the system's are another one's."""
        return parts.environment() | {"QEMU_MODULE_DIR": next(HOME.glob("lib/*/qemu"))}

    def restarted(self):
        """The appliance restarts itself. raspi4b can't, or ends with that: the power is cut, and switched on again."""
        self.wait_for("its restart", lambda: self.qemu.process.poll() is not None or re.search(
            r"reboot: (Restarting system|System halted)", self.console_text()))
        self.cut_power()
        self.power_on()


class Bench(Board):
    """The bench's appliance. QEMU plays the boot loader's part, too: the emulated card reads 1 MB/s, and Debian's kernel has 33."""

    tree = "cm4.dtb"
    arguments = f"root=PARTUUID=0d1d2024-06 ro rootfstype=squashfs rootwait panic=5 odid.slot=a {raspi4b.EARLY_CONSOLE}"

    def _boot_files(self):
        for name in ("Image", "initrd"):
            (self.folder / name).write_bytes(disks.inside(self.disk.image, f"boot/{name}"))
        self._fit_tree(self.folder / self.tree)

    def _fit_tree(self, tree):
        """As the firmware would have completed it, without what the machine lacks."""
        tree.write_bytes(disks.IMAGE.with_name(self.tree).read_bytes())
        nodes = disks.call("fdtget", "-l", tree, "/soc").split()
        for node in ("/gpu", raspi4b.EMMC, raspi4b.UART1, *(f"/soc/{node}" for node in nodes if node.startswith(SCREENS))):
            raspi4b.put(tree, node, "status", "disabled")
        raspi4b.take_out_absent(tree)
        for node, name in (PIN, (raspi4b.CARD, "mmc-pwrseq")):
            disks.call("fdtput", "-d", tree, node, name)
        disks.call("fdtput", "-r", tree, f"{raspi4b.CARD}/wifi@1")
        raspi4b.put(tree, raspi4b.BLUETOOTH, "local-bd-address", *raspi4b.ADDRESS, kind="bx")

    def _started_by(self):
        return ["-kernel", self.folder / "Image", "-initrd", self.folder / "initrd", "-dtb", self.folder / self.tree,
                "-append", self.arguments]


class Flashed(Board):
    """The image that is flashed: QEMU plays the firmware's part, and U-Boot starts it with the tree of its slot."""

    tree = "odid-cm4.dtb"

    def _boot_files(self):
        raspi4b.firmware_tree(disks.IMAGE.with_name(self.tree), self.folder / self.tree)
        environment = raspi4b.environment(self.folder / "env", fit_tree=f"{raspi4b.FIT_TREE}; fdt rm {' '.join(PIN)}")
        self.disk.put_files(disks.ENV, dict.fromkeys(raspi4b.ENV_FILES, environment.read_bytes()))

    def _started_by(self):
        return ["-kernel", disks.LOADER, "-dtb", self.folder / self.tree]


Cm4 = Flashed if FLASHED else Bench
