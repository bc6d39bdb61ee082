"""The built package, taken apart."""

import os
import subprocess
from pathlib import Path

TOP = Path(__file__).resolve().parent.parent.parent
FOLDER = Path(os.environ.get("COMPANION") or TOP / "build/companion")
SOURCE = TOP / "package/odid-daemon/debian"


def call(*words, check=True, **options):
    """(exit code, what it said); one that may not fail shows what it said."""
    result = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                            stdin=subprocess.DEVNULL, check=False, **options)
    assert not check or result.returncode == 0, f"{' '.join(map(str, words))}: {result.returncode}: {result.stdout}"
    return result.returncode, result.stdout


def here():
    """This machine's architecture, as Debian calls it."""
    return call("dpkg", "--print-architecture")[1].strip()


def deb(architecture=None):
    """The package's file, or None where make deb hasn't built it."""
    found = sorted(FOLDER.glob(f"odid_*_{architecture or here()}.deb"))
    return found[-1] if found else None


def container(architecture=None):
    found = sorted(FOLDER.glob(f"odid_*_{architecture or here()}.container.tar"))
    return found[-1] if found else None


def unpack(file, folder):
    """Files, and DEBIAN with the package's own."""
    call("dpkg-deb", "-R", file, folder)
    return folder
