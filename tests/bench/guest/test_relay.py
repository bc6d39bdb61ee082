"""The relay that stands in for mavlink-router, on this machine: a pty is its serial port."""

import os
import pty
import select
import socket
import subprocess
import time
import tty
from pathlib import Path

import pytest
from patience import LIMIT_S

SOURCE = Path(__file__).with_name("relay.c")
# A MAVLink 1 and a MAVLink 2 frame (signed: 13 octets more); what is inside doesn't matter here.
FRAME1 = bytes([0xFE, 3, 0, 1, 1, 0]) + b"abc" + b"xx"
FRAME2 = bytes([0xFD, 2, 1, 0, 0, 1, 1, 0, 0, 0]) + b"de" + b"xx" + bytes(13)


@pytest.fixture(scope="module", name="relay")
def compiled(tmp_path_factory):
    program = tmp_path_factory.mktemp("relay") / "relay"
    subprocess.run(["cc", "-O1", "-g", "-Wall", "-Wextra", "-Werror", "-std=gnu11",
                    "-fsanitize=address,undefined", "-o", program, SOURCE], check=True)
    return program


class Line:
    """The relay between a serial line and two UDP peers of this test."""

    def __init__(self, relay, folder, extra=()):
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        device = os.ttyname(self.slave)
        self.peers = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(2)]
        for peer in self.peers:
            peer.bind(("127.0.0.1", 0))
            peer.settimeout(LIMIT_S)
        endpoints = "\n".join(
            f"[UdpEndpoint peer{at}]\nMode = Normal\nAddress = 127.0.0.1\nPort = {peer.getsockname()[1]}"
            for at, peer in enumerate(self.peers))
        configuration = folder / "main.conf"
        configuration.write_text(
            f"# as mavlink-router's\n[General]\nTcpServerPort = 0\nReportStats = false\n\n"
            f"[UartEndpoint autopilot]\nDevice = {device}\nBaud = 921600,115200\n\n{endpoints}\n")
        self.process = subprocess.Popen([relay, "-c", configuration, *extra], stderr=subprocess.PIPE)
        assert b"2 UDP endpoints" in self.process.stderr.readline()

    def close(self):
        self.process.kill()
        self.process.wait()
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
    line.peers[0].sendto(FRAME2, relay_address)
    assert line.peers[1].recv(1000) == FRAME2
    assert select.select([line.master], [], [], LIMIT_S)[0]
    assert os.read(line.master, 1000) == FRAME2
    line.peers[0].settimeout(0.2)       # nothing comes
    with pytest.raises(TimeoutError):
        line.peers[0].recv(1000)        # not back to who sent it


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
    assert b"/dev/pts/" in line.process.stderr.read()


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
