"""One flight in a simulated world: the programs, radios, hostapd and an autopilot around them, and the judge behind."""

import hashlib
import itertools
import json
import math
import os
import subprocess

import parts
from judge.conformance import Options, judge
from judge.flight_log import read_flight_log
from judge.set_log import add_payload

from .air import Air
from .autopilot import Autopilot
from .controller import Controller
from .faults import Window
from .hostapd import Hostapd
from .rfkill import BLUETOOTH as RFKILL_BLUETOOTH
from .rfkill import WIFI as RFKILL_WIFI
from .rfkill import Switches
from .technician import Technician
from .world import START_US, Device, Port, World

BLUETOOTH, SERIAL, PORT = "/dev/bluetooth", "/dev/autopilot", 14550
PORTS = itertools.count()
SERVICES = ("odid-keeper", "odid-recorder", "odid-clock")
FIRST_ASKED_US = 1_037_000
BINDING_US, BIND_PAUSE_US, BIND_PAUSE_MAX_US = 500_000, 10_000_000, 60_000_000  # driver-watch's
WARM_UP_S = 5.0  # until all is on the air, and a position has come


class Flight:
    """link: "serial", or "udp" as behind mavlink-router. kept: as on the appliance, with odid-keeper, odid-recorder and
    odid-clock; else odid-daemon by itself."""

    def __init__(self, folder, flight, seed=1, mode="full", loss=0.0, late=(0.0, 0), kept=False, link="serial"):
        self.folder, self.link = folder, link
        self.world = World(folder, seed, late)
        self.air = Air(self.world, loss)
        self.controller = Controller(self.world, self.air, BLUETOOTH, mode)
        self.hostapd = Hostapd(self.world, self.air, self.world.root / "hostapd")
        self.switches = Switches(self.world, "/dev/rfkill", {
            RFKILL_WIFI: (lambda: self.hostapd.order("disabled"), lambda: self.hostapd.order("enabled")),
            RFKILL_BLUETOOTH: (self.unplug_controller, self.plug_in_controller)})
        self.autopilot = Autopilot(self.world, self._connect, flight, folder / "played.jsonl")
        self.channels = ("bt4", "bt5", "wifi") if mode == "full" else ("bt4", "wifi")
        self.kept, self.windows = kept, []  # windows: what was done to it
        self.daemon_words = ()  # beside its configuration, where a keeper starts it
        self._config = self._write_config()
        self.technician = Technician(self.world, self.world.root / "run/odid/status.sock", START_US + FIRST_ASKED_US, self._bind_anew)
        self.plugged_in, self._binding, self._bind_from_us, self._bind_pause_us = True, False, 0, BIND_PAUSE_US
        self.costs_at_first = None  # the daemon's: process, descriptors, KiB
        self.at(2 * WARM_UP_S, self._look_at_costs)
        if kept:
            for name in SERVICES:
                self.serve(name)
        else:
            self._start("odid-daemon", "-config", self._config)

    def _connect(self, on_octets):
        if self.link == "serial":
            return Device(self.world, SERIAL, on_octets)
        # An address of this process' own: others simulate, too.
        pid = os.getpid()
        self.port = f"127.{pid >> 16 & 255}.{pid >> 8 & 255}.{pid & 255}", PORT + next(PORTS)
        return Port(self.world, self.port, on_octets)

    def _write_config(self):
        sections = parts.IDENTITY | {
            "mavlink": {"source": "serial", "device": SERIAL} if self.link == "serial" else
            {"source": "udp", "udp_address": self.port[0], "udp_port": self.port[1]},
            "broadcast": {"bt_adapter": f"h4:{BLUETOOTH}", "wifi_iface": "wlan0", "hostapd_dir": self.world.root / "hostapd"},
            "daemon": {"run_dir": self.world.root / "run/odid", "user": "root"}}
        path = self.world.root / "odid.conf"
        path.write_text(parts.config_text(sections))
        return path

    # --- programs --------------------------------------------------------------------

    def _start(self, name, *words):
        return self.world.start([parts.DAEMON.with_name(name), *words], self.folder / f"{name}.log")

    def serve(self, name):
        """A service, as the supervisor starts it."""
        root = self.world.root
        if name == "odid-keeper":
            self._start(name, "-faults", root / "run/faults", "--", parts.DAEMON, "-config", self._config, *self.daemon_words)
        else:
            self._start(name, "-root", root)

    def unplug_controller(self):
        if not self._binding:
            self.controller.device.unplug()
        self.plugged_in = self._binding = False

    def plug_in_controller(self):
        self.controller.power_on()
        self.controller.device.plug_in()
        self.plugged_in = True

    def _bind_anew(self, answer):
        """The controller's driver, as the service driver-watch does where the daemon says that it is stuck."""
        channels = [answer["channels"][name] for name in ("bt4", "bt5")]
        if any(one["state"] == "on air" for one in channels):
            self._bind_pause_us = BIND_PAUSE_US
        elif not self.plugged_in:
            self._bind_from_us = self.world.now_us + BIND_PAUSE_US
        elif not self._binding and any(one["stuck"] for one in channels) and self.world.now_us >= self._bind_from_us:
            self._bind_from_us = self.world.now_us + self._bind_pause_us
            self._bind_pause_us = min(2 * self._bind_pause_us, BIND_PAUSE_MAX_US)
            self.controller.device.unplug()
            self._binding = True
            self.world.after(BINDING_US, self._bind)

    def _bind(self):
        if self._binding:  # it is still there to be bound
            self._binding = False
            self.plug_in_controller()

    def kill_service(self, name, again_s=1.0):
        """And the supervisor starts it again."""
        self.world.kill(self.world.called(name))
        self.world.after(round(again_s * 1e6), self.serve, name)

    def _look_at_costs(self):
        daemon = self.world.called("odid-daemon")
        if daemon:
            self.costs_at_first = daemon.pid, daemon.descriptors(), daemon.memory_kib()

    def record(self):
        """The newest flight record, as odidctl tells it."""
        said = subprocess.run([parts.CONTROL, "-root", self.world.root, "flights", "1", "--json"], capture_output=True, text=True,
                              check=True)
        return json.loads(said.stdout)

    # --- what happens ----------------------------------------------------------------

    def at(self, second, call, *arguments):
        """Of the flight."""
        self.world.at(START_US + round(second * 1e6), call, *arguments)

    def harm(self, fault, at_s, seconds=0.0):
        """Does a fault, for so long where it is one that lasts."""
        back_s = at_s + (min(seconds, fault.longest_s) if fault.end else 0.0)
        self.at(at_s, fault.begin, self)
        if fault.end:
            self.at(at_s + seconds, fault.end, self)
        self.windows += [Window(channel, at_s, back_s, fault) for channel in fault.channels or [None] * fault.told]

    def fly(self, until_s):
        """To that second of the flight."""
        self.world.run(START_US + round(until_s * 1e6))

    def judged(self):
        """What the judge says of all that was heard since everything was on the air."""
        self.autopilot.played.flush()
        run = self.air.run()
        run.start_mono += WARM_UP_S
        run.receptions = [one for one in run.receptions if one.mono >= run.start_mono]
        return judge(run, Options(expect_channels=self.channels, listed=math.inf), read_flight_log(self.folder / "played.jsonl"), self._set_log())

    def octets(self):
        """A hash of all that was heard, and when: the same on each machine."""
        heard = hashlib.sha256()
        for one in self.air.run().receptions:
            heard.update(f"{one.mono:.6f} {one.channel} {one.address} {one.raw.hex()}\n".encode())
        return heard.hexdigest()

    def _set_log(self):
        log = {}
        for mono, channel, data in self.controller.set_log:
            add_payload(log, channel, mono, data)
        return log

    def end(self):
        self.world.end()
        self.autopilot.close()
