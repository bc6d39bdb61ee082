"""Is what `make test` sums up what happened?"""

import subprocess
import sys
from xml.etree import ElementTree

import parts
import program
import pytest
from measure.bench import Table

from . import summary

COMMAND = parts.ROOT / "tests/run/command.py"


@pytest.mark.parametrize("script, verdict", [
    ("print('PASS')", "passed"),
    ("print('not judged: other work'); sys.exit(77)", "not judged"),
    ("print('not judged: other work'); sys.exit(1)", "failed"),
    ("sys.exit(77)", "failed"),  # nobody said why
], ids=["passes", "not-judged", "fails-beside", "says-nothing"])
def test_a_command_is_judged_by_its_exit_and_its_word(tmp_path, script, verdict):
    report = tmp_path / "bench.xml"
    code = subprocess.run([sys.executable, COMMAND, report, sys.executable, "-c", f"import sys; {script}"]).returncode
    assert (code == 0) == (verdict != "failed")
    case, = ElementTree.parse(report).iter("testcase")
    assert summary.result(case)[0] == verdict


@pytest.mark.parametrize("disturbed, value, timed, failed, not_judged", [
    ("", 2, True, 1, 0),
    ("other work", 2, True, 0, 1),
    ("other work", 2, False, 1, 0),     # no machine explains it
    ("other work", None, True, 1, 0),   # nor that nothing was heard
    ("other work", 1, True, 0, 0),
])
def test_a_figure_beside_other_work_is_not_judged(disturbed, value, timed, failed, not_judged):
    table = Table()
    table.disturbed = disturbed
    table.add("gap_s", value, 1, timed=timed)
    assert (len(table.failed), len(table.not_judged)) == (failed, not_judged)


@pytest.mark.parametrize("slot_ms, bare_ms, failed, not_judged", [
    (1.5, 0.6, 0, 0),
    (1.7, 0.6, 1, 0),
    (1.1, None, 1, 0),
    (5.2, 3.6, 0, 1),   # a processor that alone wakes up later than the limit
    (4.5, 3.6, 0, 0),
])
def test_a_deadline_is_judged_where_the_machine_wakes_up_in_time(slot_ms, bare_ms, failed, not_judged):
    table = Table()
    table.slots("slot_jitter_p99_ms", {"realtime": True, "slot_jitter_p99_ms": slot_ms, "bare_timer_p99_ms": bare_ms}, 1)
    assert (len(table.failed), len(table.not_judged)) == (failed, not_judged)


def test_the_code_for_not_judged_is_one(monkeypatch):
    monkeypatch.syspath_prepend(COMMAND.parent)
    import command
    assert command.CODE_NOT_JUDGED == program.NOT_JUDGED
