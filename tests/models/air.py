"""What is on the air, for tests: a light scanner on rootcanal, and the beacons in a growing pcap.

The judge (tests/judge) decides what is right; this one only says what was heard and when. It
keeps Service Data of Open Drone ID (Bluetooth) and its vendor element (Wi-Fi), undecoded.
"""

import socket
import struct
import threading
import time
from collections import namedtuple
from pathlib import Path

import patience

from .front import COMMAND_COMPLETE, EVENT, Packets

# data: from the application code on, that is 0x0D, counter, message or pack; mono: time.monotonic()
Reception = namedtuple("Reception", "mono channel address data")

RESET, SET_EVENT_MASK, LE_SET_EVENT_MASK = 0x0C03, 0x0C01, 0x2001
SET_EXTENDED_SCAN_PARAMETERS, SET_EXTENDED_SCAN_ENABLE = 0x2041, 0x2042
LE_META, EXTENDED_REPORT = 0x3E, 0x0D
LEGACY_PDU, INCOMPLETE = 1 << 4, 0x60  # bits of a report's event type
INTERVAL_10_MS = 0x0010
SCAN_1M_AND_CODED = 0x05
SERVICE_DATA = bytes([0x16, 0xFA, 0xFF])  # AD type, UUID 0xFFFA
VENDOR_ELEMENT = bytes([0xFA, 0x0B, 0xBC])  # the OUI of ASD-STAN
PCAP_HEADER, PCAP_RECORD = 24, 16
PACK = 0xF
ALL_FIVE = {0, 1, 3, 4, 5}
FIXED_FIELDS = 24 + 12  # of a beacon: MAC header, time stamp, interval, capabilities


def service_data(data):
    """The Open Drone ID element of an advertisement, from its application code on, or None."""
    at = 0
    while at + 1 < len(data) and data[at]:
        body = data[at + 1:at + 1 + data[at]]
        if body.startswith(SERVICE_DATA):
            return body[len(SERVICE_DATA):]
        at += 1 + data[at]
    return None


def extended_reports(event):
    """(event type, address, data) of an LE Extended Advertising Report event, as H4 packet."""
    at = 5
    for _ in range(event[4]):
        kind, address = int.from_bytes(event[at:at + 2], "little"), event[at + 3:at + 9]
        length = event[at + 23]
        yield kind, address[::-1].hex(":").upper(), event[at + 24:at + 24 + length]
        at += 24 + length


class Scanner:
    """A controller of its own on rootcanal's air, scanning both PHYs all the time."""

    def __init__(self, hci_port):
        self.receptions = []
        self._incomplete = {}  # address -> data so far
        self._packets = Packets()
        self._socket = socket.create_connection(("127.0.0.1", hci_port), timeout=patience.LIMIT_S)
        self._command(RESET)
        self._command(SET_EVENT_MASK, b"\xff" * 8)
        self._command(LE_SET_EVENT_MASK, b"\xff" * 8)
        one_phy = struct.pack("<BHH", 0, INTERVAL_10_MS, INTERVAL_10_MS)  # passive, all the time
        self._command(SET_EXTENDED_SCAN_PARAMETERS, bytes([0, 0, SCAN_1M_AND_CODED]) + one_phy * 2)
        self._command(SET_EXTENDED_SCAN_ENABLE, bytes([1, 0, 0, 0, 0, 0]))
        self._socket.settimeout(None)
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _command(self, opcode, parameters=b""):
        self._socket.sendall(struct.pack("<BHB", 1, opcode, len(parameters)) + parameters)
        while True:
            for packet in self._packets.feed(self._socket.recv(4096)):
                if packet[1] == COMMAND_COMPLETE and packet[4] | packet[5] << 8 == opcode:
                    if packet[6] != 0:
                        raise RuntimeError(f"scanner: 0x{opcode:04x} was answered 0x{packet[6]:02x}")
                    return

    def _listen(self):
        try:
            while data := self._socket.recv(65536):
                mono = time.monotonic()
                for packet in self._packets.feed(data):
                    if packet[0] == EVENT and packet[1] == LE_META and packet[3] == EXTENDED_REPORT:
                        self._take(mono, packet)
        except OSError:
            return  # closed by stop(), or rootcanal has ended: nothing more to hear

    def _take(self, mono, packet):
        for kind, address, data in extended_reports(packet):
            data = self._incomplete.pop(address, b"") + data
            if kind & INCOMPLETE == 1 << 5:  # more is to come
                self._incomplete[address] = data
                continue
            payload = service_data(data)
            if payload is not None:
                channel = "bt4" if kind & LEGACY_PDU else "bt5"
                self.receptions.append(Reception(mono, channel, address, bytes(payload)))

    def stop(self):
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()


def beacon_payloads(packet):
    """(BSSID, Open Drone ID payload) of each such element of a beacon behind a radiotap header; more than one is a fault."""
    frame = packet[int.from_bytes(packet[2:4], "little"):]
    at = FIXED_FIELDS if frame[:1] == b"\x80" else len(frame)
    while at + 1 < len(frame):
        body = frame[at + 2:at + 2 + frame[at + 1]]
        if frame[at] == 221 and body.startswith(VENDOR_ELEMENT):
            yield frame[16:22].hex(":").upper(), body[len(VENDOR_ELEMENT):]
        at += 2 + frame[at + 1]


def beacons(path):
    """The receptions in a pcap so far; it may be growing."""
    data = Path(path).read_bytes() if Path(path).exists() else b""
    to_mono_s, at, found = time.monotonic() - time.time(), PCAP_HEADER, []
    while at + PCAP_RECORD <= len(data):
        seconds, micros, length, _ = struct.unpack_from("<IIII", data, at)
        packet = data[at + PCAP_RECORD:at + PCAP_RECORD + length]
        if len(packet) < length:
            break
        found += [Reception(seconds + micros / 1e6 + to_mono_s, "wifi", *heard) for heard in beacon_payloads(packet)]
        at += PCAP_RECORD + length
    return found


class Air:
    """All channels. Listens from the beginning to stop()."""

    def __init__(self, hci_port, pcap=None):
        self._scanner, self._pcap = Scanner(hci_port), pcap

    def receptions(self, channel, since_mono=0.0, until_mono=float("inf")):
        """What was heard on bt4, bt5 or wifi in that span of time.monotonic(), in order."""
        if channel not in ("bt4", "bt5", "wifi"):
            raise ValueError(f"no channel {channel!r}: bt4, bt5 or wifi")
        everything = beacons(self._pcap) if channel == "wifi" else list(self._scanner.receptions)
        return [one for one in everything
                if one.channel == channel and since_mono <= one.mono < until_mono]

    def heard(self, channel, seconds):
        """Listens from now on for so long."""
        since_mono = time.monotonic()
        time.sleep(seconds)
        return self.receptions(channel, since_mono)

    def types(self, channel, since_mono=0.0):
        """Which types of message, alone or in a pack: 0 Basic ID, 1 Location, 3 Self ID, 4 System, 5 Operator ID."""
        found = set()
        for one in self.receptions(channel, since_mono):
            body = one.data[2:]
            first = range(3, len(body), 25) if body[0] >> 4 == PACK else (0,)
            found |= {body[at] >> 4 for at in first}
        return found

    def wait_all_five(self, channels, since_mono=None, limit_s=patience.LIMIT_S):
        """Until each message was heard on each channel; from now on, or since an instant."""
        since_mono = time.monotonic() if since_mono is None else since_mono
        for channel in channels:
            patience.wait_for(f"all five messages on {channel}",
                              lambda channel=channel: self.types(channel, since_mono) >= ALL_FIVE, limit_s=limit_s)

    def stop(self):
        self._scanner.stop()
