"""A model of a hawkBit server's device API ("DDI"), for one device: what it offers, and what it is told.

Paths, fields and values are those of the API's published description (https://eclipse.dev/hawkbit/rest-api/ddi/).
What the device sends is held against it; what doesn't fit is an entry in `violations`.
"""

import hashlib
import http.server
import json
import re
import threading
from pathlib import Path

EXECUTIONS = {"closed", "proceeding", "canceled", "scheduled", "rejected", "resumed", "downloaded", "download"}
FINISHED = {"success", "failure", "none"}
GUEST_SEES = "10.0.2.2"
JSON = "application/hal+json"


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
    details = status.get("details", [])
    if not isinstance(details, list) or not all(isinstance(line, str) and len(line) <= 512 for line in details):
        wrong.append(f"details {details!r}")
    return wrong


class HawkBit:
    """One action at a time, for the device `name` of `tenant`, which shows `token`."""

    def __init__(self, name, tenant="DEFAULT", token="a-test-token", poll_s=3):
        self.name, self.tenant, self.token, self.poll_s = name, tenant, token, poll_s
        self.action = self.bundle = self.version = None
        self.polls, self.bytes_in, self.bytes_out = 0, 0, 0
        self.attributes, self.feedback, self.violations, self.refused = {}, [], [], 0
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def _go(self):
                length = int(self.headers.get("Content-Length") or 0)
                body = self.rfile.read(length) if length else b""
                outer.bytes_in += length + len(str(self.headers)) + len(self.requestline)
                outer.answer(self, self.command, self.path.split("?")[0], body)

            do_GET = do_POST = do_PUT = _go     # noqa: N815, the library's names

            def give(self, code, data=b"", kind=JSON):
                self.send_response(code)
                self.send_header("Content-Type", kind)
                self.send_header("Content-Length", str(len(data)))
                self.end_headers()
                self.wfile.write(data)
                outer.bytes_out += len(data) + 150

            def log_message(self, *_):
                pass

        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self._server.daemon_threads = True
        threading.Thread(target=self._server.serve_forever, daemon=True).start()
        self.url = f"http://{GUEST_SEES}:{self._server.server_address[1]}"
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
        if method == "GET" and rest == f"/softwaremodules/1/artifacts/{self.bundle and self.bundle.name}":
            return request.give(200, self.bundle.read_bytes(), "application/octet-stream")
        self.violations.append(f"{method} {path}")
        return request.give(404)

    def _root(self):
        hours, rest = divmod(self.poll_s, 3600)
        links = {}
        if not self.attributes:
            links["configData"] = {"href": f"{self.url}{self.base}/configData"}
        if self.action and self.outcome(self.action) is None:
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

    def _take_attributes(self, request, body):
        got = json.loads(body)
        if not isinstance(got.get("data"), dict) or got.get("mode", "merge") not in ("merge", "replace", "remove"):
            self.violations.append(f"configData {got}")
        self.attributes = got.get("data", {})
        request.give(200)

    def _take_feedback(self, request, body):
        got = json.loads(body)
        self.violations += [f"feedback: {wrong}" for wrong in check_feedback(got)]
        self.feedback.append((self.action, got))
        request.give(200)
