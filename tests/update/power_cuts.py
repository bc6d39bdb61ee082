"""Power fails at any instant: python3 -m update.power_cuts [--count N] [--seed N] [--control NAME].

One course of the appliance is recorded, with every write and flush: first boot with a new file on CONFIG,
a setting, an update from its first octet to its commit, another setting, another update into the other
slot. Then disks are made as a power cut at some instant would leave them (writes.py); each is booted, and
has to be on the air, with the version and the settings of before the cut or of after it; never with
older ones than had been promised to whoever asked.

What is done already isn't done again: build/update/power-cuts holds the record, and a line for each cut.
A control run takes one protection out, and must fail:

  one-copy   U-Boot's environment has only its first copy
  no-flush   odidctl doesn't flush what it writes
"""

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

from bench import disk as disks
from bench.machine import Machine, configuration, missing

from . import bundles, writes
from .appliance import Appliance, wait_for

FOLDER = bundles.BUILD / "power-cuts"
FIGURES = bundles.BUILD / "figures.json"
CONTROLS = ("one-copy", "no-flush")
FIRST, SECOND, THIRD = "From CONFIG", "Set by odidctl", "Set again"
VERSIONS = ("1.0.0", "2.0.0")
HARMLESS_FAULTS = {"autopilot", "watchdog"}

NO_FLUSH = """
int fsync(int fd) { (void)fd; return 0; }
int fdatasync(int fd) { (void)fd; return 0; }
void sync(void) {}
"""


# --- the course ------------------------------------------------------------------


class Recorded(Machine):
    """Writes to a raw disk, and each request to a record."""

    def record(self, base, live, log):
        disks.call("qemu-img", "convert", "-O", "raw", self.disk.path, base)
        disks.call("cp", "--sparse=always", base, live)
        log.write_bytes(b"")
        self._drive = writes.drive(live, log)
        self._log = log

    def _words(self, rtc, adapter):
        words = super()._words(rtc, adapter)
        at = next(i for i, word in enumerate(words) if str(word).startswith("if=none,id=disk"))
        words[at - 1:at + 1] = ["-blockdev", self._drive]
        return words


class Course:
    """What the appliance is put through, and what it promised when."""

    def __init__(self, folder, control):
        self.log, self.base = folder / "log", folder / "base"
        self.control, self.promises = control, []
        self.machine = Recorded(folder / "machine", config={
            "odid.conf": configuration(self_id={"description": FIRST})})
        self.appliance = Appliance(machine=self.machine)
        self.machine.record(self.base, folder / "live", self.log)

    def may(self, what, value):
        """From now on a cut may leave this."""
        self.promises.append((writes.count(self.log), "may", what, value))

    def must(self, what, value):
        """Somebody was told that it is so: from now on no cut may leave what was before."""
        self.promises.append((writes.count(self.log), "must", what, value))

    def set(self, description):
        self.may("description", description)
        preload = ""
        if self.control == "no-flush":
            preload = "LD_PRELOAD=/tmp/noflush.so "
        self.machine.must(f"{preload}odidctl set self_id.description '{description}'", 30)
        self.must("description", description)
        time.sleep(2)

    def update(self, version):
        one = self.appliance
        one.wait_ready()
        before = one.starts()
        self.may("version", version)
        got = one.install(bundles.bundle(f"v{version}", version))
        if got.code:
            raise RuntimeError(got.output)
        self.must("version", version)
        one.wait_restart(before)
        self.machine.wait_on_air(timeout_s=60)
        wait_for("the trial", lambda: one.state() == "trial", 60)
        wait_for("the commit", lambda: one.state() == "idle", 120)

    def run(self):
        if self.control == "no-flush":
            library = compiled(NO_FLUSH, self.log.parent / "noflush.so")
        self.may("version", bundles.running_version())
        self.must("version", bundles.running_version())
        self.may("description", "")
        self.may("description", FIRST)
        self.machine.power_on()
        self.machine.wait_on_air(timeout_s=60)
        self.must("description", FIRST)
        if self.control == "no-flush":
            self.machine.put("/tmp/noflush.so", library.read_bytes())
        self.set(SECOND)
        if self.control != "no-flush":
            self.update(VERSIONS[0])
            self.set(THIRD)
            self.update(VERSIONS[1])
        time.sleep(3)


def compiled(source, target):
    subprocess.run(["aarch64-linux-gnu-gcc", "-shared", "-fPIC", "-nostdlib", "-o", target, "-x", "c", "-"],
                   input=source.encode(), check=True)
    return target


def recorded(control):
    """The folder with the record, made unless it is there for this very disk."""
    folder = FOLDER / (control if control == "no-flush" else "course")
    made_of = f"{bundles.root().name} {bundles.KEYS}"
    if (folder / "promises.json").exists() and (folder / "made-of").read_text(encoding="utf-8") == made_of:
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    began = time.monotonic()
    course = Course(folder, control)
    try:
        course.run()
    finally:
        course.appliance.close()
    (folder / "live").unlink()
    (folder / "promises.json").write_text(json.dumps(course.promises), encoding="utf-8")
    (folder / "made-of").write_text(made_of, encoding="utf-8")
    print(f"recorded {writes.count(course.log)} requests in {time.monotonic() - began:.0f} s", flush=True)
    return folder


# --- judging -----------------------------------------------------------------------


def allowed(promises, what, boundary, under_way):
    """What a cut there may leave: what was promised last, and what was begun since."""
    values = []
    for at, kind, name, value in promises:
        if name != what:
            continue
        if kind == "must" and at <= boundary:
            values = [value]
        elif kind == "may" and at <= boundary + under_way:
            values.append(value)
    return set(values)


def places(image):
    """(first sector, sectors) of the partitions whose writes decide."""
    table = json.loads(disks.call("sfdisk", "--json", image))["partitiontable"]["partitions"]
    found = {int(entry["node"].removeprefix(str(image))): (entry["start"], entry["size"]) for entry in table}
    return [found[number] for number in (disks.CONFIG, disks.ENV, disks.DATA)]


class Judge:
    """A machine that one disk after the other is put into."""

    def __init__(self, folder):
        self.image = folder / "cut"
        disks.call("cp", "--sparse=always", folder / "base", self.image)
        self.machine = Machine(folder / "judge", config={}, image=self.image)

    def close(self):
        self.machine.close()
        self.image.unlink(missing_ok=True)

    def look(self, promises, boundary, under_way):
        """Boots the disk: ("", time to air) when all is as it may be, else what isn't."""
        machine = self.machine
        machine.disk = disks.Disk(machine.folder / "disk.qcow2", self.image)
        try:
            machine.power_on()
            machine.wait_on_air(timeout_s=60)
            took = time.monotonic() - machine.powered_mono
            found = {"version": machine.must("cat /etc/odid/version").strip(),
                     "description": machine.must("odidctl get self_id.description").strip()}
            wrong = [f"{what} is {value!r}, expected one of {sorted(allowed(promises, what, boundary, under_way))}"
                     for what, value in found.items()
                     if value not in allowed(promises, what, boundary, under_way)]
            faults = set(machine.must("ls /run/faults").split()) - HARMLESS_FAULTS
            if faults:
                wrong.append(machine.must(f"cd /run/faults; head {' '.join(sorted(faults))}"))
            return "; ".join(wrong), round(took, 1), found
        except (RuntimeError, TimeoutError, ConnectionError) as error:
            return f"{type(error).__name__}: {error}"[:2000], None, {}
        finally:
            machine.cut_power()


def take_out_copy(image):
    """Overwrites the environment's second copy with noise."""
    start, _ = places(image)[1]
    data = disks.call("mdir", "-i", f"{image}@@{start * writes.SECTOR}", "::")
    assert "uboot-redund" in data.lower() or "UBOOT-" in data
    noise = Path(f"{image}.noise")
    noise.write_bytes(random.Random(0).randbytes(0x4000))
    disks.call("mcopy", "-o", "-i", f"{image}@@{start * writes.SECTOR}", noise, "::uboot-redund.env")
    noise.unlink()


def run(count, seed, control):
    folder = recorded(control)
    promises = json.loads((folder / "promises.json").read_text(encoding="utf-8"))
    requests = writes.read(folder / "log")
    cuts = writes.choose(requests, count, seed, places(folder / "base"))
    lines = folder / f"cuts-{control or 'plain'}-{seed}.jsonl"
    done = {}
    if lines.exists():
        for line in lines.read_text(encoding="utf-8").splitlines():
            result = json.loads(line)
            done[result["number"], result["boundary"], result["count"]] = result
    judge = Judge(folder)
    results = []
    try:
        for cut in cuts:
            result = done.get((cut.number, cut.boundary, count))
            if not result:
                kind, extra = writes.left(requests, cut.boundary, random.Random(cut.seed))
                writes.disk(folder / "base", folder / "log", requests, cut.boundary, extra, judge.image)
                if control == "one-copy":
                    take_out_copy(judge.image)
                wrong, took, found = judge.look(promises, cut.boundary, len(writes.after(requests, cut.boundary)))
                result = {"number": cut.number, "boundary": cut.boundary, "count": count, "kind": kind,
                          "requests": len(extra), "boot_to_air_s": took, "found": found, "wrong": wrong}
                with open(lines, "a", encoding="utf-8") as file:
                    file.write(json.dumps(result) + "\n")
            results.append(result)
            mark = "survived" if not result["wrong"] else f"FAILED: {result['wrong']}"
            print(f"cut {cut.number + 1} of {count} (after request {cut.boundary} of {len(requests)}, "
                  f"then {result['kind']}): {mark}", flush=True)
    finally:
        judge.close()
    return results


def write_figures(results, seed):
    survived = sum(not one["wrong"] for one in results)
    figures = json.loads(FIGURES.read_text(encoding="utf-8")) if FIGURES.exists() else {}
    commit = subprocess.run(["git", "rev-parse", "--short", "HEAD"], capture_output=True, text=True, check=False)
    figures |= {"commit": commit.stdout.strip(), "date": time.strftime("%Y-%m-%d"),
                "power_cuts": len(results), "power_cuts_survived": survived, "power_cuts_seed": seed,
                "violations": len(results) - survived,
                "verdict": "PASS" if survived == len(results) else "FAIL"}
    FIGURES.write_text(json.dumps(figures, indent=1) + "\n", encoding="utf-8")
    return survived


def main():
    parser = argparse.ArgumentParser(prog="power_cuts.py", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("SEED") or 1))
    parser.add_argument("--control", choices=CONTROLS)
    arguments = parser.parse_args()
    reason = missing()
    if reason:
        sys.exit(f"power-cuts: {reason}")
    print(f"power-cuts: seed {arguments.seed}", flush=True)
    results = run(arguments.count, arguments.seed, arguments.control)
    failed = [one for one in results if one["wrong"]]
    if arguments.control:
        print(f"power-cuts: without its protection {len(failed)} of {len(results)} failed: "
              + ("as it has to be" if failed else "the control shows nothing"))
        return not failed
    survived = write_figures(results, arguments.seed)
    print(f"power-cuts: {survived} of {len(results)} survived (seed {arguments.seed}; {FIGURES})")
    return survived != len(results)


if __name__ == "__main__":
    sys.exit(main())
