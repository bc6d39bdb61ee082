"""Updates of the appliance in the bench's machine (see README.md)."""

import pytest

# Takes minutes: only in make update and make test-all (conftest.py).
LONG = pytest.mark.long
