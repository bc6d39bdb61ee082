"""The bench's own parts, without a machine."""

import json
import re
import socket
import struct
import subprocess
import threading
import time
import types
from itertools import accumulate

import parts
import pytest
from models import tlog
from models.flight import write_flight

from . import flights, gaps, rights, runs, soak, wifi
from .machine import Shell, configuration
from .tap import HEADER, MAGIC, RECORD, Stream


def record(frame, at_us):
    return RECORD.pack(at_us // 1_000_000, at_us % 1_000_000, len(frame), len(frame)) + frame


def pcap(*frames, header=True):
    start = HEADER.pack(MAGIC, 2, 4, 0, 0, 65535, 127) if header else b""
    return start + b"".join(record(frame, 1_000_002) for frame in frames)


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


class SlowConsole:
    """A shell behind a UNIX socket, as QEMU has it, to which every word takes its time."""

    def __init__(self, path, delay_s):
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(str(path))
        self.listener.listen()
        self.shell = subprocess.Popen(["/bin/sh"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                      bufsize=0)
        self.delay_s, self.peer = delay_s, None
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        self.peer, _ = self.listener.accept()
        threading.Thread(target=self.answer, daemon=True).start()
        try:
            while octets := self.peer.recv(65536):
                time.sleep(self.delay_s)
                self.shell.stdin.write(octets)
        except OSError:
            pass  # the test is over

    def answer(self):
        try:
            while octets := self.shell.stdout.read(65536):
                self.peer.sendall(octets)
        except OSError:
            pass

    def close(self):
        self.shell.kill()
        self.shell.wait()
        self.listener.close()


def test_a_console_that_answers_late_is_understood_all_the_same(tmp_path, monkeypatch):
    """It was asked again meanwhile, and answers each time."""
    monkeypatch.setattr(Shell, "ANSWER_S", 0.05)
    console = SlowConsole(tmp_path / "console", 0.4)
    try:
        shell = Shell(tmp_path / "console")
        for number in range(5):
            assert shell.run(f"echo {number}; [ {number} != 3 ]") == (number == 3, f"{number}\n")
        shell.close()
    finally:
        console.close()


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


def beacons(path, *intervals_ms):
    frame = bytes((0, 0, 8, 0, 0, 0, 0, 0, wifi.BEACON)) + bytes(40)
    times_us = accumulate((round(1000 * each) for each in intervals_ms), initial=1_000_000_000)
    path.write_bytes(pcap() + b"".join(record(frame, at_us) for at_us in times_us))
    return path


@pytest.mark.parametrize("intervals_ms, stood_still_s", [
    ([102.4, 218.2, 1.7, 87.5, 102.4], [0.116]), ([102.4, 244.2, 61.4, 102.4], [0.142]), ([102.4, 204.4, 0.1, 105], [0.102]),
    ([102.4, 140, 64.8, 102.4], []),         # not for long
    ([102.4, 2000, 102.4, 102.4], []),       # off, and on again
    ([102.4, 204.8, 102.4, 102.4], []),      # one wasn't received
])
def test_an_emulated_machine_that_stands_still_is_told_from_an_access_point_that_is_off(tmp_path, intervals_ms, stood_still_s):
    found = list(wifi.standstills(beacons(tmp_path / "pcap", *intervals_ms)))
    assert [round(seconds, 3) for _, seconds in found] == stood_still_s


def test_a_wait_is_judged_without_what_the_machine_stood_still():
    """One beacon that was 0.12 s late among 5858 made half an hour's verdict."""
    contents = types.SimpleNamespace(newer={"bt4": [1.0, 1.3, 1.6], "wifi": [1.0, 1.512, 1.9, 2.45]})
    waits = soak.longest_waits(contents, [(1.4, 0.116), (2.5, 0.2)])
    assert {channel: tuple(round(one, 3) for one in wait) for channel, wait in waits.items()} == {"bt4": (0.3, 0), "wifi": (0.55, 0)}
    assert soak.too_long(waits) == ["wifi: 0.550 s for a newer position"]
    assert soak.too_long({"wifi": (0.512, 0.116)}) == []


# --- what processes may do ------------------------------------------------------------

TABLE = """
| process | there | user | groups | capabilities | bounding | filter | no new privs | listens | writes |
|---|---|---|---|---|---|---|---|---|---|
| `first` | always | root | root | all | all | no | no | - | all |
| `second` | always | some | some, more | net_admin, net_raw | - | yes | yes | `udp 127.0.0.1:14550`, `unix /run/second-*` | all |
| `third` | maintenance | root | root | all | all | no | no | `tcp *:80` | all |
"""
ALL = "000001ffffffffff"
ROOT = {"Uid": "0\t0\t0\t0", "Gid": "0\t0\t0\t0", "Groups": " ", "CapPrm": ALL, "CapEff": ALL, "CapBnd": ALL,
        "NoNewPrivs": "0", "Seccomp": "0"}
SECOND = {"Uid": "7\t7\t7\t7", "Gid": "7\t7\t7\t7", "Groups": "7 8 ", "CapPrm": f"{0x3000:016x}",
          "CapEff": f"{0x3000:016x}", "CapBnd": f"{0:016x}", "NoNewPrivs": "1", "Seccomp": "2"}
UDP = "  1: {} 00000000:0000 07 00000000:00000000 00:00000000 00000000     7        0 {} 2 0 0"
TCP = "  0: 00000000:{} 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 {} 1 0 100 0 0 10 0"
UNIX = "0: 00000002 00000000 {} {} 01 {} {}"


class Listing:
    """What a machine says of itself; of it tests change one thing each."""

    def __init__(self):
        # By number: its command, its parent, what its threads' status says.
        self.processes = {1: ("first", 0, [ROOT]), 2: ("", 0, [ROOT]), 3: ("", 2, [ROOT]),
                          8: ("/bin/sh /etc/init.d/S05bench start", 1, [ROOT]), 9: ("other --word", 8, [ROOT]),
                          20: ("/usr/bin/second -x", 1, [SECOND])}
        self.holders = {101: 20, 102: 20, 103: 9}
        self.sockets = {"udp": [UDP.format("0100007F:38D6", 101)],
                        "unix": [UNIX.format("00010000", "0001", 102, "/run/second-5")], "tcp": [TCP.format("1F90", 103)]}

    def second(self, **status):
        self.processes[20] = ("/usr/bin/second -x", 1, [SECOND, SECOND | status])

    def adds(self, pid, command, *sockets):
        self.processes[pid] = (command, 1, [ROOT])
        for kind, text in sockets:
            inode = 200 + len(self.holders)
            self.holders[inode] = pid
            self.sockets.setdefault(kind, []).append(text.format(inode))

    def text(self):
        lines = ["@status"]
        for pid, (_, parent, threads) in self.processes.items():
            for number, thread in enumerate(threads):
                status = {"State": "S (sleeping)", "PPid": str(parent), "CapInh": "0", "CapAmb": "0"} | thread
                lines += [f"{pid}/task/{pid + number * 1000}/status:{key}:\t{value}" for key, value in status.items()]
        lines += ["@cmdline"] + [f"{pid} {one[0]}" for pid, one in self.processes.items()] + ["@links"]
        for pid in self.processes:
            lines += [f"lrwxrwxrwx 1 0 Nov 23 17:34 {pid}/cwd -> /run/service/third", f"{pid}/fd:"]
            lines += [f"lrwx------ 1 64 Nov 23 17:34 4 -> socket:[{inode}]"
                      for inode, holder in self.holders.items() if holder == pid]
        for kind in (*rights.NETWORKS, *rights.OTHERS, "unix"):
            lines += [f"@{kind}", *self.sockets.get(kind, ())]
        lines += ["@users", "root:x:0:0", "some:x:7:7", "@groups", "root:x:0:", "some:x:7:", "more:x:8:",
                  "@capabilities", "40"]
        return "\n".join(lines) + "\n"

    def problems(self, *states):
        return rights.differences(rights.table(TABLE), rights.snapshot(self.text()), {"always", *states})


def test_processes_that_are_as_the_table_says():
    listing = Listing()
    assert listing.problems() == []
    listing.adds(30, "/bin/sh ./run", ("tcp", TCP.format("0050", "{}")))
    assert listing.problems("maintenance") == []


DEVIATIONS = {
    "unknown": (lambda one: one.adds(30, "fourth"), r"fourth \(process 30\): it has no row.*user: root"),
    "not_there_now": (lambda one: one.adds(30, "/bin/sh ./run"), "third .*no row"),
    "missing": (lambda one: one.processes.pop(1), "first, user root: no such process"),
    "twice": (lambda one: one.processes.update({21: ("second", 1, [SECOND])}), "second, process: expected one, found 20, 21"),
    "user": (lambda one: one.second(Uid="0\t0\t0\t0"), "second .*, user: expected some, found root, some"),
    "saved_user": (lambda one: one.second(Uid="7\t7\t0\t7"), "second .*, user: expected some, found root, some"),
    "group": (lambda one: one.second(Groups="7 8 0 "), "second .*, groups: expected more, some, found more, root, some"),
    "capability": (lambda one: one.second(CapEff=f"{0x3002:016x}"), "second .*, capabilities: .*found dac_override, net"),
    "could_take_it": (lambda one: one.second(CapPrm=ALL), "second .*, capabilities: expected net_.*, found all"),
    "bounding": (lambda one: one.second(CapBnd=ALL), "second .*, bounding: expected -, found all"),
    "filter": (lambda one: one.second(Seccomp="0"), "second .*, filter: expected yes, found no, yes"),
    "no_new_privs": (lambda one: one.second(NoNewPrivs="0"), "second .*, no new privs: expected yes, found no, yes"),
    "port": (lambda one: one.sockets["udp"].append(UDP.format("00000000:0035", 101)),
             r"second .*, listens: expected .*, found udp \*:53, udp 127"),
    "other_address": (lambda one: one.sockets.update(udp=[UDP.format("00000000:38D6", 101)]), r"found udp \*:14550"),
    "socket": (lambda one: one.sockets["unix"].append(UNIX.format("00000000", "0002", 102, "@open@@@")),
               "second .*, listens: expected .*, found .*unix @open$"),
    "packets": (lambda one: one.sockets.update(packet=["0 3 3 0003 3 1 0 7 102"]), "second .*, found packet, "),
    "nobody_s": (lambda one: one.sockets["tcp"].append(TCP.format("0016", 999)), r"no process .*listens: tcp \*:22"),
    "socket_that_is_gone": (lambda one: one.sockets.pop("unix"), "second, listens: expected unix /run/second-\\*, found udp"),
}


@pytest.mark.parametrize("deviation", DEVIATIONS)
def test_a_process_that_is_not_as_the_table_says(deviation):
    listing = Listing()
    change, says = DEVIATIONS[deviation]
    change(listing)
    problems = listing.problems()
    assert any(re.search(says, one) for one in problems), problems


def test_what_may_be_written_is_compared_too():
    rows = rights.table(TABLE.replace("`unix /run/second-*` | all", "- | `/run/second`, `/dev/tty[AU]*`"))
    processes = [one._replace(columns=one.columns | {"writes": frozenset(("/run/second", "/dev/ttyUSB0"))})
                 if one.name == "second" else one for one in rights.snapshot(Listing().text())]
    assert not [one for one in rights.differences(rows, processes, {"always"}) if "writes" in one]
    processes[-1].columns["writes"] |= {"/data/odid"}
    assert any("second (process 20), writes: expected" in one and "found /data/odid, " in one
               for one in rights.differences(rows, processes, {"always"}))
    assert rights.outermost(["/run/odid/kept", "/run/odid", "/run/odid-other", "/run/odid/a/b"]) == \
        {"/run/odid", "/run/odid-other"}


def test_what_the_document_names_is_there():
    text = rights.DOCUMENT.read_text()
    tests = "".join(path.read_text() for path in (parts.ROOT / "tests").rglob("test_*.py"))
    named = set(re.findall(r"`(test_\w+)`", text))
    assert len(named) > 20
    assert not [name for name in named if f"def {name}(" not in tests]
    programs = {one.name for one in (parts.ROOT / "package/odid-daemon/tests").rglob("test_*.c")}
    assert not set(re.findall(r"`(test_\w+\.c)`", text)) - programs
    paths = {one for one in re.findall(r"`([\w.-]+(?:/[\w.-]+)+)`", text) if not one.startswith("/")}
    assert len(paths) > 20
    assert not [path for path in paths if not (parts.ROOT / path).exists()]
