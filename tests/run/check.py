"""`make check`: what a tool can say about the sources without running them."""

import argparse
import os
import re
import subprocess
import sys
import time
from pathlib import Path

import junit

# Neither holds sources of ours.
ELSEWHERE = {".git", "build"}
DAEMON = Path("package/odid-daemon")


def sources() -> list[Path]:
    found = []
    for folder, folders, files in os.walk("."):
        folders[:] = sorted(name for name in folders if name not in ELSEWHERE)
        found += [Path(folder, name) for name in sorted(files)]
    return [path for path in found if path.is_file() and not path.is_symlink()]


def is_shell(path: Path) -> bool:
    with path.open("rb") as file:
        first = file.readline(80)
    return path.suffix == ".sh" or re.match(rb"#! ?/.*\b(sh|bash)\b", first) is not None


def is_man_page(path: Path) -> bool:
    return path.parent.name == "man" and path.suffix in {".1", ".5", ".8"}


def checks() -> list[tuple[str, list[str], list[Path]]]:
    """Name, command and the files that it is given."""
    paths = sources()
    python = [path for path in paths if path.suffix == ".py"]
    ours = [path for path in paths if path.suffix in {".c", ".h"}]
    return [
        (
            "C formatting",
            ["clang-format", "--dry-run", "-Werror"],
            ours,
        ),
        ("shell scripts", ["shellcheck"], [path for path in paths if is_shell(path)]),
        (
            "man pages",
            ["mandoc", "-T", "lint", "-W", "warning,stop"],
            [path for path in paths if is_man_page(path)],
        ),
        ("Python", [sys.executable, "-m", "pyflakes"], python),
        (
            "waits and durations",
            [sys.executable, "tests/run/durations.py"],
            [path for path in python if path.parts[0] == "tests"]
            + [path for path in ours if path.is_relative_to(DAEMON / "tests")],
        ),
        ("test modules apart", [sys.executable, "tests/run/apart.py"], [path for path in python if path.parts[0] == "tests"]),
        ("rooms", [sys.executable, "tests/run/rooms.py"], [path for path in ours if path.is_relative_to(DAEMON / "src")]),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--junit", type=Path, help="write the results there as well")
    options = parser.parse_args()

    cases = []
    for name, command, files in checks():
        start = time.monotonic()
        case = junit.Case(name, 0)
        if not files:
            case.skipped = "no such files"
        else:
            result = subprocess.run(
                [*command, *map(str, files)],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
            )
            if result.returncode != 0:
                case.failure = result.stdout or f"exit code {result.returncode}"
        case.seconds = time.monotonic() - start
        cases.append(case)
        verdict = "FAILED" if case.failure else f"skipped: {case.skipped}" if case.skipped else "ok"
        print(f"{name} ({len(files)} files): {verdict}")
        if case.failure:
            print(case.failure.rstrip())
    if options.junit:
        junit.write(options.junit, "check", cases)
    return any(case.failure for case in cases)


if __name__ == "__main__":
    sys.exit(main())
