"""`make demo`: boots the appliance in an emulated machine and flies past an independent listener.

  FLIGHT=<log>     the flight to play; default: the recorded one in TEST_DATA, else a generated one
  SECONDS=<n>      how long the listener listens (30)
  IMAGE=<disk>     the appliance's disk (build/appliance/disk.img)
"""

import json
import sys
import time
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from bench import limits
from bench.machine import CHANNELS, Machine, missing
from host import demo as host_demo
from host import parts, program

FOLDER = host_demo.FOLDER
LEAD_S = 3.0  # positions flow before the judging begins


def boot(machine):
    """Power on. Returns the figures of the boot."""
    machine.power_on()
    machine.wait_on_air()
    started = machine.started()
    return {f"boot_to_{channel}_s": round(machine.air.receptions(channel)[0].mono - started, 2)
            for channel in CHANNELS}


def listen(machine, seconds, title):
    """The judge's table, live, and its report. Returns its exit code, and odidctl's answer in flight."""
    judge = machine.judge(seconds, "--played", machine.folder / "played.jsonl", "--expect", ",".join(CHANNELS),
                          "--title", title, out=FOLDER, show=True)
    try:
        time.sleep(max(0, seconds - host_demo.STATUS_BEFORE_END_S))
        status = machine.run("odidctl status")
        return judge.wait(timeout=90), status
    finally:
        if judge.poll() is None:
            judge.terminate()
            judge.wait()


def conclude(code, status, figures):
    print(f"\n--- odidctl status in the appliance, {host_demo.STATUS_BEFORE_END_S} s before the end, in flight ---")
    print(status.output)
    if status.code != 0:
        print(f"odidctl ended with {status.code}: not everything required was on the air")
        code = code or 1
    for channel, limit_s in limits.BOOT_S.items():
        seconds = figures[f"boot_to_{channel}_s"]
        print(f"From init to the first message on {channel}: {seconds:.2f} s ({limit_s:g} s allowed)")
        if seconds > limit_s:
            code = code or 1
    path = FOLDER / "figures.json"
    judged = json.loads(path.read_text())
    path.write_text(json.dumps({**judged, **figures, "verdict": "FAIL" if code else "PASS"}, indent=1) + "\n")
    print(f"In {FOLDER.relative_to(parts.ROOT)}: report.txt, report.png, figures.json, receptions.jsonl, "
          f"machine/console.log\n{'FAIL' if code else 'PASS'}")
    return code


def main():
    seconds = host_demo.wanted_seconds()
    reason = missing()
    if reason:
        sys.exit(f"demo: {reason}")
    FOLDER.mkdir(parents=True, exist_ok=True)
    for old in ("report.txt", "report.png", "figures.json", "receptions.jsonl"):
        (FOLDER / old).unlink(missing_ok=True)
    flight, sentence = host_demo.choose_flight(seconds)
    print(f"Booting the appliance, then playing {sentence} for {seconds:g} s.\n"
          "Real: the appliance's disk from boot loader to daemon, Linux, hostapd, the judge. Models: the\n"
          "machine (QEMU), both radios (rootcanal, mac80211_hwsim), the autopilot (a log being played).\n",
          flush=True)
    machine = Machine(FOLDER / "machine")
    try:
        figures = boot(machine)
        machine.play(flight, seconds=seconds + LEAD_S + 30)
        machine.wait_on_air(position=True)
        time.sleep(LEAD_S)
        if machine.player.process.poll() is not None:
            raise RuntimeError(f"the flight can't be played: {machine.player.log().strip()}")
        code, status = listen(machine, seconds, f"make demo: {flight.name}")
    finally:
        machine.close()
    return conclude(code, status, figures)


if __name__ == "__main__":
    program.run("demo", main)
