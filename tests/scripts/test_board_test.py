"""odidctl board-test: what a technician answers, what the board says meanwhile, and what stands on CONFIG after it."""

import re

import pytest
from patience import wait_for

SCRIPT = "lib/odid/board-test"
ALL_SEEN = ("5", "5", "-45", "-50", "n", "y")
ON_AIR = "hci0 on-air 300\nwlan0 on-air 300\n"
# Device and driver, as driver-watch writes them down.
BOUND = {"wlan0": "/sys/devices/mmc1:0001:1 /sys/bus/sdio/drivers/brcmfmac", "hci0": "/sys/devices/serial0-0 /sys/bus/serial/drivers/hci_uart_bcm"}


@pytest.fixture
def tested(appliance):
    """A board on which all is well, whose minutes are short, and whose radios are back on the air as soon as their drivers were
    bound."""
    appliance.change("lib/odid/functions", ("[ -b /dev/disk/odid/config ]", "[ -e /config-is-there ]"), ("mount -t vfat", "true"))
    appliance.change(SCRIPT, ("umount /run/config", "[ -e /config-is-there ]"), ("pauses 60", "pauses 3"), ("pause 1", "[ ! -x /meanwhile ] || /meanwhile"),
                     ("timeout 65", "timeout 5"), ("/lib/odid/bind-anew", "/bind-anew"))
    appliance.write("config-is-there", "")
    appliance.write("radios", ON_AIR)
    appliance.write("bind-anew", '#!/bin/sh\necho "$*" >>/calls\nsed -i "s/on-air .*/on-air 0/" /radios\n')
    (appliance.root / "bind-anew").chmod(0o755)
    appliance.write("sys/class/thermal/thermal_zone0/temp", "61200\n")
    appliance.write("sys/class/hwmon/hwmon1/in0_lcrit_alarm", "0\n")
    for name, bound in BOUND.items():
        appliance.write(f"run/drivers/{name}/bound", bound + "\n")
    return appliance


def run(tested, *answers, steps=""):
    """How it ended, and CONFIG's report."""
    said = "\\n".join(answers)
    result = tested.run(f"printf '{said}\\n' | /{SCRIPT} {steps}")
    report = tested.root / "run/config/board-test.txt"
    return result, report.read_bytes().decode().replace("\r\n", "\n") if report.exists() else None


def test_all_five_are_right(tested):
    result, report = run(tested, *ALL_SEEN)
    assert result.returncode == 0, result.stdout + result.stderr
    assert "\n5 passed, 0 failed, 0 not seen.\n" in report
    assert "How many of the five does the receiver show over Wi-Fi (0-5)? 5\n" in report
    assert "hottest: 61 degrees Celsius; undervoltage: no\n" in report
    assert tested.calls() == [*BOUND.values()]
    assert "The report: board-test.txt, on the volume CONFIG." in result.stdout


@pytest.mark.parametrize("answers, failed", [
    (("3", *ALL_SEEN[1:]), 1),
    (("5", "0", *ALL_SEEN[2:]), 1),
    ((*ALL_SEEN[:2], "-81", *ALL_SEEN[3:]), 2),
    ((*ALL_SEEN[:3], "-76", *ALL_SEEN[4:]), 2),
    ((*ALL_SEEN[:4], "y", "y"), 3),
    ((*ALL_SEEN[:5], "n"), 5),
])
def test_what_the_receiver_does_not_show_has_failed(tested, answers, failed):
    result, report = run(tested, *answers)
    assert result.returncode == 1 and "\n4 passed, 1 failed, 0 not seen.\n" in report
    assert re.search(rf"\n{failed}\. (?:[^\n]+\n)+?  FAILED: ", report), report


@pytest.mark.parametrize("path, text, failed", [
    ("radios", "hci0 on-air 2\nwlan0 on-air 300\n", "34"),
    ("radios", "hci0 on-air 300\nwlan0 stuck 0\n", "345"),
    ("radios", "wlan0 on-air 300\n", "345"),
    ("sys/class/thermal/thermal_zone0/temp", "80000\n", "4"),
    ("sys/class/hwmon/hwmon1/in0_lcrit_alarm", "1\n", "4"),
    ("run/drivers/wlan0/bound", "", "5"),
    ("bind-anew", "#!/bin/sh\n", "5"),
    ("bind-anew", '#!/bin/sh\nsed -i "s/on-air .*/off 0/" /radios\n', "5"),
])
def test_what_the_board_itself_finds_has_failed_whatever_the_receiver_shows(tested, path, text, failed):
    tested.write(path, text)
    _, report = run(tested, *ALL_SEEN)
    assert "".join(re.findall(r"\n(\d)\. (?:[^\n]+\n)+?  FAILED: ", report)) == failed, report


def test_some_of_them_alone(tested):
    result, report = run(tested, "-45", "-50", "y", steps="2 5")
    assert result.returncode == 0 and "\n2 passed, 0 failed, 0 not seen.\n" in report and "\n1. " not in report
    for steps in ("6", "all", "12", "'1 2'", "''"):
        assert run(tested, steps=steps)[0].returncode == 2


def test_what_nobody_looks_at_is_not_passed(tested):
    result, report = run(tested)
    assert result.returncode == 1 and "\n1 passed, 0 failed, 4 not seen.\n" in report
    assert report.count("NOT SEEN: nobody looked at a receiver.") == 4


def test_an_answer_that_is_none_is_asked_for_again(tested):
    result, report = run(tested, "six", "55", "$(touch /pwned)", "*", *ALL_SEEN)
    assert result.returncode == 0 and "six" not in report and not tested.exists("pwned")
    assert result.stdout.count("That isn't among the answers") == 4


@pytest.mark.parametrize("said", ["armed once 1 said\n", "unknown never 0 unsaid\n", ""])
def test_an_aircraft_that_is_not_disarmed_is_left_alone(tested, said):
    tested.write("armed", said)
    result, report = run(tested, *ALL_SEEN)
    assert result.returncode == 1 and report is None and not tested.calls()
    assert result.stdout == "The aircraft isn't disarmed: no board test.\n"


def test_one_that_is_armed_meanwhile_ends_it_and_nothing_keeps_its_processors(tested):
    tested.write("meanwhile", '#!/bin/sh\n[ -s /run/.busy ] || { echo "$1" >/run/.busy; exit; }; echo "armed once 1 said" >/armed\n')
    tested.change(SCRIPT, ("/meanwhile\n", '/meanwhile "$busy"\n'), ("[ ! -x /meanwhile ]", '[ -z "$busy" ]'))
    (tested.root / "meanwhile").chmod(0o755)
    result, report = run(tested, *ALL_SEEN)
    assert result.returncode == 1 and not tested.calls()
    assert "The aircraft isn't disarmed any more: the test ends here." in report and "\n3 passed, 1 failed, 0 not seen.\n" in report
    for process in tested.read("run/.busy").split():
        wait_for("its end", lambda: tested.run(f"kill -0 {process}").returncode != 0)  # noqa: B023


@pytest.mark.parametrize("bind", ['echo "armed once 1 said" >/armed', 'sed -i "s/wlan0 on-air .*/wlan0 off 0/" /radios'])
def test_bluetooth_is_left_alone_where_somebody_arms_or_wi_fi_does_not_come_back(tested, bind):
    tested.write("bind-anew", f'#!/bin/sh\necho "$*" >>/calls\n{bind}\n')
    result, report = run(tested, *ALL_SEEN)
    assert result.returncode == 1 and tested.calls() == [BOUND["wlan0"]], report


def test_a_serial_port_is_no_radio_with_a_driver(tested):
    tested.write("radios", "h4:/dev/ttyS1 on-air 300\nhci1 on-air 300\nwlan0 on-air 300\n")
    tested.write("run/drivers/hci1/bound", BOUND["hci0"] + "\n")
    assert run(tested, *ALL_SEEN)[0].returncode == 0 and tested.calls() == [*BOUND.values()]


def test_without_config_the_report_is_kept(tested):
    (tested.root / "config-is-there").unlink()
    result, report = run(tested, *ALL_SEEN)
    assert report is None and "the volume CONFIG can't be written" in result.stdout
    assert "5 passed" in tested.read("run/board-test.txt")
