"""What `make mutants` puts into the daemon can still be put in."""

import os
import subprocess

import parts
from mutants.laws import CASES
from mutants.named import NAMED
from mutants.places import places
from mutants.run import Kept, put_in
from mutants.survivors import SURVIVORS
from mutants.trial import SOURCE, named


def test_each_named_one_changes_its_file():
    assert len({one.name for one in NAMED}) == len(NAMED) >= 25
    for mutant in (*NAMED, *(case.mutant for case in CASES)):
        assert put_in(mutant) != named(SOURCE, mutant.file).read_text()


def test_a_verdict_holds_for_the_sources_that_it_was_found_of(tmp_path):
    path, change = tmp_path / "seen.jsonl", ("some.c", 1, 2, "<", "<=")
    kept = Kept(path, "these")
    kept.add(change, "caught", "test_some")
    kept.add(("some.c", 3, 4, "1", "2"), "survived", "")
    assert Kept(path, "these").found == {change: ("caught", "test_some")} and Kept(path, "others").found == {}


def test_make_hands_on_which_daemon_is_tried():
    """A test that calls `make simulate` flew another one, or none."""
    said = subprocess.run(["make", "--silent", "--eval", "told:\n\t@echo $$DAEMON", "told"], cwd=parts.ROOT, check=True,
                          env={**os.environ, "DAEMON": "/some/daemon"}, stdout=subprocess.PIPE, text=True)
    assert said.stdout == "/some/daemon\n"


def test_each_survivor_is_still_there():
    for one in SURVIVORS:
        lines = [line.strip() for line in named(SOURCE, one.file).read_text().splitlines()]
        assert one.line in lines and one.before in one.line, one


def test_what_can_be_changed_is_found(tmp_path):
    source = tmp_path / "some.c"
    source.write_text("""
#define WAIT_US 250 /* 9 */
static int some(int a)
{
    log_warning("1 %d", a + 1); /* a == 2 */
    if (a < 3 && !other(a)) {
        call(a);
    }
    return a - 0x10;
}
""")
    found = {(place.line, place.before, place.after) for place in places(source, "some.c")}
    assert found == {
        (2, "250", "251"), (2, "250", "249"),
        (6, "<", "<="), (6, "<", ">="), (6, "3", "4"), (6, "3", "2"), (6, "&&", "||"), (6, "!other(a)", "other(a)"),
        (6, "(a < 3 && !other(a))", "(!((a < 3 && !other(a))))"),
        (7, "call(a);", ";"), (9, "-", "+"), (9, "0x10", "0x11")}
