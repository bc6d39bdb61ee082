"""Plays a .tlog in real time to the daemon, as an autopilot on UDP or on a serial line.

Every frame goes out as it was recorded, at an absolute deadline; what matters to the judge
is logged as JSON lines, and so is everything that the daemon sends back.  The whole log is
parsed beforehand.  PYTHONPATH holds the folder tests.
"""

import argparse
import json
import os
import pty
import select
import signal
import socket
import struct
import sys
import threading
import time
import tty
from dataclasses import dataclass
from pathlib import Path

from pymavlink.dialects.v20 import common

from host.realtime import raise_process

STAMP = struct.Struct(">Q")
FOLLOWS_WITHIN_US = 86_400_000_000  # a stamp further from the one before is no stamp
WAKE_S = 0.1  # how often a stop event is looked at
LAST_ANSWERS_S = 0.2
LOGGED = {"HEARTBEAT", "SYSTEM_TIME", "GLOBAL_POSITION_INT", "GPS_RAW_INT", "HOME_POSITION", "EXTENDED_SYS_STATE"}


@dataclass
class Frame:
    after_s: float  # the log's first frame
    octets: bytes
    logged: str | None  # the end of its line in the log of what was played


def _fields(message):
    """By MAVLink's names. HEARTBEAT's own field `type` becomes `mav_type`: `type` is the message."""
    fields = message.to_dict()
    fields.pop("mavpackettype")
    if "type" in fields:
        fields["mav_type"] = fields.pop("type")
    return fields


def _line_end(kind, fields):
    return json.dumps({"type": kind, **fields}, default=list)[1:] + "\n"


def _line(end):
    return f'{{"time": {time.time():.6f}, "mono": {time.monotonic():.6f}, {end}'


def _frame_length(log, at):
    """Of the MAVLink 1 or 2 frame there; None when there is none, or not all of it."""
    length = None
    if log[at:at + 1] == b"\xfe" and at + 2 <= len(log):
        length = 8 + log[at + 1]
    elif log[at:at + 1] == b"\xfd" and at + 3 <= len(log):
        length = 12 + log[at + 1] + (13 if log[at + 2] & 1 else 0)  # signed
    return length if length is not None and at + length <= len(log) else None


def _logged(octets, parser):
    try:
        message = parser.decode(bytearray(octets))
    except common.MAVError:
        return None  # another dialect, or damaged: it is sent all the same
    kind = message.get_type()
    if kind not in LOGGED and not kind.startswith("OPEN_DRONE_ID_"):
        return None
    return _line_end(kind, _fields(message))


def read_flight(path):
    """All frames of a .tlog; octets that are no stamp and frame are skipped."""
    log, parser = Path(path).read_bytes(), common.MAVLink(None)
    frames, at, first_us, before_us = [], 0, None, None
    while at + STAMP.size < len(log):
        stamp_us, length = STAMP.unpack_from(log, at)[0], _frame_length(log, at + STAMP.size)
        if length is None or before_us is not None and abs(stamp_us - before_us) > FOLLOWS_WITHIN_US:
            at += 1
            continue
        if first_us is None:
            first_us = stamp_us
        octets = log[at + STAMP.size:at + STAMP.size + length]
        frames.append(Frame((stamp_us - first_us) / 1e6, octets, _logged(octets, parser)))
        before_us, at = stamp_us, at + STAMP.size + length
    if not frames:
        raise ValueError(f"{path}: no MAVLink frame: is it a .tlog?")
    return frames


class UdpPort:
    def __init__(self, host, port):
        self._to = (socket.gethostbyname(host), port)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def fileno(self):
        return self._socket.fileno()

    def send(self, octets):
        """Whether the frame went out."""
        try:
            return self._socket.sendto(octets, self._to) == len(octets)
        except BlockingIOError:
            return False

    def receive(self):
        return self._socket.recv(65536)

    def close(self):
        self._socket.close()


class SerialPort:
    """A pseudo-terminal: the daemon opens the link to its slave side as a serial device."""

    def __init__(self, link):
        self._link = Path(link)
        if self._link.is_symlink():
            self._link.unlink()
        self._master, self._slave = pty.openpty()  # the slave stays open: no hang-up while nobody reads
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._target = os.ttyname(self._slave)
        self._link.symlink_to(self._target)

    def fileno(self):
        return self._master

    def send(self, octets):
        """Whether the frame went out: a line that nobody reads fills, and then loses octets."""
        try:
            return os.write(self._master, octets) == len(octets)
        except BlockingIOError:
            return False

    def receive(self):
        return os.read(self._master, 4096)

    def close(self):
        if self._link.is_symlink() and os.readlink(self._link) == self._target:
            self._link.unlink()
        os.close(self._master)
        os.close(self._slave)


def open_port(to):
    kind, _, rest = to.partition(":")
    if kind == "serial" and rest:
        return SerialPort(rest)
    host, _, port = rest.rpartition(":")
    if kind == "udp" and host and port.isdigit() and 0 < int(port) < 65536:
        return UdpPort(host, int(port))
    raise ValueError(f"expected udp:HOST:PORT or serial:PATH, not {to}")


class Player:
    """Plays frames to a port. `lost` counts those that the port didn't take."""

    def __init__(self, frames, port, played, answers=None, stop=None):
        self.frames, self.port, self.played, self.answers = frames, port, played, answers
        self.stop = stop or threading.Event()
        self.sent = self.lost = 0
        self._parser = common.MAVLink(None)
        self._parser.robust_parsing = True

    def play(self, start_s=0.0, seconds=None):
        """Until the log's end, `seconds` have passed, or the stop event."""
        began = time.monotonic()
        for frame in self.frames:
            at_s = frame.after_s - start_s
            if at_s < 0:
                continue
            if seconds is not None and at_s > seconds:
                break
            if not self._wait(began + at_s):
                return
            self._send(frame)
        self._wait(time.monotonic() + LAST_ANSWERS_S if seconds is None else
                   min(began + seconds, time.monotonic() + LAST_ANSWERS_S))

    def _send(self, frame):
        begin = _line(frame.logged) if frame.logged else None  # stamped before the daemon can have it
        if not self.port.send(frame.octets):
            self.lost += 1
            return
        self.sent += 1
        if begin:
            self.played.write(begin)

    def _wait(self, deadline):
        """Takes answers until then; False when the stop event is set."""
        while not self.stop.is_set():
            left_s = deadline - time.monotonic()
            if left_s <= 0:
                return True
            if select.select([self.port], [], [], min(left_s, WAKE_S))[0]:
                self._take(self.port.receive())
        return False

    def _take(self, octets):
        for message in self._parser.parse_buffer(octets) or ():
            if self.answers is None:
                continue
            origin = {} if message.get_type() == "BAD_DATA" else {
                "system": message.get_srcSystem(), "component": message.get_srcComponent()}
            self.answers.write(_line(_line_end(message.get_type(), {**origin, **_fields(message)})))


def main():
    parser = argparse.ArgumentParser(prog="player.py", description=__doc__.splitlines()[0])
    parser.add_argument("flight", type=Path, metavar="FLIGHT")
    parser.add_argument("--to", required=True, metavar="WHERE", help="udp:HOST:PORT or serial:PATH")
    parser.add_argument("--played", default=os.devnull, metavar="FILE", help="what was sent (JSON lines)")
    parser.add_argument("--answers", default=os.devnull, metavar="FILE", help="what came back (JSON lines)")
    parser.add_argument("--seconds", type=float, metavar="N", help="play this long (default: to the end)")
    parser.add_argument("--start", type=float, default=0, metavar="S", help="skip the log's first seconds")
    arguments = parser.parse_args()
    stop = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stop.set())
    try:
        frames = read_flight(arguments.flight)
        port = open_port(arguments.to)
    except (OSError, ValueError) as error:
        parser.error(str(error))
    if not raise_process(0):
        print("player: real-time priority is refused", file=sys.stderr)
    try:
        with open(arguments.played, "w", buffering=1) as played, open(arguments.answers, "w", buffering=1) as answers:
            player = Player(frames, port, played, answers, stop)
            player.play(arguments.start, arguments.seconds)
    except OSError as error:
        sys.exit(f"player: {error}")
    finally:
        port.close()
    print(f"player: {player.sent} frames sent, {player.lost} lost", file=sys.stderr)


if __name__ == "__main__":
    main()
