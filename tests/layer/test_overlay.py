"""What the files of overlay/ call and name is in the image."""

import re

from .shared import OVERLAY, TOP, defconfig, options, read

# Programs of the packages that the defconfigs select. BusyBox' and ours are read from where they are named.
PROGRAMS = {
    "DROPBEAR": "dropbear dropbearkey", "E2FSPROGS": "mke2fs e2fsck tune2fs", "DOSFSTOOLS": "mkfs.fat fsck.fat",
    "HOSTAPD_ODID": "hostapd hostapd_cli", "IW": "iw", "LIBUBOOTENV": "fw_printenv fw_setenv",
    "MAVLINK_ROUTER": "mavlink-routerd", "NFTABLES": "nft", "SWUPDATE": "swupdate",
    "LIBCURL_CURL": "curl",
}
BUILT_IN = set("""
    : . [ alias bg break cd command continue echo eval exec exit export false fg getopts hash help jobs kill let
    local printf pwd read readonly return set shift test times trap true type ulimit umask unalias unset wait
""".split())
WORDS = set("if then else elif fi for while until do done case esac in { } ! function".split())
# They run what comes after them: how many of their own words come before that.
RUNNERS = {"exec": 0, "nice": 2, "timeout": 1, "chrt": 2, "setsid": 0, "nohup": 0, "xargs": 0, "env": 0}
SOURCED = [OVERLAY / "lib/odid" / name for name in ("functions", "data-disk")]


def applets():
    return {name.removeprefix("CONFIG_").removeprefix("BB_").lower()
            for name, value in options(read("board/common/busybox.fragment"))
            if value == "y" and "FEATURE_" not in name} | {"sh", "["}


def provided():
    selected = {name.removeprefix("BR2_PACKAGE_") for name, value in options(defconfig("cm4")) if value == "y"}
    ours = [path.name.removesuffix("_main.c").replace("_", "-")
            for path in (TOP / "package/odid-daemon/src").glob("*/*_main.c")]
    found = applets() | set(ours)
    for package, programs in PROGRAMS.items():
        if package in selected:
            found |= set(programs.split())
    return found


def quoted(found):
    """awk and sed have words of their own, and in a sentence "can't" opens nothing."""
    text = found[0]
    if text[0] == "#":
        return ""
    return re.sub(r"'[^']*'", "''", text) if text[0] == "'" or "$(" in text else text.replace("'", "")


def commands(text):
    """Words in the place of a command; a rough reading of the shell that is enough for ours."""
    text = re.sub(r"\\\n", " ", text)
    text = re.sub(r"<<-?'?(\w+)'?([^\n]*)\n.*?\n\t*\1\n", r"\2\n", text, flags=re.S)
    text = re.sub(r"""'[^']*'|"(?:[^"\\]|\\.)*"|(?:^|(?<=\s))#[^\n]*""", quoted, text, flags=re.M)
    text = re.sub(r"\$\(\((?:[^()]|\([^()]*\))*\)\)", "0", text)          # arithmetic
    text = re.sub(r'"(?:[^"$\\]|\\.|\$(?!\())*"', '""', text)           # of strings only the commands in them
    inner = [command for string in re.findall(r'"[^"]*"', text) for command in re.findall(r"\$\([^)]*\)", string)]
    text = "\n".join([re.sub(r'"[^"]*"', '""', text), *inner])
    text = re.sub(r"\$\{[^}]*\}", "X", text)
    text = re.sub(r"(^|;;| in(?= ))\s*[^\s()]+( \| [^\s()]+)*\)", r"\1;", text, flags=re.M)  # patterns of case
    found = set()
    for part in re.split(r"\n|;|&&|\|\||\||\$\(|`|(?<![>&<\d])&(?!\d)|\(|\)", text):
        words = part.split()
        while words and (words[0] in WORDS or re.match(r"\w+=", words[0]) or re.match(r"\d?[<>]", words[0])):
            if words[0] in ("for", "case", "in"):
                words = []
                break
            words = words[2:] if words[0] in ("<", ">", ">>", "2>") else words[1:]
        if not words:
            continue
        name = words[0]
        if name in RUNNERS:
            rest = [word for word in words[1:] if not word.startswith("-")] if name != "nice" else words[1:]
            found |= commands(" ".join(rest[RUNNERS[name]:]))
        if re.fullmatch(r"[A-Za-z_.\[:][\w.+-]*", name):
            found.add(name)
    return found


def scripts():
    for path in sorted(OVERLAY.rglob("*")):
        if path.is_file() and not path.is_symlink():
            text = path.read_bytes()
            if text.startswith(b"#!/bin/sh") or path in SOURCED:
                yield path, text.decode()


def defined(text):
    return set(re.findall(r"^\s*(\w+)\(\) [{(]", text, re.M))


def test_the_reading_of_the_shell_finds_a_program():
    script = 'say "it can\'t, the others\' can"; a && nice -n 5 one x | two\n[ -n "$(three y)" ] || exec timeout 3 four\nfor i in no no; do five $i; done\n' \
        "case $x in no | no) six ;; no) seven ;; esac\n"
    assert commands(script) - {"say", "a", "["} >= {"one", "two", "three", "four", "five", "six", "seven"}
    assert "no" not in commands(script)
    assert {"sh", "mdev", "runsv"} <= provided() and "gcc" not in provided()


def test_programs_that_scripts_call_are_in_the_image():
    shared = set().union(*(defined(path.read_text()) for path in SOURCED))
    lost = {}
    for path, text in scripts():
        unknown = commands(text) - provided() - BUILT_IN - shared - defined(text)
        if unknown:
            lost[str(path.relative_to(TOP))] = sorted(unknown)
    assert not lost, "called, and nothing that the defconfigs select brings it"


def test_scripts_of_ours_that_are_named_are_there():
    lost = []
    for path in sorted(OVERLAY.rglob("*")):
        if path.is_file() and not path.is_symlink():
            for name in re.findall(r"/lib/odid/([a-z][\w-]*)", path.read_text(encoding="utf-8")):
                if not (OVERLAY / "lib/odid" / name).exists():
                    lost.append((str(path.relative_to(TOP)), name))
    assert not lost
