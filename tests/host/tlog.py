"""Telemetry logs (.tlog): a big-endian microsecond stamp before each MAVLink frame."""

import os

# The dialect's message fields as MAVLink 2 has them; MAVLink 1 frames are read with the same.
os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import common as mavlink  # noqa: E402

STAMP = 8
MAGIC_1, MAGIC_2 = 0xFE, 0xFD
SIGNED = 0x01  # MAVLink 2 incompatibility flag: 13 octets of signature follow


class LogError(ValueError):
    """Not a telemetry log."""


def frame_length(data, at):
    """How long the frame is that begins there; 0 when it isn't whole."""
    if len(data) < at + 3:
        return 0
    if data[at] == MAGIC_1:
        length = 8 + data[at + 1]
    elif data[at] == MAGIC_2:
        length = 12 + data[at + 1] + (13 if data[at + 2] & SIGNED else 0)
    else:
        raise LogError(f"octet {at}: no MAVLink frame (0x{data[at]:02x})")
    return length if len(data) >= at + length else 0


def read(path):
    """The frames of a log as (seconds since 1970, bytes); its last one may be cut short."""
    data = open(path, "rb").read()
    frames, at = [], 0
    while at + STAMP < len(data):
        time_s = int.from_bytes(data[at:at + STAMP], "big") / 1e6
        try:
            length = frame_length(data, at + STAMP)
        except LogError as error:
            raise LogError(f"{path}: {error}") from error
        if length == 0:
            break
        frames.append((time_s, data[at + STAMP:at + STAMP + length]))
        at += STAMP + length
    if not frames:
        raise LogError(f"{path}: no MAVLink frame in it")
    return frames


class Decoder:
    """Frames and byte streams to messages, by pymavlink."""

    def __init__(self):
        self._mavlink = mavlink.MAVLink(None)
        self._mavlink.robust_parsing = True

    def messages(self, data):
        """What is whole in a stream so far; what it can't read is left out."""
        found = self._mavlink.parse_buffer(data) or []
        return [message for message in found if message.get_type() != "BAD_DATA"]


def as_record(message):
    """Name, sender and fields, as JSON takes them; the name is "mavpackettype": HEARTBEAT has a "type"."""
    fields = message.to_dict()
    record = {"mavpackettype": fields.pop("mavpackettype"), "sysid": message.get_srcSystem(),
              "compid": message.get_srcComponent()}
    for name, value in fields.items():
        record[name] = list(value) if isinstance(value, (bytes, bytearray)) else value
    return record
