"""A step of the build: made once for each set of inputs, kept in build/appliance/cache.

    @step
    def busybox(out, sources): ...

    busybox(sources_folder, inputs=[paths and strings])

A function that is called for several things needs a `variant` for each.

`out` is an empty folder that the step fills. It is kept under a name made of the step's own source
code, its arguments and its inputs' contents; when that folder exists, the step isn't run. `identity`
names instead what a step can only make in one way.
"""

import hashlib
import inspect
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

BUILD = Path("build/appliance")
CACHE = BUILD / "cache"
started = time.monotonic()
lock = threading.Lock()


class BuildError(Exception):
    """A sentence for the person who called."""


def say(text):
    with lock:
        print(f"image: {time.monotonic() - started:5.1f} s  {text}", flush=True)


def files_of(folder):
    """All files below a folder, in a fixed order."""
    return sorted(path for path in Path(folder).rglob("*") if path.is_file() or path.is_symlink())


def sha256(path):
    return hashlib.sha256(Path(path).read_bytes()).hexdigest()


def digest(inputs):
    """Hash of strings, and of files' and folders' names, modes and contents."""
    total = hashlib.sha256()
    for item in inputs:
        if not isinstance(item, Path):
            total.update(f"text {item}\n".encode())
            continue
        if not item.exists():
            raise BuildError(f"{item} is missing")
        for path in files_of(item) if item.is_dir() else [item]:
            if "__pycache__" in path.parts:
                continue
            name = path.relative_to(item) if item.is_dir() else path.name
            if path.is_symlink():
                total.update(f"link {name} {path.readlink()}\n".encode())
            else:
                mode = path.stat().st_mode & 0o100
                total.update(f"file {name} {mode} {sha256(path)}\n".encode())
    return total.hexdigest()


def step(function):
    """Makes a cached step of a function (out, *arguments)."""

    def run(*arguments, inputs=(), variant="", identity=None):
        name = function.__name__ + variant
        for _ in range(3):
            # Arguments are folders of other steps (their names hold their own hash) or plain text.
            made_from = identity or [inspect.getsource(sys.modules[function.__module__]),
                                     *(str(argument) for argument in arguments), *inputs]
            key = digest(made_from)[:16]
            out = CACHE / f"{name}-{key}"
            if out.is_dir():
                return out
            begun = time.monotonic()
            work = CACHE / f"{name}.part"
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir(parents=True)
            function(work, *arguments)
            if digest(made_from)[:16] == key:
                break
            say(f"{name}: something it is made from was changed meanwhile; once more")
        else:
            raise BuildError(f"{name}: what it is made from keeps changing")
        for old in CACHE.glob(f"{name}-*"):
            if old.name[len(name) + 1:].isalnum():
                shutil.rmtree(old)
        work.rename(out)
        say(f"{name}: {function.__doc__.splitlines()[0].rstrip('.')} "
            f"({time.monotonic() - begun:.1f} s)")
        return out

    return run


def call(*command, log=None, **options):
    """Runs a program, and gives its output; when it fails, all it said is in the error."""
    command = [str(word) for word in command]
    try:
        result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                stdin=subprocess.DEVNULL, check=False, **options)
    except FileNotFoundError as error:
        raise BuildError(f"{command[0]} is not installed ({error})") from error
    text = result.stdout.decode(errors="replace")
    said = text + result.stderr.decode(errors="replace")
    if log is not None:
        Path(log).write_text(said, encoding="utf-8")
    if result.returncode:
        tail = "\n".join(said.splitlines()[-30:])
        raise BuildError(f"{' '.join(command)} failed with {result.returncode}:\n{tail}")
    return text
