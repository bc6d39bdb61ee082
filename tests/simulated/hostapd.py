"""A MODEL of hostapd: models/hostapd.py's control interface, with the world's time and air."""

import socket

from models.hostapd import BEACON_INTERVAL_TU, BSSID, CHANNEL, ControlInterface

BEACON_US = BEACON_INTERVAL_TU * 1024


class Hostapd(ControlInterface):
    def __init__(self, world, air, folder, iface="wlan0", answers_us=(2_000, 8_000)):
        super().__init__(iface)
        self.world, self.air, self.path, self.answers_us = world, air, folder / iface, answers_us
        self.socket = None
        self._next_us = world.now_us
        self._heard = None
        folder.mkdir(parents=True, exist_ok=True)
        air.radios.append(self._send)
        self.start()

    def start(self):
        """Its beacons begin without an element, whatever was in them before."""
        self._send(self.world.now_us)
        self.given = self.active = b""
        self.refused = self._heard = None
        self._next_us = self.world.now_us
        self.path.unlink(missing_ok=True)  # a killed one's
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(self.path))
        self.world.listen(self.socket, self._read)

    def kill(self):
        self._send(self.world.now_us)
        self.world.close(self.socket)
        self.socket = None

    def order(self, *words):
        """As models/hostapd.py takes them: "mute", "forget" ..."""
        self._send(self.world.now_us)
        self.obey(list(words))
        self._look()

    def _read(self):
        while self.socket:
            try:
                request, sender = self.socket.recvfrom(4096)
            except BlockingIOError:
                return
            if sender and not self.muted:
                self.world.after(self.world.chance.randint(*self.answers_us), self._answer, request, sender)

    def _answer(self, request, sender):
        if self.socket is None:
            return
        self._send(self.world.now_us)
        text = self.answer(request.decode("ascii", "replace"))
        self._look()
        self.world.tell(self.socket, text.encode(), sender)

    def _look(self):
        self._heard = self.air.beacon(BSSID.hex(":").upper(), self.active, CHANNEL) if self.active else None

    def _send(self, until_us):
        """The beacons that have come due."""
        while self._next_us <= until_us:
            if self.socket and self.enabled:
                self.air.hear(self._heard, self._next_us)
            self._next_us += BEACON_US
