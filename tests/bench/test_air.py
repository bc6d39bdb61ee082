"""What the appliance has on the air in a flight without any fault, and what it keeps to itself."""

import json
import re
import time

import parts
import pytest

from . import faults, limits, runs
from .machine import CHANNELS
from .wifi import BEACON, PROBE_RESPONSE, elements, frames, pack, station


def measured(machine, seconds):
    """The judge's exit code, figures and report of one measurement."""
    out = parts.ROOT / "build/system/intervals"
    judge = machine.judge(seconds, "--played", machine.folder / "played.jsonl", "--expect", ",".join(CHANNELS),
                          *limits.arguments(), out=out)
    judge.wait(seconds)
    return judge.stop(), json.loads((out / "figures.json").read_text()), judge.log()


@pytest.mark.timed
@pytest.mark.parametrize("seconds", [40, pytest.param(300, marks=pytest.mark.long)])
def test_intervals(flying, seconds):
    code, figures, report = measured(flying, seconds)
    assert code == 0, report[-4000:]
    assert figures["verdict"] == "PASS"
    for name, limit_s in limits.AIR_S.items():
        assert figures[name] <= limit_s


# --- Wi-Fi ------------------------------------------------------------------------


def test_the_answer_to_a_probe_carries_the_beacon_s_pack(flying):
    since = time.time()
    station(flying, "no-key-of-this-one", 10)
    time.sleep(1)
    beacons = [(at, pack(row)) for at, row in frames(flying.pcap, BEACON, since - 1)]
    answers = [(at, pack(row)) for at, row in frames(flying.pcap, PROBE_RESPONSE, since)]
    assert answers, "no probe was answered"
    for at, content in answers:
        assert content is not None, "an answer without Remote ID"
        near = [one for when, one in beacons if abs(when - at) < 0.5]
        assert content in near


def known(machine):
    return (machine.status() or {"channels": {"wifi": {"known": None}}})["channels"]["wifi"]["known"]


def test_another_radio_hears_the_beacons_where_one_is_named(grounded):
    """A third one of mac80211_hwsim's, which nobody uses; the kernel's own nl80211."""
    assert known(grounded) == "set"
    grounded.must("odidctl set wifi.listener wlan2")
    grounded.wait_for("that it hears them", lambda: known(grounded) == "heard")
    assert "another radio hears them" in grounded.status()["channels"]["wifi"]["detail"]
    grounded.must('odidctl set wifi.listener ""')
    grounded.wait_for("that nobody does any more", lambda: known(grounded) == "set")
    assert grounded.status()["channels"]["wifi"]["state"] == "on air"


def test_the_access_point(flying):
    """Channel 6, beacon interval 100 TU, country, WPA2."""
    _, row = next(frames(flying.pcap, BEACON))
    found = dict(elements(row))
    assert found[3] == b"\x06"
    assert found[7][:2] == b"SE"
    assert found[48][:2] == b"\x01\x00"  # RSN
    times = [at for at, _ in frames(flying.pcap, BEACON)][-100:]
    assert abs((times[-1] - times[0]) / (len(times) - 1) - 0.1024) < 0.002


# --- what listens, what can be written -----------------------------------------------


def test_nothing_listens_that_need_not(flying):
    """No TCP; UDP only the daemon's, on loopback, and sockets that only send."""
    listening = flying.must("netstat -ltn | grep LISTEN; true").strip()
    assert listening == ""
    for line in flying.must("netstat -lunp").splitlines():
        fields = line.split()
        if not fields or not fields[0].startswith("udp"):
            continue
        address, port = fields[3].rsplit(":", 1)
        assert (address, port) == ("127.0.0.1", "14550") or "mavlink-route" in line, line


def test_the_filter_drops_what_comes_in(flying):
    rules = flying.must("nft list ruleset")
    assert "policy drop" in rules
    assert "dport 14550" not in flying.must("nft list chain inet odid input")


def test_only_mavlink_router_speaks_to_another_program(flying):
    """By its user, which no other process has; and what it says arrives. Of nobody else the kernel takes a datagram to any
    port of this machine, mavlink-router's own included: root's neither."""
    assert "993" in flying.must("grep ^Uid /proc/$(pidof mavlink-routerd)/status")
    flying.put(faults.TOOL, runs.tool())
    ports = {int(line.split()[1].partition(":")[2], 16) for line in flying.must("cat /proc/net/udp").splitlines()[1:]}
    assert 14550 in ports and len(ports) > 1
    for port in ports:
        for who in ("0 0", "65534 65534"):
            assert flying.must(f"{faults.TOOL} say {who} 127.0.0.1 {port} 00 2").strip() == "0", (port, who)
    before = flying.status()["mavlink"]["frames"]
    flying.wait_for("what mavlink-router says", lambda: flying.status()["mavlink"]["frames"] > before)
    assert flying.status()["link"]["senders"] == 1


def test_no_root_writes_to_the_running_system(flying):
    before = flying.must("head -c 65536 /dev/disk/odid/slot-a | sha256sum")
    for slot in ("slot-a", "slot-b", "boot"):
        result = flying.run(f"dd if=/dev/zero of=/dev/disk/odid/{slot} bs=4096 count=1 conv=fsync")
        assert result.code != 0
        assert re.search("not permitted|[Rr]ead-only|resource busy", result.output), result.output
    assert flying.must("head -c 65536 /dev/disk/odid/slot-a | sha256sum") == before
    assert flying.run("mount -o remount,rw / && touch /etc/new").code != 0
    root = flying.must("grep -m1 odid.slot /proc/cmdline | sed 's/.*odid.slot=//; s/ .*//'").strip()
    assert root == "a"
