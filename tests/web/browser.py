"""A browser in front of the page: what a technician would do with it, and what is seen then."""

import re
import time

import patience

from .appliance import PASSWORD

PHONE = {"width": 360, "height": 740}
LAPTOP = {"width": 1100, "height": 900}
# What the progress said, each for a few seconds perhaps.
KEEP_LABELS = """addEventListener("DOMContentLoaded", () => {
  const label = document.querySelector("#progress-label");
  window.labels = [];
  if (label) new MutationObserver(() => { window.labels.push(label.textContent); })
    .observe(label, { subtree: true, childList: true, characterData: true });
});"""


class Browser:
    def __init__(self, chromium, appliance, viewport=PHONE, dark=False):
        self.appliance = appliance
        self.context = chromium.new_context(viewport=viewport, color_scheme="dark" if dark else "light")
        self.context.set_default_timeout(patience.LIMIT_S * 1000)
        self.context.add_init_script(KEEP_LABELS)
        self.page = self.context.new_page()
        self.asked = []                         # every address that was asked for
        self.errors = []                        # of the page's script, and what its policy forbade
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", self._console)
        self.page.goto(appliance.url)

    def _console(self, message):
        # The browser itself notes each answer that is a refusal, and each connection that is lost.
        if message.type == "error" and "Failed to load resource" not in message.text:
            self.errors.append(message.text)

    def button(self, name):
        return self.page.get_by_role("button", name=name, exact=True)

    def field(self, label):
        return self.page.get_by_label(label, exact=True)

    def section(self, title):
        return self.page.get_by_role("region", name=title, exact=True)

    def give_password(self, password=PASSWORD):
        self.field("Password").fill(password)
        self.button("Open").click()

    def login(self):
        self.give_password()
        self.waits("() => status && status.daemon")
        return self

    def waits(self, condition, argument=None):
        """Until a function's value in the page is true; an expression's, which the page's policy forbids, only once."""
        self.page.wait_for_function(condition, arg=argument)

    def sees(self, where, pattern, within_s=6):
        """Waits until the text of a place matches."""
        begun = time.monotonic()
        self.waits("([where, pattern]) => { const place = document.querySelector(where);"
                   " return place && place.checkVisibility() && new RegExp(pattern, 's').test(place.innerText); }",
                   [where, pattern])
        patience.promise(f"{where} to say {pattern}", time.monotonic() - begun, within_s)

    def has_seen(self, label):
        """Waits until the progress has said that, whatever it says now."""
        self.waits("(label) => labels.some((one) => one.includes(label))", label)

    def shows_another_answer(self):
        """Waits until the page has asked again how the appliance is, and shows it."""
        self.waits("(before) => heardAt > before", self.page.evaluate("heardAt"))

    def text(self, where):
        return self.page.locator(where).inner_text()

    def kind(self, where):
        return self.page.locator(where).get_attribute("data-kind")

    def choose(self, path):
        self.field("Update file (.swu)").set_input_files(path)

    def width_needed(self):
        return self.page.evaluate("document.documentElement.scrollWidth")

    def contrasts(self):
        """{text: contrast} of every visible text against what lies behind it (WCAG 2)."""
        return self.page.evaluate(CONTRASTS)

    def close(self):
        self.context.close()


def numbers(text):
    return [float(number) for number in re.findall(r"[\d.]+", text)]


CONTRASTS = """() => {
  const parse = (colour) => colour.match(/[\\d.]+/g).map(Number);
  const luminance = ([r, g, b]) => {
    const part = (c) => { c /= 255; return c <= 0.03928 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4; };
    return 0.2126 * part(r) + 0.7152 * part(g) + 0.0722 * part(b);
  };
  const behind = (element) => {
    for (; element; element = element.parentElement) {
      const colour = parse(getComputedStyle(element).backgroundColor);
      if (colour.length === 3 || colour[3] === 1) return colour;
    }
    return [255, 255, 255];
  };
  const found = {};
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement, text = walker.currentNode.textContent.trim();
    if (!text || !element.checkVisibility() || element.closest(":disabled")) continue;
    const pair = [parse(getComputedStyle(element).color), behind(element)].map(luminance).sort((a, b) => b - a);
    found[text] = (pair[0] + 0.05) / (pair[1] + 0.05);
  }
  return found;
}"""
