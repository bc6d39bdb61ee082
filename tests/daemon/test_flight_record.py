"""The flight record of the real daemon between the models: what happened is what the record says."""

import json
import signal
import subprocess
import time

import parts
import patience
import pytest
from models.flight import write_flight

RECORDER = parts.DAEMON.with_name("odid-recorder")


def power_on(bench, number):
    boot_id = bench.folder / "proc/sys/kernel/random/boot_id"
    boot_id.parent.mkdir(parents=True, exist_ok=True)
    boot_id.write_text(f"{number:08}-2222-3333-4444-555555555555\n")


def start_recorder(bench):
    """A machine of its own as far as faults and boot id go: one power-on."""
    (bench.folder / "run/faults").mkdir(exist_ok=True)
    (bench.folder / "data/odid").mkdir(parents=True, exist_ok=True)
    power_on(bench, 1)
    return bench.add(parts.Part([RECORDER, "-root", bench.folder], bench.folder / "recorder.log"))


def odidctl(bench, *words):
    result = subprocess.run([parts.CONTROL, "-root", bench.folder, "flights", *words],
                            capture_output=True, text=True, timeout=patience.LIMIT_S)
    assert result.returncode == 0, result.stderr
    return result.stdout


def record(bench, number=1):
    return json.loads(odidctl(bench, str(number), "--json"))


def events(flight, name):
    return [line for line in flight["events"] if line["event"] == name]


def wait_record(bench, what, condition, number=1):
    """Until the record under way says so; its newest lines are in the recorder's memory, and come within seconds."""
    def so():
        path = bench.folder / f"data/odid/flights/{number:05}.jsonl"
        return path.exists() and condition(record(bench, number))
    patience.wait_for(what, so, part=bench.recorder, every_s=0.2)


@pytest.fixture
def flying(bench, tmp_path):
    """A bench with a recorder and an armed aircraft, of which the record has begun."""
    path = tmp_path / "flight.tlog"
    write_flight(path, 600)
    one = bench(channels=("bt4", "bt5", "wifi"))
    one.recorder = start_recorder(one)
    one.play(path)
    patience.wait_for("arming", lambda: ((one.status() or {}).get("aircraft") or {}).get("armed"), part=one.daemon)
    return one


def test_a_flight_with_a_killed_daemon_a_lost_hostapd_and_a_killed_recorder(flying):
    time.sleep(3)  # on the air, and armed
    killed = time.monotonic()
    flying.daemon.stop(signal.SIGKILL)
    time.sleep(4)  # a gap is what is longer than the recorder's own second
    flying.start_daemon()
    flying.wait_on_air()
    away_s = {"bt4": time.monotonic() - killed}
    wait_record(flying, "the daemon's restart", lambda flight: flight["daemon_restarts"] == 1)
    flying.recorder.stop(signal.SIGKILL)
    armed_s = record(flying)["armed_s"]
    flying.recorder = start_recorder(flying)
    wait_record(flying, "what the new recorder sees", lambda flight: flight["armed_s"] > armed_s)
    killed = time.monotonic()
    flying.hostapd.stop(signal.SIGKILL)
    (flying.folder / "run/faults/hostapd").write_text("hostapd does not run.\n")
    wait_record(flying, "both faults", lambda flight: {"wifi", "hostapd"} <= {
        line["what"] for line in events(flight, "fault")})
    time.sleep(4)
    flying.start_hostapd()
    flying.wait_on_air()
    away_s["wifi"] = time.monotonic() - killed
    (flying.folder / "run/faults/hostapd").unlink()
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
    assert flight["verdict"].startswith("on the air WITH GAPS: Bluetooth 4 ")
    assert events(flight, "clock") and flight["start_utc"]
    for channel, gaps in (("bt4", 1), ("wifi", 2)):
        found = flight["channels"][channel]
        assert found["armed_gaps"] >= gaps and found["armed_longest_gap_s"] > 0
        patience.promised(-1.5 < found["armed_longest_gap_s"] - away_s[channel] < 1.5 and found["armed_gaps"] == gaps,
                          f"{channel}, away for {away_s[channel]:.1f} s: {found}")


def quiet_flight(flying):
    """Ten armed seconds and more, ended as a power cut leaves them. The record, and whether nothing was ever lost."""
    wait_record(flying, "ten armed seconds", lambda flight: flight["armed_s"] > 10)
    flying.recorder.stop(signal.SIGKILL)
    power_on(flying, 2)
    print(odidctl(flying, "1"))
    return record(flying), ": lost" not in flying.daemon.log()


def test_a_power_cut_leaves_a_record(flying):
    flight, _ = quiet_flight(flying)
    assert flight["ended"] == "power cut" and flight["bad_lines"] == 0
    assert flight["armed_s"] > 10


@pytest.mark.timed
def test_a_quiet_flight_has_no_gap(flying):
    """A model that a busy machine stops for a second is lost, and that is a gap; else there is none."""
    flight, nothing_lost = quiet_flight(flying)
    assert nothing_lost
    assert all(flight["channels"][channel]["armed_longest_gap_s"] == 0 for channel in ("bt4", "bt5", "wifi"))
    assert flight["verdict"] == "on the air the whole flight, the record ends while armed"


@pytest.mark.timed
def test_the_disk_is_spared(flying):
    path = flying.folder / "data/odid/flights/00001.jsonl"
    patience.wait_for("the record", path.exists)
    changes, end = set(), time.monotonic() + 21
    while time.monotonic() < end:
        changes.add(path.stat().st_mtime_ns)
        time.sleep(0.1)
    assert len(changes) <= 4  # the one that was there, and one each 10 s
