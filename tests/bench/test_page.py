"""The technician's page in the appliance: there in maintenance, gone when the aircraft is armed."""

import os
import subprocess
import threading
import time
from pathlib import Path

import pytest

from . import flights
from .conftest import GROUND, PASSWORD
from .page import Page, listening, send

NUMBER = "FIN87astrdge12k8"
CLOSED_WITHIN_S = 5         # of arming: it is looked for every other second


def is_on(machine):
    return machine.must("cat /run/odid-appliance/maintenance; true").strip() == "on"


@pytest.fixture
def page(make_machine):
    machine = make_machine("page", config={"odid.conf": GROUND})
    machine.power_on()
    machine.wait_on_air()
    page = Page(machine)
    page.machine = machine
    assert listening(machine) == set() and page.ask("GET", "/", timeout_s=3)[0] is None  # nothing comes
    machine.must("odidctl maintenance on")
    machine.wait_for("the page", lambda: listening(machine) == {80})
    return page


def test_no_program_of_the_board_takes_the_technician_s_tries(page):
    """One that was taken over kept the page shut, by Wi-Fi and by cable, with a few wrong passwords a second."""
    for address in ("127.0.0.1", "192.168.41.1"):
        for who, comes in (("mavlink", False), ("nobody", False), ("root", True)):
            said = page.machine.run(f"chpst -u {who} wget -T 2 -O /dev/null http://{address}/ 2>&1").output
            assert ("timed out" in said) != comes, (address, who, said)


def test_the_page_is_there_in_maintenance_and_gone_when_armed(page):
    machine = page.machine
    assert page.ask("GET", "/")[0] == 200
    assert page.ask("GET", "/api/status")[0] == 401
    assert page.ask("POST", "/api/session", {"password": "another-password"})[0] == 403
    assert page.ask("POST", "/api/session", {"password": PASSWORD}) == (200, {})

    code, status = page.ask("GET", "/api/status")
    assert code == 200 and status["daemon"]["on_air"] and status["slot"] in ("a", "b")
    assert status["daemon"]["channels"]["bt4"]["state"] == "on air"

    who = machine.must("for p in $(pidof odid-web); do grep -E '^(Uid|CapEff)' /proc/$p/status; done")
    assert "Uid:\t991" in who and "CapEff:\t0000000000000000" in who

    code, said = page.ask("POST", "/api/settings", {"operator": f"{NUMBER}-xyz"})
    assert code == 200 and said["operator"]["done"], said
    assert machine.must("odidctl get operator.operator_id").strip() == NUMBER
    machine.wait_on_air()
    assert machine.run("grep -r 'xyz' /data/odid /run/odid-appliance").code != 0

    assert page.ask("GET", "/api/flights")[0] == 200

    idle = page.connect()
    assert page.ask("GET", "/api/status", connection=idle)[0] == 200
    machine.play(flights.generate(machine.folder / "flight.tlog", 60))  # arms in its fourth second
    machine.wait_for("arming", lambda: (machine.status() or {}).get("aircraft", {}).get("armed"))
    machine.wait_for("the port to close", lambda: listening(machine) == set(), CLOSED_WITHIN_S)
    assert page.ask("GET", "/api/status", connection=idle)[0] is None      # the open connection, too
    assert page.ask("GET", "/", timeout_s=3)[0] is None  # nothing comes
    assert machine.must("nft list set inet odid maintenance").count("elements") == 0
    assert machine.run("odidctl maintenance on").code != 0 or (time.sleep(4) or listening(machine)) == set()


SLOT, KEYS = Path("build/appliance/slot.img"), Path("build/keys")
NEW_VERSION = "99.1.0"


@pytest.fixture
def bundle(tmp_path):
    """The machine's own slot as an update."""
    if os.environ.get("IMAGE") or not SLOT.exists() or not (KEYS / "signing.key").exists():
        pytest.skip("needs the bench's own disk and its keys (make appliance)")
    path = tmp_path / "new.swu"
    subprocess.run(["board/common/make-bundle.sh", SLOT, "qemu", NEW_VERSION, KEYS, path], check=True)
    return path.read_bytes()


def test_bundles_by_the_page(page, bundle):
    """Refused, cut short, installed: with SWUpdate itself at the other end."""
    machine = page.machine
    page.ask("POST", "/api/session", {"password": PASSWORD})
    machine.wait_for("SWUpdate, and what watches it", lambda: machine.run(
        "[ -S /run/swupdate/swupdateprog ] && [ -e /run/odid-appliance/update-state.json ] && usleep 1500000").code == 0)

    def status():
        return page.ask("GET", "/api/status")[1]

    def result(before):
        machine.wait_for("a result", lambda: status()["last_update_mark"] != before)
        return status()["last_update"]

    before = status()["last_update_mark"]
    code, said = send(page, bundle.replace(NEW_VERSION.encode(), b"98.1.0", 1))
    assert code in (202, 502), said
    refused = result(before)
    assert refused["outcome"] == "refused" and "damaged" in refused["sentence"], refused

    before = status()["last_update_mark"]
    code, said = send(page, bundle[:len(bundle) // 2])      # in order, but half of it
    refused = result(before)
    assert refused["outcome"] == "refused", refused

    machine.wait_for("SWUpdate to be ready", lambda: status()["update"]["state"] == "idle")
    code, said = send(page, bundle)
    assert code == 202, said
    seen = set()

    def waits():
        seen.add(status()["update"]["state"])
        return "waiting-for-reboot" in seen
    machine.wait_for("the end of the install", waits)
    assert machine.status()["on_air"]


def test_what_the_page_costs(page):
    """Its memory, and that its service comes back when its half that speaks HTTP is killed."""
    machine = page.machine
    kib = sum(int(line.split()[1]) for line in machine.must(
        "for p in $(pidof odid-web); do grep RssAnon /proc/$p/status; done").splitlines())
    assert kib < 2048
    # Under load the page answers, and the broadcast goes on: more than a phone ever asks.
    page.ask("POST", "/api/session", {"password": PASSWORD})
    codes = []
    askers = [threading.Thread(target=lambda: codes.extend(page.ask("GET", "/api/status")[0] for _ in range(10)))
              for _ in range(4)]
    for asker in askers:
        asker.start()
    for asker in askers:
        asker.join()
    assert set(codes) == {200} and len(codes) == 40
    assert machine.status()["on_air"]
    serving = machine.must("pidof odid-web").split()
    machine.must(f"kill -9 {max(serving, key=int)}")
    machine.wait_for("the page again", lambda: page.ask("GET", "/")[0] == 200, 10)
