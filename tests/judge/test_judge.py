"""The judge passes a clean transmitter and fails each wrong one, with the right violation."""

import json

import pytest

from . import synthetic as air
from .conformance import Options, judge
from .flight_log import read_flight_log
from .report import complete_figures, report_text
from .set_log import read_set_log
from .synthetic import Faults, encode_fix, pack, transmit

ALL = ("bt4", "bt5", "wifi")


@pytest.fixture(scope="module")
def flight_log(tmp_path_factory):
    path = tmp_path_factory.mktemp("flight") / "played.jsonl"
    path.write_text("".join(json.dumps(row) + "\n" for row in air.played_log(14)))
    return read_flight_log(path)


def kinds(run, **options):
    log = options.pop("log", None)
    return judge(run, Options(**options), log).findings.counts


def texts(run, log=None):
    return " | ".join(f"{v.what} {v.expected} {v.found}" for v in judge(run, Options(), log).findings.violations)


@pytest.mark.parametrize("interval_s", [0.02, 0.1])
def test_clean_transmitter_passes_with_and_without_log(flight_log, tmp_path, interval_s):
    run, set_rows = transmit(interval_s=interval_s)
    path = tmp_path / "set.jsonl"
    path.write_text("".join(json.dumps(row) + "\n" for row in set_rows))
    assert judge(run, Options(expect_channels=ALL)).findings.violations == []
    judgement = judge(run, Options(expect_channels=ALL), flight_log, read_set_log(path))
    assert judgement.findings.violations == [] and judgement.verdict == "PASS"
    figures = judgement.figures
    assert figures["bt4_payloads_set"] == figures["bt4_payloads_heard"] > 80
    assert figures["bt4_lost_payloads"] == 0
    assert figures["bt4_location_reception_max_s"] < 0.4
    assert 0.05 < figures["position_age_p99_s"] < 0.7
    assert figures["position_age_beyond_interval_p99_s"] < 0.4
    assert figures["bt4_all_five_within_p99_s"] < 1.3


def lose_counter(data, t):
    return bytes((0x1D,)) + data[1:5] + data[6:]


def test_missing_counter_is_named():
    run, _ = transmit(faults=Faults(advertising=lose_counter), channels=("bt4",))
    found = kinds(run)
    assert found["counter.missing"] == len(run.receptions) and "nothing" in found
    assert "counter byte missing" in texts(run) and "read one octet late" in texts(run)
    assert found["structure.size"] == len(run.receptions)  # 30 octets


def test_missing_counter_in_a_padded_element_and_in_a_pack():
    run, _ = transmit(faults=Faults(extended=lambda data: bytes((data[0] - 1,)) + data[1:5] + data[6:]),
                      channels=("bt5",))
    assert kinds(run)["counter.missing"] == len(run.receptions)


def swapped_vertical(fix, t):
    return encode_fix(fix, vertical_m_s=fix["vz"] / 100)


def test_swapped_vertical_sign(flight_log):
    run, _ = transmit(faults=Faults(location=swapped_vertical))
    assert "plausibility.climb" in kinds(run)
    with_log = judge(run, Options(), flight_log).findings
    assert with_log.counts["played.vertical_speed"] > 10
    assert any("the sign is swapped" in v.what for v in with_log.violations)


@pytest.mark.parametrize("axis, word", [("lon", "longitude"), ("lat", "latitude")])
def test_swapped_position_sign(flight_log, axis, word):
    run, _ = transmit(faults=Faults(location=lambda fix, t: encode_fix(fix, **{axis: -fix[axis]})))
    found = judge(run, Options(), flight_log).findings
    assert found.counts["played.position"] > 10
    assert any(f"the sign of the {word} is swapped" in v.what for v in found.violations)
    if axis == "lon":  # mostly eastward: seen without the log too
        assert "plausibility.course" in kinds(run)


def test_exchanged_coordinates(flight_log):
    run, _ = transmit(faults=Faults(location=lambda fix, t: encode_fix(fix, lat=fix["lon"], lon=fix["lat"])))
    assert "latitude and longitude are exchanged" in texts(run, flight_log)


def test_stale_position(flight_log):
    """A transmitter that is always 1.6 s behind: intervals are fine, the age isn't."""
    faults = Faults(fix_number=lambda t: int((t - 1.6) / air.FIX_PERIOD_S))
    run, _ = transmit(faults=faults, seconds=12)
    run.receptions = [r for r in run.receptions if r.mono > air.START_MONO + 3]
    assert judge(run, Options(), flight_log).findings.counts["played.stale"] > 50
    assert kinds(run)["location.age"] > 10  # without the log: the System message tells the time


def test_stale_position_stamped_as_fresh(flight_log):
    """The position stops at 5 s; the timestamp goes on."""
    def restamped(fix, t):
        old = air.fix_at(min(25, int((t - 0.01) / 0.2)))
        return encode_fix(old, hour_s=(air.FLIGHT_UNIX_S + t) % 3600)

    run, _ = transmit(faults=Faults(location=restamped))
    assert "plausibility.frozen" in kinds(run)
    found = kinds(run, log=flight_log)
    assert found["played.time"] > 10 and found["played.stale"] > 10 and "played.status" in found


@pytest.mark.parametrize("frozen_at_s", [5.0, 8.5])
def test_frozen_payload_repeated_for_ever(flight_log, frozen_at_s):
    run, _ = transmit(channels=("bt4",), faults=Faults(
        schedule=lambda seconds: [slot for slot in air.slots(seconds) if slot[0] <= frozen_at_s]))
    for log in (None, flight_log):
        found = judge(run, Options(), log).findings
        assert found.counts["interval.content"] == 1
        assert any("until the end of the run (frozen payload" in v.what for v in found.violations)
    # the radio goes on: one message is heard to the end
    assert judge(run, Options()).figures["bt4_location_content_max_s"] > 3


def test_frozen_pack():
    run, _ = transmit(channels=("wifi",), faults=Faults(fix_number=lambda t: min(10, int(t / 0.2))))
    found = kinds(run)
    assert found["interval.content"] == 1


def test_one_lost_location_per_three_seconds():
    run, set_rows = transmit(channels=("bt4",), seconds=30, interval_s=0.1,
                             faults=Faults(schedule=air.two_deadlines))
    judgement = judge(run, Options())
    assert judgement.findings.counts["counter.lost"] >= 9
    assert judgement.findings.counts["interval.content"] >= 9
    assert judgement.findings.counts["interval.reception"] >= 9
    assert judgement.figures["bt4_lost_payloads"] >= 9
    assert 1.7 < judgement.figures["bt4_location_reception_max_s"] < 2.2


def test_without_time_a_late_transmitter_passes_and_a_wrong_one_fails():
    """What was beyond its limits is counted all the same, and the report says so."""
    run, _ = transmit(channels=("bt4",), seconds=30, interval_s=0.1, faults=Faults(schedule=air.two_deadlines))
    options = Options(timing=False, limits={"bt4_location_reception_max_s": 0.1})
    judgement = judge(run, options)
    assert judgement.verdict == "PASS" and judgement.findings.not_judged["interval.reception"] >= 9
    assert judgement.findings.not_judged["limit"] == 1
    assert complete_figures(judgement)["not_judged"] == sum(judgement.findings.not_judged.values())
    assert "[interval.reception] " in report_text(judgement, run, options, "late")
    run, _ = transmit(faults=Faults(advertising=lose_counter), channels=("bt4",))
    assert judge(run, Options(timing=False)).verdict == "FAIL"
    run.receptions.clear()
    assert judge(run, Options(timing=False)).findings.counts == {"nothing": 1}


def test_lost_location_at_four_a_second_shows_in_the_counter_alone():
    """Every 12th Location overwritten at once: no interval is broken, yet a set payload was lost."""
    def schedule(seconds):
        plan, locations = [], 0
        for t, name in air.slots(seconds):
            locations += name == "location"
            plan.append((t, name))
            if name == "location" and locations % 12 == 0:
                plan.append((t, "basic_id"))
        return plan

    run, set_rows = transmit(channels=("bt4",), faults=Faults(schedule=schedule))
    assert kinds(run) == {"counter.lost": 3}


def test_set_log_names_the_payload_that_never_left(tmp_path):
    run, set_rows = transmit(channels=("bt4",), seconds=12, interval_s=0.1, faults=Faults(schedule=air.two_deadlines))
    path = tmp_path / "set.jsonl"
    path.write_text("".join(json.dumps(row) + "\n" for row in set_rows))
    judgement = judge(run, Options(), None, read_set_log(path))
    missing = judgement.figures["bt4_payloads_set"] - judgement.figures["bt4_payloads_heard"]
    assert judgement.findings.counts["set.unheard"] == missing >= 3


def test_wrong_pack_order_and_duplicates():
    run, _ = transmit(channels=("bt5", "wifi"), faults=Faults(pack=lambda m: pack([m[1], m[0], *m[2:]])))
    assert kinds(run) == {"structure.order": len(run.receptions)}
    run, _ = transmit(channels=("wifi",), faults=Faults(pack=lambda m: pack([m[0], m[1], m[1], *m[2:]])))
    assert kinds(run)["structure.duplicate"] == len(run.receptions)


@pytest.mark.parametrize("size, count", [(24, 5), (25, 0), (25, 10)])
def test_pack_that_receivers_drop(size, count):
    run, _ = transmit(channels=("wifi",), faults=Faults(
        pack=lambda m: bytes((0xF2, size, count)) + b"".join(m)))
    assert kinds(run)["structure.message"] == len(run.receptions) and "nothing" in kinds(run)


def test_single_message_on_bluetooth_5():
    run, _ = transmit(channels=("bt5",), faults=Faults(pack=lambda m: m[1]))
    assert kinds(run)["structure.single"] == len(run.receptions)


def test_manufacturer_data_is_never_seen_by_receivers():
    run, _ = transmit(channels=("bt4",), faults=Faults(advertising=lambda d, t: d[:1] + b"\xff" + d[2:]))
    assert kinds(run)["structure.element"] == len(run.receptions)
    assert "manufacturer data" in texts(run)


def test_flags_first():
    run, _ = transmit(channels=("bt5",), faults=Faults(extended=lambda d: b"\x02\x01\x06" + d))
    assert "Flags come before it" in texts(run)
    assert kinds(run)["structure.element"] == len(run.receptions)


def test_changing_private_and_differing_addresses():
    run, _ = transmit(channels=("bt4",), faults=Faults(
        address=lambda t: air.ADDRESS if t < 6 else "C2:00:11:22:33:55"))
    assert kinds(run)["address.changed"] == 1
    run, _ = transmit(channels=("bt4",), faults=Faults(address=lambda t: "42:00:11:22:33:44"))
    assert kinds(run) == {"address.private": 1}
    bt5, _ = transmit(channels=("bt5",), faults=Faults(address=lambda t: "C2:00:11:22:33:66"))
    bt4, _ = transmit(channels=("bt4",))
    bt4.receptions += bt5.receptions
    assert kinds(bt4) == {"address.differs": 1}


def test_counter_that_never_steps_and_one_that_steps_back():
    run, _ = transmit(channels=("bt4",), faults=Faults(counter=lambda name, value: 7))
    assert kinds(run)["counter.stuck"] > 20
    run, _ = transmit(channels=("bt4",), faults=Faults(counter=lambda name, value: (-value) % 256))
    assert kinds(run)["counter.backward"] > 20


def test_silence_at_the_end_and_missing_messages_count():
    run, _ = transmit(channels=("bt4",), faults=Faults(silent_after_s=6.0))
    found = kinds(run)
    assert found["interval.reception"] == 5 and found["interval.content"] == 1
    run, _ = transmit(channels=("bt4",), faults=Faults(
        schedule=lambda seconds: [slot for slot in air.slots(seconds) if slot[1] != "operator_id"]))
    assert kinds(run)["expected.message"] == 1
    assert kinds(run, expect_messages=("location", "basic_id")) == {}
    assert kinds(run, expect_channels=ALL, expect_messages=("location",)) == {"expected.channel": 2}


@pytest.mark.parametrize("build, fragment", [
    (lambda fix: encode_fix(fix, status=7), "status"),
    (lambda fix: encode_fix(fix, hour_s=3600.1), "timestamp"),
    (lambda fix: encode_fix(fix)[:4] + b"\x7f" + encode_fix(fix)[5:], "vertical speed"),
    (lambda fix: encode_fix(fix, lat=900000001), "latitude"),
    (lambda fix: encode_fix(fix)[:2] + b"\xb6" + encode_fix(fix)[3:], "direction"),
    (lambda fix: encode_fix(fix)[:19] + b"\x0d" + encode_fix(fix)[20:], "horizontal accuracy"),
    (lambda fix: encode_fix(fix)[:24] + b"\x01", "reserved"),
])
def test_ranges_of_location(build, fragment):
    run, _ = transmit(channels=("bt4",), seconds=4, faults=Faults(location=lambda fix, t: build(fix)))
    found = judge(run, Options()).findings
    assert any(v.kind == "range.location" and fragment in v.what for v in found.violations)


def test_text_and_version_rules():
    broken = {"basic_id": air.basic_id()[:20] + b"X" + air.basic_id()[21:]}
    run, _ = transmit(channels=("bt4",), seconds=4, faults=Faults(
        advertising=lambda d, t: d[:6] + broken["basic_id"] if d[6] >> 4 == 0 else d))
    assert "padding" in texts(run)
    run, _ = transmit(channels=("bt4",), seconds=4, faults=Faults(
        advertising=lambda d, t: d[:6] + bytes((d[6] & 0xF0,)) + d[7:]))
    assert "structure.version" in kinds(run) and "structure.version" not in kinds(run, any_version=True)


def test_a_gap_in_the_log_is_no_violation_when_status_says_so(tmp_path):
    def log_with_gap():
        path = tmp_path / "gap.jsonl"
        path.write_text("".join(json.dumps(row) + "\n" for row in air.played_log(20, gap=(6.0, 12.0))))
        return read_flight_log(path)

    def number(t):
        newest = int((t - 0.01) / 0.2)
        return 30 if 30 <= newest < 60 else newest

    def honest(fix, t):
        return encode_fix(fix, status=4 if fix["time_boot_ms"] / 1000 - air.BOOT_AHEAD_S < t - 3.1 else 2)

    run, _ = transmit(seconds=18, faults=Faults(fix_number=number, location=honest))
    assert kinds(run, log=log_with_gap()) == {}
    assert kinds(run).get("interval.content") is None  # status 4 excuses it without a log as well
    run, _ = transmit(seconds=18, faults=Faults(fix_number=number))
    assert set(kinds(run, log=log_with_gap())) == {"played.status"}
    assert kinds(run)["interval.content"] == 3


def test_units_and_references_against_the_log(flight_log):
    cases = {"played.speed": dict(speed_m_s=29.2), "played.height": dict(height_m=96.0),
             "played.altitude": dict(geodetic_m=60.0), "played.direction": dict(direction_deg=270.0)}
    for kind, change in cases.items():
        run, _ = transmit(channels=("wifi",), seconds=6, faults=Faults(
            location=lambda fix, t, change=change: encode_fix(fix, **change)))
        assert kind in kinds(run, log=flight_log), kind
    run, _ = transmit(channels=("wifi",), seconds=6, faults=Faults(
        location=lambda fix, t: encode_fix(fix, geodetic_m=fix["alt"] / 1000)))
    assert "above mean sea level instead of the ellipsoid" in texts(run, flight_log)


def test_limits_and_missing_figures():
    run, _ = transmit(channels=("bt4",))
    assert kinds(run, limits={"bt4_location_reception_max_s": 0.4}) == {}
    assert kinds(run, limits={"bt4_location_reception_max_s": 0.1}) == {"limit": 1}
    assert kinds(run, limits={"bt5_location_reception_max_s": 9.0}) == {"limit.missing": 1}


def test_system_time_through_a_float():
    run, _ = transmit(channels=("bt4",), seconds=60, faults=Faults(
        advertising=lambda d, t: d[:26] + (int.from_bytes(d[26:30], "little") // 16 * 16).to_bytes(4, "little")
        + d[30:] if d[6] >> 4 == 4 else d))
    assert "counter.stuck" not in kinds(run) and kinds(run)["system.float"] == 1


def test_jump():
    run, _ = transmit(channels=("bt4",), faults=Faults(
        location=lambda fix, t: encode_fix(fix, lat=fix["lat"] + (20000 if t > 6 else 0))))
    assert kinds(run)["plausibility.jump"] == 1


def flight(tmp_path, **options):
    path = tmp_path / "played.jsonl"
    path.write_text("".join(json.dumps(row) + "\n" for row in air.played_log(20, **options)))
    return read_flight_log(path)


@pytest.mark.parametrize("latitude_e7, longitude_e7", [(10000, -10000), (1, 7)])
def test_a_place_near_zero_is_none(latitude_e7, longitude_e7):
    run, _ = transmit(channels=("bt4",), faults=Faults(
        system=lambda t: air.system(air.FLIGHT_UNIX_S + t, latitude_e7, longitude_e7)))
    assert set(kinds(run)) == {"system.nowhere"}
    run, _ = transmit(channels=("bt4",), faults=Faults(
        location=lambda fix, t: encode_fix(fix, lat=latitude_e7, lon=longitude_e7, speed_m_s=0)))
    assert "location.nowhere" in kinds(run)


def test_vertical_speed_is_right_whichever_way_the_autopilot_sends_it(tmp_path):
    rows = air.played_log(20)
    for row in rows:
        row["vz"] = -row.get("vz", 0)
    path = tmp_path / "played.jsonl"
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))
    log = read_flight_log(path)
    assert log.vertical_inverted and not flight(tmp_path).vertical_inverted
    run, _ = transmit(channels=("bt4",), seconds=18)
    judgement = judge(run, Options(), log)
    assert judgement.verdict == "PASS" and any("upside down" in note for note in judgement.findings.notes)
    run, _ = transmit(channels=("bt4",), seconds=18,
                      faults=Faults(location=lambda fix, t: encode_fix(fix, vertical_m_s=fix["vz"] / 100)))
    assert kinds(run, log=log)["played.vertical_speed"] > 10


def test_system_time_that_stands_still_or_is_another():
    run, _ = transmit(channels=("bt4",), faults=Faults(system=lambda t: air.system(1546300800 + 5)))
    assert kinds(run)["system.frozen"] == 1


@pytest.mark.parametrize("ahead_s, wrong", [(0, False), (2, False), (39600, True), (-3600, True), (None, True)])
def test_system_time_against_the_autopilots(flight_log, ahead_s, wrong):
    run, _ = transmit(channels=("bt4",), faults=Faults(
        system=lambda t: air.system(1546300800 if ahead_s is None else air.FLIGHT_UNIX_S + t + ahead_s)))
    assert ("played.system_time" in kinds(run, log=flight_log)) == wrong


def test_a_position_without_a_fix(tmp_path):
    """GNSS is lost after 8 s, the estimator goes on: right is the last position with status 4 from 3.5 s on."""
    log = flight(tmp_path, no_fix_from=8)

    def right(fix, t):
        return encode_fix(fix, status=4 if t > 11.2 else 2)

    run, _ = transmit(channels=("bt4",), seconds=16, faults=Faults(
        fix_number=lambda t: min(39, int((t - 0.01) / 0.2)), location=right))
    assert kinds(run, log=log) == {}
    run, _ = transmit(channels=("bt4",), seconds=16)
    assert kinds(run, log=log)["played.fix"] > 10
    run, _ = transmit(channels=("bt4",), seconds=16, faults=Faults(fix_number=lambda t: min(39, int((t - 0.01) / 0.2))))
    assert set(kinds(run, log=log)) == {"played.status"}


def test_a_fix_is_any_receivers_and_moves_on(tmp_path):
    run, _ = transmit(channels=("bt4",), seconds=16)
    assert kinds(run, log=flight(tmp_path, no_fix_from=8, second=True)) == {}
    assert kinds(run, log=flight(tmp_path, hangs_from=8))["played.fix"] > 5


def test_a_renewal_in_just_over_a_second_is_no_gap_of_the_log(flight_log):
    """Who takes 1.04 s for each, beside telemetry at 5 Hz."""
    run, _ = transmit(channels=("bt4",), faults=Faults(
        schedule=lambda seconds: [(slot * 0.26, "location") for slot in range(int(seconds / 0.26))],
        fix_number=lambda t: int(int((t + 0.01) / 1.04) * 1.04 / 0.2)))
    assert kinds(run, log=flight_log)["interval.content"] > 3


def test_native_once_a_second_beside_telemetry_at_5_hz(tmp_path):
    """Who shows the native ones only isn't excused by the log's having no newer native one."""
    log = flight(tmp_path, native_s=1.2)
    run, _ = transmit(channels=("bt4",))
    assert kinds(run, log=log) == {}
    run, _ = transmit(channels=("bt4",), faults=Faults(fix_number=lambda t: int((t - 0.01) / 1.2) * 6))
    found = kinds(run, log=log)
    assert found["interval.content"] > 3 and "played.stale" in found


def test_a_geodetic_altitude_that_is_never_known_is_noted():
    run, _ = transmit(channels=("bt4",), faults=Faults(location=lambda fix, t: encode_fix(fix, geodetic_m=None)))
    judgement = judge(run, Options())
    assert judgement.verdict == "PASS" and any("geodetic altitude" in note for note in judgement.findings.notes)


def test_a_height_that_stands_still():
    run, _ = transmit(channels=("bt4",), seconds=20, faults=Faults(location=lambda fix, t: encode_fix(fix, height_m=0)))
    assert set(kinds(run)) == {"plausibility.height"}
