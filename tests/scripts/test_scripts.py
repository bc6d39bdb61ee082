"""The appliance's scripts (overlay/) on this machine: each runs in a root of its own, with BusyBox and
with programs that only note how they were called. What needs a whole machine is in tests/bench.
"""

import contextlib
import os
import re
import signal
import stat
import struct
import time
from pathlib import Path

import pytest
from patience import LIMIT_S, stays, wait_for

from .root import KEY, NETDEV, NOTES, OVERLAY, ROOT

CAP_SYS_MODULE, CAP_SYS_BOOT, CAP_SYS_TIME = 16, 22, 25  # capability.h


def test_each_country_that_can_be_set_has_rules():
    """By the database that the appliance's image has: 8 octets, then each country's two letters and where its rules are."""
    database = next(iter(sorted(ROOT.glob("build/appliance/cache/root-*/lib/firmware/regulatory.db"))), None)
    if database is None:
        pytest.skip("the appliance isn't built (make appliance)")
    octets = database.read_bytes()
    assert octets[:4] == b"RGDB"
    known = {country.decode() for country, rules in struct.iter_unpack(">2sH", octets[8:8 + 4 * 300]) if country.isalpha()}
    source = (ROOT / "package/odid-daemon/src/config/config_appliance.c").read_text()
    ours = set(re.search(r'countries\[\] =((?:\s*"[A-Z ]*")+);', source)[1].replace('"', " ").split())
    assert len(ours) > 150 and ours <= known


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


def test_empty_files_fill_no_memory(appliance):
    """By size alone a folder of everybody's took as many as half of all pages."""
    appliance.change("etc/init.d/S01mounts", ("mkdir -p /run/faults", "exit 0; mkdir"))
    made = appliance.must("mkdir -p /tmp /var; /etc/init.d/S01mounts 2>/dev/null || exit; for folder in tmp var; do\n"
                          "(number=0; while : >/$folder/$((number += 1)); do [ $number -lt 2000 ] || break; done) 2>/dev/null\n"
                          "ls /$folder | wc -l; done")
    assert [900 < int(count) < 1100 for count in made.split()] == [True, True]


def test_root_follows_no_name_in_the_daemon_s_folder():
    """/run/odid is the daemon's user's: a link that it makes there would lead root anywhere. Its socket is asked by
    odidctl, which doesn't follow one either."""
    ours = [path for path in OVERLAY.rglob("*") if path.is_file() and not path.is_symlink()]
    assert not [str(path) for path in ours if re.search(r"/run/odid/", path.read_text(errors="replace"))]
    source = ROOT / "package/odid-daemon/src"
    assert not [str(path) for path in source.glob("*/odid_*_main.c") if re.search(r'RUN_DIR "/|"/run/odid/', path.read_text())]
    (state,) = re.findall(r'#define PLACES_STATE "(/run/odid-appliance)"', (source / "appliance/places.h").read_text())
    (updating,) = re.findall(r'#define APPLIANCE_UPDATING "(\w+)"', (source / "appliance/appliance_marks.h").read_text())
    assert f": >{state}/{updating} " in (OVERLAY / "etc/init.d/S10disk").read_text()
    for program in ("daemon/odid_daemon_main.c", "update/update_places.h"):
        assert 'STATE "/" APPLIANCE_UPDATING' in (source / program).read_text()



# --- the autopilot's port ---------------------------------------------------------

FTDI = {"idVendor": "0403", "idProduct": "6001", "manufacturer": "FTDI", "product": "FT232R USB UART", "serial": "A50285BI"}
PIXHAWK = {"idVendor": "1209", "idProduct": "5741", "manufacturer": "ArduPilot", "product": "Pixhawk (1)", "serial": "3E 00"}


@pytest.fixture
def two_autopilots(appliance):
    appliance.port("ttyACM1", "1-1", 0, **PIXHAWK)
    appliance.port("ttyACM0", "1-1", 2, **PIXHAWK)  # the second interface, with the lower number
    appliance.port("ttyUSB0", "1-2", 0, 0, **FTDI)
    return appliance


ACM_NAME = "usb-ArduPilot_Pixhawk__1__3E_00-if00"
FTDI_NAME = "usb-FTDI_FT232R_USB_UART_A50285BI-if00-port0"


@pytest.mark.parametrize("wanted, ports", [
    ("auto", ["/dev/ttyACM1", "/dev/ttyUSB0", "/dev/ttyACM0"]),
    ("usb:0403:6001", ["/dev/ttyUSB0"]),
    ("usb:1209:5741", ["/dev/ttyACM1", "/dev/ttyACM0"]),
    ("/dev/serial/by-id/usb-ArduPilot_Pixhawk__1__3E_00-if02", ["/dev/ttyACM0"]),
    (f"/dev/serial/by-id/{FTDI_NAME}", ["/dev/ttyUSB0"]),
    ("/dev/ttyUSB0", ["/dev/ttyUSB0"]),
])
def test_the_ports_are_found(two_autopilots, wanted, ports):
    two_autopilots.settings(autopilot__device=wanted)
    assert two_autopilots.must("/lib/odid/autopilot-port").split() == ports


def test_a_device_with_many_ports_keeps_no_other_off_the_list(two_autopilots):
    """As many are listened to as odidctl takes; one device's were all of them, where it was plugged in before the autopilot's place."""
    for interface in range(0, 26, 2):
        two_autopilots.port(f"ttyACM{interface + 2}", "1-0", interface, idVendor="1209", idProduct="0001")
    ports = two_autopilots.must("/lib/odid/autopilot-port").split()
    assert ports[:3] == ["/dev/ttyACM2", "/dev/ttyACM1", "/dev/ttyUSB0"] and len(ports) == 9


def test_the_port_that_had_an_autopilot_is_the_first(two_autopilots):
    two_autopilots.write("data/odid/autopilot-port", FTDI_NAME + "\n")
    assert two_autopilots.must("/lib/odid/autopilot-port").split() == ["/dev/ttyUSB0", "/dev/ttyACM1", "/dev/ttyACM0"]


CONFINE = '#!/bin/sh\nexec "$@"\n'
ROUTER = """#!/bin/sh
cat /run/mavlink-router.conf >/began
"""


def search(appliance, finding):
    """The service's start, which has to listen to several ports; finding: what is run for that, in shell."""
    for name, text in {"chpst": '#!/bin/sh\nshift 2\nexec "$@"\n', "odid-confine": CONFINE, "mavlink-routerd": ROUTER, "sv": NOTES,
                       "odidctl": f'#!/bin/sh\n[ "$1" != find-autopilot ] || {{ {finding}; exit; }}\n' +
                                  appliance.read("usr/bin/odidctl").removeprefix("#!/bin/sh\n")}.items():
        appliance.write(f"usr/bin/{name}", text)
        (appliance.root / f"usr/bin/{name}").chmod(0o755)
    appliance.write("etc/group", "root:x:0:\ndialout:x:18:\n")
    # The kernel takes those out of the group whom it ends.
    appliance.change("lib/odid/functions", ('echo 1 >"$group/cgroup.kill"', 'echo 1 >"$group/cgroup.kill"; : >"$group/cgroup.procs"'))
    appliance.must("cd /etc/sv/mavlink-router && ./run")


@pytest.mark.parametrize("said, began", [
    ("/dev/ttyACM0", True), ("/dev/ttyACM9", False), ("/dev/ttyACM0|w/etc/owned", False), ("/dev/ttyACM1\n/dev/ttyACM0", False)])
def test_only_a_port_that_is_one_gets_into_a_file_of_root_s(two_autopilots, said, began):
    """What is left of a mavlink-routerd that was taken over has the user of what listens to the ports, and wrote into its
    output; sed wrote it where it said, as root."""
    one = two_autopilots
    search(one, f"printf '{said}\\n'")
    assert one.exists("began") == began
    assert not one.exists("etc/owned") and (not began or "/dev/ttyACM0" in one.read("began"))


def test_who_looks_for_the_autopilot_has_limits_and_is_ended(two_autopilots):
    """It reads what anybody's device says, ran outside every limit, and held up the service for as long as a child of its lived."""
    group = "sys/fs/cgroup/mavlink-router"
    search(two_autopilots, f"cat /{group}/pids.max /{group}/memory.max >/limits; ulimit -n >>/limits; "
                           "{ sleep 1000 & echo $! >/left; }; echo /dev/ttyACM0")
    left = two_autopilots.read("left")
    os.kill(int(left), signal.SIGKILL)  # the kernel's work, by the group
    assert two_autopilots.read("limits").split() == ["32", str(32 << 20), "64"]
    assert two_autopilots.read(f"{group}/cgroup.kill").strip() == "1" and "/dev/ttyACM0" in two_autopilots.read("began")


@pytest.mark.parametrize("finding", ["exec sleep 1000", "while :; do echo /dev/ttyACM0; done"])
def test_who_never_ends_looking_for_the_autopilot_is_ended(two_autopilots, finding):
    two_autopilots.change("etc/sv/mavlink-router/run", ("-s KILL 10", "-s KILL 1"))
    search(two_autopilots, finding)
    assert "No autopilot is heard" in two_autopilots.fault("autopilot") and not two_autopilots.exists("began")
    assert (two_autopilots.root / "run/mavlink-router.found").stat().st_size <= 4096


def test_where_listening_takes_too_long_the_one_that_had_the_autopilot_last_is_taken(two_autopilots):
    two_autopilots.write("data/odid/autopilot-port", FTDI_NAME + "\n")
    two_autopilots.change("etc/sv/mavlink-router/run", ("-s KILL 10", "-s KILL 1"))
    search(two_autopilots, "exec sleep 1000")
    assert "/dev/ttyUSB0" in two_autopilots.read("began") and two_autopilots.fault("autopilot") is None


@pytest.mark.parametrize("armed, kept, heard, port", [
    ("armed once 1", FTDI_NAME, FTDI_NAME, "/dev/ttyUSB0"), ("unknown once 1", FTDI_NAME, FTDI_NAME, "/dev/ttyUSB0"),
    ("disarmed once 1 said", FTDI_NAME, FTDI_NAME, "/dev/ttyACM0"), ("armed once 1", "", "", "/dev/ttyACM0"),
    ("armed once 1", FTDI_NAME, "", "/dev/ttyACM0"), ("armed once 1", FTDI_NAME, ACM_NAME, "/dev/ttyACM0")])
def test_in_the_air_the_kept_port_is_taken_without_listening(two_autopilots, armed, kept, heard, port):
    """A router that was started again in flight listened to all ports again and again: what the autopilot says had been switched off."""
    two_autopilots.write("armed", armed + "\n")
    for name, value in {"data/odid/autopilot-port": kept, "run/mavlink-router.heard": heard}.items():
        if value:
            two_autopilots.write(name, value + "\n")
    search(two_autopilots, "echo /dev/ttyACM0")
    assert port in two_autopilots.read("began")


def test_what_a_device_keeps_in_the_kernel_holds_the_service_s_start_for_a_moment_only(two_autopilots):
    """It is in the group still when the autopilot is found: who listens to a device that doesn't answer can't be ended."""
    two_autopilots.change("lib/odid/functions", ('while read -r left', 'while echo 7 >"$group/cgroup.procs"; read -r left'))
    search(two_autopilots, "echo /dev/ttyACM0")
    assert "/dev/ttyACM0" in two_autopilots.read("began") and two_autopilots.fault("group-mavlink-router") is None


def test_what_an_earlier_start_left_is_ended_and_the_next_one_has_limits(appliance):
    group = "sys/fs/cgroup/mavlink-router"
    appliance.write(f"{group}/cgroup.procs", "")
    appliance.must(". /lib/odid/functions; end_left mavlink-router; own_group mavlink-router 16 32")
    said = {name: appliance.read(f"{group}/{name}").strip() for name in ("cgroup.kill", "pids.max", "memory.max", "memory.oom.group")}
    assert said == {"cgroup.kill": "1", "pids.max": "16", "memory.max": str(32 << 20), "memory.oom.group": "1"}
    assert appliance.read(f"{group}/cgroup.procs").strip().isdigit() and not appliance.exists("run/faults/group-mavlink-router")
    appliance.must(". /lib/odid/functions; end_left mavlink-router")  # it doesn't go: here nobody ends it
    assert "can't be ended" in appliance.read("run/faults/group-mavlink-router")


# A router that does nothing, and the judge of it, who looks oftener than every four seconds; and what is left of that one.
JUDGED = """sleep 1000 &
router=$!
. /lib/odid/functions
started_at $router
{before}
/lib/odid/autopilot-judge $router $started 2>/dev/null &
{wait}
kill -0 $router && echo alive
kill -KILL $router
wait $!
"""


def judged(appliance, port, heard, before=":", unread="00000000", wait="until [ $(cat /looks | wc -l) -gt 3 ]; do usleep 10000; done"):
    """What autopilot-judge did in its first looks, and whether the router lives."""
    appliance.write("run/mavlink-router.port", port + "\n100\n")
    appliance.write("status.json", '{ "speaks": %s }\n' % ("true" if heard else "false"))
    appliance.write("etc/passwd", "mavlink:x:993:993::/:/bin/false\n")
    appliance.write("udp", "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
                           "   7: 00000000:8D6C 00000000:0000 07 00000000:00000A00 00:00000000 00000000     0        0 11 2\n"
                           f"   9: 00000000:8D6E 00000000:0000 07 00000000:{unread} 00:00000000 00000000   993        0 12 2\n")
    appliance.write("looks", "")
    appliance.must("/lib/odid/autopilot-port")  # as the service does: makes the links
    appliance.change("lib/odid/autopilot-judge", ("pause 4", "usleep 30000 && echo >>/looks"), ("/proc/net/udp", "/udp"))
    lives = "alive" in appliance.must(JUDGED.format(before=before, wait=wait))
    return appliance.calls(), lives


def test_a_port_without_an_autopilot_is_left_for_the_others(two_autopilots):
    calls, lives = judged(two_autopilots, "/dev/ttyACM1", heard=False)
    assert set(calls) == {"sv term mavlink-router"} and lives
    assert not two_autopilots.exists("data/odid/autopilot-port")


HEARD_THEN_SILENT = """until [ $(cat /looks | wc -l) -gt 2 ]; do usleep 10000; done; echo '{ "speaks": false }' >/status.json
    until [ $(cat /looks | wc -l) -gt 6 ]; do usleep 10000; done"""


@pytest.mark.parametrize("kept, heard, armed, left", [
    (ACM_NAME, True, "armed once 1", False), (ACM_NAME, True, "unknown once 1", False), (ACM_NAME, True, "disarmed once 1 silent", True),
    (ACM_NAME, False, "armed once 1", True),         # the autopilot was heard elsewhere since power-on, and this one is dead
    ("usb-Other-if00", True, "armed once 1", False),  # another adapter than at the last flight
    ("usb-Other-if00", False, "armed once 1", True), (FTDI_NAME, True, "armed once 1", True)])
def test_in_the_air_the_port_where_it_was_heard_is_not_left(two_autopilots, kept, heard, armed, left):
    """Its messages were switched off for some seconds: from then on all ports were listened to, and nobody asked it any more."""
    two_autopilots.write("data/odid/autopilot-port", kept + "\n")
    two_autopilots.write("armed", armed + "\n")
    calls, lives = judged(two_autopilots, "/dev/ttyACM1", heard=heard, wait=HEARD_THEN_SILENT)
    assert (set(calls), lives) == ({"sv term mavlink-router"} if left else set(), True)


def test_in_the_air_the_port_where_the_last_router_heard_it_is_not_left(two_autopilots):
    for name in "data/odid/autopilot-port", "run/mavlink-router.heard":
        two_autopilots.write(name, ACM_NAME + "\n")
    two_autopilots.write("armed", "armed once 1\n")
    assert judged(two_autopilots, "/dev/ttyACM1", heard=False) == ([], True)


def test_one_that_is_heard_later_is_kept_all_the_same(appliance):
    """The only port was judged once: one that was silent at the first look was never kept."""
    appliance.port("ttyACM1", "1-1", 0, **PIXHAWK)
    wait = """until [ $(cat /looks | wc -l) -gt 2 ]; do usleep 10000; done; echo '{ "speaks": true }' >/status.json
        until [ $(cat /looks | wc -l) -gt 5 ]; do usleep 10000; done"""
    assert judged(appliance, "/dev/ttyACM1", heard=False, wait=wait) == ([], True)
    name = appliance.read("data/odid/autopilot-port")
    assert name and appliance.read("run/mavlink-router.heard") == name


def test_the_port_where_the_autopilot_is_heard_is_kept(two_autopilots):
    assert judged(two_autopilots, "/dev/ttyUSB0", heard=True) == ([], True)
    assert two_autopilots.read("data/odid/autopilot-port") == FTDI_NAME + "\n"


def looks(number):
    return f"until [ $(cat /looks | wc -l) -gt {number} ]; do usleep 10000; done"


@pytest.mark.parametrize("asked_s_ago, armed, listened, kept", [
    (None, "disarmed no 1", True, FTDI_NAME), (None, "armed once 1", False, FTDI_NAME),
    (10, "disarmed no 1", False, ACM_NAME),     # it had nothing to say then
    (300, "disarmed no 1", False, FTDI_NAME), (700, "disarmed no 1", True, FTDI_NAME)])
def test_the_port_that_is_kept_stays_so_while_it_is_plugged_in(two_autopilots, asked_s_ago, armed, listened, kept):
    """A device that spoke before the autopilot had started was the autopilot, of the next flights as well. All are listened to once
    more, on the ground."""
    two_autopilots.write("data/odid/autopilot-port", FTDI_NAME + "\n")
    two_autopilots.write("armed", armed + "\n")
    if asked_s_ago:
        two_autopilots.write("run/mavlink-router.asked", f"{int(float(open('/proc/uptime', encoding='ascii').read().split()[0])) - asked_s_ago}\n")
    assert judged(two_autopilots, "/dev/ttyACM1", heard=True, wait=looks(7)) == (["sv term mavlink-router"] * listened, True)
    assert two_autopilots.read("data/odid/autopilot-port").strip() in (kept, *([ACM_NAME] * listened))  # the router that ends is looked at on


@pytest.mark.parametrize("number, armed, kept", [
    (13, "disarmed no 1", "usb-Other-if00"), (20, "disarmed no 1", FTDI_NAME), (20, "armed once 1", "usb-Other-if00")])
def test_one_that_isn_t_plugged_in_any_more_is_kept_for_a_minute_and_in_the_air(two_autopilots, number, armed, kept):
    """It came later than the other one, or was gone for a moment in flight, and was nobody from then on."""
    two_autopilots.write("data/odid/autopilot-port", "usb-Other-if00\n")
    two_autopilots.write("armed", armed + "\n")
    assert judged(two_autopilots, "/dev/ttyUSB0", heard=True, wait=looks(number)) == ([], True)
    assert two_autopilots.read("data/odid/autopilot-port") == kept + "\n"


def test_an_armed_aircraft_s_port_is_judged_once_it_has_landed(two_autopilots):
    """Only its third look counted."""
    two_autopilots.write("data/odid/autopilot-port", FTDI_NAME + "\n")
    two_autopilots.write("armed", "armed once 1\n")
    landing = f"{looks(6)}; echo disarmed once 1 >/armed; {looks(12)}"
    assert judged(two_autopilots, "/dev/ttyACM1", heard=True, wait=landing) == (["sv term mavlink-router"], True)


@pytest.mark.parametrize("device, waited", [("auto", ["5", "10", "15"]), ("/dev/ttyAMA0", [])])
def test_nobody_takes_the_place_of_one_that_is_starting(two_autopilots, device, waited):
    """At power-on it isn't on USB yet; what was there instead was taken without having said a word."""
    two_autopilots.write("data/odid/autopilot-port", "usb-Other-if00\n")
    two_autopilots.settings(autopilot__device=device)
    two_autopilots.change("etc/sv/mavlink-router/run", ("/proc/uptime", "/uptime"), ("pause 1", "echo $((up += 5)).0 0 >/uptime; echo $up >>/waited"))
    two_autopilots.write("uptime", "3.0 0\n")
    two_autopilots.write("waited", "")
    two_autopilots.must("mknod /dev/ttyAMA0 c 4 65")
    search(two_autopilots, "echo /dev/ttyACM0")
    assert two_autopilots.read("waited").split() == waited and two_autopilots.exists("began")


def test_where_only_one_port_is_wanted_nothing_is_judged(two_autopilots):
    two_autopilots.settings(autopilot__device="usb:0403:6001")
    assert judged(two_autopilots, "/dev/ttyUSB0", heard=False) == ([], True)


STOPPED = "kill -STOP $router"
ITS_END = "while kill -0 $router; do usleep 10000; done 2>/dev/null"


@pytest.mark.parametrize("hang", [{"before": STOPPED}, {"unread": "00000300"}])
def test_a_router_that_hangs_is_ended(appliance, hang):
    """It was waited for until power-off, as for an autopilot that is switched off; and the aircraft flew without a position."""
    appliance.port("ttyACM0", "1-1", 0, **PIXHAWK)
    assert judged(appliance, "/dev/ttyACM0", heard=False, wait=ITS_END, **hang) == ([], False)


@pytest.mark.parametrize("heard, hang", [(False, {}), (True, {"unread": "00000300"}), (True, {"before": STOPPED})])
def test_a_router_that_waits_for_its_autopilot_or_hears_it_is_left_alone(appliance, heard, hang):
    appliance.port("ttyACM0", "1-1", 0, **PIXHAWK)
    assert judged(appliance, "/dev/ttyACM0", heard, **hang) == ([], True)


def test_a_router_that_is_flooded_is_left_alone(appliance):
    """It works off what comes: at two looks there was something, and it was killed in the air."""
    appliance.port("ttyACM0", "1-1", 0, **PIXHAWK)
    drained = """cp /udp /unread; sed s/00000300/00000000/ /udp >/read
        (while kill -0 $router; do cp /unread /new; mv /new /udp; usleep 200000; cp /read /new; mv /new /udp; usleep 40000; done 2>/dev/null) &"""
    assert judged(appliance, "/dev/ttyACM0", heard=False, before=drained, unread="00000300") == ([], True)


def test_the_judge_ends_with_its_router(appliance):
    """Each start has its own."""
    appliance.port("ttyACM0", "1-1", 0, **PIXHAWK)
    assert judged(appliance, "/dev/ttyACM0", heard=True, before="started=$((started + 1))", wait="wait $!") == ([], True)
    assert len(appliance.read("looks")) == 1


@pytest.mark.parametrize("last, used, since_s, heard, restarted", [
    (FTDI_NAME, "", 0, True, True),  # several are being listened to: this one is to be among them
    (FTDI_NAME, "/dev/ttyACM1", 9, False, True),  # the one that had the autopilot last is back
    (FTDI_NAME, "/dev/ttyACM1", 1, True, True),  # so soon it was heard on the port before
    (FTDI_NAME, "/dev/ttyACM1", 9, True, False),  # the autopilot has moved, or another device has its name
    ("usb-ArduPilot_Pixhawk__1__3E_00-if00", "/dev/ttyACM1", 9, False, False),  # another: autopilot-judge's
    ("", "/dev/ttyACM1", 9, True, False),
    (FTDI_NAME, "/dev/ttyUSB0", 0, False, False),  # it is this one's own arrival
])
def test_a_port_arrives(two_autopilots, last, used, since_s, heard, restarted):
    two_autopilots.write("status.json", '{ "speaks": %s }\n' % ("true" if heard else "false"))
    if last:
        two_autopilots.write("data/odid/autopilot-port", last + "\n")
    if used:
        uptime_s = int(float(open("/proc/uptime", encoding="ascii").read().split()[0]))
        two_autopilots.write("run/mavlink-router.port", f"{used}\n{uptime_s - since_s}\n")
    two_autopilots.must("mkdir -p /run/service/mavlink-router/supervise && "
                        "mkfifo /run/service/mavlink-router/supervise/control && "
                        "ACTION=add MDEV=ttyUSB0 /lib/odid/device-autopilot")
    assert two_autopilots.calls() == ["sv term mavlink-router"] * restarted + ["sv up mavlink-router"]
    assert two_autopilots.exists("run/mavlink-router.back") == restarted


@pytest.mark.parametrize("last", ["", "usb-Other-if00"])
def test_the_only_port_takes_nobody_s_place(appliance, last):
    """Its arrival had it taken at once, while the autopilot was starting and had no port yet."""
    appliance.port("ttyUSB0", "1-2", 0, 0, **FTDI)
    if last:
        appliance.write("data/odid/autopilot-port", last + "\n")
    appliance.must("mkdir -p /run/service/mavlink-router/supervise && mkfifo /run/service/mavlink-router/supervise/control && "
                   "ACTION=add MDEV=ttyUSB0 /lib/odid/device-autopilot")
    assert appliance.calls() == ["sv term mavlink-router", "sv up mavlink-router"] and not appliance.exists("run/mavlink-router.back")


def arrives(appliance):
    """Its arrival, in shell."""
    appliance.must("mkdir -p /run/service/mavlink-router/supervise && mkfifo /run/service/mavlink-router/supervise/control")
    return "ACTION=add MDEV=ttyACM1 /lib/odid/device-autopilot >/dev/null"


@pytest.mark.parametrize("last, anew", [
    ("", False), (FTDI_NAME, False), ("usb-Other-if00", False), ("usb-ArduPilot_Pixhawk__1__3E_00-if00", True)])
def test_a_port_that_comes_and_goes_keeps_nobody_from_listening_to_the_others(two_autopilots, last, anew):
    """Each time that it came the listening began anew: one that came every other second kept the autopilot from being found."""
    if last:
        two_autopilots.write("data/odid/autopilot-port", last + "\n")
    search(two_autopilots, f"{arrives(two_autopilots)}; echo /dev/ttyACM0")
    assert two_autopilots.calls() == ["sv term mavlink-router"] * anew + ["sv up mavlink-router"]
    assert "/dev/ttyACM0" in two_autopilots.read("began")


def test_a_port_that_comes_while_nobody_listens_is_begun_with_at_once(two_autopilots):
    """The service is down, or has looked already which ports are there; what an earlier listening left says nothing of it."""
    arrival = arrives(two_autopilots)
    two_autopilots.must(arrival)
    assert two_autopilots.calls() == ["sv term mavlink-router", "sv up mavlink-router"]
    two_autopilots.write("calls", "")
    two_autopilots.write("run/mavlink-router.found", "")
    two_autopilots.change("etc/sv/mavlink-router/run", ("set -- $(/lib/odid/autopilot-port)", f"{arrival}; exit"))
    two_autopilots.must("cd /etc/sv/mavlink-router && ./run")
    assert two_autopilots.calls() == ["sv term mavlink-router", "sv up mavlink-router"]


def test_a_device_that_does_not_answer_keeps_nobody_from_the_others(two_autopilots):
    """The kernel has its texts wait for what else is done with it, and mdev, the router and its judge stood still for minutes."""
    (product,) = [path for path in (two_autopilots.root / "sys").rglob("product") if path.read_text().startswith("FT232R")]
    product.unlink()
    os.mkfifo(product)
    assert two_autopilots.must("/lib/odid/autopilot-port").split() == ["/dev/ttyACM1", "/dev/ttyACM0"]


def silent_devices(appliance):
    """Six that don't answer, one of them with as many ports as one can have, and that they do so for two seconds."""
    for interface in range(15):
        appliance.port(f"ttyACM{interface + 2}", "1-3", interface, idVendor="1209", idProduct="0001")
    for number in range(5):
        appliance.port(f"ttyUSB{number + 1}", f"1-4.{number}", 0, 0, idVendor="0403", idProduct="6001")
    for device in ("1-3", *(f"1-4.{number}" for number in range(5))):
        os.mkfifo(appliance.root / "sys/devices" / device / "product")
    appliance.write("asking", 'echo asked >>/asked\ntimeout -s KILL 2 "$@"\nstatus=$?\necho over >>/asked\nexit $status\n')
    appliance.change("lib/odid/autopilot-port", ("timeout -s KILL 1 ", "sh /asking "))


def test_devices_that_do_not_answer_cost_a_second_together(two_autopilots):
    """It was one for each of their ports, at each look of mdev's, the router's and its judge's."""
    silent_devices(two_autopilots)
    assert two_autopilots.must("/lib/odid/autopilot-port").split() == ["/dev/ttyACM1", "/dev/ttyUSB0", "/dev/ttyACM0"]
    happened = two_autopilots.read("asked").split()
    assert happened.count("asked") == 6 + 2, "a device is asked once"
    assert "asked" not in happened[[at for at, what in enumerate(happened) if what == "over"][2]:], "one was waited for before another was asked"


@pytest.mark.parametrize("action, subsystem", [("add", "usb-serial"), ("bind", "usb-serial"), ("unbind", "usb-serial"), ("change", "tty")])
def test_a_port_that_is_told_of_again_ends_no_start(two_autopilots, action, subsystem):
    """A slow board's service hadn't taken the port yet, and began anew with each of the three that the kernel says."""
    two_autopilots.must("mkdir -p /run/service/mavlink-router/supervise && mkfifo /run/service/mavlink-router/supervise/control")
    two_autopilots.must(f"ACTION={action} SUBSYSTEM={subsystem} MDEV=ttyUSB0 /lib/odid/device-autopilot")
    assert two_autopilots.calls() == []
    two_autopilots.must("ACTION=add SUBSYSTEM=tty MDEV=ttyUSB0 /lib/odid/device-autopilot")
    assert two_autopilots.calls() == ["sv term mavlink-router", "sv up mavlink-router"]


def test_devices_that_answer_cost_no_second(two_autopilots):
    """BusyBox's timeout leaves a process behind that looks each second whether it is needed. An autopilot that was plugged in was
    heard three seconds later, where it had been one."""
    two_autopilots.write("asking", '{ sleep 20; echo >>/over; } &\nexec "$@"\n')
    two_autopilots.change("lib/odid/autopilot-port", ("timeout -s KILL 1 ", "sh /asking "))
    said = two_autopilots.must("/lib/odid/autopilot-port >/found 2>/dev/null; [ -e /over ] || cat /found")
    assert said.split() == ["/dev/ttyACM1", "/dev/ttyUSB0", "/dev/ttyACM0"]
    assert two_autopilots.must("find /run -name 'usb-texts*'") == ""


@pytest.mark.parametrize("there", [True, False])
def test_for_a_port_that_is_not_on_usb_no_device_is_asked(two_autopilots, there):
    silent_devices(two_autopilots)
    two_autopilots.settings(autopilot__device="/dev/ttyAMA2")
    if there:
        two_autopilots.must("mknod /dev/ttyAMA2 c 4 66")
    result = two_autopilots.run("/lib/odid/autopilot-port")
    assert (result.returncode, result.stdout) == ((0, "/dev/ttyAMA2\n") if there else (1, ""))
    assert not two_autopilots.exists("asked")


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
    assert made["UartEndpoint autopilot"] == {"Device": "/dev/ttyACM1", "Baud": "921600", "FlowControl": "false",
                                              "BlockSrcCompIn": "236,237,238"}
    assert made["UdpEndpoint daemon"] == {"Mode": "Normal", "Address": "127.0.0.1", "Port": "14550",
                                          "AllowSrcCompIn": "236"}
    station = made.get("UdpEndpoint ground_station")
    assert (station and (station["Address"], station["Port"])) == endpoint
    assert "@" not in str(made)


@pytest.mark.parametrize("vehicle", [None, "7", "42", "199", "255"])
def test_nobody_on_the_ground_speaks_as_the_vehicle(appliance, vehicle):
    appliance.settings(ground_station__address="10.0.0.9")
    if vehicle:
        appliance.write("data/odid/vehicle", f"{vehicle}\n")
    made = sections(appliance.must("/lib/odid/mavlink-router-config /dev/ttyACM1"))
    for name, keys in made.items():
        if "Endpoint" in name and name not in ("UartEndpoint autopilot", "UdpEndpoint daemon"):
            assert keys["BlockSrcSysIn"] == (vehicle or "1") and keys["BlockSrcCompIn"] == "1,236,237,238"
            assert keys["BlockMsgIdIn"] == "12918,256,126,2,109,166,386,387,388,232,113,48,233,100,106,114,132,295,90,107,115,149,151,101,102,103,104,138,331,11011,296,123,11000,11002"


def loaded(appliance):
    """What the firewall's script gives nft to load at once."""
    appliance.write("usr/bin/nft", '#!/bin/sh\necho "nft $*" >>/calls\n[ "$2" != - ] || cat >>/loaded\n')
    appliance.must("/lib/odid/firewall")
    return appliance.read("loaded")


@pytest.mark.parametrize("address, drops", [("", False), ("none", False), ("10.0.0.9", True), ("10.0.0.9:14551", True)])
def test_the_ground_station_is_heard_by_its_own_way_only(appliance, address, drops):
    """A USB adapter's DHCP server took its network, and answers to its address were taken from there."""
    appliance.settings(ground_station__address=address)
    rule = 'insert rule inet odid input ip saddr 10.0.0.9 iif != "lo" iif != @way counter drop'
    rate = ('insert rule inet odid input iif @way ip saddr 10.0.0.9 meta l4proto udp limit rate over 60000 bytes/second '
            'burst 8 kbytes counter drop')
    rules = loaded(appliance)
    assert (rule in rules) == (rate in rules) == drops
    # The daemon, taken over, told the pilot what it liked, as the vehicle, by a socket that was root's.
    assert 'add rule inet odid output oif != "lo" udp sport 14550 counter drop' in rules
    assert 'insert rule inet odid input ip daddr 192.168.41.0/24 iif != "lo" iifname != "wlan0" counter drop' in rules


@pytest.mark.parametrize("rule", [
    # hawkBit's client, taken over, told the pilot what it liked, as the vehicle.
    'oif != "lo" meta l4proto udp meta skuid { "odid", "odid-web", "hostapd", "odid-beacons" } counter drop',
    'oif != "lo" udp dport != 53 meta skuid "odid-hawkbit" counter drop',
    # The page's program, taken over, connected to whom it liked by a socket that had been accepted, or that root had opened.
    'tcp flags & (syn | ack) == syn tcp sport { 22, 80 } counter drop',
    'tcp flags & (syn | ack) == syn meta skuid "odid-web" counter drop',
    'meta skuid "odid-hawkbit" ct state new limit rate over 5/second burst 20 packets counter drop'])
def test_what_the_board_s_own_programs_say_to_others_is_filtered(appliance, rule):
    chain = loaded(appliance).partition("chain output {")[2].partition("}\n\n")[0]
    assert f"\t\t{rule}\n" in chain


@pytest.mark.parametrize("before, asks", [("", True), ("7", True), ("9", False)])
def test_a_lease_that_came_before_the_filter_knew_the_way_is_asked_for_again(appliance, before, asks):
    """It was a stranger's, until it was given for longer: nothing went to the ground station."""
    appliance.settings(ground_station__address="10.0.0.9")
    appliance.write("sys/class/net/eth0/ifindex", "9\n")
    appliance.write("run/odid-appliance/firewall", f"{before}\n")
    appliance.write("run/faults/dhcp-eth0", "The adapter at eth0 is another one than the ground station's.\n")
    loaded(appliance)
    assert ("sv term udhcpc" in appliance.calls()) == asks and appliance.read("run/odid-appliance/firewall") == "9\n"


@pytest.mark.parametrize("before, said", [(False, "SSH and maintenance stay closed"), (True, "stays as it was")])
def test_a_filter_that_can_not_be_loaded_says_what_is_open(appliance, before, said):
    """Loaded anew in vain, it goes on as it was; and it was said that SSH and maintenance are closed."""
    if before:
        appliance.write("run/odid-appliance/firewall", "\n")
    appliance.write("usr/bin/nft", "#!/bin/sh\nexit 1\n")
    assert appliance.run("/lib/odid/firewall").returncode == 1 and said in appliance.fault("firewall")


def test_a_filter_that_can_not_be_loaded_at_boot_is_tried_again(appliance):
    """SSH and maintenance stayed closed until power-off."""
    appliance.change("etc/init.d/S50firewall", ("sleep $pause", ":"), ("nice -n 5 ", ""))
    appliance.write("lib/odid/firewall", "#!/bin/sh\necho load >>/calls\n[ $(wc -l </calls) -ge 2 ]\n")
    appliance.write("calls", "")
    appliance.must(". /etc/init.d/S50firewall; wait")
    assert appliance.calls() == ["load"] * 2


WAY = "add element inet odid way { 2 }"


def test_no_other_interface_is_the_ground_station_s_by_its_name(appliance):
    """hostapd, taken over, gave the access point's interface the name of the ground station's."""
    appliance.settings(ground_station__address="10.0.0.9")
    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    assert WAY in loaded(appliance)
    (appliance.root / "sys/class/net/eth0/phy80211").mkdir()
    appliance.write("loaded", "")
    assert "element inet odid way" not in loaded(appliance)
    assert "eth0 is a radio" in appliance.fault("way")
    appliance.must("rm -r /sys/class/net/eth0/phy80211 && mkdir /sys/class/net/2")    # for nft a name comes before a number
    appliance.write("loaded", "")
    assert "element inet odid way" not in loaded(appliance)


def test_the_ground_station_s_interface_may_come_and_go(appliance):
    appliance.settings(ground_station__address="10.0.0.9")
    assert "element inet odid way" not in loaded(appliance)

    def event(action, *others):
        appliance.write("loaded", "")
        for name in ("eth0", *others):
            if action == "add":
                plugged(appliance, name)
            else:
                appliance.must(f"ACTION={action} MDEV={name} /lib/odid/device-network")
        return appliance.read("loaded")

    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    appliance.must("rm /run/lock/firewall")
    assert event("add", "eth0", "usb1").count(WAY) == 1
    assert [appliance.must(f"stat -c %a /run/{file}").strip() for file in ("lock/firewall", "odid-appliance/firewall")] == ["644"] * 2
    assert not event("add")
    # Whoever else may have its name now: it is there still.
    appliance.must("mv /sys/class/net/eth0 /sys/class/net/x")
    appliance.write("sys/class/net/eth0/ifindex", "5\n")
    assert not event("remove", "wlan1")
    appliance.must("rm -r /sys/class/net/eth0 /sys/class/net/x")
    gone = event("remove", "eth0")
    assert gone.count("table inet odid {") == 1 and WAY not in gone
    # A layer's program gives its interface that name.
    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    assert WAY in event("move")
    # Before the filter is loaded at first it is nobody's to load: it looks itself.
    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    appliance.must("rm /run/odid-appliance/firewall")
    assert not event("add")


def test_a_slow_port_is_not_filled_by_the_ground_station(appliance):
    """The autopilot heard nothing of us any more."""
    appliance.settings(ground_station__address="10.0.0.9", autopilot__baud="57600")
    assert "limit rate over 3840 bytes/second" in loaded(appliance)


def test_a_cable_fills_nobody_s_table_of_neighbours(appliance):
    """1,024 invented senders were all that the kernel remembers, of the Wi-Fi's technician's interface, too. Whoever asks becomes
    one, and whoever is answered; a limit for all interfaces together would drop what is asked at the others."""
    rules = loaded(appliance)
    limit = "limit rate over 50/second burst 20 packets } counter drop"
    assert 'iif != "lo" iifname != "wlan0" arp operation request update @asking { iifname ' + limit in rules
    assert "update @answering { oifname " + limit in rules and not appliance.fault("arp")
    for answer in ("tcp sport { 22, 80 } tcp flags & (syn | rst) != 0x0", "udp sport 67", "meta l4proto icmp"):
        assert f"\t{answer} jump bounded\n" in rules


def test_no_program_takes_the_technician_s_tries(appliance):
    """The page was closed to everybody by Wi-Fi and by cable, and SSH as well."""
    assert '\t\toif "lo" tcp dport { 22, 80 } meta skuid != "root" counter drop\n' in loaded(appliance)


def test_only_mavlink_router_speaks_to_another_program(appliance):
    """Any process took its telemetry, and spoke as the daemon, by a datagram to its port; and hostapd from the daemon's own port at
    another one of lo's addresses. By lo's number: its name can be another interface's."""
    rules = loaded(appliance)
    assert 'output oif "lo" meta l4proto udp udp sport != 14550 meta skuid != "mavlink" counter drop' in rules
    assert 'output oif "lo" meta l4proto udp udp sport 14550 meta skuid != { "root", "odid" } counter drop' in rules
    assert 'output oif "lo" meta l4proto udp ip saddr != 127.0.0.1 meta skuid != "mavlink" counter drop' in rules
    assert "ct direction" not in rules and 'oif "lo" meta l4proto udp notrack' in rules
    assert 'add rule inet odid output meta skuid mavlink oif != lo oif != @way counter drop' in rules
    assert not re.search(r'[io]ifname[^\n]*\blo\b', rules)
    # And what a packet socket puts on lo has no way yet.
    of_both = 'iif "lo" ip protocol { tcp, udp }'
    assert f'{of_both} rt ip nexthop >= 0.0.0.0 accept\n\t\t{of_both} counter drop\n' in rules
    assert '\t\tiif "lo" meta nfproto ipv6 counter drop\n' in rules
    for outside in ("rt ip nexthop >= 0.0.0.0", "ip daddr 127.0.0.0/8", "ip saddr 127.0.0.0/8"):
        assert f"\t\t{outside} counter drop\n" in rules
    # Source routing changes where a packet goes after prerouting.
    assert rules.index("ip daddr 127.0.0.0/8 counter drop", rules.index("chain input")) < rules.index("ct state established")
    assert "-u mavlink:" in appliance.read("etc/sv/mavlink-router/run")


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


@pytest.mark.parametrize("file, name", [("RemoteID-1234", "RemoteID-1234"), ("", "RemoteID"), (None, "RemoteID")])
def test_the_access_point_has_the_name_of_which_its_key_is_made(appliance, file, name):
    """A name whose line had no end any more: hostapd had another one, and no password fitted."""
    if file is not None:
        appliance.write("data/secrets/wifi_ssid", file)
    assert hostapd(appliance)[0]["ssid"] == name


def test_hostapd_reads_its_files_by_its_group_and_nobody_else_does(appliance):
    hostapd(appliance)
    for name in ("hostapd.conf", "hostapd.psk"):
        file = (appliance.root / "run" / name).stat()
        assert (file.st_uid, file.st_gid, file.st_mode & 0o777) == (0, USERS["hostapd"][1], 0o640)
    assert [name for name, (_, gid) in USERS.items() if gid == USERS["hostapd"][1]] == ["hostapd"]


def test_hostapd_is_started_without_root_s_rights_and_only_it_and_the_daemon_s_group_are_in_its_folder(appliance):
    """Whoever had its control socket had it delete root's files: SET ctrl_interface, SET interface, TERMINATE."""
    appliance.write("usr/bin/odid-confine", """#!/bin/sh
echo "$0 $*" >/began
{ ls /run/hostapd; stat -c '%u %g %a' /run/hostapd; ulimit -n; } >>/began
grep '^hostapd /run/hostapd' /proc/mounts >/mounted
""")
    appliance.write("usr/bin/iw", NOTES)
    for name in ("odid-confine", "iw"):
        (appliance.root / "usr/bin" / name).chmod(0o755)
    appliance.write("run/hostapd/wlan0", "a killed one's")
    appliance.must("mkdir -p /sys/class/net/wlan0 && cd /etc/sv/hostapd && ./run")
    assert appliance.read("began").splitlines() == [
        "/usr/bin/odid-confine -u hostapd hostapd /run/hostapd.conf", f"{USERS['hostapd'][0]} {NETDEV} 750", "64"]
    assert "\necho -900 >/proc/self/oom_score_adj\n" in appliance.read("etc/sv/hostapd/run"), "else its limit ends nobody"
    # What it makes there, by the thousand or so deep that nobody can take it away, is none of the next one's or anybody else's.
    (mounted,) = appliance.read("mounted").splitlines()
    # Made for everybody, it took somebody else's socket in the moment before chmod.
    assert "mode=700" in mounted and "size=64k" in mounted and "nr_inodes=16" in mounted and "noexec" in mounted
    assert appliance.read("sys/fs/cgroup/hostapd/memory.max").strip() == str(24 << 20)


def test_who_asks_the_chip_has_one_right_and_a_folder_of_its_own(appliance):
    appliance.write("usr/bin/odid-confine", """#!/bin/sh
echo "$*" >/began
{ stat -c '%u %g %a' /run/odid-beacons; cat /proc/self/oom_score_adj; } >>/began
grep '^odid-beacons /run/odid-beacons' /proc/mounts >/mounted
""")
    (appliance.root / "usr/bin/odid-confine").chmod(0o755)
    appliance.settings(broadcast__wifi_iface="wlan1")
    appliance.must("cd /etc/sv/odid-beacons && ./run")
    uid, gid = USERS["odid-beacons"]
    assert appliance.read("began").splitlines() == ["-r odid-beacons odid-beacons wlan1 /run/odid-beacons/count", f"{uid} {gid} 755", "0"]
    (mounted,) = appliance.read("mounted").splitlines()
    assert "size=16k" in mounted and "nr_inodes=8" in mounted and "noexec" in mounted
    assert appliance.read("sys/fs/cgroup/odid-beacons/memory.max").strip() == str(4 << 20)
    appliance.settings(broadcast__wifi_beacon_enabled="false")
    appliance.must("cd /etc/sv/odid-beacons && ./run")
    assert appliance.calls() == ["sv down odid-beacons"]
    appliance.write("settings", "")  # nobody answers: tried again
    assert appliance.run("cd /etc/sv/odid-beacons && ./run").returncode == 1


def test_another_radio_that_is_to_listen_is_switched_on(appliance):
    """When the service begins, and when its adapter comes; and nothing else that has its name."""
    appliance.write("usr/bin/odid-confine", "#!/bin/sh\necho $* >/began\n")
    (appliance.root / "usr/bin/odid-confine").chmod(0o755)
    appliance.settings(wifi__listener="wlan1")
    appliance.change("etc/sv/odid-beacons/run", ("ip link", "/usr/bin/ip link"))
    appliance.must("cd /etc/sv/odid-beacons && ./run")
    assert appliance.read("began").split()[-1] == "wlan1" and appliance.calls() == ["ip link set wlan1 up"]
    appliance.must("mkdir -p /run/service/odid-beacons/supervise && mkfifo /run/service/odid-beacons/supervise/control")
    for radio, times in ((False, 0), (True, 1)):
        if radio:
            (appliance.root / "sys/class/net/wlan1/phy80211").mkdir(parents=True)
        appliance.must("ACTION=add MDEV=wlan1 /lib/odid/device-network; ACTION=remove MDEV=wlan1 /lib/odid/device-network")
        assert appliance.calls().count("sv term odid-beacons") == times
    # In the air its driver would hold up the kernel's network, and hostapd's next beacon.
    appliance.write("armed", "armed once 1 said\n")
    appliance.must("cd /etc/sv/odid-beacons && ./run")
    assert appliance.calls().count("ip link set wlan1 up") == 1


def test_what_mdev_starts_makes_nothing_that_everybody_writes(appliance):
    """mdev's umask is 0. Into the name of the port that had come back anybody wrote another one, with sed's words in it, for root."""
    appliance.port("ttyACM0", "1-1", 0, **PIXHAWK)
    appliance.write("data/odid/autopilot-port", ACM_NAME + "\n")
    scripts = set(re.findall(r"[@*]/(lib/odid/[a-z-]+)", appliance.read("etc/mdev.conf")))
    assert len(scripts) == 4
    supervised(appliance)
    appliance.must("mkdir -p /run/service/mavlink-router/supervise && mkfifo -m 600 /run/service/mavlink-router/supervise/control")
    for script, device in {"device-network": "usb0", "device-autopilot": "ttyACM0"}.items():
        (appliance.root / "sys/class/net/usb0/device").mkdir(parents=True, exist_ok=True)
        appliance.run(f"umask 0; ACTION=add MDEV={device} /lib/odid/{script}")
    assert appliance.exists("run/mavlink-router.back") and appliance.exists("run/service/udhcpc-usb0")
    for script in scripts:
        assert "\n. /lib/odid/functions\n" in appliance.read(script) or ">" not in appliance.read(script)
    assert appliance.must("umask 0; . /lib/odid/functions; umask").strip() == "0022"
    assert appliance.must("find /run ! -type l -perm /022").split() == []


@pytest.mark.parametrize("back", ["/dev/ptmx", "/dev/ttyACM1|w/etc/owned", "/dev/null"])
def test_only_a_port_that_is_one_comes_back(two_autopilots, back):
    two_autopilots.write("run/mavlink-router.back", back + "\n")
    search(two_autopilots, "echo /dev/ttyACM0")
    assert "/dev/ttyACM0" in two_autopilots.read("began") and not two_autopilots.exists("etc/owned")


def test_a_radio_s_interface_is_no_device_of_its_name(appliance):
    """hostapd made one called ttyACM0, and deleted it: mdev ended mavlink-router and removed the autopilot's port; each of another
    name began with eth left a process of root's."""
    rules = [line for line in appliance.read("etc/mdev.conf").splitlines() if line and not line.startswith("#")]
    assert rules[0].split() == ["SUBSYSTEM=net;.*", "root:root", "660", "!", "*/lib/odid/device-network"]
    for name in ("eth0", "ethA", "usb0"):
        appliance.write(f"sys/class/net/{name}/phy80211/name", "phy0\n")
        (appliance.root / f"sys/class/net/{name}/device").mkdir()
        appliance.must(f"MDEV={name} ACTION=add /lib/odid/device-network")
    assert appliance.calls() == [] and not list((appliance.root / "run").glob("service/udhcpc-*"))


def test_a_radio_itself_is_no_device_of_its_name_either(appliance):
    """hostapd called the radio ttyACM0, and had it go."""
    rules = [line for line in appliance.read("etc/mdev.conf").splitlines() if line and not line.startswith("#")]
    assert rules[1].split() == ["SUBSYSTEM=ieee80211;.*", "root:root", "660", "!"]


@pytest.mark.parametrize("action, adapter", [("move", True), ("change", True), ("add", False)])
def test_a_name_alone_starts_nothing(appliance, action, adapter):
    """Each name that hostapd gave to eth0, or to a radio's interface that it deleted at once, left a process of root's."""
    for number in range(3):
        if adapter:
            (appliance.root / f"sys/class/net/usb{number}/device").mkdir(parents=True)
        appliance.must(f"MDEV=usb{number} ACTION={action} /lib/odid/device-network; MDEV=usb{number} ACTION=remove /lib/odid/device-network")
    assert appliance.calls() == [] and not list((appliance.root / "run").glob("service/udhcpc-*"))


def test_not_more_adapters_are_served_than_a_board_has(appliance):
    supervised(appliance)
    for number in range(12):
        plugged(appliance, f"usb{number}")
    assert 6 <= len(list((appliance.root / "run/service").glob("udhcpc-*"))) <= 8
    assert "isn't served" in appliance.fault("adapters")


@pytest.mark.parametrize("chip", ["", "echo $$ >/waits; exec sleep 1000"])
def test_the_board_s_own_bluetooth_is_there_before_a_dongle_s_driver_is_loaded(appliance, chip):
    """Who is there first is hci0: a dongle that was plugged in had the name, and the board's own wasn't used. Nor does one that doesn't
    answer keep mdev from its devices."""
    appliance.must("mkdir -p /lib/modules/$(uname -r)")
    appliance.write("sys/bus/serial/devices/serial0-0/modalias", "of:NbluetoothT(null)Cbrcm,bcm43438-bt\n")
    appliance.write("sys/bus/usb/devices/1-1:1.0/modalias", "usb:v0A12p0001d8891dcE0dsc01dp01icE0isc01ip01in00\n")
    for path, text in {"usr/bin/modprobe": NOTES + chip + "\n", "usr/bin/mdev": NOTES, "lib/odid/coldplug": "#!/bin/sh\n"}.items():
        appliance.write(path, text)
        (appliance.root / path).chmod(0o755)
    appliance.change("etc/sv/mdev/run", ("modprobe -a", "/usr/bin/modprobe -a"), ("exec mdev", "exec /usr/bin/mdev"))  # BusyBox has its own
    appliance.must("/etc/sv/mdev/run")
    if chip:
        os.kill(int(appliance.read("waits")), signal.SIGKILL)
    assert appliance.calls() == ["modprobe -a -b -q of:NbluetoothT(null)Cbrcm,bcm43438-bt", "mdev -df"]


def test_only_the_daemon_blocks_and_unblocks_radios(appliance):
    """hostapd blocked Bluetooth again each time that the daemon had unblocked it."""
    (rights,) = re.findall(r"^rfkill\s+(\S+ \S+)$", appliance.read("etc/mdev.conf"), re.M)
    assert rights == "odid:netdev 640"
    early = appliance.read("etc/init.d/S20devices")
    assert "chown odid:netdev /dev/rfkill" in early and "chmod 640 /dev/rfkill" in early


def test_hostapd_can_answer_root_and_nobody_else_is_among_the_answers(appliance):
    """Its user writes to the asking program's socket; and gets into that folder, where it makes no name."""
    (made,) = re.findall(r"^mkdir -p /run/hostapd-cli\n(?:.* /run/hostapd-cli\n)+", appliance.read("etc/init.d/S01mounts"), re.M)
    appliance.must(made)
    folder = (appliance.root / "run/hostapd-cli").stat()
    assert (folder.st_uid, folder.st_gid, folder.st_mode & 0o777) == (0, USERS["hostapd"][1], 0o710)
    appliance.write("usr/bin/hostapd_cli", '#!/bin/sh\numask >>/umasks; echo "state=ENABLED OK"\n')
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.must("mkdir -p /sys/class/net/wlan0; /lib/odid/maintenance on")
    appliance.change("etc/sv/hostapd-watch/run", ("pause 1", "usleep 20000"))
    with watched_by(appliance, "hostapd-watch", "hostapd"):
        wait_for("several looks", lambda: appliance.read("umasks").count("\n") > 6)
    assert set(appliance.read("umasks").split()) == {"0000"}


def test_wifi_switched_off_has_no_configuration(appliance):
    hostapd(appliance)
    appliance.settings(broadcast__wifi_beacon_enabled="false")
    appliance.must("/lib/odid/hostapd-config /run/hostapd.conf")
    assert not appliance.exists("run/hostapd.conf")


@pytest.mark.parametrize("setting, code, calls", [
    ({"broadcast__wifi_beacon_enabled": "false"}, 0, ["sv down hostapd"]), ({"broadcast__wifi_iface": ""}, 1, [])])
def test_only_wifi_that_is_switched_off_has_no_hostapd(appliance, setting, code, calls):
    """A configuration that couldn't be made at that moment passed for Wi-Fi switched off: there was none until power-off."""
    appliance.settings(**setting)
    assert appliance.run("/etc/sv/hostapd/run").returncode == code
    assert appliance.calls() == calls and bool(appliance.fault("access_point")) == bool(code)


def test_a_hostapd_started_in_maintenance_is_open(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("run/odid-appliance/maintenance", "on\n")
    made, key = hostapd(appliance)
    assert (made["max_num_sta"], key) == ("200", KEY)


@pytest.mark.parametrize("damaged", [KEY[:-1], KEY + "7", KEY[:-1] + "x", KEY.upper().replace("7", "G")])
def test_a_damaged_key_takes_remote_id_off_nothing(appliance, damaged):
    """hostapd didn't start with it while maintenance was on."""
    appliance.write("data/secrets/maintenance.psk", damaged + "\n")
    appliance.write("run/odid-appliance/maintenance", "on\n")
    key = hostapd(appliance)[1]
    assert re.fullmatch("[0-9a-f]{64}", key) and key != damaged
    assert "Set [maintenance] password anew" in appliance.fault("secrets")


def test_a_key_that_cannot_be_read_is_said_to_be(appliance):
    """A folder stands for it. Nobody could join, and the report said that a password was set."""
    (appliance.root / "data/secrets/maintenance.psk").mkdir(parents=True)
    appliance.must("/lib/odid/hostapd-key on")
    assert "Set [maintenance] password anew" in appliance.fault("secrets")


@pytest.mark.parametrize("in_force, fault", [("SE", False), ("00", True), ("98", True)])
def test_a_country_that_is_not_in_force_is_a_fault(appliance, in_force, fault):
    hostapd(appliance)
    appliance.write("usr/bin/iw", f"#!/bin/sh\nprintf 'global\\ncountry {in_force}: DFS-ETSI\\n\\t(2400 - 2483 @ 40)\\n'\n")
    (appliance.root / "usr/bin/iw").chmod(0o755)
    appliance.must("/lib/odid/country")
    assert (appliance.fault("country") is not None) == fault
    appliance.write("usr/bin/iw", "#!/bin/sh\necho country SE: DFS-ETSI\n")
    appliance.must("/lib/odid/country")
    assert appliance.fault("country") is None


def test_the_country_is_asked_of_a_hostapd_that_waited_for_it(appliance):
    """Its rules not in force weren't told by anybody, and an update without them was kept."""
    appliance.write("usr/bin/hostapd_cli", "#!/bin/sh\necho looks >>/calls; [ -s /looked ] && echo state=ENABLED || echo state=COUNTRY_UPDATE\n"
                                           "echo once >/looked\n")
    appliance.write("lib/odid/country", "#!/bin/sh\necho country >>/calls\n")
    for name in ("usr/bin/hostapd_cli", "lib/odid/country"):
        (appliance.root / name).chmod(0o755)
    appliance.change("etc/sv/hostapd-watch/run", ("pause 1", "usleep 20000"))
    with watched_by(appliance, "hostapd-watch", "hostapd"):
        wait_for("several looks", lambda: appliance.calls().count("looks") > 5)
        assert appliance.calls().count("country") == 1


# --- networks ---------------------------------------------------------------------------


def plugged(appliance, interface):
    """mdev's word that it came: a device's, as the kernel has it."""
    (appliance.root / f"sys/class/net/{interface}/device").mkdir(parents=True, exist_ok=True)
    appliance.must(f"umask 0; ACTION=add MDEV={interface} /lib/odid/device-network")


def supervised(appliance):
    """sv knows none of these yet; runsv says what it is given."""
    appliance.write("usr/bin/sv", "#!/bin/sh\nexit 1\n")
    appliance.write("usr/bin/runsv", '#!/bin/sh\necho "runsv $*" >>/calls\n')
    for name in ("sv", "runsv"):
        (appliance.root / "usr/bin" / name).chmod(0o755)


def test_each_adapter_that_is_plugged_in_gets_an_address(appliance):
    supervised(appliance)
    for interface in ("eth1", "usb0", "wwan0", "lo", "sit0"):
        plugged(appliance, interface)
    # They aren't waited for.
    wait_for("three of them", lambda: len(appliance.calls()) >= 3)
    time.sleep(0.3)
    assert sorted(appliance.calls()) == [f"runsv /run/service/udhcpc-{name}" for name in ("eth1", "usb0", "wwan0")]
    assert os.readlink(appliance.root / "run/service/udhcpc-usb0/run") == "/etc/sv/udhcpc/run"


def test_one_that_was_there_before_goes_on(appliance):
    """sv knows it."""
    appliance.must("mkdir -p /run/service/udhcpc-usb0")
    plugged(appliance, "usb0")
    appliance.must("ACTION=remove MDEV=usb0 /lib/odid/device-network")
    assert appliance.calls() == ["sv up udhcpc-usb0", "sv down udhcpc-usb0"]


def test_a_computer_on_the_usb_cable_is_given_an_address(appliance):
    supervised(appliance)
    plugged(appliance, "gadget0")
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
    appliance.write("etc/nftables.d/camera.nft", "add rule\n")
    appliance.must("/lib/odid/firewall")
    assert appliance.calls() == ["nft -f -", "nft -f -", "nft -f /etc/nftables.d/camera.nft"]
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


def test_without_a_filter_maintenance_does_not_begin(appliance):
    """It said that maintenance stays closed, and opened it to everybody."""
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("usr/bin/nft", "#!/bin/sh\nexit 1\n")
    assert appliance.run("/lib/odid/maintenance on").returncode == 1
    assert appliance.calls() == [] and not appliance.exists("run/odid-appliance/maintenance")


def test_maintenance_opens_and_closes_without_a_restart(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("sys/class/net/wlan0/operstate", "up\n")
    appliance.must("/lib/odid/maintenance on")
    opened = appliance.calls()
    assert appliance.read("run/hostapd.psk") == f"00:00:00:00:00:00 {KEY}\n"
    appliance.must("/lib/odid/maintenance off")
    closed = appliance.calls()[len(opened):]
    assert KEY not in appliance.read("run/hostapd.psk")
    cli = "hostapd_cli -s /run/hostapd-cli -p /run/hostapd -i wlan0 raw "
    assert [call for call in opened if call.startswith("hostapd_cli")] == [cli + "RELOAD_WPA_PSK", cli + "SET max_num_sta 200"]
    assert [call for call in closed if call.startswith("hostapd_cli")] == [
        cli + "SET max_num_sta 0", cli + "RELOAD_WPA_PSK", cli + "DEAUTHENTICATE ff:ff:ff:ff:ff:ff"]
    assert 'nft add element inet odid maintenance { "wlan0", "eth0", "gadget0" }' in opened
    assert "sv up odid-web" in opened and "sv up udhcpd" in opened
    assert closed[:2] == ["nft flush set inet odid maintenance", "sv down odid-web"] and "sv down udhcpd" in closed
    assert not any("hostapd" in call for call in appliance.calls() if call.startswith("sv "))


def test_what_is_saved_counts_for_what_starts_anew_once_it_is_applied_and_not_before(appliance):
    """An aircraft that was armed had another number, or no telemetry, after a service's restart in flight."""
    appliance.write("usr/bin/odid-keeper", NOTES)
    appliance.must("chmod 755 /usr/bin/odid-keeper")
    appliance.write("lib/odid/board-settings", "#!/bin/sh\n")
    appliance.write("data/odid/odid.conf", "of the boot\n")
    appliance.must("/etc/init.d/S42in-force")
    appliance.write("data/odid/odid.conf", "saved since\n")
    appliance.write("armed", "armed once 1\n")
    appliance.run("/lib/odid/apply-configuration")
    assert appliance.read("run/odid-appliance/odid.conf") == "of the boot\n"
    appliance.must("/etc/sv/odid-daemon/run")
    assert appliance.calls()[-1] == "odid-keeper -- odid-daemon -appliance -config /run/odid-appliance/odid.conf"
    appliance.write("armed", "disarmed once 1\n")
    appliance.run("/lib/odid/apply-configuration")
    assert appliance.read("run/odid-appliance/odid.conf") == "saved since\n"


def test_the_daemon_s_memory_has_an_end(appliance):
    """Taken over, or by a leak, it had all others ended for want of memory, and the board restarted, in the air as well."""
    appliance.write("usr/bin/odid-keeper", "#!/bin/sh\nulimit -v >/limit\n")
    appliance.must("chmod 755 /usr/bin/odid-keeper && /etc/sv/odid-daemon/run")
    assert appliance.read("limit") == "131072\n"


LOCK = """#!/bin/sh
[ "$(readlink /proc/$PPID/fd/$1)" = /run/lock/access-point ] || exit 1
echo locked >>/calls
%s
"""


def lock(appliance, meanwhile=""):
    """meanwhile: what the one does that had the lock until now."""
    appliance.write("usr/bin/flock", LOCK % meanwhile)


def test_a_setting_that_is_saved_while_maintenance_ends_leaves_it_closed(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("run/odid-appliance/maintenance", "on\n")
    hostapd(appliance)
    lock(appliance, "echo off >/run/odid-appliance/maintenance")
    appliance.settings(wifi__channel="11")
    appliance.write("lib/odid/board-settings", "#!/bin/sh\n")  # there is no boot loader here
    appliance.run("/lib/odid/apply-configuration")
    assert "locked" in appliance.calls()
    made = appliance.read("run/hostapd.conf").splitlines()
    assert "channel=11" in made and "max_num_sta=0" in made
    assert KEY not in appliance.read("run/hostapd.psk")


@pytest.mark.parametrize("word", ["on", "off"])
def test_maintenance_changes_nothing_before_it_has_the_lock(appliance, word):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    lock(appliance)
    appliance.must(f"/lib/odid/maintenance {word}")
    assert appliance.calls()[0] == "locked"


def test_the_page_is_there_by_cable_whatever_the_access_point_does(appliance):
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.must("/lib/odid/maintenance on")  # there is no wlan0
    assert "sv up odid-web" in appliance.calls() and "sv up udhcpd" not in appliance.calls()
    appliance.write("sys/class/net/wlan0/operstate", "up\n")
    appliance.write("usr/bin/hostapd_cli", "#!/bin/sh\necho FAIL\n")
    assert appliance.run("/lib/odid/maintenance on").returncode == 1  # to be tried again
    assert appliance.read("run/odid-appliance/maintenance") == "on\n"
    assert appliance.calls()[-1] == "sv up odid-web"


def test_an_access_point_whose_configuration_can_not_be_made_is_tried_again(appliance):
    """It had the technician's key, and room for nobody, and passed for open."""
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("sys/class/net/wlan0/operstate", "up\n")
    appliance.must("/lib/odid/hostapd-config /run/hostapd.conf")
    appliance.settings(wifi__country="")
    assert appliance.run("/lib/odid/maintenance on").returncode == 1
    assert appliance.calls()[-1] == "sv up odid-web" and "can't be made" in appliance.fault("access_point")


def decided(appliance, calls, asked=0):
    """What it does, and that it does no more; asked: how often it asks odidctl at least, where the test counts that."""
    appliance.change("lib/odid/maintenance-decide", ("pause 2\n", "pause 0.1\n"))
    appliance.write("dev/kmsg", "")
    deciding = appliance.start("exec sh /lib/odid/maintenance-decide")
    try:
        wait_for("what it does", lambda: len(appliance.calls()) >= len(calls) and
                 (not asked or appliance.exists("asked") and len(appliance.read("asked").splitlines()) > asked))
        stays("nothing more is done", lambda: len(appliance.calls()) == len(calls), 0.5)
    finally:
        deciding.kill()
        deciding.wait()
    assert appliance.calls() == calls


def test_maintenance_that_began_by_half_is_tried_again_and_ended_by_arming(appliance):
    appliance.write("usr/bin/odidctl", '''#!/bin/sh
case $1 in
get) echo yes ;;
armed) [ "$(wc -l </calls)" -ge 2 ] && echo armed once 1 || echo disarmed never 1 ;;
esac
''')
    appliance.write("lib/odid/maintenance", '#!/bin/sh\necho "maintenance $1" >>/calls\n[ "$1" = off ]\n')
    appliance.write("calls", "")
    decided(appliance, ["maintenance on", "maintenance on", "maintenance off"])


@pytest.mark.parametrize("words, calls", [
    (["disarmed never 0", "unknown never 0", "disarmed never 0"], ["on"]),  # the daemon was started again
    (["disarmed never 0", "unknown never 0"], ["on", "off"]),               # and stays away
    (["unknown never 0"], []),                                              # nobody says that it is disarmed
    (["disarmed once 1"], []),                                              # at boot: until the first flight
])
def test_maintenance_and_a_daemon_that_does_not_answer(appliance, words, calls):
    appliance.write("lib/odid/maintenance", '#!/bin/sh\necho "$1" >>/calls\n')
    appliance.write("usr/bin/odidctl", '''#!/bin/sh
[ "$1" = armed ] || { echo yes; exit; }
echo >>/asked
sed -n "$(wc -l </asked)p;\\$p" /words | head -n 1
''')
    appliance.write("words", "\n".join(words) + "\n")
    appliance.write("calls", "")
    decided(appliance, calls, asked=0 if words == ["disarmed once 1"] else len(words))


def test_maintenance_that_nobody_asked_for_ends_with_its_setting(appliance):
    """It was "in effect", and stayed open until the aircraft was armed."""
    appliance.write("lib/odid/maintenance", '#!/bin/sh\necho "$1" >>/calls\n[ "$1" = off ] || echo no >/at_boot\n')
    appliance.write("usr/bin/odidctl", '#!/bin/sh\n[ "$1" = armed ] && echo disarmed never 0 || cat /at_boot\n')
    appliance.write("at_boot", "yes\n")
    decided(appliance, ["on", "off"])


def test_in_flight_nobody_looks_again(appliance):
    """Until the daemon's word changes: inotifyd then runs it once more."""
    appliance.write("armed", "armed once 1\n")
    appliance.write("run/odid-appliance/maintenance-asked", "")
    appliance.write("dev/kmsg", "")
    appliance.must("sh /lib/odid/maintenance-decide y /run/odid kept")
    assert not appliance.exists("run/odid-appliance/maintenance-asked")
    appliance.write("run/odid-appliance/maintenance-asked", "")
    appliance.must("sh /lib/odid/maintenance-decide n /run/odid-appliance update-state.json")
    assert appliance.exists("run/odid-appliance/maintenance-asked"), "it looked for somebody else's file"


def test_the_vehicle_is_on_the_disk_before_it_has_its_name(appliance):
    """At a board's first flight a power cut left an empty file: at the next power-on it had never had an autopilot."""
    appliance.write("usr/bin/fsync", NOTES)
    appliance.must("/lib/odid/vehicle 7 armed")
    assert appliance.calls() == ["fsync /data/odid/.vehicle"] and appliance.read("data/odid/vehicle") == "7\n"


def test_another_vehicle_than_1_is_told_to_mavlink_router_but_not_in_flight(appliance):
    begun = "echo /dev/ttyACM0 >/run/mavlink-router.port; /lib/odid/mavlink-router-config /dev/ttyACM0 >/run/mavlink-router.conf"
    appliance.must("/lib/odid/vehicle 0 disarmed; /lib/odid/vehicle '' unknown")
    assert not appliance.exists("data/odid/vehicle")
    appliance.must(f"{begun}; /lib/odid/vehicle 1 disarmed")
    assert appliance.read("data/odid/vehicle") == "1\n" and appliance.calls() == []
    for words in ("7 armed", "7 unknown"):
        appliance.must(f"/lib/odid/vehicle {words}")
    assert appliance.read("data/odid/vehicle") == "7\n" and appliance.calls() == []
    # After the flight: the router went on with the other one until its next start.
    appliance.must("/lib/odid/vehicle 7 disarmed")
    assert appliance.calls() == ["sv term mavlink-router"]
    appliance.must(f"{begun}; /lib/odid/vehicle 7 disarmed")
    assert appliance.calls() == ["sv term mavlink-router"], "it knows"
    appliance.must("/lib/odid/vehicle 8 disarmed")
    assert appliance.calls() == ["sv term mavlink-router"] * 2
    appliance.must(f"rm /run/mavlink-router.port; /lib/odid/vehicle 9 disarmed; {begun}")
    assert appliance.calls() == ["sv term mavlink-router"] * 2, "it was listening to several ports, and reads it after that"
    assert sections(appliance.read("run/mavlink-router.conf"))["General"]["SnifferSysid"] == "9"


def test_what_an_earlier_start_was_told_says_nothing_of_this_one(two_autopilots):
    two_autopilots.write("run/mavlink-router.conf", "SnifferSysid = 7\n")
    search(two_autopilots, "[ -e /run/mavlink-router.conf ] || echo /dev/ttyACM0")
    assert "SnifferSysid = 1\n" in two_autopilots.read("began")


# --- the networks' ------------------------------------------------------------------


def test_nothing_of_this_machine_s_is_in_reach_of_a_script(appliance):
    """The lease's script took this machine's own addresses away, each time that the tests below ran."""
    assert appliance.must("ip -o link").splitlines() == [appliance.must("ip -o link show lo").rstrip()]
    assert "Read-only" in appliance.run("echo 0 >/proc/sys/vm/swappiness").stderr
    held = int(re.search(r"CapEff:\s*(\w+)", appliance.must("cat /proc/self/status"))[1], 16)
    assert not held & (1 << CAP_SYS_BOOT | 1 << CAP_SYS_TIME | 1 << CAP_SYS_MODULE)


@pytest.mark.parametrize("ip, mask, taken", [
    ("192.168.41.99", 24, False), ("192.168.42.1", 30, False), ("192.168.41.99", 16, False), ("192.168.42.9", "", False), ("192.168.40.99", 24, True)])
def test_no_lease_takes_the_technician_s_networks_away(appliance, ip, mask, taken):
    """A DHCP server by cable took 192.168.41.0/24: who came by Wi-Fi was answered there."""
    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"))  # the shell would take its own applet
    appliance.must(f"interface=eth0 ip={ip} mask={mask} router= dns= /lib/odid/dhcp-event bound")
    assert (f"ip addr add {ip}/{mask} dev eth0" in appliance.calls()) == taken
    assert ("eth0 has this board's own addresses" in (appliance.fault("dhcp-eth0") or "")) != taken


@pytest.mark.parametrize("ip, mask, station, interface, taken", [
    ("10.20.0.9", 32, "10.20.0.9", "usb0", False), ("10.20.0.3", 25, "10.20.0.9:14550", "usb0", False),
    ("10.20.0.200", 25, "10.20.0.9", "usb0", True), ("10.9.8.7", 1, "10.20.0.9", "usb0", False),
    ("10.20.0.3", 25, "none", "usb0", True), ("10.20.0.3", 25, "", "usb0", True), ("10.20.0.3", 25, "10.20.0.9", "eth0", True)])
def test_no_lease_takes_the_ground_station_away(appliance, ip, mask, station, interface, taken):
    """A modem's DHCP server had its address: neither side heard the other any more."""
    appliance.settings(ground_station__address=station)
    appliance.write("run/odid-appliance/firewall", "2\n")
    appliance.write(f"sys/class/net/{interface}/ifindex", "2\n")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"))
    appliance.must(f"interface={interface} ip={ip} mask={mask} router= dns= /lib/odid/dhcp-event bound")
    assert (f"ip addr add {ip}/{mask} dev {interface}" in appliance.calls()) == taken
    assert ("has the ground station's address" in (appliance.fault(f"dhcp-{interface}") or "")) != taken


@pytest.mark.parametrize("mask, taken", [(0, False), (7, False), (8, True), ("", True)])
def test_no_lease_is_the_way_to_half_of_all_addresses(appliance, mask, taken):
    """What was for anybody behind another adapter's gateway, a server's answers too, went to who had given it."""
    appliance.write("sys/class/net/usb0/ifindex", "9\n")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"))
    appliance.must(f"interface=usb0 ip=10.9.8.7 mask={mask} router= dns= /lib/odid/dhcp-event bound")
    assert (f"ip addr add 10.9.8.7/{mask or 32} dev usb0" in appliance.calls()) == taken
    assert ("is larger than any may be" in (appliance.fault("dhcp-usb0") or "")) != taken


def leased(appliance, interface, lease, others):
    """What of it is done to addresses; others: {interface: its network}."""
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"), ("ip -4", "/usr/bin/ip -4"))
    appliance.write("addresses", "1: lo    inet 127.0.0.1/8 scope host lo\n" + "".join(
        f"{number}: {name}    inet {network} scope global {name}\\       valid_lft forever\n"
        for number, (name, network) in enumerate(others.items(), 2)))
    appliance.write("usr/bin/ip", NOTES.replace("echo OK", '[ "$*" != "-4 -o addr" ] || cat /addresses'))
    appliance.write(f"sys/class/net/{interface}/ifindex", "9\n")
    ip, mask = lease.split("/")
    appliance.must(f"interface={interface} ip={ip} mask={mask} router= dns=10.0.0.53 /lib/odid/dhcp-event bound")
    return [call for call in appliance.calls() if "addr add" in call or "flush" in call][1:]    # first its own is flushed


WIRED = {"eth0": "10.20.0.3/24"}


@pytest.mark.parametrize("interface, lease, others, lost_to", [
    ("usb0", "10.20.0.9/24", WIRED, "eth0"), ("usb0", "10.20.0.3/32", WIRED, "eth0"), ("usb0", "10.20.0.130/25", WIRED, "eth0"),
    ("usb0", "10.9.8.7/8", WIRED, "eth0"), ("usb0", "10.20.1.9/24", WIRED, None), ("usb0", "10.9.8.7/24", {"wlan0": "10.9.8.1/24"}, None),
    ("usb0", "10.9.8.7/24", {"usb0": "10.9.8.1/24"}, None), ("usb0", "10.9.8.7/24", {"eth1": "10.9.8.1/24"}, "eth1"),
    ("eth0", "10.9.8.7/24", {"usb0": "10.9.8.1/24", "wwan0": "10.0.0.1/8"}, "wwan0")])
def test_no_lease_takes_another_adapter_s_network_away(appliance, interface, lease, others, lost_to):
    """An adapter that anybody plugs in had the network of who came by Ethernet: it got what was for him."""
    appliance.settings(ground_station__interface="wwan0")
    assert leased(appliance, interface, lease, others) == ([] if lost_to else [f"ip addr add {lease} dev {interface}"])
    assert (f"overlaps the one at {lost_to}" in (appliance.fault(f"dhcp-{interface}") or "")) == bool(lost_to)
    assert [name for name in os.listdir(appliance.root / "run/faults") if name != f"dhcp-{interface}"] == []


@pytest.mark.parametrize("way, interface", [("eth0", "eth0"), ("wwan0", "eth0"), ("wwan0", "wwan0"), ("eth1", "eth1")])
def test_an_adapter_that_was_there_first_gives_way_to_ethernet_and_the_ground_station(appliance, way, interface):
    appliance.settings(ground_station__interface=way)
    appliance.write("run/names/005-usb0", "nameserver 10.20.0.66\n")
    assert leased(appliance, interface, "10.20.0.3/24", {"usb0": "10.20.0.7/16", "usb1": "10.21.0.7/16"}) == [
        "ip -4 addr flush dev usb0", f"ip addr add 10.20.0.3/24 dev {interface}"]
    assert f"at usb0 overlaps the one at {interface}" in appliance.fault("dhcp-usb0") and not appliance.fault(f"dhcp-{interface}")
    assert appliance.read("run/resolv.conf") == "nameserver 10.0.0.53\n"


@pytest.mark.parametrize("carrier, used", [("0\n", True), ("1\n", False)])
def test_a_cable_that_was_pulled_out_keeps_no_other_adapter_from_its_network(appliance, carrier, used):
    """Its lease was there still, for hours. Plugged in again it asks anew, and goes before the other one."""
    appliance.write("sys/class/net/eth0/carrier", carrier)
    assert leased(appliance, "usb0", "10.20.0.9/24", WIRED) == (
        ["ip -4 addr flush dev eth0", "ip addr add 10.20.0.9/24 dev usb0"] if used else [])
    assert ("sv term udhcpc" in appliance.calls()) == used and bool(appliance.fault("dhcp-usb0")) != used


@pytest.mark.parametrize("had", [True, False])
def test_a_network_that_overlapped_is_asked_for_again_when_the_other_s_lease_is_over(appliance, had):
    """It wasn't used any more, until power-off. Who had none asks nobody: two would end each other in turns."""
    appliance.change("lib/odid/dhcp-event", ("ip -4", "/usr/bin/ip -4"))
    appliance.write("usr/bin/ip", "#!/bin/sh\n" + ("echo '2: eth0    inet 10.20.0.3/24'\n" if had else ""))
    appliance.write("run/faults/dhcp-usb0", "It overlaps.\n")
    appliance.must("interface=eth0 /lib/odid/dhcp-event deconfig")
    assert appliance.calls() == (["sv term udhcpc-usb0"] if had else [])


@pytest.mark.parametrize("event, had, said", [
    ("bound", "", "odid: eth0 has the address 10.20.0.3/24"), ("renew", "10.20.0.3/24", ""),
    ("renew", "10.20.0.4/24", "odid: eth0 has the address 10.20.0.3/24"), ("renew", "110.20.0.3/24", "odid: eth0 has the address 10.20.0.3/24"),
    ("deconfig", "10.20.0.3/24", "odid: eth0 has no address any more"), ("deconfig", "", ""), ("nak", "10.20.0.3/24", ""),
    ("leasefail", "", "")])
def test_an_address_that_is_got_or_lost_is_a_line_in_the_log(appliance, event, had, said):
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"), ("ip -4", "/usr/bin/ip -4"))
    appliance.write("usr/bin/ip", "#!/bin/sh\n" + (f"[ \"$4\" != show ] || echo '2: eth0    inet {had} scope global eth0'\n" if had else ""))
    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    appliance.must(f"interface=eth0 ip=10.20.0.3 mask=24 router= dns= /lib/odid/dhcp-event {event}")
    assert appliance.read("dev/kmsg").strip() == said


def test_what_is_asked_and_answered_by_a_cable_is_no_line_in_the_log_each_time(appliance):
    """Without a cable udhcpc said 900 lines an hour, with a hostile server at its end 3500: the log held no flight."""
    for path, text in (("run/odid-appliance/firewall", ""), ("sys/class/net/eth0/ifindex", "2\n"),
                       ("usr/bin/udhcpc", "#!/bin/sh\necho 'udhcpc: broadcasting discover'\necho 'udhcpc: received DHCP NAK' >&2\n"
                                          "interface=eth0 ip=10.20.0.3 mask=24 router= dns= /lib/odid/dhcp-event bound\n")):
        appliance.write(path, text)
    (appliance.root / "usr/bin/udhcpc").chmod(0o755)
    appliance.change("etc/sv/udhcpc/run", ("/proc/sys", "/proc-sys"), ("ip link", "/usr/bin/ip link"), ("exec udhcpc", "exec /usr/bin/udhcpc"))
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"), ("ip -4", "/usr/bin/ip -4"), ("exec >", "exec >>"))
    appliance.must("mkdir -p /proc-sys/net/ipv4/conf/eth0 && cd /etc/sv/udhcpc && ./run")
    said = appliance.read("dev/kmsg")
    assert "odid: eth0 has the address 10.20.0.3/24" in said and "udhcpc" not in said


@pytest.fixture
def adapter(appliance):
    """What serves an adapter, with its programs noted; usb0 is the ground station's."""
    appliance.settings(ground_station__interface="usb0")
    appliance.write("run/odid-appliance/firewall", "9\n")
    appliance.write("usr/bin/udhcpc", "#!/bin/sh\necho udhcpc >>/calls\n")
    appliance.write("usr/bin/ip", NOTES)
    for program in ("udhcpc", "ip"):
        (appliance.root / "usr/bin" / program).chmod(0o755)
    appliance.change("etc/sv/udhcpc/run", ("/proc/sys", "/proc-sys"), ("ip link", "/usr/bin/ip link"), ("exec udhcpc", "exec /usr/bin/udhcpc"))
    return appliance


def serve_adapter(appliance, interface, meanwhile):
    """meanwhile: what is done in place of a pause."""
    appliance.write(f"sys/class/net/{interface}/ifindex", "9\n")
    appliance.change("etc/sv/udhcpc/run", ("pause 2", f"{{ echo waits >>/calls; {meanwhile}; }}"))
    appliance.must(f"mkdir -p /proc-sys/net/ipv4/conf/{interface} /run/service/udhcpc-{interface} && "
                   f"cp /etc/sv/udhcpc/run /run/service/udhcpc-{interface}/ && cd /run/service/udhcpc-{interface} && ./run")


@pytest.mark.parametrize("interface, armed, uptime_s, waits", [
    ("usb1", "armed once 1 said", 90, True), ("usb1", "disarmed once 1 said", 90, False), ("usb0", "armed once 1 said", 90, False),
    ("usb1", "disarmed never 0 unheard", 90, False), ("usb1", "disarmed once 1 silent", 90, True), ("usb1", "disarmed never 0 awaited", 90, True),
    ("usb1", "disarmed never 0 awaited", 30, False),  # the only way in, and the autopilot is dead
    ("usb1", "armed never 1 said", 30, True), ("usb1", "unknown never 0 unheard", 30, True)])
def test_in_the_air_no_adapter_is_switched_on_but_the_ground_station_s(adapter, interface, armed, uptime_s, waits):
    """One that answers nothing holds the kernel's network lock for minutes, and hostapd's beacons wait for that."""
    adapter.change("lib/odid/functions", ("read -r uptime _ </proc/uptime", f"uptime={uptime_s}.5"))
    adapter.write("armed", armed + "\n")
    serve_adapter(adapter, interface, "exit")
    assert adapter.calls() == (["waits"] if waits else [f"ip link set {interface} up", "udhcpc"])
    assert ("is switched on when" in (adapter.fault(f"adapter-{interface}") or "")) == waits


def test_one_that_waits_is_switched_on_when_it_becomes_the_ground_station_s(adapter):
    """Saved, and in effect, it said; and it stayed off."""
    adapter.change("lib/odid/functions", ("read -r uptime _ </proc/uptime", "uptime=90.5"))
    adapter.write("armed", "armed once 1 said\n")
    serve_adapter(adapter, "usb1", "sed -i s/=usb0/=usb1/ /settings; [ \"$(grep -c waits /calls)\" -lt 5 ] || exit")
    assert adapter.calls() == ["waits", "ip link set usb1 up", "udhcpc"] and adapter.fault("adapter-usb1") is None


def test_a_network_that_overlapped_is_asked_for_again_when_the_other_has_gone(appliance):
    for name in ("eth0", "wwan0", "usb0"):
        appliance.write(f"run/faults/dhcp-{name}", "It overlaps.\n")
    appliance.write("run/faults/adapter-usb0", "It waits.\n")
    appliance.must("mkdir -p /run/service/udhcpc-usb0 && ACTION=remove MDEV=usb0 /lib/odid/device-network")
    assert appliance.calls() == ["sv down udhcpc-usb0", "sv term udhcpc", "sv term udhcpc-wwan0"]
    assert appliance.fault("adapter-usb0") is None  # one that waited could not take it back any more


RIGHT = "1.2", "12d1", "14dc"


def modem(appliance, lease="10.9.8.7/24", interface="usb0", plugged=RIGHT, filtered=9):
    """Is the lease used? plugged: its USB port and model, or None: it isn't on USB. filtered: whom the filter knows as the way."""
    usb = appliance.root / "sys/devices/usb1"
    appliance.must("rm -rf /sys/devices /calls /sys/class/net")
    for name, value in zip(("devpath", "idVendor", "idProduct"), plugged or ()):
        appliance.write(usb / name, value + "\n")
    (usb / "1:1.0").mkdir(parents=True, exist_ok=True)
    appliance.write(f"sys/class/net/{interface}/ifindex", "9\n")
    appliance.write("run/odid-appliance/firewall", f"{filtered}\n")
    (appliance.root / f"sys/class/net/{interface}/device").symlink_to("../../../devices/usb1/1:1.0")
    ip, mask = lease.split("/")
    appliance.must(f"interface={interface} ip={ip} mask={mask} router= dns= /lib/odid/dhcp-event bound")
    used = f"ip addr add {lease} dev {interface}" in appliance.calls()
    assert used == ("another one than the ground station's" not in (appliance.fault(f"dhcp-{interface}") or ""))
    return used


@pytest.fixture
def by_modem(appliance):
    """The ground station's way is usb0, and a modem had that name."""
    appliance.settings(ground_station__address="203.0.113.9", ground_station__interface="usb0")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"))
    appliance.write("data/odid/odid.conf.imported", "0123456789abcdef\n")
    assert modem(appliance) and appliance.read("data/odid/way") == "usb0 0123456789abcdef 1.2 12d1 14dc\n"
    return appliance


@pytest.mark.parametrize("plugged, used", [
    (RIGHT, True), (("1.1", "12d1", "14dc"), False), (("1.2", "12d1", "14db"), False), (("1.2", "0bda", "14dc"), False), (None, True)])
def test_an_adapter_that_has_the_name_of_the_ground_station_s_isn_t_its_way(by_modem, plugged, used):
    """Whoever was found first was usb0: a modem of somebody else's heard all, and could speak as the ground station."""
    assert modem(by_modem, plugged=plugged) == used
    assert modem(by_modem, interface="usb1", plugged=plugged)
    assert modem(by_modem)


def test_one_that_was_given_the_name_is_neither_the_way_nor_kept_as_it(by_modem):
    """hostapd gave a modem the name of the ground station's interface, whose own adapter was then refused for good."""
    by_modem.must("rm /data/odid/way")
    assert not modem(by_modem, filtered=2) and not by_modem.exists("data/odid/way")
    assert modem(by_modem)


def test_without_a_ground_station_no_adapter_is_kept(appliance):
    appliance.settings(ground_station__interface="usb0")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"))
    assert modem(appliance) and not appliance.exists("data/odid/way")


def test_which_adapter_it_was_is_forgotten_with_the_settings(by_modem):
    other = "1.1", "0bda", "8153"
    by_modem.write("data/odid/odid.conf.imported", "fedcba9876543210\n")     # another one came from CONFIG
    assert modem(by_modem, plugged=other) and not modem(by_modem)
    assert saved(by_modem).returncode == 0
    assert not by_modem.exists("data/odid/way") and "sv term udhcpc-usb0" in by_modem.calls()
    assert modem(by_modem)


def test_names_are_asked_where_the_way_out_is(appliance):
    """The last network's server was the only one, and stayed when that network was gone."""
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"), ("ip route", "/usr/bin/ip route"))

    def happens(interface, event, server):
        appliance.must(f"interface={interface} ip=10.9.0.3 mask=24 router= dns={server} /lib/odid/dhcp-event {event}")
        return appliance.read("run/resolv.conf").split()[1::2]
    for number, interface in ((2, "eth0"), (11, "wwan0")):
        appliance.write(f"sys/class/net/{interface}/ifindex", f"{number}\n")
    assert happens("wwan0", "bound", "10.0.0.11") == ["10.0.0.11"]
    assert happens("eth0", "bound", "10.0.0.2") == ["10.0.0.2", "10.0.0.11"]
    assert happens("wwan0", "renew", "10.0.0.12") == ["10.0.0.2", "10.0.0.12"]
    assert happens("wwan0", "deconfig", "") == ["10.0.0.2"]


def test_a_lease_at_the_ground_station_s_interface_brings_its_own_way(appliance):
    """Any DHCP server by cable was the way out, and a ground station behind a modem was heard no more."""
    appliance.settings(ground_station__address="203.0.113.9:14550", ground_station__interface="wwan0")
    appliance.write("run/odid-appliance/firewall", "3\n")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"), ("ip route", "/usr/bin/ip route"))
    for number, interface in enumerate(("eth0", "wwan0"), 2):
        appliance.write(f"sys/class/net/{interface}/ifindex", f"{number}\n")
        appliance.write("calls", "")
        appliance.must(f"interface={interface} ip=10.{number}.0.3 mask=24 router=10.{number}.0.1 dns= /lib/odid/dhcp-event bound")
        own = f"ip route replace 203.0.113.9/32 via 10.{number}.0.1 dev {interface}"
        assert (own in appliance.calls()) == (interface == "wwan0")


def test_a_ground_station_in_the_lease_s_own_network_is_reached_without_its_gateway(appliance):
    appliance.settings(ground_station__address="10.2.0.9")
    appliance.write("run/odid-appliance/firewall", "2\n")
    appliance.change("lib/odid/dhcp-event", ("ip addr", "/usr/bin/ip addr"), ("ip route", "/usr/bin/ip route"))
    appliance.write("sys/class/net/eth0/ifindex", "2\n")
    appliance.must("interface=eth0 ip=10.2.0.3 mask=24 router=10.2.0.1 dns= /lib/odid/dhcp-event bound")
    routes = [call for call in appliance.calls() if call.startswith("ip route")]
    assert routes == ["ip route replace default via 10.2.0.1 dev eth0 metric 2"]


@pytest.mark.parametrize("state", ["on", "off"])
def test_a_radio_that_comes_back_in_maintenance_has_its_addresses(appliance, state):
    """Whoever gave the right password came in, and had no address."""
    appliance.write("run/odid-appliance/maintenance", state + "\n")
    appliance.must("mkdir -p /run/service/hostapd/supervise && mkfifo /run/service/hostapd/supervise/control")
    appliance.change("lib/odid/functions", ("\tip addr replace", "\t/usr/bin/ip addr replace"))
    appliance.must("ACTION=add MDEV=wlan0 /lib/odid/device-network")
    begun = ["ip addr replace 192.168.41.1/24 dev wlan0", "sv term udhcpd", "sv up udhcpd"]
    assert appliance.calls() == ["sv up hostapd", *(begun if state == "on" else [])]
    assert appliance.exists("run/udhcpd.conf") == (state == "on")


def test_hostapd_s_answers_come_where_nobody_is_in_the_way():
    """Without -s they come to /tmp: with its names taken there by anybody, hostapd passed for one that doesn't answer."""
    calls = [line for path in OVERLAY.rglob("*") if path.is_file() and not path.is_symlink()
             for line in path.read_text(errors="replace").splitlines() if re.search(r"\bhostapd_cli -", line)]
    assert len(calls) == 3 and all("hostapd_cli -s /run/hostapd-cli " in line for line in calls)


def test_what_was_said_during_boot_waits_for_who_keeps_it(appliance):
    """Both are started at once: where klogd was first, the log began with whatever came later."""
    appliance.write("usr/bin/klogd", NOTES)
    appliance.must("chmod 755 /usr/bin/klogd; mkdir -p /run/log")
    appliance.write("looks", "")
    appliance.change("etc/sv/klogd/run", ("pause 1", "echo >>/looks && usleep 10000"), ("exec klogd", "exec /usr/bin/klogd"))
    klogd = appliance.start("exec /etc/sv/klogd/run")
    try:
        wait_for("its looks", lambda: len(appliance.read("looks")) > 3)
        assert appliance.calls() == []
        os.mknod(appliance.root / "run/log/socket", stat.S_IFSOCK | 0o600)
        assert klogd.wait(LIMIT_S) == 0 and appliance.calls() == ["klogd -n"]
    finally:
        klogd.kill()


# --- services of other layers ----------------------------------------------------------


def weighted(appliance, *groups):
    """Those groups, with the weight that the kernel gives them once the processor is shared out between groups."""
    for group in groups:
        appliance.write(f"sys/fs/cgroup/{group}/cpu.weight", "100\n")


def weights(appliance):
    return {path.parent.name: int(path.read_text()) for path in (appliance.root / "sys/fs/cgroup").glob("*/cpu.weight")}


@pytest.fixture
def limited(appliance):
    """Starts a service within limits, which says that it runs."""
    weighted(appliance, "appliance", "mavlink-router", "swupdate", "greedy")
    appliance.start("/lib/odid/limited greedy 50 64 sh -c 'echo runs >/runs'")
    return appliance


@pytest.mark.parametrize("there", ["run/odid-appliance/firewall", "run/faults/firewall"])
def test_no_other_service_runs_before_the_filter_is_loaded(limited, there):
    """It could speak to the daemon in the autopilot's place in the first seconds."""
    stays("it waits", lambda: not limited.exists("runs"), 1.5)
    limited.write(there, "")
    wait_for("it to run", lambda: limited.exists("runs"))


def test_within_limits_the_broadcast_has_the_processor_first(limited):
    limited.write("run/odid-appliance/firewall", "")
    wait_for("it to run", lambda: limited.exists("runs"))
    assert weights(limited) == {"appliance": 10000, "mavlink-router": 10000, "swupdate": 1, "greedy": 1}
    assert limited.read("sys/fs/cgroup/greedy/cpu.max") == "50000 100000\n"


@pytest.mark.parametrize("group, weight", [("mavlink-router", 10000), ("hostapd", 10000), ("swupdate", 1)])
def test_a_group_that_is_made_later_has_its_share_as_well(appliance, group, weight):
    """Of a processor that was busy mavlink-router, which owns the position, had a hundredth from its next start on."""
    own = f". /lib/odid/functions; own_group {group} 16 32"
    assert "cpu.weight" not in appliance.run(own).stderr and weights(appliance) == {}, "nothing is shared out yet"
    weighted(appliance, group)
    appliance.must(own)
    assert weights(appliance) == {group: weight}


# --- a stick with a bundle ------------------------------------------------------------


STICK = {"mount": 'echo "mount $*" >>/calls', "umount": "echo umount >>/calls",
         "blkid": 'echo blkid >>/calls; echo "$1: LABEL=\\"X\\" UUID=\\"1-2\\" TYPE=\\"$(cat /type)\\""',
         "odidctl": '[ "$1" != armed ] || { cat /armed; exec grep -qv ^disarmed /armed; }; echo "odidctl $*" >>/calls; echo said'}
LIMITED = '#!/bin/sh\necho "limited $*" >>/calls\nshift 3\nexec "$@"\n'


@pytest.fixture
def stick(appliance):
    """Plugs one in, and tells what is called."""
    for name, command in STICK.items():
        appliance.write(f"usr/bin/{name}", f"#!/bin/sh\n{command}\n")
        (appliance.root / f"usr/bin/{name}").chmod(0o755)
    appliance.write("lib/odid/limited", LIMITED)
    # Its shell would take its own applets.
    script = appliance.root / "lib/odid/update-stick"
    script.write_text(re.sub(r"\b(mount|umount|blkid) ", r"/usr/bin/\1 ", script.read_text()))
    (appliance.root / "run/swupdate").mkdir()
    for name in ("swupdate/sockinstctrl", "odid-appliance/update.sock"):
        os.mknod(appliance.root / "run" / name, stat.S_IFSOCK | 0o600)
    appliance.write("armed", "disarmed never 1 said\n")
    appliance.write("dev/sda1", "\0" * 512)

    appliance.change("lib/odid/update-stick", ("do sleep 2; done", "do : >/waits; sleep 0.1; done"))

    def plug(kind="vfat", last="umount"):
        """What is called, up to the last one of it."""
        appliance.write("type", kind)
        appliance.write("calls", "")
        appliance.write("dev/kmsg", "")
        # Without pipes: what it leaves running keeps them open.
        assert appliance.start("MDEV=sda1 /lib/odid/update-stick").wait(LIMIT_S) == 0
        # The first umount is for what an earlier one left behind.
        wait_for(last, lambda: appliance.calls().count(last) >= (2 if last == "umount" else 1))
        return appliance.calls()

    plug.appliance = appliance
    return plug


@pytest.mark.parametrize("kind", ["vfat", "exfat"])
def test_a_sticks_folder_is_offered_within_limits(stick, kind):
    """Mounted by its type: then the kernel loads the driver, which isn't there before."""
    assert stick(kind) == ["limited stick 50 48 /lib/odid/update-stick attend", "umount", "blkid",
                           f"mount -t {kind} -o ro,nosuid,nodev,noexec /dev/sda1 /run/stick",
                           "odidctl update /run/stick", "umount"]
    assert "stick sda1: said" in stick.appliance.read("dev/kmsg")


@pytest.mark.parametrize("kind", ["ext4", "squashfs", ""])
def test_no_other_file_system_is_mounted(stick, kind):
    """A stick whose ext4 said errors=panic restarted the board, armed or not."""
    assert stick(kind, last="blkid")[1:] == ["umount", "blkid"]
    stays("it is left alone", lambda: stick.appliance.calls()[1:] == ["umount", "blkid"], 0.5)


@pytest.mark.parametrize("head, mounted", [(b"\0\0\0\2", True), (b"\1\0\0\2", False), (b"\xff" * 4, False), (b"", False)])
def test_an_exfat_that_would_take_all_memory_is_not_mounted(stick, head, mounted):
    """Its map of clusters is read whole, 512 MiB of 2^32 of them, in the kernel and beyond the group's limit."""
    (stick.appliance.root / "dev/sda1").write_bytes(b"\0" * 92 + head + b"\0" * (412 if head else 0))
    calls = stick("exfat", last="umount" if mounted else "blkid")
    stays("it is left alone, or was mounted", lambda: any("mount -t" in call for call in stick.appliance.calls()) == mounted, 0.5)
    assert "blkid" in calls


@pytest.mark.parametrize("armed", ["armed once 1 said", "unknown once 1 unsaid", "disarmed never 1 silent", "disarmed never 0 awaited"])
def test_nothing_of_a_stick_is_read_unless_disarmed(stick, armed):
    """Nor while the autopilot is silent: who had made it so, by a parameter, had a stick read in the air."""
    stick.appliance.write("armed", armed)
    limited, = stick(last="limited stick 50 48 /lib/odid/update-stick attend")
    wait_for("it to wait", lambda: stick.appliance.exists("waits"))
    stays("nothing is read", lambda: stick.appliance.calls() == [limited], 0.5)
    stick.appliance.write("armed", "disarmed once 1 said")
    wait_for("the bundle to be offered", lambda: "odidctl update /run/stick" in stick.appliance.calls())


# Its exit status alone was that of a disarmed aircraft.
NO_WORD = "#!/bin/sh\necho \"odidctl $*\" >>/calls\nexit 1\n"


def test_nothing_of_a_stick_is_read_where_nobody_says_disarmed(stick):
    stick.appliance.write("usr/bin/odidctl", NO_WORD)
    stick(last="odidctl armed")
    stays("nothing is read", lambda: "blkid" not in stick.appliance.calls(), 0.5)
    assert stick.appliance.exists("waits")


@pytest.mark.parametrize("slow, read", [("blkid", []), ("mount", ["mount -t vfat -o ro,nosuid,nodev,noexec /dev/sda1 /run/stick"])])
def test_a_stick_that_takes_its_time_isn_t_read_in_the_air(stick, slow, read):
    """Armed while the stick's own slowness holds what looks at it, for up to a minute."""
    path = f"usr/bin/{slow}"
    stick.appliance.write(path, stick.appliance.read(path) + "[ -e /slow ] || { : >/slow; echo armed once 1 >/armed; }\n")
    calls = stick(last=slow if slow == "blkid" else "umount")
    stays("nothing more is read", lambda: [call for call in stick.appliance.calls() if "mount -t" in call] == read
          and "odidctl update /run/stick" not in stick.appliance.calls(), 0.5)
    assert "blkid" in calls
    stick.appliance.write("armed", "disarmed once 1 said\n")
    wait_for("the bundle to be offered after the flight", lambda: "odidctl update /run/stick" in stick.appliance.calls())


# --- settings -----------------------------------------------------------------------


def saved(appliance):
    appliance.write("lib/odid/board-settings", "#!/bin/sh\n")  # there is no boot loader here
    return appliance.run("/lib/odid/apply-configuration")


def test_a_setting_whose_turn_comes_in_the_air_restarts_nothing(appliance):
    """Somebody held the lock until after take-off, and hostapd and mavlink-router were started again in flight."""
    hostapd(appliance)
    lock(appliance, "echo armed once 1 >/armed")
    appliance.settings(wifi__channel="11")
    assert saved(appliance).returncode == 1
    assert appliance.calls() == ["locked"] and "channel=6" in appliance.read("run/hostapd.conf")


def test_nothing_is_restarted_where_nobody_says_disarmed(appliance):
    appliance.write("usr/bin/odidctl", NO_WORD)
    assert saved(appliance).returncode == 1
    assert appliance.calls() == ["odidctl armed"]


@pytest.mark.parametrize("changed", [False, True])
def test_the_daemon_is_restarted_by_its_own_settings_only(appliance, changed):
    """Whatever was saved, nothing was broadcast for a second."""
    hostapd(appliance)
    if changed:
        appliance.write("changed", "")
    appliance.settings(wifi__channel="11")
    assert saved(appliance).returncode == 0
    assert ("sv term odid-daemon" in appliance.calls()) == changed
    assert "sv term hostapd odid-beacons" in appliance.calls()


def test_another_password_counts_at_once(appliance):
    """It was said to be in effect, and hostapd went on with the old one."""
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("run/odid-appliance/maintenance", "on\n")
    hostapd(appliance)
    told = [f"hostapd_cli -s /run/hostapd-cli -p /run/hostapd -i wlan0 raw {words}"
            for words in ("RELOAD_WPA_PSK", "DEAUTHENTICATE ff:ff:ff:ff:ff:ff")]
    saved(appliance)
    assert not set(told) & set(appliance.calls())
    appliance.write("data/secrets/maintenance.psk", "8" * 64 + "\n")
    saved(appliance)
    assert [call for call in appliance.calls() if call in told] == told


@pytest.mark.parametrize("running, closed", [(True, False), (False, True)])
def test_an_access_point_that_refuses_to_close_is_told_again(appliance, running, closed):
    """One that runs and doesn't obey is open still; one that doesn't run starts closed."""
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.write("usr/bin/hostapd_cli", "#!/bin/sh\necho FAIL\n")
    appliance.write("usr/bin/pidof", f"#!/bin/sh\nexit {0 if running else 1}\n")
    (appliance.root / "usr/bin/pidof").chmod(0o755)
    appliance.change("lib/odid/maintenance", ("pidof hostapd", "/usr/bin/pidof hostapd"))
    assert (appliance.run("/lib/odid/maintenance off").returncode == 0) == closed


def test_an_access_point_whose_configuration_cannot_be_made_is_not_closed(appliance):
    """It was said to be, and hostapd's next start, in the air, let in who knew the password."""
    appliance.write("data/secrets/maintenance.psk", KEY + "\n")
    appliance.must("/lib/odid/maintenance on && /lib/odid/maintenance off")
    appliance.write("lib/odid/hostapd-config", "#!/bin/sh\nexit 1\n")
    assert appliance.run("/lib/odid/maintenance off").returncode != 0


@pytest.mark.parametrize("url, another", [("http://here", False), ("http://there", True), ("", True)])
def test_another_hawkbit_is_another_file(appliance, url, another):
    """By which odid-update knows that SWUpdate is to start anew (settings_of_its_server_s_count_when_no_update_is_going_on)."""
    appliance.write("etc/odid/version", "1.10.0\n")
    appliance.settings(update__hawkbit_url="http://here", update__hawkbit_tenant="", update__hawkbit_id="me", basic_id__uas_id="")
    appliance.must("/lib/odid/update-hawkbit >/run/swupdate.hawkbit")
    appliance.settings(update__hawkbit_url=url, update__hawkbit_tenant="", update__hawkbit_id="me", basic_id__uas_id="")
    asked = appliance.root / "run/swupdate.hawkbit"
    before = asked.stat().st_ino
    assert saved(appliance).returncode == 0
    assert (asked.stat().st_ino != before) == another and url in asked.read_text()
    assert not [call for call in appliance.calls() if "swupdate" in call]


# --- what root reads -----------------------------------------------------------------


USERS = {name: (int(uid), int(gid)) for name, uid, _, gid, *_ in
         (line.split() for line in (ROOT / "board/common/users.txt").read_text().splitlines() if not line.startswith("#"))}


def others_may_write(folder):
    """What somebody else than root owns, or may write to, below that folder."""
    found = [path for path in folder.rglob("*") if not path.is_symlink() and not stat.S_ISSOCK(path.stat().st_mode)]
    return sorted(str(path.relative_to(folder)) for path in found if path.stat().st_uid != 0 or path.stat().st_mode & 0o022)


@pytest.fixture
def swupdate(appliance):
    """An appliance on which the service swupdate can be run: SWUpdate itself only notes how it is called."""
    for name, text in (("etc/odid/version", "1.10.0\n"), ("run/odid-appliance/slot", "a\n"), ("run/fw_env.config", "x\n"),
                       ("etc/passwd", "root:x:0:0::/root:/bin/sh\n"),
                       ("run/odid-appliance/update-state.json", '{ "state": "idle" }\n'), ("run/swupdate/sw-description.sig", "left"),
                       ("data/secrets/hawkbit-token", "a-secret\n"),
                       ("etc/group", "".join(f"{name}:x:{gid}:\n" for name, (_, gid) in {"root": (0, 0), **USERS}.items()))):
        appliance.write(name, text)
    appliance.write("etc/swupdate.cfg", (OVERLAY / "etc/swupdate.cfg").read_text())
    for name in ("swupdate", "blockdev", "renice", "chpst"):
        appliance.write(f"usr/bin/{name}", NOTES)
    appliance.write("usr/bin/fw_printenv", "#!/bin/sh\necho 0\n")
    appliance.write("usr/bin/odid-confine", CONFINE)
    for name in ("swupdate", "blockdev", "renice", "chpst", "fw_printenv", "odid-confine"):
        (appliance.root / "usr/bin" / name).chmod(0o755)
    appliance.settings(update__hawkbit_url="https://here", update__hawkbit_tenant="", update__hawkbit_id="me", basic_id__uas_id="")
    return appliance


def test_what_an_ended_swupdate_had_unpacked_is_gone(swupdate):
    """Unverified, and in memory that others need until power-off."""
    swupdate.must("cd /etc/sv/swupdate && ./run")
    assert not (swupdate.root / "run/swupdate/sw-description.sig").exists()


def test_hawkbit_s_client_reads_its_configuration_and_nobody_else_writes_it(swupdate):
    """Root's SWUpdate takes from it which programs it calls as root."""
    swupdate.must("cd /etc/sv/swupdate && ./run")
    assert [call for call in swupdate.calls() if call.startswith("swupdate -f ")], swupdate.calls()
    written = swupdate.read("run/swupdate.cfg")
    assert "a-secret" in written and f"userid = {USERS['odid-hawkbit'][0]};" in written
    assert f"groupid = {USERS['odid-hawkbit'][1]};" in written
    for name, mode in (("swupdate.cfg", 0o640), ("swupdate", 0o750)):
        file = (swupdate.root / "run" / name).stat()
        assert (file.st_uid, file.st_gid, file.st_mode & 0o777) == (0, USERS["odid-hawkbit"][1], mode)
    assert others_may_write(swupdate.root / "run") == []
    # The group is the client's alone: the page's user, for one, is in another.
    assert [name for name, (_, gid) in USERS.items() if gid == USERS["odid-hawkbit"][1]] == ["odid-hawkbit"]


# --- the first start ---------------------------------------------------------------------


@pytest.fixture
def first_start(appliance):
    """What makes the host keys is left out; programs that flush note what they flush and what is there then."""
    script = appliance.read("etc/init.d/S33secrets")
    appliance.write("etc/init.d/S33secrets", re.sub(r"^\(sleep.*", "", script, flags=re.M))
    appliance.write("usr/bin/fsync", '#!/bin/sh\necho "fsync $* $(ls -A /data/secrets | tr "\\n" " ")" >>/calls\n')
    (appliance.root / "usr/bin/fsync").chmod(0o755)
    return appliance


def test_the_access_point_s_name_is_on_the_disk_before_it_counts(first_start):
    first_start.must("/etc/init.d/S33secrets")
    assert re.fullmatch(r"RemoteID-[0-9A-F]{4}\n", first_start.read("data/secrets/wifi_ssid"))
    # Flushed under another name, then renamed: a power cut leaves all of it or nothing.
    assert first_start.calls() == ["fsync /data/secrets/.wifi_ssid .wifi_ssid "]
    assert re.search(r"mv \S+/\.wifi_ssid \S+/wifi_ssid \|\| ! sync -d \$secrets", first_start.read("etc/init.d/S33secrets"))


@pytest.mark.parametrize("name", [None, "", "RemoteID-FFFF\n"])
def test_a_name_that_was_lost_comes_back_with_the_key_that_was_made_with_it(first_start, name):
    first_start.write("data/secrets/maintenance.psk", KEY + "\nRemoteID-0A1B\n")
    if name is not None:
        first_start.write("data/secrets/wifi_ssid", name)
    first_start.must("/etc/init.d/S33secrets")
    assert first_start.read("data/secrets/wifi_ssid") == "RemoteID-0A1B\n"
    before = first_start.calls()
    first_start.must("/etc/init.d/S33secrets")         # and then it stays, without being written again
    assert first_start.calls() == before


def test_a_name_that_comes_late_is_the_key_s(first_start):
    """The boot went on while the disk took it, and the password's key was made with the name that there is without one."""
    first_start.write("usr/bin/fsync", f"#!/bin/sh\nprintf '%s\\nRemoteID\\n' {KEY} >/data/secrets/maintenance.psk\n")
    first_start.must("/etc/init.d/S33secrets")
    assert first_start.read("data/secrets/wifi_ssid") == "RemoteID\n"


@pytest.mark.parametrize("damaged", ["a|b", "x" * 40, "\x01\x02"])
def test_a_damaged_name_takes_remote_id_off_nothing(first_start, damaged):
    """hostapd had no configuration with it, and Wi-Fi stayed silent for good."""
    first_start.write("data/secrets/maintenance.psk", f"{KEY}\n{damaged}\n")
    first_start.write("data/secrets/wifi_ssid", damaged + "\n")
    first_start.must("/etc/init.d/S33secrets")
    assert re.fullmatch(r"RemoteID-[0-9A-F]{4}\n", first_start.read("data/secrets/wifi_ssid"))
    assert "Set [maintenance] password anew" in first_start.fault("secrets")
    first_start.must("/lib/odid/hostapd-config /run/hostapd.conf")


@pytest.mark.parametrize("damaged", ["1|x", "0", "007", "256", "300", "99999999999999999999", "7 8"])
def test_a_damaged_vehicle_takes_no_telemetry_away(appliance, damaged):
    appliance.write("data/odid/vehicle", damaged + "\n")
    made = appliance.must("/lib/odid/mavlink-router-config /dev/ttyACM1")
    assert "SnifferSysid = 1\n" in made and "Device = /dev/ttyACM1\n" in made


CARRY = """. /lib/odid/functions
. /lib/odid/data-disk
eval "$(sed -n '/^carry_.*()/,/^}/p; /^has_technician_s()/,/^}/p' /lib/odid/mend-data)"
carry_over /run/mended"""


@pytest.mark.parametrize("made, on_disk, wins", [
    (False, {"maintenance.psk": "old"}, "new"),                     # from CONFIG, where it has been blanked
    (True, {"maintenance.psk": "old"}, "old"),                      # the board's own, for want of that one
    (False, {"maintenance.psk": "old", "maintenance.made": "x"}, "new"),
    (True, {}, "new"),
])
def test_a_password_stays_with_what_it_was_made_of_when_data_is_mended(appliance, made, on_disk, wins):
    appliance.write("data/secrets/maintenance.psk", "new\n")
    appliance.write("data/secrets/wifi_ssid", "new\n")
    if made:
        appliance.write("data/secrets/maintenance.made", "shown on CONFIG\n")
    for name, text in on_disk.items():
        appliance.write(f"run/mended/secrets/{name}", text + "\n")
    if on_disk:
        appliance.write("run/mended/secrets/wifi_ssid", "old\n")
    appliance.must(CARRY)
    assert [appliance.read(f"run/mended/secrets/{name}") for name in ("maintenance.psk", "wifi_ssid")] == [wins + "\n"] * 2
    assert appliance.exists("run/mended/secrets/maintenance.made") == (made and wins == "new")


@pytest.mark.parametrize("in_memory, kept", [("as booted\n", "on the disk\n"), ("saved since\n", "saved since\n")])
def test_what_was_saved_while_data_was_in_memory_is_kept(appliance, in_memory, kept):
    appliance.write("run/booted/odid/odid.conf", "as booted\n")
    appliance.write("data/odid/odid.conf", in_memory)
    appliance.write("run/mended/odid/odid.conf", "on the disk\n")
    appliance.must(CARRY.replace("\ncarry_over", "\ncopied=yes; carry_over"))
    assert appliance.read("run/mended/odid/odid.conf") == kept


# --- values that get into other programs' files ----------------------------------------


@pytest.mark.parametrize("setting", [{"broadcast__wifi_iface": "wlan0|"}, {"broadcast__wifi_iface": 'a","lo'},
                                     {"broadcast__wifi_iface": ""}, {"wifi__country": ""}, {"wifi__channel": "6\\nx=y"}])
def test_an_access_point_s_configuration_that_would_be_refused_is_not_put_in_place(appliance, setting):
    appliance.must("/lib/odid/hostapd-config /run/hostapd.conf")
    before = appliance.read("run/hostapd.conf")
    appliance.settings(**setting)
    assert appliance.run("/lib/odid/hostapd-config /run/hostapd.conf").returncode != 0
    assert appliance.read("run/hostapd.conf") == before
    assert "The one before stays." in appliance.fault("access_point")
    appliance.settings()
    appliance.must("/lib/odid/hostapd-config /run/hostapd.conf")
    assert appliance.fault("access_point") is None


def test_a_serial_number_with_a_quote_breaks_no_update(swupdate):
    swupdate.settings(update__hawkbit_url="https://here", update__hawkbit_tenant="", update__hawkbit_id="", basic_id__uas_id='A"B')
    swupdate.must("cd /etc/sv/swupdate && ./run")
    assert 'A"B' not in swupdate.read("run/swupdate.cfg") and "suricatta" not in swupdate.read("run/swupdate.cfg")
    assert "Set [update] hawkbit_id" in swupdate.fault("hawkbit")


@pytest.fixture
def with_config(appliance):
    """The volume CONFIG as a folder that needs no mounting."""
    os.makedirs(appliance.root / "dev/disk/odid")
    os.mknod(appliance.root / "dev/disk/odid/config", 0o60600, os.makedev(7, 200))
    appliance.write("usr/bin/fsync", NOTES)             # which Debian's BusyBox lacks
    (appliance.root / "usr/bin/fsync").chmod(0o755)
    for path in ("etc/init.d/S40config", "lib/odid/functions"):
        appliance.write(path, re.sub(r"mount -t vfat.*|umount .*", "true", appliance.read(path)))
    return appliance


@pytest.mark.parametrize("octets", [b"\0" * 40, b"\xff" * 40, b"a-sec\xff\xff\n", "a-secret\n".encode("utf-16")],
                         ids=["NULs", "erased flash", "half of it", "saved as UTF-16"])
def test_a_token_of_a_power_cut_s_zeros_is_not_emptied(with_config, octets):
    with_config.write("data/secrets/hawkbit-token", "a-secret\n")
    (with_config.root / "run/config").mkdir(parents=True, exist_ok=True)
    (with_config.root / "run/config/hawkbit-token").write_bytes(octets)
    with_config.must("/etc/init.d/S40config")
    assert with_config.read("data/secrets/hawkbit-token") == "a-secret\n"
    assert "is damaged, or no plain text" in with_config.fault("hawkbit-ca")


def test_a_token_without_a_line_end_is_used(swupdate):
    swupdate.write("data/secrets/hawkbit-token", "a-secret")
    assert 'targettoken = "a-secret"' in swupdate.must("/lib/odid/update-hawkbit")


def test_a_token_that_was_emptied_is_forgotten(with_config):
    with_config.write("run/config/hawkbit-token", "a-secret\n")
    with_config.must("/etc/init.d/S40config")
    assert with_config.read("data/secrets/hawkbit-token") == "a-secret\n"
    (with_config.root / "run/config/hawkbit-token").unlink()    # not there: the one before counts
    with_config.must("/etc/init.d/S40config")
    assert with_config.exists("data/secrets/hawkbit-token")
    for emptied in ("", " \r\n"):
        with_config.write("data/secrets/hawkbit-token", "a-secret\n")
        with_config.write("run/config/hawkbit-token", emptied)
        with_config.must("/etc/init.d/S40config")
        assert not with_config.exists("data/secrets/hawkbit-token")


@pytest.mark.parametrize("checked, passed_over, forgotten", [
    ("/run/config: would be taken over\n", False, True),
    ("/run/config: would be taken over\n", True, False),   # S40config has looked by then
    ("/run/config: not all of it would be taken over: authorized_keys line 2: is a private key\n", False, False),
    ("", False, False),    # it crashed
])
def test_a_factory_reset_forgets_nothing_that_config_can_t_bring_back(appliance, checked, passed_over, forgotten):
    """It is refused as a whole where one value is wrong, and the board began without an identity."""
    if passed_over:
        appliance.write("run/faults/boot-data", "The boot script S30data did not end within 20 s.\n")
    appliance.change("etc/init.d/S30data", (". /lib/odid/functions", ". /lib/odid/functions; mount() { :; }; umount() { :; }; mountpoint() { :; }"))
    appliance.write("checked", checked)
    appliance.write("data/odid/odid.conf", "mine\n")
    appliance.write("data/odid/way", "usb0 - 1.2 12d1 14dc\n")
    appliance.write("data/odid/factory-reset", "")
    appliance.write("etc/odid/odid.conf", "the image's\n")
    said = appliance.must("/etc/init.d/S30data")
    assert appliance.read("data/odid/odid.conf") == ("the image's\n" if forgotten else "mine\n")
    assert appliance.exists("data/odid/way") != forgotten
    assert not appliance.exists("data/odid/factory-reset")
    assert forgotten or passed_over or f"odid: {checked.strip()}\n" in said
    assert ("There was no factory reset" in (appliance.fault("factory-reset") or "")) != forgotten


def test_a_power_cut_after_a_factory_reset_forgets_nothing_that_config_brought(with_config, with_data):
    """The next power-on was one more, and the password that CONFIG had brought, and hasn't any more, was gone."""
    with_data.write("checked", "/run/config: would be taken over\n")
    with_data.write("data/odid/factory-reset", "")
    with_data.must("/etc/init.d/S30data")
    with_data.write("data/secrets/maintenance.psk", KEY + "\n")     # S40config's import, and then the power goes
    with_data.must("/etc/init.d/S30data")
    assert with_data.read("data/secrets/maintenance.psk") == KEY + "\n"


# --- damage -------------------------------------------------------------------------


PLAYED = """mount() { while [ -e /hangs ] && [ $2 = ext4 ]; do usleep 20000; done; echo mount $* >>/calls; }
umount() { echo umount $* >>/calls; }
mountpoint() { ! cat /unmounted; }
blockdev() { cat /getro; }
read_only() { [ $1 = /run/looked ] && [ -e /read-only ]; }
nice() { shift 2; "$@"; }
mke2fs() { echo mke2fs $* >>/calls; }
"""


@pytest.fixture
def with_data(appliance):
    """/data on a disk that is a file, with what mounts it played."""
    appliance.write("dev/disk/odid/data", "\0" * 4096)
    appliance.change("etc/init.d/S30data", ("[ ! -b ", "[ ! -e "), ("[ -b ", "[ -e "))
    for script in ("etc/init.d/S30data", "lib/odid/mend-data"):
        appliance.change(script, (". /lib/odid/data-disk", ". /lib/odid/data-disk\n. /played"))
    appliance.write("played", PLAYED)
    appliance.write("getro", "0\n")
    appliance.write("etc/odid/odid.conf", "the image's\n")
    for name, text in {"e2fsck": NOTES, "fsync": "#!/bin/sh\n[ ! -e /turns ] || { : >/read-only; exit 1; }\n"}.items():
        appliance.write(f"usr/bin/{name}", text)
        (appliance.root / f"usr/bin/{name}").chmod(0o755)
    return appliance


@pytest.mark.parametrize("lost", [None, ""])
def test_a_configuration_that_data_lost_is_config_s_again(with_data, lost):
    """It counted as taken over still, and who the aircraft is was gone though CONFIG had it."""
    with_data.write("data/odid/odid.conf.imported", "0123456789abcdef\n")
    if lost is not None:
        with_data.write("data/odid/odid.conf", lost)
    with_data.must("/etc/init.d/S30data")
    assert with_data.read("data/odid/odid.conf") == "the image's\n" and with_data.read("data/odid/odid.conf.imported") == "0000000000000000\n"
    assert "Check the serial number" in with_data.fault("settings")


def powered_on(appliance, config=None):
    """Is it a fault that settings were lost? config: which one is taken over from CONFIG, if one is."""
    appliance.must("rm -f /run/faults/*; /etc/init.d/S30data")
    if config:
        appliance.write("data/odid/odid.conf.imported", config)
    appliance.must("/etc/init.d/S40config")
    return appliance.fault("settings") is not None


# What is kept of CONFIG's odid.conf: the one of before, and another one.
OLD, SINCE = "0123456789abcdef\n", "fedcba9876543210\n"


@pytest.mark.parametrize("imported, config", [(OLD, OLD), (OLD, None), (None, OLD), ("\xff" * 17, OLD), (None, None)])
def test_lost_settings_are_said_until_a_person_has_saved_some(with_config, with_data, imported, config):
    """At the next power-on what stood in for them was sound: another aircraft was on the air, and any older version was taken."""
    if imported:
        with_data.write("data/odid/odid.conf.imported", imported)
    for _ in range(3):
        assert powered_on(with_data, config)
    assert not powered_on(with_data, SINCE) and not powered_on(with_data, SINCE)


def test_a_config_that_was_saved_before_the_settings_were_lost_counts_and_nothing_is(with_config, with_data):
    with_data.write("data/odid/odid.conf.imported", OLD)
    assert not powered_on(with_data, SINCE)


# odidctl import, where what is in /data is damaged
FINDS_DAMAGE = """#!/bin/sh
[ "$1" != import ] || [ ! -e /damaged ] || {
	[ -e /data/odid/settings-lost ] || : >/data/odid/settings-lost
	echo "config's" >/data/odid/odid.conf
	echo 0123456789abcdef >/data/odid/odid.conf.imported
	rm /damaged
}
"""


def test_damaged_settings_are_lost_ones(with_config, with_data):
    """CONFIG's stood in for them, and nobody said so."""
    with_data.write("usr/bin/odidctl", FINDS_DAMAGE)
    with_data.write("data/odid/odid.conf", "\0" * 112)
    with_data.write("damaged", "")
    for _ in range(3):
        assert powered_on(with_data) and with_data.read("data/odid/odid.conf") == "config's\n"
    assert not powered_on(with_data, SINCE)


def test_a_worn_mark_of_lost_settings_is_no_person_s_word(with_config, with_data):
    with_data.write("data/odid/odid.conf.imported", OLD)
    assert powered_on(with_data, OLD) and powered_on(with_data, OLD)
    (with_data.root / "data/odid/settings-lost").write_bytes(b"\xff" * 17)
    assert powered_on(with_data, OLD)
    assert not powered_on(with_data, SINCE)


WORN = {"NULs": b"\0" * 40, "erased flash": b"\xff" * 40, "half of it": b"[basic_id]\nuas_id = SSRS5\xff\xff\xff"}


@pytest.mark.parametrize("octets", WORN.values(), ids=WORN)
def test_settings_of_worn_flash_are_lost_ones_without_config_s(with_config, with_data, octets):
    """Whoever set them by the page has none there: half of a number was the aircraft's."""
    with_data.write("data/odid/odid.conf", "")
    (with_data.root / "data/odid/odid.conf").write_bytes(octets)
    with_data.write("data/odid/odid.conf.imported", OLD)
    assert powered_on(with_data) and powered_on(with_data)
    assert with_data.read("data/odid/odid.conf") == "the image's\n"


def test_a_factory_reset_ends_what_was_lost(with_config, with_data):
    assert powered_on(with_data)
    with_data.write("checked", "/run/config: would be taken over\n")
    with_data.write("data/odid/factory-reset", "")
    assert not powered_on(with_data) and not with_data.exists("data/odid/settings-lost")


def test_at_the_first_start_nothing_is_lost(with_data):
    (with_data.root / "data/secrets").rmdir()
    with_data.must("/etc/init.d/S30data")
    assert with_data.exists("data/secrets") and with_data.fault("settings") is None
    # It says that no CONFIG was taken over: without that nobody would know (import_kept.h).
    assert with_data.read("data/odid/odid.conf.imported") == "0000000000000000\n"


@pytest.mark.parametrize("state, mended", [(1, False), (3, True), (2, True)])
def test_damage_that_the_kernel_has_noted_is_mended_before_data_is_used(with_data, state, mended):
    """It mounts all the same, and turned read-only at the first write, at each power-on."""
    with_data.write("dev/disk/odid/data", "\0" * 1082 + chr(state) + "\0" * 3013)
    with_data.must("/etc/init.d/S30data")
    assert ("e2fsck -p /dev/disk/odid/data" in with_data.calls()) == mended
    assert ("was damaged, and was repaired" in (with_data.fault("data") or "")) == mended


MOUNTED = """mount_data() { echo mounted while $(readlink /proc/$$/fd/9) is held >>/calls; cp -a /run/mended/. /data/; }
"""


def mend(appliance, command="/lib/odid/mend-data broken '' ''", played=""):
    """The disk is /run/mended, whatever becomes of it."""
    appliance.write("played", PLAYED + MOUNTED + played)
    appliance.must(command)


@pytest.fixture
def in_memory(with_data):
    """/data is in memory, and its disk is mended now."""
    with_data.write("run/odid-appliance/booted", "")
    with_data.write("data/odid/odid.conf", "as booted\n")
    with_data.write("run/mended/odid/odid.conf", "as booted\n")
    with_data.write("lib/odid/apply-configuration", "#!/bin/sh\necho apply >>/calls\nexit $(cat /refused)\n")
    with_data.write("refused", "0\n")
    with_data.write("usr/bin/flock", NOTES)
    with_data.change("lib/odid/functions", ("sleep 3\n\tdone", ":\n\tdone"))
    return with_data


@pytest.mark.parametrize("name, on_disk, refused, applied", [
    ("odid/odid.conf", "as booted\n", 0, 0),
    ("odid/odid.conf", "set before\n", 0, 1),
    ("secrets/maintenance.psk", KEY + "\n", 0, 1),
    ("odid/odid.conf", "set before\n", 1, 5),  # armed
])
def test_what_comes_back_with_the_mended_disk_counts(in_memory, name, on_disk, refused, applied):
    """odid.conf said one aircraft, and another one was broadcast until power-off."""
    in_memory.write(f"run/mended/{name}", on_disk)
    in_memory.write("refused", f"{refused}\n")
    mend(in_memory)
    assert in_memory.read(f"data/{name}") == on_disk and in_memory.fault("settings") is None
    assert in_memory.calls().count("apply") == applied
    assert "was repaired or made anew" in in_memory.fault("data")
    assert ("counts from the next power-on" in in_memory.fault("data")) == bool(refused)


def test_damaged_settings_on_the_mended_disk_are_lost_ones(with_config, in_memory):
    in_memory.write("usr/bin/odidctl", FINDS_DAMAGE)
    in_memory.write("run/mended/odid/odid.conf", "\0" * 112)
    in_memory.write("damaged", "")
    mend(in_memory)
    assert in_memory.read("data/odid/odid.conf") == "config's\n" and in_memory.fault("settings") is not None


@pytest.mark.parametrize("name", ["odid/odid.conf", "ssh/authorized_keys"])
def test_what_config_has_brought_since_goes_before_what_the_disk_had(in_memory, name):
    """A new one was in force, and the old one took its place in the middle of the day."""
    in_memory.write(f"data/{name}", "new on CONFIG\n")
    in_memory.write(f"data/{name}.imported", "new\n")
    in_memory.write(f"run/mended/{name}", "of before\n")
    in_memory.write(f"run/mended/{name}.imported", "old\n")
    mend(in_memory)
    assert in_memory.read(f"data/{name}") == "new on CONFIG\n" and in_memory.read(f"data/{name}.imported") == "new\n"
    assert "apply" not in in_memory.calls()


@pytest.mark.parametrize("asked, refused, there", [
    (True, False, "as booted\n"), (True, True, "set before\n"),
    (False, False, "set before\n"),  # it couldn't be read in time
])
def test_a_factory_reset_on_a_damaged_disk_is_done_once(in_memory, asked, refused, there):
    """What was forgotten came back with the mended disk, and at a later power-on it was forgotten again."""
    if asked:
        in_memory.write("run/old-data/odid/factory-reset", "")
    if refused:
        in_memory.write("run/faults/factory-reset", "There was no factory reset.\n")
    in_memory.write("run/mended/odid/factory-reset", "")
    in_memory.write("run/mended/odid/odid.conf", "set before\n")
    in_memory.write("run/mended/secrets/maintenance.psk", KEY + "\n")
    mend(in_memory, """. /lib/odid/data-disk; . /played
eval "$(sed -n '/^went_on()/,/^}/p; /^copy_old()/,/^}/p' /etc/init.d/S30data)"
copy_old
rm -f /data/odid/factory-reset
/lib/odid/mend-data broken "$copied" "$reset\"""")
    assert in_memory.read("data/odid/odid.conf") == there
    assert not in_memory.exists("run/mended/odid/factory-reset")
    assert ("There was no factory reset" in (in_memory.fault("factory-reset") or "")) == (not asked or refused)
    assert in_memory.exists("run/mended/secrets/maintenance.psk") == (there == "set before\n")


@pytest.mark.parametrize("copied, counts", [("", "all of it\n"), ("yes", "one key\n")])
def test_one_key_that_was_saved_beside_an_unknown_disk_replaces_nothing(in_memory, copied, counts):
    """The image's odid.conf with that key took the place of all that was set, and nothing was said. It is saved just in time."""
    in_memory.write("run/mended/odid/odid.conf", "all of it\n")
    in_memory.write("usr/bin/flock", "#!/bin/sh\necho one key >/data/odid/odid.conf\n")
    mend(in_memory, f"/lib/odid/mend-data broken '{copied}' ''")
    assert in_memory.read("data/odid/odid.conf") == counts
    assert ("save it again" in in_memory.fault("data")) != bool(copied)


def test_settings_that_had_been_lost_before_are_said_to_be_by_a_disk_that_comes_late(in_memory):
    """Until the next power-on any older version was taken, and nobody was told why another aircraft was on the air."""
    in_memory.write("run/mended/odid/settings-lost", "")
    mend(in_memory)
    assert "Check the serial number" in in_memory.fault("settings")


@pytest.mark.parametrize("old, in_force", [("set before\n", "set before\n"), ("", "as booted\n")])
def test_a_late_disk_that_cannot_be_repaired_is_read_all_the_same(in_memory, old, in_force):
    """Another aircraft's identity was on the air, CONFIG's old one, and nothing said so."""
    if old:
        in_memory.write("run/old-data/odid/odid.conf", old)
    in_memory.write("usr/bin/e2fsck", "#!/bin/sh\nexit 8\n")
    mend(in_memory, "echo broken | /lib/odid/mend-data late '' ''")
    assert "can't be repaired" in in_memory.fault("data") and "mke2fs" not in str(in_memory.calls())
    assert in_memory.read("data/odid/odid.conf") == in_force
    assert ("apply" in in_memory.calls()) == bool(old) == (in_memory.fault("settings") is None)
    if old:
        assert in_memory.read("run/odid-appliance/data-in-memory") == "copied\n"
        in_memory.write("usr/bin/flock", "#!/bin/sh\necho one key >/data/odid/odid.conf\n")
        mend(in_memory, "echo broken | /lib/odid/mend-data late '' ''")
        assert in_memory.read("data/odid/odid.conf") == old and "save it again" in in_memory.fault("settings")


READS_SLOWLY = PLAYED.replace("mount() {", "mount() { case $* in *noload*) while [ -e /slow ]; do : >/reads; usleep 20000; done ;; esac;") + """
mount_data() { [ $1 = /data ] && cp -a /run/mended/. /data/; }
"""


@pytest.mark.parametrize("read_only", [True, False])
def test_a_broken_disk_that_is_read_when_the_boot_went_on_is_not_forgotten(in_memory, read_only):
    """What CONFIG had brought by then passed for a copy of it, and the disk was made anew."""
    in_memory.must("rm -rf /data/odid/odid.conf /run/odid-appliance/booted /run/mended")
    for path, text in {"turns": "", "slow": "", "getro": f"{read_only:d}\n", "run/old-data/odid/odid.conf": "set before\n",
                       "run/old-data/odid/odid.conf.imported": "old\n", "usr/bin/e2fsck": "#!/bin/sh\nexit 8\n", "played": READS_SLOWLY}.items():
        in_memory.write(path, text)
    script = in_memory.start("exec /etc/init.d/S30data")
    wait_for("the disk to be read", lambda: in_memory.exists("reads"))
    in_memory.write("run/faults/boot-data", "The boot script S30data did not end within 20 s\n")  # rcS
    in_memory.write("data/odid/odid.conf", "CONFIG's old one\n")
    in_memory.write("data/odid/odid.conf.imported", "old\n")
    in_memory.must("mkdir -p /data/secrets; /etc/init.d/S42in-force")
    (in_memory.root / "slow").unlink()
    assert script.wait(LIMIT_S) == 0
    in_memory.write("run/odid-appliance/booted", "")
    wait_for("it to count", lambda: "apply" in in_memory.calls())
    in_memory.end_all()
    assert "set before" in in_memory.read("data/odid/odid.conf") and in_memory.fault("settings") is None
    assert ("mke2fs" in str(in_memory.calls())) != read_only


@pytest.mark.parametrize("result", [1, 8])  # repaired, with nothing left; made anew
def test_a_power_cut_after_a_disk_was_mended_is_no_first_start(in_memory, result):
    """Before what was set is on it: it was, nothing was said, and CONFIG's old identity was in force."""
    in_memory.must("rm -r /run/mended")
    in_memory.write("usr/bin/e2fsck", f"#!/bin/sh\nexit {result}\n")
    in_memory.change("lib/odid/mend-data", ("put_in_place $mended ||", "exit\nput_in_place $mended ||"))
    mend(in_memory)
    in_memory.must("rm -rf /data /run/faults/*; mv /run/mended /data; mkdir /run/mended; /etc/init.d/S30data")
    assert "was set in /data is lost" in in_memory.fault("settings")


@pytest.mark.parametrize("ended", ["kill -KILL $$", "exit 33"])  # that it was told to end; with errors corrected before
def test_a_check_that_was_ended_has_said_nothing_of_the_disk(in_memory, ended):
    """For want of memory, say: the disk was made anew, flight records and all."""
    in_memory.write("usr/bin/e2fsck", f"#!/bin/sh\n{ended}\n")
    mend(in_memory)
    assert "can't be repaired" in in_memory.fault("data") and "mke2fs" not in str(in_memory.calls())


@pytest.mark.parametrize("before, lost", [("", False), ("mkdir /run/looked/secrets", True)])
def test_a_late_disk_s_first_start_is_one(in_memory, before, lost):
    """What was never set was said to be lost, at each power-on."""
    in_memory.must(f"mkdir -p /run/looked; {before}")
    mend(in_memory, "echo whole | /lib/odid/mend-data late '' ''", "mount_data() { cp -a /run/looked/. /data/; }\n")
    assert (in_memory.fault("settings") is not None) == lost == in_memory.exists("data/odid/settings-lost")


def test_a_config_that_was_never_taken_over_takes_no_settings_place(in_memory):
    """The image's own is in force meanwhile, and none of CONFIG's."""
    in_memory.write("data/odid/odid.conf.imported", "0000000000000000\n")
    in_memory.write("run/mended/odid/odid.conf", "set before\n")
    in_memory.write("run/mended/odid/odid.conf.imported", OLD)
    mend(in_memory, "echo broken | /lib/odid/mend-data late '' ''")
    assert in_memory.read("data/odid/odid.conf") == "set before\n" and in_memory.read("data/odid/odid.conf.imported") == OLD


@pytest.mark.parametrize("command", ["echo broken | /lib/odid/mend-data late '' ''", "/lib/odid/mend-data read-only '' ''"])
def test_a_factory_reset_that_a_rescued_disk_asks_for_is_called_off(in_memory, command):
    """It came to nothing, and nobody was told."""
    in_memory.write("run/old-data/odid/odid.conf", "set before\n")
    in_memory.write("run/old-data/odid/factory-reset", "")
    in_memory.write("usr/bin/e2fsck", "#!/bin/sh\nexit 8\n")
    mend(in_memory, command)
    assert in_memory.read("data/odid/odid.conf") == "set before\n"
    assert "There was no factory reset" in in_memory.fault("factory-reset") and not in_memory.exists("data/odid/factory-reset")


def test_what_is_copied_of_a_disk_does_not_fill_memory(in_memory):
    """/run has 16 MiB for everybody: somebody's bundle on that disk stayed there until power-off."""
    in_memory.must("rm -f /data/odid/odid.conf /run/odid-appliance/booted; rm -rf /run/mended")
    for path, text in {"turns": "", "getro": "0\n", "run/old-data/odid/odid.conf": "set before\n",
                       "run/old-data/odid/a-bundle.swu": "x" * 1_000_000, "usr/bin/e2fsck": "#!/bin/sh\nexit 8\n", "played": READS_SLOWLY}.items():
        in_memory.write(path, text)
    script = in_memory.start("exec /etc/init.d/S30data")
    assert script.wait(LIMIT_S) == 0
    in_memory.end_all()
    assert in_memory.read("data/odid/odid.conf") == "set before\n"
    assert not in_memory.exists("run/copied") and not in_memory.exists("data/odid/a-bundle.swu")


def test_a_password_that_stayed_on_config_is_blanked_when_the_disk_is_there(in_memory):
    """It came back at the next power-on, over one that was set since."""
    in_memory.write("usr/bin/odidctl", NOTES)
    mend(in_memory, played="mount_config() { :; }\n")
    calls = in_memory.calls()
    assert calls.index("odidctl import /run/config") > next(number for number, call in enumerate(calls) if call.startswith("mounted"))


@pytest.mark.parametrize("octets", WORN.values(), ids=WORN)
def test_worn_settings_on_a_mended_disk_are_lost_ones(in_memory, octets):
    (in_memory.root / "run/mended/odid/odid.conf").write_bytes(octets)
    mend(in_memory, "echo broken | /lib/odid/mend-data late '' ''")
    assert in_memory.read("data/odid/odid.conf") == "as booted\n" and "was set in /data is lost" in in_memory.fault("settings")


def test_half_of_the_settings_is_not_what_was_set(in_memory):
    """Of a disk that can't be repaired cp had half of odid.conf: it counted from then on, and nothing was said."""
    in_memory.must("rm -rf /run/mended/odid /data/odid/odid.conf")
    in_memory.write("run/old-data/odid/odid.conf", "half of it\nand the rest\n")
    in_memory.write("run/old-data/odid/odid.conf.imported", OLD)
    in_memory.write("run/old-data/ssh/authorized_keys", "the technician's\n")
    mend(in_memory, """. /lib/odid/data-disk; . /played
eval "$(sed -n '/^went_on()/,/^}/p; /^copy_old()/,/^}/p' /etc/init.d/S30data)"
copy_old
[ -e /data/odid/odid.conf ] || echo "the image's" >/data/odid/odid.conf
/lib/odid/mend-data broken "$copied" "$reset\"""", """cp() {
	case "$*" in
	*old-data/odid/odid.conf*) [ -d "$3" ] && head -n 1 "$2" >"$3/odid.conf" || head -n 1 "$2" >"$3"; return 1 ;;
	*) /bin/cp "$@" ;;
	esac
}
""")
    assert "half of it" not in in_memory.read("data/odid/odid.conf") + in_memory.read("run/mended/odid/odid.conf")
    assert "Check the serial number" in in_memory.fault("settings")
    assert in_memory.read("data/ssh/authorized_keys") == "the technician's\n"


FULL = """mkdir -p /run/mended && mount -t tmpfs -o size=64k full /run/mended && cp -a /run/prepared/. /run/mended/
dd if=/dev/zero of=/run/mended/fill bs=1k 2>/dev/null
exec /lib/odid/mend-data broken yes ''"""


def test_what_a_full_disk_takes_no_more_is_said(in_memory):
    """It was saved, and in effect, and was gone."""
    in_memory.must("rm -rf /run/mended")
    in_memory.write("run/prepared/odid/odid.conf", "as booted\n")
    in_memory.change("lib/odid/mend-data", ("copy_settings /data /run/booted\n", "copy_settings /data /run/booted\necho saved since >/data/odid/odid.conf\n"))
    mend(in_memory, FULL)
    assert "save it again" in in_memory.fault("data")


def test_a_password_that_a_full_disk_takes_no_more_leaves_the_board_s_own(in_memory):
    """The technician's wasn't there, and the board's, which was in force, was known to nobody."""
    in_memory.must("rm -rf /run/mended")
    in_memory.write("run/prepared/secrets/maintenance.psk", "a" * 64 + "\nRemoteID-1\n")
    in_memory.write("run/prepared/secrets/maintenance.made", "k7wd-93hp-qfxm\n")
    in_memory.write("data/secrets/maintenance.psk", KEY + "\nRemoteID-1\n")
    mend(in_memory, FULL)
    assert in_memory.read("data/secrets/maintenance.made") == "k7wd-93hp-qfxm\n"


def test_what_cannot_be_read_is_no_text(appliance):
    """A folder stands for it."""
    appliance.must(". /lib/odid/data-disk; ! is_text /data")


def test_keys_of_a_late_disk_are_rescued_though_its_settings_are_worn(in_memory):
    (in_memory.root / "run/old-data/odid").mkdir(parents=True)
    (in_memory.root / "run/old-data/odid/odid.conf").write_bytes(b"\xff" * 40)
    in_memory.write("run/old-data/secrets/maintenance.psk", KEY + "\nRemoteID-0A1B\n")
    in_memory.write("run/old-data/ssh/authorized_keys", "the technician's\n")
    in_memory.write("usr/bin/e2fsck", "#!/bin/sh\nexit 8\n")
    mend(in_memory, "echo broken | /lib/odid/mend-data late '' ''")
    assert in_memory.exists("data/ssh/authorized_keys") and in_memory.exists("data/secrets/maintenance.psk")
    assert in_memory.read("data/odid/odid.conf") == "as booted\n" and in_memory.fault("settings") is not None


@pytest.mark.parametrize("copied", ["", "yes"])
def test_settings_that_were_lost_with_the_disk_are_said_to_be(in_memory, copied):
    """But not those that could be read before it was mended, and are in force."""
    (in_memory.root / "run/mended/odid/odid.conf").unlink()
    mend(in_memory, f"/lib/odid/mend-data broken '{copied}' ''")
    assert in_memory.read("data/odid/odid.conf") == "as booted\n" and "apply" not in in_memory.calls()
    if copied:
        assert in_memory.fault("settings") is None
    else:
        assert "Check the serial number, the operator number and prevent_downgrade" in in_memory.fault("settings")
    assert in_memory.exists("run/mended/odid/settings-lost") != bool(copied)


def test_a_disk_that_is_mended_and_can_t_be_mounted_is_said_to_be(in_memory):
    mend(in_memory, played="mount_data() { false; }\n")
    assert "can't be repaired" in in_memory.fault("data")


def test_nothing_is_set_between_the_carrying_over_and_the_mount(in_memory):
    """It was said to be saved, and lay below what was mounted then."""
    mend(in_memory)
    done = [call for call in in_memory.calls() if re.match("flock|umount /run/mended|mounted", call)]
    assert done == ["flock 9", "umount /run/mended", "mounted while /data/odid/.lock is held"]
    assert stat.S_IMODE((in_memory.root / "data/odid/.lock").stat().st_mode) == 0o600  # who may open it may hold it


def test_a_state_that_cannot_be_read_ends_nothing(with_data):
    """The shell ended over it, and /data was the read-only system's empty folder: no identity and no way in, at each power-on."""
    with_data.change("etc/init.d/S30data", ("od -An -tu1", "head -c 0"))
    with_data.must("/etc/init.d/S30data")
    assert with_data.fault("data") is None and with_data.read("data/odid/odid.conf") == "the image's\n"


def test_whatever_ends_the_script_there_is_a_data(with_data):
    with_data.write("unmounted", "")
    with_data.change("etc/init.d/S30data", ("case $state in\nwhole)", "case $(( & 2)) in\nwhole)"))
    assert with_data.run("/etc/init.d/S30data").returncode != 0
    assert "lost at power-off" in with_data.fault("data") and "mount -t tmpfs" in "\n".join(with_data.calls())
    assert "umount /run/old-data" in with_data.calls()  # what could be read was copied
    assert with_data.read("data/odid/odid.conf") == "the image's\n"


@pytest.mark.parametrize("free, said", [("0 900", "is full"), ("90000 0", "is full"), ("90000 900", "perhaps worn out"), ("", "perhaps worn out")])
def test_data_is_full_only_where_there_is_no_room(with_data, free, said):
    """A disk that took nothing any more was "full", too."""
    with_data.write("free", free + "\n")
    with_data.write("played", PLAYED + "fsync() { false; }\nstat() { cat /free; }\n")
    with_data.must("/etc/init.d/S30data")
    assert said in with_data.fault("data") and "mount --move /run/looked /data" in with_data.calls()


def test_data_that_turns_read_only_at_the_first_write_is_a_broken_one(with_data):
    """It was "full"."""
    with_data.write("turns", "")
    with_data.write("getro", "1\n")  # else it is mended in the background
    with_data.must("/etc/init.d/S30data")
    assert "umount /run/looked" in with_data.calls() and "lost at power-off" in with_data.fault("data")


def test_what_ends_in_disorder_while_it_looks_finds_a_broken_one(with_data):
    with_data.write("getro", "1\n")  # else it is mended in the background
    with_data.change("etc/init.d/S30data", ("has_errors() {", "has_errors() {\n\techo $(( & 2))"))
    with_data.must("/etc/init.d/S30data")
    assert "lost at power-off" in with_data.fault("data") and "umount /run/old-data" in with_data.calls()


@pytest.mark.parametrize("whole", [True, False])
def test_a_disk_that_answers_late_keeps_nobody_waiting(in_memory, whole):
    """The boot stood there, and the watchdog began it anew, for ever."""
    in_memory.change("etc/init.d/S30data", ("read -r -t 12 ", "read -r -t 1 "))
    in_memory.write("run/looked/odid/odid.conf", "set before\n")
    in_memory.write("hangs", "")
    if not whole:
        in_memory.write("turns", "")
    script = in_memory.start("exec /etc/init.d/S30data")
    assert script.wait(LIMIT_S) == 0
    assert "doesn't answer" in in_memory.fault("data")
    assert [call for call in in_memory.calls() if "mount" in call] == ["mount -t tmpfs -o size=16m,mode=755,noatime,nosuid,nodev,noexec data /data"]
    (in_memory.root / "hangs").unlink()
    wait_for("the disk", lambda: "doesn't answer" not in in_memory.fault("data"))
    assert not in_memory.exists("run/looked/.probe")
    if whole:
        assert "answered late" in in_memory.fault("data") and "e2fsck" not in str(in_memory.calls())
        assert in_memory.read("run/looked/odid/odid.conf") == "set before\n"
    else:
        assert "was repaired or made anew" in in_memory.fault("data") and "umount /run/looked" in in_memory.calls()


def test_a_boot_script_that_does_not_end_is_passed_over(appliance):
    """The boot stood there as well. `last` is asked for when `late` says its end."""
    for script in (appliance.root / "etc/init.d").glob("S*"):
        script.unlink()
    os.mknod(appliance.root / "dev/kmsg", 0o20666, os.makedev(1, 3))  # null
    for name, command in {"S20late": "until [ -e /go ]; do usleep 20000; done; : >/over", "S21done": "echo $1 >>/calls", "S22said": "echo why >/run/faults/said; exit 3", "S22wrong": "exit 3",
                          "S23last": ": >/go; until [ -e /over ]; do usleep 20000; done; usleep 200000; exit 5"}.items():
        appliance.write(f"etc/init.d/{name}", f"#!/bin/sh\n{command}\n")
        (appliance.root / "etc/init.d" / name).chmod(0o755)
    appliance.change("etc/init.d/rcS", ("-lt 20 ] || left=20", "-lt 1 ] || left=1"))
    appliance.must("/etc/init.d/rcS")
    assert appliance.calls() == ["start"] and appliance.fault("boot-done") is None and appliance.exists("run/odid-appliance/booted")
    assert "S20late did not end within 1 s" in appliance.fault("boot-late")
    assert "S22wrong failed" in appliance.fault("boot-wrong") and "S23last failed" in appliance.fault("boot-last")
    assert appliance.fault("boot-said") is None


def test_the_boot_is_over_before_the_watchdog_s_minute(appliance):
    """Each script had 20 s of its own, and more whenever a late one ended: a worn disk had the board started anew, for ever."""
    for script in (appliance.root / "etc/init.d").glob("S*"):
        script.unlink()
    os.mknod(appliance.root / "dev/kmsg", 0o20666, os.makedev(1, 3))  # null
    for number in range(20, 29):
        appliance.write(f"etc/init.d/S{number}slow{number}", "#!/bin/sh\nuntil [ -e /over ]; do usleep 20000; done\n")
        (appliance.root / f"etc/init.d/S{number}slow{number}").chmod(0o755)
    appliance.change("etc/init.d/rcS", ("sleep 1;", "usleep 20000;"))
    appliance.must("/etc/init.d/rcS; : >/over")
    waited = [int(re.search(r"within (\d+) s", appliance.fault(f"boot-slow{number}"))[1]) for number in range(20, 29)]
    assert waited == [20, 20, *[2] * 7] and sum(waited) < 60


def test_what_boots_shares_the_memory_that_is_kept(appliance):
    """rcS started each script by a shell of its own, and all after the first one read their programs on others' account."""
    for script in (appliance.root / "etc/init.d").glob("S*"):
        if script.name != "S01mounts":
            script.unlink()
    text = appliance.read("etc/init.d/S01mounts")
    begun = text.index("groups=/sys")
    appliance.write("etc/init.d/S01mounts", "#!/bin/sh\n" + text[begun:text.index("# And what was used", begun)])
    appliance.change("etc/init.d/S01mounts", ("mount -t cgroup2", ": mount"), ("+memory >$groups", "+memory >/run"),
                     ("mkdir -p $groups", "mkdir -p /sys/fs/cgroup"), (">$groups/appliance/cgroup.procs", ">>/moved"))
    os.mknod(appliance.root / "dev/kmsg", 0o20666, os.makedev(1, 3))  # null
    boot = appliance.must("echo $$; exec /etc/init.d/rcS").strip()
    assert boot in appliance.read("moved").split()


@pytest.mark.parametrize("refused", [0, 1])
def test_what_config_brings_after_the_boot_went_on_counts(with_config, refused):
    """The report said that it was in force, and the image's identity was on the air until power-off."""
    with_config.write("data/odid/odid.conf", "before\n")
    with_config.write("run/odid-appliance/odid.conf", "before\n")
    with_config.write("usr/bin/odidctl", '#!/bin/sh\n[ "$1" != import ] || echo taken over >/data/odid/odid.conf\n')
    with_config.write("lib/odid/apply-configuration", f"#!/bin/sh\necho apply >>/calls\nexit {refused}\n")
    with_config.change("lib/odid/functions", ("sleep 3\n\tdone", ":\n\tdone"))
    with_config.must("/etc/init.d/S40config")
    assert with_config.calls().count("apply") == (5 if refused else 1)
    assert ("counts from the next power-on" in (with_config.fault("config") or "")) == bool(refused)
    with_config.write("run/odid-appliance/odid.conf", "taken over\n")
    with_config.must(": >/calls; /etc/init.d/S40config")
    assert "apply" not in with_config.calls()


@pytest.mark.parametrize("octets, taken", [(65536, True), (65537, False)])
def test_authorities_are_taken_whole_or_not_at_all(with_config, octets, taken):
    """64 KiB of them ended in the middle of one, and then none is believed."""
    with_config.write("data/secrets/hawkbit-ca.pem", "before\n")
    with_config.write("run/config/hawkbit-ca.pem", "x" * octets)
    with_config.must("/etc/init.d/S40config")
    assert len(with_config.read("data/secrets/hawkbit-ca.pem")) == (octets if taken else 7)
    assert (with_config.fault("hawkbit-ca") is None) == taken


@pytest.mark.parametrize("cut", ["odid.conf", "authorized_keys.txt", "hawkbit-token"])
def test_a_file_on_config_that_was_cut_short_is_put_aside(with_config, cut):
    """Half a configuration was taken over, and a token that had become empty counted as emptied."""
    with_config.change("etc/init.d/S40config", (". /lib/odid/functions", ". /lib/odid/functions; read_only() { [ ! -e /mended ]; }"))
    with_config.write("usr/bin/fsck.fat", f"""#!/bin/sh
: >/mended
: >/run/config/{cut}
printf '%s\n' 'fsck.fat 4.2' '/{cut}' '  File size is 5000 bytes, cluster chain length is 2048 bytes.' '  Truncating file to 2048 bytes.'
""")
    (with_config.root / "usr/bin/fsck.fat").chmod(0o755)
    with_config.change("usr/bin/odidctl", ("case $1 in\n", "case $1 in\nimport) rm -f /run/faults/config ;;\n"))  # all is well, it finds
    with_config.write("data/secrets/hawkbit-token", "a-secret\n")
    for name in {"odid.conf", "hawkbit-token", cut}:
        with_config.write(f"run/config/{name}", "a-secret\n")
    with_config.must("/etc/init.d/S40config")
    assert with_config.exists(f"run/config/{cut}.cut-short") and not with_config.exists(f"run/config/{cut}")
    assert with_config.read("data/secrets/hawkbit-token") == "a-secret\n"
    assert f"put aside: {cut}. What was in force stays" in with_config.fault("config-cut")


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
    """inotifyd answers SIGTERM with its number: four settings saved in a row made a fault of the service maintenance."""
    assert ended(appliance, 0, 0, 6) == [] and ended(appliance, -1, 15, 6) == [] and ended(appliance, 15, 0, 6) == []
    assert not os.listdir(appliance.root / "run/faults")


def test_one_that_keeps_failing_is_a_fault_and_started_less_often(appliance):
    assert ended(appliance, 1, 0, 3) == [], "a first failure is not waited for"
    assert appliance.fault("service-test") is None
    assert ended(appliance, 1, 0, 6) == [1, 2, 3, 4, 5, 5]
    assert "keeps ending (exit code 1)" in appliance.fault("service-test")


@pytest.fixture
def watched(appliance):
    """A clock of the test's own, and each of those who look after 15 s does when it is told; known by when they began."""
    appliance.change("lib/odid/finish", ("/proc/uptime", "/uptime"), ("exec sleep", "exec true"),
                     ("sleep 15", 'trap ": >/looked-$now" EXIT; until [ -e /over ] || [ -e "/later-$now" ]; do usleep 10000; done'))
    appliance.must("mkdir -p /run/service/test")
    yield appliance
    appliance.write("over", "")


def ended_at(appliance, code, *times):
    for uptime in times:
        appliance.write("uptime", f"{uptime} 0\n")
        appliance.must(f"cd /run/service/test && /lib/odid/finish {code} 0")
    return appliance.fault("service-test")


def after_15_s(appliance, began):
    appliance.write(f"later-{began}", "")
    wait_for("a look at the service", lambda: appliance.exists(f"looked-{began}"))
    return appliance.fault("service-test")


def test_one_that_runs_again_is_no_fault_any_more(watched):
    """One of its own, beside what the service has to say by its name."""
    watched.write("run/faults/test", "Version 2 was rolled back.\n")
    assert ended_at(watched, 1, "10.0", "11.0", "12.0", "13.0", "15.0")
    assert after_15_s(watched, 13), "it had failed once more since"
    assert not after_15_s(watched, 15) and watched.fault("test")


def test_nor_is_one_that_ended_in_good_order_since(watched):
    assert ended_at(watched, 1, "10.0", "11.0", "12.0", "13.0")
    assert ended_at(watched, 0, "20.0"), "it has not run for 15 s yet"
    assert not after_15_s(watched, 13)


@pytest.mark.parametrize("orderly", [[], ["20.0"]])
def test_nor_is_one_whose_failures_are_counted_from_one_again(watched, orderly):
    """The next one at the very end of the 15 s, or after an orderly end."""
    assert ended_at(watched, 1, "7.9", "8.9", "9.9", "10.9")
    assert ended_at(watched, 0, *orderly) and ended_at(watched, 1, "25.0")
    assert watched.read("run/service/test/failures") == "1 25\n"
    assert after_15_s(watched, 10), "it had failed once more since"
    assert not after_15_s(watched, 25)


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


def running(appliance, service, same):
    """A process that was started as that service, or is another one with its number."""
    one = appliance.start("exec sleep 1000")
    started = int(Path(f"/proc/{one.pid}/stat").read_text().rpartition(")")[2].split()[19])
    appliance.write(f"run/pid/{service}", f"{one.pid} {started + (not same)}\n")
    return one


def ended_all(*processes):
    for one in processes:
        one.kill()
        one.wait()


@contextlib.contextmanager
def watched_by(appliance, watch, service, same=True):
    """The process of a service, or another one with its number, and the service that looks after it."""
    one = running(appliance, service, same)
    watch = appliance.start(f"exec /etc/sv/{watch}/run")
    try:
        yield one
    finally:
        ended_all(one, watch)


@pytest.mark.parametrize("same", [True, False])
def test_a_stranger_with_hostapd_s_number_is_left_alone(appliance, same):
    appliance.change("etc/sv/hostapd-watch/run", ("limit=15", "limit=1"), ("pause 1", "echo looks >>/calls; usleep 20000"))
    with watched_by(appliance, "hostapd-watch", "hostapd", same) as one:
        if same:
            assert one.wait(LIMIT_S) == -9
        else:
            wait_for("several looks", lambda: appliance.calls().count("looks") > 5)
            assert one.poll() is None


def test_what_strangers_send_is_no_line_in_the_log_each_time(appliance):
    appliance.write("usr/bin/hostapd_cli", NOTES.replace("echo OK", "echo state=ENABLED"))
    appliance.change("etc/sv/hostapd-watch/run", ("pause 1", "usleep 20000"))
    cli = "hostapd_cli -s /run/hostapd-cli -p /run/hostapd "
    with watched_by(appliance, "hostapd-watch", "hostapd"):
        wait_for("several looks", lambda: appliance.calls().count(cli + "status") > 5)
        assert appliance.calls()[:3] == [cli + "status", cli + "raw LOG_LEVEL WARNING", cli + "status"]
        assert appliance.calls().count(cli + "raw LOG_LEVEL WARNING") == 1


LOGGED_IN = ("Pubkey auth succeeded for 'root' with ssh-ed25519 key SHA256:x from 10.0.0.2:2000",
             "Exit (root) from <10.0.0.2:2000>: Disconnect received")
STRANGER = ("Child connection from 10.0.0.1:1000", "Exit before auth from <10.0.0.1:1000>: Exited normally",
            "Exit before auth from <10.0.0.1:1000>: (user 'root', 9 fails): Max auth tries reached - user 'root'",
            "Login attempt for nonexistent user from 10.0.0.1:1000",
            "Exit before auth from <10.0.0.1:1000>: Exit (root) Pubkey auth succeeded for 'root' with x")


def test_who_connects_by_ssh_and_has_no_key_is_no_line_in_the_log(appliance):
    """Twenty seconds of that, and the flight's log was gone."""
    own = (f"echo '[{{}}] Nov 26 18:00:00 {line}' >&2" for line in ("Not backgrounding", "Early exit: Terminated by signal"))
    begins, ends = (line.replace("{}", "'$$'") for line in own)
    connections = "".join(f'echo "[1] Nov 26 18:00:00 {line}" >&2\n' for line in (*STRANGER, *LOGGED_IN))
    appliance.write("usr/bin/dropbear", f"#!/bin/sh\n{begins}\n{connections}{ends}\necho dropbear: it breaks >&2\n")
    appliance.write("lib/odid/host-keys", "#!/bin/sh\n")
    for name in ("usr/bin/dropbear", "lib/odid/host-keys"):
        (appliance.root / name).chmod(0o755)
    for name in ("data/ssh/authorized_keys", "run/odid-appliance/firewall", "sys/fs/cgroup/cgroup.procs", "dev/kmsg"):
        appliance.write(name, "a line\n")
    appliance.must("exec /etc/sv/dropbear/run")
    wait_for("its last words", lambda: "it breaks" in appliance.read("dev/kmsg"))
    said = [re.sub(r"^\[\d+\] Nov 26 18:00:00 ", "", line) for line in appliance.read("dev/kmsg").splitlines()]
    assert said == ["Not backgrounding", *LOGGED_IN, "Early exit: Terminated by signal", "dropbear: it breaks"]


@pytest.mark.parametrize("good", [True, False])
def test_a_damaged_host_key_is_made_anew(appliance, good):
    """dropbear ends over one, for good. (Asked is dropbearkey -y.)"""
    appliance.write("data/ssh/dropbear_ed25519_host_key", "a key\n")
    appliance.write("usr/bin/dropbearkey", f"#!/bin/sh\n[ $1 != -y ] || exit {0 if good else 1}\necho made >$4\n")
    for name in ("fsync", "sync"):
        appliance.write(f"usr/bin/{name}", NOTES)
    for name in ("dropbearkey", "fsync", "sync"):
        (appliance.root / f"usr/bin/{name}").chmod(0o755)
    appliance.must("/lib/odid/host-keys")
    assert appliance.read("data/ssh/dropbear_ed25519_host_key") == ("a key\n" if good else "made\n")


@pytest.mark.parametrize("same", [True, False])
def test_a_stranger_with_the_keeper_s_number_feeds_no_watchdog(appliance, same):
    os.mknod(appliance.root / "dev/watchdog", 0o20600, os.makedev(1, 3))
    appliance.write("usr/bin/svok", NOTES)
    (appliance.root / "usr/bin/svok").chmod(0o755)
    appliance.change("etc/sv/watchdog/run", ("while pause 2", "while usleep 20000"), ("svok", "/usr/bin/svok"))
    missed = "its supervisor is not running (5)"
    with watched_by(appliance, "watchdog", "odid-daemon", same):
        if same:
            wait_for("several looks", lambda: appliance.calls().count("svok /run/service/odid-daemon") > 10)
            assert missed not in appliance.read("dev/kmsg")
        else:
            wait_for("that it is missed", lambda: appliance.exists("dev/kmsg") and missed in appliance.read("dev/kmsg"))


@pytest.mark.parametrize("armed, state, left", [
    ("disarmed never 1 said", "trial", True),
    ("disarmed never 0 unheard", "trial", True),
    ("disarmed never 0 awaited", "trial", True),
    ("disarmed never 1 silent", "trial", False),  # it may fly
    ("disarmed never 1 said", "idle", False),  # it is decided
    ("armed once 1 said", "trial", False),
    ("unknown once 1 said", "trial", False),  # it may be in the air
    ("unknown never 1 unsaid", "trial", False),
    ("unknown never 0 unsaid", "trial", False),  # all but HEARTBEATs comes of it
    ("unknown never 0 unheard", "trial", True),  # its daemon never came up, or heard nobody
    ("unknown never 0 awaited", "trial", True),
    ("unknown never 0 unheard", None, True),  # and its odid-update neither
    ("", "trial", False),
])
def test_a_trial_that_nobody_decides_is_ended_unless_it_may_be_in_the_air(appliance, armed, state, left):
    os.mknod(appliance.root / "dev/watchdog", 0o20600, os.makedev(1, 3))
    appliance.write("armed", armed + "\n")
    if state:
        appliance.write("run/odid-appliance/update-state.json", f'{{ "state": "{state}" }}\n')
    appliance.change("etc/sv/watchdog/run", ("while pause 2", "while echo looks >>/calls; usleep 20000"), ("-ge 120", "-ge 4"),
                     ("read -r words </proc/cmdline", "words=odid.trial"), ("kill -TERM 1", "echo restarts >>/calls"))
    watchdog = appliance.start("exec /etc/sv/watchdog/run")
    try:
        wait_for("several looks", lambda: appliance.calls().count("looks") > 10)
        assert ("restarts" in appliance.calls()) == left
    finally:
        ended_all(watchdog)


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
