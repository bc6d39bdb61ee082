"""A model of a hawkBit server's device API ("DDI"), for one device: what it offers, and what it is told.

What the device sends, and what it is answered, is held against ddi.json, and that against hawkBit's own description of
the API (ddi.py). What doesn't fit is an entry in `violations`.
"""

import contextlib
import hashlib
import http.server
import json
import re
import time
from pathlib import Path

from . import ddi
from .appliance import wait_for
from .server import paced, serve

# hawkBit's own least interval, unless it is set otherwise. SWUpdate asks at this interval in the middle of a
# download, too, and reads one piece of it between two answers when these take longer than the interval.
OFFERED_POLL_S = 30
JSON = "application/hal+json"
MODULE = "1"


def poll_octets(machine, server, polls=4):
    """What a poll costs on the line, in both directions, as the machine's network card counts it."""
    def so_far():
        return sum(int(line) for line in machine.must(
            "cat /sys/class/net/eth0/statistics/rx_bytes /sys/class/net/eth0/statistics/tx_bytes").split())
    begun = server.polls
    wait_for("a poll", lambda: server.polls > begun)
    time.sleep(1)       # until it is over, and the next one hasn't begun
    octets, begun = so_far(), server.polls
    wait_for("polls", lambda: server.polls >= begun + polls)
    time.sleep(1)
    return (so_far() - octets) // (server.polls - begun)


class HawkBit:
    """One action at a time, for the device `name` of `tenant`, which shows `token`.

    tls: (certificate, key), files; default: without TLS."""

    def __init__(self, name, tenant="DEFAULT", token="a-test-token", poll_s=3, tls=None):
        self.name, self.tenant, self.token, self.poll_s = name, tenant, token, poll_s
        self.action = self.bundle = self.version = None
        self.download = self.update = "forced"          # or "attempt"; "skip": not now
        self.window = None                              # of maintenance: "available", "unavailable"; None: it has none
        self.cancelling, self.cancelled = False, []     # the action is to be called off; what was said to that
        self.polls = self.octets = 0        # octets: of both directions, above TCP and TLS
        self.attributes, self.feedback, self.violations, self.refused = {}, [], [], 0
        self.break_at, self.resumed_at = None, []       # octets of a bundle
        self.breaks_for_good = False                    # nothing comes of what is asked for then
        self.pause_s = self.downloads = 0               # before a bundle comes, as over LTE; how often one was asked for
        self.rate = None                                # octets a second of a bundle
        self.closes = False                             # each connection, after one answer
        self.linked = None                              # another address than its own, where its links lead
        self._does = {"GET": self._root, "PUT configData": self._take_attributes,
                      "GET deploymentBase/{actionId}": self._deployment,
                      "POST deploymentBase/{actionId}/feedback": self._take_feedback,
                      "GET cancelAction/{actionId}": self._cancel,
                      "POST cancelAction/{actionId}/feedback": self._take_cancelled}
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def _go(self):
                length = int(self.headers.get("Content-Length") or 0)
                body = self.rfile.read(length) if length else b""
                outer.octets += length + len(str(self.headers)) + len(self.requestline)
                outer.answer(self, self.command, self.path.split("?")[0], body)

            do_GET = do_HEAD = do_POST = do_PUT = _go       # noqa: N815, the library's names

            def give(self, code, data=b"", kind=JSON, lost=0, **headers):
                """lost: so many octets of it don't come, and the connection ends."""
                self.send_response(code)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                for name, value in headers.items():
                    self.send_header(name.replace("_", "-"), value)
                outer.octets += sum(map(len, self._headers_buffer)) + len(data)
                self.end_headers()
                if self.command == "HEAD":
                    return
                self.close_connection = self.close_connection or lost > 0 or outer.closes
                with contextlib.suppress(OSError):      # it had enough
                    for piece in paced(data[:len(data) - lost], None if kind == JSON else outer.rate):
                        self.wfile.write(piece)

            def log_message(self, *_):
                pass

        self._server, self.url = serve(Handler, tls)
        self.base = f"/{tenant}/controller/v1/{name}"

    def stop(self):
        self._server.shutdown()
        self._server.server_close()

    def offer(self, action, bundle, version):
        self.bundle, self.version = Path(bundle), version
        self.action = str(action)

    def cancel(self):
        """Calls the action off, as somebody at the server does."""
        self.cancelling = True

    def executions(self, action=None):
        return [one["status"]["execution"] for at, one in self.feedback if action in (None, at)]

    def outcome(self, action):
        """"success" or "failure" when the device has closed the action, else None."""
        for at, one in self.feedback:
            if at == str(action) and one["status"]["execution"] == "closed":
                return one["status"]["result"]["finished"]
        return None

    # --- the API ---------------------------------------------------------------

    def answer(self, request, method, path, body):
        if request.headers.get("Authorization") != f"TargetToken {self.token}":
            self.refused += 1
            return request.give(401)
        name, about = None, []
        if path.startswith(self.base):
            name, about = ddi.operation("GET" if method == "HEAD" else method, path.removeprefix(self.base))
        if name is None or about[:1] not in ([], [self.action], [MODULE]):
            self.violations.append(f"{method} {path}: there is no such thing")
            return request.give(404)
        if name.endswith("{fileName}"):
            return self._give_bundle(request)
        its = ddi.OPERATIONS[name]
        if "takes" in its:
            about.append(json.loads(body))
            self.violations += ddi.wrong(its["takes"], about[-1])
        code, message = self._does[name](*about)
        if "gives" in its:
            self.violations += [f"ours: {line}" for line in ddi.wrong(its["gives"], message, exactly=True)]
        if code not in its["codes"]:
            self.violations.append(f"ours: {name} is never answered {code}")
        return request.give(code, json.dumps(message).encode() if message else b"")

    def _is_open(self):
        return self.action and self.outcome(self.action) is None and \
            "closed" not in (status["execution"] for status in self.cancelled)

    def _root(self):
        self.polls += 1
        offered = self._is_open()
        hours, rest = divmod(OFFERED_POLL_S if offered else self.poll_s, 3600)
        links = {}
        if not self.attributes:
            links["configData"] = {"href": f"{self.linked or self.url}{self.base}/configData"}
        if offered and self.cancelling:
            links["cancelAction"] = {"href": f"{self.linked or self.url}{self.base}/cancelAction/{self.action}"}
        elif offered:
            links["deploymentBase"] = {"href": f"{self.linked or self.url}{self.base}/deploymentBase/{self.action}?c=1"}
        return 200, {"config": {"polling": {"sleep": f"{hours:02}:{rest // 60:02}:{rest % 60:02}"}}, "_links": links}

    def _deployment(self, action):
        data = self.bundle.read_bytes()
        href = f"{self.linked or self.url}{self.base}/softwaremodules/{MODULE}/artifacts/{self.bundle.name}"
        when = {"download": self.download, "update": self.update} | ({"maintenanceWindow": self.window} if self.window else {})
        return 200, {"id": action, "deployment": when | {"chunks": [{
            "part": "os", "version": self.version, "name": "odid", "artifacts": [{
                "filename": self.bundle.name, "size": len(data),
                "hashes": {"sha1": hashlib.sha1(data).hexdigest(), "md5": hashlib.md5(data).hexdigest(),
                           "sha256": hashlib.sha256(data).hexdigest()},
                "_links": {"download-http": {"href": href}, "md5sum-http": {"href": f"{href}.MD5SUM"}}}]}]}}

    def _cancel(self, action):
        return 200, {"id": action, "cancelAction": {"stopId": action}}

    def _give_bundle(self, request):
        """All of it; or the rest, for a device whose connection broke."""
        self.downloads += 1
        time.sleep(self.pause_s)
        data, kind = self.bundle.read_bytes(), "application/octet-stream"
        part = re.fullmatch(r"bytes=(\d+)-", request.headers.get("Range", ""))
        if part:
            start = int(part[1])
            self.resumed_at.append(start)
            request.give(206, data[start:], kind, lost=len(data) - start if self.breaks_for_good else 0,
                         Content_Range=f"bytes {start}-{len(data) - 1}/{len(data)}")
        else:
            request.give(200, data, kind, lost=len(data) - self.break_at if self.break_at else 0)

    def _take_attributes(self, got):
        self.attributes = got.get("data", {})
        return 200, None

    def _take_feedback(self, action, got):
        if not self._is_open():
            self.violations.append(f"feedback to action {action}, which is closed")
            return 410, None
        self.feedback.append((action, got))
        return 200, None

    def _take_cancelled(self, _, got):
        self.cancelled.append(got["status"])
        if got["status"]["execution"] == "rejected":  # then it goes on
            self.cancelling = False
        return 200, None
