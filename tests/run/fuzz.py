"""Runs every fuzzer for a while: first over its committed corpus, then on from there.

What it finds new is kept in build/fuzz/corpus; an input that breaks the code in build/fuzz/crashes,
from where it goes into the committed corpus together with the fix.
"""

import argparse
import re
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import junit

BUILD = Path("build/fuzz")
SOURCES = Path("package/odid-daemon/fuzz")


def run(fuzzer: Path, seconds: int) -> tuple[junit.Case, str]:
    """The result, and one line that describes it."""
    name = fuzzer.stem.removeprefix("fuzz_")
    committed = SOURCES / "corpus" / name
    if not committed.is_dir() or not any(committed.iterdir()):
        return junit.Case(name, 0, failure=f"has no corpus: {committed}"), "no corpus"
    found, crashes = BUILD / "corpus" / name, BUILD / "crashes" / name
    for folder in (found, crashes):
        folder.mkdir(parents=True, exist_ok=True)
    command = [
        str(BUILD / fuzzer.stem),
        f"-max_total_time={seconds}",
        "-timeout=5",  # for one input
        "-rss_limit_mb=1024",
        "-print_final_stats=1",
        f"-artifact_prefix={crashes}/",
    ]
    dictionary = fuzzer.with_name(f"{name}.dict")
    if dictionary.exists():
        command.append(f"-dict={dictionary}")

    start = time.monotonic()
    try:
        # libFuzzer ends by itself; this is for one that can't.
        result = subprocess.run(
            [*command, str(found), str(committed)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            timeout=seconds + 120,
        )
        output, failed = result.stdout, result.returncode != 0
    except (subprocess.TimeoutExpired, OSError) as error:
        output, failed = str(error), True
    case = junit.Case(name, time.monotonic() - start)
    (BUILD / f"{name}.log").write_text(output, encoding="utf-8")

    inputs = re.search(r"stat::number_of_executed_units: (\d+)", output)
    coverage = re.findall(r"cov: (\d+)", output)
    figures = (
        f"{int(inputs[1]) if inputs else 0} inputs, {sum(1 for _ in committed.iterdir())} in the "
        f"corpus, {coverage[-1] if coverage else 0} edges covered"
    )
    if failed:
        case.failure = "\n".join(output.splitlines()[-40:])
    return case, figures


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=20, help="for each fuzzer")
    parser.add_argument("--jobs", type=int, default=2, help="fuzzers at the same time")
    parser.add_argument("--junit", type=Path, help="write the results there as well")
    fuzzers = {path.stem.removeprefix("fuzz_"): path for path in sorted(SOURCES.glob("*/fuzz_*.c"))}
    parser.add_argument("names", nargs="*", metavar="fuzzer", help=f"which of {', '.join(fuzzers)} (default: all)")
    options = parser.parse_args()
    if unknown := set(options.names) - set(fuzzers):
        parser.error(f"no such fuzzer: {', '.join(sorted(unknown))}; there are {', '.join(fuzzers)}")

    cases = []
    with ThreadPoolExecutor(options.jobs) as pool:
        for case, figures in pool.map(lambda name: run(fuzzers[name], options.seconds), options.names or fuzzers):
            cases.append(case)
            print(f"fuzz {case.name}: {'FAILED' if case.failure else 'ok'}, {figures}", flush=True)
            if case.failure:
                print(case.failure)
    if options.junit:
        junit.write(options.junit, "fuzz", cases)
    return any(case.failure for case in cases)


if __name__ == "__main__":
    sys.exit(main())
