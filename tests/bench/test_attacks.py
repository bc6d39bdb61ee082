"""The worst that was found, done to an appliance in flight: by whoever is at the ground station's end of the link, and by
a process of its own board. What a receiver hears meanwhile is judged from the air."""

import time
from dataclasses import dataclass

import parts
import patience
import pytest
from judge.findings import Findings
from judge.receptions import read_receptions
from judge.structure import check_structure

from . import faults, flights, gaps, runs
from .attacker import ARMED, CRAFTED, DISARMED, ELSEWHERE_E7, HOST, Attacker, Speaker
from .conftest import PASSWORD
from .machine import Machine, configuration

SECONDS = 8
GAP_S = 0.6
ROOT, ODID_WEB, HAWKBIT, MAVLINK = "0 0", "991 990", "992 992", "993 993"
PROCESSES = "pidof odid-daemon hostapd mavlink-routerd"


@dataclass
class Flown:
    machine: Machine
    attacker: Attacker
    windows: dict
    seen: dict
    contents: gaps.Contents = None


def crafted(flown):
    """100 kB in a second, half of it crafted, half full of start bytes."""
    every_s, station = 0.02, Speaker(255, 190)
    flown.attacker.keep_sending(SECONDS, every_s, lambda: [CRAFTED, station.start_bytes()] * round(50_000 * every_s / len(CRAFTED)))


def elsewhere(flown):
    """As the vehicle's autopilot, as new as its own word."""
    forger = Speaker(1, 1)
    flown.attacker.keep_sending(SECONDS, 0.1, lambda: [forger.heartbeat(ARMED), forger.position(flown.attacker.boot_ms() + 200)])


def disarmed(flown):
    """As the vehicle's autopilot; meanwhile maintenance is asked for, and an update."""
    forger, machine = Speaker(1, 1), flown.machine
    machine.must("(sleep 5; odidctl maintenance on; odidctl update /tmp/none.swu) >/tmp/asked 2>&1 </dev/null &")
    flown.attacker.keep_sending(SECONDS, 0.1, lambda: [forger.heartbeat(DISARMED)])
    time.sleep(1)
    flown.seen["asked"], flown.seen["armed"] = machine.must("cat /tmp/asked"), machine.run("odidctl armed").output


def another_vehicle(flown):
    """Which isn't there: a second autopilot, disarmed, then our own serial number elsewhere."""
    other = Speaker(2, 1)
    flown.attacker.keep_sending(SECONDS, 0.1, lambda: [other.heartbeat(DISARMED), other.position(flown.attacker.boot_ms())])


def from_the_board(flown):
    """A process of the board's own, root's and the page's: to the daemon's port, past mavlink-router."""
    forger = Speaker(1, 1)
    for who in (ROOT, ODID_WEB):
        frame = (forger.heartbeat(DISARMED) + forger.position(flown.attacker.boot_ms() + 500)).hex()
        flown.seen[who] = int(flown.machine.must(f"{faults.TOOL} say {who} 127.0.0.1 14550 {frame} 200"))


ATTACKS = {one.__name__: one for one in (crafted, elsewhere, disarmed, another_vehicle, from_the_board)}


@pytest.fixture(scope="module")
def flown(machine_possible):
    """One flight with all of them, one after the other."""
    attacker = Attacker()
    machine = Machine(parts.ROOT / "build/system/attacked", config={"odid.conf": configuration(
        ground_station={"address": f"{HOST}:{attacker.port}"}, maintenance={"password": PASSWORD})})
    flight = Flown(machine, attacker, {}, {})
    judge = None
    try:
        judge = machine.judge(None)
        machine.power_on()
        machine.play(flights.generate(machine.folder / "flight.tlog", 240))
        machine.wait_on_air(position=True)
        patience.wait_for("the telemetry at the ground station's end", lambda: attacker.hears)
        machine.put(faults.TOOL, runs.tool())
        time.sleep(runs.SETTLE_S)
        flight.seen["before"], flight.seen["problems"] = (machine.must(PROCESSES), machine.status()["mavlink"]), machine.status()["problems"]
        for name, attack in ATTACKS.items():
            begun = time.monotonic()
            attack(flight)
            time.sleep(1.5)
            flight.windows[name] = begun, time.monotonic()
            flight.seen[name] = machine.status()
        flight.seen["after"] = machine.must(PROCESSES), machine.status()["mavlink"]
        judge.stop()
        flight.contents = gaps.Contents(machine.folder / "judge/receptions.jsonl")
        yield flight
    finally:
        if judge:
            judge.stop()
        machine.close()
        attacker.close()


@pytest.mark.parametrize("name", ATTACKS)
def test_the_broadcast_goes_on(flown, name):
    gap_s, channel = flown.contents.worst_gap(gaps.CHANNELS, *flown.windows[name])
    patience.promise(f"the longest gap, on {channel}", gap_s, GAP_S)


def test_no_receiver_hears_a_false_position(flown):
    places = [message.latitude_deg for reception in read_receptions(flown.machine.folder / "judge/receptions.jsonl").receptions
              if (heard := check_structure(reception, Findings(), any_version=False))
              for message in heard.messages if message.type_name == "location" and message.latitude_deg is not None]
    assert len(places) > 500
    assert not [one for one in places if abs(one - ELSEWHERE_E7 / 1e7) < 1]
    assert max(places) - min(places) < 0.1


@pytest.mark.parametrize("name", ATTACKS)
def test_nothing_becomes_wrong_and_it_is_armed(flown, name):
    status = flown.seen[name]
    assert status["problems"] == flown.seen["problems"]
    assert status["aircraft"]["armed"] and not status["mavlink"]["contradicted"]


def test_no_process_was_restarted(flown):
    assert flown.seen["after"][0] == flown.seen["before"][0]


def test_what_was_sent_came_as_far_as_it_may(flown):
    """Else nothing was attacked: frames full of start bytes and those of another vehicle reach the daemon, crafted ones don't."""
    (_, before), (_, after) = flown.seen["before"], flown.seen["after"]
    assert flown.seen["crafted"]["mavlink"]["not_needed"] - before["not_needed"] > 500
    assert after["refused"] == before["refused"]
    assert flown.seen[ROOT] == flown.seen[ODID_WEB] == 0, "what only mavlink-router may say passed the filter"
    frame = Speaker(9, 1).heartbeat(DISARMED).hex()
    assert int(flown.machine.must(f"{faults.TOOL} say {MAVLINK} 127.0.0.1 14550 {frame} 5")) == 5


@pytest.mark.parametrize("who, taken", [(HAWKBIT, 0), (ODID_WEB, 0), (MAVLINK, 5)])
def test_nobody_else_speaks_to_the_ground_station_as_the_vehicle(flown, who, taken):
    """hawkBit's client, taken over, told the pilot what it liked."""
    frame = Speaker(1, 1).heartbeat(DISARMED).hex()
    assert int(flown.machine.must(f"{faults.TOOL} say {who} {HOST} {flown.attacker.port} {frame} 5")) == taken


def test_armed_opens_nothing(flown):
    assert flown.seen["armed"].startswith("armed")
    assert "no maintenance" in flown.seen["asked"] and "armed" in flown.seen["asked"]


def test_without_the_router_s_rules_it_would_be_seen(flown):
    """The same attack with the vehicle's words let through: two sources contradict each other. After all others."""
    machine, forger = flown.machine, Speaker(1, 1)
    open_rules = "/tmp/ground-station.conf.in"
    machine.must(f"sed /^Block/d /etc/mavlink-router/ground-station.conf.in >{open_rules} && "
                 f"mount --bind {open_rules} /etc/mavlink-router/ground-station.conf.in && sv term mavlink-router")
    machine.wait_inside("the router", "pidof mavlink-routerd")
    time.sleep(2)
    flown.attacker.keep_sending(4, 0.1, lambda: [forger.heartbeat(DISARMED), forger.position(flown.attacker.boot_ms() + 200)])
    status = machine.status()
    assert status["mavlink"]["contradicted"] and status["aircraft"]["armed"]
