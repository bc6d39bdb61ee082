"""Is a machine that has other work told from a quiet one?"""

import json
import os
import signal
import subprocess
import sys
import time

import patience
import pytest
import quiet
from models import realtime


def lines(path, *records):
    path.write_text("".join(json.dumps(one) + "\n" for one in records))
    return path


@pytest.fixture
def watch(tmp_path):
    one = quiet.Watch(tmp_path / "quiet.jsonl")
    yield one
    one.stop()


@pytest.mark.timed
@pytest.mark.skipif(not realtime.granted(), reason="this machine grants no real-time priority")
def test_a_machine_that_stands_still_is_noticed(watch):
    patience.wait_for("the watch to look", lambda: watch.log.exists() and "others" in watch.log.read_text())
    begun = time.monotonic()
    os.kill(watch.process.pid, signal.SIGSTOP)
    time.sleep(0.5)
    os.kill(watch.process.pid, signal.SIGCONT)
    time.sleep(0.2)
    assert 0.4 < quiet.stood_still_s(watch.log, begun, time.monotonic()) < 0.7
    assert quiet.stood_still_s(watch.log, begun - 100, begun - 50) == 0


def burnt(words):
    """What a process burnt that prints its number; what counts as ours meanwhile, and as all; seconds."""
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as child:
        number = int(child.stdout.readline())

        def so_far():
            return quiet.processes()[number][1], quiet.ours_s(os.getpid()), quiet.busy_s()

        try:
            patience.wait_for("the process", lambda: so_far()[0] > 0.2)
            before = so_far()
            patience.wait_for("it to burn", lambda: so_far()[0] - before[0] > 1)
            after = so_far()
        finally:
            os.kill(number, signal.SIGKILL)
    return [new - old for new, old in zip(after, before)]


def test_other_work_is_told_from_the_bench_s_own():
    spin = f"exec {sys.executable} -c 'while True: pass' >/dev/null"
    it, ours, everything = burnt(["sh", "-c", f"echo $$; {spin}"])
    assert ours >= it - 0.1 and everything >= it - 0.1
    it, ours, everything = burnt(["sh", "-c", f"setsid sh -c \"{spin}\" & echo $!"])  # whose parent has ended
    assert ours < it and everything >= it - 0.1


def test_other_work_is_a_mean_over_the_window(tmp_path):
    log = lines(tmp_path / "log.jsonl", *({"mono": mono, "seconds": 1.0, "others": others}
                                          for mono, others in ((10, 0.0), (11, 1.0), (12, 2.0), (13, 0.1))))
    assert quiet.others_had(log, 10.5, 11.5) == 1.5
    assert quiet.others_had(log, 20, 30) == quiet.others_had(tmp_path / "none", 0, 30) == 0


@pytest.mark.parametrize("record, said", [
    ({"seconds": 0.06, "processor": 0}, "this machine stood still for 0.06 s"),
    ({"seconds": 1.0, "others": 1.5}, "other work had 1.50 of this machine's"),
    ({"seconds": 1.0, "others": 0.1}, ""),
])
def test_what_disturbs_is_said(watch, record, said):
    watch.stop()
    lines(watch.log, {"mono": 10, **record})
    assert watch.disturbed(9, 11).startswith(said) and bool(watch.disturbed(9, 11)) == bool(said)
    assert watch.disturbed(20, 30) == ""
