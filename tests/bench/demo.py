"""`make demo`: boots the appliance in an emulated machine and flies past an independent listener.

`make demo BOARD=cm4`: in the Compute Module's, both radio chips behind the drivers that fly.

  FLIGHT=<log>     the flight to play; default: a generated one, a take-off and circles
  SECONDS=<n>      how long the listener listens (30)
  IMAGE=<disk>     the appliance's disk (build/appliance/disk.img)
"""

import json
import sys
import time
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import patience
import program
from bench import limits
from bench.cm4 import FLASHED, Cm4, missing_for_cm4
from bench.machine import KERNEL_S, Machine, missing
from daemon import demo as host_demo

FOLDER = host_demo.FOLDER
LEAD_S = 1.0  # positions flow before the judging begins, and the aircraft hasn't taken off


def boot(machine):
    """Power on. Returns the figures of the boot, and beside them the kernel's own start: the same work each time."""
    machine.power_on()
    machine.wait_on_air()
    started = machine.started()
    first_s = {channel: machine.air.receptions(channel)[0].mono - started for channel in machine.channels}
    return {"kernel_s": round(machine.kernel_s(), 2)} | {
        f"boot_to_{channel}_s": round(seconds, 2) for channel, seconds in first_s.items()}


def listen(machine, seconds, title):
    """The judge's table, live, and its main figures. Returns its exit code, and odidctl's answer in flight."""
    judge = machine.judge(seconds, *host_demo.JUDGED, ",".join(machine.channels), "--played", machine.folder / "played.jsonl", "--title", title,
                          out=FOLDER, show=True)
    try:
        time.sleep(max(0, seconds - host_demo.STATUS_BEFORE_END_S))
        status = machine.run("odidctl status")
        return judge.wait(patience.BOOTED_S), status.output
    finally:
        if judge.poll() is None:
            judge.terminate()
            judge.wait()


def conclude(code, status, figures, quiet):
    """quiet: what the boot takes on a quiet machine."""
    path = FOLDER / "figures.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | figures, indent=1) + "\n")
    lines = ["", f"From init to the first message: Bluetooth {figures['boot_to_bt4_s']:.2f} s, Wi-Fi "
                 f"{figures['boot_to_wifi_s']:.2f} s; the kernel's own start before it: {figures['kernel_s']:.2f} s", *quiet]
    return host_demo.conclude(code, status, lines, {"machine/console.log": "the appliance's boot, line by line"})


VIRT = (Machine, missing, """Real: the appliance's disk from boot loader to daemon, Linux, hostapd, the judge. Models: the
machine (QEMU), both radios (rootcanal, mac80211_hwsim), the autopilot (a log being played).
""", (f"(on a quiet machine that is {KERNEL_S:g} s, and {limits.BOOT_S['bt4']:g} and {limits.BOOT_S['wifi']:g} s "
      "are allowed then: make test-all)",))
CM4 = (Cm4, missing_for_cm4, f"""Real: {"the image that is flashed, from boot loader to daemon" if FLASHED else "the appliance's root"}, Linux with the
board's device tree and both chips' drivers, hostapd, the judge. Models: the board (QEMU{"" if FLASHED else "; no boot loader"}), both chips
(the Wi-Fi one on USB, where the board has SDIO), the air, the autopilot.
""", ())


def main():
    seconds = host_demo.wanted_seconds()
    kind, missing_for, real, quiet = CM4 if sys.argv[1:] == ["cm4"] else VIRT
    reason = missing_for()
    if reason:
        sys.exit(f"demo: {reason}")
    host_demo.clear()
    flight, sentence = host_demo.choose_flight(seconds)
    print(f"Booting the appliance, then playing {sentence} for {seconds:g} s.\n{real}", flush=True)
    machine = kind(FOLDER / "machine")
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
    return conclude(code, status, figures, quiet)


if __name__ == "__main__":
    program.run("demo", main)
