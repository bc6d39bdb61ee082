"""Maintenance: outside of it nobody gets in, and what it costs the broadcast."""

import time

import patience
import pytest

from . import flights
from .conftest import GROUND, PASSWORD
from .test_air import BEACON, PROBE_RESPONSE, frames, pack, station

CONNECTED = "CTRL-EVENT-CONNECTED"
BEACON_S = 0.1024


def longest_silence_s(machine, since):
    times = [at for at, row in frames(machine.pcap, BEACON, since) if pack(row)]
    return max(later - earlier for earlier, later in zip(times, times[1:]))


def wait_maintenance(machine, state):
    machine.wait_inside(f"maintenance {state}", f"[ \"$(cat /run/odid-appliance/maintenance)\" = {state} ]")


@pytest.fixture
def maintenance(grounded):
    yield grounded
    grounded.run("odidctl maintenance off")
    wait_maintenance(grounded, "off")


def test_nobody_gets_in_outside_maintenance(grounded):
    since = time.time()
    assert CONNECTED not in station(grounded, PASSWORD)
    assert CONNECTED not in station(grounded, "another-password", 6)
    assert list(frames(grounded.pcap, PROBE_RESPONSE, since)), "the station was not even heard"


def test_the_technician_gets_in_in_maintenance_and_out_after_it(maintenance):
    since = time.time()
    maintenance.must("odidctl maintenance on")
    wait_maintenance(maintenance, "on")
    maintenance.wait_for("its connection", lambda: CONNECTED in station(maintenance, PASSWORD))
    assert CONNECTED not in station(maintenance, "another-password", 6)
    maintenance.must("odidctl maintenance off")
    wait_maintenance(maintenance, "off")
    assert CONNECTED not in station(maintenance, PASSWORD)
    # At most two beacons lost, at its beginning and at its end.
    patience.promise("Wi-Fi's silence", longest_silence_s(maintenance, since), 3 * BEACON_S + 0.05)


def test_the_password_is_not_kept(grounded):
    found = grounded.must(f"find /data /run /var -type f -exec grep -l {PASSWORD} '{{}}' + ; true")
    assert found == ""
    grounded.must("mkdir -p /tmp/config && mount -o ro /dev/disk/odid/config /tmp/config")
    try:
        assert PASSWORD not in grounded.must("cat /tmp/config/*")
    finally:
        grounded.must("umount /tmp/config")


def test_arming_ends_it(make_machine):
    machine = make_machine("arming", config={"odid.conf": GROUND})
    machine.power_on()
    machine.wait_on_air()
    machine.must("odidctl maintenance on")
    wait_maintenance(machine, "on")
    machine.play(flights.generate(machine.folder / "flight.tlog", 60))  # arms in its fourth second
    machine.wait_on_air(position=True)
    wait_maintenance(machine, "off")
    assert machine.run("odidctl maintenance on").code != 0 or \
        machine.must("sleep 4; cat /run/odid-appliance/maintenance").strip() == "off"
