"""The laws see what they are there for: a flight to which harm was done breaks each of them, where what was done is forgotten."""

import pytest
from models.flight import write_flight
from mutants.laws import CASES

from . import random_flights
from .faults import BY_NAME, FAULTS, Window
from .flight import Flight
from .laws import broken_laws, judged_by_law
from .world import START_US

FLIGHT_S = 120
BROKEN = {
    "no newer position": ("bt4: no newer position", "bt5: no newer position", "wifi: no newer position"),
    "no other message": ("bt4: no basic_id", "bt4: no system", "bt4: no operator_id", "bt4: no self_id", "bt5: no system"),
    "told that it is bad": ('"Bluetooth 4 off: absent"', '"no link to the autopilot"'),
    "not told": ("no ARM_STATUS",),
    "failure": ("bt4: Remote ID system failure", "wifi: Remote ID system failure"),
    "recorded gaps": ("bt4: the flight record has a gap", "wifi: the flight record has a gap")}


@pytest.fixture(scope="module")
def harmed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laws")
    write_flight(folder / "flight.tlog", FLIGHT_S + 10)
    flight = Flight(folder / "flight", folder / "flight.tlog", seed=3, kept=True)
    for at_s, name in ((30, "controller_unplugged"), (60, "autopilot_unplugged"), (90, "daemon_hangs")):
        flight.harm(BY_NAME[name], at_s, 4)
    flight.fly(FLIGHT_S)
    yield flight
    flight.end()


def test_with_what_was_done_they_hold(harmed):
    assert broken_laws(harmed, FLIGHT_S) == []


def test_for_each_of_them_make_laws_has_a_fault(harmed):
    assert {case.law for case in CASES} == set(judged_by_law(harmed, FLIGHT_S))


def test_what_happened_before_a_failure_can_be_read(harmed, tmp_path):
    happened = random_flights.trace(harmed)
    assert happened == sorted(happened) and len({what.split()[0] for _, what in happened}) == 5
    (tmp_path / "trace.txt").write_text("".join(f"{at_s:9.3f} {what}\n" for at_s, what in happened))
    said = random_flights.just_before("bt4: no newer position from 29.800 to 31.100 s", tmp_path).splitlines()
    assert 1 < len(said) <= random_flights.LAST_EVENTS and any("done   controller_unplugged to bt4" in line for line in said)


@pytest.mark.parametrize("sentences", BROKEN.values(), ids=BROKEN)
def test_without_it_each_is_broken(harmed, sentences, monkeypatch):
    monkeypatch.setattr(harmed, "windows", [])
    broken = broken_laws(harmed, FLIGHT_S)
    for sentence in sentences:
        assert any(one.startswith(sentence) for one in broken), sentence


def test_a_failure_that_isn_t_said_is_missed(harmed, monkeypatch):
    """Four seconds without a word of the autopilot's, said to have been ten."""
    monkeypatch.setattr(harmed, "windows", [
        one._replace(back_s=one.back_s + 6) if one.fault.no_position else one for one in harmed.windows])
    assert any("where there was no position for long" in one for one in broken_laws(harmed, FLIGHT_S))


def test_a_judge_s_rule_is_heard(harmed, monkeypatch):
    """As by a daemon whose position is another one."""
    judgement = harmed.judged()
    judgement.findings.violation("played.position", (0.0, START_US / 1e6 + 50), "the position was never played", "a", "b", "bt4")
    monkeypatch.setattr(harmed, "judged", lambda: judgement)
    assert any(one.startswith("played.position at 50.000 s on bt4") for one in broken_laws(harmed, FLIGHT_S))


def test_a_forgery_that_isn_t_told_is_missed(harmed, monkeypatch):
    told = next(one for one in FAULTS if one.told)
    monkeypatch.setattr(harmed, "windows", [*harmed.windows, Window(None, 40.0, 45.0, told)])
    monkeypatch.setattr(harmed.autopilot, "said", [one._replace(good=True) for one in harmed.autopilot.said])
    assert any("the pilot wasn't told" in one for one in broken_laws(harmed, FLIGHT_S))


def test_good_is_not_believed_where_nothing_was_heard(harmed, monkeypatch):
    """As by a daemon that says that all is well whatever happens."""
    monkeypatch.setattr(harmed.autopilot, "said", [one._replace(good=True) for one in harmed.autopilot.said])
    assert any('"good to arm"' in one for one in broken_laws(harmed, FLIGHT_S))


def test_a_gap_that_is_not_in_the_record_is_missed(harmed, monkeypatch):
    record = harmed.record()
    record["events"] = [one for one in record["events"] if one["event"] != "gap"]
    monkeypatch.setattr(harmed, "record", lambda: record)
    assert any("the flight record doesn't say so" in one for one in broken_laws(harmed, FLIGHT_S))


def test_what_it_costs_is_seen(harmed, monkeypatch):
    daemon = harmed.world.called("odid-daemon")
    monkeypatch.setattr(harmed, "costs_at_first", (daemon.pid, 3, 100))
    monkeypatch.setattr(harmed, "kept", False)  # a kept one is woken for the others, too
    monkeypatch.setattr(daemon, "wakeups", 61 * FLIGHT_S)
    broken = broken_laws(harmed, FLIGHT_S)
    assert any("descriptors" in one for one in broken) and any("KiB of memory" in one for one in broken)
    assert any("wake-ups" in one for one in broken)


def test_a_clock_that_is_off_is_seen(harmed, monkeypatch):
    monkeypatch.setattr(harmed.world, "realtime_us", harmed.world.realtime_us + 5_000_000)
    assert any("clock is 5.0 s off" in one for one in broken_laws(harmed, FLIGHT_S))
