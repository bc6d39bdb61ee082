"""Keeps the judge's Wi-Fi capture: takes the emulated machine's pcap stream, stamps each frame with
this machine's time of arrival and appends it to a file.

The guest's own stamps are no use: the appliance sets its clock by the autopilot's, and tests step it.
The stream may end and begin again, with each boot and each restart of the capture.
"""

import argparse
import os
import socket
import struct
import sys
import time

MAGIC = 0xA1B2C3D4
HEADER, RECORD = struct.Struct("<IHHiIII"), struct.Struct("<IIII")
LARGEST = 65535


class Stream:
    """Cuts one stream into frames."""

    def __init__(self):
        self._buffer = bytearray()

    def feed(self, data):
        """Yields (link type, None) at a stream's beginning, (None, frame) for each frame."""
        self._buffer += data
        while len(self._buffer) >= RECORD.size:
            if int.from_bytes(self._buffer[:4], "little") == MAGIC:
                if len(self._buffer) < HEADER.size:
                    return
                yield HEADER.unpack_from(self._buffer)[6], None
                del self._buffer[:HEADER.size]
                continue
            _, _, length, _ = RECORD.unpack_from(self._buffer)
            if length > LARGEST:
                self._skip(f"a frame of {length} octets")
                continue
            if len(self._buffer) < RECORD.size + length:
                return
            yield None, bytes(self._buffer[RECORD.size:RECORD.size + length])
            del self._buffer[:RECORD.size + length]

    def _skip(self, found):
        """The capture was ended in the middle of a frame: on to where it begins again."""
        at = self._buffer.find(MAGIC.to_bytes(4, "little"), 1)
        lost = at if at > 0 else len(self._buffer) - 3
        print(f"no pcap: {found}; left out {lost} octets", file=sys.stderr, flush=True)
        del self._buffer[:lost]


def record(stream, out):
    """One connection, to its end. What is in the file is always whole records."""
    cutter = Stream()
    while data := stream.recv(65536):
        seconds, micros = divmod(time.time_ns() // 1000, 1_000_000)
        for link_type, frame in cutter.feed(data):
            if frame is not None:
                out.write(RECORD.pack(seconds, micros, len(frame), len(frame)) + frame)
            elif out.tell() == 0:
                out.write(HEADER.pack(MAGIC, 2, 4, 0, 0, LARGEST, link_type))
        out.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--listen", required=True, metavar="SOCKET", help="UNIX socket for the machine")
    parser.add_argument("--out", required=True, metavar="PCAP")
    arguments = parser.parse_args()
    with socket.socket(socket.AF_UNIX) as listener, open(arguments.out, "ab") as out:
        listener.bind(arguments.listen + ".new")
        listener.listen()
        os.replace(arguments.listen + ".new", arguments.listen)  # who sees it can connect
        while True:
            stream, _ = listener.accept()
            with stream:
                record(stream, out)


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
