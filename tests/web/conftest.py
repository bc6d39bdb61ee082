"""The page's server as a fixture, and a browser that looks at it."""

import os
import shutil

import patience
import pytest

from .appliance import PROGRAM, Appliance
from .updater import Updater

CHROMIUM = shutil.which("chromium")


@pytest.fixture
def appliance(short_folder):
    if not PROGRAM.exists():
        pytest.skip(f"{PROGRAM.name} isn't built: make daemon")
    made = Appliance(short_folder / "appliance")
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
