"""odid-web's answers, asked for without a browser: who gets which, and what they do."""

import http.client
import os
import re
import select
import socket
import struct
import subprocess
import threading
import time

import pytest
from patience import LIMIT_S, promise, promised, stays, wait_for

from .appliance import CONFIGURATION, PASSWORD, USER, Gate, process_says

BUNDLE = os.urandom(1 << 20)
NUMBER, SECRET = "FIN87astrdge12k8", "xyz"
PROTECTED = [("GET", "/api/status"), ("GET", "/api/flights"), ("GET", "/api/flights/00001.jsonl"),
             ("POST", "/api/settings"), ("POST", "/api/update"), ("DELETE", "/api/update")]


# --- who gets in --------------------------------------------------------------------


@pytest.mark.parametrize("method, path", PROTECTED)
@pytest.mark.parametrize("cookie", [None, "odid=", "odid=" + "0" * 32, "odid=../../etc/passwd"])
def test_nothing_without_the_password(appliance, updater, method, path, cookie):
    appliance.write("data/odid/flights/00001.jsonl", "{}\n")
    code, said, _ = appliance.ask(method, path, b"{}" if method == "POST" else None, cookie=cookie)
    assert (code, said) == (401, {"sentence": "Give the maintenance password first."})
    assert updater.bundles == [] and appliance.read("data/odid/odid.conf") == CONFIGURATION


def test_the_page_itself_is_for_everybody_and_says_nothing(appliance):
    for path, kind in (("/", "text/html"), ("/page.js", "text/javascript"), ("/style.css", "text/css")):
        code, text, headers = appliance.ask("GET", path)
        assert code == 200 and headers["Content-Type"].startswith(kind)
        assert b"SSRS5GBG01" not in text and "default-src 'none'" in headers["Content-Security-Policy"]


def test_the_password_opens_and_leaving_closes(appliance):
    code, said, headers = appliance.ask("POST", "/api/session", {"password": PASSWORD})
    assert (code, said) == (200, {})
    assert set(headers["Set-Cookie"].split("; ")[1:]) == {"Path=/", "HttpOnly", "SameSite=Strict"}
    cookie = headers["Set-Cookie"].split(";")[0]
    assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 200
    assert appliance.ask("DELETE", "/api/session", cookie=cookie)[0] == 200
    assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 401
    assert appliance.login() != cookie


def test_a_session_ends_with_the_program(appliance):
    cookie = appliance.login()
    appliance.stop()
    appliance.start()
    assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 401


def slow_ones(appliance, count, octet=b"G", address="127.0.0.1"):
    """Connections that begin a request and don't go on."""
    made = []
    for _ in range(count):
        made.append(socket.create_connection(("127.0.0.1", appliance.port), source_address=(address, 0)))
        made[-1].send(octet)
    return made


@pytest.mark.parametrize("addresses", [["127.0.0.1"], [f"127.0.0.{number}" for number in range(2, 8)]], ids=["his own", "others"])
def test_slow_connections_keep_nobody_out(appliance, addresses):
    """Twenty-four of them locked the page, for as long as each sent an octet now and then; twelve, from the technician's own
    address, as behind a router."""
    cookie = appliance.login()
    held = [one for address in addresses for one in slow_ones(appliance, 72 // len(addresses), address=address)]
    assert appliance.ask("GET", "/")[0] == 200
    assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 200
    assert appliance.ask("POST", "/api/session", {"password": PASSWORD})[0] == 200
    for one in held:
        one.close()


def test_a_request_has_ten_seconds(appliance):
    """Whatever comes of it meanwhile."""
    (one,), begun = slow_ones(appliance, 1), time.monotonic()

    def is_closed():
        try:
            one.send(b"x")
            return bool(select.select([one], [], [], 0)[0]) and one.recv(1) == b""
        except OSError:
            return True
    wait_for("its end", is_closed)
    promised(time.monotonic() - begun > 9, "it ended before its ten seconds were over")
    promise("its end", time.monotonic() - begun, 12)


def test_a_session_s_connection_stays_over_many_requests(appliance):
    cookie = appliance.login()
    connection = http.client.HTTPConnection("127.0.0.1", appliance.port, timeout=LIMIT_S)
    connection.connect()
    kept = connection.sock

    def goes_on():
        connection.request("GET", "/api/status", headers={"Cookie": cookie})
        return connection.getresponse().read() and connection.sock is kept
    stays("it is the same connection", goes_on, 12)  # longer than a request has


def test_who_has_logged_out_is_a_stranger_again(appliance):
    """Forty connections that once showed a session, and nobody saw the page until it was started again."""
    cookie, held = appliance.login(), []

    def ask(connection, method="GET", path="/"):
        try:
            connection.request(method, path, headers={"Cookie": cookie, "X-Odid-Page": "1"})
            connection.getresponse().read()
        except (OSError, http.client.HTTPException):
            pass  # its place was another one's
    for number in range(40):
        one = http.client.HTTPConnection("127.0.0.1", appliance.port, timeout=LIMIT_S,
                                         source_address=(f"127.0.0.{2 + number // 10}", 0))
        ask(one)
        held.append(one)
    ask(held[0], "DELETE", "/api/session")
    for one in held:
        ask(one)
    assert appliance.ask("GET", "/")[0] == 200
    for one in held:
        one.close()


def test_wrong_passwords_are_slowed_down(appliance):
    for wrong in ("", PASSWORD + "x", PASSWORD.upper(), PASSWORD[:-1]):
        code, said, headers = appliance.ask("POST", "/api/session", {"password": wrong})
        assert (code, said["sentence"]) == (403, "That is not the maintenance password.")
        assert "Set-Cookie" not in headers
    assert appliance.ask("POST", "/api/session", b"no JSON")[0] == 403

    def refused():
        """The right one, after wrong ones that came quicker than one in ten seconds."""
        for _ in range(10):
            if appliance.ask("POST", "/api/session", {"password": "wrong"})[0] == 429:
                break
        code, said, _ = appliance.ask("POST", "/api/session", {"password": PASSWORD})
        return code == 429 and said["sentence"]
    assert re.search(r"Wait \d+ seconds", wait_for("the right password to be refused", refused))
    assert PASSWORD not in appliance.said()


def test_without_a_password_nobody_gets_in(appliance):
    (appliance.folder / "data/secrets/maintenance.psk").unlink()
    code, said, _ = appliance.ask("POST", "/api/session", {"password": ""})
    assert code == 403 and "No maintenance password was ever set" in said["sentence"]


# --- who asks -----------------------------------------------------------------------


@pytest.mark.parametrize("host", ["evil.example", "192.168.41.1.evil.example:80", None])
def test_a_foreign_name_for_this_address_gets_nothing(appliance, host):
    for method, path in (("GET", "/"), ("POST", "/api/session")):
        code, said, _ = appliance.ask(method, path, b"" if method == "POST" else None, headers={"Host": host})
        assert code in (400, 403)
        if code == 403:
            assert "192.168.41.1" in said["sentence"]


@pytest.mark.parametrize("method, path, body", [
    ("POST", "/api/session", f'{{"password": "{PASSWORD}"}}'), ("DELETE", "/api/session", None),
    ("POST", "/api/settings", '{"serial": "SSRS5GBG02"}'), ("POST", "/api/update", "bundle")])
@pytest.mark.parametrize("page, origin", [
    (False, None), (False, "own"), (True, "http://evil.example"), (True, "null"), (True, "https://own")])
def test_a_foreign_page_changes_nothing(appliance, updater, method, path, body, page, origin):
    own = f"127.0.0.1:{appliance.port}"
    origin = origin and (f"http://{own}" if origin == "own" else origin.replace("own", own))
    cookie = appliance.login()
    code, said, headers = appliance.ask(method, path, body and body.encode(), cookie=cookie, page=page,
                                        headers={"Origin": origin})
    assert code == 403 and "another page" in said["sentence"] and "Set-Cookie" not in headers
    assert appliance.read("data/odid/odid.conf") == CONFIGURATION and updater.bundles == []
    assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 200


# --- status -------------------------------------------------------------------------


def test_the_status_is_complete(appliance):
    appliance.write("run/faults/wireless", "There is no Wi-Fi interface wlan0.\n")
    appliance.update("installing", 40, 12, "Installing version 1.5.0.")
    appliance.last_update("refused", "The bundle isn't signed.")
    code, status, _ = appliance.ask("GET", "/api/status", cookie=appliance.login())
    assert code == 200
    assert status["daemon"] == appliance.daemon.status and status["daemon_silence"] is None
    assert status["faults"] == [{"name": "wireless", "sentence": "There is no Wi-Fi interface wlan0."}]
    assert (status["version"], status["slot"]) == ("1.4.0", "a")
    assert status["update"] == {"state": "installing", "percent": 40, "seconds_left": 12,
                                "sentence": "Installing version 1.5.0."}
    assert (status["last_update"]["outcome"], status["last_update"]["to"]) == ("refused", "1.5.0")


def test_what_can_not_be_read_is_null(appliance):
    appliance.daemon.stop()
    for path in ("etc/odid/version", "run/odid-appliance/slot"):
        (appliance.folder / path).unlink()
    appliance.write("run/odid-appliance/update-state.json", "{half")
    appliance.write("data/odid/update.json", "[1]")
    status = appliance.ask("GET", "/api/status", cookie=appliance.login())[1]
    assert status == {"daemon": None, "daemon_silence": "not running", "faults": [], "version": None, "slot": None,
                      "update": None, "last_update": None, "last_update_mark": None}


def test_the_same_result_twice_is_two_results(appliance):
    cookie, marks = appliance.login(), set()
    for _ in range(3):
        time.sleep(0.02)        # a file's time goes on in steps, and a file's number is used again
        appliance.last_update("refused", "The bundle isn't signed.", at=None)
        marks.add(appliance.ask("GET", "/api/status", cookie=cookie)[1]["last_update_mark"])
    assert len(marks) == 3


def test_a_daemon_that_hangs_is_said_to(appliance):
    cookie = appliance.login()
    appliance.daemon.hangs = True
    assert appliance.ask("GET", "/api/status", cookie=cookie)[1]["daemon_silence"] == "does not answer"


# --- settings -----------------------------------------------------------------------


def test_settings_are_checked_saved_and_applied(appliance):
    code, said, _ = appliance.ask("POST", "/api/settings", {"operator": f"{NUMBER}-{SECRET}", "serial": "SSRS5GBG02"},
                                  cookie=appliance.login())
    assert code == 200 and said["operator"]["done"] and said["serial"]["done"]
    assert "Saved, and in effect." in said["serial"]["said"]
    assert appliance.read("data/odid/odid.conf") == CONFIGURATION.replace("SSRS5GBG01", "SSRS5GBG02").replace(
        "SWE3jxza7qbzvu5d", NUMBER)
    assert appliance.read("applied") == "applied\napplied\n"


def test_the_secret_part_is_nowhere(appliance):
    cookie = appliance.login()
    for given in (f"{NUMBER}-{SECRET}", f"{NUMBER}-aaa", f"{NUMBER}{SECRET}", f"{NUMBER[:-1]}9-{SECRET}"):
        _, said, _ = appliance.ask("POST", "/api/settings", {"operator": given}, cookie=cookie)
        assert SECRET not in str(said) and "aaa" not in str(said)
    _, said, _ = appliance.ask("POST", "/api/settings", {"serial": f"{NUMBER}-{SECRET}"}, cookie=cookie)
    assert not said["serial"]["done"] and SECRET not in str(said)
    for path in appliance.folder.rglob("*"):
        if path.is_file() and path.parent.name != "odid-web":  # the page has an example
            assert SECRET not in path.read_text(errors="replace"), path


@pytest.mark.parametrize("body", [b"", b"{}", b"[]", b'{"serial": 5}', b'{"serial": "a\\nb"}', b'{"channel": "6"}',
                                  b'{"serial": "' + b"A" * 128 + b'"}'])
def test_settings_that_are_none_change_nothing(appliance, body):
    code, said, _ = appliance.ask("POST", "/api/settings", body, cookie=appliance.login())
    assert code == 400 and "nothing was changed" in said["sentence"]
    assert appliance.read("data/odid/odid.conf") == CONFIGURATION


def test_a_body_that_is_too_long_is_refused(appliance):
    assert appliance.ask("POST", "/api/settings", b" " * 100000, cookie=appliance.login())[0] == 413


def test_nothing_is_set_while_armed(appliance):
    cookie = appliance.login()
    appliance.status(aircraft__armed=True)
    said = appliance.ask("POST", "/api/settings", {"serial": "SSRS5GBG02"}, cookie=cookie)[1]
    assert said == {"serial": {"done": False, "said": ["The aircraft is armed: nothing was changed."]}}
    assert appliance.read("data/odid/odid.conf") == CONFIGURATION


# --- flight records -----------------------------------------------------------------


def test_flight_records_are_listed_and_given(appliance):
    record = '{"t": 1.0, "event": "start", "boot": "b", "version": "1", "image": "i"}\n'
    appliance.write("data/odid/flights/00003.jsonl", record)
    appliance.write("data/odid/flights/00012.jsonl", record)
    cookie = appliance.login()
    assert [flight["number"] for flight in appliance.ask("GET", "/api/flights", cookie=cookie)[1]] == [12, 3]
    code, text, headers = appliance.ask("GET", "/api/flights/00012.jsonl", cookie=cookie)
    assert code == 200 and text.decode() == record
    assert headers["Content-Disposition"] == 'attachment; filename="flight-00012.jsonl"'


@pytest.mark.parametrize("name", ["..%2f..%2fodid%2fodid.conf", "../odid.conf", "00099.jsonl", "12",
                                  "link.jsonl", "00077.jsonl"])
def test_nothing_but_flight_records_is_given(appliance, name):
    appliance.write("data/odid/flights/00012.jsonl", "{}\n")
    (appliance.folder / "data/odid/flights/00077.jsonl").symlink_to("../odid.conf")
    code, text, _ = appliance.ask("GET", f"/api/flights/{name}", cookie=appliance.login())
    assert code == 404 and "uas_id" not in str(text)


# --- the bundle ---------------------------------------------------------------------


def test_a_bundle_reaches_the_updater_whole(appliance, updater):
    code, said, _ = appliance.ask("POST", "/api/update", BUNDLE, cookie=appliance.login())
    assert (code, said["sentence"]) == (202, "The whole bundle is with the updater.")
    wait_for("the bundle's end", lambda: updater.bundles)
    assert updater.bundles == [BUNDLE]


def begin_upload(appliance, updater, cookie):
    """Sends the bundle, of which the updater takes half before it is told to go on."""
    updater.stops_at = len(BUNDLE) // 2
    upload = threading.Thread(target=appliance.ask, args=("POST", "/api/update", BUNDLE), kwargs={"cookie": cookie})
    upload.start()
    wait_for("half of the bundle", lambda: updater.taken >= updater.stops_at)
    return upload


def test_the_page_answers_while_a_slow_updater_takes_a_bundle(appliance, updater):
    updater.rate = 1_000_000
    cookie = appliance.login()
    upload = begin_upload(appliance, updater, cookie)
    took_s = []
    # For ever slow, and then so slow that there is a little room now and then.
    while len(took_s) < 3 or upload.is_alive():
        begun = time.monotonic()
        assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 200
        took_s.append(time.monotonic() - begun)
        if len(took_s) == 3:
            assert upload.is_alive() and updater.bundles == []
            updater.goes_on.set()
        time.sleep(0.1)
    promise("the slowest answer meanwhile", max(took_s), 0.5)
    wait_for("the bundle's end", lambda: updater.bundles)
    assert updater.bundles == [BUNDLE]


def test_a_bundle_that_is_refused_half_way_is_said_to_be(appliance, updater):
    updater.limit = 100000
    code, said, _ = appliance.ask("POST", "/api/update", BUNDLE, cookie=appliance.login())
    assert code == 502 and "stopped taking the bundle" in said["sentence"]


def test_a_connection_that_is_cut_ends_the_bundle(appliance, updater):
    cookie = appliance.login()
    connection = socket.create_connection(("127.0.0.1", appliance.port))
    connection.sendall(f"POST /api/update HTTP/1.1\r\nHost: 127.0.0.1:{appliance.port}\r\nX-Odid-Page: 1\r\n"
                       f"Cookie: {cookie}\r\nContent-Length: {len(BUNDLE)}\r\n\r\n".encode() + BUNDLE[:300000])
    wait_for("the first half", lambda: updater.taken >= 250000)
    connection.close()
    wait_for("the bundle's end", lambda: updater.bundles, within_s=5)
    assert len(updater.bundles[0]) <= 300000
    assert appliance.ask("GET", "/api/status", cookie=cookie)[0] == 200
    wait_for("the log", lambda: "cut short" in appliance.said())
    assert appliance.ask("POST", "/api/update", BUNDLE, cookie=cookie)[0] == 202


@pytest.mark.parametrize("obstacle, sentence", [
    ("armed", "The aircraft is armed"), ("lost", "The aircraft is armed"), ("busy", "another update is under way"),
    ("installing", "Installing version 1.5.0."), ("trial", "Version 1.5.0 is on trial.")])
def test_no_bundle_is_begun_when_none_may_be_installed(appliance, updater, obstacle, sentence):
    cookie = appliance.login()
    if obstacle == "armed":
        appliance.status(aircraft__armed=True)
    elif obstacle == "lost":                    # after arming: armed is what was heard last
        appliance.status(aircraft__armed=True)
        appliance.status(aircraft__armed=None)
    elif obstacle == "busy":
        updater.busy = True
    else:
        appliance.update(obstacle, sentence=sentence)
    code, said, _ = appliance.ask("POST", "/api/update", BUNDLE, cookie=cookie)
    assert code == 409 and sentence in said["sentence"]
    assert updater.bundles == []


@pytest.mark.parametrize("answer, code, sentence", [
    ("", 200, "The update is called off."), ("Nothing is being installed.", 409, "Nothing is being installed.")])
def test_an_update_is_called_off(appliance, answer, code, sentence):
    gate = Gate(appliance.folder / "run/odid-appliance", answer)
    assert appliance.ask("DELETE", "/api/update", cookie=appliance.login())[:2] == (code, {"sentence": sentence})
    assert gate.asked == ["cancel"]


def test_nothing_is_called_off_where_nobody_looks_after_updates(appliance):
    code, said, _ = appliance.ask("DELETE", "/api/update", cookie=appliance.login())
    assert code == 409 and "Nobody looks after updates" in said["sentence"]


@pytest.mark.parametrize("how", ["closed", "reset"])
def test_a_browser_that_leaves_ends_the_bundle_at_once(appliance, updater, how):
    """With much of the bundle still on its way: the end comes right behind the last octets."""
    updater.rate, updater.stops_at = 3_000_000, 1_000_000
    cookie = appliance.login()
    for _ in range(4):
        updater.goes_on.clear()
        browser = socket.create_connection(("127.0.0.1", appliance.port))
        browser.settimeout(0.4)     # nothing comes; it fills the buffers, and never gets to the end
        head = (f"POST /api/update HTTP/1.1\r\nHost: 127.0.0.1:{appliance.port}\r\nX-Odid-Page: 1\r\n"
                f"Cookie: {cookie}\r\nContent-Length: 9000000\r\n\r\n")
        with pytest.raises(TimeoutError):
            browser.sendall(head.encode() + bytes(9000000))
        if how == "reset":
            browser.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        browser.close()
        updater.goes_on.set()
        wait_for("the bundle's end", updater.over.is_set, within_s=4)
        updater.over.clear()
    assert max(map(len, updater.bundles)) < 9000000


def test_only_one_bundle_at_a_time(appliance, updater):
    cookie = appliance.login()
    first = begin_upload(appliance, updater, cookie)
    code, said, _ = appliance.ask("POST", "/api/update", b"x" * 1000, cookie=cookie)
    assert (code, said["sentence"]) == (409, "Another file is being sent already.")
    updater.goes_on.set()
    first.join()
    wait_for("the bundle's end", lambda: updater.bundles)
    assert updater.bundles == [BUNDLE]


def test_what_is_no_bundle_by_its_size_is_stopped(appliance, updater):
    code, said, _ = appliance.ask("POST", "/api/update", b"x" * (64 * 1024 * 1024 + 1), cookie=appliance.login())
    assert code == 413 and "too large" in said["sentence"]


def test_without_an_updater_it_says_so(appliance):
    code, said, _ = appliance.ask("POST", "/api/update", BUNDLE, cookie=appliance.login())
    assert code == 409 and "updater isn't running" in said["sentence"]


# --- its two halves -----------------------------------------------------------------


@pytest.mark.skipif(not USER, reason="only root can give rights away")
def test_who_speaks_http_has_no_rights(appliance):
    serving = appliance.serving()
    assert process_says(serving, "Uid") != "0" and process_says(serving, "NoNewPrivs") == "1"
    assert process_says(serving, "Seccomp") == "2"
    for name in ("CapInh", "CapPrm", "CapEff", "CapBnd", "CapAmb"):
        assert int(process_says(serving, name), 16) == 0, name
    wait_for("root's half to have closed the port", lambda: "page is served" in appliance.said())
    sockets = subprocess.run(["ss", "-Hltnp", "sport", "=", str(appliance.port)], capture_output=True, text=True).stdout
    if sockets:
        assert f"pid={serving}" in sockets and f"pid={appliance.process.pid}" not in sockets, sockets


@pytest.mark.parametrize("who", ["serving", "helper"])
def test_either_half_ends_with_the_other(appliance, who):
    serving = appliance.serving()
    os.kill(serving if who == "serving" else appliance.process.pid, 9)
    # An orphan that has ended stays a zombie until somebody asks for it.
    wait_for("both to end", lambda: appliance.process.poll() is not None and
             process_says(serving, "State") in (None, "Z", "X"), within_s=5)
    appliance.wait_closed()


def test_its_end_closes_the_sockets(appliance):
    idle = http.client.HTTPConnection("127.0.0.1", appliance.port, timeout=LIMIT_S)
    idle.request("GET", "/")
    idle.getresponse().read()
    begun = time.monotonic()
    appliance.process.terminate()
    assert appliance.process.wait(LIMIT_S) == -15
    appliance.wait_closed()
    with pytest.raises((OSError, http.client.HTTPException)) as lost:
        idle.request("GET", "/")
        idle.getresponse()
    assert not isinstance(lost.value, TimeoutError)
    promise("the end of all its connections", time.monotonic() - begun, 3)
