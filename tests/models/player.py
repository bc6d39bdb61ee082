"""Plays a telemetry log (.tlog) at real speed, byte for byte, and keeps what comes back.

A command is answered as an autopilot that can't do it now (MAV_RESULT_FAILED), so that it is known to hear. The answer has a
number of its sender's, and what is played of that one after it has the next ones.

`--to udp:ADDRESS:PORT` sends datagrams, `serial:PATH` writes to a device, `pty:PATH` makes a pty
with a link at that path, `unix:PATH` connects to a UNIX socket, which is the serial line of an
emulated machine. At the log's end it is silent, as an autopilot that was switched off, and stays until it is ended.

Orders, one a line on standard input, each answered by "done" or "error: ...":
  pause | resume     an autopilot that falls silent; the log's time goes on meanwhile
  unplug | plug      the pty vanishes and comes back (pty: only)
"""

import argparse
import json
import os
import select
import socket
import sys
import termios
import time
import tty
from collections import Counter
from pathlib import Path

from pymavlink.dialects.v20 import common

from . import tlog
from .orders import Orders

# What the judge compares the air with.
KEPT = ("HEARTBEAT", "SYSTEM_TIME", "GLOBAL_POSITION_INT", "GPS_RAW_INT", "GPS2_RAW", "HOME_POSITION",
        "EXTENDED_SYS_STATE")
KEPT_PREFIX = "OPEN_DRONE_ID_"
AUTOPILOT = 1  # its component


class Udp:
    """A sender with a port of its own, as an autopilot's router has."""

    def __init__(self, address, port):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect((address, port))
        self._socket.setblocking(False)

    def fileno(self):
        return self._socket.fileno()

    def send(self, frame):
        try:
            self._socket.send(frame)
        except (ConnectionRefusedError, BlockingIOError):
            return False  # nobody listens there (yet)
        return True

    def receive(self):
        try:
            return self._socket.recv(65536)
        except (ConnectionRefusedError, BlockingIOError):
            return b""


class Unix:
    """An emulated serial line. Little is in flight in it: what the machine doesn't read in time is
    lost, as on a wire."""

    IN_FLIGHT = 4096

    def __init__(self, path):
        self._socket = socket.socket(socket.AF_UNIX)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self.IN_FLIGHT)
        self._socket.connect(path)
        self._socket.setblocking(False)

    def fileno(self):
        return self._socket.fileno()

    def send(self, frame):
        try:
            return self._socket.send(frame) == len(frame)
        except BlockingIOError:
            return False  # nobody reads, and the line is full

    def receive(self):
        try:
            data = self._socket.recv(65536)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionError("the machine has ended")
        return data


class Serial:
    """A device, or a pty of our own."""

    BAUD = termios.B921600

    def __init__(self, path, make):
        self.path, self.make = path, make
        self.fd = -1
        self.plug()

    def plug(self):
        if self.fd >= 0:
            raise ValueError("it is plugged in")
        if self.make:
            self.fd, self._slave = os.openpty()  # held open: the reader may come and go
            tty.setraw(self._slave)
            os.fchmod(self._slave, 0o666)
            fresh = self.path + ".new"
            os.symlink(os.ttyname(self._slave), fresh)
            os.replace(fresh, self.path)
        else:
            self.fd = os.open(self.path, os.O_RDWR | os.O_NOCTTY)
            tty.setraw(self.fd)
            modes = termios.tcgetattr(self.fd)
            modes[4] = modes[5] = self.BAUD
            termios.tcsetattr(self.fd, termios.TCSANOW, modes)
        os.set_blocking(self.fd, False)

    def unplug(self):
        if not self.make or self.fd < 0:
            raise ValueError("nothing of ours is plugged in")
        os.unlink(self.path)
        os.close(self.fd)
        os.close(self._slave)
        self.fd = -1

    def fileno(self):
        return self.fd

    def send(self, frame):
        if self.fd < 0:
            return False
        try:
            return os.write(self.fd, frame) == len(frame)
        except BlockingIOError:
            return False  # nobody reads, and the line is full

    def receive(self):
        try:
            return os.read(self.fd, 65536)
        except BlockingIOError:
            return b""


def open_end(text):
    kind, _, rest = text.partition(":")
    if kind == "udp":
        address, _, port = rest.rpartition(":")
        if not address or not port.isdigit():
            raise ValueError(f"{text!r}: expected udp:ADDRESS:PORT")
        return Udp(address, int(port))
    if kind in ("serial", "pty") and rest:
        return Serial(rest, make=kind == "pty")
    if kind == "unix" and rest:
        return Unix(rest)
    raise ValueError(f"{text!r}: expected udp:ADDRESS:PORT, serial:PATH, pty:PATH or unix:PATH")


def prepare(path, start_s, seconds):
    """(seconds from the beginning, frame, record or None) for what is to be played."""
    frames = tlog.read(path)
    if frames.damaged_parts:
        print(f"player: {path}: {frames.damaged_parts} damaged parts ({frames.damaged_octets} octets) are left out",
              file=sys.stderr)
    first_s = frames[0][0] + start_s
    decoder, prepared, at_s = tlog.Decoder(), [], 0.0
    for time_s, frame in frames:
        if time_s < first_s or (seconds is not None and time_s > first_s + seconds):
            continue
        record = None
        for message in decoder.messages(frame):
            name = message.get_type()
            if name in KEPT or name.startswith(KEPT_PREFIX):
                record = tlog.as_record(message)
        at_s = max(at_s, time_s - first_s)  # a stamp that goes back doesn't hold the player up
        prepared.append((at_s, frame, record))
    if not prepared:
        raise tlog.LogError(f"{path}: nothing to play from {start_s:g} s on")
    return prepared


class JsonLines:
    def __init__(self, path):
        self._file = open(path, "w", buffering=1, encoding="utf-8") if path else None

    def write(self, mono, record):
        if self._file:
            stamped = {"time": time.time() + mono - time.monotonic(), "mono": mono, **record}
            self._file.write(json.dumps(stamped) + "\n")


class Player:
    def __init__(self, prepared, end, played, answers):
        self.prepared, self.end = prepared, end
        self.played, self.answers = JsonLines(played), JsonLines(answers)
        self.decoder = tlog.Decoder()
        self.paused = False
        self.numbers = {}  # (system, component): its last number
        self.answered = Counter()  # and how many answers of it came before that
        self.orders, self.has_orders = Orders(self.obey), True

    def obey(self, words):
        if words in (["pause"], ["resume"]):
            self.paused = words == ["pause"]
        elif words in (["unplug"], ["plug"]) and isinstance(self.end, Serial):
            getattr(self.end, *words)()
        else:
            raise ValueError(f"unknown order {' '.join(words)!r}")

    def on_order(self):
        self.has_orders = self.orders.take()

    def on_answer(self):
        mono = time.monotonic()
        for message in self.decoder.messages(self.end.receive()):
            self.answers.write(mono, tlog.as_record(message))
            if message.get_type() == "COMMAND_LONG":
                self.answer(message)

    def answer(self, command):
        sender = command.target_system, AUTOPILOT
        if self.paused or sender not in self.numbers:
            return
        link = common.MAVLink(None, *sender)
        link.seq = self.numbers[sender] = (self.numbers[sender] + 1) & 0xFF
        self.answered[sender] += 1
        self.end.send(common.MAVLink_command_ack_message(
            command.command, common.MAV_RESULT_FAILED, 0, 0, command.get_srcSystem(), command.get_srcComponent()).pack(link))

    def send(self, frame):
        sender = tlog.sender(frame)
        frame = tlog.renumbered(frame, self.answered[sender])
        self.numbers[sender] = tlog.number(frame)
        return self.end.send(frame)

    def wait(self, until):
        """Listens until then (None: for ever)."""
        while until is None or time.monotonic() < until:
            watched = [sys.stdin.fileno()] if self.has_orders else []
            if self.end.fileno() >= 0:
                watched.append(self.end)
            left = None if until is None else max(0.0, until - time.monotonic())
            ready, _, _ = select.select(watched, [], [], left)
            if self.end in ready:
                self.on_answer()
            if sys.stdin.fileno() in ready:
                self.on_order()

    def run(self):
        start = time.monotonic()
        for at_s, frame, record in self.prepared:
            self.wait(start + at_s)
            mono = time.monotonic()
            # What nobody could receive wasn't played.
            if not self.paused and self.send(frame) and record:
                self.played.write(mono, record)
        print(f"played {len(self.prepared)} frames in {time.monotonic() - start:.1f} s",
              file=sys.stderr, flush=True)
        self.paused = True
        self.wait(None)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("log", type=Path)
    parser.add_argument("--to", required=True, help="udp:ADDRESS:PORT, serial:PATH, pty:PATH or unix:PATH")
    parser.add_argument("--start", type=float, default=0.0, help="seconds into the log")
    parser.add_argument("--seconds", type=float, help="how much of it")
    parser.add_argument("--played", help="JSON lines of what was sent")
    parser.add_argument("--answers", help="JSON lines of what came back")
    arguments = parser.parse_args()
    try:
        prepared = prepare(arguments.log, arguments.start, arguments.seconds)
        end = open_end(arguments.to)
    except (OSError, ValueError) as error:
        print(f"player: {error}", file=sys.stderr)
        return 2
    try:
        Player(prepared, end, arguments.played, arguments.answers).run()
    except KeyboardInterrupt:
        return 130
    except ConnectionError as error:
        print(f"player: {arguments.to}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
