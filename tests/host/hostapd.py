"""A model of hostapd: its control socket, and the beacons of its access point in a pcap file.

It answers what the daemon asks (PING, STATUS, SET vendor_elements, UPDATE_BEACON) and adds a
beacon to the file every 102.4 ms.  A line on standard input is an order, answered with a
line: `fail N` (the next N SETs fail), `mute`, `unmute` (no answers), `disable`, `enable`
(the interface: no beacons).  PYTHONPATH holds the folder tests.
"""

import argparse
import json
import os
import select
import signal
import socket
import struct
import sys
import time
from pathlib import Path

from host.realtime import raise_process

INTERVAL_TU = 100
INTERVAL_S = INTERVAL_TU * 1024e-6
CHANNEL, FREQUENCY_MHZ = 6, 2437
BSSID = bytes.fromhex("020d1d000001")
SSID = b"remote-id"
DLT_RADIOTAP = 127
# Channel (2.4 GHz, CCK) and signal (-40 dBm) before each frame.
RADIOTAP = struct.pack("<BBHIHHb", 0, 0, 13, 1 << 3 | 1 << 5, FREQUENCY_MHZ, 0x00a0, -40)
PCAP_HEADER = struct.pack("<IHHiIII", 0xa1b2c3d4, 2, 4, 0, 0, 65535, DLT_RADIOTAP)
CAPABILITIES = 0x0411  # ESS, privacy, short slots
RATES = bytes((0x82, 0x84, 0x8b, 0x96, 0x0c, 0x12, 0x18, 0x24))
# Version 1, group CCMP, one pairwise CCMP, one key management PSK, no capabilities.
RSN = bytes.fromhex("0100" "000fac04" "0100" "000fac04" "0100" "000fac02" "0000")


def element(number, value):
    return bytes((number, len(value))) + value


def elements_add_up(octets):
    """Whether each element's length leads to the next one, and the last one's to the end."""
    at = 0
    while at + 2 <= len(octets):
        at += 2 + octets[at + 1]
    return at == len(octets)


class Beacons:
    """The pcap file that grows by a beacon at a time."""

    def __init__(self, path):
        self._file = open(path, "wb", buffering=0)
        self._file.write(PCAP_HEADER)
        self._sequence = 0
        self._began = time.monotonic()

    def write(self, vendor_elements):
        now_us = time.time_ns() // 1000
        packet = RADIOTAP + self._frame(vendor_elements)
        header = struct.pack("<IIII", now_us // 1_000_000, now_us % 1_000_000, len(packet), len(packet))
        self._file.write(header + packet)
        self._sequence = (self._sequence + 1) % 4096

    def _frame(self, vendor_elements):
        header = struct.pack("<HH6s6s6sH", 0x0080, 0, b"\xff" * 6, BSSID, BSSID, self._sequence << 4)
        timer_us = round((time.monotonic() - self._began) * 1e6)
        fixed = struct.pack("<QHH", timer_us, INTERVAL_TU, CAPABILITIES)
        traffic = bytes((self._sequence % 2, 2, 0, 0))  # DTIM count, period; no traffic
        return header + fixed + (element(0, SSID) + element(1, RATES) + element(3, bytes((CHANNEL,)))
                                 + element(5, traffic) + element(48, RSN) + vendor_elements)

    def close(self):
        self._file.close()


class Hostapd:
    """The state behind the control socket."""

    def __init__(self, set_log=None):
        self.enabled, self.muted, self.failures_due = True, False, 0
        self.set_elements = self.active_elements = b""
        self._set_log = set_log

    def answer(self, request):
        if request == "PING":
            return "PONG\n"
        if request == "STATUS":
            state = "ENABLED" if self.enabled else "DISABLED"
            return (f"state={state}\nphy=phy0\nfreq={FREQUENCY_MHZ}\nchannel={CHANNEL}\n"
                    f"beacon_int={INTERVAL_TU}\nbssid[0]={BSSID.hex(':')}\nssid[0]={SSID.decode()}\n")
        if request == "UPDATE_BEACON":
            self._update()
            return "OK\n"
        if request.startswith("SET "):
            return "OK\n" if self._set(*request[4:].partition(" ")[::2]) else "FAIL\n"
        return "UNKNOWN COMMAND\n"

    def _set(self, name, value):
        if self.failures_due:
            self.failures_due -= 1
            return False
        if name != "vendor_elements" or any(letter.isspace() for letter in value):
            return False
        try:
            octets = bytes.fromhex(value)
        except ValueError:
            return False
        if not elements_add_up(octets):
            return False
        self.set_elements = octets
        return True

    def _update(self):
        self.active_elements = self.set_elements
        if self._set_log and self.enabled:
            record = {"time": time.time(), "mono": time.monotonic(), "opcode": "UPDATE_BEACON",
                      "channel": "wifi", "data": self.active_elements.hex()}
            self._set_log.write(json.dumps(record) + "\n")

    def order(self, line):
        """Follows an order; returns the line that answers it."""
        words = line.split()
        if len(words) == 2 and words[0] == "fail" and words[1].isdigit():
            self.failures_due = int(words[1])
        elif words in (["mute"], ["unmute"]):
            self.muted = words == ["mute"]
        elif words in (["disable"], ["enable"]):
            self.enabled = words == ["enable"]
        else:
            return f"error: expected fail N, mute, unmute, disable or enable, not {line!r}"
        return "done"


class Control:
    """The datagram socket DIR/IFACE."""

    def __init__(self, folder, iface):
        folder.mkdir(parents=True, exist_ok=True)
        self._path = folder / iface
        if self._path.is_socket():
            self._path.unlink()  # stale
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.bind(str(self._path))
        self._inode = self._path.stat().st_ino

    def fileno(self):
        return self._socket.fileno()

    def serve(self, hostapd):
        octets, client = self._socket.recvfrom(8192)
        if hostapd.muted:
            return
        answer = hostapd.answer(octets.decode("ascii", "replace").rstrip("\n\0"))
        if not client:
            return  # it has no address to answer to
        try:
            self._socket.sendto(answer.encode(), client)
        except (FileNotFoundError, ConnectionRefusedError, BlockingIOError) as error:
            print(f"hostapd: an answer was lost: {error}", file=sys.stderr, flush=True)

    def close(self):
        self._socket.close()
        if self._path.exists() and self._path.stat().st_ino == self._inode:
            self._path.unlink()  # ours, not a successor's


class Orders:
    """Lines on standard input, as far as there are any."""

    def __init__(self):
        self.open, self._rest = sys.stdin is not None, b""

    def fileno(self):
        return 0

    def follow(self, hostapd):
        octets = os.read(0, 4096)
        self.open = bool(octets)
        *lines, self._rest = (self._rest + octets).split(b"\n")
        for line in lines:
            print(hostapd.order(line.decode(errors="replace")), flush=True)


def run(control, orders, hostapd, beacons):
    """Answers, obeys and beacons at absolute deadlines, until an exception ends it."""
    due = time.monotonic() + INTERVAL_S
    while True:
        sources = [control, orders] if orders.open else [control]
        ready = select.select(sources, [], [], max(0.0, due - time.monotonic()))[0]
        if time.monotonic() >= due:
            if hostapd.enabled:
                beacons.write(hostapd.active_elements)
            due += INTERVAL_S * max(1, (time.monotonic() - due) // INTERVAL_S)
        if control in ready:
            control.serve(hostapd)
        if orders in ready:
            orders.follow(hostapd)


def main():
    parser = argparse.ArgumentParser(prog="hostapd.py", description=__doc__.splitlines()[0])
    parser.add_argument("--dir", required=True, type=Path, help="the folder of the control socket")
    parser.add_argument("--iface", default="wlan0", help="the interface: the control socket's name")
    parser.add_argument("--pcap", required=True, metavar="FILE", help="where the beacons go")
    parser.add_argument("--set-log", metavar="FILE", help="elements by the time they became active (JSON lines)")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    control = beacons = set_log = None
    if not raise_process(0):
        print("hostapd: real-time priority is refused", file=sys.stderr, flush=True)
    try:
        set_log = open(arguments.set_log, "w", buffering=1) if arguments.set_log else None
        beacons = Beacons(arguments.pcap)
        control = Control(arguments.dir, arguments.iface)
        run(control, Orders(), Hostapd(set_log), beacons)
    except KeyboardInterrupt:
        return 0
    except OSError as error:
        return f"hostapd: {error}"
    finally:
        for one in (control, beacons, set_log):
            if one is not None:
                one.close()


if __name__ == "__main__":
    sys.exit(main())
