"""QEMU's machine raspi4b beside the Compute Module's board: what of it is missing, and what the firmware, whose part QEMU plays,
would have done before U-Boot: the device tree that it leaves, and for U-Boot's environment what the kernel has to be told.
"""

import shutil
import subprocess

import parts

BLUETOOTH = "/soc/serial@7e201000/bluetooth"
CARD = "/soc/mmc@7e300000"  # where the board has its Wi-Fi chip
EMMC = "/emmc2bus/mmc@7e340000"
UART1 = "/soc/serial@7e215040"
# What the machine hasn't got. Those it knows it takes out of the tree itself, by their "compatible"; the firmware leaves
# them, switched off, and that is what board.cmd looks for. A watchdog that is started resets the machine at once.
ABSENT = ("/scb/pcie@7d500000", "/scb/ethernet@7d580000", "/soc/rng@7e104000", "/soc/avs-monitor@7d5d2000/thermal",
          "/soc/watchdog@7e100000")
ADDRESS = ("1", "2", "3", "32", "a6", "dc")  # the module's own, last octet first, as the firmware writes it
SERIAL = "10000000a1b2c3d4"
# In the slot's tree: the machine's card is where the board has its Wi-Fi chip, so for the kernel it isn't one; and the
# firmware's pins that switch the radios aren't there.
FIT_TREE = f"fdt rm {CARD} mmc-pwrseq; fdt rm {CARD}/wifi@1; fdt set {EMMC} status disabled"
# The kernel's early console on uart1: as a program's console the machine's uart1 interrupts without end.
EARLY_CONSOLE = "earlycon=uart8250,mmio32,0xfe215040 keep_bootcon"
ENV_FILES = ("uboot.env", "uboot-redund.env")


def put(tree, node, name, *values, kind="s"):
    subprocess.run(["fdtput", "-t", kind, tree, node, name, *values], check=True, stdin=subprocess.DEVNULL)


def take_out_absent(tree):
    for node in ABSENT:
        put(tree, node, "status", "disabled")
        put(tree, node, "compatible", "absent")


def firmware_tree(source, out):
    """The image's tree, as U-Boot gets it from the firmware: with the firmware's numbers, which are the other way round."""
    shutil.copy(source, out)
    put(out, "/aliases", "mmc0", CARD)
    put(out, "/aliases", "mmc1", EMMC)
    put(out, "/chosen", "stdout-path", "serial1:115200n8")
    put(out, UART1, "status", "okay")
    put(out, "/", "serial-number", SERIAL)
    put(out, BLUETOOTH, "local-bd-address", *ADDRESS, kind="bx")
    take_out_absent(out)
    return out


def environment(out, **variables):
    """U-Boot's, as a file of the volume ENV: the board's, what this machine needs, and variables."""
    variables = {"board_bootargs": EARLY_CONSOLE, "fit_tree": FIT_TREE} | variables
    text = (parts.ROOT / "board/cm4/u-boot.env").read_text(encoding="utf-8")
    source = out.with_suffix(".txt")
    source.write_text(text + "".join(f"{name}={value}\n" for name, value in variables.items()), encoding="utf-8")
    subprocess.run(["mkenvimage", "-r", "-s", "0x4000", "-o", out, source], check=True, stdin=subprocess.DEVNULL)
    return out
