"""Adds up what the levels of `make test` left in build/test: each LEVEL.xml in JUnit's form, and
LEVEL.exit when its runner's exit code wasn't 0.

What a test of real time measured on a machine with other work is not judged: it says nothing of the code, is listed
with its figure, and counts apart. The last line is the count, alone. Exits with 0 only when nothing failed and every
level that was asked for left results with at least one test in them.

--keep FOLDER: the same as FOLDER/summary.txt, below the commit, the date and what machine it was.
"""

import argparse
import os
import re
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import quiet

# One line per test inside a cmocka program, which ctest takes for a single test.
CMOCKA = re.compile(r"^\[  *(RUN|OK|FAILED|SKIPPED|ERROR)  *\] (\S+)$")
# What says most in the output of a program that failed.
TELLING = re.compile(r"runtime error: |ERROR: \S|: error: ")
NOT_JUDGED = "not judged: "  # conftest.py
SLOWEST = 10
CMOCKA_RESULTS = {"OK": "passed", "FAILED": "failed", "ERROR": "failed", "SKIPPED": "skipped"}

Result = tuple[str, str, str]  # "passed", "failed", "skipped" or "not judged"; the test's name; why


def level(path: Path) -> list[Result]:
    found = recorded(path)
    code = path.with_suffix(".exit")
    if code.exists() and all(verdict != "failed" for verdict, _, _ in found):
        why = f"its runner's exit code was {code.read_text().strip()}, though no test failed"
        found.append(("failed", path.stem, why))
    return found


def recorded(path: Path) -> list[Result]:
    if not path.exists():
        return [("failed", path.stem, "the level left no results")]
    try:
        cases = list(ElementTree.parse(path).iter("testcase"))
    except ElementTree.ParseError as error:
        return [("failed", path.stem, f"unreadable results: {error}")]
    if not cases:
        return [("failed", path.stem, "no test ran")]
    return [result for case in cases for result in results(case)]


def results(case: ElementTree.Element) -> list[Result]:
    whole = result(case)
    parts = cmocka(case.get("name", ""), case.findtext("system-out") or "")
    # A program that crashes or leaks fails without any of its tests saying so.
    if not parts or (whole[0] == "failed" and all(part[0] != "failed" for part in parts)):
        parts.append(whole)
    return parts


def result(case: ElementTree.Element) -> Result:
    name = "::".join(filter(None, (case.get("classname"), case.get("name"))))
    for tag, verdict in (("failure", "failed"), ("error", "failed"), ("skipped", "skipped")):
        element = case.find(tag)
        if element is not None:
            text = (element.get("message") or element.text or "").strip()
            if verdict == "skipped" and text.startswith(NOT_JUDGED):
                return "not judged", name, text.removeprefix(NOT_JUDGED)
            return verdict, name, text or case.findtext("system-out") or "no reason given"
    return "passed", name, ""


def cmocka(program: str, output: str) -> list[Result]:
    found: dict[str, Result] = {}
    running, said = "", []
    for line in output.splitlines():
        match = CMOCKA.match(line)
        if not match:
            said.append(line)
        elif match[1] == "RUN":
            running, said = match[2], []
        elif match[2] == running:  # not the list of failures at the end
            verdict = CMOCKA_RESULTS[match[1]]
            why = "" if verdict == "passed" else "\n".join(said).strip() or "no reason given"
            found[running] = (verdict, f"{program}::{running}", why)
    return list(found.values())


def slowest(paths: list[Path]) -> list[tuple[float, str]]:
    """What single tests took, the longest first."""
    found = []
    for path in filter(Path.exists, paths):
        try:
            for case in ElementTree.parse(path).iter("testcase"):
                found.append((float(case.get("time") or 0), result(case)[1]))
        except ElementTree.ParseError:
            continue  # recorded() has counted it as a failure
    return sorted(found, reverse=True)[:SLOWEST]


def headline(why: str) -> str:
    lines = why.strip().splitlines()
    return next(filter(TELLING.search, lines), lines[0])


def origin(folder: Path) -> str:
    """What was tested, when, and on what; how quiet that was is in each level's own watch."""
    words = ["git", "describe", "--always", "--dirty", "--abbrev=12", "--exclude=*"]
    commit = subprocess.run(words, capture_output=True, text=True, check=False).stdout.strip() or "no commit"
    processors = re.search(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.M)
    memory_kib = re.search(r"^MemTotal:\s*(\d+)", Path("/proc/meminfo").read_text(), re.M)
    still_s, others, watched_s = watched(folder)
    return (f"commit {commit}, {time.strftime('%Y-%m-%d %H:%M', time.gmtime())} UTC\n"
            f"{os.cpu_count()} processors, {processors[1] if processors else os.uname().machine}, "
            f"{int(memory_kib[1]) / 2**20:.0f} GiB, Linux {os.uname().release}\n"
            f"watched for {watched_s:.0f} s: stood still for {still_s:.1f} s at most, other work had {others:.2f} processors\n")


def watched(folder: Path) -> tuple[float, float, float]:
    """Of all the watches that were kept (conftest.py): the longest standstill, the processors that other work had on
    average, and over how long."""
    logs = list(folder.glob("quiet-*.jsonl"))
    counted = [one for log in logs for one in quiet.lines(log, "others")]
    watched_s = sum(one["seconds"] for one in counted)
    others = sum(one["others"] * one["seconds"] for one in counted) / watched_s if watched_s else 0.0
    return max((quiet.stood_still_s(log, 0, float("inf")) for log in logs), default=0.0), others, watched_s


def main() -> int:
    parser = argparse.ArgumentParser(description="Adds up what the levels of a test left.")
    parser.add_argument("folder", type=Path, help="where they left it")
    parser.add_argument("levels", nargs="+")
    parser.add_argument("--keep", type=Path, metavar="FOLDER")
    arguments = parser.parse_args()
    text, passed = summary(arguments.folder, arguments.levels)
    print(text, end="")
    if arguments.keep:
        arguments.keep.mkdir(parents=True, exist_ok=True)
        (arguments.keep / "summary.txt").write_text(origin(arguments.folder) + text, encoding="utf-8")
    return 0 if passed else 1


def summary(folder: Path, levels: list[str]) -> tuple[str, bool]:
    said: list[str] = []
    total: Counter[str] = Counter()
    listed: dict[str, list[Result]] = {"skipped": [], "not judged": [], "failed": []}
    said.append("\nSummary")
    for name in levels:
        found = level(folder / f"{name}.xml")
        counts = Counter(verdict for verdict, _, _ in found)
        total += counts
        for verdict, some in listed.items():
            some += [one for one in found if one[0] == verdict]
        said.append(
            f"  {name:8} {counts['passed']:5} passed {counts['failed']:5} failed {counts['skipped']:5} skipped"
            + (f" {counts['not judged']:5} not judged" if counts["not judged"] else "")
        )
    said.append("Slowest")
    for seconds, name in slowest([folder / f"{name}.xml" for name in levels]):
        said.append(f"  {seconds:6.1f} s  {name}")
    for verdict, some in listed.items():
        if some:
            said.append(verdict.capitalize())
        said += [f"  {name}: {headline(why)}" for _, name, why in some]
    started = folder / "started"
    if started.exists():
        said.append(f"Took {time.time() - int(started.read_text()):.0f} s, set-up and building included")
    if total["not judged"]:
        said.append(f"{total['passed']} passed, {total['failed']} failed, {total['not judged']} not judged")
    said.append(f"{total['passed']} passed, {total['failed']} failed, {total['skipped']} skipped")
    return "\n".join(said) + "\n", total["passed"] > 0 and not total["failed"]


if __name__ == "__main__":
    sys.exit(main())
