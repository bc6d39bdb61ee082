"""Telemetry logs (.tlog): a big-endian microsecond stamp before each MAVLink frame."""

import os
import struct

# The dialect's message fields as MAVLink 2 has them; MAVLink 1 frames are read with the same.
os.environ.setdefault("MAVLINK20", "1")

from pymavlink.dialects.v20 import common as mavlink  # noqa: E402

STAMP = 8
MAGIC_1, MAGIC_2 = 0xFE, 0xFD
SIGNED = 0x01  # MAVLink 2 incompatibility flag: 13 octets of signature follow


LATEST_S = 4102444800.0  # the year 2100
LATER_S = 3600.0  # a stamp that is so much later than the next one is none


class LogError(ValueError):
    """Not a telemetry log."""


class Log(list):
    """(seconds since 1970, bytes) of each frame, in order."""
    damaged_parts = 0  # left out
    damaged_octets = 0


def frame_length(data, at):
    """How long the frame is whose magic stands there; 0 when it isn't whole."""
    if len(data) < at + 3:
        return 0
    length = 8 + data[at + 1]
    if data[at] == MAGIC_2:
        length = 12 + data[at + 1] + (13 if data[at + 2] & SIGNED else 0)
    return length if len(data) >= at + length else 0


def _stamp_s(data, at):
    return int.from_bytes(data[at:at + STAMP], "big") / 1e6


def _whole(data, at):
    """The length of the stamped frame there; 0 when what stands there, or behind it, is none."""
    if data[at + STAMP:at + STAMP + 1] not in (bytes((MAGIC_1,)), bytes((MAGIC_2,))) or _stamp_s(data, at) > LATEST_S:
        return 0
    end = at + STAMP + frame_length(data, at + STAMP)
    if end == at + STAMP or end + STAMP >= len(data):
        return end - at - STAMP
    follows = data[end + STAMP] in (MAGIC_1, MAGIC_2) and _stamp_s(data, at) - _stamp_s(data, end) < LATER_S
    return end - at - STAMP if follows else 0


def read(path):
    """The frames of a log. Damaged parts are left out and counted; the last frame may be cut short."""
    data = open(path, "rb").read()
    frames, at, damaged = Log(), 0, None
    while at + STAMP < len(data):
        length = _whole(data, at)
        if length:
            if damaged is not None:
                frames.damaged_parts += 1
                frames.damaged_octets += at - damaged
                damaged = None
            frames.append((_stamp_s(data, at), data[at + STAMP:at + STAMP + length]))
            at += STAMP + length
        else:
            damaged = at if damaged is None else damaged
            at += 1
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


def number(frame):
    return frame[4] if frame[0] == MAGIC_2 else frame[2]


def sender(frame):
    """(system, component)."""
    return (frame[5], frame[6]) if frame[0] == MAGIC_2 else (frame[3], frame[4])


def renumbered(frame, steps):
    """A frame whose number is so many steps later; one of a message that nobody knows stays as it is."""
    second = frame[0] == MAGIC_2
    number_at, header = (4, 10) if second else (2, 6)
    end = header + frame[1]
    known = mavlink.mavlink_map.get(int.from_bytes(frame[7:10], "little") if second else frame[5])
    if not steps or not known:
        return frame
    made = bytearray(frame)
    made[number_at] = (made[number_at] + steps) & 0xFF
    crc = mavlink.x25crc(bytes(made[1:end]))
    crc.accumulate(bytes([known.crc_extra]))
    made[end:end + 2] = struct.pack("<H", crc.crc)
    return bytes(made)


def as_record(message):
    """Name, sender and fields, as JSON takes them; the name is "mavpackettype": HEARTBEAT has a "type"."""
    fields = message.to_dict()
    record = {"mavpackettype": fields.pop("mavpackettype"), "sysid": message.get_srcSystem(),
              "compid": message.get_srcComponent()}
    for name, value in fields.items():
        record[name] = list(value) if isinstance(value, (bytes, bytearray)) else value
    return record
