"""Single runs of `make bench`: a flight through the daemon, the same with losses, the field study's model."""

import contextlib
import json
import os
import shutil
import statistics
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import parts
import quiet

from . import costs

LEAD_S = 2.0  # positions flow before the judging begins
SETTLE_S = 3.0  # the daemon's start isn't part of its flight
LOSS_DRAWS = 41
MODEL_ADDRESS = "C6:05:04:03:02:01"


def fresh(folder):
    """Nothing of an earlier run may be taken for this one's."""
    if folder.exists():
        shutil.rmtree(folder)
    folder.mkdir(parents=True)
    return folder


@contextlib.contextmanager
def in_memory(folder):
    """A folder in memory for the length of a run, kept as `folder` afterwards."""
    fresh(folder)
    with tempfile.TemporaryDirectory(prefix="odid-bench-", dir=parts.memory()) as name:
        try:
            yield Path(name)
        finally:
            for path in Path(name).iterdir():
                if path.is_file() and not path.is_symlink():
                    shutil.copy2(path, folder)


def _read_figures(folder, log):
    path = folder / "figures.json"
    if not path.exists():
        raise RuntimeError(f"{folder}: the judge left no figures: {log[-2000:]}")
    return json.loads(path.read_text())


def fly(kept, flight, seconds, mode="full", load=None, realtime=True):
    """A flight in real time. Returns the judge's figures, what was measured of the daemon, and as `disturbed` what
    speaks against all of these: empty on a machine that had nothing else to do."""
    with in_memory(kept) as folder:
        watch = quiet.Watch(folder / "quiet.jsonl")
        try:
            begun = time.monotonic()
            figures = _fly(parts.Bench(folder, mode=mode), kept.name, flight, seconds, load, realtime)
            if disturbed := watch.disturbed(begun, time.monotonic()):
                figures["violations_without_time"] = violations_without_time(folder, folder / "played.jsonl")
            return figures | {"disturbed": disturbed}
        finally:
            watch.stop()


def violations_without_time(folder, played):
    """Those of a run's receptions that don't depend on when they were heard: what other work is no excuse for."""
    out = folder / "without-time"
    words = parts.python("judge", "--receptions", folder / "receptions.jsonl", "--played", played, "--without-time",
                         "--out", out, "--quiet")
    result = subprocess.run([str(word) for word in words], env=parts.environment(), cwd=parts.ROOT,
                            capture_output=True, text=True)
    return _read_figures(out, result.stdout + result.stderr)["violations"]


def _fly(bench, name, flight, seconds, load, realtime):
    channels = ("bt4", "bt5", "wifi") if bench.mode == "full" else ("bt4", "wifi")
    stress, bare = costs.Load(None, 0), costs.BareTimer(bench.folder)
    try:
        bench.start_daemon(realtime=realtime)
        bench.wait_on_air(channels)
        player = bench.play(flight, seconds=seconds + LEAD_S + 15)
        time.sleep(LEAD_S)
        stress = costs.Load(load, seconds + 60)
        judge = bench.judge(seconds, "--played", bench.folder / "played.jsonl", "--expect",
                            ",".join(channels), "--title", name)
        pid = bench.daemon.process.pid
        time.sleep(min(SETTLE_S, seconds / 4))
        bare.start(max(1, seconds - SETTLE_S))
        before, cpu_before_ms, from_s = costs.memory_kib(pid), costs.cpu_ms(pid), time.monotonic()
        time.sleep(max(1, seconds - SETTLE_S))
        after, cpu_after_ms, to_s = costs.memory_kib(pid), costs.cpu_ms(pid), time.monotonic()
        status = bench.status()
        judge.process.wait(timeout=120)
        bare_timer_ms = bare.late_p99_ms()
        for part, what in ((player, "the player"), (bench.daemon, "the daemon")):
            if part.process.poll() is not None:
                raise RuntimeError(f"{name}: {what} ended early: {part.log()[-2000:]}")
        if not stress.is_running():
            raise RuntimeError(f"{name}: stress-ng ended before the run did")
    finally:
        bare.stop()
        stress.stop()
        bench.stop()
    figures = _read_figures(bench.folder, judge.log())
    figures.update(costs.interval_figures(costs.host_locations_s(bench.set_log)))
    figures.update(rss_anon_kib=after["RssAnon"], rss_anon_growth_kib=after["RssAnon"] - before["RssAnon"],
                   vm_rss_kib=after["VmRSS"],
                   cpu_ms_per_s=(cpu_after_ms - cpu_before_ms) / (to_s - from_s),
                   slot_jitter_p99_ms=status["schedule"]["slot_lateness_p99_us"] / 1000,
                   slot_jitter_max_ms=status["schedule"]["slot_lateness_max_us"] / 1000,
                   bare_timer_p99_ms=bare_timer_ms, slots_skipped=status["schedule"]["skipped"],
                   realtime=status["privilege"]["realtime"])
    return figures


def with_losses(folder, loss):
    """The receptions of a run with a share of them dropped: the edge of range.

    Returns each figure's median over many draws, and its largest as <name>_worst: the p99 of the
    few hundred receptions that are left rests on five of them. At 100 ms a draw's is off by 0.16 s (sigma), the
    median of nine by 0.065, which decided in one run of ten; that of 41 by 0.03.
    """
    out = fresh(folder.with_name(f"{folder.name}-loss"))
    heard = out / "receptions.jsonl"
    heard.write_text("".join(line for line in (folder / "receptions.jsonl").read_text().splitlines(keepends=True)
                             if json.loads(line)["channel"] == "bt4"))

    def draw(seed):
        words = parts.python("judge", "--receptions", heard, "--loss", loss,
                             "--seed", seed, "--out", out / str(seed), "--quiet", "--expect", "bt4")
        result = subprocess.run([str(word) for word in words], env=parts.environment(), cwd=parts.ROOT,
                                capture_output=True, text=True)
        return _read_figures(out / str(seed), result.stdout + result.stderr)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        draws = list(pool.map(draw, range(1, LOSS_DRAWS + 1)))
    figures = {}
    for name in ("bt4_all_five_within_p99_s", "bt4_location_reception_p99_s"):
        values = [draw[name] for draw in draws if name in draw]
        if len(values) == len(draws):  # else a message was never heard: the figure is missing
            figures[name], figures[f"{name}_worst"] = statistics.median(values), max(values)
    return figures


def model(kept, seconds):
    """The field study's schedule in the same bench: (what its log says, what the judge says)."""
    with in_memory(kept) as folder:
        bench = parts.Bench(folder, hostapd=False)
        try:
            transmitter = bench.add(parts.Part(
                parts.python("models.field_study", "--hci-port", bench.rootcanal.hci_port, "--seconds",
                             seconds + 6), folder / "model.log", raised=True))
            time.sleep(1)
            judge = bench.judge(seconds, "--expect", "bt4", "--address", MODEL_ADDRESS)
            judge.process.wait(timeout=seconds + 120)
            if transmitter.process.wait(timeout=30) != 0:
                raise RuntimeError(f"{kept.name}: the model failed: {transmitter.log()}")
            own = json.loads(transmitter.log().splitlines()[-1])
        finally:
            bench.stop()
        return own, _read_figures(folder, judge.log())
