"""The appliance's disk for one run: a copy-on-write layer over the built image."""

import functools
import json
import os
import re
import subprocess
import tempfile
from contextlib import contextmanager
from pathlib import Path

import parts

APPLIANCE = parts.ROOT / "build/appliance"
IMAGE = Path(os.environ.get("IMAGE") or APPLIANCE / "disk.img")
# Beside the disk lies the boot loader that belongs to it.
LOADER = IMAGE.with_name("u-boot.bin")
SECTOR = 512
BOOT, CONFIG, ENV, SLOT_A, SLOT_B, DATA = 1, 2, 5, 6, 7, 8


def call(*words, **options):
    """Runs a program; its output, or a RuntimeError with it."""
    result = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            stdin=subprocess.DEVNULL, text=True, **options)
    if result.returncode:
        raise RuntimeError(f"{words[0]} ended with {result.returncode}: {result.stdout.strip()}")
    return result.stdout


def places(image):
    """{partition's number: (offset, size)} in octets."""
    table = json.loads(call("sfdisk", "--json", image))["partitiontable"]
    return {int(entry["node"].removeprefix(str(image))): (entry["start"] * SECTOR, entry["size"] * SECTOR)
            for entry in table["partitions"]}


def inside(image, name):
    """A file of the root in slot a."""
    offset, _ = places(image)[SLOT_A]
    return subprocess.run(["unsquashfs", "-o", str(offset), "-cat", image, name], stdout=subprocess.PIPE,
                          stdin=subprocess.DEVNULL, check=True).stdout


@functools.cache
def board(image=IMAGE):
    """Which one an image is made for."""
    return re.search(r"^BOARD=(\S+)$", inside(image, "etc/odid-release").decode(), re.M)[1]


class Disk:
    """Changed only while no machine has it."""

    form = "qcow2"

    def __init__(self, path, image=IMAGE):
        self.path, self.image = Path(path), Path(image).resolve()
        if not self.image.exists():
            raise FileNotFoundError(f"{self.image} isn't built: make appliance")
        self.path.unlink(missing_ok=True)
        self._make()

    def _make(self):
        call("qemu-img", "create", "-q", "-f", self.form, "-F", "raw", "-b", self.image, self.path)

    def place(self, number):
        """Offset and size of a partition, in octets."""
        return places(self.image)[number]

    def _options(self, number):
        offset, size = self.place(number)
        return (f"driver=raw,offset={offset},size={size},file.driver={self.form},"
                f"file.file.driver=file,file.file.filename={self.path}")

    def read(self, number, out):
        """Copies a partition to a file."""
        call("qemu-img", "convert", "-O", "raw", "--image-opts", self._options(number), out)

    def write(self, number, source):
        """Copies a file of the partition's size to a partition."""
        call("qemu-img", "convert", "-n", "-f", "raw", "--target-image-opts", source, self._options(number))

    def fill(self, number, octet, at=0, size=None):
        """Overwrites a partition, or size octets of it."""
        offset, whole = self.place(number)
        call("qemu-io", "-f", self.form, "-c", f"write -P {octet:#x} {offset + at} {size or whole}", self.path)

    def forget_partition(self, number):
        """Takes a partition out of the table: the disk has none of that number any more."""
        with self._whole() as raw:
            call("sfdisk", "--quiet", "--no-reread", "--no-tell-kernel", "--delete", raw, number)

    @contextmanager
    def _whole(self):
        with tempfile.NamedTemporaryFile(dir=self.path.parent) as raw:
            call("qemu-img", "convert", "-f", self.form, "-O", "raw", self.path, raw.name)
            yield raw.name
            call("qemu-img", "convert", "-n", "-f", "raw", "-O", self.form, raw.name, self.path)

    def put_config(self, files):
        """Puts files on the CONFIG volume, as a technician does with a card reader."""
        self.put_files(CONFIG, files)

    def put_files(self, number, files):
        """Puts files on a volume of FAT."""
        with tempfile.TemporaryDirectory(dir=self.path.parent) as folder:
            volume, source = Path(folder, "volume"), Path(folder, "file")
            self.read(number, volume)
            for name, content in files.items():
                source.write_bytes(content if isinstance(content, bytes) else content.encode())
                call("mcopy", "-o", "-i", volume, source, f"::{name}")
            self.write(number, volume)

    def read_config(self, name):
        """A file of the CONFIG volume, None when there is none."""
        with tempfile.TemporaryDirectory(dir=self.path.parent) as folder:
            volume, target = Path(folder, "volume"), Path(folder, "file")
            self.read(CONFIG, volume)
            if name not in call("mdir", "-b", "-i", volume, "::").replace("::/", "").split("\n"):
                return None
            call("mcopy", "-n", "-i", volume, f"::{name}", target)
            return target.read_bytes()


class Card(Disk):
    """Of a size that the emulated controller takes, and a copy: a card's writes are asked to be flushed by nobody, so the table
    of clusters that QEMU keeps of a layer would be lost with it."""

    form = "raw"
    octets = 512 << 20  # a power of two

    def _make(self):
        call("qemu-img", "convert", "-O", self.form, self.image, self.path)
        call("qemu-img", "resize", "-q", "-f", self.form, self.path, self.octets)
