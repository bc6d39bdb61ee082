"""The models themselves: are they what README.md says they are?"""

import json
import math
import os
import select
import signal
import socket
import struct
import sys
import time

import parts
import patience
import pytest

from . import air, controller, hostapd, realtime, tlog
from .controller import Rootcanal
from .flight import UNDULATION_M, write_flight
from .front import Packets

RESET, READ_FEATURES = 0x0C03, 0x2003
SET_PARAMETERS, SET_DATA, SET_ENABLE = 0x2006, 0x2008, 0x200A
SET_EXTENDED_PARAMETERS, SET_EXTENDED_DATA = 0x2036, 0x2037
INTERVAL_20_MS, INTERVAL_100_MS = 0x20, 0xA0


def legacy_parameters(interval):
    return struct.pack("<HHBBB6sBB", interval, interval, 3, 0, 0, bytes(6), 7, 0)


def extended_parameters(handle, properties, phy, interval=INTERVAL_20_MS):
    three = interval.to_bytes(3, "little")
    return struct.pack("<BH3s3sBBB6sBbBBBBB", handle, properties, three, three, 7, 0, 0, bytes(6), 0,
                       127, phy, 0, phy, handle, 0)


def advertisement(message):
    return bytes([0x1E, 0x16, 0xFA, 0xFF, 0x0D, 7]) + message.ljust(25, b"\0")


class Host:
    """The other side of the pty: sends commands, reads events."""

    def __init__(self, path):
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        self.packets, self.events = Packets(), []

    def receive(self, timeout_s=patience.LIMIT_S):
        if not self.events:
            if not select.select([self.fd], [], [], timeout_s)[0]:
                return None
            self.events += self.packets.feed(os.read(self.fd, 4096))
            return self.receive(timeout_s)
        return self.events.pop(0)

    def command(self, opcode, parameters=b""):
        """The answer's status and what follows it."""
        os.write(self.fd, struct.pack("<BHB", 1, opcode, len(parameters)) + parameters)
        event = self.receive()
        assert event is not None, f"no answer to 0x{opcode:04x}"
        if event[1] == 0x0F:
            assert event[5] | event[6] << 8 == opcode
            return event[3], b""
        assert event[1] == 0x0E and event[4] | event[5] << 8 == opcode
        return event[6], event[7:]

    def close(self):
        os.close(self.fd)


@pytest.mark.parametrize("taken", range(4))
def test_a_port_that_somebody_took_meanwhile_is_not_waited_for(short_folder, monkeypatch, taken):
    """rootcanal went on without it, and a gate was red."""
    free_ports, tries = controller.free_ports, []

    def ports(count):
        found = free_ports(count)
        if not tries:
            found[taken] = holder.getsockname()[1]
        tries.append(found)
        return found
    monkeypatch.setattr(controller, "STARTED_S", 2)
    monkeypatch.setattr(controller, "free_ports", ports)
    with socket.socket() as holder:
        holder.bind(("127.0.0.1", 0))
        Rootcanal(short_folder / "rootcanal.log").stop()
    assert len(tries) == 2


@pytest.fixture
def front(short_folder, rootcanal):
    """Starts a front in a mode; gives the part, a host on its pty and the log of set payloads."""
    started = []

    def start(mode):
        part = parts.Part(parts.python("models.front", "--pty", short_folder / "bt", "--hci-port",
                                       rootcanal.hci_port, "--mode", mode, "--set-log",
                                       short_folder / "set.jsonl"),
                          short_folder / "front.log", orders=True)
        assert part.process.stdout.readline() == "done\n", part.log()
        host = Host(short_folder / "bt")
        started.append((part, host))
        assert host.command(RESET)[0] == 0
        return part, host, short_folder / "set.jsonl"

    yield start
    for part, host in started:
        host.close()
        part.stop()


def json_lines(path):
    return [json.loads(line) for line in path.read_text().splitlines()]


# --- the controller ---------------------------------------------------------


def test_h4_packets_are_cut_wherever_the_bytes_break():
    stream = bytes.fromhex("01030c00" "040e0401030c00" "0200000300aabbcc" "0500000200ffff")
    packets, found = Packets(), []
    for octet in stream:
        found += packets.feed(bytes([octet]))
    assert found == [stream[:4], stream[4:11], stream[11:19], stream[19:]]
    with pytest.raises(ValueError, match="not H4"):
        list(Packets().feed(b"\x99"))


@pytest.mark.parametrize("mode,newer,at_20_ms,extended", [
    ("full", True, 0x00, 0x0C), ("legacy20", False, 0x00, 0x01), ("bcm43455", False, 0x12, 0x01)])
def test_each_mode_is_the_controller_that_it_says(front, mode, newer, at_20_ms, extended):
    _, host, _ = front(mode)
    status, features = host.command(READ_FEATURES)
    assert status == 0 and len(features) == 8
    assert bool(features[1] & 0x10) == bool(features[1] & 0x08) == newer
    assert host.command(SET_PARAMETERS, legacy_parameters(INTERVAL_20_MS))[0] == at_20_ms
    assert host.command(SET_PARAMETERS, legacy_parameters(INTERVAL_100_MS))[0] == 0
    # After a legacy command a controller that knows the extended ones refuses them as well.
    assert host.command(SET_EXTENDED_PARAMETERS, extended_parameters(0, 0x10, 1))[0] == extended
    assert host.command(0x207F, extended_parameters(0, 0x10, 1) + bytes(2))[0] != 0


def test_a_legacy_command_after_an_extended_one_is_refused_until_reset(front):
    _, host, _ = front("full")
    assert host.command(SET_EXTENDED_PARAMETERS, extended_parameters(0, 0x10, 1))[0] == 0
    assert host.command(SET_PARAMETERS, legacy_parameters(INTERVAL_100_MS))[0] == 0x0C
    assert host.command(RESET)[0] == 0
    assert host.command(SET_PARAMETERS, legacy_parameters(INTERVAL_100_MS))[0] == 0


@pytest.mark.skipif(not realtime.granted(), reason="this machine grants no real-time priority")
def test_each_thread_of_the_controller_has_real_time_priority(rootcanal):
    """Raised after its start, on a busy machine, every third controller had threads that weren't."""
    tasks = os.listdir(f"/proc/{rootcanal.process.pid}/task")
    assert {os.sched_getscheduler(int(task)) for task in tasks} == {os.SCHED_FIFO}


def test_what_was_set_is_logged_with_its_channel_when_it_was_accepted(front):
    begun = time.monotonic()
    part, host, log = front("full")
    long_range = bytes([0x05, 0x16, 0xFA, 0xFF, 0x0D, 1])
    for handle, properties, phy, data in ((0, 0x10, 1, advertisement(b"\x12")), (1, 0, 3, long_range)):
        assert host.command(SET_EXTENDED_PARAMETERS, extended_parameters(handle, properties, phy, 0xA0))[0] == 0
        assert host.command(SET_EXTENDED_DATA, bytes([handle, 3, 1, len(data)]) + data)[0] == 0
    assert part.order("refuse 2037 0c") == "done"
    assert host.command(SET_EXTENDED_DATA, bytes([0, 3, 1, 3, 2, 1, 6]))[0] == 0x0C
    rows = json_lines(log)
    assert [(row["channel"], row["data"]) for row in rows] == [
        ("bt4", advertisement(b"\x12").hex()), ("bt5", long_range.hex())]
    assert all(begun <= row["mono"] <= time.monotonic() and row["opcode"] == 0x2037 for row in rows)


def test_a_foreign_command_is_done_and_its_completion_shown(front):
    part, host, _ = front("bcm43455")
    assert part.order("inject 0a200100") == "done"
    event = host.receive()
    assert event[1] == 0x0E and event[4:6] == b"\x0a\x20"
    assert part.order("inject 0a2001").startswith("error")
    assert part.order("dance").startswith("error")


def test_a_hung_controller_answers_nothing(front):
    part, host, _ = front("full")
    assert part.order("mute") == "done"
    os.write(host.fd, bytes.fromhex("01030c00"))
    assert host.receive(0.3) is None  # to look that nothing comes
    assert part.order("unmute") == "done"
    assert host.command(RESET)[0] == 0


def test_an_unplugged_controller_hangs_up_and_a_fresh_one_comes(front, short_folder):
    part, host, _ = front("full")
    assert part.order("unplug") == "done"
    assert not (short_folder / "bt").exists()
    assert select.select([host.fd], [], [], patience.LIMIT_S)[0]  # readable: the end of it
    with pytest.raises(OSError):
        if os.read(host.fd, 10) == b"":
            raise OSError("end of file")
    assert part.order("unplug").startswith("error") and part.order("plug") == "done"
    fresh = Host(short_folder / "bt")
    assert fresh.command(RESET)[0] == 0
    fresh.close()


def test_what_is_advertised_is_heard_and_what_is_replaced_is_not_any_more(front, rootcanal):
    _, host, _ = front("bcm43455")
    ear = air.Air(rootcanal.hci_port)
    try:
        def advertise(number):
            assert host.command(SET_DATA, bytes([31]) + advertisement(bytes([0x12, number])))[0] == 0

        def numbers(since=0.0):
            return [one.data[3] for one in ear.receptions("bt4", since)]

        assert host.command(SET_PARAMETERS, legacy_parameters(INTERVAL_100_MS))[0] == 0
        advertise(1)
        assert host.command(SET_ENABLE, b"\x01")[0] == 0
        patience.wait_for("the first one", lambda: 1 in numbers())
        advertise(2)
        advertise(3)
        patience.wait_for("the last one", lambda: 3 in numbers())
    finally:
        ear.stop()
    assert numbers() == sorted(numbers())
    assert all(one.data[:2] == b"\x0d\x07" for one in ear.receptions("bt4"))
    # The next event was 100 ms away: what a program replaces within that time was never sent.
    patience.promised(2 not in numbers(), "what was replaced at once was heard")


def test_the_field_study_loses_a_location_every_three_seconds(rootcanal, short_folder):
    """By what the model's own log says the interval is kept."""
    ear = air.Air(rootcanal.hci_port)
    model = parts.Part(parts.python("models.field_study", "--hci-port", rootcanal.hci_port, "--seconds", 11),
                       short_folder / "model.log")
    try:
        assert model.process.wait(patience.LIMIT_S) == 0, model.log()
        locations = [one for one in ear.receptions("bt4") if one.data[2] >> 4 == 1]
    finally:
        model.stop()
        ear.stop()
    own = json.loads(model.log().splitlines()[-1])
    assert locations and own["host_location_max_s"] > 0
    times = [one.mono for one in locations]
    patience.promise("by its own log", own["host_location_max_s"], 1.05)
    patience.promised(max(later - earlier for earlier, later in zip(times, times[1:])) > 1.7, "no Location was lost")


# --- hostapd ----------------------------------------------------------------


@pytest.fixture
def access_point(short_folder):
    part = parts.Part(parts.python("models.hostapd", "--dir", short_folder / "h", "--pcap",
                                   short_folder / "b.pcap"), short_folder / "h.log", orders=True)
    assert part.process.stdout.readline() == "done\n", part.log()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as client:
        client.bind(str(short_folder / "client"))
        client.connect(str(short_folder / "h/wlan0"))
        client.settimeout(patience.LIMIT_S)

        def ask(text):
            client.send(text.encode())
            return client.recv(4096).decode()
        ask.client = client
        yield part, ask, short_folder / "b.pcap"
    part.stop()


def test_hostapd_answers_as_hostapd_does(access_point):
    part, ask, _ = access_point
    assert ask("PING") == "PONG\n"
    assert "state=ENABLED\n" in ask("STATUS")
    assert ask("SET vendor_elements dd03fa0bbc") == "OK\n"
    assert ask("SET vendor_elements dd0") == ask("SET vendor_elements zz") == "FAIL\n"
    assert ask("DANCE") == "UNKNOWN COMMAND\n"
    assert part.order("fail 1") == "done"
    assert [ask("SET vendor_elements dd00") for _ in range(2)] == ["FAIL\n", "OK\n"]
    assert part.order("disabled") == "done"
    assert "state=DISABLED\n" in ask("STATUS") and ask("UPDATE_BEACON") == "FAIL\n"
    assert part.order("mute") == "done"
    ask.client.settimeout(0.5)  # nothing comes
    with pytest.raises(TimeoutError):
        ask("PING")


def test_a_chip_that_refuses_an_element_confuses_its_driver(access_point):
    part, ask, pcap = access_point
    assert part.order("refuse 1") == "done"
    assert ask("SET vendor_elements dd06fa0bbc0d0142") == "OK\n"
    assert [ask("UPDATE_BEACON") for _ in range(2)] == ["FAIL\n", "OK\n"]  # and sends nothing
    assert ask("SET vendor_elements dd06fa0bbc0d0143") == "OK\n" and ask("UPDATE_BEACON") == "FAIL\n"
    assert ask("SET vendor_elements ") == "OK\n" and ask("UPDATE_BEACON") == "FAIL\n"
    assert ask("SET vendor_elements dd06fa0bbc0d0144") == ask("UPDATE_BEACON") == "OK\n"
    assert part.order("limit 7") == "done"
    assert ask("SET vendor_elements dd06fa0bbc0d0145") == "OK\n" and ask("UPDATE_BEACON") == "FAIL\n"


def test_what_a_chip_had_before_it_refused_stays_in_it(access_point):
    """Beside what comes later, until the driver is right about it."""
    part, ask, pcap = access_point
    assert ask("SET vendor_elements dd06fa0bbc0d0142") == ask("UPDATE_BEACON") == "OK\n"
    assert part.order("refuse 1") == "done"
    assert ask("SET vendor_elements dd06fa0bbc0d0143") == "OK\n" and ask("UPDATE_BEACON") == "FAIL\n"
    assert ask("SET vendor_elements ") == "OK\n" and ask("UPDATE_BEACON") == "FAIL\n"
    assert ask("SET vendor_elements dd06fa0bbc0d0144") == ask("UPDATE_BEACON") == "OK\n"
    patience.wait_for("beacons with both", lambda: {one.data for one in air.beacons(pcap)} >= {b"\x0d\x01\x42", b"\x0d\x01\x44"})
    assert ask("DISABLE") == ask("ENABLE") == "OK\n" and part.order("silence") == "done"
    assert ask("SET vendor_elements dd06fa0bbc0d0145") == ask("UPDATE_BEACON") == "OK\n"
    time.sleep(0.3)  # of some beacons
    assert b"\x0d\x01\x45" not in {one.data for one in air.beacons(pcap)}


def test_an_element_is_in_the_beacons_from_the_update_on(access_point):
    _, ask, pcap = access_point
    assert ask("SET vendor_elements dd06fa0bbc0d0142") == "OK\n"
    time.sleep(0.25)  # of some beacons
    assert air.beacons(pcap) == []
    assert ask("UPDATE_BEACON") == "OK\n"
    found = patience.wait_for("some beacons", lambda: len(found := air.beacons(pcap)) > 5 and found)
    assert {(one.data, one.address) for one in found} == {(b"\x0d\x01\x42", hostapd.BSSID.hex(":").upper())}
    gaps = [later.mono - earlier.mono for earlier, later in zip(found, found[1:])]
    patience.promise("the beacon interval's deviation", abs(sum(gaps) / len(gaps) - 0.1024), 0.01)


# --- the flight and its player ----------------------------------------------


def test_the_generated_flight_agrees_with_itself(tmp_path):
    write_flight(tmp_path / "a.tlog", 30)
    write_flight(tmp_path / "b.tlog", 30)
    assert (tmp_path / "a.tlog").read_bytes() == (tmp_path / "b.tlog").read_bytes()
    decoder, found = tlog.Decoder(), {}
    for time_s, frame in tlog.read(tmp_path / "a.tlog"):
        for message in decoder.messages(frame):
            found.setdefault(message.get_type(), []).append((time_s, message))
    places = found["GLOBAL_POSITION_INT"]
    assert len(places) == 150
    moving = [one for one in places if math.hypot(one[1].vx, one[1].vy) > 300]
    assert len(moving) > 100
    for (_, before), (_, after) in zip(moving, moving[1:]):
        seconds = (after.time_boot_ms - before.time_boot_ms) / 1000
        north_m = (after.lat - before.lat) * 1e-7 * 111319.49
        assert north_m == pytest.approx((before.vx + after.vx) / 200 * seconds, abs=0.2)
        climb_m = (after.alt - before.alt) / 1000
        assert climb_m == pytest.approx(-(before.vz + after.vz) / 200 * seconds, abs=0.2)
        assert (before.lat, before.lon) != (after.lat, after.lon)
    gnss = found["GPS_RAW_INT"][-1][1]
    assert gnss.alt_ellipsoid - gnss.alt == UNDULATION_M * 1000
    armed = [bool(message.base_mode & 0x80) for _, message in found["HEARTBEAT"]]
    assert not armed[0] and armed[-1]


def test_the_player_answers_what_it_is_told_to_do(tmp_path):
    """It can't, and hears. Its answer takes a number, and what comes after it the next ones."""
    flight, heard, decoder = tmp_path / "flight.tlog", [], tlog.Decoder()
    write_flight(flight, 4)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(patience.LIMIT_S)
        player = parts.Part([sys.executable, "-m", "models.player", flight, "--to", f"udp:127.0.0.1:{ear.getsockname()[1]}"],
                            tmp_path / "player.log", orders=True)
        try:
            while len(heard) < 40 or [one.get_type() for one in heard].count("COMMAND_ACK") < 2:
                frame, sender = ear.recvfrom(512)
                heard += decoder.messages(frame)
                if len(heard) in (5, 20):
                    command = tlog.mavlink.MAVLink_command_long_message(1, 1, 511, 0, 33, 200000, 0, 0, 0, 0, 0)
                    ear.sendto(command.pack(tlog.mavlink.MAVLink(None, srcSystem=1, srcComponent=236)), sender)
        finally:
            player.stop(signal.SIGTERM)
    answers = [one for one in heard if one.get_type() == "COMMAND_ACK"]
    assert [(one.command, one.result, one.target_component) for one in answers] == [(511, 4, 236)] * 2
    assert [one.get_seq() for one in heard] == [(heard[0].get_seq() + step) & 0xFF for step in range(len(heard))]


def test_the_player_keeps_bytes_and_time(tmp_path):
    began = time.time(), time.monotonic()
    flight = tmp_path / "flight.tlog"
    write_flight(flight, 3)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", 0))
        ear.settimeout(patience.LIMIT_S)
        player = parts.Part([sys.executable, "-m", "models.player", flight, "--to",
                             f"udp:127.0.0.1:{ear.getsockname()[1]}", "--seconds", "1.5",
                             "--played", tmp_path / "played.jsonl", "--answers", tmp_path / "answers.jsonl"],
                            tmp_path / "player.log", orders=True)
        try:
            expected = [(stamp, frame) for stamp, frame in tlog.read(flight)]
            expected = [(stamp - expected[0][0], frame) for stamp, frame in expected
                        if stamp - expected[0][0] <= 1.5]
            heard = []
            for _ in expected:
                frame, sender = ear.recvfrom(512)
                heard.append((time.monotonic(), frame))
            heartbeat = tlog.mavlink.MAVLink_heartbeat_message(34, 8, 0, 0, 4, 3)
            ear.sendto(heartbeat.pack(tlog.mavlink.MAVLink(None, srcSystem=1, srcComponent=236)), sender)
            # Its log is over: it hears, and is silent.
            command = tlog.mavlink.MAVLink_command_long_message(1, 1, 511, 0, 33, 200000, 0, 0, 0, 0, 0)
            ear.sendto(command.pack(tlog.mavlink.MAVLink(None, srcSystem=1, srcComponent=236)), sender)
            patience.wait_for("the second answer", lambda: len(json_lines(tmp_path / "answers.jsonl")) == 2, part=player)
        finally:
            player.stop(signal.SIGTERM)
        ear.setblocking(False)
        with pytest.raises(BlockingIOError):
            ear.recv(512)
    assert [frame for _, frame in heard] == [frame for _, frame in expected]
    late = [mono - heard[0][0] - at_s for (mono, _), (at_s, _) in zip(heard, expected)]
    patience.promise("how late it plays, in the middle", abs(sorted(late)[len(late) // 2]), 0.02)
    answer = json_lines(tmp_path / "answers.jsonl")[0]
    assert (answer["mavpackettype"], answer["type"], answer["compid"]) == ("HEARTBEAT", 34, 236)
    played = json_lines(tmp_path / "played.jsonl")
    assert {row["mavpackettype"] for row in played} >= {"HEARTBEAT", "GLOBAL_POSITION_INT", "SYSTEM_TIME"}
    assert all(began[0] <= row["time"] <= time.time() and began[1] <= row["mono"] <= time.monotonic() for row in played)


def test_what_is_no_log_is_said_clearly(tmp_path):
    (tmp_path / "empty.tlog").write_bytes(b"")
    (tmp_path / "other.tlog").write_bytes(b"not a telemetry log at all")
    for name, sentence in (("empty", "no MAVLink frame"), ("other", "no MAVLink frame")):
        with pytest.raises(tlog.LogError, match=sentence):
            tlog.read(tmp_path / f"{name}.tlog")


def test_damaged_parts_of_a_log_are_left_out_and_counted(tmp_path):
    write_flight(tmp_path / "whole.tlog", 30)
    whole = tlog.read(tmp_path / "whole.tlog")
    data = bytearray((tmp_path / "whole.tlog").read_bytes())
    assert whole.damaged_parts == 0 and len(whole) > 300
    places = [sum(8 + len(frame) for _, frame in whole[:number]) for number in (40, 100, 250)]
    data[places[2] + 8] = 0  # no start of a frame
    data[places[1]:places[1] + 4] = b""  # octets missing
    data[places[0]:places[0]] = b"\xfd" * 900  # and too many, that look like frames
    (tmp_path / "damaged.tlog").write_bytes(data)
    found = tlog.read(tmp_path / "damaged.tlog")
    assert found.damaged_parts == 3 and found.damaged_octets > 900
    assert set(found) <= set(whole) and len(found) >= len(whole) - 6
