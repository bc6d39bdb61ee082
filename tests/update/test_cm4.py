"""Updates of the image that is flashed, on the Compute Module's board in emulation: its channels transmit, so a good one is
committed. Its restarts are made by hand (bench/cm4.py)."""

import re

import parts
import pytest
from bench.cm4 import FLASHED, Cm4

from . import bundles
from .appliance import Appliance, readied, wait_for
from .bundles import NEWER, Failure

pytestmark = pytest.mark.skipif(not FLASHED, reason="of the image that is flashed: make system IMAGE=build/image/cm4/images/disk.img")

FAILURES = (
    Failure("no_patch_file", {"lib/firmware/brcm/BCM4345C0.hcd": None}, "Not so before.*Bluetooth chip.*without its patch"),
    Failure("no_regulatory_database", {"lib/firmware/regulatory.db": None}, "Not so before.*radio rules"),
    Failure("no_wifi_driver", {"lib/modules/**/brcmfmac.ko*": None}, "Wi-Fi.*isn't on the air"),
)


def changes_of(failure):
    """With the files' whole names: a kernel module's has the kernel's version in it."""
    root = bundles.root()
    changes = {str(path.relative_to(root)): content for pattern, content in failure.changes.items() for path in root.glob(pattern)}
    assert changes, f"{failure.name}: not in the image: {failure.changes}"
    return changes


@pytest.fixture
def ready(cm4_possible, request):
    with readied(Appliance(machine=Cm4(parts.ROOT / "build/update/runs" / re.sub(r"\W+", "_", request.node.name)))) as one:
        yield one


def given(appliance, bundle):
    """Gives it the bundle, and waits until its slot was started."""
    got = appliance.install(bundle)
    assert got.code == 0, got.output
    appliance.machine.restarted()
    assert appliance.slot() == "b"


def test_one_that_transmits_is_committed(ready):
    before = bundles.running_version()
    given(ready, bundles.bundle("good", NEWER))
    ready.machine.wait_on_air()
    ready.machine.wait_all_five()
    ready.wait_state("idle")
    variables = ready.variables()
    assert (variables["slot"], variables["upgrade_available"]) == ("b", "0")
    result = ready.result()
    assert (result["outcome"], result["from"], result["to"]) == ("installed", before, NEWER)
    ready.machine.cut_power()
    ready.power_on()
    assert (ready.slot(), ready.version()) == ("b", NEWER)


@pytest.mark.parametrize("failure", FAILURES, ids=lambda failure: failure.name)
def test_one_whose_radio_lacks_something_is_rolled_back_and_says_why(ready, failure):
    given(ready, bundles.bundle(failure.name, NEWER, changes_of(failure)))
    wait_for("the reason", ready.result)
    ready.machine.restarted()
    ready.machine.wait_on_air()
    ready.machine.wait_all_five()
    assert (ready.slot(), ready.version()) == ("a", bundles.running_version())
    result = ready.result()
    assert result["outcome"] == "rolled-back"
    assert re.search(failure.says, result["sentence"]), result["sentence"]
    variables = ready.variables()
    assert (variables["slot"], variables["upgrade_available"]) == ("a", "0")
