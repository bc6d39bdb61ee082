"""A bundle by the page over the networks that aren't Ethernet: the access point, and a computer's USB port.

The technician's laptop is another host inside the machine (tests/bench/guest/other-host.c), with the radio, or the
USB port, that is its own."""

import os
import time

import patience
import pytest
from bench.conftest import GROUND, PASSWORD
from bench.gaps import CHANNELS, Contents
from bench.page import Page, send

from . import LONG, autopilot, bundles, figures
from .appliance import wait_for
from .bundles import NEWER

pytestmark = [LONG, pytest.mark.skipif(bool(os.environ.get("IMAGE")),
                                       reason="the release image's kernel has no second network for another host")]

PORT = 8081         # the laptop's end of what the test asks, in the machine's own network
SERIAL = "10000000abcdef12"

LEASE = """#!/bin/sh
[ "$1" != bound ] || ip addr add "$ip/24" dev "$interface"
"""
# What a laptop does with its Wi-Fi radio, or its network adapter, once it has one.
LAPTOP = """#!/bin/sh
until ip link set {interface} up 2>/dev/null; do usleep 100000; done
{connect}
exec udhcpc -f -t 60 -T 1 -A 1 -i {interface} -s /tmp/lease
"""
STATION = """network={{
    ssid="{ssid}"
    psk="{key}"
    scan_ssid=1
    scan_freq=2437
}}
"""


def laptop(machine, interface, address, connect=""):
    """Its process's id: its network's, too."""
    machine.put("/tmp/lease", LEASE.encode())
    machine.put("/tmp/laptop", LAPTOP.format(interface=interface, connect=connect).encode())
    machine.must(f"(other-host {PORT} {address}:80 /tmp/laptop >/tmp/laptop.id 2>/tmp/laptop.log </dev/null &)")
    machine.wait_inside("the laptop", "[ -s /tmp/laptop.id ]")
    return machine.must("cat /tmp/laptop.id").strip()


def access_point(machine):
    station = STATION.format(ssid=machine.must("cat /data/secrets/wifi_ssid").strip(), key=PASSWORD)
    machine.put("/tmp/laptop.conf", station.encode(), "600")
    network = laptop(machine, "wlan2", "192.168.41.1",
                     connect="wpa_supplicant -B -i wlan2 -c /tmp/laptop.conf >/dev/null")
    machine.must(f"iw phy $(cat /sys/class/net/wlan2/phy80211/name) set netns {network}")


def usb_gadget(machine):
    """The board's port and the computer's are the kernel's dummy_hcd. The machine has no device tree of a CM4's; the
    rest is what coldplug does there."""
    machine.must("modprobe dummy_hcd")
    machine.must(f"mkdir /tmp/tree && echo {SERIAL} >/tmp/tree/serial-number && "
                 "mount --bind /tmp/tree /sys/firmware/devicetree/base && /lib/odid/gadget dummy_udc.0; "
                 "umount /sys/firmware/devicetree/base")
    machine.wait_inside("the computer's adapter", "[ -e /sys/class/net/usb0 ]")
    # This kernel is the computer's, too: it took the adapter for a modem of ours.
    machine.wait_inside("udhcpc", "[ -p /run/service/udhcpc-usb0/supervise/control ]")
    machine.must("sv down udhcpc-usb0")
    machine.wait_inside("its end", "[ -z \"$(cat /run/service/udhcpc-usb0/supervise/pid)\" ]")
    # Now and then this kernel's link between its own two ends doesn't come up: said here, not as a page that is missing.
    machine.must("ip link set usb0 up")
    machine.wait_inside("the link", "[ \"$(cat /sys/class/net/usb0/carrier)\" = 1 ]")
    network = laptop(machine, "usb0", "192.168.42.1")
    machine.must(f"ip link set usb0 netns {network}")


@pytest.mark.parametrize("way", [access_point, usb_gadget])
def test_a_bundle_by(way, make_appliance, tmp_path):
    one = make_appliance(f"page_{way.__name__}", config={"odid.conf": GROUND})
    machine, bundle = one.machine, bundles.bundle("good", NEWER)
    judge = machine.judge(None)
    try:
        one.power_on()
        machine.play(autopilot.generate(tmp_path, armed=False))
        machine.wait_on_air(position=True)
        one.wait_ready()
        machine.must("odidctl maintenance on")
        machine.wait_inside("maintenance", "[ \"$(cat /run/odid-appliance/maintenance)\" = on ]")
        way(machine)
        machine.must(f"nft insert rule inet odid input iifname eth0 tcp dport {PORT} accept")
        page = Page(machine, PORT)
        wait_for("the page", lambda: page.ask("GET", "/")[0] == 200)
        assert page.ask("POST", "/api/session", {"password": PASSWORD}) == (200, {})
        before, begun = one.starts(), time.monotonic()
        code, said = send(page, bundle.read_bytes())
        assert code == 202, said
        wait_for("the end of the install", lambda: page.ask("GET", "/api/status")[1]["update"]["state"]
                 not in ("checking", "installing"))
        ended = time.monotonic()
        one.wait_restart(before)
        assert one.slot() == "b" and one.version() == NEWER
        # The page comes back by itself, to whoever waits for the outcome.
        page = Page(machine)
        wait_for("the page again", lambda: page.ask("GET", "/")[0] == 200)
        assert page.ask("POST", "/api/session", {"password": PASSWORD}) == (200, {})
        one.wait_state("idle")
        assert "is installed" in page.ask("GET", "/api/status")[1]["last_update"]["sentence"]
    finally:
        judge.stop()
    gap_s, channel = Contents(machine.folder / "judge/receptions.jsonl").worst_gap(CHANNELS, begun, ended)
    print(f"longest gap {gap_s:.2f} s on {channel}")
    patience.promise(f"the longest gap, on {channel}", gap_s, figures.GAP_S)
