"""What is asked of the release image only (IMAGE=): the bench's own has Debian's kernel and libraries."""

import re

import pytest
from image.test_image import figures

MEMORY_MAX_MB = 20


@pytest.fixture(name="release")
def release_image(flying):
    if flying.run("[ -e /boot/initrd ]").code == 0:
        pytest.skip("this is the bench's own: make system IMAGE=build/image/qemu/images/disk.img")
    return flying


def test_memory_in_use(release):
    """In flight, with everything on the air; what the kernel gives back at once (its caches) isn't in use."""
    kib = {name: int(value) for name, value in
           re.findall(r"^(\w+): +(\d+) kB$", release.must("cat /proc/meminfo"), re.M)}
    used = kib["MemTotal"] - kib["MemFree"] - kib["Buffers"] - kib["Cached"] - kib["SReclaimable"] + kib["Shmem"]
    figures("qemu", memory_used_mb=round(used * 1024 / 1e6, 1))
    assert used * 1024 <= MEMORY_MAX_MB * 1_000_000


def test_the_autopilot_s_router_is_the_real_one(release):
    assert "mavlink-router version" in release.must("mavlink-routerd --version")
    assert "--tcp-port" in release.run("mavlink-routerd --help").output        # to it the option is an error
