"""USB sticks: disks with a file system and no partitions, and the machine's port for them."""

from bench.disk import call

from . import bundles
from .appliance import wait_for

SPARE = 32 << 20    # for what a file system keeps for itself


def blank(name, files):
    """A stick without a file system, large enough for those files."""
    image = bundles.BUILD / f"{name}.stick"
    image.unlink(missing_ok=True)
    with open(image, "wb") as out:
        out.truncate(sum(file.stat().st_size for file in files) + SPARE)
    return image


def stick(name, *files):
    """A stick with those files at its top level."""
    image = blank(name, files)
    call("mkfs.fat", "-F", "32", image)
    for file in files:
        call("mcopy", "-i", image, file, f"::{file.name}")
    return image


def plug(machine, image, read_only=True):
    machine.qmp.command("blockdev-add", **{"driver": "raw", "node-name": "stick", "read-only": read_only,
                                           "file": {"driver": "file", "filename": str(image)}})
    machine.qmp.command("device_add", driver="usb-storage", id="stick", drive="stick", bus="usb.0")


def let_go(machine):
    """The appliance sees it go a moment before QEMU is done with it."""
    try:
        machine.qmp.command("blockdev-del", **{"node-name": "stick"})
    except RuntimeError as error:
        if "in use" not in str(error):
            raise
        return False
    return True


def pull(machine):
    machine.qmp.command("device_del", id="stick")
    wait_for("the stick to be gone", lambda: machine.run("[ -e /sys/class/block/sda ]").code != 0)
    wait_for("QEMU to let go of the stick's file", lambda: let_go(machine))
