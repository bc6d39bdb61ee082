"""Which tests are selected by what they need, and how those about time are judged.

`booted` is given to each test that boots the appliance, `timed` marks one that needs real time to be kept, `long` one that
takes minutes. `make test` selects none of them (tests/smoke boots for it); what any other test promises beside its waits
(patience.promise) is judged at its end, once ODID_TIMED is set, as `make test-all` does.
"""

import os
import shutil
import tempfile
import time
from pathlib import Path

import patience
import pytest
import quiet
from bench.cm4 import missing_for_cm4
from bench.machine import missing

TIMED = bool(os.environ.get("ODID_TIMED"))


def pytest_configure(config):
    for name, what in (("booted", "boots the appliance in an emulated machine"),
                       ("timed", "needs real time to be kept: make test-all"),
                       ("long", "takes minutes: make update, make test-all")):
        config.addinivalue_line("markers", f"{name}: {what}")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    for item in items:
        if {"machine_possible", "cm4_possible"} & set(item.fixturenames):
            item.add_marker("booted")


@pytest.fixture(scope="session")
def emulation_possible():
    """Asked for by what needs QEMU and the appliance's disk."""
    reason = missing()
    if reason:
        pytest.skip(reason)


@pytest.fixture(scope="session")
def machine_possible(emulation_possible):
    """Asked for by every fixture that boots the appliance."""


@pytest.fixture(scope="session")
def cm4_possible():
    """The same on the Compute Module's board."""
    reason = missing_for_cm4()
    if reason:
        pytest.skip(reason)


@pytest.fixture
def short_folder():
    """A folder of the test's own whose path fits a UNIX socket's 108 octets, open to every user."""
    folder = Path(tempfile.mkdtemp(prefix="odid-"))
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


# --- real time ---------------------------------------------------------------------


def pytest_sessionstart(session):
    """Watches what else this machine does, where it matters."""
    session.config.watch = quiet.Watch(f"build/test/quiet-{os.getpid()}.jsonl") if TIMED else None


def pytest_sessionfinish(session):
    if session.config.watch:
        session.config.watch.stop()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item):
    patience.broken.clear()
    item.begun = time.monotonic()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """A test that is late on a machine with other work says nothing of the code: it is not judged, and says so."""
    report = yield
    if call.when != "call" or not TIMED:
        return report
    late = [*patience.broken]
    if report.failed and item.get_closest_marker("timed") and call.excinfo.errisinstance(AssertionError):
        late.append(str(call.excinfo.value).strip() or call.excinfo.typename)
    elif report.failed or not late:
        return report
    figures = "; ".join(late)
    disturbed = item.config.watch.disturbed(item.begun, time.monotonic()) or patience.slow()
    if disturbed:
        report.outcome, report.longrepr = "skipped", (str(item.path), 0, f"not judged: {disturbed}; {figures}")
    elif report.passed:
        report.outcome, report.longrepr = "failed", f"late, on a machine that had nothing else to do: {figures}"
    return report
