"""The fixed list of faults (faults.py): each is injected into a flight, and the longest content gap that a
receiver heard is held against its limit. build/faults has the table and the figures."""


import pytest

from . import faults, runs


@pytest.fixture(scope="session")
def outcomes(request, machine_possible):
    """All that were asked for, run once; the figures are written when it is all of them."""
    wanted = {item.callspec.params["name"] for item in request.session.items
              if "outcomes" in getattr(item, "fixturenames", ()) and hasattr(item, "callspec")}
    found = runs.outcomes_of([one for one in faults.IN_FLIGHT + faults.BOOTS if one.name in wanted])
    text = runs.table(found, None if wanted == set(faults.NAMES) else wanted)
    print(f"\n{text}")
    if wanted == set(faults.NAMES):
        (runs.FOLDER / "table.txt").write_text(text)
        runs.write_figures(found)
    return found


@pytest.mark.parametrize("name", faults.NAMES)
def test_fault(outcomes, name):
    one = outcomes[name]
    assert not one.problems
    if one.verdict == "not judged":
        pytest.skip(f"not judged: {one.disturbed}; {'; '.join(one.beyond)}")
    assert one.verdict == "PASS", "; ".join(one.beyond) or "no figure"


def test_the_list_is_whole():
    """Each row of the issue's table that is a gap; the power cuts are test_power_cut.py's."""
    assert len(set(faults.NAMES)) == len(faults.NAMES) == 29
