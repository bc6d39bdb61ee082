"""Without root, or without BusyBox, these tests skip and say so."""

import os

import pytest

from .root import BUSYBOX, Appliance


@pytest.fixture
def appliance(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("a root of its own needs root")
    if BUSYBOX is None:
        pytest.skip("busybox isn't installed (Debian: busybox-static)")
    return Appliance(tmp_path / "root")
