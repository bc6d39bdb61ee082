"""Real-time priority for the models, below the daemon's.

Under load the models must not be what is measured: their timers are the air's.
"""

import functools
import subprocess

PRIORITY = 10  # the daemon's is 20


@functools.cache
def granted():
    """Whether this machine grants it at all: tried on a process that ends at once."""
    return subprocess.run(_raised(["true"]), stderr=subprocess.DEVNULL).returncode == 0


def command(arguments):
    """A command that has the priority from its first instruction on, where it is granted: threads that a
    process has begun already wouldn't get it."""
    return _raised(arguments) if granted() else list(arguments)


def _raised(arguments):
    return ["chrt", "--fifo", str(PRIORITY), *arguments]
