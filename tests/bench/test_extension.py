"""A service of somebody's own that takes all it can, within /lib/odid/limited: the broadcast isn't
touched, and the service keeps its limits."""

import json

import parts
import pytest

from . import limits
from .machine import CHANNELS

CPU_PERCENT, MEMORY_MIB, PROCESSES = 50, 24, 64
SECONDS = 20
# Four processors' worth of spinning; then, again and again, more processes than there may be and more
# memory. What is refused a process is a shell of its own, for that ends it.
GREEDY = f"""#!/bin/sh
. /lib/odid/functions
take_over greedy
exec /lib/odid/limited greedy {CPU_PERCENT} {MEMORY_MIB} sh -c '
for n in 1 2 3 4; do (while :; do :; done) & done
while :; do
	sleep 6 & pause=$!
	(for n in $(seq 200); do sleep 3 & done)
	wait $pause
	dd if=/dev/zero of=/dev/null bs=100M count=1
done'
"""
# In so few seconds a p99 is the worst interval but one; so it is the worst ones that are judged.
WORST = limits.arguments("_max_")
GROUP = "/sys/fs/cgroup/greedy"


def number(machine, file, name):
    return int(machine.must(f"sed -n 's/^{name} //p' {GROUP}/{file}"))


@pytest.fixture(name="greedy")
def greedy_service(flying):
    flying.must("mkdir -p /run/service/greedy && ln -sfn /lib/odid/finish /run/service/greedy/finish")
    flying.put("/run/service/greedy/run", GREEDY.encode())
    flying.must("setsid runsv /run/service/greedy </dev/null >/dev/null 2>&1 &")
    flying.wait_inside("the greedy service", f"grep -q 'usage_usec [1-9][0-9]\\{{5\\}}' {GROUP}/cpu.stat")
    yield flying
    flying.must("sv exit /run/service/greedy; rm -rf /run/service/greedy; "
                f"echo 1 >{GROUP}/cgroup.kill; rm -f /run/faults/greedy")


def test_a_greedy_service_takes_nothing_from_the_broadcast(greedy):
    out = parts.ROOT / "build/system/greedy"
    weights = [greedy.must(f"cat /sys/fs/cgroup/{group}/cpu.weight").strip() for group in ("appliance", "mavlink-router", "greedy")]
    assert weights == ["10000", "10000", "1"]
    before, begun = number(greedy, "cpu.stat", "usage_usec"), float(greedy.must("cat /proc/uptime").split()[0])
    judge = greedy.judge(SECONDS, "--played", greedy.folder / "played.jsonl", "--expect", ",".join(CHANNELS),
                         *WORST, out=out)
    judge.wait(SECONDS)
    used, ended = number(greedy, "cpu.stat", "usage_usec"), float(greedy.must("cat /proc/uptime").split()[0])
    share = (used - before) / 1e4 / (ended - begun)
    killed, refused = number(greedy, "memory.events", "oom_kill"), number(greedy, "pids.events", "max")
    (out / "greedy.json").write_text(json.dumps({"cpu_percent": share, "killed": killed, "forks_refused": refused}))
    assert judge.stop() == 0, judge.log()[-4000:]
    assert 5 < share < CPU_PERCENT * 1.1, "it did nothing, or more than it may"
    assert killed > 0 and refused > 0, "it was never at its limits of memory and processes"
    assert int(greedy.must(f"cat {GROUP}/memory.peak")) <= MEMORY_MIB << 20
    greedy.wait_for("a position", lambda: greedy.status()["position"]["fresh"])
