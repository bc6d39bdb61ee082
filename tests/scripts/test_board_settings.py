"""/lib/odid/board-settings: odid.conf's [board] keys on their way to the boot loader."""

# U-Boot's environment in a file, one line a variable, as libubootenv's programs see it; where it can't be read, the file that -f
# names, or /etc/u-boot-initial-env, instead.
BUILT_IN = """#!/bin/sh
built_in=/etc/u-boot-initial-env
[ "$1" != -f ] || { built_in=$2; shift 2; }
[ ! -e /unreadable ] || cp "$built_in" /environment 2>/dev/null || exit 243
"""
PRINTENV = BUILT_IN + """
sed -n "s/^$2=//p" /environment | grep . || { echo "no $2" >&2; exit 1; }
"""
SETENV = BUILT_IN + """
echo fw_setenv >>/calls
[ ! -e /read-only ] || exit 1
while IFS= read -r line; do
    [ -n "$line" ] || continue
    grep -v "^${line%%=*}=" /environment >/new
    echo "$line" >>/new
    mv /new /environment
done <"$2"
"""
DEFAULTS = {"board__antenna": "internal", "board__usb": "host", "board__uarts": "", "board__console": "off"}


def run(one, environment="slot=a\n", **changed):
    for name, text in (("fw_printenv", PRINTENV), ("fw_setenv", SETENV)):
        one.write(f"usr/bin/{name}", text)
        (one.root / "usr/bin" / name).chmod(0o755)
    if environment is not None:
        one.write("environment", environment)
        one.write("run/fw_env.config", "place\n")
    one.settings(**DEFAULTS | changed)
    return one.run("/lib/odid/board-settings")


def test_defaults_are_not_written(appliance):
    assert run(appliance).returncode == 0
    assert appliance.calls() == [] and appliance.fault("board") is None


def test_a_change_is_written_once_and_said_until_the_next_power_on(appliance):
    assert run(appliance, board__uarts="uart3 uart5", board__usb="gadget").returncode == 0
    lines = appliance.read("environment").splitlines()
    assert sorted(lines) == ["board_antenna=internal", "board_console=off", "board_uarts=uart3 uart5",
                             "board_usb=gadget", "slot=a"]
    assert "switch the power off and on" in appliance.fault("board")
    (appliance.root / "run/faults/board").unlink()
    run(appliance, environment=appliance.read("environment"), board__uarts="uart3 uart5", board__usb="gadget")
    assert appliance.calls() == ["fw_setenv"] and appliance.fault("board") is None
    run(appliance, environment=appliance.read("environment"))      # back to the defaults
    assert "board_uarts=" in appliance.read("environment").splitlines()
    assert appliance.calls() == ["fw_setenv"] * 2


def test_an_environment_that_can_not_be_written_is_a_fault(appliance):
    appliance.write("read-only", "")
    assert run(appliance, board__antenna="external").returncode == 1
    assert "can't be written" in appliance.fault("board")


def test_an_environment_that_can_not_be_read_is_not_written(appliance):
    """One unreadable copy of two, and fw_printenv's and fw_setenv's was the built-in one: the board went back to the first slot."""
    appliance.write("etc/u-boot-initial-env", "slot=a\n")
    appliance.write("unreadable", "")
    assert run(appliance, environment="slot=b\n", board__antenna="external").returncode == 1
    assert "can't be written" in appliance.fault("board") and appliance.read("environment") == "slot=b\n" and not appliance.calls()


def test_an_environment_that_is_not_found_is_a_fault(appliance):
    appliance.change("lib/odid/board-settings", ("sleep 1", ":"))
    assert run(appliance, environment=None).returncode == 1
    assert "can't be read" in appliance.fault("board")


def test_one_that_is_known_not_to_be_readable_is_not_waited_for(appliance):
    """Each setting that was saved took a minute, in which the page answered nothing."""
    appliance.change("lib/odid/board-settings", ("sleep 1", "exit 9"))
    appliance.write("run/faults/environment", "It can't be read.\n")
    assert run(appliance, environment=None).returncode == 1
    assert "can't be read" in appliance.fault("board")
