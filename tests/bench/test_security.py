"""docs/security.md says what each process of the appliance may do: its table, compared with the booted appliance."""

import pytest

from . import flights, rights
from .conftest import PASSWORD
from .machine import configuration

# Nobody has the other half of this key, nor answers at that address.
KEY = "ssh-ed25519 AAAAC3NzaC1lZDI1NTE5AAAAIJ1k0Zyq8r0mN8J1k0Zyq8r0mN8J1k0Zyq8r0mN8J1k0 nobody\n"
EVERYTHING = {
    "odid.conf": configuration(maintenance={"password": PASSWORD},
                               update={"hawkbit_url": "http://10.0.2.2:1", "hawkbit_id": "me"}),
    "hawkbit-token": "a-secret\n", "authorized_keys": KEY}


def settled(machine):
    """Until only that runs which lasts."""
    machine.wait_inside("the last service", "[ -S /run/swupdate/swupdateprog ] && pidof odid-update")
    machine.wait_inside("the end of the boot scripts", "! ps -o args | grep '[i]nit.d/S' | grep -qv S05bench")
    machine.wait_inside("the autopilot's port", "pidof mavlink-routerd && [ $(pidof autopilot-judge | wc -w) = 1 ]")


def problems(machine, *states):
    document = rights.DOCUMENT.read_text()
    # Where there is an initial file system, the image is the bench's own.
    image = "bench" if machine.run("[ -e /boot/initrd ]").code == 0 else "release"
    processes, common = rights.running(machine)
    found = rights.differences(rights.table(document), processes, {"always", image, *states, *(f"{state}, {image}" for state in states)})
    found += [f"everybody, writes: {path} isn't expected" for path in sorted(common)
              if not rights.covered(path, rights.everybody(document))]
    return "\n".join(found)


@pytest.fixture
def booted(make_machine):
    def boot(name, **options):
        machine = make_machine(name, **options)
        machine.power_on()
        machine.wait_on_air()
        return machine
    return boot


def play(machine, seconds=None):
    """A flight; it arms in its fourth second."""
    machine.wait_inside("the autopilot's port", "pidof mavlink-routerd")
    machine.play(flights.generate(machine.folder / "flight.tlog", 300), seconds=seconds)


def test_in_flight(booted):
    """As it comes: no maintenance, no SSH, no server."""
    machine = booted("security-flight")
    play(machine)
    machine.wait_on_air(position=True)
    settled(machine)
    assert problems(machine) == ""
    # What it says of users and capabilities would mean little if a program could give them.
    assert machine.must("find / -xdev -type f -perm +6000") == ""


def test_in_maintenance_and_armed_after_it(booted):
    machine = booted("security-maintenance", config=EVERYTHING)
    play(machine, 2)    # so that the way to the daemon is there
    machine.wait_for("its first words", lambda: machine.status()["mavlink"]["frames"] > 0)
    machine.must("odidctl maintenance on")
    machine.wait_inside("hawkBit's client", "ps -o user,args | grep -q '^odid-haw.*[s]wupdate'")
    machine.wait_inside("SSH, the page and its addresses", "pidof dropbear && pidof odid-web && pidof udhcpd")
    settled(machine)
    assert problems(machine, "SSH key", "hawkBit", "maintenance") == ""
    play(machine)
    machine.wait_inside("the end of maintenance", "! pidof odid-web && ! pidof udhcpd")
    settled(machine)
    assert problems(machine, "SSH key", "hawkBit") == ""
