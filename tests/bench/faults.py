"""What is done to the appliance in flight and at its start, and how long a receiver may then wait for
a newer position. The list is fixed: a fault without a figure is a failure.

Each fault does its harm to a running, moving flight and says when: `at`, the harm itself, or `back`,
when hardware that was taken away is there again. From then on the longest content gap of the worst
channel counts (gaps.py). What else was to be seen and wasn't is in `problems`.
"""

import random
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import patience

from . import disk as disks
from .flights import restarted

CHANNELS = ("bt4", "bt5", "wifi")
BLUETOOTH, WIFI = ("bt4", "bt5"), ("wifi",)
TOOL = "/tmp/fault"
NONE_S = 0.5  # no gap: what the bar allows between two positions without any fault
OTHERS_S = 1.0  # on channels that the fault has nothing to do with
TO_FIRST_S = {"bt4": 4.0, "bt5": 4.0, "wifi": 5.0}  # from init to the first message
POSITION_S = 2.0  # from the autopilot's port to its first position on the air
FIX_SAID_S = 0.5  # the played flight says GPS_RAW_INT twice a second: a fix from before is none any more
TOLD_S = 3.0
FOREIGN_DISABLE = "3920020000"  # LE Set Extended Advertising Enable: off, all sets


@dataclass
class Injected:
    at: float
    back: float | None = None
    problems: list = field(default_factory=list)
    late: list = field(default_factory=list)  # what was to be seen by then, and wasn't


@dataclass(frozen=True)
class Fault:
    name: str
    what: str
    limit_s: float
    inject: Callable
    channels: tuple = CHANNELS
    watch_s: float = 1.0  # beyond the limit
    undo: Callable = lambda machine: None  # when it was watched long enough


@dataclass(frozen=True)
class Boot:
    """A power-on under a fault. The gap counts from when the first message is due."""
    name: str
    what: str
    limit_s: float = NONE_S
    prepare: Callable = lambda machine: None  # while it is switched off
    power: dict = field(default_factory=dict)
    early: Callable = lambda machine: None  # as soon as there is a shell
    later: Callable | None = None  # once on the air: gives an Injected, and the gap counts from there
    to_first_s: dict = field(default_factory=lambda: TO_FIRST_S)


# --- in flight ------------------------------------------------------------------


def nothing(machine):
    at = time.monotonic()
    time.sleep(8)
    return Injected(at)


def command(text):
    """A fault that is one command in the machine."""
    def inject(machine):
        at = time.monotonic()
        machine.must(text)
        return Injected(at)
    return inject


def at_any_phase(inject, times=12):
    """The same again and again, each time at another place in the advertising interval."""
    def inject_each(machine):
        injected = []
        for number in range(times):
            injected.append(inject(machine))
            time.sleep(1.2 + 0.037 * number)
        return injected[0]
    return inject_each


def kill(signal, program):
    return command(f"kill -{signal} $(pidof {program})")


def blocked(switch):
    """switch: where the radio's rfkill device is, so that the judge's own radio stays on."""
    def inject(machine):
        soft = machine.must(f"ls {switch}/soft").strip()
        at = time.monotonic()
        machine.must(f"echo 1 >{soft}")
        time.sleep(4)
        back = time.monotonic()
        machine.must(f"echo 0 >{soft}")
        return Injected(at, back)
    return inject


def wifi_radio(machine):
    mac = machine.must("cat /sys/class/net/wlan0/address").strip()
    at = time.monotonic()
    machine.must(f"{TOOL} radio-remove 0")
    time.sleep(3)
    machine.must(f"{TOOL} radio-create {mac}")
    return Injected(at, machine.wait_inside("wlan0", "[ -e /sys/class/net/wlan0 ]"))


def bluetooth_controller(machine):
    at = time.monotonic()
    machine.must("kill $(pidof hci-attach)")
    machine.must("until [ ! -e /sys/class/bluetooth/hci0 ]; do usleep 10000; done")
    machine.front.order("unplug")
    time.sleep(3)
    machine.front.order("plug")
    machine.must("pidof hci-attach || (setsid hci-attach /dev/hvc0 </dev/null >/dev/null 2>&1 &)")
    return Injected(at, machine.wait_inside("hci0 to be set up", f"{TOOL} is-set-up 0"))


def replugged(machine):
    """Something still has the old node open, so the adapter comes back under another number."""
    old = machine.must("ls /dev/ttyUSB*").split()
    machine.must(f"(setsid sleep 30 2>/dev/null >/dev/null <{old[0]} &)")
    time.sleep(1)  # until it has it open
    at = time.monotonic()
    machine.unplug()
    machine.wait_inside("the port to vanish", f"[ ! -e {old[0]} ]")
    time.sleep(1)
    machine.plug()
    back = machine.wait_inside("the port", "ls /dev/ttyUSB* >/dev/null 2>&1")
    new = machine.must("ls /dev/ttyUSB*").split()
    return Injected(at, back, [] if new != old else [f"the port came back under its old number, {new[0]}"])


def wrong_port(machine):
    """Another adapter is plugged in, and is the only one for a while: the router takes it, for want of a better one."""
    machine.plug_another()
    time.sleep(5)  # it stays where it is, and where that is is kept
    at = time.monotonic()
    machine.unplug()
    machine.wait_inside("the other port to be taken", "read -r port </run/mavlink-router.port && [ -e $port ]"
                        " && pidof mavlink-routerd")
    time.sleep(1.5)  # nobody is quicker at it
    machine.plug()
    back = machine.wait_inside("the port", "[ $(ls -d /dev/ttyUSB* | wc -l) = 2 ]")
    return Injected(at, back)


def told(machine, since):
    """Whether status and pilot were told of the silence in time: what was late."""
    time.sleep(max(0.0, since + TOLD_S - time.monotonic()))
    late = []
    status = machine.status()
    if status is None or not any("autopilot" in problem["reason"] or "position" in problem["reason"]
                                 for problem in status["problems"]):
        late.append(f"odidctl status does not say within {TOLD_S:g} s that the autopilot is silent")
    if not any(answer["mavpackettype"] == "OPEN_DRONE_ID_ARM_STATUS" and answer["status"] != 0
               and since < answer["mono"] <= since + TOLD_S for answer in machine.answers()):
        late.append(f"no ARM_STATUS told the pilot within {TOLD_S:g} s")
    return late


def silent(machine):
    at = time.monotonic()
    machine.player.order("pause")
    late = told(machine, at)
    time.sleep(2)
    back = time.monotonic()
    machine.player.order("resume")
    return Injected(at, back, late=late)


def rebooted(machine):
    """Silence, then positions again, from an autopilot whose clock since its start began anew."""
    into_s = time.monotonic() - machine.flight_mono
    # It has been up for less time than it was silent.
    flight = restarted(machine.flight, machine.folder / "restarted.tlog", into_s + 1.5, boot_s=0.5)
    at = time.monotonic()
    machine.player.order("pause")
    late = told(machine, at)
    start_s = time.monotonic() - machine.flight_mono + 1
    machine.play(flight, start=start_s)
    played = machine.folder / "played.jsonl"
    patience.wait_for("the flight to go on", lambda: "GLOBAL_POSITION_INT" in played.read_text(), part=machine.player)
    return Injected(at, time.monotonic(), late=late)


def ours(machine):
    """The processes of the appliance: the supervisors that init starts, and all below them."""
    listing = machine.must("for p in /proc/[0-9]*; do read -r line <$p/stat && echo \"$line\"; done 2>/dev/null; true")
    parents, names = {}, {}
    for line in listing.splitlines():
        pid, _, rest = line.partition(" (")
        name, _, rest = rest.rpartition(") ")
        parents[int(pid)], names[int(pid)] = int(rest.split()[1]), name
    found = []
    for pid in parents:
        above = pid
        while above > 1 and names.get(above) != "runsv":
            above = parents.get(above, 0)
        if above > 1:
            found.append(pid)
    return found


def everything(machine):
    chance, at, killed = random.Random(1), time.monotonic(), 0
    for _ in range(10):
        pids = ours(machine)
        chance.shuffle(pids)
        killed += len(pids)
        machine.must(f"kill -KILL {' '.join(map(str, pids))} 2>/dev/null; true")
        time.sleep(1)   # what is said before is of those that were killed
        machine.wait_on_air(position=True)
        time.sleep(1)
    return Injected(at, problems=[] if killed > 100 else [f"only {killed} processes were found to be killed"])


def load(machine):
    at = time.monotonic()
    machine.must(f"(setsid {TOOL} hog 1000 16 </dev/null >/dev/null 2>&1 &)")
    time.sleep(18)
    kills = machine.must("dmesg | grep -c 'Out of memory'; true").strip()
    return Injected(at, problems=[] if int(kills) else ["memory did not run out"])


def clock(machine):
    at = time.monotonic()
    for when in ("@0", "@2100000000", "@1000000000"):
        machine.must(f"date -s {when}")
        time.sleep(2)
    return Injected(at)


def data_full(machine):
    at = time.monotonic()
    result = machine.run("dd if=/dev/zero of=/data/filler bs=64k")
    problems = [] if "No space" in result.output else [f"/data did not get full: {result.output}"]
    time.sleep(4)
    machine.must("rm /data/filler")
    return Injected(at, problems=problems)


def data_read_only(machine):
    at = time.monotonic()
    machine.must("mount -o remount,ro /data")
    time.sleep(4)
    machine.must("mount -o remount,rw /data")
    return Injected(at)


SPIN = f"{TOOL} spin $(pidof odid-daemon)"

IN_FLIGHT = (
    Fault("counter_byte", "the counter byte is there: receivers understand every message", NONE_S, nothing, BLUETOOTH),
    Fault("update_beacon", "the beacon on the air follows what is set", NONE_S, nothing, WIFI),
    # One slot and 0.3 s, a Location's own interval, and the allowance for emulation.
    Fault("foreign_command", "a second Bluetooth user turns advertising off", 0.125 + 0.3 + 0.1 + 0.05,
          at_any_phase(command(f"{TOOL} hci 0 {FOREIGN_DISABLE}")), BLUETOOTH),
    Fault("daemon_sigkill", "daemon killed", 1.5, kill("KILL", "odid-daemon")),
    Fault("daemon_sigsegv", "daemon crashes", 1.5, kill("SEGV", "odid-daemon")),
    Fault("daemon_sigstop", "daemon stopped", 5, kill("STOP", "odid-daemon")),
    Fault("daemon_spin", "daemon spins", 5, command(SPIN)),
    Fault("hostapd_sigkill", "hostapd killed", 4, kill("KILL", "hostapd"), WIFI),
    Fault("hostapd_sigstop", "hostapd stopped", 8, kill("STOP", "hostapd"), WIFI),
    Fault("wifi_radio", "Wi-Fi radio removed and re-created", 5, wifi_radio, WIFI),
    Fault("bluetooth_controller", "Bluetooth controller removed and re-attached", 2, bluetooth_controller, BLUETOOTH),
    Fault("rfkill_bluetooth", "Bluetooth blocked, later unblocked", 4, blocked("/sys/class/bluetooth/hci0/rfkill*"), BLUETOOTH),
    Fault("rfkill_wifi", "Wi-Fi blocked, later unblocked", 4, blocked("/sys/class/net/wlan0/phy80211/rfkill*"), WIFI),
    Fault("autopilot_replugged", "autopilot unplugged, back under another number", POSITION_S, replugged),
    Fault("autopilot_wrong_port", "another serial adapter in the autopilot's place, then both", POSITION_S, wrong_port,
          undo=lambda machine: machine.unplug_another()),
    # At once: what was sent goes out in the next slot.
    Fault("autopilot_silent", "autopilot silent for 5 s", 0.6 + FIX_SAID_S, silent),
    Fault("autopilot_rebooted", "autopilot rebooted", 0.6 + FIX_SAID_S, rebooted),
    Fault("relay_sigkill", "mavlink relay killed", 2, kill("KILL", "mavlink-routerd")),
    Fault("load", "all CPU and memory taken", 0.6, load),
    Fault("clock_stepped", "wall clock stepped to 1970, 2036 and 2001", NONE_S, clock),
    Fault("data_full", "/data full", NONE_S, data_full),
    Fault("data_read_only", "/data read-only", NONE_S, data_read_only),
    Fault("everything_killed", "every process killed in random order, ten times", 5, everything),
)


# --- at power-on ------------------------------------------------------------------


def corrupt_data(machine):
    machine.disk.fill(disks.DATA, 0xA5)


def missing_data(machine):
    machine.disk.forget_partition(disks.DATA)


def late_autopilot(machine):
    time.sleep(3)
    at = time.monotonic()
    machine.plug()
    return Injected(at, machine.wait_inside("the port", "ls /dev/ttyUSB* >/dev/null 2>&1"))


def block_bluetooth(machine):
    """What is there and what is to come, before any service has started."""
    machine.must("modprobe rfkill; rfkill block bluetooth")
    if machine.run("pidof odid-daemon").code == 0:
        raise RuntimeError("Bluetooth was not blocked before the daemon had started")


BOOTS = (
    Boot("blocked_at_boot", "hci0 down and soft-blocked at boot", early=block_bluetooth),
    Boot("autopilot_late", "autopilot absent at boot, plugged in later", POSITION_S, power={"adapter": False},
         later=late_autopilot),
    Boot("boot_1970", "booted in 1970", power={"rtc": "1970-01-01T00:00:00"}),
    Boot("boot_2038", "booted in 2038", power={"rtc": "2038-01-19T03:14:00"}),
    Boot("data_corrupt", "/data corrupt at boot", prepare=corrupt_data),
    Boot("data_missing", "/data missing at boot", prepare=missing_data),
)
NAMES = tuple(one.name for one in (*IN_FLIGHT, *BOOTS))


# --- the same, without what mends it ------------------------------------------------


def without(name, what, take_away, give_back):
    """A fault of the list, with what is there against it taken away before: it has to miss its limit."""
    fault = next(one for one in IN_FLIGHT if one.name == name)

    def inject(machine):
        machine.must(take_away)
        return fault.inject(machine)
    return replace(fault, what=f"{fault.what}, without {what}", inject=inject,
                   undo=lambda machine: machine.must(give_back))


def stopped(process):
    return f"kill -STOP {process}", f"kill -CONT {process}"


KEEPER = stopped("$(pidof odid-keeper)")


def supervisor(service):
    """Its supervisor is there, and does nothing."""
    return stopped(f"$(pgrep -f 'runsv /run/service/{service}$')")


def service(name):
    return f"sv down {name}", f"sv up {name}"


# Against the others there is no part that could be left out of a machine that runs: it is how the
# daemon is made, and its own tests show it. Without init's starting everything again the hardware
# watchdog restarts the board, which ends the run.
WITHOUT = (
    without("daemon_sigkill", "its keeper", *KEEPER),
    without("daemon_sigsegv", "its keeper", *KEEPER),
    without("daemon_sigstop", "its keeper", *KEEPER),
    without("daemon_spin", "its keeper", *KEEPER),
    without("hostapd_sigkill", "its supervisor", *supervisor("hostapd")),
    without("hostapd_sigstop", "hostapd-watch", *service("hostapd-watch")),
    without("wifi_radio", "mdev", *service("mdev")),
    without("autopilot_replugged", "mdev", *service("mdev")),
    without("relay_sigkill", "its supervisor", *supervisor("mavlink-router")),
    without("load", "memory kept for what runs",
            "echo 0 >/sys/kernel/mm/lru_gen/min_ttl_ms; echo 0 >/sys/fs/cgroup/appliance/memory.min",
            "echo 1000 >/sys/kernel/mm/lru_gen/min_ttl_ms; echo 64M >/sys/fs/cgroup/appliance/memory.min"),
)
