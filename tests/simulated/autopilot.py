"""A MODEL of an autopilot: plays a log of frames, by the world's clock, and heeds nothing that it is told."""

import functools
import json
from collections import namedtuple

from host import player, tlog
from host.flight import BOOTED_MS
from pymavlink.dialects.v20 import common

# What the daemon says of itself: CLOCK_MONOTONIC in seconds, whether it is good to arm, and otherwise why not.
ArmStatus = namedtuple("ArmStatus", "mono good reason")


prepare = functools.lru_cache(maxsize=16)(player.prepare)


class Autopilot:
    """frames: host/player.py's, (seconds, frame, record or None). said: each ARM_STATUS that came. connect(on_octets): its
    line to the daemon, a world.Device or world.Port.

    rewrite(message) may change what it says, or return False: it isn't said."""

    def __init__(self, world, connect, flight, played):
        self.world = world
        self.frames = prepare(flight, 0, None)
        self.played = open(played, "w", encoding="utf-8")
        self.silent = False
        self.rewrite = None
        self._clock_ms = 0  # how much less its clock says since it started again
        self.said = []
        self._decoder, self._link = tlog.Decoder(), common.MAVLink(None, srcSystem=1, srcComponent=1)
        self.device = connect(self._listen)
        self._begun_us, self._next = world.now_us, 0
        world.at(self._begun_us, self._play)

    def _listen(self, octets):
        for message in self._decoder.messages(octets):
            if message.get_type() == "OPEN_DRONE_ID_ARM_STATUS":
                self.said.append(ArmStatus(self.world.now_us / 1e6, message.status == 0, message.error))

    def _play(self):
        _, frame, record = self.frames[self._next]
        if self.rewrite or self._clock_ms:
            frame, record = self._rewritten(frame, record)
        if frame and not self.silent and self.device.send(frame) and record:
            self.played.write(json.dumps({"time": self.world.unix_s, "mono": self.world.now_us / 1e6} | record) + "\n")
        self._next += 1
        if self._next < len(self.frames):
            self.world.at(self._begun_us + round(self.frames[self._next][0] * 1e6), self._play)

    def _rewritten(self, frame, record):
        message, = tlog.Decoder().messages(frame)
        if self.rewrite and self.rewrite(message) is False:
            return None, None
        if hasattr(message, "time_boot_ms"):
            message.time_boot_ms -= self._clock_ms
        self._link.seq = message.get_seq()
        return message.pack(self._link), tlog.as_record(message) if record else None

    def start_again(self):
        """Its clock begins at 0."""
        self.silent = False
        self._clock_ms += self.boot_ms()

    def boot_ms(self):
        """Its clock now."""
        return BOOTED_MS + (self.world.now_us - self._begun_us) // 1000 - self._clock_ms

    def close(self):
        self.played.close()
