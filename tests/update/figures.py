"""build/update/figures.json: what the tests of updates measure, against the bar.

python3 -m update.figures prints it.
"""

import fnmatch
import json
import subprocess
import time

import parts

PATH = parts.ROOT / "build/update/figures.json"
GAP_S = 0.6
LIMITS = {"install_s": 60, "*_gap_s": GAP_S, "*_failed_to_air_s": 90, "power_cuts_failed": 0}


def over(figures):
    """Those that are over their limit."""
    return [name for name, value in figures.items() for pattern, limit in LIMITS.items()
            if fnmatch.fnmatch(name, pattern) and value > limit]


def read():
    return json.loads(PATH.read_text(encoding="utf-8")) if PATH.exists() else {}


def verdict(figures):
    """FAIL, PASS, or None: nothing is over its limit, but not all that has one was measured."""
    if over(figures):
        return "FAIL"
    return "PASS" if all(fnmatch.filter(figures, pattern) for pattern in LIMITS) else None


def head():
    return subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                          check=False).stdout.strip()


def note(**figures):
    """Adds figures, or replaces older ones of the same name. Those of another commit don't stay."""
    commit, known = head(), read()
    merged = (known if known.get("commit") == commit else {}) | figures
    merged.pop("verdict", None)
    merged |= {"commit": commit, "date": time.strftime("%Y-%m-%d"), "violations": len(over(merged))}
    if said := verdict(merged):
        merged["verdict"] = said
    PATH.parent.mkdir(parents=True, exist_ok=True)
    PATH.write_text(json.dumps(merged, indent=1) + "\n", encoding="utf-8")
    print(" ".join(f"{name}={value}" for name, value in figures.items()), flush=True)


if __name__ == "__main__":
    for key, figure in read().items():
        print(f"{key:40} {figure}")
