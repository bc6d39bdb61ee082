"""BusyBox and U-Boot, from their sources. (In a file of their own: a change in it builds both again.)"""

import os
import shutil
from pathlib import Path

from .steps import BUILD, BuildError, call, step

CROSS = "aarch64-linux-gnu-"
MAKE = ["make", f"-j{os.cpu_count()}", "-s", f"CROSS_COMPILE={CROSS}"]
ENVIRONMENT = os.environ | {"SOURCE_DATE_EPOCH": "0", "KBUILD_BUILD_TIMESTAMP": "1970-01-01",
                            "KBUILD_BUILD_USER": "odid", "KBUILD_BUILD_HOST": "odid"}
BOARD = Path("board").absolute()


def unpacked(source, name):
    """The archive's contents, in a scratch folder outside the cache."""
    work = (BUILD / "work" / name).absolute()
    shutil.rmtree(work, ignore_errors=True)
    work.mkdir(parents=True)
    (archive,) = source.iterdir()
    call("tar", "-xf", archive, "-C", work, "--strip-components=1")
    return work


@step
def busybox(out, source):
    """BusyBox built."""
    work = unpacked(source, "busybox")
    environment = ENVIRONMENT | {"CROSS_COMPILE": CROSS}
    call(BOARD / "common/busybox-config.sh", cwd=work, env=environment)
    call(*MAKE, "busybox", "busybox.links", cwd=work, env=environment)
    for name in ("busybox", "busybox.links"):
        shutil.copy2(work / name, out)
    shutil.rmtree(work)


@step
def u_boot(out, source):
    """U-Boot built."""
    work = unpacked(source, "u-boot")
    fragments = [BOARD / "common/u-boot.fragment", BOARD / "qemu/u-boot.fragment"]
    wanted = "".join(path.read_text(encoding="utf-8") for path in fragments)
    wanted += f'CONFIG_DEFAULT_ENV_FILE="{BOARD}/qemu/u-boot.env"\n'
    defconfig = (work / "configs/qemu_arm64_defconfig").read_text(encoding="utf-8")
    (work / ".config").write_text(defconfig + wanted, encoding="utf-8")
    call(*MAKE, "olddefconfig", cwd=work, env=ENVIRONMENT)
    check_config((work / ".config").read_text(encoding="utf-8").splitlines(), wanted)
    call(*MAKE, "u-boot.bin", cwd=work, env=ENVIRONMENT)
    shutil.copy2(work / "u-boot.bin", out)
    shutil.rmtree(work)


def check_config(got, wanted):
    """A wish that kconfig dropped (a dependency, a new name) must not go unnoticed."""
    lost = []
    for line in wanted.splitlines():
        if line.startswith("CONFIG_") and line not in got:
            lost.append(line)
        elif line.startswith("# CONFIG_") and line.endswith(" is not set"):
            name = line.split()[1]
            if any(other.startswith(f"{name}=") for other in got):
                lost.append(line)
    if lost:
        raise BuildError("u-boot.fragment: U-Boot's configuration did not take over: "
                         + ", ".join(lost))
