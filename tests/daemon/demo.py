"""`make demo-host`: a flight through the real daemon, and what an independent listener heard of it.

  FLIGHT=<log>     the flight to play; default: a generated one, a take-off and circles
  SECONDS=<n>      how long the listener listens (30)
  LOSS=<model>     receptions that the listener drops
"""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import parts
import patience
import program
from models.flight import write_flight

FOLDER = parts.ROOT / "build/demo"
GENERATED_MORE_S = 600  # than is listened to: until all is on the air, on any machine
LEAD_S = 2.0  # positions flow before the judging begins
STATUS_BEFORE_END_S = 3
RESULTS = {
    "report.txt, report.png": "all that the listener measured, and when",
    "receptions.jsonl": "each reception, to recompute it: python3 -m judge --receptions (tests/judge)",
    "figures.json": "the figures, to compare one day with another",
    "status.txt": "what odidctl status said in flight",
}
PLAIN = re.compile(r"\x1b\[[0-9;]*m")
# What is transmitted, in every field. When it was heard is in the report beside its limits, and tells of the machine that
# runs the demo as much as of the daemon.
JUDGED = ("--without-time", "--brief", "--expect")
CHANNELS = "bt4,bt5,wifi"


def choose_flight(seconds):
    """The flight to play and a sentence about it."""
    named = os.environ.get("FLIGHT")
    if named:
        if not Path(named).is_file():
            sys.exit(f"demo: FLIGHT={named}: no such file")
        return Path(named), f"the flight {named}"
    generated = FOLDER / "flight.tlog"
    write_flight(generated, seconds + GENERATED_MORE_S)
    return generated, "a generated flight (a take-off and circles; FLIGHT=<.tlog> plays another one)"


def wanted_seconds():
    text = os.environ.get("SECONDS") or "30"
    try:
        seconds = float(text)
    except ValueError:
        seconds = 0
    if not 5 <= seconds <= 3600:
        sys.exit(f"demo: SECONDS={text}: expected a number from 5 to 3600")
    return seconds


def listen(bench, seconds, title):
    """The judge's table, live, and its main figures. Returns the judge's exit code and odidctl's answer,
    asked for in flight; it is shown later, because the table is drawn in place."""
    judge = bench.judge(seconds, *JUDGED, CHANNELS, "--played", FOLDER / "played.jsonl", "--title", title, quiet=False, show=True)
    try:
        time.sleep(max(0, seconds - STATUS_BEFORE_END_S))
        status = subprocess.run([parts.CONTROL, "-root", bench.folder, "status"],
                                capture_output=True, text=True, timeout=patience.LIMIT_S)
        return judge.wait(patience.BOOTED_S), status.stdout + status.stderr
    finally:
        if judge.poll() is None:
            judge.terminate()
            judge.wait()


def clear():
    """No file of an earlier demo is taken for this one's."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for old in ", ".join(RESULTS).split(", "):
        (FOLDER / old).unlink(missing_ok=True)


def conclude(code, status, lines=(), more=None):
    """What odidctl said, lines, and where all of it is. The demo's verdict is the judge's, and so is its exit status."""
    (FOLDER / "status.txt").write_text(status)
    print("\nThe technician's view (odidctl status), in flight:")
    print("\n".join(f"  {line}" for line in PLAIN.sub("", status).splitlines()[:2]))
    for line in lines:
        print(line)
    print(f"\nWhere to look next, in {FOLDER.relative_to(parts.ROOT)}:")
    for files, what in {**RESULTS, **(more or {})}.items():
        print(f"  {files:22} {what}")
    print("And: make demo LOSS=0.5 (the edge of range), make bench (under load), make test, make help")
    print("FAIL" if code else "PASS")
    return code


def main():
    seconds = wanted_seconds()
    clear()
    flight, sentence = choose_flight(seconds)
    print(f"Playing {sentence} for {seconds:g} s at real speed.\n"
          "Real: odid-daemon, its H4 and hostapd-control sides, the judge. Models: the Bluetooth\n"
          "controller and the air (rootcanal), hostapd, the autopilot (a log being played).\n", flush=True)
    bench = parts.Bench(FOLDER)
    try:
        bench.start_daemon()
        bench.wait_on_air()
        player = bench.play(flight, seconds=seconds + LEAD_S + 15)
        time.sleep(LEAD_S)
        if player.process.poll() is not None:
            raise RuntimeError(f"the flight can't be played: {player.log().strip()}")
        code, status = listen(bench, seconds, f"make demo-host: {flight.name}")
    finally:
        bench.stop()
    return conclude(code, status)


if __name__ == "__main__":
    program.run("demo", main)
