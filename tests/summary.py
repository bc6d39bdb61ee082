"""Adds up what the levels of `make test` left in build/test: each LEVEL.xml in JUnit's form, and
LEVEL.exit when its runner's exit code wasn't 0.

What a test of real time measured on a machine with other work is not judged: it says nothing of the code, is listed
with its figure, and counts apart. The last line is the count, alone. Exits with 0 only when nothing failed and every
level that was asked for left results with at least one test in them.
"""

import re
import sys
import time
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

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


def main() -> int:
    folder, levels = Path(sys.argv[1]), sys.argv[2:]
    total: Counter[str] = Counter()
    listed: dict[str, list[Result]] = {"skipped": [], "not judged": [], "failed": []}
    print("\nSummary")
    for name in levels:
        found = level(folder / f"{name}.xml")
        counts = Counter(verdict for verdict, _, _ in found)
        total += counts
        for verdict, some in listed.items():
            some += [one for one in found if one[0] == verdict]
        print(
            f"  {name:8} {counts['passed']:5} passed {counts['failed']:5} failed {counts['skipped']:5} skipped"
            + (f" {counts['not judged']:5} not judged" if counts["not judged"] else "")
        )
    print("Slowest")
    for seconds, name in slowest([folder / f"{name}.xml" for name in levels]):
        print(f"  {seconds:6.1f} s  {name}")
    for verdict, some in listed.items():
        if some:
            print(verdict.capitalize())
        for _, name, why in some:
            print(f"  {name}: {headline(why)}")
    started = folder / "started"
    if started.exists():
        print(f"Took {time.time() - int(started.read_text()):.0f} s, set-up and building included")
    if total["not judged"]:
        print(f"{total['passed']} passed, {total['failed']} failed, {total['not judged']} not judged")
    print(f"{total['passed']} passed, {total['failed']} failed, {total['skipped']} skipped")
    return 0 if total["passed"] and not total["failed"] else 1


if __name__ == "__main__":
    sys.exit(main())
