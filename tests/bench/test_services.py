"""What the appliance is beside its broadcast: a board without radios, SSH, the flight record, and a
daemon that can't be started any more."""

import json
import re
import socket
import struct
import subprocess
import time

import patience
import pytest
from parts import ROOT, free_udp_port

from . import flights
from .machine import Machine
from .wifi import BEACON, frames, pack

ADAPTER = bytes((0x40, 0, 0, 0, 77, 1))  # as QEMU's has it
OFF_AIR_S = 5.0  # after which the last payload of a daemon that isn't back is taken off the air


def ssh(machine, key, *command):
    """A technician's computer. Returns exit code and output; 255: not let in."""
    done = subprocess.run(
        ["ssh", "-i", key, "-p", str(machine.ssh_port), "-o", "BatchMode=yes", "-o", "ConnectTimeout=10",
         "-o", "IdentitiesOnly=yes", "-o", "StrictHostKeyChecking=accept-new",
         "-o", f"UserKnownHostsFile={machine.folder}/known_hosts", "root@127.0.0.1", *command],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        timeout=patience.LIMIT_S)
    return done.returncode, done.stdout


@pytest.fixture(scope="module")
def switched_on(machine_possible):
    """Nothing has to be on the air."""
    machine = Machine(ROOT / "build/system/switched_on")
    machine.power_on()
    yield machine
    machine.close()


def test_what_a_program_opens_by_name_is_there(switched_on):
    """A shell's <(...), and nft -f - where nothing else makes these names."""
    assert switched_on.run("for one in fd stdin stdout stderr; do [ -e /dev/$one ] || echo $one; done").output == ""


def test_what_the_machine_says_is_heard_however_late(switched_on):
    """The bench's own: of the kernel's log the end was lost, and what was waited for with it."""
    switched_on.shell.send("i=0; while [ $i -lt 3000 ]; do i=$((i+1)); echo said $i; done")
    time.sleep(3)  # it is busy, and doesn't listen
    switched_on.shell.send("echo and that is all")
    said, _ = switched_on.shell.until(b"and that is all\n", patience.LIMIT_S)
    assert [int(one) for one in re.findall(rb"said (\d+)\n", said)] == list(range(1, 3001))


@pytest.fixture
def key(tmp_path):
    path = tmp_path / "key"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", path], check=True)
    return path


def test_ssh_is_for_an_installed_key_only(make_machine, key, tmp_path):
    machine = make_machine("ssh")
    (machine.folder / "known_hosts").unlink(missing_ok=True)
    machine.power_on()
    machine.wait_on_air()
    machine.wait_inside("the firewall", "[ -e /run/odid-appliance/firewall ]")
    time.sleep(3)
    assert "LISTEN" not in machine.must("netstat -ltn"), "SSH listens though nobody could log in"
    machine.must("sync")
    machine.cut_power()

    machine.disk.put_config({"authorized_keys": key.with_suffix(".pub").read_bytes()})
    machine.power_on()
    machine.wait_inside("SSH, and a way to it", "netstat -ltn | grep -q :22 && ip -4 addr show dev eth0 | grep -q 'inet '")
    code, output = ssh(machine, key, "odidctl set self_id.description 'Set over SSH'")
    assert code == 0, output
    code, output = ssh(machine, key, "odidctl set system.category none-such")
    assert code != 0 and "category" in output and "none-such" in output, output
    other = tmp_path / "other"
    subprocess.run(["ssh-keygen", "-q", "-t", "ed25519", "-N", "", "-f", other], check=True)
    assert ssh(machine, other, "true")[0] == 255
    # Who logged in is in the log, and nobody who only came.
    machine.wait_inside("the log-ins' lines", "[ $(logread | grep -c 'Pubkey auth succeeded') = 2 ]")
    assert machine.run("logread | grep -E 'Child connection|Exit before auth'").output == ""
    machine.cut_power()

    # What was said to be set is kept, and so is the host's key: the client would complain.
    machine.power_on()
    machine.wait_inside("SSH, and a way to it", "netstat -ltn | grep -q :22 && ip -4 addr show dev eth0 | grep -q 'inet '")
    code, output = ssh(machine, key, "odidctl get self_id.description")
    assert (code, output.strip().splitlines()[-1:]) == (0, ["Set over SSH"]), output
    machine.wait_on_air()


def test_the_flight_record_says_whether_it_was_on_the_air(make_machine):
    machine = make_machine("record")
    machine.power_on()
    machine.wait_on_air()
    machine.play(flights.generate(machine.folder / "flight.tlog", 90))  # arms in its fourth second
    machine.wait_on_air(position=True)
    time.sleep(10)
    hung = machine.must("pidof hostapd").strip()
    machine.must(f"kill -STOP {hung}")
    machine.wait_inside("its end by hostapd-watch", f"[ ! -e /proc/{hung} ]")
    machine.wait_on_air(position=True)
    time.sleep(15)
    machine.cut_power()
    machine.power_on()
    machine.wait_on_air()
    records = json.loads(machine.must("odidctl flights --json"))
    print(machine.must("odidctl flights"))
    flown = records[1]
    print(json.dumps(flown, indent=1))
    assert flown["ended"] == "power cut"
    assert flown["armed_s"] > 15
    assert flown["channels"]["wifi"]["armed_longest_gap_s"] > 1
    patience.promise("the first broadcast", flown["first_broadcast_s"], 10)
    patience.promise("the longest gap on bt4", flown["channels"]["bt4"]["armed_longest_gap_s"], 0.5)
    patience.promise("the longest gap on wifi", flown["channels"]["wifi"]["armed_longest_gap_s"], 8)
    assert "Wi-Fi" in flown["verdict"]


def test_a_board_without_radios_boots_and_says_so(make_machine):
    machine = make_machine("no-radios")
    machine.power_on(radios=False)
    machine.wait_inside("all services", "pidof odid-recorder && [ -e /run/odid-appliance/booted ]")

    def reasons():
        status = machine.status()
        return " ".join(problem["reason"] for problem in status["problems"]) if status else ""
    machine.wait_for("the reasons", lambda: "Bluetooth" in reasons() and "Wi-Fi" in reasons())
    time.sleep(10)
    assert not machine.status()["on_air"]
    output = machine.run("odidctl status")
    assert output.code != 0 and "no Wi-Fi interface" in output.output, output.output
    # It is not tried again and again, and nothing crashes.
    assert machine.run("dmesg | grep -c 'ended (exit code'").output.strip() == "0"


def test_a_daemon_that_never_comes_back_is_taken_off_the_air(make_machine):
    """Its last position would be a lie. What takes it off is the keeper, by the kernel's own hci0."""
    machine = make_machine("off-air")
    machine.power_on()
    machine.wait_on_air()
    machine.play(flights.generate(machine.folder / "flight.tlog", 120))
    machine.wait_on_air(position=True)
    machine.must("mount --bind /bin/false $(which odid-daemon)")
    killed, killed_mono = time.time(), time.monotonic()
    machine.must("kill -KILL $(pidof odid-daemon)")
    machine.wait_inside("the keeper", "odidctl status 2>&1 | grep -q 'taken off the air'")
    time.sleep(1)
    off_s = time.monotonic() - killed_mono
    time.sleep(4)
    on_air_s = {channel: machine.air.receptions(channel)[-1].mono - killed_mono for channel in ("bt4", "bt5")}
    on_air_s["wifi"] = max(at for at, row in frames(machine.pcap, BEACON, killed) if pack(row)) - killed
    assert max(on_air_s.values()) < off_s, f"still on the air: {on_air_s}"
    for channel, seconds in on_air_s.items():
        patience.promise(f"{channel}: on the air without a daemon", seconds, OFF_AIR_S + 1.5)
        patience.promised(seconds > 0.5, f"{channel}: taken off before the daemon could be back")
    status = machine.run("odidctl status")
    # In the order in which it was done.
    assert status.code != 0 and re.search("taken off the air: (wlan0, hci0|hci0, wlan0)", status.output), status.output
    machine.must("umount $(which odid-daemon)")
    machine.wait_on_air(position=True)


def from_strangers(end, port):
    """To an adapter whose cable ends here: as from a DHCP server's port, SYN and echo request, of ever other addresses."""
    def checksum(octets):
        total = sum(struct.unpack(f"!{len(octets) // 2}H", octets))
        return ~(total + (total >> 16)) & 0xFFFF

    def frame(protocol, source, target, payload):
        head = struct.pack("!BBHHHBBH4s4s", 0x45, 0, 20 + len(payload), 0, 0, 64, protocol, 0, source, target)
        return ADAPTER + bytes((2, 0, 0, 0, 77, 2)) + b"\x08\x00" + head[:10] + struct.pack("!H", checksum(head)) + head[12:] + payload

    us = bytes((10, 77, 0, 1))
    for low in range(1, 251):
        for high in range(1, 5):
            source = bytes((10, 77, high, low))
            syn = struct.pack("!HHIIBBHHH", 40000, 22, low, 0, 5 << 4, 2, 65535, 0, 0)
            pseudo = source + us + struct.pack("!HH", 6, len(syn))
            syn = syn[:16] + struct.pack("!H", checksum(pseudo + syn)) + syn[18:]
            echo = struct.pack("!BBHHH", 8, 0, checksum(struct.pack("!HHHH", 0x800, 0, low, high)), low, high)
            for one in (frame(17, source, us, struct.pack("!HHHH", 67, 68, 8, 0)), frame(6, source, us, syn),
                        frame(1, source, us, echo)):
                end.sendto(one, ("127.0.0.1", port))


def test_strangers_fill_no_table_of_connections(make_machine):
    machine = make_machine("strangers")
    machine.power_on()
    port = free_udp_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as end:
        end.bind(("127.0.0.1", 0))
        machine.qmp.command("netdev_add", type="dgram", id="cable", local={"type": "inet", "host": "127.0.0.1", "port": str(port)},
                            remote={"type": "inet", "host": "127.0.0.1", "port": str(end.getsockname()[1])})
        machine.qmp.command("device_add", driver="usb-net", id="cable", netdev="cable", bus="usb.0", mac=ADAPTER.hex(":"))
        named = f"grep -l {ADAPTER.hex(':')} /sys/class/net/*/address"
        machine.wait_inside("the adapter", named)
        adapter = machine.must(named).split("/")[4]
        machine.wait_inside("its DHCP client's end", f"sv stop udhcpc-{adapter}")  # which would take the address away
        machine.must(f"ip link set {adapter} up && ip addr add 10.77.0.1/16 dev {adapter}")
        machine.wait_inside("the firewall", "[ -e /run/odid-appliance/firewall ]")
        known = int(machine.must("cat /proc/sys/net/netfilter/nf_conntrack_count"))

        def came():
            """The emulated adapter loses most of it."""
            from_strangers(end, port)
            return int(machine.must(f"cat /sys/class/net/{adapter}/statistics/rx_packets")) > 2000
        machine.wait_for("what they sent", came)
    assert int(machine.must("cat /proc/sys/net/netfilter/nf_conntrack_count")) < known + 50
    machine.wait_on_air()


def test_a_modem_that_is_plugged_in_has_an_address_and_is_the_second_way_out(make_machine):
    """QEMU's USB network adapter, as modems that are Ethernet are one (CDC)."""
    machine = make_machine("modem")
    machine.power_on()
    machine.wait_inside("a way out", "ip route | grep -q default")
    machine.qmp.command("netdev_add", type="user", id="modem", net="10.9.8.0/24")
    machine.qmp.command("device_add", driver="usb-net", id="modem", netdev="modem", bus="usb.0")
    machine.wait_inside("the modem's address", "ip route | grep -q 'default via 10.9.8.2'")
    ways = re.findall(r"default via (\S+) dev (\S+) +metric (\d+)", machine.must("ip route"))
    (_, first, near), (_, second, far) = sorted(ways, key=lambda way: int(way[2]))
    assert first == "eth0" and int(near) < int(far)
    assert machine.must(f"sv status udhcpc-{second}").startswith("run:")

    machine.must("ip link set eth0 down")
    assert "10.9.8.2" in machine.must("ip route get 203.0.113.1")
    # But not to the ground station, unless it is said to be: whoever plugs it in would be in between.
    to_it = "chpst -u mavlink curl -s -m 2 http://10.9.8.2:14550/"      # any packet of that user's
    dropped = "nft list chain inet odid output | sed -n 's/.*oif != @way counter packets \\([0-9]*\\).*/\\1/p'"
    way = "nft list set inet odid way"
    assert '"eth0"' in machine.must(way)
    machine.run(to_it)
    assert int(machine.must(dropped)) > 0
    machine.must(f"odidctl set ground_station.interface {second}")
    assert f'"{second}"' in machine.must(way) and '"eth0"' not in machine.must(way)
    machine.run(to_it)
    assert int(machine.must(dropped)) == 0
    machine.qmp.command("device_del", id="modem")
    machine.wait_inside("the modem's end", f"sv status udhcpc-{second} | grep -q ^down:")
    assert not re.search("10.9.8", machine.must("ip route"))
    machine.wait_inside("a filter that knows no way", f"! {way} | grep -q elements")
    machine.wait_on_air()
