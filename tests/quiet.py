"""Whether the measuring machine had nothing else to do: only then does a figure of real time tell of the code.

Two things spoil it. A virtual machine has its processors taken away by its host now and then, and stands still: a thread
on each processor, with real-time priority above all of the bench, wakes every 10 ms, and one that is 50 ms late could not
run, and so nothing could. And other work may want the processors: what they did is counted against what the bench did,
that is the process that started the watch with all that it started.

Each is a line in the log: `mono` at its end, `seconds`, and `processor` (it stood still) or `others` (how many
processors other work had on average).
"""

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

from judge.receptions import read_json_lines

WAKE_EVERY_S, LATE_S = 0.01, 0.05
PRIORITY = 30  # the models' is 10, the daemon's (in tests without an emulated machine) is 20
COUNT_EVERY_S = 1.0
OTHERS_MAX = 0.2  # the kernel's own threads, a shell that somebody sits at
TICKS = os.sysconf("SC_CLK_TCK")


class Watch:
    """A watch over this machine, until stop()."""

    def __init__(self, log):
        self.log = Path(log)
        self.log.parent.mkdir(parents=True, exist_ok=True)
        self.log.unlink(missing_ok=True)
        self.process = subprocess.Popen([sys.executable, __file__, "--out", self.log], stdin=subprocess.DEVNULL,
                                        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)})

    def disturbed(self, from_mono, until_mono):
        """What says against figures that were taken in between; empty: nothing is known against them."""
        if (still_s := stood_still_s(self.log, from_mono, until_mono)) > 0:
            return f"this machine stood still for {still_s:.2f} s"
        if (others := others_had(self.log, from_mono, until_mono)) > OTHERS_MAX:
            return f"other work had {others:.2f} of this machine's {os.cpu_count()} processors"
        return ""

    def stop(self):
        self.process.terminate()
        self.process.wait()


def lines(log, key, from_mono=0.0, until_mono=float("inf")):
    """Those that have this key, of a window."""
    if not Path(log).exists():
        return []
    return [one for _, one in read_json_lines(log)
            if key in one and one["mono"] >= from_mono and one["mono"] - one["seconds"] <= until_mono]


def stood_still_s(log, from_mono, until_mono):
    """The longest standstill that reaches into the window; 0 without one, or without a log."""
    return max((one["seconds"] for one in lines(log, "processor", from_mono, until_mono)), default=0.0)


def others_had(log, from_mono, until_mono):
    """How many processors other work had on average; 0 without a log."""
    counted = lines(log, "others", from_mono, until_mono)
    seconds = sum(one["seconds"] for one in counted)
    return sum(one["others"] * one["seconds"] for one in counted) / seconds if seconds else 0.0


# --- the watch itself ----------------------------------------------------------


def watch_processor(processor, out):
    os.sched_setaffinity(0, {processor})
    due = time.monotonic()
    while True:
        due += WAKE_EVERY_S
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        if now - due >= LATE_S:
            out.write(json.dumps({"mono": now, "seconds": round(now - due, 3), "processor": processor}) + "\n")
            due = now


def busy_s():
    """Of all processors, since the machine's start: all but idle and waiting. What a host took is others'."""
    user, nice, system, _idle, _waiting, *interrupts_and_stolen = map(int, Path("/proc/stat").read_text().split()[1:9])
    return (user + nice + system + sum(interrupts_and_stolen)) / TICKS


def processes():
    """{number: (parent, seconds with those of ended children)}."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            # The second field, the name, may hold anything but ends with the last bracket.
            fields = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        found[int(stat.parent.name)] = int(fields[1]), sum(map(int, fields[11:15])) / TICKS
    return found


def ours_s(bench):
    """Of that process and all below it."""
    found = processes()
    ours, sum_s = {bench}, found[bench][1] if bench in found else 0.0
    left = {number: one for number, one in found.items() if number != bench}
    while new := [number for number, (parent, _) in left.items() if parent in ours]:
        ours.update(new)
        sum_s += sum(left.pop(number)[1] for number in new)
    return sum_s


def count_others(bench, out):
    before = time.monotonic(), busy_s(), ours_s(bench)
    while os.getppid() == bench:
        time.sleep(COUNT_EVERY_S)
        now = time.monotonic(), busy_s(), ours_s(bench)
        seconds, busy, ours = (new - old for new, old in zip(now, before))
        out.write(json.dumps({"mono": round(now[0], 3), "seconds": round(seconds, 3),
                              "others": round(max(0.0, busy - ours) / seconds, 2)}) + "\n")
        before = now


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", required=True)
    bench = os.getppid()
    with open(parser.parse_args().out, "a", buffering=1) as out:
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        except PermissionError:
            pass  # without it we could be late because of others: not known is not "stood still"
        else:
            for one in os.sched_getaffinity(0):
                threading.Thread(target=watch_processor, args=(one, out), daemon=True).start()
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # what follows computes, and is in no hurry
        count_others(bench, out)


if __name__ == "__main__":
    main()
