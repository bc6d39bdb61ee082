"""driver-watch: whose driver is bound anew, how often, and when the board is restarted for it."""

import os

import pytest
from patience import wait_for

SERIAL = ("sys/devices/fe201000.serial/serial0/serial0-0", "serial", "hci_uart_bcm")
SDIO = ("sys/devices/fe300000.mmc/mmc_host/mmc1/mmc1:0001/mmc1:0001:1", "sdio", "brcmfmac")
USB = ("sys/devices/0000:00:01.0/usb1/1-1/1-1.2/1-1.2:1.0", "usb", "btusb")
RUN = "etc/sv/driver-watch/run"


class Driven:
    """A radio as sysfs shows it. Its driver's files are pipes: they keep what was written."""

    def __init__(self, appliance, name, device, bus, driver, beside=()):
        self.appliance, self.name, self.device = appliance, name, device
        self.link = appliance.root / "sys/class" / ("bluetooth" if name.startswith("hci") else "net") / name / "device"
        folder = appliance.root / "sys/bus" / bus / "drivers" / driver
        folder.mkdir(parents=True)
        self.pipes = {}
        for order in ("unbind", "bind"):
            os.mkfifo(folder / order)
            self.pipes[order] = os.open(folder / order, os.O_RDWR | os.O_NONBLOCK)
        for one in (device, *beside):
            appliance.write(f"{one}/uevent", "")
            (appliance.root / one / "driver").symlink_to(folder)
        # Absolute, as in the root that the script sees.
        (appliance.root / device / "driver").unlink()
        (appliance.root / device / "driver").symlink_to(f"/sys/bus/{bus}/drivers/{driver}")
        self.come()

    def come(self):
        self.link.parent.mkdir(parents=True)
        self.link.symlink_to(f"/{self.device}")
        if not self.name.startswith("hci"):
            (self.link.parent / "phy80211").mkdir()

    def go(self):
        self.link.unlink()
        self.link.parent.rmdir()

    def asked(self, order):
        try:
            return os.read(self.pipes[order], 1000).decode().split()
        except BlockingIOError:
            return []

    def close(self):
        for pipe in self.pipes.values():
            os.close(pipe)


@pytest.fixture
def make_driven(appliance):
    made = []

    def make(name, device, bus, driver, **more):
        made.append(Driven(appliance, name, device, bus, driver, **more))
        return made[-1]
    yield make
    for one in made:
        one.close()


@pytest.fixture
def watch(appliance):
    """The service, with a clock of ours; it looks fifty times a second."""
    appliance.change(RUN, ("pause 1", "echo looks >>/calls; usleep 20000"), ("/proc/uptime", "/uptime"),
                     ("kill -TERM 1", "echo restarts >>/calls"))
    appliance.change("lib/odid/bind-anew", ("usleep 500000", "true"))
    appliance.change("lib/odid/functions", ("read -r uptime _ </proc/uptime", "read -r uptime _ </uptime"))
    appliance.write("run/odid-appliance/update-state.json", '{ "state": "idle" }\n')
    appliance.write("uptime", "100.00 1\n")
    started = []

    def start():
        started.append(appliance.start(f"exec /{RUN}"))
    yield start
    for one in started:
        one.kill()
        one.wait()


def say(appliance, *lines, uptime_s=None):
    """What the daemon says of its radios; returns when the script has heard it."""
    for name, text in (("uptime", f"{uptime_s}.00 1\n"), ("radios", "".join(f"{line}\n" for line in lines))):
        if name != "uptime" or uptime_s is not None:
            appliance.write(f"{name}.new", text)
            (appliance.root / f"{name}.new").rename(appliance.root / name)
    looks = appliance.calls().count("looks") + 3
    wait_for("several looks", lambda: appliance.calls().count("looks") >= looks)


@pytest.mark.parametrize("name, where, beside, asked", [
    ("hci0", SERIAL, (), ["serial0-0"]),
    # The driver does nothing for one of the functions, and all for the other.
    ("wlan0", SDIO, (SDIO[0][:-1] + "2",), ["mmc1:0001:1", "mmc1:0001:2"]),
    ("hci0", USB, (USB[0][:-1] + "1", "sys/devices/0000:00:01.0/usb1/1-1/1-1.3/1-1.3:1.0"), ["1-1.2:1.0", "1-1.2:1.1"]),
])
def test_the_driver_of_a_radio_that_is_stuck_is_bound_anew(appliance, make_driven, watch, name, where, beside, asked):
    driven = make_driven(name, *where, beside=beside)
    watch()
    say(appliance, f"{name} on-air 5", "wlan7 stuck 0")
    assert driven.asked("unbind") == driven.asked("bind") == []
    say(appliance, f"{name} stuck 0")
    assert driven.asked("unbind") == driven.asked("bind") == asked
    assert f"The radio {name} doesn't come back by itself: its driver is bound anew (1)." in appliance.fault(f"radio-{name}")
    say(appliance, f"{name} on-air 1")
    assert appliance.fault(f"radio-{name}") is None


def test_an_interface_that_only_has_a_radio_s_name_is_left_alone(appliance, make_driven, watch):
    """Whoever may rename interfaces had root unbind the ground station's adapter."""
    driven = make_driven("wlan0", *USB)
    (driven.link.parent / "phy80211").rmdir()
    watch()
    say(appliance, "wlan0 on-air 5")
    say(appliance, "wlan0 stuck 0")
    assert driven.asked("unbind") == driven.asked("bind") == []


def test_what_is_no_radio_of_the_broadcast_s_any_more_is_no_fault(appliance, make_driven, watch):
    make_driven("hci0", *SERIAL)
    watch()
    say(appliance, "hci0 on-air 5")
    say(appliance, "hci0 stuck 0")
    say(appliance, "hci0 off 0")
    assert appliance.fault("radio-hci0")
    say(appliance, "hci1 off 0")
    assert appliance.fault("radio-hci0") is None


def test_a_chip_without_its_patch_is_a_fault(appliance, make_driven, watch):
    """By the kernel's record, in which a device's name with a line of its own in it stays one line, and a program's line has
    the program's facility."""
    def record(number, text, priority=3):
        return f"{priority},{number},{number}000,-;{text}\n SUBSYSTEM=bluetooth\n"
    nowhere, loaded = "Bluetooth: hci0: BCM: firmware Patch file not found, tried:", "Bluetooth: hci0: BCM4345C0 'brcm/BCM4345C0.hcd' Patch"
    name = f"usb 1-1: Product: ;{nowhere}\\x0a{nowhere}"
    make_driven("hci0", *SERIAL)
    watch()
    say(appliance)
    appliance.write("dev/kmsg", record(1, nowhere) + record(2, loaded) + record(3, name) + record(4, nowhere.replace("hci0", "hci1")) +
                    record(5, nowhere, 11) + record(6, nowhere, 30))
    say(appliance, "hci0 on-air 5")
    assert appliance.fault("patch-hci0") is None
    say(appliance, "hci0 stuck 0")
    appliance.write("dev/kmsg", record(1, loaded) + record(2, nowhere) + record(3, "Bluetooth: hci0: BCM: 'brcm/BCM.hcd'"))
    say(appliance, "hci0 on-air 1")
    assert "The Bluetooth chip of hci0 runs without its patch" in appliance.fault("patch-hci0")
    say(appliance, "hci1 off 0")
    assert appliance.fault("patch-hci0") is None


def test_it_is_tried_again_and_less_and_less_often(appliance, make_driven, watch):
    """Also where its interface doesn't come again."""
    driven = make_driven("hci0", *SERIAL)
    watch()
    say(appliance, "hci0 on-air 5")
    driven.go()
    tried = []
    for uptime_s in range(100, 400):
        say(appliance, "hci0 stuck 0", uptime_s=uptime_s) if uptime_s in (100, 109, 110, 129, 130, 169, 170, 229, 230, 289, 290) else None
        tried += [uptime_s] * bool(driven.asked("bind"))
    assert tried == [100, 110, 130, 170, 230, 290]
    # On the air for a moment: the pauses go on; for a minute: it begins anew.
    say(appliance, "hci0 on-air 5", uptime_s=300)
    say(appliance, "hci0 stuck 0", uptime_s=310)
    assert not driven.asked("bind")
    for uptime_s in (311, 371):
        say(appliance, "hci0 on-air 5", uptime_s=uptime_s)
    say(appliance, "hci0 stuck 0", uptime_s=372)
    assert driven.asked("bind")


def test_for_how_long_a_radio_works_is_not_the_daemon_s_to_say(appliance, make_driven, watch):
    """One that was taken over had drivers bound every two seconds, and the board restarted again and again."""
    driven = make_driven("hci0", *SERIAL)
    appliance.write("data/odid/restarted-for-hci0", "")
    watch()
    for uptime_s in range(100, 112, 3):
        say(appliance, "hci0 on-air 1000", uptime_s=uptime_s)
        say(appliance, "hci0 stuck 0", uptime_s=uptime_s + 1)
    assert len(driven.asked("bind")) == 1
    assert appliance.exists("data/odid/restarted-for-hci0")


@pytest.mark.parametrize("change", ["blocked", "pulled", "never", "off", "name"])
def test_what_is_switched_off_or_away_is_left_alone(appliance, make_driven, watch, change):
    driven = make_driven("hci0", *SERIAL)
    if change == "never":
        driven.go()
    watch()
    say(appliance, "hci0 off 0")
    if change == "blocked":
        for name, text in (("type", "bluetooth"), ("soft", "1"), ("hard", "0")):
            appliance.write(f"sys/class/rfkill/rfkill0/{name}", text + "\n")
    elif change == "pulled":
        (appliance.root / driven.device / "uevent").unlink()
    line = {"off": "hci0 off 0", "name": "../../sys/class/bluetooth/hci0 stuck 0"}.get(change, "hci0 stuck 0")
    say(appliance, line)
    assert driven.asked("unbind") == driven.asked("bind") == []


def test_what_was_pulled_has_its_time_when_it_is_plugged_in_again(appliance, make_driven, watch):
    driven = make_driven("hci0", *SERIAL)
    there = appliance.root / driven.device / "uevent"
    watch()
    say(appliance, "hci0 on-air 5")
    there.unlink()
    say(appliance, "hci0 stuck 0", uptime_s=120)
    there.touch()
    say(appliance, "hci0 stuck 0", uptime_s=124)
    assert not driven.asked("bind")
    say(appliance, "hci0 stuck 0", uptime_s=125)
    assert driven.asked("bind")


def stays_away(appliance, radio, *beside):
    """For more than a minute, in which its driver was bound anew four times."""
    say(appliance, *beside, f"{radio} on-air 5", uptime_s=100)
    for uptime_s in (110, 120, 140, 180):
        say(appliance, *beside, f"{radio} stuck 0", uptime_s=uptime_s)


@pytest.mark.parametrize("files, gone, restarts", [
    ({}, None, True),
    ({"armed": "armed once 1\n"}, None, False),
    ({"armed": "unknown once 1\n"}, None, False),
    ({"armed": "disarmed once 1 silent\n"}, None, False),  # it fell silent, and may fly
    ({"armed": ""}, None, False),
    ({"run/odid-appliance/maintenance": "on\n"}, None, False),
    ({"run/odid-appliance/maintenance": "off\n"}, None, True),
    ({"run/odid-appliance/update-state.json": '{ "state": "installing" }\n'}, None, False),
    ({"run/odid-appliance/update-state.json": '{ "state": "trial" }\n'}, None, False),
    ({}, "run/odid-appliance/update-state.json", False),
    ({"run/odid-appliance/data-in-memory": ""}, None, False),  # the mark goes with the restart: it had no end
    ({"data/odid/restarted-for-hci0": ""}, None, False),
    ({"data/odid/restarted-for-wlan0": ""}, None, True),
    ({}, "data/odid", False),  # nowhere to remember it
])
def test_the_board_restarts_on_the_ground_and_once(appliance, make_driven, watch, files, gone, restarts):
    driven = make_driven("hci0", *SERIAL)
    for name, text in files.items():
        appliance.write(name, text)
    if gone:
        path = appliance.root / gone
        path.rmdir() if path.is_dir() else path.unlink()
    watch()
    say(appliance, "hci0 on-air 5", uptime_s=100)
    for uptime_s in (110, 120, 140):
        say(appliance, "hci0 stuck 0", uptime_s=uptime_s)
    assert "restarts" not in appliance.calls()
    say(appliance, "hci0 stuck 0", uptime_s=180)
    assert appliance.calls().count("restarts") == restarts
    assert len(driven.asked("bind")) == 4
    say(appliance, "hci0 stuck 0", uptime_s=240)
    assert appliance.calls().count("restarts") == restarts


def test_armed_at_the_last_moment_nothing_is_remembered(appliance, make_driven, watch):
    """That radio's last remedy was gone, also over power-offs."""
    make_driven("hci0", *SERIAL)
    appliance.change(RUN, ("&& fsync \"$mark\"; }", "&& echo armed once 1 said >/armed; }"))
    watch()
    stays_away(appliance, "hci0")
    assert "armed once" in appliance.read("armed") and "restarts" not in appliance.calls()
    assert not appliance.exists("data/odid/restarted-for-hci0")


@pytest.mark.parametrize("for_s, restarts", [(20, False), (2, True)])  # a moment at each new binding is no coming back
def test_a_radio_that_came_back_has_its_minute_once_more(appliance, make_driven, watch, for_s, restarts):
    make_driven("hci0", *SERIAL)
    watch()
    say(appliance, "hci0 on-air 5", uptime_s=100)
    say(appliance, "hci0 stuck 0", uptime_s=110)
    for uptime_s in range(150 - for_s, 150):
        say(appliance, "hci0 on-air 5", uptime_s=uptime_s)
    for uptime_s in (150, 180):
        say(appliance, "hci0 stuck 0", uptime_s=uptime_s)
    assert ("restarts" in appliance.calls()) == restarts
    say(appliance, "hci0 stuck 0", uptime_s=250)
    assert "restarts" in appliance.calls()


def test_on_a_full_disk_no_restart_is_remembered_that_was_not_made(appliance, make_driven, watch):
    """The name was there, the octet wasn't: that radio's last remedy was gone."""
    make_driven("hci0", *SERIAL)
    appliance.change(RUN, ("{ echo >", "{ : >\"$mark\" && false >"))
    watch()
    stays_away(appliance, "hci0")
    assert "restarts" not in appliance.calls() and not appliance.exists("data/odid/restarted-for-hci0")


@pytest.mark.parametrize("bluetooth, restarts", [
    ("hci0 on-air 500", False), ("h4:/dev/ttyS1@115200 on-air 500", False), ("hci0 stuck 0", True), ("hci0 off 0", True)])
def test_for_wi_fi_alone_the_board_is_not_restarted(appliance, make_driven, watch, bluetooth, restarts):
    """Whoever kept the channel busy for a minute silenced Bluetooth as well, which was fine."""
    make_driven("wlan0", *SDIO)
    watch()
    stays_away(appliance, "wlan0", bluetooth)
    assert appliance.calls().count("restarts") == restarts


@pytest.mark.parametrize("state, armed, binds", [("trial", "disarmed never 0 said", False), ("idle", "disarmed never 0 said", True),
                                                 ("waiting", "disarmed never 0 said", True), ("trial", "armed once 1 said", True)])
def test_in_a_trial_wi_fi_s_driver_is_left_alone_on_the_ground(appliance, make_driven, watch, state, armed, binds):
    """Whoever kept the channel busy had hostapd started again and again, and each version given up for that."""
    wifi = make_driven("wlan0", *SDIO)
    appliance.write("armed", armed + "\n")
    appliance.write("run/odid-appliance/update-state.json", f'{{ "state": "{state}" }}\n')
    watch()
    say(appliance, "wlan0 on-air 5")
    say(appliance, "wlan0 stuck 0")
    assert bool(wifi.asked("bind")) == binds


def test_a_radio_that_never_worked_restarts_nothing(appliance, make_driven, watch):
    driven = make_driven("hci0", *SERIAL)
    watch()
    for uptime_s in (110, 120, 140, 180, 240):
        say(appliance, "hci0 stuck 0", uptime_s=uptime_s)
    assert len(driven.asked("bind")) == 5 and "restarts" not in appliance.calls()


def test_ten_minutes_on_the_air_allow_another_restart(appliance, make_driven, watch):
    make_driven("hci0", *SERIAL)
    appliance.write("data/odid/restarted-for-hci0", "")
    watch()
    for uptime_s in (100, 699):
        say(appliance, "hci0 on-air 5", uptime_s=uptime_s)
    assert appliance.exists("data/odid/restarted-for-hci0")
    say(appliance, "hci0 on-air 5", uptime_s=700)
    assert not appliance.exists("data/odid/restarted-for-hci0")
