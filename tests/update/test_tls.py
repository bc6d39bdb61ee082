"""TLS to a hawkBit server, with a clock that no battery keeps."""

import os
import time

import pytest
from bench.machine import configuration

from . import LONG, autopilot, certificate, figures
from .appliance import wait_for
from .hawkbit import HawkBit, poll_octets
from .server import GUEST_SEES

pytestmark = LONG
NAME = "SSRS5GBG01"
LONG_ENOUGH_S = 45      # SWUpdate tries a server again after 10 s, then at the interval that it was told


@pytest.fixture
def server(tmp_path):
    one = HawkBit(NAME, tls=certificate.make(tmp_path, GUEST_SEES))
    yield one
    one.stop()


def appliance(make_appliance, name, server, authority, rtc):
    one = make_appliance(name, config={
        "odid.conf": configuration(update={"hawkbit_url": server.url}), "hawkbit-token": server.token + "\n",
        "hawkbit-ca.pem": authority.read_bytes()})
    one.power_on(rtc=rtc)
    one.wait_ready()
    return one


def year(one):
    return int(one.machine.must("date -u +%Y"))


def test_after_a_power_on_without_any_time(make_appliance, server, tmp_path):
    """The clock starts when the image was built, and the certificate is valid then."""
    one = appliance(make_appliance, "tls_1970", server, tmp_path / "server.crt", "1970-01-01T00:00:00")
    assert year(one) > 2024
    wait_for("a poll", lambda: server.polls > 1)
    kept = poll_octets(one.machine, server)
    server.closes = True        # as one does that is asked after minutes
    wait_for("a poll", lambda: server.polls > 1)
    figures.note(hawkbit_poll_tls_line_octets=kept, hawkbit_poll_tls_anew_line_octets=poll_octets(one.machine, server))


@pytest.mark.skipif(not os.environ.get("IMAGE"), reason="the bench's SWUpdate, Debian's 2022.12, waits by the wall clock: "
                    "set back, it sleeps until 2038. The release's doesn't: IMAGE=build/image/qemu/images/disk.img")
def test_a_clock_that_is_wrong_until_the_autopilot_sets_it_back(make_appliance, server, tmp_path):
    one = appliance(make_appliance, "tls_2038", server, tmp_path / "server.crt", None)
    # It starts at the time that was saved last.
    one.machine.must("date -u -s '2038-01-19 03:14:20' && sv term odid-clock && sleep 1 && sync")
    one.machine.cut_power()
    server.polls = 0
    one.power_on()
    one.wait_ready()
    time.sleep(LONG_ENOUGH_S)
    assert year(one) == 2038
    assert server.polls == 0        # the certificate has expired by then
    # A time from before the image was built would not be believed.
    one.machine.play(autopilot.generate(tmp_path, armed=False, unix_s=time.time()))
    wait_for("the autopilot's time", lambda: year(one) < 2037)
    wait_for("a poll", lambda: server.polls > 1)


def test_another_authority_is_not_believed(make_appliance, server, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    authority = certificate.make(other, GUEST_SEES)[0]
    appliance(make_appliance, "tls_other", server, authority, None)
    time.sleep(LONG_ENOUGH_S)
    assert server.polls == 0
