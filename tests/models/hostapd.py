"""A MODEL of hostapd: its control interface, scripted, and the beacons that would be on the air.

Speaks hostapd's protocol on a UNIX datagram socket (<dir>/<iface>): PING, STATUS, SET
vendor_elements, UPDATE_BEACON, DISABLE, ENABLE. As hostapd does, it takes an element at SET and sends it from the
next UPDATE_BEACON on. Each beacon (102.4 ms) goes into a growing pcap, a whole 802.11 frame behind
a radiotap header, time stamped and flushed: that is what the judge hears. Nothing of it is real
radio; hostapd itself is part of the system bench.

Orders, one a line on standard input, each answered by "done" or "error: ...":
  fail N              the next N SETs are answered FAIL
  mute | unmute       requests are swallowed, beacons go on
  disabled | enabled  STATUS says so; no beacon while disabled
  delay MS            each answer comes this late
  forget              drops the element, as a reconfigured hostapd does
  refuse N            the chip refuses the next N changes of its elements
  limit OCTETS        it refuses longer ones; 0: none is too long
  silence | speak     the chip says OK to everything, and sends no beacon

Between hostapd and the chip there is a driver that does as brcmfmac: it takes for set what it was told, whatever the chip says;
has that one deleted before it has another one added; and has nothing to do where it is told the same again.
"""

import argparse
import heapq
import itertools
import os
import selectors
import socket
import struct
import sys
import time
from pathlib import Path

from .orders import Orders

BEACON_INTERVAL_TU = 100
BEACON_INTERVAL_S = BEACON_INTERVAL_TU * 1024e-6
REQUEST_MAX = 4096  # hostapd's CTRL_IFACE_MAX_LEN
BSSID = bytes.fromhex("02524944f001")  # locally administered
SSID = b"odid-bench"
CHANNEL, FREQUENCY_MHZ = 6, 2437
DLT_IEEE802_11_RADIO = 127

ELEMENT_SSID, ELEMENT_RATES, ELEMENT_DS, ELEMENT_RSN = 0, 1, 3, 48
# 1, 2, 5.5 and 11 Mbit/s as basic rates, 6 to 18 besides; units of 500 kbit/s.
RATES = bytes([0x82, 0x84, 0x8B, 0x96, 12, 18, 24, 36])
# WPA2: group and pairwise CCMP, key management by a pre-shared key.
RSN = bytes.fromhex("0100" "000fac04" "0100" "000fac04" "0100" "000fac02" "0000")
# ESS, privacy, short slot time.
CAPABILITIES = 0x0411
# Flags, rate and channel are present; no FCS, 1 Mbit/s, 2.4 GHz CCK.
RADIOTAP = struct.pack("<BBHIBBHH", 0, 0, 14, 1 << 1 | 1 << 2 | 1 << 3, 0, 2, FREQUENCY_MHZ, 0x00A0)


def element(number, body):
    return bytes([number, len(body)]) + body


def beacon(sequence, uptime_us, vendor_elements):
    """One beacon frame, radiotap header included."""
    header = struct.pack("<HH6s6s6sH", 0x0080, 0, b"\xff" * 6, BSSID, BSSID, (sequence & 0xFFF) << 4)
    fixed = struct.pack("<QHH", uptime_us, BEACON_INTERVAL_TU, CAPABILITIES)
    elements = (element(ELEMENT_SSID, SSID) + element(ELEMENT_RATES, RATES)
                + element(ELEMENT_DS, bytes([CHANNEL])) + element(ELEMENT_RSN, RSN))
    return RADIOTAP + header + fixed + elements + vendor_elements


class Pcap:
    """A growing capture; a started one is continued, as when hostapd restarts."""

    def __init__(self, path):
        self._file = open(path, "ab")
        if self._file.tell() == 0:
            self._file.write(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535,
                                         DLT_IEEE802_11_RADIO))
            self._file.flush()

    def write(self, frame):
        now_us = time.time_ns() // 1000
        # In one piece: whoever follows the file mustn't see half a record.
        self._file.write(struct.pack("<IIII", now_us // 1000000, now_us % 1000000, len(frame),
                                     len(frame)) + frame)
        self._file.flush()


class ControlInterface:
    """What hostapd answers, and what is in its beacons by that. It has neither a socket nor a clock: the simulated world
    (tests/simulated) has another of each."""

    def __init__(self, iface):
        self.iface = iface
        self.given = b""  # by SET
        self.fail, self.muted, self.delay_s = 0, False, 0.0
        self.enabled, self.switched_on = True, True  # by orders; by requests
        self.refusals, self.limit, self.silent = 0, 0, False
        self.forget()

    def forget(self):
        """As a reconfigured hostapd, a driver and its chip do."""
        self.given, self._driver, self._chip = b"", b"", []

    @property
    def active(self):
        """What is in the beacons."""
        return b"".join(self._chip)

    @property
    def sends(self):
        return self.enabled and self.switched_on and not self.silent

    def status(self):
        state = "ENABLED" if self.enabled and self.switched_on else "DISABLED"
        return (f"state={state}\nphy=phy0\nfreq={FREQUENCY_MHZ}\nnum_sta_non_erp=0\n"
                f"channel={CHANNEL}\nbeacon_int={BEACON_INTERVAL_TU}\ndtim_period=2\n"
                f"bss[0]={self.iface}\nbssid[0]={BSSID.hex(':')}\nssid[0]={SSID.decode()}\n"
                f"num_sta[0]=0\n")

    def set_elements(self, text):
        if self.fail > 0:
            self.fail -= 1
            return "FAIL\n"
        try:
            self.given = bytes.fromhex(text)
        except ValueError:
            return "FAIL\n"
        return "OK\n"

    def _update(self):
        """What the driver says."""
        if self.given == self._driver:
            return True
        before, self._driver = self._driver, self.given
        if self.refusals > 0 and self.given:
            self.refusals -= 1
            return False
        if before:
            if before not in self._chip:
                return False
            self._chip.remove(before)
        if 0 < self.limit < len(self.given):
            return False
        self._chip += [self.given] if self.given else []
        return True

    def answer(self, request):
        command, *words = request.split(" ", 2)
        if request == "PING":
            return "PONG\n"
        if request == "STATUS":
            return self.status()
        if command == "SET":
            variable, *text = words or [""]
            return self.set_elements(*text) if variable == "vendor_elements" and text else "FAIL\n"  # no other one is modelled
        if request == "UPDATE_BEACON":
            return "OK\n" if self.enabled and self.switched_on and self._update() else "FAIL\n"
        if request in ("DISABLE", "ENABLE"):
            self.switched_on = request == "ENABLE"
            self.forget()
            return "OK\n"
        return "UNKNOWN COMMAND\n"

    def obey(self, words):
        order, *values = words or [""]
        if order == "fail" and len(values) == 1:
            self.fail = int(*values)
        elif words in (["mute"], ["unmute"]):
            self.muted = order == "mute"
        elif words in (["disabled"], ["enabled"]):
            self.enabled = order == "enabled"
        elif order == "delay" and len(values) == 1:
            self.delay_s = float(*values) / 1000
        elif order == "refuse" and len(values) == 1:
            self.refusals = int(*values)
        elif order == "limit" and len(values) == 1:
            self.limit = int(*values)
        elif words in (["silence"], ["speak"]):
            self.silent = order == "silence"
        elif words == ["forget"]:
            self.forget()
        else:
            raise ValueError(f"unknown order {' '.join(words)!r}")


class Hostapd(ControlInterface):
    def __init__(self, folder, iface, pcap):
        super().__init__(iface)
        self.path = folder / iface
        folder.mkdir(parents=True, exist_ok=True)
        self.path.unlink(missing_ok=True)  # a killed one's
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.socket.bind(str(self.path))
        os.chmod(self.path, 0o666)  # whatever user the daemon becomes
        self.pcap = Pcap(pcap)
        self.answers, self.number = [], itertools.count()  # due, number, text, address
        self.orders = Orders(self.obey)

    # --- requests and orders --------------------------------------------------

    def on_request(self):
        request, sender = self.socket.recvfrom(REQUEST_MAX)
        if self.muted or not sender:  # unbound: there is nowhere to answer to
            return
        text = self.answer(request.decode("ascii", "replace"))
        heapq.heappush(self.answers, (time.monotonic() + self.delay_s, next(self.number), text,
                                      sender))

    def send_answers(self, now):
        while self.answers and self.answers[0][0] <= now:
            _, _, text, sender = heapq.heappop(self.answers)
            try:
                self.socket.sendto(text.encode(), sender)
            except OSError as error:  # whoever asked has gone: hostapd goes on as well
                print(f"no answer to {sender}: {error}", file=sys.stderr, flush=True)

    def on_order(self):
        if not self.orders.take():
            raise SystemExit(0)  # whoever started us is gone

    # --- the air ------------------------------------------------------------

    def run(self):
        selector = selectors.DefaultSelector()
        selector.register(self.socket, selectors.EVENT_READ, self.on_request)
        selector.register(sys.stdin.fileno(), selectors.EVENT_READ, self.on_order)
        start = due = time.monotonic()
        sequence = 0
        print("done", flush=True)
        while True:
            wake = min([due] + [answer[0] for answer in self.answers[:1]])
            for key, _ in selector.select(max(0.0, wake - time.monotonic())):
                key.data()
            now = time.monotonic()
            self.send_answers(now)
            if now >= due:
                due += BEACON_INTERVAL_S * (1 + (now - due) // BEACON_INTERVAL_S)
                if self.sends:
                    sequence += 1
                    self.pcap.write(beacon(sequence, int((now - start) * 1e6), self.active))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dir", type=Path, required=True, help="where the control socket goes")
    parser.add_argument("--iface", default="wlan0")
    parser.add_argument("--pcap", type=Path, required=True, help="the beacons, as they go out")
    arguments = parser.parse_args()
    model = Hostapd(arguments.dir, arguments.iface, arguments.pcap)
    try:
        model.run()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
