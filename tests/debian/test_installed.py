"""Installed into a root of its own, upgraded, removed and purged, by dpkg and the package's own scripts.

The root has a user's and a group's list and nothing else; the scripts work there by DPKG_ROOT. tests/debian/test_system.py
does the same in a whole Debian.
"""

import os

import pytest

from .package import call, unpack

CONFIG = "etc/odid/odid.conf"


class Root:
    def __init__(self, folder):
        self.folder = folder
        for name in ("var/lib/dpkg/info", "var/lib/dpkg/updates", "var/lib/systemd", "etc/systemd/system", "run"):
            (folder / name).mkdir(parents=True)
        for name in ("var/lib/dpkg/status", "var/lib/dpkg/available", "etc/gshadow", "etc/shadow"):
            (folder / name).touch()
        (folder / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\n")
        (folder / "etc/group").write_text("root:x:0:\ndialout:x:20:\n")
        self.before = self.files()

    def dpkg(self, *words):
        return call("dpkg", f"--root={self.folder}", "--force-script-chrootless", "--force-depends", "--log=/dev/null", *words,
                    env={**os.environ, "LC_ALL": "C"})[1]

    def files(self):
        """Everything there is, but for dpkg's own list and what it keeps of users' lists of before."""
        found = {str(path.relative_to(self.folder)) for path in self.folder.rglob("*")}
        return {name for name in found if not name.startswith("var/lib/dpkg") and not name.startswith("etc/.")
                and not name.endswith("-")}

    def read(self, name):
        return (self.folder / name).read_text()


@pytest.fixture
def root(tmp_path):
    if os.geteuid() != 0:
        pytest.skip("dpkg needs root")
    return Root(tmp_path / "root")


@pytest.fixture
def next_deb(deb, tmp_path):
    """The same package as version 9, with another configuration."""
    folder = unpack(deb, tmp_path / "next")
    for name, old, new in (("DEBIAN/control", "Version: ", "Version: 9+"), (CONFIG, "[basic_id]", "# What the next version says.\n[basic_id]")):
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1))
    out = tmp_path / "next.deb"
    call("dpkg-deb", "--root-owner-group", "-b", folder, out)
    return out


def test_its_users_are_made_with_the_groups_that_they_need(root, deb):
    root.dpkg("-i", deb)
    passwd, group = root.read("etc/passwd"), root.read("etc/group")
    assert "\nodid:" in passwd and "\nodid-hostapd:" in passwd
    for user in ("odid", "odid-hostapd", "odid-beacons"):
        assert f"\n{user}:x:" in passwd and "nologin" in next(line for line in passwd.splitlines() if line.startswith(f"{user}:"))
    members = {line.split(":")[0]: line.split(":")[3] for line in group.splitlines()}
    assert members["dialout"] == "odid" and "odid" not in members.get("netdev", "") and members["odid-hostapd"] == "odid"


def test_it_is_started_at_every_start_of_the_computer(root, deb):
    root.dpkg("-i", deb)
    assert os.path.lexists(root.folder / "etc/systemd/system/multi-user.target.wants/odid.service")
    # The access point by its interface, which may come late.
    assert not list((root.folder / "etc/systemd/system").rglob("odid-*"))


def test_purged_it_leaves_nothing(root, deb):
    root.dpkg("-i", deb)
    (root.folder / "run/odid_faults").mkdir(parents=True)
    (root.folder / "etc/odid/.lock").touch()  # odidctl set's
    root.dpkg("-r", "odid")
    assert (root.folder / CONFIG).exists(), "removed, the configuration stays"
    root.dpkg("-P", "odid")
    assert root.files() == root.before
    assert "odid" not in root.read("etc/passwd")
    assert ":odid" not in root.read("etc/group")


def test_an_upgrade_leaves_a_person_s_configuration(root, deb, next_deb):
    root.dpkg("-i", deb)
    mine = "[basic_id]\nuas_id = SSRS5GBG01\n"
    (root.folder / CONFIG).write_text(mine)
    root.dpkg("--force-confold", "-i", next_deb)
    assert root.read(CONFIG) == mine
    assert "# What the next version says." in root.read(f"{CONFIG}.dpkg-dist")
    root.dpkg("-P", "odid")
    assert root.files() == root.before


def test_an_upgrade_renews_a_configuration_that_nobody_has_changed(root, deb, next_deb):
    root.dpkg("-i", deb)
    root.dpkg("--force-confold", "-i", next_deb)
    assert "# What the next version says." in root.read(CONFIG)
    assert not (root.folder / f"{CONFIG}.dpkg-dist").exists()


def test_a_person_s_own_files_are_left_alone(root, deb):
    """Of the same names in /etc, where they go before the package's."""
    own = {name: f"# mine, {name}\n" for name in (
        "etc/NetworkManager/conf.d/90-odid.conf", "etc/udev/rules.d/90-odid.rules", "etc/default/odid",
        "etc/hostapd/hostapd.conf", "etc/systemd/system/odid.service.d/mine.conf", "etc/sysusers.d/odid.conf")}
    own["etc/sysusers.d/odid.conf"] = (
        "u odid - \"mine\" /nonexistent\nu odid-hostapd - \"mine\" /nonexistent\nu odid-beacons - \"mine\" /nonexistent\n")
    for name, text in own.items():
        path = root.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    root.dpkg("-i", deb)
    root.dpkg("-P", "odid")
    for name, text in own.items():
        assert root.read(name) == text


def test_the_scripts_do_without_what_they_find_missing(root, deb):
    """No udev runs, and nobody to restart."""
    said = root.dpkg("-i", deb)
    assert "error" not in said.lower(), said
