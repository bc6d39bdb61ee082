"""The real odid-web on loopback, in a folder that stands for the appliance's root.

What the appliance's daemon would say is a recording of the real one's (status.json), changed by each
test as it needs; the updater is Debian's SWUpdate (updater.py), or none.
"""

import copy
import hashlib
import http.client
import json
import os
import shutil
import socket
import subprocess
import threading
from pathlib import Path

import patience

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PROGRAM = ROOT / "build/daemon/odid-web"
FILES = ROOT / "overlay/usr/share/odid-web"
SSID, PASSWORD = "RemoteID-0A1B", "saltwater-and-wind"
CONFIGURATION = "[basic_id]\nuas_id = SSRS5GBG01\n\n[operator]\noperator_id = SWE3jxza7qbzvu5d\n"
# The serving half becomes a user with no rights; nobody is on every machine.
USER = "nobody" if os.geteuid() == 0 else ""


def process_says(pid, name):
    """A line's first word in /proc/<pid>/status; None when there is no such process."""
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except (FileNotFoundError, ProcessLookupError):
        return None
    return next(line.split()[1] for line in lines if line.startswith(name + ":"))


def recorded():
    return json.loads((HERE / "status.json").read_text(encoding="utf-8"))


class Daemon:
    """Answers on status.sock as odid-daemon does."""

    def __init__(self, folder):
        self.status = recorded()
        self.hangs = False
        self.path = folder / "status.sock"
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(str(self.path))
        self.path.chmod(0o666)
        self.listener.listen(8)
        self.held = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            if self.hangs:
                self.held.append(connection)
                continue
            try:
                connection.sendall(json.dumps(self.status).encode())
            except OSError:
                pass
            connection.close()

    def stop(self):
        self.path.unlink(missing_ok=True)
        self.listener.close()


class Gate:
    """Answers on update.sock as odid-update does, each word with `answer`."""

    def __init__(self, folder, answer=""):
        self.answer, self.asked = answer, []
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.listener.bind(str(folder / "update.sock"))
        self.listener.listen(1)
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self):
        while True:
            connection, _ = self.listener.accept()
            self.asked.append(connection.recv(16).decode())
            connection.send(self.answer.encode() + b"\0")
            connection.close()


class Appliance:
    def __init__(self, folder):
        self.folder = Path(folder)
        # A copy: the checkout may be where the serving half's user can't come, in root's own folder for instance.
        shutil.copytree(FILES, self.folder / "usr/share/odid-web")
        for name in ("data/odid/flights", "data/secrets", "etc/odid", "lib/odid", "run/faults", "run/odid", "run/odid-appliance",
                     "run/swupdate"):
            (self.folder / name).mkdir(parents=True)
        (self.folder / "data/secrets").chmod(0o700)
        self.write("etc/odid/version", "1.4.0\n")
        self.write("run/odid-appliance/slot", "a\n")
        self.write("data/odid/odid.conf", CONFIGURATION)
        self.write("data/secrets/wifi_ssid", SSID + "\n", 0o600)
        key = hashlib.pbkdf2_hmac("sha1", PASSWORD.encode(), SSID.encode(), 4096, 32).hex()
        self.write("data/secrets/maintenance.psk", key + "\n", 0o600)
        self.write("lib/odid/apply-configuration", f"#!/bin/sh\necho applied >>{self.folder}/applied\n", 0o755)
        self.daemon = Daemon(self.folder / "run/odid")
        # The port stays ours while the program isn't there: the kernel gives a bound one to nobody else, and the
        # program may bind it, too.
        self.place = socket.socket()
        self.place.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.place.bind(("127.0.0.1", 0))
        self.port = self.place.getsockname()[1]
        self.keep()
        self.process = None
        self.start()

    # --- the program ---

    def start(self):
        self.log = open(self.folder / "odid-web.log", "ab")
        words = [PROGRAM, "-listen", f"127.0.0.1:{self.port}", "-user", USER, "-root", self.folder]
        self.process = subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log)

        def listens():
            if self.process.poll() is not None:
                raise RuntimeError(f"odid-web didn't start: {self.said()}")
            return not self.refuses()
        patience.wait_for("odid-web to listen", listens, within_s=5)

    def refuses(self):
        """Whether nobody listens."""
        try:
            socket.create_connection(("127.0.0.1", self.port), patience.LIMIT_S).close()
        except ConnectionRefusedError:
            return True
        except ConnectionResetError:        # it ended just now
            return False
        return False

    def serving(self):
        """The process id of its serving half. The port is open before that is forked, and gives its rights away."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")

        def found():
            pids = children.read_text().split()
            return int(pids[0]) if pids and process_says(pids[0], "Seccomp") == "2" else None
        return patience.wait_for("the serving half to have no rights any more", found)

    def stop(self):
        if self.process.poll() is None:
            self.process.terminate()
            self.process.wait(patience.LIMIT_S)
            self.wait_closed()
        self.log.close()

    def wait_closed(self):
        """Its serving half is ended by the kernel after the other one, and listens until then. And a process that ends
        has no memory any more some time before its sockets are closed."""
        patience.wait_for("its end to close its port", self.refuses, within_s=5)

    def end(self):
        self.stop()
        self.daemon.stop()
        self.place.close()

    def said(self):
        return (self.folder / "odid-web.log").read_text(errors="replace")

    # --- its surroundings ---

    def write(self, path, text, mode=None):
        path = self.folder / path
        new = path.with_name(f".{path.name}.new")
        new.write_text(text, encoding="utf-8")
        new.chmod(0o644 if mode is None else mode)
        new.rename(path)

    def read(self, path):
        return (self.folder / path).read_text(encoding="utf-8")

    def update(self, state="idle", percent=None, seconds_left=None, sentence=""):
        """What the update's own services say is going on."""
        self.write("run/odid-appliance/update-state.json", json.dumps(
            {"state": state, "percent": percent, "seconds_left": seconds_left, "sentence": sentence}))

    def last_update(self, outcome, sentence, version="1.5.0", at="2026-11-21T10:12:13Z"):
        self.write("data/odid/update.json", json.dumps(
            {"time": at, "from": "1.4.0", "to": version, "outcome": outcome, "sentence": sentence}))

    def status(self, **changes):
        """Changes what the daemon says: channels__bt4__state="lost"."""
        status = copy.deepcopy(self.daemon.status)
        for path, value in changes.items():
            place = status
            *way, name = path.split("__")
            for step in way:
                place = place[step]
            place[name] = value
        self.daemon.status = status
        self.keep()

    def keep(self):
        """As the daemon does: armed or not, when it is known."""
        armed = self.daemon.status["aircraft"]["armed"]
        if armed is not None:
            self.write("run/odid/kept", f"vehicle 1\narmed {'yes' if armed else 'no'}\narmed-once no\n")

    # --- asking without a browser ---

    @property
    def url(self):
        return f"http://127.0.0.1:{self.port}/"

    def ask(self, method, path, body=None, headers=None, page=True, cookie=None):
        """Returns the code, what came back and the header fields; None for a header leaves it out."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=patience.LIMIT_S)
        sent = {"X-Odid-Page": "1"} if page else {}
        if cookie:
            sent["Cookie"] = cookie
        sent |= headers or {}
        if isinstance(body, dict):
            body = json.dumps(body).encode()
        try:
            connection.putrequest(method, path, skip_host="Host" in sent)
            for name, value in sent.items():
                if value is not None:
                    connection.putheader(name, value)
            if body is not None:
                connection.putheader("Content-Length", str(len(body)))
            connection.endheaders(body)
            answer = connection.getresponse()
            text = answer.read()
        finally:
            connection.close()
        is_json = answer.getheader("Content-Type") == "application/json"
        return answer.status, json.loads(text) if is_json else text, answer.headers

    def login(self):
        """Returns the session's cookie."""
        code, said, headers = self.ask("POST", "/api/session", {"password": PASSWORD})
        assert code == 200, said
        return headers["Set-Cookie"].split(";")[0]
