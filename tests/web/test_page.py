"""The page in headless Chromium: each state, what a technician does with it, and how it looks.

ODID_PICTURES=docs/pictures makes the pictures of docs/page.md anew; look at each before it is committed.
"""

import os
import re
import time
from pathlib import Path

import pytest
from patience import LIMIT_S, wait_for

from .appliance import PASSWORD, ROOT, Gate, recorded
from .browser import LAPTOP, PHONE, Browser

PICTURES = os.environ.get("ODID_PICTURES")
TOTALS = ('{"t":1900.0,"event":"totals","armed_since":null,"armed_s":1500.0,"faults":0,"armed_faults":0,"restarts":0,'
          '"armed_fault_s":{},"channels":{"bt4":%s,"wifi":%s}}\n')
HEARD = '{"required":true,"first":3.9,"heard":1900.0,"silent_s":0.0,"longest_gap_s":0.0,"gaps":0,"open_gap_s":0.0}'
SILENT = '{"required":true,"first":4.4,"heard":1900.0,"silent_s":7.2,"longest_gap_s":4.1,"gaps":2,"open_gap_s":0.0}'


def refusals():
    """Every sentence that the appliance has for a bundle it doesn't take, with something for its variables."""
    offer = (ROOT / "package/odid-daemon/src/appliance/update_offer.c").read_text()
    gate = [re.sub(r'"\s*"', "", re.sub(r'"\s*PRIu64\s*"', "s", one)).strip().strip('"') for one in
            re.findall(r'refuse\(why, size,\s*((?:"[^"]*"|\s|PRIu64)+)', offer)]
    assert len(gate) == 14
    installer = re.findall(r'\{"[^"]+", "([^"]+)"\}', (ROOT / "package/odid-daemon/src/update/update_installer.c").read_text())
    return [f"The update was refused: {re.sub(r'[$]{.+?}|[$][a-z_]+|%s', '1.3.0', sentence)}"
            for sentence in dict.fromkeys(gate + installer)]


UNSIGNED, = (one for one in refusals() if "signed by a key" in one)


def record(wifi=HEARD):
    return ('{"t":2.1,"event":"start","format":1,"boot":"boot","version":"0.1.0","image":"1.4.0"}\n'
            '{"t":40.0,"event":"clock","utc":"2026-11-20T14:11:00Z"}\n' + TOTALS % (HEARD, wifi))


@pytest.fixture
def browse(chromium, appliance):
    """Opens the page, logged in; every browser must end without an error or a request elsewhere."""
    opened = []

    def browse(login=True, **arguments):
        opened.append(Browser(chromium, appliance, **arguments))
        return opened[-1].login() if login else opened[-1]
    yield browse
    for one in opened:
        elsewhere = [url for url in one.asked if not url.startswith(appliance.url)]
        one.close()
        assert one.errors == [] and elsewhere == []


def picture(browser, name, where=None):
    """For docs/page.md, when asked for."""
    if PICTURES:
        time.sleep(0.3)
        path = Path(PICTURES) / f"{name}.png"
        if where is None:
            browser.page.screenshot(path=path, full_page=True)
        else:
            browser.page.locator(where).screenshot(path=path)


def problem(reason, advice="Do something.", severity="fault", name="some-problem"):
    return {"id": name, "severity": severity, "reason": reason, "advice": advice}


# Far more than the kernel keeps on the way.
def bundle(appliance, size=12_000_000, name="odid-cm4-1.5.0.swu"):
    path = appliance.folder / name
    path.write_bytes(os.urandom(size))
    return path


# --- password -----------------------------------------------------------------------


def test_a_wrong_password_is_said_and_the_right_one_opens(browse):
    browser = browse(login=False)
    browser.waits("() => document.activeElement.id === 'password'")
    browser.give_password("not the password")
    browser.sees("#login-said", "That is not the maintenance password")
    picture(browser, "password")
    assert not browser.page.locator("#page").is_visible()
    browser.give_password()
    browser.sees("#state-title", "^On the air$")
    assert browser.page.locator("#password").input_value() == ""


def test_too_many_wrong_passwords_have_to_wait(browse):
    """That is, when they come quicker than one in ten seconds."""
    browser = browse(login=False)

    def refused():
        browser.give_password("not the password")
        browser.waits("() => !document.querySelector('#login-form button').disabled")
        return re.search(r"Wait \d+ seconds", browser.text("#login-said"))
    wait_for("one of them to have to wait", refused)


def test_leaving_closes_the_page(browse, appliance):
    browser = browse()
    with browser.page.expect_navigation():
        browser.button("Log out").click()
    browser.page.wait_for_selector("#login:not([hidden])")
    browser.page.reload()
    browser.page.wait_for_selector("#login:not([hidden])")


def test_a_session_that_ended_asks_again(browse, appliance):
    browser = browse()
    appliance.stop()
    appliance.start()
    browser.sees("#login-said", "Give the password again")
    browser.login()


# --- is it transmitting, and what does it say ---------------------------------------


def test_on_the_air(browse):
    browser = browse()
    browser.sees("#state-title", "^On the air$")
    assert browser.kind("#state") == "good" and not browser.page.locator("#problems").is_visible()
    channels = browser.text("#channel-list")
    assert re.search(r"Bluetooth 4\s+On the air\s+hci0, every 100 ms", channels), channels
    assert re.search(r"Bluetooth 5\s+Not possible", channels) and re.search(r"Wi-Fi beacon\s+On the air", channels)
    said = browser.text("#aircraft-list")
    for wanted in ("SSRS5GBG01", "SWE3jxza7qbzvu5d", "Sea rescue surveillance", "57.700000, 11.900001",
                   "the take-off place", "disarmed"):
        assert wanted in said
    assert re.search(r"Version\s+1\.4\.0\s+Slot\s+A", browser.text("#software-list"))
    picture(browser, "on-the-air")


@pytest.mark.parametrize("state, word", [
    ("absent", "Not found"), ("blocked", "Radio switched off"), ("down", "Down"), ("starting", "Starting"),
    ("lost", "Lost"), ("disabled", "Switched off"), ("unsupported", "Not possible"), ("on air", "On the air")])
def test_each_state_of_a_channel(browse, appliance, state, word):
    appliance.status(channels__bt4__state=state)
    browser = browse()
    assert re.search(rf"Bluetooth 4\s+{word}", browser.text("#channel-list"))


def test_partly_on_the_air_says_what_to_do(browse, appliance):
    appliance.status(on_air=False, channels__bt4__state="lost", channels__bt4__detail="hci0: no answer",
                     identity__operator_id={"operator_id": None, "source": None, "validity": None},
                     problems=[problem("Bluetooth 4 off: lost", "It is being set up again. If this lasts a "
                                       "minute, switch power off and on."),
                               problem("missing operator_id message", "Set [operator] operator_id in odid.conf.", name="operator-id-missing"),
                               problem("time unknown: time stamps say so", "It comes with a GNSS fix.", "warning")])
    appliance.write("run/faults/data", "/data is full: delete what doesn't belong there.\n")
    browser = browse()
    browser.sees("#state-title", "^Only partly on the air$")
    assert browser.kind("#state") == "bad" and "Don't fly" in browser.text("#state-text")
    told = browser.text("#problem-list")
    assert told.index("Bluetooth 4 off: lost") < told.index("No operator number") < told.index("Time unknown")
    assert "Enter the number below" in told and "odid.conf" not in told
    assert "/data is full" in told
    picture(browser, "what-to-do")


def test_not_on_the_air(browse, appliance):
    appliance.status(on_air=False, channels__bt4__state="absent", channels__wifi__state="down")
    browser = browse()
    browser.sees("#state-title", "^Not on the air$")


def test_on_the_air_but_not_complete(browse, appliance):
    appliance.status(problems=[problem("no position from autopilot", "Take the aircraft outdoors.")],
                     position__latitude_deg=None, position__longitude_deg=None, position__fresh=False,
                     position__age_s=None, operator__latitude_deg=None, operator__longitude_deg=None)
    browser = browse()
    browser.sees("#state-title", "^On the air, not ready$")
    assert browser.kind("#state") == "warn"
    assert re.search(r"Position\s+unknown\s+It says so on the air", browser.text("#aircraft-list"))


def test_an_old_position_is_said_to_be(browse, appliance):
    appliance.status(position__fresh=False, position__age_s=125.0)
    assert "2 min old" in browse().text("#aircraft-list")


@pytest.mark.parametrize("speaks, state", [(True, "no HEARTBEAT from the autopilot"), (False, "no autopilot heard")])
def test_an_autopilot_without_heartbeats_is_not_said_to_be_silent(browse, appliance, speaks, state):
    appliance.status(aircraft__armed=None, aircraft__heartbeat=False, aircraft__speaks=speaks)
    assert state in browse().text("#aircraft-list")


@pytest.mark.parametrize("silence", ["gone", "hanging"])
def test_no_daemon(browse, appliance, silence):
    browser = browse()
    if silence == "gone":
        appliance.daemon.stop()
    else:
        appliance.daemon.hangs = True
    browser.sees("#state-title", "^Not on the air$", within_s=10)
    browser.sees("#state-text", "isn't running" if silence == "gone" else "doesn't answer")


def test_no_connection_is_no_verdict(browse, appliance):
    browser = browse()
    appliance.stop()
    browser.sees("#state-title", "^Not connected$")
    assert browser.kind("#state") == "unknown" and "says nothing about whether it transmits" in browser.text("#state-text")
    picture(browser, "not-connected", "#state")


def test_texts_from_outside_are_no_markup(browse, appliance):
    evil = '<img src=x onerror="document.title=1"><b>x</b>'
    appliance.status(identity__self_id={"description": evil, "type": "text", "source": "native"},
                     problems=[problem(evil, evil, name="constructor")], channels__bt4__detail=evil, channels__bt5__state="toString")
    appliance.write("run/faults/evil", evil)
    appliance.update("trial", sentence=evil)
    appliance.last_update("refused", evil)
    browser = browse()
    browser.sees("#problem-list", "onerror")
    assert browser.page.locator("main img, main b").count() == 0 and evil in browser.text("#aircraft-list")


# --- settings -----------------------------------------------------------------------


def save(browser, **values):
    for name, value in values.items():
        browser.page.locator(f"#{name}").fill(value)
    browser.button("Save").click()


def test_the_operator_number_is_set_and_its_secret_leaves_the_screen(browse, appliance):
    browser = browse()
    assert browser.button("Save").is_disabled()
    save(browser, operator="FIN87astrdge12k8-xyz")
    browser.sees("#operator-said", "Check character right; the secret part is not kept.*Saved, and in effect")
    assert browser.kind("#operator-said") == "good"
    assert "operator_id = FIN87astrdge12k8\n" in appliance.read("data/odid/odid.conf")
    assert "xyz" not in browser.page.locator("#operator").input_value()
    assert "xyz" not in browser.text("#operator-said")
    appliance.status(identity__operator_id={"operator_id": "FIN87astrdge12k8", "source": "configuration",
                                            "validity": "structure right"})
    browser.sees("#aircraft-list", "FIN87astrdge12k8")
    assert browser.page.locator("#operator").input_value() == "FIN87astrdge12k8"
    assert browser.button("Save").is_disabled()


def test_a_mistyped_operator_number_is_a_warning(browse, appliance):
    browser = browse()
    save(browser, operator="FIN87astrdge12k8-xya")
    browser.sees("#operator-said", "one of them is mistyped")
    assert browser.kind("#operator-said") == "warn"
    assert browser.text("#serial-said") == ""
    picture(browser, "mistyped", "#settings-form")


def test_a_serial_number_that_does_not_fit_is_refused(browse, appliance):
    before = appliance.read("data/odid/odid.conf")
    browser = browse()
    save(browser, serial="SSRS5GBG01SSRS5GBG011")
    browser.sees("#serial-said", "21 bytes long, 20 fit on the air.*Nothing was changed")
    assert browser.kind("#serial-said") == "bad" and appliance.read("data/odid/odid.conf") == before
    assert browser.page.locator("#serial").input_value() == "SSRS5GBG01SSRS5GBG011"   # to be mended


def test_settings_of_an_armed_aircraft_stay(browse, appliance):
    appliance.status(aircraft__armed=True)
    browser = browse()
    save(browser, serial="SSRS5GBG02")
    browser.sees("#serial-said", "The aircraft is armed: nothing was changed")


def test_what_is_being_typed_stays(browse, appliance):
    browser = browse()
    browser.field("Operator number").fill("")
    for piece in ("F", "IN", "87"):
        browser.field("Operator number").press_sequentially(piece)
        browser.shows_another_answer()
    assert browser.page.locator("#operator").input_value() == "FIN87"


# --- updates ------------------------------------------------------------------------


def install(browser, path):
    browser.choose(path)
    browser.button("Install").click()


def test_an_update_shows_how_far_it_is_and_how_it_ended(browse, appliance, updater):
    # Longer than the first second, whose rate the page doesn't believe.
    updater.rate, updater.stops_at = 3_000_000, 9_000_000
    browser = browse()
    path = bundle(appliance)
    install(browser, path)
    browser.sees("#progress-label", "^Sending to the aircraft$")
    browser.sees("#progress-text", r"^\d+ %, about \d+ s left$")
    assert browser.button("Install").is_disabled()
    appliance.update("installing", 62, 9, "Installing version 1.5.0.")
    browser.sees("#progress-text", "^62 %, about 9 s left$")
    assert browser.text("#progress-label") == "Installing version 1.5.0."
    assert browser.page.locator("#progress-bar").get_attribute("value") == "62"
    picture(browser, "installing", "#software-title >> xpath=..")
    updater.rate = None
    updater.goes_on.set()
    browser.waits("() => upload && upload.sent")
    appliance.update("waiting-for-reboot", 100, 0, "Version 1.5.0 is installed; the aircraft restarts.")
    browser.sees("#progress-label", "the aircraft restarts")
    appliance.stop()
    browser.sees("#state-title", "^Restarting$")
    appliance.write("etc/odid/version", "1.5.0\n")
    appliance.write("run/odid-appliance/slot", "b\n")
    appliance.update("trial", sentence="Version 1.5.0 is on trial.")
    appliance.start()
    browser.page.wait_for_selector("#login:not([hidden])")
    browser.login()
    assert re.search(r"1\.5\.0\s+Slot\s+B\s+Version 1.5.0 is on trial", browser.text("#software-list"))
    appliance.update()
    appliance.last_update("installed", "Version 1.5.0 is installed.")
    browser.sees("#last-update-title", "^Last update: Installed$")
    assert browser.kind("#last-update") == "good" and updater.bundles == [path.read_bytes()]
    picture(browser, "installed", "#software-title >> xpath=..")


@pytest.mark.parametrize("sentence", refusals())
def test_a_refusal_says_why(browse, appliance, updater, sentence):
    updater.limit = 200_000
    appliance.last_update("installed", "Version 1.4.0 is installed.", "1.4.0")
    browser = browse()
    # The update's service writes its sentence, and SWUpdate closes its end.
    updater.says = lambda: appliance.last_update("refused", sentence)
    install(browser, bundle(appliance))
    browser.sees("#last-update-text", re.escape(sentence).replace(r"\ ", " "))
    browser.sees("#last-update-title", "^Last update: Refused$")
    browser.page.wait_for_selector("#progress", state="hidden")
    assert browser.kind("#last-update") == "bad" and browser.text("#update-said") == ""
    if sentence == UNSIGNED:
        picture(browser, "refused", "#software-title >> xpath=..")


def test_an_updater_that_stops_without_a_word_is_said_to(browse, appliance, updater):
    updater.limit = 200_000
    appliance.last_update("installed", "Version 1.4.0 is installed.", "1.4.0")
    browser = browse()
    install(browser, bundle(appliance))
    browser.has_seen("looking why")
    browser.sees("#update-said", "The updater stopped taking the bundle")
    assert browser.kind("#update-said") == "bad" and not browser.page.locator("#progress").is_visible()


def test_a_bundle_of_which_nothing_is_heard_again_is_said_to_be(browse, appliance, updater):
    browser = browse()
    browser.page.clock.install()
    install(browser, bundle(appliance, 1000))
    browser.has_seen("checks and installs it")
    browser.page.clock.run_for(20000)
    browser.sees("#update-said", "nothing says what became of it")


def test_the_same_refusal_again_is_seen(browse, appliance, updater):
    browser = browse()
    updater.says = lambda: appliance.last_update("refused", UNSIGNED, at=None)
    for _ in range(2):
        install(browser, bundle(appliance, 1000))
        browser.page.wait_for_selector("#progress", state="hidden")
        browser.sees("#last-update", "Last update: Refused.*time unknown")


def test_a_roll_back_says_why(browse, appliance):
    appliance.last_update("rolled-back", "Version 1.5.0 didn't get Bluetooth on the air within 60 s.")
    browser = browse()
    browser.sees("#last-update", "Last update: Rolled back.*didn't get Bluetooth on the air.*1.4.0 → 1.5.0")
    assert browser.kind("#last-update") == "bad"


@pytest.mark.parametrize("obstacle, sentence", [
    ("armed", "The aircraft is armed"), ("busy", "another update is under way"), ("none", "updater isn't running")])
def test_an_update_that_can_not_begin_says_why(browse, appliance, request, obstacle, sentence):
    if obstacle != "none":
        request.getfixturevalue("updater").busy = obstacle == "busy"
    appliance.status(aircraft__armed=obstacle == "armed")
    browser = browse()
    install(browser, bundle(appliance))
    browser.sees("#update-said", sentence)
    assert browser.kind("#update-said") == "bad" and not browser.page.locator("#progress").is_visible()


def test_another_update_under_way_is_shown(browse, appliance):
    appliance.update("installing", 10, 40, "Installing version 1.5.0, from the USB stick.")
    browser = browse()
    browser.sees("#progress-label", "from the USB stick")
    browser.choose(bundle(appliance)) if browser.page.locator("#bundle").is_enabled() else None
    assert browser.button("Install").is_disabled()


def test_an_update_of_whoever_can_be_called_off(browse, appliance):
    gate = Gate(appliance.folder / "run/odid-appliance")
    appliance.update("installing", 10, 40, "Version 1.5.0 is being written.")
    browser = browse()
    browser.sees("#progress-label", "is being written")
    browser.button("Cancel").click()
    wait_for("the word", lambda: gate.asked == ["cancel"])
    appliance.update("waiting-for-reboot", sentence="Version 1.5.0 is written.")    # too late for that
    browser.sees("#progress-label", "is written")
    assert not browser.button("Cancel").is_visible()


def test_an_upload_that_is_cut_half_way_says_so(browse, appliance, updater):
    updater.rate, updater.stops_at = 3_000_000, 2_000_000
    browser = browse()
    install(browser, bundle(appliance))
    # What the page takes for sent may be in the kernel's buffers still.
    wait_for("a part of it to be taken", lambda: updater.taken >= updater.stops_at)
    appliance.stop()
    browser.sees("#update-said", "The connection broke before the whole file was sent; nothing was installed")
    updater.goes_on.set()
    assert updater.over.wait(LIMIT_S) and len(updater.bundles[0]) < 12_000_000


def test_an_upload_can_be_cancelled(browse, appliance, updater):
    updater.rate, updater.stops_at = 3_000_000, 2_000_000
    browser = browse()
    install(browser, bundle(appliance))
    browser.sees("#progress-label", "Sending")
    browser.button("Cancel").click()
    browser.sees("#update-said", "Sending was cancelled")
    updater.goes_on.set()
    assert updater.over.wait(LIMIT_S) and len(updater.bundles[0]) < 12_000_000
    browser.choose(bundle(appliance, 1000))
    wait_for("another one can be installed", lambda: browser.button("Install").is_enabled())


@pytest.mark.parametrize("size, word", [(0, "empty"), (64 * 1024 * 1024 + 1, "far too large")])
def test_what_is_no_bundle_is_not_sent(browse, appliance, updater, size, word):
    path = appliance.folder / "holiday.mp4"
    with path.open("wb") as file:
        file.truncate(size)
    browser = browse()
    install(browser, path)
    browser.sees("#update-said", f"holiday.mp4 is {word}")
    assert updater.bundles == [] and not updater.taken


# --- flight records -----------------------------------------------------------------


def test_flight_records_are_listed_and_downloaded(browse, appliance):
    for number, wifi in ((11, SILENT), (12, HEARD)):
        appliance.write(f"data/odid/flights/{number:05}.jsonl", record(wifi))
    browser = browse()
    browser.button("Show").click()
    browser.sees("#flight-list", r"12: 2026-11-20 14:\d\d UTC.*11: 2026")
    with browser.page.expect_download() as download:
        browser.page.get_by_role("link", name="Download record 12").click()
    assert download.value.suggested_filename == "flight-00012.jsonl"
    assert Path(download.value.path()).read_text() == appliance.read("data/odid/flights/00012.jsonl")
    picture(browser, "flights", "#flights-title >> xpath=..")


def test_no_flight_records_yet(browse):
    browser = browse()
    browser.button("Show").click()
    browser.sees("#flights-said", "No flight is recorded yet")


# --- how it looks -------------------------------------------------------------------


def busy_page(appliance):
    """Everything that the page can show at once, with long texts."""
    long = "SSRSFABCDEFGHJKLMNPQ"
    status = recorded()
    status["identity"]["basic_ids"][0]["uas_id"] = long
    status["identity"]["basic_ids"].append({**status["identity"]["basic_ids"][0], "id_type": "registration",
                                            "uas_id": "SE-ABCDEFGHIJKLMNOPQ", "validity": "not checked"})
    appliance.daemon.status = status
    appliance.status(on_air=False, channels__bt4__state="lost",
                     channels__bt4__detail="h4:/dev/serial/by-id/usb-a-very-long-name-without-any-blank@115200",
                     problems=[problem(f"Basic ID is no valid serial: {long}"), problem("x" * 200, "y" * 200, "warning")])
    appliance.write("run/faults/data", "/data can't be mounted, and is being repaired. " * 4)
    appliance.update("installing", 40, 33, "Installing version 1.5.0-with-a-long-name.")
    appliance.last_update("refused", UNSIGNED, "1.5.0-with-a-long-name-of-a-version-0123456789")
    appliance.write("data/odid/flights/00012.jsonl", record())


@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("viewport", [{"width": 320, "height": 600}, PHONE, LAPTOP], ids=["320", "360", "1100"])
def test_everything_fits_and_can_be_read(browse, appliance, viewport, dark):
    busy_page(appliance)
    browser = browse(viewport=viewport, dark=dark)
    browser.button("Show").click()
    browser.sees("#flight-list", "Download")
    assert browser.width_needed() <= viewport["width"]
    faint = {text: contrast for text, contrast in browser.contrasts().items() if contrast < 4.5}
    assert faint == {}
    if dark and viewport == LAPTOP:
        appliance.daemon.status = recorded()
        (appliance.folder / "run/faults/data").unlink()
        appliance.update()
        browser.sees("#state-title", "^On the air$")
        picture(browser, "dark")


def test_everything_has_a_name_and_can_be_reached_by_keyboard(browse, appliance):
    browser = browse()
    browser.choose(bundle(appliance, 1000))
    browser.page.locator("#operator").fill("x")
    unnamed = browser.page.evaluate("""[...document.querySelectorAll("button, input, a, progress")]
        .filter((one) => one.checkVisibility() && !(one.innerText || (one.labels && one.labels.length)))
        .map((one) => one.outerHTML)""")
    assert unnamed == []
    reached, visible = [], []
    browser.page.locator("body").press("Tab")
    for _ in range(12):
        reached.append(browser.page.evaluate("document.activeElement.id || document.activeElement.innerText"))
        visible.append(browser.page.evaluate("getComputedStyle(document.activeElement).outlineStyle"))
        browser.page.keyboard.press("Tab")
    for wanted in ("leave", "operator", "serial", "Save", "bundle", "Install", "flights-show"):
        assert wanted in reached
        assert visible[reached.index(wanted)] != "none", wanted


def test_a_reader_is_told_of_a_change_and_not_of_each_second(browse, appliance):
    browser = browse()
    browser.page.evaluate("""() => { window.told = 0; new MutationObserver((changes) => { window.told += changes.length; })
        .observe(document.querySelector("#state [aria-live]"), { subtree: true, childList: true, characterData: true }); }""")
    for _ in range(2):
        browser.shows_another_answer()
    assert browser.page.evaluate("window.told") == 0
    appliance.status(on_air=False)
    browser.sees("#state-title", "Only partly")
    assert browser.page.evaluate("window.told") > 0


def test_the_password_is_not_in_the_page(browse):
    browser = browse()
    assert PASSWORD not in browser.page.content()
    assert browser.page.evaluate("document.cookie") == "" and browser.page.evaluate("localStorage.length") == 0
