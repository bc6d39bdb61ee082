"""The real daemon between the models: what it does when things go wrong, as heard on the air."""

import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from pathlib import Path

import pytest

from host import parts
from host.flight import write_flight

DISABLE_EXTENDED = "3920020000"  # LE Set Extended Advertising Enable: everything off
DISABLE_LEGACY = "0a200100"
RESET = "030c00"
FAILURE = "remote ID system failure"


@pytest.fixture(scope="session")
def flight(tmp_path_factory):
    path = tmp_path_factory.mktemp("flight") / "flight.tlog"
    write_flight(path, 120)
    return path


@pytest.fixture
def make_bench():
    """Makes benches, and ends all that they started."""
    made = []
    # Not pytest's own folder: that one is closed to the user that the daemon becomes.
    folder = Path(tempfile.mkdtemp(prefix="odid-bench-"))
    folder.chmod(0o755)

    def make(**arguments):
        made.append(parts.Bench(folder / str(len(made)), **arguments))
        return made[-1]
    yield make
    for bench in made:
        bench.stop()
    shutil.rmtree(folder)


@pytest.fixture
def flying(make_bench, flight):
    """A daemon on the air on every channel, with a flight under way. Arguments as Bench's."""
    def start(channels=("bt4", "bt5", "wifi"), flags=(), **arguments):
        bench = make_bench(**arguments)
        bench.start_daemon(*flags)
        bench.wait_on_air(channels)
        bench.play(flight)
        parts.wait_for("positions", lambda: bench.status()["position"]["fresh"], 5, bench.daemon)
        return bench
    return start


def listen(bench, seconds, *arguments):
    """Starts the judge and waits until it hears: what is done from then on is on its record."""
    out = bench.folder / f"heard{len(bench.parts)}"
    judge = bench.judge(seconds, *arguments, out=out)
    parts.wait_for("the judge to listen", lambda: "listening" in judge.log(), 15, judge)
    return judge, out


def finish(heard):
    """The judge's receptions, in order."""
    judge, out = heard
    judge.process.wait(timeout=60)
    return [json.loads(line) for line in (out / "receptions.jsonl").read_text().splitlines()]


def message_type(reception):
    return int(reception["payload"][4:5], 16)


def location_gap_s(receptions, channel, since_mono):
    """The longest time without a newer Location from an instant on, an unfinished one included."""
    times, last = [since_mono], None
    for reception in receptions:
        newer = reception["channel"] == channel and reception["payload"] != last
        if newer and (channel != "bt4" or message_type(reception) == 1):
            last = reception["payload"]
            if reception["mono"] > since_mono:
                times.append(reception["mono"])
    times.append(max(reception["mono"] for reception in receptions))
    return max(later - earlier for earlier, later in zip(times, times[1:]))


def figures(out):
    return json.loads((out / "figures.json").read_text())


def report(out):
    return (out / "report.txt").read_text()


# --- right on the air -------------------------------------------------------


@pytest.mark.parametrize("mode,channels", [("full", "bt4,bt5,wifi"), ("bcm43455", "bt4,wifi"),
                                           ("legacy20", "bt4,wifi")])
def test_a_flight_is_broadcast_without_a_violation(make_bench, flight, mode, channels):
    bench = make_bench(mode=mode)
    bench.start_daemon()
    bench.wait_on_air(channels.split(","))
    bench.play(flight)
    time.sleep(2)
    judge, out = listen(bench, 40 if mode == "full" else 15, "--played",
                        bench.folder / "played.jsonl", "--expect", channels)
    judge.process.wait(timeout=90)
    assert figures(out)["verdict"] == "PASS", report(out)
    assert figures(out)["bt4_payloads_heard"] == figures(out)["bt4_payloads_set"] > 100
    interval = "every 100 ms" if mode == "bcm43455" else "every 20 ms"
    assert interval in bench.status()["channels"]["bt4"]["detail"]
    assert bench.status()["channels"]["bt5"]["state"] == ("on air" if mode == "full" else "unsupported")


def test_the_recorded_flight_is_broadcast_without_a_violation(make_bench):
    recorded = parts.test_data() / "arduplane-vtol-sitl.tlog"
    if not recorded.is_file():
        pytest.skip(f"{recorded.name} isn't in TEST_DATA")
    bench = make_bench()
    bench.start_daemon()
    bench.wait_on_air()
    bench.play(recorded)
    time.sleep(2)
    judge, out = listen(bench, 40, "--played", bench.folder / "played.jsonl", "--expect", "bt4,bt5,wifi")
    judge.process.wait(timeout=90)
    assert figures(out)["verdict"] == "PASS", report(out)


def test_two_basic_ids_take_turns_and_are_both_in_the_pack(flying):
    bench = flying(settings={"basic_id_2": {"uas_id": "SE-ABC123", "id_type": "registration"}})
    receptions = finish(listen(bench, 6))
    single = {reception["payload"][8:] for reception in receptions
              if reception["channel"] == "bt4" and message_type(reception) == 0}
    assert len(single) == 2
    packs = [bytes.fromhex(reception["payload"]) for reception in receptions if reception["channel"] == "wifi"]
    assert packs and all(b"SSRS5GBG01" in pack and b"SE-ABC123" in pack for pack in packs)


def test_the_address_is_one_and_outlives_the_daemon(flying):
    bench = flying()
    heard = listen(bench, 10)
    time.sleep(2)
    bench.daemon.stop(signal.SIGKILL)
    bench.start_daemon()
    receptions = finish(heard)
    addresses = {reception["address"] for reception in receptions if reception["channel"] != "wifi"}
    assert len(addresses) == 1
    assert int(next(iter(addresses))[:2], 16) & 0xC0 == 0xC0  # random static
    assert location_gap_s(receptions, "bt4", receptions[0]["mono"]) < 2.5


# --- faults -----------------------------------------------------------------


@pytest.mark.parametrize("mode,order", [("full", DISABLE_EXTENDED), ("full", RESET),
                                        ("bcm43455", DISABLE_LEGACY), ("bcm43455", RESET)])
def test_a_foreign_command_is_undone_within_a_slot(flying, mode, order):
    bench = flying(channels=("bt4",), mode=mode)
    heard = listen(bench, 6)
    time.sleep(1)
    injected = time.monotonic()
    assert bench.front.order(f"inject {order}") == "done"
    receptions = finish(heard)
    assert bench.status()["channels"]["bt4"]["repairs"] >= 1
    # one slot, and what a Location takes to be on the air without any fault
    assert location_gap_s(receptions, "bt4", injected) <= 0.125 + 0.3 + 0.1
    assert len({one["address"] for one in receptions if one["channel"] == "bt4"}) == 1


def test_a_controller_that_vanishes_is_lost_and_comes_back(flying):
    bench = flying()
    bench.front.order("unplug")
    parts.wait_for("Bluetooth to be missed",
                   lambda: bench.status()["channels"]["bt4"]["state"] in ("lost", "absent"), 1.5)
    assert control(bench).returncode == 1
    bench.front.order("plug")
    plugged = time.monotonic()
    bench.wait_on_air()
    assert time.monotonic() - plugged < 2.5
    assert finish(listen(bench, 3))


def test_a_controller_that_hangs_is_noticed_and_used_again(flying):
    bench = flying()
    bench.front.order("mute")
    parts.wait_for("the hang to be noticed", lambda: bench.status()["channels"]["bt4"]["state"] == "lost", 2)
    bench.front.order("unmute")
    bench.wait_on_air(timeout_s=5)


def test_hostapd_that_is_killed_and_started_again(flying):
    bench = flying()
    bench.hostapd.stop(signal.SIGKILL)
    parts.wait_for("Wi-Fi to be missed", lambda: bench.status()["channels"]["wifi"]["state"] != "on air", 2)
    assert bench.status()["channels"]["bt4"]["state"] == "on air"
    bench.start_hostapd()
    started = time.monotonic()
    bench.wait_on_air()
    assert time.monotonic() - started < 3


def test_hostapd_that_refuses_or_hangs_is_reported_and_recovers(flying):
    bench = flying()
    failures = bench.status()["channels"]["wifi"]["failures"]
    bench.hostapd.order("fail 3")
    parts.wait_for("a refusal", lambda: bench.status()["channels"]["wifi"]["failures"] > failures, 3)
    bench.wait_on_air()
    bench.hostapd.order("mute")
    parts.wait_for("the hang to be noticed", lambda: bench.status()["channels"]["wifi"]["state"] == "lost", 3)
    bench.hostapd.order("unmute")
    bench.wait_on_air()


def test_a_serial_autopilot_that_is_unplugged_and_replugged(make_bench, flight):
    bench = make_bench(settings={"mavlink": {"source": "serial", "device": "AUTOPILOT", "baud": 921600}})
    device = bench.folder / "autopilot"
    bench.settings["mavlink"]["device"] = device
    bench.start_daemon()
    assert bench.status() is None or bench.status()["link"]["state"] == "absent"
    player = bench.play(flight, to=f"pty:{device}")
    parts.wait_for("positions", lambda: (bench.status() or {}).get("position", {}).get("fresh"), 5, bench.daemon)
    bench.wait_on_air()
    heard = listen(bench, 12)
    assert player.order("unplug") == "done"
    parts.wait_for("the hang-up", lambda: bench.status()["link"]["state"] == "absent", 1)
    time.sleep(4)
    assert bench.status()["position"]["status"] == FAILURE
    assert player.order("plug") == "done"
    plugged = time.monotonic()
    receptions = finish(heard)
    newer = [one for one in receptions if one["channel"] == "bt4" and message_type(one) == 1
             and one["mono"] > plugged and int(one["payload"][6], 16) != 4]
    assert newer and newer[0]["mono"] - plugged < 1


def test_an_autopilot_that_falls_silent_is_a_remote_id_failure(flying):
    bench = flying()
    player = bench.parts[-1]
    assert player.order("pause") == "done"
    parts.wait_for("the failure", lambda: bench.status()["position"]["status"] == FAILURE, 4)
    status = bench.status()
    assert status["position"]["latitude_deg"] is not None and status["position"]["speed_mps"] is None
    assert status["link"]["state"] == "silent"
    player.order("resume")
    parts.wait_for("positions", lambda: bench.status()["position"]["fresh"], 1.5)
    parts.wait_for("the heartbeat", lambda: bench.status()["position"]["status"] != FAILURE, 1.5)


def test_the_take_off_point_outlives_a_killed_daemon(flying):
    bench = flying()
    parts.wait_for("take-off", lambda: bench.status()["aircraft"]["takeoff_known"], 8)
    time.sleep(1.2)
    before = bench.status()["operator"]
    bench.daemon.stop(signal.SIGKILL)
    bench.start_daemon()
    parts.wait_for("the heartbeat", lambda: (bench.status() or {}).get("aircraft", {}).get("armed"), 5)
    after = bench.status()
    assert after["operator"]["latitude_deg"] == pytest.approx(before["latitude_deg"], abs=1e-7)
    assert not after["aircraft"]["takeoff_is_home"]


def test_several_senders_at_once_do_not_confuse_it(flying):
    bench = flying()
    noise = subprocess.Popen(parts.python("host.noise", str(bench.udp_port), "8"), env=parts.environment(),
                             cwd=parts.ROOT)
    try:
        judge, out = listen(bench, 8, "--played", bench.folder / "played.jsonl")
        judge.process.wait(timeout=60)
    finally:
        noise.terminate()
        noise.wait()
    assert figures(out)["verdict"] == "PASS", report(out)
    assert bench.status()["mavlink"]["other_system"] > 0
    assert bench.status()["vehicle"] == 1


def test_an_orderly_end_leaves_nothing_on_the_air(flying):
    """A radio would go on repeating a dead program's last position."""
    bench = flying()
    heard = listen(bench, 5)
    time.sleep(2)
    bench.daemon.stop()
    ended = time.monotonic()
    receptions = finish(heard)
    assert {one["channel"] for one in receptions if one["mono"] < ended} == {"bt4", "bt5", "wifi"}
    assert not [one for one in receptions if one["mono"] > ended + 0.3]


# --- back to the pilot ------------------------------------------------------


def answers(bench, name):
    lines = (bench.folder / "answers.jsonl").read_text().splitlines()
    return [record for record in map(json.loads, lines) if record["mavpackettype"] == name]


def test_the_pilot_is_told_once_a_second_and_when_a_channel_is_lost(flying):
    bench = flying()
    time.sleep(3)
    bench.hostapd.stop(signal.SIGKILL)
    time.sleep(4)
    bench.start_hostapd()
    bench.wait_on_air()
    time.sleep(2)
    heartbeats, statuses = answers(bench, "HEARTBEAT"), answers(bench, "OPEN_DRONE_ID_ARM_STATUS")
    gaps = [later["mono"] - earlier["mono"] for earlier, later in zip(heartbeats, heartbeats[1:])]
    assert gaps and max(gaps) < 1.2
    assert all(one["type"] == 34 and one["compid"] == 236 and one["sysid"] == 1 for one in heartbeats)
    assert {one["status"] for one in statuses} == {0, 1}
    assert any("Wi-Fi" in one["error"] for one in statuses if one["status"] == 1)
    texts = [one["text"] for one in answers(bench, "STATUSTEXT")]
    assert any("off air" in text for text in texts) and any("on air again" in text for text in texts)


def test_faster_positions_are_asked_for_and_can_be_left_alone(make_bench, tmp_path):
    slow = tmp_path / "slow.tlog"
    write_flight(slow, 40, rate_hz=1)
    asked = []
    for wanted in ("yes", "no"):
        bench = make_bench(settings={"mavlink": {"request_rate": wanted}})
        bench.start_daemon()
        bench.wait_on_air()
        bench.play(slow)
        time.sleep(8)
        asked.append([one for one in answers(bench, "COMMAND_LONG")
                      if one["command"] == 511 and one["param1"] == 33])
        bench.stop()
    assert asked[0] and not asked[1]


# --- identity and control ---------------------------------------------------


def control(bench, *words):
    return subprocess.run([parts.CONTROL, "-run-dir", bench.folder / "run", *(words or ("status",))],
                          capture_output=True, text=True, timeout=10)


def test_wrong_identifiers_warn_everywhere_and_are_broadcast(flying):
    bench = flying(settings={"basic_id": {"uas_id": "SSRSGBG001"},
                             "operator": {"operator_id": "SWE3jxza7qbzvu5d-q7z"}})
    receptions = finish(listen(bench, 3))
    payloads = [bytes.fromhex(one["payload"]) for one in receptions]
    packs = [payload for payload, one in zip(payloads, receptions) if one["channel"] == "wifi"]
    assert packs and all(b"SSRSGBG001" in pack and b"SWE3jxza7qbzvu5d" in pack for pack in packs)
    assert "SSRSGBG001" in bench.daemon.log()
    assert any("serial" in problem["reason"].lower() for problem in bench.status()["problems"])
    time.sleep(1)
    assert any(one["status"] == 1 for one in answers(bench, "OPEN_DRONE_ID_ARM_STATUS"))
    everything = bench.daemon.log() + control(bench).stdout + control(bench, "status", "--json").stdout
    assert "q7z" not in everything  # the secret part stays in the configuration parser
    assert not any(b"q7z" in payload for payload in payloads)


def test_odidctl_says_what_is_on_the_air_by_its_exit_code(flying):
    bench = flying()
    assert control(bench).returncode == 0
    bench.hostapd.stop(signal.SIGKILL)
    parts.wait_for("Wi-Fi to be missed", lambda: control(bench).returncode == 1, 3)
    bench.daemon.stop()
    gone = control(bench)
    assert gone.returncode == 3 and (gone.stdout + gone.stderr).strip()


# --- privilege --------------------------------------------------------------


def test_the_running_daemon_has_no_more_rights_than_it_needs(flying):
    if os.geteuid() != 0:
        pytest.skip("needs root: the daemon changes its user")
    bench = flying(settings={"daemon": {"user": "nobody"}}, channels=())
    lines = Path(f"/proc/{bench.daemon.process.pid}/status").read_text().splitlines()
    status = {line.split(":")[0]: line.split(":")[1].split() for line in lines}
    assert set(status["Uid"]) == {"65534"}
    assert int(status["CapEff"][0], 16) == int(status["CapPrm"][0], 16) == 1 << 12 | 1 << 13
    assert int(status["CapBnd"][0], 16) == 0 and int(status["CapInh"][0], 16) == 0
    assert status["NoNewPrivs"] == ["1"]
    assert status["Seccomp"] == ["2"]


def test_a_forbidden_system_call_ends_the_running_daemon(flying):
    if os.geteuid() != 0:
        pytest.skip("needs root: a debugger makes the daemon misbehave")
    bench = flying()
    subprocess.run(["gdb", "--batch", "-p", str(bench.daemon.process.pid), "-ex", "call (int)mkdir(\"/tmp/odid-forbidden\", 448)"],
                   capture_output=True, stdin=subprocess.DEVNULL, timeout=60, check=False)
    assert bench.daemon.process.wait(timeout=5) == -signal.SIGSYS
    assert not Path("/tmp/odid-forbidden").exists()
