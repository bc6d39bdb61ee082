"""Writes JUnit XML, so that every level of `make test` reports in the same form."""

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree


@dataclass
class Case:
    name: str
    seconds: float
    failure: str = ""  # why it failed; empty: passed
    skipped: str = ""  # why it didn't run; empty: it did


def write(path: Path, level: str, cases: list[Case]) -> None:
    suite = ElementTree.Element("testsuite", name=level, tests=str(len(cases)))
    for case in cases:
        element = ElementTree.SubElement(
            suite, "testcase", classname=level, name=case.name, time=f"{case.seconds:.3f}"
        )
        if case.failure:
            ElementTree.SubElement(element, "failure").text = printable(case.failure)
        elif case.skipped:
            ElementTree.SubElement(element, "skipped", message=printable(case.skipped))
    path.parent.mkdir(parents=True, exist_ok=True)
    ElementTree.ElementTree(suite).write(path, encoding="utf-8", xml_declaration=True)


def printable(text: str) -> str:
    """XML can't carry most control characters; a fuzzer's output may hold any."""
    return "".join(c if c.isprintable() or c in "\n\t" else "\ufffd" for c in text)
