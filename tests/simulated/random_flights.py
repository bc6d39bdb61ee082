"""`make simulate`: flights through random mixes of faults. The laws hold in each of them.

  SEEDS=<first>-<last>   which (1-20); a seed is one world and one flight
  MINUTES=<n>            how long each (10)
  HOURS=<n>              so many seeds, from the first one on, that it is as long together
  JOBS=<n>               so many at the same time (one for each processor)

A failure prints its seed, the law and the instant, what happened just before, and the command that does it again;
everything of it is kept in build/simulated/<seed>, and in its trace.txt all that was heard, said and done. It is made smaller by leaving faults out while it still fails.
"""

import functools
import gc
import hashlib
import itertools
import math
import multiprocessing
import os
import random
import re
import shutil
import sys
import tempfile
import time
from collections import namedtuple
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import parts
import program
from models import front
from models.flight import write_flight
from simulated.autopilots import KINDS, WITHOUT_RECEIVER
from simulated.faults import BY_NAME, FAULTS
from simulated.flight import WARM_UP_S, Flight
from simulated.laws import broken_laws
from simulated.world import START_US, Ended

FOLDER = parts.ROOT / "build/simulated"
LATE = ((0.0, 0), (0.0, 0), (0.1, 40_000), (0.3, 150_000))  # share of wake-ups, most
REST_S = 15.0  # after a fault, at least
AUTOPILOTS = [(kind, number) for number, kind in enumerate(KINDS)]  # each flies a way of its own
LOGS = []
KEPT = 0.25  # with odid-keeper and the others: so many of the flights
LAST_EVENTS = 8
TWO = 0.25  # so many of the faults aren't done alone
Plan = namedtuple("Plan", "mode link late kept autopilot faults")  # autopilot: (kind, way); faults: (Fault, at_s, seconds)


def plan(seed, until_s):
    """What that seed's world is, and what is done in it."""
    chance = random.Random(f"flight {seed}")
    mode, late, kept, faults = chance.choice(front.MODES), chance.choice(LATE), chance.random() < KEPT, []
    link, autopilot = chance.choice(("serial", "udp")), chance.choice(AUTOPILOTS)
    # Of a lost fix it would tell when its last native LOCATION with one is 3 s old.
    left_out = "gnss_lost" if autopilot[0] == WITHOUT_RECEIVER else None
    possible = [fault for fault in FAULTS if (kept or not fault.kept) and fault.name != left_out]
    at_s = WARM_UP_S + chance.uniform(5, 20)
    while at_s < until_s - 2 * REST_S:
        fault, seconds = chance.choice(possible), some_seconds(chance)
        faults.append((fault, at_s, seconds))
        over_s = at_s + seconds
        others = [other for other in possible if may_be_beside(fault, other)]
        if others and chance.random() < TWO:
            begin_s, seconds = at_s + chance.uniform(0, seconds), some_seconds(chance)
            faults.append((chance.choice(others), begin_s, seconds))
            over_s = max(over_s, begin_s + seconds)
        at_s = over_s + REST_S + chance.expovariate(1 / 15)
    return Plan(mode, link, late, kept, autopilot, faults)


def some_seconds(chance):
    return chance.choice((0.05, 0.5, 2.0, 6.0, 20.0)) * chance.uniform(0.8, 1.2)


def may_be_beside(one, other):
    """Done to two parts; and a daemon that begins while two speak doesn't know who was there first."""
    return one.part != other.part and not (one.told and other.restarts or other.told and one.restarts)


def planned(mode, link, late, kept, autopilot, faults):
    """As `written` says it: a flight that failed once is kept so, for what a seed means changes with each new fault."""
    return Plan(mode, link, late, kept, autopilot, [(BY_NAME[name], at_s, seconds) for name, at_s, seconds in faults])


def written(what):
    return repr(tuple(what._replace(faults=[(fault.name, round(at_s, 6), round(seconds, 6)) for fault, at_s, seconds in what.faults])))


@functools.cache
def flight_log(kind, way, seconds):
    """One of a few flights: what is done in them makes the difference."""
    if not LOGS:
        LOGS.append(tempfile.TemporaryDirectory(prefix="odid-flights-"))
    path = Path(LOGS[0].name, f"{kind}-{way}.tlog")
    write_flight(path, seconds, seed=way, **KINDS[kind])
    return path


def fly(seed, until_s, what, folder):
    """The laws that were broken, how long it took, and a hash of what was heard."""
    folder.mkdir(parents=True, exist_ok=True)
    begun, log = time.monotonic(), flight_log(*what.autopilot, until_s + 10)
    gc.disable()  # a flight makes a million objects and hardly a cycle: looking for these takes a tenth of the time
    flight = Flight(folder, log, seed, what.mode, late=what.late, kept=what.kept, link=what.link)
    try:
        for fault, at_s, seconds in what.faults:
            flight.harm(fault, at_s, seconds)
        try:
            flight.fly(until_s)
            broken = broken_laws(flight, until_s)
        except (Ended, TimeoutError) as error:  # no program of an aircraft ends by itself, nor stands still
            broken = [str(error)]
        if broken:
            (folder / "trace.txt").write_text("".join(f"{at_s:9.3f} {what}\n" for at_s, what in trace(flight)))
        return broken, time.monotonic() - begun, flight.octets()
    finally:
        flight.end()
        gc.enable()
        gc.collect()  # PyPy wouldn't come to it between two flights, and to start a program takes as long as there is memory


def trace(flight):
    """(second, what): all that was heard, said and done, in order."""
    happened = [(one.mono - START_US / 1e6, f"heard  {one.channel}  {one.payload.hex()}") for one in flight.air.run().receptions]
    happened += [(one.mono - START_US / 1e6, f"told   {'good' if one.good else one.reason}") for one in flight.autopilot.said]
    happened += [(one["at_s"] - START_US / 1e6, "status " + ("on air" if one["on_air"] else "not on air") + "".join(
        f"; {problem['reason']}" for problem in one["problems"])) for one in flight.technician.answers]
    for one in flight.windows:
        happened += [(one.begin_s, f"done   {one.fault.name} to {one.channel or 'the autopilot'}"), (one.back_s, f"over   {one.fault.name}")]
    return sorted(one for one in happened if one[0] <= flight.world.now_us / 1e6 - START_US / 1e6)  # not what was planned for later


def just_before(law, folder):
    """What was done, told and said last, of the trace, before the instant that a sentence names."""
    instant = re.search(r"(\d+\.\d+) s", law)
    lines = [line for line in (folder / "trace.txt").read_text().splitlines() if " heard " not in line and (
        not instant or float(line.split()[0]) <= float(instant[1]))]
    return "\n".join(lines[-LAST_EVENTS:])


def smaller(seed, until_s, what, folder):
    """The same without what it doesn't need to fail."""
    for one in list(what.faults):
        less = what._replace(faults=[other for other in what.faults if other is not one])
        if fly(seed, until_s, less, folder)[0]:
            what = less
    return what


def told(what):
    late = f"late at {what.late[0]:.0%} of its wake-ups by up to {what.late[1] / 1000:.0f} ms" if what.late[0] else "never late"
    return "\n".join([f"  {what.autopilot[0]}, {what.mode}, {what.link}, {late}{', with its keeper, recorder and clock' if what.kept else ''}", *(
        f"  {at_s:7.2f} s  {fault.name}{f' for {seconds:.2f} s' if fault.end else ''}" for fault, at_s, seconds in what.faults)])


def number(name, default):
    text = os.environ.get(name) or default
    if not text.replace(".", "", 1).isdigit() or not float(text):
        sys.exit(f"simulate: {name}={text}: expected a number above 0")
    return float(text)


def asked(minutes):
    seeds = os.environ.get("SEEDS") or "1-20"
    first, _, last = seeds.partition("-")
    if not (first.isdigit() and (last or first).isdigit()):
        sys.exit(f"simulate: SEEDS={seeds}: expected 1-20, or 7")
    if os.environ.get("HOURS"):
        last = int(first) + math.ceil(number("HOURS", "") * 60 / minutes) - 1
    return range(int(first), int(last or first) + 1)


def one_seed(seed, minutes):
    """That flight's seconds, number of faults and hash, and what is to be said of it: empty where all laws held."""
    until_s = minutes * 60
    what = plan(seed, until_s)
    broken, seconds, octets = fly(seed, until_s, what, FOLDER / str(seed))
    said = ""
    if not broken:
        shutil.rmtree(FOLDER / str(seed))
    else:
        less = smaller(seed, until_s, what, FOLDER / f"{seed}-smaller")
        said = (f"seed {seed}: {len(broken)} times, first: {broken[0]}\n{just_before(broken[0], FOLDER / str(seed))}\n{told(less)}\n"
                f"  again: make simulate SEEDS={seed} MINUTES={minutes:g}\n"
                f"  to be kept (test_random_flights.py): ({seed}, {written(less)})")
    return seconds, len(what.faults), octets, said


def stay(processors):
    """A flight's world and its programs take turns: on one processor these cost half as much."""
    os.sched_setaffinity(0, {processors.get()})


def main():
    minutes = number("MINUTES", "10")
    seeds, jobs = asked(minutes), int(number("JOBS", str(os.cpu_count())))
    failed, took_s, faults, heard, begun = 0, 0.0, 0, hashlib.sha256(), time.monotonic()
    for autopilot in AUTOPILOTS:
        flight_log(*autopilot, minutes * 60 + 10)  # once, and not by each process
    fork, jobs = multiprocessing.get_context("fork"), min(jobs, len(seeds))
    processors = fork.SimpleQueue()
    for _, processor in zip(range(jobs), itertools.cycle(sorted(os.sched_getaffinity(0)))):
        processors.put(processor)
    with fork.Pool(jobs, stay, (processors,)) as pool:
        for seconds, number_of_faults, octets, said in pool.imap(functools.partial(one_seed, minutes=minutes), seeds):
            heard.update(octets.encode())
            took_s, faults, failed = took_s + seconds, faults + number_of_faults, failed + bool(said)
            if said:
                print(said, flush=True)
        # Leaving ends them by SIGTERM, which program.run's handler keeps for Python to see: one that is about to wait never does.
        pool.close()
        pool.join()
    flown_s = len(seeds) * minutes * 60
    print(f"{len(seeds)} flights, {flown_s / 3600:.1f} hours, {faults} faults, in {time.monotonic() - begun:.0f} s "
          f"({flown_s / took_s:.0f} times real time on each processor): {failed} broke a law; "
          f"what was heard: {heard.hexdigest()[:16]}")
    return 1 if failed else 0


if __name__ == "__main__":
    program.run("simulate", main)
