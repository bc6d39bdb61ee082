"""Wi-Fi as a station sees it: a capture's frames and their elements; and one that tries to get in."""

import struct
from itertools import pairwise
from pathlib import Path

from models.air import FIXED_FIELDS, VENDOR_ELEMENT

PCAP_HEADER, PCAP_RECORD = 24, 16
BEACON, PROBE_RESPONSE = 0x80, 0x50
BEACON_INTERVAL_S = 0.1024  # hostapd.conf's 100 TU


def frames(path, kind, since=0.0):
    """(Unix time, elements) of the capture's frames of one kind."""
    data, at = Path(path).read_bytes(), PCAP_HEADER
    while at + PCAP_RECORD <= len(data):
        seconds, micros, length, _ = struct.unpack_from("<IIII", data, at)
        packet = data[at + PCAP_RECORD:at + PCAP_RECORD + length]
        at += PCAP_RECORD + length
        frame = packet[int.from_bytes(packet[2:4], "little"):]
        if frame[:1] == bytes([kind]) and seconds + micros / 1e6 >= since:
            yield seconds + micros / 1e6, frame[FIXED_FIELDS:]


def standstills(path, late_s=0.05):
    """(Unix time of its end, seconds): when the emulated machine stood still, as its beacons tell. Its kernel sends them by a
    timer, whatever its programs do: one is late, and the next one is where it would have been."""
    intervals = list(pairwise(at for at, _ in frames(path, BEACON)))
    for (before, late), (_, after) in pairwise(intervals):
        if late - before > BEACON_INTERVAL_S + late_s and after - late < BEACON_INTERVAL_S - late_s / 2:
            yield late, late - before - BEACON_INTERVAL_S


def elements(row):
    at = 0
    while at + 1 < len(row):
        yield row[at], row[at + 2:at + 2 + row[at + 1]]
        at += 2 + row[at + 1]


def pack(row):
    for number, value in elements(row):
        if number == 221 and value.startswith(VENDOR_ELEMENT):
            return value[len(VENDOR_ELEMENT):]
    return None


def station(machine, key, seconds=12):
    """A station with this key tries to get in. Its log."""
    ssid = machine.must("cat /data/secrets/wifi_ssid").strip()
    network = f'network={{\nssid="{ssid}"\npsk="{key}"\nscan_ssid=1\nscan_freq=2437\n}}\n'
    machine.put("/tmp/station.conf", network.encode(), "600")
    machine.must("ip link set wlan2 up")
    return machine.must(f"timeout {seconds} wpa_supplicant -i wlan2 -c /tmp/station.conf; true")
