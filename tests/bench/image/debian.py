"""Debian's packages and sources for another machine, by an apt state of our own.

Mirrors and proxies are those of this machine's own apt; signatures are checked as apt always does. What is
fetched is kept for all checkouts in FETCHED (Makefile); what is there already is checked, and not fetched again.
"""

import fcntl
import functools
import os
import re
import shutil
from pathlib import Path

from .steps import BuildError, call, say, sha256, step

FETCHED = Path(os.environ.get("FETCHED") or "build/fetched").absolute()
DOWNLOADS = FETCHED / "downloads"

KEYRING = "/usr/share/keyrings/debian-archive-keyring.gpg"
RELEASE = "bookworm"
SOURCES_RELEASE = "trixie"      # has the BusyBox and the U-Boot that Buildroot has


def mirrors():
    """This machine's addresses of Debian 12 and of its security updates: {suite: address}."""
    targets = call("apt-get", "indextargets", "--format", "$(RELEASE) $(COMPONENT) $(REPO_URI)",
                   "Created-By: Packages")
    found = {}
    for line in targets.splitlines():
        suite, component, address = line.split()
        if component == "main":
            found.setdefault(suite, address)
    if RELEASE not in found:
        raise BuildError(f"this machine's apt has no source for Debian {RELEASE} main, from which "
                         "the bench's packages come")
    return {suite: found.get(suite, found[RELEASE])
            for suite in (RELEASE, f"{RELEASE}-updates")} | {
        suite: address for suite, address in found.items() if suite == f"{RELEASE}-security"}


class Apt:
    """apt-get and apt-cache for arm64, with everything they write in FETCHED."""

    def __init__(self):
        home = FETCHED / "apt"
        for folder in ("state/lists/partial", "cache/archives/partial"):
            (home / folder).mkdir(parents=True, exist_ok=True)
        (home / "status").touch()
        sources = [f"deb [signed-by={KEYRING}] {address} {suite} main"
                   for suite, address in mirrors().items()]
        sources.append(f"deb-src [signed-by={KEYRING}] {mirrors()[RELEASE]} {SOURCES_RELEASE} main")
        self.sources = "\n".join(sources) + "\n"
        (home / "sources.list").write_text(self.sources, encoding="utf-8")
        own = "\n".join(line for line in call("apt-config", "dump").splitlines()
                        if re.match(r"Acquire::(https?|ForceIPv[46])\b", line))
        (home / "apt.conf").write_text(f"""{own}
Dir::Etc::main "/dev/null";
Dir::Etc::parts "/dev/null";
Dir::Etc::sourcelist "{home}/sources.list";
Dir::Etc::sourceparts "/dev/null";
Dir::Etc::preferences "/dev/null";
Dir::Etc::preferencesparts "/dev/null";
Dir::State "{home}/state";
Dir::State::status "{home}/status";
Dir::Cache "{home}/cache";
APT::Architecture "arm64";
APT::Architectures "arm64";
APT::Sandbox::User "";
Acquire::Languages "none";
Acquire::Retries "3";
""", encoding="utf-8")
        self.lists = home / "state/lists"
        self.environment = os.environ | {"APT_CONFIG": str(home / "apt.conf"), "LC_ALL": "C"}

    def call(self, *command, **options):
        return call(*command, env=self.environment, **options)


def alone(fetch):
    """Another checkout waits meanwhile."""
    @functools.wraps(fetch)
    def locked(*arguments):
        DOWNLOADS.mkdir(parents=True, exist_ok=True)
        with open(FETCHED / "lock", "w", encoding="utf-8") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            fetch(*arguments)
    return locked


@step
@alone
def indexes(out, sources):
    """Debian's indexes fetched."""
    del sources                 # only names the result: other mirrors, other indexes
    apt = Apt()
    try:
        apt.call("apt-get", "update", "--error-on=any", log=out / "log")
    except BuildError as error:
        if not list(apt.lists.glob("*_InRelease")):
            raise
        say(f"Debian's indexes can't be fetched, the ones of before are used ({str(error).splitlines()[-1]})")


def fetched(fetch):
    """Indexes that are weeks old name files that mirrors no longer have: once more with new ones."""
    apt = Apt()
    try:
        return fetch(apt)
    except BuildError:
        apt.call("apt-get", "update", "--error-on=any")
        return fetch(apt)


@step
@alone
def packages(out, indexes, names):
    """Debian's arm64 packages fetched."""
    del indexes

    def fetch(apt):
        wanted = names.split()
        if "linux-image-arm64" in wanted:
            depends = apt.call("apt-cache", "depends", "linux-image-arm64")
            wanted[wanted.index("linux-image-arm64")] = re.search(r"Depends: (\S+)", depends).group(1)
        uris = apt.call("apt-get", "download", "--print-uris", *wanted)
        files = re.findall(r"^'\S+' (\S+\.deb) \d+ SHA256:(\w+)$", uris, re.MULTILINE)
        if len(files) != len(wanted):
            raise BuildError(f"apt named {len(files)} files for {len(wanted)} packages: {uris}")
        for file, hash_ in files:       # apt keeps one that is there and has the right size
            path = DOWNLOADS / file
            if path.exists() and sha256(path) != hash_:
                path.unlink()
        apt.call("apt-get", "download", *wanted, cwd=DOWNLOADS)
        return [file for file, _ in files]

    for file in fetched(fetch):
        shutil.copyfile(DOWNLOADS / file, out / file)


@step
@alone
def source(out, indexes, name, archive, wanted):
    """A source archive fetched."""
    del indexes
    path = DOWNLOADS / archive
    if not path.exists() or sha256(path) != wanted:
        path.unlink(missing_ok=True)
        fetched(lambda apt: apt.call("apt-get", "source", "--download-only", "--tar-only",
                                     "--only-source", name, cwd=DOWNLOADS))
    got = sha256(path) if path.exists() else "no such file"
    if got != wanted:
        raise BuildError(f"{archive}: sha256 expected {wanted}, got {got}")
    shutil.copyfile(path, out / archive)


@step
def sysroot(out, packages):
    """Packages unpacked."""
    merged_root(out)
    for deb in sorted(packages.glob("*.deb")):
        if not deb.name.startswith("linux-image"):
            extract(deb, out)


@step
def kernel(out, packages):
    """Kernel and its modules unpacked."""
    merged_root(out)
    (deb,) = packages.glob("linux-image-*.deb")
    extract(deb, out)
    (modules,) = (out / "lib/modules").iterdir()
    call("depmod", "-b", out, modules.name)


def merged_root(out):
    for name in ("bin", "sbin", "lib"):
        (out / "usr" / name).mkdir(parents=True)
        (out / name).symlink_to(f"usr/{name}")


def extract(deb, out):
    """As dpkg does: a link to a folder stays one. Owners don't matter, the image sets them."""
    call("sh", "-ec", 'dpkg-deb --fsys-tarfile "$1" | '
         'tar -x --keep-directory-symlink --no-same-owner -C "$2"', "sh", deb, out)
