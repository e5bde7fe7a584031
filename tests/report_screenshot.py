#!/usr/bin/env python3
"""Opens a report in headless Chromium, tries its controls, and keeps screenshots.

    tests/report_screenshot.py REPORT.html FOLDER

Writes FOLDER/{390,1280,2560}-{light,dark}.png, and two of a zoomed page, and print.pdf, and fails on any console message of level
error, exception, network request, plot without ink, text wider than the page, or control
that does not do what it says. Needs Debian's `chromium` (or $CHROMIUM); no Python package.
"""

import base64
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

WIDTHS = {390: 844, 1280: 800, 2560: 1440}
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--hide-scrollbars", "--remote-debugging-pipe",
]
# Plots whose inside shows too few pixels of a colour: the grid, the marks and the page are grey.
PLOTS_WITHOUT_INK = """
[...document.querySelectorAll('.plot')].filter(plot => plot.checkVisibility()).filter(plot => {
  const canvas = plot.querySelector('canvas');
  if (!canvas || !canvas.width) return true;
  const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let ink = 0;
  // A map of a model without error is as grey as its zero: any cell counts there.
  const map = plot.closest('.heat') != null;
  for (let i = 0; i < data.length; i += 4) {
    const [r, g, b, a] = data.slice(i, i + 4);
    if (a > 100 && (map || Math.max(r, g, b) - Math.min(r, g, b) > 60)) ink++;
  }
  return ink < (map ? 2000 : 100);
}).map(plot => plot.getAttribute('aria-label'))
"""
# Rows with a short text broken into a letter or two a line: of its own height, for a cell is as tall as its row.
TALL = """[...document.querySelectorAll('tbody tr')].filter(r => r.checkVisibility()).filter(r => [...r.cells].some(c => {
  const text = document.createRange();
  text.selectNodeContents(c);
  const tall = text.getBoundingClientRect().height > 4.5 * parseFloat(getComputedStyle(c).lineHeight);
  return tall && c.textContent.length < 20 && c.clientWidth < 60;
})).map(r => r.textContent.slice(0, 40))
"""
WINDOW = "document.getElementById('window').textContent"


class Browser:
    """Chromium driven over its debugging pipe (file descriptors 3 and 4)."""

    def __init__(self, profile):
        to_read, self.to_browser = os.pipe()
        self.from_browser, to_write = os.pipe()

        def numbered():
            # Duplicated upwards first: one of the ends may itself be number 3 or 4.
            a, b = os.dup(to_read), os.dup(to_write)
            a, b = (os.dup(a), os.dup(b)) if min(a, b) < 5 else (a, b)
            os.dup2(a, 3)
            os.dup2(b, 4)

        self.process = subprocess.Popen(
            [os.environ.get("CHROMIUM", "chromium"), *FLAGS, f"--user-data-dir={profile}"],
            preexec_fn=numbered, close_fds=False,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_read)
        os.close(to_write)
        self.buffer, self.number, self.session, self.events = b"", 0, None, []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def message(self):
        while b"\0" not in self.buffer:
            part = os.read(self.from_browser, 1 << 20)
            if not part:
                sys.exit("chromium ended early")
            self.buffer += part
        text, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        request = {"id": self.number, "method": method, "params": params}
        if self.session:
            request["sessionId"] = self.session
        os.write(self.to_browser, json.dumps(request).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.number:
                if "error" in answer:
                    sys.exit(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.events.append(answer)

    def value(self, expression):
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        if "exceptionDetails" in answer:
            sys.exit(f"{expression}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    def close(self):
        self.call("Browser.close")
        self.process.wait(20)


def complaints(events):
    """What the console, the page or the network said that it should not."""
    for event in events:
        method, p = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = p["exceptionDetails"]
            yield details.get("exception", {}).get("description") or details["text"]
        elif method == "Runtime.consoleAPICalled" and p["type"] in ("error", "warning", "assert"):
            yield f"console: {p['args']}"
        elif method == "Log.entryAdded" and p["entry"]["level"] in ("error", "warning"):
            yield f"log: {p['entry']['text']}"
        elif method == "Network.requestWillBeSent":
            if not p["request"]["url"].startswith(("file:", "data:", "about:")):
                yield f"request: {p['request']['url']}"


def open_page(browser, page, width, theme):
    """Loads the page at a width and a theme; what is wrong with it."""
    browser.events = []
    browser.call("Emulation.setDeviceMetricsOverride", width=width, height=WIDTHS[width],
                 deviceScaleFactor=2 if width == 390 else 1, mobile=width == 390)
    browser.call("Emulation.setTouchEmulationEnabled", enabled=width == 390)
    browser.call("Emulation.setEmulatedMedia",
                 features=[{"name": "prefers-color-scheme", "value": theme}])
    browser.call("Page.navigate", url=page.resolve().as_uri())
    deadline = time.monotonic() + 20
    while browser.value("document.documentElement?.dataset.ready") != "yes":
        if time.monotonic() > deadline:
            return ["the page was not drawn in 20 s", *complaints(browser.events)]
        time.sleep(0.05)
    time.sleep(0.3)
    found = [f"no ink in: {plot}" for plot in browser.value(PLOTS_WITHOUT_INK)]
    if browser.value("document.documentElement.dataset.theme") != theme:
        found.append("the page does not follow the system's theme")
    if not int(browser.value("document.documentElement.dataset.charts")) > 0:
        found.append("the page has no plot")
    over = browser.value("document.documentElement.scrollWidth - innerWidth")
    if over > 0:
        found.append(f"the page is {over} px wider than the screen")
    if not browser.value("[...document.querySelectorAll('.bar nav a')].every(a => a.checkVisibility())"):
        found.append("the page's sections cannot be jumped to")
    found += [f"a short text over more than four lines: {row}" for row in browser.value(TALL)]
    return found


def shoot(browser, file):
    # Measured in CSS pixels; the page is scrolled to its top so that the bar stands there.
    browser.value("scrollTo(0, 0)")
    size = browser.call("Page.getLayoutMetrics")["cssContentSize"]
    clip = {"x": 0, "y": 0, "width": size["width"], "height": size["height"], "scale": 1}
    shot = browser.call("Page.captureScreenshot", format="png", captureBeyondViewport=True, clip=clip)
    file.write_bytes(base64.b64decode(shot["data"]))


def over_of(browser, index):
    """Left, top, width, height of the sensitive area of a plot over time, scrolled into view."""
    area = f"document.querySelectorAll('.panels .u-over')[{index}]"
    browser.value(f"{area}.scrollIntoView({{block: 'center'}})")
    time.sleep(0.1)
    return browser.value(f"(r => [r.left, r.top, r.width, r.height])({area}.getBoundingClientRect())")


def mouse(browser, kind, x, y, clicks=1):
    pressed = 1 if kind != "mouseReleased" else 0
    browser.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=pressed,
                 clickCount=clicks)


def window_after(browser, what):
    what()
    time.sleep(0.25)
    return browser.value(WINDOW)


def drag(browser, share_from, share_to):
    left, top, width, height = over_of(browser, 0)
    xs = [left + width * s for s in (share_from, (share_from + share_to) / 2, share_to)]
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=xs[0], y=top + height / 2)
    mouse(browser, "mousePressed", xs[0], top + height / 2)
    for x in xs[1:]:
        browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=top + height / 2,
                     button="left", buttons=1)
    mouse(browser, "mouseReleased", xs[2], top + height / 2)


def key(browser, name):
    for kind in ("keyDown", "keyUp"):
        text = {"text": name} if len(name) == 1 and kind == "keyDown" else {}
        browser.call("Input.dispatchKeyEvent", type=kind, key=name, **text)


# The title and the outputs of every legend: at a linked cursor each figure over time shows values.
READINGS = """[...document.querySelectorAll('.panels figure')].filter(f => f.checkVisibility())
  .map(f => [f.querySelector('h3').textContent, [...f.querySelectorAll('.legend button output')].map(o => o.textContent)])"""


def untimed(browser):
    """A page may have no plot over time; one that has must show its window."""
    if browser.value("document.querySelector('.panels .plot') == null"):
        return []
    return ["the plots over time show no window"]


def try_mouse_and_keys(browser, zoomed_shot):
    found = []
    whole = browser.value(WINDOW)
    if not whole:
        return untimed(browser)
    zoomed = window_after(browser, lambda: drag(browser, 0.25, 0.5))
    start, end = (float(t) for t in zoomed.removesuffix(" s").split(" to "))
    all_start, all_end = (float(t) for t in whole.removesuffix(" s").split(" to "))
    wanted = [all_start + s * (all_end - all_start) for s in (0.25, 0.5)]
    # The readout has one decimal, and a pixel at this width is about 0.05 s.
    if abs(start - wanted[0]) > 0.2 or abs(end - wanted[1]) > 0.2:
        found.append(f"dragging from a quarter to the middle of {whole} shows {zoomed}")
    if browser.value("document.getElementById('reset').disabled"):
        found.append("the reset button is not offered while zoomed")

    left, top, width, height = over_of(browser, 0)
    browser.call("Input.dispatchMouseEvent", type="mouseMoved", x=left + 0.4 * width, y=top + 0.5 * height)
    time.sleep(0.2)
    for title, values in browser.value(READINGS):
        if not values or not all(values):
            found.append(f"the linked cursor shows no value in: {title} {values}")
    shot = browser.call("Page.captureScreenshot", format="png")
    zoomed_shot.write_bytes(base64.b64decode(shot["data"]))

    def double():
        # On another plot than the one that was dragged across.
        last = browser.value("document.querySelectorAll('.panels .u-over').length - 1")
        left, top, width, height = over_of(browser, last)
        for clicks in (1, 2):
            mouse(browser, "mousePressed", left + width / 2, top + height / 2, clicks)
            mouse(browser, "mouseReleased", left + width / 2, top + height / 2, clicks)
    if window_after(browser, double) != whole:
        found.append("a double click does not reset the zoom")

    browser.value("document.querySelector('.panels .uplot').closest('.plot').focus()")
    if window_after(browser, lambda: key(browser, "+")) == whole:
        found.append("the plus key does not zoom")
    if window_after(browser, lambda: key(browser, "0")) != whole:
        found.append("the 0 key does not reset the zoom")

    click = "document.querySelector('button.zoom')?.click()"
    if browser.value("!!document.querySelector('button.zoom')"):
        if window_after(browser, lambda: browser.value(click)) == whole:
            found.append("selecting a target does not zoom to it")
        window_after(browser, lambda: browser.value("document.getElementById('reset').click()"))
    if browser.value(WINDOW) != whole:
        found.append("the reset button does not reset the zoom")
    theme = "document.documentElement.dataset.theme"
    before = browser.value(theme)
    browser.value("document.getElementById('theme').click()")
    if browser.value(theme) == before or browser.value(PLOTS_WITHOUT_INK):
        found.append("the theme button does not redraw the page in the other theme")
    return found + try_choices(browser) + try_readouts(browser)


def try_choices(browser):
    """Presses every button of every choice, and follows every link of the findings."""
    found = []
    # what is folded is tried, too
    browser.value("document.querySelectorAll('details').forEach(d => { d.open = true; })")
    seen = "[...document.querySelectorAll('.choice')].map(c => [...c.querySelectorAll(':scope > .option')].filter(o => o.checkVisibility()).map(o => o.dataset.option))"
    if any(len(options) != 1 for options in browser.value(seen)):
        found.append("a choice does not show exactly one alternative")
    buttons = browser.value("document.querySelectorAll('.options button').length")
    for i in range(buttons):
        name = browser.value(f"(b => (b.click(), b.dataset.option))(document.querySelectorAll('.options button')[{i}])")
        if not browser.value(f"document.querySelectorAll('.options button')[{i}].getAttribute('aria-pressed') === 'true'"):
            found.append(f"the button {name} does not stay pressed")
        if not any(name in options for options in browser.value(seen)):
            found.append(f"the button {name} shows nothing")
        found += [f"no ink after choosing {name} in: {plot}" for plot in browser.value(PLOTS_WITHOUT_INK)]
    for i in range(browser.value("document.querySelectorAll('a.show').length")):
        name = browser.value(f"(a => (a.click(), a.dataset.option))(document.querySelectorAll('a.show')[{i}])")
        if not any(name in options for options in browser.value(seen)):
            found.append(f"the link to {name} does not show it")
        time.sleep(0.05)
    return found


# Presses an arrow key on every plot that tells single values; those that then say nothing.
SILENT = """[...document.querySelectorAll('.intervals .plot, .heat .plot')].filter(p => p.checkVisibility()).filter(p => {
  p.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', bubbles: true, cancelable: true}));
  return !p.parentElement.querySelector('.readout').textContent;
}).map(p => p.getAttribute('aria-label'))"""


def try_readouts(browser):
    return [f"an arrow key reads nothing in: {plot}" for plot in browser.value(SILENT)]


def try_touch(browser):
    whole = browser.value(WINDOW)
    if not whole:
        return untimed(browser)

    def pinch():
        left, top, width, height = over_of(browser, 0)
        for kind, a, b in (("touchStart", 0.4, 0.6), ("touchMove", 0.3, 0.7),
                           ("touchMove", 0.2, 0.8), ("touchEnd", None, None)):
            points = [] if a is None else [
                {"x": left + s * width, "y": top + height / 2, "id": i} for i, s in enumerate((a, b))]
            browser.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)

    def double_tap():
        left, top, width, height = over_of(browser, 0)
        for _ in range(2):
            point = {"x": left + width / 2, "y": top + height / 2}
            browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[point])
            browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    found = []
    if window_after(browser, pinch) == whole:
        found.append("a pinch does not zoom")
    time.sleep(0.5)
    if window_after(browser, double_tap) != whole:
        found.append("a double tap does not reset the zoom")
    return found


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    page, folder = map(pathlib.Path, sys.argv[1:])
    folder.mkdir(parents=True, exist_ok=True)
    failures = []
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        browser = Browser(profile)
        for width in WIDTHS:
            for theme in ("light", "dark"):
                name = f"{width}-{theme}"
                found = open_page(browser, page, width, theme)
                shoot(browser, folder / f"{name}.png")
                if theme == "light" and width == 390:
                    found += try_touch(browser)
                elif theme == "light":
                    found += try_mouse_and_keys(browser, folder / f"{name}-zoomed.png")
                found += complaints(browser.events)
                failures += [f"{name}: {what}" for what in found]
        (folder / "print.pdf").write_bytes(base64.b64decode(
            browser.call("Page.printToPDF", printBackground=False)["data"]))
        browser.close()
    for failure in dict.fromkeys(failures):
        print(failure, file=sys.stderr)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
