"""What one process of the appliance, taken over or somebody's own, can do to the broadcast."""

import re
import time

import patience
import pytest

from . import faults, runs
from .faults import Fault, Injected
from .machine import configuration

STATUS, SECONDS = "/run/odid/status.sock", 12
# User and group (board/common/users.txt): one that has no business there, and one whose questions are answered.
NOBODY, ODID_WEB, HOSTAPD = "65534 65534", "991 990", "994:994"


def flooded(who, may_connect, processes=4):
    def inject(machine):
        programs = "pidof odid-daemon hostapd"
        before, at = machine.must(programs), time.monotonic()
        connected = int(machine.must(f"{faults.TOOL} flood {STATUS} {who} {processes} {SECONDS}"))
        print(f"{who} got {connected} connections")
        problems = [] if bool(connected) == may_connect else [f"{who} got {connected} connections"]
        if machine.must(programs) != before:
            print(machine.must("dmesg | tail -n 20"))
            problems.append("odid-daemon or hostapd is another process than before")
        return Injected(at, problems=problems)
    return inject


@pytest.mark.usefixtures("machine_possible")
@pytest.mark.parametrize("user", ["nobody", "odid-web"])
def test_a_flood_of_questions_costs_the_broadcast_nothing(user):
    flood = flooded(NOBODY, False) if user == "nobody" else flooded(ODID_WEB, True)
    fault = Fault(f"status_flood_{user}", f"status.sock flooded by {user}", 0.6, flood)
    one = runs.in_flight([fault])[fault.name]
    assert not one.problems
    assert one.gap_s is not None
    patience.promise(f"the longest gap, on {one.channel}", one.gap_s, one.limit_s)


@pytest.mark.usefixtures("machine_possible")
def test_busy_processors_are_no_silence_of_hostapd_s():
    """Twelve processes leave hostapd-watch's question no time, unless it has hostapd's own priority."""
    fault = Fault("busy", "both processors busy", 5, flooded(NOBODY, False, processes=12))
    assert not runs.in_flight([fault])[fault.name].problems


def test_nobody_keeps_the_aircraft_on_the_ground_by_pretending_an_update(grounded):
    """SWUpdate's notifier takes anybody's word that something begins, and passes it on as its own."""
    start = 1
    grounded.wait_inside("odid-update's view of SWUpdate", "[ -S /run/odid-appliance/update.sock ] && [ -S /run/swupdate/swupdateprog ]")
    grounded.put(faults.TOOL, runs.tool())
    grounded.must(f"{faults.TOOL} notice {NOBODY} {start}")
    grounded.wait_inside("the pretended word", "! grep -q '\"state\": \"idle\"' /run/odid-appliance/update-state.json")
    assert grounded.run("[ -e /run/odid-appliance/updating ]").code != 0


GROUP = "/sys/fs/cgroup/mavlink-router"


def test_what_the_router_leaves_behind_is_ended(grounded):
    """It had the user of what root's script started next, and wrote into that one's output: a line of sed's, as root."""
    grounded.wait_inside("mavlink-router", f"grep -q . {GROUP}/cgroup.procs")
    left = grounded.must(f"(echo 0 >{GROUP}/cgroup.procs; exec setsid chpst -u mavlink:dialout sleep 1000) >/dev/null 2>&1 & echo $!").strip()
    grounded.wait_inside("it in its group", f"grep -qx {left} {GROUP}/cgroup.procs")
    before = grounded.must("pidof mavlink-routerd")
    grounded.must("sv term mavlink-router")
    grounded.wait_inside("the next one", f"new=$(pidof mavlink-routerd) && [ \"$new\" != \"{before.strip()}\" ]")
    assert not grounded.must(f"[ ! -e /proc/{left} ] || cat /proc/{left}/cmdline").strip()
    assert grounded.must(f"cat {GROUP}/pids.max {GROUP}/memory.max").split() == ["32", str(32 << 20)]
    limits = grounded.must("grep -E 'open files' /proc/$(pidof mavlink-routerd)/limits").split()
    assert limits[3:5] == ["64", "64"]


# What belongs to somebody else than root, or may be written by others. Of the daemon's folder root reads `kept`, and asks by
# `status.sock`; it follows no name there (test_kept.c, test_root_follows_no_name_in_the_daemon_s_folder).
THEIRS = (r"/run/odid(/.*)?", r"/run/odid-beacons(/.*)?", r"/run/hostapd", r"/tmp", r"/var/tmp")


def test_nobody_writes_what_root_reads(make_machine):
    machine = make_machine("who-writes", config={
        "odid.conf": configuration(maintenance={"password": "a-test-password"}, update={"hawkbit_url": "http://10.0.2.2:1", "hawkbit_id": "me"}),
        "hawkbit-token": "a-secret\n"})
    machine.power_on()
    machine.wait_on_air()
    machine.wait_inside("hawkBit's client", "ps -o user,args | grep -q '^odid-haw.*[s]wupdate'")
    listing = machine.must("find /run /data /etc /lib /usr /sbin /bin /tmp /var ! -type l ! -type s -exec stat -c '%u %a %n' {} +")
    files = [line.split(" ", 2) for line in listing.splitlines()]
    assert len(files) > 500
    wrong = [" ".join(file) for file in files
             if (file[0] != "0" or int(file[1], 8) & 0o022) and not any(re.fullmatch(one, file[2]) for one in THEIRS)]
    assert not wrong
    # And the token is for root and for that client.
    reader = "chpst -u odid-hawkbit:odid-hawkbit cat /run/swupdate.cfg"
    assert "a-secret" in machine.must(reader)
    assert machine.run(reader.replace("-u odid-hawkbit:odid-hawkbit", "-u odid-web:odid-web")).code != 0


def test_who_has_hostapd_s_socket_deletes_no_file_of_root_s(make_machine):
    """As the daemon's user, if it were taken over: at its end hostapd deletes its socket, where it is told that this is."""
    machine = make_machine("by-hostapd")
    machine.power_on()
    machine.wait_on_air()
    machine.must("mkdir -p /data/theirs && : >/data/theirs/file")
    before = machine.must("pidof hostapd").strip()
    for words in ("SET ctrl_interface /data/theirs", "SET interface file", "TERMINATE"):
        told = machine.must(f"umask 0; chpst -u odid:netdev timeout 5 hostapd_cli -s /tmp -p /run/hostapd -i wlan0 raw '{words}'")
        assert "OK" in told, words
    machine.wait_inside("its end", f"[ ! -e /proc/{before} ]")
    machine.must("[ -e /data/theirs/file ]")
    machine.wait_on_air()


def test_nobody_but_mavlink_router_is_heard_by_the_daemon(make_machine):
    """hostapd, taken over, was: from the daemon's own port at another address of lo's, by a packet socket at lo, and by a broadcast
    route, whose copy the kernel loops back."""
    machine = make_machine("stranger-on-lo")
    machine.power_on()
    machine.wait_on_air()
    machine.wait_inside("the filter", "[ -e /run/odid-appliance/firewall ]")
    machine.put("/tmp/speak", runs.tool("speak"))
    # What CAP_NET_ADMIN can set for itself.
    machine.must("cd /proc/sys/net/ipv4; echo 0 >ip_unprivileged_port_start; "
                 "for one in all lo wlan0; do echo 1 >conf/$one/route_localnet; echo 1 >conf/$one/accept_local; echo 0 >conf/$one/rp_filter; done")
    machine.must("ip route add 10.9.9.0/24 dev wlan0")
    ways = f"/tmp/speak from {HOSTAPD} 14550; /tmp/speak packet 14550; /tmp/speak looped 14550 wlan0"
    dropped = "nft list table inet odid | sed -n 's/.*counter packets \\([0-9]*\\) .* drop/\\1/p' | awk '{ all += $1 } END { print all }'"
    before = int(machine.must(dropped))
    machine.run(ways)
    machine.wait_inside("all to be dropped", f"[ $({dropped}) -ge {before + 3} ]")
    assert machine.status()["link"]["bytes_in"] == 0
    machine.must("nft delete table inet odid")
    machine.must(ways)
    machine.wait_for("what comes without the filter", lambda: machine.status()["link"]["senders"] >= 3)
