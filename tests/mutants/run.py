"""`make mutants`: does the gate see a fault that is put into the daemon?

Without more, those of named.py, each a fault that somebody could make; all of them have to be seen. With RANDOM=<n>, that
many changes of one operator, number, condition or call, anywhere in what odid-daemon is linked from:

  RANDOM=<n> SEED=<n>    how many, and which (1)
  ONLY=<text>            of the named ones those with that in their name; of the random ones those of that file

Each is built in a copy and put to the unit tests, the simulated flights and tests/daemon until one of them fails. What was
seen is kept in build/mutants, so a run that was broken off goes on, and only what survived is tried again. A survivor that
changes nothing anybody can see is named with its reason in survivors.py, and doesn't count.
"""

import concurrent.futures
import hashlib
import json
import os
import queue
import random
import re
import subprocess
import sys
from collections import Counter, namedtuple
from pathlib import Path

if __package__ is None:
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import parts
import program
from mutants.named import NAMED
from mutants.places import places
from mutants.survivors import reason
from mutants.trial import SOURCE, Workshop, named

FOLDER = parts.ROOT / "build/mutants"
WORKSHOPS = 2
CAUGHT_SHARE = 0.95
JUDGES = ("simulated", "daemon", "models", "judge")
# identity: the same in each run; text: the file with it; why: it may survive.
Change = namedtuple("Change", "identity name file text why")


def linked():
    """The sources that odid-daemon is made of, as the linker says."""
    build = parts.DAEMON.parent
    link = (build / "CMakeFiles/odid-daemon.dir/link.txt").read_text().strip()
    map_path = FOLDER / "daemon.map"
    subprocess.run(f"{link} -o {FOLDER / 'daemon'} -Wl,-Map={map_path}", shell=True, cwd=build, check=True)
    return sorted({f"{name}.c" for name in re.findall(r"libodid_\w+\.a\((\w+)\.c\.o\)", map_path.read_text())}
                  | {"odid_daemon_main.c"})


def judged():
    """A hash of the sources and of what judges them: a verdict holds for these."""
    seen = hashlib.sha256()
    folders = (SOURCE / "src", SOURCE / "tests", *(parts.ROOT / "tests" / name for name in JUDGES))
    paths = [path for folder in folders for path in folder.rglob("*") if path.suffix in (".c", ".h", ".py")]
    for path in sorted([*paths, parts.HERE / "parts.py"]):
        seen.update(f"{path.relative_to(parts.ROOT)}\n".encode() + path.read_bytes())
    return seen.hexdigest()[:16]


class Kept:
    """What earlier runs found of the same sources and tests, but for what survived."""

    def __init__(self, path, of):
        self.path, self.of = path, of
        lines = path.read_text().splitlines() if path.exists() else []
        self.found = {tuple(one["change"]): (one["verdict"], one["by"]) for one in map(json.loads, lines)
                      if one["verdict"] != "survived" and one.get("of") == of}

    def add(self, change, verdict, by):
        self.found[change] = verdict, by
        with open(self.path, "a") as out:
            out.write(json.dumps({"of": self.of, "change": change, "verdict": verdict, "by": by}) + "\n")


def changed(place):
    text = named(SOURCE, place.file).read_bytes()
    return (text[:place.start] + place.after.encode() + text[place.end:]).decode()


def put_in(mutant):
    text = named(SOURCE, mutant.file).read_text()
    if text.count(mutant.before) != 1:
        raise RuntimeError(f"{mutant.name}: its text stands {text.count(mutant.before)} times in {mutant.file}")
    return text.replace(mutant.before, mutant.after)


def line_of(place):
    return named(SOURCE, place.file).read_text().splitlines()[place.line - 1].strip()


def asked():
    only, count = os.environ.get("ONLY") or "", os.environ.get("RANDOM")
    if not count:
        return [Change((mutant.file, mutant.before, mutant.after), f"{mutant.file}: {mutant.name}", mutant.file,
                       put_in(mutant), None) for mutant in NAMED if only in mutant.name]
    everywhere = [place for name in linked() for place in places(named(SOURCE, name), name)]
    chance = random.Random(int(os.environ.get("SEED") or 1))
    # Drawn one after the other: a larger number holds the smaller one's.
    chance.shuffle(everywhere)
    return [Change((place.file, place.start, place.end, place.before, place.after),
                   f"{place.file}:{place.line}: {place.before.splitlines()[0]} -> {place.after.splitlines()[0]}",
                   place.file, changed(place), reason(place.file, line_of(place), place.before, place.after))
            for place in everywhere[:int(count)] if only in place.file]


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    changes, kept = asked(), Kept(FOLDER / "seen.jsonl", judged())
    to_try = [one for one in changes if one.identity not in kept.found and not one.why]
    workshops = queue.Queue()
    if to_try:
        for number in range(WORKSHOPS):
            workshops.put(Workshop(FOLDER / str(number)))
        untouched = Workshop.seen(workshops.queue[0], "")
        if untouched:
            raise RuntimeError(f"the sources as they are don't pass: {untouched[1]}")

    def tried(change):
        workshop = workshops.get()
        try:
            return change, workshop.judge(change.file, change.text)
        finally:
            workshops.put(workshop)

    pool = concurrent.futures.ThreadPoolExecutor(WORKSHOPS)
    try:
        for one in concurrent.futures.as_completed([pool.submit(tried, change) for change in to_try]):
            change, (verdict, by) = one.result()
            kept.add(change.identity, verdict, by)
            print(f"{verdict:10} {change.name}  {by}", flush=True)
    finally:
        pool.shutdown(cancel_futures=True)  # what has begun is ended
    return told([(one.name, *(("harmless", one.why) if one.why else kept.found[one.identity])) for one in changes])


def told(results):
    count = Counter(verdict for _, verdict, _ in results)
    by = Counter(re.split(r"[ :]", by)[0].removeprefix("tests/").split("/")[0]
                 for _, verdict, by in results if verdict == "caught")
    judged = count["caught"] + count["survived"]
    print(f"\n{judged} changes: {count['caught']} caught ({', '.join(f'{number} by {who}' for who, number in by.most_common())}), "
          f"{count['survived']} survived; not counted: {count['equivalent']} of which the compiler makes the same, "
          f"{count['no C']} that it refuses, {count['harmless']} harmless")
    for name, verdict, why in results:
        if verdict in ("survived", "harmless"):
            print(f"  {verdict}: {name}  {why}")
    needed = judged * CAUGHT_SHARE if os.environ.get("RANDOM") else len(results)
    return 0 if count["caught"] >= needed else 1


if __name__ == "__main__":
    program.run("mutants", main)
