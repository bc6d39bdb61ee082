"""What is refused before anything is written, with the reason; and, check by check, that it would be
installed if the check weren't there: a test that can't fail shows nothing."""

import hashlib
import re
import time
from collections import namedtuple

import pytest

from . import LONG, autopilot, bundles, preload
from .appliance import wait_for
from .bundles import NEWER, OLDER
from .installs import accepted


# bundle: makes it; says: what the sentence has; arrange, undo: what has to be so on the appliance;
# without: takes the check out, for the counter-test (None: it can't be taken out); back: puts it back.
Refusal = namedtuple("Refusal", "name bundle says arrange undo without back",
                     defaults=(None, None, None, None))


def good():
    return bundles.bundle("good", NEWER)


def gate_open(machine):
    """SWUpdate asks somebody else, who always says yes."""
    machine.put("/tmp/yes", b"#!/bin/sh\nblockdev --setrw /dev/disk/odid/slot-b\n")
    machine.must("sed 's,odid-update gate,/tmp/yes,' /etc/swupdate.cfg >/tmp/swupdate.cfg && "
                 "! cmp -s /tmp/swupdate.cfg /etc/swupdate.cfg && mount --bind /tmp/swupdate.cfg /etc/swupdate.cfg && "
                 "sv term swupdate && sleep 2 && [ -S /run/swupdate/sockinstctrl ]")


def gate_back(machine):
    machine.must("umount /etc/swupdate.cfg; sv term swupdate; sleep 2")


def other_run_script(expression):
    def take_out(machine):
        machine.must("cp /run/service/swupdate/run /tmp/run && "
                     f"sed -i '{expression}' /run/service/swupdate/run && ! cmp -s /tmp/run /run/service/swupdate/run "
                     "&& sv term swupdate && sleep 2 && [ -S /run/swupdate/sockinstctrl ]")
    return take_out


def run_script_back(machine):
    machine.must("cp /tmp/run /run/service/swupdate/run; umount /etc/swupdate/trusted.pem 2>/dev/null; "
                 "sv term swupdate; sleep 2")


def trust_the_other(machine):
    machine.put("/tmp/trusted.pem", (bundles.other_keys() / "trusted.pem").read_bytes(), "644")
    machine.must("cp /run/service/swupdate/run /tmp/run; mount --bind /tmp/trusted.pem /etc/swupdate/trusted.pem; "
                 "sv term swupdate; sleep 2")


def swupdate_with(source):
    """SWUpdate with some of its libraries' functions replaced."""
    def take_out(machine):
        preload.put(machine, source, "/tmp/changed.so")
        other_run_script("s,^exec ,export LD_PRELOAD=/tmp/changed.so; exec ,")(machine)
    return take_out


def any_signature(machine):
    machine.put("/tmp/signature", bundles.signature_of(good()))
    swupdate_with(preload.ANY_SIGNATURE)(machine)


def prevent_downgrade(machine):
    machine.must("odidctl set update.prevent_downgrade yes")


def allow_downgrade(machine):
    machine.must("odidctl set update.prevent_downgrade no")
    machine.wait_on_air()


REFUSALS = (
    Refusal("other_hardware", lambda: bundles.bundle("cm4", NEWER, board="cm4"), "other hardware.*odid-qemu",
            without=other_run_script(r's/odid:odid-\$BOARD/odid:odid-cm4/'), back=run_script_back),
    # No counter-test: that a signature has its place in the archive is the archive's form. The next one's is empty.
    Refusal("unsigned", lambda: bundles.unsigned(good(), "unsigned"), "signed"),
    Refusal("empty_signature", lambda: bundles.signed_with(good(), "empty", b""), "signed",
            without=any_signature, back=run_script_back),
    Refusal("signed_by_another", lambda: bundles.bundle("another", NEWER, keys=bundles.other_keys()), "signed",
            without=trust_the_other, back=run_script_back),
    Refusal("altered_description",
            lambda: bundles.described(good(), "altered", lambda text: text.replace(NEWER, "9.9.1"), keys=None),
            "signed|altered", without=any_signature, back=run_script_back),
    Refusal("older", lambda: bundles.bundle("older", OLDER), f"{OLDER} is older",
            arrange=prevent_downgrade, undo=allow_downgrade,
            without=gate_open, back=gate_back),
    Refusal("no_space",
            lambda: bundles.described(good(), "large", lambda text: re.sub(
                r'slot-octets = "\d+"', 'slot-octets = "200000000"', text)), "200000000 octets",
            without=gate_open, back=gate_back),
    Refusal("noise", lambda: bundles.noise("noise"), "bundle"),
)


def untouched(appliance):
    """What an update that is refused leaves alone: as items, so that two of them differ by what was touched."""
    sectors = {("sectors written", part, appliance.sectors_written(part)) for part in (7, 6, 5, 1)}
    return set(appliance.variables().items()) | appliance.kept() | sectors


@pytest.mark.parametrize("refusal", REFUSALS, ids=lambda refusal: refusal.name)
def test_refused_before_anything_is_written(grounded, refusal):
    machine, bundle = grounded.machine, refusal.bundle()
    if refusal.arrange:
        refusal.arrange(machine)
    try:
        before = untouched(grounded)
        got = grounded.install(bundle)
        assert got.code == 1, got.output
        result = grounded.result()
        assert result["outcome"] == "refused"
        assert result["from"] == bundles.running_version()
        assert re.search(refusal.says, result["sentence"]), result["sentence"]
        assert result["sentence"] in got.output
        assert grounded.state() == "idle"
        assert untouched(grounded) ^ before == set()
        assert grounded.protected()
        machine.wait_on_air()
    finally:
        if refusal.undo:
            refusal.undo(machine)


@LONG
@pytest.mark.parametrize("refusal", [one for one in REFUSALS if one.without], ids=lambda refusal: refusal.name)
def test_without_the_check_it_would_be_installed(grounded, refusal):
    machine, bundle = grounded.machine, refusal.bundle()
    if refusal.arrange:
        refusal.arrange(machine)
    refusal.without(machine)
    try:
        assert accepted(grounded, bundle)
    finally:
        refusal.back(machine)
        if refusal.undo:
            refusal.undo(machine)


# --- a payload that isn't what was signed ------------------------------------------


@pytest.mark.parametrize("spoil", [bundles.damaged, bundles.cut_short], ids=["damaged", "cut_short"])
def test_a_wrong_payload_is_never_marked(grounded, spoil):
    before = grounded.variables(), grounded.kept()
    written = grounded.sectors_written(6), grounded.sectors_written(5)
    got = grounded.install(spoil(good(), "spoilt"))
    assert got.code == 1, got.output
    assert re.search("damaged|cut short", grounded.result()["sentence"])
    assert (grounded.variables(), grounded.kept()) == before
    assert (grounded.sectors_written(6), grounded.sectors_written(5)) == written
    assert grounded.protected()


def test_a_refused_payload_can_t_be_started(grounded):
    """Whole, sealed and not its maker's: U-Boot, which asks for no signature, would take it where the other slot is damaged."""
    folder = bundles.parts_of(good())
    (folder / "slot.img").write_bytes(bundles.slot("evil", {"etc/evil": b"x"}).read_bytes())
    evil = bundles.put_together(folder, ["sw-description", "sw-description.sig", "slot.img"], bundles.BUILD / "evil.swu")
    got = grounded.install(evil)
    assert got.code == 1 and "damaged" in grounded.result()["sentence"], got.output
    assert grounded.machine.must("head -c 4 /dev/disk/odid/slot-b | hexdump -e '4/1 \"%02x\"'").strip() == "00000000"
    assert grounded.protected()


def test_what_is_not_verified_fills_nothing_that_others_need(grounded):
    """A signature as large as /run: what was kept of the flight there couldn't be written any more."""
    machine = grounded.machine
    free = int(machine.must("df -k /run | tail -n 1").split()[3])
    got = grounded.install(bundles.signed_with(good(), "large", bytes(free * 1024)))
    assert got.code == 1, got.output
    assert int(machine.must("df -k /run | tail -n 1").split()[3]) > free - 512
    grounded.wait_ready()
    assert machine.must("ls /run/swupdate").split() == ["sockinstctrl", "swupdateprog"]


def any_hash(machine, bundle, slot, and_source=""):
    """That slot has the hash that the bundle wants."""
    machine.put("/tmp/hashes", hashlib.sha256(slot).digest() + bytes.fromhex(bundles.sha256_in(bundle)))
    swupdate_with(preload.OTHER_HASH + and_source)(machine)


@LONG
def test_without_its_hash_a_damaged_one_would_be_marked(grounded):
    bundle, machine = bundles.damaged(good(), "spoilt"), grounded.machine
    any_hash(machine, bundle, bundles.slot_of(bundle))
    try:
        assert accepted(grounded, bundle)
    finally:
        run_script_back(machine)


@LONG
def test_without_its_end_and_its_hash_one_cut_short_would_be_marked(grounded):
    whole, machine = bundles.without_sums(good(), "whole"), grounded.machine
    bundle = bundles.cut_short(whole, "spoilt")
    slot, rest = bundles.filled(whole, bundle)
    machine.put("/tmp/rest", rest)
    any_hash(machine, whole, slot, preload.REST_FROM_FILE)
    try:
        assert accepted(grounded, bundle)
    finally:
        run_script_back(machine)


@LONG
def test_the_bundle_itself_is_good(grounded):
    """Else the tests above would pass for the wrong reason."""
    assert accepted(grounded, good())


# --- one at a time -----------------------------------------------------------


def test_a_second_one_at_the_same_time(grounded):
    bundle = good()
    grounded.begin(bundles.damaged(bundle, "first"), rate=bundle.stat().st_size // 8)
    grounded.wait_state("installing")
    second = grounded.install(bundle)
    assert second.code == 3
    assert "another update is being installed" in second.output
    assert grounded.ended()[0] == 1     # the first one went on to its own end
    assert "damaged" in grounded.result()["sentence"]


@LONG
def test_with_a_second_swupdate_it_would_be_written_meanwhile(grounded):
    """There is one installer: that is what lets one bundle in at a time."""
    machine, bundle = grounded.machine, good()
    grounded.begin(bundles.damaged(bundle, "first"), rate=bundle.stat().st_size // 40)
    grounded.wait_state("installing")
    machine.must("mkdir -p /run/second; export TMPDIR=/run/second; swupdate -f /run/swupdate.cfg -H odid:odid-qemu -M -m "
                 "-e stable,slot-b -q stable,slot-b >/dev/null 2>&1 & echo $! >/tmp/second; "
                 "until [ -S /run/second/sockinstctrl ]; do usleep 100000; done")
    try:
        machine.shell.send(f"TMPDIR=/run/second odidctl update {grounded.server.url(bundle)} >/dev/null 2>&1 &")
        wait_for("the mark in U-Boot's variables", lambda: grounded.variables().get("trial") == "b")
        assert machine.run("[ -s /tmp/code ]").code     # the first one is being written still
    finally:
        machine.must("kill $(cat /tmp/second); fw_setenv upgrade_available 0; fw_setenv trial")
        grounded.ended()


def test_a_dry_run_is_no_update(grounded):
    """SWUpdate says "success" at its end; that restarted the board, with nothing written."""
    machine, before, starts = grounded.machine, untouched(grounded), grounded.starts()
    preload.put(machine, preload.DRY_RUN, "/tmp/dry.so")
    got = machine.run(f"LD_PRELOAD=/tmp/dry.so odidctl update {grounded.server.url(good())}")
    assert got.code == 1 and "nothing is marked" in got.output, got.output
    assert grounded.state() == "idle" and untouched(grounded) ^ before == set() and grounded.protected()
    time.sleep(6)       # it would restart five seconds after an install
    assert grounded.starts() == starts and machine.must("odidctl update").startswith("No update")


def test_it_can_be_called_off(grounded):
    machine, bundle = grounded.machine, good()
    before = grounded.variables(), grounded.kept()
    assert machine.run("odidctl update cancel").code == 1
    grounded.begin(bundle, rate=bundle.stat().st_size // 30)
    grounded.wait_state("installing")
    assert machine.must("odidctl update cancel") == "The update is called off.\n"
    assert grounded.ended()[0] == 1
    assert "called off" in grounded.result()["sentence"]
    assert (grounded.variables(), grounded.kept()) == before and grounded.protected()
    grounded.wait_ready()


# As long as nobody listened to it, SWUpdate keeps what it said.
def test_refused_as_soon_as_swupdate_is_there(grounded):
    machine = grounded.machine
    machine.must(f"curl -sfo /tmp/noise.swu {grounded.server.url(bundles.noise('noise'))}")
    for _ in range(3):
        got = machine.run("rm -f /data/odid/update.json; sv down swupdate; rm -f /run/swupdate/sock*; sv up swupdate; "
                          "until [ -S /run/swupdate/sockinstctrl ]; do usleep 10000; done; "
                          "odidctl update /tmp/noise.swu")
        assert got.code == 1, got.output
        assert "no bundle" in got.output or "no whole bundle" in got.output


def test_not_while_nobody_watches(grounded):
    """Else the autopilot isn't told, and it would be written on when armed."""
    machine = grounded.machine
    before = untouched(grounded)
    machine.must("sv down update; sleep 1")
    try:
        got = grounded.install(good())
        assert got.code == 3 and "nothing looks after updates" in got.output, got.output
        assert "service update doesn't answer" in machine.run("odid-update gate").output
        assert untouched(grounded) ^ before == set() and grounded.protected()
    finally:
        machine.must("sv up update; sleep 1")
        grounded.wait_ready()


@LONG
def test_a_newer_one_is_no_downgrade(grounded):
    """1.10 is newer than 1.9; one that is the same isn't older."""
    machine = grounded.machine
    prevent_downgrade(machine)
    machine.must("echo 1.9.0 >/tmp/version; mount --bind /tmp/version /etc/odid/version")
    try:
        for version in ("1.10.0", "1.9.0"):
            assert accepted(grounded, bundles.bundle("newer", version)), version
    finally:
        machine.must("umount /etc/odid/version")
        allow_downgrade(machine)


# variable, its value: what U-Boot's environment has then.
Undecided = namedtuple("Undecided", "name variable value says")
UNDECIDED = (
    Undecided("on_trial", "upgrade_available", "1", "on trial"),
    # The running slot failed its trial and waits for the restart.
    Undecided("slot_to_go_back_to", "trial_failed", "a", "failed its trial"))


@pytest.fixture(params=UNDECIDED, ids=lambda one: one.name)
def undecided(request, grounded):
    one, before = request.param, grounded.variables()
    grounded.machine.must(f"fw_setenv {one.variable} {one.value}")
    yield one
    grounded.machine.must(f"fw_setenv {one.variable} {before.get(one.variable, '')}")


def test_not_over_an_update_that_is_not_decided(grounded, undecided):
    got = grounded.install(good())
    assert got.code == 1, got.output
    assert undecided.says in grounded.result()["sentence"]


@LONG
def test_without_the_check_it_would_be_written_over(grounded, undecided):
    gate_open(grounded.machine)
    try:
        assert accepted(grounded, good())
    finally:
        gate_back(grounded.machine)


# --- armed -------------------------------------------------------------------


@pytest.fixture(scope="module")
def logs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("logs")
    return {armed: autopilot.generate(folder, armed) for armed in (False, True)}


@pytest.fixture
def armed(grounded, logs):
    grounded.machine.play(logs[True])
    wait_for("armed", grounded.armed)
    yield
    grounded.machine.play(logs[False])
    wait_for("disarmed", lambda: grounded.armed() is False)
    time.sleep(3)


def unplugged(appliance):
    """Its cable is pulled: it flies on."""
    appliance.machine.unplug()
    wait_for("lost", lambda: appliance.machine.status()["aircraft"]["heartbeat"] is False)


def test_armed_and_lost_while_armed(grounded, armed):
    machine = grounded.machine
    before = untouched(grounded)
    got = grounded.install(good())
    assert got.code == 1, got.output
    assert "armed" in grounded.result()["sentence"]
    unplugged(grounded)
    try:
        machine.must("rm -f /data/odid/update.json")
        got = grounded.install(good())
        assert got.code == 1, got.output
        assert "armed" in grounded.result()["sentence"]
        assert untouched(grounded) ^ before == set()
    finally:
        machine.plug()


@LONG
@pytest.mark.parametrize("lost", [False, True], ids=["armed", "lost_while_armed"])
def test_without_the_check_it_would_be_written_in_flight(grounded, armed, lost):
    """odid-update, which ends SWUpdate at arming, doesn't run meanwhile; accepted() starts it again."""
    if lost:
        unplugged(grounded)
    gate_open(grounded.machine)
    grounded.machine.must("sv down update")
    try:
        assert accepted(grounded, good())
    finally:
        gate_back(grounded.machine)
        if lost:
            grounded.machine.plug()
