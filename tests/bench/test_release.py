"""What is asked of the release image only (IMAGE=): the bench's own has Debian's kernel and libraries."""

import re
import time

import pytest
from release.figures import figures

from . import faults, runs

MEMORY_MAX_MB = 20
STACK_KIB = 16              # the kernel's, of each thread
SERIAL_LINE_KIB = 128 * 4   # what virtio_console keeps for each line, and for the one that announces them


@pytest.fixture(name="release")
def release_image(flying):
    if flying.run("[ -e /boot/initrd ]").code == 0:
        pytest.skip("this is the bench's own: make system IMAGE=build/image/qemu/images/disk.img")
    return flying


def test_the_autopilot_s_router_is_the_real_one(release):
    assert "mavlink-router version" in release.must("mavlink-routerd --version")
    assert "--tcp-port" in release.run("mavlink-routerd --help").output        # to it the option is an error


def test_addresses_are_of_the_web(release):
    """An update server's answer names an address, too: not one of this board's files."""
    protocols = re.search(r"^Protocols: (.*)", release.must("curl --version"), re.M)[1].split()
    assert {one for one in protocols if one not in ("http", "https", "ipfs", "ipns", "ws", "wss")} == set()
    release.must("echo secret >/tmp/secret")
    assert "secret" not in release.run("curl -s file:///tmp/secret").output


def used_kib(machine):
    """What the kernel gives back at once isn't in use: caches, and the lists of free pages that each processor has."""
    kib = {name: int(value) for name, value in
           re.findall(r"^(\w+): +(\d+) kB$", machine.must("cat /proc/meminfo"), re.M)}
    listed = sum(map(int, re.findall(r"^ +count: +(\d+)$", machine.must("cat /proc/zoneinfo"), re.M)))
    return (kib["MemTotal"] - kib["MemFree"] - kib["Buffers"] - kib["Cached"] - kib["SReclaimable"] + kib["Shmem"]
            - listed * 4)


def bench_s_programs_kib(machine):
    """S05bench and all that it has started: their own pages, page tables and stacks."""
    text = machine.must("for one in /proc/[0-9]*; do cat $one/status; done 2>/dev/null; true")
    found = {int(one["Pid"]): one for one in (
        dict(re.findall(r"^(\w+):\s+(\S+)", f"Name:{status}", re.M)) for status in text.split("Name:")[1:])}

    def ours(pid):
        return pid in found and (found[pid]["Name"] == "S05bench" or ours(int(found[pid]["PPid"])))

    return sum(int(one["RssAnon"]) + int(one["VmPTE"]) + int(one["Threads"]) * STACK_KIB
               for pid, one in found.items() if ours(pid) and "RssAnon" in one)


def test_memory_in_use(release):
    """In flight, everything on the air, without what is the bench's: its programs, radios, network card and lines."""
    release.wait_inside("the last service", "pidof swupdate")
    time.sleep(5)
    all_of_it = used_kib(release)
    release.must("killall -STOP S05bench; killall tcpdump")     # it would start it again
    release.put(faults.TOOL, runs.tool())
    release.must(f"for radio in 1 2; do {faults.TOOL} radio-remove $radio; done; rm {faults.TOOL}")      # the judge's and a station's
    release.must("cd /sys/bus/virtio/drivers/virtio_net && basename virtio* >unbind; sleep 1")
    lines = int(release.must("ls -d /sys/class/virtio-ports/* | wc -l")) + 1
    samples = []        # programs that come and go, each second, are in some of them
    for _ in range(9):
        samples.append(used_kib(release) - bench_s_programs_kib(release))
        time.sleep(1)
    used_mb = (sorted(samples)[4] - lines * SERIAL_LINE_KIB) * 1024 / 1e6
    figures("qemu", memory_used_mb=round(used_mb, 1), memory_used_with_the_bench_mb=round(all_of_it * 1024 / 1e6, 1))
    assert used_mb <= MEMORY_MAX_MB
