"""Without root, or without BusyBox, these tests skip and say so."""

import functools
import os
import subprocess

import pytest

from .root import BUSYBOX, OF_ITS_OWN, Appliance


@functools.cache
def no_mounts():
    """Why there are none of our own here; empty: there are."""
    tried = subprocess.run([*OF_ITS_OWN, "true"], capture_output=True, text=True, check=False)
    return tried.stderr.strip() if tried.returncode else ""


@pytest.fixture
def appliance(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("a root of its own needs root")
    if BUSYBOX is None:
        pytest.skip("busybox isn't installed (Debian: busybox-static)")
    if no_mounts():
        pytest.skip(f"a root of its own needs mounts of its own (in a container: --cap-add SYS_ADMIN): {no_mounts()}")
    appliance = Appliance(tmp_path / "root")
    yield appliance
    appliance.end_all()
