"""The layer's recipes and patches: their form, and that all they fetch is pinned."""

import re

import pytest

from .shared import BOARDS, LAYER, PACKAGES, defconfig, options, read


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
