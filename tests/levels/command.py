"""Runs one command as a level with a single test: passed when it exits with 0."""

import argparse
import subprocess
import sys
import time
from pathlib import Path

import junit


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("junit", type=Path, help="where the result goes; its name is the level's")
    parser.add_argument("command", nargs=argparse.REMAINDER)
    options = parser.parse_args()

    start = time.monotonic()
    code = subprocess.run(options.command).returncode
    case = junit.Case(" ".join(options.command), time.monotonic() - start)
    if code != 0:
        case.failure = f"exit code {code}"
    junit.write(options.junit, options.junit.stem, [case])
    return code


if __name__ == "__main__":
    sys.exit(main())
