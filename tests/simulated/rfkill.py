"""A MODEL of the kernel's radio switches: /dev/rfkill, and what a blocked radio does."""

import struct

from .world import Device

EVENT = struct.Struct("<IBBBB")  # linux/rfkill.h: index, type, operation, soft, hard
WIFI, BLUETOOTH = 1, 2  # types
ADD, CHANGE = 0, 2
FOLLOWS_US = 20_000  # the radio, its switch


class Switches:
    """radios: {type: (call when it is blocked, call when it isn't any more)}."""

    def __init__(self, world, path, radios):
        self.world, self.radios = world, radios
        self.soft, self.hard = dict.fromkeys(radios, False), dict.fromkeys(radios, False)
        self._obeyed = dict.fromkeys(radios, False)
        self.device = Device(world, path, self._on_octets, on_open=lambda: [self._tell(one, ADD) for one in radios])

    def block(self, radio, hard=False):
        """Softly, by another program; or by a switch."""
        (self.hard if hard else self.soft)[radio] = True
        self._changed(radio)

    def unblock(self, radio, hard=False):
        (self.hard if hard else self.soft)[radio] = False
        self._changed(radio)

    def _on_octets(self, octets):
        for _, radio, operation, soft, _ in EVENT.iter_unpack(octets):
            if operation == CHANGE and radio in self.radios:
                self.soft[radio] = bool(soft)
                self._changed(radio)

    def _tell(self, radio, operation):
        self.device.send(EVENT.pack(radio - 1, radio, operation, self.soft[radio], self.hard[radio]))

    def _changed(self, radio):
        self._tell(radio, CHANGE)
        if self.soft[radio] or self.hard[radio]:
            self._obey(radio)  # at once
        else:
            self.world.after(FOLLOWS_US, self._obey, radio)

    def _obey(self, radio):
        blocked = self.soft[radio] or self.hard[radio]
        if blocked != self._obeyed[radio]:
            self._obeyed[radio] = blocked
            self.radios[radio][not blocked]()
