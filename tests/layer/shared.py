"""What the tests of the layer read and call."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent.parent
LAYER, OVERLAY, COMMON = TOP / "br2-external", TOP / "overlay", TOP / "board/common"
BOARDS = sorted(path.name[len("odid_"):-len("_defconfig")] for path in (TOP / "configs").iterdir())
PACKAGES = sorted(path.name for path in (LAYER / "package").iterdir())
MARK = "# --- From here on the same"
OPTION = re.compile(r"(?:# )?((?:BR2|CONFIG)_\w+)(?:=(.*)| is not set)$")
EPOCH = "1767225600"


def read(*parts):
    return TOP.joinpath(*parts).read_text(encoding="utf-8")


def defconfig(board):
    return read(f"configs/odid_{board}_defconfig")


def options(text):
    """[(name, value)]; value None: switched off."""
    return [match.groups() for match in map(OPTION.match, text.splitlines()) if match]


def call(*words, **environment):
    return subprocess.run([str(word) for word in words], capture_output=True, text=True, check=False,
                          stdin=subprocess.DEVNULL, env=os.environ | environment)


def must(*words, **environment):
    result = call(*words, **environment)
    assert result.returncode == 0, result.stdout + result.stderr
    return result.stdout


def needs(*programs):
    lost = [name for name in programs if not shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin:/sbin")]
    return pytest.mark.skipif(bool(lost), reason=f"not installed: {', '.join(lost)}")
