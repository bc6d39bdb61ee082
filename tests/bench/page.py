"""The page of an appliance that is booted, as a program on this machine sees it."""

import http.client
import json

import patience
from models.controller import free_ports


class Page:
    """The page from outside, by Ethernet; or by whatever answers at that port in the machine."""

    def __init__(self, machine, port=80):
        (self.port,) = free_ports(1)
        self.cookie = ""
        machine.qmp.command("human-monitor-command",
                            **{"command-line": f"hostfwd_add net tcp:127.0.0.1:{self.port}-:{port}"})

    def connect(self, timeout_s=patience.LIMIT_S):
        return http.client.HTTPConnection("127.0.0.1", self.port, timeout=timeout_s)

    def ask(self, method, path, body=None, timeout_s=patience.LIMIT_S, connection=None):
        """The code and what came back; None when nothing answers."""
        connection = connection or self.connect(timeout_s)
        try:
            connection.request(method, path, json.dumps(body) if body is not None else None,
                               {"X-Odid-Page": "1", "Cookie": self.cookie})
            answer = connection.getresponse()
            text = answer.read()
        except (OSError, http.client.HTTPException):
            return None, None
        if "Set-Cookie" in answer.headers:
            self.cookie = answer.headers["Set-Cookie"].split(";")[0]
        return answer.status, json.loads(text) if path.startswith("/api") else text


def send(page, data):
    connection = page.connect(patience.BOOTED_S)
    connection.request("POST", "/api/update", data, {"X-Odid-Page": "1", "Cookie": page.cookie})
    answer = connection.getresponse()
    return answer.status, json.loads(answer.read())


def listening(machine):
    """TCP ports that anything in the machine listens on: a scan that misses none."""
    lines = machine.must("netstat -ltn | grep LISTEN; true").splitlines()
    return {int(line.split()[3].rsplit(":", 1)[1]) for line in lines}
