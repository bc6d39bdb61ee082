"""Appliances to update. What they are made of: README.md."""

import re

import pytest

from .appliance import Appliance


@pytest.fixture
def make_appliance(machine_possible):
    """Appliances of a test's own, switched off; they end with the test."""
    made = []

    def make(name, **options):
        made.append(Appliance(name, **options))
        return made[-1]

    yield make
    for one in made:
        one.close()


@pytest.fixture
def ready(make_appliance, request):
    """An appliance of the test's own that takes a bundle."""
    one = make_appliance(re.sub(r"\W+", "_", request.node.name))
    one.power_on()
    one.wait_ready()
    return one


@pytest.fixture(scope="module")
def grounded(machine_possible):
    """An appliance that is ready for a bundle; what it is given it refuses."""
    one = Appliance("grounded")
    try:
        one.power_on()
        one.wait_ready()
        yield one
    finally:
        one.close()
