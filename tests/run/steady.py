"""`make steady`: does the gate say the same thing each time? Runs it again and again, each in a clean clone of HEAD.

  COUNT=<n>     how often (10)
  STRESS=<n>    beside so many processes that want a processor each (none)

build/steady keeps each run's log, and table.txt: verdict, seconds, what failed. Exits with 0 when all of them passed.
"""

import os
import re
import shutil
import subprocess
import sys
import time

import parts
import program
from measure import costs

FOLDER = parts.ROOT / "build/steady"
COUNTED = re.compile(r"^(\d+) passed, (\d+) failed, (\d+) skipped$", re.M)


def number(name, default):
    text = os.environ.get(name) or default
    if not text.isdigit():
        sys.exit(f"steady: {name}={text}: expected a number")
    return int(text)


def failed(log):
    """The tests that the summary names."""
    found = re.search(r"^Failed\n((?:  .*\n)*)", log, re.M)
    return [line.split(": ")[0].strip() for line in found[1].splitlines()] if found else []


def once(name, commit):
    """One run of the gate: (passed, seconds, what is to be said of it)."""
    clone, log = FOLDER / f"{name}.clone", FOLDER / f"{name}.log"
    shutil.rmtree(clone, ignore_errors=True)
    subprocess.run(["git", "clone", "--quiet", parts.ROOT, clone], check=True)
    subprocess.run(["git", "checkout", "--quiet", commit], cwd=clone, check=True)
    # What this run got from its own make isn't the other one's.
    environment = {key: value for key, value in os.environ.items() if key not in (
        "MAKEFLAGS", "MAKELEVEL", "MFLAGS", "PYTHONPATH", "PYTHONPYCACHEPREFIX")} | {"TEST_DATA": str(parts.test_data())}
    begun = time.monotonic()
    with open(log, "w") as out:
        code = subprocess.run(["make", "test"], cwd=clone, env=environment, stdin=subprocess.DEVNULL, stdout=out,
                              stderr=subprocess.STDOUT).returncode
    seconds, text = time.monotonic() - begun, log.read_text(errors="replace")
    counts = COUNTED.search(text)
    said = ", ".join(failed(text)) or (counts[0] if counts else f"no summary: {log.relative_to(parts.ROOT)}")
    if code == 0:
        shutil.rmtree(clone)
    return code == 0, seconds, said


def main():
    count, stress = number("COUNT", "10"), number("STRESS", "0")
    FOLDER.mkdir(parents=True, exist_ok=True)
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=parts.ROOT, capture_output=True, text=True,
                            check=True).stdout.strip()
    title = f"{commit}, {time.strftime('%Y-%m-%d', time.gmtime())}, {f'beside {stress} processes of stress' if stress else 'alone'}"
    print(f"steady: {count} times make test: {title}", flush=True)
    lines, passed = [], 0
    load = costs.Load(f"--cpu {stress}" if stress else None, 0)  # until it is told to stop
    try:
        for run in range(1, count + 1):
            good, seconds, said = once(f"{'stress-' if stress else ''}{run}", commit)
            passed += good
            lines.append(f"{run:3}  {'passed' if good else 'FAILED'}  {seconds:5.0f} s  {said}")
            print(lines[-1], flush=True)
            if not load.is_running():
                sys.exit("steady: stress-ng ended before the runs did")
    finally:
        load.stop()
    lines.append(f"{passed} of {count} passed")
    print(lines[-1])
    with open(FOLDER / "table.txt", "a") as table:
        table.write("\n".join([title, *lines]) + "\n\n")
    return 0 if passed == count else 1


if __name__ == "__main__":
    program.run("steady", main)
