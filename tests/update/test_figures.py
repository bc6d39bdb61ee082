"""figures.json: of one commit, with a verdict when all that has a limit was measured."""

import pytest

from . import figures

ALL = {"install_s": 5, "trial_gap_s": 0.5, "no_kernel_failed_to_air_s": 20, "power_cuts_failed": 0}


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.setattr(figures, "PATH", tmp_path / "figures.json")
    monkeypatch.setattr(figures, "head", lambda: "1111111")


def test_a_verdict_needs_every_figure_that_has_a_limit(file):
    for name, value in ALL.items():
        assert "verdict" not in figures.read()
        figures.note(**{name: value})
    assert figures.read()["verdict"] == "PASS"
    figures.note(trial_gap_s=0.7)
    assert (figures.read()["verdict"], figures.read()["violations"]) == ("FAIL", 1)


def test_figures_of_another_commit_do_not_stay(file, monkeypatch):
    figures.note(**ALL)
    monkeypatch.setattr(figures, "head", lambda: "2222222")
    figures.note(install_s=6)
    assert figures.read() == {"install_s": 6, "commit": "2222222", "date": figures.read()["date"], "violations": 0}
