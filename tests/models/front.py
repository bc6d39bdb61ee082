"""A MODEL of the Bluetooth chip's host side: rootcanal behind a pty, as this or that controller.

The daemon opens the pty (`h4:<path>`); H4 packets go through to rootcanal, whose link layer and air
they are. With --listen there is a TCP port instead, for the serial line of an emulated machine: each
connection is a power-on, with a fresh controller. That it answers 0x0C to a legacy command after an
extended one is rootcanal's own doing. What is ours: the pty, the log of payloads that were set, and
being a lesser or a broken chip:

  full       everything rootcanal can: 20 ms, extended advertising, Coded PHY
  legacy20   no extended advertising in the features; extended commands are unknown
  bcm43455   the same, and intervals under 100 ms are refused with 0x12, as before Bluetooth 5

Orders, one a line on standard input, each answered by "done" or "error: ...":
  inject HEX         another program's HCI command (opcode and parameters as on the wire, without the
                     packet type) on the same controller; its Command Complete goes up to the daemon,
                     as the kernel shows it to every raw socket
  mute | unmute      a controller that hangs: nothing passes; its radio goes on
  unplug | plug      the pty vanishes; a new one comes, with a fresh controller. (--listen: the
                     connection stays, as a UART's wires do, and nobody answers in between)
  refuse OPCODE ST   answers the next such command with this status (both hexadecimal)
"""

import argparse
import collections
import json
import os
import selectors
import socket
import sys
import time
import tty

from .orders import Orders

COMMAND, EVENT = 0x01, 0x04
COMMAND_COMPLETE, COMMAND_STATUS = 0x0E, 0x0F
READ_FEATURES = 0x2003
SET_PARAMETERS, SET_DATA = 0x2006, 0x2008
SET_EXTENDED_PARAMETERS, SET_EXTENDED_DATA = 0x2036, 0x2037
SET_EXTENDED_PARAMETERS_V2 = 0x207F
SUCCESS, UNKNOWN_COMMAND, INVALID_PARAMETERS = 0x00, 0x01, 0x12
LEGACY_PDU = 0x0010  # event property of an extended advertising set
INTERVAL_100_MS = 0x00A0
# Bits 11 (Coded PHY) and 12 (extended advertising) of the LE features, in their second byte.
NEWER_FEATURES = 1 << 3 | 1 << 4
# By packet type: how long the header is, and how long what follows it.
HEADER = {
    0x01: (4, lambda p: p[3]),
    0x02: (5, lambda p: p[3] | p[4] << 8),
    0x03: (4, lambda p: p[3]),
    0x04: (3, lambda p: p[2]),
    0x05: (5, lambda p: (p[3] | p[4] << 8) & 0x3FFF),
}
MODES = ("full", "legacy20", "bcm43455")


class Packets:
    """Cuts a byte stream into H4 packets."""

    def __init__(self):
        self._buffer = bytearray()

    def feed(self, data):
        self._buffer += data
        while self._buffer:
            if self._buffer[0] not in HEADER:
                raise ValueError(f"not H4: packet type 0x{self._buffer[0]:02x}")
            size, length = HEADER[self._buffer[0]]
            if len(self._buffer) < size or len(self._buffer) < size + length(self._buffer):
                return
            end = size + length(self._buffer)
            yield bytes(self._buffer[:end])
            del self._buffer[:end]


def is_extended(opcode):
    return 0x2034 <= opcode <= 0x203D or opcode == SET_EXTENDED_PARAMETERS_V2


class SetLog:
    """What the controller accepted as advertising data, and when; nothing is written without a path."""

    def __init__(self, path):
        self._file = open(path, "a", buffering=1, encoding="utf-8") if path else None
        self.clear()

    def clear(self):
        """A fresh controller."""
        self._channels = {}  # advertising handle -> channel
        self._asked = collections.defaultdict(collections.deque)  # opcode -> commands in flight

    def command(self, opcode, parameters):
        """A command on its way down; answers come in order for each opcode."""
        channel, data = None, b""
        if opcode in (SET_EXTENDED_PARAMETERS, SET_EXTENDED_PARAMETERS_V2) and len(parameters) >= 3:
            properties = parameters[1] | parameters[2] << 8
            self._channels[parameters[0]] = "bt4" if properties & LEGACY_PDU else "bt5"
        elif opcode == SET_DATA and parameters:
            channel, data = "bt4", parameters[1:1 + parameters[0]]
        elif opcode == SET_EXTENDED_DATA and len(parameters) >= 4:
            channel, data = self._channels.get(parameters[0]), parameters[4:4 + parameters[3]]
        if opcode in (SET_DATA, SET_EXTENDED_DATA):
            self._asked[opcode].append((channel, data))

    def completed(self, opcode, status):
        if not self._asked[opcode]:
            return
        channel, data = self._asked[opcode].popleft()
        if status == SUCCESS and channel and self._file:
            self._file.write(json.dumps({"mono": time.monotonic(), "opcode": opcode,
                                         "channel": channel, "data": data.hex()}) + "\n")


class Front:
    """Between a host and rootcanal; master is the descriptor that leads to the host."""

    def __init__(self, port, mode, set_log):
        self.port, self.mode = port, mode
        self.set_log = SetLog(set_log)
        self.muted = False
        self.refusals = {}  # opcode -> status, once each
        self.selector = selectors.DefaultSelector()
        self.master = self.controller = None
        self.orders = Orders(self.obey)
        self.selector.register(sys.stdin.fileno(), selectors.EVENT_READ, self.on_order)

    # --- the air's end --------------------------------------------------------

    def connect(self):
        """A fresh controller."""
        self.controller = socket.create_connection(("127.0.0.1", self.port))
        self.controller.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.set_log.clear()
        self.down, self.up = Packets(), Packets()
        self.selector.register(self.controller, selectors.EVENT_READ, self.on_controller)

    def disconnect(self):
        self.selector.unregister(self.controller)
        self.controller.close()
        self.controller = None

    def to_host(self, packet):
        if self.muted or self.master is None:
            return
        try:
            os.write(self.master, packet)
        except BlockingIOError:  # nobody reads and the line is full: lost, as on a UART
            print(f"nobody reads the pty: lost {packet.hex()}", file=sys.stderr, flush=True)

    # --- down: commands -----------------------------------------------------

    def answer(self, opcode, status):
        """Command Status for a command the chip doesn't know, Command Complete for any other."""
        if status == UNKNOWN_COMMAND:
            body = bytes([status, 1, opcode & 0xFF, opcode >> 8])
            self.to_host(bytes([EVENT, COMMAND_STATUS, len(body)]) + body)
        else:
            body = bytes([1, opcode & 0xFF, opcode >> 8, status])
            self.to_host(bytes([EVENT, COMMAND_COMPLETE, len(body)]) + body)

    def refused(self, opcode, parameters):
        """Answers a command that this chip doesn't take. Returns whether it did."""
        status = self.refusals.pop(opcode, None)
        if status is None and self.mode != "full" and is_extended(opcode):
            status = UNKNOWN_COMMAND
        if status is None and self.mode == "bcm43455" and opcode == SET_PARAMETERS:
            if int.from_bytes(parameters[0:2], "little") < INTERVAL_100_MS:
                status = INVALID_PARAMETERS
        if status is None:
            return False
        self.answer(opcode, status)
        return True

    def on_host(self):
        try:
            data = os.read(self.master, 4096)
        except BlockingIOError:
            return
        self.from_host(data)

    def from_host(self, data):
        for packet in self.down.feed(data):
            if self.muted:
                continue
            if packet[0] == COMMAND:
                opcode = packet[1] | packet[2] << 8
                if self.refused(opcode, packet[4:]):
                    continue
                self.set_log.command(opcode, packet[4:])
            self.controller.sendall(packet)

    # --- up: events ---------------------------------------------------------

    def on_controller(self):
        data = self.controller.recv(65536)
        if not data:
            sys.exit("rootcanal closed the controller's connection")
        # rootcanal writes a packet in two pieces and holds the second back until the first is
        # acknowledged: 40 ms late, as no chip is, unless that happens at once.
        self.controller.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        for packet in self.up.feed(data):
            if packet[0] == EVENT and packet[1] == COMMAND_COMPLETE and len(packet) >= 7:
                packet = self.completed(packet)
            elif packet[0] == EVENT and packet[1] == COMMAND_STATUS and len(packet) >= 7:
                self.set_log.completed(packet[5] | packet[6] << 8, packet[3])
            self.to_host(packet)

    def completed(self, packet):
        opcode, status = packet[4] | packet[5] << 8, packet[6]
        self.set_log.completed(opcode, status)
        if opcode == READ_FEATURES and self.mode != "full":
            packet = packet[:8] + bytes([packet[8] & ~NEWER_FEATURES]) + packet[9:]
        return packet

    # --- orders -------------------------------------------------------------

    def inject(self, text):
        command = bytes.fromhex(text)
        if len(command) < 3 or command[2] != len(command) - 3:
            raise ValueError("expected opcode (2 octets, little-endian), length, parameters")
        if self.controller is None:
            raise ValueError("the controller is unplugged")
        self.set_log.command(command[0] | command[1] << 8, command[3:])
        self.controller.sendall(bytes([COMMAND]) + command)

    def obey(self, words):
        order, *values = words or [""]
        if order == "inject" and len(values) == 1:
            self.inject(*values)
        elif words in (["mute"], ["unmute"]):
            self.muted = order == "mute"
        elif words == ["unplug"]:
            self.unplug()
        elif words == ["plug"]:
            self.plug()
        elif order == "refuse" and len(values) == 2:
            opcode, status = values
            self.refusals[int(opcode, 16)] = int(status, 16)
        else:
            raise ValueError(f"unknown order {' '.join(words)!r}")

    def on_order(self):
        if not self.orders.take():
            sys.exit(0)  # whoever started us is gone

    def wait_s(self):
        """Until something has to be done by itself; None: nothing has."""
        return None

    def idle(self):
        """Called whenever something has happened, or the time has come."""

    def run(self):
        print("done", flush=True)
        while True:
            for key, _ in self.selector.select(self.wait_s()):
                if key.fd in self.selector.get_map():  # not unplugged meanwhile
                    key.data()
            self.idle()


class PtyFront(Front):
    """Its host is the daemon itself, on this machine."""

    def __init__(self, path, *others):
        super().__init__(*others)
        self.path = path
        self.plug()

    def plug(self):
        if self.master is not None:
            raise ValueError("it is plugged in")
        self.connect()
        # Our own end of the slave stays open: the daemon may close and open it again unnoticed, as
        # with a UART.
        self.master, self.slave = os.openpty()
        tty.setraw(self.slave)
        os.fchmod(self.slave, 0o666)  # whatever user the daemon becomes
        os.set_blocking(self.master, False)
        self.selector.register(self.master, selectors.EVENT_READ, self.on_host)
        fresh = self.path + ".new"
        os.symlink(os.ttyname(self.slave), fresh)
        os.replace(fresh, self.path)

    def unplug(self):
        if self.master is None:
            raise ValueError("it isn't plugged in")
        os.unlink(self.path)
        self.selector.unregister(self.master)
        os.close(self.master)
        os.close(self.slave)
        self.master = None
        self.disconnect()


class TcpFront(Front):
    """Its host is an emulated machine's serial line. The line may come before and go after a driver
    that speaks H4 on it, so what is no H4 is noise."""

    def __init__(self, listen_port, *others):
        super().__init__(*others)
        self.listener = socket.create_server(("127.0.0.1", listen_port))
        self.selector.register(self.listener, selectors.EVENT_READ, self.on_machine)

    def on_machine(self):
        line, _ = self.listener.accept()
        if self.master is not None:
            line.close()
            print("a second machine was turned away", file=sys.stderr, flush=True)
            return
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        line.setblocking(False)
        self.line, self.master = line, line.fileno()
        self.muted = False
        self.connect()
        self.selector.register(self.master, selectors.EVENT_READ, self.on_host)

    def plug(self):
        if self.controller is not None:
            raise ValueError("it is plugged in")
        if self.master is None:
            raise ValueError("no machine is connected")
        self.connect()

    def unplug(self):
        if self.controller is None:
            raise ValueError("it isn't plugged in")
        self.disconnect()

    def machine_gone(self):
        self.selector.unregister(self.master)
        self.line.close()
        self.master = None
        if self.controller is not None:
            self.disconnect()

    def to_host(self, packet):
        try:
            super().to_host(packet)
        except ConnectionError:
            self.machine_gone()

    def from_host(self, data):
        if not data:
            self.machine_gone()
        elif self.controller is not None:
            try:
                super().from_host(data)
            except ValueError as error:
                print(f"from the machine: {error}: dropped {data.hex()}", file=sys.stderr, flush=True)
                self.down = Packets()

    def on_host(self):
        try:
            super().on_host()
        except ConnectionError:
            self.machine_gone()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    host = parser.add_mutually_exclusive_group(required=True)
    host.add_argument("--pty", help="where the link to the pty is put")
    host.add_argument("--listen", type=int, metavar="PORT", help="TCP port for an emulated machine's serial line")
    parser.add_argument("--hci-port", type=int, required=True, help="rootcanal's HCI port")
    parser.add_argument("--mode", choices=MODES, default="full")
    parser.add_argument("--set-log", help="JSON lines of the payloads that were set")
    arguments = parser.parse_args()
    try:
        others = arguments.hci_port, arguments.mode, arguments.set_log
        if arguments.pty:
            PtyFront(arguments.pty, *others).run()
        else:
            TcpFront(arguments.listen, *others).run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
