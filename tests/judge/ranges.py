"""Rules about field values: ranges, reserved bits and values, text, defaults.

Ranges and enumerations from the published message headers (protocol version 2).
Every check works on the encoded octets, so that a value that can't be decoded
is caught as well.
"""

from __future__ import annotations

import struct
import time

from . import messages as m
from .findings import Findings
from .identifiers import operator_problem, serial_problem
from .receptions import Reception

_HOUR_TENTHS = 36000
_DAY_S = 86400


def check_ranges(reception: Reception, message: m.Message, findings: Findings) -> None:
    """Reports every field of one message that is out of range."""
    def bad(field: str, expected, found) -> None:
        findings.violation(f"range.{message.type_name}", reception, f"{message.type_name}: {field}", expected, found)

    _CHECKS[type(message)](message, bad, lambda text: findings.note(f"{reception.channel}: {text}"))


def _text(octets: bytes, field: str, bad) -> None:
    """Printable ASCII, then NUL to the end."""
    text, _, padding = octets.partition(b"\0")
    if any(padding):
        bad(f"{field}: padding", "NUL", padding.hex(" "))
    if any(not 0x20 <= octet < 0x7F for octet in text):
        bad(f"{field}: characters", "printable ASCII", m.printable(text))


def _reserved(value, field: str, bad) -> None:
    octets = value if isinstance(value, bytes) else bytes((value,))
    if any(octets):
        bad(f"{field} is reserved", "0", octets.hex(" "))


def _basic_id(message: m.BasicId, bad, note) -> None:
    if message.id_type > 4:
        bad("ID type", "0 to 4", message.id_type)
    if message.id_type in (3, 4):
        if not any(message.uas_id):
            bad("identifier", "not empty", "all zero")
    else:
        _text(message.uas_id, "identifier", bad)
        if message.id_type == 0 or not message.text:
            bad("identifier", "an ID type and an identifier",
                f"type {message.id_type}, {message.text!r}: counts as no Basic ID")
        elif message.id_type == 1 and (problem := serial_problem(message.text)):
            note(f"CTA-2063-A: {problem}")
    _reserved(message.raw[22:25], "octets 22-24", bad)


def _location(message: m.Location, bad, note) -> None:
    raw = message.raw
    last_status = m.STATUS_SYSTEM_FAILURE if message.version >= 2 else 3
    if message.status > last_status:
        bad("status", f"0 to {last_status}", message.status)
    _reserved(raw[1] & 0x08, "bit 3 of octet 1", bad)
    direction = raw[2] + (180 if raw[1] & 0x02 else 0)
    if direction > 361 or raw[2] > 181:
        bad("direction", "0 to 360 degrees, or 361 unknown", f"{direction} ({raw[1]:#04x} {raw[2]})")
    vertical = struct.unpack_from("<b", raw, 4)[0]
    if not -124 <= vertical <= 124 and vertical != 126:
        bad("vertical speed", "-62 to 62 m/s, or 63 unknown", f"{vertical * 0.5} m/s")
    _coordinates(raw, 5, "", bad)
    for name, value, last in (("horizontal", message.horizontal_accuracy, 12),
                              ("vertical", message.vertical_accuracy, 6),
                              ("pressure altitude", message.pressure_accuracy, 6),
                              ("speed", message.speed_accuracy, 4)):
        if value > last:
            bad(f"{name} accuracy", f"0 to {last}", value)
    tenths = struct.unpack_from("<H", raw, 21)[0]
    if tenths > _HOUR_TENTHS and tenths != m.LOCATION_TIMESTAMP_UNKNOWN:
        bad("timestamp", "0 to 36000 tenths of a second, or 65535 unknown", tenths)
    _reserved(raw[23] & 0xF0, "high half of octet 23", bad)
    _reserved(raw[24], "octet 24", bad)


def _coordinates(raw: bytes, offset: int, whose: str, bad) -> None:
    latitude, longitude = struct.unpack_from("<ii", raw, offset)
    if abs(latitude) > 900000000:
        bad(f"{whose}latitude", "-90 to 90 degrees", latitude / 1e7)
    if abs(longitude) > 1800000000:
        bad(f"{whose}longitude", "-180 to 180 degrees", longitude / 1e7)


def _authentication(message: m.Authentication, bad, note) -> None:
    if 6 <= message.auth_type <= 9:
        bad("authentication type", "0 to 5, or 10 to 15 (private)", message.auth_type)
    if message.page == 0:
        if message.last_page > 15:
            bad("last page", "0 to 15", message.last_page)
        if message.length > 17 + 23 * min(message.last_page, 15):
            bad("length", f"at most what {message.last_page + 1} pages hold", message.length)


def _self_id(message: m.SelfId, bad, note) -> None:
    if 3 <= message.description_type <= 200:
        bad("description type", "0 to 2, or 201 to 255 (private)", message.description_type)
    _text(message.description, "description", bad)


def _system(message: m.System, bad, note) -> None:
    raw = message.raw
    if message.operator_location_type > 2:
        bad("operator location type", "0 to 2", message.operator_location_type)
    if message.classification_type > 1:
        bad("classification type", "0 or 1", message.classification_type)
    _reserved(raw[1] & 0xE0, "bits 5-7 of octet 1", bad)
    _coordinates(raw, 2, "operator ", bad)
    if message.area_count == 0 and message.version >= 2:
        bad("area count", "1 or more (default 1)", 0)
    if message.area_count == 1 and (message.area_radius_m or message.area_ceiling_m is not None
                                    or message.area_floor_m is not None):
        note(f"System gives one aircraft an area: radius {message.area_radius_m} m, "
             f"ceiling {message.area_ceiling_m} m, floor {message.area_floor_m} m (defaults 0, unknown, unknown)")
    if message.classification_type == 1:
        if message.category > 3:
            bad("EU category", "0 to 3", message.category)
        if message.eu_class > 7:
            bad("EU class", "0 to 7", message.eu_class)
    elif raw[17]:
        bad("category and class without a classification type", "0", f"{raw[17]:#04x}")
    if message.unix_s is not None and message.unix_s > time.time() + _DAY_S:
        bad("timestamp", "not in the future", time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime(message.unix_s)))
    _reserved(raw[24], "octet 24", bad)


def _operator_id(message: m.OperatorId, bad, note) -> None:
    if 1 <= message.operator_id_type <= 200:
        bad("operator ID type", "0, or 201 to 255 (private)", message.operator_id_type)
    _text(message.operator_id, "operator ID", bad)
    if not message.text:
        note("the Operator ID is empty: counts as absent")
    elif message.operator_id_type == 0 and (problem := operator_problem(message.text)):
        note(f"EU {problem}")
    _reserved(message.raw[22:25], "octets 22-24", bad)


_CHECKS = {m.BasicId: _basic_id, m.Location: _location, m.Authentication: _authentication,
           m.SelfId: _self_id, m.System: _system, m.OperatorId: _operator_id}
