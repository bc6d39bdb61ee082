"""What is tested here needs the disk and QEMU, and boots no further than the boot loader."""

import pytest
from bench.machine import missing


@pytest.fixture(scope="session", autouse=True)
def loader_possible():
    reason = missing()
    if reason:
        pytest.skip(reason)
