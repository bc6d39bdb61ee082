"""`make check` sees a verdict that would rest on how long something took."""

import subprocess
import sys
from pathlib import Path

import pytest

CHECK = Path(__file__).with_name("durations.py")


def check(folder, body, decorator=""):
    path = folder / "tests/test_it.py"
    path.parent.mkdir(exist_ok=True)
    lines = "".join(f"    {line}\n" for line in body.splitlines())
    path.write_text(f"LIMIT = 3\n{decorator}\ndef test_it(process, count):\n    begun = time.monotonic()\n{lines}")
    return subprocess.run([sys.executable, CHECK, "tests/test_it.py"], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("body, said", [
    ("assert time.monotonic() - begun < 4", "an assertion about real time"),
    ("took = time.monotonic() - begun\nassert round(took, 1) <= LIMIT", "an assertion about real time"),
    ("assert count / (time.time() - begun) > 7.5", "an assertion about real time"),
    ("while time.monotonic() < begun + 5:\n    pass", "a wait of its own"),
    ("process.wait(5)", "a limit of its own"),
    ("process.communicate(timeout=10)", "a limit of its own"),
    ("patience.wait_for('x', count, limit_s=5)", "a limit of its own"),
    ("time.sleep(3)\nassert count", "a sleep"),
])
def test_what_rests_on_time_is_named_with_its_line(tmp_path, body, said):
    result = check(tmp_path, body)
    assert result.returncode == 1 and result.stdout.startswith("tests/test_it.py:") and said in result.stdout


@pytest.mark.parametrize("body", [
    "patience.wait_for('x', count, within_s=3)",
    "patience.promise('x', time.monotonic() - begun, 3)",
    "process.wait(patience.LIMIT_S)",
    "heard = count(since=begun)\nassert heard > 3",
    "assert begun <= count[1] <= time.monotonic()",
    "process.settimeout(0.2)  # nothing comes",
])
def test_what_does_not_passes(tmp_path, body):
    result = check(tmp_path, body)
    assert result.returncode == 0, result.stdout


def test_what_needs_real_time_says_so(tmp_path):
    assert check(tmp_path, "assert time.monotonic() - begun < 4", "@pytest.mark.timed").returncode == 0


def check_c(folder, function, line, name="test_some.c"):
    """The third line of a file of tests: what was said of it, and the status."""
    path = folder / name
    path.write_text(f"static void {function}(void **state)\n{{\n    {line}\n}}\n")
    result = subprocess.run([sys.executable, CHECK, path], cwd=folder, capture_output=True, text=True)
    return result.stdout.removeprefix(f"{path}:3: "), result.returncode


def test_a_sleep_in_c_is_named(tmp_path):
    said, status = check_c(tmp_path, "test_it", "usleep(50000);")
    assert status == 1 and said.startswith("a sleep")
    assert check_c(tmp_path, "answer_slowly", "usleep(50000);", "test_recorder_snapshot.c") == ("", 0)


@pytest.mark.parametrize("line", [
    "assert_true(loop_now_us() - begun_us < 600000);",
    "assert_in_range(loop_now_us() - begun_us, 0, 5);"])
def test_a_duration_in_c_is_named(tmp_path, line):
    said, status = check_c(tmp_path, "test_it", line)
    assert status == 1 and said.startswith("a duration")


@pytest.mark.parametrize("line", [
    "assert_true(in_time(loop_now_us() - begun_us, 0, 5));",
    "assert_true(loop_now_us() - begun_us >= 600000);"])
def test_a_duration_in_c_is_judged_where_that_is_wanted(tmp_path, line):
    assert check_c(tmp_path, "test_it", line) == ("", 0)
