"""LE advertising reports in HCI events (Core Specification, Vol 4 Part E, 7.7.65).

One parser for the live scanner and for HCI dumps.  It is cheap on purpose: it
runs between the arrival of an event and the next one.
"""

from __future__ import annotations

import struct

from .carriers import PHY_NAMES, Advertisement, address_text

HCI_EVENT_PACKET = 0x04
LE_META_EVENT = 0x3E
SUBEVENT_ADVERTISING_REPORT = 0x02
SUBEVENT_EXTENDED_ADVERTISING_REPORT = 0x0D

_LEGACY_EVENTS = {0: "ADV_IND", 1: "ADV_DIRECT_IND", 2: "ADV_SCAN_IND", 3: "ADV_NONCONN_IND", 4: "SCAN_RSP"}
_LEGACY_EVENTS_EXTENDED = {0x13: "ADV_IND", 0x15: "ADV_DIRECT_IND", 0x12: "ADV_SCAN_IND",
                           0x10: "ADV_NONCONN_IND", 0x1A: "SCAN_RSP", 0x1B: "SCAN_RSP"}
_ADDRESS_TYPES = {0: "public", 1: "random", 2: "public", 3: "random", 0xFF: "anonymous"}
_RSSI_NOT_AVAILABLE = 127
_DATA_MORE_TO_COME = 1


class HciReportError(ValueError):
    """The controller's event is shorter than it says."""


def is_advertising_event(packet: bytes) -> bool:
    """`packet` is H4 framed: type octet first."""
    return (len(packet) > 4 and packet[0] == HCI_EVENT_PACKET and packet[1] == LE_META_EVENT
            and packet[3] in (SUBEVENT_ADVERTISING_REPORT, SUBEVENT_EXTENDED_ADVERTISING_REPORT))


class ReportParser:
    """Turns advertising events into advertisements; joins the fragments in which
    controllers report long extended advertising data."""

    def __init__(self) -> None:
        self._fragments: dict[tuple[bytes, int], bytes] = {}

    def parse(self, packet: bytes) -> list[Advertisement]:
        """All complete advertisements of an event for which is_advertising_event() holds."""
        try:
            if packet[3] == SUBEVENT_ADVERTISING_REPORT:
                return self._legacy(packet)
            return self._extended(packet)
        except (struct.error, IndexError) as error:
            raise HciReportError(f"advertising report of {len(packet)} octets is cut short: "
                                 f"{packet.hex()}") from error

    def _legacy(self, packet: bytes) -> list[Advertisement]:
        heard, offset = [], 5
        for _ in range(packet[4]):
            event_type, address_type, address, length = struct.unpack_from("<BB6sB", packet, offset)
            offset += 9
            data = packet[offset:offset + length]
            offset += length
            rssi = struct.unpack_from("<b", packet, offset)[0]
            offset += 1
            heard.append(Advertisement(
                False, address_text(address), _ADDRESS_TYPES.get(address_type, str(address_type)),
                _LEGACY_EVENTS.get(event_type, f"type {event_type:#04x}"), "1M/-",
                None if rssi == _RSSI_NOT_AVAILABLE else rssi, data))
        return heard

    def _extended(self, packet: bytes) -> list[Advertisement]:
        heard, offset = [], 5
        for _ in range(packet[4]):
            (event_type, address_type, address, primary, secondary, set_id, _tx_power, rssi, _periodic,
             _direct_type, _direct, length) = struct.unpack_from("<HB6sBBBbbHB6sB", packet, offset)
            offset += 24
            data = packet[offset:offset + length]
            if len(data) < length:
                raise IndexError
            offset += length
            legacy = bool(event_type & 0x10)
            if not legacy:
                key = (address, set_id)
                data = self._fragments.pop(key, b"") + data
                if event_type >> 5 & 0x03 == _DATA_MORE_TO_COME:
                    self._fragments[key] = data
                    continue
            heard.append(Advertisement(
                not legacy, address_text(address), _ADDRESS_TYPES.get(address_type, str(address_type)),
                _LEGACY_EVENTS_EXTENDED.get(event_type & 0x1F, "legacy") if legacy else _extended_name(event_type),
                f"{PHY_NAMES.get(primary, '?')}/{PHY_NAMES.get(secondary, '-')}",
                None if rssi == _RSSI_NOT_AVAILABLE else rssi, data))
        return heard


def _extended_name(event_type: int) -> str:
    kinds = [name for bit, name in ((1, "connectable"), (2, "scannable"), (4, "directed"), (8, "scan response"))
             if event_type & bit]
    if event_type >> 5 & 0x03 == 2:
        kinds.append("truncated")
    return "extended " + (" ".join(kinds) or "nonconnectable")
