"""One flight of odid-daemon in a simulated world: radios, hostapd and an autopilot around it, and the judge behind."""

from host import parts
from receiver.conformance import Options, judge
from receiver.flight_log import read_flight_log
from receiver.set_log import add_payload

from .air import Air
from .autopilot import Autopilot
from .controller import Controller
from .faults import Window
from .hostapd import Hostapd
from .world import START_US, World

BLUETOOTH, SERIAL = "/dev/bluetooth", "/dev/autopilot"
WARM_UP_S = 5.0  # until all is on the air, and a position has come


class Flight:
    def __init__(self, folder, flight, seed=1, mode="full", loss=0.0, late=(0.0, 0)):
        self.folder = folder
        self.world = World(folder, seed, late)
        self.air = Air(self.world, loss)
        self.controller = Controller(self.world, self.air, BLUETOOTH, mode)
        self.hostapd = Hostapd(self.world, self.air, self.world.root / "hostapd")
        self.autopilot = Autopilot(self.world, SERIAL, flight, folder / "played.jsonl")
        self.channels = ("bt4", "bt5", "wifi") if mode == "full" else ("bt4", "wifi")
        self.windows = []  # what was done to it
        self.world.start([parts.DAEMON, "-config", self._write_config()], folder / "daemon.log")

    def _write_config(self):
        (self.world.root / "run").mkdir()
        sections = parts.IDENTITY | {
            "mavlink": {"source": "serial", "device": SERIAL},
            "broadcast": {"bt_adapter": f"h4:{BLUETOOTH}", "wifi_iface": "wlan0", "hostapd_dir": self.world.root / "hostapd"},
            "daemon": {"run_dir": self.world.root / "run", "user": "root"}}
        path = self.world.root / "odid.conf"
        path.write_text(parts.config_text(sections))
        return path

    def at(self, second, call, *arguments):
        """Of the flight."""
        self.world.at(START_US + round(second * 1e6), call, *arguments)

    def harm(self, fault, at_s, seconds=0.0):
        """Does a fault, for so long where it is one that lasts."""
        back_s = at_s + (seconds if fault.end else 0.0)
        self.at(at_s, fault.begin, self)
        if fault.end:
            self.at(back_s, fault.end, self)
        self.windows += [Window(channel, at_s, back_s, fault.limit_s) for channel in fault.channels]

    def fly(self, until_s):
        """To that second of the flight."""
        self.world.run(START_US + round(until_s * 1e6))

    def judged(self):
        """What the judge says of all that was heard since everything was on the air."""
        self.autopilot.played.flush()
        run = self.air.run()
        run.start_mono += WARM_UP_S
        run.receptions = [one for one in run.receptions if one.mono >= run.start_mono]
        return judge(run, Options(expect_channels=self.channels), read_flight_log(self.folder / "played.jsonl"), self._set_log())

    def _set_log(self):
        log = {}
        for mono, channel, data in self.controller.set_log:
            add_payload(log, channel, mono, data)
        return log

    def end(self):
        self.world.end()
        self.autopilot.close()
