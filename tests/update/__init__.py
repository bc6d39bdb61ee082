"""Updates of the appliance in the bench's machine (see README.md)."""

import os

import pytest

LONG = pytest.mark.skipif(not os.environ.get("TEST_LONG"), reason="minutes: make update, make test-long")
