"""SWUpdate's own hawkBit client against a model of the server."""

import os
import time

import pytest
from bench.machine import configuration

from . import LONG, autopilot, bundles, figures
from .appliance import wait_for
from .bundles import NEWER, NO_BLUETOOTH
from .hawkbit import OFFERED_POLL_S, HawkBit, poll_octets

pytestmark = LONG

NAME = "SSRS5GBG01"     # nothing else is configured: the aircraft's serial number


@pytest.fixture
def server():
    one = HawkBit(NAME)
    yield one
    one.stop()


@pytest.fixture
def ready(make_appliance, request, server):
    one = make_appliance(request.node.name, config={
        "odid.conf": configuration(update={"hawkbit_url": server.url}), "hawkbit-token": server.token + "\n"})
    one.power_on()
    one.wait_ready()
    return one


def assert_left_alone(ready, server, installer):
    """SWUpdate is another process than that one by then, and asks no server."""
    wait_for("another SWUpdate", lambda: ready.machine.must("cat /run/pid/swupdate") != installer)
    ready.wait_ready()
    polls = server.polls
    time.sleep(4 * server.poll_s)
    assert server.polls == polls


def test_an_update_is_fetched_installed_and_reported(ready, server):
    wait_for("a poll", lambda: server.polls > 1)
    assert server.attributes["version"] == bundles.running_version()
    assert server.attributes["hardware"] == "odid-qemu"
    assert not server.refused
    # Its token is nobody else's business.
    assert server.token not in ready.machine.must("ps; odidctl status --json; dmesg; odidctl get update.hawkbit_url")
    assert ready.machine.must("ps -o user,args | grep '[s]wupdate' | cut -d' ' -f1 | sort -u").split() == \
        ["odid-haw", "root"]        # eight letters are all that ps has room for
    before = ready.starts()
    server.offer(17, bundles.bundle("good", NEWER), NEWER)
    ready.wait_restart(before)
    ready.machine.wait_on_air()
    assert server.outcome(17) is None       # not before the trial is over
    ready.wait_state("trial")
    ready.wait_state("idle")
    wait_for("the report", lambda: server.outcome(17))
    assert server.outcome(17) == "success"
    assert "proceeding" in server.executions("17")
    assert ready.result()["outcome"] == "installed"
    assert not server.violations
    polls, octets = server.polls, server.octets
    wait_for("it to go on asking", lambda: server.polls > polls + 1)
    figures.note(hawkbit_poll_octets=round((server.octets - octets) / (server.polls - polls)),
                 hawkbit_poll_line_octets=poll_octets(ready.machine, server))
    assert ready.starts() == before + 1     # and it isn't installed again


def test_a_connection_that_breaks_is_taken_up_where_it_was(ready, server):
    bundle, before = bundles.bundle("good", NEWER), ready.starts()
    server.break_at = bundle.stat().st_size // 3
    server.offer(21, bundle, NEWER)
    ready.wait_restart(before)
    assert server.resumed_at == [server.break_at]
    assert not server.violations


def test_a_server_that_breaks_off_is_left_alone_for_a_while(ready, server):
    """Else it begins again at once, and a server that gives a percent now and then keeps the aircraft on the ground."""
    bundle = bundles.bundle("good", NEWER)
    server.break_at, server.breaks_for_good = bundle.stat().st_size // 3, True
    server.offer(22, bundle, NEWER)
    ready.wait_state("installing")
    installer = ready.machine.must("cat /run/pid/swupdate")
    ready.wait_state("idle")
    assert ready.result()["outcome"] == "refused"
    assert_left_alone(ready, server, installer)
    assert ready.machine.run("test -e /run/updating")[0] != 0
    assert ready.protected()


def test_a_rolled_back_one_is_reported(ready, server):
    before = ready.starts()
    server.offer(18, bundles.bundle("no_bluetooth", NEWER, NO_BLUETOOTH.changes), NEWER)
    ready.wait_restart(before)
    ready.wait_restart(before + 1)
    ready.machine.wait_on_air()
    wait_for("the report", lambda: server.outcome(18))
    assert server.outcome(18) == "failure"
    assert ready.result()["outcome"] == "rolled-back"
    assert not server.violations


def test_one_that_is_refused_is_reported(ready, server):
    server.offer(19, bundles.bundle("another", NEWER, keys=bundles.other_keys()), NEWER)
    wait_for("the report", lambda: server.outcome(19))
    assert server.outcome(19) == "failure"
    assert any("signature" in line.lower() or "image invalid" in line.lower() for _, one in server.feedback
               for line in one["status"].get("details", []))
    assert ready.result()["outcome"] == "refused"
    assert not server.violations


def test_one_that_is_called_off_while_it_comes(ready, server):
    """At the server, in the middle of it: no more is written, nothing is marked, and the server is told that it is over.
    Then it is left alone for a while: one that offers and calls off, again and again, kept the aircraft on the ground."""
    def found():
        return (ready.starts(), ready.kept(),       # ustate is SWUpdate's own
                {name: value for name, value in ready.variables().items() if name != "ustate"})
    before, bundle = found(), bundles.bundle("good", NEWER)
    server.rate = bundle.stat().st_size // (3 * OFFERED_POLL_S)     # SWUpdate asks meanwhile
    server.offer(25, bundle, NEWER)
    ready.wait_state("installing")
    installer = ready.machine.must("cat /run/pid/swupdate")
    server.cancel()
    wait_for("the answer", lambda: server.cancelled)
    assert [status["execution"] for status in server.cancelled] == ["closed"]
    ready.wait_state("idle")
    assert "called off" in ready.result()["sentence"]
    assert_left_alone(ready, server, installer)
    assert found() == before and ready.protected()
    assert not server.violations


# --- not now ---------------------------------------------------------------------------

release_only = pytest.mark.skipif(not os.environ.get("IMAGE"), reason=(
    "the bench's SWUpdate, Debian's, closes what the server says skip to (br2-external/patches/swupdate): "
    "IMAGE=build/image/qemu/images/disk.img"))


@release_only
@pytest.mark.parametrize("field", ["update", "download"])
def test_what_the_server_says_skip_to_waits_and_is_installed_later(ready, server, field):
    """Outside of the maintenance window it was told that it had been a success, and held the aircraft for updated for ever."""
    before = ready.starts()
    setattr(server, field, "skip")
    server.window = "unavailable"
    server.offer(26, bundles.bundle("good", NEWER), NEWER)
    polls = server.polls
    wait_for("more polls", lambda: server.polls > polls + 2)
    assert not server.feedback and not server.downloads and ready.starts() == before
    setattr(server, field, "attempt")
    server.window = "available"
    ready.wait_restart(before)
    ready.machine.wait_on_air()
    wait_for("the report", lambda: server.outcome(26))
    assert server.outcome(26) == "success"
    assert not server.violations


@release_only
def test_one_that_the_server_says_skip_to_while_it_comes_is_not_over(ready, server):
    before, bundle = ready.starts(), bundles.bundle("good", NEWER)
    server.rate = bundle.stat().st_size // (3 * OFFERED_POLL_S)     # SWUpdate asks meanwhile
    server.offer(27, bundle, NEWER)
    ready.wait_state("installing")
    server.update = "skip"
    ready.wait_state("idle")
    assert server.outcome(27) is None and "closed" not in server.executions("27")
    assert ready.starts() == before and ready.protected()
    assert not server.violations


def test_switched_off_and_on_by_the_technician(ready, server):
    """At once, as odidctl says."""
    wait_for("a poll", lambda: server.polls > 1)
    ready.machine.must("odidctl set update.hawkbit_url ''")
    ready.wait_ready()
    polls = server.polls
    time.sleep(4 * server.poll_s)
    assert server.polls == polls
    ready.machine.must(f"odidctl set update.hawkbit_url {server.url}")
    wait_for("a poll", lambda: server.polls > polls)


def test_one_that_comes_in_the_air_is_refused(ready, server, tmp_path):
    """Over a slow connection: SWUpdate isn't ended for it, else it would ask for the bundle again for the whole flight."""
    ready.machine.play(autopilot.generate(tmp_path, armed=True))
    wait_for("armed", ready.armed)
    before = ready.machine.must("cat /run/pid/swupdate"), ready.starts(), ready.sectors_written()
    server.pause_s = 5
    server.offer(23, bundles.bundle("good", NEWER), NEWER)
    wait_for("the report", lambda: server.outcome(23))
    assert server.outcome(23) == "failure"
    assert server.downloads <= 3        # SWUpdate takes the refusal for a broken download first
    assert "disarm it first" in ready.result()["sentence"]
    assert (ready.machine.must("cat /run/pid/swupdate"), ready.starts(), ready.sectors_written()) == before
    assert not server.violations


# --- only what has happened ---------------------------------------------------------------


@release_only
def test_one_that_is_called_off_once_it_runs_has_happened(ready, server):
    """It was told to have been called off, and ran."""
    before = ready.starts()
    server.offer(31, bundles.bundle("good", NEWER), NEWER)
    ready.wait_restart(before)
    server.cancel()
    wait_for("the report", lambda: server.outcome(31))
    assert [status["execution"] for status in server.cancelled] == ["rejected"]
    assert server.outcome(31) == "success" and ready.result()["outcome"] == "installed"
    assert not server.violations


@release_only
def test_a_report_that_nobody_waits_for_closes_nothing_later(ready, server):
    """The next action was closed as a success before it was fetched."""
    before, newer = ready.starts(), bundles.bundle("good", NEWER)
    server.offer(32, newer, NEWER)
    ready.wait_restart(before)
    server.action = None  # whoever looks after the server has taken it away
    ready.wait_state("trial")
    ready.wait_state("idle")
    polls = server.polls
    wait_for("polls", lambda: server.polls > polls + 1)
    server.update = "skip"
    server.offer(33, newer, NEWER)
    ready.machine.must("sv term swupdate")
    polls = server.polls
    wait_for("more polls", lambda: server.polls > polls + 2)
    assert server.outcome(33) is None and not server.executions("33")
