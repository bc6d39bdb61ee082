"""A bundle on a USB stick; and back to what CONFIG says."""

import re

import pytest
from bench.disk import call
from bench.machine import configuration

from . import LONG, bundles
from .appliance import wait_for
from .bundles import NEWER
from .sticks import blank, plug, pull, stick

pytestmark = LONG


def exfat_stick(ready, name, *files):
    """Nothing on this machine writes that without being its root: the appliance's own driver does."""
    image, machine = blank(name, files), ready.machine
    call("mkfs.exfat", image)
    plug(machine, image, read_only=False)
    wait_for("what it says of the stick", lambda: "no bundle for odid-qemu" in machine.console_text())
    machine.must("mkdir /tmp/stick && mount -t exfat /dev/sda /tmp/stick")
    for file in files:
        machine.must(f"curl -sf -o /tmp/stick/{file.name} {ready.server.url(file)}")
    machine.must("umount /tmp/stick")
    pull(machine)
    return image


@pytest.mark.parametrize("kind", ["vfat", "exfat"])
def test_the_newest_that_fits_is_taken_once(ready, kind):
    """And where the stick stays in, it isn't installed again."""
    files = [bundles.bundle("good", NEWER), bundles.bundle("older", bundles.OLDER),
             bundles.bundle("cm4", "99.0.0", board="cm4")]
    plug(ready.machine, exfat_stick(ready, "several", *files) if kind == "exfat" else
         stick("several", *files))
    before = ready.starts()
    ready.wait_state("installing")
    ready.wait_restart(before)
    ready.machine.wait_on_air()
    ready.wait_state("trial")
    ready.wait_state("idle")
    assert ready.version() == NEWER
    said = wait_for("what it says of the stick", lambda: re.search(
        f"stick .*: Version {NEWER} is running already", ready.machine.console_text()), 60)
    assert said
    assert ready.result()["outcome"] == "installed"


def test_a_stick_without_a_bundle(ready):
    image = stick("nothing", bundles.bundle("cm4", NEWER, board="cm4"))
    plug(ready.machine, image)
    wait_for("what it says of the stick", lambda: "no bundle for odid-qemu" in ready.machine.console_text())
    assert ready.state() == "idle"
    assert ready.result() is None


@pytest.mark.parametrize("name, spoil, said", [
    ("factory_unreadable",
     "dd if=/dev/zero of=/dev/disk/odid/config bs=4096 count=16 conv=fsync", "CONFIG can't be read"),
    ("factory_wrong",
     "mount -t vfat /dev/disk/odid/config /run/config && echo '[wifi]' >>/run/config/odid.conf && "
     "echo 'channel = 99' >>/run/config/odid.conf && umount /run/config", "channel"),
], ids=["unreadable", "wrong"])
def test_no_factory_reset_while_config_cannot_be_read(make_appliance, name, spoil, said):
    """What is forgotten has to come back from there."""
    one = make_appliance(name)
    one.power_on()
    machine = one.machine
    machine.must("odidctl set self_id.description Changed")
    before, ssid = one.starts(), machine.must("cat /data/secrets/wifi_ssid")
    machine.must(f"{spoil} 2>&1")
    machine.shell.send("odidctl factory-reset")
    one.wait_restart(before)
    machine.wait_on_air()
    assert machine.must("odidctl get self_id.description basic_id.uas_id").split() == ["Changed", "SSRS5GBG01"]
    assert machine.must("cat /data/secrets/wifi_ssid") == ssid
    assert said in machine.must("cat /run/faults/config")
    assert machine.run("[ -e /data/odid/factory-reset ]").code


def test_factory_reset(make_appliance):
    one = make_appliance("factory", config={"odid.conf": configuration(
        self_id={"description": "As on CONFIG"}, maintenance={"password": "a-test-password"})})
    one.power_on()
    machine = one.machine
    machine.must("odidctl set self_id.description Changed")
    machine.must("odidctl set wifi.channel 11")
    machine.wait_on_air()
    machine.must("echo x >/data/secrets/other; echo 7 >/data/odid/vehicle; sync; ls /data/odid/flights/*")
    before, ssid = one.starts(), machine.must("cat /data/secrets/wifi_ssid")
    machine.shell.send("odidctl factory-reset")
    one.wait_restart(before)
    machine.wait_on_air()
    assert machine.must("odidctl get self_id.description").strip() == "As on CONFIG"
    assert machine.must("odidctl get wifi.channel").strip() == "6"
    assert machine.must("odidctl get basic_id.uas_id").strip() == "SSRS5GBG01"
    assert machine.must("cat /data/secrets/wifi_ssid") != ssid
    assert machine.run("cat /data/secrets/other /data/odid/vehicle /data/odid/factory-reset").code != 0
    assert machine.must("ls /data/odid/flights/*")
    machine.cut_power()
    one.power_on()
    machine.must("odidctl set self_id.description Again")
    machine.must("sync")
    machine.cut_power()
    machine.power_on()
    assert machine.must("odidctl get self_id.description").strip() == "Again"       # only once
