"""Starts rootcanal, Google's virtual Bluetooth controller (a model of the air and the chip).

Every TCP client of its HCI port is a controller of its own, H4 framed, all on one air: the daemon's
is one of them, the judge's scanner another.
"""

import os
import socket
import subprocess
from pathlib import Path

import patience
import rootcanal.binaries

from . import realtime

STARTED_S = patience.LIMIT_S / 3  # of five tries


def free_ports(count):
    sockets = [socket.socket() for _ in range(count)]
    try:
        for one in sockets:
            one.bind(("127.0.0.1", 0))
        return [one.getsockname()[1] for one in sockets]
    finally:
        for one in sockets:
            one.close()


def is_listening(port):
    """Whether anybody listens there, without connecting: a connection would be a controller."""
    wanted = f"0100007F:{port:04X}", f"00000000:{port:04X}"
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        fields = line.split()
        if fields[1] in wanted and fields[3] == "0A":
            return True
    return False


class Rootcanal:
    """A running rootcanal; hci_port is where controllers are had."""

    def __init__(self, log_path):
        self.log_path, tries = Path(log_path), 5
        # A port that was free a moment ago may be somebody's by the time that it is asked for: it ends then, or goes on without.
        while not self._started():
            tries -= 1
            if not tries:
                raise RuntimeError(f"rootcanal doesn't listen on port {self.hci_port}: see {log_path}")

    def _started(self):
        program = Path(rootcanal.binaries.get_package_binary_resource_path("rootcanal"))
        ports = free_ports(4)
        self.hci_port, link, link_ble, test = ports
        self._log = open(self.log_path, "wb")
        self.process = subprocess.Popen(
            realtime.command([program, f"-hci_port={self.hci_port}", f"-link_port={link}",
                              f"-link_ble_port={link_ble}", f"-test_port={test}"]),
            env={**os.environ, "LD_LIBRARY_PATH": str(program.parent)},
            cwd=self.log_path.parent, stdin=subprocess.DEVNULL, stdout=self._log,
            stderr=subprocess.STDOUT)
        try:
            patience.wait_for(f"rootcanal on ports {ports}; its log: {self.log_path}",
                              lambda: self.process.poll() is not None or all(map(is_listening, ports)),
                              every_s=0.05, limit_s=STARTED_S)
        except TimeoutError:  # it goes on without the port that it didn't get
            self.process.kill()
            self.process.wait()
        if self.process.poll() is None:
            return True
        self._log.close()
        return False

    def stop(self):
        self.process.terminate()
        self.process.wait()
        self._log.close()
