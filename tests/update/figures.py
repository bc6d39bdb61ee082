"""build/update/figures.json: what the tests of updates measure, against the bar.

python3 -m update.figures prints it.
"""

import fnmatch
import json
import subprocess
import time

from host import parts

PATH = parts.ROOT / "build/update/figures.json"
LIMITS = {"install_s": 60, "*_gap_s": 0.6, "*_failed_to_air_s": 90, "power_cuts_failed": 0}


def over(figures):
    """Those that are over their limit."""
    return [name for name, value in figures.items() for pattern, limit in LIMITS.items()
            if fnmatch.fnmatch(name, pattern) and value > limit]


def read():
    return json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}


def note(**figures):
    """Adds figures, or replaces older ones of the same name."""
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    merged = read() | figures | {"commit": commit.stdout.strip(), "date": time.strftime("%Y-%m-%d")}
    violations = len(over(merged))
    merged |= {"violations": violations, "verdict": "FAIL" if violations else "PASS"}
    PATH.parent.mkdir(parents=True, exist_ok=True)
    PATH.write_text(json.dumps(merged, indent=1) + "\n", encoding="utf-8")
    print(" ".join(f"{name}={value}" for name, value in figures.items()), flush=True)


if __name__ == "__main__":
    for key, figure in read().items():
        print(f"{key:40} {figure}")
