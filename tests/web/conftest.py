"""The page's server as a fixture, and a browser that looks at it."""

import os
import shutil
import tempfile
from pathlib import Path

import patience
import pytest

from .appliance import PROGRAM, Appliance
from .updater import Updater

CHROMIUM = shutil.which("chromium")


@pytest.fixture
def folder():
    """Open to the user that the serving half becomes, which pytest's own folder isn't."""
    folder = Path(tempfile.mkdtemp(prefix="odid-web-"))
    folder.chmod(0o755)
    yield folder
    shutil.rmtree(folder)


@pytest.fixture
def appliance(folder):
    if not PROGRAM.exists():
        pytest.skip(f"{PROGRAM.name} isn't built: make daemon")
    made = Appliance(folder / "appliance")
    yield made
    made.end()
    print(f"--- odid-web's log ---\n{made.said()}")


@pytest.fixture
def updater(appliance):
    made = Updater(appliance.folder / "run/swupdate")
    yield made
    made.stop()


@pytest.fixture(scope="session")
def chromium():
    if CHROMIUM is None:
        pytest.skip("chromium isn't installed (Debian: chromium)")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        # Its own sandbox can't be had by root.
        browser = playwright.chromium.launch(executable_path=CHROMIUM, chromium_sandbox=os.geteuid() != 0,
                                             timeout=patience.LIMIT_S * 1000)
        yield browser
        browser.close()
