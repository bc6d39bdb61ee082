"""The field study's transmitter schedule, as a MODEL in the same bench, for comparison.

Two independent deadlines looked at on a 50 ms tick: Location every 1000 ms, and one of the other
four messages every 750 ms. Legacy advertising at 100 ms, the payload rewritten at each deadline.
Every 3 s both fall into one tick: the second payload replaces the first before the controller has
sent it. The model's own log, like the study's, knows nothing of that: only a receiver does.

The tick is a plain sleep and deadlines are counted in ticks. That is our reading of the published
figures: absolute deadlines would give a mean of 1.000 s, not 1.005 s.
"""

import argparse
import itertools
import json
import socket
import struct
import sys
import time

LOCATION_TICKS, OTHER_TICKS, TICK_S = 20, 15, 0.050
INTERVAL_100_MS = 0x00A0
START_LATITUDE_E7, START_LONGITUDE_E7 = 577089000, 119746000


def basic_id():
    return bytes([0x02, 0x11]) + b"SSRS5GBG01".ljust(20, b"\0") + bytes(3)


def location(count):
    """Moving north at 20 m/s; every one differs from the one before."""
    return struct.pack("<BBBBbiiHHHBBHBB", 0x12, 0x20, 0, 80, 0, START_LATITUDE_E7 + count * 1800,
                       START_LONGITUDE_E7, 0, 2200, 2100, 0, 0, count * 10 % 36000, 0, 0)


def self_id():
    return bytes([0x32, 0]) + b"Sea rescue surveillance"


def system():
    return struct.pack("<BBiiHBHHBHIB", 0x42, 0x04, START_LATITUDE_E7, START_LONGITUDE_E7, 1, 0, 0, 0,
                       0x13, 0, 0, 0)


def operator_id():
    return bytes([0x52, 0]) + b"SWE3jxza7qbzvu5d".ljust(20, b"\0") + bytes(3)


class Controller:
    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.events = self.socket.makefile("rb")
        self.command(0x0C03, b"")
        self.command(0x2005, bytes([0x01, 0x02, 0x03, 0x04, 0x05, 0xC6]))
        self.command(0x2006, struct.pack("<HHBBB6sBB", INTERVAL_100_MS, INTERVAL_100_MS, 3, 1, 0,
                                         bytes(6), 7, 0))

    def command(self, opcode, parameters):
        self.socket.sendall(struct.pack("<BHB", 1, opcode, len(parameters)) + parameters)
        # Has to be asked for each time: without it every answer comes 40 ms late (front.py says why).
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
        event = self.events.read(3)
        event += self.events.read(event[2])
        if event[:2] != b"\x04\x0e" or event[6] != 0:
            sys.exit(f"the controller refused command 0x{opcode:04x}: {event.hex()}")

    def advertise(self, message, counter):
        data = bytes([0x1E, 0x16, 0xFA, 0xFF, 0x0D, counter]) + message
        self.command(0x2008, bytes([len(data)]) + data)


def run(port, seconds):
    """Returns the instants at which the model believes it sent a Location."""
    controller, counters, log = Controller(port), [0] * 6, []
    others = [(0, basic_id), (4, system), (5, operator_id), (3, self_id)]
    controller.advertise(location(0), 0)
    controller.command(0x200A, b"\x01")
    end, turn = time.monotonic() + seconds, 0
    for tick in itertools.count():
        if time.monotonic() >= end:
            break
        if tick % LOCATION_TICKS == 0:
            counters[1] = counters[1] + 1 & 0xFF
            controller.advertise(location(len(log)), counters[1])
            log.append(time.monotonic())
        if tick % OTHER_TICKS == 0:
            kind, build = others[turn % len(others)]
            controller.advertise(build(), counters[kind])
            turn += 1
        time.sleep(TICK_S)
    return log


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--hci-port", type=int, required=True)
    parser.add_argument("--seconds", type=float, default=60)
    arguments = parser.parse_args()
    log = run(arguments.hci_port, arguments.seconds)
    gaps = [later - earlier for earlier, later in zip(log, log[1:])]
    mean = sum(gaps) / len(gaps)
    print(json.dumps({"host_location_mean_s": round(mean, 4),
                      "host_location_sigma_ms": round(1000 * (sum((gap - mean) ** 2 for gap in gaps)
                                                              / len(gaps)) ** 0.5, 2),
                      "host_location_max_s": round(max(gaps), 4)}))


if __name__ == "__main__":
    main()
