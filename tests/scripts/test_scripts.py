"""The appliance's scripts (overlay/) on this machine: each runs in a root of its own, with BusyBox and
with programs that only note how they were called. What needs a whole machine is in tests/bench.
"""

import os
import re
import signal
import stat
import time
from pathlib import Path

import pytest
from patience import LIMIT_S, stays, wait_for

from .root import KEY, NOTES, OVERLAY


def test_each_service_is_supervised_and_each_supervised_one_exists():
    started = re.findall(r"^::respawn:(?:/bin/nice -n -\d+ )?/usr/bin/runsv /run/service/(\S+)$",
                         (OVERLAY / "etc/inittab").read_text(), re.M)
    services = {path.name for path in (OVERLAY / "etc/sv").iterdir()}
    assert sorted(started) == sorted(services)
    for name in services:
        run = OVERLAY / "etc/sv" / name / "run"
        assert os.access(run, os.X_OK), run
        assert re.search(rf'^take_over ({name}|"\$service")$', run.read_text(), re.M), f"{run}: who ends its orphan?"
        finish = OVERLAY / "etc/sv" / name / "finish"
        if finish.is_symlink():
            assert os.readlink(finish) == "/lib/odid/finish"
        else:
            assert 'exec /lib/odid/finish "$@"' in finish.read_text() and os.access(finish, os.X_OK)


# --- the autopilot's port ---------------------------------------------------------

FTDI = {"idVendor": "0403", "idProduct": "6001", "manufacturer": "FTDI", "product": "FT232R USB UART", "serial": "A50285BI"}
PIXHAWK = {"idVendor": "1209", "idProduct": "5741", "manufacturer": "ArduPilot", "product": "Pixhawk (1)", "serial": "3E 00"}


@pytest.fixture
def two_autopilots(appliance):
    appliance.port("ttyACM1", "1-1", 0, **PIXHAWK)
    appliance.port("ttyACM0", "1-1", 2, **PIXHAWK)  # the second interface, with the lower number
    appliance.port("ttyUSB0", "1-2", 0, 0, **FTDI)
    return appliance


@pytest.mark.parametrize("wanted, port", [
    ("auto", "/dev/ttyACM1"),
    ("usb:0403:6001", "/dev/ttyUSB0"),
    ("usb:1209:5741", "/dev/ttyACM1"),
    ("/dev/serial/by-id/usb-ArduPilot_Pixhawk__1__3E_00-if02", "/dev/ttyACM0"),
    ("/dev/serial/by-id/usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0", "/dev/ttyUSB0"),
    ("/dev/ttyUSB0", "/dev/ttyUSB0"),
])
def test_the_port_is_found(two_autopilots, wanted, port):
    two_autopilots.settings(autopilot__device=wanted)
    assert two_autopilots.must("/lib/odid/autopilot-port") == port + "\n"


@pytest.mark.parametrize("wanted", ["usb:26ac:0011", "/dev/ttyAMA3", "/dev/serial/by-id/usb-Other-if00"])
def test_a_port_that_is_not_there_is_not_replaced_by_another(two_autopilots, wanted):
    two_autopilots.settings(autopilot__device=wanted)
    result = two_autopilots.run("/lib/odid/autopilot-port")
    assert (result.returncode, result.stdout) == (1, "")


def test_links_of_ports_that_went_are_removed(two_autopilots):
    two_autopilots.must("/lib/odid/autopilot-port")
    assert len(os.listdir(two_autopilots.root / "dev/serial/by-id")) == 3
    (two_autopilots.root / "sys/class/tty/ttyUSB0").unlink()
    (two_autopilots.root / "dev/ttyUSB0").unlink()
    two_autopilots.must("/lib/odid/autopilot-port")
    assert not any("FTDI" in name for name in os.listdir(two_autopilots.root / "dev/serial/by-id"))


# --- configurations made at start ---------------------------------------------------


def sections(text):
    """{section: {key: value}} of mavlink-router's configuration."""
    found = {}
    for line in text.splitlines():
        if line.startswith("["):
            current = found.setdefault(line.strip("[]"), {})
        else:
            key, value = line.split(" = ")
            current[key] = value
    return found


@pytest.mark.parametrize("address, endpoint", [
    ("", None), ("10.0.0.9", ("10.0.0.9", "14550")), ("10.0.0.9:14551", ("10.0.0.9", "14551")),
])
def test_mavlink_router(appliance, address, endpoint):
    appliance.settings(ground_station__address=address)
    made = sections(appliance.must("/lib/odid/mavlink-router-config /dev/ttyACM1"))
    assert made["General"]["TcpServerPort"] == "0"
    assert made["General"]["SnifferSysid"] == "1"
    assert made["UartEndpoint autopilot"] == {"Device": "/dev/ttyACM1", "Baud": "921600", "FlowControl": "false"}
    assert made["UdpEndpoint daemon"] == {"Mode": "Normal", "Address": "127.0.0.1", "Port": "14550"}
    station = made.get("UdpEndpoint ground_station")
    assert (station and (station["Address"], station["Port"])) == endpoint
    assert "@" not in str(made)


def hostapd(appliance):
    appliance.must("/lib/odid/hostapd-config /run/hostapd.conf")
    lines = appliance.read("run/hostapd.conf").splitlines()
    return dict(line.split("=", 1) for line in lines), appliance.read("run/hostapd.psk").split()[1]


def test_the_access_point_is_closed(appliance):
    appliance.write("data/secrets/wifi_ssid", "RemoteID-1234\n")
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    made, key = hostapd(appliance)
    assert made["max_num_sta"] == "0" and made["wpa"] == "2" and made["rsn_pairwise"] == "CCMP"
    assert (made["channel"], made["beacon_int"], made["country_code"], made["ssid"]) == ("6", "100", "SE", "RemoteID-1234")
    assert "vendor_elements" not in made and "@" not in str(made)
    assert re.fullmatch("[0-9a-f]{64}", key) and key != KEY
    assert hostapd(appliance)[1] != key, "the random key is the same each time"
    assert (appliance.root / "run/hostapd.psk").stat().st_mode & 0o777 == 0o600


def test_wifi_switched_off_has_no_configuration(appliance):
    hostapd(appliance)
    appliance.settings(broadcast__wifi_beacon_enabled="false")
    appliance.must("/lib/odid/hostapd-config /run/hostapd.conf")
    assert not appliance.exists("run/hostapd.conf")


def test_a_hostapd_started_in_maintenance_is_open(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("run/odid-appliance/maintenance", "on\n")
    made, key = hostapd(appliance)
    assert (made["max_num_sta"], key) == ("4", KEY)


# --- networks ---------------------------------------------------------------------------


def supervised(appliance):
    """sv knows none of these yet; runsv says what it is given."""
    appliance.write("usr/bin/sv", "#!/bin/sh\nexit 1\n")
    appliance.write("usr/bin/runsv", '#!/bin/sh\necho "runsv $*" >>/calls\n')
    for name in ("sv", "runsv"):
        (appliance.root / "usr/bin" / name).chmod(0o755)


def test_each_adapter_that_is_plugged_in_gets_an_address(appliance):
    supervised(appliance)
    for interface in ("eth1", "usb0", "wwan0", "lo", "sit0"):
        appliance.must(f"ACTION=add MDEV={interface} /lib/odid/device-network")
    # They aren't waited for.
    wait_for("three of them", lambda: len(appliance.calls()) >= 3)
    time.sleep(0.3)
    assert sorted(appliance.calls()) == [f"runsv /run/service/udhcpc-{name}" for name in ("eth1", "usb0", "wwan0")]
    assert os.readlink(appliance.root / "run/service/udhcpc-usb0/run") == "/etc/sv/udhcpc/run"


def test_one_that_was_there_before_goes_on(appliance):
    """sv knows it."""
    appliance.must("ACTION=add MDEV=usb0 /lib/odid/device-network")
    appliance.must("ACTION=remove MDEV=usb0 /lib/odid/device-network")
    assert appliance.calls() == ["sv up udhcpc-usb0", "sv down udhcpc-usb0"]


def test_a_computer_on_the_usb_cable_is_given_an_address(appliance):
    supervised(appliance)
    appliance.must("ACTION=add MDEV=gadget0 /lib/odid/device-network")
    wait_for("its DHCP server", lambda: "runsv /run/service/udhcpd-gadget0" in appliance.calls())
    assert "start 192.168.42.10\n" in appliance.read("run/udhcpd-gadget0.conf")


def gadget(appliance, cmdline="console=ttyGS0 root=x"):
    """configfs makes a function's files with its folder; the files are there before, for the script writes them only."""
    top = "sys/kernel/config/usb_gadget/odid"
    for name in ("idVendor", "UDC", "strings/0x409/product", "configs/all.1/x", "functions/ncm.0/ifname", "functions/acm.0/console"):
        appliance.write(f"{top}/{name}", "\n")
    appliance.write("sys/firmware/devicetree/base/serial-number", "10000000a1b2c3d4\0")
    appliance.write("cmdline", cmdline + "\n")
    appliance.must("mount --bind /cmdline /proc/cmdline && /lib/odid/gadget fe980000.usb")
    return lambda name: appliance.read(f"{top}/{name}").strip()


def test_a_usb_gadget_is_a_network_and_a_serial_port(appliance):
    made = gadget(appliance)
    assert made("UDC") == "fe980000.usb" and made("strings/0x409/serialnumber") == "10000000a1b2c3d4"
    assert (made("functions/ncm.0/dev_addr"), made("functions/ncm.0/host_addr")) == ("02:0d:1e:b2:c3:d4", "02:0d:1f:b2:c3:d4")
    assert made("functions/ncm.0/ifname") == "gadget%d" and made("functions/acm.0/console") == "1"
    folder = appliance.root / "sys/kernel/config/usb_gadget/odid/configs/all.1"
    assert {name.name for name in folder.iterdir() if name.is_symlink()} == {"ncm.0", "acm.0"}


def test_a_usb_gadget_s_console_is_for_those_who_ask(appliance):
    assert gadget(appliance, "console=ttynull")("functions/acm.0/console") == ""


def test_rules_of_other_layers_are_loaded_each_time(appliance):
    appliance.settings(mavlink__udp_address="127.0.0.1")
    appliance.write("etc/nftables.d/camera.nft", "add rule\n")
    appliance.must("/lib/odid/firewall")
    assert appliance.calls() == ["nft -f /etc/nftables.conf", "nft -f /etc/nftables.d/camera.nft"]
    assert appliance.fault("firewall") is None
    appliance.write("usr/bin/nft", '#!/bin/sh\ncase $2 in *camera*) exit 1 ;; esac\n')
    appliance.must("/lib/odid/firewall")
    assert "camera.nft" in appliance.fault("firewall") and appliance.exists("run/odid-appliance/firewall")


# --- maintenance --------------------------------------------------------------------


def test_maintenance_without_a_password_stays_closed_and_says_why(appliance):
    assert appliance.run("/lib/odid/maintenance on").returncode == 1
    assert "password" in appliance.fault("maintenance")
    assert appliance.calls() == []
    assert appliance.read("run/odid-appliance/maintenance") == "off\n"


def test_maintenance_opens_and_closes_without_a_restart(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("sys/class/net/wlan0/operstate", "up\n")
    appliance.must("/lib/odid/maintenance on")
    opened = appliance.calls()
    assert appliance.read("run/hostapd.psk") == f"00:00:00:00:00:00 {KEY}\n"
    appliance.must("/lib/odid/maintenance off")
    closed = appliance.calls()[len(opened):]
    assert KEY not in appliance.read("run/hostapd.psk")
    cli = "hostapd_cli -p /run/hostapd -i wlan0 raw "
    assert [call for call in opened if call.startswith("hostapd_cli")] == [cli + "RELOAD_WPA_PSK", cli + "SET max_num_sta 4"]
    assert [call for call in closed if call.startswith("hostapd_cli")] == [
        cli + "SET max_num_sta 0", cli + "RELOAD_WPA_PSK", cli + "DEAUTHENTICATE ff:ff:ff:ff:ff:ff"]
    assert 'nft add element inet odid maintenance { "wlan0", "eth0", "gadget0" }' in opened
    assert "sv up odid-web" in opened and "sv up udhcpd" in opened
    assert "nft flush set inet odid maintenance" in closed
    assert closed[0] == "sv down odid-web" and "sv down udhcpd" in closed
    assert not any("hostapd" in call for call in appliance.calls() if call.startswith("sv "))


def test_the_page_is_there_by_cable_whatever_the_access_point_does(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.must("/lib/odid/maintenance on")  # there is no wlan0
    assert "sv up odid-web" in appliance.calls() and "sv up udhcpd" not in appliance.calls()
    appliance.write("sys/class/net/wlan0/operstate", "up\n")
    appliance.write("usr/bin/hostapd_cli", "#!/bin/sh\necho FAIL\n")
    assert appliance.run("/lib/odid/maintenance on").returncode == 1  # to be tried again
    assert appliance.read("run/odid-appliance/maintenance") == "on\n"
    assert appliance.calls()[-1] == "sv up odid-web"


def test_maintenance_that_began_by_half_is_tried_again_and_ended_by_arming(appliance):
    appliance.write("lib/odid/armed", '#!/bin/sh\n[ "$(wc -l </calls)" -ge 2 ]\n')
    appliance.write("lib/odid/maintenance", '#!/bin/sh\necho "maintenance $1" >>/calls\n[ "$1" = off ]\n')
    appliance.write("calls", "")
    appliance.settings(maintenance__at_boot="yes")
    appliance.change("etc/sv/maintenance/run", ("pause 1\n", "pause 0.1\n"))
    service = appliance.start("exec sh /etc/sv/maintenance/run")
    try:
        wait_for("its end", lambda: len(appliance.calls()) >= 3)
        stays("nothing more is tried", lambda: len(appliance.calls()) == 3, 0.5)
    finally:
        service.kill()
        service.wait()
    assert appliance.calls() == ["maintenance on", "maintenance on", "maintenance off"]


@pytest.mark.parametrize("heard, armed", [
    ([None], False),                            # never heard
    (["false"], False),
    (["true"], True),
    (["true", "null"], True),                   # lost after arming: it flies on
    (["true", None], True),                     # the daemon gives no answer
    (["true", "null", "false"], False),
    (["false", "null"], False),
])
def test_armed_is_what_was_heard_last(appliance, heard, armed):
    for word in heard:
        appliance.write("status.json", "" if word is None else f'{{\n  "vehicle": 1,\n  "armed": {word}\n}}\n')
        result = appliance.run("/lib/odid/armed")
    assert (result.returncode == 0) == armed


def test_another_vehicle_than_1_is_told_to_mavlink_router_but_not_in_flight(appliance):
    appliance.write("status.json", '{ "vehicle": 7, "armed": true }')
    appliance.must("/lib/odid/armed")
    assert appliance.read("data/odid/vehicle") == "7\n" and appliance.calls() == []
    appliance.write("status.json", '{ "vehicle": 8, "armed": false }')
    appliance.run("/lib/odid/armed")
    assert appliance.calls() == ["sv term mavlink-router"]
    made = sections(appliance.must("/lib/odid/mavlink-router-config /dev/ttyACM0"))
    assert made["General"]["SnifferSysid"] == "8"


# --- a stick with a bundle ------------------------------------------------------------


STICK = {"mount": 'echo "mount $*" >>/calls; cp /stick/* /run/stick/', "umount": "rm -f /run/stick/*",
         "blkid": 'echo "$1: LABEL=\\"X\\" UUID=\\"1-2\\" TYPE=\\"$(cat /type)\\""', "odidctl": 'echo "odidctl $*" >>/calls'}


@pytest.fixture
def stick(appliance):
    """Plugs one in, and tells what is said of it and what is called."""
    for name, command in STICK.items():
        appliance.write(f"usr/bin/{name}", f"#!/bin/sh\n{command}\n")
        (appliance.root / f"usr/bin/{name}").chmod(0o755)
    appliance.change("lib/odid/update-stick", ("sleep 2", "sleep 0.1"))
    # Its shell would take its own applets.
    script = appliance.root / "lib/odid/update-stick"
    script.write_text(re.sub(r"\b(mount|umount|blkid) ", r"/usr/bin/\1 ", script.read_text()))
    appliance.write("etc/odid-release", "BOARD=qemu\n")
    appliance.write("etc/odid/version", "1.10.0\n")
    appliance.write("run/odid-appliance/update.json", "{}\n")
    appliance.write("lib/odid/armed", "#!/bin/sh\nfalse\n")
    (appliance.root / "run/swupdate").mkdir()
    os.mknod(appliance.root / "run/swupdate/sockinstctrl", stat.S_IFSOCK | 0o600)

    def plug(*versions, kind="vfat", meanwhile=None):
        appliance.write("type", kind)
        for version in versions:
            appliance.write(f"stick/{version}.swu", f'software =\n{{\n\tversion = "{version}";\n'
                                                    '\thardware-compatibility: [ "odid-qemu" ];\n')
        appliance.write("calls", "")
        appliance.write("dev/kmsg", "")
        # Without pipes: what it leaves running keeps them open.
        assert appliance.start("MDEV=sda1 /lib/odid/update-stick").wait(LIMIT_S) == 0
        wait_for("the stick to be mounted", appliance.calls)
        if meanwhile:
            meanwhile()
        wait_for("the stick to be done with", lambda: not appliance.exists("run/stick"))
        return appliance.read("dev/kmsg"), [call for call in appliance.calls() if call.startswith("odidctl")]

    plug.appliance = appliance
    return plug


def test_the_newest_version_on_a_stick_is_installed(stick):
    assert stick("1.9.0", "1.10.1", "1.2.0")[1] == ["odidctl update /run/stick/1.10.1.swu"]


@pytest.mark.parametrize("version", ["1.9.0", "0.0.1"])
def test_a_forgotten_stick_does_not_bring_an_older_version_back(stick, version):
    said, calls = stick(version)
    assert f"version {version}, which is older than 1.10.0" in said
    assert calls == []


def test_the_version_that_runs_is_left_alone(stick):
    said, calls = stick("1.10.0")
    assert "which is running" in said and calls == []


def test_what_was_rolled_back_is_not_tried_again_whatever_came_since(stick):
    stick.appliance.write("data/odid/rolled-back", "1.11.0\n")
    stick.appliance.write("data/odid/update.json", '{ "to": "1.12.0", "outcome": "refused" }\n')
    said, calls = stick("1.11.0")
    assert "was rolled back" in said and calls == []
    assert stick("1.11.1")[1] == ["odidctl update /run/stick/1.11.1.swu"]


def test_what_the_boot_loader_has_just_given_up_is_waited_for(stick):
    """The service update writes it down some seconds after the stick was found."""
    (stick.appliance.root / "run/odid-appliance/update.json").unlink()

    def written_down():
        stays("it waits", lambda: stick.appliance.exists("run/stick") and len(stick.appliance.calls()) == 1, 0.5)
        stick.appliance.write("data/odid/rolled-back", "1.11.0\n")
        stick.appliance.write("run/odid-appliance/update.json", "{}\n")
    said, calls = stick("1.11.0", meanwhile=written_down)
    assert "was rolled back" in said and calls == []


def test_nothing_is_installed_from_a_stick_that_could_not_be_remembered(stick):
    stick.appliance.write("run/faults/data", "/data is full.\n")
    said, calls = stick("1.11.0")
    assert "/data" in said and calls == []


@pytest.mark.parametrize("kind", ["vfat", "exfat", "ext4"])
def test_a_stick_is_mounted_by_its_type(stick, kind):
    """Then the kernel loads the driver, which isn't there before."""
    stick("1.11.0", kind=kind)
    assert stick.appliance.calls()[0] == f"mount -t {kind} -o ro,nosuid,nodev,noexec /dev/sda1 /run/stick"


# --- settings -----------------------------------------------------------------------


@pytest.mark.parametrize("url, told", [("http://here", []), ("http://there", ["sv term swupdate"]), ("", ["sv term swupdate"])])
def test_another_hawkbit_counts_when_no_update_is_going_on(appliance, url, told):
    appliance.write("etc/odid/version", "1.10.0\n")
    appliance.write("lib/odid/board-settings", "#!/bin/sh\n")  # the boot loader's aren't here
    for name, text in (("hardware", "odid-qemu\n"), ("slot", "a\n"), ("update.json", '{ "state": "installing" }\n')):
        appliance.write(f"run/odid-appliance/{name}", text)
    appliance.settings(update__hawkbit_url="http://here", update__hawkbit_tenant="", update__hawkbit_id="me", basic_id__uas_id="")
    appliance.must("/lib/odid/update-hawkbit >/run/swupdate.hawkbit")
    appliance.settings(update__hawkbit_url=url, update__hawkbit_tenant="", update__hawkbit_id="me", basic_id__uas_id="")
    appliance.change("lib/odid/apply-configuration", ("pause 2", "pause 0.1"))

    def swupdate_told():
        return [call for call in appliance.calls() if "swupdate" in call]
    appliance.must("/lib/odid/apply-configuration")
    stays("nobody is told in the middle of an update", lambda: not swupdate_told(), 0.5)
    appliance.write("run/odid-appliance/update.json", '{ "state": "idle" }\n')
    wait_for("it to be told", lambda: len(swupdate_told()) >= len(told))
    time.sleep(0.5)
    assert swupdate_told() == told


# --- services -----------------------------------------------------------------------


def ended(appliance, code, signal, times):
    """What finish pauses after a service ended so often; it is only noted. And nobody is there after 15 s, to see that
    the fault is over."""
    if not appliance.exists("usr/bin/noted-sleep"):
        appliance.write("usr/bin/noted-sleep", NOTES)
        (appliance.root / "usr/bin/noted-sleep").chmod(0o755)
        appliance.change("lib/odid/finish", ("exec sleep", "exec noted-sleep"), ("sleep 15", "exit"))
        (appliance.root / "run/service/test").mkdir(parents=True)
    for _ in range(times):
        appliance.must(f"cd /run/service/test && /lib/odid/finish {code} {signal} 2>/dev/null")
    return [int(call.split()[1]) for call in appliance.calls() if call.startswith("noted-sleep")]


def test_an_orderly_end_is_no_fault(appliance):
    assert ended(appliance, 0, 0, 6) == [] and ended(appliance, -1, 15, 6) == []
    assert not os.listdir(appliance.root / "run/faults")


def test_one_that_keeps_failing_is_a_fault_and_started_less_often(appliance):
    assert ended(appliance, 1, 0, 3) == [], "a first failure is not waited for"
    assert appliance.fault("test") is None
    assert ended(appliance, 1, 0, 6) == [1, 2, 3, 4, 5, 5]
    assert "keeps ending (exit code 1)" in appliance.fault("test")


@pytest.mark.parametrize("stays_there", [False, True])
def test_without_its_port_mavlink_router_is_not_tried_again(appliance, stays_there):
    """Its node is taken away a moment after mavlink-router has noticed."""
    appliance.write("run/mavlink-router.port", "/dev/ttyUSB0\n")
    appliance.write("dev/ttyUSB0", "")
    if not stays_there:     # a moment: it has looked three times
        appliance.change("etc/sv/mavlink-router/finish",
                         ("usleep 30000", "usleep 30000; [ $tries -lt 3 ] || rm -f /dev/ttyUSB0"))
    appliance.must("mkdir -p /run/service/mavlink-router/supervise; cd /run/service/mavlink-router\n"
                   "/etc/sv/mavlink-router/finish 1 0 2>/dev/null; [ -e supervise/control ] || : >supervise/control")
    assert appliance.read("run/service/mavlink-router/supervise/control") == ("" if stays_there else "d")
    assert ("unplugged" in (appliance.fault("autopilot") or "")) != stays_there


def catches_term(pid):
    caught, = re.findall(r"^SigCgt:\s*(\w+)$", Path(f"/proc/{pid}/status").read_text(), re.M)
    return int(caught, 16) >> signal.SIGTERM - 1 & 1


def test_an_orphan_is_taken_over_and_a_stranger_with_its_number_is_not(appliance):
    take_over = ". /lib/odid/functions && take_over test"
    orphan, monitor = appliance.start(f"{take_over}; exec sleep 1000"), None
    try:
        pid, started = wait_for("its number", lambda: appliance.exists("run/pid/test") and
                                appliance.read("run/pid/test").split())
        assert int(pid) == orphan.pid
        appliance.write("run/pid/test", f"{pid} {int(started) + 1}\n")
        appliance.must(take_over)
        assert appliance.read("run/pid/test").split()[0] != pid, "a stranger was taken for the orphan"
        appliance.write("run/pid/test", f"{pid} {started}\n")
        monitor = appliance.start(f"{take_over}; echo a second one >>/calls")
        wait_for("what stands for it to pass a signal on", lambda: catches_term(monitor.pid))
        time.sleep(0.3)
        assert monitor.poll() is None and orphan.poll() is None
        monitor.terminate()  # what sv term does
        assert orphan.wait(LIMIT_S) == -15
        assert monitor.wait(LIMIT_S) == 0 and appliance.calls() == []
    finally:
        for one in filter(None, (orphan, monitor)):
            one.kill()
            one.wait()


@pytest.mark.parametrize("comes, told", [("false", "d"), ("true", "du")])
def test_a_device_that_comes_meanwhile_is_not_missed(appliance, comes, told):
    appliance.write("run/service/test/supervise/control", "")
    control = appliance.root / "run/service/test/supervise/control"
    control.unlink()
    os.mkfifo(control)
    reader = os.open(control, os.O_RDWR | os.O_NONBLOCK)
    try:
        appliance.must(f". /lib/odid/functions && cd /run/service/test && wait_for {comes}")
        assert os.read(reader, 10).decode() == told
    finally:
        os.close(reader)


def test_a_fault_is_one_sentence_until_it_is_over(appliance):
    appliance.must(". /lib/odid/functions && fault data 'The disk is gone.'")
    assert appliance.fault("data") == "The disk is gone.\n"
    assert os.listdir(appliance.root / "run/faults") == ["data"]
    appliance.must(". /lib/odid/functions && fault_over data && fault_over data")
    assert appliance.fault("data") is None
