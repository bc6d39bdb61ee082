"""Flights in the simulated world: what is on the air, and how soon it is there again. No machine is late here, so every
limit is the daemon's own, in the thousandths of a second that the models leave it."""

import re
from itertools import pairwise

import parts
import pytest
from bench.attacker import Speaker
from models import front
from models.flight import write_flight
from pymavlink.dialects.v20 import common

from .autopilots import says_native_messages_alone, tells_of_no_receiver
from .faults import BY_NAME, FAULTS
from .flight import Flight
from .laws import broken_laws
from .world import START_US

FLIGHT_S = 120
AT_S, BACK_S = 30.0, 34.0  # a fault begins, and what it took away is back


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("simulated") / "flight.tlog"
    write_flight(path, FLIGHT_S + 10)
    return path


@pytest.fixture
def make_flight(tmp_path, log):
    flights = []

    def make(flight=log, **options):
        flights.append(Flight(tmp_path / f"flight-{len(flights)}", flight, **options))
        return flights[-1]
    yield make
    for one in flights:
        one.end()


def passed(flight):
    """The flown flight's judgement: none of the judge's rules was broken."""
    flight.fly(FLIGHT_S)
    judgement = flight.judged()
    assert judgement.verdict == "PASS", judgement.findings.violations
    return judgement


@pytest.mark.parametrize("mode", front.MODES)
def test_everything_is_right_by_each_kind_of_chip(make_flight, mode):
    """In every field, on every channel, and in time: the judge's whole set of rules."""
    figures = passed(make_flight(mode=mode)).figures
    slow = mode == "bcm43455"
    assert figures["bt4_location_content_p99_s"] <= (0.40 if slow else 0.30)
    assert figures["bt4_location_content_max_s"] <= (0.50 if slow else 0.40)
    assert figures["wifi_location_content_max_s"] <= 0.40
    assert figures["bt4_all_five_within_p99_s"] <= 1.1
    assert figures["bt4_position_age_p99_s"] <= (0.33 if slow else 0.25)
    assert figures["bt4_payloads_heard"] == figures["bt4_payloads_set"] > 800


def test_everything_is_right_behind_a_router(make_flight):
    passed(make_flight(link="udp"))


def test_the_recorded_flight_is_right(make_flight):
    recorded = parts.recorded_flight()
    if not recorded.is_file():
        pytest.skip(f"{recorded.name} isn't in TEST_DATA")
    passed(make_flight(flight=recorded))


@pytest.mark.parametrize("every_s", [0.9, 1.0, 1.1, 1.5])
def test_native_messages_beside_faster_telemetry_age_nothing(make_flight, tmp_path, every_s):
    write_flight(tmp_path / "native.tlog", FLIGHT_S + 10, native_hz=1 / every_s)
    without, beside = (passed(flight).figures["bt4_position_age_p99_s"]
                       for flight in (make_flight(), make_flight(flight=tmp_path / "native.tlog")))
    assert beside <= without + 0.01


@pytest.mark.parametrize("seed", range(1, 6))
def test_a_machine_that_is_late_loses_no_message(make_flight, seed):
    """Three of ten times, by up to 150 ms, which is more than a slot: every limit of the rules is kept, and no payload is
    replaced before it was sent."""
    passed(make_flight(seed=seed, late=(0.3, 150_000)))


def test_the_same_seed_gives_the_same_octets(make_flight):
    found = []
    for seed in (7, 7, 8):
        flight = make_flight(seed=seed)
        flight.fly(20)
        found.append(flight.octets())
    assert found[0] == found[1] != found[2]


# --- faults -----------------------------------------------------------------------------


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
@pytest.mark.parametrize("seed", range(1, 6))
def test_it_is_on_the_air_again(make_flight, fault, seed):
    flight = make_flight(seed=seed, kept=fault.kept)
    flight.harm(fault, AT_S, BACK_S - AT_S)
    flight.fly(FLIGHT_S)
    assert broken_laws(flight, FLIGHT_S) == []


@pytest.mark.parametrize("mode", front.MODES)
def test_a_chip_that_resets_itself_is_set_up_again(make_flight, mode):
    """It says nothing of it; one without advertising sets takes data as before, and sends none."""
    flight, times_s = make_flight(mode=mode), (AT_S, AT_S + 10.3, AT_S + 20.6, AT_S + 30.9)
    for at_s in times_s:
        flight.harm(BY_NAME["controller_resets_silently"], at_s)
    flight.fly(FLIGHT_S)
    assert broken_laws(flight, FLIGHT_S) == []
    said = flight.technician.answers[-1]["channels"]["bt4"]
    assert said["starts"] == 1 and said["repairs" if mode != "full" else "failures"] == len(times_s)


def test_a_chip_that_only_its_driver_brings_back_is_given_up_and_that_is_said(make_flight):
    flight = make_flight(mode="bcm43455", kept=True)
    flight.harm(BY_NAME["controller_hangs_until_bound_anew"], AT_S)
    flight.fly(FLIGHT_S)
    assert broken_laws(flight, FLIGHT_S) == []
    said = [answer["channels"]["bt4"] for answer in flight.technician.answers]
    stuck = [one for one in said if one["stuck"]]
    assert stuck and all("its driver is to be bound anew" in one["detail"] and one["state"] != "on air" for one in stuck)
    assert not said[-1]["stuck"] and said[-1]["state"] == "on air"
    assert any(gap["channel"] == "bt4" for gap in flight.record()["events"] if gap["event"] == "gap")


def test_a_silent_autopilot_is_a_failure_that_is_said(make_flight):
    """From 3 s after its last heartbeat on, on every channel; and never before."""
    flight = make_flight()
    flight.at(AT_S + 0.5, setattr, flight.autopilot, "silent", True)
    flight.fly(AT_S + 10)
    for track in flight.judged().tracks:
        failed = [heard.reception.mono - START_US / 1e6 for heard, location in track.of_type("location")
                  if location.status == 4 and heard.reception.mono > START_US / 1e6 + 10]
        assert AT_S + 3.0 <= min(failed) < AT_S + 3.5, track.channel


# In the air; on the ground, where it takes off so.
@pytest.mark.parametrize("at_s", [AT_S, 2.5])
def test_one_that_falls_silent_is_asked_on(make_flight, at_s):
    """A ground station switched its messages off for as long as two questions are apart: after three silent seconds nobody asked
    any more, and it was silent until power-off."""
    flight = make_flight()
    flight.at(at_s, setattr, flight.autopilot, "silent", True)
    flight.fly(at_s + 60)
    for message in common.MAVLINK_MSG_ID_HEARTBEAT, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT:
        asked = [mono - START_US / 1e6 for mono, which in flight.autopilot.asked if which == message]
        late = [at_s + 5, *(one for one in asked if one > at_s + 5), at_s + 60]
        assert max(after - before for before, after in pairwise(late)) < 8, message


def test_a_daemon_that_begins_without_a_position_says_so_at_once(make_flight):
    """Where the one before it did: else each one that is killed takes the word back for three seconds."""
    flight = make_flight(kept=True)
    flight.harm(BY_NAME["autopilot_unplugged"], AT_S, 20.0)
    flight.harm(BY_NAME["daemon_killed"], AT_S + 10)
    flight.fly(AT_S + 30)
    assert broken_laws(flight, AT_S + 30) == []
    for track in flight.judged().tracks:
        said = {location.status for heard, location in track.of_type("location")
                if AT_S + 4 < heard.reception.mono - START_US / 1e6 < AT_S + 20}
        assert said == {4}, track.channel


def test_a_forged_word_for_no_fix_takes_no_position_off_the_air(make_flight):
    """Twenty-five times a second, beside the receiver's own word each second: within eight seconds it is known that two
    speak, and told, and from then on theirs has no effect."""
    flight, forger, lasts_s, known_s = make_flight(), Speaker(1, 1), 30, 8
    for number in range(lasts_s * 25):
        flight.at(AT_S + number / 25, lambda: flight.autopilot.device.send(forger.fix(1)))
    flight.fly(AT_S + lasts_s)
    known_us = START_US + (AT_S + known_s) * 1_000_000
    for track in flight.judged().tracks:
        new = [heard.reception.mono for (_, before), (heard, location) in pairwise(track.of_type("location"))
               if location.raw != before.raw and heard.reception.mono > known_us / 1e6]
        assert len(new) > 80 and max(after - before for before, after in pairwise(new)) <= 0.6, track.channel
    told = [one for one in flight.autopilot.said if one.mono > known_us / 1e6]
    assert told and not any(one.good for one in told)


def test_armed_is_written_down_as_soon_as_it_can_be(make_flight):
    """What couldn't be written at arming was never tried again: updates went by "no" for the whole flight."""
    flight = make_flight()
    run_dir = flight.world.root / "run/odid"
    flight.at(2.5, (run_dir / "kept").unlink)
    for name in ("kept", "kept.new"):  # neither another one, nor in place
        flight.at(2.5, (run_dir / name).mkdir)
        flight.at(8.0, (run_dir / name).rmdir)
    flight.fly(8.0)
    assert not (run_dir / "kept").is_file()
    flight.fly(9.0)
    assert "armed yes" in (run_dir / "kept").read_text().splitlines()
    assert (flight.folder / "odid-daemon.log").read_text().count("can't keep") == 1


def test_a_daemon_that_begins_without_heartbeats_asks_for_them_and_tells_the_pilot(make_flight):
    """It asked for nothing, and was silent to the autopilot, for the rest of the flight: one word of a ground station's for each
    message was enough."""
    flight = make_flight(kept=True)
    flight.at(AT_S, setattr, flight.autopilot, "rewrite", lambda message: message.get_type() != "HEARTBEAT")
    flight.harm(BY_NAME["daemon_killed"], AT_S + 6)
    flight.at(AT_S + 14, setattr, flight.autopilot, "rewrite",
              lambda message: message.get_type() not in ("HEARTBEAT", "GLOBAL_POSITION_INT"))
    flight.fly(AT_S + 30)
    asked = {message for mono, message in flight.autopilot.asked if mono > START_US / 1e6 + AT_S + 14}
    assert {common.MAVLINK_MSG_ID_HEARTBEAT, common.MAVLINK_MSG_ID_GLOBAL_POSITION_INT} <= asked
    told = [one.mono for one in flight.autopilot.said if one.mono > START_US / 1e6 + AT_S + 6]
    assert max(after - before for before, after in pairwise([START_US / 1e6 + AT_S + 7, *told])) < 4


def armed_word(flight):
    """What the daemon keeps of whether it is armed."""
    return re.search(r"^armed (\w+)$", (flight.world.root / "run/odid/kept").read_text(), re.M)[1]


def test_an_old_disarmed_is_no_word_of_one_that_speaks_on(make_flight):
    """Settings, the page and updates were open in the air, where its HEARTBEATs were held back and it flew slowly."""
    flight = make_flight(kept=True)
    flight.at(2.5, setattr, flight.autopilot, "rewrite", lambda message: message.get_type() != "HEARTBEAT")
    flight.fly(2.5)
    assert armed_word(flight) == "no"
    flight.fly(6.5)
    assert armed_word(flight) == "unsaid"
    flight.at(6.5, setattr, flight.autopilot, "rewrite", lambda message: False)
    flight.fly(12)
    assert armed_word(flight) == "silent"


def test_what_another_daemon_heard_is_no_word_of_one_that_speaks_on(make_flight):
    """Its HEARTBEATs were held back, and a setting was saved: "disarmed" stood until power-off."""
    flight = make_flight(kept=True)
    flight.at(2.5, setattr, flight.autopilot, "rewrite", lambda message: message.get_type() != "HEARTBEAT")
    flight.harm(BY_NAME["daemon_killed"], 2.6)
    flight.fly(2.6)
    assert armed_word(flight) == "no"
    flight.fly(7.5)
    assert armed_word(flight) == "unsaid"
    flight.harm(BY_NAME["daemon_killed"], 7.6)
    for tenth in range(76, 130):
        flight.fly(tenth / 10)
        assert armed_word(flight) == "unsaid"
    flight.at(13, setattr, flight.autopilot, "rewrite", lambda message: False)
    flight.harm(BY_NAME["daemon_killed"], 13.1)
    flight.fly(18)
    assert armed_word(flight) == "silent"


@pytest.mark.parametrize("changed", [says_native_messages_alone, tells_of_no_receiver])
def test_a_killed_daemon_has_the_position_again_where_only_native_messages_know_of_a_fix(make_flight, tmp_path, changed):
    """The next one made up a receiver, which then fell silent: nowhere until power-off."""
    write_flight(tmp_path / "native.tlog", FLIGHT_S, native_hz=1, changed=changed)
    flight = make_flight(flight=tmp_path / "native.tlog", kept=True)
    flight.harm(BY_NAME["daemon_killed"], AT_S)
    flight.fly(60)
    for track in flight.judged().tracks:
        late = {location.status for where, location in track.of_type("location") if where.reception.mono - START_US / 1e6 > BACK_S}
        assert late == {2}, track.channel


# As root's file has it; at the first power-on; and where somebody has changed the number since.
@pytest.mark.parametrize("words", [("-expect-vehicle", "1"), (), ("-expect-vehicle", "7")])
def test_one_that_says_all_but_heartbeats_from_the_start_is_no_absent_one(make_flight, words):
    """It counted as one that wasn't there: an update could restart the computer in the air."""
    flight = make_flight(kept=True)
    flight.daemon_words = words
    flight.autopilot.rewrite = lambda message: False
    flight.at(0.1, flight.kill_service, "odid-keeper")
    flight.at(6, setattr, flight.autopilot, "rewrite", lambda message: message.get_type() != "HEARTBEAT")
    flight.fly(8.5)
    assert armed_word(flight) == ("awaited" if words else "unheard")
    flight.fly(10)
    assert armed_word(flight) == "unsaid"
    flight.at(10, setattr, flight.autopilot, "rewrite", None)
    flight.fly(12)
    assert armed_word(flight) in ("no", "yes")


def test_one_that_says_heartbeats_as_another_component_is_no_absent_one(make_flight):
    """A parameter gave PX4 that one, from the next power-on on: a server's update could begin in the air."""
    flight = make_flight(kept=True)
    flight.daemon_words = ("-expect-vehicle", "1")
    flight.autopilot.rewrite = lambda message: False
    flight.at(0.1, flight.kill_service, "odid-keeper")
    flight.at(6, setattr, flight.autopilot, "rewrite", lambda message: setattr(message.get_header(), "srcComponent", 2))
    flight.fly(8)
    assert armed_word(flight) == "awaited"
    flight.fly(11)
    assert armed_word(flight) == "unsaid"


def test_one_that_speaks_on_under_another_number_has_not_said_that_it_is_disarmed(make_flight):
    """A station gave it one, and held its HEARTBEATs back: the last word stood, of one that was taken to be switched off."""
    def changed(message):
        message._header.srcSystem = 2
        return message.get_type() != "HEARTBEAT"

    flight = make_flight(kept=True)
    flight.at(2.6, setattr, flight.autopilot, "rewrite", changed)
    flight.fly(2.6)
    assert armed_word(flight) == "no"
    flight.fly(8)
    assert armed_word(flight) == "unsaid"


def test_one_that_is_switched_off_disarmed_has_said_it(make_flight):
    """Its last HEARTBEAT comes before its last word; for a second nobody knew, and maintenance ended."""
    flight = make_flight(kept=True)
    seen = set()
    flight.at(2.6, setattr, flight.autopilot, "rewrite", lambda message: False)
    for tenth in range(25, 90):
        flight.fly(tenth / 10)
        seen.add(armed_word(flight))
    assert seen == {"no", "silent"}


def test_a_channel_that_one_daemon_had_on_the_air_is_missed_by_the_next_one(make_flight):
    """Its controller came back without Bluetooth 5; that was forgotten, and the pilot was told that all is well."""
    flight = make_flight(kept=True)
    flight.at(AT_S, setattr, flight.controller, "mode", "legacy20")
    flight.harm(BY_NAME["daemon_killed"], AT_S)
    flight.fly(AT_S + 30)
    told = [one for one in flight.autopilot.said if one.mono > START_US / 1e6 + AT_S + 5]
    assert told and {one.reason for one in told} == {"Bluetooth 5 off: unsupported"}
    missed = flight.record()["channels"]["bt5"]
    assert missed["required"] and missed["armed_longest_gap_s"] > 15  # it is written each 10 s


def test_what_a_daemon_that_was_taken_over_has_kept_holds_nobody_off(make_flight):
    """It waited for an armed vehicle that there isn't, and the one that flew had no position until power-off."""
    flight = make_flight(kept=True)
    flight.daemon_words = ("-expect-vehicle", "1")  # as root's file has it
    flight.at(AT_S, (flight.world.root / "run/odid/kept").write_text, "vehicle 250\narmed yes\narmed-once yes\nfix yes\n")
    flight.at(AT_S, flight.kill_service, "odid-keeper")
    flight.fly(AT_S + 12)
    for track in flight.judged().tracks:
        said = {location.status for heard, location in track.of_type("location")
                if heard.reception.mono - START_US / 1e6 > AT_S + 8}
        assert said == {2}, track.channel


def heard_by_wifi(flight, kind):
    """When each message of a kind was heard, in seconds of the flight."""
    (track,) = (track for track in flight.judged().tracks if track.channel == "wifi")
    return [heard.reception.mono - START_US / 1e6 for heard, _ in track.of_type(kind)]


def longest_gap_s(times):
    return max(later - earlier for earlier, later in pairwise(times))


@pytest.mark.parametrize("times, without_self_id_s", [(1, 0.6), (2, 11.5)])
def test_an_element_that_the_chip_refuses_for_once_is_given_again(make_flight, times, without_self_id_s):
    """The driver then says OK to what isn't sent, and fails with all else: off the air until hostapd was started again. At the
    second time it is shorter for ten seconds."""
    flight = make_flight()
    flight.at(AT_S, flight.hostapd.order, "refuse", str(times))
    flight.fly(AT_S + 30)
    assert longest_gap_s(heard_by_wifi(flight, "location")) < 0.6
    assert longest_gap_s(heard_by_wifi(flight, "operator_id")) < 0.6
    assert longest_gap_s(heard_by_wifi(flight, "self_id")) < without_self_id_s


def test_a_hostapd_that_somebody_switched_off_is_switched_on(make_flight):
    flight = make_flight()
    flight.at(AT_S, flight.hostapd.answer, "DISABLE")
    flight.fly(FLIGHT_S)
    assert longest_gap_s(heard_by_wifi(flight, "location")) < 2.5
    assert [said["state"] for at_s, said in wifi_said(flight)][-1] == "on air"


@pytest.mark.parametrize("messages, kinds", [(4, {"location", "basic_id", "system", "operator_id"}),
                                             (3, {"location", "basic_id", "system", "operator_id", "self_id"}),
                                             (1, {"location", "basic_id", "system", "operator_id", "self_id"})])
def test_a_chip_without_room_for_all_messages_has_those_that_matter_most(make_flight, messages, kinds):
    """And where these have no room, each in turn: three were without the operator's place for a whole flight, and good to arm.
    Trying more again and again costs hardly a beacon."""
    flight = make_flight()
    flight.at(AT_S, flight.hostapd.order, "limit", str(10 + 25 * messages))
    flight.fly(FLIGHT_S)
    later = {kind: [at for at in heard_by_wifi(flight, kind) if at > AT_S + 2]
             for kind in ("location", "basic_id", "system", "operator_id", "self_id")}
    assert {kind for kind, times in later.items() if times} == kinds
    assert longest_gap_s(later["location"]) < 0.7 and all(longest_gap_s(later[kind]) < 3 for kind in kinds)


def wifi_said(flight):
    return [(one["at_s"] - START_US / 1e6, one["channels"]["wifi"]) for one in flight.technician.answers]


def test_what_the_chip_counts_is_said_to_be_confirmed(make_flight):
    flight = make_flight()
    flight.fly(FLIGHT_S)
    assert {said["known"] for at_s, said in wifi_said(flight) if at_s > AT_S} == {"confirmed"}


@pytest.mark.parametrize("seconds", (4, 40))
def test_a_chip_that_says_ok_and_sends_nothing_is_off_the_air(make_flight, seconds):
    """Of the beacons nobody knew but the chip."""
    flight = make_flight()
    flight.harm(BY_NAME["wifi_chip_silent"], AT_S, seconds)
    flight.fly(AT_S + seconds + 10)
    silent = [said for at_s, said in wifi_said(flight) if AT_S + 3 < at_s < AT_S + seconds]
    assert silent and all(said["state"] != "on air" for said in silent)
    assert any("sends no beacon" in said["detail"] for said in silent)
    assert all(said["state"] == "on air" for at_s, said in wifi_said(flight) if at_s > AT_S + seconds + 3)
    assert any(said["stuck"] for said in silent) == (seconds > 10)


# --- the flight record --------------------------------------------------------------------


def test_a_quiet_flight_has_no_gap(make_flight):
    flight = make_flight(kept=True)
    flight.fly(FLIGHT_S)
    record = flight.record()
    assert all(record["channels"][channel]["armed_longest_gap_s"] == 0 for channel in flight.channels)
    assert record["verdict"] == "on the air the whole flight" and record["faults"] == 0


def test_the_disk_is_spared(make_flight):
    """A file that is written again has another time: each ten seconds in flight, and at what happens."""
    flight, changes = make_flight(kept=True), []

    def look():
        file = (flight.world.root / "data/odid/flights/00001.jsonl").stat()
        changes.append((file.st_ino, file.st_size, file.st_mtime_ns))
        if len(changes) < 90:
            flight.world.after(1_000_000, look)
    flight.at(AT_S, look)
    flight.fly(FLIGHT_S)
    assert 8 <= len(set(changes)) <= 10
