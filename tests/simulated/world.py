"""Simulated time, what is to happen in it, and the programs that live in it.

One program runs at a time, until it waits; then the world says how late it is. Between two of these instants nothing takes
any time, so the same seed gives the same octets on any machine.
"""

import heapq
import itertools
import os
import random
import re
import select
import shutil
import signal
import socket
import struct
import subprocess
import tempfile
from collections import namedtuple
from pathlib import Path

import parts
import patience

START_US = 100_000_000  # CLOCK_MONOTONIC when the world begins
NEVER_US = 1 << 63
MEMORY = "/dev/shm"
UNIX_S = 1_772_359_200  # and what time it is then: 2026-03-01 10:00:00 UTC
BOOT_ID = "6b4a3f0e-2d51-4c1e-9f5a-{:012x}\n"
LIBRARY = parts.ROOT / "build/simulated/seam.so"
# seam.c's struct turn
Turn = namedtuple("Turn", "us realtime_us born touched")
TURN = struct.Struct("<4q")


class Ended(Exception):
    """A program of the world's has ended by itself."""


def build_library():
    """The seam, where it is missing or older than its source."""
    source = parts.HERE / "simulated/seam.c"
    if not LIBRARY.exists() or LIBRARY.stat().st_mtime < source.stat().st_mtime:
        LIBRARY.parent.mkdir(parents=True, exist_ok=True)
        fresh = LIBRARY.with_suffix(f".{os.getpid()}")
        subprocess.run(["gcc", "-std=gnu11", "-D_GNU_SOURCE", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC",
                        "-o", fresh, source], check=True)
        fresh.replace(LIBRARY)


def peer(line):
    """The process at the other end."""
    return struct.unpack("3i", line.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, struct.calcsize("3i")))[0]


class Program:
    """A program that ships, behind the seam: one that the world has started, or that such a one has."""

    def __init__(self, world, line, process, parent):
        self.world, self.line, self.process, self.parent = world, line, process, parent
        self.pid = peer(line)
        self._ended = os.pidfd_open(self.pid)
        self.name = Path(f"/proc/{self.pid}/cmdline").read_bytes().split(b"\0")[0].decode().rpartition("/")[2]
        self.deadline_us = None  # until when it waits; None: it runs
        self.hangs = False
        self.wakeups = 0
        for waiting in (socket.SO_RCVTIMEO, socket.SO_SNDTIMEO):  # settimeout() would ask the kernel twice each time
            line.setsockopt(socket.SOL_SOCKET, waiting, struct.pack("ll", patience.LIMIT_S, 0))

    def take_turn(self):
        """It runs until it waits: Turn. Where it ends instead, None, and whoever started it has been told."""
        if self.deadline_us is not None:
            self.wakeups += 1
            self._say(self.world.now_us)
        try:
            said = self.line.recv(TURN.size)
        except ConnectionError:
            said = b""
        except BlockingIOError:
            raise TimeoutError(f"{self.name}, process {self.pid}: neither waits nor ends") from None
        if not said:
            self.bury()
            return None
        turn = Turn(*TURN.unpack(said))
        self.deadline_us = turn.us
        return turn

    def _say(self, us):
        try:
            self.line.send(TURN.pack(us, self.world.realtime_us, 0, 0))
        except ConnectionError:
            pass  # it has ended

    def descriptors(self):
        return len(os.listdir(f"/proc/{self.pid}/fd"))

    def memory_kib(self):
        """Its own: RssAnon."""
        status = Path(f"/proc/{self.pid}/status").read_text()
        return int(re.search(r"^RssAnon:\s*(\d+) kB$", status, re.M)[1])

    def kill(self):
        os.kill(self.pid, signal.SIGKILL)
        self.bury()

    def bury(self):
        """Waits until it has ended."""
        if not select.select([self._ended], [], [], patience.LIMIT_S)[0]:
            raise TimeoutError(f"{self.name}, process {self.pid}: has closed its line to the world, and doesn't end")
        if self.process:
            self.process.wait()
        self.line.close()
        os.close(self._ended)
        self.world.programs.remove(self)


class World:
    """folder: everything that is left of it. Models say what is to happen (`at`, `after`), and what they listen to.

    late: (share, most in microseconds): of so many of its wake-ups the program is told late, as by a machine that had other
    work."""

    def __init__(self, folder, seed, late=(0.0, 0)):
        build_library()
        self.folder, self.seed, self.now_us = folder, seed, START_US
        self.realtime_us = UNIX_S * 1_000_000 - START_US  # CLOCK_REALTIME is ahead by this
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        # What the programs see instead of this machine's; in memory, for a disk takes half a millisecond for each file that is
        # replaced, and there are several a second. A UNIX socket's path has 107 octets at most.
        self.root = Path(tempfile.mkdtemp(prefix="odid-", dir=MEMORY if os.access(MEMORY, os.W_OK) else None))
        for there in ("data/odid", "dev", "run/faults", "run/odid"):
            (self.root / there).mkdir(parents=True)
        self.chance, self.late = random.Random(seed), late
        boot_id = self.root / "proc/sys/kernel/random/boot_id"
        boot_id.parent.mkdir(parents=True)
        boot_id.write_text(BOOT_ID.format(self.chance.getrandbits(48)))
        self.programs = []  # in the order in which they were started
        self._door = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._door.bind(str(self.root / "world"))
        self._door.listen()
        self._events, self._number = [], itertools.count()
        self._poll, self._listeners = select.poll(), {}
        self._told = set()  # to whom something was said at this instant

    @property
    def unix_s(self):
        return self.unix_s_at(self.now_us)

    @staticmethod
    def unix_s_at(us):
        """Of the world, whatever the programs' clock was set to."""
        return UNIX_S + (us - START_US) / 1e6

    # --- what is to happen -------------------------------------------------------

    def at(self, us, call, *arguments):
        heapq.heappush(self._events, (us, next(self._number), call, arguments))

    def after(self, us, call, *arguments):
        self.at(self.now_us + us, call, *arguments)

    def listen(self, sock, call):
        """call() when something can be read, or accepted."""
        sock.setblocking(False)
        self._listeners[sock.fileno()] = call
        self._poll.register(sock, select.POLLIN)

    def close(self, sock):
        del self._listeners[sock.fileno()]
        self._poll.unregister(sock)
        sock.close()
        self._told.update(self.programs)  # whosever end of it that was

    def tell(self, sock, octets, to=None, program=None):
        """That program (None: whichever listens) runs before anything else happens. Returns whether somebody was there to
        hear it."""
        self._told.update([program] if program else self.programs)
        try:
            if to is None:
                sock.send(octets)
            else:
                sock.sendto(octets, to)
        except (BlockingIOError, ConnectionError, FileNotFoundError):
            return False
        return True

    # --- programs -------------------------------------------------------------------

    def start(self, words, log_path):
        """A program, and with it those that it starts."""
        environment = {"PATH": os.environ["PATH"], "LD_PRELOAD": str(LIBRARY), "SIM_ROOT": str(self.root),
                       "SIM_SEED": str(self.seed)}
        with open(log_path, "ab") as log:
            process = subprocess.Popen([str(word) for word in words], env=environment, stdin=subprocess.DEVNULL,
                                       stdout=log, stderr=log, cwd=parts.ROOT)
        self._welcome(process.pid, process)
        return next(one for one in self.programs if one.process is process)

    def _welcome(self, pid, process=None, parent=None):
        """Waits until that process has come. It may have ended before: who started it has been told."""
        ended = os.pidfd_open(pid)
        come, _, _ = select.select([self._door, ended], [], [], patience.LIMIT_S)
        os.close(ended)
        if not come:
            raise TimeoutError(f"process {pid} was started, and doesn't come to the world")
        if self._door not in come:
            if process:
                raise Ended(f"{process.args[0]} ended with {process.wait()}")
            return
        program = Program(self, self._door.accept()[0], process, parent)
        if program.pid != pid:
            raise RuntimeError(f"process {program.pid} has come, and {pid} was expected")
        self.programs.append(program)
        program.take_turn()
        self._told.update(self.programs)

    def called(self, name):
        """The program of that name that was started last; None: there is none."""
        return next((one for one in reversed(self.programs) if one.name == name), None)

    def kill(self, program):
        """And what it has started, which asked the kernel for that."""
        children = [one for one in self.programs if one.parent is program]
        program.kill()
        for child in children:
            child.bury()
        self._told.update(self.programs)

    def go_on(self, program):
        program.hangs = False
        self._told.add(program)

    def _give_turns(self, programs):
        """To these, and to those whom they may have told something."""
        queue = list(programs)
        while queue:
            program = queue.pop(0)
            if program.hangs or program not in self.programs:
                continue
            turn = program.take_turn()
            if turn is None and program.process:
                raise Ended(f"{program.name} ended with {program.process.returncode}")
            if turn:
                self.realtime_us = turn.realtime_us
            if turn and turn.born:
                self._welcome(turn.born, parent=program)
            if turn is None or turn.touched or turn.born:
                queue += [other for other in self.programs if other is not program and other not in queue]

    # --- time ---------------------------------------------------------------------

    def run(self, until_us):
        """Everything that happens until then."""
        while True:
            for descriptor, _ in self._poll.poll(0):
                if descriptor in self._listeners:  # not closed by an earlier one
                    self._listeners[descriptor]()
            due, due_us = None, NEVER_US
            for one in self.programs:
                if one.deadline_us < due_us and not one.hangs:
                    due, due_us = one, one.deadline_us
            while not self._told:
                next_us = self._events[0][0] if self._events else until_us
                if min(next_us, due_us) >= until_us:
                    self.now_us = until_us
                    return
                if due_us < next_us:
                    self.now_us = max(self.now_us, due_us)
                    break
                self.now_us = max(self.now_us, next_us)
                self._next_event()
            self._be_late(until_us)
            turns = [one for one in self.programs if one in self._told] or [due]
            self._told.clear()
            self._give_turns(turns)

    def _next_event(self):
        _, _, call, arguments = heapq.heappop(self._events)
        call(*arguments)

    def _be_late(self, until_us):
        share, most_us = self.late
        if not share or self.chance.random() >= share:
            return
        until_us = min(until_us, self.now_us + self.chance.randint(0, most_us))
        while self._events and self._events[0][0] <= until_us:
            self.now_us = max(self.now_us, self._events[0][0])
            self._next_event()
        self.now_us = max(self.now_us, until_us)

    def end(self):
        while self.programs:
            self.kill(self.programs[0])
        self._door.close()
        shutil.rmtree(self.root)


class Port:
    """A UDP port of the program's machine, and another program (mavlink-router) that speaks to it."""

    def __init__(self, world, address, on_octets):
        self.world, self.address, self.on_octets, self.there = world, address, on_octets, True
        self.sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.sock.bind((address[0], 0))
        world.listen(self.sock, self._read)

    def _read(self):
        while True:
            try:
                octets = self.sock.recv(65536)
            except BlockingIOError:
                return
            except ConnectionError:
                continue  # what was sent reached nobody
            self.on_octets(octets)

    def plug_in(self):
        self.there = True

    def unplug(self):
        self.there = False

    def send(self, octets):
        return self.there and self.world.tell(self.sock, octets, self.address)


class Device:
    """A device of the program's machine: whoever opens it has a line to here, one at a time.

    on_octets(octets) is called with what it writes, on_open() when it opens it, on_close() when it closes it."""

    def __init__(self, world, path, on_octets, on_close=lambda: None, on_open=lambda: None):
        self.world, self.path = world, world.root / path.lstrip("/")
        self.on_octets, self.on_close, self.on_open = on_octets, on_close, on_open
        self.listener = self.line = self.program = None
        self.plug_in()

    def plug_in(self):
        self.listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.listener.bind(str(self.path))
        self.listener.listen(1)
        self.world.listen(self.listener, self._accept)

    def unplug(self):
        self.path.unlink()
        self.world.close(self.listener)
        self._hang_up()

    def _hang_up(self):
        if self.line:
            self.world.close(self.line)
            self.line = None
            self.on_close()

    def _accept(self):
        self._hang_up()
        self.line, _ = self.listener.accept()
        pid = peer(self.line)
        self.program = next((one for one in self.world.programs if one.pid == pid), None)
        self.world.listen(self.line, self._read)
        self.on_open()
        self._read()

    def _read(self):
        try:
            octets = self.line.recv(65536)
        except BlockingIOError:
            return
        except ConnectionError:  # it was killed, with something unread
            octets = b""
        if octets:
            self.on_octets(octets)
        else:
            self._hang_up()

    def send(self, octets):
        return self.line is not None and self.world.tell(self.line, octets, program=self.program)
