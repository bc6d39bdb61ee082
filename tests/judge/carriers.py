"""Finds the Remote ID octets in what a radio delivers, or says why there are none.

Bluetooth (Core Specification, Supplement part A): advertising data is a row of
AD structures, each `length type value`; Remote ID is Service Data (type 0x16)
of the 16-bit UUID 0xFFFA, then application code 0x0D.  Wi-Fi (IEEE 802.11): a
beacon is a row of elements, each `id length value`; Remote ID is the vendor
specific element (221) with OUI FA-0B-BC, then type 0x0D.  From the 0x0D on both
are alike: application code, message counter, message or pack.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from .messages import APPLICATION_CODE

AD_SERVICE_DATA_16 = 0x16
AD_MANUFACTURER_DATA = 0xFF
AD_FLAGS = 0x01
UUID_REMOTE_ID = b"\xfa\xff"  # 0xFFFA, little-endian
OUI_REMOTE_ID = b"\xfa\x0b\xbc"
ELEMENT_VENDOR = 221
ELEMENT_DS_PARAMETER = 3
ADVERTISING_ACCESS_ADDRESS = 0x8E89BED6
PHY_NAMES = {1: "1M", 2: "2M", 3: "Coded", 4: "Coded"}


class FrameError(ValueError):
    """The frame is damaged or cut short; the text says where."""


@dataclass(frozen=True)
class Found:
    """Remote ID as a frame carries it; `payload` starts at the application code."""
    payload: bytes | None
    raw: bytes
    problem: str | None = None


@dataclass(frozen=True)
class Advertisement:
    """One Bluetooth advertising PDU, from whichever source."""
    extended: bool
    address: str
    address_type: str  # public, random, anonymous
    event_type: str
    phy: str  # primary/secondary
    rssi: int | None
    data: bytes
    damaged: bool = False  # the sniffer saw a wrong CRC: no receiver would deliver it


@dataclass(frozen=True)
class Beacon:
    """One 802.11 beacon: transmitter, its element octets, radio channel if known."""
    bssid: str
    elements: bytes
    channel: int | None
    rssi: int | None


def address_text(little_endian: bytes) -> str:
    return little_endian[::-1].hex(":").upper()


def _length_value(data: bytes, length_first: bool):
    """Splits a row of AD structures (length, type, value; the length counts the
    type) or of elements (id, length, value) into (offset, type, value)."""
    offset = 0
    while offset < len(data):
        if length_first:
            if data[offset] == 0:  # early termination: the rest is padding
                return
            end = offset + 1 + data[offset]
        elif offset + 1 < len(data):
            end = offset + 2 + data[offset + 1]
        else:
            end = offset + 2
        if end > len(data):
            raise FrameError(f"the structure at octet {offset} ends {end - len(data)} octets "
                             f"behind the data's end")
        yield offset, data[offset + 1 if length_first else offset], data[offset + 2:end]
        offset = end


def remote_id_in_advertising(data: bytes) -> Found | None:
    """The Remote ID in advertising data; None when nothing in it looks like one.

    What receivers demand beyond the AD layout: the element comes first, since
    they read the counter at octet 5 and the message from octet 6.
    """
    suspicious = None
    seen = []
    try:
        for offset, ad_type, value in _length_value(data, length_first=True):
            if value[:2] == UUID_REMOTE_ID and ad_type == AD_SERVICE_DATA_16:
                if value[2:3] != bytes((APPLICATION_CODE,)):
                    code = f"{value[2]:#04x}" if len(value) > 2 else "none"
                    return Found(None, data, f"application code is {code}, not 0x0d")
                before = "Flags come" if seen[:1] == [AD_FLAGS] else "another AD structure comes"
                problem = (f"the Service Data element is not first: {before} before it, receivers "
                           f"read {offset} octets off") if offset else None
                return Found(value[2:], data, problem)
            if value[:3] == UUID_REMOTE_ID + bytes((APPLICATION_CODE,)):
                kind = "manufacturer data" if ad_type == AD_MANUFACTURER_DATA else "this type"
                suspicious = Found(None, data, f"AD type is {ad_type:#04x}, not Service Data 0x16: "
                                               f"receivers never look at {kind}")
            seen.append(ad_type)
    except FrameError as error:
        if UUID_REMOTE_ID + bytes((APPLICATION_CODE,)) in data:
            return Found(None, data, f"AD structures are malformed: {error}")
    return suspicious


def has_ad_structures(data: bytes) -> bool:
    """Is this a well-formed row of AD structures, with at least one in it?"""
    try:
        return len(list(_length_value(data, length_first=True))) > 0
    except FrameError:
        return False


def remote_id_in_elements(elements: bytes) -> Found | None:
    """The Remote ID vendor element of a beacon, of several the first; None when there is none."""
    first = None
    try:
        for offset, element_id, value in _length_value(elements, length_first=False):
            if element_id == ELEMENT_VENDOR and value[:3] == OUI_REMOTE_ID:
                raw = elements[offset:offset + 2 + len(value)]
                if value[3:4] != bytes((APPLICATION_CODE,)):
                    code = f"{value[3]:#04x}" if len(value) > 3 else "none"
                    return Found(None, raw, f"vendor element type is {code}, not 0x0d")
                if first:
                    return Found(first.payload, first.raw, "two elements in one beacon: receivers show either")
                first = Found(value[3:], raw)
    except FrameError as error:
        if first is None and OUI_REMOTE_ID + bytes((APPLICATION_CODE,)) in elements:
            return Found(None, elements, f"beacon elements are malformed: {error}")
    return first


def beacon_in_80211(frame: bytes, rssi: int | None = None, channel: int | None = None) -> Beacon | None:
    """A beacon from an 802.11 frame without its FCS; None for any other frame."""
    if len(frame) < 36 or frame[0] != 0x80:  # version 0, management, subtype 8
        return None
    start = 24 + 12  # MAC header; timestamp, beacon interval, capabilities
    if frame[1] & 0x80:  # +HTC: four octets more of header
        start += 4
    elements = frame[start:]
    try:
        for _, element_id, value in _length_value(elements, length_first=False):
            if element_id == ELEMENT_DS_PARAMETER and len(value) == 1:
                channel = value[0]
                break
    except FrameError:
        pass  # remote_id_in_elements() says so when it matters
    return Beacon(frame[16:22].hex(":").upper(), elements, channel, rssi)


# Radiotap fields by bit: (size, alignment), as far as the signal strength.
_RADIOTAP_FIELDS = ((8, 8), (1, 1), (1, 1), (4, 2), (2, 2), (1, 1))
_RADIOTAP_HAS_FCS = 0x10
_RADIOTAP_BAD_FCS = 0x40


def beacon_in_radiotap(packet: bytes) -> Beacon | None:
    """A beacon from an 802.11 frame behind a radiotap header (radiotap.org)."""
    if len(packet) < 8 or packet[0] != 0:
        return None
    length, present = struct.unpack_from("<HI", packet, 2)
    if length < 8 or length > len(packet):
        return None
    offset, word = 8, present
    while word & 0x80000000 and offset + 4 <= length:  # further presence words
        word = struct.unpack_from("<I", packet, offset)[0]
        offset += 4
    flags, frequency_mhz, rssi = 0, None, None
    for bit, (size, alignment) in enumerate(_RADIOTAP_FIELDS):
        if not present & 1 << bit:
            continue
        offset = (offset + alignment - 1) // alignment * alignment
        if offset + size > length:
            return None
        if bit == 1:
            flags = packet[offset]
        elif bit == 3:
            frequency_mhz = struct.unpack_from("<H", packet, offset)[0]
        elif bit == 5:
            rssi = struct.unpack_from("<b", packet, offset)[0]
        offset += size
    if flags & _RADIOTAP_BAD_FCS:
        return None
    frame = packet[length:-4] if flags & _RADIOTAP_HAS_FCS else packet[length:]
    return beacon_in_80211(frame, rssi, wifi_channel(frequency_mhz))


def wifi_channel(frequency_mhz: int | None) -> int | None:
    if frequency_mhz == 2484:
        return 14
    if frequency_mhz and 2412 <= frequency_mhz <= 2472:
        return (frequency_mhz - 2407) // 5
    if frequency_mhz and 5000 < frequency_mhz < 5900:
        return (frequency_mhz - 5000) // 5
    return None


_LEGACY_PDUS = {0: "ADV_IND", 1: "ADV_DIRECT_IND", 2: "ADV_NONCONN_IND", 4: "SCAN_RSP", 6: "ADV_SCAN_IND"}


def advertisement_in_link_layer(packet: bytes, phy: str, rssi: int | None = None,
                                damaged: bool = False) -> Advertisement | None:
    """An advertisement from a link-layer packet (access address first).

    On the Coded PHY one octet, the coding indicator, stands between the access
    address and the PDU.  Only PDUs with advertising data are returned: an
    ADV_EXT_IND that merely points to its auxiliary packet carries none.
    """
    pdu = packet[5:] if phy == "Coded" else packet[4:]
    if len(pdu) < 3 or struct.unpack_from("<I", packet)[0] != ADVERTISING_ACCESS_ADDRESS:
        return None
    pdu_type, body = pdu[0] & 0x0F, pdu[2:2 + pdu[1]]
    address_type = "random" if pdu[0] & 0x40 else "public"
    if len(body) < pdu[1] or len(body) < 6:
        return None
    if pdu_type in _LEGACY_PDUS:
        return Advertisement(False, address_text(body[:6]), address_type, _LEGACY_PDUS[pdu_type],
                             f"{phy}/-", rssi, body[6:], damaged)
    if pdu_type != 7:
        return None
    header_end = 1 + (body[0] & 0x3F)
    data = body[header_end:]
    if header_end < 8 or not body[1] & 0x01 or not data:  # no AdvA, or nothing said
        return None
    mode = ("nonconnectable", "connectable", "scannable", "reserved")[body[0] >> 6]
    return Advertisement(True, address_text(body[2:8]), address_type, f"extended {mode}",
                         f"{phy}/{phy}", rssi, data, damaged)


def advertisement_in_nordic_sniffer(packet: bytes) -> Advertisement | None:
    """Nordic's sniffer (DLT 272, header versions 2 and 3): board octet, six octets
    of transport header, then length, flags, channel, -RSSI, event counter, time."""
    if len(packet) < 17 + 6 or packet[3] not in (2, 3) or packet[7] < 10:
        return None
    flags, start = packet[8], 7 + packet[7]
    phy = {0: "1M", 1: "2M", 2: "Coded"}.get(flags >> 4 & 0x07, "?")
    return advertisement_in_link_layer(packet[start:], phy, -packet[10], damaged=not flags & 0x01)


def advertisement_in_phdr(packet: bytes) -> Advertisement | None:
    """DLT 256: ten octets of radio data before the link-layer packet."""
    if len(packet) < 16:
        return None
    flags = struct.unpack_from("<H", packet, 8)[0]
    phy = {0: "1M", 1: "2M", 2: "Coded"}.get(flags >> 14, "?")
    rssi = struct.unpack_from("<b", packet, 1)[0] if flags & 0x0002 else None
    checked_and_wrong = flags & 0x0C00 == 0x0400
    return advertisement_in_link_layer(packet[10:], phy, rssi, checked_and_wrong)
