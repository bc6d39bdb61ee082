"""A USB device behind QEMU's usb-redir: the device's side of the usbredir protocol, version 0.7, as far as a device with
control and bulk transfers needs it; interrupt endpoints stay silent.

QEMU is the "guest": it asks for transfers, each with an id, and the answer carries that id. Octets go in by `received`
and come out by `write`, so nothing here knows of sockets. Bulk-in requests stay open until there is something to give.

From usbredir's own description of the protocol (docs/usb-redirection-protocol.md of the usbredir project) and from what
QEMU 10 was seen to send.

raspi4b's host controller (QEMU 10, hw/usb/hcd-dwc2.c) forgets no transfer that the kernel has taken back, and ends QEMU by
an assertion when it meets it again, or one whose device is gone. So whatever makes the kernel take transfers back, a cable
that is pulled or a port that is closed, has to find none open: they end with an error right before. (Where requests never
cease, it comes right behind the answer to one: wifi_chip.py.)
"""

import asyncio
import os
import struct
import sys
from collections import deque

from .orders import Orders

# Packets, and the results in them.
(HELLO, DEVICE_CONNECT, DEVICE_DISCONNECT, RESET, INTERFACE_INFO, EP_INFO, SET_CONFIGURATION, GET_CONFIGURATION,
 CONFIGURATION_STATUS, SET_ALT_SETTING, GET_ALT_SETTING, ALT_SETTING_STATUS) = range(12)
START_INTERRUPT, STOP_INTERRUPT, INTERRUPT_STATUS = 15, 16, 17
CANCEL_DATA, DEVICE_DISCONNECT_ACK = 21, 24
CONTROL, BULK = 100, 101
SUCCESS, CANCELLED, INVALID, IO_ERROR, STALL = range(5)
LOW, FULL, HIGH = range(3)  # speeds

VERSION_OCTETS, ENDPOINTS = 64, 32
# What a peer can, by bit.
DEVICE_VERSION, DISCONNECT_ACK, MAX_PACKET_SIZE, WIDE_IDS, LONG_BULK = 1, 3, 4, 5, 6
CAPABILITIES = sum(1 << bit for bit in (DEVICE_VERSION, DISCONNECT_ACK, MAX_PACKET_SIZE, WIDE_IDS, LONG_BULK))

# Standard requests of USB, and the kinds of descriptors.
GET_STATUS, GET_DESCRIPTOR = 0x00, 0x06
DEVICE, CONFIGURATION, STRING, INTERFACE, ENDPOINT, QUALIFIER = 1, 2, 3, 4, 5, 6
TO_HOST, KIND, STANDARD = 0x80, 0x60, 0x00
ENGLISH = bytes([4, STRING, 0x09, 0x04])
UNUSED = 255  # an endpoint's type


def slot(address):
    """An endpoint's place in usbredir's tables: 0-15 out, 16-31 in."""
    return (address & TO_HOST) >> 3 | address & 0x0F


class UsbDevice:
    """Subclasses have the descriptors `device` and `configuration`, `strings`, a `speed`; they answer in `control`, take
    in `bulk_out`, and give by `bulk_in`."""

    device = configuration = b""
    strings = {}
    speed = HIGH

    def __init__(self):
        self.write = None  # towards QEMU
        self.plugged = False
        self._begin()

    def _begin(self):
        self._buffer, self._capabilities, self._configured = bytearray(), 0, 0
        self._nothing_open()

    def _nothing_open(self):
        self._asked, self._given = deque(), deque()  # bulk-in requests; packets that nobody has asked for yet

    def can(self, capability):
        return bool(self._capabilities & 1 << capability)

    # --- towards QEMU -------------------------------------------------------

    def connected(self, write):
        """QEMU is there: the bus has power."""
        self._begin()
        self.write = write
        self._send(HELLO, 0, b"odid bench".ljust(VERSION_OCTETS, b"\0") + struct.pack("<I", CAPABILITIES))

    def disconnected(self):
        """QEMU has gone."""
        self.write, self.plugged = None, False
        self._begin()

    def plug(self):
        """The device is on the bus from now on."""
        if self.write is None or self.plugged:
            return
        self.plugged = True
        self._announce()

    def unplug(self, last=b""):
        """last: what it has sent right before."""
        if self.plugged:
            self.plugged = False
            ended = self._all_ended(IO_ERROR)
            self._nothing_open()
            self.write(last + ended + self._packed(DEVICE_DISCONNECT, 0, b""))  # in one piece: nothing comes in between

    def ready(self):
        """Both sides have said what they can. (Subclasses plug themselves in here.)"""

    def bulk_in(self, packet):
        if self.plugged:
            self._given.append(packet)
            self._give()

    @property
    def unread(self):
        """How many packets nobody has asked for yet."""
        return len(self._given)

    def _give(self):
        while self._given and self._asked:
            ident, endpoint, stream, length = self._asked.popleft()
            packet = self._given.popleft()[:length]
            self._send(BULK, ident, self._bulk_head(endpoint, SUCCESS, len(packet), stream) + packet)

    def end_bulk_in(self):
        """Whatever is asked for now ends with an error."""
        if ended := self._all_ended(IO_ERROR):
            self.write(ended)

    def _all_ended(self, status, chosen=lambda _: True):
        ended = [one for one in self._asked if chosen(one[0])]
        for one in ended:
            self._asked.remove(one)
        return b"".join(self._packed(BULK, ident, self._bulk_head(endpoint, status, 0, stream))
                        for ident, endpoint, stream, _ in ended)

    def _packed(self, kind, ident, body):
        head = "<IIQ" if self.can(WIDE_IDS) and kind != HELLO else "<III"
        return struct.pack(head, kind, len(body), ident) + body

    def _send(self, kind, ident, body):
        if self.write is not None:
            self.write(self._packed(kind, ident, body))

    def _bulk_head(self, endpoint, status, length, stream):
        head = struct.pack("<BBHI", endpoint, status, length & 0xFFFF, stream)
        return head + struct.pack("<H", length >> 16) if self.can(LONG_BULK) else head

    def _announce(self):
        """What the configuration's descriptors say, in usbredir's tables."""
        interfaces, endpoints = [], {0x00: (0, 0, 0, 64), 0x80: (0, 0, 0, 64)}
        at = 0
        while at < len(self.configuration):
            piece = self.configuration[at:at + self.configuration[at]]
            if piece[1] == INTERFACE:
                interfaces.append((piece[2], piece[5], piece[6], piece[7]))
            elif piece[1] == ENDPOINT:
                endpoints[piece[2]] = piece[3] & 3, piece[6], interfaces[-1][0], int.from_bytes(piece[4:6], "little")
            at += len(piece)
        columns = (bytes(column).ljust(32, b"\0") for column in zip(*interfaces, strict=True))
        self._send(INTERFACE_INFO, 0, struct.pack("<I", len(interfaces)) + b"".join(columns))
        table = [(UNUSED, 0, 0, 0)] * ENDPOINTS
        for address, row in endpoints.items():
            table[slot(address)] = row
        kinds, intervals, of_interface, sizes = zip(*table, strict=True)
        body = bytes(kinds) + bytes(intervals) + bytes(of_interface)
        if self.can(MAX_PACKET_SIZE):
            body += struct.pack(f"<{ENDPOINTS}H", *sizes)
        self._send(EP_INFO, 0, body)
        version = self.device[12:14] if self.can(DEVICE_VERSION) else b""
        self._send(DEVICE_CONNECT, 0, bytes([self.speed, *self.device[4:7]]) + self.device[8:12] + version)

    # --- from QEMU ----------------------------------------------------------

    def received(self, data):
        self._buffer += data
        while True:
            size = 16 if self.can(WIDE_IDS) else 12
            if len(self._buffer) < size:
                return
            kind, length, ident = struct.unpack_from("<IIQ" if size == 16 else "<III", self._buffer)
            if len(self._buffer) < size + length:
                return
            body = bytes(self._buffer[size:size + length])
            del self._buffer[:size + length]
            self._packet(kind, ident, body)

    def _packet(self, kind, ident, body):
        if kind == HELLO:
            self._capabilities = CAPABILITIES & int.from_bytes(body[VERSION_OCTETS:VERSION_OCTETS + 4], "little")
            self.ready()
        elif kind == DEVICE_DISCONNECT_ACK or not self.plugged:
            pass  # what was under way when it was unplugged
        elif kind == RESET:
            self.write(self._all_ended(CANCELLED))
            self._given.clear()
        elif kind in (SET_CONFIGURATION, GET_CONFIGURATION):
            self._configured = body[0] if kind == SET_CONFIGURATION else self._configured
            self._send(CONFIGURATION_STATUS, ident, bytes([SUCCESS, self._configured]))
        elif kind in (SET_ALT_SETTING, GET_ALT_SETTING):
            setting = body[1] if kind == SET_ALT_SETTING else 0
            self._send(ALT_SETTING_STATUS, ident, bytes([SUCCESS, body[0], setting]))
        elif kind in (START_INTERRUPT, STOP_INTERRUPT):
            self._send(INTERRUPT_STATUS, ident, bytes([SUCCESS, body[0]]))
        elif kind == CANCEL_DATA:
            self.write(self._all_ended(CANCELLED, lambda asked: asked == ident))
        elif kind == CONTROL:
            self._control(ident, body)
        elif kind == BULK:
            self._bulk(ident, body)
        else:
            print(f"usbredir: packet {kind} isn't known: {body.hex()}", file=sys.stderr, flush=True)

    def _control(self, ident, body):
        _, request, kind, _, value, index, _ = struct.unpack_from("<BBBBHHH", body)
        answer = self._standard if kind & KIND == STANDARD else self.control
        self.answer_control(ident, body, answer(kind, request, value, index, body[10:]))

    def answer_control(self, ident, body, data):
        """body: the request; data: None for a stall."""
        if self.write is not None:
            self.write(self.control_answer(ident, body, data))

    def control_answer(self, ident, body, data):
        """The same, to be sent."""
        endpoint, request, kind, _, value, index, length = struct.unpack_from("<BBBBHHH", body)
        status = STALL if data is None else SUCCESS
        data = (data or b"")[:length] if kind & TO_HOST else b""
        done = len(data) if kind & TO_HOST else length
        head = struct.pack("<BBBBHHH", endpoint, request, kind, status, value, index, done)
        return self._packed(CONTROL, ident, head + data)

    def _standard(self, kind, request, value, _index, _data):
        if request != GET_DESCRIPTOR:
            return bytes(2) if kind & TO_HOST and request == GET_STATUS else b""
        which = value & 0xFF
        text = self.strings.get(which, "").encode("utf-16-le")
        strings = ENGLISH if which == 0 else bytes([len(text) + 2, STRING]) + text
        return {DEVICE: self.device, CONFIGURATION: self.configuration, STRING: strings,
                QUALIFIER: bytes([10, QUALIFIER]) + self.device[2:8] + bytes([1, 0])}.get(value >> 8)

    def _bulk(self, ident, body):
        endpoint, _, length, stream = struct.unpack_from("<BBHI", body)
        at = 8
        if self.can(LONG_BULK):
            length, at = length | int.from_bytes(body[8:10], "little") << 16, 10
        if endpoint & TO_HOST:
            self._asked.append((ident, endpoint, stream, length))
            self.asked()
            self._give()
        else:
            self.bulk_out(body[at:])
            self._send(BULK, ident, self._bulk_head(endpoint, SUCCESS, length, stream))

    # --- the device itself --------------------------------------------------

    def control(self, kind, request, value, index, data):
        """A class or vendor request: the answer, or None for a stall."""
        return None

    def asked(self):
        """The driver waits for something."""

    def bulk_out(self, packet):
        """What the driver sends."""


async def serve(device, reader, writer):
    """One connection of QEMU's, to its end."""
    device.connected(writer.write)
    try:
        while data := await reader.read(65536):
            device.received(data)
    except ConnectionError:
        pass
    finally:
        device.disconnected()
        writer.close()


async def listen(path, served):
    """A UNIX socket that is ready as soon as it is seen; served: called with each connection's reader and writer."""
    await asyncio.start_unix_server(served, f"{path}.new")
    os.replace(f"{path}.new", path)


async def until_orders_end(obey):
    """Orders from standard input, until whoever started us is gone."""
    orders, over = Orders(obey), asyncio.Event()
    asyncio.get_running_loop().add_reader(sys.stdin.fileno(), lambda: orders.take() or over.set())
    print("done", flush=True)
    await over.wait()
