"""Maintenance: outside of it nobody gets in, and what it costs the broadcast."""

import time

import patience
import pytest

from . import flights
from .conftest import GROUND, PASSWORD
from .runs import tool
from .wifi import BEACON, PROBE_RESPONSE, frames, pack, station

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


def test_a_crowd_of_invented_addresses_keeps_nobody_out(maintenance):
    """Four authentication frames filled the access point for five minutes. These are 200 a minute."""
    maintenance.must("odidctl maintenance on")
    wait_maintenance(maintenance, "on")
    maintenance.put("/tmp/crowd", tool("crowd"))
    bssid = maintenance.must("cat /sys/class/net/wlan0/address").strip()
    stations = "umask 0; hostapd_cli -p /run/hostapd -i wlan0 all_sta | grep -c '^02:00:00:00:'; true"
    maintenance.must(f"/tmp/crowd wlan1 {bssid} 20 10")     # at once
    assert int(maintenance.must(stations)) > 4, "it isn't heard"
    maintenance.shell.send(f"/tmp/crowd wlan1 {bssid} 120 300 >/tmp/crowd.log 2>&1 &")
    maintenance.wait_for("its connection", lambda: CONNECTED in station(maintenance, PASSWORD))
    maintenance.wait_inside("the crowd's end", "! pidof crowd")
    maintenance.wait_inside("the end of its associations", f"[ $({stations}) = 0 ]")


def test_the_password_is_not_kept(grounded):
    found = grounded.must(f"find /data /run /var -type f -exec grep -sl {PASSWORD} '{{}}' + ; true")
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
