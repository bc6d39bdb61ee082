"""The package in a Debian 12 with systemd, its neighbours beside it, judged from outside as the appliance is.

The bar: on the air within 15 s of systemd's start, all five messages on each channel, without a violation for a minute; killed,
a receiver waits 1.5 s at most for a newer position, upgraded in flight 2 s, with a bluetoothd that advertises beside it 0.6 s.
"""

import json
import time

import patience
import pytest
from bench import flights, gaps
from bench.machine import CHANNELS, configuration

from . import package, system
from .package import call, unpack

pytestmark = pytest.mark.booted

ON_AIR_S, KILLED_S, NEIGHBOUR_S, UPGRADE_S = 15.0, 1.5, 0.6, 2.0
JUDGED_S = 60
SETTLE_S = 5
WATCHED_S = 20
CONFIG = configuration(mavlink={"device": "/dev/ttyUSB0"})


@pytest.fixture(scope="module")
def companion():
    """Installed by apt, started anew, in flight."""
    reason = system.missing() or ("" if package.deb("amd64") else "the package isn't built: make deb-amd64")
    if reason:
        pytest.skip(reason)
    machine = system.Companion(package.TOP / "build/system/companion")
    try:
        machine.power_on()
        machine.put("/root/odid.deb", package.deb("amd64").read_bytes())
        machine.must("cd / && apt-get install --yes /root/odid.deb >/root/log 2>&1 || { tail -n 20 /root/log; false; }")
        machine.put("/etc/odid/odid.conf", CONFIG.encode(), mode="644")
        machine.restart()
        machine.play(flights.generate(machine.folder / "flight.tlog", 3600))
        machine.wait_on_air(position=True)
        time.sleep(SETTLE_S)
    except BaseException:
        machine.close()
        raise
    yield machine
    machine.close()


def content_gap(machine, harm, watch_s):
    """The longest time that a receiver waits for a newer position after the harm, and on which channel."""
    judge = machine.judge(None, out=machine.folder / f"judge-{harm.__name__}")
    time.sleep(2)
    from_mono = time.monotonic()
    harm(machine)
    time.sleep(watch_s)
    until_mono = time.monotonic()
    judge.stop()
    contents = gaps.Contents(machine.folder / f"judge-{harm.__name__}/receptions.jsonl")
    gap = contents.worst_gap(CHANNELS, from_mono, until_mono)
    print(f"{harm.__name__}: {gap[0]:.2f} s on {gap[1]}")
    return gap


def test_it_is_on_the_air_after_a_restart(companion):
    companion.restart()
    companion.play(flights.generate(companion.folder / "flight.tlog", 3600))
    companion.air.wait_all_five(CHANNELS, since_mono=companion.powered_mono, limit_s=patience.BOOTED_S)
    started = companion.systemd_started()
    for channel in CHANNELS:
        first = next(at / 10 for at in range(0, 3000) if companion.air.types(channel, companion.powered_mono) and
                     all_five_by(companion, channel, started + at / 10))
        print(f"all five on {channel}: {first:.1f} s after systemd's start")
        patience.promise(f"all five on {channel}", first, ON_AIR_S)
    companion.wait_on_air(position=True)
    time.sleep(SETTLE_S)
    assert companion.must("systemctl is-active odid odid-hostapd@wlan0 odid-beacons@wlan0").split() == ["active"] * 3


def all_five_by(machine, channel, until_mono):
    found = set()
    for one in machine.air.receptions(channel, machine.powered_mono, until_mono):
        body = one.data[2:]
        first = range(3, len(body), 25) if body[0] >> 4 == 0xF else (0,)
        found |= {body[at] >> 4 for at in first}
    return found >= {0, 1, 3, 4, 5}


def test_nothing_is_wrong_for_a_minute(companion):
    judge = companion.judge(JUDGED_S, "--played", companion.folder / "played.jsonl", "--expect", ",".join(CHANNELS),
                            "--without-time")
    judge.wait(JUDGED_S)
    code = judge.stop()
    assert code == 0, judge.log()[-4000:]
    assert json.loads((companion.folder / "judge/figures.json").read_text())["violations"] == 0


def test_what_it_may_do(companion):
    """As its user, with two rights, in real time, on a root that nobody writes to."""
    netdev = companion.must("getent group netdev | cut -d : -f 3").strip()
    for name in ("odid-keeper", "odid-daemon"):
        number = companion.must(f"pidof {name}").split()[0]
        status = dict(line.split(":", 1) for line in companion.must(f"cat /proc/{number}/status").splitlines())
        user = companion.must("id -u odid").strip()
        assert status["Uid"].split() == [user] * 4, name
        assert netdev not in status["Groups"].split(), f"{name}: commands wpa_supplicant"
        assert companion.run(f"nsenter -t {number} -m ls /run/dbus/system_bus_socket").code != 0, name
        assert int(status["CapPrm"], 16) == 0x3000 and int(status["CapBnd"], 16) == 0x3000, name
        assert int(companion.must(f"cut -d ')' -f 2 /proc/{number}/stat").split()[38]) == 1, f"{name}: not in real time"
        assert companion.run(f"nsenter -t {number} -m -S {user} -G {user} touch /var/tmp/x /etc/odid/x").code != 0
    assert companion.status()["privilege"]["realtime"] is True


@pytest.mark.parametrize("folder", ["/run/odid", "/run/odid_faults"])
def test_a_daemon_that_was_taken_over_fills_nothing_that_others_need(companion, folder):
    """The access point couldn't be started again, also when the daemon was back: there was no room for its key."""
    number = companion.must("pidof odid-daemon").split()[0]
    user = companion.must("id -u odid").strip()
    as_daemon = f"nsenter -t {number} -m -S {user} -G {user}"
    try:
        assert companion.run(f"{as_daemon} dd if=/dev/zero of={folder}/more bs=1M count=1000").code != 0
        assert int(companion.must("df --output=avail -k /run | tail -n 1")) > 1000
        for place in ("/tmp", "/var/tmp", "/dev/shm"):
            assert companion.run(f"{as_daemon} touch {place}/more").code != 0
    finally:
        companion.must(f"rm -f {folder}/more")


def test_the_access_point_switches_no_radio_off(companion):
    """Strangers speak to it: taken over, it would have had both radios silent."""
    number = companion.must("pidof hostapd").split()[0]
    status = dict(line.split(":", 1) for line in companion.must(f"cat /proc/{number}/status").splitlines())
    netdev = companion.must("getent group netdev | cut -d : -f 3").strip()
    assert netdev not in status["Gid"].split() + status["Groups"].split()
    uid, gid = status["Uid"].split()[0], status["Gid"].split()[0]
    assert companion.run(f"setpriv --reuid {uid} --regid {gid} --clear-groups sh -c ': >>/dev/rfkill'").code != 0
    assert companion.run(f"setpriv --reuid {uid} --regid {gid} --clear-groups sh -c ': </dev/rfkill'").code == 0


def test_what_a_taken_over_access_point_left_keeps_no_other_from_starting(companion):
    """Its user's word for it: folders, sockets and a mode of 0 in each place where it may write."""
    uid, gid = companion.must("id -u odid-hostapd; id -g odid-hostapd").split()
    as_hostapd = f"setpriv --reuid {uid} --regid {gid} --clear-groups"
    companion.must(f"{as_hostapd} sh -c 'cd /run/odid-hostapd/control && rm wlan0 && mkdir -p wlan0/a && chmod 0 wlan0'")
    assert companion.run(f"{as_hostapd} sh -c 'rm -f /run/odid-hostapd/*; mkdir /run/odid-hostapd/a'").code != 0
    companion.must("kill -KILL $(pidof hostapd)")
    companion.wait_for("its socket", lambda: companion.run("test -S /run/odid-hostapd/control/wlan0").code == 0)
    companion.wait_on_air(position=True)


def test_another_interface_takes_nothing_from_the_one_that_is_used(companion):
    """Its own access point isn't started, and systemd took away the folder that all of them share."""
    companion.must("iw phy $(cat /sys/class/net/wlan2/phy80211/name) interface add other0 type managed")
    try:
        companion.wait_for("systemd to have looked at it", lambda: "exec-condition" in companion.must(
            "systemctl show -P Result odid-hostapd@other0; systemctl show -P Result odid-beacons@other0"))
        companion.must("test -S /run/odid-hostapd/control/wlan0 && test -e /run/odid-hostapd/hostapd.conf && test -e /run/odid-beacons/count")
    finally:
        companion.run("iw dev other0 del")


def test_the_doctor_finds_nobody_to_complain_of(companion):
    result = companion.run("odidctl doctor")
    assert result.output == "Nothing here is seen to disturb Remote ID.\n"


def test_its_address_is_the_same_after_a_restart(companion):
    """Else a receiver sees another aircraft."""
    def addresses():
        return {one.address for one in companion.air.heard("bt4", 3)}
    before = addresses()
    companion.must("systemctl restart odid")
    companion.wait_on_air(position=True)
    assert len(before) == 1 and addresses() == before


def the_daemon_is_killed(machine):
    machine.must("kill -KILL $(pidof odid-daemon)")


def the_keeper_is_killed(machine):
    machine.must("kill -KILL $(pidof odid-keeper)")


def the_daemon_is_stopped(machine):
    machine.must("kill -STOP $(pidof odid-daemon)")


def the_access_point_is_killed(machine):
    machine.must("kill -KILL $(pidof hostapd)")


def the_access_point_is_stopped(machine):
    """Its radio goes on with the last place, and systemd sees a process."""
    machine.must("kill -STOP $(pidof hostapd)")


@pytest.mark.parametrize("harm,limit_s", [(the_daemon_is_killed, KILLED_S), (the_keeper_is_killed, KILLED_S),
                                          (the_daemon_is_stopped, 5.0), (the_access_point_is_killed, 5.0),
                                          (the_access_point_is_stopped, 10.0)])
def test_killed_it_is_back(companion, harm, limit_s):
    gap_s, channel = content_gap(companion, harm, WATCHED_S)
    assert gap_s < WATCHED_S, f"{channel} isn't back"
    patience.promise(f"{harm.__name__}, on {channel}", gap_s, limit_s)
    companion.wait_on_air(position=True)


def test_a_keeper_that_hangs_is_started_again(companion):
    """By systemd's watchdog; meanwhile the daemon goes on."""
    before = companion.must("pidof odid-keeper")
    companion.must(f"kill -STOP {before}")
    companion.wait_for("another keeper", lambda: companion.run("pidof odid-keeper").output not in ("", before), every_s=1)
    companion.wait_on_air(position=True)


def bluetoothd_advertises_beside_it(machine):
    machine.must("systemctl start bluetooth && (echo 'advertise on'; sleep 600) | bluetoothctl >/root/bluetoothctl 2>&1 &")


def test_beside_a_bluetoothd_that_advertises(companion):
    gap_s, channel = content_gap(companion, bluetoothd_advertises_beside_it, 12)
    try:
        assert "bluetoothd (process" in companion.run("odidctl doctor").output
        patience.promise(f"beside a bluetoothd, on {channel}", gap_s, NEIGHBOUR_S)
    finally:
        companion.must("systemctl stop bluetooth")
    companion.wait_on_air(position=True)


def test_network_manager_leaves_the_beacon_s_interface_alone(companion):
    companion.must("systemctl start NetworkManager")
    try:
        companion.wait_for("NetworkManager", lambda: "wlan0" in companion.run("nmcli -c no -t -f DEVICE device").output)
        assert "wlan0:unmanaged" in companion.must("nmcli -c no -t -f DEVICE,STATE device")
        companion.wait_on_air(position=True)
        assert companion.run("odidctl doctor").code == 0
    finally:
        companion.must("systemctl stop NetworkManager")


def test_upgraded_in_flight(companion, tmp_path):
    folder = unpack(package.deb("amd64"), tmp_path / "next")
    control = folder / "DEBIAN/control"
    control.write_text(control.read_text().replace("Version: ", "Version: 9+", 1))
    call("dpkg-deb", "--root-owner-group", "-b", folder, tmp_path / "next.deb")
    companion.put("/root/next.deb", (tmp_path / "next.deb").read_bytes())
    before = companion.must("pidof odid-keeper")
    companion.must("gpasswd --add odid netdev")  # as an older version had it

    def upgrade(machine):
        machine.must("dpkg -i /root/next.deb >/root/log 2>&1")
    gap_s, channel = content_gap(companion, upgrade, 5)
    assert companion.must("pidof odid-keeper") != before
    patience.promise(f"an upgrade, on {channel}", gap_s, UPGRADE_S)
    assert "netdev" not in companion.must("id -Gn odid").split()
    assert companion.must("cat /etc/odid/odid.conf") == CONFIG


def test_settings_are_changed_on_the_ground(companion):
    """In flight they are kept for the next start."""
    said = companion.must("odidctl set wifi.channel 11")
    assert "at the next power-on or sooner" in said
    companion.must("odidctl set wifi.channel 6")


def test_purged_it_is_gone(companion):
    companion.must("apt-get purge --yes odid >/root/log 2>&1")
    assert companion.run("pidof odid-daemon odid-keeper odid-beacons hostapd").code != 0
    assert companion.run("getent passwd odid odid-hostapd odid-beacons").output == ""
    left = companion.must("find / -xdev -path /var/lib/dpkg -prune -o -path /var/log -prune -o -path /root -prune -o "
                          "-iname '*odid*' -print; ls -d /run/odid* 2>/dev/null || true")
    assert left == "", companion.run("ls -laR /etc/odid; tail -n 5 /root/log").output
