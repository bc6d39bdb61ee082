"""The release's SWUpdate (its version, configuration and patches; built for this machine) as a client of hawkBit's: what it
tells a server. Nothing is installed here: what it fetches is no bundle, and refused. (The booted appliance installs:
test_hawkbit.py.) And who keeps others from its socket, and how long."""

import os
import re
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import patience
import pytest

from . import bundles, certificate, hawkbit
from .appliance import wait_for
from .server import GUEST_SEES

SWUPDATE = bundles.parts.ROOT / "build/swupdate/swupdate"
OFFERED = "1.1.0"
# SWUpdate's state, in U-Boot's variable ustate.
INSTALLED = "1"  # a new system is written, and hasn't started yet
TESTING = "2"  # it runs and is kept, and the server hasn't been told
FAILED = "3"  # it failed its trial, and the server hasn't been told
OCTETS = 16_000
LIMIT_S = 15  # for an answer by its socket, and for its end


def hawkbit_server(tls=None):
    one = hawkbit.HawkBit("an-aircraft", poll_s=1, tls=tls)
    one.url = one.url.replace(GUEST_SEES, "127.0.0.1")
    return one


@pytest.fixture
def server(request, monkeypatch, tmp_path):
    """With TLS where a test asks for it."""
    monkeypatch.setattr(hawkbit, "OFFERED_POLL_S", 1)
    one = hawkbit_server(certificate.make(tmp_path, "127.0.0.1") if getattr(request, "param", "") == "tls" else None)
    yield one
    one.stop()


def remember(folder, ustate):
    """In U-Boot's environment, as SWUpdate does."""
    variables, environment = folder / "variables", folder / "environment"
    variables.write_text(f"upgrade_available=0\nustate={ustate}\n")
    subprocess.run(["mkenvimage", "-s", "0x4000", "-o", f"{environment}.new", variables], check=True)
    os.replace(f"{environment}.new", environment)


@pytest.fixture
def start(server, tmp_path):
    """start(ustate): the client, as overlay/etc/sv/swupdate/run starts it; in place of the one before. Returns SWUpdate's process id."""
    started = []

    def end():
        for one in started:
            one.terminate()
            try:
                one.wait(LIMIT_S)
            except subprocess.TimeoutExpired:  # its threads are cancelled, whatever they hold
                one.kill()
                one.wait()
            print((tmp_path / "log").read_text(errors="replace"))  # shown where a test fails
        started.clear()

    def start(ustate=""):
        end()
        authority = f'cafile = "{tmp_path / "server.crt"}";' if server.url.startswith("https:") else ""
        remember(tmp_path, ustate)
        (tmp_path / "fw_env.config").write_text(f"{tmp_path / 'environment'} 0 0x4000\n")
        (tmp_path / "swupdate.cfg").write_text(f"""
globals: {{ public-key-file = "{bundles.KEYS / 'trusted.pem'}"; bootloader = "uboot"; loglevel = 4;
           fwenv-config-location = "{tmp_path / 'fw_env.config'}"; }};
suricatta: {{ url = "{server.url}"; tenant = "{server.tenant}"; id = "{server.name}"; targettoken = "{server.token}";
             {authority} userid = {os.getuid()}; groupid = {os.getgid()}; retry = 2; retrywait = 1; }};
identify: ( {{ name = "version"; value = "1.0.0"; }} );
""")
        with open(tmp_path / "log", "wb") as log:
            started.append(subprocess.Popen(
                [SWUPDATE, "-f", tmp_path / "swupdate.cfg", "-H", "odid:odid-qemu", "-M", "-u", ""],
                env=os.environ | {"TMPDIR": str(tmp_path)}, stdout=log, stderr=log))
        polls = server.polls
        wait_for("a poll", lambda: server.polls > polls)
        return started[-1].pid

    yield start
    end()


@pytest.fixture
def no_bundle(tmp_path):
    """Its description comes whole before it is seen to be none."""
    (tmp_path / "sw-description").write_bytes(b"\n" * OCTETS)
    return bundles.put_together(tmp_path, ["sw-description"], tmp_path / "no.swu")


def more_polls(server):
    polls = server.polls
    wait_for("more polls", lambda: server.polls > polls + 2)


def sockets_of(pid):
    """What it holds of sockets that wait for somebody, and of named ones: each line of /proc/net/unix."""
    held = {os.readlink(one)[len("socket:["):-1] for one in Path(f"/proc/{pid}/fd").iterdir() if os.readlink(one).startswith("socket:[")}
    return [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:] if line.split()[6] in held]


def test_the_client_answers_nobody_in_swupdate_s_place(start, tmp_path):
    """It had its listening sockets: taken over, it took a person's bundle, and said of its own that a person had asked."""
    parent = start()
    client, = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    listening = 1 << 16  # __SO_ACCEPTCON
    assert {one[7] for one in sockets_of(parent) if int(one[3], 16) & listening} >= {str(tmp_path / "sockinstctrl")}
    assert not [one for one in sockets_of(client) if int(one[3], 16) & listening]
    assert {one[7].rstrip("@") for one in sockets_of(client) if len(one) > 7} == {f"@Notify{client}"}


@pytest.mark.parametrize("field", ["update", "download"])
def test_what_the_server_says_skip_to_waits_until_it_doesn_t(server, start, no_bundle, field):
    """It was told "closed", "success", and held the aircraft for updated for ever."""
    setattr(server, field, "skip")
    server.window = "unavailable"
    server.offer(26, no_bundle, OFFERED)
    start()
    more_polls(server)
    assert not server.feedback and not server.downloads
    setattr(server, field, "attempt")
    server.window = "available"
    wait_for("the report", lambda: server.outcome(26))
    assert server.downloads and server.outcome(26) == "failure" and not server.violations


def test_one_that_the_server_says_skip_to_while_it_comes_is_not_over(server, start, no_bundle):
    """It was told "closed", "failure"."""
    server.rate = OCTETS // 60  # a second: it asks meanwhile
    server.offer(27, no_bundle, OFFERED)
    start()
    wait_for("a download", lambda: server.downloads)
    server.update = "skip"
    more_polls(server)
    assert server.outcome(27) is None and "closed" not in server.executions("27") and not server.violations


def test_one_that_is_called_off_while_it_waits_is(server, start, no_bundle):
    server.update = "skip"
    server.offer(28, no_bundle, OFFERED)
    start()
    server.cancel()
    wait_for("the answer", lambda: server.cancelled)
    assert [status["execution"] for status in server.cancelled] == ["closed"] and not server.violations


def test_what_is_called_off_at_each_poll_is_not_written_each_time(server, start, no_bundle, tmp_path):
    """U-Boot's environment was, once a second where the server liked, in flight as well."""
    server.update = "skip"
    start("0")
    environment = tmp_path / "environment"
    before = environment.stat().st_mtime_ns
    for number in range(3):
        server.offer(60 + number, no_bundle, OFFERED)
        server.cancelled.clear()
        server.cancel()
        wait_for("the answer", lambda: server.cancelled)
    more_polls(server)
    assert environment.stat().st_mtime_ns == before and not server.violations


def test_one_that_is_called_off_once_it_runs_has_happened(server, start, no_bundle):
    """It was told to have been called off, and ran."""
    server.offer(31, no_bundle, OFFERED)
    server.cancel()
    start(TESTING)
    wait_for("the report", lambda: server.outcome(31))
    assert [status["execution"] for status in server.cancelled] == ["rejected"]
    assert server.outcome(31) == "success" and not server.downloads and not server.violations


def test_one_whose_trial_is_to_come_isn_t_fetched_again(server, start, no_bundle):
    """After the client's restart it was, and a failure was told."""
    server.offer(35, no_bundle, OFFERED)
    start(INSTALLED)
    more_polls(server)
    assert not server.downloads and "closed" not in server.executions("35") and not server.violations


@pytest.mark.parametrize("called_off", [True, False], ids=["called off", "offered"])
def test_nothing_is_told_while_nobody_says_whether_a_trial_is_to_come(server, start, no_bundle, tmp_path, called_off):
    """The client's two processes end one after the other. What asked in between was told "closed", and tried afterwards; or
    it was fetched once more."""
    server.offer(38, no_bundle, OFFERED)
    start(INSTALLED)
    more_polls(server)
    server.feedback.clear()
    (tmp_path / "sockinstctrl").unlink()
    server.cancelling = called_off
    more_polls(server)
    assert not server.cancelled and not server.feedback and not server.downloads and not server.violations


def test_one_that_is_installed_though_its_download_failed_is_not_over(server, start, no_bundle, tmp_path):
    """It was told "closed", "failure", tried and kept. What makes it so is played: the bundle isn't one."""
    give = server._give_bundle
    server._give_bundle = lambda request: (remember(tmp_path, INSTALLED), give(request))
    server.offer(39, no_bundle, OFFERED)
    start("0")
    wait_for("its end", lambda: "Image invalid" in (tmp_path / "log").read_text())
    fetched = server.downloads
    more_polls(server)
    assert server.downloads == fetched and "closed" not in server.executions("39") and not server.violations


def test_one_that_is_called_off_before_its_trial_is_answered_after_it(server, start, no_bundle):
    """It was told to have been called off, and its trial went on."""
    server.offer(32, no_bundle, OFFERED)
    start(INSTALLED)
    server.cancel()
    more_polls(server)
    assert not server.cancelled and "closed" not in server.executions("32")
    start(TESTING)
    wait_for("the report", lambda: server.outcome(32))
    assert [status["execution"] for status in server.cancelled] == ["rejected"]
    assert server.outcome(32) == "success" and not server.downloads and not server.violations


def test_one_that_is_called_off_before_its_trial_and_fails_it_is_called_off(server, start, no_bundle):
    server.offer(34, no_bundle, OFFERED)
    server.cancel()
    start(INSTALLED)
    more_polls(server)
    assert not server.cancelled and not server.feedback
    start(FAILED)
    wait_for("the answer", lambda: server.cancelled)
    assert [status["execution"] for status in server.cancelled] == ["closed"] and not server.downloads and not server.violations


def test_a_report_that_nobody_waits_for_closes_nothing_later(server, start, no_bundle):
    """The next action was closed as a success before it was fetched."""
    start(TESTING)
    more_polls(server)
    server.update = "skip"
    server.offer(33, no_bundle, OFFERED)
    more_polls(server)
    assert server.outcome(33) is None and not server.executions("33") and not server.violations


def test_whose_a_complaint_is_is_said(server, start, no_bundle, tmp_path):
    """What the client complained of was held for the reason why a technician's bundle was refused."""
    server.offer(36, no_bundle, OFFERED)
    start()
    wait_for("the report", lambda: server.outcome(36))
    said = re.findall(r"SWUPDATE failed \[(\d)\] (?:ERROR : )?(.+)", (tmp_path / "log").read_text())
    assert ("1", "Image invalid or corrupted. Not installing ...") in said  # SWUpdate itself
    assert ("3", "No suitable .swu image found") in said


# --- its socket ---------------------------------------------------------------------

# network_ipc.h, of a machine with 64 bits
MESSAGE_OCTETS = 3120
MAGIC, REQ_INSTALL, ACK, GET_STATUS, NOTIFY_STREAM = 0x14052001, 0, 1, 3, 11
API_VERSION, SOURCE_SERVER, SOURCE_LOCAL = 1, 2, 4
# progress_ipc.h
PROGRESS_OCTETS, CONNECTED_OCTETS = 2416, 8
FAILURE = 4
NOBODY = 65534
ASK = """
import socket, sys
client = socket.socket(socket.AF_UNIX)
client.connect("sockinstctrl")
client.sendall(sys.stdin.buffer.read())
client.recv(1)
"""


@pytest.mark.parametrize("server", ["tls"], indirect=True)
def test_a_server_with_tls_leads_nowhere_else(server, start, no_bundle):
    """One that knows itself by http, behind a proxy, had its token shown, and its next answer taken, in the clear."""
    plain = hawkbit_server()
    try:
        server.linked = plain.url
        server.offer(67, no_bundle, OFFERED)
        start()
        more_polls(server)
        assert plain.octets == 0 and not server.downloads
        server.linked = None
        wait_for("the report", lambda: server.outcome(67))
        assert server.downloads and plain.octets == 0
    finally:
        plain.stop()


def test_nobody_leaves_anything_at_who_only_speaks(start):
    """What hawkBit's client tells by was a place for anybody's messages, with descriptors in them, as long as that one lived."""
    start()
    names = re.findall(r"@(Notify\d+)", open("/proc/net/unix", encoding="ascii").read())
    assert names
    for name in names:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as one, pytest.raises(BrokenPipeError):
            one.sendto(b"x", b"\0" + name.encode().ljust(107, b"\0"))


def connected(folder):
    client = socket.socket(socket.AF_UNIX)
    client.settimeout(LIMIT_S)
    client.connect(str(folder / "sockinstctrl"))
    return client


def message(what, *data):
    return struct.pack(f"=ii{len(data)}I", MAGIC, what, *data).ljust(MESSAGE_OCTETS, b"\0")


def answer(client, what, *data):
    """What it answers: the message's type."""
    client.sendall(message(what, *data))
    return struct.unpack("=ii", client.recv(MESSAGE_OCTETS, socket.MSG_WAITALL)[:8])[1]


def anybody_else_is_answered(folder, promise_s):
    began = time.monotonic()
    with connected(folder) as client:
        assert answer(client, GET_STATUS) == ACK
    patience.promise("another one's answer", time.monotonic() - began, promise_s)


@pytest.mark.parametrize("said", [b"", b"x"], ids=["nothing", "one_octet"])
def test_one_that_connects_and_says_no_more_keeps_nobody_out(start, tmp_path, said):
    """It waited for that one for ever: no update began any more, and nobody heard of one."""
    start()
    with connected(tmp_path) as client:
        client.sendall(said)
        anybody_else_is_answered(tmp_path, 3)
        assert client.recv(1) == b""


def test_one_that_wants_to_be_told_all_and_reads_nothing_keeps_nobody_out(start, tmp_path):
    """As soon as its buffer was full."""
    start()
    with connected(tmp_path) as listener:
        listener.sendall(message(NOTIFY_STREAM))
        for _ in range(400):  # each is a word to those who listen
            with connected(tmp_path) as client:
                client.sendall(b"x")
        anybody_else_is_answered(tmp_path, 10)


@pytest.mark.parametrize("user, source", [(0, SOURCE_LOCAL), (NOBODY, SOURCE_SERVER)], ids=["root", "another"])
def test_whoever_is_not_root_asks_for_a_server(start, tmp_path, user, source):
    """hawkBit's client, taken over, said that a person asks: what waits for nothing but a person's word began for it."""
    start()
    tmp_path.chmod(0o755)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.settimeout(LIMIT_S)
        listener.connect(str(tmp_path / "swupdateprog"))
        assert len(listener.recv(CONNECTED_OCTETS, socket.MSG_WAITALL)) == CONNECTED_OCTETS
        subprocess.run([os.path.realpath(sys.executable), "-c", ASK], input=message(REQ_INSTALL, API_VERSION, SOURCE_LOCAL),
                       cwd=tmp_path, user=user, extra_groups=[], check=True, timeout=LIMIT_S)
        told = listener.recv(PROGRESS_OCTETS, socket.MSG_WAITALL)
    assert struct.unpack_from("=II", told)[1] == FAILURE  # nothing came
    assert struct.unpack_from("=I", told, 356) == (source,)


def test_a_bundle_may_take_its_time(start, tmp_path):
    """Whose request was there at once."""
    start()
    with connected(tmp_path) as client:
        assert answer(client, REQ_INSTALL, API_VERSION, SOURCE_LOCAL) == ACK
        client.settimeout(3)  # nothing comes
        with pytest.raises(TimeoutError):
            client.recv(1)
    # Ended in the middle of what it says of that, it may hang.
    log = tmp_path / "log"
    wait_for("the end of it", lambda: "Waiting for requests" in log.read_text().rpartition("Software Update started")[2])
