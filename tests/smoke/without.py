"""`make smoke-without`: does the smoke see anything? Each of its tests is run by itself, on an appliance that lacks what
it proves; each has to fail, and not for another reason.

Run by pytest (`-p smoke.without`), this file takes it away, right before the test.
"""

import json
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import subprocess
from collections import namedtuple

import parts
import program
import pytest
from update import bundles

FOLDER = parts.ROOT / "build/smoke-without"
FAILED = 1  # pytest's exit code when tests failed; TAKEN_NOT: nothing was shown
TAKEN_NOT = 3

Missing = namedtuple("Missing", "what take_away")


def shell(command):
    return lambda machine: machine.must(command)


def replaced(path, script):
    """A program of the appliance is this script instead."""
    def take_away(machine):
        machine.put("/tmp/instead", f"#!/bin/sh\n{script}\n".encode(), "755")
        machine.must(f"mount --bind /tmp/instead {path}")
    return take_away


def never_armed(machine):
    """Whoever asks whether it is armed hears that it isn't."""
    machine.must("cp /usr/bin/odidctl /tmp/odidctl")
    replaced("/usr/bin/odidctl", '[ "$1" != armed ] || exec echo disarmed once 1; exec /tmp/odidctl "$@"')(machine)


def trusted(machine):
    """Whoever has forged the bundle is trusted."""
    machine.put("/tmp/trusted.pem", (bundles.other_keys() / "trusted.pem").read_bytes(), "644")
    machine.must("mount --bind /tmp/trusted.pem /etc/swupdate/trusted.pem && sv restart swupdate")


def from_new_slots(path):
    """What is installed lacks this, too."""
    def take_away(_):
        make = bundles.bundle
        bundles.bundle = lambda name, version, changes=None: make(
            f"{name}_without", version, (changes or {}) | {path: None})
    return take_away


def another_flight(machine):
    """The judge is told of a flight eleven metres further north, when it has heard this one."""
    record, other, judge = machine.folder / "played.jsonl", machine.folder / "other.jsonl", machine.judge

    def elsewhere(line):
        message = json.loads(line)
        return json.dumps(message | {"lat": message["lat"] + 1000} if "lat" in message else message) + "\n"

    def judge_of_another(seconds, *arguments, **words):
        part = judge(seconds, *(other if one == record else one for one in arguments), **words)
        stop = part.stop

        def tell_and_stop():
            with open(record, encoding="utf-8") as lines:
                other.write_text("".join(map(elsewhere, lines)), encoding="utf-8")
            return stop()
        part.stop = tell_and_stop
        return part
    machine.judge = judge_of_another


STOPPED = "kill -STOP $(pidof odid-keeper odid-daemon)"

WITHOUT = {
    "test_it_boots_and_all_five_messages_are_heard_on_each_channel": Missing("hostapd", shell("sv down hostapd")),
    "test_a_configuration_is_taken_over_and_a_wrong_one_refused": Missing(
        "the import of CONFIG", replaced("/usr/bin/odidctl", "exit 0")),
    "test_the_page_is_there_in_maintenance": Missing("odid-web", replaced("/usr/sbin/odid-web", "exec sleep 1000")),
    "test_a_forged_bundle_is_refused": Missing("the society's certificate: the forger's is in its place", trusted),
    "test_an_update_is_installed_tried_and_kept": Missing(
        "odid-update in the new slot, which decides", from_new_slots("usr/sbin/odid-update")),
    "test_an_update_that_fails_is_given_up": Missing(
        "odid-update in the new slot, which decides", from_new_slots("usr/sbin/odid-update")),
    "test_the_page_is_gone_when_armed": Missing("the daemon's word that it is armed", never_armed),
    "test_every_field_is_right_in_flight": Missing("the right record of what was flown", another_flight),
    "test_what_is_killed_comes_back[odid-daemon]": Missing("its keeper", shell("kill -STOP $(pidof odid-keeper)")),
    "test_what_is_killed_comes_back[hostapd]": Missing(
        "its supervisor", shell("sv down hostapd-watch; kill -STOP $(pgrep -f 'runsv /run/service/hostapd$')")),
    "test_a_foreign_disable_is_undone": Missing("the daemon, which undoes it", shell(STOPPED)),
    "test_the_autopilot_s_cable_is_pulled_and_back": Missing("mdev, which tells of devices", shell("sv down mdev")),
    "test_a_radio_is_taken_away_and_back[wifi_radio]": Missing("mdev, which tells of devices", shell("sv down mdev")),
    "test_a_radio_is_taken_away_and_back[bluetooth_controller]": Missing(
        "the daemon, which sets it up", shell(STOPPED)),
}


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_call(item):
    machine = item.funcargs.get("flying") or item.funcargs.get("machine") or item.funcargs["appliance"].machine
    try:
        machine.wait_on_air()  # what is taken away earlier is there again later
        WITHOUT[item.name].take_away(machine)
    except Exception as error:
        pytest.exit(f"{item.name}: {error}", TAKEN_NOT)


def outcome(name, number):
    """How the test failed, or None; what pytest said is in the folder."""
    report, log = FOLDER / f"{number}.xml", FOLDER / f"{number}.log"
    with open(log, "w", encoding="utf-8") as out:
        code = subprocess.run(
            [sys.executable, "-m", "pytest", "-p", "smoke.without", f"tests/smoke/test_smoke.py::{name}", "-o",
             f"cache_dir={FOLDER}/pytest", f"--junit-xml={report}"], stdout=out, stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL, cwd=parts.ROOT).returncode
    failures = xml.parse(report).getroot().findall(".//failure") if code == FAILED else []
    return failures[0].get("message").splitlines()[0] if failures else None


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    wanted = [name for name in WITHOUT if all(word in name for word in sys.argv[1:])]
    unseen = 0
    for number, name in enumerate(wanted):
        how = outcome(name, number)
        unseen += how is None
        print(f"{name}\n    without {WITHOUT[name].what}\n    {f'failed: {how[:200]}' if how else 'NOT SEEN: ' + str(FOLDER / f'{number}.log')}",
              flush=True)
    print(f"{len(wanted) - unseen} of {len(wanted)} seen")
    return 1 if unseen or not wanted else 0


if __name__ == "__main__":
    program.run("smoke-without", main)
