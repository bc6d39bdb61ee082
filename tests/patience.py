"""How long tests wait, and what things may take: the one place for both.

A wait ends as soon as its condition holds, so a generous limit costs a good run nothing, and no machine that is merely
slow reaches it. What is asserted then is a state. What something may *take* is a promise about time, given beside the wait
(`within_s`) or by `promise`: `make test` doesn't look at it, because a machine that others share is slow by any
factor; `make test-all` judges it at the test's end (conftest.py), where nothing else went on.
"""

import time

LIMIT_S = 180  # for one step of a program on this machine
BOOTED_S = 300  # for what takes an emulated machine many: a start, an installation

broken = []  # promises of the test that runs
running = []  # emulated machines, which can be asked whether they are slow (slow())


def promise(what, took_s, within_s):
    """Judged by `make test-all` only."""
    if took_s > within_s:
        broken.append(f"{what}: {took_s:.2f} s, {within_s:g} s allowed")


def promised(so, otherwise):
    """The same of what is no duration, and rests on time all the same."""
    if not so:
        broken.append(otherwise)


def slow():
    """Why what took its time in a machine that runs now says little of the code; "" where nothing is known of that."""
    for machine in running:
        try:
            why = machine.slow()
        except (RuntimeError, OSError):  # it answers nothing: then that isn't why
            continue
        if why:
            return why
    return ""


def wait_for(what, condition, within_s=None, part=None, every_s=0.02, limit_s=LIMIT_S):
    """The first value of the condition that is true. `part` is whose log says why, when it never is."""
    begun = time.monotonic()
    while True:
        value = condition()
        took_s = time.monotonic() - begun
        if value:
            if within_s is not None:
                promise(what, took_s, within_s)
            return value
        if took_s > limit_s:
            tail = f"; its log ends:\n{part.log()[-6000:]}" if part else ""
            raise TimeoutError(f"waited {limit_s} s in vain for {what}{tail}")
        time.sleep(every_s)


def wait_booted(what, condition, within_s=None, every_s=0.3, limit_s=BOOTED_S):
    """The same of what an emulated machine needs many steps for. Asking costs it something: seldom."""
    return wait_for(what, condition, within_s, every_s=every_s, limit_s=limit_s)


def stays(what, condition, seconds):
    """Looks for so long that something stays as it is; that it has become so is never asked this way."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        assert condition(), f"no longer so: {what}"
        time.sleep(0.02)
