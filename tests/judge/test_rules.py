"""One by one, the rules that no faulty transmitter of test_judge.py breaks."""

import json

import pytest

from . import synthetic as air
from . import messages as m
from .conformance import Options, judge
from .findings import LISTED_OF_A_KIND, Findings
from .flight_log import read_flight_log
from .ranges import check_ranges
from .receptions import Reception
from .structure import check_structure
from .synthetic import Faults, encode_fix, transmit


def changed(message: bytes, at: int, *octets: int) -> bytes:
    return message[:at] + bytes(octets) + message[at + len(octets):]


def authentication(auth_type=1, page=0, last_page=1, length=40) -> bytes:
    return bytes((0x22, auth_type << 4 | page, last_page, length)) + bytes(4) + bytes(17)


RECEPTION = Reception(1.7e9, 5000.0, "bt4", air.ADDRESS, b"", b"")
PLACE = air.location(577000000, 119000000, hour_s=10.0)
FUTURE = (0xFFFFFFFF).to_bytes(4, "little")


@pytest.mark.parametrize("message, field", [
    (air.basic_id(id_type=5), "ID type"), (air.basic_id(id_type=0), "identifier"), (air.basic_id(""), "identifier"),
    (air.basic_id("", id_type=3), "identifier"), (changed(air.basic_id(), 3, 7), "identifier: characters"),
    (changed(air.basic_id(), 24, 1), "octets 22-24 is reserved"),
    (air.location(0, 1800000001), "longitude"), (air.location(-900000001, 0), "latitude"),
    (changed(PLACE, 19, 0x70), "vertical accuracy"), (changed(PLACE, 20, 0x70), "pressure altitude accuracy"),
    (changed(PLACE, 20, 0x05), "speed accuracy"), (changed(PLACE, 23, 0x10), "high half of octet 23 is reserved"),
    (changed(PLACE, 1, 0x28), "bit 3 of octet 1 is reserved"),
    (changed(PLACE, 0, 0x11, 0x40), "status"),  # status 4 came with protocol version 2
    (authentication(auth_type=7), "authentication type"), (authentication(last_page=16), "last page"),
    (authentication(length=41), "length"),
    (changed(air.self_id(), 1, 3), "description type"), (changed(air.self_id("x"), 24, 65), "description: padding"),
    (changed(air.operator_id(), 1, 200), "operator ID type"), (changed(air.operator_id(), 22, 1), "octets 22-24"),
    (changed(air.system(1.7e9), 1, 0x07), "operator location type"),
    (changed(changed(air.system(1.7e9), 1, 0x08), 17, 0), "classification type"),
    (changed(air.system(1.7e9), 1, 0x24), "bits 5-7 of octet 1 is reserved"),
    (changed(air.system(1.7e9), 2, *(0x7FFFFFFF).to_bytes(4, "little")), "operator latitude"),
    (changed(air.system(1.7e9), 6, *(0x7FFFFFFF).to_bytes(4, "little")), "operator longitude"),
    (changed(air.system(1.7e9), 10, 0, 0), "area count"), (changed(air.system(1.7e9), 17, 0x45), "EU category"),
    (changed(air.system(1.7e9), 17, 0x28), "EU class"),
    (changed(air.system(1.7e9), 1, 0x00), "category and class without a classification type"),
    (changed(air.system(1.7e9), 20, *FUTURE), "timestamp"), (changed(air.system(1.7e9), 24, 1), "octet 24"),
])
def test_a_field_out_of_range(message, field):
    findings = Findings()
    check_ranges(RECEPTION, m.decode_message(message), findings)
    assert findings.total == 1 and field in findings.violations[0].what


@pytest.mark.parametrize("message", [
    PLACE, air.location(0, 0), air.location(900000000, -1800000000, speed_m_s=254.25, vertical_m_s=-62.0),
    air.basic_id(), air.basic_id("\x01\x02\x03", id_type=4), air.self_id(""), air.operator_id(), air.system(1.7e9),
    authentication(), authentication(auth_type=12, page=3), changed(air.system(1.7e9), 20, 0, 0, 0, 0)])
def test_what_is_allowed(message):
    findings = Findings()
    check_ranges(RECEPTION, m.decode_message(message), findings)
    assert findings.violations == []


@pytest.mark.parametrize("message, words", [
    (air.basic_id("SSRSGBG001"), "no length code"), (air.operator_id("FIN87astrdge12k8xyz"), "secret characters"),
    (air.operator_id(""), "counts as absent"), (changed(air.system(1.7e9), 12, 5), "an area")])
def test_notes_that_are_no_violations(message, words):
    findings = Findings()
    check_ranges(RECEPTION, m.decode_message(message), findings)
    assert findings.violations == [] and words in findings.notes[0]


def structure(channel="bt4", body=PLACE, **fields):
    raw = fields.pop("raw", air.service_data(1, body))
    reception = Reception(1.7e9, 5000.0, channel, air.ADDRESS, raw[4:], raw, **fields)
    findings = Findings()
    heard = check_structure(reception, findings, any_version=False)
    return findings.counts, heard


PACK = air.pack([air.basic_id(), PLACE, air.system(1.7e9)])


@pytest.mark.parametrize("kind, arguments, readable", [
    ("structure.pack", dict(body=PACK), True),
    ("structure.pdu", dict(event_type="ADV_IND"), True),
    ("structure.pdu", dict(channel="bt5", body=PACK, event_type="extended connectable"), True),
    ("structure.phy", dict(channel="bt5", body=PACK, phy="1M/2M"), True),
    ("structure.trailing", dict(channel="wifi", body=PACK + b"\0"), True),
    ("structure.size", dict(raw=bytes.fromhex("0516faff0d07")), False),
    ("structure.size", dict(channel="wifi", raw=bytes.fromhex("0516faff0d07")), False),
    ("structure.message", dict(body=PLACE[:24]), False),
    ("structure.message", dict(body=b"\xe2" + PLACE[1:]), False),
    ("structure.duplicate", dict(channel="wifi", body=air.pack([air.basic_id(), air.basic_id()])), True),
])
def test_structure(kind, arguments, readable):
    counts, heard = structure(**arguments)
    assert kind in counts and (heard is not None) == readable


@pytest.mark.parametrize("arguments", [
    dict(event_type="ADV_NONCONN_IND", phy="1M/-"),
    dict(channel="bt5", body=PACK, event_type="extended nonconnectable", phy="Coded/Coded"),
    dict(channel="wifi", body=air.pack([air.basic_id(), air.basic_id("x", id_type=2), PLACE, authentication(),
                                        authentication(page=1)]), wifi_channel=6)])
def test_structure_that_is_right(arguments):
    counts, heard = structure(**arguments)
    assert counts == {} and heard is not None


def test_missing_counter_isn_t_seen_where_there_is_one():
    """Every counter value, also those that look like a message header or a pack."""
    for counter in range(256):
        raw = air.service_data(counter, PLACE)
        assert structure(raw=raw)[0] == {}, counter
        assert structure(channel="wifi", raw=air.service_data(counter, PACK))[0] == {}, counter
        assert structure(raw=air.service_data(counter, air.basic_id()))[0] == {}, counter


@pytest.mark.parametrize("message", [PLACE, air.basic_id(), air.self_id(), air.system(1.7e9), air.operator_id()])
def test_missing_counter_of_every_message(message):
    counts, heard = structure(raw=bytes((29, 0x16, 0xFA, 0xFF, 0x0D)) + message)
    assert "counter.missing" in counts and heard is None


@pytest.fixture
def flight_log(tmp_path):
    path = tmp_path / "played.jsonl"

    def read(rows):
        path.write_text("".join(json.dumps(row) + "\n" for row in rows))
        return read_flight_log(path)
    return read


def counts(run, log=None, **options):
    return judge(run, Options(**options), log).findings.counts


def test_position_that_goes_back_and_forth(flight_log):
    """Two stale payloads in turn are no new content."""
    def number(t):
        return 15 if t < 4 else (15, 10)[int(t / 0.125) % 4 // 2]

    run, _ = transmit(channels=("bt4",), seconds=9, faults=Faults(fix_number=number))
    assert counts(run)["location.backward"] > 3 and counts(run)["interval.content"] >= 1
    found = counts(run, flight_log(air.played_log(10)))
    assert found["played.order"] > 3 and "location.backward" not in found


def test_unknown_position_although_one_was_played(flight_log):
    run, _ = transmit(channels=("bt4",), seconds=6, faults=Faults(
        location=lambda fix, t: encode_fix(fix, lat=0, lon=0)))
    log = air.played_log(8)
    assert counts(run, flight_log(log))["played.unknown"] > 3
    for row in log:
        if row["type"] == "GPS_RAW_INT":
            row["fix_type"] = 1
    assert "played.unknown" not in counts(run, flight_log(log))


def test_unknown_time_and_direction_although_they_were_played(flight_log):
    run, _ = transmit(channels=("bt4",), seconds=6, faults=Faults(
        location=lambda fix, t: encode_fix(fix, hour_s=None, direction_deg=None)))
    found = counts(run, flight_log(air.played_log(8)))
    assert found["played.time_unknown"] > 5 and found["played.direction"] > 5


def test_time_that_nobody_told(flight_log):
    """Without SYSTEM_TIME the timestamp has to be unknown, not a guess."""
    log = flight_log([row for row in air.played_log(8) if row["type"] != "SYSTEM_TIME"])
    run, _ = transmit(channels=("bt4",), seconds=6)
    assert counts(run, log)["played.time"] > 5
    run, _ = transmit(channels=("bt4",), seconds=6, faults=Faults(
        location=lambda fix, t: encode_fix(fix, hour_s=None)))
    assert counts(run, log) == {}


def test_course_while_hovering(flight_log):
    still = [{**row, "vx": 5, "vy": 5} if row["type"] == "GLOBAL_POSITION_INT" else row for row in air.played_log(8)]

    def hovering(direction):
        return Faults(location=lambda fix, t: encode_fix(fix, speed_m_s=0.0, direction_deg=direction))

    run, _ = transmit(channels=("wifi",), seconds=5, faults=hovering(45.0))
    assert counts(run, flight_log(still))["played.direction"] > 3
    run, _ = transmit(channels=("wifi",), seconds=5, faults=hovering(None))
    assert "played.direction" not in counts(run, flight_log(still))


def test_failure_status_although_the_position_is_fresh(flight_log):
    run, _ = transmit(channels=("wifi",), seconds=5, faults=Faults(
        location=lambda fix, t: encode_fix(fix, status=4)))
    log = air.played_log(8)
    assert counts(run, flight_log(log))["played.status"] > 10
    silent = [row for row in log if row["type"] != "HEARTBEAT"]  # a lost heartbeat is a reason as well
    assert "played.status" not in counts(run, flight_log(silent))


def test_log_that_is_out_of_order(flight_log):
    """A position with an older boot time is no newer one: nobody has to show it."""
    log = air.played_log(8)
    late = [{**row, "mono": row["mono"] + 1.1, "time": row["time"] + 1.1} for row in log
            if row["type"] == "GLOBAL_POSITION_INT" and 1 < row["mono"] - air.START_MONO < 5]
    run, _ = transmit(channels=("bt4",), seconds=6)
    assert counts(run, flight_log(log + late)) == {}


def test_native_location_with_gps_time(flight_log):
    """The autopilot's own Location: its height and its course count, its 18 leap seconds don't."""
    rows = []
    for row in air.played_log(8):
        rows.append(row)
        if row["type"] == "GLOBAL_POSITION_INT":
            rows.append({"time": row["time"], "mono": row["mono"] + 0.001, "type": "OPEN_DRONE_ID_LOCATION",
                         "latitude": row["lat"], "longitude": row["lon"], "height": 7.0, "altitude_geodetic": 90.0,
                         "speed_horizontal": 1500, "speed_vertical": -200, "direction": 9000, "status": 2,
                         "timestamp": (air.FLIGHT_UNIX_S + row["time_boot_ms"] / 1000 - air.BOOT_AHEAD_S + 18) % 3600})
    log = flight_log(rows)
    native = [fix for fix in log.fixes if fix.source == "OPEN_DRONE_ID_LOCATION"]
    telemetry = [fix for fix in log.fixes if fix.source == "GLOBAL_POSITION_INT"]
    assert len(native) == len(telemetry)
    assert all(a.hour_s == pytest.approx(b.hour_s, abs=0.01) for a, b in zip(native, telemetry))
    assert (native[0].speed_m_s, native[0].vertical_speed_m_s, native[0].direction_deg) == (15.0, -2.0, 90.0)


def test_messages_of_others_in_the_log_count_for_nothing(flight_log):
    """Other components' telemetry, another transmitter's messages, another aircraft's."""
    rows = []
    for row in air.played_log(8):
        rows.append({**row, "mavpackettype": row["type"], "compid": 1})
        if row["type"] in ("SYSTEM_TIME", "GLOBAL_POSITION_INT", "HEARTBEAT"):
            shift = {"time_unix_usec": 1685000000000000, "lat": 10, "base_mode": 0}
            rows.append({**rows[-1], "compid": 191, **{k: v for k, v in shift.items() if k in row}})
        if row["type"] == "GLOBAL_POSITION_INT":
            native = {"time": row["time"], "mono": row["mono"], "mavpackettype": "OPEN_DRONE_ID_LOCATION",
                      "latitude": 10, "longitude": 10}
            rows += [{**native, "compid": 236}, {**native, "compid": 1, "id_or_mac": [0] * 19 + [7]}]
    run, _ = transmit(channels=("bt4",), seconds=6)
    log = flight_log(rows)
    assert counts(run, log) == {} and {fix.source for fix in log.fixes} == {"GLOBAL_POSITION_INT"}


def test_height_follows_relative_altitude_until_arming(flight_log):
    unarmed = [{**row, "base_mode": 81} if row["type"] == "HEARTBEAT" else row for row in air.played_log(8)]
    for row in unarmed:
        if row["type"] == "GLOBAL_POSITION_INT":
            row["relative_alt"] += 5000  # home is 5 m lower than the take-off point
    run, _ = transmit(channels=("wifi",), seconds=5)
    assert counts(run, flight_log(unarmed))["played.height"] > 5
    run, _ = transmit(channels=("wifi",), seconds=5, faults=Faults(
        location=lambda fix, t: encode_fix(fix, height_m=fix["relative_alt"] / 1000 + 5)))
    assert counts(run, flight_log(unarmed)) == {}


def test_geodetic_altitude_is_unknown_without_the_ellipsoid(flight_log):
    log = air.played_log(8)
    for row in log:
        if row["type"] == "GPS_RAW_INT":
            row["alt_ellipsoid"] = 0  # a MAVLink 1 autopilot doesn't say it
    run, _ = transmit(channels=("wifi",), seconds=5)
    assert counts(run, flight_log(log))["played.altitude"] > 5
    run, _ = transmit(channels=("wifi",), seconds=5, faults=Faults(
        location=lambda fix, t: encode_fix(fix, geodetic_m=None)))
    assert counts(run, flight_log(log)) == {}


def test_a_message_that_comes_late(flight_log):
    late = Faults(schedule=lambda seconds: [s for s in air.slots(seconds) if s[1] != "self_id" or s[0] > 5])
    run, _ = transmit(channels=("bt4",), faults=late)
    assert counts(run) == {"interval.reception": 1}
    assert counts(run, warmup_s=5.0) == {}


def test_system_timestamp_that_goes_back():
    def earlier(data, t):
        if data[6] >> 4 != 4 or t < 6:
            return data
        return data[:26] + (int.from_bytes(data[26:30], "little") - 100).to_bytes(4, "little") + data[30:]

    run, _ = transmit(channels=("bt4",), faults=Faults(advertising=earlier))
    assert counts(run)["system.backward"] == 1


def test_two_basic_ids_share_a_counter():
    """A second identifier takes turns in its slot: neither stuck, nor lost, nor backward."""
    turn = {"n": 0}

    class TwoIds(air.Transmitter):
        def message(self, name, t):
            if name != "basic_id":
                return super().message(name, t)
            turn["n"] += 1
            return air.basic_id() if turn["n"] % 2 else air.basic_id("SWE-REG-1", id_type=2)

    original, air.Transmitter = air.Transmitter, TwoIds
    try:
        run, _ = transmit(channels=("bt4",))
    finally:
        air.Transmitter = original
    assert counts(run) == {}


@pytest.mark.parametrize("silence_s, backward", [(11, 1), (13, 0)])
def test_a_counter_says_nothing_after_a_long_silence(silence_s, backward):
    """With ten payloads a second it may have gone half of its circle by then."""
    run, _ = transmit(channels=("wifi",), faults=Faults(
        counter=lambda name, value: (value + 150) % 256 if 40 <= value < 200 else value))
    after = False
    for reception in run.receptions:
        after = after or reception.payload[1] == 190
        reception.mono += silence_s if after else 0
    assert after and counts(run).get("counter.backward", 0) == backward


def test_every_violation_is_counted_and_some_are_listed():
    run, _ = transmit(channels=("bt5",), faults=Faults(pack=lambda messages: messages[1]))
    findings = judge(run, Options()).findings
    assert findings.counts["structure.single"] == len(run.receptions) > LISTED_OF_A_KIND
    assert sum(v.kind == "structure.single" for v in findings.violations) == LISTED_OF_A_KIND
