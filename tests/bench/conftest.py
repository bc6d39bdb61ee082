"""Booted appliances for tests, never more of them than one file of tests needs: a machine that runs beside
another one shows in its figures. What they are made of: README.md."""

import time

import parts
import pytest

from . import flights, runs
from .machine import Machine, configuration

PASSWORD = "a-test-password"
GROUND = configuration(maintenance={"password": PASSWORD})


def started(folder, kind=Machine, **options):
    machine = kind(parts.ROOT / "build/system" / folder, **options)
    try:
        machine.power_on()
        machine.wait_on_air()
    except BaseException:
        machine.close()
        raise
    return machine


@pytest.fixture(scope="module")
def flying(machine_possible):
    """An appliance in a moving flight, all channels on the air, nothing wrong."""
    machine = started("flying")
    machine.play(flights.generate(machine.folder / "flight.tlog", 600))
    machine.wait_on_air(position=True)
    time.sleep(runs.SETTLE_S)
    yield machine
    machine.close()


@pytest.fixture(scope="module")
def grounded(machine_possible):
    """An appliance whose autopilot was never heard: it counts as disarmed. Its maintenance has a password."""
    machine = started("grounded", config={"odid.conf": GROUND})
    yield machine
    machine.close()


@pytest.fixture
def make_machine(machine_possible):
    """Machines of a test's own, switched off; they end with the test."""
    made = []

    def make(name, **options):
        made.append(Machine(parts.ROOT / "build/system" / name, **options))
        return made[-1]

    yield make
    for machine in made:
        machine.close()
