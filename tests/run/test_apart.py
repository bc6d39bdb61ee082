"""`make check` sees a test module that is imported by another one."""

import subprocess
import sys
from pathlib import Path

import pytest

CHECK = Path(__file__).with_name("apart.py")


def check(folder, importing, name="test_one.py"):
    (folder / "test_other.py").write_text("def test_it():\n    pass\n")
    (folder / name).write_text(f'"""Of one thing."""\n\n{importing}\n')
    return subprocess.run([sys.executable, CHECK, "test_other.py", name], cwd=folder, capture_output=True, text=True)


@pytest.mark.parametrize("importing", [
    "from .test_other import figures",
    "from folder.test_other import figures",
    "from . import bundles, test_other",
    "import folder.test_other as other",
    "def test_it():\n    from .test_other import figures",
])
@pytest.mark.parametrize("name", ["test_one.py", "helper.py"])
def test_a_test_module_that_is_imported_is_named(tmp_path, importing, name):
    result = check(tmp_path, importing, name)
    assert result.returncode == 1 and result.stdout.startswith(f"{name}:") and "test_other is a test module" in result.stdout


@pytest.mark.parametrize("importing", ["from .other import test_data", "from . import bundles", "from parts import test_data"])
def test_what_is_none_passes(tmp_path, importing):
    result = check(tmp_path, importing)
    assert result.returncode == 0 and not result.stdout


def test_nothing_to_look_at_is_no_pass():
    assert subprocess.run([sys.executable, CHECK]).returncode == 1
