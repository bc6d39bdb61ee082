"""Two trusted keys during a rotation, and neither of them after it; at any time a clock may show."""

import pytest

from . import LONG, bundles
from .bundles import NEWER
from .test_refused import accepted


pytestmark = LONG

def trust(machine, *certificates):
    machine.put("/tmp/trusted.pem", b"".join(path.read_bytes() for path in certificates), "644")
    machine.must("mount --bind /tmp/trusted.pem /etc/swupdate/trusted.pem && sv term swupdate; sleep 2")


def trust_as_built(machine):
    machine.must("umount /etc/swupdate/trusted.pem; sv term swupdate; sleep 2")


def test_rotation(grounded):
    machine, old, new = grounded.machine, bundles.KEYS, bundles.other_keys()
    signed_by_old, signed_by_new = bundles.bundle("good", NEWER), bundles.bundle("another", NEWER, keys=new)
    trust(machine, old / "signing.crt", new / "signing.crt")
    try:
        assert accepted(grounded, signed_by_old)
        assert accepted(grounded, signed_by_new)
    finally:
        trust_as_built(machine)
    trust(machine, new / "signing.crt")
    try:
        assert accepted(grounded, signed_by_new)
        got = grounded.install(signed_by_old)
        assert got.code == 1, got.output
        assert "signed" in grounded.result()["sentence"]
    finally:
        trust_as_built(machine)


@pytest.mark.parametrize("date", ["1970-01-01 00:00:30", "2038-01-19 03:14:20", "2001-09-09 01:46:40"])
def test_signatures_need_no_clock(grounded, date):
    machine = grounded.machine
    machine.must(f"date -s '{date}'")
    assert accepted(grounded, bundles.bundle("good", NEWER))
    got = grounded.install(bundles.bundle("another", NEWER, keys=bundles.other_keys()))
    assert got.code == 1, got.output
