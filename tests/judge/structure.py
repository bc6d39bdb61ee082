"""Rules about the shape of what was heard: octet counts, order, versions, PHY.

Sources: message and pack layout from the published message headers; the rest
(2nd), from open references: 31 octets with the Service Data element first and a
counter before the message (receivers ignore or misread anything else), packs on
Bluetooth 5 and Wi-Fi, single messages on Bluetooth 4, pack order by message type.
"""

from __future__ import annotations

from .findings import Findings
from .messages import (MESSAGE_OCTETS, PACK_HEADER_OCTETS, PROTOCOL_VERSION, TYPE_NAMES, Message, MessageError,
                       decode_body, is_pack)
from .receptions import Reception
from .tracks import Heard

LEGACY_OCTETS = 31
_MAY_REPEAT = ("basic_id", "authentication")


def check_structure(reception: Reception, findings: Findings, any_version: bool) -> Heard | None:
    """The valid messages of a reception, or None when a receiver couldn't read it."""
    if reception.problem:
        findings.violation("structure.element", reception, reception.problem,
                           "Service Data 0xFFFA, code 0x0D, first" if reception.channel != "wifi"
                           else "vendor element FA-0B-BC, type 0x0D", _head(reception.raw))
    payload = reception.payload
    if payload is None:
        return None
    _check_carrier(reception, findings)
    if _counter_is_missing(payload):
        findings.violation(
            "counter.missing", reception,
            f"counter byte missing: the octet where receivers read the counter holds the message header "
            f"{payload[1]:#04x}, everything after it is read one octet late",
            "0d, counter, message", f"{_head(payload)} (message type read: "
            f"{payload[2] >> 4 if len(payload) > 2 else 'none'}, {len(reception.raw)} octets in all)")
        return None
    if len(payload) < 3:
        findings.violation("structure.size", reception, "nothing follows the message counter",
                           "a message or pack", _head(payload))
        return None
    body = payload[2:]
    try:
        messages = decode_body(body)
    except MessageError as error:
        findings.violation("structure.message", reception, str(error), "a message of 25 octets, or a pack",
                           _head(body))
        return None
    if reception.channel == "bt4":
        if is_pack(body):
            findings.violation("structure.pack", reception, "a pack on Bluetooth 4", "one message", _head(body))
    elif not is_pack(body):
        findings.violation("structure.single", reception, "a single message instead of a pack",
                           "a message pack (type 0xF)", _head(body))
    if is_pack(body):
        _check_pack(reception, body, messages, findings)
    for octet in {body[0], *(message.raw[0] for message in messages)}:
        _check_version(reception, octet & 0x0F, findings, any_version)
    return Heard(reception, payload[1], body, tuple(messages))


def _head(octets: bytes) -> str:
    return octets[:8].hex(" ") + (f" ... ({len(octets)} octets)" if len(octets) > 8 else "")


def _check_carrier(reception: Reception, findings: Findings) -> None:
    """PDU type, PHY, size: what the radio around the message has to look like."""
    if reception.channel == "bt4":
        if reception.raw and len(reception.raw) != LEGACY_OCTETS:
            findings.violation("structure.size", reception, "size of the advertising data: receivers ignore "
                               "anything under 31 octets", f"{LEGACY_OCTETS} octets", f"{len(reception.raw)} octets")
        if reception.event_type not in (None, "ADV_NONCONN_IND"):
            findings.violation("structure.pdu", reception, "advertising PDU type", "ADV_NONCONN_IND",
                               reception.event_type)
    elif reception.channel == "bt5":
        if reception.phy not in (None, "Coded/Coded"):
            findings.violation("structure.phy", reception, "PHY (primary/secondary): Long Range is the Coded PHY",
                               "Coded/Coded", reception.phy)
        if reception.event_type not in (None, "extended nonconnectable"):
            findings.violation("structure.pdu", reception, "extended advertising properties",
                               "extended nonconnectable", reception.event_type)
    elif reception.wifi_channel not in (None, 6, 149):
        findings.note(f"wifi: channel {reception.wifi_channel}: outside 6 and 149 beacons are due five times a "
                      "second (2nd)")


def _looks_like_header(octet: int, versions=range(PROTOCOL_VERSION + 1)) -> bool:
    return octet >> 4 in TYPE_NAMES and octet & 0x0F in versions


def _counter_is_missing(payload: bytes) -> bool:
    """Does the message start where the counter belongs?

    A pack shows it by its size octet 25.  A single message shows it by its length
    (26 octets instead of 27) or, padded to the right length, by a type that can't
    be; what is in the counter's place has to look like a header in both cases,
    since a message may also be cut short or wrong behind a good counter.
    """
    if len(payload) < 4:
        return False
    if payload[1] >> 4 == 0xF and payload[2] == MESSAGE_OCTETS:
        return payload[3] != MESSAGE_OCTETS
    if payload[2] >> 4 == 0xF and payload[3] == MESSAGE_OCTETS:
        return False
    if len(payload) == 1 + MESSAGE_OCTETS:
        return _looks_like_header(payload[1], (PROTOCOL_VERSION,)) or (
            _looks_like_header(payload[1]) and not _looks_like_header(payload[2]))
    return (len(payload) == 2 + MESSAGE_OCTETS and payload[-1] == 0
            and _looks_like_header(payload[1], (PROTOCOL_VERSION,)) and payload[2] >> 4 not in TYPE_NAMES)


def _check_pack(reception: Reception, body: bytes, messages: list[Message], findings: Findings) -> None:
    trailing = body[PACK_HEADER_OCTETS + len(messages) * MESSAGE_OCTETS:]
    if trailing:
        findings.violation("structure.trailing", reception, "octets behind the last message of the pack", "none",
                           f"{len(trailing)} octets" + (", all zero" if not any(trailing) else ""))
    numbers = [message.type_number for message in messages]
    if numbers != sorted(numbers):
        findings.violation("structure.order", reception, "order of the messages in the pack", "by message type",
                           ", ".join(message.type_name for message in messages))
    names = [message.type_name for message in messages]
    for name in sorted(set(names)):
        if name not in _MAY_REPEAT and names.count(name) > 1:
            findings.violation("structure.duplicate", reception, f"{name} in one pack", "once",
                               f"{names.count(name)} times")
    keys = [message.content_key for message in messages]
    for key in sorted(set(keys)):
        if len(key) > 1 and keys.count(key) > 1:
            findings.violation("structure.duplicate", reception, "the same Basic ID kind or Authentication page "
                               "in one pack", "once", f"{keys.count(key)} times")


def _check_version(reception: Reception, version: int, findings: Findings, any_version: bool) -> None:
    if version == PROTOCOL_VERSION:
        return
    if any_version and version < PROTOCOL_VERSION:
        findings.note(f"{reception.channel}: protocol version {version} of {reception.address} (an older edition)")
    else:
        findings.violation("structure.version", reception, "protocol version", PROTOCOL_VERSION, version)
