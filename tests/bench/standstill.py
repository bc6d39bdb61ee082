"""When the measuring machine itself stood still: one that is virtual has its processors taken away by its
host now and then, and is then late with the air, with the autopilot and with the emulated machine at once.

A thread on each processor, with real-time priority above all of the bench, wakes every 10 ms. One that
is woken 50 ms late or more could not run, and so nothing could. Each time is a line in the log:
monotonic time at the end, seconds, processor.
"""

import argparse
import json
import os
import threading
import time

from receiver.receptions import read_json_lines

EVERY_S = 0.01
LATE_S = 0.05
PRIORITY = 30  # the models' is 10, the daemon's (in tests without an emulated machine) is 20


def watch(processor, out):
    os.sched_setaffinity(0, {processor})
    due = time.monotonic()
    while True:
        due += EVERY_S
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        if now - due >= LATE_S:
            out.write(json.dumps({"mono": now, "seconds": round(now - due, 3), "processor": processor}) + "\n")
            due = now


def longest_s(path, from_mono, until_mono):
    """The longest standstill that reaches into the window; 0 without one, or without a log."""
    if not path.exists():
        return 0.0
    return max((one["seconds"] for _, one in read_json_lines(path)
                if one["mono"] >= from_mono and one["mono"] - one["seconds"] <= until_mono), default=0.0)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", required=True)
    options = parser.parse_args()
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
    except PermissionError:
        return  # without it we could be late because of others: not known is not "stood still"
    with open(options.out, "a", buffering=1) as out:
        threads = [threading.Thread(target=watch, args=(one, out)) for one in os.sched_getaffinity(0)]
        for one in threads:
            one.start()
        for one in threads:
            one.join()


if __name__ == "__main__":
    main()
