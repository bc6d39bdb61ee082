"""Commands that no test runs: can they be loaded?"""

import subprocess
import sys

import parts
import patience
import pytest


@pytest.mark.parametrize("module", ["measure.bench", "daemon.demo", "bench.demo", "bench.soak", "bench.without",
                                    "update.power_cuts"])
def test_what_is_run_by_hand_only_can_be_loaded(module):
    result = subprocess.run([sys.executable, "-c", f"import {module}"], capture_output=True, text=True,
                            env=parts.environment(), timeout=patience.LIMIT_S)
    assert result.returncode == 0, result.stderr
