"""A browser in front of the page: what a technician would do with it, and what is seen then."""

import re

from .appliance import PASSWORD

PHONE = {"width": 360, "height": 740}
LAPTOP = {"width": 1100, "height": 900}


class Browser:
    def __init__(self, chromium, appliance, viewport=PHONE, dark=False):
        self.appliance = appliance
        self.context = chromium.new_context(viewport=viewport, color_scheme="dark" if dark else "light")
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
        self.sees("#state-title", r"air|connected|Restarting")
        return self

    def sees(self, where, pattern, seconds=6):
        """Waits until the text of a place matches."""
        self.page.wait_for_function(
            "([where, pattern]) => { const place = document.querySelector(where);"
            " return place && place.checkVisibility() && new RegExp(pattern, 's').test(place.innerText); }",
            arg=[where, pattern], timeout=seconds * 1000)

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
