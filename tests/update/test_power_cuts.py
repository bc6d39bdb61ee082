"""A draw of the power cuts that `make power-cuts` goes through, and all of them in `make test-long`."""

import os

import pytest

from . import LONG, figures, power_cuts

COUNT, INSTALL_S = 20, 60


def test_each_cut_leaves_an_appliance_that_broadcasts():
    """The course that they fall into is itself an update that is installed, tried and kept."""
    results = power_cuts.run(COUNT, 1, None, short=True, afresh=True)
    assert len(results) == COUNT
    assert not [one for one in results if one["wrong"]]
    install_s = power_cuts.course_figures(short=True)["install_s"]
    figures.note(install_s=install_s)
    assert install_s <= INSTALL_S


@LONG
def test_all_of_them():
    seed = int(os.environ.get("SEED") or 1)
    results = power_cuts.run(300, seed, None)
    power_cuts.note(results, seed)
    assert not [one for one in results if one["wrong"]]


@LONG
@pytest.mark.parametrize("control, count", [("one-copy", 60), ("no-flush", 24)])
def test_without_a_protection_some_fail(control, count):
    results = power_cuts.run(count, 1, control)
    assert [one for one in results if one["wrong"]]
