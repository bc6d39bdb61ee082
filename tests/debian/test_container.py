"""The container's image: what is in it, and that it runs with two rights on a root that nobody writes to."""

import hashlib
import io
import json
import os
import re
import shutil
import subprocess
import tarfile
from collections import namedtuple

import patience
import pytest

from . import package
from .package import TOP, call

SIZE_MAX = 15_000_000
Image = namedtuple("Image", "file config layer tag")  # layer: {name: its member in the tar}, data by read()
NET_ADMIN, NET_RAW = 12, 13


class Layer:
    def __init__(self, data):
        self.data = data
        self.archive = tarfile.open(fileobj=io.BytesIO(data))
        self.members = {member.name: member for member in self.archive}

    def read(self, name):
        return self.archive.extractfile(self.members[name]).read()

    def put(self, folder):
        self.archive.extractall(folder)
        return folder


@pytest.fixture(scope="module")
def image():
    file = package.container()
    if file is None:
        pytest.skip(f"the image isn't built: make container-{package.here()}")
    with tarfile.open(file) as archive:
        (manifest,) = json.load(archive.extractfile("manifest.json"))
        config = json.load(archive.extractfile(manifest["Config"]))
        (layer,) = (archive.extractfile(name).read() for name in manifest["Layers"])
    assert config["rootfs"]["diff_ids"] == [f"sha256:{hashlib.sha256(layer).hexdigest()}"]
    return Image(file, config, Layer(layer), manifest["RepoTags"][0])


def test_it_is_small(image):
    assert image.file.stat().st_size <= SIZE_MAX


def test_the_package_s_files_their_libraries_and_nothing_else_are_in_it(image, unpacked):
    files = {name for name, member in image.layer.members.items() if member.isfile()}
    libraries = {name for name in files if re.search(r"/[\w-]+\.so\.\d+$", name)}
    assert files - libraries == {
        "usr/bin/odidctl", "usr/sbin/odid-daemon", "usr/sbin/odid-keeper", "etc/odid/odid.conf", "etc/passwd", "etc/group",
        "etc/nsswitch.conf", "usr/share/doc/odid/copyright"}
    for name in ("usr/bin/odidctl", "usr/sbin/odid-daemon", "etc/odid/odid.conf"):
        assert image.layer.read(name) == (unpacked / name).read_bytes()
    assert len(libraries) == 8, libraries  # with the loader


def test_nothing_in_it_belongs_to_its_user_or_has_more_than_its_mode(image):
    for name, member in image.layer.members.items():
        assert (member.uid, member.gid) == (0, 0) and member.mode & 0o6000 == 0, name
        assert member.mode & 0o022 == 0 or name in ("run/odid", "run/odid_faults"), name


def test_what_it_says_of_itself(image):
    config = image.config["config"]
    assert config["User"] == "odid" and image.config["architecture"] == package.here()
    assert config["Healthcheck"]["Test"] == ["CMD", "/usr/bin/odidctl", "status"]
    assert config["Entrypoint"][0] == "/usr/sbin/odid-keeper"


def test_its_programs_find_their_libraries(image, tmp_path):
    if os.geteuid() != 0:
        pytest.skip("a root of its own needs root")
    root = image.layer.put(tmp_path)
    for program, word in (("/usr/bin/odidctl", "--version"), ("/usr/sbin/odid-daemon", "-version"),
                          ("/usr/sbin/odid-keeper", "-version")):
        assert call("chroot", root, program, word)[1].startswith(program.rsplit("/", 1)[1])


@pytest.mark.long
def test_the_same_bytes_again(image, tmp_path):
    for file in (package.deb(), ):
        shutil.copy(file, tmp_path)
    call("python3", TOP / "board/companion/make_container.py", package.here(), tmp_path)
    (again,) = tmp_path.glob("*.container.tar")
    assert again.read_bytes() == image.file.read_bytes()


# --- run --------------------------------------------------------------------------


class Podman:
    """With everything that it keeps in a folder of the test's own."""

    def __init__(self, folder, runtime):
        self.words = ["podman", "--root", folder / "root", "--runroot", folder / "run", "--storage-driver", "vfs",
                      "--cgroup-manager", "cgroupfs", *(["--runtime", runtime] if runtime else [])]

    def __call__(self, *words, **options):
        return call(*self.words, *words, timeout=patience.LIMIT_S, **options)


# What docs/debian.md says, but for the limits that only somebody who may raise them can give, and for the timer of the health
# check, which is systemd's.
RUN = ("--read-only", "--read-only-tmpfs=false", "--cap-drop", "all", "--cap-add", "NET_ADMIN,NET_RAW", "--network", "host",
       "--tmpfs", "/run/odid:size=256k", "--tmpfs", "/run/odid_faults:size=256k", "--no-healthcheck",
       "--ulimit", "nofile=1024:1024", "--ulimit", "nproc=1024:1024")


@pytest.fixture(scope="module")
def podman(image, tmp_path_factory):
    if os.geteuid() != 0 or not shutil.which("podman"):
        pytest.skip("podman isn't installed, or not for root")
    said = []
    for runtime in (None, "runc"):
        one = Podman(tmp_path_factory.mktemp("podman"), runtime)
        try:
            one("load", "-i", image.file)
            one("run", "--rm", *RUN, "--entrypoint", "/usr/bin/odidctl", image.tag, "--version")
            return one
        except (AssertionError, subprocess.TimeoutExpired) as error:
            said.append(str(error).strip().splitlines()[-1])
    pytest.skip(f"podman can't run a container here: {'; '.join(said)}")


@pytest.fixture
def running(podman, image):
    podman("run", "-d", "--name", "odid", *RUN, image.tag)
    yield podman
    podman("rm", "-f", "-t", "3", "odid", check=False)


def processes(podman):
    """{name: (its status in /proc)} of what runs in the container."""
    found = {}
    top = podman("top", "odid", "hpid", "comm")[1].splitlines()[1:]
    for line in top:
        number, name = line.split()
        with open(f"/proc/{number}/status", encoding="utf-8") as status:
            found[name] = dict(line.split(":", 1) for line in status.read().splitlines())
    return found


@pytest.mark.long
def test_it_runs_as_its_user_with_two_rights_on_a_root_that_nobody_writes_to(running):
    patience.wait_for("the daemon in the container", lambda: "odid-daemon" in processes(running))
    patience.wait_for("an answer", lambda: "Channels" in running("exec", "odid", "/usr/bin/odidctl", "status", check=False)[1])
    for name, status in processes(running).items():
        assert status["Uid"].split() == ["990"] * 4, name
        assert int(status["CapPrm"], 16) == 1 << NET_ADMIN | 1 << NET_RAW, name
    assert running("exec", "odid", "/usr/bin/odidctl", "status", check=False)[0] == 1  # no radio here: unhealthy
    said = running("exec", "odid", "/usr/bin/odidctl", "set", "wifi.channel", "11", check=False)[1]
    assert "nothing was changed" in said


@pytest.mark.long
def test_the_doctor_says_in_it_what_it_can_t_do(running):
    patience.wait_for("an answer", lambda: "Channels" in running("exec", "odid", "/usr/bin/odidctl", "status", check=False)[1])
    code, said = running("exec", "odid", "/usr/bin/odidctl", "doctor", check=False)
    assert code == 1
    for words in ("--device /dev/rfkill", "-v /run/hostapd:/run/odid-hostapd/control", "neither firmware nor other programs"):
        assert words in said
