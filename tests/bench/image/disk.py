"""The disk: its volumes and the table around them."""

import os
import re
import shutil
from pathlib import Path

from .steps import BuildError, call, step

COMMON = Path("board/common")
BOARD = Path("board/qemu")
EXAMPLE = Path("package/odid-daemon/odid.conf.example")
EPOCH = "1767225600"            # 2026-01-01: what the volumes' files are dated
ENVIRONMENT = os.environ | {"SOURCE_DATE_EPOCH": EPOCH, "E2FSPROGS_FAKE_TIME": EPOCH, "TZ": "UTC"}


def said_in(name, key):
    """The value that a file of the board's gives to that."""
    return re.search(rf"^{key}=(\S+)$", (COMMON / name).read_text(encoding="utf-8"), re.M).group(1)


@step
def disk(out, slot):
    """Disk made."""
    inputs, scratch = out / "inputs", out / "scratch"
    inputs.mkdir()
    shutil.copyfile(slot / "slot.img", inputs / "slot.img")
    shutil.copyfile(EXAMPLE, inputs / EXAMPLE.name)
    call("mkimage", "-A", "arm64", "-T", "script", "-C", "none", "-n", "boot", "-d",
         COMMON / "boot.cmd", inputs / "boot.scr", env=ENVIRONMENT)
    for name in ("uboot.env", "uboot-redund.env"):
        call("mkenvimage", "-r", "-s", said_in("u-boot.fragment", "CONFIG_ENV_SIZE"), "-o", inputs / name,
             BOARD / "u-boot.env")
    call("mke2fs", "-q", "-t", "ext4", "-L", "data", "-U", "0d1d2024-0000-4000-8000-000000000008",
         "-E", "hash_seed=0d1d2024-0000-4000-8000-000000000009,lazy_itable_init=0",
         inputs / "data.ext4", said_in("post-image.sh", "data_size"), env=ENVIRONMENT)
    for path in inputs.iterdir():
        os.utime(path, (int(EPOCH), int(EPOCH)))
    text = (COMMON / "genimage.cfg.in").read_text(encoding="utf-8")
    (out / "genimage.cfg").write_text(text.replace("@BOOT_FILES@", '"boot.scr"'), encoding="utf-8")
    (out / "empty").mkdir()
    call("genimage", "--config", out / "genimage.cfg", "--inputpath", inputs, "--outputpath", out,
         "--tmppath", scratch, "--rootpath", out / "empty", env=ENVIRONMENT)
    if not (out / "disk.img").exists():
        raise BuildError("genimage left no disk.img")
    for path in out.iterdir():
        if path.name != "disk.img":
            shutil.rmtree(path) if path.is_dir() else path.unlink()
