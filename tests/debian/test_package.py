"""What is in the package."""

import re
import shutil
import socket

import pytest

from . import package
from .package import SOURCE, TOP, call

EXPECTED = {
    "/etc/odid/odid.conf",
    "/lib/systemd/system/odid.service", "/lib/systemd/system/odid-hostapd@.service",
    "/lib/systemd/system/odid-beacons@.service", "/lib/systemd/system/odid-hostapd-watch@.service",
    "/lib/systemd/system/run-odid.mount", "/lib/systemd/system/run-odid_faults.mount",
    "/lib/udev/rules.d/90-odid.rules",
    "/usr/bin/odidctl", "/usr/sbin/odid-daemon", "/usr/sbin/odid-keeper", "/usr/sbin/odid-beacons",
    "/usr/lib/NetworkManager/conf.d/90-odid.conf",
    "/usr/lib/odid/apply-configuration", "/usr/lib/odid/hostapd-config", "/usr/lib/odid/hostapd-watch",
    "/usr/lib/systemd/system/hostapd.service.d/odid.conf", "/usr/lib/systemd/system/hostapd@.service.d/odid.conf",
    "/usr/lib/sysusers.d/odid.conf",
    "/usr/share/bash-completion/completions/odidctl",
    "/usr/share/doc/odid/changelog.gz", "/usr/share/doc/odid/copyright", "/usr/share/doc/odid/odid.conf.example",
    "/usr/share/man/man1/odidctl.1.gz", "/usr/share/man/man5/odid.conf.5.gz",
    "/usr/share/man/man8/odid-daemon.8.gz", "/usr/share/man/man8/odid-keeper.8.gz", "/usr/share/man/man8/odid-beacons.8.gz",
    "/usr/share/odid/hostapd.conf.in",
}
# Of the appliance's other programs: nobody reads them here.
LEFT_OUT = {"autopilot", "ground_station", "maintenance", "update", "board"}
EXPOSURE_MAX = 2.0


def fields(file):
    return dict(line.split(": ", 1) for line in call("dpkg-deb", "-f", file)[1].splitlines() if re.match(r"[A-Z]\S*: ", line))


def test_nothing_is_in_it_but_what_belongs_there(unpacked):
    found = {f"/{path.relative_to(unpacked)}" for path in unpacked.rglob("*") if path.is_file()}
    assert {name for name in found if not name.startswith("/DEBIAN/")} == EXPECTED
    # What a person may change is theirs; all else has its place in /usr or /lib, where theirs in /etc goes before it.
    assert (unpacked / "DEBIAN/conffiles").read_text().split() == ["/etc/odid/odid.conf"]


def test_the_version_is_the_image_s(deb):
    version = re.search(r"^project\(odid-daemon VERSION ([\d.]+)", (TOP / "package/odid-daemon/CMakeLists.txt").read_text(), re.M)[1]
    assert fields(deb)["Version"] == version


def test_it_asks_for_libraries_of_debian_12_and_for_nothing_of_the_appliance_s(deb):
    depends = {word.split(" ")[0] for word in fields(deb)["Depends"].split(", ")}
    assert depends == {"hostapd", "systemd", "libc6", "libcap-ng0", "libinih1", "libjson-c5", "libnettle8", "libnl-3-200", "libnl-genl-3-200",
                       "libseccomp2", "procps"}
    assert "hostapd (>= 2:2.10)" in fields(deb)["Depends"]


def test_both_architectures_have_the_same(deb):
    others = [package.deb(name) for name in ("amd64", "arm64")]
    if None in others:
        pytest.skip("one of both isn't built: make deb")
    one, other = ({line.split()[-1] for line in call("dpkg-deb", "-c", file)[1].splitlines()} for file in others)
    assert one == other
    ours, theirs = (fields(file) for file in others)
    for name in ("Version", "Depends", "Recommends"):
        assert ours[name] == theirs[name]


@pytest.mark.parametrize("architecture", ["amd64", "arm64"])
def test_lintian_has_nothing_against_it(architecture):
    file = package.deb(architecture)
    if file is None or shutil.which("lintian") is None:
        pytest.skip("lintian isn't installed" if file else f"not built: make deb-{architecture}")
    # By the rules of the Debian that it is for; of a warning nothing is left out.
    code, said = call("lintian", "--profile", "debian", "--tag-display-limit", "0", "--allow-root", "--fail-on", "error,warning",
                      file, check=False)
    assert code == 0, said
    assert not re.search(r"^[EW]: ", said, re.M), said


def test_the_unit_s_exposure(unpacked, tmp_path):
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd isn't installed")
    unit = tmp_path / "odid.service"
    shutil.copyfile(unpacked / "lib/systemd/system/odid.service", unit)
    said = call("systemd-analyze", "security", "--offline=yes", "--no-pager", unit)[1]
    found = re.search(r"Overall exposure level for odid.service: ([\d.]+)", said)
    assert float(found[1]) <= EXPOSURE_MAX, said


def test_no_unit_leaves_a_folder_open_to_whoever_takes_it_over(unpacked):
    """What was written there stayed: memory was full, and the unit's own limit counted that no more once it had ended."""
    units = [unit.read_text() for unit in (unpacked / "lib/systemd/system").glob("odid*.service")]
    assert len(units) == 4
    for unit in units:
        assert "\nProtectSystem=strict\n" in unit and "\nPrivateTmp=yes\n" in unit
        assert re.search(r"^InaccessiblePaths=.*-/dev/shm -/dev/mqueue$", unit, re.M)


def test_the_unit_says_what_keeps_it_on_the_air(unpacked):
    unit = (unpacked / "lib/systemd/system/odid.service").read_text()
    for line in ("Type=notify", "Restart=always", "StartLimitIntervalSec=0", "User=odid", "ProtectSystem=strict",
                 "CapabilityBoundingSet=CAP_NET_ADMIN CAP_NET_RAW", "CPUSchedulingPolicy=fifo",
                 "EnvironmentFile=-/etc/default/odid", "WantedBy=multi-user.target"):
        assert f"\n{line}\n" in unit
    # The watchdog: the keeper speaks once a second.
    assert 3 <= int(re.search(r"^WatchdogSec=(\d+)$", unit, re.M)[1]) <= 10
    # The daemon asks for its filter, and the Bluetooth address comes of the boot id in /proc/sys: without either it is silent,
    # or another aircraft after each restart.
    assert "\nSystemCallFilter=@system-service seccomp\n" in unit and "ProcSubset" not in unit
    # Nothing that may be written to but its run directory.
    assert not re.search(r"^(ReadWritePaths|StateDirectory|CacheDirectory|LogsDirectory)=", unit, re.M)


def sections(text):
    return set(re.findall(r"^\[(\w+)\]", text, re.M))


def test_the_configuration_is_the_example_without_what_nobody_reads(unpacked):
    example = (TOP / "package/odid-daemon/odid.conf.example").read_text()
    made = (unpacked / "etc/odid/odid.conf").read_text()
    assert sections(made) == sections(example) - LEFT_OUT
    assert set(made.splitlines()) - set(example.splitlines()) == {
        "# ---- The access point whose beacons carry Remote ID ---------------------------------------------",
        "# A hostapd of your own: /run/hostapd, which it gives to the group odid-hostapd.",
        "; hostapd_dir = /run/odid-hostapd/control"}
    assert "appliance" not in made.lower()
    # Every key is a comment: as it comes it has what is so by default, and an aircraft without an identity.
    said = call(unpacked / "usr/bin/odidctl", "check", unpacked / "etc/odid/odid.conf", check=False)[1]
    assert "error" not in said and "uas_id is not set" in said


def test_an_interface_that_systemd_would_call_otherwise_is_refused(unpacked, tmp_path):
    """Its access point waited for a device that never comes: no Wi-Fi, and not a word why."""
    (file := tmp_path / "odid.conf").write_text("[broadcast]\nwifi_iface = wlan-ap\n")
    said = call(unpacked / "usr/bin/odidctl", "check", file, check=False)[1]
    assert 'wifi_iface = "wlan-ap": expected an interface such as wlan0, at most 15 bytes, without a hyphen' in said


def test_whom_the_package_makes_is_whom_the_units_name(unpacked):
    made = set(re.findall(r"^u (\S+)", (unpacked / "usr/lib/sysusers.d/odid.conf").read_text(), re.M))
    units = "".join(path.read_text() for path in (unpacked / "lib/systemd/system").iterdir())
    assert set(re.findall(r"^User=(\S+)", units, re.M)) == made


def test_the_access_point_s_configuration_is_the_appliance_s(unpacked):
    assert (unpacked / "usr/share/odid/hostapd.conf.in").read_bytes() == (TOP / "overlay/etc/hostapd/hostapd.conf.in").read_bytes()


WORDS = {
    "flights": ["flights"], "maintenance": ["maintenance", "on"], "update": ["update"], "import": ["import", "/nowhere"],
    "factory-reset": ["factory-reset"], "password": ["set", "maintenance.password", "abcdefgh1234"],
    "board-test": ["board-test"], "board": ["set", "board.usb", "gadget"],
}


@pytest.mark.parametrize("words", WORDS.values(), ids=WORDS)
def test_what_only_the_appliance_has_is_said_in_a_sentence(unpacked, words, tmp_path):
    code, said = call(unpacked / "usr/bin/odidctl", "-root", tmp_path, *words, check=False)
    assert code == 1
    assert re.fullmatch(r"[^\n]*\bthe appliance's\b[^\n]*\.\n", said), said


def test_settings_are_changed_where_the_package_has_them(unpacked, tmp_path):
    config = tmp_path / "etc/odid/odid.conf"
    config.parent.mkdir(parents=True)
    config.write_bytes((unpacked / "etc/odid/odid.conf").read_bytes())
    odidctl = (unpacked / "usr/bin/odidctl", "-root", tmp_path)
    assert call(*odidctl, "set", "wifi.channel", "11")[1] == "Saved. Restart the daemon to make it count.\n"
    assert call(*odidctl, "get", "wifi.channel")[1] == "11\n"
    assert "\nchannel = 11\n" in config.read_text()


def access_point(unpacked, tmp_path, interface, *words, **values):
    """The script's exit code, and what it wrote; below a root of its own."""
    root = tmp_path / "root"
    (root / "run").mkdir(parents=True, exist_ok=True)
    lines = {"wifi_beacon_enabled": "true", "wifi_iface": "wlan0", "country": "SE", "channel": "6", **values}
    told = root / "odidctl"
    told.write_text("#!/bin/sh\nprintf '%s\\n' " + " ".join(lines.values()) + "\n")
    told.chmod(0o755)
    text = (unpacked / "usr/lib/odid/hostapd-config").read_text().replace("pkill -KILL -u odid-hostapd", f"echo >{root}/killed")
    assert "pkill" not in text  # the user that stands in for it has more processes
    script = root / "hostapd-config"
    script.write_text(text.replace(" odid-hostapd", " root").replace(":odid-hostapd", ":root")
                      .replace("=/run/", f"={root}/run/")
                      .replace("/usr/share/odid", f"{unpacked}/usr/share/odid").replace("$(odidctl", f"$({told}"))
    script.chmod(0o755)
    return call(script, interface, *words, check=False)[0], root / "run/odid-hostapd"


def test_the_access_point_that_is_made(unpacked, tmp_path):
    code, folder = access_point(unpacked, tmp_path, "wlan0", channel="11")
    assert code == 0
    made = dict(line.split("=", 1) for line in (folder / "hostapd.conf").read_text().splitlines())
    assert made["interface"] == "wlan0" and made["channel"] == "11" and made["country_code"] == "SE"
    assert made["ctrl_interface"] == f"{folder}/control"
    assert made["max_num_sta"] == "0" and made["ctrl_interface_group"] == "odid-hostapd"
    assert "@" not in "".join(made.values())
    key = re.fullmatch(r"00:00:00:00:00:00 ([0-9a-f]{64})\n", (folder / "psk").read_text())[1]
    assert made["wpa_psk_file"] == f"{folder}/psk"
    assert (folder / "psk").stat().st_mode & 0o077 == 0
    access_point(unpacked, tmp_path, "wlan0")
    assert key not in (folder / "psk").read_text(), "the same key twice"
    assert (tmp_path / "root/killed").exists()  # what its user still had


@pytest.mark.parametrize("interface,values", [("wlan1", {}), ("wlan0", {"wifi_beacon_enabled": "false"})])
def test_another_interface_or_wi_fi_switched_off_has_no_access_point(unpacked, tmp_path, interface, values):
    for words in ((), ("check",)):
        code, folder = access_point(unpacked, tmp_path, interface, *words, **values)
        assert code == 1 and not folder.exists() and not (tmp_path / "root/killed").exists()


def test_whether_it_is_to_be_started_is_found_out_without_making_anything(unpacked, tmp_path):
    """By its watch and its counter, which may make nothing."""
    code, folder = access_point(unpacked, tmp_path, "wlan0", "check")
    assert code == 0 and not folder.exists()


def test_an_access_point_that_could_not_be_made_is_tried_again(unpacked, tmp_path):
    """With 1 systemd would take it for one of another interface, which isn't started."""
    code, folder = access_point(unpacked, tmp_path, "wlan0", channel="'6|; no sed'")
    assert code == 255 and folder.exists()


@pytest.mark.parametrize("unit", ["odid-hostapd@", "odid-hostapd-watch@", "odid-beacons@", ""])
def test_nobody_fills_run_or_the_disk(unpacked, unit):
    """What one that was taken over leaves goes before the next one starts: else each life of it had the memory that it may have anew."""
    text = (unpacked / f"lib/systemd/system/{unit or 'odid'}.service").read_text()
    assert re.search(r"^InaccessiblePaths=.*/tmp /var/tmp", text, re.M)
    for folder in re.findall(r"^RuntimeDirectory=(\S+)$", text, re.M) if "RuntimeDirectoryPreserve=yes" in text and unit else []:
        assert f"\nExecStartPre=-+/usr/bin/find /run/{folder} -mindepth 1 -delete\n" in text


def test_what_a_taken_over_access_point_left_keeps_no_other_from_starting(unpacked, tmp_path, monkeypatch):
    """A folder in a file's place did, with a mode of 0 or a socket in it, and what it wrote filled /run."""
    config = tmp_path / "root/run/odid-hostapd"
    sockets = config / "control"
    for path in (config / "psk/a", config / "hostapd.conf/a", sockets / "wlan0/a/b"):
        path.mkdir(parents=True)
    for place in (config / "settings", sockets / "wlan0/a/socket", sockets / "more"):
        with socket.socket(socket.AF_UNIX) as one:
            monkeypatch.chdir(place.parent)  # the whole path is too long for one
            one.bind(place.name)
    (config / "psk").chmod(0)
    assert access_point(unpacked, tmp_path, "wlan0")[0] == 0
    assert {path.name: path.is_file() for path in config.iterdir()} == {
        "control": False, "hostapd.conf": True, "psk": True, "settings": True}
    assert list(sockets.iterdir()) == []


def test_it_can_write_nothing_that_root_reads(unpacked):
    """A link to the watchdog: opened, and closed again, it restarted the computer a quarter of a minute later."""
    unit = (unpacked / "lib/systemd/system/odid-hostapd@.service").read_text()
    assert re.findall(r"^(?:ReadWritePaths|.*Directory)=(.*)$", unit, re.M) == ["-/run/odid-hostapd/control"]
    assert "control" not in (unpacked / "usr/lib/odid/apply-configuration").read_text()


def watched(unpacked, tmp_path, answers):
    """How often hostapd was ended, where it answers so: a letter a second, y or n, or - where it has no socket. Its second is a
    hundredth here, and the last letter ends it."""
    tools = tmp_path / "tools"
    tools.mkdir()
    (tmp_path / "answers").write_text("\n".join(answers) + "\n")
    for name, text in {
            "sleep": f'socket={tmp_path}/wlan0\nread -r now <{tmp_path}/answers || kill $PPID\nsed -i 1d {tmp_path}/answers\n'
                     f'echo "$now" >{tmp_path}/now\nif [ "$now" = - ]; then rm -f $socket; elif [ ! -e $socket ]; then\n'
                     'python3 -c "import socket, sys; socket.socket(socket.AF_UNIX).bind(sys.argv[1])" $socket; fi\n',
            "hostapd_cli": f'read -r now <{tmp_path}/now; [ "$now" = y ] && echo state=ENABLED\n',
            "pkill": f'echo "$*" >>{tmp_path}/ended\n'}.items():
        (tools / name).write_text("#!/bin/sh\n" + text)
        (tools / name).chmod(0o755)
    script = tmp_path / "hostapd-watch"
    script.write_text((unpacked / "usr/lib/odid/hostapd-watch").read_text().replace("/run/odid-hostapd/control", str(tmp_path)))
    call("env", f"PATH={tools}:/usr/bin:/bin", f"RUNTIME_DIRECTORY={tmp_path}", "sh", script, "wlan0", check=False)
    return (tmp_path / "ended").read_text().splitlines() if (tmp_path / "ended").exists() else []


@pytest.mark.parametrize("answers, times", [
    ("yyyyy", 0), ("ynyny", 0), ("ynn", 1), ("ynnnnnn", 1), ("ynnynn", 2),  # once, until the next one has answered
    ("y-nn", 0), ("n" * 14 + "y", 0), ("n" * 15, 1), ("-" * 30, 0)])
def test_an_access_point_that_hangs_is_ended(unpacked, tmp_path, answers, times):
    """Its radio goes on with the last place that it was told, and systemd sees a process that runs."""
    assert watched(unpacked, tmp_path, answers) == ["-KILL -x -u odid-hostapd hostapd"] * times


def test_the_access_point_alone_is_watched(unpacked):
    """A watch of another interface ended the hostapd of the broadcast's each 15 s: that of the other one, somebody else's, didn't answer."""
    units = [(unpacked / f"lib/systemd/system/odid-hostapd{which}@.service").read_text() for which in ("", "-watch")]
    for line in re.findall(r"^ConditionPathExists=.*$", units[0], re.M) + ["ExecCondition=+/usr/lib/odid/hostapd-config %i check"]:
        assert line in units[1]


def apply(unpacked, folder, armed="disarmed never 0 said"):
    """apply-configuration's exit code, and what it had systemd do; what hostapd runs with is in `settings`."""
    for name, text in {
            "odidctl": f"case $1 in armed) echo '{armed}' ;; get) [ $# -gt 2 ] && printf 'true\\nlo\\nSE\\n6\\n' || echo lo ;; esac\n",
            "systemctl": f'echo "$*" >>{folder}/calls\n'}.items():
        (folder / name).write_text("#!/bin/sh\n" + text)
        (folder / name).chmod(0o755)
    script = folder / "apply-configuration"
    script.write_text((unpacked / "usr/lib/odid/apply-configuration").read_text().replace("/run/odid-hostapd", str(folder))
                      .replace("/usr/lib/odid", f"{unpacked}/usr/lib/odid"))
    code = call("env", f"PATH={folder}:/usr/bin:/bin", "sh", script, check=False)[0]
    return code, (folder / "calls").read_text().splitlines() if (folder / "calls").exists() else []


ANEW = ["stop odid-hostapd@*.service odid-beacons@*.service", "start odid-hostapd@lo.service odid-beacons@lo.service"]


@pytest.mark.parametrize("runs_with, calls", [
    ("true\nlo\nSE\n6\n", ["try-restart odid-beacons@lo.service"]), ("true\nlo\nSE\n11\n", ANEW), (None, ANEW)])
def test_what_is_saved_restarts_what_it_concerns(unpacked, tmp_path, runs_with, calls):
    settings = tmp_path / "settings"
    if runs_with:
        settings.write_text(runs_with)
    assert apply(unpacked, tmp_path) == (0, calls)
    if calls == ANEW:  # it isn't written where there is none to start: switched on again, that was taken for what runs
        assert not settings.exists()


@pytest.mark.parametrize("armed", ["armed once 1 said", "unknown never 1 unsaid", ""])
def test_what_is_saved_restarts_nothing_in_the_air(unpacked, tmp_path, armed):
    assert apply(unpacked, tmp_path, armed) == (1, [])


def test_where_the_settings_are_not_known_the_access_point_is_tried_again(unpacked, tmp_path):
    """1 would be: there is none to start, until the next power-on."""
    for said in ({"channel": ""}, {"wifi_beacon_enabled": "", "wifi_iface": "", "country": "", "channel": ""}):
        assert access_point(unpacked, tmp_path, "wlan0", "check", **said)[0] == 255


def test_the_completion_knows_every_command_that_works_here(unpacked):
    usage = call(unpacked / "usr/bin/odidctl", "--help")[1]
    commands = set(re.findall(r"^  odidctl ([a-z-]+)", usage, re.M)) - {"flights", "maintenance", "update", "import", "factory-reset", "board-test"}
    script = ('source "$1"; COMP_WORDS=(odidctl ""); COMP_CWORD=1; _odidctl; printf "%s\\n" "${COMPREPLY[@]}"')
    said = call("bash", "-c", script, "bash", unpacked / "usr/share/bash-completion/completions/odidctl")[1]
    assert set(said.split()) == commands | {"--version", "--help"}


@pytest.mark.long
def test_the_same_bytes_from_another_place(deb, tmp_path):
    """Another folder, another umask."""
    copy = tmp_path / "copy"
    copy.mkdir()
    for name in ("package", "board", "overlay", "tests/setup"):
        shutil.copytree(TOP / name, copy / name, symlinks=True)
    when = call("git", "-C", TOP, "log", "-1", "--format=%ct")[1].strip()
    call("sh", "-c", f"umask 077; SOURCE_DATE_EPOCH={when} OPENDRONEID={TOP}/build/opendroneid MAVLINK={TOP}/build/mavlink "
         f"{copy}/board/companion/make-deb.sh {package.here()} {tmp_path}/out")
    (again,) = (tmp_path / "out").glob("*.deb")
    assert again.read_bytes() == deb.read_bytes()


def test_rules_for_udev_are_understood(unpacked):
    """Each line: matches and assignments, and ModemManager's word for autopilots only."""
    rules = [line for line in (unpacked / "lib/udev/rules.d/90-odid.rules").read_text().splitlines()
             if line and not line.startswith("#")]
    for rule in rules:
        assert all(re.fullmatch(r'[A-Z_]+(\{\w+\})?(==|!=|=|\+=)"[^"]*"', word) for word in rule.split(", ")), rule
        if "ID_MM" in rule:
            assert "ATTRS{idVendor}" in rule
    assert (SOURCE / "odid.udev").read_text() == (unpacked / "lib/udev/rules.d/90-odid.rules").read_text()
