"""What is ours, cross-compiled: the daemon's package and the bench's own small programs."""

import os
import shutil
from pathlib import Path

from .steps import BUILD, call, step

CROSS = "aarch64-linux-gnu-"
# glibc's headers are the cross compiler's: the same version of Debian as the packages'.
FLAGS = ["-O2", "-Wall", "-Wextra", "-Werror", "-std=gnu11", "-s"]


@step
def daemon(out, sysroot, opendroneid, mavlink):
    """The daemon's package built."""
    work = (BUILD / "work/daemon").absolute()       # kept: only what changed is compiled again
    work.mkdir(parents=True, exist_ok=True)
    sysroot = Path(sysroot).absolute()
    toolchain = work / "toolchain.cmake"
    text = f"""set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER {CROSS}gcc)
set(CMAKE_C_FLAGS_INIT "-isystem {sysroot}/usr/include")
set(CMAKE_EXE_LINKER_FLAGS_INIT
    "-L{sysroot}/usr/lib/aarch64-linux-gnu -Wl,-rpath-link,{sysroot}/usr/lib/aarch64-linux-gnu")
set(CMAKE_C_FLAGS_RELEASE "-O2 -DNDEBUG" CACHE STRING "")
set(CMAKE_FIND_ROOT_PATH {sysroot})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
"""
    if not toolchain.exists() or toolchain.read_text(encoding="utf-8") != text:
        shutil.rmtree(work)
        work.mkdir()
        toolchain.write_text(text, encoding="utf-8")
    environment = os.environ | {
        "PKG_CONFIG_LIBDIR": f"{sysroot}/usr/lib/aarch64-linux-gnu/pkgconfig",
        "PKG_CONFIG_SYSROOT_DIR": str(sysroot), "PKG_CONFIG_PATH": "",
        "DESTDIR": str(out.absolute())}
    call("cmake", "-S", "package/odid-daemon", "-B", work, "-G", "Unix Makefiles",
         f"-DCMAKE_TOOLCHAIN_FILE={toolchain}", "-DCMAKE_BUILD_TYPE=Release",
         "-DCMAKE_INSTALL_PREFIX=/usr", "-DODID_WERROR=OFF",
         f"-DOPENDRONEID_DIR={Path(opendroneid).absolute()}",
         f"-DMAVLINK_DIR={Path(mavlink).absolute()}", env=environment)
    call("cmake", "--build", work, "-j", os.cpu_count(), env=environment)
    call("cmake", "--install", work, "--strip", env=environment)
    shutil.rmtree(out / "usr/share", ignore_errors=True)        # manuals


@step
def guest_programs(out, guest, mavlink):
    """The bench's own programs built."""
    for source in sorted(Path(guest).glob("*.c")):
        call(f"{CROSS}gcc", *FLAGS, "-isystem", mavlink, "-o", out / source.stem, source)
