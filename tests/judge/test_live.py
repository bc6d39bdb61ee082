"""The scanner against a controller model: real HCI, real time, no radio."""

import json
import os
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import patience
import pytest
from models.air import Air
from models.controller import Rootcanal

from . import synthetic as air

TESTS = Path(__file__).parent.parent


class Controller:
    """One H4 connection to the model."""

    def __init__(self, port):
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(patience.LIMIT_S)

    def receive(self, count):
        data = b""
        while len(data) < count:
            part = self.socket.recv(count - len(data))
            assert part, "the controller model closed the connection"
            data += part
        return data

    def command(self, opcode, parameters=b""):
        self.socket.sendall(struct.pack("<BHB", 1, opcode, len(parameters)) + parameters)
        while True:
            _, code, length = self.receive(3)
            event = self.receive(length)
            if code == 0x0E and struct.unpack_from("<H", event, 1)[0] == opcode:
                assert event[3] == 0, f"{opcode:#06x} answered {event[3]:#04x}"
                return


@pytest.fixture
def model(tmp_path):
    pytest.importorskip("rootcanal.binaries", reason="rootcanal, the controller model, isn't installed")
    pytest.importorskip("bumble", reason="bumble isn't installed")
    one = Rootcanal(tmp_path / "model.log")
    yield one
    one.stop()


def start_judge(model, tmp_path, *arguments):
    """Starts it, and waits until it listens. Its process, and what it says on standard error."""
    log = tmp_path / "judge.log"
    with open(log, "w") as said:
        judge = subprocess.Popen([sys.executable, "-m", "judge", "--hci", f"tcp-client:127.0.0.1:{model.hci_port}",
                                  "--quiet", *arguments], env={**os.environ, "PYTHONPATH": str(TESTS)},
                                 stdout=subprocess.PIPE, stderr=said, text=True)
    patience.wait_for("the judge to listen", lambda: "listening" in log.read_text())
    return judge, log


def test_a_lost_controller_is_an_error_and_no_verdict(model, tmp_path):
    judge, log = start_judge(model, tmp_path)
    model.process.kill()
    assert judge.wait(patience.LIMIT_S) == 2
    assert "connection to the controller is lost" in log.read_text()


SETS = ("bt4", 0, 0x10, 1, 1, 0x20), ("bt5", 1, 0, 3, 3, 0xA0)  # channel, handle, properties, PHYs, interval


class Advertiser:
    """Two advertising sets, one on each PHY; what it sets goes into the log."""

    def __init__(self, model, log):
        self.controller, self.log = Controller(model.hci_port), log
        self.legacy, self.long_range = air.Transmitter(air.Faults()), air.Transmitter(air.Faults())
        self.controller.command(0x0C03)
        address = bytes.fromhex(air.ADDRESS.replace(":", ""))[::-1]
        for _, handle, properties, primary, secondary, interval in SETS:
            self.controller.command(0x2036, struct.pack(
                "<BH3s3sBBB6sBbBBBBB", handle, properties, interval.to_bytes(3, "little"),
                interval.to_bytes(3, "little"), 7, 1, 0, bytes(6), 0, 127, primary, 0, secondary, handle, 0))
            self.controller.command(0x2035, bytes((handle,)) + address)

    def slot(self, number, name, t):
        """One slot's message on Bluetooth 4, and with every other one a pack on Bluetooth 5."""
        self.set("bt4", 0, self.legacy.legacy(name, t))
        if number % 2 == 0:
            body = self.long_range.pack_body(t)
            self.set("bt5", 1, air.service_data(self.long_range.counter("pack", body), body))
        if number == 0:
            self.controller.command(0x2039, bytes((1, 2, 0, 0, 0, 0, 1, 0, 0, 0)))

    def set(self, channel, handle, data):
        self.controller.command(0x2037, bytes((handle, 3, 1, len(data))) + data)
        with open(self.log, "a", encoding="utf-8") as rows:
            rows.write(json.dumps({"mono": time.monotonic(), "opcode": 0x2037, "data": data.hex(),
                                   "channel": channel}) + "\n")


def test_legacy_and_long_range_from_a_controller(model, tmp_path):
    """Both kinds are heard, decoded and told apart; each payload stays until it was heard."""
    advertiser, ear = Advertiser(model, tmp_path / "set.jsonl"), Air(model.hci_port)
    judge, _ = start_judge(model, tmp_path, "--expect", "bt4,bt5", "--without-time", "--out", tmp_path / "out",
                           "--address", air.ADDRESS)
    for number, (t, name) in zip(range(24), air.slots(60)):
        begun = time.monotonic()
        advertiser.slot(number, name, t)
        patience.wait_for("the payload", lambda: all(ear.receptions(channel, begun) for channel in ("bt4", "bt5")))
    ear.stop()
    judge.terminate()
    text = judge.communicate(timeout=patience.LIMIT_S)[0]
    assert judge.returncode == 0, text
    rows = [json.loads(line) for line in open(tmp_path / "out/receptions.jsonl")]
    phys = {(row["channel"], row["phy"]) for row in rows}
    assert ("bt5", "Coded/Coded") in phys and {channel for channel, _ in phys} == {"bt4", "bt5"}


@pytest.mark.timed
def test_eight_payloads_a_second_are_heard_in_order(model, tmp_path):
    log = tmp_path / "set.jsonl"
    advertiser = Advertiser(model, log)
    log.touch()
    judge, _ = start_judge(model, tmp_path, "--seconds", "5", "--expect", "bt4,bt5", "--set-log", log, "--out",
                           tmp_path / "out", "--address", air.ADDRESS)
    start = time.monotonic()
    for number, (t, name) in enumerate(air.slots(25)):
        time.sleep(max(0.0, start + t - time.monotonic()))
        advertiser.slot(number, name, t)
        if judge.poll() is not None:
            break
    text = judge.communicate(timeout=patience.LIMIT_S)[0]
    assert judge.returncode == 0, text
    figures = json.loads((tmp_path / "out/figures.json").read_text())
    assert figures["bt4_payloads_set"] == figures["bt4_payloads_heard"] > 30
    assert figures["bt5_payloads_set"] == figures["bt5_payloads_heard"] > 15
    assert 0.08 < figures["bt5_location_reception_mean_s"] < 0.12
    assert figures["bt4_location_reception_p50_s"] < 0.04
