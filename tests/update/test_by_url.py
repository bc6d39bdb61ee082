"""odidctl update URL: what it shows meanwhile, and whose servers it believes."""

import re

from . import LONG, bundles, certificate
from .bundles import NEWER
from .server import GUEST_SEES, Server

pytestmark = LONG

SHOWN = re.compile(r"^ *(\d+) %(?:, (\d+) s left)?$", re.M)
TAKES_S = 25


def test_percent_and_seconds_left(ready):
    """Both are true: at an even pace the time that is left goes with the percentage."""
    bundle = bundles.bundle("good", NEWER)
    got = ready.install(bundle, rate=bundle.stat().st_size // TAKES_S)
    assert got.code == 0, got.output
    shown = [(int(percent), left and int(left)) for percent, left in SHOWN.findall(got.output)]
    percents = [percent for percent, _ in shown]
    assert percents == sorted(percents) and percents[0] <= 10 and percents[-1] >= 95 and len(percents) >= 10, shown
    told = [(percent, left) for percent, left in shown if left is not None and percent >= 20]
    assert len(told) >= 8, shown
    for percent, left in told:
        assert abs(left - TAKES_S * (100 - percent) / 100) <= 6, shown
    assert f"Version {NEWER} is written" in got.output


def test_a_server_has_to_be_who_it_says(ready, tmp_path):
    """Its certificate is held against the authorities that the image has; a test's own takes their place."""
    files = certificate.make(tmp_path, GUEST_SEES)
    server, bundle = Server(bundles.BUILD, tls=files), bundles.bundle("good", NEWER)
    try:
        before = ready.sectors_written(), ready.starts()
        got = ready.machine.run(f"odidctl update {server.url(bundle)}")
        assert got.code == 1 and "certificate" in got.output, got.output
        assert (ready.sectors_written(), ready.starts()) == before and ready.protected()
        ready.machine.put("/tmp/authority.pem", files[0].read_bytes(), "644")
        got = ready.machine.run(f"CURL_CA_BUNDLE=/tmp/authority.pem odidctl update {server.url(bundle)}")
        assert got.code == 0, got.output
        ready.wait_restart(before[1])
        assert ready.slot() == "b"
    finally:
        server.stop()
