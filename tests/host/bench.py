"""`make bench`: the figures of docs/measurements.md, measured on this machine.

Each run is the whole chain in real time: a flight played into the real daemon, its commands to the
controller model, the independent listener's figures. `--long` takes the field study's durations
(300 s, and 900 s for T-L5); `--quick` is for trying the bench itself. `--only NAME` runs one.
"""

import argparse
import datetime
import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from host import parts, realtime
from host.demo import LEAD_S, RECORDED
from host.flight import write_flight

FOLDER = parts.ROOT / "build/bench"
# The field study's T-L4, as published. What its other scenarios were isn't public in detail: their
# loads below are ours, under the study's names.
STRESS = {
    "T-L0": None,
    "T-L2": "--cpu 1",
    "T-L3": "--cpu 4",
    "T-L4": "--cpu 4 --vm 1 --vm-bytes 256M --io 2",
    "T-L5": None,
    "T-L6a": "--vm 1 --vm-bytes 256M",
    "T-L6b": "--io 2",
}
STUDY = ("the study, at its host: Location mean 1.004-1.006 s, sigma 0.8-2.0 ms, max 1.015 s; "
         "RSS 2124 kB; CPU 0.09-0.33 %")

OTHERS = ("basic_id", "system", "operator_id", "self_id")


class Table:
    """Figures, the limits they were held against, and what came of it."""

    def __init__(self):
        self.figures, self.rows, self.failed = {}, [], 0

    def add(self, name, value, limit=None, what=""):
        """limit None: only shown. A missing value fails."""
        verdict = ""
        if limit is not None:
            good = value is not None and value <= limit
            verdict = "PASS" if good else "FAIL"
            self.failed += not good
        if value is not None:
            self.figures[name] = round(value, 4)
        shown = "missing" if value is None else f"{value:.3f}"
        self.rows.append(f"{name:<52} {shown:>10}  {'<= %g' % limit if limit is not None else '':<9} "
                         f"{verdict:<5}{what}".rstrip())
        print(self.rows[-1], flush=True)

    def say(self, text):
        self.rows.append(text)
        print(text, flush=True)


def memory_kib(pid):
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return {line.split(":")[0]: int(line.split()[1]) for line in lines
            if line.startswith(("VmRSS", "RssAnon"))}


def cpu_ms(pid):
    """CPU time of a process so far; the scheduler counts it in nanoseconds."""
    return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1e6


class Load:
    """stress-ng beside the run."""

    def __init__(self, options, seconds):
        self.process = None
        if options:
            if not shutil.which("stress-ng"):
                raise FileNotFoundError("stress-ng isn't installed: make setup")
            self.process = subprocess.Popen(
                ["stress-ng", *options.split(), "--timeout", str(int(seconds)), "--quiet"],
                stdin=subprocess.DEVNULL)
            time.sleep(1)

    def stop(self):
        if self.process:
            self.process.terminate()
            self.process.wait()


def fly(name, flight, seconds, mode="full", load=None, channels="bt4,bt5,wifi"):
    """One run. Returns the judge's figures, and the daemon's own beside them."""
    folder = FOLDER / name
    bench = parts.Bench(folder, mode=mode)
    stress = Load(None, 0)
    try:
        bench.start_daemon()
        bench.wait_on_air(channels.split(","))
        bench.play(flight, seconds=seconds + LEAD_S + 15)
        time.sleep(LEAD_S)
        stress = Load(load, seconds + 20)
        judge = bench.judge(seconds, "--played", folder / "played.jsonl", "--expect", channels,
                            "--title", name)
        pid = bench.daemon.process.pid
        time.sleep(min(3, seconds / 4))
        before, cpu_before, from_s = memory_kib(pid), cpu_ms(pid), time.monotonic()
        time.sleep(max(1, seconds - 3))
        after, cpu_after, to_s = memory_kib(pid), cpu_ms(pid), time.monotonic()
        status = bench.status()
        judge.process.wait(timeout=90)
    finally:
        stress.stop()
        bench.stop()
    path = folder / "figures.json"
    if not path.exists():
        raise RuntimeError(f"{name}: the judge left no figures: {judge.log()[-2000:]}")
    figures = json.loads(path.read_text())
    figures.update(rss_anon_kib=after["RssAnon"], rss_anon_growth_kib=after["RssAnon"] - before["RssAnon"],
                   vm_rss_kib=after["VmRSS"],
                   cpu_ms_per_s=(cpu_after - cpu_before) / (to_s - from_s),
                   slot_jitter_p99_ms=status["schedule"]["slot_lateness_p99_us"] / 1000,
                   slot_jitter_max_ms=status["schedule"]["slot_lateness_max_us"] / 1000,
                   slots_skipped=status["schedule"]["skipped"])
    return figures


def show_location(table, prefix, figures, limits):
    for name, limit in zip(("reception_p99", "reception_max", "content_p99", "content_max"), limits):
        table.add(f"{prefix}_bt4_location_{name}_s", figures.get(f"bt4_location_{name}_s"), limit)


def show_verdict(table, prefix, figures):
    table.add(f"{prefix}_violations", figures["violations"], 0)
    missing = figures["bt4_payloads_set"] - figures["bt4_payloads_heard"]
    table.add(f"{prefix}_bt4_payloads_unheard", missing, 0, f" of {figures['bt4_payloads_set']}")


def show_slots(table, prefix, figures, limit_ms, realtime_granted):
    if realtime_granted:
        table.add(f"{prefix}_slot_jitter_p99_ms", figures["slot_jitter_p99_ms"], limit_ms)
    else:
        table.add(f"{prefix}_slot_jitter_p99_ms", figures["slot_jitter_p99_ms"], None,
                  "not judged: real-time priority is refused here")


def rejudge(table, name, prefix, loss, all_five_s, location_p99_s):
    """The same receptions with a share of them dropped: the edge of range."""
    folder = FOLDER / f"{name}-loss"
    words = parts.python("receiver", "--receptions", FOLDER / name / "receptions.jsonl", "--loss", loss,
                         "--seed", 1, "--out", folder, "--quiet", "--expect", "bt4")
    subprocess.run([str(word) for word in words], env=parts.environment(), cwd=parts.ROOT,
                   stdout=subprocess.DEVNULL, check=False)
    figures = json.loads((folder / "figures.json").read_text())
    table.add(f"{prefix}_loss50_all_five_p99_s", figures.get("bt4_all_five_within_p99_s"), all_five_s)
    table.add(f"{prefix}_loss50_bt4_location_reception_p99_s",
              figures.get("bt4_location_reception_p99_s"), location_p99_s)


def hello_world_kib():
    """VmRSS of a C program that does nothing, on this machine."""
    source, program = FOLDER / "hello.c", FOLDER / "hello"
    source.write_text('#include <stdio.h>\n#include <unistd.h>\n'
                      'int main(void)\n{\n    puts("hello");\n    return pause();\n}\n')
    subprocess.run(["cc", "-O2", "-o", program, source], check=True)
    process = subprocess.Popen([program], stdout=subprocess.DEVNULL)
    time.sleep(0.3)
    figures = memory_kib(process.pid)
    process.kill()
    process.wait()
    return figures["VmRSS"]


def run_bar(table, flights, seconds, granted):
    """The figures that the product is held to."""
    table.say("\nA generated flight, 5 Hz, a controller that takes 20 ms")
    figures = fly("bar-20ms", flights["generated"], seconds)
    show_location(table, "bar20", figures, (0.20, 0.25, 0.30, 0.40))
    for message in OTHERS:
        table.add(f"bar20_bt4_{message}_reception_max_s", figures.get(f"bt4_{message}_reception_max_s"), 1.1)
    for channel in ("wifi", "bt5"):
        table.add(f"bar20_{channel}_location_content_max_s",
                  figures.get(f"{channel}_location_content_max_s"), None)
    show_verdict(table, "bar20", figures)
    table.add("position_age_p99_s", figures.get("position_age_p99_s"), 0.4 + flights["interval_s"],
              " (0.4 s beyond the autopilot's own interval)")
    show_slots(table, "bar20", figures, 1, granted)
    table.add("rss_anon_kib", figures["rss_anon_kib"], 400)
    table.add("rss_anon_growth_kib", figures["rss_anon_growth_kib"], 8, " over the run")
    table.add("vm_rss_kib", figures["vm_rss_kib"], None, f"hello world here: {hello_world_kib()} kB")
    table.add("cpu_ms_per_s", figures["cpu_ms_per_s"], 3)
    rejudge(table, "bar-20ms", "bar20", 0.5, 2.5, 0.5)

    table.say("\nThe same, a controller that takes 100 ms only")
    figures = fly("bar-100ms", flights["generated"], seconds, "bcm43455", channels="bt4,wifi")
    show_location(table, "bar100", figures, (0.33, 0.40, 0.40, 0.50))
    for message in OTHERS:
        table.add(f"bar100_bt4_{message}_reception_max_s", figures.get(f"bt4_{message}_reception_max_s"), 1.1)
    show_verdict(table, "bar100", figures)
    rejudge(table, "bar-100ms", "bar100", 0.5, 9, 1.7)


def run_log(table, flights, seconds):
    if flights["recorded"] is None:
        table.say("\nThe recorded flight is skipped: it isn't in TEST_DATA")
        return
    table.say("\nThe recorded flight, whole, with the gaps that it has")
    figures = fly("log", flights["recorded"], seconds)
    show_location(table, "log", figures, (None,) * 4)
    show_verdict(table, "log", figures)


def run_scenarios(table, flights, names, seconds, granted):
    for name in names:
        table.say(f"\n{name}: stress-ng {STRESS[name] or '(nothing)'}")
        limits = (None, 0.5, None, 0.6) if name == "T-L4" else (None,) * 4
        length = seconds * 3 if name == "T-L5" else seconds
        figures = fly(name, flights["generated"], length, load=STRESS[name])
        key = name.replace("-", "").lower()
        show_location(table, key, figures, limits)
        table.add(f"{key}_bt4_location_content_mean_s", figures.get("bt4_location_content_mean_s"))
        show_slots(table, key, figures, 2 if name == "T-L4" else None, granted)
        table.add(f"{key}_vm_rss_kib", figures["vm_rss_kib"])
        table.add(f"{key}_cpu_percent", figures["cpu_ms_per_s"] / 10)
        table.add(f"{key}_violations", figures["violations"], 0)


def run_model(table, seconds):
    """The field study's schedule in the same bench: its log, and the air."""
    table.say("\nThe field study's own schedule, modelled, on the same air at 100 ms")
    folder = FOLDER / "field-study"
    bench = parts.Bench(folder, hostapd=False)
    try:
        model = bench._add(parts.Part(
            parts.python("host.field_study", "--hci-port", bench.rootcanal.hci_port, "--seconds", seconds + 4),
            folder / "model.log", raised=True))
        time.sleep(1)
        judge = bench.judge(seconds, "--expect", "bt4", "--address", "C6:05:04:03:02:01")
        judge.process.wait(timeout=seconds + 60)
        model.process.wait(timeout=30)
        own = json.loads(model.log().splitlines()[-1])
    finally:
        bench.stop()
    heard = json.loads((folder / "figures.json").read_text())
    for name, value in own.items():
        table.add(f"model_{name}", value, None, " what its log says")
    for name in ("reception_p99", "reception_max", "content_max"):
        table.add(f"model_bt4_location_{name}_s", heard.get(f"bt4_location_{name}_s"), None,
                  " what is heard")
    table.say(STUDY)


def write_results(table):
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True,
                            cwd=parts.ROOT, check=False).stdout.strip() or "unknown"
    violations = sum(int(value) for name, value in table.figures.items() if name.endswith("_violations"))
    verdict = "PASS" if table.failed == 0 else "FAIL"
    (FOLDER / "figures.json").write_text(json.dumps(
        {**table.figures, "violations": violations, "commit": commit, "verdict": verdict,
         "date": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds")}, indent=1) + "\n")
    table.say(f"\n{verdict}: {table.failed} figure(s) over their limit"
              if table.failed else "\nPASS: every figure within its limit")
    (FOLDER / "report.txt").write_text("\n".join(table.rows) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--long", action="store_true", help="the study's durations")
    parser.add_argument("--quick", action="store_true", help="15 s a run, to try the bench itself")
    parser.add_argument("--only", choices=("bar", "log", "scenarios", "model"))
    arguments = parser.parse_args()
    seconds = 300 if arguments.long else 15 if arguments.quick else 60
    whole = 15 if arguments.quick else 190
    FOLDER.mkdir(parents=True, exist_ok=True)
    flights = {"generated": FOLDER / "flight.tlog", "interval_s": 0.2,
               "recorded": parts.test_data() / RECORDED}
    longest = max(whole, seconds * (3 if arguments.long else 1))
    write_flight(flights["generated"], longest + 30)
    if not flights["recorded"].is_file():
        flights["recorded"] = None
    granted = realtime.granted()
    table = Table()
    if not granted:
        table.say("Real-time priority is refused here: slot deadlines aren't judged.")
    wanted = [arguments.only] if arguments.only else ["bar", "log", "scenarios", "model"]
    names = ["T-L0", "T-L2", "T-L3", "T-L4"] + (["T-L5"] if arguments.long else []) + ["T-L6a", "T-L6b"]
    if "bar" in wanted:
        run_bar(table, flights, whole, granted)
    if "log" in wanted:
        run_log(table, flights, whole)
    if "scenarios" in wanted:
        run_scenarios(table, flights, names, seconds, granted)
    if "model" in wanted:
        run_model(table, seconds)
    write_results(table)
    return 0 if table.failed == 0 else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
    except (TimeoutError, FileNotFoundError, RuntimeError) as error:
        sys.exit(f"bench: {error}")
