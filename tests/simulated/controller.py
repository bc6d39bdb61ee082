"""A MODEL of a Bluetooth controller: H4, the advertising commands and their rules, and what is on the air by them.

Bluetooth Core Specification, Vol 4 Part E 7.8 (commands), Vol 6 Part B 4.4.2.2 (an advertising event each interval and a
random 0 to 10 ms). Its modes are those of models/front.py:

  full       extended advertising with Coded PHY, 20 ms
  legacy20   no extended advertising, 20 ms
  bcm43455   the same, and intervals under 100 ms are refused, as before Bluetooth 5
"""

import struct
from dataclasses import dataclass

from models.front import COMMAND, EVENT, MODES, Packets

from .world import Device

COMPLETE, STATUS = 0x0E, 0x0F
RESET, READ_FEATURES, CLEAR_SETS = 0x0C03, 0x2003, 0x203D
SET_ADDRESS, SET_PARAMETERS, SET_DATA, ENABLE = 0x2005, 0x2006, 0x2008, 0x200A
SET_EXTENDED_ADDRESS, SET_EXTENDED_PARAMETERS, SET_EXTENDED_DATA, ENABLE_EXTENDED = 0x2035, 0x2036, 0x2037, 0x2039
SET_EXTENDED_PARAMETERS_V2 = 0x207F
READ_MAXIMUM_DATA, MAXIMUM_DATA = 0x203A, 0x0672
READ_DATA_LENGTH, WRITE_DATA_LENGTH, LEAST_DATA_LENGTH = 0x2023, 0x2024, struct.pack("<HH", 27, 328)
LEGACY = (SET_ADDRESS, SET_PARAMETERS, SET_DATA, ENABLE)
EXTENDED = (SET_EXTENDED_ADDRESS, SET_EXTENDED_PARAMETERS, SET_EXTENDED_DATA, ENABLE_EXTENDED, CLEAR_SETS,
            SET_EXTENDED_PARAMETERS_V2)
OTHERS = (0x0C01, 0x0C63, 0x1001, 0x1002, 0x1009, 0x2001, 0x2002)  # masks, versions, sizes: taken
OK, UNKNOWN, DISALLOWED, INVALID, LIMIT, NO_SUCH_SET = 0x00, 0x01, 0x0C, 0x12, 0x07, 0x42
FEATURES_FULL = (1 << 11 | 1 << 12 | 1 << 40).to_bytes(8, "little")  # Coded PHY, extended advertising, coding selection
LEGACY_PDU = 0x0010
UNIT_US = 625
RANDOM_US = 10_000
SETS = 2


@dataclass
class AdvertisingSet:
    """The legacy commands use the first one."""
    known: bool = False
    addressed: bool = False
    enabled: bool = False
    interval_us: int = 0
    long_range: bool = False
    address: bytes = bytes(6)
    data: bytes = b""
    next_us: int = 0
    heard: object = None  # what a receiver makes of it


class Controller:
    """set_log: every payload that was set while it was advertised, for the judge: (seconds, channel, data)."""

    def __init__(self, world, air, path, mode="full", answers_us=(1_000, 8_000)):
        if mode not in MODES:
            raise ValueError(f"mode {mode}: expected one of {', '.join(MODES)}")
        self.world, self.air, self.mode, self.answers_us = world, air, mode, answers_us
        self.set_log = []
        self.hangs = False
        self.until_reset = self.until_power = False  # it hangs, and sends nothing, until that comes
        self.refused = {}  # opcode -> status, once
        self.lost_events = 0  # so many of the next answers don't arrive
        self._busy_us = 0  # it does one command after the other
        self.reset()
        self.device = Device(world, path, self._on_octets, self._forget_octets)
        self._forget_octets()
        air.radios.append(self._send)

    def reset(self):
        """By a command, or by itself: it doesn't say so."""
        self.sets = [AdvertisingSet() for _ in range(SETS)]
        self.used = None  # which kind of commands: they don't mix
        self.data_length = LEAST_DATA_LENGTH

    def power_on(self):
        self.reset()
        self.until_reset = self.until_power = False

    def hang_until(self, what):
        """"reset" or "power"."""
        self.reset()
        setattr(self, f"until_{what}", True)

    @property
    def answers_nothing(self):
        return self.hangs or self.until_reset or self.until_power

    # --- the line ------------------------------------------------------------------

    def _forget_octets(self):
        self._packets = Packets()

    def _on_octets(self, octets):
        for packet in self._packets.feed(octets):
            if packet[0] != COMMAND:
                continue
            if packet[1] | packet[2] << 8 == RESET:
                self.until_reset = False
            if not self.answers_nothing:
                self._busy_us = max(self._busy_us, self.world.now_us) + self.world.chance.randint(*self.answers_us)
                self.world.at(self._busy_us, self.command, packet[1] | packet[2] << 8, packet[4:])

    def command(self, opcode, parameters):
        """Also another program's: everybody sees the answer."""
        self._send(self.world.now_us)
        status, more = self._obey(opcode, parameters)
        if self.answers_nothing:
            return
        if self.lost_events:
            self.lost_events -= 1
            return
        if status == UNKNOWN:
            body = struct.pack("<BBBH", STATUS, 4, status, 1 | (opcode & 0xFF) << 8) + bytes([opcode >> 8])
        else:
            body = struct.pack("<BBBHB", COMPLETE, 4 + len(more), 1, opcode, status) + more
        self.device.send(bytes([EVENT]) + body)

    # --- commands -------------------------------------------------------------------

    def _obey(self, opcode, parameters):
        """Status, and what is returned beside it."""
        if opcode in self.refused:
            return self.refused.pop(opcode), b""
        if opcode == RESET:
            self.reset()
            return OK, b""
        if opcode == READ_FEATURES:
            return OK, FEATURES_FULL if self.mode == "full" else bytes(8)
        if opcode == WRITE_DATA_LENGTH:
            self.data_length = parameters
            return OK, b""
        if opcode == READ_DATA_LENGTH:
            return OK, self.data_length
        if opcode == READ_MAXIMUM_DATA and self.mode == "full":
            return OK, MAXIMUM_DATA.to_bytes(2, "little")
        if opcode in LEGACY or (opcode in EXTENDED and self.mode == "full"):
            kind = LEGACY if opcode in LEGACY else EXTENDED
            if self.used not in (None, kind):
                return DISALLOWED, b""
            if opcode != SET_ADDRESS:
                self.used = kind
            return self._obey_legacy(opcode, parameters) if kind is LEGACY else self._obey_extended(opcode, parameters)
        return (OK if opcode in OTHERS else UNKNOWN), b""

    def _obey_legacy(self, opcode, parameters):
        one = self.sets[0]
        if opcode == SET_ADDRESS:
            if one.enabled:
                return DISALLOWED, b""
            one.address, one.addressed = parameters, True
        elif opcode == SET_PARAMETERS:
            if one.enabled:
                return DISALLOWED, b""
            units = parameters[0] | parameters[1] << 8
            if self.mode == "bcm43455" and units < 0x00A0:
                return INVALID, b""
            one.interval_us, one.known = units * UNIT_US, True
        elif opcode == SET_DATA:
            self._set_data(one, parameters[1:1 + parameters[0]])
        elif parameters[0] and not one.known:
            return INVALID, b""
        else:
            self._enable(one, bool(parameters[0]))
        return OK, b""

    def _obey_extended(self, opcode, parameters):
        if opcode == CLEAR_SETS:
            if any(one.enabled for one in self.sets):
                return DISALLOWED, b""
            self.sets = [AdvertisingSet() for _ in range(SETS)]
            return OK, b""
        if opcode == ENABLE_EXTENDED:
            return self._enable_extended(parameters), b""
        if parameters[0] >= SETS:
            return LIMIT, b""
        one = self.sets[parameters[0]]
        if opcode in (SET_EXTENDED_PARAMETERS, SET_EXTENDED_PARAMETERS_V2):
            if one.enabled:
                return DISALLOWED, b""
            one.known, one.interval_us = True, int.from_bytes(parameters[3:6], "little") * UNIT_US
            one.long_range = not (parameters[1] | parameters[2] << 8) & LEGACY_PDU
            return OK, bytes([0])  # the power that was chosen
        if not one.known:
            return NO_SUCH_SET, b""
        if opcode == SET_EXTENDED_ADDRESS:
            one.address, one.addressed = parameters[1:7], True
        else:
            self._set_data(one, parameters[4:4 + parameters[3]])
        return OK, b""

    def _enable_extended(self, parameters):
        wanted, count = bool(parameters[0]), parameters[1]
        handles = [parameters[2 + 4 * number] for number in range(count)] if count else range(SETS)
        if any(handle >= SETS or (count and not self.sets[handle].known) for handle in handles):
            return NO_SUCH_SET
        if wanted and not all(self.sets[handle].addressed for handle in handles):
            return INVALID
        for handle in handles:
            self._enable(self.sets[handle], wanted)
        return OK

    def _set_data(self, one, data):
        one.data, one.heard = data, self.air.advertisement(one.address, data, one.long_range)
        if one.enabled:
            self.set_log.append((self.world.now_us / 1e6, "bt5" if one.long_range else "bt4", data))

    def _enable(self, one, wanted):
        if wanted and not one.enabled:
            one.next_us = self.world.now_us + 1_000
            one.heard = self.air.advertisement(one.address, one.data, one.long_range)
        one.enabled = wanted

    # --- the air ---------------------------------------------------------------------

    def _send(self, until_us):
        """The advertising events that have come due."""
        for one in self.sets:
            while one.enabled and one.next_us <= until_us:
                self.air.hear(one.heard, one.next_us)
                one.next_us += one.interval_us + self.world.chance.randrange(RANDOM_US)
