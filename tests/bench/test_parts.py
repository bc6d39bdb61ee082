"""The bench's own parts, without a machine."""

import json
import struct

import pytest
from host import tlog
from host.flight import write_flight

from . import flights, gaps, runs, soak
from .machine import configuration
from .tap import HEADER, MAGIC, RECORD, Stream


def pcap(*frames, header=True):
    start = HEADER.pack(MAGIC, 2, 4, 0, 0, 65535, 127) if header else b""
    return start + b"".join(RECORD.pack(1, 2, len(frame), len(frame)) + frame for frame in frames)


def frames_of(stream, data, piece):
    found = []
    for at in range(0, len(data), piece):
        found += [frame for _, frame in stream.feed(data[at:at + piece]) if frame is not None]
    return found


@pytest.mark.parametrize("piece", [1, 7, 1000])
def test_frames_are_cut_out_of_any_pieces(piece):
    assert frames_of(Stream(), pcap(b"first", b"second" * 100), piece) == [b"first", b"second" * 100]


def test_a_capture_that_begins_again_is_followed(capsys):
    stream = Stream()
    assert frames_of(stream, pcap(b"first") + pcap(b"again"), 11) == [b"first", b"again"]
    # ended in the middle of a frame: what follows is no frame of that length
    cut = pcap(b"x" * 50, header=False)[:-20]
    assert frames_of(stream, cut + pcap(b"y" * 90) + pcap(b"last"), 1000)[-1] == b"last"


def location(east, seconds):
    """A Location on the air: 25 octets, position and timestamp set."""
    body = bytearray(25)
    body[0], body[1] = 0x12, 0x20
    struct.pack_into("<ii", body, 5, 577000000, 119000000 + east)
    struct.pack_into("<H", body, 21, seconds)
    return bytes([0x0D, east & 0xFF]) + bytes(body)


@pytest.fixture
def receptions(tmp_path):
    def write(rows):
        path = tmp_path / "receptions.jsonl"
        path.write_text("".join(json.dumps({
            "time": mono, "mono": mono, "channel": channel, "address": "C0:00:00:00:00:01", "rssi": None,
            "payload": payload.hex(), "raw": "", "phy": None}) + "\n" for mono, channel, payload in rows))
        return gaps.Contents(path)
    return write


def test_a_frozen_payload_is_a_gap(receptions):
    heard = receptions([(at, "bt4", location(min(at, 3), 10 * min(at, 3))) for at in range(1, 9)])
    assert heard.newer["bt4"] == [1, 2, 3]
    assert heard.longest_gap_s("bt4", 1.5, 8.5) == 5.5  # unfinished: since 3
    assert heard.longest_gap_s("bt4", 7.5, 8.5, clip=True) == 1.0  # counted from then on only


def test_a_gap_reaches_back_before_the_harm(receptions):
    heard = receptions([(at, "bt4", location(at, 10 * at)) for at in (1, 2, 6, 7)])
    assert heard.longest_gap_s("bt4", 3, 7.1) == 4
    assert heard.longest_gap_s("bt4", 3, 7.1, clip=True) == 3


def test_a_silent_channel_is_the_worst(receptions):
    heard = receptions([(at, "bt4", location(at, 10 * at)) for at in range(1, 9)])
    assert heard.worst_gap(("bt4", "wifi"), 2, 8) == (6, "wifi")


def test_a_restarted_autopilot_has_a_younger_clock_only(tmp_path):
    source, path = tmp_path / "a.tlog", tmp_path / "b.tlog"
    write_flight(source, 20)
    flights.restarted(source, path, 10)
    before, after = ([message for _, frame in tlog.read(one) for message in tlog.Decoder().messages(frame)
                      if message.get_type() == "GLOBAL_POSITION_INT"] for one in (source, path))
    assert len(before) == len(after) == 100
    assert [one.lat for one in before] == [one.lat for one in after]
    assert [one.time_boot_ms for one in after[:50]] == [one.time_boot_ms for one in before[:50]]
    assert after[50].time_boot_ms < 3000 and after[99].time_boot_ms - after[50].time_boot_ms == 9800


def test_the_configuration_is_the_society_s_with_what_is_added():
    text = configuration(self_id={"description": "Test"}, wifi={"channel": 11})
    assert "uas_id = SSRS5GBG01" in text and "description = Test\n" in text and "[wifi]\nchannel = 11" in text


@pytest.mark.parametrize("gap_s, late, problems, disturbed, verdict", [
    (0.4, [], [], "", "PASS"),
    (0.4, [], [], "it stood still", "PASS"),            # in time all the same
    (0.7, [], [], "", "FAIL"),
    (0.7, [], [], "it stood still", "not judged"),      # late, maybe because of the machine
    (0.4, ["too late"], [], "it stood still", "not judged"),
    (0.4, ["too late"], [], "", "FAIL"),
    (None, [], [], "", "FAIL"),
    (None, [], [], "it stood still", "FAIL"),           # that nothing was measured isn't late
    (0.4, [], ["wrong"], "it stood still", "FAIL"),     # what isn't about time needs no quiet machine
])
def test_only_what_is_late_on_a_disturbed_machine_is_not_judged(gap_s, late, problems, disturbed, verdict):
    one = runs.Outcome("load", "", 0.5, gap_s, "wifi", problems=problems, late=late, disturbed=disturbed)
    assert one.verdict == verdict and f"  {verdict}" in runs.table({"load": one}, ["load"]) + "  PASS"


def samples(*descriptors):
    """One a minute, the first ones before anything is settled."""
    return [soak.Sample(60 * minute, {}, 6500, number, 300000, 364, 24) for minute, number in enumerate(descriptors)]


@pytest.mark.parametrize("descriptors, grown", [
    ([90, 95, 97, 98, 98, 98, 98, 98], 0),     # before the third minute all is new
    ([98, 98, 98, 98, 98, 98, 98, 102], 0),    # a connection that was just made
    ([98, 98, 98, 98, 99, 100, 101, 102], 2),  # a leak
    ([98, 98, 98, 98, 98, 99, 99, 99], 1),
])
def test_what_grows_is_told_from_what_comes_and_goes(descriptors, grown):
    assert soak.growth(samples(*descriptors))["file_descriptors"] == grown
