"""The bench as a fixture. What it is made of: ../models/README.md."""

import parts
import pytest


@pytest.fixture
def bench(short_folder):
    """Starts benches: `one = bench(settings={"self_id": {...}}, mode="bcm43455", flight=path)`.

    Each is a parts.Bench, the daemon started and what `channels` names on the air; its `air` has listened from the
    beginning. All that was started ends with the test.
    """
    started = []

    def start(settings=None, mode="full", flight=None, hostapd=True, channels=None, flags=()):
        one = parts.Bench(short_folder / str(len(started)), mode=mode, settings=settings, hostapd=hostapd)
        started.append(one)
        assert one.air  # it listens once it is asked for
        if channels is None:
            channels = ["bt4"] + ["bt5"] * (mode == "full") + ["wifi"] * hostapd
        one.start_daemon(*flags)
        one.wait_on_air(channels)
        if flight is not None:
            one.play(flight)
        return one

    yield start
    for one in started:
        print(f"--- the daemon's log, {one.folder.name} ---\n{one.daemon.log() if one.daemon else ''}")
        one.stop()
