"""Reads pcap, pcapng and btsnoop files, also while another program appends to them.

pcap: both byte orders, microseconds and nanoseconds.  pcapng: interface, enhanced
and simple packet blocks, the interface's own time resolution.  btsnoop: version 1,
H4 (1002) and Linux monitor (2001).  A reader hands out every complete packet it
has; on a growing file it is simply asked again.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from .receptions import InputError

MAX_PACKET_OCTETS = 262144  # more than any capture program writes: the file is damaged


@dataclass(frozen=True)
class Packet:
    time: float  # Unix seconds
    link_type: int
    data: bytes


class _Reader:
    """Common to all formats: bytes come in, complete packets go out."""

    def __init__(self, path: Path, what: str):
        self.path = path
        self.what = what
        self.file = open_binary(path)
        self.buffer = b""
        self.offset = 0  # in the file, of the buffer's first octet
        self.started = False

    def fail(self, expected: str) -> InputError:
        return InputError(f"{self.path}: octet {self.offset}: {expected}")

    def packets(self):
        """Yields the packets that are complete so far."""
        while chunk := self.file.read(1 << 20):
            self.buffer += chunk
            yield from self._drain()

    def close(self) -> None:
        self.file.close()

    def incomplete_octets(self) -> int:
        """Octets behind the last complete packet: what a killed writer left."""
        return len(self.buffer)

    def take(self, count: int) -> bytes:
        taken, self.buffer = self.buffer[:count], self.buffer[count:]
        self.offset += count
        return taken

    def _drain(self):
        if not self.started:
            if not self._start():
                return
            self.started = True
        while (record := self._record()) is not None:
            if record is not SKIPPED:
                yield record


SKIPPED = object()


class _Pcap(_Reader):
    MAGICS = {b"\xd4\xc3\xb2\xa1": ("<", 1e-6), b"\xa1\xb2\xc3\xd4": (">", 1e-6),
              b"\x4d\x3c\xb2\xa1": ("<", 1e-9), b"\xa1\xb2\x3c\x4d": (">", 1e-9)}

    def _start(self) -> bool:
        if len(self.buffer) < 24:
            return False
        self.order, self.unit_s = self.MAGICS[self.buffer[:4]]
        self.link_type = struct.unpack_from(self.order + "I", self.buffer, 20)[0] & 0x0FFFFFFF
        self.take(24)
        return True

    def _record(self):
        if len(self.buffer) < 16:
            return None
        seconds, fraction, captured, _ = struct.unpack_from(self.order + "IIII", self.buffer)
        if captured > MAX_PACKET_OCTETS:
            raise self.fail(f"expected a pcap packet, found one of {captured} octets")
        if len(self.buffer) < 16 + captured:
            return None
        data = self.take(16 + captured)[16:]
        return Packet(seconds + fraction * self.unit_s, self.link_type, data)


class _Pcapng(_Reader):
    SECTION, INTERFACE, SIMPLE, ENHANCED = 0x0A0D0D0A, 1, 3, 6

    def _start(self) -> bool:
        if len(self.buffer) < 12:
            return False
        self._section()
        return True

    def _section(self) -> None:
        magic = self.buffer[8:12]
        if magic not in (b"\x4d\x3c\x2b\x1a", b"\x1a\x2b\x3c\x4d"):
            raise self.fail(f"expected pcapng's byte order magic, found {magic.hex()}")
        self.order = "<" if magic[0] == 0x4D else ">"
        self.interfaces: list[tuple[int, float, int]] = []  # link type, time unit, time offset

    def _record(self):
        if len(self.buffer) < 12:
            return None
        if self.buffer[:4] == b"\x0a\x0d\x0d\x0a":
            self._section()
        kind, length = struct.unpack_from(self.order + "II", self.buffer)
        if length < 12 or length % 4 or length > MAX_PACKET_OCTETS + 4096:
            raise self.fail(f"expected a pcapng block, found a length of {length}")
        if len(self.buffer) < length:
            return None
        start = self.offset
        block = self.take(length)
        if struct.unpack_from(self.order + "I", block, length - 4)[0] != length:
            raise InputError(f"{self.path}: octet {start}: the pcapng block's two lengths differ")
        if kind == self.INTERFACE:
            self.interfaces.append(self._interface(block))
        elif kind == self.ENHANCED:
            interface, high, low, captured = struct.unpack_from(self.order + "IIII", block, 8)
            if interface >= len(self.interfaces) or 28 + captured > length - 4:
                raise InputError(f"{self.path}: octet {start}: damaged packet block "
                                 f"(interface {interface}, {captured} octets)")
            link_type, unit_s, offset_s = self.interfaces[interface]
            return Packet((high << 32 | low) * unit_s + offset_s, link_type, block[28:28 + captured])
        elif kind == self.SIMPLE:
            raise InputError(f"{self.path}: octet {start}: a simple packet block has no time, "
                             "so nothing can be judged by it")
        return SKIPPED

    def _interface(self, block: bytes) -> tuple[int, float, int]:
        unit_s, offset_s, at = 1e-6, 0, 16
        while at + 4 <= len(block) - 4:
            option, size = struct.unpack_from(self.order + "HH", block, at)
            value = block[at + 4:at + 4 + size]
            if option == 0:
                break
            if option == 9 and size == 1:  # if_tsresol
                unit_s = 2.0 ** -(value[0] & 0x7F) if value[0] & 0x80 else 10.0 ** -value[0]
            elif option == 14 and size == 8:  # if_tsoffset
                offset_s = struct.unpack(self.order + "q", value)[0]
            at += 4 + (size + 3) // 4 * 4
        return struct.unpack_from(self.order + "H", block, 8)[0], unit_s, offset_s


class _Btsnoop(_Reader):
    H4, MONITOR = 1002, 2001
    EPOCH_US = 0x00DCDDB30F2F8000  # 1970-01-01 in microseconds since year 0

    def _start(self) -> bool:
        if len(self.buffer) < 16:
            return False
        version, self.link_type = struct.unpack_from(">II", self.buffer, 8)
        if version != 1:
            raise self.fail(f"expected btsnoop version 1, found {version}")
        if self.link_type not in (self.H4, self.MONITOR):
            raise self.fail(f"expected btsnoop data link 1002 (H4) or 2001 (monitor), found {self.link_type}")
        self.take(16)
        return True

    def _record(self):
        if len(self.buffer) < 24:
            return None
        _, captured, flags, _, stamp_us = struct.unpack_from(">IIIIq", self.buffer)
        if captured > MAX_PACKET_OCTETS:
            raise self.fail(f"expected a btsnoop record, found one of {captured} octets")
        if len(self.buffer) < 24 + captured:
            return None
        data = self.take(24 + captured)[24:]
        if self.link_type == self.MONITOR:
            if flags & 0xFFFF != 3:  # anything but an HCI event
                return SKIPPED
            data = b"\x04" + data
        return Packet((stamp_us - self.EPOCH_US) / 1e6, self.link_type, data)


def open_binary(path: Path):
    try:
        return open(path, "rb")
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error


def open_capture(path: Path) -> _Reader:
    """A reader for a pcap or pcapng file, told apart by its first four octets."""
    with open_binary(path) as file:
        magic = file.read(4)
    if magic in _Pcap.MAGICS:
        return _Pcap(path, "pcap")
    if magic == b"\x0a\x0d\x0d\x0a":
        return _Pcapng(path, "pcapng")
    raise InputError(f"{path}: octet 0: expected a pcap or pcapng magic number, found {magic.hex() or 'nothing'}")


def open_btsnoop(path: Path) -> _Reader:
    with open_binary(path) as file:
        magic = file.read(8)
    if magic != b"btsnoop\0":
        raise InputError(f"{path}: octet 0: expected 'btsnoop', found {magic.hex() or 'nothing'}")
    return _Btsnoop(path, "btsnoop")
