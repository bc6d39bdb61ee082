"""`make faults-without`: do the tests of faults see anything? Faults of the list are done to an appliance
that lacks what is there against them; each of them has to miss its limit."""

import sys
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import program
from bench import faults, runs
from bench.machine import missing


def main():
    reason = missing()
    if reason:
        sys.exit(f"faults-without: {reason}")
    runs.FOLDER = runs.FOLDER.with_name("faults-without")
    outcomes = runs.in_flight(faults.WITHOUT)
    unseen = 0
    print(f"\n{'fault':<22} {'longest gap':>12} {'limit':>8}  what")
    for one in outcomes.values():
        missed = one.gap_s is not None and one.gap_s > one.limit_s
        unseen += not missed
        gap = "no figure" if one.gap_s is None else f"{one.gap_s:.2f} s"
        print(f"{one.fault:<22} {gap:>12} {one.limit_s:>6.2f} s  {one.what}{'' if missed else '  NOT SEEN'}")
    print(f"{unseen} of {len(outcomes)} not seen\n{'FAIL' if unseen else 'PASS'}")
    return 1 if unseen else 0


if __name__ == "__main__":
    program.run("faults-without", main)
