"""A MODEL of an autopilot: plays a log of frames, by the world's clock, and heeds nothing that it is told."""

import copy
import functools
import json
from collections import namedtuple

from models import player, tlog
from models.flight import BOOTED_MS
from pymavlink.dialects.v20 import common

# What the daemon says of itself: CLOCK_MONOTONIC in seconds, whether it is good to arm, and otherwise why not.
ArmStatus = namedtuple("ArmStatus", "mono good reason")
# fields: what the judge compares the air with, in JSON but for its opening brace; None: nothing.
Frame = namedtuple("Frame", "at_s octets fields")


@functools.lru_cache(maxsize=16)
def prepare(flight):
    return [Frame(at_s, frame, fields_of(record)) for at_s, frame, record in player.prepare(flight, 0, None)]


def fields_of(record):
    return json.dumps(record)[1:] if record else None


@functools.lru_cache(maxsize=100_000)
def decoded(frame):
    message, = tlog.Decoder().messages(frame)
    return message


class Autopilot:
    """said: each ARM_STATUS that came; asked: (CLOCK_MONOTONIC in seconds, message) of each rate. connect(on_octets): its line to the daemon, a world.Device or world.Port.

    rewrite(message) may change what it says, or return False: it isn't said."""

    def __init__(self, world, connect, flight, played):
        self.world = world
        self.frames = prepare(flight)
        self.played = open(played, "w", encoding="utf-8")
        self.silent = False
        self.rewrite = None
        self._clock_ms = 0  # how much less its clock says since it started again
        self.said, self.asked = [], []
        self._decoder, self._link = tlog.Decoder(), common.MAVLink(None)
        self.device = connect(self._listen)
        self._begun_us, self._next = world.now_us, 0
        world.at(self._begun_us, self._play)

    def _listen(self, octets):
        for message in self._decoder.messages(octets):
            if message.get_type() == "OPEN_DRONE_ID_ARM_STATUS":
                self.said.append(ArmStatus(self.world.now_us / 1e6, message.status == 0, message.error))
            elif message.get_type() == "COMMAND_LONG" and message.command == common.MAV_CMD_SET_MESSAGE_INTERVAL:
                self.asked.append((self.world.now_us / 1e6, int(message.param1)))

    def _play(self):
        _, octets, fields = self.frames[self._next]
        if self.rewrite or self._clock_ms:
            octets, fields = self._rewritten(octets, fields)
        if octets and not self.silent and self.device.send(octets) and fields:
            self.played.write(f'{{"time": {self.world.unix_s!r}, "mono": {self.world.now_us / 1e6!r}, {fields}\n')
        self._next += 1
        if self._next < len(self.frames):
            self.world.at(self._begun_us + round(self.frames[self._next].at_s * 1e6), self._play)

    def _rewritten(self, octets, fields):
        message = copy.copy(decoded(octets))
        message._header = copy.copy(message.get_header())
        if self.rewrite and self.rewrite(message) is False:
            return None, None
        if hasattr(message, "time_boot_ms"):
            message.time_boot_ms -= self._clock_ms
        self._link.srcSystem, self._link.srcComponent = message.get_srcSystem(), message.get_srcComponent()
        self._link.seq = message.get_seq()
        return message.pack(self._link), fields_of(tlog.as_record(message)) if fields else None

    def start_again(self):
        """Its clock begins at 0."""
        self.silent = False
        self._clock_ms += self.boot_ms()

    def boot_ms(self):
        """Its clock now."""
        return BOOTED_MS + (self.world.now_us - self._begun_us) // 1000 - self._clock_ms

    def close(self):
        self.played.close()
