"""A built release image: build/image/<board>, or IMAGE_OUT=<dir> for one that was built elsewhere."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
BOARDS = sorted(path.name[len("odid_"):-len("_defconfig")] for path in (TOP / "configs").iterdir())


class Image:
    """What Buildroot left, and the slot's files."""

    def __init__(self, board, out, root):
        self.board, self.out, self.root = board, out, root
        self.images = out / "images"

    def files(self):
        return [path for path in sorted(self.root.rglob("*")) if path.is_file() and not path.is_symlink()]

    def name(self, path):
        return f"/{path.relative_to(self.root)}"


def call(*words, **options):
    return subprocess.run([str(word) for word in words], check=True, capture_output=True, text=True, **options).stdout


def out_of(board):
    named = os.environ.get("IMAGE_OUT")
    if not named:
        return TOP / "build/image" / board
    out = Path(named).resolve()
    text = (out / ".config").read_text(encoding="utf-8")
    return out if f'BR2_ROOTFS_POST_SCRIPT_ARGS="{board}"' in text else None


@pytest.fixture(name="image", scope="session", params=BOARDS)
def built_image(request, tmp_path_factory):
    out = out_of(request.param)
    if out is None or not (out / "images/rootfs.squashfs").exists():
        pytest.skip(f"no image for {request.param} is built: make image BOARD={request.param}")
    if not shutil.which("unsquashfs"):
        pytest.skip("unsquashfs isn't installed (Debian: squashfs-tools)")
    if os.geteuid() != 0:
        pytest.skip("owners and modes of an unpacked root need root")
    root = tmp_path_factory.mktemp(request.param) / "root"
    call("unsquashfs", "-quiet", "-no-progress", "-dest", root, out / "images/rootfs.squashfs")
    yield Image(request.param, out, root)
    shutil.rmtree(root)
