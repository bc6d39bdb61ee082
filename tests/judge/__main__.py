"""Command line: listens, shows, judges, and ends with the verdict.

Exit status: 0 PASS, 1 FAIL (also when nothing was heard), 2 a wrong option or a
source that can't be used.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import re
import signal
import sys
import time
from pathlib import Path

from .conformance import ALL_FIVE, Options, judge
from .flight_log import read_flight_log
from .loss import Loss, parse_loss
from .messages import TYPE_NAMES
from .receptions import CHANNELS, InputError, Run, align_clocks, read_receptions, write_receptions
from .report import brief_text, report_text, write_figures
from .set_log import read_set_log
from .sources import READY_S, Ear, follow_pcap, listen_monitor, read_btsnoop, read_pcap, scan_hci
from .table import Screen

REAL_TIME_PRIORITY = 5


def _list_of(allowed):
    def parse(text: str) -> tuple[str, ...]:
        names = tuple(name.strip() for name in text.split(",") if name.strip())
        for name in names:
            if name not in allowed:
                raise argparse.ArgumentTypeError(f"{name!r} is none of {', '.join(allowed)}")
        return names
    return parse


def _address(text: str) -> str:
    if not re.fullmatch(r"([0-9A-Fa-f]{2}:){5}[0-9A-Fa-f]{2}", text):
        raise argparse.ArgumentTypeError(f"{text!r}: expected six octets as AA:BB:CC:DD:EE:FF")
    return text.upper()


def _limit(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name, float(value)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r}: expected NAME=NUMBER") from error


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="judge", description="Listens to Direct Remote ID and judges it.")
    add = parser.add_argument
    add("--hci", action="append", default=[], metavar="TRANSPORT",
        help="scan with an HCI controller, by Bumble's transport name (tcp-client:HOST:PORT, usb:0)")
    add("--pcap", action="append", default=[], type=Path, metavar="FILE", help="a pcap or pcapng file")
    add("--follow", action="store_true", help="the --pcap files grow: read on until the run ends")
    add("--monitor", action="append", default=[], metavar="IFACE", help="a Wi-Fi interface in monitor mode (root)")
    add("--btsnoop", action="append", default=[], type=Path, metavar="FILE", help="an HCI dump")
    add("--receptions", action="append", default=[], type=Path, metavar="FILE",
        help="judge a saved receptions.jsonl again")
    add("--seconds", type=float, metavar="N", help="how long to listen (live; default: until interrupted)")
    add("--out", type=Path, metavar="DIR",
        help="write receptions.jsonl, run.json, report.txt, report.png, figures.json")
    add("--address", action="append", default=[], type=_address, metavar="AA:..",
        help="listen to this transmitter only")
    add("--played", type=Path, metavar="FILE", help="what was played to the transmitter (JSON lines)")
    add("--set-log", type=Path, metavar="FILE", help="advertising data that was set on the controller (JSON lines)")
    add("--title", default="Remote ID conformance report")
    add("--expect", type=_list_of(CHANNELS), default=(), metavar="CHANNELS", help="must be heard: bt4,bt5,wifi")
    add("--expect-messages", type=_list_of(tuple(TYPE_NAMES.values())), default=ALL_FIVE, metavar="MESSAGES")
    add("--any-version", action="store_true", help="accept older protocol versions (as a note)")
    add("--limit", action="append", default=[], type=_limit, metavar="NAME=VALUE", help="upper limit for a figure")
    add("--without-time", action="store_true",
        help="leave out what depends on when something was heard: for a machine with other work")
    add("--lost-margin", type=int, default=0, metavar="N", help="payloads that may be lost on Bluetooth 4")
    add("--warmup", type=float, default=0.0, metavar="S", help="don't judge intervals in the first S seconds")
    add("--loss", type=float, metavar="P", help="drop this share of all receptions (also: LOSS=P[,burst=N])")
    add("--loss-burst", type=float, metavar="MEAN", help="drop in bursts of this many on average")
    add("--seed", type=int, default=1, metavar="S")
    add("--quiet", action="store_true", help="no live table")
    add("--brief", action="store_true", help="print the report's main figures only; the verdict is the exit status")
    return parser


def _loss(arguments) -> Loss:
    share, burst = 0.0, 1.0
    if os.environ.get("LOSS"):
        share, burst = parse_loss(os.environ["LOSS"])
    if arguments.loss is not None:
        share = arguments.loss
    if arguments.loss_burst is not None:
        burst = arguments.loss_burst
    return Loss(share, burst, arguments.seed)


def _take_real_time_priority(run: Run) -> bool:
    """So that load on the machine doesn't spoil the time stamps."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REAL_TIME_PRIORITY))
        run.notes.append(f"the listener ran with real-time priority (SCHED_FIFO {REAL_TIME_PRIORITY})")
        return True
    except OSError as error:
        run.notes.append(f"the listener ran without real-time priority ({error.strerror}): load on this machine "
                         "shows in the time stamps")
        return False


async def _wait_ready(tasks: list, events: list[asyncio.Event], stop: asyncio.Event) -> None:
    """Until every live source listens; a source that fails, or a stop, ends the wait."""
    waiting = [asyncio.ensure_future(event.wait()) for event in events]
    stopping = asyncio.ensure_future(stop.wait())
    try:
        deadline = time.monotonic() + READY_S
        while not all(w.done() for w in waiting) and not stopping.done():
            await asyncio.wait([*tasks, *waiting, stopping], timeout=0.2, return_when=asyncio.FIRST_COMPLETED)
            if any(task.done() for task in tasks):
                return
            if time.monotonic() > deadline:
                raise InputError(f"a live source isn't ready after {READY_S} s")
    finally:
        for future in (*waiting, stopping):
            future.cancel()


async def _listen_live(ear: Ear, arguments, screen: Screen | None) -> None:
    loop, stop = asyncio.get_running_loop(), asyncio.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    events: list[asyncio.Event] = []

    def ready() -> asyncio.Event:
        events.append(asyncio.Event())
        return events[-1]

    tasks = [asyncio.ensure_future(scan_hci(ear, name, ready())) for name in arguments.hci]
    tasks += [asyncio.ensure_future(listen_monitor(ear, name, ready())) for name in arguments.monitor]
    if arguments.follow:
        tasks += [asyncio.ensure_future(follow_pcap(ear, path)) for path in arguments.pcap]
    try:
        await _wait_ready(tasks, events, stop)
        if not screen:
            print("judge: listening", file=sys.stderr, flush=True)
        start = time.monotonic()
        end = start + arguments.seconds if arguments.seconds is not None else None
        ear.saw(start)
        while not stop.is_set() and (end is None or time.monotonic() < end):
            left = None if end is None else end - time.monotonic()
            done, _ = await asyncio.wait(tasks, timeout=0.2 if left is None else min(0.2, left))
            if screen:
                screen.draw(ear.run.receptions, time.monotonic(), left)
            for task in done:
                task.result()  # a live source only ends by failing
    finally:
        ear.saw(time.monotonic())
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        # What came before every source listened, or stood in a growing file already, isn't this run's.
        ear.run.receptions[:] = [r for r in ear.run.receptions if r.mono >= ear.run.start_mono]


def _collect(arguments, loss: Loss) -> tuple[Run, Ear]:
    ear = Ear(set(arguments.address), loss)
    if arguments.hci or arguments.monitor or arguments.follow:
        real_time = _take_real_time_priority(ear.run)
        try:
            asyncio.run(_listen_live(ear, arguments, None if arguments.quiet else Screen(sys.stdout)))
        finally:
            if real_time:
                os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    for path in arguments.pcap:
        ear.run.sources.append(f"capture {path.name}" + (" (followed while it grew)" if arguments.follow else ""))
        if not arguments.follow:
            read_pcap(ear, path)
    for path in arguments.btsnoop:
        ear.run.sources.append(f"HCI dump {path.name}")
        read_btsnoop(ear, path)
    for path in arguments.receptions:
        saved = read_receptions(path)
        ear.run.sources += saved.sources
        for reception in saved.receptions:
            if not ear.addresses or reception.address in ear.addresses:
                ear.add(reception)
        for mono_s in (saved.start_mono, saved.end_mono):
            if mono_s is not None:
                ear.saw(mono_s)
    if loss.probability:
        ear.run.notes.append(f"{loss}: {ear.dropped} dropped, {len(ear.run.receptions)} kept")
    ear.run.receptions.sort(key=lambda reception: reception.mono)
    return ear.run, ear


def main(argv: list[str] | None = None) -> int:
    parser = _parser()
    arguments = parser.parse_args(argv)
    if not any((arguments.hci, arguments.pcap, arguments.monitor, arguments.btsnoop, arguments.receptions)):
        parser.error("no source: give --hci, --pcap, --monitor, --btsnoop or --receptions")
    try:
        loss = _loss(arguments)
    except ValueError as error:
        parser.error(str(error))
    try:
        if arguments.out:
            try:
                arguments.out.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                raise InputError(f"--out {arguments.out}: {error.strerror}") from error
        run, _ = _collect(arguments, loss)
        log = read_flight_log(arguments.played) if arguments.played else None
        set_log = read_set_log(arguments.set_log) if arguments.set_log else None
    except InputError as error:
        print(f"judge: {error}", file=sys.stderr)
        return 2
    align_clocks(run, log.clock_offset_s if log else None)
    options = Options(
        expect_channels=arguments.expect, expect_messages=arguments.expect_messages, limits=dict(arguments.limit),
        addresses=frozenset(arguments.address), any_version=arguments.any_version,
        timing=not arguments.without_time, lossy=bool(loss.probability), lost_margin=arguments.lost_margin,
        warmup_s=arguments.warmup, seed=arguments.seed)
    judgement = judge(run, options, log, set_log)
    text = report_text(judgement, run, options, arguments.title)
    if arguments.out:
        from .plot import write_plot
        write_receptions(run, arguments.out)
        (arguments.out / "report.txt").write_text(text, encoding="utf-8")
        write_figures(judgement, arguments.out)
        write_plot(judgement, run, options, arguments.title, arguments.out / "report.png")
    print(brief_text(judgement, run) if arguments.brief else text, end="")
    return 0 if judgement.verdict == "PASS" else 1


if __name__ == "__main__":
    sys.exit(main())
