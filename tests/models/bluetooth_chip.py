"""A MODEL of the BCM43455's Bluetooth half on a UART, as Linux' hci_uart_bcm sees it: rootcanal behind it.

front.py with the mode bcm43455 or legacy20 and --listen, and before it what Broadcom's chip wants first: its own commands,
by which the driver finds out what it is, loads the patch file into its memory, launches that, sets the baud rate and gives
it an address. Everything else goes to rootcanal, whose link layer and air it is: also the address in the advertisements is
rootcanal's own.

The commands and their lengths are those that Linux' btbcm.c and hci_bcm.c send and check (6.1); the names and versions are
those of a BCM4345C0 as Raspberry Pis show it. How late each answer comes, and what the patch file does, isn't modelled:
octets that are written go nowhere.

Orders, beside front.py's (mute | unmute is a hang that ends by order; its radio goes on):
  late SECONDS       each command of the patch file's is answered so late; 0: at once
  reset              the chip has reset itself: no advertising, no patch, its default address; it says nothing of it
  hang               nothing is answered, and nothing sent on the air, until a reset comes (HCI_Reset)
  lose COUNT         so many of the next events get lost on the way up
  stop | go          flow control stops (CTS): the chip takes nothing; then everything that waited, at once
"""

import argparse
import heapq
import itertools
import struct
import sys
import time

from .front import COMMAND_COMPLETE, EVENT, UNKNOWN_COMMAND, TcpFront

RESET, READ_VERSION, READ_ADDRESS = 0x0C03, 0x1001, 0x1009
WRITE_ADDRESS, SET_BAUD_RATE, MINIDRIVER, SET_CLOCK = 0xFC01, 0xFC18, 0xFC2E, 0xFC45
WRITE_RAM, LAUNCH, READ_FEATURES, READ_CONFIGURATION = 0xFC4C, 0xFC4E, 0xFC6E, 0xFC79
VENDOR = 0x3F  # the group of commands that each make has for itself
PATCHING = (MINIDRIVER, WRITE_RAM, LAUNCH)

# Until one is written; the driver knows it as one that isn't an address.
DEFAULT_ADDRESS = bytes.fromhex("43 45 c0 00 1f ac")[::-1]
HCI_4_2, BROADCOM, BCM4345C0 = 8, 15, 0x6119  # the last is how the driver knows the chip
BUILD, UNPATCHED_BUILD = 281, 0
CHIP_ID = 0x6B


def patch_file(records=3, octets=200):
    """What the driver takes for a patch file: commands as on the wire. This model's patch does nothing."""
    def command(opcode, parameters):
        return struct.pack("<HB", opcode, len(parameters)) + parameters
    written = (command(WRITE_RAM, struct.pack("<I", 0x00210000 + octets * number) + bytes(octets))
               for number in range(records))
    return b"".join(written) + command(LAUNCH, struct.pack("<I", 0xFFFFFFFF))


class BluetoothChip(TcpFront):
    """What it is before and beside rootcanal."""

    def __init__(self, listen_port, hci_port, mode, set_log):
        self.late_s = 0.0
        super().__init__(listen_port, hci_port, mode, set_log)

    def connect(self):
        """Power-on."""
        super().connect()
        self.address, self.patched, self.written = DEFAULT_ADDRESS, False, 0
        self.hung, self.losing, self.waiting = False, 0, None  # waiting: octets before flow control, when it has stopped
        self.due, self._number = [], itertools.count()  # answers that come later

    def _start_again(self):
        """The chip's own start: nothing is left but its power."""
        self.disconnect()
        self.connect()

    def _stop_radio(self):
        """Its patch and its address stay: they are in memory."""
        self.disconnect()
        super().connect()

    # --- down ---------------------------------------------------------------

    def from_host(self, data):
        if self.controller is not None and self.waiting is not None and data:
            self.waiting += data
        else:
            super().from_host(data)

    def refused(self, opcode, parameters):
        """Whether rootcanal gets to see this command."""
        if self.hung:
            if opcode != RESET:
                return True
            self.hung = False
        if opcode in self.refusals:
            return super().refused(opcode, parameters)
        body = self._own(opcode, parameters)
        if body is None:
            return super().refused(opcode, parameters)
        self._complete(opcode, body, self.late_s if opcode in PATCHING else 0)
        return True

    def _own(self, opcode, parameters):
        """What Broadcom's chip answers by itself, its status first; None: a command of everybody's."""
        if opcode == READ_VERSION:
            build = BUILD if self.patched else UNPATCHED_BUILD
            return struct.pack("<BBHBHH", 0, HCI_4_2, build, HCI_4_2, BROADCOM, BCM4345C0)
        if opcode == READ_ADDRESS:
            return b"\0" + self.address
        if opcode >> 10 != VENDOR:
            return None
        if opcode == WRITE_ADDRESS:
            self.address = bytes(parameters[:6])
        elif opcode == WRITE_RAM:
            self.written += len(parameters) - 4
        elif opcode == LAUNCH:
            self.patched = self.written > 0
        answers = {READ_CONFIGURATION: bytes([0, CHIP_ID]) + bytes(5), READ_FEATURES: bytes(9), **dict.fromkeys(
            (WRITE_ADDRESS, SET_BAUD_RATE, SET_CLOCK, *PATCHING), b"\0")}
        return answers.get(opcode, bytes([UNKNOWN_COMMAND]))

    # --- up -----------------------------------------------------------------

    def _complete(self, opcode, body, late_s):
        packet = bytes([EVENT, COMMAND_COMPLETE, len(body) + 3, 1, opcode & 0xFF, opcode >> 8]) + body
        if late_s:
            heapq.heappush(self.due, (time.monotonic() + late_s, next(self._number), packet))
        else:
            self.to_host(packet)

    def to_host(self, packet):
        if self.losing and packet[0] == EVENT:
            self.losing -= 1
        elif not self.hung:
            super().to_host(packet)

    # --- orders -------------------------------------------------------------

    def obey(self, words):
        order, *values = words or [""]
        if order == "late" and len(values) == 1:
            self.late_s = float(values[0])
            return
        if order not in ("reset", "hang", "lose", "stop", "go"):
            super().obey(words)
            return
        if self.controller is None:
            raise ValueError("it has no power")
        if words == ["reset"]:
            self._start_again()
        elif words == ["hang"]:
            self._stop_radio()
            self.hung = True
        elif order == "lose" and len(values) == 1:
            self.losing = int(values[0])
        elif words == ["stop"]:
            self.waiting = b""
        elif words == ["go"] and self.waiting is not None:
            held, self.waiting = self.waiting, None
            if held:
                self.from_host(held)
        else:
            raise ValueError(f"unknown order {' '.join(words)!r}")

    # --- time ---------------------------------------------------------------

    def wait_s(self):
        """Until the next answer that comes late; None: there is none."""
        return max(0, self.due[0][0] - time.monotonic()) if self.master is not None and self.due else None

    def idle(self):
        """Called whenever something has happened, or the time has come."""
        while self.wait_s() == 0:
            self.to_host(heapq.heappop(self.due)[2])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--listen", type=int, metavar="PORT", required=True, help="TCP port for the machine's UART")
    parser.add_argument("--hci-port", type=int, required=True, help="rootcanal's HCI port")
    parser.add_argument("--mode", choices=("legacy20", "bcm43455"), default="bcm43455")
    parser.add_argument("--set-log", help="JSON lines of the payloads that were set")
    arguments = parser.parse_args()
    try:
        BluetoothChip(arguments.listen, arguments.hci_port, arguments.mode, arguments.set_log).run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
