"""Decodes Open Drone ID messages (25 octets each) and message packs.

Layout: ASTM F3411-22a as published in the open message headers.  All integers
are little-endian; octet 0 holds the message type in its high nibble and the
protocol version in its low one.  Each decoded class has the physical value of
every field; ``None`` is "unknown", never a number.  Decoding never judges:
`ranges.py` and `structure.py` hold the rules.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from functools import lru_cache
from typing import ClassVar

MESSAGE_OCTETS = 25
PACK_HEADER_OCTETS = 3
PACK_MAX_MESSAGES = 9
PACK_TYPE = 0xF
PROTOCOL_VERSION = 2
APPLICATION_CODE = 0x0D
SYSTEM_EPOCH_UNIX_S = 1546300800  # 2019-01-01 00:00:00 UTC

TYPE_NAMES = {0: "basic_id", 1: "location", 2: "authentication",
              3: "self_id", 4: "system", 5: "operator_id"}
UA_TYPES = ("none", "aeroplane", "helicopter/multirotor", "gyroplane", "hybrid lift",
            "ornithopter", "glider", "kite", "free balloon", "captive balloon", "airship",
            "parachute", "rocket", "tethered", "ground obstacle", "other")
ID_TYPES = ("none", "serial number", "registration", "UTM UUID", "session ID")
STATUS_NAMES = ("undeclared", "ground", "airborne", "emergency", "RID failure")
STATUS_EMERGENCY = 3
STATUS_SYSTEM_FAILURE = 4
EU_CATEGORIES = ("undeclared", "open", "specific", "certified")
EU_CLASSES = ("undeclared", "C0", "C1", "C2", "C3", "C4", "C5", "C6")

LOCATION_TIMESTAMP_UNKNOWN = 0xFFFF


class MessageError(ValueError):
    """These octets are no message or pack; the text says which rule they break."""


@dataclass(frozen=True)
class Message:
    type_number: ClassVar[int]
    type_name: ClassVar[str]
    raw: bytes = field(repr=False)

    def __init_subclass__(cls) -> None:
        cls.type_name = TYPE_NAMES[cls.type_number]

    @property
    def version(self) -> int:
        return self.raw[0] & 0x0F

    @property
    def content_key(self) -> tuple:
        """Tells apart messages of one type that stand side by side."""
        return (self.type_number,)


@dataclass(frozen=True)
class BasicId(Message):
    type_number = 0
    id_type: int
    ua_type: int
    uas_id: bytes  # 20 octets with their padding

    @property
    def text(self) -> str:
        """The identifier to show: text, or hexadecimal for the two binary kinds."""
        if self.id_type in (3, 4):
            return self.uas_id.hex()
        return printable(self.uas_id)

    @property
    def content_key(self) -> tuple:
        return (self.type_number, self.id_type)


@dataclass(frozen=True)
class Location(Message):
    type_number = 1
    status: int
    height_above_ground: bool
    direction_deg: float | None
    speed_m_s: float | None
    vertical_speed_m_s: float | None  # positive is up
    latitude_deg: float | None
    longitude_deg: float | None
    pressure_altitude_m: float | None
    geodetic_altitude_m: float | None  # above the WGS-84 ellipsoid
    height_m: float | None
    horizontal_accuracy: int
    vertical_accuracy: int
    pressure_accuracy: int
    speed_accuracy: int
    timestamp_s: float | None  # since the last full UTC hour
    timestamp_accuracy_s: float | None

    @property
    def content(self) -> tuple:
        """What makes one Location newer than another: everything measured, and
        not the status, which changes without a new position."""
        return self.raw[2:23]


@dataclass(frozen=True)
class Authentication(Message):
    type_number = 2
    auth_type: int
    page: int
    last_page: int | None  # page 0 only
    length: int | None  # page 0 only
    unix_s: int | None  # page 0 only
    data: bytes

    @property
    def content_key(self) -> tuple:
        return (self.type_number, self.page)


@dataclass(frozen=True)
class SelfId(Message):
    type_number = 3
    description_type: int
    description: bytes  # 23 octets with their padding

    @property
    def text(self) -> str:
        return printable(self.description)


@dataclass(frozen=True)
class System(Message):
    type_number = 4
    operator_location_type: int
    classification_type: int
    operator_latitude_deg: float | None
    operator_longitude_deg: float | None
    area_count: int
    area_radius_m: int
    area_ceiling_m: float | None
    area_floor_m: float | None
    category: int
    eu_class: int
    operator_altitude_m: float | None
    unix_s: int | None  # None: 0, or a protocol version that has no such field


@dataclass(frozen=True)
class OperatorId(Message):
    type_number = 5
    operator_id_type: int
    operator_id: bytes  # 20 octets with their padding

    @property
    def text(self) -> str:
        return printable(self.operator_id)


def printable(padded: bytes) -> str:
    """Text up to the first NUL; anything that isn't printable ASCII is escaped."""
    text = padded.split(b"\0", 1)[0]
    return "".join(chr(c) if 0x20 <= c < 0x7F else f"\\x{c:02x}" for c in text)


def _altitude_m(encoded: int) -> float | None:
    """Half metres above -1000 m; 0 (-1000 m) is unknown."""
    return None if encoded == 0 else encoded * 0.5 - 1000.0


def _position_deg(latitude_e7: int, longitude_e7: int) -> tuple[float | None, float | None]:
    """Both zero is unknown; one zero is the equator or the Greenwich meridian."""
    if latitude_e7 == 0 and longitude_e7 == 0:
        return None, None
    return latitude_e7 / 1e7, longitude_e7 / 1e7


def _decode_basic_id(raw: bytes) -> BasicId:
    return BasicId(raw, id_type=raw[1] >> 4, ua_type=raw[1] & 0x0F, uas_id=raw[2:22])


def _decode_location(raw: bytes) -> Location:
    (flags, direction, speed, vertical, latitude, longitude, pressure, geodetic, height,
     accuracy, accuracy_2, timestamp, timestamp_accuracy) = struct.unpack_from("<BBBbiiHHHBBHB", raw, 1)
    direction_deg = direction + (180 if flags & 0x02 else 0)
    if flags & 0x01:  # above 63.75 m/s the steps are 0.75 m/s wide
        speed_m_s = speed * 0.75 + 63.75
    else:
        speed_m_s = speed * 0.25
    latitude_deg, longitude_deg = _position_deg(latitude, longitude)
    return Location(
        raw, status=flags >> 4, height_above_ground=bool(flags & 0x04),
        direction_deg=None if direction_deg == 361 else float(direction_deg),
        speed_m_s=None if speed_m_s == 255.0 else speed_m_s,
        vertical_speed_m_s=None if vertical == 126 else vertical * 0.5,
        latitude_deg=latitude_deg, longitude_deg=longitude_deg,
        pressure_altitude_m=_altitude_m(pressure), geodetic_altitude_m=_altitude_m(geodetic),
        height_m=_altitude_m(height),
        horizontal_accuracy=accuracy & 0x0F, vertical_accuracy=accuracy >> 4,
        speed_accuracy=accuracy_2 & 0x0F, pressure_accuracy=accuracy_2 >> 4,
        timestamp_s=None if timestamp == LOCATION_TIMESTAMP_UNKNOWN else timestamp / 10,
        timestamp_accuracy_s=(timestamp_accuracy & 0x0F) / 10 or None)


def _decode_authentication(raw: bytes) -> Authentication:
    page = raw[1] & 0x0F
    if page:
        return Authentication(raw, raw[1] >> 4, page, None, None, None, raw[2:25])
    last_page, length, seconds = struct.unpack_from("<BBI", raw, 2)
    return Authentication(raw, raw[1] >> 4, page, last_page, length,
                          SYSTEM_EPOCH_UNIX_S + seconds if seconds else None, raw[8:25])


def _decode_self_id(raw: bytes) -> SelfId:
    return SelfId(raw, description_type=raw[1], description=raw[2:25])


def _decode_system(raw: bytes) -> System:
    (flags, latitude, longitude, count, radius, ceiling, floor, classification, altitude,
     seconds) = struct.unpack_from("<BiiHBHHBHI", raw, 1)
    latitude_deg, longitude_deg = _position_deg(latitude, longitude)
    has_timestamp = raw[0] & 0x0F >= 2  # new in protocol version 2
    return System(
        raw, operator_location_type=flags & 0x03, classification_type=flags >> 2 & 0x07,
        operator_latitude_deg=latitude_deg, operator_longitude_deg=longitude_deg,
        area_count=count, area_radius_m=radius * 10,
        area_ceiling_m=_altitude_m(ceiling), area_floor_m=_altitude_m(floor),
        category=classification >> 4, eu_class=classification & 0x0F,
        operator_altitude_m=_altitude_m(altitude),
        unix_s=SYSTEM_EPOCH_UNIX_S + seconds if seconds and has_timestamp else None)


def _decode_operator_id(raw: bytes) -> OperatorId:
    return OperatorId(raw, operator_id_type=raw[1], operator_id=raw[2:22])


_DECODERS = {0: _decode_basic_id, 1: _decode_location, 2: _decode_authentication,
             3: _decode_self_id, 4: _decode_system, 5: _decode_operator_id}


def decode_message(raw: bytes) -> Message:
    """One message of exactly 25 octets."""
    if len(raw) != MESSAGE_OCTETS:
        raise MessageError(f"a message has {MESSAGE_OCTETS} octets, this one {len(raw)}")
    return _decoded(bytes(raw))


@lru_cache(maxsize=4096)  # a radio repeats each message tens of times
def _decoded(raw: bytes) -> Message:
    decoder = _DECODERS.get(raw[0] >> 4)
    if decoder is None:
        raise MessageError(f"message type {raw[0] >> 4:#x} doesn't exist")
    return decoder(raw)


def is_pack(body: bytes) -> bool:
    return bool(body) and body[0] >> 4 == PACK_TYPE


def decode_pack(body: bytes) -> list[Message]:
    """A message pack: header octet, size octet 25, count 1..9, then the messages.

    Octets behind the last message are left alone, as receivers do (`structure.py`
    reports them)."""
    if len(body) < PACK_HEADER_OCTETS:
        raise MessageError(f"a pack has a header of 3 octets, this one has {len(body)} in all")
    size, count = body[1], body[2]
    if size != MESSAGE_OCTETS:
        raise MessageError(f"the pack's message size is {size}, not 25: receivers drop it whole")
    if not 1 <= count <= PACK_MAX_MESSAGES:
        raise MessageError(f"the pack says {count} messages, 1 to 9 are allowed: receivers drop it whole")
    expected = PACK_HEADER_OCTETS + count * MESSAGE_OCTETS
    if len(body) < expected:
        raise MessageError(f"a pack of {count} messages has {expected} octets, this one {len(body)}")
    return [decode_message(body[start:start + MESSAGE_OCTETS])
            for start in range(PACK_HEADER_OCTETS, expected, MESSAGE_OCTETS)]


def decode_body(body: bytes) -> list[Message]:
    """What follows the message counter: one message or a pack."""
    if not body:
        raise MessageError("nothing follows the message counter")
    return decode_pack(body) if is_pack(body) else [decode_message(body)]
