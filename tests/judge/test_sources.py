"""Files and devices: formats, damage, growing files, loss, the command line."""

import json
import os
import struct
import subprocess
import sys
import time
from pathlib import Path

import patience
import pytest

from . import synthetic as air
from .__main__ import main
from .capture_files import open_btsnoop, open_capture
from .carriers import beacon_in_radiotap
from .flight_log import read_flight_log
from .loss import Loss, parse_loss
from .receptions import InputError, read_receptions, write_receptions
from .sources import Ear, read_btsnoop, read_pcap

TESTS = Path(__file__).parent.parent
BODY = air.pack([air.basic_id(), air.location(577000000, 119000000), air.self_id(), air.system(1.7e9),
                 air.operator_id()])
ADDRESS_OCTETS = bytes.fromhex(air.ADDRESS.replace(":", ""))


def beacon_frame(counter: int = 1) -> bytes:
    bssid = bytes.fromhex(air.BSSID.replace(":", ""))
    return (b"\x80\0\0\0" + b"\xff" * 6 + bssid * 2 + bytes(2) + bytes(8) + b"\x64\0\x11\x04" + b"\0\4odid"
            + b"\x03\x01\x06" + air.vendor_element(counter, BODY))


def pcap_header(order="<", nano=False, link_type=105) -> bytes:
    return struct.pack(order + "IHHiIII", 0xA1B23C4D if nano else 0xA1B2C3D4, 2, 4, 0, 0, 65535, link_type)


def pcap_record(data: bytes, time_s: float, order="<", nano=False) -> bytes:
    fraction = round(time_s % 1 * (1e9 if nano else 1e6))
    return struct.pack(order + "IIII", int(time_s), fraction, len(data), len(data)) + data


def read(path, reader=read_pcap):
    ear = Ear(set(), Loss())
    reader(ear, path)
    return ear.run


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("nano", [False, True])
def test_pcap_in_both_orders_and_resolutions(tmp_path, order, nano):
    path = tmp_path / "a.pcap"
    path.write_bytes(pcap_header(order, nano) + pcap_record(beacon_frame(), 1700000000.25, order, nano)
                     + pcap_record(b"\xd4\0" + bytes(8), 1700000001.5, order, nano))  # an ACK
    run = read(path)
    (reception,) = run.receptions
    assert reception.time == pytest.approx(1700000000.25) and reception.address == air.BSSID
    assert reception.payload == b"\x0d\x01" + BODY and reception.wifi_channel == 6
    assert run.end_mono == pytest.approx(1700000001.5)  # the capture went on after the last beacon


def test_radiotap_with_fcs_signal_and_further_presence_words():
    header = (struct.pack("<BBHIIBBHhbB", 0, 0, 24, 0x8000002E, 0, 0x10, 2, 2437, 0, -47, 0) + bytes(3))
    packet = header + bytes(24 - len(header)) + beacon_frame() + b"\1\2\3\4"
    # flags at 12, rate 13, channel 14..17, signal 18
    beacon = beacon_in_radiotap(packet)
    assert (beacon.bssid, beacon.channel, beacon.rssi) == (air.BSSID, 6, -47)
    assert beacon.elements.endswith(BODY)
    bad_fcs = bytearray(packet)
    bad_fcs[12] |= 0x40
    assert beacon_in_radiotap(bytes(bad_fcs)) is None
    assert beacon_in_radiotap(b"\0\0\xff\0" + bytes(8)) is None and beacon_in_radiotap(b"") is None


def pcapng_block(order, kind, body) -> bytes:
    body += bytes(-len(body) % 4)
    return struct.pack(order + "II", kind, len(body) + 12) + body + struct.pack(order + "I", len(body) + 12)


@pytest.mark.parametrize("order", "<>")
def test_pcapng_with_nanoseconds(tmp_path, order):
    def section():
        return pcapng_block(order, 0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))

    resolution = struct.pack(order + "HHB3x", 9, 1, 9) + bytes(4)
    interface = pcapng_block(order, 1, struct.pack(order + "HHI", 105, 0, 0) + resolution)
    stamp, frame = 1700000000_250000000, beacon_frame()
    packet = pcapng_block(order, 6, struct.pack(order + "IIIII", 0, stamp >> 32, stamp & 0xFFFFFFFF, len(frame),
                                                len(frame)) + frame)
    path = tmp_path / "a.pcapng"
    path.write_bytes(section() + interface + packet + section() + interface + packet)
    run = read(path)
    assert [r.time for r in run.receptions] == [pytest.approx(1700000000.25)] * 2


def link_layer(coded: bool = False) -> bytes:
    data = air.service_data(1, air.basic_id())
    pdu = bytes((0x42, 6 + len(data))) + ADDRESS_OCTETS[::-1] + data
    return struct.pack("<I", 0x8E89BED6) + (b"\0" if coded else b"") + pdu + b"\0\0\0"


def test_bluetooth_link_layer_captures(tmp_path):
    plain = tmp_path / "251.pcap"
    plain.write_bytes(pcap_header(link_type=251) + pcap_record(link_layer(), 1.7e9))
    (reception,) = read(plain).receptions
    assert (reception.channel, reception.address, reception.address_type) == ("bt4", air.ADDRESS, "random")
    assert (reception.event_type, len(reception.raw)) == ("ADV_NONCONN_IND", 31)
    radio = tmp_path / "256.pcap"
    for flags, damaged in ((0x0C02, False), (0x0402, True)):
        header = struct.pack("<BbbBIH", 0, -55, 0, 0, 0x8E89BED6, flags)
        radio.write_bytes(pcap_header(link_type=256) + pcap_record(header + link_layer(), 1.7e9))
        (reception,) = read(radio).receptions
        assert (reception.rssi, reception.damaged, reception.payload is None) == (-55, damaged, damaged)


def hci_event(extended: bool) -> bytes:
    address = ADDRESS_OCTETS[::-1]
    if extended:
        data = air.service_data(3, BODY)
        parts = [data[:100], data[100:]]
        return b"".join(
            _event(b"\x0d\x01" + struct.pack("<HB6sBBBbbHB6sB", status, 1, address, 3, 3, 0, 127, -60, 0, 0, bytes(6),
                                             len(part)) + part) for status, part in zip((0x20, 0), parts))
    data = air.service_data(1, air.basic_id())
    return _event(b"\x02\x01" + struct.pack("<BB6sB", 3, 1, address, len(data)) + data + struct.pack("b", -50))


def _event(body: bytes) -> bytes:
    return bytes((0x04, 0x3E, len(body))) + body


@pytest.mark.parametrize("monitor", [False, True])
def test_btsnoop(tmp_path, monitor):
    def record(packet, opcode=3):
        data = packet[1:] if monitor else packet
        return struct.pack(">IIIIq", len(data), len(data), opcode if monitor else 1, 0,
                           0x00DCDDB30F2F8000 + 1_700_000_000_500_000) + data

    extended = hci_event(True)
    first = extended[:3 + extended[2]]
    path = tmp_path / "dump"
    path.write_bytes(b"btsnoop\0" + struct.pack(">II", 1, 2001 if monitor else 1002) + record(hci_event(False))
                     + record(b"\x04\x0e\x04\x01\x03\x0c\0", 3) + record(first) + record(extended[len(first):]))
    legacy, long_range = read(path, read_btsnoop).receptions
    assert (legacy.channel, legacy.event_type, legacy.rssi) == ("bt4", "ADV_NONCONN_IND", -50)
    assert legacy.time == pytest.approx(1700000000.5)
    assert (long_range.channel, long_range.phy, long_range.payload) == ("bt5", "Coded/Coded", b"\x0d\x03" + BODY)


def test_bad_files_say_where(tmp_path):
    path = tmp_path / "x"
    for content, words, reader in (
            (b"nonsense", "octet 0: expected a pcap", open_capture), (b"", "found nothing", open_capture),
            (b"btsnoop\0" + struct.pack(">II", 2, 1002), "expected btsnoop version 1", open_btsnoop),
            (b"nonsense", "expected 'btsnoop'", open_btsnoop),
            (pcap_header() + struct.pack("<IIII", 0, 0, 1 << 30, 1), "octet 24: expected a pcap packet", open_capture)):
        path.write_bytes(content)
        with pytest.raises(InputError, match=words):
            list(reader(path).packets())
    path.write_bytes(pcap_header(link_type=1) + pcap_record(b"x" * 60, 1.7e9))
    with pytest.raises(InputError, match="link type 1 is none of"):
        read(path)
    path.write_bytes(pcap_header() + pcap_record(beacon_frame(), 1.7e9) + b"\0" * 7)
    assert "last 7 octets" in read(path).notes[0]
    path.write_text('{"time": 1, "mono": 1, "channel": "bt4"}\n')
    with pytest.raises(InputError, match="x:1: not a reception: 'address' is missing|'payload' is missing"):
        read_receptions(path)
    path.write_text('{"time": 1, "mono": 1, "type": "GLOBAL_POSITION_INT"}\n')
    with pytest.raises(InputError, match="x:1: not a played MAVLink message"):
        read_flight_log(path)
    path.write_text('{"time": 1, "mono": 1, "type": 2}\n')
    with pytest.raises(InputError, match="x:1: .*name is expected in mavpackettype"):
        read_flight_log(path)
    path.write_text('{"time": 1, "mono": 1, "mavpackettype": "ATTITUDE"}\n{"time": 2, "mo')
    assert read_flight_log(path).fixes == []  # the second line is still being written
    path.write_text("{oops\n")
    with pytest.raises(InputError, match="x:1: not JSON"):
        read_flight_log(path)


def test_receptions_survive_saving(tmp_path):
    run, _ = air.transmit(seconds=3)
    write_receptions(run, tmp_path)
    again = read_receptions(tmp_path / "receptions.jsonl")
    assert again.receptions == run.receptions
    assert (again.start_mono, again.end_mono) == (run.start_mono, run.end_mono)
    first = json.loads((tmp_path / "receptions.jsonl").read_text().splitlines()[0])
    assert set(first) >= {"time", "mono", "channel", "address", "payload", "raw", "phy", "rssi"}
    assert first["payload"].startswith("0d")


def test_loss_is_seeded_and_has_the_share_and_bursts_asked_for():
    for share, burst in ((0.5, 1.0), (0.5, 3.0), (0.2, 5.0)):
        pattern = [Loss(share, burst, 7)]
        drops = [pattern[0].drops("bt4") for _ in range(20000)]
        again = Loss(share, burst, 7)
        assert drops == [again.drops("bt4") for _ in range(20000)]
        assert sum(drops) / len(drops) == pytest.approx(share, abs=0.03)
        bursts = "".join("x" if d else "." for d in drops).replace(".", " ").split()
        expected = burst if burst > 1 else 1 / (1 - share)
        assert sum(map(len, bursts)) / len(bursts) == pytest.approx(expected, rel=0.1)
    assert parse_loss("0.5,burst=3") == (0.5, 3.0) and parse_loss("0.25") == (0.25, 1.0)
    for wrong in ("0.5,bursts=3", "half"):
        with pytest.raises(ValueError):
            parse_loss(wrong)
    with pytest.raises(ValueError):
        Loss(1.0)


def receiver(*arguments, **environment):
    return subprocess.run([sys.executable, "-m", "judge", *map(str, arguments)], text=True, capture_output=True,
                          env={**os.environ, "PYTHONPATH": str(TESTS), **environment}, timeout=patience.LIMIT_S)


def test_command_line_pass_fail_and_files(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("LOSS", raising=False)
    run, _ = air.transmit(seconds=8)
    write_receptions(run, tmp_path)
    log = tmp_path / "played.jsonl"
    log.write_text("".join(json.dumps(row) + "\n" for row in air.played_log(10)))
    out = tmp_path / "out"
    common = ["--receptions", str(tmp_path / "receptions.jsonl"), "--played", str(log), "--quiet"]
    assert main([*common, "--out", str(out), "--expect", "bt4,bt5,wifi", "--title", "A flight"]) == 0
    assert capsys.readouterr().out.rstrip().endswith("PASS")
    figures = json.loads((out / "figures.json").read_text())
    assert figures["verdict"] == "PASS" and figures["violations"] == 0 and figures["commit"] and figures["date"]
    assert all(not isinstance(value, (dict, list)) for value in figures.values())
    assert (out / "report.txt").read_text().startswith("A flight\n")
    assert (out / "report.png").read_bytes().startswith(b"\x89PNG")
    assert (out / "receptions.jsonl").read_text().count("\n") == len(run.receptions)
    assert main([*common, "--limit", "bt4_location_reception_max_s=0.01"]) == 1
    assert "[limit] 1" in capsys.readouterr().out
    assert main([*common, "--address", "00:00:00:00:00:01"]) == 1
    assert "nothing was heard" in capsys.readouterr().out
    monkeypatch.setenv("LOSS", "0.5,burst=3")
    assert main([*common, "--limit", "bt4_all_five_within_p99_s=5"]) == 0
    assert "dropped on purpose" in capsys.readouterr().out


@pytest.mark.parametrize("arguments, words", [
    ([], "no source"), (["--pcap", "/nonexistent"], "/nonexistent: No such file"),
    (["--hci", "tcp-client:127.0.0.1:1", "--seconds", "1"], "--hci tcp-client"),
    (["--monitor", "nosuchif0", "--seconds", "1"], "--monitor nosuchif0"),
    (["--pcap", "x", "--expect", "bt6"], "'bt6' is none of"), (["--pcap", "x", "--limit", "a=b"], "NAME=NUMBER"),
    (["--pcap", "x", "--loss", "2"], "loss is 2"), (["--pcap", "x", "--address", "12"], "six octets")])
def test_usage_and_source_errors_exit_2(arguments, words):
    answer = receiver(*arguments)
    assert answer.returncode == 2 and words in answer.stderr, answer.stderr
    assert "Traceback" not in answer.stderr


def test_follow_a_growing_file(tmp_path):
    """Beacons are appended while the listener runs; half a record is waited for."""
    path, log, sent = tmp_path / "growing.pcap", tmp_path / "log", 40
    with open(path, "wb", buffering=0) as file, open(log, "w") as said:
        file.write(pcap_header() + pcap_record(beacon_frame(99), time.time() - 60))  # before the run
        listener = subprocess.Popen(
            [sys.executable, "-m", "judge", "--pcap", path, "--follow", "--quiet", "--out", tmp_path / "out",
             "--expect-messages", "location"], text=True, stdout=subprocess.PIPE, stderr=said,
            env={**os.environ, "PYTHONPATH": str(TESTS)})
        patience.wait_for("the listener", lambda: "listening" in log.read_text())
        for counter in range(sent):
            record = pcap_record(beacon_frame(counter), time.time())
            file.write(record[:40])
            time.sleep(0.05)
            file.write(record[40:])
        listener.terminate()
        text = listener.communicate(timeout=patience.LIMIT_S)[0]
    rows = [json.loads(line) for line in (tmp_path / "out/receptions.jsonl").read_text().splitlines()]
    assert all(row["address"] == air.BSSID for row in rows)
    assert [int(row["payload"][2:4], 16) for row in rows] == list(range(sent)), text  # none lost, none from before
    assert "FAIL" in text and "frozen payload" in text  # the position never moves
