"""What board/cm4/board.cmd makes of a device tree, in the bench's own U-Boot.

The trees hold only the nodes that it deals with; that the Compute Module's real tree has these nodes,
tests/release looks at.
"""

import re
import shutil
import subprocess

import parts
import patience
import pytest
from bench import disk as disks

SCRIPT = parts.ROOT / "board/cm4/board.cmd"
VOLUME_AT = 1 << 20
BLUETOOTH, ETHERNET = "/soc/serial@7e201000/bluetooth", "/scb/ethernet@7d580000"
UARTS = {"uart1": "/soc/serial@7e215040", "uart2": "/soc/serial@7e201400", "uart3": "/soc/serial@7e201600",
         "uart4": "/soc/serial@7e201800", "uart5": "/soc/serial@7e201a00"}
ABSENT = ("/scb/pcie@7d500000", ETHERNET, "/soc/rng@7e104000", "/soc/avs-monitor@7d5d2000/thermal")
HOGS = "/soc/firmware/gpio/ant{}-hog"

TREE = """/dts-v1/;
/ {
	%(root)s
	soc {
		serial@7e201000 { bluetooth { %(bluetooth)s }; };
		serial@7e215040 { status = "disabled"; };
		serial@7e201400 { status = "disabled"; };
		serial@7e201600 { status = "disabled"; };
		serial@7e201800 { status = "disabled"; };
		serial@7e201a00 { status = "disabled"; };
		usb@7e980000 { dr_mode = "host"; };
		rng@7e104000 { };
		avs-monitor@7d5d2000 { thermal { }; };
		firmware { gpio { ant1-hog { output-high; }; ant2-hog { output-low; }; }; };
	};
	scb { pcie@7d500000 { %(pcie)s }; ethernet@7d580000 { %(ethernet)s }; };
};
"""
FIRMWARE = {"root": 'serial-number = "10000000a1b2c3d4";', "pcie": "", "ethernet": "local-mac-address = [dc a6 32 01 02 0f];",
            "bluetooth": "local-bd-address = [0f 03 02 32 a6 dc];"}

RUN = """
setenv fdtcontroladdr 0x44000000
setenv fdt_addr_r 0x44100000
load virtio 0:1 ${fdtcontroladdr} firmware.dtb
load virtio 0:1 ${fdt_addr_r} slot.dtb
%s
load virtio 0:1 0x44200000 board.scr && source 0x44200000
fdt addr ${fdt_addr_r}
fdt header get size totalsize
fatwrite virtio 0:1 ${fdt_addr_r} out.dtb ${size}
echo "console=${console} ethaddr=${ethaddr} serial=${serial#}"
echo ALL-DONE
"""

pytestmark = [pytest.mark.usefixtures("emulation_possible"),
              pytest.mark.skipif(not shutil.which("dtc"), reason="dtc isn't installed (Debian: device-tree-compiler)")]


def call(*words, **options):
    return subprocess.run([str(word) for word in words], check=True, capture_output=True, **options).stdout


class Board:
    """What is on the disk, and what came out."""

    def __init__(self, folder):
        self.folder, self.disk = folder, folder / "disk.img"

    def put(self, name, data):
        (self.folder / name).write_bytes(data)
        call("mcopy", "-o", "-i", f"{self.disk}@@{VOLUME_AT}", self.folder / name, f"::{name}")

    def script(self, name, text):
        (self.folder / "text").write_text(text)
        call("mkimage", "-A", "arm64", "-T", "script", "-C", "none", "-d", self.folder / "text", self.folder / name)
        self.put(name, (self.folder / name).read_bytes())

    def start(self, firmware, **board):
        with open(self.disk, "wb") as file:
            file.truncate(36 << 20)
        call("sfdisk", "--quiet", self.disk, input=b"label: dos\nstart=1MiB, type=c\n")
        call("mkfs.fat", "--offset", VOLUME_AT // 512, self.disk, 34 << 10)
        for name, values in (("firmware.dtb", FIRMWARE | firmware), ("slot.dtb", dict.fromkeys(FIRMWARE, ""))):
            self.put(name, call("dtc", "-q", "-I", "dts", "-O", "dtb", input=(TREE % values).encode()))
        self.script("board.scr", SCRIPT.read_text())
        self.script("boot.scr", RUN % "\n".join(f"setenv board_{name} {value}" for name, value in board.items()))
        text = self.run()
        self.said = dict(word.split("=", 1) for word in re.search(r"^(console=.*)$", text, re.M)[1].split())
        (self.folder / "out.dtb").unlink(missing_ok=True)
        call("mcopy", "-i", f"{self.disk}@@{VOLUME_AT}", "::out.dtb", self.folder / "out.dtb")

    def run(self):
        console = self.folder / "console"

        def said():
            return console.read_text(errors="replace").replace("\r", "") if console.exists() else ""
        qemu = subprocess.Popen(
            ["qemu-system-aarch64", "-M", "virt,gic-version=3", "-cpu", "cortex-a72", "-accel", "tcg", "-m", "256",
             "-nodefaults", "-display", "none", "-bios", disks.LOADER, "-chardev", f"file,id=console,path={console}",
             "-serial", "chardev:console", "-drive", f"if=none,id=disk,format=raw,file={self.disk}",
             "-device", "virtio-blk-device,drive=disk"], stdin=subprocess.DEVNULL)
        try:
            def done():
                return "ALL-DONE" in said() and said()
            # About 3 s where the machine has nothing else to do.
            return patience.wait_for("the end of the script", done, every_s=0.1, limit_s=patience.BOOTED_S)
        except TimeoutError as error:
            raise TimeoutError(f"{error}:\n{said()[-2000:]}") from None
        finally:
            qemu.kill()
            qemu.wait()

    def get(self, node, name, kind="s"):
        result = subprocess.run(["fdtget", "-t", kind, self.folder / "out.dtb", node, name], capture_output=True,
                                text=True, check=False)
        return result.stdout.strip() if result.returncode == 0 else None

    def has(self, node, name):
        return name in call("fdtget", "-p", self.folder / "out.dtb", node).decode().split()


@pytest.fixture(name="board")
def board_to_start(tmp_path):
    one = Board(tmp_path)
    yield one
    one.disk.unlink()           # pytest keeps folders of the last runs


def test_as_it_comes(board):
    board.start({})
    assert board.get(ETHERNET, "local-mac-address", "bx") == "dc a6 32 1 2 f"
    assert board.get(BLUETOOTH, "local-bd-address", "bx") == "f 3 2 32 a6 dc"
    assert board.said["serial"] == "10000000a1b2c3d4"
    assert board.said["ethaddr"] == "", "another board's, out of the environment"
    assert board.get("/soc/usb@7e980000", "dr_mode") == "host"
    assert board.has(HOGS.format(1), "output-high") and board.has(HOGS.format(2), "output-low")
    assert [board.get(node, "status") for node in UARTS.values()] == ["disabled"] * 5
    assert [board.get(node, "status") for node in ABSENT] == [None] * 4
    assert board.said["console"] == "ttyAMA0", "as u-boot.env has it"


@pytest.mark.parametrize("bluetooth", ["", "local-bd-address = [00 00 00 00 00 00];"])
def test_a_bluetooth_address_is_made_of_the_serial_number(board, bluetooth):
    board.start({"bluetooth": bluetooth})
    assert board.get(BLUETOOTH, "local-bd-address", "bx") == "d4 c3 b2 1d d 2"


def test_a_firmware_that_says_nothing(board):
    board.start(dict.fromkeys(FIRMWARE, ""))
    assert not board.has(BLUETOOTH, "local-bd-address") and not board.has(ETHERNET, "local-mac-address")


def test_everything_else_than_the_default(board):
    board.start({"pcie": 'status = "disabled";'}, antenna="external", usb="gadget", uarts="uart3 uart5", console="uart2")
    assert not board.has(HOGS.format(1), "output-high") and board.has(HOGS.format(1), "output-low")
    assert not board.has(HOGS.format(2), "output-low") and board.has(HOGS.format(2), "output-high")
    assert board.get("/soc/usb@7e980000", "dr_mode") == "peripheral"
    assert {name: board.get(node, "status") for name, node in UARTS.items()} == {
        "uart1": "disabled", "uart2": "okay", "uart3": "okay", "uart4": "disabled", "uart5": "okay"}
    assert board.said["console"] == "ttyAMA2,115200"
    assert board.get(ABSENT[0], "status") == "disabled" and board.get(ABSENT[1], "status") is None


@pytest.mark.parametrize("console, kernel", [
    ("uart1", "ttyS1,115200"), ("uart5", "ttyAMA5,115200"), ("usb", "ttyGS0"), ("off", "ttyAMA0"), ("nonsense", "ttyAMA0")])
def test_the_console(board, console, kernel):
    board.start({}, console=console, uarts="uart4")
    assert board.said["console"] == kernel
    assert {name for name, node in UARTS.items() if board.get(node, "status") == "okay"} == {console, "uart4"} & set(UARTS)
