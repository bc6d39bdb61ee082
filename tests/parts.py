"""The parts of the bench on this machine, each a process: started, spoken to, ended by its id."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
from pathlib import Path

import patience
from models import realtime
from models.air import Air
from models.controller import Rootcanal

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
# DAEMON=: another one than `make daemon` has built (tests/mutants).
DAEMON = Path(os.environ.get("DAEMON") or ROOT / "build/daemon/odid-daemon")
CONTROL = ROOT / "build/daemon/odidctl"
IFACE = "wlan0"

# What the field uses (REMOTE ID of a real society), with an identity that is valid.
IDENTITY = {
    "basic_id": {"uas_id": "SSRS5GBG01", "id_type": "serial", "ua_type": "auto"},
    "operator": {"operator_id": "SWE3jxza7qbzvu5d"},
    "self_id": {"description": "Sea rescue surveillance"},
    "system": {"category": "open", "class": "C2"},
}


def test_data():
    """Where recorded flights and captures are; never part of the project."""
    return Path(os.environ.get("TEST_DATA") or ROOT.parent / "shared/data")


def config_text(sections):
    """odid.conf of {section: {key: value}}."""
    return "".join(f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items())
                   for name, keys in sections.items())


def recorded_flight():
    """A real autopilot's, with gaps; where it isn't there, a path to nothing."""
    return test_data() / "arduplane-vtol-sitl.tlog"


def memory():
    """Where files are in memory; None where nothing is. On a disk that is being synced the models, which
    write as they go, would wait for it for seconds, and it is they that would be measured."""
    return Path("/dev/shm") if Path("/dev/shm").is_dir() else None


def environment():
    return {**os.environ, "PYTHONPATH": str(ROOT / "tests")}


class Part:
    """A process with a log; orders go to its standard input."""

    def __init__(self, arguments, log_path, orders=False, raised=False, env=None):
        self.log_path = Path(log_path)
        self._log = open(log_path, "ab")
        words = [str(word) for word in arguments]
        self.process = subprocess.Popen(
            realtime.command(words) if raised else words, stdin=subprocess.PIPE if orders else subprocess.DEVNULL,
            stdout=subprocess.PIPE if orders else self._log, stderr=self._log,
            env=env or environment(), text=orders, cwd=ROOT)

    def order(self, line):
        """Gives an order to a part that answers each with a line."""
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()

    def log(self):
        return self.log_path.read_text(errors="replace")

    def wait(self, seconds):
        """Its exit code; it needs so long, and may take what patience allows beside that."""
        return self.process.wait(seconds + patience.LIMIT_S)

    def stop(self, how=signal.SIGTERM):
        if self.process.poll() is None:
            self.process.send_signal(how)
            try:
                self.process.wait(patience.LIMIT_S)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        if self.process.stdin:
            self.process.stdin.close()
            self.process.stdout.close()
        self._log.close()
        return self.process.returncode


def python(module, *arguments):
    return [sys.executable, "-m", module, *arguments]


class Bench:
    """Controller model, hostapd model and daemon around one folder; used by demo, bench and tests."""

    def __init__(self, folder, mode="full", settings=None, hostapd=True):
        if not DAEMON.exists():
            raise FileNotFoundError(f"{DAEMON} isn't built: make daemon")
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.mode, self.settings = mode, settings or {}
        self.parts = []
        self.daemon = self.hostapd = self._air = None
        self.set_log, self.pcap = self.folder / "set.jsonl", self.folder / "beacons.pcap"
        for stale in self.folder.glob("*.log"):
            stale.unlink()
        for stale in (self.set_log, self.pcap, self.folder / "played.jsonl"):
            stale.unlink(missing_ok=True)
        shutil.rmtree(self.folder / "run", ignore_errors=True)  # another flight's take-off point is in it
        (self.folder / "run").mkdir()
        self.rootcanal = Rootcanal(self.folder / "rootcanal.log")
        try:
            self.front = self.add(Part(
                python("models.front", "--pty", self.folder / "bt", "--hci-port",
                       self.rootcanal.hci_port, "--mode", mode, "--set-log", self.set_log),
                self.folder / "front.log", orders=True, raised=True))
            if self.front.process.stdout.readline().strip() != "done":
                raise RuntimeError(f"the controller model didn't start: {self.front.log()}")
            if hostapd:
                self.start_hostapd()
        except BaseException:
            self.stop()
            raise

    def add(self, part):
        self.parts.append(part)
        return part

    def start_hostapd(self):
        control = self.folder / "hostapd" / IFACE
        control.unlink(missing_ok=True)
        self.hostapd = self.add(Part(
            python("models.hostapd", "--dir", self.folder / "hostapd", "--iface", IFACE,
                   "--pcap", self.pcap), self.folder / "hostapd.log", orders=True, raised=True))
        patience.wait_for("hostapd's socket", control.exists, part=self.hostapd)

    def write_config(self):
        sections = {name: dict(keys) for name, keys in IDENTITY.items()}
        sections["mavlink"] = {"source": "udp", "udp_port": self.udp_port}
        sections["broadcast"] = {"bt_adapter": f"h4:{self.folder / 'bt'}", "wifi_iface": IFACE,
                                 "hostapd_dir": self.folder / "hostapd"}
        sections["daemon"] = {"run_dir": self.folder / "run/odid", "user": "root"}
        for name, keys in self.settings.items():
            sections.setdefault(name, {}).update(keys)
        path = self.folder / "odid.conf"
        path.write_text(config_text(sections))
        return path

    def start_daemon(self, *flags, realtime=True):
        """realtime=False: as in a container that isn't granted real-time priority."""
        refused = [] if realtime else ["setpriv", "--bounding-set=-sys_nice", "--inh-caps=-sys_nice"]
        self.udp_port = getattr(self, "udp_port", None) or free_udp_port()
        self.daemon = self.add(Part([*refused, DAEMON, "-config", self.write_config(), *flags],
                                     self.folder / "daemon.log"))
        return self.daemon

    @property
    def air(self):
        """Listens from the first time it is asked for."""
        if self._air is None:
            self._air = Air(self.rootcanal.hci_port, self.pcap if self.hostapd else None)
        return self._air

    def status(self):
        """The daemon's own view, None when it doesn't answer."""
        result = subprocess.run([CONTROL, "-root", self.folder, "status", "--json"],
                                capture_output=True, text=True, timeout=patience.LIMIT_S)
        return json.loads(result.stdout) if result.stdout else None

    def wait_on_air(self, channels=("bt4", "bt5", "wifi"), within_s=None):
        def on_air():
            status = self.status()
            return status is not None and all(status["channels"][one]["state"] == "on air" for one in channels)
        patience.wait_for(f"{', '.join(channels) or 'the daemon'} on air", on_air, within_s, self.daemon)

    def play(self, flight, to=None, seconds=None, start=0):
        arguments = [flight, "--to", to or f"udp:127.0.0.1:{self.udp_port}", "--start", start,
                     "--played", self.folder / "played.jsonl",
                     "--answers", self.folder / "answers.jsonl"]
        if seconds:
            arguments += ["--seconds", seconds]
        return self.add(Part(python("models.player", *arguments), self.folder / "player.log", orders=True,
                              raised=True))

    def judge(self, seconds, *arguments, quiet=True, out=None, show=False):
        """Starts the judge; seconds None: until it is told to stop. Its report goes to out (default: the folder)."""
        words = python("judge", "--hci", f"tcp-client:127.0.0.1:{self.rootcanal.hci_port}",
                       "--set-log", self.set_log, "--out", out or self.folder, *arguments)
        if seconds is not None:
            words += ["--seconds", seconds]
        if self.hostapd:
            words += ["--pcap", self.pcap, "--follow"]
        if quiet:
            words.append("--quiet")
        if show:
            return subprocess.Popen([str(word) for word in words], env=environment(), cwd=ROOT)
        return self.add(Part(words, Path(f"{out or self.folder / 'judge'}.log")))

    def stop(self):
        for part in reversed(self.parts):
            part.stop()
        if self._air:
            self._air.stop()
        self.rootcanal.stop()


def free_udp_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]
