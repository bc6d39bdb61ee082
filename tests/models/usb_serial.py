"""A MODEL of a flight controller's own USB port: a serial line as USB has it (CDC-ACM), behind QEMU's usb-redir.

The autopilot at the line's other end connects to the UNIX socket --line; QEMU to --listen. The descriptors are those of
USB's class definition for communication devices (CDC 1.2, PSTN 1.2), the numbers ArduPilot's. What nobody reads is lost,
as it is in a flight controller.

(QEMU has a serial adapter of its own, usb-serial. On raspi4b it can't be pulled, see usbredir.py.)

Orders, one a line on standard input, each answered by "done" or "error: ...":
  unplug | plug      its cable
"""

import argparse
import asyncio
import functools
import struct
import sys

from . import usbredir

SET_LINE_CODING, GET_LINE_CODING, SET_LINE_STATE = 0x20, 0x21, 0x22
READY = 1 << 0  # of the line's state: somebody has the port open
QUIET_S = 0.03
PACKET = 63  # one octet less than an endpoint takes: each ends a transfer at once
UNREAD = 256  # packets


def descriptor(*octets):
    return bytes([len(octets) + 1, *octets])


def endpoint(address, kind, octets, interval):
    return descriptor(usbredir.ENDPOINT, address, kind, octets, 0, interval)


class UsbSerial(usbredir.UsbDevice):
    """line: takes what the machine sends; later: calls something after so many seconds, and can be cancelled."""

    speed = usbredir.FULL
    device = struct.pack("<BBHBBBBHHHBBBB", 18, usbredir.DEVICE, 0x0200, 2, 0, 0, 64, 0x1209, 0x5740, 0x0200, 1, 2, 3, 1)
    _parts = b"".join((
        descriptor(usbredir.INTERFACE, 0, 0, 1, 2, 2, 1, 0),  # its control, and which interface has its data
        descriptor(0x24, 0, 0x10, 0x01), descriptor(0x24, 1, 0, 1), descriptor(0x24, 2, 2), descriptor(0x24, 6, 0, 1),
        endpoint(0x81, 3, 8, 16),
        descriptor(usbredir.INTERFACE, 1, 0, 2, 0x0A, 0, 0, 0), endpoint(0x82, 2, 64, 0), endpoint(0x03, 2, 64, 0)))
    configuration = struct.pack("<BBHBBBBB", 9, usbredir.CONFIGURATION, 9 + len(_parts), 2, 1, 0, 0xC0, 50) + _parts
    strings = {1: "ArduPilot", 2: "Flight controller (model)", 3: "AUTOPILOT"}

    def __init__(self, later, present=True):
        super().__init__()
        self.present, self.line = present, None
        self._later, self._closing, self._timer = later, None, None
        self._coding = struct.pack("<IBBB", 115200, 0, 0, 8)

    def ready(self):
        self.plug()

    def plug(self):
        if self.present:
            super().plug()

    def control(self, kind, request, value, index, data):
        if request == SET_LINE_CODING:
            self._coding = data
        return self._coding if request == GET_LINE_CODING else b""

    def _control(self, ident, body):
        value = int.from_bytes(body[4:6], "little")
        if body[1] == SET_LINE_STATE and not value & READY and self._closing is None:
            # The port is about to be closed. That goes on when the driver has given up what it had asked for.
            self._closing = ident, body
            self.asked()
        else:
            super()._control(ident, body)

    def asked(self):
        if self._closing:
            self.end_bulk_in()
            if self._timer:
                self._timer.cancel()
            self._timer = self._later(QUIET_S, self._closed)

    def _closed(self):
        closing, self._closing, self._timer = self._closing, None, None
        if self.plugged and closing:
            self.answer_control(*closing, b"")

    def unplug(self):
        self._closing = None
        super().unplug()

    def disconnected(self):
        self._closing = None
        super().disconnected()

    def bulk_out(self, packet):
        if self.line:
            self.line(packet)

    def say(self, data):
        """The autopilot's octets."""
        for at in range(0, len(data), PACKET):
            if self.unread < UNREAD:
                self.bulk_in(data[at:at + PACKET])

    def obey(self, words):
        if words not in (["unplug"], ["plug"]):
            raise ValueError(f"unknown order {' '.join(words)!r}")
        self.present = words == ["plug"]
        (self.plug if self.present else self.unplug)()


async def autopilot(port, reader, writer):
    """One that connects to the line, to its end; the next one takes its place."""
    port.line = writer.write
    try:
        while data := await reader.read(4096):
            port.say(data)
    except ConnectionError:
        pass
    finally:
        if port.line == writer.write:
            port.line = None
        writer.close()


async def run(arguments):
    port = UsbSerial(asyncio.get_running_loop().call_later, not arguments.unplugged)
    await usbredir.listen(arguments.line, functools.partial(autopilot, port))
    await usbredir.listen(arguments.listen, functools.partial(usbredir.serve, port))
    await usbredir.until_orders_end(port.obey)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--listen", required=True, metavar="SOCKET", help="UNIX socket for QEMU's usb-redir")
    parser.add_argument("--line", required=True, metavar="SOCKET", help="UNIX socket for the autopilot")
    parser.add_argument("--unplugged", action="store_true", help="until it is plugged in")
    try:
        asyncio.run(run(parser.parse_args()))
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
