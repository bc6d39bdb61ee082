"""`make laws`: does each law of the simulated flights see anything? For each a fault is put into the daemon, or into one of the
programs beside it, and flown: that law has to be broken, and by the sources as they are none.

  ONLY=<text>   those with that in their name
"""

import json
import os
import subprocess
import sys
import tempfile
from collections import namedtuple
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import program
from models.flight import write_flight
from mutants.named import NAMED, Mutant
from mutants.run import FOLDER, put_in
from mutants.trial import Workshop
from simulated.faults import BY_NAME
from simulated.flight import Flight
from simulated.laws import judged_by_law

FLIGHT_S = 90
# harm: what is done meanwhile, (fault, at_s, seconds)
Case = namedtuple("Case", "law mutant harm")


def named(name):
    return next(one for one in NAMED if one.name == name)


CASES = (
    Case("as the judge has it", named("a counter stands still"), ()),
    Case("failure", named("status 4 is forgotten"), (("autopilot_silent", 30, 10),)),
    Case("newer position", named("a controller is closed and never opened again"), (("controller_unplugged", 30, 2),)),
    Case("other messages", named("the operator's number never has its turn"), ()),
    Case("good", Mutant("a channel that is off the air is no fault", "health.c",
                        "} else if (health_required(input, channel) && state != RADIO_ON_AIR) {", "} else if (false) {"),
         (("controller_hangs", 30, 20),)),
    Case("status", named("a channel that was lost counts as on the air"), (("controller_hangs", 30, 20),)),
    Case("bad", Mutant("it stands still at once", "radio.h", "#define RADIO_STALE_US 2500000", "#define RADIO_STALE_US 60000"), ()),
    Case("status", Mutant("another place in the status", "status_json.c",
                          'add_number(object, "latitude_deg", location->latitude_deg,',
                          'add_number(object, "latitude_deg", location->longitude_deg,'), ()),
    Case("told", Mutant("the pilot is told every three seconds", "odid_daemon_main.c", "#define TELL_US 1000000",
                        "#define TELL_US 3000000"), ()),
    Case("two sources", Mutant("two sources are no fault", "health.c", "    if (input->contradicted) {", "    if (false) {"),
         (("forged_autopilot", 15, 0),)),
    Case("costs", named("a descriptor leaks at each reconnect to the autopilot"),
         tuple(("autopilot_unplugged", at_s, 1) for at_s in (20, 35, 50, 65))),
    Case("gaps recorded", Mutant("a gap is no event", "recorder.c",
                                 "} else if (status->unbroken_us > totals->heard_us + ROUNDING_US) {", "} else if (false) {"),
         (("controller_hangs", 30, 10),)),
    Case("recorded gaps", Mutant("each pause is a gap", "radio.h", "#define RADIO_PAUSE_US 1500000", "#define RADIO_PAUSE_US 60000"), ()),
    Case("clock", Mutant("a clock that is off stays so", "clock_set.c", "> OFF_US", "> INT64_MAX - 1"), (("clock_set", 30, 0),)),
)


def fly(harm):
    """Prints the laws that were broken, as JSON. With DAEMON, and so beside it the others, from a workshop."""
    with tempfile.TemporaryDirectory(prefix="odid-laws-") as folder:
        log = Path(folder, "flight.tlog")
        write_flight(log, FLIGHT_S + 10)
        flight = Flight(Path(folder, "flight"), log, seed=3, kept=True)
        try:
            for name, at_s, seconds in harm:
                flight.harm(BY_NAME[name], at_s, seconds)
            flight.fly(FLIGHT_S)
            print(json.dumps({law: found[:1] for law, found in judged_by_law(flight, FLIGHT_S).items() if found}))
        finally:
            flight.end()


def flown(daemon, harm):
    said = subprocess.run([sys.executable, __file__, "fly", json.dumps(harm)], env={**os.environ, "DAEMON": str(daemon)},
                          stdout=subprocess.PIPE, text=True, check=True).stdout
    return json.loads(said.splitlines()[-1])


def main():
    if sys.argv[1:2] == ["fly"]:
        fly(json.loads(sys.argv[2]))
        return 0
    FOLDER.mkdir(parents=True, exist_ok=True)
    workshop, unseen = Workshop(FOLDER / "laws", unit=False), []
    cases = [case for case in CASES if (os.environ.get("ONLY") or "") in case.law]
    for case in cases:
        untouched = flown(workshop.shipped / "odid-daemon", case.harm)
        with workshop.changed(case.mutant.file, put_in(case.mutant)):
            broken = flown(workshop.shipped / "odid-daemon", case.harm)
        seen = case.law in broken and not untouched
        unseen += [] if seen else [case.law]
        print(f"{case.law:20} {case.mutant.name}: {broken.get(case.law, ['NOT SEEN'])[0]}", flush=True)
        if untouched:
            print(f"{'':20} WITHOUT IT: {untouched}", flush=True)
    print(f"{len(cases) - len(unseen)} of {len(cases)} laws seen to fail")
    return 1 if unseen or not cases else 0


if __name__ == "__main__":
    program.run("laws", main)
