"""A MODEL of an autopilot on a serial line: plays a log of frames, by the world's clock."""

import json

from host import player

from .world import Device


class Autopilot:
    """frames: host/player.py's, (seconds, frame, record or None)."""

    def __init__(self, world, path, flight, played):
        self.world = world
        self.frames = player.prepare(flight, 0, None)
        self.played = open(played, "w", encoding="utf-8")
        self.silent = False
        self.device = Device(world, path, lambda octets: None)  # what it is sent, it doesn't heed
        self._begun_us, self._next = world.now_us, 0
        world.at(self._begun_us, self._play)

    def _play(self):
        _, frame, record = self.frames[self._next]
        if not self.silent and self.device.send(frame) and record:
            self.played.write(json.dumps({"time": self.world.unix_s, "mono": self.world.now_us / 1e6} | record) + "\n")
        self._next += 1
        if self._next < len(self.frames):
            self.world.at(self._begun_us + round(self.frames[self._next][0] * 1e6), self._play)

    def close(self):
        self.played.close()
