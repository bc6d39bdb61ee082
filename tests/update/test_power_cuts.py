"""A draw of the power cuts that `make power-cuts` goes through."""

import os

import pytest

from . import power_cuts

COUNT = 300 if os.environ.get("TEST_LONG") else 20


def test_each_cut_leaves_an_appliance_that_broadcasts():
    results = power_cuts.run(COUNT, 1, None)
    power_cuts.write_figures(results, 1)
    assert len(results) == COUNT
    assert not [one for one in results if one["wrong"]]


@pytest.mark.skipif(not os.environ.get("TEST_LONG"), reason="minutes; TEST_LONG=1, or make power-cuts CONTROL=")
@pytest.mark.parametrize("control", power_cuts.CONTROLS)
def test_without_a_protection_some_fail(control):
    results = power_cuts.run(60, 1, control)
    assert [one for one in results if one["wrong"]]
