"""`make soak`: the appliance in a flight of half an hour, without a fault: nothing may go wrong on the
air, and nothing may grow in the machine.

  SECONDS=<n>      how long (1800)

Every minute it is looked at from the bench's own console: memory that only the process itself has
(RssAnon), open file descriptors and used disk. What grew is the difference between the first samples
after SETTLED_S, when every service has done all it does once, and the last ones.

What the judge finds beside other work is not judged (exit code 77) as far as it is about time.
"""

import datetime
import json
import os
import subprocess
import sys
import time
from collections import namedtuple
from itertools import pairwise
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import parts
import program
from bench import flights, gaps, limits, wifi
from bench.machine import CHANNELS, Machine, missing
from measure.runs import violations_without_time

FOLDER = parts.ROOT / "build/soak"
DEFAULT_S = 1800
SETTLED_S = 180
EVERY_S = 60
# What may grow: the allocator's and the shell's rounding in memory, and the flight record on the disk,
# which has one line every 10 s at most, and an end.
GROWTH = {"rss_anon_kib": 128, "file_descriptors": 0, "memory_kib": 2048, "tmpfs_kib": 64, "data_kib": 256}
Sample = namedtuple("Sample", "at_s processes rss_anon_kib file_descriptors memory_kib tmpfs_kib data_kib")

# Per process: name, RssAnon, descriptors. Only services that run on: not what a script starts for a moment.
LOOK = """
for file in /run/pid/*; do
    read -r pid _ <$file
    for p in $pid $(cat /proc/$pid/task/$pid/children 2>/dev/null); do
        read -r name 2>/dev/null </proc/$p/comm || continue
        case $name in sleep|usleep|sh) [ $p = $pid ] || continue;; esac
        echo process ${file##*/}/$name $(sed -n 's/RssAnon:[^0-9]*\\([0-9]*\\).*/\\1/p' /proc/$p/status) $(ls /proc/$p/fd | wc -l)
    done
done
echo memory $(sed -n 's/^MemAvailable:[^0-9]*\\([0-9]*\\).*/\\1/p' /proc/meminfo)
df -k /run /tmp /var | while read -r device _ used _; do [ "$used" = Used ] || echo tmpfs $used; done
df -k /data | while read -r device _ used _; do [ "$used" = Used ] || echo data $used; done
"""


def look(machine, at_s):
    """What there is at this moment."""
    processes, sums = {}, {"memory": 0, "tmpfs": 0, "data": 0}
    for line in machine.must(LOOK).splitlines():
        kind, *words = line.split()
        if kind == "process" and len(words) == 3:
            rss_kib, descriptors = processes.get(words[0], (0, 0))
            processes[words[0]] = rss_kib + int(words[1]), descriptors + int(words[2])
        elif kind in sums:
            sums[kind] += int(words[0])
    if not any(name.endswith("/odid-daemon") for name in processes):
        raise RuntimeError(f"the daemon is not among the processes: {sorted(processes)}")
    return Sample(at_s, processes, sum(one for one, _ in processes.values()),
                  sum(one for _, one in processes.values()), sums["memory"], sums["tmpfs"], sums["data"])


def least(samples):
    """Of each of GROWTH what all of these had: one of them may have met a connection that was just made."""
    used = [one._replace(memory_kib=-one.memory_kib) for one in samples]  # what is available gets less
    return {name: min(getattr(one, name) for one in used) for name in GROWTH}


def growth(samples):
    """What grew from the first two settled samples to the last three, in GROWTH's units."""
    settled = [one for one in samples if one.at_s >= SETTLED_S]
    first, last = least(settled[:2]), least(settled[2:][-3:])
    return {name: last[name] - first[name] for name in GROWTH}


def longest_waits(contents, standstills):
    """{channel: (seconds, how many of them the emulated machine stood still)} of what a receiver waited for a newer position.
    In a long run a machine stands still now and then, and that is no word about the code: the longest is taken without.
    standstills: (CLOCK_MONOTONIC in seconds at its end, seconds)."""
    def still_s(begun, ended):
        return sum(seconds for at, seconds in standstills if begun < at <= ended)

    waits = {}
    for channel in ("bt4", "wifi"):
        intervals = [(ended - begun, still_s(begun, ended)) for begun, ended in pairwise(contents.newer[channel])]
        waits[channel] = max(intervals, key=lambda one: one[0] - one[1])
    return waits


def too_long(waits):
    """Says them all; returns what is wrong with them."""
    problems = []
    for channel, (seconds, still_s) in waits.items():
        limit_s = limits.AIR_S[f"{channel}_location_content_max_s"]
        print(f"{channel}: at most {seconds:.3f} s for a newer position, {still_s:.3f} s of them the emulated machine stood still "
              f"({limit_s} allowed without)")
        if seconds - still_s > limit_s:
            problems.append(f"{channel}: {seconds - still_s:.3f} s for a newer position")
    return problems


def fly(machine, seconds):
    """The flight, judged and looked at. The judge's exit code, the samples, and what speaks against its verdict."""
    machine.power_on()
    machine.wait_on_air()
    machine.play(flights.generate(FOLDER / "flight.tlog", seconds + 60))
    machine.wait_on_air(position=True)
    time.sleep(3)
    judge = machine.judge(seconds, "--played", machine.folder / "played.jsonl", "--expect", ",".join(CHANNELS),
                          *limits.arguments("_p99_"), out=FOLDER)
    start, samples = time.monotonic(), []
    try:
        while (at_s := time.monotonic() - start) < seconds - 5:
            samples.append(look(machine, at_s))
            one = samples[-1]
            print(f"soak: {at_s:6.0f} s  RssAnon {one.rss_anon_kib} KiB, {one.file_descriptors} descriptors, "
                  f"{one.memory_kib} KiB available, tmpfs {one.tmpfs_kib} KiB, /data {one.data_kib} KiB", flush=True)
            time.sleep(max(0.0, min(EVERY_S, seconds - 4 - (time.monotonic() - start))))
        code = judge.wait(seconds)
    finally:
        judge.stop()
    print(judge.log())
    return code, samples, machine.disturbed(start, time.monotonic())


def main():
    seconds = float(os.environ.get("SECONDS") or DEFAULT_S)
    if seconds < SETTLED_S + 4 * EVERY_S:
        sys.exit(f"soak: SECONDS={seconds:g}: at least {SETTLED_S + 4 * EVERY_S} are needed to see growth")
    reason = missing()
    if reason:
        sys.exit(f"soak: {reason}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    machine = Machine(FOLDER / "machine")
    try:
        code, samples, disturbed = fly(machine, seconds)
        faults = machine.run("ls /run/faults").output.split()
    finally:
        machine.close()
    (FOLDER / "samples.json").write_text(json.dumps([one._asdict() for one in samples], indent=1) + "\n")
    grown, problems = growth(samples), [] if code == 0 or disturbed else [f"the judge ended with {code}"]
    unix_s = time.time() - time.monotonic()
    late = too_long(longest_waits(gaps.Contents(FOLDER / "receptions.jsonl"),
                                  [(at - unix_s, seconds) for at, seconds in wifi.standstills(machine.pcap)]))
    if late and not disturbed:
        problems += late
    for name, limit in GROWTH.items():
        print(f"{name}: grew by {grown[name]} ({limit} allowed)")
        if grown[name] > limit:
            problems.append(f"{name} grew by {grown[name]}")
    if faults:
        problems.append(f"faults: {', '.join(faults)}")
    path = FOLDER / "figures.json"
    figures = json.loads(path.read_text())
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=parts.ROOT, capture_output=True, text=True)
    if code != 0 and disturbed and (violations := violations_without_time(FOLDER, FOLDER / "machine/played.jsonl")):
        problems.append(f"{violations} violations that no other work explains")
    verdict = "FAIL" if problems else "not judged" if code != 0 or late else "PASS"
    figures.update({f"growth_{name}": value for name, value in grown.items()}, soak_s=seconds, disturbed=disturbed,
                   commit=commit.stdout.strip() or "unknown", verdict=verdict,
                   date=datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"))
    path.write_text(json.dumps(figures, indent=1) + "\n")
    print("\n".join(problems + [f"not judged: {disturbed}; the judge ended with {code}" if verdict == "not judged" else verdict]))
    return {"FAIL": 1, "not judged": program.NOT_JUDGED}.get(verdict, 0)


if __name__ == "__main__":
    program.run("soak", main)
