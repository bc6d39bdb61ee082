"""A draw of the power cuts that `make power-cuts` goes through, and all of them behind LONG."""

import os

import patience
import pytest

from bench import disk as disks

from . import LONG, figures, power_cuts, writes

COUNT, INSTALL_S = 20, 60

pytestmark = pytest.mark.usefixtures("machine_possible")
SLOTS = {disks.SLOT_A, disks.SLOT_B}


def test_each_cut_leaves_an_appliance_that_broadcasts():
    """The course that they fall into is itself an update that is installed, tried and kept."""
    results = power_cuts.run(COUNT, 1, None, short=True, afresh=True)
    assert len(results) == COUNT
    assert not [one for one in results if one["wrong"]]
    install_s = power_cuts.course_figures(short=True)["install_s"]
    figures.note(install_s=install_s)
    patience.promise("an installation", install_s, INSTALL_S)


def test_a_slot_is_on_the_disk_before_it_is_marked():
    """Of what lies between two flushes a power cut may leave any part: the mark without the slot."""
    folder = power_cuts.recorded(None, short=True)
    place, begun, marks = power_cuts.places(folder / "base"), set(), 0
    for request in writes.read(folder / "log"):
        parts = {part for part in (disks.ENV, *SLOTS) if writes.touches(request, place[part])}
        assert not (begun & SLOTS and disks.ENV in parts), request
        marks += disks.ENV in parts
        begun = set() if request.flags & (writes.FLUSH | writes.FUA) else begun | parts
    assert marks >= 4   # two updates, each marked and decided


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
