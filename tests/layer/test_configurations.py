"""The configurations of the boards, as text."""

import re

import pytest

from .shared import BOARDS, COMMON, LAYER, MARK, OPTION, call, defconfig, must, options, read


def test_boards_differ_only_where_they_do():
    same, = {defconfig(board).partition(MARK)[2] for board in BOARDS}
    assert same


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
    assert ["qemu"] == [folder for folder in ("common", *BOARDS) if "HWSIM" in read(f"board/{folder}/linux.fragment")]


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
