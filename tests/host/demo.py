"""`make demo`: a flight through the real daemon, and what an independent listener heard of it.

  FLIGHT=<log>     the flight to play; default: the recorded one in TEST_DATA, else a generated one
  SECONDS=<n>      how long the listener listens (30)
  LOSS=<model>     receptions that the listener drops
"""

import os
import subprocess
import sys
import time
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from host import parts
from host.flight import write_flight

FOLDER = parts.ROOT / "build/demo"
RECORDED = "arduplane-vtol-sitl.tlog"
LEAD_S = 2.0  # positions flow before the judging begins


def choose_flight(seconds):
    """The flight to play and a sentence about it."""
    named = os.environ.get("FLIGHT")
    if named:
        if not Path(named).is_file():
            sys.exit(f"demo: FLIGHT={named}: no such file")
        return Path(named), f"the flight {named}"
    recorded = parts.test_data() / RECORDED
    if recorded.is_file():
        return recorded, f"a recorded flight of ArduPlane's simulator ({recorded.name})"
    generated = FOLDER / "flight.tlog"
    write_flight(generated, seconds + 15)
    return generated, f"a generated flight ({recorded} isn't there)"


def show_status(bench):
    print("\n--- odidctl status, while flying " + "-" * 45)
    subprocess.run([parts.CONTROL, "-run-dir", bench.folder / "run", "status"], check=False)


def main():
    seconds = float(os.environ.get("SECONDS", "30"))
    FOLDER.mkdir(parents=True, exist_ok=True)
    flight, sentence = choose_flight(seconds)
    print(f"Playing {sentence} for {seconds:g} s at real speed.\n"
          "Real: odid-daemon, its H4 and hostapd-control sides, the judge. Models: the Bluetooth\n"
          "controller and the air (rootcanal), hostapd, the autopilot (a log being played).\n", flush=True)
    bench = parts.Bench(FOLDER)
    try:
        bench.start_daemon()
        bench.wait_on_air()
        bench.play(flight, seconds=seconds + LEAD_S + 15)
        time.sleep(LEAD_S)
        judge = bench.judge(seconds, "--played", FOLDER / "played.jsonl", "--expect", "bt4,bt5,wifi",
                            "--title", f"make demo: {flight.name}", quiet=False, show=True)
        try:
            time.sleep(max(0, seconds - 3))
            show_status(bench)
            code = judge.wait(timeout=60)
        finally:
            if judge.poll() is None:
                judge.terminate()
                judge.wait()
    finally:
        bench.stop()
    print(f"\nIn {FOLDER.relative_to(parts.ROOT)}: report.txt, report.png, figures.json, receptions.jsonl")
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except (TimeoutError, FileNotFoundError, RuntimeError) as error:
        sys.exit(f"demo: {error}")
