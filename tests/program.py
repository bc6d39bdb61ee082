"""How each command of the tests ends."""

import signal
import subprocess
import sys


NOT_JUDGED = 77  # exit code: what is beyond its limit was measured beside other work (run/command.py)


def run(name, main):
    """Runs main(), whose value is the exit code. What can't go on is one sentence; the parts that were
    started are ended in any case, also when we are told to end."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except (OSError, RuntimeError, subprocess.SubprocessError) as error:  # a TimeoutError is an OSError
        sys.exit(f"{name}: {error}")
