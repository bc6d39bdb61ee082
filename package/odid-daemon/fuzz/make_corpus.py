#!/usr/bin/env python3
"""Writes the hand-made part of corpus/: short flights in the fuzzers' input formats.

What libFuzzer found since lies beside it under its own names and is kept.
"""
import math
import pathlib
import struct

HERE = pathlib.Path(__file__).parent
FRAME = 8
# steps_us and senders of fuzz_telemetry.c, messages of frames.h
NOW, MS, MS_200, SECOND, STALE, HOUR, DAYS_25 = 0, 1, 4, 5, 7, 11, 13
(HEARTBEAT, SYSTEM_TIME, GPS_RAW, POSITION, HOME, LANDED, BASIC_ID, LOCATION, AUTHENTICATION,
 SELF_ID, SYSTEM, OPERATOR_ID, PACK, SYSTEM_UPDATE) = range(14)
MESSAGES = 16
VEHICLE, GROUND_STATION = 0, 2
UNIX_US = 1790000000000000


def frame(step, message, payload, sender=VEHICLE, stream=0):
    return bytes([step << 4 | FRAME | stream, message, sender, len(payload)]) + payload


def heartbeat(step=NOW, armed=False, autopilot=3, kind=2, status=4, sender=VEHICLE):
    return frame(step, HEARTBEAT,
                 struct.pack("<IBBBBB", 0, kind, autopilot, 0x81 if armed else 1, status, 3), sender)


def system_time(boot_ms, unix_us=None, step=NOW):
    unix_us = UNIX_US + boot_ms * 1000 if unix_us is None else unix_us
    return frame(step, SYSTEM_TIME, struct.pack("<QI", unix_us, boot_ms))


def gps(fix=3, step=NOW):
    return frame(step, GPS_RAW, struct.pack("<QiiiHHHHBBiIIII", 0, 577089000, 119746000, 84000, 100,
                                            100, 500, 9000, fix, 12, 120400, 1200, 2500, 300, 0))


def position(boot_ms, lat=577089000, lon=119746000, velocity=(300, -400, -150), step=MS_200):
    return frame(step, POSITION, struct.pack("<IiiiihhhH", boot_ms, lat, lon, 120500, 36500,
                                             *velocity, 9000))


def location(hour_s, lat=577089000, status=2, step=NOW, alt=120.5):
    return frame(step, LOCATION,
                 struct.pack("<iiffffHHh22sBBBBBBBB", lat, 119746000, alt, alt, 36.5, hour_s, 27000,
                             1225, -250, b"", status, 0, 11, 5, 4, 3, 2, 0))


def system(timestamp, kind=1, lat=577000000, sender=GROUND_STATION, step=NOW):
    return frame(step, SYSTEM, struct.pack("<iifffIHHBB20sBBBB", lat, 119000000, -1000, -1000, 48.5,
                                           timestamp, 1, 0, 1, 1, b"", kind, 1, 2, 5), sender)


def update(timestamp, step=NOW):
    return frame(step, SYSTEM_UPDATE,
                 struct.pack("<iifIBB", 577100000, 119100000, 50, timestamp, 1, 1))


def basic_id(kind, text):
    return frame(NOW, BASIC_ID, struct.pack("<BB20sBB20s", 0, 0, b"", kind, 2, text))


def self_id(text):
    return frame(NOW, SELF_ID, struct.pack("<BB20sB23s", 0, 0, b"", 0, text))


def operator_id(text):
    return frame(NOW, OPERATOR_ID, struct.pack("<BB20sB20s", 0, 0, b"", 0, text))


def authentication(page, last, fill):
    return frame(NOW, AUTHENTICATION, struct.pack("<IBB20sBBBB23s", 7, 0, 0, b"", 1, page, last,
                                                  (17 + 23 * last) % 256, bytes([fill]) * 23))


def pack(*on_air):
    return frame(NOW, PACK, struct.pack("<BB20sBB225s", 0, 0, b"", 25, len(on_air),
                                        b"".join(on_air)))


def hour_s(boot_ms, ahead=0.0):
    return math.fmod((UNIX_US / 1e6 + boot_ms / 1000 + ahead), 3600)


def flight(seconds, boot_ms=60000, native=None, armed_at=2):
    out = b""
    for second in range(seconds):
        out += heartbeat(armed=second >= armed_at) + system_time(boot_ms) + gps()
        if native is not None:
            out += location(hour_s(boot_ms, native))
        for _ in range(5):
            boot_ms += 200
            out += position(boot_ms, lat=577089000 + boot_ms)
    return out


def crc(data, extra):
    value = 0xFFFF
    for byte in data + bytes([extra]):
        tmp = byte ^ (value & 0xFF)
        tmp ^= tmp << 4 & 0xFF
        value = (value >> 8 ^ tmp << 8 ^ tmp << 3 ^ tmp >> 4) & 0xFFFF
    return struct.pack("<H", value)


def raw(data, step=NOW, stream=0):
    out = b""
    for i in range(0, len(data), 200):
        piece = data[i:i + 200]
        out += bytes([step << 4 | stream, len(piece)]) + piece
        step = NOW
    return out


def mavlink_1_heartbeat():
    body = bytes([9, 0, 1, 1, 0]) + struct.pack("<IBBBBB", 0, 2, 3, 0x81, 4, 3)
    return b"\xfe" + body + crc(body, 50)


def mavlink_2_position(boot_ms):
    payload = struct.pack("<IiiiihhhH", boot_ms, 577089000, 119746000, 120500, 36500, 1, 2, 3, 4)
    body = bytes([len(payload), 0, 0, 0, 1, 1, 33, 0, 0]) + payload
    return b"\xfd" + body + crc(body, 104)


def telemetry_inputs():
    stream = b"".join(mavlink_1_heartbeat() + mavlink_2_position(1000 + 200 * i) for i in range(8))
    statics = (basic_id(1, b"SSRS5GBG01") + basic_id(2, b"SE-123") + basic_id(3, bytes(range(20)))
               + self_id(b"Sea rescue surveillance") + operator_id(b"SWE3jxza7qbzvu5d"))
    yield "plain", b"\0" + flight(6)
    yield "configured", b"\x27" + flight(3)
    yield "bench", b"\x10" + flight(1) + heartbeat(STALE)
    yield "native", b"\0" + flight(5, native=0)
    yield "leap_seconds", b"\0" + flight(6, native=18)
    yield "px4", b"\0" + heartbeat(autopilot=12) + gps() + system_time(5000) + location(hour_s(5000))
    yield "statics", b"\0" + heartbeat() + statics
    yield "authentication", b"\0" + heartbeat() + b"".join(
        authentication(i, 2, 0xA0 + i) for i in (0, 1, 2, 1, 2, 0))
    yield "all_pages", b"\0" + heartbeat() + b"".join(authentication(i, 15, i) for i in range(16))
    yield "operator", (b"\x08" + heartbeat() + heartbeat(autopilot=8, kind=6, sender=GROUND_STATION)
                       + system(100) + update(101, SECOND) + update(102, STALE))
    yield "stale", b"\0" + flight(2) + heartbeat(STALE) + position(1) + position(2, step=HOUR)
    yield "restart", (b"\0" + flight(2) + position(500, step=STALE) + system_time(700)
                      + heartbeat(SECOND, armed=True))
    yield "wrap", (b"\0" + heartbeat() + position(2**32 - 100) + position(100)
                   + position(300, step=DAYS_25) + system_time(500))
    yield "no_fix", b"\0" + heartbeat() + gps(1) + position(1000) + position(1200, 0, 0)
    yield "home", (b"\0" + heartbeat(armed=True) + frame(
        NOW, HOME, struct.pack("<iiifff4ffff", 577000000, 119000000, 12500, *([0.0] * 10)))
        + gps() + position(1000))
    yield "nowhere", b"\0" + heartbeat() + position(1000, 2**31 - 1, -2**31) + location(
        float("nan"), alt=float("inf"))
    yield "emergency", b"\0" + flight(1) + heartbeat(status=6) + heartbeat(STALE, status=6)
    yield "landed", b"\0" + flight(1) + frame(NOW, LANDED, b"\0\1")
    yield "pack", b"\0" + heartbeat() + pack(
        b"\x02\x12SSRS5GBG01".ljust(25, b"\0"),
        bytes.fromhex("12225A50FBE8AD6522D02D23079B08C10818085B4339300200"),
        b"\x22\x10\x00\x11" + bytes(21), b"\x32\0Sea rescue".ljust(25, b"\0"),
        bytes.fromhex("4205186EE8EBD07B955A020019C0080000253108B38D860E00"),
        b"\x52\0SWE3jxza7qbzvu5d".ljust(25, b"\0"))
    yield "raw", b"\0" + raw(stream)
    yield "garbage", b"\0" + raw(b"\xfd\xfe\x00" * 5 + stream + b"\xfd" * 12 + stream, stream=3)
    yield "another_vehicle", b"\0" + flight(1) + frame(
        10, HEARTBEAT, struct.pack("<IBBBBB", 0, 1, 3, 0x81, 4, 3), 1) + heartbeat(SECOND)


def message_inputs():
    yield "empty", b""
    yield "zeros", b"\0" * 64
    for choice in (0x05, 0x1A, 0x4E, 0x86):
        for fill in (0x00, 0x41, 0x7F, 0xFF):
            yield f"fill_{choice:02x}_{fill:02x}", bytes([choice]) + bytes([fill]) * 1100
    numbers = [float("nan"), float("inf"), -1e300, 1e300, -0.0, 89.9999999, 359.6, 3599.96]
    for offset in range(4):
        doubles = (numbers[offset:] + numbers[:offset]) * 18
        yield f"numbers_{offset}", b"\x46" + struct.pack(f"<{len(doubles)}d", *doubles)


def framing_inputs():
    """The frames that cost most to find out about, or that hide another one."""
    good = mavlink_2_position(1000)
    header = bytes([0xFD, 255, 2, 0, 0, 1, 1, 0xFD, 0xFD, 0xFD])
    yield "ordinary", mavlink_1_heartbeat() + good * 8
    yield "unknown_flags_of_start_bytes", header + b"\xfd" * 257
    yield "unknown_flags_of_headers", header + (b"\xfd\xff\x02" * 86)[:257]
    yield "unknown_flags_of_first_versions", header + b"\xfe\xff" * 128 + b"\xfe"
    yield "unknown_flags_of_first_starts", header + b"\xfe" * 257
    yield "unknown_id_of_start_bytes", bytes([0xFD, 255, 0, 0, 0, 1, 1, 0x60, 0xEA, 0]) + b"\xfd" * 257
    yield "signed_and_unknown", bytes([0xFD, 255, 3]) + b"\xfd" * 277
    yield "start_bytes", b"\xfd" * 300
    yield "start_bytes_1", b"\xfe" * 300
    # Long frames of known messages, each beginning within the one before: checksums over and over.
    yield "overlapping", b"\xfd\xff\0\0\0\0\0\0\0\0" * 60
    yield "overlapping_closely", b"\xfd\xfd\0\0\0" * 120
    yield "overlapping_1", b"\xfe\x33\x01\x00\x00\x54" * 80
    yield "overlapping_1_closely", b"\xfe\x1c\x21" * 120
    yield "short_frames", bytes([0xFD, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0]) * 30
    yield "wrapped", header[:1] + bytes([len(good)]) + header[2:] + good + b"\0\0" + good
    yield "wrapped_unknown_id", (bytes([0xFD, len(good), 0, 0, 0, 1, 1, 0x60, 0xEA, 0]) + good + b"\0\0"
                                 + good)


def others(after_ms, message, octets=b"", sender=0, stream=9, number=0, offset=0):
    """A record of fuzz_sources.c."""
    return bytes([after_ms // 4, stream, sender, message, number, len(octets), offset]) + octets


def sources_inputs():
    for label, as_vehicle in (("strangers", b"\0"), ("impostors", b"\1")):
        yield f"{label}_say_disarmed", as_vehicle + others(100, HEARTBEAT, b"\1", offset=6) * 60
        yield f"{label}_elsewhere", as_vehicle + others(100, POSITION, struct.pack("<i", 100000000), offset=4) * 60
        yield f"{label}_are_younger", as_vehicle + others(100, POSITION, struct.pack("<I", 1000)) * 60
        away = [others(0, POSITION, struct.pack("<i", 577090000 + 700 * step), offset=4, number=step) for step in range(200)]
        yield f"{label}_walk_away", as_vehicle + b"".join(away)
        yield f"{label}_walk_away_and_stay", as_vehicle + b"".join(away) + others(
            100, POSITION, struct.pack("<i", 577090000 + 700 * 199), offset=4) * 90
        yield f"{label}_tell_the_time", as_vehicle + others(100, SYSTEM_TIME, struct.pack("<Q", UNIX_US + 10**11)) * 60
        yield f"{label}_are_a_ground_station", as_vehicle + others(100, HEARTBEAT, b"\6\x08\0", offset=4) * 60
        yield f"{label}_native", as_vehicle + others(100, LOCATION, struct.pack("<ii", 570000000, 110000000)) * 60
        for sender in range(1, 8):
            yield f"{label}_{sender}", as_vehicle + b"".join(
                others(40, message, sender=sender) for message in range(MESSAGES))


def main():
    for name, inputs in (("telemetry", telemetry_inputs), ("messages", message_inputs),
                         ("framing", framing_inputs), ("sources", sources_inputs)):
        folder = HERE / "corpus" / name
        folder.mkdir(parents=True, exist_ok=True)
        for label, data in inputs():
            (folder / label).write_bytes(data)


if __name__ == "__main__":
    main()
