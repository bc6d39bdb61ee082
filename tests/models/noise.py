"""What else may be on the MAVLink port: another aircraft, a ground station, another transmitter, dirt."""

import os
import random
import socket
import sys
import time

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import common  # noqa: E402


def frames(count):
    """(sender's number, bytes): each sender is a socket of its own."""
    other = common.MAVLink(None, srcSystem=9, srcComponent=1)
    yield 0, common.MAVLink_heartbeat_message(2, 3, 0x81, 0, 4, 3).pack(other)
    yield 0, common.MAVLink_global_position_int_message(count * 100, 100000000, 100000000, 90000, 9000,
                                                        100, 100, 0, 0).pack(other)
    station = common.MAVLink(None, srcSystem=255, srcComponent=190)
    yield 1, common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3).pack(station)
    transmitter = common.MAVLink(None, srcSystem=1, srcComponent=237)
    yield 2, common.MAVLink_open_drone_id_basic_id_message(0, 0, [0] * 20, 1, 1, list(b"WRONG5WRONG" + bytes(9))
                                                           ).pack(transmitter)
    heard = common.MAVLink(None, srcSystem=1, srcComponent=1)
    yield 3, common.MAVLink_open_drone_id_basic_id_message(
        0, 0, [1] * 20, 1, 1, list(b"OTHER5AIRCR" + bytes(9))).pack(heard)
    yield 4, random.Random(count).randbytes(40)


def main():
    port = int(sys.argv[1])
    senders = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in range(5)]
    count = 0
    while True:
        for sender, frame in frames(count):
            senders[sender].sendto(frame, ("127.0.0.1", port))
        count += 1
        time.sleep(0.1)


if __name__ == "__main__":
    main()
