"""Appliances to update. What they are made of: README.md."""

import os
import re

import pytest
from bench.machine import missing

from .appliance import Appliance


def pytest_configure(config):
    config.addinivalue_line("markers", "long: takes minutes: make update, make test-long")


def pytest_collection_modifyitems(config, items):
    """Those are left out, rather than skipped: what `make test` skips is what this machine can't do."""
    if os.environ.get("TEST_LONG"):
        return
    left_out = [item for item in items if item.get_closest_marker("long")]
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=left_out)


@pytest.fixture(scope="session", autouse=True)
def machine_possible():
    reason = missing()
    if reason:
        pytest.skip(reason)


@pytest.fixture
def make_appliance():
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
def grounded():
    """An appliance that is ready for a bundle; what it is given it refuses."""
    one = Appliance("grounded")
    try:
        one.power_on()
        one.wait_ready()
        yield one
    finally:
        one.close()
