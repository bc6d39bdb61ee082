"""Real captures and a real flight, from the folder TEST_DATA (they aren't part of the project)."""

import os
from collections import Counter
from pathlib import Path

import pytest

from . import messages as m
from .conformance import Options, judge
from .loss import Loss
from .sources import Ear, read_pcap

DATA = Path(os.environ.get("TEST_DATA") or Path(__file__).parents[2] / "../shared/data")


def capture(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"{name} isn't in the folder TEST_DATA ({DATA})")
    ear = Ear(set(), Loss())
    read_pcap(ear, path)
    return ear.run


def test_a_commercial_aircraft_of_protocol_version_0():
    run = capture("parrot-anafi-wifi-beacon.pcapng")
    assert len(run.receptions) == 1140
    assert {(r.channel, r.address) for r in run.receptions} == {("wifi", "90:3A:E6:5B:C8:A8")}
    assert run.receptions[-1].time - run.receptions[0].time == pytest.approx(122.7, abs=0.05)
    judgement = judge(run, Options(any_version=True, expect_messages=("basic_id", "location", "system")))
    figures = judgement.figures
    assert figures["wifi_location_reception_count"] == 1140
    assert figures["wifi_location_reception_p50_s"] == pytest.approx(0.1024, abs=0.001)
    assert 0.9 < figures["wifi_location_content_p50_s"] < 1.1
    assert figures["wifi_lost_payloads"] == 0
    # Its positions are renewed every 1.02 s: that, and nothing else, is against the rules.
    assert set(judgement.findings.counts) == {"interval.content"}
    assert any("protocol version 0" in note for note in judgement.findings.notes)
    assert "structure.version" in judge(run, Options()).findings.counts
    places = [place for track in judgement.tracks for _, place in track.of_type("location")]
    assert all(47.19 < place.latitude_deg < 47.21 and 8.72 < place.longitude_deg < 8.74 for place in places)
    assert {m.STATUS_NAMES[place.status] for place in places} == {"ground", "airborne"}


def test_273_bluetooth_5_packs():
    run = capture("bt5-long-range-sample.pcapng")
    assert len(run.receptions) == 273
    assert sum(r.damaged for r in run.receptions) == 29  # wrong CRC: on record, never judged
    assert {(r.channel, r.address, r.phy) for r in run.receptions} == {
        ("bt5", "E0:7D:EA:EB:2F:1C", "Coded/Coded")}
    assert run.receptions[-1].time - run.receptions[0].time == pytest.approx(17.6, abs=0.05)
    judgement = judge(run, Options(any_version=True))
    # The sample's transmitter always sends room for nine messages, and starts with empty packs.
    assert judgement.findings.counts["structure.message"] == 19
    assert judgement.findings.counts["structure.trailing"] == 225
    (track,) = judgement.tracks
    sizes = Counter(len(heard.messages) for heard in track.heard)
    assert sizes == {1: 3, 2: 6, 3: 9, 4: 8, 5: 199}
    newest = {message.type_name: message for heard in track.heard for message in heard.messages}
    assert newest["basic_id"].text == "SSEVTFG93700070"
    assert newest["self_id"].text == "Drone ID demo"
    assert newest["operator_id"].text == "FIN87astrdge12kxyz8"


def test_a_real_flight_through_a_clean_transmitter_is_plausible():
    """The flight log's own motion must not look implausible, nor its gaps like faults."""
    path = DATA / "arduplane-vtol-sitl.tlog"
    if not path.exists():
        pytest.skip(f"{path.name} isn't in the folder TEST_DATA ({DATA})")
    mavutil = pytest.importorskip("pymavlink.mavutil", reason="pymavlink isn't installed")
    from . import synthetic as air

    connection, fixes, first = mavutil.mavlink_connection(str(path)), [], None
    while (message := connection.recv_match(type="GLOBAL_POSITION_INT")) is not None:
        fix = message.to_dict()
        if not fixes or fix["time_boot_ms"] > fixes[-1][1]["time_boot_ms"]:
            first = fix["time_boot_ms"] if first is None else first
            fixes.append(((fix["time_boot_ms"] - first) / 1000, fix))
    assert len(fixes) > 700

    def newest(t):
        return next((n - 1 for n, (at, _) in enumerate(fixes) if at > t - 0.01), len(fixes) - 1)

    def send(_, t):
        at, fix = fixes[max(0, newest(t))]
        still = abs(fix["vx"]) < 22 and abs(fix["vy"]) < 22
        return air.encode_fix(fix, height_m=fix["relative_alt"] / 1000, geodetic_m=None, status=4 if t - at > 3 else 2,
                              **({"direction_deg": None} if still else {}))

    run, _ = air.transmit(seconds=fixes[-1][0], channels=("bt4",), interval_s=0.1,
                          faults=air.Faults(location=send))
    assert not [kind for kind in judge(run, Options()).findings.counts if kind != "interval.content"]
