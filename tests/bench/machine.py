"""The emulated machine that the appliance boots in, and the parts around it.

  rootcanal <- front.py <- serial line --+              +-- control console: run()
  (the air)               hvc0, hci0     |  QEMU, arm64 |
  wifi.pcap <- tap.py <- virtio port ----+  appliance   +-- USB serial adapter <- player.py
  the judge listens to both              +--------------+   unplug(), plug(): QMP

Everything the appliance is judged by is outside of it; the console's log stays with the run.
"""

import base64
import contextlib
import gzip
import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import tempfile
import time
from collections import namedtuple
from pathlib import Path

import parts
import patience
import quiet
from judge.receptions import read_json_lines
from models.air import Air
from models.controller import Rootcanal, free_ports

from . import disk as disks

QEMU = "qemu-system-aarch64"
KILLED = 128 + 9  # exit code of a command that timeout(1) had to kill
NICENESS = -10
NS_AN_INSTRUCTION_LOG2 = 1  # 500 million in a second of its own: about what an emulated processor does here
# From the kernel's start to init's, at most, on two processors that nobody else wants: the release image's (0.44 s was
# seen), Debian's (1.25 s). What comes then takes up to three times as long.
KERNEL_S = 0.6 if os.environ.get("IMAGE") else 1.3
CHANNELS = ("bt4", "bt5", "wifi")
Result = namedtuple("Result", "code output")


def missing(board="qemu"):
    """Why no machine of this board can be started here, or None."""
    for program, package in ((QEMU, "qemu-system-arm"), ("qemu-img", "qemu-utils"), ("mcopy", "mtools")):
        if not shutil.which(program):
            return f"{program} isn't installed (Debian: {package})"
    for path in (disks.IMAGE, disks.LOADER):
        if not path.exists():
            return f"{path} isn't built: make appliance"
    if disks.board() != board:
        return f"{disks.IMAGE} is made for the board {disks.board()}"
    return None


def connect(path):
    """A UNIX socket that QEMU is about to make."""
    def connected():
        one = socket.socket(socket.AF_UNIX)
        try:
            one.connect(str(path))
            return one
        except (FileNotFoundError, ConnectionRefusedError):
            one.close()
            return None
    return patience.wait_for(f"QEMU's socket {path.name}", connected)


class Qmp:
    """QEMU's own control socket."""

    def __init__(self, path):
        self._socket = connect(path)
        self._lines = self._socket.makefile("r", encoding="utf-8")
        self._socket.settimeout(patience.LIMIT_S)
        self._lines.readline()  # its greeting
        self.command("qmp_capabilities")

    def command(self, name, **arguments):
        self._socket.sendall(json.dumps({"execute": name, "arguments": arguments}).encode() + b"\n")
        while line := self._lines.readline():
            answer = json.loads(line)
            if "error" in answer:
                raise RuntimeError(f"QEMU: {name}: {answer['error']['desc']}")
            if "return" in answer:  # anything else is an event
                return answer["return"]
        raise ConnectionError("QEMU has ended")

    def close(self):
        self._lines.close()
        self._socket.close()


class Shell:
    """The control console: a root shell of the bench's, outside of the appliance's services."""

    READY = "BENCH: ready"
    ANSWER_S = 0.3  # then it is asked again: a machine that restarts forgets what it was told

    def __init__(self, path, alive=lambda: None):
        """alive raises when there is nothing left to wait for."""
        self._socket, self._count, self._got = connect(path), 0, b""

        def answers():
            alive()
            self.send(f"echo {self.READY}")
            try:
                self.until(self.READY.encode(), self.ANSWER_S)
            except TimeoutError:
                return False
            return True
        patience.wait_for("a shell on the control console", answers, limit_s=patience.BOOTED_S)

    def until(self, pattern, timeout_s):
        """What comes before the pattern, and its match."""
        deadline = time.monotonic() + timeout_s
        while True:
            match = re.search(pattern, self._got)
            if match:
                before, self._got = self._got[:match.start()], self._got[match.end():]
                return before, match
            left = deadline - time.monotonic()
            if left <= 0:
                raise TimeoutError(f"the control console: no answer within {timeout_s} s; "
                                   f"so far: {self._got[-300:]!r}")
            self._socket.settimeout(left)
            try:
                data = self._socket.recv(65536)
            except TimeoutError:
                continue
            if not data:
                raise ConnectionError("QEMU has ended")
            self._got += data

    def send(self, command):
        """Doesn't wait for an end."""
        self._socket.settimeout(patience.BOOTED_S)
        self._socket.sendall(f"{command}\n".encode())

    def run(self, command):
        self._count += 1
        mark, limit_s = f"BENCH-{self._count}", patience.BOOTED_S
        # Ended in the machine, too: one command that hangs must not take the console from all others.
        self.send(f"echo {mark}-begins; timeout -s KILL {limit_s} sh -c {shlex.quote(command)} </dev/null 2>&1; "
                  f"echo {mark}-ends $?")
        self.until(rf"{mark}-begins\n".encode(), limit_s)
        output, end = self.until(rf"{mark}-ends (\d+)\n".encode(), 2 * limit_s)
        if int(end[1]) == KILLED:
            raise TimeoutError(f"in the machine: {command}: not done within {limit_s} s: {output[-300:]!r}")
        return Result(int(end[1]), output.decode(errors="replace"))

    def close(self):
        self._socket.close()


class Machine:
    """The machine, its disk, and the parts around it. It is made switched off.

    config: the files of the CONFIG volume; default: an identity as a society's technician gives it.
    """

    channels = CHANNELS
    most_kernel_s = KERNEL_S
    kind_of_disk = disks.Disk
    of_qemu = ("qmp", "control", "fc")  # sockets that it makes

    def __init__(self, folder, config=None, image=disks.IMAGE, memory_mib=384, processors=2, own_time=False):
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.memory_mib, self.processors = memory_mib, processors
        # own_time: its clock goes on by what its processors do (and in their pauses by ours). What else this machine does
        # makes it late to us, and not to itself: its watchdog, its trial's limits and its time-outs see nothing of it.
        self.timing = ("-accel", "tcg,thread=single", "-icount", f"shift={NS_AN_INSTRUCTION_LOG2},sleep=on") if own_time else (
            "-accel", "tcg,thread=multi")
        self.console, self.pcap = self.folder / "console.log", self.folder / "wifi.pcap"
        self.set_log = self.folder / "set.jsonl"
        for old in (*self.folder.glob("*.log"), *self.folder.glob("*.jsonl"), self.pcap):
            old.unlink(missing_ok=True)
        self.disk = self.kind_of_disk(self.folder / "disk", image)
        if config is None:
            config = {"odid.conf": configuration()}
        if config:
            self.disk.put_config(config)
        self.qemu = self.qmp = self.shell = self.player = None
        self.parts = []
        # A UNIX socket's path has 107 octets at most.
        self._sockets = Path(tempfile.mkdtemp(prefix="odid-"))
        self.front_port, self.mavlink_port, self.ssh_port = free_ports(3)
        self.rootcanal = Rootcanal(self.folder / "rootcanal.log")
        try:
            self.air = Air(self.rootcanal.hci_port, self.pcap)
            self._start_radios()
            self.watch = quiet.Watch(self.folder / "quiet.jsonl")
        except BaseException:
            self.close()
            raise

    def _start_radios(self):
        """What is on the air, and what hears it."""
        self.front = self._model("front", "--listen", self.front_port, "--hci-port", self.rootcanal.hci_port,
                                 "--set-log", self.set_log)
        tap = self._add(parts.Part(parts.python(
            "bench.tap", "--listen", self._sockets / "wifi", "--out", self.pcap),
            self.folder / "tap.log", raised=True))
        patience.wait_for("the capture", (self._sockets / "wifi").exists, part=tap)

    def _model(self, name, *words):
        """A model that takes orders; it is ready."""
        part = self._add(parts.Part(parts.python(f"models.{name}", *words), self.folder / f"{name}.log", orders=True,
                                    raised=True))
        if part.process.stdout.readline().strip() != "done":
            raise RuntimeError(f"the model {name} didn't start: {part.log()}")
        return part

    def _add(self, part):
        self.parts.append(part)
        return part

    # --- power --------------------------------------------------------------

    def _board(self):
        """QEMU, what it is to be, what is started first, and how the disk is connected."""
        # As many requests at once as a card's driver has; the kernel keeps memory for each.
        return [QEMU, "-M", "virt,gic-version=3", "-cpu", "cortex-a72", *self.timing, "-bios", disks.LOADER,
                "-device", "virtio-blk-device,drive=disk,queue-size=64"]

    def _words(self, rtc, adapter, radios):
        """QEMU's command line."""
        words = [
            "setpriv", "--pdeathsig", "KILL",  # it would go on, and cost much, when we are killed
            *self._board(), "-smp", self.processors,
            "-m", self.memory_mib, "-nodefaults", "-display", "none",
            "-chardev", f"file,id=console,path={self.console},append=on", "-serial", "chardev:console",
            "-qmp", f"unix:{self._sockets}/qmp,server=on,wait=off",
            # A power cut here ends QEMU, not this machine: what the disk was given is there without a flush.
            "-drive", f"if=none,id=disk,format=qcow2,cache=unsafe,file={self.disk.path}",
            "-device", "virtio-rng-pci",
            "-device", "virtio-serial-pci",
            "-chardev", f"socket,id=bt,host=127.0.0.1,port={self.front_port},nodelay=on",
            "-device", "virtconsole,chardev=bt",
            "-chardev", f"socket,id=control,path={self._sockets}/control,server=on,wait=off",
            # No console by QEMU's word: of what one says it drops what isn't read at once.
            "-device", "virtserialport,chardev=control,name=control",
            "-chardev", f"socket,id=wifi,path={self._sockets}/wifi",
            "-device", "virtserialport,chardev=wifi,name=wifi",
            "-netdev", f"user,id=net,hostfwd=udp:127.0.0.1:{self.mavlink_port}-:14550,"
                       f"hostfwd=tcp:127.0.0.1:{self.ssh_port}-:22",
            "-device", "virtio-net-pci,netdev=net,romfile=",
            "-device", "i6300esb", "-action", "watchdog=reset",
            "-device", "qemu-xhci,id=usb",
            "-chardev", f"socket,id=fc,path={self._sockets}/fc,server=on,wait=off",
            "-chardev", "null,id=another",
        ]
        if adapter:
            words += ["-device", "usb-serial,id=fc,chardev=fc,always-plugged=on,serial=AUTOPILOT"]
        if rtc:
            words += ["-rtc", f"base={rtc}"]
        if not radios:
            words += ["-device", "pci-testdev"]  # guest/root/etc/init.d/S05bench looks for it
        return words

    @staticmethod
    def _environment():
        """QEMU's own."""
        return parts.environment()

    def power_on(self, rtc=None, adapter=True, radios=True, wait=True):
        """rtc: the clock at power-on, as 1970-01-01T00:00:00; adapter: whether the autopilot is plugged in;
        radios: whether the board has any."""
        for name in self.of_qemu:
            (self._sockets / name).unlink(missing_ok=True)
        self.powered_mono = time.monotonic()
        self._boot_from = self.console.stat().st_size if self.console.exists() else 0
        self.qemu = parts.Part(self._words(rtc, adapter, radios), self.folder / "qemu.log", env=self._environment())
        with contextlib.suppress(PermissionError):  # else what else this machine does shows in the figures
            os.setpriority(os.PRIO_PROCESS, self.qemu.process.pid, NICENESS)
        try:
            self.qmp = Qmp(self._sockets / "qmp")
            if wait:
                self.wait_shell()
        except (TimeoutError, RuntimeError, ConnectionError) as error:
            qemu_log = self.qemu.log()
            self.cut_power()
            raise RuntimeError(f"{error}\n{qemu_log}\n--- {self.console} ends ---\n"
                               f"{self.console_text()[-3000:]}") from error
        except BaseException:
            self.cut_power()
            raise

    def wait_shell(self):
        self.shell = Shell(self._sockets / "control", self._still_booting)
        self._uptime_to_mono_s, self._kernel_s = None, self._ask_kernel_s()
        if self not in patience.running:
            patience.running.append(self)

    def _still_booting(self):
        if self.qemu.process.poll() is not None:
            raise RuntimeError(f"QEMU ended with {self.qemu.process.returncode}: {self.qemu.log()}")
        if "neither slot can be started" in self.console_text():
            raise RuntimeError("the boot loader can start neither slot")

    def cut_power(self):
        """What was not on the disk yet is lost."""
        if self in patience.running:
            patience.running.remove(self)
        for one in (self.shell, self.qmp):
            if one:
                one.close()
        self.shell = self.qmp = None
        if self.player:
            self.player.stop()
            self.player = None
        if self.qemu:
            self.qemu.process.kill()
            self.qemu.stop()
            self.qemu = None

    def close(self):
        """May be called again."""
        self.cut_power()
        if not self._sockets.exists():
            return
        for part in reversed(self.parts):
            part.stop()
        for one in ("air", "watch"):
            if hasattr(self, one):
                getattr(self, one).stop()
        self.rootcanal.stop()
        shutil.rmtree(self._sockets)

    # --- what goes on inside ------------------------------------------------

    def run(self, command):
        """A command in the machine, as root: (exit code, output)."""
        return self.shell.run(command)

    def must(self, command):
        """The same, when it can't fail: its output."""
        result = self.run(command)
        if result.code:
            raise RuntimeError(f"in the machine: {command}: exit code {result.code}: {result.output}")
        return result.output

    def put(self, path, data, mode="755"):
        """Puts a file into the machine."""
        text = base64.b64encode(gzip.compress(data)).decode()
        self.must(f"rm -f {path}.z")
        for at in range(0, len(text), 30000):
            self.must(f"echo {text[at:at + 30000]} >>{path}.z")
        self.must(f"base64 -d {path}.z | gunzip >{path} && rm {path}.z && chmod {mode} {path}")

    def mono(self, uptime_s):
        """time.monotonic() at the machine's uptime."""
        if self._uptime_to_mono_s is None:
            tries = []
            for _ in range(3):
                before = time.monotonic()
                uptime = float(self.must("cat /proc/uptime").split()[0])
                after = time.monotonic()
                tries.append((after - before, (before + after) / 2 - uptime))
            self._uptime_to_mono_s = min(tries)[1]
        return uptime_s + self._uptime_to_mono_s

    def wait_inside(self, what, condition):
        """Waits in the machine until a shell condition holds; time.monotonic() at which it did."""
        try:
            output = self.must(f"until {condition}; do usleep 20000; done; cat /proc/uptime")
        except TimeoutError as error:
            raise TimeoutError(f"waited in vain for {what} in the machine: {error}") from None
        return self.mono(float(output.splitlines()[-1].split()[0]))

    wait_for = staticmethod(patience.wait_booted)

    def status(self):
        """The daemon's own view, None when it doesn't answer."""
        output = self.run("odidctl status --json").output
        try:
            return json.loads(output)
        except ValueError:
            return None

    def wait_on_air(self, channels=None, position=False):
        """channels: all of the machine's, unless some are named; position: with a fresh one of the autopilot's."""
        channels = channels or self.channels

        def on_air():
            status = self.status()
            return (status is not None and (status["position"]["fresh"] or not position)
                    and all(status["channels"][one]["state"] == "on air" for one in channels))
        try:
            self.wait_for(f"{', '.join(channels)} on air{' with a position' if position else ''}", on_air, every_s=0.05)
        except TimeoutError as error:
            raise TimeoutError(f"{error}; {self.run('odidctl status').output}") from None

    def wait_all_five(self, channels=None):
        """Until each message was heard on each channel, from now on."""
        self.air.wait_all_five(channels or self.channels, limit_s=patience.BOOTED_S)

    def console_text(self):
        """The console since the last power-on."""
        if not self.console.exists():
            return ""
        with open(self.console, "rb") as log:
            log.seek(self._boot_from)
            return log.read().decode(errors="replace").replace("\r\n", "\n")

    def wait_console(self, pattern):
        return self.wait_for(f"{pattern!r} on the console", lambda: re.search(pattern, self.console_text()), every_s=0.02)

    def started(self):
        """time.monotonic() at which the appliance's init was started."""
        return self.mono(self.kernel_s())

    def kernel_s(self):
        """The kernel's seconds, from its own start to init's; also of a machine that is switched off meanwhile."""
        return self._kernel_s

    def _ask_kernel_s(self):
        """What the kernel says of it, or the bench's initial file system (guest/init) on its behalf. At once: later its log may
        have lost that line."""
        match = re.search(r"^\[ *([\d.]+)\] Run /sbin/init as init process", self.must("dmesg"), re.M)
        if not match:
            raise RuntimeError("the kernel's log does not say when init was started")
        return float(match[1])

    def port_mono(self):
        """time.monotonic() at which the autopilot's port was there, for the last time."""
        found = re.findall(r"^\[ *([\d.]+)\] .* now attached to ttyUSB", self.must("dmesg"), re.M)
        if not found:
            raise RuntimeError("the autopilot's port never came")
        return self.mono(float(found[-1]))

    # --- the autopilot ------------------------------------------------------

    def play(self, flight, start=0, seconds=None):
        """Begins a flight; the player stays when it is over."""
        if self.player:
            self.player.stop()
        played = self.folder / "played.jsonl"
        played.write_text("")  # else an earlier flight's lines are taken for this one's
        words = [flight, "--to", f"unix:{self._sockets}/fc", "--start", start, "--played", played,
                 "--answers", self.folder / "answers.jsonl"]
        if seconds:
            words += ["--seconds", seconds]
        self.player = parts.Part(parts.python("models.player", *words), self.folder / "player.log", orders=True,
                                 raised=True)

    def unplug(self):
        """The autopilot's cable is pulled."""
        if self.player:
            self.player.order("pause")
        self.qmp.command("device_del", id="fc")

    def plug(self):
        self.qmp.command("device_add", driver="usb-serial", id="fc", chardev="fc", serial="AUTOPILOT",
                         **{"always-plugged": True})
        if self.player:
            self.player.order("resume")

    def plug_another(self):
        """A serial adapter without an autopilot behind it."""
        self.qmp.command("device_add", driver="usb-serial", id="another", chardev="another", serial="ANOTHER",
                         **{"always-plugged": True})

    def unplug_another(self):
        self.qmp.command("device_del", id="another")

    def answers(self):
        """What came back to the autopilot."""
        path = self.folder / "answers.jsonl"
        return [answer for _, answer in read_json_lines(path)] if path.exists() else []

    def disturbed(self, from_mono, until_mono):
        """Why what was measured in between says little of the appliance; empty: nothing is known against it."""
        return self.watch.disturbed(from_mono, until_mono)

    def slow(self):
        """The kernel's start is the same work each time, right before ours: where it took long, what comes next does too."""
        seconds = self.kernel_s()
        if seconds > self.most_kernel_s:
            return f"this machine was slow: the kernel's own start took {seconds:.2f} s, {self.most_kernel_s} s at most otherwise"
        return ""

    def boot_disturbed(self):
        """As `disturbed`, of the last power-on."""
        return self.slow() or self.disturbed(self.powered_mono, time.monotonic())

    # --- the judge ----------------------------------------------------------

    def judge(self, seconds, *arguments, out=None, show=False):
        """Starts the judge; seconds None: until it is told to stop. Its report goes to out."""
        out = out or self.folder / "judge"
        words = parts.python("judge", "--hci", f"tcp-client:127.0.0.1:{self.rootcanal.hci_port}",
                             "--pcap", self.pcap, "--follow", "--set-log", self.set_log, "--out", out, *arguments)
        if seconds is not None:
            words += ["--seconds", seconds]
        if show:
            return subprocess.Popen([str(word) for word in words], env=parts.environment(), cwd=parts.ROOT)
        log = Path(f"{out}.log")
        log.unlink(missing_ok=True)  # an older judge's says "listening", too
        part = parts.Part([*words, "--quiet"], log)
        patience.wait_for("the judge", lambda: "listening" in part.log(), part=part)
        return part


def configuration(**sections):
    """odid.conf, as a technician writes it; sections are added, or replace keys."""
    merged = {name: dict(keys) for name, keys in parts.IDENTITY.items()}
    for name, keys in sections.items():
        merged.setdefault(name, {}).update(keys)
    return "".join(f"[{name}]\n" + "".join(f"{key} = {value}\n" for key, value in keys.items()) + "\n"
                   for name, keys in merged.items())
