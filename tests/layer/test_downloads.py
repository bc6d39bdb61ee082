"""That a user's download ends well: Buildroot itself fetches each package that comes from git, and holds the
archive that it makes of it against the hash that the layer pins. Such a hash depends on the tar that made the
archive, so it can't be had by any other way than Buildroot's own.

  BUILDROOT_DIR=<dir>   a Buildroot
  GIT_MIRRORS=<dir>     repositories to fetch from, instead of their own places: <dir>/<last part of the URL>
"""

import os
import re
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent.parent
LAYER = TOP / "br2-external"
BUILDROOT, MIRRORS = os.environ.get("BUILDROOT_DIR"), os.environ.get("GIT_MIRRORS")
FROM_GIT = sorted(recipe.stem for recipe in LAYER.glob("package/*/*.mk") if "_SITE_METHOD = git\n" in recipe.read_text())
# Buildroot's own, with hashes that are not ours: where these don't come out, it isn't the layer that is wrong.
CONTROLS = ("aer-inject", "panel-mipi-dbi-firmware")
# Archives that a package of Buildroot's also has, under the name of that package there.
THE_SAME_AS = {"libbluetooth": "bluez5_utils-headers"}

pytestmark = pytest.mark.skipif(not BUILDROOT, reason="no BUILDROOT_DIR=<dir> was given")


def buildroot(out, *words, **environment):
    return subprocess.run(
        ["make", "--no-print-directory", "-C", Path(BUILDROOT).resolve(), f"O={out}", f"BR2_EXTERNAL={LAYER}", *words],
        capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL,
        env=os.environ | {"MAKEFLAGS": ""} | environment)


@pytest.fixture(name="out", scope="module")
def configured(tmp_path_factory):
    out = tmp_path_factory.mktemp("downloads")
    result = buildroot(out, "odid_cm4_defconfig")
    assert result.returncode == 0, result.stderr
    with open(out / ".config", "a", encoding="utf-8") as config:
        config.write('BR2_BACKUP_SITE=""\n')    # else another server's archive would do
    return out


def needs_a_tar_that_buildroot_takes():
    """Else it would fetch one and build it; with one on the PATH the test needs nothing but the mirrors."""
    accepted = subprocess.run([Path(BUILDROOT) / "support/dependencies/check-host-tar.sh", "tar"],
                              capture_output=True, text=True, check=False)
    if accepted.returncode != 0:
        pytest.skip("this Buildroot doesn't take the tar that is on the PATH (1.35 or newer)")


def repository(package):
    """Where its recipe says that it is."""
    recipe = next(path for path in (LAYER, Path(BUILDROOT)) if (path / "package" / package).exists())
    return re.search(r"_SITE = (\S+\.git)$", (recipe / f"package/{package}/{package}.mk").read_text(), re.M)[1]


def mirrored(url, folder):
    """git's configuration that takes a repository from the mirrors."""
    mirror = Path(MIRRORS) / url.rpartition("/")[2]
    if not mirror.exists():
        pytest.skip(f"{mirror} is not there")
    path = folder / "gitconfig"
    path.write_text(f'[url "file://{mirror.resolve()}"]\n\tinsteadOf = {url}\n[safe]\n\tdirectory = *\n')
    return path


@pytest.mark.skipif(not MIRRORS, reason="no GIT_MIRRORS=<dir> was given")
@pytest.mark.parametrize("package", [*FROM_GIT, *CONTROLS])
def test_buildroot_accepts_what_it_downloads(out, tmp_path, package):
    needs_a_tar_that_buildroot_takes()
    config = mirrored(repository(package), tmp_path)
    result = buildroot(out, f"{package}-source", BR2_DL_DIR=str(tmp_path), GIT_CONFIG_GLOBAL=str(config))
    assert result.returncode == 0, f"{result.stdout[-1000:]}\n{result.stderr[-2000:]}"
    assert list(tmp_path.glob(f"{package}/{package}-*-git*.tar.gz"))


def pinned(file):
    """{name: sha256} of a .hash file."""
    found = (line.split() for line in Path(file).read_text(encoding="utf-8").splitlines() if line.startswith("sha256 "))
    return {name: value for _, value, name in found}


@pytest.mark.parametrize("package", THE_SAME_AS)
def test_what_buildroot_has_too_has_buildroot_s_hash(package):
    theirs = THE_SAME_AS[package]
    assert pinned(LAYER / f"package/{package}/{package}.hash") == pinned(
        Path(BUILDROOT) / f"package/{theirs}/{theirs}.hash")
