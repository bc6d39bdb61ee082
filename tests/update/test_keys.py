"""Two trusted keys during a rotation, and neither of them after it; at any time a clock may show."""

import pytest

from . import LONG, bundles
from .bundles import NEWER
from .installs import accepted


pytestmark = LONG

# The one before leaves its socket behind.
RESTART = ("sv down swupdate; rm -f /run/swupdate/sock*; sv up swupdate; "
           "until [ -S /run/swupdate/sockinstctrl ]; do usleep 10000; done")


def trust(appliance, *certificates):
    appliance.machine.put("/tmp/trusted.pem", b"".join(path.read_bytes() for path in certificates), "644")
    appliance.machine.must(f"mount --bind /tmp/trusted.pem /etc/swupdate/trusted.pem; {RESTART}")
    appliance.wait_ready()


def trust_as_built(appliance):
    appliance.machine.must(f"umount /etc/swupdate/trusted.pem; {RESTART}")
    appliance.wait_ready()


def test_rotation(grounded):
    old, new = bundles.KEYS, bundles.other_keys()
    signed_by_old, signed_by_new = bundles.bundle("good", NEWER), bundles.bundle("another", NEWER, keys=new)
    trust(grounded, old / "signing.crt", new / "signing.crt")
    try:
        assert accepted(grounded, signed_by_old)
        assert accepted(grounded, signed_by_new)
    finally:
        trust_as_built(grounded)
    trust(grounded, new / "signing.crt")
    try:
        assert accepted(grounded, signed_by_new)
        got = grounded.install(signed_by_old)
        assert got.code == 1, got.output
        assert "signed" in grounded.result()["sentence"]
    finally:
        trust_as_built(grounded)


@pytest.mark.parametrize("date", ["1970-01-01 00:00:30", "2038-01-19 03:14:20", "2001-09-09 01:46:40"])
def test_signatures_need_no_clock(grounded, date):
    machine = grounded.machine
    machine.must(f"date -s '{date}'")
    assert accepted(grounded, bundles.bundle("good", NEWER))
    got = grounded.install(bundles.bundle("another", NEWER, keys=bundles.other_keys()))
    assert got.code == 1, got.output
