"""`make check` sees a source that includes what its room may not know."""

import os
import subprocess
import sys
from pathlib import Path

import parts
import pytest

CHECK = Path(__file__).with_name("rooms.py")
DAEMON = parts.ROOT / "package/odid-daemon"


def check(folder, room, included):
    path = folder / "src" / room / "module.c"
    path.parent.mkdir(parents=True)
    path.write_text(f'#include <stdio.h>\n\n#include "{included}"\n')
    return subprocess.run([sys.executable, CHECK, path], capture_output=True, text=True)


@pytest.mark.parametrize("room, included, said", [
    ("web", "odidctl/odidctl.h", "web may not know odidctl"),
    ("base", "config/config.h", "base may not know config"),
    ("flights", "recorder/recorder.h", "flights may not know recorder"),
    ("daemon", "loop.h", 'expected "FOLDER/loop.h"'),
])
def test_what_may_not_be_known_is_named(tmp_path, room, included, said):
    result = check(tmp_path, room, included)
    assert result.returncode == 1 and said in result.stdout


@pytest.mark.parametrize("room, included", [("web", "appliance/places.h"), ("config", "base/earth.h"), ("radio", "radio/hci.h")])
def test_what_may_be_known_passes(tmp_path, room, included):
    result = check(tmp_path, room, included)
    assert result.returncode == 0 and not result.stdout


SOURCES = {
    "first.c": "void first(void)\n{\n    second();\n}\n",
    "second.c": "static void more(void)\n{\n    %s(0); /* first() */\n}\n\nvoid second(void)\n{\n    more();\n}\n",
    "third.c": "int third(int one,\n          int two)\n{\n    first();\n    return one;\n}\n",
}


@pytest.mark.parametrize("called, said", [("third", "first.c: calls itself by second.c, third.c"), ("fourth", "")])
def test_a_circle_is_named(tmp_path, called, said):
    for name, text in SOURCES.items():
        path = tmp_path / "src/daemon" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace("%s", called))
    result = subprocess.run([sys.executable, CHECK, *sorted(path.parent.iterdir())], capture_output=True, text=True)
    assert (result.returncode != 0) == bool(said) and said in result.stdout and result.stdout.count("\n") == bool(said)


def test_nothing_to_look_at_is_no_pass():
    assert subprocess.run([sys.executable, CHECK]).returncode == 1


def test_the_daemon_by_itself_asks_for_none_of_the_appliance_s_libraries(tmp_path):
    subprocess.run(["cmake", "-S", DAEMON, "-B", tmp_path, "-DODID_ONLY_DAEMON=ON",
                    f"-DOPENDRONEID_DIR={os.environ.get('OPENDRONEID_DIR', parts.ROOT / 'build/opendroneid')}",
                    f"-DMAVLINK_DIR={os.environ['MAVLINK_DIR']}"], check=True, capture_output=True)
    programs = {path.parent.name.removesuffix(".dir") for path in tmp_path.glob("CMakeFiles/*.dir/link.txt")}
    assert "odid-daemon" in programs and not programs & {"odid-update", "odid-web", "odidctl"}
    assert "swupdate" not in (tmp_path / "CMakeCache.txt").read_text()
