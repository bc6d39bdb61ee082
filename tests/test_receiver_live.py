"""The scanner against a controller model: real HCI, real time, no radio."""

import json
import os
import socket
import struct
import subprocess
import sys
import time
from pathlib import Path

import pytest

import receiver_synthetic as air

TESTS = Path(__file__).parent


def free_ports(count):
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [s.getsockname()[1] for s in sockets]
    for s in sockets:
        s.close()
    return ports


class Controller:
    """One H4 connection to the model."""

    def __init__(self, port):
        deadline = time.monotonic() + 10
        while True:
            try:
                self.socket = socket.create_connection(("127.0.0.1", port))
                break
            except OSError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.socket.settimeout(5)

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
    binaries = pytest.importorskip("rootcanal.binaries", reason="rootcanal, the controller model, isn't installed")
    pytest.importorskip("bumble", reason="bumble isn't installed")
    hci, link, link_ble, test = free_ports(4)
    with open(tmp_path / "model.log", "wb") as log:
        process = subprocess.Popen(
            [str(binaries.get_package_binary_resource_path("rootcanal")), "-hci_port", str(hci), "-link_port",
             str(link), "-link_ble_port", str(link_ble), "-test_port", str(test)], stdout=log, stderr=log)
    yield process, hci
    process.kill()
    process.wait()


def test_a_lost_controller_is_an_error_and_no_verdict(model):
    process, port = model
    Controller(port).command(0x0C03)  # the model is up
    listener = subprocess.Popen([sys.executable, "-m", "receiver", "--hci", f"tcp-client:127.0.0.1:{port}", "--quiet"],
                                env={**os.environ, "PYTHONPATH": str(TESTS)}, stderr=subprocess.PIPE, text=True)
    time.sleep(2.0)
    assert listener.poll() is None
    process.kill()
    assert "connection to the controller is lost" in listener.communicate(timeout=20)[1]
    assert listener.returncode == 2


def test_legacy_and_long_range_from_a_controller(model, tmp_path):
    """Two advertising sets, eight payloads a second: every one is heard, in order."""
    seconds = 5.0
    _, port = model
    controller = Controller(port)
    controller.command(0x0C03)
    address = bytes.fromhex(air.ADDRESS.replace(":", ""))[::-1]
    for handle, properties, primary, secondary, interval in ((0, 0x10, 1, 1, 0x20), (1, 0, 3, 3, 0xA0)):
        controller.command(0x2036, struct.pack(
            "<BH3s3sBBB6sBbBBBBB", handle, properties, interval.to_bytes(3, "little"), interval.to_bytes(3, "little"),
            7, 1, 0, bytes(6), 0, 127, primary, 0, secondary, handle, 0))
        controller.command(0x2035, bytes((handle,)) + address)
    legacy, long_range = air.Transmitter(air.Faults()), air.Transmitter(air.Faults())
    log = tmp_path / "set.jsonl"
    judge = subprocess.Popen(
        [sys.executable, "-m", "receiver", "--hci", f"tcp-client:127.0.0.1:{port}", "--seconds", str(seconds),
         "--quiet", "--expect", "bt4,bt5", "--set-log", log, "--out", tmp_path / "out", "--address", air.ADDRESS],
        env={**os.environ, "PYTHONPATH": str(TESTS)}, stdout=subprocess.PIPE, text=True)
    start = time.monotonic()
    with open(log, "w", encoding="utf-8") as rows:
        for number, (t, name) in enumerate(air.slots(seconds + 20)):
            time.sleep(max(0.0, start + t - time.monotonic()))
            updates = [("bt4", 0, legacy.legacy(name, t))]
            if number % 2 == 0:
                body = long_range.pack_body(t)
                updates.append(("bt5", 1, air.service_data(long_range.counter("pack", body), body)))
            for channel, handle, data in updates:
                controller.command(0x2037, bytes((handle, 3, 1, len(data))) + data)
                rows.write(json.dumps({"mono": time.monotonic(), "opcode": 0x2037, "data": data.hex(),
                                       "channel": channel}) + "\n")
                rows.flush()
            if number == 0:
                controller.command(0x2039, bytes((1, 2, 0, 0, 0, 0, 1, 0, 0, 0)))
            if judge.poll() is not None:
                break
    text = judge.communicate(timeout=30)[0]
    assert judge.returncode == 0, text
    figures = json.loads((tmp_path / "out/figures.json").read_text())
    assert figures["bt4_payloads_set"] == figures["bt4_payloads_heard"] > 30
    assert figures["bt5_payloads_set"] == figures["bt5_payloads_heard"] > 15
    assert 0.08 < figures["bt5_location_reception_mean_s"] < 0.12
    assert figures["bt4_location_reception_p50_s"] < 0.04
    phys = {(row["channel"], row["phy"]) for row in map(json.loads, open(tmp_path / "out/receptions.jsonl"))}
    assert ("bt5", "Coded/Coded") in phys and {channel for channel, _ in phys} == {"bt4", "bt5"}
