"""Power fails at any instant: python3 -m update.power_cuts [--count N] [--seed N] [--control NAME].

One course of the appliance is recorded, with every write and flush: first boot with a new file on CONFIG,
a setting, an update from its first octet to its commit, one that fails its trial and is rolled back,
another setting, one that is kept in the other slot. Then disks are made as a power cut at some instant
would leave them (writes.py); each is booted, and has to be heard on every channel, with the version, the
settings and the last update's result of before the cut or of after it; never with older ones than had been
promised to whoever asked. And the technician's password, which the first start takes from CONFIG, opens the access
point: after any cut.

What is done already isn't done again: build/update/power-cuts holds the record, and a line for each cut.
A control run takes one protection out, and must fail:

  one-copy   U-Boot's environment has one copy: both files lie at the same place. Cuts only while it is written
  no-flush   odidctl doesn't flush what it writes: a course of settings. Cuts only when it has ended: what it
             said has to be so, without luck (something else may flush a moment before or after it)
"""

import argparse
import hashlib
import json
import queue
import random
import shutil
import struct
import sys
import threading
import time

import program
from bench import disk as disks
from bench.machine import CHANNELS, Machine, configuration, missing
from judge.receptions import read_json_lines

from . import bundles, figures, preload, writes
from .appliance import Appliance, wait_for

FOLDER = bundles.BUILD / "power-cuts"
CONTROLS = ("one-copy", "no-flush")
FIRST, SECOND, THIRD = "From CONFIG", "Set by odidctl", "Set again"
PASSWORD = "a-test-password"
SETTINGS, SETTLED_S = 12, 6     # of the course without flushes; the file system writes by itself after 5 s
VERSIONS = ("1.0.0", "2.0.0", "3.0.0")
LONG_NAME, FIRST_CLUSTER = 0x0f, 26     # of an entry in a FAT directory: attributes; where a number is
HARMLESS_FAULTS = {"autopilot", "watchdog", "update"}    # the last one: an update was rolled back
JOBS = 2        # machines at a time, with one processor each

# --- the course ------------------------------------------------------------------


class Recorded(Machine):
    """Writes to a raw disk, and each request to a record."""

    def record(self, base, live, log, one_copy):
        disks.call("qemu-img", "convert", "-O", "raw", self.disk.path, base)
        if one_copy:
            share_copy(base)
        disks.call("cp", "--sparse=always", base, live)
        log.write_bytes(b"")
        self._drive = writes.drive(live, log)
        self._log = log

    def _words(self, rtc, adapter, radios):
        words = super()._words(rtc, adapter, radios)
        at = next(i for i, word in enumerate(words) if str(word).startswith("if=none,id=disk"))
        words[at - 1:at + 1] = ["-blockdev", self._drive]
        return words


class Course:
    """What the appliance is put through, and what it promised when."""

    def __init__(self, folder, control):
        self.log, self.base = folder / "log", folder / "base"
        self.control, self.promises, self.figures = control, [], {}
        self.machine = Recorded(folder / "machine", config={
            "odid.conf": configuration(self_id={"description": FIRST}, maintenance={"password": PASSWORD})})
        self.appliance = Appliance(machine=self.machine)
        self.machine.record(self.base, folder / "live", self.log, one_copy=control == "one-copy")

    def may(self, what, value):
        """From now on a cut may leave this."""
        self.promises.append((writes.count(self.log), "may", what, value))

    def must(self, what, value):
        """Somebody was told that it is so: from now on no cut may leave what was before."""
        self.promises.append((writes.count(self.log), "must", what, value))

    def set(self, description, environment=""):
        self.may("description", description)
        self.machine.must(f"{environment} odidctl set self_id.description '{description}'")
        self.must("description", description)
        time.sleep(2)

    def set_without_flushes(self):
        preload.put(self.machine, preload.NO_FLUSH, "/tmp/noflush.so")
        for number in range(SETTINGS):
            self.set(f"{SECOND} {number}", "LD_PRELOAD=/tmp/noflush.so")
            time.sleep(SETTLED_S)

    def install(self, bundle, version, outcome):
        """Up to the first start of its slot."""
        one = self.appliance
        one.wait_ready()
        before, began = one.starts(), time.monotonic()
        self.may("version", version)
        self.may("result", f"refused: {version}")       # broken off
        self.may("result", f"{outcome}: {version}")
        got = one.install(bundle)
        if got.code:
            raise RuntimeError(got.output)
        self.figures.setdefault("install_s", round(time.monotonic() - began, 1))
        one.wait_restart(before)
        return before + 1

    def update(self, version):
        one = self.appliance
        old = one.version()
        self.install(bundles.bundle(f"v{version}", version), version, "installed")
        self.machine.wait_on_air()
        wait_for("the trial", lambda: one.state() == "trial")
        wait_for("the commit", lambda: one.state() == "idle")
        self.must("version", version)
        self.must("result", f"installed: {version}")
        self.expect(version, {"outcome": "installed", "from": old, "to": version})

    def update_in_vain(self, version, failure):
        one = self.appliance
        old = one.version()
        self.may("fault", "slot")       # the boot loader says so, each time that it gives the new one up
        starts = self.install(bundles.bundle(failure.name, version, failure.changes), version, "rolled-back")
        if failure.itself:
            one.wait_restart(starts)
        self.machine.wait_on_air()
        wait_for("the end", lambda: one.state() == "idle")
        self.must("version", old)
        self.must("result", f"rolled-back: {version}")
        self.must("fault", None)
        self.expect(old, {"outcome": "rolled-back", "from": old, "to": version})

    def expect(self, version, result):
        found = self.appliance.result()
        if self.appliance.version() != version or result.items() - found.items():
            raise RuntimeError(f"version {self.appliance.version()}, {found}; expected {version}, {result}; "
                               f"faults {self.appliance.faults()}; its log ends:\n{self.appliance.log()}")

    def run(self, short):
        """short: one update that is kept, and one that the boot loader gives up."""
        self.may("version", bundles.running_version())
        self.must("version", bundles.running_version())
        self.may("description", "")
        self.may("description", FIRST)
        self.may("result", "")
        self.machine.power_on()
        self.machine.wait_on_air()
        # On a machine that stood still /data may come late (S30data): what is promised before that is in memory.
        self.machine.wait_inside("the disk's /data", "[ ! -e /run/odid-appliance/data-in-memory ]")
        self.must("description", FIRST)
        if self.control == "no-flush":
            self.set_without_flushes()
        else:
            self.set(SECOND)
            self.update(VERSIONS[0])
            self.update_in_vain(VERSIONS[1], bundles.NO_KERNEL if short else bundles.NO_BLUETOOTH)
            if not short:
                self.set(THIRD)
                self.update(VERSIONS[2])
        time.sleep(3)


def share_copy(image):
    """Both files of U-Boot's environment lie where the first one does: there is one copy."""
    (start, _), entry = places(image)[disks.ENV], struct.Struct("<11sB14xHI")     # name, attributes, first cluster, size
    with open(image, "r+b") as disk:
        disk.seek(start * writes.SECTOR)
        reserved, tables, entries, table = struct.unpack("<14xHBH3xH", disk.read(24))
        at = (start + reserved + tables * table) * writes.SECTOR
        found = {}
        for number in range(entries):
            disk.seek(at + number * entry.size)
            name, attributes, cluster, _ = entry.unpack(disk.read(entry.size))
            if name.endswith(b"ENV") and attributes != LONG_NAME:
                found[name] = number, cluster
        (_, first), (second, _) = (found[name] for name in sorted(found))
        disk.seek(at + second * entry.size + FIRST_CLUSTER)
        disk.write(struct.pack("<H", first))


def recorded(control, short=False, afresh=False):
    """The folder with the record, made unless it is there for this very disk."""
    folder = FOLDER / (control or ("short" if short else "course"))
    made_of = f"{bundles.root().name} {bundles.KEYS}"
    if not afresh and (folder / "promises.json").exists() and \
            (folder / "made-of").read_text(encoding="utf-8") == made_of:
        return folder
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    began = time.monotonic()
    course = Course(folder, control)
    try:
        course.run(short)
    finally:
        course.appliance.close()
    (folder / "live").unlink()
    (folder / "promises.json").write_text(json.dumps(course.promises), encoding="utf-8")
    (folder / "figures.json").write_text(json.dumps(course.figures), encoding="utf-8")
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
    """(first sector, sectors) of each partition."""
    table = json.loads(disks.call("sfdisk", "--json", image))["partitiontable"]["partitions"]
    return {int(entry["node"].removeprefix(str(image))): (entry["start"], entry["size"]) for entry in table}


def choose(base, requests, promises, count, seed, control):
    """The cuts: everywhere, or where the protection that is taken out counts."""
    place = places(base)
    if control == "one-copy":
        return writes.choose_from(writes.during(requests, place[disks.ENV]), count, seed, "torn")
    if control == "no-flush":
        told = {at for at, kind, *_ in promises if kind == "must"}
        return writes.choose_from([one for one in writes.boundaries(requests) if one in told], count, seed)
    return writes.choose(requests, count, seed, [place[number] for number in (disks.CONFIG, disks.ENV, disks.DATA)])


class Judge:
    """A machine that one disk after the other is put into."""

    def __init__(self, folder, number):
        self.folder, self.image = folder, folder / f"cut-{number}.img"
        disks.call("cp", "--sparse=always", folder / "base", self.image)
        self.machine = Machine(folder / f"judge-{number}", config={}, image=self.image, processors=1)
        self.appliance = Appliance(machine=self.machine)
        self.requests = writes.read(folder / "log")
        self.promises = json.loads((folder / "promises.json").read_text(encoding="utf-8"))

    def close(self):
        self.appliance.close()
        self.image.unlink(missing_ok=True)

    def judge(self, cut):
        """Makes the disk that the cut leaves, and boots it: a line of results."""
        kind, extra = writes.left(self.requests, cut.boundary, random.Random(cut.seed), cut.kind)
        writes.disk(self.folder / "base", self.folder / "log", self.requests, cut.boundary, extra, self.image)
        try:
            took, found = self._boot()
            wrong = self._wrong(found, cut.boundary)
        except (RuntimeError, TimeoutError, ConnectionError) as error:
            took, found, wrong = None, {}, f"{type(error).__name__}: {error}"[:2000]
        finally:
            self.machine.cut_power()
        return {"number": cut.number, "boundary": cut.boundary, "kind": kind, "requests": len(extra),
                "boot_to_air_s": took, "found": found, "wrong": wrong}

    def _boot(self):
        machine = self.machine
        machine.disk = disks.Disk(machine.folder / "disk", self.image)
        machine.power_on()
        self._wait_on_air()
        for channel in CHANNELS:
            wait_for(f"a reception on {channel}",
                     lambda channel=channel: machine.air.receptions(channel, machine.powered_mono))
        took = round(time.monotonic() - machine.powered_mono, 1)
        return took, {
            "version": machine.must("cat /etc/odid/version").strip(),
            "description": machine.must("odidctl get self_id.description").strip(),
            "result": self._result(),
            "locked_out": self._locked_out(),
            "faults": self.appliance.faults()}

    def _locked_out(self):
        """Why the password doesn't open the access point (its key is made of password and name); empty: it does."""
        key, made_for = (self.machine.must("cat /data/secrets/maintenance.psk").split("\n") + ["", ""])[:2]
        name = self.machine.must("cat /data/secrets/wifi_ssid").strip()
        if key != hashlib.pbkdf2_hmac("sha1", PASSWORD.encode(), name.encode(), 4096, 32).hex():
            return f"the key, made for {made_for!r}, isn't the password's for {name!r}"
        return ""

    def _wait_on_air(self):
        """The version that lacks Bluetooth (the course has it fail) is on trial, and gives itself up after its minute."""
        if self.machine.must("cat /etc/odid/version").strip() == VERSIONS[1]:
            self.appliance.wait_restart(1)
        self.machine.wait_on_air()

    def _result(self):
        """What is said of the last update."""
        found = self.appliance.result()
        return f"{found['outcome']}: {found['to']}" if found else ""

    def _wrong(self, found, boundary):
        under_way = len(writes.after(self.requests, boundary))
        harmless = HARMLESS_FAULTS | allowed(self.promises, "fault", boundary, under_way)
        wrong = [f"fault {name}: {text}" for name, text in found["faults"].items() if name not in harmless]
        if found["locked_out"]:
            wrong.append(found["locked_out"])
        for what in ("version", "description", "result"):
            values = allowed(self.promises, what, boundary, under_way)
            if found[what] not in values:
                wrong.append(f"{what} is {found[what]!r}, expected one of {sorted(values)}")
        return "; ".join(wrong)


def judge_all(folder, number, cuts, results):
    """One of several at work; a machine ends with the thread that made it."""
    judge = Judge(folder, number)
    try:
        while True:
            results.put(judge.judge(cuts.get_nowait()))
    except queue.Empty:
        pass
    except BaseException as error:
        results.put(error)
        raise
    finally:
        judge.close()


def course_figures(short=False):
    return json.loads((FOLDER / ("short" if short else "course") / "figures.json").read_text(encoding="utf-8"))


def run(count, seed, control, short=False, afresh=False):
    """short: the short course; afresh: nothing of what is there already counts."""
    folder = recorded(control, short, afresh)
    requests = writes.read(folder / "log")
    promises = json.loads((folder / "promises.json").read_text(encoding="utf-8"))
    cuts = choose(folder / "base", requests, promises, count, seed, control)
    lines = folder / f"cuts-{control or 'plain'}-{seed}-{count}.jsonl"
    done = {}
    if lines.exists():
        done = {result["number"]: result for _, result in read_json_lines(lines)}
    work, results = queue.Queue(), queue.Queue()
    for cut in cuts:
        if cut.number not in done:
            work.put(cut)
    left = work.qsize()
    flushes = len(writes.boundaries(requests))
    print(f"{len(done)} cuts of {count} are done, {flushes} flushes in the record"
          f"{'' if control or flushes <= count else ': not each of them is cut at'}", flush=True)
    judges = [threading.Thread(target=judge_all, args=(folder, number, work, results))
              for number in range(min(JOBS, left))]
    for one in judges:
        one.start()
    try:
        for _ in range(left):
            result = results.get()
            if isinstance(result, BaseException):
                raise result
            done[result["number"]] = result
            with open(lines, "a", encoding="utf-8") as file:
                file.write(json.dumps(result) + "\n")
            mark = "survived" if not result["wrong"] else f"FAILED: {result['wrong']}"
            print(f"cut {len(done)} of {count} (after request {result['boundary']} of {len(requests)}, "
                  f"then {result['kind']}): {mark}", flush=True)
    finally:
        with work.mutex:
            work.queue.clear()  # told to end: each machine ends after the cut that it is at
        for one in judges:
            one.join()
    return [done[cut.number] for cut in cuts]


def note(results, seed):
    """How many survived."""
    failed = sum(bool(one["wrong"]) for one in results)
    figures.note(power_cuts=len(results), power_cuts_failed=failed, power_cuts_seed=seed)
    return len(results) - failed


def main():
    parser = argparse.ArgumentParser(prog="power_cuts.py", description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
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
    survived = note(results, arguments.seed)
    print(f"power-cuts: {survived} of {len(results)} survived (seed {arguments.seed}; {figures.PATH})")
    return survived != len(results)


if __name__ == "__main__":
    program.run("power-cuts", main)
