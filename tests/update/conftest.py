"""Appliances to update. What they are made of: README.md."""

import re

import pytest

from .appliance import Appliance, readied


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
def ready(machine_possible, request):
    """An appliance of the test's own that takes a bundle."""
    with readied(Appliance(re.sub(r"\W+", "_", request.node.name))) as one:
        yield one


@pytest.fixture(scope="module")
def grounded(machine_possible):
    """An appliance that is ready for a bundle; what it is given it refuses."""
    with readied(Appliance("grounded")) as one:
        yield one
