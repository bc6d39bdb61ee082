"""The flight record of the real daemon between the models: what happened is what the record says."""

import json
import signal
import subprocess
import time

import pytest

from host import parts
from host.flight import write_flight

RECORDER = parts.DAEMON.with_name("odid-recorder")


def start_recorder(bench):
    """A machine of its own as far as faults and boot id go: one power-on."""
    root = bench.folder / "root"
    (root / "run/faults").mkdir(parents=True, exist_ok=True)
    boot_id = root / "proc/sys/kernel/random/boot_id"
    boot_id.parent.mkdir(parents=True, exist_ok=True)
    boot_id.write_text("11111111-2222-3333-4444-555555555555\n")
    return bench.add(parts.Part(
        [RECORDER, "-dir", bench.folder / "flights", "-run-dir", bench.folder / "run", "-root", root],
        bench.folder / "recorder.log"))


def odidctl(bench, *words):
    result = subprocess.run([parts.CONTROL, "-flights-dir", bench.folder / "flights", "flights", *words],
                            capture_output=True, text=True, timeout=10)
    assert result.returncode == 0, result.stderr
    return result.stdout


def record(bench, number=1):
    return json.loads(odidctl(bench, str(number), "--json"))


def events(flight, name):
    return [line for line in flight["events"] if line["event"] == name]


@pytest.fixture
def flying(bench, tmp_path):
    """A bench with a recorder and an armed aircraft."""
    path = tmp_path / "flight.tlog"
    write_flight(path, 120)
    one = bench(channels=("bt4", "bt5", "wifi"))
    one.recorder = start_recorder(one)
    one.play(path)
    parts.wait_for("arming", lambda: (one.status() or {})["aircraft"]["armed"], 10, one.daemon)
    time.sleep(3)
    return one


def test_a_flight_with_a_killed_daemon_a_lost_hostapd_and_a_killed_recorder(flying):
    flying.daemon.stop(signal.SIGKILL)
    time.sleep(3)
    flying.start_daemon()
    flying.wait_on_air()
    time.sleep(2)
    flying.recorder.stop(signal.SIGKILL)
    flying.hostapd.stop(signal.SIGKILL)
    flying.recorder = start_recorder(flying)
    (flying.folder / "root/run/faults/hostapd").write_text("hostapd does not run.\n")
    time.sleep(4)
    flying.start_hostapd()
    flying.wait_on_air()
    (flying.folder / "root/run/faults/hostapd").unlink()
    time.sleep(3)
    flying.recorder.stop()
    flight = record(flying)
    print(odidctl(flying), odidctl(flying, "1"))
    assert flight["ended"] == "in order" and flight["bad_lines"] == 0
    assert flight["daemon_restarts"] == 1
    assert len(events(flight, "recorder_restarted")) == 1
    assert len(events(flight, "first_broadcast")) == 3
    faults = {line["what"] for line in events(flight, "fault")}
    assert {"daemon", "wifi", "hostapd"} <= faults
    assert 2.5 < flight["channels"]["bt4"]["armed_longest_gap_s"] < 6
    assert flight["channels"]["bt4"]["armed_gaps"] == 1
    assert 3.5 < flight["channels"]["wifi"]["armed_longest_gap_s"] < 8
    assert flight["channels"]["wifi"]["armed_gaps"] == 2
    assert flight["verdict"].startswith("on the air WITH GAPS: Bluetooth 4 ")
    assert events(flight, "clock") and flight["start_utc"]


def test_a_quiet_flight_has_no_gap_and_the_disk_is_spared(flying):
    path = flying.folder / "flights/00001.jsonl"
    changes = set()
    end = time.monotonic() + 21
    while time.monotonic() < end:
        changes.add(path.stat().st_mtime_ns)
        time.sleep(0.1)
    assert len(changes) <= 4  # the one that was there, and one each 10 s
    flying.recorder.stop(signal.SIGKILL)  # as a power cut leaves it
    flight = record(flying)
    print(odidctl(flying, "1"))
    assert flight["ended"] == "power cut"
    assert flight["armed_s"] > 10
    log = flying.daemon.log()
    # A model that a busy machine stops for a second is lost, and that is a gap; else there is none.
    for channel, title in (("bt4", "Bluetooth 4"), ("bt5", "Bluetooth 5"), ("wifi", "Wi-Fi beacon")):
        assert (flight["channels"][channel]["armed_longest_gap_s"] == 0) == (f"{title}: lost" not in log)
    if ": lost" not in log:
        assert flight["verdict"] == "on the air the whole flight"
