"""odidctl's command line: what it doesn't understand it names, and does nothing."""

import subprocess

import parts
import pytest

USAGE = 2


@pytest.mark.parametrize("words, said", [
    ([], "say what to do"),
    (["stats"], "no such command"),
    (["status", "now"], "status takes no words"),
    (["set", "self_id.description", "two", "words"], "quote a value with blanks"),
    (["maintenance", "of"], 'maintenance needs "on" or "off"'),
    (["check", "--json", "/dev/null"], "only status and flights have --json"),
])
def test_wrong_words(words, said):
    got = subprocess.run([parts.CONTROL, *words], capture_output=True, text=True, check=False)
    assert got.returncode == USAGE and got.stdout == ""
    assert got.stderr.splitlines()[0].endswith(said)
