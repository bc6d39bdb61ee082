"""The decoder against octets written down by hand from the published layout."""

import pytest

from . import messages as m
from .carriers import remote_id_in_advertising, remote_id_in_elements
from .identifiers import operator_problem, serial_problem

# Location: airborne, height above ground, direction 180+45, 10 m/s, -2.5 m/s (down),
# 57.7089 N 11.9746 E, pressure altitude unknown, 86 m geodetic, 40.5 m, accuracies
# 11/4/0/3, 1234.5 s of the hour to 0.2 s.
LOCATION = bytes.fromhex("12" "26" "2d" "28" "fb" "88aa6522" "102f2307" "0000" "7c08" "2108" "4b" "03" "3930" "02" "00")
LOCATION_UNKNOWN = bytes.fromhex("12" "03" "b5" "ff" "7e" "00000000" "00000000" "0000" "0000" "0000"
                                 "00" "00" "ffff" "00" "00")
SYSTEM = bytes.fromhex("42" "05" "88aa6522" "102f2307" "0100" "05" "3408" "0000" "25" "9808" "00f15365" "00")
BASIC_ID = bytes.fromhex("02" "14") + b"SSRS5GBG01".ljust(20, b"\0") + bytes(3)
SELF_ID = bytes.fromhex("32" "00") + b"Sea rescue surveillance"
OPERATOR_ID = bytes.fromhex("52" "00") + b"SWE3jxza7qbzvu5d\0\0\0\0" + bytes(3)
PACK = bytes.fromhex("f2" "19" "05") + BASIC_ID + LOCATION + SELF_ID + SYSTEM + OPERATOR_ID


def test_location():
    place = m.decode_message(LOCATION)
    assert (place.type_name, place.version, place.status) == ("location", 2, 2)
    assert place.height_above_ground and place.direction_deg == 225.0
    assert (place.speed_m_s, place.vertical_speed_m_s) == (10.0, -2.5)
    assert (place.latitude_deg, place.longitude_deg) == (57.7088136, 11.9746320)
    assert (place.pressure_altitude_m, place.geodetic_altitude_m, place.height_m) == (None, 86.0, 40.5)
    assert (place.horizontal_accuracy, place.vertical_accuracy) == (11, 4)
    assert (place.speed_accuracy, place.pressure_accuracy) == (3, 0)
    assert (place.timestamp_s, place.timestamp_accuracy_s) == (1234.5, 0.2)


def test_unknown_values_are_none():
    place = m.decode_message(LOCATION_UNKNOWN)
    assert [place.direction_deg, place.speed_m_s, place.vertical_speed_m_s, place.latitude_deg, place.longitude_deg,
            place.pressure_altitude_m, place.geodetic_altitude_m, place.height_m, place.timestamp_s,
            place.timestamp_accuracy_s] == [None] * 10


@pytest.mark.parametrize("flags, octet, speed", [(0, 255, 63.75), (1, 0, 63.75), (1, 254, 254.25), (1, 255, None)])
def test_speed_multiplier(flags, octet, speed):
    raw = bytearray(LOCATION)
    raw[1], raw[3] = raw[1] & 0xF6 | flags, octet
    assert m.decode_message(bytes(raw)).speed_m_s == speed


def test_the_equator_and_greenwich_are_places():
    raw = bytearray(LOCATION)
    raw[5:9] = bytes(4)
    place = m.decode_message(bytes(raw))
    assert place.latitude_deg == 0.0 and place.longitude_deg is not None


def test_system():
    system = m.decode_message(SYSTEM)
    assert (system.operator_location_type, system.classification_type) == (1, 1)
    assert (system.operator_latitude_deg, system.operator_longitude_deg) == (57.7088136, 11.9746320)
    assert (system.area_count, system.area_radius_m, system.area_ceiling_m, system.area_floor_m) == (1, 50, 50.0, None)
    assert (m.EU_CATEGORIES[system.category], m.EU_CLASSES[system.eu_class]) == ("specific", "C4")
    assert system.operator_altitude_m == 100.0
    assert system.unix_s == 1546300800 + 0x6553F100
    assert m.decode_message(b"\x41" + SYSTEM[1:]).unix_s is None  # version 1 has no such field


def test_identity():
    basic = m.decode_message(BASIC_ID)
    assert (basic.id_type, m.UA_TYPES[basic.ua_type], basic.text) == (1, "hybrid lift", "SSRS5GBG01")
    assert m.decode_message(SELF_ID).text == "Sea rescue surveillance"
    assert m.decode_message(OPERATOR_ID).text == "SWE3jxza7qbzvu5d"
    assert m.printable(b"A\x01\xe5\0B") == "A\\x01\\xe5"


def test_authentication_pages():
    first = m.decode_message(bytes.fromhex("22" "10" "02" "3f" "01000000") + bytes(range(17)))
    assert (first.auth_type, first.page, first.last_page, first.length) == (1, 0, 2, 63)
    assert first.unix_s == 1546300801 and first.data == bytes(range(17))
    second = m.decode_message(bytes.fromhex("22" "11") + bytes(range(23)))
    assert (second.page, second.length, len(second.data)) == (1, None, 23)
    assert first.content_key != second.content_key


def test_pack():
    assert [x.type_name for x in m.decode_body(PACK)] == ["basic_id", "location", "self_id", "system", "operator_id"]
    for damaged, words in ((b"\xf2\x18" + PACK[2:], "size is 24"), (PACK[:2] + b"\0" + PACK[3:], "says 0"),
                           (PACK[:2] + b"\x0a" + PACK[3:], "says 10"), (PACK[:-1], "has 128 octets, this one 127"),
                           (PACK[:2], "header")):
        with pytest.raises(m.MessageError, match=words):
            m.decode_body(damaged)
    for damaged in (b"", LOCATION[:24], LOCATION + b"\0", b"\xe2" + LOCATION[1:]):
        with pytest.raises(m.MessageError):
            m.decode_body(damaged)


def test_carriers_name_what_is_wrong():
    right = bytes.fromhex("1e16faff0d07") + LOCATION
    assert remote_id_in_advertising(right).payload == right[4:]
    assert remote_id_in_advertising(right).problem is None
    assert "Flags" in remote_id_in_advertising(b"\x02\x01\x06" + right).problem
    assert "manufacturer" in remote_id_in_advertising(right[:1] + b"\xff" + right[2:]).problem
    assert "application code is 0x0e" in remote_id_in_advertising(right[:4] + b"\x0e" + right[5:]).problem
    assert "malformed" in remote_id_in_advertising(b"\x1f" + right[1:]).problem
    assert remote_id_in_advertising(b"\x02\x01\x06\x03\x03\xfa\xff") is None
    assert remote_id_in_advertising(b"") is None
    element = bytes((0xDD, len(PACK) + 5)) + bytes.fromhex("fa0bbc0d09") + PACK
    assert remote_id_in_elements(b"\0\0" + element).payload == element[5:]
    assert remote_id_in_elements(b"\0\0" + element[:-1]).problem.startswith("beacon elements are malformed")
    assert remote_id_in_elements(b"\xdd\x04\xfa\x0b\xbc\x0e").problem == "vendor element type is 0x0e, not 0x0d"
    assert remote_id_in_elements(element + element).problem.startswith("two elements in one beacon")
    assert remote_id_in_elements(b"\0\4odid\xdd\x04\x00\x50\xf2\x01") is None


def test_identifiers():
    assert serial_problem("SSRS5GBG01") is None
    assert "'G' is no length code" in serial_problem("SSRSGBG001")
    assert "only 0-9 and A-Z" in serial_problem("DIY19eosdrone8")
    assert "announces 5" in serial_problem("SSRS5GBG0")
    assert operator_problem("SWE3jxza7qbzvu5d") is None
    assert "secret" in operator_problem("FIN87astrdge12k8-xyz")
    assert operator_problem("hello")
