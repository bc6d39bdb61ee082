"""Runs one command as a level with a single test: passed when it exits with 0. One with figures of real time that says
"not judged: WHY" and exits with 77 (as a skipped test does for automake) is not judged."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import junit

NOT_JUDGED = "not judged: "
CODE_NOT_JUDGED = 77


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("junit", type=Path, help="where the result goes; its name is the level's")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args()

    start = time.monotonic()
    not_judged = ""
    with subprocess.Popen(options.command, stdout=subprocess.PIPE, text=True, errors="replace") as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            if line.startswith(NOT_JUDGED):
                not_judged = line.strip()
    code = process.returncode
    case = junit.Case(" ".join(options.command), time.monotonic() - start)
    if code == CODE_NOT_JUDGED and not_judged:
        case.skipped, code = not_judged, 0
    elif code != 0:
        case.failure = f"exit code {code}"
    junit.write(options.junit, options.junit.stem, [case])
    return code


if __name__ == "__main__":
    sys.exit(main())
