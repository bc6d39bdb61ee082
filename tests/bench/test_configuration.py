"""Configuration files as people make them wrong, Windows and macOS among them: each gives a sentence that
helps, the last good configuration stays in force, and the aircraft broadcasts meanwhile."""

import re
from dataclasses import dataclass

import pytest

from .machine import configuration
from .technician import REPORT, Technician

GOOD = configuration()


@dataclass(frozen=True)
class Wrong:
    name: str
    files: dict
    says: tuple  # in the report, whatever the letters' case: regular expressions
    taken: bool = False  # the file is usable all the same
    uas_id: str = "SSRS5GBG01"  # in force then


def changed(old, new):
    assert old in GOOD
    return {"odid.conf": GOOD.replace(old, new)}


def added(section, line):
    return {"odid.conf": f"{GOOD}[{section}]\n{line}\n"}


WRONG = (
    # As editors and operating systems write them.
    Wrong("byte_order_mark", {"odid.conf": b"\xef\xbb\xbf" + GOOD.encode()}, ("byte.order mark",), taken=True),
    Wrong("utf16_little", {"odid.conf": GOOD.encode("utf-16")}, ("UTF-16",)),
    Wrong("utf16_big", {"odid.conf": b"\xfe\xff" + GOOD.encode("utf-16-be")}, ("UTF-16",)),
    Wrong("carriage_returns", {"odid.conf": GOOD.replace("\n", "\r\n")}, ("taken over|in force|accepted",), taken=True),
    Wrong("hidden_ending", {"odid.conf.txt": GOOD}, (r"odid\.conf\.txt", "name"), taken=True),
    Wrong("apple_double", {"._odid.conf": b"\0\5\x16\7" + bytes(60)}, (r"\._odid\.conf",)),
    Wrong("latin1", {"odid.conf": GOOD.replace("Sea rescue surveillance", "Räddning").encode("latin-1")}, ("UTF-8",)),
    Wrong("typographic_quotes", changed("uas_id = SSRS5GBG01", "uas_id = “SSRS5GBG01”"),
          ("uas_id", "line 2", "quotes"), taken=True),
    # Values.
    Wrong("decimal_comma", added("system", "operator_latitude = 57,7\noperator_longitude = 11,9"),
          ("operator_latitude", "57,7", "point")),
    Wrong("long_description", changed("Sea rescue surveillance", "Sjöräddning på väg åtta"), ("description", "23")),
    Wrong("latitude_range", added("system", "operator_latitude = 91\noperator_longitude = 11.9"),
          ("operator_latitude", "91", "90")),
    Wrong("channel_range", added("wifi", "channel = 36"), ("channel", "36", "expected")),
    Wrong("country", added("wifi", "country = Sweden"), ("country", "Sweden", "two")),
    Wrong("no_boolean", added("broadcast", "bt4_enabled = maybe"), ("bt4_enabled", "maybe", "true|yes")),
    Wrong("no_number", added("autopilot", "baud = fast"), ("baud", "fast")),
    Wrong("port_range", added("mavlink", "udp_port = 99999"), ("udp_port", "99999", "65535")),
    Wrong("short_password", added("maintenance", "password = short"), ("password", "8")),
    Wrong("operator_number", changed("SWE3jxza7qbzvu5d", "SWE123"), ("operator_id", "SWE123", "16"), taken=True),
    Wrong("serial_number", changed("SSRS5GBG01", "SSRS9GBG01"), ("uas_id", "SSRS9GBG01", "9"), taken=True,
          uas_id="SSRS9GBG01"),
    Wrong("category", changed("category = open", "category = public"), ("category", "public", "open")),
    Wrong("another_run_dir", added("daemon", "run_dir = /tmp/elsewhere\nuser = nobody"),
          ("run_dir = /tmp/elsewhere", "for the appliance"), taken=True),
    # The file's form.
    Wrong("wrong_section", changed("[basic_id]", "[basicid]"), ("basicid",)),
    Wrong("unknown_key", changed("uas_id =", "uasid ="), ("uasid",)),
    Wrong("no_section", {"odid.conf": "uas_id = SSRS5GBG01\n" + GOOD}, (r"belongs in \[basic_id\]", "line 1")),
    Wrong("no_equals", changed("uas_id = SSRS5GBG01", "uas_id SSRS5GBG01"), ("uas_id SSRS5GBG01|line 2|:2",)),
    Wrong("cut_short", {"odid.conf": GOOD[:GOOD.index("[system]") + 4]}, (r"\[sys",)),
    Wrong("twice", changed("uas_id = SSRS5GBG01", "uas_id = SSRS5GBG01\nuas_id = SSRS5GBG02"),
          ("uas_id", "line 3", "again"), taken=True, uas_id="SSRS5GBG02"),
    Wrong("zeroes", {"odid.conf": bytes(512)}, ("odid.conf",)),
    Wrong("empty", {"odid.conf": ""}, ("empty",)),
    Wrong("huge", {"odid.conf": GOOD + "; filler\n" * 60000}, ("large|long|big|size",)),
)


@pytest.fixture
def technician(grounded):
    one = Technician(grounded)
    one.puts({"odid.conf": GOOD})
    assert grounded.must("odidctl get basic_id.uas_id").strip() == "SSRS5GBG01"
    return one


@pytest.mark.parametrize("wrong", WRONG, ids=lambda wrong: wrong.name)
def test_wrong_in_one_way(technician, wrong):
    machine = technician.machine
    technician.puts(wrong.files)
    report = technician.report()
    for pattern in wrong.says:
        assert re.search(pattern, report, re.IGNORECASE), report
    assert machine.must("odidctl get basic_id.uas_id").strip() == wrong.uas_id
    refused = machine.run("cat /run/faults/config")
    assert (refused.code != 0) == wrong.taken, refused.output
    machine.wait_all_five(("bt4", "wifi"))


def test_the_volume_is_full(technician):
    """The report finds no place; the configuration is taken over all the same, and status says so."""
    machine = technician.machine
    technician.puts({"odid.conf": GOOD.replace("Sea rescue surveillance", "Full")},
                    "dd if=/dev/zero of=filler bs=64k 2>/dev/null")
    assert machine.must("odidctl get self_id.description").strip() == "Full"
    assert "No space" in machine.must("cat /run/faults/config")
    machine.wait_all_five(("bt4", "wifi"))
    machine.must("mkdir -p /tmp/config && mount -t vfat /dev/disk/odid/config /tmp/config; rm -f /tmp/config/filler; "
                 "umount /tmp/config")


def test_a_good_file_is_taken_over_at_power_on(make_machine):
    machine = make_machine("config-good")
    machine.power_on()
    machine.wait_on_air()
    assert machine.must("odidctl get basic_id.uas_id").strip() == "SSRS5GBG01"
    machine.cut_power()
    report = machine.disk.read_config(REPORT)
    assert report and b"odid.conf" in report


def test_a_wrong_file_at_power_on_is_refused_and_said(make_machine):
    machine = make_machine("config-wrong")
    machine.power_on()
    machine.wait_on_air()
    machine.must("sync")
    machine.cut_power()
    machine.disk.put_config(changed("uas_id =", "uasid ="))
    machine.power_on()
    machine.wait_on_air()
    assert machine.must("odidctl get basic_id.uas_id").strip() == "SSRS5GBG01"
    machine.wait_all_five(("bt4", "wifi"))
    machine.cut_power()
    assert b"uasid" in machine.disk.read_config(REPORT)
