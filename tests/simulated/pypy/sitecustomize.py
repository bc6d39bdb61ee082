"""What Debian 12's PyPy, a Python 3.9, lacks of the Python 3.11 that the tests are written for: `make simulate PYTHON=pypy3`."""

import bisect
import ctypes
import dataclasses
import itertools
import os
import socket
import struct
import termios

KERNEL = ctypes.CDLL(None, use_errno=True)
PIDFD_OPEN = 434  # on each architecture
PROCESSORS = struct.Struct("16Q")  # the kernel's CPU_SETSIZE


def asked(answer):
    if answer < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return answer


def pidfd_open(pid, flags=0):
    return asked(KERNEL.syscall(PIDFD_OPEN, pid, flags))


def sched_getaffinity(pid):
    octets = ctypes.create_string_buffer(PROCESSORS.size)
    asked(KERNEL.sched_getaffinity(pid, PROCESSORS.size, octets))
    bits = int.from_bytes(octets.raw, "little")
    return {number for number in range(PROCESSORS.size * 8) if bits >> number & 1}


def sched_setaffinity(pid, numbers):
    bits = sum(1 << number for number in numbers)
    asked(KERNEL.sched_setaffinity(pid, PROCESSORS.size, bits.to_bytes(PROCESSORS.size, "little")))


def pairwise(iterable):
    one, next_one = itertools.tee(iterable)
    next(next_one, None)
    return zip(one, next_one)


def bisect_right(rows, value, low=0, high=None, *, key=lambda row: row):
    high = len(rows) if high is None else high
    while low < high:
        middle = (low + high) // 2
        if value < key(rows[middle]):
            high = middle
        else:
            low = middle + 1
    return low


def dataclass(cls=None, slots=False, plain=dataclasses.dataclass, **options):
    """Without slots: PyPy's objects are as small without."""
    return plain(cls, **options)


os.pidfd_open, os.sched_getaffinity, os.sched_setaffinity = pidfd_open, sched_getaffinity, sched_setaffinity
socket.SO_PEERCRED, termios.B921600 = 17, 0o10007
itertools.pairwise, bisect.bisect_right, dataclasses.dataclass = pairwise, bisect_right, dataclass
