"""Runs under faults: one boot serves many. What a receiver heard of each, as figures and a table."""

import functools
import json
import subprocess
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import parts

from . import faults, flights
from .gaps import Contents
from .machine import CHANNELS, Machine

FOLDER = parts.ROOT / "build/faults"
SETTLE_S = 3.0
FLIGHT_S = 1500  # longer than all faults together


@dataclass
class Outcome:
    fault: str
    what: str
    limit_s: float
    gap_s: float | None = None  # None: no figure
    channel: str | None = None
    to_first_s: dict = field(default_factory=dict)
    problems: list = field(default_factory=list)
    late: list = field(default_factory=list)  # beyond a limit in seconds, its gap aside
    disturbed: str = ""  # why the measuring machine, not the appliance, may be what is late

    @property
    def beyond(self):
        """Everything that took longer than it may."""
        if self.gap_s is None or self.gap_s <= self.limit_s:
            return self.late
        return [*self.late, f"{self.gap_s:.2f} s on {self.channel}, {self.limit_s:g} s allowed"]

    @property
    def verdict(self):
        if self.problems or self.gap_s is None or self.beyond and not self.disturbed:
            return "FAIL"
        return "not judged" if self.beyond else "PASS"


@functools.cache
def tool(name="fault"):
    """A program of tools/, for the machine."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, name)
        subprocess.run(["aarch64-linux-gnu-gcc", "-static", "-Os", "-s", "-Wall", "-Wextra", "-Werror", "-std=gnu11",
                        "-o", out, parts.HERE / f"bench/tools/{name}.c"], check=True)
        return out.read_bytes()


@functools.cache
def flight():
    return flights.generate(FOLDER / "flight.tlog", FLIGHT_S)


class Run:
    """One power-on with a judge that listens from before to after it."""

    def __init__(self, name, prepare=None, **power):
        self.folder = FOLDER / name
        self.folder.mkdir(parents=True, exist_ok=True)
        self.machine, self.windows, self.judge = Machine(self.folder), {}, None
        self.plugged = power.get("adapter", True)
        try:
            if prepare:
                prepare(self.machine)
            self.judge = self.machine.judge(None)
            self.machine.power_on(**power)
        except BaseException:
            self.close()
            raise

    def fly(self):
        self.machine.play(flight())
        self.machine.flight, self.machine.flight_mono = flight(), time.monotonic()

    def tools(self):
        self.machine.put(faults.TOOL, tool())

    def inject(self, fault):
        """Does the harm, and watches for as long as mending may take, and longer."""
        injected = fault.inject(self.machine)
        mended = max(injected.at, injected.back or 0) + fault.limit_s + fault.watch_s
        time.sleep(max(0.0, mended - time.monotonic()))
        fault.undo(self.machine)
        self.windows[fault.name] = injected, time.monotonic()

    def stop(self):
        """Ends the judge, then the machine: silence at a run's end would count. What was heard."""
        self.judge.stop()
        status = self.judge.process.returncode
        self.close()
        if status not in (0, 1):
            raise RuntimeError(f"the judge ended with {status}: {self.judge.log()[-2000:]}")
        return Contents(self.folder / "judge/receptions.jsonl")

    def disturbed(self, fault):
        """Whether the measuring machine was, during this fault."""
        injected, until = self.windows[fault.name]
        return self.machine.disturbed(injected.at, until) or self.machine.slow()

    def close(self):
        """May be called again."""
        if self.judge:
            self.judge.stop()
        self.machine.close()


def judge_window(fault, contents, window):
    """One fault's outcome: the gap on its channels, and whether the other channels were left alone."""
    injected, until = window
    start, clip = (injected.at, False) if injected.back is None else (injected.back, True)
    gap_s, channel = contents.worst_gap(fault.channels, start, until, clip)
    late = list(injected.late)
    for other in set(CHANNELS) - set(fault.channels):
        other_s = contents.longest_gap_s(other, injected.at, until)
        if other_s > faults.OTHERS_S:
            late.append(f"{other}, which has nothing to do with it, had a gap of {other_s:.2f} s")
    return Outcome(fault.name, fault.what, fault.limit_s, gap_s, channel, problems=list(injected.problems), late=late)


def in_flight(wanted=faults.IN_FLIGHT, say=print):
    """All faults that a flight bears, one after the other; a new boot only where one left ruins."""
    left = list(wanted)
    outcomes, boots = {}, 0
    while left:
        boots += 1
        run = Run(f"flight-{boots}")
        failed = {}
        try:
            run.fly()
            run.machine.wait_on_air(position=True)
            run.tools()
            time.sleep(SETTLE_S)
            done = []
            while left:
                fault = left.pop(0)
                say(f"fault: {fault.name}: {fault.what}", flush=True)
                done.append(fault)
                try:
                    run.inject(fault)
                    run.machine.wait_on_air(position=True)
                except (TimeoutError, RuntimeError, ConnectionError) as error:
                    failed[fault.name] = str(error)
                    say(f"fault: {fault.name}: {error}", flush=True)
                    break
            contents = run.stop()
        except BaseException:
            run.close()
            raise
        for fault in done:
            if fault.name in run.windows:
                outcomes[fault.name] = judge_window(fault, contents, run.windows[fault.name])
                outcomes[fault.name].disturbed = run.disturbed(fault)
            else:
                outcomes[fault.name] = Outcome(fault.name, fault.what, fault.limit_s)
            if fault.name in failed:
                outcomes[fault.name].problems.append(failed[fault.name])
        common(contents, [outcomes[fault.name] for fault in done])
    return outcomes


def common(contents, outcomes):
    """What is wrong with a whole boot is wrong with its first outcome."""
    for channel, addresses in contents.addresses.items():
        if len(addresses) > 1:
            outcomes[0].problems.append(f"{channel}: the aircraft changed its address: {', '.join(addresses)}")
    for kind, count in contents.findings.counts.items():
        outcomes[0].problems.append(f"{count} receptions that receivers can't read ({kind}): "
                                    f"{next(v.what for v in contents.findings.violations if v.kind == kind)}")


def boot(fault, say=print):
    """A power-on under a fault."""
    say(f"fault: {fault.name}: {fault.what}", flush=True)
    outcome, run = Outcome(fault.name, fault.what, fault.limit_s), None
    try:
        run = Run(f"boot-{fault.name}", prepare=fault.prepare, **fault.power)
        fault.early(run.machine)
        run.fly()
        if not run.plugged:
            run.machine.player.order("pause")
        run.machine.wait_on_air(position=run.plugged)
        started = run.machine.started()
        if fault.later:
            injected = fault.later(run.machine)
        else:
            # Positions are due as after any plugging in.
            due = max(started + max(fault.to_first_s.values()), run.machine.port_mono() + faults.POSITION_S)
            time.sleep(max(0.0, due - time.monotonic()))
            injected = faults.Injected(started, due)
        time.sleep(fault.limit_s + 4)
        until = time.monotonic()
        outcome.disturbed = run.machine.boot_disturbed()
        outcome.problems += run.machine.must("cat /run/faults/boot-* 2>/dev/null || true").splitlines()
        contents = run.stop()
    except (TimeoutError, RuntimeError, ConnectionError) as error:
        outcome.problems.append(str(error))
        return outcome
    finally:
        if run:
            run.close()
    outcome.problems += injected.problems
    outcome.late += injected.late
    outcome.gap_s, outcome.channel = contents.worst_gap(CHANNELS, injected.back, until, clip=True)
    for channel, limit_s in fault.to_first_s.items():
        first = contents.first[channel]
        outcome.to_first_s[channel] = None if first is None else first - started
        if first is None:
            outcome.problems.append(f"{channel}: no message, ever")
        elif first - started > limit_s:
            outcome.late.append(f"{channel}: first message {first - started:.2f} s after init, {limit_s:g} s allowed")
    common(contents, [outcome])
    return outcome


def outcomes_of(wanted, say=print):
    """All that is wanted."""
    found = in_flight([one for one in wanted if one in faults.IN_FLIGHT], say)
    found.update((one.name, boot(one, say)) for one in wanted if one in faults.BOOTS)
    return found


def table(outcomes, names=None):
    """All, or those that were wanted."""
    lines = [f"{'fault':<22} {'longest gap':>12} {'limit':>8}  worst  what"]
    for name in faults.NAMES:
        one = outcomes.get(name)
        if names is not None and name not in names:
            continue
        if one is None:
            lines.append(f"{name:<22} {'no figure':>12} {'':>8}  -      FAIL")
            continue
        gap = "no figure" if one.gap_s is None else f"{one.gap_s:.2f} s"
        lines.append(f"{name:<22} {gap:>12} {one.limit_s:>6.2f} s  {one.channel or '-':<5}  {one.what}"
                     f"{'' if one.verdict == 'PASS' else f'  {one.verdict}'}")
        lines += [f"{'':<22}   {problem.splitlines()[0]}" for problem in (*one.problems, *one.late)]
        if one.verdict == "not judged":
            lines.append(f"{'':<22}   {one.disturbed}")
    return "\n".join(lines) + "\n"


def write_figures(outcomes, path=FOLDER / "figures.json"):
    """One flat object; the verdict needs a figure of every fault."""
    figures = {}
    for name in faults.NAMES:
        one = outcomes.get(name)
        if one and one.gap_s is not None:
            figures[f"{name}_gap_s"] = round(one.gap_s, 3)
        for channel, seconds in (one.to_first_s if one else {}).items():
            if seconds is not None:
                figures[f"{name}_to_{channel}_s"] = round(seconds, 2)
    verdicts = [outcomes[name].verdict if name in outcomes else "FAIL" for name in faults.NAMES]
    violations = verdicts.count("FAIL")
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=parts.ROOT, capture_output=True, text=True)
    figures.update(violations=violations, not_judged=verdicts.count("not judged"), verdict="FAIL" if violations else "PASS",
                   commit=commit.stdout.strip() or "unknown", date=time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()))
    path.write_text(json.dumps(figures, indent=1) + "\n")
    return figures
