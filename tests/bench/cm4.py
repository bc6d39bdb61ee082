"""The Compute Module's board: QEMU's raspi4b with the module's own device tree, its two radio chips as models behind the
drivers that fly, and the appliance's disk as its card.

  rootcanal <- bluetooth_chip.py <- uart0 -----+              +-- USB network adapter: control console: run()
  (the air)                         hci_uart   |  QEMU, arm64 |
  wifi.pcap <- wifi_chip.py <------ USB -------+  appliance   +-- USB serial port <- player.py
  the judge listens to both         brcmfmac   +--------------+   usb_serial.py: unplug(), plug()

What it is and isn't: README.md. Here the machine plays the boot loader's part, too: the emulated card reads 1 MB/s, and
Debian's kernel has 33.
"""

import subprocess

import parts

from . import disk as disks
from .machine import Machine, missing

HOME = parts.ROOT / "build/qemu-raspi/usr"
QEMU = HOME / "bin/qemu-system-aarch64"
TREE = disks.APPLIANCE / "cm4.dtb"
CARD_OCTETS = 512 << 20  # the emulated controller wants a power of two
BLUETOOTH = "/soc/serial@7e201000/bluetooth"
CARD = "/soc/mmc@7e300000"  # where the board has its Wi-Fi chip
# What the machine hasn't got. Those it knows it takes out of the tree itself, by their "compatible".
KNOWN = ("/scb/pcie@7d500000", "/scb/ethernet@7d580000", "/soc/rng@7e104000", "/soc/avs-monitor@7d5d2000/thermal",
         "/soc/watchdog@7e100000")
ABSENT = ("/gpu", "/emmc2bus/mmc@7e340000", "/soc/serial@7e215040")
SCREENS = ("hdmi", "hvs", "pixelvalve", "vec", "txp", "dsi", "v3d", "dvp", "interrupt-controller@7ef", "clock@7ef", "i2c@7ef")
# Of the firmware's pins, by which the board switches its radios, the machine has none.
WITHOUT = ((BLUETOOTH, "shutdown-gpios"), (CARD, "mmc-pwrseq"))
ADDRESS = ("1", "2", "3", "32", "a6", "dc")  # the module's own, last octet first, as the firmware writes it
# The kernel's messages by its early console: as a program's console the machine's uart1 interrupts without end.
ARGUMENTS = ("root=PARTUUID=0d1d2024-06 ro rootfstype=squashfs rootwait panic=5 odid.slot=a "
             "earlycon=uart8250,mmio32,0xfe215040 keep_bootcon")


def missing_for_cm4():
    """Why this machine can't be started here, or None."""
    if reason := missing():
        return reason
    if disks.IMAGE.parent != disks.APPLIANCE:
        return f"{disks.IMAGE} is made for another board"
    for path, how in ((QEMU, "make qemu-raspi"), (TREE, "make appliance")):
        if not path.exists():
            return f"{path} isn't there: {how}"
    return None


def fitted_tree(out):
    """A copy of the board's tree, as the firmware would have completed it, without what the machine lacks."""
    out.write_bytes(TREE.read_bytes())

    def put(node, name, *values, kind="s"):
        disks.call("fdtput", "-t", kind, out, node, name, *values)
    nodes = disks.call("fdtget", "-l", out, "/soc").split()
    for node in (*KNOWN, *ABSENT, *(f"/soc/{node}" for node in nodes if node.startswith(SCREENS))):
        put(node, "status", "disabled")
    for node in KNOWN:
        put(node, "compatible", "absent")
    for node, name in WITHOUT:
        disks.call("fdtput", "-d", out, node, name)
    disks.call("fdtput", "-r", out, f"{CARD}/wifi@1")
    put(BLUETOOTH, "local-bd-address", *ADDRESS, kind="bx")
    return out


class Cm4(Machine):
    """The same as Machine; `front` is the Bluetooth chip, `wifi` the other one, `port` the autopilot's."""

    channels = ("bt4", "wifi")
    disk_octets = CARD_OCTETS
    most_kernel_s = float("inf")  # nobody has measured it on a quiet machine
    of_qemu = ("qmp", "control")

    def __init__(self, folder, config=None, mode="bcm43455"):
        self._mode = mode
        super().__init__(folder, config)
        self._boot_files()

    def _boot_files(self):
        """Kernel and initial file system, out of the disk's slot a."""
        offset, _ = self.disk.place(disks.SLOT_A)
        for name in ("Image", "initrd"):
            with open(self.folder / name, "wb") as out:
                subprocess.run(["unsquashfs", "-o", str(offset), "-cat", self.disk.image, f"boot/{name}"], stdout=out,
                               stdin=subprocess.DEVNULL, check=True)
        fitted_tree(self.folder / "cm4.dtb")

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
            "-kernel", self.folder / "Image", "-initrd", self.folder / "initrd", "-dtb", self.folder / "cm4.dtb",
            "-append", ARGUMENTS,
            "-qmp", f"unix:{self._sockets}/qmp,server=on,wait=off",
            "-drive", f"if=sd,format=qcow2,cache=unsafe,file={self.disk.path}",
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
