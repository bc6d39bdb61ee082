"""A MODEL of hostapd: models/hostapd.py's control interface, with the world's time and air. And one of odid-beacons, which
writes down how many beacons the chip has sent."""

import socket

from models.hostapd import BEACON_INTERVAL_TU, BSSID, CHANNEL, ControlInterface

BEACON_US = BEACON_INTERVAL_TU * 1024
COUNT_EVERY_US = 500_000


class Hostapd(ControlInterface):
    def __init__(self, world, air, folder, iface="wlan0", answers_us=(2_000, 8_000)):
        super().__init__(iface)
        self.world, self.air, self.path, self.answers_us = world, air, folder / iface, answers_us
        self.socket = None
        self._next_us = world.now_us
        self._heard, self._sent = None, 0
        folder.mkdir(parents=True, exist_ok=True)
        air.radios.append(self._send)
        self.start()
        self._count = world.root / "run/odid-beacons/count"
        self._count.parent.mkdir(parents=True)
        self._write_count()

    def _write_count(self):
        self._send(self.world.now_us)
        new = self._count.with_suffix(".new")
        new.write_text(f"{self.world.now_us // 1000} {self._sent} - seen\n")
        new.rename(self._count)
        self.world.after(COUNT_EVERY_US, self._write_count)

    def start(self):
        """Its beacons begin without an element, whatever was in them before."""
        self._send(self.world.now_us)
        self.forget()
        self.switched_on, self._heard = True, None
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
            if self.socket and self.sends:
                self._sent += 1
                self.air.hear(self._heard, self._next_us)
            self._next_us += BEACON_US
