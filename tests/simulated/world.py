"""Simulated time, what is to happen in it, and the program that lives in it.

The program runs until it waits; then the world says how late it is. Between two of these instants nothing takes any
time, so the same seed gives the same octets on any machine.
"""

import heapq
import itertools
import os
import random
import select
import shutil
import socket
import struct
import subprocess
import tempfile
from pathlib import Path

from host import parts

START_US = 100_000_000  # CLOCK_MONOTONIC when the world begins
UNIX_S = 1_772_359_200  # and what time it is then: 2026-03-01 10:00:00 UTC
BOOT_ID = "6b4a3f0e-2d51-4c1e-9f5a-{:012x}\n"
LIBRARY = parts.ROOT / "build/simulated/seam.so"


class Ended(Exception):
    """A program has ended, by itself or killed."""


def build_library():
    """The seam, where it is missing or older than its source."""
    source = parts.HERE.parent / "simulated/seam.c"
    if not LIBRARY.exists() or LIBRARY.stat().st_mtime < source.stat().st_mtime:
        LIBRARY.parent.mkdir(parents=True, exist_ok=True)
        fresh = LIBRARY.with_suffix(f".{os.getpid()}")
        subprocess.run(["gcc", "-std=gnu11", "-D_GNU_SOURCE", "-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC",
                        "-o", fresh, source], check=True)
        fresh.replace(LIBRARY)


class Program:
    """A program that ships, behind the seam."""

    def __init__(self, world, words, log_path):
        self.world = world
        self._world_end, its_end = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        environment = {
            "PATH": os.environ["PATH"], "LD_PRELOAD": str(LIBRARY), "SIM_FD": str(its_end.fileno()),
            "SIM_NOW_US": str(world.now_us), "SIM_REALTIME_US": str(UNIX_S * 1_000_000 - START_US),
            "SIM_SEED": str(world.seed), "SIM_ROOT": str(world.root)}
        with its_end, open(log_path, "ab") as log:
            self.process = subprocess.Popen([str(word) for word in words], env=environment, pass_fds=[its_end.fileno()],
                                            stdin=subprocess.DEVNULL, stdout=log, stderr=log, cwd=parts.ROOT)

    def waits_until(self):
        """Runs until it waits; its deadline, in simulated microseconds."""
        said = self._world_end.recv(8)
        if not said:
            raise Ended(f"{self.process.args[0]} ended with {self.process.wait()}")
        return struct.unpack("<q", said)[0]

    def wake(self):
        self._world_end.send(struct.pack("<q", self.world.now_us))

    def end(self):
        self.process.kill()
        self.process.wait()
        self._world_end.close()


class World:
    """folder: everything that is left of it. Models say what is to happen (`at`, `after`), and what they listen to.

    late: (share, most in microseconds): of so many of its wake-ups the program is told late, as by a machine that had other
    work."""

    def __init__(self, folder, seed, late=(0.0, 0)):
        build_library()
        self.folder, self.seed, self.now_us = folder, seed, START_US
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        # What the program sees instead of this machine's. A UNIX socket's path has 107 octets at most.
        self.root = Path(tempfile.mkdtemp(prefix="odid-"))
        (self.root / "dev").mkdir()
        self.chance, self.late = random.Random(seed), late
        boot_id = self.root / "proc/sys/kernel/random/boot_id"
        boot_id.parent.mkdir(parents=True)
        boot_id.write_text(BOOT_ID.format(self.chance.getrandbits(48)))
        self.program = self._deadline_us = None
        self._events, self._number = [], itertools.count()
        self._poll, self._listeners = select.poll(), {}
        self._told = False  # something was said to the program at this instant

    @property
    def unix_s(self):
        return self.unix_s_at(self.now_us)

    @staticmethod
    def unix_s_at(us):
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
        self._told = True  # the program's end of it

    def tell(self, sock, octets, to=None):
        """To the program: it runs before anything else happens. Returns whether somebody was there to hear it."""
        self._told = True
        try:
            if to is None:
                sock.send(octets)
            else:
                sock.sendto(octets, to)
        except (BlockingIOError, ConnectionError, FileNotFoundError):
            return False
        return True

    # --- time ---------------------------------------------------------------------

    def start(self, words, log_path):
        self.program, self._deadline_us = Program(self, words, log_path), None

    def run(self, until_us):
        """Everything that happens until then."""
        while True:
            if self._deadline_us is None:
                self._deadline_us = self.program.waits_until()
            for descriptor, _ in self._poll.poll(0):
                if descriptor in self._listeners:  # not closed by an earlier one
                    self._listeners[descriptor]()
            self._told = False
            while not self._told:
                next_us = self._events[0][0] if self._events else until_us
                if min(next_us, self._deadline_us) >= until_us:
                    self.now_us = until_us
                    return
                if self._deadline_us < next_us:
                    self.now_us = max(self.now_us, self._deadline_us)
                    break
                self.now_us = max(self.now_us, next_us)
                self._next_event()
            self._be_late(until_us)
            self.program.wake()
            self._deadline_us = None

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
        if self.program:
            self.program.end()
        shutil.rmtree(self.root)


class Device:
    """A device of the program's machine: whoever opens it has a line to here, one at a time.

    on_octets(octets) is called with what it writes, on_close() when it closes it."""

    def __init__(self, world, path, on_octets, on_close=lambda: None):
        self.world, self.path = world, world.root / path.lstrip("/")
        self.on_octets, self.on_close = on_octets, on_close
        self.listener = self.line = None
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
        self.world.listen(self.line, self._read)
        self._read()

    def _read(self):
        try:
            octets = self.line.recv(65536)
        except BlockingIOError:
            return
        if octets:
            self.on_octets(octets)
        else:
            self._hang_up()

    def send(self, octets):
        return self.line is not None and self.world.tell(self.line, octets)
