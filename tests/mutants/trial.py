"""One changed source, built in a copy and put to the gate's tests until one of them sees it."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys

import parts

SOURCE = parts.ROOT / "package/odid-daemon"
# What is still to be waited for is more than any of them takes: a change that makes something hang is seen by that.
UNIT_S, PYTEST_S = 300, 1200
FAILED_UNIT = re.compile(r"^\s*\d+ - (\w+) ", re.M)
FAILED_TEST = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.M)


def named(source, file):
    """Where it lies: a source's name is its own in all folders."""
    (path,) = (source / "src").rglob(file)
    return path


class Workshop:
    """A copy of the daemon's sources, with the build that ships and the one of the unit tests."""

    def __init__(self, folder, unit=True):
        self.folder, self.source = folder, folder / "odid-daemon"
        self.shipped, self.unit = folder / "daemon", folder / "unit"
        shutil.rmtree(self.source, ignore_errors=True)
        shutil.copytree(SOURCE, self.source)
        builds = {self.shipped: ["-DCMAKE_BUILD_TYPE=Release"],
                  self.unit: ["-DCMAKE_BUILD_TYPE=Debug", "-DODID_TESTS=ON", "-DODID_SANITIZE=ON"]}
        for build, options in builds.items() if unit else [(self.shipped, builds[self.shipped])]:
            subprocess.run(["cmake", "-S", self.source, "-B", build, "-G", "Unix Makefiles", *options,
                            *(f"-D{name}={os.environ[name]}" for name in ("OPENDRONEID_DIR", "MAVLINK_DIR"))],
                           check=True, stdout=subprocess.DEVNULL)
            if not self._build(build):
                raise RuntimeError(f"the sources as they are can't be built: {build}")

    def _run(self, words, seconds, **environment):
        """(exit code, None: it hung; its output)"""
        process = subprocess.Popen([str(word) for word in words], cwd=parts.ROOT, env={**os.environ, **environment},
                                   stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                   errors="replace", start_new_session=True)
        try:
            said, _ = process.communicate(timeout=seconds)
            return process.returncode, said
        except subprocess.TimeoutExpired:
            return None, ""
        finally:
            try:
                os.killpg(process.pid, signal.SIGKILL)  # what it started, too
            except ProcessLookupError:
                pass
            process.wait()

    def _build(self, build, *targets):
        return subprocess.run(["cmake", "--build", build, "-j", "2", *(f"--target={one}" for one in targets), "--", "-s"],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode == 0

    def _object(self, file):
        """What the compiler makes of it for the build that ships. None: nothing."""
        path = named(self.source, file)
        target = "odid-daemon" if file.endswith("_main.c") else f"odid_{path.parent.name}"
        made = self.shipped / f"CMakeFiles/{target}.dir/{path.relative_to(self.source)}.o"
        return made.read_bytes() if self._build(self.shipped, target) else None

    @contextlib.contextmanager
    def changed(self, file, text):
        """What ships is built with that text of the file, for so long."""
        path = named(self.source, file)
        before = path.read_text()
        try:
            path.write_text(text)
            if not self._build(self.shipped):
                raise RuntimeError(f"{file}: with that text it can't be built")
            yield
        finally:
            path.write_text(before)
            self._build(self.shipped)

    def judge(self, file, text):
        """(verdict, which test or why) of that source with this text."""
        path, untouched = named(self.source, file), named(SOURCE, file).read_text()
        before = self._object(file)
        try:
            path.write_text(text)
            after = self._object(file)
            if after is None:
                return "no C", "the compiler refuses it"
            if after == before:
                return "equivalent", "the compiler makes the same of it"
            if not self._build(self.unit) or not self._build(self.shipped):
                return "no C", "it can't be linked"
            return self.seen(file) or ("survived", "")
        finally:
            path.write_text(untouched)

    def seen(self, file):
        """(verdict, by which test) of what is built there; None: no test fails. Those of that file first."""
        stem = file.removesuffix(".c").removesuffix("_main")
        own = f"^test_({stem}|{stem.split('_')[0]}.*)$"
        for words in (["-R", own], ["-E", own]):
            code, said = self._run(["ctest", "--test-dir", self.unit, "-j", "3", "--stop-on-failure", *words], UNIT_S)
            if code != 0:
                failed = FAILED_UNIT.findall(said)
                return "caught", f"unit {failed[0]}" if failed else "unit: hangs"
        daemon = str(self.shipped / "odid-daemon")
        for which in (["tests/simulated"], ["tests/daemon", "-m", "not booted and not timed and not long", "-n", "3"]):
            code, said = self._run([sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider",
                                    f"--basetemp={self.folder / 'pytest'}", *which], PYTEST_S, DAEMON=daemon)
            if code != 0:
                failed = FAILED_TEST.findall(said)
                return "caught", failed[0] if failed else f"{which[0]}: hangs"
        return None
