"""odidctl doctor on made-up computers: whom it finds, and which remedy, file and line it names.

A computer here is a folder with those files of /proc, /sys, /run and /etc that the doctor reads (odidctl -root).
"""

import os
import re

import pytest

from .package import call

HEALTHY = {
    "proc/1/comm": "systemd\n", "proc/1/cmdline": "/sbin/init\0",
    "proc/300/comm": "odid-keeper\n", "proc/300/cmdline": "/usr/sbin/odid-keeper\0--\0odid-daemon\0",
    "proc/301/comm": "odid-daemon\n", "proc/301/cmdline": "odid-daemon\0",
    "proc/301/stat": "301 (odid-daemon) S 300 " + " ".join(str(field) for field in range(5, 41)) + " 1 0\n",
    "proc/310/comm": "hostapd\n", "proc/310/cmdline": "/usr/sbin/hostapd\0/run/odid-hostapd/hostapd.conf\0",
    "proc/310/exe": "\x7fELF.. hostapd v2.10\nUser space daemon\n",
    "proc/cmdline": "console=tty1 root=/dev/mmcblk0p2\n",
    "sys/class/net/wlan0/ifindex": "3\n",
    "sys/class/bluetooth/hci0/uevent": "\n",
    "sys/class/tty/ttyACM0/dev": "166:0\n",
    "sys/class/rfkill/rfkill0/type": "wlan\n", "sys/class/rfkill/rfkill0/soft": "0\n", "sys/class/rfkill/rfkill0/hard": "0\n",
    "sys/class/rfkill/rfkill1/type": "bluetooth\n", "sys/class/rfkill/rfkill1/soft": "0\n", "sys/class/rfkill/rfkill1/hard": "0\n",
    "run/udev/data/c166:0": "E:ID_MM_DEVICE_IGNORE=1\n",
    "lib/systemd/system/odid.service": "[Service]\nCPUSchedulingPolicy=fifo\n",
    "lib/systemd/system/odid-hostapd@.service": "[Service]\n",
    "etc/odid/odid.conf": "[basic_id]\nuas_id = SSRS5GBG01\n",
}
OF_ONES_OWN = "ctrl_interface=/run/hostapd\nctrl_interface_group=odid-hostapd\n"
CONFIGURED = {"etc/odid/odid.conf": HEALTHY["etc/odid/odid.conf"] + "[broadcast]\nhostapd_dir = /run/hostapd\n"}
NOBODY = "Nothing here is seen to disturb Remote ID.\n"


def process(number, name, command, **files):
    return {f"proc/{number}/comm": f"{name}\n", f"proc/{number}/cmdline": command.replace(" ", "\0") + "\0",
            **{f"proc/{number}/{file}": text for file, text in files.items()}}


# What is added to the healthy computer (None: taken away): what the sentence, the remedy and the place have in them.
ILLNESSES = {
    "bluetoothd": (
        {**process(400, "bluetoothd", "/usr/libexec/bluetooth/bluetoothd"),
         "lib/systemd/system/bluetooth.service": "[Unit]\n\n[Service]\nExecStart=/usr/libexec/bluetooth/bluetoothd\n"},
        r"bluetoothd \(process 400\)", "systemctl disable --now bluetooth.service", "/lib/systemd/system/bluetooth.service:4"),
    "NetworkManager has the interface": (
        {**process(400, "NetworkManager", "/usr/sbin/NetworkManager --no-daemon"),
         "run/NetworkManager/devices/3": "[device]\nmanaged=true\n",
         "etc/NetworkManager/system-connections/home.nmconnection": "[connection]\nid=home\ntype=wifi\ninterface-name=wlan0\n"},
        "NetworkManager manages wlan0", r"unmanaged-devices\+=interface-name:wlan0.*/etc/NetworkManager/conf.d/90-odid.conf",
        "/etc/NetworkManager/system-connections/home.nmconnection:4"),
    "NetworkManager has it without a connection": (
        {**process(400, "NetworkManager", "/usr/sbin/NetworkManager"), "run/NetworkManager/devices/3": "[device]\nmanaged=true\n"},
        "NetworkManager manages wlan0", "unmanaged-devices", "/run/NetworkManager/devices/3:2"),
    "wpa_supplicant": (
        {**process(400, "wpa_supplicant", "/sbin/wpa_supplicant -B -i wlan0 -c /etc/wpa.conf"),
         "etc/network/interfaces": "auto lo\niface lo inet loopback\niface wlan0 inet dhcp\n"},
        r"wpa_supplicant \(process 400\) has wlan0", r"wpa_supplicant@wlan0", "/etc/network/interfaces:3"),
    **{f"wpa_supplicant, as {whose} starts it": (
        process(400, "wpa_supplicant", f"/sbin/wpa_supplicant {words}"), r"wpa_supplicant \(process 400\) has wlan0",
        r"wpa_supplicant@wlan0", "/etc/network/interfaces") for whose, words in {
            "systemd": "-c/etc/wpa_supplicant/wpa_supplicant-wlan0.conf -iwlan0",
            "ifupdown": "-s -B -P /run/wpa_supplicant.wlan0.pid -i wlan0 -D nl80211,wext",
        }.items()},
    "iwd": (process(400, "iwd", "/usr/libexec/iwd"), "iwd .* takes every wireless interface", "systemctl disable --now iwd", None),
    "dhcpcd": (
        {**process(400, "dhcpcd", "/usr/sbin/dhcpcd -w"), "etc/dhcpcd.conf": "hostname\n"},
        "dhcpcd .* starts wpa_supplicant on wlan0", "denyinterfaces wlan0", "/etc/dhcpcd.conf"),
    "ModemManager": (
        {**process(400, "ModemManager", "/usr/sbin/ModemManager"), "run/udev/data/c166:0": "E:ID_VENDOR_ID=1234\n"},
        "ModemManager looks on /dev/ttyACM0", "ID_MM_DEVICE_IGNORE", "/etc/udev/rules.d/60-odid.rules"),
    "gpsd on each port": (
        {**process(400, "gpsd", "/usr/sbin/gpsd -F /run/gpsd.sock"), "etc/default/gpsd": 'DEVICES=""\nUSBAUTO="true"\n'},
        r"gpsd \(process 400\)", 'USBAUTO="false"', "/etc/default/gpsd:2"),
    "gpsd on that port": (
        {**process(400, "gpsd", "/usr/sbin/gpsd"), "etc/default/gpsd": 'DEVICES="/dev/ttyACM0"\nUSBAUTO="false"\n'},
        "gpsd", "DEVICES", "/etc/default/gpsd:1"),
    "Bluetooth is switched off by software": (
        {"sys/class/rfkill/rfkill1/soft": "1\n"}, "Bluetooth is switched off by software", "rfkill unblock bluetooth",
        "/sys/class/rfkill/rfkill1/soft:1"),
    "Wi-Fi is switched off by software": (
        {"sys/class/rfkill/rfkill0/soft": "1\n"}, "Wi-Fi is switched off by software", "rfkill unblock wlan",
        "/sys/class/rfkill/rfkill0/soft:1"),
    "a switch": (
        {"sys/class/rfkill/rfkill0/hard": "1\n"}, "Wi-Fi is switched off by a switch", "switch", "/sys/class/rfkill/rfkill0/hard:1"),
    "firmware of Wi-Fi": (
        {"sys/class/net/wlan0/ifindex": None, "sys/bus/sdio/devices/mmc1:0001:1/vendor": "0x02d0\n"},
        "The Wi-Fi interface wlan0 isn't there", "apt install firmware-brcm80211", "/sys/class/net/wlan0"),
    "firmware of Bluetooth": (
        {"sys/class/bluetooth/hci0/uevent": None, "sys/bus/sdio/devices/mmc1:0001:1/vendor": "0x02d0\n"},
        "The Bluetooth adapter hci0 isn't there", "apt install bluez-firmware", "/sys/class/bluetooth/hci0"),
    "firmware of another one's": (
        {"sys/class/net/wlan0/ifindex": None}, "The Wi-Fi interface wlan0 isn't there", "journalctl -k", "/sys/class/net/wlan0"),
    "an old hostapd": (
        {"proc/310/exe": "\x7fELF.. hostapd v2.9\n"}, "hostapd 2.9 .* is older than 2.10", "apt install hostapd", None),
    "no hostapd": (
        {"proc/310/comm": None, "proc/310/cmdline": None, "proc/310/exe": None},
        "hostapd isn't running", "systemctl start odid-hostapd@wlan0", "/lib/systemd/system/odid-hostapd@.service"),
    "a hostapd for another interface alone": (
        {"proc/310/cmdline": "/usr/sbin/hostapd\0/etc/hostapd/wlan1.conf\0", "etc/hostapd/wlan1.conf": "interface=wlan1\n"},
        "hostapd isn't running", "systemctl start odid-hostapd@wlan0", "/lib/systemd/system/odid-hostapd@.service"),
    "a hostapd of one's own that Debian has masked": (
        {"proc/310/comm": None, "proc/310/cmdline": None, "proc/310/exe": None, **CONFIGURED,
         "etc/hostapd/hostapd.conf": f"interface=wlan0\n{OF_ONES_OWN}"},
        "hostapd isn't running", "systemctl unmask hostapd", None),
    "a hostapd of one's own by the interface's name": (
        {"proc/310/comm": None, "proc/310/cmdline": None, "proc/310/exe": None, **CONFIGURED,
         "etc/hostapd/wlan0.conf": f"interface=wlan0\n{OF_ONES_OWN}"},
        "hostapd isn't running", "systemctl enable --now hostapd@wlan0.service", None),
    "a hostapd of one's own without a socket": (
        {"etc/hostapd/hostapd.conf": "interface=wlan0\nctrl_interface_group=0\n"},
        "no control socket", "ctrl_interface_group=odid-hostapd", "/etc/hostapd/hostapd.conf:2"),
    "a hostapd of one's own whose folder isn't configured": (
        {"etc/hostapd/hostapd.conf": OF_ONES_OWN}, "no control socket", r"\[broadcast\] hostapd_dir = /run/hostapd",
        "/etc/hostapd/hostapd.conf:2"),
    "a hostapd of one's own that nobody gets at": (
        {"etc/hostapd/hostapd.conf": OF_ONES_OWN.replace("odid-hostapd", "0"), **CONFIGURED}, "no control socket",
        "ctrl_interface_group=odid-hostapd", "/etc/hostapd/hostapd.conf:2"),
    "a hostapd of one's own for another interface": (
        {"etc/hostapd/hostapd.conf": f"interface=wlan1\n{OF_ONES_OWN}", **CONFIGURED},
        "is for another interface than wlan0", "hostapd@INTERFACE.service", "/etc/hostapd/hostapd.conf:1"),
    "a hostapd of one's own with elements": (
        {"etc/hostapd/wlan0.conf": f"{OF_ONES_OWN}vendor_elements=dd00\n", **CONFIGURED},
        "sets vendor elements itself", "take the line out", "/etc/hostapd/wlan0.conf:3"),
    "somebody has the port open": (
        process(400, "mavproxy.py", "python3 /usr/bin/mavproxy.py"), r"mavproxy.py \(process 400\) has /dev/ttyACM0 open",
        "127.0.0.1:14550", None),
    "the kernel's console": (
        {"proc/cmdline": "console=ttyACM0,115200 root=/dev/sda1\n"}, "kernel writes its messages to the autopilot's port",
        "take that word out", "/boot/firmware/cmdline.txt:1"),
    "the kernel's console behind a Raspberry Pi's own words": (
        {"proc/cmdline": "smsc95xx.macaddr=DC:A6:32:00:00:01 " * 12 + "console=ttyACM0,115200\n"},
        "kernel writes its messages to the autopilot's port", "take that word out", "/boot/firmware/cmdline.txt:1"),
    "another Remote ID program": (
        {**process(400, "python3", "python3 /opt/remote-id/main.py"),
         "etc/systemd/system/rid.service": "[Service]\nType=simple\nExecStart=/usr/bin/python3 /opt/remote-id/main.py\n"},
        "Another Remote ID program runs .*process 400", "systemctl disable --now rid.service", "/etc/systemd/system/rid.service:3"),
    "a second one of ours": (
        process(400, "odid-daemon", "/opt/old/odid-daemon"), "Another Remote ID program runs", "end it", None),
    "a unit that waits to start one": (
        {"etc/systemd/system/old.service": "[Service]\nExecStart=/opt/odid_daemon\n"},
        "A unit of yours starts another", "systemctl disable --now old.service", "/etc/systemd/system/old.service:2"),
    "no real-time priority": (
        {"proc/301/stat": HEALTHY["proc/301/stat"].replace(" 1 0\n", " 0 0\n")},
        "refused real-time priority", "CPUSchedulingPolicy=fifo", "/lib/systemd/system/odid.service:2"),
    "no daemon": (
        {name: None for name in HEALTHY if name.startswith("proc/301/")}, "daemon isn't running", "systemctl start odid",
        "/lib/systemd/system/odid.service"),
}


class Computer:
    def __init__(self, odidctl, root):
        self.odidctl, self.root = odidctl, root
        self.add(HEALTHY)

    def add(self, files):
        for name, text in files.items():
            path = self.root / name
            if text is None:
                path.unlink()
                if name.startswith("sys/class/"):
                    path.parent.rmdir()
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)

    def doctor(self, **options):
        code, said = call(self.odidctl, "-root", self.root, "doctor", check=False, **options)
        return code, said.replace("Who has the autopilot's port open is seen by root only.\n", "")


@pytest.fixture
def computer(unpacked, tmp_path):
    return Computer(os.environ.get("ODIDCTL") or unpacked / "usr/bin/odidctl", tmp_path / "computer")


def test_a_healthy_computer(computer):
    assert computer.doctor() == (0, NOBODY)


@pytest.mark.parametrize("files,sentence,remedy,where", ILLNESSES.values(), ids=ILLNESSES)
def test_who_disturbs_is_named_with_remedy_file_and_line(computer, files, sentence, remedy, where):
    computer.add(files)
    if "somebody" in sentence or "mavproxy" in sentence:
        (computer.root / "proc/400/fd").mkdir()
        (computer.root / "proc/400/fd/3").symlink_to("/dev/ttyACM0")
    code, said = computer.doctor()
    lines = said.splitlines()
    assert code == 1
    assert re.search(sentence, lines[0]), said
    assert lines[1].startswith("    Remedy: ") and re.search(remedy, lines[1]), said
    assert lines[2:] == ([f"    See:    {where}"] if where else []), said


HARMLESS = {
    "a wpa_supplicant of another interface": process(400, "wpa_supplicant", "/sbin/wpa_supplicant -i wlan01"),
    "the kernel's console on another port": {"proc/cmdline": "console=ttyACM01,115200\n"},
    "NetworkManager that leaves it alone": {
        **process(400, "NetworkManager", "/usr/sbin/NetworkManager"), "run/NetworkManager/devices/3": "[device]\nmanaged=false\n"},
    "ModemManager that leaves the port alone": process(400, "ModemManager", "/usr/sbin/ModemManager"),
    "gpsd on a receiver of its own": {
        **process(400, "gpsd", "/usr/sbin/gpsd"), "etc/default/gpsd": 'DEVICES="/dev/ttyAMA3"\nUSBAUTO="false"\n'},
    "dhcpcd that was told": {**process(400, "dhcpcd", "dhcpcd"), "etc/dhcpcd.conf": "denyinterfaces wlan0\n"},
    "an editor with our file": process(400, "vi", "vi /etc/odid/odid.conf"),
    "a hostapd of one's own": {"etc/hostapd/hostapd.conf": OF_ONES_OWN, **CONFIGURED},
    "a hostapd of one's own by the older name": {
        "etc/hostapd/hostapd.conf": OF_ONES_OWN.replace("/run", "/var/run"), **CONFIGURED},
    "our own units in /etc": {"etc/systemd/system/odid.service.d/mine.conf": "[Service]\nExecStart=odid-keeper\n"},
}


@pytest.mark.parametrize("files", HARMLESS.values(), ids=HARMLESS)
def test_who_does_nothing_isn_t_named(computer, files):
    computer.add(files)
    assert computer.doctor() == (0, NOBODY)


@pytest.mark.parametrize("section,illness", [
    ("bt4_enabled = false\nbt5_enabled = false", "bluetoothd"), ("wifi_beacon_enabled = false", "NetworkManager has the interface"),
    ("wifi_beacon_enabled = false", "no hostapd"), ("wifi_beacon_enabled = false", "Wi-Fi is switched off by software")])
def test_a_radio_that_isn_t_used_is_nobody_s_concern(computer, section, illness):
    computer.add({"etc/odid/odid.conf": f"[broadcast]\n{section}\n", **ILLNESSES[illness][0]})
    assert computer.doctor() == (0, NOBODY)


def test_the_port_is_found_behind_its_lasting_name(computer):
    computer.add({"etc/odid/odid.conf": "[mavlink]\ndevice = /dev/serial/by-id/usb-AP\n", "dev/ttyACM0": "",
                  **ILLNESSES["ModemManager"][0]})
    (computer.root / "dev/serial/by-id").mkdir(parents=True)
    (computer.root / "dev/serial/by-id/usb-AP").symlink_to("../../ttyACM0")
    assert "/dev/ttyACM0" in computer.doctor()[1]


def test_what_udev_says_of_the_whole_device_counts(computer):
    computer.add(ILLNESSES["ModemManager"][0])
    computer.add({"sys/devices/usb1/dev": "189:5\n", "sys/devices/usb1/if0/uevent": "\n",
                  "run/udev/data/c189:5": "E:ID_MM_DEVICE_IGNORE=1\n"})
    (computer.root / "sys/class/tty/ttyACM0/device").symlink_to("../../../devices/usb1/if0")
    assert computer.doctor() == (0, NOBODY)


def test_in_a_container_it_says_what_that_keeps_from_it(computer):
    computer.add({"run/.containerenv": "", **ILLNESSES["no real-time priority"][0]})
    code, said = computer.doctor()
    assert code == 1
    for words in ("--ulimit rtprio=20", "--device /dev/rfkill", "-v /run/hostapd:/run/odid-hostapd/control", "neither firmware nor other programs"):
        assert words in said
    computer.add({"dev/rfkill": "", "run/odid-hostapd/control/wlan0": "", "proc/301/stat": HEALTHY["proc/301/stat"]})
    code, said = computer.doctor()
    assert code == 0 and "Remedy" not in said


def test_the_package_s_own_programs_are_nobody_else_s_and_hide_nobody(computer):
    for number, name in enumerate(("odid-keeper", "odid-beacons", "hostapd"), 320):
        computer.add(process(number, name, f"/usr/sbin/{name} wlan0 /run/odid-beacons/count"))
    assert computer.doctor() == (0, NOBODY)
    computer.add({**process(400, "python3", "python3 /opt/remote-id/main.py"), **process(500, "odid-daemon", "/opt/old/odid-daemon")})
    code, said = computer.doctor()
    assert code != 0 and "process 400" in said and "process 500" in said


def test_what_the_kernel_holds_up_costs_one_answer(computer):
    """A FIFO that nobody writes into, in a file's place, is left alone; so is a name that means nothing."""
    computer.add(process(400, "gpsd", "gpsd"))
    (computer.root / "etc/default").mkdir(parents=True)
    os.mkfifo(computer.root / "etc/default/gpsd")
    os.mkfifo(computer.root / "proc/400/environ")
    (computer.root / "sys/class/rfkill/rfkill9").symlink_to("/nowhere")
    assert computer.doctor() == (0, NOBODY)


def test_no_word_of_other_people_s_reaches_the_terminal(computer):
    computer.add(process(400, "odid-daemon", "/opt/\x1b[2Jodid"))
    said = computer.doctor()[1]
    assert "?[2J" in said and "\x1b" not in said


def test_nor_does_a_file_s_name(computer):
    """NetworkManager makes one of a connection's name, which who is logged in chooses."""
    files = ILLNESSES["NetworkManager has the interface"][0]
    computer.add({path.replace("home.nm", "home\33]0;owned\a.nm"): text for path, text in files.items()})
    _, said = computer.doctor()
    assert "See:    /etc/NetworkManager/system-connections/home" in said and not re.search(r"[\0-\x09\x0b-\x1f\x7f]", said)
