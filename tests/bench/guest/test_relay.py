"""The relay that stands in for mavlink-router, on this machine: a pty is its serial port. What it lets pass is held
against mavlink-router itself where that is installed, or MAVLINK_ROUTERD names it."""

import os
import pty
import re
import select
import shutil
import socket
import subprocess
import time
import tty
from pathlib import Path

import pytest
from patience import LIMIT_S, wait_for

os.environ.setdefault("MAVLINK20", "1")
from pymavlink.dialects.v20 import ardupilotmega, common  # noqa: E402
from pymavlink.generator.mavcrc import x25crc  # noqa: E402

SOURCE = Path(__file__).with_name("relay.c")
(PATCH,) = Path("br2-external/patches/mavlink-router").glob("*-no-command-does-*.patch")
MAVLINK = Path(os.environ.get("MAVLINK_DIR") or "build/mavlink")
# What an autopilot hears, by MAVLink's own parser: system, component and message of each frame.
HEARD = r"""
#include <common/mavlink.h>
#include <stdio.h>
int main(void)
{
    mavlink_message_t message;
    mavlink_status_t status;
    for (int octet; (octet = getchar()) != EOF;)
        if (mavlink_parse_char(MAVLINK_COMM_0, (uint8_t)octet, &message, &status))
            printf("%u %u %u\n", message.sysid, message.compid, message.msgid);
}
"""
# A MAVLink 1 and a MAVLink 2 frame (signed: 13 octets more); what is inside doesn't matter here.
FRAME1 = bytes([0xFE, 3, 0, 1, 1, 0]) + b"abc" + b"xx"
FRAME2 = bytes([0xFD, 2, 1, 0, 0, 1, 1, 0, 0, 0]) + b"de" + b"xx" + bytes(13)


def compiled(program, source):
    subprocess.run(["cc", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-std=gnu11", "-isystem", MAVLINK,
                    "-fsanitize=address,undefined", "-o", program, source], check=True)
    return program


@pytest.fixture(scope="module", name="relay")
def the_relay(tmp_path_factory):
    return compiled(tmp_path_factory.mktemp("relay") / "relay", SOURCE)


@pytest.fixture(scope="module", name="heard")
def what_is_heard(tmp_path_factory):
    """A function of octets: [(system, component, message)]."""
    folder = tmp_path_factory.mktemp("heard")
    (folder / "heard.c").write_text(HEARD)
    program = compiled(folder / "heard", folder / "heard.c")
    return lambda octets: [tuple(map(int, line.split())) for line in subprocess.run(
        [program], input=octets, stdout=subprocess.PIPE, check=True).stdout.splitlines()]


def drained(peer, until):
    """What a peer heard, up to that frame."""
    heard = b""
    while until not in heard:
        heard += peer.recv(2000)
    return heard[:heard.index(until)]


def arrived(line, until):
    """What the autopilot got, up to that frame."""
    octets = b""
    while until not in octets:
        assert select.select([line.master], [], [], LIMIT_S)[0]
        octets += os.read(line.master, 100_000)
    return octets[:octets.index(until)]


class Line:
    """The relay between a serial line and two UDP peers of this test."""

    def __init__(self, relay, folder, extra=(), keys=("", ""), uart=""):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        device = os.ttyname(self.slave)
        self.peers = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
        for peer in self.peers:
            peer.bind(("127.0.0.1", 0))
            peer.settimeout(LIMIT_S)
        endpoints = "\n".join(
            f"[UdpEndpoint peer{at}]\nMode = Normal\nAddress = 127.0.0.1\nPort = {peer.getsockname()[1]}\n{keys[at]}"
            for at, peer in enumerate(self.peers))
        configuration = folder / "main.conf"
        configuration.write_text(
            f"# as mavlink-router's\n[General]\nTcpServerPort = 0\nReportStats = false\n\n"
            f"[UartEndpoint autopilot]\nDevice = {device}\nBaud = 921600,115200\n{uart}\n{endpoints}\n")
        # The real one reads further files from a folder, the machine's own by default.
        if Path(relay).name != "relay":
            extra = ("-d", folder / "none", *extra)
        self.said = open(folder / "said", "w+b")
        self.process = subprocess.Popen([relay, "-c", configuration, *extra], stdout=self.said, stderr=self.said)
        self.addresses()

    def addresses(self):
        """Where each peer's telemetry comes from; it is up when all hear the autopilot."""
        found = {}

        def all_heard():
            assert self.process.poll() is None
            os.write(self.master, heartbeat((9, 9)))
            for number, peer in enumerate(self.peers):
                if select.select([peer], [], [], 0.05)[0]:  # nothing comes
                    found[number] = peer.recvfrom(2000)[1]
            return len(found) == len(self.peers)
        wait_for("each peer to hear the autopilot", all_heard)
        last = heartbeat((9, 9), number=200)    # behind all that was said for that
        os.write(self.master, last)
        for peer in self.peers:
            peer.settimeout(LIMIT_S)
            drained(peer, last)
        return [found[number] for number in range(len(self.peers))]

    def close(self):
        self.process.kill()
        self.process.wait()
        self.said.close()
        for one in (self.master, self.slave):
            try:
                os.close(one)
            except OSError:
                pass                    # the test closed it
        for peer in self.peers:
            peer.close()


@pytest.fixture(name="line")
def running(relay, tmp_path):
    one = Line(relay, tmp_path)
    yield one
    one.close()


def test_frames_go_out_whole_one_a_datagram(line):
    os.write(line.master, b"noise" + FRAME1 + FRAME2[:5])
    for peer in line.peers:
        assert peer.recv(1000) == FRAME1
    os.write(line.master, FRAME2[5:])
    for peer in line.peers:
        assert peer.recv(1000) == FRAME2


def test_an_answer_goes_to_the_line_and_the_other_peer(line):
    os.write(line.master, FRAME1)
    _, relay_address = line.peers[0].recvfrom(1000)
    line.peers[1].recv(1000)
    answer = frame(255, 190)
    line.peers[0].sendto(answer, relay_address)
    assert line.peers[1].recv(1000) == answer
    assert select.select([line.master], [], [], LIMIT_S)[0]
    assert os.read(line.master, 1000) == answer
    line.peers[0].settimeout(0.2)       # nothing comes
    with pytest.raises(TimeoutError):
        line.peers[0].recv(1000)        # not back to who sent it


def frame(system, component, content=b"de"):
    return bytes([0xFD, len(content), 0, 0, 0, system, component, 0, 0, 0]) + content + b"xx"


def test_a_peer_may_be_kept_from_speaking_as_others(relay, tmp_path):
    only = Line(relay, tmp_path, keys=("BlockSrcSysIn = 1\nBlockSrcCompIn = 1", "AllowSrcCompIn = 236"))
    try:
        os.write(only.master, FRAME1)
        addresses = [peer.recvfrom(1000)[1] for peer in only.peers]
        let_in = frame(255, 190, content=b"\xfd" * 255)
        only.peers[0].sendto(frame(1, 190) + frame(7, 1) + FRAME1 + let_in, addresses[0])
        assert only.peers[1].recv(1000) == let_in  # and nothing before it
        only.peers[1].sendto(frame(1, 1) + frame(1, 236), addresses[1])
        assert only.peers[0].recv(1000) == frame(1, 236)
    finally:
        only.close()


# --- the rules, the relay's and mavlink-router's -------------------------------------------

# One that was built without br2-external/patches/mavlink-router lets more pass than the release's: it fails here.
REAL = os.environ.get("MAVLINK_ROUTERD") or shutil.which("mavlink-routerd")
VEHICLE, STATION, FOREIGN, TRANSMITTER = (1, 1), (255, 190), (7, 1), (1, 236)


def heartbeat(who, version=2, number=0):
    link = common.MAVLink(None, srcSystem=who[0], srcComponent=who[1])
    link.seq = number
    return common.MAVLink_heartbeat_message(1, 3, 1, 0, 4, 3).pack(link, force_mavlink1=version == 1)


def arm_status(who):
    """All is well, says somebody."""
    link = common.MAVLink(None, srcSystem=who[0], srcComponent=who[1])
    return common.MAVLink_open_drone_id_arm_status_message(0, b"").pack(link)


def setup_signing(who):
    """From now on the autopilot hears only who signs."""
    link = common.MAVLink(None, srcSystem=who[0], srcComponent=who[1])
    return common.MAVLink_setup_signing_message(0, 0, bytes(32), 1).pack(link)


def serial_control(who):
    """Seventy octets out of one of the autopilot's ports, which it then keeps for whoever asked."""
    link = common.MAVLink(None, srcSystem=who[0], srcComponent=who[1])
    return common.MAVLink_serial_control_message(100, 2 | 4, 0, 57600, 21, list(heartbeat(VEHICLE)) + [0] * 49).pack(link)


def heartbeat_with(flags, who):
    """One that is right but for those flags; a signature where they say so."""
    octets = heartbeat(who)
    octets = octets[:2] + bytes([flags]) + octets[3:-2]
    crc = x25crc(octets[1:] + bytes([common.MAVLink_heartbeat_message.crc_extra])).crc
    return octets + crc.to_bytes(2, "little") + bytes(13 if flags & 1 else 0)


def crafted(who, flags=2, message=0xFDFDFD):
    """A header that says 255 octets of a message nobody knows, with a flag nobody knows."""
    return bytes([0xFD, 255, flags, 0, 0, *who, *message.to_bytes(3, "little")]) + b"\xfd" * 257


def said(message):
    return message.pack(common.MAVLink(None, *STATION))


def command(number, param1=0, who=STATION, form=common.MAVLink_command_long_message, version=2):
    """To everybody. MAVLink 2 cuts off what is zero at its end, of the command itself, too."""
    before = (0, 0, number, 0) if form is common.MAVLink_command_long_message else (0, 0, 0, number, 0, 0)
    return form(*before, param1, *[0] * 6).pack(common.MAVLink(None, *who), force_mavlink1=version == 1)


def parameter(name, version=2):
    return common.MAVLink_param_set_message(1, 1, name.encode(), 7, 4).pack(common.MAVLink(None, *STATION), force_mavlink1=version == 1)


FORMS = (common.MAVLink_command_long_message, common.MAVLink_command_int_message)
# That it wants to see the autopilot's CAN bus, where it is, that its receivers fail, where its origin is, which way it points
# (EXTERNAL_ATTITUDE_ESTIMATE, compass offsets), which of its sources count (SET_EKF_SOURCE_SET, ESTIMATOR_SENSOR_ENABLE, or a
# switch's function, DO_AUX_FUNCTION), that all its parameters, its system id among them, are as at first (PREFLIGHT_STORAGE), and
# what nobody knows yet.
SHUT_COMMANDS = (32000, 43003, 420, 611, 620, 242, 42004, 42005, 42006, 42007, 43006, 218,
                 0, 15, 219, 245, 309, 610, 621, 12900, 43004, 65535)

# What a peer says, and whether it passes where the vehicle's system and component 1 are blocked, and where only
# component 236 is allowed.
# All of it to everybody, so that a peer hears what passes.
RULES = {
    "the station's word": (heartbeat(STATION), True, False),
    "in MAVLink 1": (heartbeat(STATION, version=1), True, False),
    "as the vehicle": (heartbeat(VEHICLE), False, False),
    "as the vehicle, in MAVLink 1": (heartbeat(VEHICLE, version=1), False, False),
    "as its transmitter": (heartbeat(TRANSMITTER), False, True),
    "the transmitter's word": (arm_status(STATION), False, False),
    "the same as its transmitter": (arm_status(TRANSMITTER), False, True),
    "a key to sign with": (setup_signing(STATION), False, False),
    "what an autopilot's port is to say": (serial_control(STATION), False, False),
    "what time it is": (said(common.MAVLink_system_time_message(1_800_000_000_000_000, 1)), False, False),
    "that a radio is full": (said(common.MAVLink_radio_status_message(1, 1, 0, 1, 1, 0, 0)), False, False),
    "what is on the autopilot's CAN bus": (said(common.MAVLink_can_frame_message(0, 0, 0, 8, 0x1234, b"12345678")), False, False),
    "where it is": (said(common.MAVLink_gps_input_message(1, 0, 0, 1, 1, 3, 1, 1, 1, 1, 1, 0, 0, 0, 1, 1, 1, 9)), False, False),
    "where some sensor sees it": (said(common.MAVLink_global_position_sensor_message(0, 0, 0, 1, 0, 1, 0, 1, 1, 1, 1, 1, 1)), False, False),
    "where a camera sees it": (said(common.MAVLink_vision_position_estimate_message(1, 1, 1, 1, 0, 0, 0)), False, False),
    "what its receiver's port is to say": (said(common.MAVLink_gps_inject_data_message(0, 0, 2, b"\xb5\x62" + bytes(108))), False, False),
    "how the ground goes by below it": (said(common.MAVLink_optical_flow_rad_message(1, 0, 1, 1, 1, 0, 0, 0, 0, 255, 1, 1)), False, False),
    "corrections, if they are some": (said(common.MAVLink_gps_rtcm_data_message(0, 2, b"\xb5\x62" + bytes(178))), False, False),
    "where it began": (said(common.MAVLink_set_gps_global_origin_message(0, 1, 1, 1)), False, False),
    "that the receivers are off, by a switch": (command(218, 65), False, False),
    "such a switch in MAVLink 1": (command(218, 65, version=1), False, False),
    "another command with that number": (command(400, 65), True, False),
    **{f"command {number}, by {form.msgname}": (command(number, form=form), False, False) for number in SHUT_COMMANDS for form in FORMS},
    "a command that isn't shut": (command(43005), True, False),
    "the same by COMMAND_INT": (command(43005, 1, form=common.MAVLink_command_int_message), True, False),
    "such a command as its transmitter": (command(32000, who=TRANSMITTER), False, True),
    "another system id": (parameter("SYSID_THISMAV"), False, False),
    "the same in MAVLink 1": (parameter("MAV_SYSID", version=1), False, False),
    "the same, as ArduPilot reads it": (parameter("sysid_Thismav"), False, False),
    "PX4's": (parameter("MAV_SYS_ID"), False, False),
    "all parameters as at first, ArduPilot's": (parameter("FORMAT_VERSION"), False, False),
    "the same, of older ones": (parameter("sysid_sw_mrev"), False, False),
    "the same, PX4's": (parameter("SYS_AUTOCONFIG"), False, False),
    "PX4's component": (parameter("MAV_COMP_ID"), False, False),
    "another parameter": (parameter("SYSID_MYGCS"), True, False),
    "as another autopilot": (heartbeat(FOREIGN), False, False),
    "signed": (heartbeat_with(1, STATION), True, False),
    "signed, as its transmitter": (heartbeat_with(1, TRANSMITTER), False, True),
    "a flag that nobody knows": (heartbeat_with(2, STATION), False, False),
    "the same, signed": (heartbeat_with(3, STATION), False, False),
    "that flag as its transmitter": (heartbeat_with(2, TRANSMITTER), False, False),
    "a message that nobody knows": (crafted(STATION, flags=0), False, False),
    "one in MAVLink 1": (bytes([0xFE, 3, 0, *STATION, 3]) + b"abc" + b"xx", False, False),
    "both": (crafted(STATION), False, False),
    "both as the vehicle": (crafted(VEHICLE), False, False),
    "both as the transmitter": (crafted(TRANSMITTER), False, False),
}


# The ground station's, as the appliance has them.
STATION_S = "".join(re.findall("^Block.*\n", Path("overlay/etc/mavlink-router/ground-station.conf.in").read_text(), re.M)).replace("@VEHICLE@", "1")


# What the ground station may say of the dialect ardupilotmega, each looked at for what an autopilot does with it: none has it say
# another place of its own, or another time, or hear its receivers no more.
MESSAGES = (
    "0-1 4-8 11 20-47 49-51 54-55 61-67 69-70 73-77 80-87 89 91-93 105 108 110-112 116-122 124-125 127-131 133-137 139-144 146-148 150 152-158 "
    "160-165 167-186 191-195 200-201 214-219 225-226 230-231 234-235 241-254 257-271 275-277 280-288 290-291 299-301 "
    "310-311 320-324 330 332-336 339-340 345 350 360-361 370-373 375-376 380 385 390 395-397 400-401 410-413 435-437 440 "
    "9000 9005 10001-10008 10151 11001 11003-11005 11010 11020 11030-11044 11060 12900-12905 12915 12919-12920 42000-42001 "
    "50001-50005 52000-52001 "
)


def numbers(ranges):
    return {number for one in ranges.split() for low, _, high in [one.partition("-")] for number in range(int(low), int(high or low) + 1)}


def test_each_message_and_command_that_there_is_was_judged():
    """A new message said a place in the receivers' stead (GLOBAL_POSITION_SENSOR), and new commands switched them off or turned the
    aircraft (43006 and 620, of dialects that PX4 has and mavlink-router hasn't)."""
    shut = {int(number) for number in re.search("BlockMsgIdIn = (.*)", STATION_S)[1].split(",")}
    assert not shut & numbers(MESSAGES) and set(ardupilotmega.mavlink_map) <= shut | numbers(MESSAGES)
    router, relay = (re.findall(r"\{(\d+), (\d+)\}", path.read_text()) for path in (PATCH, SOURCE))
    judged = {number for low, high in router for number in range(int(low), int(high) + 1)}
    assert router == relay and not judged & set(SHUT_COMMANDS)
    known = {number for number, entry in ardupilotmega.enums["MAV_CMD"].items() if "ENUM_END" not in entry.name}
    assert known <= judged | set(SHUT_COMMANDS)


@pytest.fixture(scope="module", name="program", params=["relay", "mavlink-router"])
def either(request):
    if request.param == "relay":
        return request.getfixturevalue("relay")
    if not REAL:
        pytest.skip("mavlink-router isn't installed, and MAVLINK_ROUTERD=<program> names none")
    return Path(REAL)


def test_what_each_side_may_say(program, tmp_path):
    line = Line(program, tmp_path, keys=(STATION_S, "AllowSrcCompIn = 236\n"))
    try:
        addresses = line.addresses()
        for number, (what, (octets, *passes)) in enumerate(RULES.items(), 1):
            for speaker, listener, wanted in ((0, 1, passes[0]), (1, 0, passes[1])):
                # It always passes: what came before it has been decided.
                mark = heartbeat((STATION, TRANSMITTER)[speaker], number=number)
                line.peers[speaker].sendto(octets, addresses[speaker])
                line.peers[speaker].sendto(mark, addresses[speaker])
                heard = drained(line.peers[listener], mark)
                assert (octets in heard) == wanted, (what, f"from peer {speaker}")
    finally:
        line.close()


def around(inner, flags, message, crc_extra=0):
    """A frame of the ground station's with another one inside."""
    head = bytes([len(inner), flags, 0, 0, *STATION]) + message.to_bytes(3, "little")
    crc = x25crc(head + inner + bytes([crc_extra])).crc
    return b"\xfd" + head + inner + crc.to_bytes(2, "little")


def test_nothing_that_may_not_pass_hides_in_what_does(program, heard, tmp_path):
    """MAVLink's own parser takes no frame with a flag that it doesn't know, and looks for one inside."""
    line = Line(program, tmp_path, keys=(STATION_S, ""))
    command = common.MAVLink_command_long_message
    try:
        address = line.addresses()[0]
        for number, inner in enumerate((heartbeat(VEHICLE), arm_status(TRANSMITTER), setup_signing(STATION), serial_control(STATION))):
            outer = around(inner, 2, command.id, command.crc_extra), around(inner, 2, 0xFFFFF0)
            mark = heartbeat(STATION, number=number)
            for octets in outer:
                assert heard(octets + mark) == [*heard(inner), (*STATION, 0)], "nothing hides there"
            line.peers[0].sendto(b"".join(outer) + mark, address)
            assert heard(arrived(line, mark)) == [], number
    finally:
        line.close()


def test_what_comes_behind_what_is_refused_does_not_wait(program, tmp_path):
    """Of the same datagram, for the next one."""
    line = Line(program, tmp_path)
    try:
        line.peers[0].sendto(crafted(STATION) + crafted(STATION, flags=0) + heartbeat(STATION), line.addresses()[0])
        assert arrived(line, heartbeat(STATION)) == b""
    finally:
        line.close()


@pytest.mark.parametrize("flags", [0, 2])
def test_nothing_of_an_autopilot_s_passes_that_no_checksum_vouches_for(program, tmp_path, flags):
    """Where octets are lost, what it was given by somebody (a file, by FTP) is looked into for frames: one that nobody knows, whose
    length leads to the next one of that kind, went on as long as that came."""
    line = Line(program, tmp_path)
    try:
        os.write(line.master, crafted((9, 9), flags) + heartbeat((9, 9)))
        for peer in line.peers:
            assert drained(peer, heartbeat((9, 9))) == b""
    finally:
        line.close()


def test_a_line_that_is_full_takes_whole_frames_or_none(program, tmp_path):
    """What comes behind half a frame is taken for its other half."""
    line = Line(program, tmp_path)
    try:
        address = line.addresses()[0]
        one, behind = serial_control(STATION), heartbeat(STATION)
        sent = 150_000 // len(one)
        for _ in range(sent):
            line.peers[0].sendto(one, address)
            assert line.peers[1].recv(1000) == one  # it has been passed on, as far as it could be
        octets = b""
        while select.select([line.master], [], [], 0.2)[0]:  # nothing comes any more
            octets += os.read(line.master, 100_000)
        line.peers[0].sendto(behind, address)
        octets += arrived(line, behind)
        assert len(octets) < sent * len(one), "it wasn't full"
        assert octets.replace(one, b"") == b""
    finally:
        line.close()


@pytest.mark.parametrize("uart, arrives", [("", False), ("BlockSrcCompIn = 236,237,238\n", True)], ids=["open", "blocked"])
def test_who_speaks_as_the_transmitter_by_the_autopilot_s_line_makes_that_one_unheard(program, tmp_path, uart, arrives):
    """Once, whatever it is: mavlink-router has learned then that the transmitter lives there."""
    line = Line(program, tmp_path, uart=uart)
    try:
        addresses = line.addresses()
        os.write(line.master, heartbeat(TRANSMITTER) + heartbeat((9, 9), number=201))
        drained(line.peers[1], heartbeat((9, 9), number=201))  # it was read
        line.peers[1].sendto(arm_status(TRANSMITTER) + arm_status((9, 8)), addresses[1])
        assert (arm_status(TRANSMITTER) in arrived(line, arm_status((9, 8)))) == arrives
    finally:
        line.close()


def test_who_isn_t_spoken_to_takes_nobody_s_place(program, tmp_path):
    """Whoever sent something was sent all that comes from then on, and heard as the ground station."""
    line = Line(program, tmp_path)
    try:
        address = line.addresses()[0]
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(("127.0.0.1", 0))
            for elsewhere in ("127.0.0.1", "127.0.0.2"):
                stranger.sendto(heartbeat(STATION, number=1), (elsewhere, address[1]))
            os.write(line.master, heartbeat((9, 9), number=202))
            drained(line.peers[0], heartbeat((9, 9), number=202))
            line.peers[0].sendto(heartbeat(STATION, number=2), address)
            assert arrived(line, heartbeat(STATION, number=2)) == b""
    finally:
        line.close()


def processor_s(process):
    """What it has taken so far."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_who_speaks_as_everybody_makes_no_message_dearer(program, tmp_path):
    """Who has been heard by an endpoint is asked for each message."""
    line = Line(program, tmp_path, keys=(STATION_S, ""))

    def cost_of(senders):
        before = processor_s(line.process)
        for some in zip(*[iter(senders)] * 32):
            line.peers[0].sendto(b"".join(map(heartbeat, some)), address)
            for octets in map(heartbeat, some):
                assert line.peers[1].recv(2000) == octets
        return processor_s(line.process) - before
    try:
        address = line.addresses()[0]
        everybody = [(system, component) for system in range(2, 256, 2) for component in range(2, 236)]
        by_one = cost_of([STATION] * len(everybody))
        cost_of(everybody)
        assert cost_of(everybody) < 2 * by_one
    finally:
        line.close()


def test_a_peer_that_is_not_there_costs_nothing(line):
    line.peers[1].close()
    for _ in range(5):
        os.write(line.master, FRAME1)
        assert line.peers[0].recv(1000) == FRAME1
        time.sleep(0.02)                # the refusal comes back
    assert line.process.poll() is None


def test_it_ends_when_the_line_hangs_up(line):
    os.close(line.slave)
    os.close(line.master)
    assert line.process.wait(LIMIT_S) == 1
    line.said.seek(0)
    assert b"/dev/pts/" in line.said.read()


@pytest.mark.parametrize("text, said", [
    ("[TcpEndpoint x]\n", b"TcpEndpoint x"),
    ("[General]\nTcpServerPort = 5760\n", b"TcpServerPort"),
    ("[UdpEndpoint x]\nMode = Sideways\n", b"Sideways"),
    ("[UdpEndpoint x]\nPort = 99999\n", b"99999"),
    ("[UartEndpoint x]\nDevice = /dev/null\nBaud = 12345\n", b"/dev/null"),
    ("[General]\n", b"no serial device"),
    ("rubbish\n", b"rubbish"),
])
def test_it_refuses_what_it_cannot_do(relay, tmp_path, text, said):
    path = tmp_path / "wrong.conf"
    path.write_text(text)
    result = subprocess.run([relay, "-c", path], capture_output=True, timeout=LIMIT_S, check=False)
    assert result.returncode == 1
    assert said in result.stderr


def test_the_port_may_be_named_on_the_command_line(relay, tmp_path):
    result = subprocess.run([relay, "/dev/no:such:port:57600"], capture_output=True, timeout=LIMIT_S,
                            check=False)
    assert result.returncode == 1
    assert b"/dev/no:such:port: No such file" in result.stderr
