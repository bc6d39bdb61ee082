"""The Buildroot layer and what makes the disk of it, as far as that can be checked without building.

BUILDROOT_DIR=<dir>: with a Buildroot there, also what only Buildroot itself can say.
"""

import json
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parent.parent
LAYER, OVERLAY, COMMON = TOP / "br2-external", TOP / "overlay", TOP / "board/common"
BOARDS = ("qemu", "cm4")
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


# --- configurations -----------------------------------------------------------------


def test_boards_differ_only_where_they_do():
    qemu, cm4 = (defconfig(board).partition(MARK)[2] for board in BOARDS)
    assert qemu and qemu == cm4


def fragments():
    return [*(f"configs/odid_{board}_defconfig" for board in BOARDS), "board/common/busybox.fragment",
            "board/common/swupdate.fragment", *(f"board/{board}/{part}.fragment" for board in ("common", *BOARDS) for part in ("linux", "u-boot"))]


@pytest.mark.parametrize("file", fragments())
def test_each_line_is_an_option_or_a_comment(file):
    prefix = "BR2_" if "defconfig" in file else "CONFIG_"
    for line in read(file).splitlines():
        match = OPTION.match(line)
        if not match:
            assert not line or re.match(r"#( |$)", line), line
            assert " is not set" not in line, line
            continue
        assert match[1].startswith(prefix), line
        assert match[2] is None or re.fullmatch(r'y|m|-?\d+|0x[0-9a-fA-F]+|"[^"]*"', match[2]), line


@pytest.mark.parametrize("board", BOARDS)
def test_every_option_is_set_once(board):
    for part in ("linux", "u-boot"):
        names = [name for folder in ("common", board)
                 for name, _ in options(read(f"board/{folder}/{part}.fragment"))]
        assert len(names) == len(set(names))
    for file in (f"configs/odid_{board}_defconfig", "board/common/busybox.fragment", "board/common/swupdate.fragment"):
        names = [name for name, _ in options(read(file))]
        assert len(names) == len(set(names))


@pytest.mark.parametrize("board", BOARDS)
def test_files_that_a_defconfig_names_are_there(board):
    found = re.findall(r"\$\(BR2_EXTERNAL_ODID_PATH\)/([^ \"]+)", defconfig(board))
    assert found
    assert not [name for name in found if not (LAYER / name).exists()]


def test_emulated_radios_are_in_no_released_kernel():
    assert "HWSIM" in read("board/qemu/linux.fragment")
    for folder in ("common", "cm4"):
        assert "HWSIM" not in read(f"board/{folder}/linux.fragment")


def test_nobody_has_a_password():
    for board in BOARDS:
        values = dict(options(defconfig(board)))
        assert values["BR2_TARGET_ENABLE_ROOT_LOGIN"] is None and values["BR2_TARGET_GENERIC_GETTY"] is None
        assert "BR2_TARGET_GENERIC_ROOT_PASSWD" not in values
    for line in read("board/common/users.txt").splitlines():
        if line and not line.startswith("#"):
            assert line.split()[4] in ("*", "!"), line


def test_ssh_asks_nobody_who_a_stranger_is():
    """It asked a name server before its first word: without an answer whoever came in waited, and strangers' places were held longer."""
    for board in BOARDS:
        assert dict(options(defconfig(board)))["BR2_PACKAGE_DROPBEAR_DISABLE_REVERSEDNS"] == "y"


def test_an_option_that_did_not_survive_is_found(tmp_path):
    got, wanted, check = tmp_path / "got", tmp_path / "wanted", COMMON / "check-config.sh"
    got.write_text('CONFIG_A=y\n# CONFIG_B is not set\nCONFIG_S="x y"\n')
    wanted.write_text('CONFIG_A=y\n# CONFIG_B is not set\n# CONFIG_GONE is not set\nCONFIG_S="x y"\n')
    must(check, "test", got, wanted)
    for lost in ("CONFIG_B=y", "# CONFIG_A is not set", "CONFIG_UNKNOWN=m", 'CONFIG_S="x"'):
        wanted.write_text(lost + "\n")
        result = call(check, "test", got, wanted)
        assert result.returncode == 1 and lost in result.stderr
    assert call(check, "test", tmp_path / "none", wanted).returncode == 1


def test_options_of_one_s_own_replace_the_defconfig_s(tmp_path):
    files = {"defconfig": '# A comment.\nBR2_A="theirs"\nBR2_B=y\nBR2_C=y\n',
             "layer": 'BR2_A="the layer\'s"\nBR2_D=y\n', "machine": 'BR2_A="mine"\n# BR2_B is not set\n'}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    merge, names = COMMON / "merge-config.sh", [tmp_path / name for name in files]
    assert must(merge, names[0]) == files["defconfig"]
    assert options(must(merge, *names)) == [("BR2_C", "y"), ("BR2_D", "y"), ("BR2_A", '"mine"'), ("BR2_B", None)]


# --- recipes ------------------------------------------------------------------------


def variables(package):
    """{name without the package's prefix: value}."""
    prefix = package.upper().replace("-", "_")
    text = read(f"br2-external/package/{package}/{package}.mk").replace("\\\n", " ")
    found = dict(re.findall(rf"^{prefix}_(\w+) = ?(.*)$", text, re.M))
    for _ in range(3):
        found = {name: re.sub(rf"\$\({prefix}_(\w+)\)", lambda match: found.get(match[1], match[0]), value)
                 for name, value in found.items()}
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_a_recipe_has_its_form(package):
    folder = LAYER / "package" / package
    recipe, menu = ((folder / name).read_text(encoding="utf-8") for name in (f"{package}.mk", "Config.in"))
    assert recipe.startswith(f"{'#' * 80}\n#\n# {package}\n#\n{'#' * 80}\n\n")
    assert re.search(r"\n\$\(eval \$\((generic|cmake|meson|autotools)-package\)\)\n$", recipe)
    assert menu.startswith(f'config BR2_PACKAGE_{package.upper().replace("-", "_")}\n\tbool "{package}"\n')
    assert "\n\thelp\n\t  " in menu
    assert f'source "$BR2_EXTERNAL_ODID_PATH/package/{package}/Config.in"\n' in read("br2-external/Config.in")
    made = variables(package)
    assert made["LICENSE"] and made["LICENSE_FILES"] and made["VERSION"]


@pytest.mark.parametrize("package", [name for name in PACKAGES if name != "odid-daemon"])
def test_what_a_recipe_fetches_is_pinned(package):
    made = variables(package)
    hashes = {}
    for line in read(f"br2-external/package/{package}/{package}.hash").splitlines():
        if line and not line.startswith("#"):
            kind, value, name = line.split("  ")
            assert kind == "sha256" and re.fullmatch("[0-9a-f]{64}", value), line
            hashes[name] = value
    for name in made["LICENSE_FILES"].split():
        assert name in hashes, f"{name}: a licence that changes must not go unnoticed"
    if made.get("SITE_METHOD") == "git":
        assert re.fullmatch("[0-9a-f]{40}", made["VERSION"]), "a branch or tag can move"
        archive = f"{package}-{made['VERSION']}-git"
    else:
        archive = made["SOURCE"]
    assert any(name.startswith(archive) for name in hashes), f"no hash of {archive}"
    assert re.match(r"https?://|\$\(BR2_KERNEL_MIRROR\)/", made["SITE"])


@pytest.mark.parametrize("board", BOARDS)
def test_patches_are_taken(board):
    assert 'BR2_GLOBAL_PATCH_DIR="$(BR2_EXTERNAL_ODID_PATH)/patches"\n' in defconfig(board)
    chosen = {name for name, value in options(defconfig(board)) if value == "y"}
    assert {f"BR2_PACKAGE_{path.name.upper().replace('-', '_')}" for path in (LAYER / "patches").iterdir()} <= chosen


@pytest.mark.parametrize("package", sorted(path.name for path in (LAYER / "patches").iterdir()))
def test_a_patch_has_its_form(package):
    """Numbered without a gap, what it is for, whether upstream has it; and the table says of each package that it has one."""
    patches = sorted((LAYER / "patches" / package).iterdir())
    assert [path.name[:5] for path in patches] == [f"{number:04}-" for number in range(1, len(patches) + 1)]
    for path in patches:
        head, _, changes = path.read_text(encoding="utf-8").partition("\n---\n")
        assert re.fullmatch(r"From: [^\n]+\nSubject: \[PATCH\] [^\n]+\n\n.+\n\nUpstream: [^\n]+\nSigned-off-by: [^\n]+", head, re.S), path
        files = re.findall(r"^diff --git a/(\S+) b/\1\n--- a/\1\n\+\+\+ b/\1\n@@ ", changes, re.M)
        assert files and len(files) == changes.count("diff --git"), path
        assert path.suffix == ".patch" and not re.search("^index ", changes, re.M), path
    row = re.search(rf"^\| [^|]*`{package}`.*$", read("docs/building.md"), re.M)
    assert "patch" in row[0]


def test_the_router_that_ships_refuses_what_could_hide_a_frame():
    """That it does is held against it where one was built so: tests/bench/guest/test_relay.py."""
    said = "".join(path.read_text(encoding="utf-8") for path in (LAYER / "patches/mavlink-router").iterdir())
    for line in ("incompat_flags & ~MAVLINK_IFLAG_SIGNED", "msg_entry == nullptr", "flush_pending_msgs() == -EAGAIN", "errno != EPERM",
                 "_comp_ids[sysid & 0xff].any()", "!_is_configured(sender)"):
        assert re.search(rf"^\+.*{re.escape(line)}", said, re.M), line


def test_recipes_are_in_order():
    listed = re.findall(r"package/([^/]+)/Config.in", read("br2-external/Config.in"))
    assert listed == PACKAGES


def test_each_selected_package_of_the_layer_is_there():
    symbols = {f"BR2_PACKAGE_{name.upper().replace('-', '_')}" for name in PACKAGES}
    chosen = {name for name, value in options(defconfig("cm4")) if value == "y"} & symbols
    for _ in PACKAGES:
        for symbol in list(chosen):
            package = symbol.removeprefix("BR2_PACKAGE_").lower().replace("_", "-")
            chosen |= set(re.findall(r"select (\w+)", read(f"br2-external/package/{package}/Config.in"))) & symbols
    assert chosen == symbols, "a recipe that nothing selects"


# What scripts want of the kernel without naming a program for it.
KERNEL = {"lib/odid/update-stick": "USB_STORAGE BLK_DEV_SD VFAT_FS EXFAT_FS EXT4_FS", "etc/nftables.conf": "NF_TABLES_INET NFT_CT",
          "etc/sv/odid-web/run": "SYN_COOKIES",
          "etc/init.d/S01mounts": "CGROUPS MEMCG LRU_GEN TMPFS UNIX98_PTYS", "lib/odid/limited": "CFS_BANDWIDTH CGROUP_PIDS MEMCG"}


@pytest.mark.parametrize("script", KERNEL)
def test_the_kernel_has_what_scripts_want(script):
    assert (OVERLAY / script).exists()
    on = {name.removeprefix("CONFIG_") for name, value in options(read("board/common/linux.fragment")) if value in ("y", "m")}
    assert set(KERNEL[script].split()) <= on


# What a board must have by what it is for; a driver that is missing fails on a real board only.
DRIVERS = {
    "autopilots": "USB_ACM USB_SERIAL_CH341 USB_SERIAL_CP210X USB_SERIAL_FTDI_SIO USB_SERIAL_PL2303",
    "wired networks on USB": "USB_RTL8152 USB_LAN78XX USB_NET_AX8817X USB_NET_AX88179_178A USB_NET_CDCETHER USB_NET_CDC_NCM "
                             "USB_NET_CDC_MBIM USB_NET_QMI_WWAN USB_NET_RNDIS_HOST USB_NET_SMSC95XX",
    "the filter": "NF_TABLES_INET NF_CONNTRACK NFT_CT NFT_LIMIT",
    "hardening": "SECCOMP STACKPROTECTOR_STRONG FORTIFY_SOURCE HARDENED_USERCOPY SLAB_FREELIST_HARDENED INIT_ON_ALLOC_DEFAULT_ON "
                 "INIT_STACK_ALL_ZERO VMAP_STACK RANDOMIZE_BASE UNMAP_KERNEL_AT_EL0 STRICT_KERNEL_RWX STRICT_MODULE_RWX "
                 "SECURITY_DMESG_RESTRICT",
}
CM4_DRIVERS = {
    "radios": "BRCMFMAC BRCMFMAC_SDIO BT_HCIUART_SERDEV BT_HCIUART_BCM BT_HCIBTUSB SERIAL_DEV_BUS",
    "its USB in both roles, and on PCIe": "USB_DWC2 USB_DWC2_DUAL_ROLE USB_CONFIGFS USB_CONFIGFS_NCM USB_CONFIGFS_ACM PCIE_BRCMSTB "
                                          "USB_XHCI_HCD USB_XHCI_PCI",
    "card and network": "MMC_SDHCI_IPROC MMC_BCM2835 BCMGENET",
    "memory its devices reach": "ZONE_DMA ZONE_DMA32",
    "watchdog and sensors": "BCM2835_WDT SENSORS_RASPBERRYPI_HWMON BCM2711_THERMAL",
    "clocks, power and pins of the firmware": "RASPBERRYPI_FIRMWARE CLK_BCM2835 CLK_RASPBERRYPI RASPBERRYPI_POWER GPIO_RASPBERRYPI_EXP "
                                              "RESET_RASPBERRYPI",
}


def test_a_boot_that_hangs_is_a_restart():
    """Without a limit the kernel would feed the boot loader's watchdog for an init that never gets anywhere."""
    limits = dict(options(read("board/common/linux.fragment")))
    assert limits["CONFIG_WATCHDOG_HANDLE_BOOT_ENABLED"] == "y"
    assert 0 < int(limits.get("CONFIG_WATCHDOG_OPEN_TIMEOUT", 0)) <= 60


@pytest.mark.parametrize("board, what", [("qemu", what) for what in DRIVERS] + [("cm4", what) for what in DRIVERS | CM4_DRIVERS])
def test_the_kernel_has_what_the_board_is_for(board, what):
    fragments = read("board/common/linux.fragment") + read(f"board/{board}/linux.fragment")
    on = {name.removeprefix("CONFIG_") for name, value in options(fragments) if value in ("y", "m")}
    assert not set((DRIVERS | CM4_DRIVERS)[what].split()) - on


def test_the_first_volume_holds_what_the_boot_rom_and_its_settings_name():
    settings = dict(re.findall(r"^(\w+)=(.*)$", read("board/cm4/config.txt"), re.M))
    files = {line.rpartition("/")[2] for line in read("board/cm4/boot-files").splitlines() if line and not line.startswith("#")}
    # With the smallest share for the screen the boot ROM takes the firmware without one.
    kind = "4cd" if settings.get("gpu_mem") == "16" else "4"
    assert {settings["kernel"], settings["device_tree"], f"start{kind}.elf", f"fixup{kind}.dat"} <= files


# --- overlay/ and what the image brings ----------------------------------------------

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


def commands(text):
    """Words in the place of a command; a rough reading of the shell that is enough for ours."""
    text = re.sub(r"\\\n", " ", text)
    text = re.sub(r"<<-?'?(\w+)'?([^\n]*)\n.*?\n\1\n", r"\2\n", text, flags=re.S)
    text = re.sub(r"'[^']*'", "''", text)                               # awk and sed have words of their own
    text = re.sub(r"(^|\s)#[^\n]*", r"\1", text)
    text = re.sub(r"\$\(\((?:[^()]|\([^()]*\))*\)\)", "0", text)          # arithmetic
    text = re.sub(r'"(?:[^"$\\]|\\.|\$(?!\())*"', '""', text)           # of strings only the commands in them
    inner = [command for string in re.findall(r'"[^"]*"', text) for command in re.findall(r"\$\([^)]*\)", string)]
    text = "\n".join([re.sub(r'"[^"]*"', '""', text), *inner])
    text = re.sub(r"\$\{[^}]*\}", "X", text)
    text = re.sub(r"^\s*[^\s()]+( \| [^\s()]+)*\)", ";", text, flags=re.M)  # patterns of case
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
            if text.startswith(b"#!/bin/sh") or path == OVERLAY / "lib/odid/functions":
                yield path, text.decode()


def defined(text):
    return set(re.findall(r"^\s*(\w+)\(\) [{(]", text, re.M))


def test_the_reading_of_the_shell_finds_a_program():
    script = 'a && nice -n 5 one x | two\n[ -n "$(three y)" ] || exec timeout 3 four\nfor i in no no; do five $i; done\n'
    assert commands(script) - {"a", "["} >= {"one", "two", "three", "four", "five"}
    assert "no" not in commands(script)
    assert {"sh", "mdev", "runsv"} <= provided() and "gcc" not in provided()


def test_programs_that_scripts_call_are_in_the_image():
    shared = defined(read("overlay/lib/odid/functions"))
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


# --- what Buildroot calls: the root completed, the disk made --------------------------


def bare_target(folder):
    """A root as Buildroot hands it to post-build.sh."""
    shutil.copytree(OVERLAY, folder, symlinks=True)
    (folder / "etc/passwd").write_text("root:x:0:0:root:/root:/bin/sh\nwww-data:x:33:33::/var/www:/bin/false\n")
    (folder / "etc/shadow").write_text("root:*:::::::\nwww-data:*:::::::\n")
    (folder / "etc/init.d/S50theirs").write_text("#!/bin/sh\n")
    return folder


def firmware(target, board):
    listing = TOP / f"board/{board}/firmware-files"
    names = [line for line in listing.read_text().splitlines() if line and not line.startswith("#")]
    for name in [*names, "brcm/other.bin"]:
        (target / "lib/firmware" / name).parent.mkdir(parents=True, exist_ok=True)
        (target / "lib/firmware" / name).write_text(name)
    return names


def post_build(target, board, images):
    images.mkdir(exist_ok=True)
    trusted = images.parent / "trusted.pem"
    trusted.write_text("a certificate\n")
    return call(COMMON / "post-build.sh", target, board, BINARIES_DIR=str(images), SOURCE_DATE_EPOCH=EPOCH,
                ODID_BUILD_TIME="1795000000", ODID_TRUSTED=str(trusted))


@needs("mkimage")
def test_the_root_is_completed(tmp_path):
    target, images = bare_target(tmp_path / "target"), tmp_path / "images"
    names = firmware(target, "cm4")
    (images).mkdir()
    (images / "odid-cm4.dtb").write_text("tree")
    for _ in range(2):          # Buildroot calls it again on the same root
        result = post_build(target, "cm4", images)
        assert result.returncode == 0, result.stderr
        (target / "etc/odid-release").write_text(read("overlay/etc/odid-release"))
    result = post_build(target, "cm4", images)
    release = (target / "etc/odid-release").read_text()
    assert "BOARD=cm4" in release and "BUILD_TIME=1795000000" in release and "@" not in release
    assert f"VERSION={(target / 'etc/odid/version').read_text().strip()}\n" in release
    assert (target / "etc/swupdate/trusted.pem").read_text() == "a certificate\n"
    assert (target / "etc/u-boot-initial-env").read_text() == read("board/cm4/u-boot.env")
    assert sorted(path.name for path in (target / "etc/init.d").iterdir()) == sorted(
        path.name for path in (OVERLAY / "etc/init.d").iterdir())
    assert (target / "etc/passwd").read_text().split(":")[0] == "root" and "www-data" not in (
        target / "etc/shadow").read_text()
    assert (target / "boot/board.dtb").read_text() == "tree"
    assert b"fdtcontroladdr" in (target / "boot/board.scr").read_bytes()
    found = {str(path.relative_to(target / "lib/firmware")) for path in (target / "lib/firmware").rglob("*")
             if path.is_file()}
    assert found == set(names)


@needs("mkimage")
def test_firmware_that_no_package_brought_is_an_error(tmp_path):
    target = bare_target(tmp_path / "target")
    names = firmware(target, "cm4")
    (target / "lib/firmware" / names[-1]).unlink()
    result = post_build(target, "cm4", tmp_path / "images")
    assert result.returncode == 1 and names[-1] in result.stderr


def test_a_service_of_another_layer_is_supervised(tmp_path):
    target = bare_target(tmp_path / "target")
    run = target / "etc/sv/camera/run"
    run.parent.mkdir()
    run.write_text("#!/bin/sh\n")
    result = post_build(target, "qemu", tmp_path / "images")
    assert result.returncode == 1 and "/etc/sv/camera/run" in result.stderr, "it can't be run"
    run.chmod(0o755)
    for _ in range(2):
        assert post_build(target, "qemu", tmp_path / "images").returncode == 0
    lines = (target / "etc/inittab").read_text().splitlines()
    assert lines.count("::respawn:/usr/bin/runsv /run/service/camera") == 1
    assert sum(line.endswith(" /run/service/odid-daemon") for line in lines) == 1
    assert os.readlink(run.parent / "finish") == "/lib/odid/finish"


DISK_TOOLS = ("genimage", "mkimage", "mkenvimage", "mke2fs", "mkfs.fat", "mcopy", "mdir", "mksquashfs", "sfdisk", "xxd")


def make_disk(folder, board):
    """images/disk.img of a slot that holds one file."""
    images = folder / "images"
    (images / "rpi-firmware").mkdir(parents=True)
    (folder / "root").mkdir()
    (folder / "root/file").write_text("content")
    must("mksquashfs", folder / "root", images / "rootfs.squashfs", "-quiet", "-no-progress", "-all-time", "0",
         "-mkfs-time", "0", "-all-root")
    for name in ("rpi-firmware/start4.elf", "rpi-firmware/fixup4.dat", "odid-cm4.dtb", "u-boot.bin"):
        (images / name).write_text(name)
    must(COMMON / "post-image.sh", images, board, BUILD_DIR=str(folder), SOURCE_DATE_EPOCH=EPOCH,
         PATH=os.environ["PATH"] + ":/usr/sbin:/sbin")
    return images / "disk.img"


@needs(*DISK_TOOLS)
@pytest.mark.parametrize("board, on_boot", [
    ("qemu", {"boot.scr"}),
    ("cm4", {"boot.scr", "config.txt", "start4.elf", "fixup4.dat", "odid-cm4.dtb", "u-boot.bin"}),
])
def test_the_disk(tmp_path, board, on_boot):
    disk = make_disk(tmp_path / "one", board)
    table = json.loads(must("sfdisk", "--json", disk, PATH=os.environ["PATH"] + ":/usr/sbin:/sbin"))["partitiontable"]
    assert (table["label"], table["id"]) == ("dos", "0x0d1d2024")
    places = {int(entry["node"].removeprefix(str(disk))): entry for entry in table["partitions"]}
    assert sorted(places) == [1, 2, 3, 5, 6, 7, 8]
    assert places[1]["bootable"] and places[1]["type"] == "c", "the boot ROM wants FAT first"
    assert all(entry["start"] % 2048 == 0 for entry in places.values())

    def files(number):
        volume = f"{disk}@@{places[number]['start'] * 512}"
        return set(must("mdir", "-b", "-i", volume, "::").replace("::/", "").split())
    assert files(1) == on_boot
    assert files(2) == {"odid.conf.example"}
    assert files(5) == {"uboot.env", "uboot-redund.env"}

    def octets(number, length=None):
        with open(disk, "rb") as file:
            file.seek(places[number]["start"] * 512)
            return file.read(length or places[number]["size"] * 512)
    volume, copy = octets(5), (tmp_path / "one/disk-inputs/uboot.env").read_bytes()
    copies = [match.start() for match in re.finditer(re.escape(copy), volume)]
    assert len(copies) == 2 and not any(at % 4096 for at in copies), "writing one touches no sector of the other"
    assert octets(6, 4) == b"hsqs" and octets(6) == octets(7)
    assert octets(8, 1082)[1080:] == b"\x53\xef", "ext4"

    again = make_disk(tmp_path / "two-in-a-longer-path", board)
    assert disk.read_bytes() == again.read_bytes(), "the same inputs, the same bytes"


@needs(*DISK_TOOLS)
def test_a_boot_file_that_is_missing_is_an_error(tmp_path):
    images = tmp_path / "images"
    images.mkdir()
    must("mksquashfs", TOP / "configs", images / "rootfs.squashfs", "-quiet", "-no-progress")
    result = call(COMMON / "post-image.sh", images, "cm4", BUILD_DIR=str(tmp_path), SOURCE_DATE_EPOCH=EPOCH,
                  PATH=os.environ["PATH"] + ":/usr/sbin:/sbin")
    assert result.returncode == 1 and "start4.elf" in result.stderr


# --- what is handed on ----------------------------------------------------------------


def built(out, content=b"disk"):
    """What Buildroot leaves of an image."""
    for folder in ("images", "legal-info/licenses/a"):
        (out / folder).mkdir(parents=True)
    with open(out / "images/disk.img", "wb") as disk:
        disk.write(content)
        disk.truncate(1 << 20)
    for name in ("images/u-boot.bin", "legal-info/manifest.csv", "legal-info/licenses/a/COPYING", "sbom.json"):
        (out / name).write_text(name)
    (out / "root").mkdir()
    (out / "root/file").write_bytes(content)
    return out


@needs("bmaptool", "xz")
def test_the_release(tmp_path):
    out = built(tmp_path / "out")
    must(COMMON / "pack-release.sh", "qemu", out, "odid-qemu-1.0")
    release = out / "release"
    assert sorted(str(path.relative_to(release)) for path in release.rglob("*") if path.is_file()) == [
        "SHA256SUMS", "licences/a/COPYING", "licences/manifest.csv", "odid-qemu-1.0.img.bmap",
        "odid-qemu-1.0.img.xz", "odid-qemu-1.0.sbom.json", "u-boot.bin"]
    must("sh", "-c", f"cd {release} && sha256sum --quiet -c SHA256SUMS")
    assert len((release / "SHA256SUMS").read_text().splitlines()) == 6
    # Without a bill of materials it is a release all the same, and says so.
    (out / "sbom.json").unlink()
    assert "odid-qemu-1.0.sbom.json" in must(COMMON / "pack-release.sh", "qemu", out, "odid-qemu-1.0")
    assert len((release / "SHA256SUMS").read_text().splitlines()) == 5
    # What a technician does with it: only what the map names is written.
    must("bmaptool", "-q", "copy", release / "odid-qemu-1.0.img.xz", tmp_path / "card")
    assert (tmp_path / "card").read_bytes() == (out / "images/disk.img").read_bytes()
    assert "<MappedBlocksCount> 1 " in (release / "odid-qemu-1.0.img.bmap").read_text()


@needs("bmaptool", "xz", "unsquashfs")
def test_two_builds_are_compared(tmp_path):
    outs = [built(tmp_path / "one"), built(tmp_path / "two"), built(tmp_path / "three", b"other")]
    for out in outs:
        must("mksquashfs", out / "root", out / "images/rootfs.squashfs", "-quiet", "-no-progress", "-all-time", "0")
        must(COMMON / "pack-release.sh", "cm4", out, "odid-cm4-1.0")
    compare = COMMON / "compare-images.sh"
    assert "the same" in must(compare, outs[0], outs[1])
    result = call(compare, outs[0], outs[2])
    assert result.returncode == 1
    assert "  odid-cm4-1.0.img.xz\n" in result.stdout and "Files one/file and other/file differ" in result.stdout
    assert call(compare, outs[0], tmp_path / "none").returncode != 0


def test_what_is_missing_to_make_an_image_is_said(tmp_path):
    check = COMMON / "check-host.sh"
    result = call(check, "pi", tmp_path, tmp_path / "a b", PATH="/nowhere:" + os.environ["PATH"])
    assert result.returncode == 1
    assert "BOARD=pi" in result.stderr and "expected one of: cm4, qemu" in result.stderr
    assert "a space in its name" in result.stderr
    tools = tmp_path / "bin"
    tools.mkdir()
    for name in ("sh", "dirname", "mkdir", "df", "awk", "make"):
        (tools / name).symlink_to(shutil.which(name))
    result = call(check, "cm4", tmp_path, tmp_path / "out", PATH=str(tools))
    assert result.returncode == 1 and "bmaptool is not installed" in result.stderr
    assert "make is not installed" not in result.stderr


def test_each_build_needs_its_room(tmp_path):
    """make reproducible makes two: that the second has none is said before the first begins."""
    disk = tmp_path / "df"
    disk.write_text("#!/bin/sh\nprintf 'header\\n/dev/disk 0 0 16777216 0%% /\\n'\n")  # 16 GiB
    disk.chmod(0o755)

    def complaints(*outs):
        return call(COMMON / "check-host.sh", "cm4", tmp_path, *outs, PATH=f"{tmp_path}:{os.environ['PATH']}").stderr
    one, other = tmp_path / "one", tmp_path / "other"
    assert "GiB" not in complaints(one) and "20 GiB are needed" in complaints(one, other)
    (one / "built").write_text("")
    assert "GiB" not in complaints(one, other)


def program(path, text):
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def test_the_list_of_licences_is_taken_by_its_hash(tmp_path):
    """Whatever a server says under its name: the image is made without it, and what is missing is named."""
    (tmp_path / "utils").mkdir()
    (tmp_path / "utils/generate-cyclonedx").write_text('CYCLONEDX_VERSION = "1.6"\n')
    wget = tmp_path / "wget"
    wget.write_text('#!/bin/sh\nwhile [ "$1" != -O ]; do shift; done\necho "{}" >"$2"\n')
    wget.chmod(0o755)
    result = call(COMMON / "licence-names.sh", tmp_path, tmp_path, PATH=f"{tmp_path}:{os.environ['PATH']}")
    listing = tmp_path / "cyclonedx/spdx-1.6.schema.json"
    assert result.returncode == 1 and str(listing) in result.stderr and "expected baa9d3bd" in result.stderr
    assert not list(listing.parent.iterdir())
    (tmp_path / "utils/generate-cyclonedx").write_text('CYCLONEDX_VERSION = "1.7"\n')
    assert "another version" in call(COMMON / "licence-names.sh", tmp_path, tmp_path).stderr


@pytest.mark.parametrize("generate, made", [
    ('printf %s "$(cat)" >"$6"', True),
    ('echo half >"$6"; echo Traceback >&2; exit 1', False),
], ids=["made", "fails"])
def test_an_image_is_made_without_a_bill_of_materials(tmp_path, generate, made):
    """Buildroot's program is the last step of an hour: whatever becomes of it, the image is there."""
    bill, common = tmp_path / "sbom.json", tmp_path / "common"
    program(tmp_path / "utils/generate-cyclonedx", generate)
    program(common / "licence-names.sh", "exit 0")
    shutil.copy(COMMON / "bill-of-materials.sh", common)
    bill.write_text("of another build")
    result = call("sh", "-c", f"echo info | {common}/bill-of-materials.sh {tmp_path} {tmp_path} {tmp_path} odid-cm4 1.0")
    assert result.returncode == 0 and bill.exists() == made and not list(tmp_path.glob("*.part"))
    assert made or "the image goes without one" in result.stderr
    program(common / "licence-names.sh", "exit 1")
    assert call("sh", "-c", f"{common}/bill-of-materials.sh {tmp_path} {tmp_path} {tmp_path} a 1 </dev/null").returncode == 0
    assert not bill.exists()


# --- keys: by make itself, as who releases calls it -------------------------------------


def make_here(goal, **variables):
    alone = {name: "" for name in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
    return call("make", "-C", TOP, "--no-print-directory", goal, *(f"{name}={value}" for name, value in variables.items()), **alone)


def keys(folder, *certificates):
    """certificates: what images are to trust besides its own."""
    must(COMMON / "make-keys.sh", folder)
    with open(folder / "trusted.pem", "a", encoding="utf-8") as trusted:
        trusted.writelines((path / "signing.crt").read_text() for path in certificates)
    return folder


def slot_that_trusts(folder, trusted):
    version = re.search(r"^project.odid-daemon VERSION ([0-9.]+)", read("package/odid-daemon/CMakeLists.txt"), re.M)[1]
    for name, text in {"etc/odid/version": f"{version}\n", "etc/swupdate/trusted.pem": trusted.read_text()}.items():
        (folder / "root" / name).parent.mkdir(parents=True)
        (folder / "root" / name).write_text(text)
    must("mksquashfs", folder / "root", folder / "slot.img", "-quiet", "-no-progress")
    return folder / "slot.img"


@needs("mksquashfs", "unsquashfs", "openssl", "cpio", "make")
@pytest.mark.parametrize("image, signer, made", [
    ("old", "old", True), ("both", "old", True),    # a rotation's first step: signed by the old key, it brings both
    ("new", "new", True),                           # and its second
    ("old", "new", False), ("new", "old", False),   # KEYS= was forgotten, at one of the two
])
def test_no_bundle_brings_an_image_that_does_not_trust_its_key(tmp_path, image, signer, made):
    """After it the aircraft took no bundle of the fleet's any more, nor was there a way back to that key."""
    old, new = keys(tmp_path / "old"), keys(tmp_path / "new")
    keys(tmp_path / "both", old, new)
    bundle = tmp_path / "x.swu"
    result = make_here("bundle", SLOT=slot_that_trusts(tmp_path, tmp_path / image / "trusted.pem"),
                       KEYS=tmp_path / signer, BOARD="qemu", BUNDLE=bundle)
    assert (result.returncode == 0) == bundle.exists() == made, result.stderr
    assert made or f"does not trust {tmp_path / signer}/signing.crt" in result.stderr and "make image KEYS=" in result.stderr


@needs("openssl", "make")
def test_a_folder_of_keys_that_was_mistyped_gets_no_new_pair(tmp_path):
    """An image of a key that nobody keeps was the result. Who builds images has trusted.pem alone."""
    for goal in ("keys", "keys-named"):
        result = make_here(goal, KEYS=tmp_path / "none")
        assert result.returncode != 0 and f"there is no {tmp_path}/none/trusted.pem" in result.stderr
    assert not (tmp_path / "none").exists()
    keys(tmp_path / "builder")
    for name in ("signing.key", "signing.crt"):
        (tmp_path / "builder" / name).unlink()
    assert make_here("keys", KEYS=tmp_path / "builder").returncode == 0
    assert [path.name for path in (tmp_path / "builder").iterdir()] == ["trusted.pem"]


# --- with Buildroot -------------------------------------------------------------------

BUILDROOT = os.environ.get("BUILDROOT_DIR")
with_buildroot = pytest.mark.skipif(not BUILDROOT, reason="no BUILDROOT_DIR=<dir> was given")


def buildroot(out, *words):
    return must("make", "-s", "--no-print-directory", "-C", Path(BUILDROOT).resolve(), f"O={out}",
                f"BR2_EXTERNAL={LAYER}", *words, MAKEFLAGS="", SOURCE_DATE_EPOCH=EPOCH)


@pytest.fixture(name="configured", scope="session", params=BOARDS)
def configured_for_a_board(request, tmp_path_factory):
    out = tmp_path_factory.mktemp(request.param)
    buildroot(out, f"odid_{request.param}_defconfig")
    return request.param, out


# Debian's own Python has Debian's packages.
SYSTEM = "/usr/bin:" + os.environ["PATH"]


@with_buildroot
@pytest.mark.skipif(call("python3", "-c", "import magic, flake8", PATH=SYSTEM).returncode != 0,
                    reason="not installed: python3-magic or python3-flake8")
def test_check_package():
    files = [path for path in LAYER.rglob("*") if path.is_file()]
    files += [path for path in (TOP / "package/odid-daemon").iterdir() if path.suffix == ".mk" or path.name == "Config.in"]
    output = must(Path(BUILDROOT) / "utils/check-package", "--br2-external", *files, PATH=SYSTEM)
    assert "0 warnings generated" in output or output.strip() == ""


@with_buildroot
def test_a_defconfig_survives(configured):
    board, out = configured
    must(COMMON / "check-config.sh", "Buildroot", out / ".config", TOP / f"configs/odid_{board}_defconfig")


@with_buildroot
def test_the_swupdate_that_is_tried_is_the_release_s():
    """What tests/setup/swupdate.sh builds for this machine."""
    tried = re.search(r"^version=(\S+)$", (TOP / "tests/setup/swupdate.sh").read_text(), re.M)[1]
    assert f"SWUPDATE_VERSION = {tried}\n" in Path(BUILDROOT, "package/swupdate/swupdate.mk").read_text()


@with_buildroot
def test_a_list_without_ours_is_an_error(configured):
    board, out = configured
    if board != "cm4":
        pytest.skip("the same for both")
    theirs = (out / ".config").read_text()
    ours = re.search(r'^BR2_ROOTFS_USERS_TABLES="(.*)"$', theirs, re.M)[1]
    for value, refused in (("/theirs/users.txt", True), (f"{ours} /theirs/users.txt", False)):
        result = call("make", "-s", "-C", Path(BUILDROOT).resolve(), f"O={out}", f"BR2_EXTERNAL={LAYER}", "-n", "skeleton",
                      f'BR2_ROOTFS_USERS_TABLES="{value}"', MAKEFLAGS="")
        assert ("BR2_ROOTFS_USERS_TABLES" in result.stderr) == refused, result.stderr[-500:]


@with_buildroot
def test_locations_hashes_and_licences_are_complete(configured):
    _, out = configured
    lost = []
    for name, package in json.loads(buildroot(out, "show-info")).items():
        if package["type"] == "rootfs" or package["virtual"] or not package.get("downloads"):
            continue
        if package["type"] == "target" and not package.get("licenses"):
            lost.append((name, "licence"))
        hashes = "".join(Path(BUILDROOT, file).read_text() for file in package.get("hashes", []))
        for download in package["downloads"]:
            if any(uri.startswith("local") for uri in download.get("uris", [])):
                continue
            if not download.get("uris"):
                lost.append((name, "location"))
            if not re.search(rf"^sha(256|512) +[0-9a-f]+ +{re.escape(download['source'])}$", hashes, re.M):
                lost.append((name, "hash"))
    assert not lost
