"""A model of a hawkBit server's device API ("DDI"), for one device: what it offers, and what it is told.

Paths, fields and values are those of the API's published description (https://eclipse.dev/hawkbit/rest-api/ddi/,
and the classes DdiStatus, DdiResult, DdiDeployment, DdiArtifact, DdiConfigData that it is generated from).
What the device sends is held against it; what doesn't fit is an entry in `violations`.
"""

import contextlib
import hashlib
import http.server
import json
import re
import ssl
import threading
import time
from pathlib import Path

EXECUTIONS = {"closed", "proceeding", "canceled", "scheduled", "rejected", "resumed", "downloaded", "download"}
FINISHED = {"success", "failure", "none"}
GUEST_SEES = "10.0.2.2"
# hawkBit's own least interval, unless it is set otherwise. SWUpdate asks at this interval in the middle of a
# download, too, and reads one piece of it between two answers when these take longer than the interval.
OFFERED_POLL_S = 30
JSON = "application/hal+json"


def is_integer(value):
    return isinstance(value, int) and not isinstance(value, bool)


def check_feedback(body):
    """What in a feedback isn't as the API says; an empty list when all is well."""
    wrong = []
    status = body.get("status")
    if not isinstance(status, dict):
        return ["no status"]
    if status.get("execution") not in EXECUTIONS:
        wrong.append(f"execution {status.get('execution')!r}")
    result = status.get("result")
    if not isinstance(result, dict) or result.get("finished") not in FINISHED:
        wrong.append(f"result {result!r}")
    elif not all(is_integer(value) for value in result.get("progress", {}).values()):
        wrong.append(f"progress {result['progress']!r}")
    if not is_integer(status.get("code", 0)):
        wrong.append(f"code {status['code']!r}")
    details = status.get("details", [])
    if not isinstance(details, list) or not all(isinstance(line, str) for line in details):
        wrong.append(f"details {details!r}")
    return wrong


def check_attributes(body):
    """The same of a device's attributes."""
    data = body.get("data")
    wrong = []
    if not isinstance(data, dict) or not data or not all(isinstance(value, str) for value in data.values()):
        wrong.append(f"data {data!r}")
    if body.get("mode", "merge") not in ("merge", "replace", "remove"):
        wrong.append(f"mode {body['mode']!r}")
    return wrong


class HawkBit:
    """One action at a time, for the device `name` of `tenant`, which shows `token`.

    tls: (certificate, key), files; default: without TLS."""

    def __init__(self, name, tenant="DEFAULT", token="a-test-token", poll_s=3, tls=None):
        self.name, self.tenant, self.token, self.poll_s = name, tenant, token, poll_s
        self.action = self.bundle = self.version = None
        self.polls = self.octets = 0        # octets: of both directions, above TCP and TLS
        self.attributes, self.feedback, self.violations, self.refused = {}, [], [], 0
        self.break_at, self.resumed_at = None, []       # octets of a bundle
        self.pause_s = self.downloads = 0               # before a bundle comes, as over LTE; how often one was asked for
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
                self.close_connection = self.close_connection or lost > 0
                with contextlib.suppress(OSError):      # it had enough
                    self.wfile.write(data[:len(data) - lost])

            def log_message(self, *_):
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        if tls:
            context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
            context.load_cert_chain(*tls)
            # Not while it accepts: one device that doesn't go on must not keep the others waiting.
            self._server.socket = context.wrap_socket(self._server.socket, server_side=True,
                                                      do_handshake_on_connect=False)
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.url = f"{'https' if tls else 'http'}://{GUEST_SEES}:{self._server.server_address[1]}"
        self.base = f"/{tenant}/controller/v1/{name}"

    def stop(self):
        self._server.shutdown()
        self._server.server_close()

    def offer(self, action, bundle, version):
        self.bundle, self.version = Path(bundle), version
        self.action = str(action)

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
        if not path.startswith(self.base):
            return request.give(404)
        rest = path.removeprefix(self.base)
        if method == "GET" and rest == "":
            self.polls += 1
            return request.give(200, json.dumps(self._root()).encode())
        if method == "PUT" and rest == "/configData":
            return self._take_attributes(request, body)
        match = re.fullmatch(r"/deploymentBase/(\w+)(/feedback)?", rest)
        if match and match[1] == self.action:
            if method == "GET" and not match[2]:
                return request.give(200, json.dumps(self._deployment()).encode())
            if method == "POST" and match[2]:
                return self._take_feedback(request, body)
        if method in ("GET", "HEAD") and rest == f"/softwaremodules/1/artifacts/{self.bundle and self.bundle.name}":
            return self._give_bundle(request)
        self.violations.append(f"{method} {path}")
        return request.give(404)

    def _root(self):
        offered = self.action and self.outcome(self.action) is None
        hours, rest = divmod(OFFERED_POLL_S if offered else self.poll_s, 3600)
        links = {}
        if not self.attributes:
            links["configData"] = {"href": f"{self.url}{self.base}/configData"}
        if offered:
            links["deploymentBase"] = {"href": f"{self.url}{self.base}/deploymentBase/{self.action}?c=1"}
        return {"config": {"polling": {"sleep": f"{hours:02}:{rest // 60:02}:{rest % 60:02}"}}, "_links": links}

    def _deployment(self):
        data = self.bundle.read_bytes()
        href = f"{self.url}{self.base}/softwaremodules/1/artifacts/{self.bundle.name}"
        return {"id": self.action, "deployment": {"download": "forced", "update": "forced", "chunks": [{
            "part": "os", "version": self.version, "name": "odid", "artifacts": [{
                "filename": self.bundle.name, "size": len(data),
                "hashes": {"sha1": hashlib.sha1(data).hexdigest(), "md5": hashlib.md5(data).hexdigest(),
                           "sha256": hashlib.sha256(data).hexdigest()},
                "_links": {"download-http": {"href": href}, "md5sum-http": {"href": f"{href}.MD5SUM"}}}]}]}}

    def _give_bundle(self, request):
        """All of it; or the rest, for a device whose connection broke."""
        self.downloads += 1
        time.sleep(self.pause_s)
        data, kind = self.bundle.read_bytes(), "application/octet-stream"
        part = re.fullmatch(r"bytes=(\d+)-", request.headers.get("Range", ""))
        if part:
            start = int(part[1])
            self.resumed_at.append(start)
            request.give(206, data[start:], kind, Content_Range=f"bytes {start}-{len(data) - 1}/{len(data)}")
        else:
            request.give(200, data, kind, lost=len(data) - self.break_at if self.break_at else 0)

    def _take_attributes(self, request, body):
        got = json.loads(body)
        self.violations += [f"configData: {wrong}" for wrong in check_attributes(got)]
        self.attributes = got.get("data", {})
        request.give(200)

    def _take_feedback(self, request, body):
        if self.outcome(self.action) is not None:
            self.violations.append(f"feedback to action {self.action}, which is closed")
            request.give(410)
            return
        got = json.loads(body)
        self.violations += [f"feedback: {wrong}" for wrong in check_feedback(got)]
        self.feedback.append((self.action, got))
        request.give(200)
